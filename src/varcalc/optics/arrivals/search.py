"""All rays of many pairs of points: which search finds them, and which model carries them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from varcalc.numerics.roots import EPSILON
from varcalc.optics.arrivals.fan import Fan, FanReach
from varcalc.optics.arrivals.narrow import NarrowSearch
from varcalc.optics.arrivals.newton import ANGLE_ROUND_OFF, KNOWN_ALIKE
from varcalc.optics.arrivals.sections import PlaneSection
from varcalc.optics.arrivals.space import SpaceSearch
from varcalc.optics.arrivals.space_fan import SpaceFan, SpaceReach
from varcalc.optics.arrivals.wavefront_construction import Arrivals, PlanePairs, WavefrontConstruction
from varcalc.optics.media.medium import Graded, Radial, Stratified, as_layers, as_shells, as_tilted_layers
from varcalc.optics.media.tabulated import Tabulated
from varcalc.optics.models.aimed import CARRIED_WELL, Carry, Told
from varcalc.optics.models.constant_pull import ConstantPull
from varcalc.optics.models.hamilton import HamiltonRays
from varcalc.optics.models.invariants import Invariants
from varcalc.optics.models.jumps import placed
from varcalc.optics.models.linear import is_linear
from varcalc.optics.models.model import Builder, Model, Question, checked_model
from varcalc.optics.models.quadratic_index import QuadraticIndex
from varcalc.optics.models.range_function import RangeFunction
from varcalc.optics.propagation.sequential import CompiledScene, Propagator
from varcalc.optics.rays.beam import Beam, RayStatus, Rows, launched, spreading
from varcalc.optics.rays.leg import Leg
from varcalc.optics.rays.ray import SHADOW, FoundTogether, Ray, Rays, no_rays
from varcalc.optics.surfaces import Sphere
from varcalc.optics.validation import matched, numbers, rows
from varcalc.progress import Interrupted, Progress, Stage, telling

FLAT_SPREADING = 1e-9
"""A spreading so small beside that of a uniform medium is that of a conjugate point."""
PAIRS_TOGETHER = 4096
"""Pairs of points searched for together."""
BESIDE_LINE = 1e-6
"""Of its heading: a ray leaves the line through both points."""
BESIDE_FOCUS = 1e-4
"""Headings of rays that may be one, seen twice where many come together."""
MEETS = 1e-7
"""Of the distance of two points: a ray that ends farther from the second when it is carried anew is none of theirs."""
USUAL_RANGE = 5.0
"""Rays are looked for up to so many times the optical length of the scene."""
DIM = 1e-2
"""Of the index at the source: steps along rays that come where it is less become small without end."""
STOPPED = "stopped before its end"
"""What is said of a search that was."""
FARTHEST_SCALE, FARTHEST_KNOWN_SCALE = 1e3, 1e9
"""Of the distance of two points: a medium that varies over more is uniform to a fan, as the tail of a lens is; and to
what knows all rays of a medium."""


Complete = ConstantPull | QuadraticIndex | RangeFunction
"""What knows all rays of a medium, and passes over none."""


@dataclass(frozen=True)
class PointPairs(Rows):
    """k pairs of points: sources and targets (k, d), and ``within`` (k,), the largest optical paths of their rays.

    The planes that hold the rays go through ``origin`` (k, d) along ``axes`` (k, 2, d); (k, 0, d) where none does.
    Those that are ``turning`` (k,) are any about the line through both points.
    """

    sources: np.ndarray
    targets: np.ndarray
    within: np.ndarray
    origin: np.ndarray
    axes: np.ndarray
    turning: np.ndarray

    @property
    def in_planes(self) -> bool:
        """Whether planes hold the rays."""
        return self.axes.shape[1] > 0


@dataclass(frozen=True)
class _ToldRays:
    """Rays between the ``ends`` of which all is ``known`` but how they spread, which is asked of all together, once.

    ``full`` carries them, or what the ``other`` way has those that are ``careful`` (k,) or miss their targets.
    """

    full: Propagator
    other: Callable[[], TwoPoint]
    ends: PointPairs
    known: Told
    careful: np.ndarray

    def rays(self) -> list[Ray]:
        """One object each."""
        known, full = self.known, self.full
        none = np.zeros(len(known), dtype=bool)
        together = FoundTogether(
            known.counts, none, known.headings, known.arriving, full.name, self._spread, self._followed, full.media,
            full.surfaces,
        )  # fmt: skip
        return together.rays(known.paths, known.errors)

    def _spread(self, k: int) -> float:
        """How one ray spreads."""
        return float(self._spreads[k])

    @cached_property
    def _spreads(self) -> np.ndarray:
        """How all rays spread (k,)."""
        out, off = np.empty(len(self.known)), np.where(self.careful, np.inf, 0.0)
        rows = np.flatnonzero(~self.careful)
        if len(rows):
            out[rows], off[rows] = self._carried(self.full, rows)
        rows = np.flatnonzero(off > CARRIED_WELL)
        if len(rows):
            out[rows], off[rows] = self._carried(self.other().full, rows)
        return np.where((off > MEETS) & np.isfinite(self.known.spreads), self.known.spreads, out)

    def _carried(self, full: Propagator, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How some rays spread, and how far off their targets they come, of the way between the points."""
        end, some = full.through_all(self._started(rows), self.known.paths[rows])[1], self.ends.take(rows)
        off, apart = (np.linalg.norm(p - some.targets, axis=1) for p in (end.position, some.sources))
        return spreading(end), np.nan_to_num(off / apart, nan=np.inf)

    def _started(self, rows: np.ndarray) -> Beam:
        """The rays of some rows at their sources, with their neighbours."""
        some = self.ends.take(rows)
        index = self.full.fields[0].index(some.sources)
        return launched(some.sources, self.known.headings[rows], index, neighbours=True)

    def _followed(self, k: int) -> Sequence[Leg]:
        """The legs of one ray; none where it does not come to its target."""
        full = self.other().full if self.careful[k] else self.full
        source, target = self.ends.sources[k], self.ends.targets[k]
        try:
            legs = full.followed(self._started(np.array([k])), float(self.known.paths[k]))[0]
        except ArithmeticError:  # beside rays that rest it goes out of all bounds
            return ()
        ends_at = [leg.at(np.array([leg.length])).position[0] for leg in legs[-1:]]  # one that was lost has no leg
        met = [np.linalg.norm(end - target) <= MEETS * np.linalg.norm(target - source) for end in ends_at]
        return legs if all(met) else ()


