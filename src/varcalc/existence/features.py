"""Where in the plane L is so narrow that evenly spaced rows of a lattice would miss it: spots, and gates in walls.

What lies on the known curve is seen between its points, and what is narrow across the curve alone on vertical lines.
Here are the abscissae at which something off the curve begins and ends, and the ordinates that matter on these rows.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from varcalc.formulation import formulate
from varcalc.formulation.height import breadths
from varcalc.problem.breaks import breaks
from varcalc.problem.problem import Problem
from varcalc.symbolic.derived import answered
from varcalc.symbolic.narrow import NarrowPlaces, narrow_places

HEIGHT_OF_SQUARE = 8.0
"""Height of the square that is looked at, in units of how broad the landscape is."""
MOST_CANDIDATES, MOST_ROWS, MOST_ORDINATES = 512, 40, 40
"""Abscissae that are tried, and abscissae and ordinates that are told: of more those that lie evenly among all."""
CHANGES = 1e-2
"""Change of L from one row to the next, of the most, from which on they are told."""
BREAK_SIDE = 1e-9
"""Distance from a break, in units of the interval, of the rows on its sides."""
ORDINATES_OF_ROW = 129
"""Ordinates at which a row is looked at, besides those of boxes."""
SHARES_OF_ROW = (0.5, 0.1, 1e-2, 1e-4)
"""Shares of how much L changes along a row at which something begins or ends there."""


@dataclass(frozen=True)
class Features:
    """The abscissae ``rows`` (k,) and the ordinates ``levels`` (j,) between which L is narrow; none, none."""

    rows: np.ndarray
    levels: np.ndarray


NOTHING = Features(np.zeros(0), np.zeros(0))


@answered
def features(problem: Problem) -> Features:
    """What is narrow in the L of a graph of one function, of which :func:`varcalc.problem.breaks.uneven` is true."""
    known, s = np.array(breaks(problem)), problem.symbols
    a, b = problem.span
    height = HEIGHT_OF_SQUARE * max(breadths(formulate(problem))[0], _rise(problem))
    middle = np.array([0.5 * (a + b), _level(problem)])
    point = ca.SX.sym("point", 2)
    place = [a + (b - a) * (point[0] + 0.5), middle[1] + height * point[1]]
    numbers = [ca.SX.zeros(*s.ddy.shape), ca.SX(ca.DM(problem.parameter_values)), ca.SX.zeros(*s.unknowns.shape)]
    at_rest = ca.substitute([problem.integrand], s.all, [*place, ca.SX.zeros(1), *numbers])[0]
    L = ca.Function("L", [point], [problem.sign * at_rest])
    boxes = narrow_places(L, np.zeros(2), 1.0)
    rows, y = _tried(boxes, (known - middle[0]) / (b - a))
    if not len(rows):
        return NOTHING
    points = np.array([np.repeat(rows, len(y)), np.tile(y, len(rows))])
    values = np.asarray(L.map(points.shape[1])(points)).reshape(len(rows), len(y))
    values = np.where(np.isfinite(values), values, np.nan)
    told = _telling(values)
    return Features(
        a + (b - a) * (rows[told] + 0.5), middle[1] + height * _some(y[_kept(values[told])], MOST_ORDINATES)
    )


def _rise(problem: Problem) -> float:
    """How far the ends that are given lie apart."""
    ends = [end.values(1)[0] for end in (problem.start, problem.end)]
    return float(np.nan_to_num(abs(ends[1] - ends[0])))


def _level(problem: Problem) -> float:
    """The ordinate in the middle of the ends that are given."""
    ends = np.array([end.values(1)[0] for end in (problem.start, problem.end)])
    return float(ends[~np.isnan(ends)].mean()) if not np.isnan(ends).all() else 0.0


def _tried(boxes: NarrowPlaces, known: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where the boxes begin, end and have their middles, and abscissae on both sides of what is known to switch."""
    edges = boxes.middle + boxes.width[:, None] * np.array([-0.5, 0.0, 0.5])[:, None, None]
    rows = np.unique(np.concatenate([edges[..., 0].ravel(), known - BREAK_SIDE, known + BREAK_SIDE]))
    y = np.unique(
        np.concatenate([_some(np.unique(edges[..., 1]), MOST_CANDIDATES), np.linspace(-0.5, 0.5, ORDINATES_OF_ROW)])
    )
    return _some(rows[(rows > -0.5) & (rows < 0.5)], MOST_CANDIDATES), y


def _some(values: np.ndarray, most: int) -> np.ndarray:
    """At most so many of them, evenly among all."""
    return values if len(values) <= most else values[np.linspace(0, len(values) - 1, most).astype(int)]


def _telling(values: np.ndarray) -> np.ndarray:
    """The numbers of the rows of ``values`` (k, j) of L from which it changes to the next, or has from the last."""
    with np.errstate(all="ignore"):
        change = np.nan_to_num(np.abs(np.diff(values, axis=0))).max(axis=1, initial=0.0)
    much = change > CHANGES * change.max(initial=0.0)
    return _some(np.flatnonzero(np.append(much, False) | np.append(False, much)), MOST_ROWS)


def _kept(values: np.ndarray) -> np.ndarray:
    """At which ordinates (j,) L is least along one of the rows, or has come near to that; of bool."""
    kept = np.zeros(values.shape, dtype=bool)
    if not values.size:
        return np.zeros(values.shape[1], dtype=bool)
    with np.errstate(all="ignore"):
        low, high = np.nanmin(values, axis=1, keepdims=True), np.nanmax(values, axis=1, keepdims=True)
        share = (values - low) / (high - low)
    inner = values[:, 1:-1]
    kept[:, 1:-1] = (inner < values[:, :-2]) & (inner <= values[:, 2:]) & (share[:, 1:-1] < SHARES_OF_ROW[0])
    for reached in SHARES_OF_ROW:
        beyond = share < reached
        kept[:, 1:] |= beyond[:, 1:] & ~beyond[:, :-1]
        kept[:, :-1] |= beyond[:, :-1] & ~beyond[:, 1:]
    return np.asarray(kept.any(axis=0))
