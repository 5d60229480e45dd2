"""Carrying a bundle through the media and surfaces of a scene, one after the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from varcalc import engines
from varcalc.optics.beam import NOTHING, Arrival, Beam, RayStatus, at_surface
from varcalc.optics.hamilton import HamiltonRays
from varcalc.optics.media import Field, Medium
from varcalc.optics.straight import StraightRays
from varcalc.optics.surfaces import Geometry, Surface


class Model(Protocol):
    """How rays get from one surface to the next."""

    @property
    def name(self) -> str:
        """What to call it in an answer."""
        ...

    def advance(self, beam: Beam, limit: np.ndarray, leaving: int = NOTHING) -> Arrival:
        """Carry the rays to the first surface, or to the optical path ``limit`` (m,)."""
        ...


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
    extent : float
        The size of the scene.
    """

    media: Sequence[Medium]
    surfaces: Sequence[Surface]
    until: Surface | None
    dimension: int
    extent: float
    geometries: list[Geometry] = field(init=False)
    fields: list[Field] = field(init=False)
    models: list[Model] = field(init=False)
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
        self.models = [self._model(k) for k in range(len(self.media))]

    def _model(self, number: int) -> Model:
        """The cheapest model that treats medium ``number``."""
        medium = self.media[number]
        if medium.is_uniform:
            squared, _, _ = self.fields[number](np.zeros((1, self.dimension)))
            return StraightRays(float(squared[0]), self.geometries)
        return HamiltonRays(medium, self.dimension, self.geometries, self.extent, engines.default())

    @property
    def name(self) -> str:
        """The models in use."""
        return ", ".join(dict.fromkeys(model.name for model in self.models))

    def run(self, beam: Beam, limit: np.ndarray, starts_at_stop: np.ndarray) -> tuple[Beam, np.ndarray]:
        """The ends of the rays and their status; ``starts_at_stop`` (m,) marks rays that start on ``until``."""
        beam = beam.take(np.arange(len(beam)))
        status = np.full(len(beam), int(RayStatus.ARRIVED))
        struck = np.full(len(beam), NOTHING)
        for rows, leaving in ((np.flatnonzero(~starts_at_stop), NOTHING), (np.flatnonzero(starts_at_stop), self.stop)):
            struck[rows], status[rows] = self._leg(0, beam, rows, limit, leaving)
        for number, surface in enumerate(self.surfaces):
            status[self._strayed(struck, status, number)] = RayStatus.OUT_OF_ORDER
            shape = self.shapes[number]
            rows = np.flatnonzero((status == RayStatus.ARRIVED) & (struck == shape) & (struck != self.stop))
            if len(rows) == 0:
                break
            before, after = self.fields[number : number + 2]
            refracted, total = at_surface(beam.take(rows), self.geometries[shape], before, after, mirror=surface.mirror)
            beam.put(rows, refracted)
            status[rows[total]] = RayStatus.TOTAL_REFLECTION
            rows = rows[~total]
            struck[rows], status[rows] = self._leg(number + 1, beam, rows, limit, shape)
        status[self._strayed(struck, status, len(self.surfaces))] = RayStatus.OUT_OF_ORDER
        return beam, status

    def _leg(
        self, number: int, beam: Beam, rows: np.ndarray, limit: np.ndarray, leaving: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Carry ``rows`` of ``beam``, in place, through medium ``number`` to the first surface."""
        if len(rows) == 0:
            return np.zeros(0, dtype=int), np.zeros(0, dtype=int)
        arrival = self.models[number].advance(beam.take(rows), limit[rows], leaving)
        beam.put(rows, arrival.beam)
        return arrival.struck, arrival.status

    def _strayed(self, struck: np.ndarray, status: np.ndarray, number: int) -> np.ndarray:
        """True (m,) for rays in medium ``number`` that have come to a surface which is not the next one."""
        expected = self.shapes[number] if number < len(self.shapes) else NOTHING
        elsewhere = (struck != NOTHING) & (struck != self.stop) & (struck != expected)
        return elsewhere & (status == RayStatus.ARRIVED)


def _shape(surface: Surface) -> Surface:
    """The surface, whatever it does to light."""
    return replace(surface, mirror=False) if surface.mirror else surface  # pyright: ignore[reportArgumentType]
