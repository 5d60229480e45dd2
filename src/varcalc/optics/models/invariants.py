"""Rays by their invariants and quadrature, in layers and about a centre.

The momentum along layers (Snell's law; Brizard, "An Introduction to Lagrangian
Mechanics", sect. 1.3.2) and Bouguer's n r sin φ (sect. 1.3.4) are constant, so
that a ray is an integral over one coordinate. Nothing is stepped along the
ray: where it goes to and fro, whole periods are multiplied.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from threading import Lock

import numpy as np

from varcalc.numerics.one_coordinate.motions import CoordinateMotion, MotionBounds, both_bounds, ways
from varcalc.numerics.one_coordinate.potential import PotentialNodes
from varcalc.numerics.one_coordinate.quadrature import TAU, reached
from varcalc.optics.media.medium import Field, Medium, Radial, Stratified
from varcalc.optics.models.hamilton import HamiltonRays
from varcalc.optics.models.jumps import jumping
from varcalc.optics.models.model import Carrier, DoesNotApply, Model, Question
from varcalc.optics.models.range_function import RangeFunction
from varcalc.optics.models.reduction import SIGMA, AboutCentre, Profile, ReducedRays, deviations, reduction
from varcalc.optics.models.straight import StraightRays
from varcalc.optics.rays.beam import NOTHING, Arrival, Beam, RayStatus
from varcalc.optics.rays.leg import Leg
from varcalc.optics.rays.ray import Ray, Rays
from varcalc.optics.surfaces import Geometry, Plane, Sphere

NEIGHBOURS_NEAR_CENTRE = 1e-2
"""Neighbours of rays that start towards a centre at a smaller angle lose digits to its polar coordinates."""
OUT_OF_CENTRE = 1e-4
"""Rays that start so much closer to a centre than they end lose digits as well."""
AIMED_AT_CENTRE = 1e-7
"""Rays that start towards a centre at a smaller angle lose digits themselves."""
_ONE_AT_A_TIME = Lock()
"""Threads that need the same profile wait for the one that builds it."""
AT_CENTRE = 1e-100
"""Of the largest radius, or of one unit: rays that start closer to the centre have no polar coordinates."""
DARK_TURN, FLAT_TURN = 1e-12, 1e-5
"""Of g at the start: g and p_h², and g' times the way there, zero at a turning point known to half the digits."""
ON_AXIS = 4e-16
"""A normal with a smaller part along the layers is upright; a centre so close, relative to the radius, is the same."""


@dataclass(frozen=True)
class Invariants(Model):
    """The invariants of layers and centres, and quadrature: for ``Stratified`` and ``Radial`` media.

    It needs surfaces that keep the symmetry: horizontal and vertical planes between and in layers, spheres about the
    centre. Uniform media of the scene are gone through straight. Coordinates of the symmetry are singular for rays
    that stay where the index is stationary, and for those that start from a centre or are aimed at it: Hamilton's
    equations carry them.
    """

    def carrier(self, medium: Medium, dimension: int, surfaces: Sequence[Geometry]) -> Carrier:
        """See :meth:`Model.carrier`."""
        if medium.is_uniform:
            squared, _, _ = Field(medium, dimension)(np.zeros((1, dimension)))
            return StraightRays(float(squared[0]), surfaces)
        if not isinstance(medium, Stratified | Radial):
            raise DoesNotApply(
                "Invariants needs an index of the height alone (Stratified) or of the distance from a centre (Radial), "
                f"not {type(medium).__name__}; take Hamilton()"
            )
        if jumping(medium, dimension):
            raise DoesNotApply(
                "Invariants needs an index without jumps, at which rays may turn back without coming to rest; "
                "take Hamilton(), or put a surface between two media"
            )
        for geometry in surfaces:
            if not (_kept_by_layers(geometry) if isinstance(medium, Stratified) else _about(medium, geometry)):
                kind = (
                    "horizontal and vertical planes" if isinstance(medium, Stratified) else "spheres about the centre"
                )
                raise DoesNotApply(
                    f"Invariants needs surfaces that keep the symmetry of {type(medium).__name__}, {kind}, "
                    f"and {geometry.surface} is none; take Hamilton()"
                )
        return InvariantRays(medium, dimension, surfaces)

    def between(self, question: Question) -> Rays | None:
        """See :meth:`Model.between`: by the range function, where there is one medium and no surface."""
        medium, a = question.media[0], question.a
        if question.surfaces or not isinstance(medium, Stratified | Radial) or jumping(medium, len(a)):
            return None
        function = RangeFunction(medium, np.eye(len(a))[-1])
        a, b = a[None], question.b[None]
        if not function.applies(a, b)[0]:
            raise DoesNotApply(
                "Invariants needs points off the centre of the index, about which all turns; take Hamilton()"
            )
        built = question.built

        def carry(
            question: np.ndarray, headings: np.ndarray, paths: np.ndarray, touching: np.ndarray,
            counts: np.ndarray,
        ) -> list[tuple[Ray | None, float]]:  # fmt: skip
            """The rays of the one question there is."""
            return built(headings, paths, touching)  # there is one question, and nothing is carried twice

        return function.rays(a, b, np.array([question.within]), carry)[0]


