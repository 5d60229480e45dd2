"""Random layers, and how many rays join points in them by fans that know nothing of varcalc.

In layers y'' = (n²)'/(2 p²) along x, p = n cos θ at the start, so that a fan of rays is stepped in x by a symplectic
rule of fourth order (Yoshida, Phys. Lett. A 150 (1990) 262); where n² is linear in pieces by parabolas from one kink to
the next. Between two rays of which one goes above a receiver and
the other below there is a ray to it. Where the count is not the one that is claimed, the fan is laid closer wherever
it all but turns round at the receiver.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from varcalc import optics

FIRST = 1 / (2 - 2 ** (1 / 3))
SHARES = (FIRST, 1 - 2 * FIRST, FIRST)
"""Of a step: Yoshida's."""
STEEPEST = 1.5
"""Radians: rays that start steeper are not counted, and not asked for."""
CLOSER = 400
"""Rays laid between two neighbours of the fan."""
SUSPECTED = 60
"""Stretches of a fan, of those nearest to a receiver, that are looked at closer."""
SUSPICIOUS = 2.0
"""Second differences of a fan from a height: farther away it does not turn round there."""
BISECTIONS, PARTED = 45, 1e-6
"""Of a stretch between two neighbours, after which rays that are so far apart have parted at a kink."""
LONGEST = 1.3
"""Optical paths are asked for up to so many times that of the farthest level ray."""


@dataclass(frozen=True)
class Scenery:
    """A medium with ``g`` = n² and its ``slope``, a source height, and the ``turn`` x in which rays turn, about.

    ``low`` and ``high`` bound the medium; ``heights`` those of receivers, ``spread`` is the tangent of rays that turn.
    """

    medium: optics.Medium
    g: Callable[[np.ndarray], np.ndarray]
    slope: Callable[[np.ndarray], np.ndarray]
    source: float
    heights: tuple[float, float]
    turn: float
    spread: float
    low: float = -np.inf
    high: float = np.inf
    steps: int = 50
    """For each turn; as many as the steepest rays that are asked for need."""
    turns: tuple[float, float] = (2, 16)
    """Of the farthest receiver: how many turns it is away, at least and at most."""
    pieces: tuple[np.ndarray, np.ndarray] | None = None
    """Heights and n² there, where n² is linear between them and they reach as far as rays do."""


def duct(rng: np.random.Generator) -> Scenery:
    """One to three Gaussians of strengths from 1e-6 to 1e-1."""
    k, size, width = rng.integers(1, 4), 10.0 ** rng.uniform(-6, -1), 10.0 ** rng.uniform(-1, 1)
    a, c, s = size * rng.uniform(-1, 1, k), width * rng.uniform(-2, 2, k), width * rng.uniform(0.3, 1.5, k)
    a[0] = size
    terms = list(zip(a.tolist(), c.tolist(), s.tolist(), strict=True))

    def slope(y: np.ndarray) -> np.ndarray:
        return sum((-4 * a * (y - c) / s**2 * np.exp(-(((y - c) / s) ** 2)) for a, c, s in terms), np.zeros_like(y))

    def g(y: np.ndarray) -> np.ndarray:
        return 1 + sum(2 * a * np.exp(-(((y - c) / s) ** 2)) for a, c, s in terms)

    medium = optics.Stratified(lambda y: ca.sqrt(1 + sum(2 * a * ca.exp(-(((y - c) / s) ** 2)) for a, c, s in terms)))
    reach = 1.5 * width
    return Scenery(
        medium, g, slope, rng.uniform(-reach, reach), (-reach, reach), width / np.sqrt(2 * size), 3 * np.sqrt(2 * size)
    )


def mirage(rng: np.random.Generator) -> Scenery:
    """Air over warm ground: n² grows from it by a few 1e-5, exponentially, over metres."""
    size, height = 10.0 ** rng.uniform(-5, -4), 10.0 ** rng.uniform(-0.5, 1)
    medium = optics.Stratified(lambda y: ca.sqrt(1.0006 - 2 * size * ca.exp(-y / height)))
    return Scenery(
        medium, lambda y: 1.0006 - 2 * size * np.exp(-y / height), lambda y: 2 * size / height * np.exp(-y / height),
        height * rng.uniform(0.2, 3), (0.1 * height, 3 * height), 2 * height / np.sqrt(2 * size), 3 * np.sqrt(2 * size),
    )  # fmt: skip