@dataclass
class TwoPoint:
    """The rays between points of one scene; what is compiled is kept.

    ``planar`` is the scene in the plane of the search, ``full`` the scene itself; in the plane they are the same.
    """

    planar: Propagator
    full: Propagator

    @cached_property
    def narrow(self) -> NarrowSearch:
        """What is narrow in the last medium."""
        return NarrowSearch(self.planar)

    @cached_property
    def over_knots(self) -> bool:
        """Whether rays are carried over knots of tables."""
        return any(isinstance(model, HamiltonRays) and model.steps_over_knots for model in self.full.models)

    def one_at_most(self, ends: PointPairs) -> np.ndarray:
        """True (k,) for pairs that see mirrors alone, each convex to them, in one uniform medium.

        The length is convex in points of the balls (Boyd and Vandenberghe, "Convex Optimization", sect. 5.5.3), and a
        ray is a least one, with one multiplier above 0 for each mirror: on a sphere there is one such point.
        """
        surfaces = self.full.surfaces
        balls = all(isinstance(one, Sphere) and one.mirror for one in surfaces)
        if not (surfaces and balls and self.full.media[0].is_uniform):
            return np.zeros(len(ends), dtype=bool)
        levels = [one.level(p) for one in self.full.geometries for p in (ends.sources, ends.targets)]
        return np.min(levels, axis=0) > 0

    def found(self, pairs: PointPairs, stage: Stage) -> list[Rays]:
        """All rays of each pair, in the planes that hold them or over all directions of space.

        How many pairs are done is told, and what is being done.
        """
        if pairs.in_planes:
            return self._in_planes(pairs, stage)
        _, source = np.unique(pairs.sources, axis=0, return_inverse=True)
        answers: dict[int, Rays] = {}
        for number in range(int(source.max(initial=-1)) + 1):
            if stage.stopped:
                break
            rows = np.flatnonzero(source.ravel() == number)
            own = self._in_space(pairs.take(rows), stage.later(len(answers)))
            answers |= dict(zip(rows.tolist(), own, strict=True))
        return [answers[k] if k in answers else _not_begun() for k in range(len(pairs))]

    def _in_planes(self, ends: PointPairs, stage: Stage) -> list[Rays]:
        """See :meth:`found`."""
        flat = [np.einsum("kad,kd->ka", ends.axes, points - ends.origin) for points in (ends.sources, ends.targets)]
        distance = np.linalg.norm(ends.targets - ends.sources, axis=1)
        far = np.maximum(ends.within / self._largest_index(ends), 2 * distance)
        origins, source = np.unique(flat[0], axis=0, return_inverse=True)
        source = source.ravel()
        bounds = _bounds(source, flat[1], ends.within, far, distance)
        aimed, given_up, said = self.narrow.aimed(origins, bounds, stage)
        fan = Fan(self.planar, origins, bounds, aimed, stage)
        fan.given_up += given_up
        found = WavefrontConstruction(fan, PlanePairs(source, flat[1], ends.within, distance)).run(stage)
        rays = self._rays(ends, found)
        found.unresolved[self.one_at_most(ends) & [len(own) == 1 for own in rays]] = 0
        searched = f"all directions of the plane ({fan.looked_at} looked at, %d narrow cells left unresolved"
        searched += f"{fan.resolution}{said}), "
        searched += f"optical paths up to %.6g, no farther than %.6g from B{f'; {STOPPED}' if stage.stopped else ''}"
        notes = [searched % note for note in zip(found.unresolved, ends.within, far, strict=True)]
        return [
            _told(rays[k], fan.ends, fan.entered, notes[k], bool(found.continuum[k]), int(found.unresolved[k]))
            for k in range(len(ends))
        ]

    def _largest_index(self, ends: PointPairs) -> np.ndarray:
        """The larger index (k,) of both ends."""
        first, last = self.full.fields[0].index(ends.sources), self.full.fields[-1].index(ends.targets)
        return np.maximum(first, last)

    def _rays(self, ends: PointPairs, found: Arrivals) -> list[list[Ray]]:
        """The rays found, pair by pair."""
        aims = found.meeting.aims
        turned = np.column_stack([np.cos(aims.angle), np.sin(aims.angle)])
        heading = np.einsum("ma,mad->md", turned, ends.axes[aims.pair])
        # where the plane may be turned about the line of both points, a ray stands for all that it is turned into
        rows = np.flatnonzero(_off_line(ends.take(aims.pair), heading) >= -BESIDE_LINE)
        pair, heading, touching = aims.pair[rows], heading[rows], found.touching[rows]
        built = self.built(ends.take(pair), heading, found.meeting.state[rows, 4], touching)
        rays: list[list[Ray]] = [[] for _ in range(len(ends))]
        for k, (ray, miss) in zip(pair, built, strict=True):
            if ray is not None and miss > MEETS:
                found.unresolved[k] += 1
            elif ray is not None and _told_apart(ray, rays[k]):
                rays[k].append(ray)
        for k in np.flatnonzero(ends.turning):
            headings = np.array([ray.tangents[0] for ray in rays[k]]).reshape(-1, ends.sources.shape[1])
            found.continuum[k] |= np.any(_off_line(ends.take(np.full(len(headings), k)), headings) > BESIDE_LINE)
        return rays

    def built(
        self, ends: PointPairs, headings: np.ndarray, path: np.ndarray, touching: np.ndarray,
        counts: np.ndarray | None = None,
    ) -> list[tuple[Ray | None, float]]:  # fmt: skip
        """The rays that leave the sources along unit ``headings`` (k, d), to the optical paths ``path`` (k,).

        ``touching`` (k,) says that a ray is known to touch a caustic at its target, ``counts`` (k,) how many conjugate
        points are inside, -1 where that is not known. With every ray comes how far from its target it ends, relative to
        the distance of the pair; there is no ray where surfaces are not met in the order of the scene.
        """
        if len(headings) == 0:
            return []
        index = self.full.fields[0].index(ends.sources)
        beam = launched(ends.sources, headings, index, neighbours=True)
        passages, end, clear = self.full.through_all(beam, path)
        d, momentum = beam.dimension, np.linalg.norm(end.momentum, axis=1)
        away = ends.targets - end.position
        along, spread = np.sum(end.momentum * away, axis=1), spreading(end)
        flat = touching | (spread <= FLAT_SPREADING * (path / index**2) ** (d - 1))
        count = np.full(len(path), -1) if counts is None else counts
        if np.any(count < 0):
            count = np.where(count < 0, self.full.conjugate_points(passages, path, flat), count)
        with np.errstate(divide="ignore"):
            squared = np.where(flat, 0.0, np.sum(away**2, axis=1) * index**2 / spread)  # the path is stationary
        error = np.abs(along) + squared + 16 * EPSILON * path
        apart = np.linalg.norm(ends.targets - ends.sources, axis=1)
        known = np.fmin(ANGLE_ROUND_OFF * spread ** (1 / (d - 1)), KNOWN_ALIKE * apart)  # no better are headings told
        miss = np.maximum(np.linalg.norm(away, axis=1) - known, 0.0) / apart

        def followed(k: int) -> Sequence[Leg]:
            return self.full.followed(beam.take(np.array([k])), float(path[k]))[0]

        together = FoundTogether(
            count, flat, headings, end.momentum / momentum[:, None], self.full.name, spread.item, followed,
            self.full.media, self.full.surfaces,
        )  # fmt: skip
        rays = together.rays(end.optical_path + along, error)
        return [
            (ray, off) if arrived else (None, np.inf)
            for ray, off, arrived in zip(rays, miss.tolist(), clear.tolist(), strict=True)
        ]

    def told(self, ends: PointPairs, known: Told, careful: np.ndarray, other: Callable[[], TwoPoint]) -> list[Ray]:
        """The rays of which all is known but how they spread.

        The ``careful`` ones (k,) are carried the ``other`` way, and those that miss their targets otherwise.
        """
        return _ToldRays(self.full, other, ends, known, careful).rays()

    def _in_space(self, ends: PointPairs, stage: Stage) -> list[Rays]:
        """All rays of pairs with one source, over all directions of space."""
        distance = np.linalg.norm(ends.targets - ends.sources, axis=1)
        far = np.maximum(ends.within / self._largest_index(ends), 2 * distance)
        bounds = _bounds(np.zeros(len(ends), dtype=int), ends.targets, ends.within, far, distance)
        reach = SpaceReach(*(values[0] for values in vars(bounds).values()))
        fan = SpaceFan(self.full, ends.sources[0], reach, len(ends), stage)
        searches = [SpaceSearch(fan, target, float(d)) for target, d in zip(ends.targets, distance, strict=True)]
        with stage.stoppable():
            stage(0, "laying out rays")
            for cells in fan.cells():
                for one in searches:
                    one.take_in(fan.held(cells, one.target), stage)
                if all(one.given_up for one in searches):
                    break
        answers, one_at_most = [], self.one_at_most(ends)
        for k, one in enumerate(searches):
            met = one.met
            met = met.take(np.flatnonzero(met.path <= ends.within[k]))
            every = np.zeros(len(met), dtype=int)
            built = self.built(ends.take(every + k), met.heading, met.path, met.touching)
            rays = [ray for ray, miss in built if ray is not None and miss <= MEETS]
            unresolved = one.unresolved + int(fan.given_up) + int(fan.unlit) + int(stage.stopped)
            unresolved += sum(ray is not None and miss > MEETS for ray, miss in built)
            unresolved = 0 if one_at_most[k] and len(rays) == 1 else unresolved
            searched = (
                f"all directions of space ({fan.looked_at} looked at, {unresolved} "
                f"narrow cells left unresolved{', ' if fan.resolution else ''}{fan.resolution}), "
                f"optical paths up to {ends.within[k]:.6g}, no farther than {far[k]:.6g} from B"
            )
            if fan.unlit:
                searched += f"; none of them comes to surface {fan.farthest}, to which narrower windows may lead"
            searched += _incomplete(one, stage)
            answers.append(_told(rays, fan.ends, fan.entered, searched, one.continuum, unresolved))
        return answers