def _upright(geometry: Geometry) -> bool:
    surface = geometry.surface
    return isinstance(surface, Plane) and float(np.max(np.abs(surface.normal[:-1]))) <= ON_AXIS


def _standing(geometry: Geometry) -> bool:
    surface = geometry.surface
    return isinstance(surface, Plane) and abs(surface.normal[-1]) <= ON_AXIS


def _kept_by_layers(geometry: Geometry) -> bool:
    return _upright(geometry) or _standing(geometry)


def _about(medium: Radial, geometry: Geometry) -> bool:
    surface = geometry.surface
    if not isinstance(surface, Sphere):
        return False
    away = np.linalg.norm(np.asarray(surface.center) - medium.middle(geometry.dimension))
    return bool(away <= ON_AXIS * surface.radius)


@dataclass
class InvariantRays:
    """The model for one medium, with the surfaces that rays in it may meet."""

    medium: Stratified | Radial
    dimension: int
    surfaces: Sequence[Geometry]
    _hamilton: HamiltonRays = field(init=False, repr=False)
    _profiles: dict[float, Profile] = field(init=False, default_factory=dict, repr=False)

    name = "invariants and quadrature"

    def __post_init__(self) -> None:
        self._hamilton = HamiltonRays(self.medium, self.dimension, self.surfaces)

    def advance(self, beam: Beam, limit: np.ndarray, leaving: int = NOTHING) -> Arrival:
        """See :meth:`varcalc.optics.models.model.Carrier.advance`."""
        left = np.maximum(limit - beam.optical_path, 0.0)
        arrival, others = self._carried(beam, self.surfaces, leaving, left, np.full(len(beam), np.inf))
        arrival.beam.optical_path[arrival.struck == PATH_ENDED] = limit[arrival.struck == PATH_ENDED]
        arrival.struck[arrival.struck == PATH_ENDED] = NOTHING
        if len(others):
            again = self._hamilton.advance(beam.take(others), limit[others], leaving)
            arrival.beam.put(others, again.beam)
            arrival.struck[others], arrival.status[others] = again.struck, again.status
        return arrival

    def onward(self, beam: Beam, sigma: np.ndarray, path: np.ndarray) -> tuple[Beam, np.ndarray]:
        """See :meth:`varcalc.optics.models.model.Carrier.onward`."""
        there = beam.take(np.arange(len(beam)))
        ahead = np.flatnonzero(sigma > 0)
        arrival, others = self._carried(beam.take(ahead), (), NOTHING, np.full(len(ahead), np.inf), sigma[ahead])
        there.put(ahead, arrival.beam.known(arrival.status == RayStatus.ARRIVED))
        if len(others):
            others = ahead[others]
            there.put(others, self._hamilton.onward(beam.take(others), sigma[others], path[others])[0])
        return there, sigma

    def _carried(
        self, beam: Beam, surfaces: Sequence[Geometry], leaving: int, path: np.ndarray, sigma: np.ndarray
    ) -> tuple[Arrival, np.ndarray]:
        """The rays where :meth:`_Run.carried` has taken them, and the rows left to Hamilton's equations."""
        m = len(beam)
        arrival = Arrival(beam.take(np.arange(m)), np.full(m, NOTHING), np.full(m, int(RayStatus.ARRIVED)))
        others = self._at_centre(beam)
        rows = np.flatnonzero(~others)
        if len(rows):
            part = beam.take(rows)
            moved, left = _Run(self._profile(part), surfaces, part, leaving, path[rows], sigma[rows]).carried()
            arrival.beam.put(rows, moved.beam)
            arrival.struck[rows], arrival.status[rows] = moved.struck, moved.status
            others[rows[left]] = True
        return arrival, np.flatnonzero(others)

    def _at_centre(self, beam: Beam) -> np.ndarray:
        """True (m,) for rays that start so close to the centre that they have no polar coordinates."""
        if not isinstance(self.medium, Radial):
            return np.zeros(len(beam), dtype=bool)
        radius = np.linalg.norm(beam.position - self.medium.middle(self.dimension), axis=1)
        return radius <= AT_CENTRE * max(1.0, float(radius.max(initial=0.0)))

    def leg(self, beam: Beam, path: float) -> Leg:
        """See :meth:`varcalc.optics.models.model.Carrier.leg`."""
        if np.any(self._at_centre(beam)):
            return self._hamilton.leg(beam, path)
        profile = self._profile(beam)
        free = _Run(profile, (), beam, NOTHING, np.array([path - beam.optical_path[0]]), np.full(1, np.inf))
        end, others = free.carried()
        if len(others) or end.status[0] != RayStatus.ARRIVED:
            return self._hamilton.leg(beam, path)
        length = float(free.came[0])

        def at(sigma: np.ndarray) -> Beam:
            """The ray at σ (m,)."""
            many = beam.take(np.zeros(len(sigma), dtype=int))
            run = _Run(profile, (), many, NOTHING, np.full(len(sigma), np.inf), sigma, free.nodes)
            carried = run.carried()[0].beam
            carried.put(np.flatnonzero(sigma == 0), many.take(np.flatnonzero(sigma == 0)))  # not to round-off only
            return carried

        return Leg(at, length)

    def _profile(self, beam: Beam) -> Profile:
        """The profile of the medium, its unit of length near the first ray's radius, for a centre."""
        probe, unit = float(beam.position[0, -1]), 1.0
        if isinstance(self.medium, Radial):
            radius = float(np.linalg.norm(beam.position[0] - self.medium.middle(self.dimension)))
            probe, unit = 0.0, float(2.0 ** np.round(np.log2(radius)))
        with _ONE_AT_A_TIME:
            if unit not in self._profiles:
                self._profiles[unit] = Profile(self.medium, unit, probe)
            return self._profiles[unit]


