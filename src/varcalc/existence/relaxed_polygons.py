"""The least polygon of the convexified functional, among all over a grid of levels: where to begin with corners.

On each piece L is replaced by its convex envelope in the slope, as its values on many slopes show it: the greatest of
all straight lines below them (Fenchel's biconjugate; Rockafellar, "Convex Analysis", 1970, sect. 12). Then no slope has
to lead from level to level, and Bellman's programme finds the least polygon at once.
"""

from __future__ import annotations

import numpy as np

from varcalc.existence.moved_polygons import least_through
from varcalc.problem.breaks import bounds
from varcalc.problem.conditions import Bound
from varcalc.problem.end_cost import costs_of_ends
from varcalc.problem.problem import Problem
from varcalc.symbolic.derived import answered, derived
from varcalc.symbolic.evaluation import PointEvaluator

PIECES, LEVELS = 16, 31
"""Pieces of the polygons, and levels on every abscissa."""
RANGES = 1.0, 4.0
"""How far levels reach beyond the ends, in units of the larger of the rise and of what the problem's slope makes of the
interval, and in units of the interval.
"""
SAME_RANGE = 1.5
"""Factor within which two ranges are one."""
SLOPES = np.sinh(np.linspace(-6.0, 6.0, 81)) / np.sinh(1.5)
"""Slopes at which L is asked, in units of the problem's: dense about 0."""


@answered
def least_relaxed(problem: Problem, steep: float) -> list[tuple[np.ndarray, np.ndarray]]:
    """Vertices of least polygons of the convexified functional, one for each range of levels; ``steep`` is a slope.

    One function of first order is looked at, whose abscissae are given.
    """
    a, b = problem.span
    x = np.linspace(a, b, PIECES + 1)
    ends = [float(end.values(1)[0]) for end in (problem.start, problem.end)]
    known = [y for y in ends if not np.isnan(y)] or [0.0]
    rooms: list[float] = []
    for room in sorted(reach * unit for reach in RANGES for unit in (max(np.ptp(known), steep * (b - a)), b - a)):
        if not rooms or room > SAME_RANGE * rooms[-1]:
            rooms.append(room)
    found = []
    for room in rooms:
        levels = np.linspace(min(known) - room, max(known) + room, LEVELS)
        for y in known:
            levels[np.argmin(np.abs(levels - y))] = y
        path = _least(problem, x, np.sort(levels), ends, steep)
        if path is not None:
            found.append((x, path))
    return found


def _least(problem: Problem, x: np.ndarray, levels: np.ndarray, ends: list[float], steep: float) -> np.ndarray | None:
    """The ordinates of the least polygon, (K + 1,); None where none is admitted."""
    nodes, there = np.tile(levels, (len(x), 1)), np.zeros((len(x), len(levels)))
    there[[0, -1]] = _begun(problem, x, levels, ends)
    known = dict[bytes, _Envelope | None]()
    added = np.stack([_pieces(problem, x[k : k + 2], levels, steep, known) for k in range(len(x) - 1)])
    y, value = least_through(nodes[None, :, :, None], added[None], there[None])
    return y[0, :, 0] if np.isfinite(value[0]) else None


def _begun(problem: Problem, x: np.ndarray, levels: np.ndarray, ends: list[float]) -> list[np.ndarray]:
    """What it costs to begin, and to end, at each level: without end where another ordinate is given."""
    added, places = [], [(at, np.nan_to_num(np.array([[y]]))) for at, y in zip((x[:1], x[-1:]), ends, strict=True)]
    for side, y in enumerate(ends):
        at = np.where(np.isnan(y) | (levels == y), 0.0, np.inf)
        if np.isnan(y):
            there = places[side][0], levels[None]
            pair = (there, places[1]) if side == 0 else (places[0], there)
            at = at + costs_of_ends(problem, *pair, problem.unknown_guesses[None])
        added.append(np.where(np.isfinite(at), at, np.inf))
    return added


_Envelope = tuple[float, float, np.ndarray, np.ndarray]
"""From which slope to which L has values, the slopes of lines below it, and how far below nothing each passes it."""


def _pieces(
    problem: Problem, x: np.ndarray, levels: np.ndarray, steep: float, known: dict[bytes, _Envelope | None]
) -> np.ndarray:
    """What a piece adds from each level to each, (J, J): the convexified L half way, by the mean slope.

    What is ``known`` of L's values on all slopes is not found again: they are the same on every piece where L does not
    hold x, and on every level where it does not hold y.
    """
    width, count = x[1] - x[0], len(levels)
    half = 0.5 * (levels[:, None] + levels)
    slope = (levels - levels[:, None]) / width
    rows, inverse = np.unique(half, return_inverse=True)
    tried = steep * SLOPES
    values = _admitted(problem, x.mean(), rows, tried)
    envelope = np.full((count, count), np.inf)
    for number, row in enumerate(values):
        key = row.tobytes()
        if key not in known:
            known[key] = _below(tried, row)
        below = known[key]
        if below is None:
            continue
        first, last, lines, conjugate = below
        here = inverse.reshape(count, count) == number
        within = here & (slope >= first) & (slope <= last)
        envelope[within] = (lines * slope[within][:, None] - conjugate).max(axis=1)
    return envelope * width


def _below(tried: np.ndarray, row: np.ndarray) -> _Envelope | None:
    """All straight lines below L's values (S,) on the slopes that are tried; None where it has less than two."""
    finite = np.isfinite(row)
    if finite.sum() < 2:
        return None
    rates = np.diff(np.where(finite, row, np.nan)) / np.diff(tried)
    lines, slopes = np.unique(rates[np.isfinite(rates)]), tried[finite]
    return slopes[0], slopes[-1], lines, (lines[:, None] * slopes - row[finite]).max(axis=1)


@derived
def _held(problem: Problem) -> PointEvaluator:
    return PointEvaluator(bounds(problem))


def _admitted(problem: Problem, x: float, y: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """L as it is minimised at one abscissa, for each ordinate and each slope, infinite where bounds bar them."""
    ordinates, tried = np.repeat(y, len(slopes)), np.tile(slopes, len(y))
    at, none = np.full(len(tried), x), np.zeros((1, 0))
    values = problem.sign * problem.integrand_values(at, ordinates[None], tried[None])
    curve, numbers = (ordinates[:, None], tried[:, None], none), (problem.parameter_values[None], none)
    held = _held(problem)(len(at), at[:, None], *curve, *numbers)
    for given, bound in zip(held.T, problem.of_type(Bound), strict=True):
        low, high = bound.interval
        values = np.where((given >= low) & (given <= high), values, np.inf)
    return np.where(np.isfinite(values), values, np.inf).reshape(len(y), len(slopes))
