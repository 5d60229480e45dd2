"""All zeros of an end map over a range of initial slopes.

The slopes are unit * sinh(u) with u on an even grid: fine about zero, a fixed
ratio apart far out. As every trajectory brings its derivative, the cubic
between two neighbours predicts the one half-way; where the prediction fails,
the interval is halved. Two zeros between two samples, as near a fold, have an
extremum of the map between them, which is found as a zero of the derivative.
Towards gaps, where trajectories do not arrive, the samples grow denser as well.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from itertools import groupby, pairwise

import numpy as np

from varcalc.axes import measured
from varcalc.integrators import RunOutcome
from varcalc.problem.functional import Functional
from varcalc.search.end_map import STEPS_PER_TRAJECTORY, EndMap, TrialTrajectory
from varcalc.symbolic.derived import derived

FARTHEST_SLOPE = 1e6
"""Largest slope, in units of the problem's own."""
FIRST_INTERVALS = 256
"""Intervals of the first grid."""
MOST_TRAJECTORIES = 4096
"""Trajectories of one scan."""
TRAJECTORIES_TOGETHER = 64
"""Trajectories that are followed together."""
DEEPEST_HALVING = 22
"""Halvings of an interval between two trajectories that arrived."""
TOWARDS_GAP, ACROSS_GAP = 12, 90
"""Halvings towards a gap, and between trajectories lost on opposite sides or off to the other side of the target."""
UNRESOLVED_SHARE = 0.1
"""An interval is halved while the cubic is off by more than this part of the least miss about it ..."""
UNRESOLVED_LEAST = 1e-3
"""... and by more than this."""
FLAT_MISS = 1e-12
"""Relative miss and derivative of trajectories that all meet the end: a continuum of extremals."""
TOUCHING_MISS = 1e-14
"""A miss at an extremum of the map that round-off explains: two extremals in one."""
CLEAR_OF_ZERO = 2.0
"""Times the way between two shots about an extremum within which no tangent of the map comes to zero."""
FALSI_ITERATIONS = 80
CLUSTER_WIDTH = 1.0
"""Distance in u within which lost trajectories are told of as one interval."""


@dataclass(frozen=True)
class Scanned:
    """What a scan found: ``zeros`` (u), those among them where two meet, and what was covered.

    ``low`` and ``high`` are slopes, in the ``unit`` that is declared; ``continuum`` is u of one trajectory where
    all of some interval meet the end; ``lost`` are intervals of slopes in which
    trajectories do not arrive, ``unresolved`` counts intervals given up.
    """

    zeros: list[float]
    double: list[float]
    low: float
    high: float
    shots: int
    lost: list[tuple[float, float, RunOutcome]]
    unresolved: int
    continuum: float | None
    unit: str = ""

    @property
    def searched(self) -> str:
        """What was covered, in words."""
        words = f"all with initial slope in {self._between(self.low, self.high)} that {self.shots} trajectories resolve"
        for low, high, outcome in self.lost:
            words += f"; with slope in {self._between(low, high)} trajectories do not arrive ({outcome.value})"
        if self.unresolved:
            words += f"; {self.unresolved} intervals were left unresolved"
        if self.continuum is not None:
            words += "; a continuum of extremals joins these ends, which are conjugate; one of them stands for all"
        return words

    def _between(self, low: float, high: float) -> str:
        return measured(f"[{low:.6g}, {high:.6g}]", self.unit)


