"""Random problems whose answer is known, or known not to exist.

For any L0 and any curve y*, L0 + s(x) y with s = d/dx L0_v - L0_y along y* has
y* as an extremal and keeps every second derivative, hence the index (the method
of manufactured solutions). The Lagrangians and curves are drawn at random:
convex, so that y* is the one extremal and the minimum; quadratic of any index;
with several extremals; and such as have no extremal or no minimum at all.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import mpmath
import numpy as np

import varcalc as vc
from campaigns.families import WIDEST, wiggle
from campaigns.routes import functional
from campaigns.truth import Extremal, Truth
from campaigns.witness import index
from varcalc.solution import Verdict

Integrand = Callable[[Any, Any, Any], Any]
WAVES = 3


@dataclass(frozen=True)
class Drawn:
    """A random problem, what is known of it, and a random starting curve.

    Where ``complete`` is False there may be extremals besides those of ``truth``, and
    a stationary curve is told by :mod:`campaigns.witness`. Where ``coercive`` a minimum
    is known to exist, though it may not be among them.
    """

    problem: vc.Problem
    truth: Truth
    start: Callable[[float], float]
    complete: bool = True
    coercive: bool = False


@dataclass(frozen=True)
class Path:
    """A smooth random curve: ``of`` an expression of x, over (x0, x1), about ``size`` high."""

    x0: float
    x1: float
    size: float
    slope: float
    waves: np.ndarray

    @classmethod
    def drawn(cls, random: np.random.Generator, longest: float = 3.0) -> Path:
        """Of random length and height."""
        x0 = random.uniform(-2, 2)
        size = math.exp(random.uniform(-1.5, 1.0))
        waves = size * random.standard_normal(WAVES) / (1.0 + np.arange(WAVES)) ** 2
        return cls(x0, x0 + random.uniform(0.4, longest), size, size * random.standard_normal(), waves)

    def of(self, x: Any) -> Any:
        """y*(x), of a number, an array or a symbol."""
        t = (x - self.x0) / (self.x1 - self.x0)
        cos = ca.cos if isinstance(x, ca.SX) else np.cos
        return self.slope * t + sum(w * cos((k + 1) * 2.5 * t + k) for k, w in enumerate(self.waves))

    def problem(self, L: Integrand) -> vc.Problem:
        """That of a Lagrangian between the ends of the path."""
        return vc.Problem(L, vc.Fixed(self.x0, float(self.of(self.x0))), vc.Fixed(self.x1, float(self.of(self.x1))))


def manufactured(path: Path, L0: Integrand) -> tuple[vc.Problem, float]:
    """The problem of L0 + s(x) y that has the path as an extremal, and the value there."""
    x, y, v = ca.SX.sym("x"), ca.SX.sym("y"), ca.SX.sym("v")
    L = L0(x, y, v)
    momentum, force = ca.gradient(L, v), ca.gradient(L, y)
    curve = path.of(x)
    slope = ca.gradient(curve, x)
    along = ca.substitute([momentum, force], [y, v], [curve, slope])
    source = ca.Function("s", [x], [ca.gradient(along[0], x) - along[1]])
    problem = path.problem(lambda x, y, dy: L0(x, y, dy) + source(x) * y)
    rate = ca.Function("rate", [x], [slope])
    value = functional(problem, path.of, lambda at: np.asarray(rate(at[None]))[0])
    return problem, value


def convex(random: np.random.Generator) -> Drawn:
    """L convex in (y, y') together: y* is the only extremal, and the minimum of all curves."""
    path = Path.drawn(random)
    problem, value = manufactured(path, _convex(random, path))
    return Drawn(problem, Truth((Extremal(value, True),)), wiggle(problem, path.size, random))


def _convex(random: np.random.Generator, path: Path) -> Integrand:
    a, b, c, d, e = np.exp(random.uniform(-2, 2, 5)) * (random.uniform(size=5) < (0.7, 0.5, 0.5, 0.5, 0.5))
    if a + b == 0:
        a = 1.0
    width, tilt, ripple = path.size, random.standard_normal(), random.uniform(0, 0.8)

    def L(x: Any, y: Any, v: Any) -> Any:
        slopes = a * v**2 / 2 + b * ca.sqrt(1 + v**2)
        return (
            slopes * (1 + ripple * ca.sin(3 * x))
            + c * y**2 / 2
            + d * ca.sqrt(width**2 + y**2)
            + e * (v - tilt * y) ** 2
        )

    return L


def quadratic(random: np.random.Generator) -> Drawn:
    """P y'^2/2 + c x y y' - Q y^2/2: one extremal, whose index counts the half waves that fit in."""
    path = Path.drawn(random)
    P, c = math.exp(random.uniform(-1, 1)), random.uniform(-1, 1)
    half_waves = float(random.integers(0, 5) + random.uniform(0.05, 0.95))
    Q = P * (half_waves * math.pi / (path.x1 - path.x0)) ** 2 - c  # the term in c adds c to Q, by parts
    problem, value = manufactured(path, lambda x, y, v: P * v**2 / 2 + c * x * y * v - Q * y**2 / 2)
    minimum = bool(half_waves < 1)
    verdicts = frozenset() if minimum else frozenset({Verdict.UNBOUNDED, Verdict.SADDLE})
    return Drawn(problem, Truth((Extremal(value, minimum),), verdicts), wiggle(problem, path.size, random))


def several(random: np.random.Generator) -> Drawn:
    """Not convex in y: other extremals than y*, of any index, are possible; a minimum exists."""
    k = math.exp(random.uniform(-0.5, 2.0))
    kinds: list[Integrand] = [
        lambda x, y, v: v**2 / 2 + k * ca.cos(y),
        lambda x, y, v: v**2 / 2 + k * (y**2 - 1) ** 2 / 4,
        lambda x, y, v: (1 + ca.sin(3 * y) / 2) * ca.sqrt(1 + v**2) + v**2 / 10,
        lambda x, y, v: (1 + y**2) * v**2 / 2 + k * ca.cos(2 * y - x),
    ]
    return _known_in_part(random, kinds[random.integers(len(kinds))], coercive=True)


def unbounded(random: np.random.Generator) -> Drawn:
    """Without a lower bound: y* may be a minimum among its neighbours or a saddle."""
    k = math.exp(random.uniform(-1.0, 1.5))
    kinds: list[Integrand] = [
        lambda x, y, v: v**2 / 2 - k * y**4 / 4,
        lambda x, y, v: v**2 / 2 - k * ca.exp(y),
        lambda x, y, v: v**2 / 2 + k * y**3 / 3,
    ]
    return _known_in_part(random, kinds[random.integers(len(kinds))], coercive=False)


def _known_in_part(random: np.random.Generator, L0: Integrand, coercive: bool) -> Drawn:
    path = Path.drawn(random)
    problem, value = manufactured(path, L0)
    rate = ca.SX.sym("x")
    slope = ca.Function("slope", [rate], [ca.gradient(path.of(rate), rate)])
    minimum = index(problem, path.of, lambda x: float(slope(x))) == 0
    verdicts = frozenset({Verdict.SADDLE} | (set() if coercive else {Verdict.UNBOUNDED}))
    truth = Truth((Extremal(value, minimum),), verdicts)
    return Drawn(problem, truth, wiggle(problem, path.size, random), complete=False, coercive=coercive)


def concave(random: np.random.Generator) -> Drawn:
    """L concave in (y, y') together: y* is a maximum, and there is no minimum."""
    path = Path.drawn(random)
    L0 = _convex(random, path)
    problem, value = manufactured(path, lambda x, y, v: -L0(x, y, v))
    truth = Truth((Extremal(value, False),), frozenset({Verdict.UNBOUNDED, Verdict.SADDLE}))
    return Drawn(problem, truth, wiggle(problem, path.size, random))


def nothing(random: np.random.Generator) -> Drawn:
    """No extremal at all: ends too far apart, a resonance, a coefficient that vanishes inside."""
    return (_rings, _reaction, _resonance, _vanishing)[random.integers(4)](random)


def _rings(random: np.random.Generator) -> Drawn:
    """Rings too far apart for a soap film, of any size."""
    r = math.exp(random.uniform(-1, 1))
    a = r * float(WIDEST) * (1 + 10 ** random.uniform(-6, 0.5))
    problem = vc.Problem(lambda x, y, dy: y * ca.sqrt(1 + dy**2), vc.Fixed(-a, r), vc.Fixed(a, r))
    truth = Truth((), frozenset({Verdict.NO_EXTREMAL, Verdict.UNBOUNDED, Verdict.NOT_ATTAINED}))
    return Drawn(problem, truth, wiggle(problem, r, random))


CRITICAL_RATE = float(8 * WIDEST**2 * mpmath.mpf(1))
"""Bratu's problem on the unit interval has no solution beyond this."""


def _reaction(random: np.random.Generator) -> Drawn:
    """Bratu's problem beyond its critical rate, on an interval of any length."""
    length, k = random.uniform(0.5, 3), math.exp(random.uniform(-1, 1))
    rate = CRITICAL_RATE * (1 + 10 ** random.uniform(-6, 1)) / length**2
    problem = vc.Problem(lambda x, y, dy: dy**2 / 2 - rate * ca.exp(k * y) / k**2, vc.Fixed(0, 0), vc.Fixed(length, 0))
    truth = Truth((), frozenset({Verdict.NO_EXTREMAL, Verdict.UNBOUNDED}))
    return Drawn(problem, truth, wiggle(problem, 1 / k, random))


def _resonance(random: np.random.Generator) -> Drawn:
    """An oscillator asked to be somewhere else after exactly so many half periods."""
    count, length, end = random.integers(1, 5), random.uniform(0.5, 5), 1 + random.uniform()
    square = (count * math.pi / length) ** 2
    problem = vc.Problem(lambda x, y, dy: (dy**2 - square * y**2) / 2, vc.Fixed(0, 0), vc.Fixed(length, end))
    truth = Truth((), frozenset({Verdict.NO_EXTREMAL, Verdict.UNBOUNDED, Verdict.DEGENERATE}))
    return Drawn(problem, truth, wiggle(problem, end, random))


def _vanishing(random: np.random.Generator) -> Drawn:
    """Weierstrass's example: the weight of the slope vanishes inside, and the infimum 0 is not attained."""
    left, right, rise = random.uniform(0.2, 2), random.uniform(0.2, 2), random.uniform(0.2, 2)
    power = 2 * random.integers(1, 3)
    problem = vc.Problem(lambda x, y, dy: x**power * dy**2, vc.Fixed(-left, 0), vc.Fixed(right, rise))
    truth = Truth((), frozenset({Verdict.NO_EXTREMAL, Verdict.NOT_ATTAINED, Verdict.DEGENERATE}))
    return Drawn(problem, truth, wiggle(problem, rise, random))


KINDS: dict[str, tuple[int, Callable[[np.random.Generator], Drawn]]] = {
    "convex": (30, convex),
    "quadratic": (22, quadratic),
    "several": (20, several),
    "unbounded": (8, unbounded),
    "concave": (8, concave),
    "nothing": (12, nothing),
}
"""The kinds of problems and how many of every hundred are drawn of each."""

ORDER = tuple(np.random.default_rng(0).permutation([kind for kind, (count, _) in KINDS.items() for _ in range(count)]))
"""The kinds in the order of drawing, so that any number of draws is a fair sample."""


def kind_of(number: int) -> str:
    """The kind of one draw."""
    return str(ORDER[number % len(ORDER)])


def draw(seed: int, number: int) -> tuple[str, Drawn]:
    """The kind and the problem of one number, the same for the same seed."""
    kind = kind_of(number)
    return kind, KINDS[kind][1](np.random.default_rng([seed, number]))
