"""Distances between many pairs of points of a spheroid, each geodesic as the departure from a great circle.

The auxiliary sphere of reduced latitudes, tan(beta) = (1 - f) tan(phi), carries
the unit vectors u; the spheroid is (a u1, a u2, b u3), and the length

    l = a integral of sqrt(|du|^2 - e^2 du3^2),  e^2 = f (2 - f).

Around the great circle through two points, with x along it and y across,

    u3 = cos(y) (A cos(x) + B sin(x)) + C sin(y),

where (A, B, C) are the components of the pole along the start, along the way
and across it. There is no pole to avoid, meridian and equator are y = 0, and
every other geodesic departs from that by an angle of the order of f.

The curvature of a spheroid is greatest at the equator, 1/b^2 (where it is
prolate at the poles, b^2/a^4), and a geodesic no longer than pi over its root
is the shortest of all (Klingenberg, "Contributions to Riemannian geometry in the
large", Ann. of Math. 69 (1959), theorem 1). Pairs further apart are nearly antipodal.
Up to four geodesics join those (Karney, "Algorithms for geodesics", J. Geodesy 87
(2013), sect. 3); of the shortest two, one may be a local minimum only.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import casadi as ca
import numpy as np

import varcalc as vc

ONE_MESH = vc.Ritz(degree=24, refine=False, starts=1)
"""Resolves any geodesic between nearly antipodal points, and makes short work of circles that lead to none."""
WORTHLESS = 1e-12
"""Relative error of such a geodesic with which it does not count."""
TOLERANCE = 1e-12
"""Relative error of a length that is asked for."""
REDUCED = 8 * np.finfo(float).eps
"""What the round-off of the ends' coordinates on the auxiliary sphere adds to a length, relative to it."""
AROUND = np.arange(4) * math.pi / 2
"""Angles about the axis of nearly antipodal points at which great circles are tried between them."""
BESIDE = 0.999
"""Component of the axis along the pole beyond which that lies in no direction from it."""


def departing(x: Any, y: Any, dx: Any, dy: Any, p: Any) -> Any:
    """The length element along (x, y) with the velocity (dx, dy)."""
    along, slope = p.A * ca.cos(x) + p.B * ca.sin(x), p.B * ca.cos(x) - p.A * ca.sin(x)
    rise = ca.cos(y) * slope * dx + (p.C * ca.cos(y) - along * ca.sin(y)) * dy
    return p.a * ca.sqrt((ca.cos(y) * dx) ** 2 + dy**2 - p.f * (2 - p.f) * rise**2)


def beside_great_circle(spheroid: Mapping[str, float]) -> vc.Problem:
    """The shortest departure from a great circle of length ``arc``, whose pole has the components A, B and C."""
    return vc.Problem(
        lambda x, y, dy, p: departing(x, y, 1, dy, p),
        vc.Fixed(0, 0),
        vc.Fixed(vc.Parameter("arc"), 0),
        parameters={**spheroid, "A": 0.0, "B": 0.6, "C": 0.8, "arc": 1.0},
        name="beside a great circle",
    )


def beside_any_circle(spheroid: Mapping[str, float]) -> vc.Curve:
    """The same as a curve, from and to points that need not lie on the circle."""
    return vc.Curve(
        lambda q, dq, p: departing(q[0], q[1], dq[0], dq[1], p),
        vc.At((vc.Parameter("x0"), vc.Parameter("y0"))),
        vc.At((vc.Parameter("x1"), vc.Parameter("y1"))),
        parameters={**spheroid, "A": 0.0, "B": 0.6, "C": 0.8, "x0": 0.0, "y0": 0.0, "x1": 1.0, "y1": 0.0},
        name="beside any circle",
    )


@dataclass(frozen=True)
class Distances:
    """Lengths (K,), how far each may be off, and where it is certain that no curve is shorter.

    Where ``certain`` is False the ends are nearly antipodal: the length is that of the shortest geodesic found,
    NaN where none was.
    """

    lengths: np.ndarray
    errors: np.ndarray
    certain: np.ndarray


def distances(start: Any, end: Any, spheroid: Mapping[str, float], cores: int = 1) -> Distances:
    """The distances from ``start`` to ``end``, each (K, 2) of latitudes and longitudes in radians.

    ``spheroid`` gives the equatorial radius ``a`` and the flattening ``f``; ``cores`` is that of :func:`varcalc.sweep`.

    Raises ValueError where these are not finite, or a latitude lies beyond a pole.

    >>> from varcalc.problems.spheroid import EARTH, distances
    >>> distances([[0.7, 0.0]], [[0.75, 1.8]], EARTH).lengths.round(3).tolist()
    [8006550.374]
    """
    points = _checked(start), _checked(end)
    if points[0].shape != points[1].shape:
        raise ValueError(f"start has {len(points[0])} points and end {len(points[1])}; give one of each for a pair")
    circles = _circles(*points, spheroid["f"])
    count = len(circles["arc"])
    lengths, errors = np.zeros(count), np.zeros(count)
    # next to the antipode the departure is no small one, and may be to any side
    facing = circles["arc"] >= math.pi * (1 - abs(spheroid["f"]))
    apart = np.flatnonzero((circles["arc"] > 0) & ~facing)
    if len(apart):
        values = vc.Paired({name: column[apart] for name, column in circles.items()})
        problem = partial(beside_great_circle, dict(spheroid))
        found = vc.sweep(problem, values, vc.Ritz(), tol=TOLERANCE, cores=cores)
        lengths[apart], errors[apart] = found.values, found.claimed_errors
    lengths[facing] = math.nan
    least = _least_conjugate(spheroid)
    unsure = np.flatnonzero(~(lengths + errors < least))
    if len(unsure):
        ends = [[_unit(p[row], spheroid["f"]) for p in points] for row in unsure]
        lengths[unsure], errors[unsure] = np.transpose(_shortest_ways(spheroid, ends))
    errors += REDUCED * lengths
    return Distances(lengths, errors, lengths + errors < least)


