"""Nutation of a heavy symmetric top: motion in the one coordinate u = cos θ, by a cubic.

With x = u - u₀ from where the motion begins, s² = 1 - u₀², A = 2 M g h/I1, β = I3 ω3/I1, a = (p_φ - p_ψ u₀)/I1 and the
angular velocity √k across the axis,

    (dx/dt)² = (s² - 2 u₀ x - x²)(k - A x) - (a - β x)².

The cubic in u itself (Brizard, "An Introduction to Lagrangian Mechanics", eq. 7.65; Goldstein, Poole and Safko,
"Classical Mechanics", eq. 5.62') has coefficients of the order β², which for a fast top leave no digits of a narrow
nutation; those in x do, and what begins upright is no exception.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from functools import cached_property

import numpy as np

from varcalc.numerics.one_coordinate.motions import CoordinateMotion, MotionPoint, bounds, ways
from varcalc.numerics.one_coordinate.potential import Potential
from varcalc.numerics.one_coordinate.quadrature import integrals, integrands

SAME = 32 * float(np.finfo(float).eps)
"""Of the terms of a sum: one that is less is round-off."""
UPRIGHT = float(np.finfo(float).eps) ** 2
"""Of 1 - |cos θ|: a tilt that is round-off."""
LOOKED_AT = 33
"""Places of half a period at which rates are looked at for their size."""
BEYOND = 1.0
"""How far beyond upright and upside down the cubic is looked at, so that a root there lies inside."""


class NutationCase(Enum):
    """What the azimuth φ does while θ goes to and fro; each member carries its meaning."""

    MONOTONE = "case I: it goes one way only"
    CUSP = "case II: it comes to rest where θ turns"
    LOOP = "case III: it goes backwards on part of the way"
    PLANE = "the axis swings in a plane through the vertical"
    STEADY = "the axis goes round at one θ: regular precession"
    SLEEPING = "the axis stays upright, or hangs"
    ASYMPTOTIC = "the axis comes to the vertical, and takes for ever"


@dataclass(frozen=True)
class Nutation:
    """How the axis of a top goes to and fro.

    ``theta`` are the limits of θ, the lesser first, ``u`` those of cos θ, the lesser first. In a ``period``, infinite
    where that is asymptotic, φ advances by ``precession`` and ψ by ``spin``, in radians (an axis that goes through the
    vertical changes φ there by π, which is not counted). Of a steady or sleeping axis, the period is that of small
    departures, infinite where they grow: it is then not ``stable``. p_φ, p_ψ and the energy are those of the motion.
    """

    case: NutationCase
    theta: tuple[float, float]
    u: tuple[float, float]
    period: float
    precession: float
    spin: float
    p_phi: float
    p_psi: float
    energy: float
    stable: bool = True


@dataclass(frozen=True)
class TopStart:
    """How a top begins, without Euler angles, so that it may be upright.

    ``above`` and ``below`` are 1 - u₀ and 1 + u₀, ``a``, ``k``, ``beta`` and ``A`` as in this module's head, ``w`` the
    rate of u and ``omega3`` that of the body's own turning.
    """

    above: float
    below: float
    w: float
    a: float
    k: float
    beta: float
    A: float
    omega3: float

    @classmethod
    def of(cls, q: np.ndarray, omega: np.ndarray, I1: float, I3: float, Mgh: float) -> TopStart:
        """From a quaternion (4,) and the angular velocity (3,) along the top's axes."""
        w, x, y, z = q.tolist()
        along, across, omega3 = omega.tolist()
        above, below = (0.0 if d <= UPRIGHT else d for d in (2 * (x * x + y * y), 2 * (w * w + z * z)))
        tilted = above > 0 and below > 0
        first, second = (2 * (x * z - w * y), 2 * (y * z + w * x)) if tilted else (0.0, 0.0)  # the vertical, across e3
        return cls(
            above, below, first * across - second * along, first * along + second * across,
            along**2 + across**2, I3 * omega3 / I1, 2 * Mgh / I1, omega3,
        )  # fmt: skip

    @property
    def u(self) -> float:
        """cos θ, from the nearer end."""
        return 1 - self.above if self.above < self.below else self.below - 1

    @cached_property
    def coefficients(self) -> tuple[float, float, float]:
        """Of x, x² and x³ in (dx/dt)²; round-off of the first is zero."""
        terms = -self.above * self.below * self.A, -2 * self.u * self.k, 2 * self.a * self.beta
        first = math.fsum(terms)
        first = 0.0 if abs(first) <= SAME * sum(map(abs, terms)) else first
        return first, 2 * self.u * self.A - self.k - self.beta**2, self.A

    def at_pole(self, pole: int) -> float:
        """(p_φ ∓ p_ψ)/I1, which is zero where the axis may come to be upright (1) or upside down (-1)."""
        reach = self.above if pole > 0 else -self.below
        return _sum(self.a, -self.beta * reach)

    def azimuth_rate(self, x: np.ndarray) -> np.ndarray:
        """φ' = (α - β u)/(1 - u²) at ``x``, with the numerator from where it loses least: a pole, or the start."""
        up, down, above, below = self.at_pole(1), self.at_pole(-1), self.above - x, self.below + x
        if up == 0 and down == 0:
            return np.zeros_like(x)
        if up == 0 or down == 0:
            return self.beta / below if up == 0 else -self.beta / above
        known = np.array([up, down, self.a]).reshape(3, *[1] * np.ndim(x))
        changes = self.beta * np.array([above, -below, -x])
        best = np.argmin(np.abs(known) + np.abs(changes), axis=0)[None]
        numerator = np.take_along_axis(known + changes, best, axis=0)[0]
        return numerator / (above * below)

    @property
    def asymptotic(self) -> bool:
        """Whether it comes to rest on the pole where it has most potential energy."""
        pole = 1 if self.A > 0 else -1
        reach = self.above if pole > 0 else -self.below
        return self.A != 0 and self.at_pole(pole) == 0 and _sum(self.k, -self.A * reach) == 0 and self.k > 0


