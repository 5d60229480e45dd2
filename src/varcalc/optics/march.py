"""Carrying a bundle through the media and surfaces of a scene, one after the other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from varcalc import integrators
from varcalc.optics.beam import NOTHING, Beam, RayStatus, at_surface
from varcalc.optics.media import Field, Medium
from varcalc.optics.model import Carrier, Model
from varcalc.optics.models import carrier
from varcalc.optics.surfaces import Geometry, Surface


@dataclass
class March:
    """The way through a scene: medium, surface, medium, ..., and where it may be cut short.

    Parameters
    ----------
    media : sequence of Medium
        One more than there are surfaces.
    surfaces : sequence of Surface
        In the order in which rays meet them.
    until : Surface or None
        Where rays stop, wherever they are on their way.
    dimension : int
    model : Model or None
        The one that carries the rays; the cheapest in each medium where it is None.
    """

    media: Sequence[Medium]
    surfaces: Sequence[Surface]
    until: Surface | None
    dimension: int
    model: Model | None = None
    geometries: list[Geometry] = field(init=False)
    fields: list[Field] = field(init=False)
    models: list[Carrier] = field(init=False)
    shapes: list[int] = field(init=False)
    stop: int = field(init=False, default=NOTHING)

    def __post_init__(self) -> None:
        # A surface may stand in the scene more than once: what a ray meets is a shape.
        shapes = list(dict.fromkeys(_shape(surface) for surface in self.surfaces))
        self.shapes = [shapes.index(_shape(surface)) for surface in self.surfaces]
        if self.until is not None:
            shapes = list(dict.fromkeys([*shapes, _shape(self.until)]))
            self.stop = shapes.index(_shape(self.until))
        self.geometries = [Geometry(shape, self.dimension) for shape in shapes]
        self.fields = [Field(medium, self.dimension) for medium in self.media]
        self.models = [carrier(self.model, medium, self.dimension, self.geometries) for medium in self.media]

    @property
    def name(self) -> str:
        """The models in use."""
        return ", ".join(dict.fromkeys(model.name for model in self.models))

    def run(self, beam: Beam, limit: np.ndarray, starts_at_stop: np.ndarray) -> tuple[Beam, np.ndarray]:
        """The ends of the rays and their status; ``starts_at_stop`` (m,) marks rays that start on ``until``."""
        beam, struck, status, alive = self._to_last_medium(beam, limit, starts_at_stop)
        if self.surfaces:
            struck[alive], status[alive] = self._leg(len(self.surfaces), beam, alive, limit, self.shapes[-1])
        status[self._strayed(struck, status, len(self.surfaces))] = RayStatus.OUT_OF_ORDER
        return beam, status

    def to_last_medium(self, beam: Beam, limit: np.ndarray) -> tuple[Beam, np.ndarray, np.ndarray]:
        """The rays where they enter the last medium, their status, and True (m,) for those which do."""
        if not self.surfaces:
            return beam, np.full(len(beam), int(RayStatus.ARRIVED)), np.ones(len(beam), dtype=bool)
        beam, _, status, rows = self._to_last_medium(beam, limit, np.zeros(len(beam), dtype=bool))
        return beam, status, np.isin(np.arange(len(beam)), rows)

    def parts(self, beam: Beam, path: np.ndarray) -> Iterator[tuple[int, Beam, Beam, np.ndarray]]:
        """Carry rays to optical paths ``path`` (m,) in the last medium, medium by medium.

        For each its number, the rays where they enter it and where they leave it or end, and True (m,) for those
        that have met the next surface and no other: in the last medium, none.
        """
        for number, model in enumerate(self.models):
            arrival = model.advance(beam, path, self.shapes[number - 1] if number else NOTHING)
            expected = self.shapes[number] if number < len(self.shapes) else NOTHING
            yield number, beam, arrival.beam, (arrival.struck == expected) & (arrival.status == RayStatus.ARRIVED)
            if number < len(self.shapes):
                beam, _ = self.refracted(number, arrival.beam)

    def to_path(self, beam: Beam, path: np.ndarray) -> tuple[Beam, np.ndarray]:
        """The rays at the optical paths ``path`` (m,) in the last medium, and True (m,) for those that come there."""
        clear = np.ones(len(beam), dtype=bool)
        for _, _, end, sound in self.parts(beam, path):
            beam, clear = end, clear & sound
        return beam, clear

    def refracted(self, number: int, beam: Beam) -> tuple[Beam, np.ndarray]:
        """Rays on surface ``number`` as they leave it, and True (m,) where they are totally reflected."""
        before, after = self.fields[number : number + 2]
        mirror = self.surfaces[number].mirror
        return at_surface(beam, self.geometries[self.shapes[number]], before, after, mirror=mirror)

    def _to_last_medium(
        self, beam: Beam, limit: np.ndarray, starts_at_stop: np.ndarray
    ) -> tuple[Beam, np.ndarray, np.ndarray, np.ndarray]:
        """A copy of the rays, what they have struck, their status, and the rows of those in the last medium.

        Without surfaces the first medium is the last, and they are carried through it.
        """
        beam = beam.take(np.arange(len(beam)))
        status = np.full(len(beam), int(RayStatus.ARRIVED))
        struck = np.full(len(beam), NOTHING)
        for alive, leaving in ((np.flatnonzero(~starts_at_stop), NOTHING), (np.flatnonzero(starts_at_stop), self.stop)):
            struck[alive], status[alive] = self._leg(0, beam, alive, limit, leaving)
        alive = np.arange(len(beam))
        for number, shape in enumerate(self.shapes):
            if number:
                struck[alive], status[alive] = self._leg(number, beam, alive, limit, self.shapes[number - 1])
            status[self._strayed(struck, status, number)] = RayStatus.OUT_OF_ORDER
            alive = alive[(status == RayStatus.ARRIVED)[alive] & (struck == shape)[alive] & (shape != self.stop)]
            refracted, total = self.refracted(number, beam.take(alive))
            beam.put(alive, refracted)
            status[alive[total]] = RayStatus.TOTAL_REFLECTION
            alive = alive[~total]
        return beam, struck, status, alive

    def _leg(
        self, number: int, beam: Beam, rows: np.ndarray, limit: np.ndarray, leaving: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Carry ``rows`` of ``beam``, in place, through medium ``number`` to the first surface."""
        struck, status = np.empty(len(rows), dtype=int), np.empty(len(rows), dtype=int)

        def carry(part: slice) -> None:
            own = rows[part]
            arrival = self.models[number].advance(beam.take(own), limit[own], leaving)
            beam.put(own, arrival.beam)
            struck[part], status[part] = arrival.struck, arrival.status

        integrators.spread(carry, len(rows))
        return struck, status

    def _strayed(self, struck: np.ndarray, status: np.ndarray, number: int) -> np.ndarray:
        """True (m,) for rays in medium ``number`` that have come to a surface which is not the next one."""
        expected = self.shapes[number] if number < len(self.shapes) else NOTHING
        elsewhere = (struck != NOTHING) & (struck != self.stop) & (struck != expected)
        return elsewhere & (status == RayStatus.ARRIVED)


def _shape(surface: Surface) -> Surface:
    """The surface, whatever it does to light."""
    return replace(surface, mirror=False) if surface.mirror else surface  # pyright: ignore[reportArgumentType]
