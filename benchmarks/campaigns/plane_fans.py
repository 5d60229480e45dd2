"""Random media of the plane, and the rays that join points in them by fans that know nothing of varcalc.

A fan of rays is stepped in σ (r'' = ∇n²/2) by a symplectic rule of fourth order (Yoshida, Phys. Lett. A 150 (1990)
262), its gradients by hand. Neighbouring rays and steps make a net of quadrangles: a receiver is reached once for each
that it lies in, which a refined net about it confirms.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca
import numpy as np
from scipy.interpolate import RectBivariateSpline
from scipy.optimize import root

from varcalc import optics

FIRST = 1 / (2 - 2 ** (1 / 3))
SHARES = (FIRST, 1 - 2 * FIRST, FIRST)
"""Of a step: Yoshida's."""
SquaredIndex = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""From places (m, 2) to n² (m,) and its gradient (m, 2)."""
APPROACHES = 1e-7
"""A ray of the fan that is aimed at a receiver comes so close."""
FINE = 6000
"""Steps of a ray that is followed by itself."""
KINKED = 1600, 2e-4
"""Steps of a ray over kinks, and how well it is told then."""
EDGE = 2.0
"""Of tables."""
CORNERS = (0, 0), (1, 0), (1, 1), (0, 1)
"""Of a quadrangle, one after another: steps and rays from its first."""
PART = 4_000
"""Rays of a fan that are stepped at once."""
SIGMA = 1.6
"""Of the optical path that is asked for: σ of the rays of a fan."""


@dataclass(frozen=True)
class Scenery:
    """A medium, its n² by hand, and optical paths ``within`` which rays are counted; everything is of size 1.

    A ray that is aimed is taken there in so many ``steps``, by which launching angles of one ray agree to ``same``
    radians, and optical paths to ten times that: over kinks the rule is of low order.
    """

    medium: optics.Medium
    squared: SquaredIndex
    within: float
    steps: int = 400
    same: float = 1e-5


def waves(rng: np.random.Generator) -> Scenery:
    """Waves of the index in random directions."""
    k = int(rng.integers(2, 5))
    size, vectors, phase = rng.uniform(0.02, 0.12, k), rng.normal(size=(k, 2)) * rng.uniform(1, 4), rng.uniform(0, 6, k)

    def index(x, y):
        terms = zip(size, vectors, phase, strict=True)
        return ca.sqrt(1.5 + sum(s * ca.sin(v[0] * x + v[1] * y + p) for s, v, p in terms))

    def squared(r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        angle = r @ vectors.T + phase
        return 1.5 + np.sin(angle) @ size, (np.cos(angle) * size) @ vectors

    return Scenery(optics.Graded(index), squared, 6.0)


def lenses(rng: np.random.Generator, narrow: float = 0.0) -> Scenery:
    """Gaussian lenses, stronger and weaker than what is about them; ``narrow`` times narrower than their distances."""
    k = int(rng.integers(1, 5))
    centre, width = rng.uniform(-1, 1, (k, 2)), rng.uniform(0.15, 0.6, k) * 10.0**-narrow
    size = rng.uniform(-0.5, 0.8, k)

    def index(x, y):
        bumps = zip(size, centre, width, strict=True)
        return ca.sqrt(1 + sum(s * ca.exp(-((x - c[0]) ** 2 + (y - c[1]) ** 2) / w**2) for s, c, w in bumps))

    def squared(r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        away = r[:, None] - centre
        bump = size * np.exp(-np.sum(away**2, axis=2) / width**2)
        return 1 + bump.sum(axis=1), np.einsum("mk,mkd->md", -2 * bump / width**2, away)

    return Scenery(optics.Graded(index), squared, 5.0)


def folds(rng: np.random.Generator) -> Scenery:
    """Two kinks across each other."""
    a, b = rng.normal(size=(2, 2))
    p, q = rng.uniform(-0.3, 0.3, 2)
    s, t = rng.uniform(-0.15, 0.15, 2)

    def index(x, y):
        return ca.sqrt(2 + s * ca.fabs(a[0] * x + a[1] * y - p) + t * ca.fmax(b[0] * x + b[1] * y, q))

    def squared(r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        first, second = r @ a - p, r @ b
        slope = s * np.sign(first)[:, None] * a + t * (second > q)[:, None] * b
        return 2 + s * np.abs(first) + t * np.maximum(second, q), slope

    return Scenery(optics.Graded(index), squared, 4.5, *KINKED)


def shells(rng: np.random.Generator) -> Scenery:
    """Shells about a centre, denser and thinner."""
    k = int(rng.integers(1, 4))
    radius, width, size = rng.uniform(0.4, 1.5, k), rng.uniform(0.1, 0.5, k), rng.uniform(-0.4, 0.8, k)

    def index(r):
        return ca.sqrt(1 + sum(s * ca.exp(-(((r - c) / w) ** 2)) for s, c, w in zip(size, radius, width, strict=True)))

    def squared(r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        away = np.linalg.norm(r, axis=1)
        bump = size * np.exp(-(((away[:, None] - radius) / width) ** 2))
        slope = np.sum(-2 * bump * (away[:, None] - radius) / width**2, axis=1) / away
        return 1 + bump.sum(axis=1), slope[:, None] * r

    return Scenery(optics.Radial(index), squared, 5.0)


def patches(
    across: np.ndarray, up: np.ndarray, n: np.ndarray, x: np.ndarray, y: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Values ``n`` at abscissae and heights, linear in each between them, at places (m,); and both derivatives."""
    i, j = (np.clip(np.searchsorted(side, v) - 1, 0, len(side) - 2) for side, v in ((across, x), (up, y)))
    wide, high = across[i + 1] - across[i], up[j + 1] - up[j]
    t, u = (x - across[i]) / wide, (y - up[j]) / high
    below, above = n[i + 1, j] - n[i, j], n[i + 1, j + 1] - n[i, j + 1]
    value = (1 - u) * (n[i, j] + t * below) + u * (n[i, j + 1] + t * above)
    return value, (below + u * (above - below)) / wide, (n[i, j + 1] - n[i, j] + t * (above - below)) / high