def _shortest_ways(spheroid: Mapping[str, float], ends: list[list[np.ndarray]]) -> list[tuple[float, float]]:
    """Length and error of the shortest geodesic found between each two nearly antipodal points; NaN where none was."""
    problem, found = beside_any_circle(spheroid), []
    for first, last in ends:
        ways = [vc.solve(problem.with_parameters(w), ONE_MESH, throw=False) for w in _ways(first, last)]
        best = min((s for s in ways if s.status.ok), key=lambda s: s.value, default=None)
        good = best is not None and best.error.value <= WORTHLESS * best.value
        found.append((best.value, best.error.value) if best is not None and good else (math.nan, math.nan))
    return found


def _checked(points: Any) -> np.ndarray:
    given = np.atleast_2d(np.asarray(points, dtype=float))
    if given.ndim != 2 or given.shape[1] != 2:
        raise ValueError(f"points must be given as (K, 2) latitudes and longitudes, not of shape {given.shape}")
    if not np.isfinite(given).all() or np.abs(given[:, 0]).max(initial=0.0) > math.pi / 2:
        raise ValueError("points must be finite latitudes and longitudes in radians, latitudes within pi/2")
    return given


def _least_conjugate(spheroid: Mapping[str, float]) -> float:
    """A length within which every geodesic is the shortest: pi over the root of the greatest curvature."""
    a, b = spheroid["a"], spheroid["a"] * (1 - spheroid["f"])
    return math.pi / math.sqrt(max(1 / b**2, b**2 / a**4))


def _circles(start: np.ndarray, end: np.ndarray, f: float) -> dict[str, np.ndarray]:
    """The great circles of the auxiliary sphere from ``start`` to ``end``: length, and components of the pole.

    Written in differences of the coordinates, which keep their relative accuracy for points close by.
    """
    turn = np.subtract(end[:, 1], start[:, 1])
    turn -= 2 * math.pi * np.round(turn / (2 * math.pi))
    (c1, s1, r1), (c2, s2, r2) = (_reduced(p[:, 0], f) for p in (start, end))
    rise = (1 - f) * np.sin(end[:, 0] - start[:, 0]) / (r1 * r2)  # the sine of the difference of reduced latitudes
    east, north = c2 * np.sin(turn), rise + 2 * s1 * c2 * np.sin(turn / 2) ** 2
    sine, cosine = np.hypot(east, north), s1 * s2 + c1 * c2 * np.cos(turn)
    there = sine > 0
    unit = np.where(there, sine, 1.0)
    # antipodes are joined by any meridian
    ahead, aside = np.where(there, north / unit, 1.0), np.where(there, east / unit, 0.0)
    return {"arc": np.arctan2(sine, cosine), "A": s1, "B": c1 * ahead, "C": c1 * aside}


def _reduced(latitude: np.ndarray, f: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cosine and sine of the reduced latitude, and what they were divided by."""
    cosine, sine = np.cos(latitude), (1 - f) * np.sin(latitude)
    size = np.hypot(cosine, sine)
    return cosine / size, sine / size, size


def _unit(point: np.ndarray, f: float) -> np.ndarray:
    """The point of the auxiliary sphere."""
    cosine, sine, _ = _reduced(point[0], f)
    return np.array([cosine * math.cos(point[1]), cosine * math.sin(point[1]), sine])


def _ways(first: np.ndarray, last: np.ndarray) -> list[dict[str, float]]:
    """Great circles along the axis of two nearly antipodal points, on every side of it, and where the points lie."""
    axis = (first - last) / np.linalg.norm(first - last)
    # towards the pole if it lies aside, where the shortest ways lead over it or along the equator
    aside = np.eye(3)[2 if abs(axis[2]) < BESIDE else np.abs(axis).argmin()]
    aside = aside - (aside @ axis) * axis
    aside /= np.linalg.norm(aside)
    ways = []
    for angle in AROUND:
        ahead = math.cos(angle) * aside + math.sin(angle) * np.cross(axis, aside)
        across = np.cross(axis, ahead)
        (x0, y0), (x1, y1) = ((math.atan2(u @ ahead, u @ axis), math.asin(u @ across)) for u in (first, last))
        pole = {"A": float(axis[2]), "B": float(ahead[2]), "C": float(across[2])}
        ways.append({**pole, "x0": x0, "y0": y0, "x1": x1 % (2 * math.pi), "y1": y1})
    return ways