def channel(rng: np.random.Generator, turns: tuple[float, float] = (2, 16)) -> Scenery:
    """Munk's sound channel (J. Acoust. Soc. Am. 55 (1974) 220) with its axis and strength drawn."""
    axis, strength = rng.uniform(700, 1500), rng.uniform(0.004, 0.01)

    def speed(z, exp):
        eta = -2 * (z + axis) / axis
        return 1 + strength * (eta - 1 + exp(-eta))

    def slope(y: np.ndarray) -> np.ndarray:
        rate = strength * (-2 / axis) * (1 - np.exp(2 * (y + axis) / axis))
        return -2 * rate / speed(y, np.exp) ** 3

    return Scenery(
        optics.Stratified(lambda z: 1 / speed(z, ca.exp)), lambda y: 1 / speed(y, np.exp) ** 2, slope,
        -rng.uniform(0.2, 2) * axis, (-2 * axis, -0.2 * axis), 2e4, 0.3, steps=400, turns=turns,
    )  # fmt: skip


def firn(rng: np.random.Generator) -> Scenery:
    """Snow that turns to ice: n = 1.78 - b exp(z / L)."""
    b, length = rng.uniform(0.3, 0.5), rng.uniform(40, 100)
    return Scenery(
        optics.Stratified(lambda z: 1.78 - b * ca.exp(z / length)), lambda y: (1.78 - b * np.exp(y / length)) ** 2,
        lambda y: -2 * (1.78 - b * np.exp(y / length)) * b / length * np.exp(y / length),
        -rng.uniform(0.2, 4) * length, (-4 * length, -0.2 * length), 3 * length, 1.5,
    )  # fmt: skip


def wells(rng: np.random.Generator) -> Scenery:
    """Two waves of the index, with barriers between their crests."""
    a, b, k, m = rng.uniform(0.1, 0.5), rng.uniform(0.05, 0.3), rng.uniform(1, 4), rng.uniform(4, 8)
    return Scenery(
        optics.Stratified(lambda y: ca.sqrt(2 + a * ca.sin(k * y) + b * ca.cos(m * y))),
        lambda y: 2 + a * np.sin(k * y) + b * np.cos(m * y), lambda y: a * k * np.cos(k * y) - b * m * np.sin(m * y),
        rng.uniform(-1, 1), (-1.5, 1.5), 1.0, 3.0,
    )  # fmt: skip


def ionosphere(rng: np.random.Generator) -> Scenery:
    """Air, and above a height an n² that falls linearly: a kink."""
    height, fall = rng.uniform(0.5, 2), 10.0 ** rng.uniform(-1.5, 0)
    return Scenery(
        optics.Stratified(lambda y: ca.sqrt(1 - fall * ca.fmax(y - height, 0))),
        lambda y: 1 - fall * np.maximum(y - height, 0), lambda y: np.where(y > height, -fall, 0.0),
        rng.uniform(0, 0.4), (-0.4, 0.4), 4 / np.sqrt(fall), 3.0,
        pieces=(np.array([-1e4, height, height + 2 / fall]), np.array([1.0, 1.0, -1.0])),
    )  # fmt: skip


def rod(rng: np.random.Generator) -> Scenery:
    """n² = n0² (1 - (y / R)²), to where it is nothing; from close to there rays turn the more quickly."""
    index, radius = rng.uniform(1.2, 1.8), rng.uniform(0.5, 3)
    source = rng.uniform(-0.999, 0.999) * radius
    return Scenery(
        optics.Stratified(lambda y: index * ca.sqrt(1 - (y / radius) ** 2)),
        lambda y: index**2 * (1 - (y / radius) ** 2), lambda y: -2 * index**2 * y / radius**2,
        source, (-0.999 * radius, 0.999 * radius), float(np.sqrt(radius**2 - source**2)), 5.0,
    )  # fmt: skip


