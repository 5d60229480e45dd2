"""Families of problems with a parameter, and the truth about each of them in closed form.

Every grid crosses the value at which the answer changes, if there is one, and
crowds there. Closed forms are evaluated by mpmath to forty digits, those of the
spheroid by geographiclib.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import casadi as ca
import mpmath
import numpy as np
from geographiclib.geodesic import Geodesic

import varcalc as vc
from campaigns.truth import Extremal, Truth
from varcalc.problems.spheroid import EARTH, length_by_longitude
from varcalc.solution import Verdict

DIGITS = 40
TINY = 1e-35
"""Width of a bracket, or square of a miss, at which a root is found."""
NEARLY = 1e-6
"""Relative distance from a critical value within which ends may be called conjugate."""

UNIT = mpmath.mpf(1)


@dataclass(frozen=True)
class Family:
    """Problems of one kind: ``problem`` and ``truth`` for each parameter value of ``grid``.

    ``labels`` says the values as a reader wants them, ``height`` how far random
    starting curves stray, ``critical`` where the answer changes.
    """

    title: str
    grid: tuple[float, ...]
    labels: tuple[str, ...]
    problem: Callable[[float], vc.Problem]
    truth: Callable[[float], Truth]
    height: float = 1.0

    def start(self, seed: Sequence[int]) -> Callable[[float], float]:
        """A random curve between the ends of the problems, the same for the same seed; see :func:`wiggle`."""
        problem = self.problem(self.grid[seed[1]])
        return wiggle(problem, self.height, np.random.default_rng(seed))


WAVES = 5
REACH = (0.03, 3.0)
"""Heights of random starting curves, in units of the problem's own."""


def wiggle(problem: vc.Problem, height: float, random: np.random.Generator) -> Callable[[float], float]:
    """A random curve between two fixed ends: the chord and five sines, gentle or wild with equal chances."""
    (x0, x1), y0, y1 = problem.span, float(problem.start.y), float(problem.end.y)
    size = height * math.exp(random.uniform(math.log(REACH[0]), math.log(REACH[1])))
    waves = size * random.standard_normal(WAVES) / np.arange(1, WAVES + 1)

    def curve(x: float) -> float:
        t = (float(x) - x0) / (x1 - x0)
        return y0 + t * (y1 - y0) + float(waves @ np.sin(np.pi * np.arange(1, WAVES + 1) * t))

    return curve


def around(critical: float, exponents: Sequence[int], name: str) -> tuple[list[float], list[str]]:
    """Parameters at powers of ten either side of a critical value, and their labels."""
    below = [(critical - 10.0**k, f"{name} - 1e{k}") for k in sorted(exponents, reverse=True)]
    above = [(critical + 10.0**k, f"{name} + 1e{k}") for k in sorted(exponents)]
    return [v for v, _ in below + above], [label for _, label in below + above]


# the soap film between two rings

with mpmath.workdps(DIGITS):
    FOLD = mpmath.findroot(lambda t: t * mpmath.tanh(t) - 1, 1.2)
    WIDEST = FOLD / mpmath.cosh(FOLD)


def film(a: float) -> vc.Problem:
    """Rings of radius 1 at -a and a; area by 2 pi."""
    return vc.Problem(lambda x, y, dy: y * ca.sqrt(1 + dy**2), vc.Fixed(-a, 1), vc.Fixed(a, 1))


@cache
def film_truth(a: float) -> Truth:
    """Two catenaries y = c cosh(x/c), the slack one a saddle, up to a = 0.6627...; none beyond."""
    verdicts = {Verdict.UNBOUNDED}  # a film of negative radius has negative area
    if abs(a - WIDEST) < NEARLY:
        verdicts |= {Verdict.DEGENERATE}
    with mpmath.workdps(DIGITS):
        if a > WIDEST:
            return Truth((), frozenset(verdicts | {Verdict.NO_EXTREMAL, Verdict.NOT_ATTAINED}))
        found = []
        for low, high, minimum in ((a / 2, FOLD, True), (FOLD, 60 * UNIT, False)):
            h = mpmath.findroot(lambda h: h / mpmath.cosh(h) - a, (low, high), solver="bisect", maxsteps=200, tol=TINY)
            c = a / h
            found.append(Extremal(float(c * (a + c * mpmath.sinh(2 * h) / 2)), minimum))
    return Truth(tuple(found), frozenset(verdicts))


