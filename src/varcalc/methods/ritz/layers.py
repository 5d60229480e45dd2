"""Meshes that close in on where bounds begin to hold a curve.

The curvature jumps there. No higher degree on the same elements tells of what happens in so small a part of one,
beside a vertex, that no point of a rule lies in it, and to compare two degrees is all that an estimate of an error can
do under bounds: elements that are shorter and shorter towards such a vertex do.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from varcalc.methods.ritz.system import RitzSystem

TOUCHES = 1e-4
"""Distance from a bound, in units of its range along the curve, at which it may hold the curve."""
CLEAR_OF_BOUND, FITTED = 1e-2, 3
"""Distance from a bound, in units of the largest in an element, at which it is clear of it, and points so told of."""
CLOSE = 0.02
"""Share of an element by which the place at which a bound begins to hold the curve is off at least."""
OFF = 10.0
"""How far it may be off where the points are so far off a straight line."""
SHORTER = 8.0
"""Factor from one element of a layer to the next."""
UNSEEN = 100.0
"""Length of an element in units of a part of it beside a vertex in which no point of a rule lies.

What is missed there is of the order of the square of that part, which the tolerance decides.
"""
BESIDE_VERTEX = 0.05
"""Share of an element, beside a vertex, in which fewer than two points of a rule lie."""
SHORTEST = 1e-3, 2e-2
"""Shares of the interval between which that length is at any tolerance."""


def layered(system: RitzSystem, z: np.ndarray, tol: float) -> np.ndarray | None:
    """The vertices of a mesh with layers where inequalities begin or cease to hold the curve of ``z``; None without."""
    vertices = system.space.vertices
    shares = (_distances(system, z) <= TOUCHES).mean(axis=2) > 0.5
    changes = vertices[1:-1][(shares[:, 1:] != shares[:, :-1]).any(axis=0)]
    shortest = _shortest(tol) * (vertices[-1] - vertices[0])
    more = []
    for vertex in changes.tolist():
        at = int(np.searchsorted(vertices, vertex))
        for neighbour in (at - 1, at + 1):
            width = float(vertices[neighbour] - vertex)
            count = int(np.ceil(np.log(abs(width) / shortest) / np.log(SHORTER))) if abs(width) > shortest else 0
            more += [vertex + width * SHORTER**-k for k in range(1, count + 1)]
    return np.unique([*vertices, *more]) if more else None


def hidden(tol: float) -> float:
    """What may be hidden beside a vertex of such a layer, in units of what is summed: a bound that gives way there.

    The slope differs by the length of that part, and over it: its square is integrated.
    """
    return float((BESIDE_VERTEX * _shortest(tol)) ** 3)


def _shortest(tol: float) -> float:
    """The length of the shortest element of a layer, in units of the interval."""
    return float(np.clip(UNSEEN * np.sqrt(tol), *SHORTEST))


def cuts(system: RitzSystem, z: np.ndarray, marked: np.ndarray) -> np.ndarray:
    """Where to cut the ``marked`` elements: around where bounds begin to hold the curve, or in two."""
    vertices, points = system.space.vertices, system.x.reshape(system.space.elements, -1)
    distances = _distances(system, z)
    found: list[float] = []
    for e in np.flatnonzero(marked):
        left, right = (float(v) for v in vertices[e : e + 2])
        places = [place for d in distances[:, e] if (place := _begins(points[e], d)) is not None]
        around = [x + side * off for x, off in places for side in (-1, 0, 1)]
        inner = [x for x in around if left < x < right]
        found += inner or [0.5 * (left + right)]
    return np.array(found)


def _begins(x: np.ndarray, distance: np.ndarray) -> tuple[float, float] | None:
    """Where, among points x of an element, a bound begins to hold the curve, and how far off that may be.

    None where it holds all of the element, or none. The ``distance`` from the bound grows as the first or the second
    power of that from the place: a root is straight.
    """
    clear = distance > CLEAR_OF_BOUND * distance.max()
    if clear.all() or clear.sum() < FITTED or clear[0] == clear[-1] or np.count_nonzero(np.diff(clear)) > 1:
        return None
    nearest = np.flatnonzero(clear)[:FITTED] if clear[-1] else np.flatnonzero(clear)[-FITTED:]
    at, unit = x[nearest], float(np.ptp(x[nearest]))
    fits = []
    for power in (1.0, 0.5):
        values = distance[nearest] ** power
        slope, level = np.polyfit((at - at[0]) / unit, values, 1)
        off = float(np.abs(np.polyval([slope, level], (at - at[0]) / unit) - values).max() / abs(slope))
        fits.append((off, float(at[0] - unit * level / slope)))
    off, place = min(fits)
    return place, max(CLOSE * float(np.ptp(x)), OFF * off * unit)


def _distances(system: RitzSystem, z: np.ndarray) -> np.ndarray:
    """How far each inequality is from either of its bounds, in units of its range: (bounds, elements, points)."""
    bounds = [c for c in system.form.conditions.pathwise if not c.equality]
    expressions = ca.densify(ca.vertcat(*(c.expression for c in bounds)))
    values = np.asarray(ca.Function("bounds", system.form.symbols.all, [expressions])(*system.arguments(z)))
    lower, upper = (np.array([[getattr(c, side)] for c in bounds]) for side in ("lower", "upper"))
    distances = np.minimum(values - lower, upper - values) / np.maximum(np.ptp(values, axis=1, keepdims=True), 1e-300)
    return distances.reshape(len(bounds), system.space.elements, -1)