def table(rng: np.random.Generator, *, smooth: bool) -> Scenery:
    """An index given at four to thirteen heights."""
    from scipy.interpolate import CubicSpline

    k, size = int(rng.integers(4, 14)), 10.0 ** rng.uniform(-5, -1.5)
    heights = np.linspace(-1, 0, k) + np.pad(rng.uniform(-0.3, 0.3, k - 2) / k, 1)
    index = 1 + size * np.cumsum(rng.normal(size=k)) * 0.3
    n2 = index**2
    spline = CubicSpline(heights, n2)
    steps = np.diff(n2) / np.diff(heights)
    rate = spline.derivative()
    return Scenery(
        optics.Tabulated(heights, index, smooth=smooth),
        (lambda y: spline(np.clip(y, -1, 0))) if smooth else (lambda y: np.interp(y, heights, n2)),
        (lambda y: rate(np.clip(y, -1, 0))) if smooth
        else (lambda y: steps[np.clip(np.searchsorted(heights, y) - 1, 0, k - 2)]),
        rng.uniform(-0.9, -0.1), (-0.95, -0.05), 1 / k / np.sqrt(size), 3 * np.sqrt(2 * size), -1.0, 0.0,
        pieces=None if smooth else (heights, n2),
    )  # fmt: skip


FAMILIES: dict[str, Callable[[np.random.Generator], Scenery]] = {
    "ducts": duct, "mirages": mirage, "channels": channel,
    "channels to 1000 km": lambda rng: channel(rng, (25, 50)), "firn": firn, "wells": wells, "ionospheres": ionosphere,
    "rods": rod, "smooth tables": lambda rng: table(rng, smooth=True),
    "linear tables": lambda rng: table(rng, smooth=False),
}  # fmt: skip
"""By name."""


@dataclass(frozen=True)
class Fan:
    """Where rays at ``angles`` (m,) are at some places: heights and optical paths (stops, m), NaN where lost."""

    scenery: Scenery
    angles: np.ndarray
    heights: np.ndarray
    paths: np.ndarray
    places: np.ndarray


def fan(scenery: Scenery, angles: np.ndarray, step: float, stops: np.ndarray) -> Fan:
    """Rays at ``angles`` (m,) after whole numbers of steps, ascending ``stops``."""
    if scenery.pieces is not None:
        return parabolas(scenery, scenery.pieces, angles, step * stops)
    y = np.full_like(angles, scenery.source)
    squared = float(scenery.g(np.array([scenery.source]))[0]) * np.cos(angles) ** 2
    tangent, path = np.tan(angles), np.zeros_like(angles)
    heights, paths = [], []
    with np.errstate(all="ignore"):
        for number in range(1, int(stops[-1]) + 1):
            before = scenery.g(y)
            for share in SHARES:
                y = y + 0.5 * share * step * tangent
                tangent = tangent + share * step * scenery.slope(y) / (2 * squared)
                y = y + 0.5 * share * step * tangent
            path += step * (before + scenery.g(y)) / 2 / np.sqrt(squared)
            y[(y < scenery.low) | (y > scenery.high)] = np.nan
            if number in stops:
                heights.append(y.copy())
                paths.append(path.copy())
    return Fan(scenery, angles, np.array(heights), np.array(paths), step * stops)