# the action of an oscillator


def oscillator(T: float) -> vc.Problem:
    """From 0 to 1 in the time T, at unit frequency."""
    return vc.Problem(lambda x, y, dy: (dy**2 - y**2) / 2, vc.Fixed(0, 0), vc.Fixed(T, 1))


def oscillator_truth(T: float) -> Truth:
    """One extremal, cot(T)/2, a minimum up to T = pi; none at multiples of pi, nor at the doubles next to them."""
    nearest = round(T / math.pi)
    critical = nearest > 0 and abs(T - nearest * math.pi) < NEARLY * T
    verdicts = {Verdict.DEGENERATE} if critical else set()
    if critical and nearest * math.pi == T:
        return Truth((), frozenset(verdicts | {Verdict.UNBOUNDED, Verdict.NO_EXTREMAL}))
    minimum = 0 < T < math.pi
    if not minimum:
        verdicts |= {Verdict.UNBOUNDED, Verdict.SADDLE}
    with mpmath.workdps(DIGITS):
        return Truth((Extremal(float(mpmath.cot(mpmath.mpf(T)) / 2), minimum),), frozenset(verdicts))


# two points of the Earth's equator

FLATTENING = EARTH["f"]
EQUATOR_ENDS = 180 * (1 - FLATTENING)


def equator(degrees: float) -> vc.Problem:
    """Two points of the equator of WGS84, latitude as a function of longitude, metres."""
    return vc.Problem(
        length_by_longitude, vc.Fixed(0, 0), vc.Fixed(math.radians(degrees), 0), parameters=EARTH
    )  # fmt: skip


def equator_truth(degrees: float) -> Truth:
    """The equator, shortest up to 180 (1 - f) degrees; from there to 180 a geodesic by each hemisphere is shorter.

    At 180 degrees the meridians are, which are no graphs over longitude.
    """
    along = EARTH["a"] * math.radians(degrees)
    verdicts = {Verdict.DEGENERATE} if abs(degrees / EQUATOR_ENDS - 1) < NEARLY else set()
    if degrees <= EQUATOR_ENDS:
        return Truth((Extremal(along, True),), frozenset(verdicts))
    verdicts |= {Verdict.SADDLE, Verdict.NOT_ATTAINED}
    if degrees >= 180:
        return Truth((Extremal(along, False),), frozenset(verdicts))
    shortest = Geodesic(EARTH["a"], FLATTENING).Inverse(0, 0, 0, degrees)["s12"]
    verdicts -= {Verdict.NOT_ATTAINED}
    return Truth((Extremal(shortest, True), Extremal(along, False)), frozenset(verdicts))


# a boundary layer


def layer(eps: float) -> vc.Problem:
    """eps y'' = y from 1 to 0."""
    return vc.Problem(lambda x, y, dy: eps * dy**2 + y**2, vc.Fixed(0, 1), vc.Fixed(1, 0))


def layer_truth(eps: float) -> Truth:
    """One minimum, sqrt(eps) coth(1/sqrt(eps))."""
    with mpmath.workdps(DIGITS):
        root = mpmath.sqrt(mpmath.mpf(eps))
        return Truth((Extremal(float(root * mpmath.coth(1 / root)), True),))


# Troesch's problem


def troesch(mu: float) -> vc.Problem:
    """y'' = mu sinh(mu y) from 0 to 1."""
    return vc.Problem(lambda x, y, dy: dy**2 / 2 + ca.cosh(mu * y), vc.Fixed(0, 0), vc.Fixed(1, 1))


