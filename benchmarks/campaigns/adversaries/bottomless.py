"""Functionals without a lower bound, and infima that no curve attains, beside neighbours that are well posed."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np
from scipy.optimize import brentq

from campaigns.least import UNBOUNDED, Least
from campaigns.statement import Integrand, Statement
from varcalc.solution import Verdict

NOWHERE = frozenset({Verdict.NOT_ATTAINED, Verdict.NO_EXTREMAL})


def superquadratic(random: np.random.Generator) -> Statement:
    """v^2/2 - c |y|^p, p > 2: y = s sin(pi x/T) falls as -s^p, however small the stretch near y = 0 that does not."""
    T, c, p = random.uniform(0.3, 4), 10 ** random.uniform(-2, 1), int(random.integers(3, 7))
    y0, y1 = random.uniform(-0.8, 0.8, 2) if random.uniform() < 0.7 else np.zeros(2)
    if p % 2:
        L: Integrand = lambda x, y, v: v**2 / 2 - c * y**p  # noqa: E731
    else:
        L = lambda x, y, v: v**2 - c * (y**2) ** (p // 2)  # noqa: E731
    return Statement(L, (0.0, y0), (T, y1), UNBOUNDED)


def oscillators(random: np.random.Generator) -> Statement:
    """v^2 - k y^2 on an interval T, with w T from 0.05 pi to 3 pi, w^2 = k: a minimum up to pi, none beyond.

    The value is w ((y0^2 + y1^2) cos w T - 2 y0 y1)/sin w T (Feynman and Hibbs, "Quantum Mechanics and Path Integrals",
    problem 2-2).
    """
    T = random.uniform(0.5, 5)
    turns = (
        1 - random.choice([-1, 1]) * 10 ** random.uniform(-4, -0.02) if random.uniform() < 0.6 else random.uniform(1, 3)
    )
    w = turns * math.pi / T
    y0, y1 = random.uniform(-1, 1, 2)
    L: Integrand = lambda x, y, v: v**2 - w**2 * y**2  # noqa: E731
    if turns >= 1:
        return Statement(L, (0.0, y0), (T, y1), UNBOUNDED)
    value = w * ((y0**2 + y1**2) * math.cos(w * T) - 2 * y0 * y1) / math.sin(w * T)
    # next to the conjugate length the phase w T is known to round-off only
    least = Least(value, sole=True, within=1e-14 * abs(value) / math.sin(w * T))
    return Statement(L, (0.0, y0), (T, y1), least)


def weights(random: np.random.Generator) -> Statement:
    """x^a v^2 from (0, 0) to (1, r), or |x|^a v^2 across 0: r^2 over the integral of x^-a.

    That is infinite from a = 1 on, where the infimum 0 is not attained (Weierstrass's example for a = 2).
    """
    a = random.uniform(-3, 0.99) if random.uniform() < 0.75 else random.choice([1.0, 2.0, random.uniform(1.05, 4)])
    rise = random.uniform(0.5, 2)
    before = 0.0 if random.uniform() < 0.7 else random.uniform(0.2, 1)
    if before:
        L: Integrand = lambda x, y, v: ca.fabs(x) ** a * v**2  # noqa: E731
    else:
        L = lambda x, y, v: x**a * v**2  # noqa: E731
    if a >= 1:
        least = Least(0.0, attained=False, sole=True, verdicts=NOWHERE | {Verdict.DEGENERATE})
    else:
        least = Least(rise**2 * (1 - a) / (1 + before ** (1 - a) * (before > 0)), sole=True)
    return Statement(L, (-before, 0.0), (1.0, rise), least, points=(0.0,))


def polar(random: np.random.Generator) -> Statement:
    """sqrt(w^2 y^2 + v^2): lengths in the plane, y from the origin at an angle w x.

    A straight line up to an angle of pi; from there on, and to the other side of the origin, the two radii, along which
    a graph only drops in the limit.
    """
    T = random.uniform(0.5, 2)
    r0, r1 = random.uniform(0.3, 2, 2)
    angle = random.uniform(0.1, 0.97 * math.pi) if random.uniform() < 0.7 else random.uniform(math.pi, 3 * math.pi)
    w = angle / T
    L: Integrand = lambda x, y, v: ca.sqrt(w**2 * y**2 + v**2)  # noqa: E731
    if angle >= math.pi or random.uniform() < 0.1:
        side = 1 if angle >= math.pi else -1
        least = Least(r0 + r1, attained=False, sole=True, verdicts=NOWHERE | {Verdict.DEGENERATE})
        return Statement(L, (0.0, r0), (T, side * r1), least)
    value = math.sqrt((r0 - r1) ** 2 + 4 * r0 * r1 * math.sin(angle / 2) ** 2)
    return Statement(L, (0.0, r0), (T, r1), Least(value, sole=True))


def rims(random: np.random.Generator) -> Statement:
    """x sqrt(1 + v^2) from x = r to R: a film about the axis of y, convex in the slope.

    x v/sqrt(1 + v^2) = C <= r, so that no curve rises more than r arcosh(R/r); what is left is a jump at r, at the
    price r for each unit. The value is that of x^2/sqrt(x^2 - C^2).
    """
    r = random.uniform(0.2, 1)
    R = r + random.uniform(0.3, 3)
    most = r * math.acosh(R / r)
    share = 1 - 10 ** random.uniform(-4, -0.02) if random.uniform() < 0.7 else 1 + 10 ** random.uniform(-3, 1)
    rise = share * most

    def area(C: float) -> float:
        def part(x: float) -> float:
            root = math.sqrt((x - C) * (x + C))
            return (x * root + C**2 * math.log(x + root)) / 2

        return part(R) - part(r)

    L: Integrand = lambda x, y, v: x * ca.sqrt(1 + v**2)  # noqa: E731
    if share > 1:
        least = Least(area(r) + r * (rise - most), attained=False, sole=True, verdicts=NOWHERE)
        return Statement(L, (r, 0.0), (R, rise), least)
    C = brentq(lambda C: C * (math.acosh(R / C) - math.acosh(r / C)) - rise, 1e-12 * r, r, xtol=1e-15, rtol=1e-14)
    return Statement(L, (r, 0.0), (R, rise), Least(area(C), sole=True))