@dataclass(frozen=True)
class TopCubic(Potential):
    """The cubic in x without its constant, which is the square of the rate at the start."""

    start: TopStart

    def at(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See :meth:`Potential.at`."""
        b, c, d = self.start.coefficients
        return u * (b + u * (c + d * u)), b + u * (2 * c + 3 * d * u)

    def changes(self, base: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See :meth:`Potential.changes`."""
        b, c, d = self.start.coefficients
        slope = b + base * (2 * c + 3 * d * base)
        return x * (slope + x * (c + d * (3 * base + x))), x * (2 * c + 3 * d * (2 * base + x))

    def weighted(self, point: MotionPoint) -> tuple[np.ndarray, ...]:
        """The rates of φ and ψ; see :meth:`Potential.weighted`."""
        rate = self.start.azimuth_rate(point.u)
        return rate, self.start.omega3 - (self.start.u + point.u) * rate


def nutation(start: TopStart, momenta: tuple[float, float], energy: float) -> Nutation:
    """The nutation of a top from its ``start``; its p_φ and p_ψ and its energy are handed on.

    Raises ValueError where the integrals of a period are not resolved.
    """
    b, c, _ = start.coefficients
    if start.w == 0 and b == 0:
        return _steady(start, c, momenta, energy)
    potential, at, squared = TopCubic(start), np.zeros(1), np.array([start.w**2])
    nodes = potential.nodes(0.0, 0.0, -start.below - BEYOND, start.above + BEYOND)
    free = np.full(1, np.inf)
    low, high = (bounds(potential, nodes, at, squared, -squared, free, sign) for sign in (-1, 1))
    limits = max(float(low.x[0]), -start.below), min(float(high.x[0]), start.above)
    case = _case(start, *limits)
    period = precession = spin = math.inf
    if case is not NutationCase.ASYMPTOTIC:
        [(_, way, _)] = ways(potential, at, np.array([start.w]), low, high)
        period, precession, spin = (2 * _half_period(way)).tolist()
    return Nutation(case, *_limits(start, *limits), period, precession, spin, *momenta, energy)


def _half_period(way: CoordinateMotion) -> np.ndarray:
    """Half a period, and what φ and ψ advance by in it (3,).

    What goes forwards and back may add up to nothing: the integrals are resolved to digits of what they would add up
    to without signs.
    """
    rates = integrands(way, np.linspace(0.0, way.period / 2, LOOKED_AT)[None])
    known = np.abs(rates[:, 0]).mean(axis=1) * way.period / 2
    half = integrals(way, np.zeros(1), np.full(1, way.period / 2), known[None])[0, :3]
    if not np.all(np.isfinite(half)):
        raise ValueError("the integrals over a period of this nutation are not resolved: it is next to asymptotic")
    return half


def _case(start: TopStart, low: float, high: float) -> NutationCase:
    if start.asymptotic:
        return NutationCase.ASYMPTOTIC
    if start.beta == 0 and start.a == 0:
        return NutationCase.PLANE
    # at a pole that the axis comes to φ does not come to rest, though what says so elsewhere vanishes there
    ends = [_sum(start.a, -start.beta * x) for x, pole in ((low, -1), (high, 1)) if start.at_pole(pole) != 0]
    if any(end == 0 for end in ends):
        return NutationCase.CUSP
    return NutationCase.LOOP if len(ends) == 2 and ends[0] * ends[1] < 0 else NutationCase.MONOTONE


def _steady(start: TopStart, bend: float, momenta: tuple[float, float], energy: float) -> Nutation:
    """What stays at one θ: small departures swing with the frequency √-bend, where that is one."""
    upright = start.above * start.below == 0
    rate = 0.0 if upright else start.a / (start.above * start.below)
    period = 2 * math.pi / math.sqrt(-bend) if bend < 0 else math.inf
    case = NutationCase.SLEEPING if upright else NutationCase.STEADY
    # at the threshold the next term of the cubic decides: it holds the axis upright
    stable = bend < 0 or (bend == 0 and start.A * start.u >= 0)
    own = start.omega3 - start.u * rate
    precession, spin = (part * period if part else 0.0 for part in (rate, own))
    return Nutation(case, *_limits(start, 0.0, 0.0), period, precession, spin, *momenta, energy, stable)


def _limits(start: TopStart, low: float, high: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """The limits of θ and of u, where those of x are ``low`` and ``high``."""
    thetas = [2 * math.atan2(math.sqrt(start.above - x), math.sqrt(start.below + x)) for x in (high, low)]
    return (thetas[0], thetas[1]), (start.u + low, start.u + high)


def _sum(first: float, second: float) -> float:
    """The sum, without round-off where that is all there is."""
    total = first + second
    return 0.0 if abs(total) <= SAME * (abs(first) + abs(second)) else total
