"""Films near their fold, and descents whose singular start is guarded."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np
from scipy.optimize import brentq

from campaigns.least import Least
from campaigns.statement import Integrand, Statement
from varcalc.solution import Verdict

NONE = frozenset({Verdict.UNBOUNDED, Verdict.NO_EXTREMAL, Verdict.NOT_ATTAINED})


def films(random: np.random.Generator) -> Statement:
    """y sqrt(1 + v^2) between rings of one radius or of two, near the fold and far from it.

    The catenary c cosh((x - d)/c) that is a minimum has its tangents at the ends meet above the axis (Lindelof's
    theorem): t - coth t, where they meet the axis with c = 1, is less at the second end than at the first. The second
    catenary is a saddle, and neither it nor the discs of Goldschmidt, whether they have less area or more, may be
    given. A film of negative radius has no least area: the local minimum is the answer, as in campaigns.families.
    """
    first = random.uniform(0.6, 1.19)
    gap = 10 ** random.uniform(-5, 0)
    # the second end where its tangent meets the axis a gap to the left of that of the first
    meets = -(first - 1 / math.tanh(first)) - gap
    last = brentq(lambda t: t - 1 / math.tanh(t) - meets, 1e-3, 10.0, xtol=1e-15)
    if random.uniform() < 0.5:
        fold = 1.1996786402577337
        first = last = fold - min(gap, 1.0)
    area = (first + last) / 2 + (math.sinh(2 * last) + math.sinh(2 * first)) / 4
    c = random.uniform(0.3, 1.2)
    L: Integrand = lambda x, y, v: y * ca.sqrt(1 + v**2)  # noqa: E731
    least = Least(c**2 * area, verdicts=NONE - {Verdict.NO_EXTREMAL})
    return Statement(L, (-c * first, c * math.cosh(first)), (c * last, c * math.cosh(last)), least)


def torn(random: np.random.Generator) -> Statement:
    """The same beyond the fold, a = 0.6627434193491817 radii: there is nothing to find."""
    radius = random.uniform(0.5, 2)
    a = 0.6627434193491817 * radius * (1 + 10 ** random.uniform(-6, 0.5))
    L: Integrand = lambda x, y, v: y * ca.sqrt(1 + v**2)  # noqa: E731
    least = Least(-math.inf, attained=False, sole=True, verdicts=NONE)
    return Statement(L, (-a, radius), (a, radius), least)


def guarded_descents(random: np.random.Generator) -> Statement:
    """sqrt((1 + v^2)/fmax(y, d)) from the origin: a straight ray down to the guard d, then a cycloid.

    Snell's law, sin(angle)/sqrt(y) = p, holds throughout. The cycloid y = (1 - cos t)/(2 p^2) takes t/p from t = 0
    (Brizard, "An Introduction to Lagrangian Mechanics" (2005), sect. 1.2.2). Its radius and its last t are drawn.
    """
    radius, last = random.uniform(0.2, 2), random.uniform(0.5, 5.5)
    guard = 10 ** random.uniform(-12, -2) * radius
    p = 1 / math.sqrt(2 * radius)
    sine = p * math.sqrt(guard)
    first = 2 * math.asin(sine)
    tangent, cosine = sine / math.sqrt(1 - sine**2), math.sqrt(1 - sine**2)
    # t - sin t without cancellation for a small t
    arc = first**3 / 6 - first**5 / 120 + first**7 / 5040 if first < 0.01 else first - math.sin(first)
    across = guard * tangent + radius * (last - math.sin(last) - arc)
    time = math.sqrt(guard) / cosine + (last - first) / p
    L: Integrand = lambda x, y, v: ca.sqrt((1 + v**2) / ca.fmax(y, guard))  # noqa: E731
    return Statement(L, (0.0, 0.0), (across, radius * (1 - math.cos(last))), Least(time))