@cache
def troesch_truth(mu: float) -> Truth:
    """One minimum.

    With the slope s at 0 and sinh(mu y/2) = s sinh(w)/2,

    mu x = integral of (1 + (s sinh(w)/2)^2)^(-1/2) dw,
    J = 1 - s^2/2 + (1/mu) integral of (s cosh(w))^2 (1 + (s sinh(w)/2)^2)^(-1/2) dw,

    elliptic integrals (Roberts and Shipman 1976), here by tanh-sinh quadrature.
    """
    with mpmath.workdps(DIGITS):
        height = 2 * mpmath.sinh(UNIT * mu / 2)

        def over(s: mpmath.mpf, numerator: Callable[[mpmath.mpf], mpmath.mpf]) -> mpmath.mpf:
            last = mpmath.asinh(height / s)
            pieces = mpmath.linspace(0, last, 9)
            return mpmath.quad(lambda w: numerator(w) / mpmath.sqrt(1 + (s * mpmath.sinh(w) / 2) ** 2), pieces) / mu

        # 8 exp(-mu) is the slope for great mu, 1 for small
        first = mpmath.log(8 * mpmath.exp(-mu) if mu > 3 else UNIT)
        u = mpmath.findroot(lambda u: over(mpmath.exp(u), lambda w: UNIT) - 1, (first, first - 0.1), tol=TINY)
        s = mpmath.exp(u)
        value = 1 - s**2 / 2 + over(s, lambda w: (s * mpmath.cosh(w)) ** 2)
    return Truth((Extremal(float(value), True),))


def _labelled(values: Sequence[float]) -> tuple[list[float], list[str]]:
    return list(values), [f"{v:g}" for v in values]


def _joined(*parts: tuple[list[float], list[str]]) -> dict[str, tuple[float, ...] | tuple[str, ...]]:
    return {"grid": tuple(v for p in parts for v in p[0]), "labels": tuple(v for p in parts for v in p[1])}


PI = math.pi
FAMILIES = {
    "film": Family(
        "soap film, half the distance of the rings; none beyond a*", problem=film, truth=film_truth,
        **_joined(
            _labelled([0.1, 0.4, 0.6, 0.65]), around(float(WIDEST), [-3, -5, -7, -9], "a*"),
            _labelled([0.7, 0.8, 1.2, 3.0]),
        ),
    ),
    "oscillator": Family(
        "oscillator, duration; a minimum up to π", problem=oscillator, truth=oscillator_truth,
        **_joined(
            _labelled([0.5, 2.0, 3.0]),
            *(
                ([*values[:3], k * PI, *values[3:]], [*labels[:3], name, *labels[3:]])
                for k, name in ((1, "π"), (2, "2π"))
                for values, labels in [around(k * PI, [-2, -5, -9], name)]
            ),
            _labelled([7.5, 9.0, 15.0]),
        ),
    ),
    "spheroid": Family(
        "the Earth's equator, degrees; shortest up to λ*", problem=equator, truth=equator_truth, height=0.3,
        **_joined(
            _labelled([60.0, 120.0, 170.0, 179.0]), around(EQUATOR_ENDS, [-2, -4, -6], "λ*"),
            _labelled([179.5, 179.7, 179.9, 179.99, 180.0, 180.2, 200.0]),
        ),
    ),
    "layer": Family(
        "boundary layer, ε", problem=layer, truth=layer_truth,
        grid=tuple(10.0**-k for k in range(1, 11)), labels=tuple(f"1e-{k}" for k in range(1, 11)),
    ),
    "troesch": Family(
        "Troesch's problem, μ", problem=troesch, truth=troesch_truth,
        **_joined(_labelled([1.0, 2.0, 3.0, 5.0, 7.0, 10.0, 13.0, 16.0, 20.0, 25.0, 30.0, 35.0, 40.0])),
    ),
}  # fmt: skip
