"""The least value that IPOPT comes to, of functionals of other kinds: an upper bound that uses nothing of the library.

Sums are minimised over polygons, at second order over Hermite's cubics, from curves at random, with what switches
rounded off; what that comes to is summed by fine rules as it is stated.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from campaigns.kinds import Drawn, Switches

ROUNDED = 1e-3
"""How wide what switches is rounded off."""
PIECES, STARTS, FINE, ITERATIONS = 32, 14, 600, 300
"""Pieces of a curve, curves at random, parts of a piece of the fine rule, and IPOPT's iterations."""
SIZES = 0.0, 0.5, 1.5
"""Sizes of the waves on the curves at random, one after the other."""
LEVEL_KEPT = 1e-6
"""How nearly a curve keeps its level."""
QUIET = {"print_time": 0, "ipopt": {"print_level": 0, "sb": "yes", "max_iter": ITERATIONS}}


def least_seen(given: Drawn, starts: int = STARTS) -> float:
    """The least sum of an admitted curve; infinite where none was found."""
    kind, rng = given.kind, np.random.default_rng(5)
    x = np.linspace(0.0, given.span, PIECES + 1)
    x = np.union1d(x, [given.waypoint[0]]) if kind.through else x
    low, high = _ends(given, x)
    nodes = ca.MX.sym("nodes", *low.shape)
    rounded, stated = _piece(given, Switches(ROUNDED), 1), _piece(given, Switches(), FINE)
    value, level = _summed(rounded, x, nodes)
    conditions = [nodes[:, 0] - nodes[:, -1]] if kind.closed else []
    conditions += [level - given.level] if kind.levelled else []
    solver = ca.nlpsol("least", "ipopt", {"x": ca.vec(nodes), "f": value, "g": ca.vertcat(*conditions)}, QUIET)
    fine = ca.Function("fine", [nodes], list(_summed(stated, x, nodes)))
    least = np.inf
    for number in range(starts):
        guess = np.clip(_at_random(given, x, rng, SIZES[number % len(SIZES)] if number else 0.0), low, high)
        found = solver(x0=guess.ravel("F"), lbx=low.ravel("F"), ubx=high.ravel("F"), lbg=0, ubg=0)
        curve = np.clip(np.asarray(found["x"]).reshape(low.shape, order="F"), low, high)
        if kind.closed:
            curve[:, -1] = curve[:, 0]
        summed, kept = (float(v) for v in fine(curve))
        if not kind.levelled or abs(kept - given.level) < LEVEL_KEPT:
            least = min(least, summed)
    return least


def _ends(given: Drawn, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What each number at each vertex lies between: at second order the ordinates, then the slopes."""
    kind, n = given.kind, given.kind.functions
    low = np.full((n * kind.order, len(x)), -np.inf)
    if not kind.closed:
        for column, place, slope in ((0, given.start, given.slopes[0]), (-1, given.end, given.slopes[1])):
            if column == 0 or not given.free:
                low[:n, column], low[n:, column] = place, slope
    high = np.where(np.isfinite(low), low, np.inf)
    if kind.through:
        row = int(np.argmin(np.abs(x - given.waypoint[0])))
        low[0, row] = high[0, row] = given.waypoint[1]
    return low, high


def _piece(given: Drawn, switches: Switches, parts: int) -> ca.Function:
    """What a piece sums, and what it adds to the level, of its place, its length and the numbers at its ends."""
    n, order = given.kind.functions, given.kind.order
    x, h = ca.SX.sym("x"), ca.SX.sym("h")
    first, last = ca.SX.sym("first", n * order), ca.SX.sym("last", n * order)
    points, weights = np.polynomial.legendre.leggauss(3)
    value, level = ca.SX(0), ca.SX(0)
    for part in range(parts):
        for point, weight in zip(points.tolist(), weights.tolist(), strict=True):
            t, share = (part + (1 + point) / 2) / parts, weight / 2 / parts
            y, v, bends = (_straight if order == 1 else _cubic)(t, h, first, last)
            value += share * h * given.lagrangian(x + t * h, y, v, bends, switches)
            level += share * h * given.levelled(y, v)
    return ca.Function("piece", [x, h, first, last], [value, level])


def _straight(t: float, h: Any, first: Any, last: Any) -> tuple[Any, Any, Any]:
    return first + t * (last - first), (last - first) / h, None


def _cubic(t: float, h: Any, first: Any, last: Any) -> tuple[Any, Any, Any]:
    """Hermite's cubic of the ordinates, then the slopes, at both ends."""
    (p, v), (q, w) = (ca.vertsplit(end, end.numel() // 2) for end in (first, last))
    y = (
        p * (2 * t**3 - 3 * t**2 + 1)
        + h * v * (t**3 - 2 * t**2 + t)
        + q * (3 * t**2 - 2 * t**3)
        + h * w * (t**3 - t**2)
    )
    slope = (q - p) * (6 * t - 6 * t**2) / h + v * (3 * t**2 - 4 * t + 1) + w * (3 * t**2 - 2 * t)
    bends = (q - p) * (6 - 12 * t) / h**2 + (v * (6 * t - 4) + w * (6 * t - 2)) / h
    return y, slope, bends


def _summed(piece: ca.Function, x: np.ndarray, nodes: Any) -> tuple[Any, Any]:
    value, level = piece.map(len(x) - 1)(x[None, :-1], np.diff(x)[None], nodes[:, :-1], nodes[:, 1:])
    return ca.sum2(value), ca.sum2(level)


def _at_random(given: Drawn, x: np.ndarray, rng: np.random.Generator, size: float) -> np.ndarray:
    """A line between ends, waves on it, and at second order its slopes."""
    t, n = x / given.span, given.kind.functions
    last = given.start + 1.5 * rng.normal(size=n) if given.free else given.end
    y = np.outer(given.start, 1 - t) + np.outer(last, t)
    if given.kind.closed:
        y = np.outer(1.2 * rng.normal(size=n), np.ones(len(x)))
    for turns in (1, 2, 3):
        y = y + size * rng.normal(size=(n, 1)) / turns * np.sin(turns * np.pi * t)
    return y if given.kind.order == 1 else np.vstack([y, np.gradient(y, x, axis=1)])
