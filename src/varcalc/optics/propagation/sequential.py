"""Sequential propagation: rays from medium to medium, through the surfaces of a scene in their order.

There is one loop, :meth:`Propagator.passages`. The ends of bundles, rays at the last medium, a single ray leg by leg
and the number of conjugate points are what is read off it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from varcalc import integrators
from varcalc.optics.media.medium import Field, Medium, Radial, Stratified, looking_up, switching
from varcalc.optics.models.hamilton import Hamilton, HamiltonRays
from varcalc.optics.models.invariants import Invariants
from varcalc.optics.models.jumps import layers_of
from varcalc.optics.models.linear import Linear
from varcalc.optics.models.model import Carrier, DoesNotApply, Model
from varcalc.optics.models.parabolas import Parabolas
from varcalc.optics.models.straight import Straight
from varcalc.optics.models.watch import UNWATCHED, Watch
from varcalc.optics.propagation.passing import PASSES, Encounter, followed_past, passing
from varcalc.optics.rays.beam import (
    AT_END,
    NOTHING,
    Arrival,
    Beam,
    RayStatus,
    Rows,
    at_surface,
    behind,
    caustics_between,
    headings,
    moved_on,
    stride,
)
from varcalc.optics.rays.leg import Leg
from varcalc.optics.surfaces import Geometry, Surface, touched
from varcalc.optics.validation import by_chunks

PLANE = 2
"""Dimensions in which what surfaces do to rays is noted."""
MOST_KEPT = 16
"""Ends of bundles for which compiled systems are kept."""
NOT_FOLLOWED = (RayStatus.SINGULAR, RayStatus.TOO_MANY_STEPS, RayStatus.INTERRUPTED)
"""Rays that end so cannot be followed a second time to where they ended."""
STEP_TO_END = 1e-12
"""Of the rest of a leg: a step so little shorter goes to its end."""
MOST_BENT = 0.5
"""Of their distance: what neighbours may be bent by over one step of those on which conjugate points are counted."""
LEAST_SHARE = 1e-6
"""Of a step by order of magnitude: the shortest that is tried."""
MOST_COUNT_STEPS = 4000
"""Steps along one leg on which conjugate points are counted."""
CHEAPEST_FIRST: tuple[Model, ...] = (Straight(), Linear(), Parabolas(), Hamilton())
"""The models tried where none is asked for, by what they cost for a bundle; the last applies everywhere."""
BY_PIECES: tuple[Model, ...] = (Straight(), Parabolas(), Invariants(), Hamilton())
"""The same where n² has kinks, jumps or knots of tables, which a step of an integration would go over."""


def carrier(model: Model | None, medium: Medium, dimension: int, surfaces: Sequence[Geometry]) -> Carrier:
    """``model``, or the cheapest that applies, at work in ``medium``; :class:`DoesNotApply` where it cannot be."""
    if model is not None:
        return model.carrier(medium, dimension, surfaces)
    reduced = isinstance(medium, Stratified | Radial)
    pieces = reduced and (switching(medium, dimension) or looking_up(medium, dimension))
    over = pieces and layers_of(medium, dimension) is None
    *cheaper, last = BY_PIECES if over else CHEAPEST_FIRST
    for candidate in cheaper:
        try:
            return candidate.carrier(medium, dimension, surfaces)
        except DoesNotApply:
            continue
    return last.carrier(medium, dimension, surfaces)


@dataclass(frozen=True)
class Noted(Rows):
    """What surfaces do to m rays of the plane: values, and last their derivatives by the launching angle.

    Not numbers where rays do not come so far. They are smooth between neighbours, and say where these part.

    Attributes
    ----------
    behind : ndarray, shape (m, surfaces, 2)
        The squares of the normal momenta behind each surface but mirrors, not above 0 where it turns rays back.
    passing : ndarray, shape (m, media, shapes, PASSES, 2)
        How far rays pass each shape in each medium, as :func:`varcalc.optics.propagation.passing.passing` has it.
    headings : ndarray, shape (m, surfaces, 2)
        The angles of the directions in which rays leave each surface.
    """

    behind: np.ndarray
    passing: np.ndarray
    headings: np.ndarray

    @property
    def smooth(self) -> np.ndarray:
        """What vanishes at edges, and its derivative: (2, m, surfaces, 1 + PASSES * shapes)."""
        passing = self.passing.reshape(*self.passing.shape[:2], PASSES * self.passing.shape[2], 2)
        return np.moveaxis(np.concatenate([self.behind[:, :, None], passing], axis=2), 3, 0)

    @classmethod
    def nothing(cls, rays: int, surfaces: int, shapes: int) -> Noted:
        """Of rays that have not started."""
        sizes = ((surfaces,), (surfaces, shapes, PASSES), (surfaces,))
        return cls(*(np.full((rays, *size, 2), np.nan) for size in sizes))


@dataclass
class UnderWay:
    """m rays on their way: where they are, the surface each has ``struck`` last, and how it ended or goes on.

    ``rows`` are those that come into the next medium, ``leaving`` (m,) the surfaces from which rays start, ``met`` (m,)
    how many surfaces of the scene they have come to.
    What is ``noted`` on the way of rays of the plane is so if it is wanted; they are ``followed`` past surfaces where
    no formula tells how they pass these.
    """

    beam: Beam
    struck: np.ndarray
    status: np.ndarray
    leaving: np.ndarray
    rows: np.ndarray
    met: np.ndarray
    noted: Noted | None = None
    followed: bool = True

    @classmethod
    def started(cls, beam: Beam, leaving: np.ndarray | int = NOTHING) -> UnderWay:
        """All rays of ``beam`` in the first medium."""
        arrived = np.full(len(beam), int(RayStatus.ARRIVED))
        nothing = np.full(len(beam), NOTHING)
        every = np.arange(len(beam))
        return cls(beam, nothing, arrived, np.broadcast_to(leaving, len(beam)), every, np.zeros(len(beam), dtype=int))

    @property
    def alive(self) -> np.ndarray:
        """True (m,) for the rays that come into the next medium."""
        alive = np.zeros(len(self.status), dtype=bool)
        alive[self.rows] = True
        return alive


@dataclass(frozen=True)
class MediumPassage:
    """The rays ``rows`` (k,) of a bundle in medium ``number``: where they enter it, and where they leave it or end."""

    number: int
    rows: np.ndarray
    entry: Beam
    exit: Beam


@dataclass
class Propagator:
    """Media and surfaces in the order in which rays meet them, and where rays may be stopped before.

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
        kept: dict[int, tuple[Field, Carrier]] = {}  # what is compiled for a medium that stands there twice is so once
        for medium in self.media:
            if id(medium) not in kept:
                model = carrier(self.model, medium, self.dimension, self.geometries)
                kept[id(medium)] = Field(medium, self.dimension), model
        self.fields, self.models = (
            list(both) for both in zip(*(kept[id(medium)] for medium in self.media), strict=True)
        )

    @cached_property
    def told_at_once(self) -> list[bool]:
        """In which media rays need not be followed past surfaces."""
        return [not followed_past(model, self.geometries) for model in self.models]

    @property
    def name(self) -> str:
        """The models in use."""
        return ", ".join(dict.fromkeys(model.name for model in self.models))

    def passages(
        self, rays: UnderWay, limit: np.ndarray, media: int | None = None, watch: Watch = UNWATCHED
    ) -> Iterator[MediumPassage]:
        """Carry ``rays``, in place, through the first ``media`` media, or all of them, and the surfaces behind them.

        They end at the optical path ``limit`` (m,), where there is one, at ``until``, or where their status says. A
        ``watch`` goes with them from one piece of a medium to the next.
        """
        for number in range(len(self.media) if media is None else media):
            rows, every = rays.rows, len(rays.rows) == len(rays.status)
            entry = rays.beam if every else rays.beam.take(rows)
            arrival = self._through(number, entry, limit[rows], rays.leaving[rows], watch)
            expected = self.shapes[number] if number < len(self.shapes) else NOTHING
            if rays.noted is not None and (rays.followed or self.told_at_once[number]):
                leaving = NOTHING if number == 0 else self.shapes[number - 1]
                met = Encounter(arrival.struck, arrival.beam.optical_path, expected)
                field, shapes = self.fields[number], self.geometries
                rays.noted.passing[rows, number] = passing(
                    self.models[number], field, shapes, entry, leaving, limit[rows], met
                )
            if every:
                rays.beam = arrival.beam
            else:
                rays.beam.put(rows, arrival.beam)
            strayed = (arrival.struck != NOTHING) & (arrival.struck != self.stop) & (arrival.struck != expected)
            strayed &= arrival.status == RayStatus.ARRIVED
            rays.struck[rows] = arrival.struck
            rays.status[rows] = np.where(strayed, int(RayStatus.OUT_OF_ORDER), arrival.status)
            if number < len(self.surfaces):
                self._cross(rays, number)
            yield MediumPassage(number, rows, entry, arrival.beam)

    def ends(
        self, beam: Beam, limit: np.ndarray, starts_at_stop: np.ndarray, watch: Watch = UNWATCHED
    ) -> tuple[Beam, np.ndarray]:
        """The ends of the rays and their status; ``starts_at_stop`` (m,) marks rays that start on ``until``.

        Those that come to the optical path ``limit`` (m,) before they come to ``until`` have missed it.
        """
        rays = UnderWay.started(beam, np.where(starts_at_stop, self.stop, NOTHING))
        for _ in self.passages(rays, limit, watch=watch):
            pass
        if self.until is not None:
            rays.status[(rays.status == RayStatus.ARRIVED) & (rays.struck != self.stop)] = RayStatus.MISSED
        return rays.beam, rays.status

    def into_medium(
        self, number: int, beam: Beam, limit: np.ndarray, watch: Watch = UNWATCHED, *, noted: bool = False,
        followed: bool = True,
    ) -> UnderWay:  # fmt: skip
        """The rays where they enter the medium of a ``number``, or end before; see :class:`UnderWay`."""
        rays = replace(UnderWay.started(beam), followed=followed)
        if noted and self.dimension == PLANE:
            rays.noted = Noted.nothing(len(beam), len(self.surfaces), len(self.geometries))
        for _ in self.passages(rays, limit, number, watch):
            pass
        return rays

    def followed(self, beam: Beam, path: float, watch: Watch = UNWATCHED) -> tuple[list[Leg], RayStatus]:
        """The legs of one ray, with its neighbours, up to the optical path ``path``; and how it ended."""
        rays = UnderWay.started(beam)
        legs = []
        for passage in self.passages(rays, np.full(1, path), watch=watch):
            if rays.status[0] not in NOT_FOLLOWED:
                model, end = self.models[passage.number], passage.exit.optical_path[0]
                legs.append(model.leg(passage.entry, float(end)))
            if len(rays.rows) == 0:
                break
        return legs, RayStatus(int(rays.status[0]))

    def through_all(self, beam: Beam, path: np.ndarray) -> tuple[list[MediumPassage], Beam, np.ndarray]:
        """The passages of rays to the optical paths ``path`` (m,) in the last medium, and their ends there.

        Last comes True (m,) for those that come so far, by the surfaces of the scene in their order.
        """
        rays = UnderWay.started(beam)
        passages = list(self.passages(rays, path))
        clear = np.zeros(len(beam), dtype=bool)
        clear[rays.rows] = (rays.status[rays.rows] == RayStatus.ARRIVED) & (rays.struck[rays.rows] == NOTHING)
        return passages, rays.beam, clear

    def conjugate_points(self, passages: Sequence[MediumPassage], path: np.ndarray, flat: np.ndarray) -> np.ndarray:
        """The number (m,) of conjugate points of rays inside their ``passages`` to optical paths ``path`` (m,).

        Where ``flat`` (m,) their ends are conjugate points themselves, which do not count.
        """
        count = np.zeros(len(path), dtype=int)
        for passage in passages:
            last = passage.number == len(self.models) - 1
            for part, entry, end in self._smooth_parts(passage):
                rows, back = passage.rows[part], np.zeros(len(part))
                if last:
                    at_end = flat[rows] & (end.optical_path >= path[rows] * (1 - AT_END))
                    back[at_end] = np.fmin(AT_END * path[rows], end.optical_path - entry.optical_path)[at_end]
                squared = np.where(back > 0, np.sum(end.momentum**2, axis=1), 1.0)
                before = moved_on(end, -back / squared, 0.0)
                count[rows] += self._caustics(passage.number, entry, end.optical_path, before)
        return count

    def _smooth_parts(self, passage: MediumPassage) -> Iterator[tuple[np.ndarray, Beam, Beam]]:
        """A passage in parts between jumps of the index: rows of it, and both ends of each.

        A ray that is thrown back at a jump has its neighbours on its other side from there on, and has met none.
        """
        model = self.models[passage.number]
        if isinstance(model, HamiltonRays):
            return model.smooth(passage.entry, passage.exit)
        return iter([(np.arange(len(passage.rows)), passage.entry, passage.exit)])

    def _caustics(self, number: int, beam: Beam, path: np.ndarray, end: Beam) -> np.ndarray:
        """How many conjugate points (m,) rays pass from ``beam`` to ``end``, at the optical paths ``path`` (m,)."""
        count, rows, share = np.zeros(len(beam), dtype=int), np.arange(len(beam)), np.ones(len(beam))
        for _ in range(MOST_COUNT_STEPS):
            left = path[rows] - beam.optical_path
            momentum = np.linalg.norm(beam.momentum, axis=1)
            length = left / np.maximum(momentum, np.finfo(float).tiny)
            step = stride(beam.position, beam.momentum, self.fields[number], length) * share
            last = step * momentum**2 >= left * (1 - STEP_TO_END)
            on = beam
            if not np.all(last):
                on = self.models[number].onward(beam, step, beam.optical_path + step * momentum**2)[0]
                last |= ~(on.optical_path < path[rows])
            if np.any(last):
                on = on.take(np.arange(len(on)))
                on.put(np.flatnonzero(last), end.take(rows[last]))
            taken = ~(bent(beam, on, step) & (share > LEAST_SHARE))
            count[rows[taken]] += caustics_between(beam, on)[taken]
            beam = beam.take(np.arange(len(beam)))
            beam.put(np.flatnonzero(taken), on.take(taken))
            share = np.where(taken, np.minimum(2 * share, 1.0), share / 4)
            keep = np.flatnonzero(~(last & taken))
            if len(keep) == 0:
                break
            rows, beam, share = rows[keep], beam.take(keep), share[keep]
        return count

    def _through(self, number: int, beam: Beam, limit: np.ndarray, leaving: np.ndarray, watch: Watch) -> Arrival:
        """Carry rays through medium ``number`` to the first surface, on all cores."""
        surfaces = np.unique(leaving)
        if len(surfaces) == 1:
            return self._spread(number, beam, limit, int(surfaces[0]), watch)
        empty = np.zeros(len(beam), dtype=int)
        whole = Arrival(beam.take(np.arange(len(beam))), empty, empty.copy())
        for surface in surfaces:
            rows = np.flatnonzero(leaving == surface)
            whole.put(rows, self._spread(number, beam.take(rows), limit[rows], int(surface), watch))
        return whole

    def _spread(self, number: int, beam: Beam, limit: np.ndarray, leaving: int, watch: Watch) -> Arrival:
        """The same for rays that all start from the surface ``leaving``, or from none."""
        parts: dict[int, Arrival] = {}
        model = self.models[number]

        def carry(part: slice) -> None:
            """Advance a part of the beam, into ``parts``."""
            if isinstance(model, HamiltonRays):
                parts[part.start] = model.advance(beam.take(part), limit[part], leaving, watch)
            else:
                parts[part.start] = model.advance(beam.take(part), limit[part], leaving)

        integrators.spread(carry, len(beam), watch.stoppable)
        return parts[0] if len(parts) == 1 else Arrival.joined([parts[first] for first in sorted(parts)])

    def _cross(self, rays: UnderWay, number: int) -> None:
        """Refract or reflect the rays that have come to surface ``number``, in place; they alone go on."""
        shape, rows = self.shapes[number], rays.rows
        here = (rays.status[rows] == RayStatus.ARRIVED) & (rays.struck[rows] == shape) & (shape != self.stop)
        rows = rows[here]
        rays.met[rows] += 1
        before, after = self.fields[number : number + 2]
        mirror = self.surfaces[number].mirror
        come = rays.beam.take(rows)
        if rays.noted is not None and not mirror:
            rays.noted.behind[rows, number] = np.stack(behind(come, self.geometries[shape], before, after), axis=1)
        refracted, total = at_surface(come, self.geometries[shape], before, after, mirror=mirror)
        if rays.noted is not None:
            rays.noted.headings[rows, number] = headings(refracted)
        if len(rows) == len(rays.status):
            rays.beam = refracted
        else:
            rays.beam = rays.beam.take(np.arange(len(rays.beam)))  # what was told of the passage stays as it is
            rays.beam.put(rows, refracted)
        rays.status[rows[total]] = RayStatus.TOTAL_REFLECTION
        with np.errstate(all="ignore"):
            unreal = ~total & (after.index(come.position) < 0)  # of which n² knows nothing
        rays.status[rows[unreal]] = RayStatus.SINGULAR
        rays.rows, rays.leaving = rows[~total & ~unreal], np.full(len(rays.status), shape)