def parabolas(scenery: Scenery, pieces: tuple[np.ndarray, np.ndarray], angles: np.ndarray, stops: np.ndarray) -> Fan:
    """Rays at ``angles`` (m,) at the abscissae ``stops``, by parabolas in each piece."""
    knots, n2 = pieces
    slopes = np.diff(n2) / np.diff(knots)
    squared = float(np.interp(scenery.source, knots, n2)) * np.cos(angles) ** 2
    p, y, x, path = np.sqrt(squared), np.full_like(angles, scenery.source), np.zeros_like(angles), np.zeros_like(angles)
    w = np.tan(angles) * p
    layer = np.full(len(angles), int(np.clip(np.searchsorted(knots, scenery.source) - 1, 0, len(slopes) - 1)))
    heights, paths = [], []
    with np.errstate(all="ignore"):
        for stop in stops:
            going = np.flatnonzero(np.isfinite(y))
            while len(going):
                k, a, v, u = layer[going], slopes[layer[going]] / 4, w[going], y[going]
                times = np.stack([_ahead(a, v, u - knots[k + side]) for side in (0, 1)])
                side = np.argmin(times, axis=0)
                rest = (stop - x[going]) / p[going]
                t = np.minimum(times.min(axis=0), rest)
                level = np.interp(u, knots, n2)
                path[going] += level * t + 4 * a * (v * t**2 / 2 + a * t**3 / 3)
                y[going], w[going] = u + v * t + a * t**2, v + 2 * a * t
                x[going] += p[going] * t
                meets = times.min(axis=0) < rest
                at = going[meets]
                y[at] = knots[k[meets] + side[meets]]
                layer[at] = k[meets] + np.where(side[meets] == 1, 1, -1)
                gone = (layer[at] < 0) | (layer[at] >= len(slopes))
                y[at[gone]], layer[at[gone]] = np.nan, 0
                going = at[~gone]
            heights.append(y.copy())
            paths.append(path.copy())
    return Fan(scenery, angles, np.array(heights), np.array(paths), stops)


def _ahead(a: np.ndarray, v: np.ndarray, c: np.ndarray) -> np.ndarray:
    """The first positive root of a t² + v t + c; infinite where there is none. A root at 0 is where the ray starts."""
    c = np.where(np.abs(c) < 1e-13, 0.0, c)
    root = np.sqrt(v**2 - 4 * a * c)
    q = -(v + np.where(v >= 0, root, -root)) / 2
    roots = np.stack([q / a, c / q])
    roots = np.where(np.isfinite(roots) & (roots > 1e-12), roots, np.inf)
    return roots.min(axis=0)


def counted(rays: Fan, stop: int, height: float, within: float) -> int:
    """How many rays of optical paths up to ``within`` come to a height between neighbours of a fan.

    At a kink neighbours may part for good.
    """
    off, path = np.sign(rays.heights[stop] - height), rays.paths[stop]
    found = np.flatnonzero((off[1:] * off[:-1] < 0) & (np.fmax(path[1:], path[:-1]) <= within))
    scenery = rays.scenery
    if scenery.pieces is None or len(found) == 0:
        return len(found)
    low, high, first = rays.angles[found], rays.angles[found + 1], off[found]
    at = rays.places[[stop]]
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        same = np.sign(parabolas(scenery, scenery.pieces, middle, at).heights[0] - height) == first
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    ends = [parabolas(scenery, scenery.pieces, side, at).heights[0] for side in (low, high)]
    return int(np.count_nonzero(np.abs(ends[0] - ends[1]) < PARTED))


def closer(rays: Fan, step: float, stop: int, height: float) -> Fan:
    """The fan at one stop, with more rays where it comes nearest to a height and turns round, or leaves."""
    off = np.abs(rays.heights[stop] - height)
    near = np.flatnonzero((off[1:-1] <= off[2:]) & (off[1:-1] <= off[:-2])) + 1
    # between three rays a smooth fan goes beyond the middle one by an eighth of their second difference, at the most
    bent = np.abs(rays.heights[stop][near + 1] - 2 * rays.heights[stop][near] + rays.heights[stop][near - 1])
    near = near[off[near] <= SUSPICIOUS * bent]
    lost = np.flatnonzero(np.isnan(off[1:]) != np.isnan(off[:-1]))
    chosen = np.concatenate([near[np.argsort(off[near])[:SUSPECTED]], lost])
    low, high = rays.angles[np.maximum(chosen - 1, 0)], rays.angles[np.minimum(chosen + 1, len(off) - 1)]
    between = np.unique(low[:, None] + (high - low)[:, None] * np.linspace(0, 1, CLOSER))
    more = fan(rays.scenery, between, step, np.array([round(rays.places[stop] / step)]))
    angles, first = np.unique(np.append(rays.angles, between), return_index=True)
    heights, paths = (
        np.append(own[stop], new[0])[None, first]
        for own, new in ((rays.heights, more.heights), (rays.paths, more.paths))
    )  # fmt: skip
    return Fan(rays.scenery, angles, heights, paths, rays.places[[stop]])