PATH_ENDED = -2
"""In place of the number of a surface, for a while: the optical path or σ came to its end."""


class _Run:
    """Rays of one medium from their starts, after the optical path ``path`` (m,) or at ``sigma`` (m,) at the latest.

    ``came`` (m,) is the σ at which they end.
    """

    def __init__(
        self,
        profile: Profile,
        surfaces: Sequence[Geometry],
        beam: Beam,
        leaving: int,
        path: np.ndarray,
        sigma: np.ndarray,
        nodes: PotentialNodes | None = None,
    ) -> None:
        self.profile, self.surfaces, self.beam, self.leaving = profile, surfaces, beam, leaving
        self.path, self.sigma, self.came = path, sigma, np.zeros(len(beam))
        self.reduced = reduction(profile, beam)
        self.motions: ReducedRays = self.reduced.motions
        self.levels = self._levels()
        self.nodes = nodes or self._nodes()

    def _nodes(self) -> PotentialNodes:
        """The nodes of the profile as far as rays may come."""
        u0 = self.motions.u
        sigma = np.fmin(self.sigma, self._standing()[1])  # planes stand in layers, where σ is τ
        low, high = (self.profile.farthest(u0, way, self.path, sigma) for way in (-1, 1))
        lowest, highest = max(self.levels.lowest, float(low.min())), min(self.levels.highest, float(high.max()))
        first, last = float(u0.min()), float(u0.max())
        return self.profile.nodes(first, last, lowest, highest, max(last - lowest, highest - first))

    def carried(self) -> tuple[Arrival, np.ndarray]:
        """The rays at the first surface or where they end, and the rows that are to be carried by another model."""
        m, beam, profile, nodes = len(self.beam), self.beam, self.profile, self.nodes
        u0, levels, squared = self.motions.u, self.levels, self.motions.w**2
        standing, standing_tau = self._standing()
        below, above = both_bounds(profile, nodes, u0, squared, self.motions.C, (levels.down, levels.up))
        (below, dark_below), (above, dark_above) = self._dark(below), self._dark(above)
        targets = np.column_stack([standing_tau, self.path, self.sigma])
        end = Arrival(beam.take(np.arange(m)), np.full(m, NOTHING), np.full(m, int(RayStatus.ARRIVED)))
        left = np.ones(m, bool)
        for rows, way, last in ways(profile, u0, self.motions.w, below, above):
            left[rows] = False
            aimless = np.all(np.isinf(targets[rows]), axis=1)
            rising = _rises_at_last(way)
            side = MotionBounds(np.where(rising, above.x[rows], below.x[rows]), rising)
            struck = np.where(rising, levels.number_up[rows], levels.number_down[rows])
            walls = np.where(rising, levels.up[rows], -levels.down[rows])
            struck = np.where(np.isfinite(last) & (side.x == walls), struck, NOTHING)
            ended = np.where(rising, nodes.high_edge | dark_above[rows], nodes.low_edge | dark_below[rows])
            edge = ended & np.isfinite(last) & (struck == NOTHING)
            going = ~aimless | (struck != NOTHING)
            unheard = np.where(edge, int(RayStatus.SINGULAR), int(RayStatus.MISSED))
            end.status[rows] = unheard
            part = way.take(np.flatnonzero(going))
            self._carry(part, rows[going], last[going], struck[going], standing, targets, end)
        others = np.flatnonzero(left | self._lose_digits(end))
        return end, others

    def _dark(self, side: MotionBounds) -> tuple[MotionBounds, np.ndarray]:
        """The both_bounds, and which (m,) are where n vanishes with its slope: rays end there and do not turn back."""
        g, _ = self.profile.at(self.motions.u)
        with np.errstate(all="ignore"):
            there, slope = self.profile.at(self.motions.u + side.x)
            level = np.fmax(there, self.motions.C) <= DARK_TURN * g
            dark = np.isfinite(side.x) & level & (np.abs(slope * side.x) <= FLAT_TURN * g)
        return replace(side, turning=side.turning & ~dark), dark

    def _carry(
        self, way: CoordinateMotion, rows: np.ndarray, last: np.ndarray, struck: np.ndarray, standing: np.ndarray,
        targets: np.ndarray, end: Arrival,
    ) -> None:  # fmt: skip
        """Carry ``rows``, all on ways of one kind, and write down how they end."""
        if len(rows) == 0:
            return
        sub = reduction(self.profile, self.beam.take(rows))
        with np.errstate(all="ignore"):  # what is no number is not resolved, and said to be so
            there = reached(way, last, targets[rows])
            self.came[rows] = there.integrals[:, SIGMA]
            start, stop = way.at(way.start[:, None]), way.at(there.q[:, None])
            moved = deviations(sub.motions, start, stop, there.integrals)
            carried = sub.carried(moved)
        by_plane = targets[rows, TAU] <= there.integrals[:, TAU] * (1 + 1e-15)
        what = np.where(there.ended, struck, np.where(by_plane, standing[rows], PATH_ENDED))
        end.struck[rows] = what
        lost = there.ended & (what == NOTHING)
        unheard = end.status[rows]
        end.status[rows] = np.where(lost, unheard, int(RayStatus.ARRIVED))
        # on the way to where n vanishes with its slope τ has no end
        endless = np.where(unheard == int(RayStatus.SINGULAR), unheard, int(RayStatus.TOO_MANY_STEPS))
        end.status[rows] = np.where(there.resolved, end.status[rows], endless)
        sound = there.resolved & np.all(np.isfinite(carried.position), axis=1)
        end.beam.put(rows[sound], carried.take(np.flatnonzero(sound)))

    def _lose_digits(self, end: Arrival) -> np.ndarray:
        """True (m,) for rays, or rays whose neighbours, cannot be told in polar coordinates up to their ``end``."""
        if not isinstance(self.reduced, AboutCentre):
            return np.zeros(len(self.beam), bool)
        least, r = NEIGHBOURS_NEAR_CENTRE if self.beam.deviations else AIMED_AT_CENTRE, self.reduced.r
        inward = (self.reduced.c < least * r * np.linalg.norm(self.beam.momentum, axis=1)) & (self.motions.w < 0)
        outward = r < OUT_OF_CENTRE * np.linalg.norm(end.beam.position - self.reduced.centre, axis=1)
        return inward | outward | (end.status == RayStatus.TOO_MANY_STEPS)

    def _levels(self) -> _Levels:
        """The surfaces of constant u about the starts."""
        u0, w, m = self.motions.u, self.motions.w, len(self.beam)
        _, slope = self.profile.at(u0)
        up, down = np.full(m, np.inf), np.full(m, np.inf)
        number_up, number_down = np.full(m, NOTHING), np.full(m, NOTHING)
        heights = []
        for number, geometry in enumerate(self.surfaces):
            surface = geometry.surface
            if isinstance(surface, Sphere):
                height = np.log(surface.radius / self.profile.unit)
            elif isinstance(surface, Plane) and _upright(geometry):
                height = float(np.dot(surface.normal, surface.point)) / surface.normal[-1]
            else:
                continue
            if number != self.leaving:  # which is on one side of all starts only to round-off
                heights.append(height)
            x, above = height - u0, height > u0
            if number == self.leaving:
                x, above = np.zeros(m), (w < 0) | ((w == 0) & (slope < 0))
            nearer = above & (x < up)
            up[nearer], number_up[nearer] = x[nearer], number
            nearer = ~above & (-x < down)
            down[nearer], number_down[nearer] = -x[nearer], number
        lowest = max((h for h in heights if h < u0.min()), default=-np.inf)
        highest = min((h for h in heights if h > u0.max()), default=np.inf)
        return _Levels(up, down, number_up, number_down, lowest, highest)

    def _standing(self) -> tuple[np.ndarray, np.ndarray]:
        """The first vertical plane (m,) that each ray comes to, and τ there."""
        m = len(self.beam)
        first, tau = np.full(m, NOTHING), np.full(m, np.inf)
        for number, geometry in enumerate(self.surfaces):
            if number == self.leaving or not _standing(geometry):
                continue
            level, slope, _ = geometry.along(self.beam.position, self.beam.momentum)
            with np.errstate(all="ignore"):
                when = -level / slope
            nearer = (when > 0) & (when < tau)
            first[nearer], tau[nearer] = number, when[nearer]
        return first, tau


@dataclass(frozen=True)
class _Levels:
    """The nearest surface above and below each start: distances and numbers (m,); and the range for all."""

    up: np.ndarray
    down: np.ndarray
    number_up: np.ndarray
    number_down: np.ndarray
    lowest: float
    highest: float


def _rises_at_last(way: CoordinateMotion) -> np.ndarray:
    """True (m,) for motions that go up for good where they do not turn back any more."""
    sign = getattr(way, "sign", None)
    return np.ones(len(way.start), bool) if sign is None else sign > 0