@dataclass
class _Scan:
    map: EndMap
    shots: dict[float, TrialTrajectory] = field(default_factory=dict)
    steps: int = 0
    unresolved: int = 0

    def shoot(self, places: Iterable[float]) -> None:
        """Follow the trajectories of u that have not been followed yet, all together."""
        fresh = [u for u in dict.fromkeys(places) if u not in self.shots]
        for shot in self.map.shots(fresh):
            self.shots[shot.u] = shot
            self.steps += shot.steps

    def _together(self, budget: float) -> int:
        """How many trajectories may be followed together without going beyond a budget of steps."""
        return max(1, min(TRAJECTORIES_TOGETHER, int((budget - self.steps) / STEPS_PER_TRAJECTORY)))

    def reach(self, grid: np.ndarray) -> np.ndarray:
        """The part of a symmetric grid, from the middle outwards, that half of the budget pays for."""
        middle, grown = len(grid) // 2, -1
        while grown < middle and 2 * self.steps <= self.map.budget:
            pairs = max(1, self._together(self.map.budget / 2) // 2)
            further = np.arange(grown + 1, min(grown + 1 + pairs, middle + 1))
            self.shoot(np.concatenate([grid[middle - further], grid[middle + further]]).tolist())
            grown = int(further[-1])
        return grid[middle - grown : middle + grown + 1]

    def refine(self, grid: np.ndarray) -> None:
        """Halve intervals until the map is resolved, or the trajectories are used up."""
        waiting = deque((float(a), float(b), 0) for a, b in pairwise(grid))
        while waiting:
            some = [waiting.popleft() for _ in range(min(self._together(self.map.budget), len(waiting)))]
            halved: list[tuple[float, float, int]] = []
            for a, b, depth in some:
                left, right = self.shots[a], self.shots[b]
                if depth >= _halvings(left, right) or not a < 0.5 * (a + b) < b:
                    self.unresolved += left.arrived and right.arrived
                elif len(self.shots) + len(halved) >= MOST_TRAJECTORIES or self.steps >= self.map.budget:
                    self.unresolved += 1
                else:
                    halved.append((a, b, depth))
            self.shoot(0.5 * (a + b) for a, b, _ in halved)
            for a, b, depth in halved:
                middle = 0.5 * (a + b)
                if not _resolved(self.shots[a], self.shots[b], self.shots[middle]):
                    waiting += [(a, middle, depth + 1), (middle, b, depth + 1)]

    def extremum(self, left: TrialTrajectory, right: TrialTrajectory) -> TrialTrajectory:
        """Where the derivative of the map vanishes between two shots, or where one is whose miss tells enough."""
        lowest = _root(lambda s: s.slope, left, right, self.map.shoot, _told_apart)
        return self.shots.setdefault(lowest.u, lowest)


def scan(end_map: EndMap) -> Scanned:
    """The zeros of ``end_map`` for slopes up to FARTHEST_SLOPE units either way, or as far as its budget goes.

    They are kept with the problem: a refusal asks for them, and whoever then asks why.
    """
    kept, key = _scans(end_map.form.problem), end_map.key
    if key not in kept:
        kept[key] = _scanned(end_map)
    return kept[key]


@derived
def _scans(_: Functional) -> dict[tuple[object, ...], Scanned]:
    """What has been scanned, by all that a scan depends on."""
    return {}


def _scanned(end_map: EndMap) -> Scanned:
    state = _Scan(end_map)
    grid = state.reach(np.linspace(-math.asinh(FARTHEST_SLOPE), math.asinh(FARTHEST_SLOPE), FIRST_INTERVALS + 1))
    continuum = _continuum([state.shots[u] for u in grid.tolist()])
    zeros: list[float] = []
    double: list[float] = []
    if continuum is None:
        state.refine(grid)
        _settle(state, zeros, double)
    unit = end_map.unit
    ordered = [state.shots[u] for u in sorted(state.shots)]
    high = unit * math.sinh(float(grid[-1]))
    lost = _gaps(ordered, [0.0, *zeros, *double], unit)
    x, y, *_ = end_map.form.problem.axes
    return Scanned(zeros, double, -high, high, len(ordered), lost, state.unresolved, continuum, y.over(x).unit)


def _continuum(shots: list[TrialTrajectory]) -> float | None:
    """The least inclined of three or more neighbours that all meet the end; None where there are none."""
    for met, run in groupby(shots, key=lambda s: s.flat <= FLAT_MISS):
        members = list(run)
        if met and len(members) >= 3:
            return min((s.u for s in members), key=abs)
    return None


def _halvings(left: TrialTrajectory, right: TrialTrajectory) -> int:
    """How often an interval may be halved."""
    if left.arrived and right.arrived:
        return DEEPEST_HALVING
    if left.arrived or right.arrived:
        return ACROSS_GAP if left.side * right.side < 0 else TOWARDS_GAP
    return ACROSS_GAP if left.side * right.side < 0 else 0


def _resolved(left: TrialTrajectory, right: TrialTrajectory, middle: TrialTrajectory) -> bool:
    """True when the cubic through two shots predicts the one half-way well enough to miss no zero."""
    if not (left.arrived and right.arrived and middle.arrived):
        return False
    width = right.u - left.u
    predicted = 0.5 * (left.miss + right.miss) + width * (left.slope - right.slope) / 8
    off = abs(middle.miss - predicted)
    least = min(abs(left.miss), abs(middle.miss), abs(right.miss))
    return off <= max(UNRESOLVED_SHARE * least, UNRESOLVED_LEAST)


def _settle(state: _Scan, zeros: list[float], double: list[float]) -> None:
    """The zeros between neighbouring shots."""
    for left, right in pairwise([state.shots[u] for u in sorted(state.shots)]):
        if not (left.arrived and right.arrived):
            continue
        brackets = [(left, right)]
        if left.miss * right.miss > 0 and left.miss * left.slope < 0 < right.miss * right.slope:
            lowest = state.extremum(left, right)
            if abs(lowest.miss) <= TOUCHING_MISS * math.cosh(lowest.u):
                double.append(lowest.u)
                continue
            brackets = [(left, lowest), (lowest, right)]
        for low, high in brackets:
            if low.miss == 0.0 or low.miss * high.miss < 0:
                zeros.append(_root(lambda s: s.miss, low, high, state.map.shoot).u)


def _told_apart(low: TrialTrajectory, high: TrialTrajectory) -> bool:
    """Whether the map has a zero between two shots about an extremum, or by both of its tangents is far from one."""
    reach = CLEAR_OF_ZERO * abs(high.u - low.u)
    far = (abs(shot.miss) > reach * abs(shot.slope) for shot in (low, high))
    return low.miss * high.miss < 0 or all(far)


def _root(
    of: Callable[[TrialTrajectory], float],
    low: TrialTrajectory,
    high: TrialTrajectory,
    shoot: Callable[[float], TrialTrajectory],
    enough: Callable[[TrialTrajectory, TrialTrajectory], bool] = lambda low, high: False,
) -> TrialTrajectory:
    """The shot between two where a function of it changes sign, by regula falsi in the Illinois variant.

    The best one so far where two about the place are ``enough``.
    """
    fa, fb = of(low), of(high)
    best = low if abs(fa) < abs(fb) else high
    for k in range(FALSI_ITERATIONS):
        a, b = low.u, high.u
        u = 0.5 * (a + b) if k % 4 == 3 else b - fb * (b - a) / (fb - fa)
        if of(best) == 0.0 or not min(a, b) < u < max(a, b) or enough(low, high):
            break
        here = shoot(u)
        value = of(here)
        if not math.isfinite(value):
            break
        best = here if abs(value) < abs(of(best)) else best
        low, fa = (high, fb) if value * fb < 0 else (low, 0.5 * fa)
        high, fb = here, value
        if abs(high.u - low.u) <= 4 * np.finfo(float).eps * abs(u):
            break
    return best


def _gaps(shots: list[TrialTrajectory], inside: list[float], unit: float) -> list[tuple[float, float, RunOutcome]]:
    """Intervals of slopes in which trajectories do not arrive, with the reason of the first.

    Lost trajectories no farther apart than CLUSTER_WIDTH count as one interval, unless one of ``inside`` is between.
    """
    gaps: list[tuple[TrialTrajectory, TrialTrajectory]] = []
    for shot in shots:
        if shot.arrived:
            continue
        near = bool(gaps) and shot.u - gaps[-1][1].u <= CLUSTER_WIDTH
        if near and not any(gaps[-1][1].u < u < shot.u for u in inside):
            gaps[-1] = (gaps[-1][0], shot)
        else:
            gaps.append((shot, shot))
    return [(unit * math.sinh(low.u), unit * math.sinh(high.u), low.outcome) for low, high in gaps]