def table(rng: np.random.Generator, *, smooth: bool) -> Scenery:
    """An index given at 6 to 12 heights and as many abscissae, a cubic spline in both or linear in each of them.

    Outside there is none.
    """
    k = rng.integers(6, 13, 2)
    sides = [np.sort(np.linspace(-EDGE, EDGE, n) + np.pad(rng.uniform(-0.3, 0.3, n - 2) / n, 1)) for n in k]
    x, y = np.meshgrid(*sides, indexing="ij")
    vector, phase = rng.normal(size=2) * 1.5, rng.uniform(0, 6)
    n = 1.4 + 0.1 * np.sin(vector[0] * x + vector[1] * y + phase) + 0.02 * rng.normal(size=x.shape)
    given = ca.interpolant("n", "bspline" if smooth else "linear", [side.tolist() for side in sides], n.ravel("F"))
    spline = RectBivariateSpline(*sides, n)

    def index(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, ...]:
        if smooth:
            return spline.ev(x, y), spline.ev(x, y, dx=1), spline.ev(x, y, dy=1)
        return patches(sides[0], sides[1], n, x, y)

    def squared(r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        inside = np.all(np.abs(r) <= EDGE, axis=1)
        value, *slope = index(*np.where(inside[:, None], r, 0.0).T)
        return np.where(inside, value**2, np.nan), 2 * value[:, None] * np.stack(slope, axis=1)

    return Scenery(optics.Graded(lambda x, y: given(ca.vertcat(x, y))), squared, 5.0, *(() if smooth else KINKED))


FAMILIES: dict[str, Callable[[np.random.Generator], Scenery]] = {
    "waves": waves, "lenses": lenses, "narrow lenses": lambda rng: lenses(rng, rng.uniform(0.3, 1.3)),
    "folds": folds, "shells": shells, "smooth plane tables": lambda rng: table(rng, smooth=True),
    "linear plane tables": lambda rng: table(rng, smooth=False),
}  # fmt: skip
"""By name."""


def stepped(
    squared: SquaredIndex, r: np.ndarray, p: np.ndarray, h: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rays (m, 2) after one step ``h`` (m, 1) in σ, and the optical path of it (m,)."""
    before = squared(r)[0]
    for share in SHARES:
        r = r + 0.5 * share * h * p
        p = p + 0.5 * share * h * squared(r)[1]
        r = r + 0.5 * share * h * p
    return r, p, h[:, 0] * (before + squared(r)[0]) / 2


def fan(scenery: Scenery, source: np.ndarray, angles: np.ndarray, steps: int) -> tuple[np.ndarray, np.ndarray]:
    """Places (steps + 1, m, 2) and optical paths (steps + 1, m) of rays at ``angles`` (m,)."""
    n = np.sqrt(scenery.squared(source[None])[0][0])
    r = np.tile(source, (len(angles), 1))
    p = n * np.column_stack([np.cos(angles), np.sin(angles)])
    h = np.full((len(angles), 1), SIGMA * scenery.within / steps)
    places, paths = [r], [np.zeros(len(angles))]
    for _ in range(steps):
        r, p, more = stepped(scenery.squared, r, p, h)
        places.append(r)
        paths.append(paths[-1] + more)
    return np.array(places), np.array(paths)


class Meeting(NamedTuple):
    """A target is met by a ray of about this launching ``angle`` and optical ``path``, after so many ``steps``."""

    angle: float
    path: float
    steps: float


@dataclass(frozen=True)
class Net:
    """A fan's quadrangles between neighbouring rays and steps, by their corners (steps + 1, m, 2) and boxes.

    ``angles`` (m,) are those of its rays, ``paths`` (steps + 1, m) the optical paths to the corners.
    """

    angles: np.ndarray
    places: np.ndarray
    paths: np.ndarray
    low: np.ndarray
    high: np.ndarray

    def met(self, target: np.ndarray, within: float) -> list[Meeting]:
        """Where the target (2,) lies, in quadrangles that begin ``within`` that optical path."""
        inside = (self.low <= target) & (self.high >= target)
        maybe = np.argwhere(inside[..., 0] & inside[..., 1] & (self.paths[:-1, :-1] <= within))
        if len(maybe) == 0:
            return []
        step, ray = maybe.T
        around = np.stack([self.places[step + i, ray + k] for i, k in CORNERS], axis=1) - target
        ahead = np.roll(around, -1, axis=1)
        cross = around[..., 0] * ahead[..., 1] - around[..., 1] * ahead[..., 0]
        turn = np.arctan2(cross, np.sum(around * ahead, axis=2)).sum(axis=1)
        found = maybe[np.abs(turn) > np.pi]
        return [Meeting(self.angles[k : k + 2].mean(), self.paths[i : i + 2, k].mean(), i + 0.5) for i, k in found]


def nets(scenery: Scenery, source: np.ndarray, angles: np.ndarray, steps: int) -> Iterator[Net]:
    """The net of a fan at ``angles`` (m,), in parts of so many rays as are kept at once."""
    for first in range(0, len(angles) - 1, PART):
        part = angles[first : first + PART + 1]
        places, paths = fan(scenery, source, part, steps)
        corners = [places[i : len(places) - 1 + i, k : places.shape[1] - 1 + k] for i, k in CORNERS]
        yield Net(part, places, paths, np.minimum.reduce(corners), np.maximum.reduce(corners))


def aimed(
    scenery: Scenery, source: np.ndarray, target: np.ndarray, angle: float, sigma: float
) -> tuple[float, float] | None:
    """The launching angle and the optical path of the ray near a guess that meets the target, by fine steps."""
    n = np.sqrt(scenery.squared(source[None])[0][0])
    steps = scenery.steps

    def end(guess: np.ndarray) -> tuple[np.ndarray, float]:
        r, p = source[None], n * np.array([[np.cos(guess[0]), np.sin(guess[0])]])
        path = 0.0
        for _ in range(steps):
            r, p, more = stepped(scenery.squared, r, p, np.full((1, 1), guess[1] / steps))
            path += float(more[0])
        return r[0], path

    found = root(lambda guess: end(guess)[0] - target, [angle, sigma], tol=1e-11)
    away, path = end(found.x)
    if np.linalg.norm(away - target) > APPROACHES or abs(found.x[0] - angle) > 0.05 or found.x[1] <= 0:
        return None
    return float(found.x[0]), path


def closest(scenery: Scenery, source: np.ndarray, target: np.ndarray, angle: float, sigma: float) -> float:
    """How near a ray comes to the target by fine steps, up to half as far again as it is said to go."""
    n = np.sqrt(scenery.squared(source[None])[0][0])
    r, p = source[None], n * np.array([[np.cos(angle), np.sin(angle)]])
    h, least = np.full((1, 1), 1.5 * sigma / FINE), np.inf
    for _ in range(FINE):
        before = r
        r, p, _ = stepped(scenery.squared, r, p, h)
        along = np.clip(np.sum((target - before) * (r - before)) / np.sum((r - before) ** 2), 0.0, 1.0)
        least = min(least, float(np.linalg.norm(before + along * (r - before) - target)))
    return least