def bent(before: Beam, after: Beam, step: np.ndarray) -> np.ndarray:
    """True (m,) where neighbours are bent over ``step`` (m,) so much that they may have crossed the ray, and come back.

    What turns them need not be seen from where a step begins: a lens in an all but uniform medium.
    """
    with np.errstate(invalid="ignore"):
        turned = np.linalg.norm(after.turned - before.turned, axis=(1, 2)) * step
        moved = np.maximum(*(np.linalg.norm(beam.moved, axis=(1, 2)) for beam in (before, after)))
        return turned > MOST_BENT * moved


def _shape(surface: Surface) -> Surface:
    """The surface, whatever it does to light."""
    return replace(surface, mirror=False) if surface.mirror else surface  # pyright: ignore[reportArgumentType]


@dataclass
class CompiledScene:
    """The media and surfaces of a scene in ``dimension`` dimensions, or either number; what is compiled is kept."""

    media: Sequence[Medium]
    surfaces: Sequence[Surface]
    dimension: int | None
    _kept: dict[tuple[Surface | None, int, Model | None], Propagator] = field(
        default_factory=dict, init=False, repr=False
    )

    def propagator(self, until: Surface | None, dimension: int, model: Model | None = None) -> Propagator:
        """What carries rays through the scene; what has been compiled for it is kept, for a number of ends."""
        key = until, dimension, model
        if key not in self._kept:
            if len(self._kept) >= MOST_KEPT:
                self._kept.pop(next(iter(self._kept)))
            self._kept[key] = Propagator(self.media, self.surfaces, until, dimension, model)
        return self._kept[key]

    def geometries(self, dimension: int) -> list[Geometry]:
        """Those of the surfaces, in the order of the scene."""
        propagator = self.propagator(None, dimension)
        return [propagator.geometries[shape] for shape in propagator.shapes]

    def touched(self, points: np.ndarray) -> list[np.ndarray]:
        """For each surface True (m,) for points (m, d) that are on it to round-off."""
        return [touched(geometry, points) for geometry in self.geometries(points.shape[1])]

    def index_at_source(self, start: np.ndarray) -> np.ndarray:
        """n (m,) where the rays start; ValueError where it is no positive number."""
        index = by_chunks(self.propagator(None, start.shape[1]).fields[0].index, start)
        bad = ~((index > 0) & np.isfinite(index))
        if np.any(bad):
            row = int(np.argmax(bad))
            raise ValueError(
                f"the index is {index[row]:g} at the source {tuple(start[row].tolist())}; rays start only "
                "where the index is a positive number"
            )
        return index
