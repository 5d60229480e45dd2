"""Where an expression of one variable switches: every place, by bisection of enclosures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import casadi as ca
import numpy as np

from varcalc.symbolic.intervals import Interval, enclosures
from varcalc.symbolic.switches import Switch
from varcalc.symbolic.tracing import Expression

NONE = ca.SX(0, 1)
CUTS = 16
"""Pieces of the interval that are looked at to begin with."""
MOST_SEARCHED_PIECES = 4096
"""Pieces at one time beyond which places are too many to be found."""
MOST_BREAKS = 256
FINEST, LEAST_PLACE = 1e-13, 1e-8
"""Width of a piece that is a point, relative to where it is, or to so much of the interval beside 0.

Where pieces are too many, as at double zeros of long formulas, one is a point that is so narrow beside the interval.
"""
TINY = float(np.finfo(float).tiny)


def places(
    switch: Switch, variable: Expression, span: tuple[float, float], known: Sequence[float] = (),
    parameters: Expression = NONE, values: Sequence[float] = (),
) -> list[float] | None:  # fmt: skip
    """Where the argument of a switch in one ``variable`` is at its levels; None where that is too often.

    The argument may itself jump at places ``known`` so far, of what is carried out before, and depend on
    ``parameters`` with given ``values``.
    """
    slope = ca.jacobian(switch.argument, variable)
    function = ca.Function("argument", [variable, parameters], [switch.argument, slope])
    numbers = [(np.array(v), np.array(v)) for v in values]
    cuts = [x for x in known if span[0] < x < span[1]]
    edges = np.unique([*np.linspace(*span, CUTS + 1), *cuts])
    widths = _PointWidths(span[1] - span[0])
    beside = widths.at(edges) * np.isin(edges, cuts)  # there the argument is on neither side
    low: np.ndarray = edges[:-1] + beside[:-1]
    high: np.ndarray = edges[1:] - beside[1:]
    found: list[float] = []
    most = MOST_BREAKS + len(switch.levels)
    while len(low):
        if len(low) > MOST_SEARCHED_PIECES and np.all(high - low <= widths.most):
            found += _apart(np.sort((low + high) / 2).tolist(), lambda _: 4 * widths.most)
            break
        if len(low) > MOST_SEARCHED_PIECES or len(found) > most:
            return None
        (value,), slope = enclosures(function, [[(low, high)], numbers])
        least, greatest = (np.broadcast_to(v, low.shape) for v in value)
        hit = switch.met(least, greatest) > 0
        hit &= (least < greatest) | (low == high)  # constant there, it does not switch inside
        single = hit & _one_way(slope, low.shape)
        if switch.met(least, greatest)[single].sum() > most + np.count_nonzero(single):
            return None
        for a, b in zip(low[single].tolist(), high[single].tolist(), strict=True):
            found += _crossings(function, switch, a, b, values)
        rest = hit & ~single
        fine = rest & (high - low <= widths.at((low + high) / 2))
        found += (0.5 * (low[fine] + high[fine])).tolist()
        low, high = low[rest & ~fine], high[rest & ~fine]
        middle = 0.5 * (low + high)
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
    return _apart(sorted(found), lambda x: 4 * float(widths.at(np.array(x))))


class _PointWidths:
    """How wide pieces of an interval of some width are that count as points."""

    def __init__(self, width: float) -> None:
        self.most, self._least = FINEST * width, LEAST_PLACE * width

    def at(self, x: np.ndarray) -> np.ndarray:
        """The width (m,) of points about ``x`` (m,)."""
        return FINEST * np.maximum(np.abs(x), self._least)


def _one_way(slope: list[Interval], shape: tuple[int, ...]) -> np.ndarray:
    """Whether the argument only rises, or only falls."""
    if not slope:
        return np.zeros(shape, dtype=bool)
    least, greatest = (np.broadcast_to(v, shape) for v in slope[0])
    return (least > 0) | (greatest < 0)


def _crossings(function: ca.Function, switch: Switch, a: float, b: float, values: Sequence[float]) -> list[float]:
    """Where an argument that only rises or falls between a and b is at a level."""
    from scipy.optimize import brentq

    def at(x: float) -> float:
        return float(function(x, list(values))[0])

    first, last = at(a), at(b)
    low, high = min(first, last), max(first, last)
    out = []
    for level in switch.within(low, high).tolist():
        if level in (first, last):
            out.append(a if level == first else b)
        else:
            out.append(float(brentq(lambda x, level=level: at(x) - level, a, b, xtol=TINY, rtol=1e-15)))
    return out


def _apart(found: list[float], room: Callable[[float], float]) -> list[float]:
    """Abscissae in order, those nearer to each other than the room at the second taken for one."""
    return [*found[:1], *(b for a, b in pairwise(found) if b - a > room(b))]
