"""Random pairs of points with the optical paths of all rays between them, found without tracing any.

The first family lies in n² = 1 - 2y, where the rays are parabolas and the arrivals
a quadratic equation. The second goes through layers: the horizontal momentum κ
of a ray is the same in all of them, and each adds to the range X(κ) what an
elementary integral says. There X is tabulated over the launching angle, its
extrema are refined, and every stretch between two of them is searched for
the receiver: all zeros, by exhaustion. A third lies in Maxwell's fish-eye,
where rays are the great circles of a sphere, gone round either way and any
number of times. A fourth lies between two mirrors, where rays are straight to
images of the source, and graze the mirrors when it is far.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

import casadi as ca
import numpy as np
from scipy.optimize import brentq, minimize_scalar

from varcalc import optics

NEAR = 1e-6
"""Pairs near the caustic are no farther from it than this."""
CLOSEST = 1e-16
"""The nearest of them are so close, or as close as round-off."""
ROUND_OFF = 3e-13
"""Closer to the caustic than this, relative to the distance of the points, two rays cannot be told from one or none."""


@dataclass(frozen=True)
class Drawn:
    """One pair: the points, the ``paths`` of its rays in ascending order, the ``depth`` of B inside the caustic.

    ``depth`` is a length, negative in the shadow and infinite where the pair was not placed near a caustic.
    """

    source: tuple[float, float]
    receiver: tuple[float, float]
    paths: tuple[float, ...]
    depth: float

    @property
    def on_caustic(self) -> bool:
        """Whether round-off decides how many rays there are."""
        size = float(np.hypot(self.receiver[0] - self.source[0], self.receiver[1] - self.source[1]))
        return abs(self.depth) <= ROUND_OFF * size


TURNS = 3
"""Times round the fish-eye that its rays are asked for."""


def fish_eye_pair(rng: np.random.Generator) -> Drawn:
    """Two points within 1.5 of the centre of n = 2 / (1 + r^2), and all arcs between them up to so many turns."""
    a, b = (float(rng.uniform(0.02, 1.5)) * _direction(rng) for _ in range(2))
    first, last = (np.append(2 * p, p @ p - 1) / (1 + p @ p) for p in (a, b))
    angle = float(np.arctan2(np.linalg.norm(np.cross(first, last)), first @ last))
    paths = sorted(arc + 2 * np.pi * k for k in range(TURNS) for arc in (angle, 2 * np.pi - angle))
    return Drawn((float(a[0]), float(a[1])), (float(b[0]), float(b[1])), tuple(paths), float("inf"))


MOST_REFLECTIONS = 8
"""Of rays between two mirrors, one unit apart."""


def guide_pair(rng: np.random.Generator) -> tuple[optics.Scene, Drawn]:
    """Two points between mirrors at y = 0 and y = -1, up to 300 apart, a number of reflections, and the one ray."""
    sides = [optics.Plane((0, 0), (0, 1), mirror=True), optics.Plane((0, -1), (0, 1), mirror=True)]
    first, last, away = -rng.uniform(0.01, 0.99), -rng.uniform(0.01, 0.99), 10 ** rng.uniform(-2, 2.5)
    begin, count = int(rng.integers(2)), int(rng.integers(1, MOST_REFLECTIONS + 1))
    image, met = first, [(begin + k) % 2 for k in range(count)]
    for side in met:
        image = -2 * side - image
    scene = optics.Scene([optics.Uniform(1.0)] * (count + 1), [sides[side] for side in met])
    return scene, Drawn((0.0, first), (away, last), (float(np.hypot(away, image - last)),), float("inf"))


def _direction(rng: np.random.Generator) -> np.ndarray:
    angle = rng.uniform(0, 2 * np.pi)
    return np.array([np.cos(angle), np.sin(angle)])


def linear_scene() -> optics.Scene:
    """n² = 1 - 2y."""
    return optics.Scene(optics.Stratified(lambda y: ca.sqrt(1 - 2 * y)))


def linear_pair(rng: np.random.Generator, near: bool) -> Drawn:
    """A pair in n² = 1 - 2y, for which OPTICS says σ² = 2 (b ± sqrt(b² - d²)) with b = n(A)² - dy."""
    source = rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 0.4)
    squared = 1 - 2 * source[1]
    dx = squared * rng.uniform(-0.95, 0.95)
    caustic = squared / 2 - dx**2 / (2 * squared)
    if near:
        dy = caustic - rng.choice([-1, 1]) * 10 ** rng.uniform(np.log10(CLOSEST), np.log10(NEAR))
    else:
        dy = rng.uniform(-1.5, 1.3) * squared / 2
    receiver = source[0] + dx, min(source[1] + dy, 0.499)
    inside, b, squared, dy, dx = _exactly(source, receiver)
    paths = _linear_paths(inside, b, squared, dy, dx) if inside >= 0 else ()
    gap = inside / (2 * max(b, abs(dx)))  # b² - d² over its derivative by the height, about
    return Drawn(source, receiver, paths, gap)


def _exactly(source: tuple[float, float], receiver: tuple[float, float]) -> tuple[float, ...]:
    """b² - d², b, n², dy and dx without round-off until the end: near the caustic everything cancels."""
    (xa, ya), (xb, yb) = (tuple(map(Fraction, point)) for point in (source, receiver))
    dx, dy, squared = xb - xa, yb - ya, 1 - 2 * ya
    b = squared - dy
    return tuple(float(v) for v in (b * b - dx * dx - dy * dy, b, squared, dy, dx))


def _linear_paths(inside: float, b: float, squared: float, dy: float, dx: float) -> tuple[float, ...]:
    last = np.sqrt(2 * (b + np.sqrt(inside)))
    sigma = np.array([2 * np.hypot(dx, dy) / last, last])  # their product is 2 d
    climb = dy / sigma + sigma / 2
    return tuple(squared * sigma - climb * sigma**2 + sigma**3 / 3)


@dataclass(frozen=True)
class Layers:
    """A source in glass above y = 0, a layer whose n² grows downwards, and below y = -1 one where it falls.

    n² = ``top``² above, ``middle`` - 2 ``gain`` y between, ``bottom`` + 2 ``fall`` (y + 1) below: rays are totally
    reflected beyond a critical angle, and those that get through come down, turn and climb again.
    """

    top: float = 1.5
    middle: float = 1.44
    gain: float = 0.3
    bottom: float = 1.69
    fall: float = 0.6
    height: float = 0.6

    def scene(self) -> optics.Scene:
        """The same for rays to be traced in."""
        media = [
            optics.Uniform(self.top),
            optics.Stratified(lambda y: ca.sqrt(self.middle - 2 * self.gain * y)),
            optics.Stratified(lambda y: ca.sqrt(self.bottom + 2 * self.fall * (y + 1))),
        ]
        return optics.Scene(media, [optics.Plane((0, 0), (0, 1)), optics.Plane((0, -1), (0, 1))])

    def arrival(self, kappa: np.ndarray, depth: float, back: bool) -> tuple[np.ndarray, np.ndarray]:
        """Range and optical path of rays of horizontal momentum κ to the height ``depth``, going down or ``back`` up.

        Not a number where no such ray comes there.
        """
        with np.errstate(invalid="ignore"):
            first = np.sqrt(self.top**2 - kappa**2)
            second = np.sqrt(self.middle - kappa**2)
            leaving = np.sqrt(self.middle + 2 * self.gain - kappa**2)
            third = np.sqrt(self.bottom - kappa**2)
            last = np.sqrt(self.bottom + 2 * self.fall * (depth + 1) - kappa**2)
        last = -last if back else last
        sigma = self.height / first + (leaving - second) / self.gain + (third - last) / self.fall
        path = self.top**2 * self.height / first
        path += kappa**2 * (leaving - second) / self.gain + (leaving**3 - second**3) / (3 * self.gain)
        path += kappa**2 * (third - last) / self.fall + (third**3 - last**3) / (3 * self.fall)
        return kappa * sigma, path


TABLE = 20001
"""Launching angles at which the range is tabulated."""


@dataclass(frozen=True)
class Curve:
    """The range over the launching angle at one height, going one way, between its extrema: ``knots`` are angles."""

    ends: Callable[[float], tuple[float, float, float]]
    knots: list[float]

    def paths(self, x: float) -> list[float]:
        """The optical paths of all rays to the range ``x``."""
        found = []
        ranges = [self.ends(angle)[0] for angle in self.knots]
        for k in range(len(self.knots) - 1):
            if (ranges[k] - x) * (ranges[k + 1] - x) < 0:
                angle = brentq(lambda t: self.ends(t)[0] - x, self.knots[k], self.knots[k + 1], xtol=1e-16, rtol=1e-15)
                reached, path, kappa = self.ends(angle)
                found.append(path + kappa * (x - reached))  # the angle is round, and so the range is
        return found


def curves(layers: Layers, depth: float) -> list[Curve]:
    """The range over the angle from the downward vertical, to the right, for both ways of passing ``depth``."""
    return [_curve(layers, depth, back) for back in (False, True)]


def _curve(layers: Layers, depth: float, back: bool) -> Curve:
    most = np.sqrt(min(layers.middle, layers.bottom + 2 * layers.fall * (depth + 1)))
    critical = np.arcsin(most / layers.top)
    share = np.sin(np.linspace(0.0, np.pi / 2, TABLE))  # close to the critical angle they are close to each other
    angles = critical * share * (1 - 1e-15)

    def ends(angle: float) -> tuple[float, float, float]:
        kappa = layers.top * np.sin(angle)
        x, path = layers.arrival(np.array([kappa]), depth, back)
        return float(x[0]), float(path[0]), float(kappa)

    x, _ = layers.arrival(layers.top * np.sin(angles), depth, back)
    keep = np.isfinite(x)
    angles, x = angles[keep], x[keep]
    turns = np.flatnonzero((x[1:-1] - x[:-2]) * (x[2:] - x[1:-1]) < 0) + 1
    knots = [float(angles[0])]
    for k in turns:
        sign = np.sign(x[k] - x[k - 1])
        best = minimize_scalar(
            lambda t, sign=sign: -sign * ends(t)[0], bounds=(angles[k - 1], angles[k + 1]), method="bounded",
            options={"xatol": 1e-13},
        )  # fmt: skip
        knots.append(float(best.x))
    return Curve(ends, [*knots, float(angles[-1])])


def layered_receivers(rng: np.random.Generator, layers: Layers, count: int) -> list[Drawn]:
    """Receivers of one source at (0, ``layers.height``), every third of them near an extremum of the range."""
    drawn = []
    for number in range(count):
        depth = float(rng.uniform(-2.2, -1.02))
        found = curves(layers, depth)
        extrema = [curve.ends(t) for curve in found for t in curve.knots[1:-1]]
        gap = np.inf
        x = float(rng.uniform(0.0, 6.0))
        if number % 3 == 0 and extrema:
            extremum, _, kappa = extrema[int(rng.integers(len(extrema)))]
            x = extremum + rng.choice([-1, 1]) * 10 ** rng.uniform(np.log10(CLOSEST), np.log10(NEAR))
            squared = layers.bottom + 2 * layers.fall * (depth + 1)
            gap = (x - extremum) * np.sqrt(1 - kappa**2 / squared)  # across the rays
        paths = sorted(path for curve in found for path in curve.paths(x))
        side = float(rng.choice([-1, 1]))
        drawn.append(Drawn((0.0, layers.height), (side * x, depth), tuple(paths), gap))
    return drawn