def _unreachable(target: np.ndarray, n: float, squared: float) -> Rays:
    """The answer of a pair whose target has no index, or one at which rays are not followed to their ends."""
    place = f"B = ({', '.join(f'{x:.6g}' for x in target)})"
    if n == 0 or np.isinf(n):
        level, only = ("0", "only come to rest") if n == 0 else ("infinite", "end")
        reason = f"the index is {level} at {place}, where rays may {only}: none such is looked for"
        return Rays((), reason, f"the index at B, which is {level}", unresolved=1)
    told = f"the index is {n:.6g}" if n < 0 else f"n² is {squared:.6g}" if squared < 0 else "the index is no number"
    return Rays((), f"{place} is dark: {told} there, so that no ray comes to it", f"the index at B, where {told}")


def _not_begun() -> Rays:
    """The answer of a pair that was not come to."""
    return Rays((), f"the search was {STOPPED}", "nothing", unresolved=1)


def _incomplete(one: SpaceSearch, stage: Stage) -> str:
    """What is said of a search in space that was not brought to its end."""
    if one.given_up:
        return f"; not all of them from {one.complete:.6g} on, where there were too many cells to look into"
    return f"; {STOPPED}" if stage.stopped else ""


def _bounds(
    source: np.ndarray, targets: np.ndarray, within: np.ndarray, far: np.ndarray, distance: np.ndarray
) -> FanReach:
    """How far the rays of each source are followed for all of its targets (k, 2)."""
    n = int(source.max()) + 1

    def gathered(ufunc: np.ufunc, values: np.ndarray, start: float) -> np.ndarray:
        """What a ufunc makes of the values of each source, and of ``start``."""
        out = np.full((n, *values.shape[1:]), start)
        ufunc.at(out, source, values)
        return out

    middle = (gathered(np.minimum, targets, np.inf) + gathered(np.maximum, targets, -np.inf)) / 2
    reach = gathered(np.maximum, np.linalg.norm(targets - middle[source], axis=1), 0.0)
    size = np.maximum(reach, gathered(np.minimum, distance, np.inf))
    return FanReach(gathered(np.maximum, within, 0.0), gathered(np.maximum, far, 0.0) + reach, middle, reach, size)


def _told(
    rays: list[Ray], ends: Counter[RayStatus], entered: int, searched: str, continuum: bool = False, unresolved: int = 0
) -> Rays:
    """The rays of one pair, or why there is none."""
    if rays:
        return Rays(tuple(sorted(rays, key=lambda ray: ray.optical_path)), "", searched, continuum, unresolved)
    if entered:
        reason = SHADOW
    elif ends[RayStatus.TOTAL_REFLECTION]:
        reason = "total reflection: no ray gets through the surfaces"
    else:
        reason = "blocked: no ray meets the surfaces in the order of the scene"
    return no_rays(reason, searched, unresolved)


def _over_knots(rays: Rays) -> Rays:
    """The same, and that rays were carried over the knots of tables, where they may part."""
    said = f"{rays.searched}; steps went over the knots of tables, beside which rays may part"
    return replace(rays, searched=said, unresolved=rays.unresolved + 1)


def _off_line(ends: PointPairs, headings: np.ndarray) -> np.ndarray:
    """How far (m,) rays along unit ``headings`` (m, d) leave the lines of pairs (m,) whose planes may be turned.

    It is negative on one side, and none where the planes may not be turned.
    """
    if not np.any(ends.turning):
        return np.zeros(len(headings))
    along, across = np.einsum("mad,md->am", ends.axes, ends.targets - ends.sources)
    side = along[:, None] * ends.axes[:, 1] - across[:, None] * ends.axes[:, 0]
    off = np.sum(headings * side, axis=1) / np.hypot(along, across)
    return np.where(ends.turning, off, 0.0)


def _told_apart(ray: Ray, others: list[Ray]) -> bool:
    """Whether a ray that ends on a caustic is none of others: beside a focus directions are known far worse than paths.

    Those are left out of the others that are known worse.
    """
    for other in others if ray.degenerate else []:
        near = np.linalg.norm(ray.tangents[0] - other.tangents[0]) <= BESIDE_FOCUS
        if near and other.degenerate and abs(ray.optical_path - other.optical_path) <= ray.error + other.error:
            if ray.error >= other.error:
                return False
            others.remove(other)
            return True
    return True


@dataclass
class PairSearch:
    """The search for the rays of pairs of points in one scene; what is compiled is kept."""

    compiled: CompiledScene
    _problems: dict[tuple[int, bool, Model | None], TwoPoint] = field(default_factory=dict, init=False, repr=False)
    _complete: dict[int, ConstantPull | QuadraticIndex | RangeFunction | None] = field(
        default_factory=dict, init=False, repr=False
    )
    _layers: dict[int, PairSearch | None] = field(default_factory=dict, init=False, repr=False)

    def arrivals(
        self, source: str, A: Any, receiver: str, B: Any, within: Any, model: Any, progress: Progress = False
    ) -> list[Rays]:
        """The rays of each pair; the arguments go by the names ``source`` and ``receiver`` in messages."""
        starts, ends = self._pairs(source, A, receiver, B)
        layers = self._as_layers(starts.shape[1])
        if model is None and layers is not None:
            return layers.arrivals(source, A, receiver, B, within, model, progress)
        if within is not None and not (numbers("within", within).ndim == 0 and within > 0):
            raise ValueError(f"within must be a positive optical path, not {within!r}")
        limit = self._usual_range(starts, ends) if within is None else np.full(len(starts), float(within))
        field_ = self.compiled.propagator(None, ends.shape[1]).fields[-1]
        index = field_.index(ends)
        real = (index > 0) & np.isfinite(index)
        answers = [_not_begun()] * len(ends)
        for row in np.flatnonzero(~real):
            answers[row] = _unreachable(ends[row], float(index[row]), float(field_(ends[row : row + 1])[0][0]))
        order = np.lexsort(starts.T)
        order = order[real[order]]
        with telling(progress, "arrivals") as told:
            stage = Stage(lambda done, what: told(done, len(order), what))
            with stage.stoppable():
                for first in range(0, len(order), PAIRS_TOGETHER):
                    told(first, len(order))
                    rows = order[first : first + PAIRS_TOGETHER]
                    some = self._with_planes(starts[rows], ends[rows], limit[rows])
                    found = self._found(some, checked_model(model), stage.later(first))
                    for row, rays in zip(rows, found, strict=True):
                        answers[row] = rays
                    if stage.stopped:
                        break
                else:
                    told(len(order), len(order))
        if stage.stopped:
            raise Interrupted(answers)
        return answers

    def usual_range(self, source: str, A: Any, receiver: str, B: Any) -> float:
        """The optical path up to which rays of one pair are looked for when nobody says."""
        a, b = self._pairs(source, A, receiver, B)
        layers = self._as_layers(a.shape[1])
        return layers.usual_range(source, A, receiver, B) if layers else float(self._usual_range(a, b)[0])

    def _pairs(self, source: str, A: Any, receiver: str, B: Any) -> tuple[np.ndarray, np.ndarray]:
        """A and B as arrays (k, d), checked."""
        a, b = rows(source, A), rows(receiver, B)
        if a.shape[1] != b.shape[1] or self.compiled.dimension not in (None, a.shape[1]):
            raise ValueError(
                f"{source} has {a.shape[1]} coordinates, {receiver} {b.shape[1]}, "
                f"the scene {self.compiled.dimension or 'either number'}"
            )
        a, b = (np.array(ends) for ends in matched(source, a, receiver, b))
        same = np.all(a == b, axis=1)
        if np.any(same):
            raise ValueError(
                f"{source} and {receiver} are the same point{_in_row(same)}, which every direction leaves; "
                "give two points"
            )
        for name, end in ((source, a), (receiver, b)):
            for number, on in enumerate(self.compiled.touched(end)):
                if np.any(on):
                    raise ValueError(
                        f"{name} lies on surface {number} of the scene{_in_row(on)}; move it off by any amount"
                    )
        self.compiled.index_at_source(a)
        return a, b

    def _found(self, ends: PointPairs, model: Model | None, stage: Stage) -> list[Rays]:
        """The rays of each of the pairs, by the model's own search where it has one, by the scene's otherwise.

        Left to choose, what is known of the one medium is asked, which passes over nothing: the equation of parabolas
        where ∇n² is constant; in layers and about a centre the range function, which looks at a curve, not at the
        plane, however far rays go out.
        """
        problem = self._problem(ends, model.companion if model else None)
        answers: list[Rays | None] = [None] * len(ends)
        if model is not None:
            answers = [model.between(self._question(problem, ends.take([k]), stage)) for k in range(len(ends))]
        elif (known := self._known(ends.sources.shape[1])) is not None:
            rows = np.flatnonzero(known.applies(ends.sources, ends.targets))
            for row, rays in zip(rows, self._all_of(known, ends.take(rows)), strict=True):
                answers[row] = rays
        left = [k for k, answer in enumerate(answers) if answer is None]
        if left:
            for k, rays in zip(left, problem.found(ends.take(left), stage), strict=True):
                answers[k] = _over_knots(rays) if problem.over_knots else rays
        return [answer for answer in answers if answer is not None]

    def _question(self, problem: TwoPoint, one: PointPairs, stage: Stage) -> Question:
        """A single pair as models are asked for it."""
        media, surfaces = self.compiled.media, self.compiled.surfaces
        a, b, within = one.sources[0], one.targets[0], float(one.within[0])
        return Question(media, surfaces, a, b, within, _builder(problem, one), lambda: problem.found(one, stage)[0])

    @cached_property
    def _section(self) -> PlaneSection | None:
        """What the planes hold that hold all rays between two points in space."""
        return PlaneSection.of(self.compiled.media, self.compiled.surfaces)

    def _as_layers(self, dimension: int) -> PairSearch | None:
        """The search in the scene read as layers, where its one medium is ``Graded`` and depends on its height."""
        medium = self.compiled.media[0]
        if self.compiled.surfaces or not isinstance(medium, Graded):
            return None
        if dimension not in self._layers:
            read, axis = as_layers(medium, dimension) or (None, -1)
            scene = CompiledScene((read,), (), dimension) if read and axis == dimension - 1 else None
            self._layers[dimension] = PairSearch(scene) if scene else None
        return self._layers[dimension]

    def _known(self, dimension: int) -> Complete | None:
        """What knows all rays of the scene, where there is one medium and no surface."""
        medium = self.compiled.media[0]
        if self.compiled.surfaces:
            return None
        if dimension not in self._complete:
            known = ConstantPull.of(medium, dimension)
            if known is None and is_linear(medium, dimension):
                known = QuadraticIndex(medium, dimension)
            up = np.eye(dimension)[-1]
            if isinstance(medium, Graded):
                medium, up = as_tilted_layers(medium, dimension) or (as_shells(medium, dimension) or medium, up)
            if known is None and isinstance(medium, Stratified | Tabulated | Radial) and placed(medium):
                known = RangeFunction(medium, up)
            self._complete[dimension] = known
        return self._complete[dimension]

    def _all_of(self, known: Complete, ends: PointPairs) -> list[Rays]:
        """The rays of pairs that are known to be all."""

        def carried_by(model: Model | None) -> Carry:
            """How a model carries rays; None stands for the model of the search."""

            def carry(
                question: np.ndarray, headings: np.ndarray, paths: np.ndarray, touching: np.ndarray,
                counts: np.ndarray,
            ) -> list[tuple[Ray | None, float]]:  # fmt: skip
                """The rays of some questions as the model carries them."""
                some = ends.take(question)
                return self._problem(some, model).built(some, headings, paths, touching, counts)

            return carry

        # a table is stepped from height to height as it is, and other gradients keep no invariant
        jumps = isinstance(known, RangeFunction) and len(known.jumps) > 0
        kept = isinstance(self.compiled.media[0], Stratified | Radial) and not jumps
        invariant = Invariants() if kept else None
        careful = carried_by(invariant) if invariant else None

        def tell(told: Told) -> list[Ray]:
            some = ends.take(told.question)
            return self._problem(some, None).told(some, told, told.least < DIM, lambda: self._problem(some, invariant))

        return known.rays(ends.sources, ends.targets, ends.within, carried_by(None), careful, tell)

    def _with_planes(self, a: np.ndarray, b: np.ndarray, within: np.ndarray) -> PointPairs:
        """The pairs with the planes that hold their rays: all of them in one, each in its own, or none."""
        k, d = a.shape
        turning, origin = np.zeros(k, dtype=bool), np.zeros((k, d))
        axes = np.broadcast_to(np.eye(2), (k, 2, 2)) if d == 2 else np.zeros((k, 0, 3))
        if d == 3 and self._section is not None:
            origin, axes = (np.array(part) for part in zip(*map(self._section.between, a, b), strict=True))
            turning = self._section.turning(a, b)
        return PointPairs(a, b, within, origin, axes, turning)

    def _problem(self, pairs: PointPairs, model: Model | None) -> TwoPoint:
        """The problem of the pairs."""
        d = pairs.sources.shape[1]
        key, full = (d, pairs.in_planes, model), self.compiled.propagator(None, d, model)
        if key not in self._problems:
            flat = self._section if d == 3 and pairs.in_planes else None
            planar = Propagator(flat.media, flat.surfaces, None, 2, model) if flat else full
            self._problems[key] = TwoPoint(planar, full)
        return self._problems[key]

    def _usual_range(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """The optical paths (k,) up to which rays are looked for when nobody says."""
        lengths, largest = [np.linalg.norm(b - a, axis=1)], np.zeros(len(a))
        fields = self.compiled.propagator(None, a.shape[1]).fields
        for medium, end in ((fields[0], a), (fields[-1], b)):
            squared, gradient, hessian = medium(end)
            with np.errstate(all="ignore"):
                largest = np.fmax(largest, np.sqrt(squared))
                first = 2 * squared / np.linalg.norm(gradient, axis=1)
                second = np.sqrt(2 * squared / np.linalg.norm(hessian, axis=(1, 2)))
            length = np.minimum(first, second)
            far = FARTHEST_SCALE if self._known(a.shape[1]) is None else FARTHEST_KNOWN_SCALE
            uniform = length > far * lengths[0]
            lengths.append(np.where(uniform, 0.0, length))
        for geometry in self.compiled.geometries(a.shape[1]):
            lengths += [geometry.distance(a), geometry.distance(b)]
        return USUAL_RANGE * largest * sum(np.where(np.isfinite(length), length, 0.0) for length in lengths)


def _builder(problem: TwoPoint, pair: PointPairs) -> Builder:
    """What makes rays of one pair from their headings, optical paths and whether they touch a caustic."""

    def built(headings: np.ndarray, paths: np.ndarray, touching: np.ndarray) -> list[tuple[Ray | None, float]]:
        every = np.zeros(len(headings), dtype=int)
        return problem.built(pair.take(every), headings, paths, touching)

    return built


def _in_row(which: np.ndarray) -> str:
    """Where the first of the rows is, for a message; nothing where there is only one."""
    return f" in row {int(np.argmax(which))}" if len(which) > 1 else ""
