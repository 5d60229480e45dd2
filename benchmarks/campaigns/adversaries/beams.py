"""Clamped beams of unit length: y''^2/2 under loads, over obstacles, through kinks and jumps.

Along each piece y is a polynomial. A bound presses with forces where contact begins and ends, or in one point; where
the ends of contact are free, y'' has no jump there (Kinderlehrer and Stampacchia, "An Introduction to Variational
Inequalities and Their Applications" (1980), chap. II and IV).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import casadi as ca
import numpy as np
from numpy.polynomial import Polynomial
from scipy.optimize import brentq

import varcalc as vc
from campaigns.least import Least
from campaigns.statement import Integrand, Statement

Pair = tuple[Polynomial, Polynomial]
PLACES = 400
"""Abscissae among which the one is looked for at which two pieces meet."""


def over_obstacles(random: np.random.Generator) -> Statement:
    """Under a load q and below a level g: clear of it, up to it in the middle, or along it from x = a to 1 - a.

    Without it the middle is at q/384, and a force there moves it by 1/192 of its size. It comes to lie on the level
    where g = q/1152, then with a^4 = 72 g/q.
    """
    q = 10 ** random.uniform(0, 4)
    g = q * 10 ** random.uniform(-4.5, -2.3)
    value = -(q**2) / 1440
    if q / 1152 <= g <= q / 384:
        value += 96 * (q / 384 - g) ** 2
    elif g < q / 1152:
        a = (72 * g / q) ** 0.25
        value = -7 * q**2 * a**5 / 540 - q * g * (1 - 2 * a)
    L: Integrand = lambda x, y, v, u: u**2 / 2 - q * y  # noqa: E731
    bound = vc.Bound(lambda x, y, v: y, upper=g)
    return Statement(L, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), Least(value, sole=True), (bound,), order=2)


def steep(random: np.random.Generator) -> Statement:
    """From one level to one higher by h at slopes of c h at most, c from 1.01 on: from 3/2 on none is so steep.

    The slope v rises along a parabola over a length a = 3 (1 - 1/c)/2, keeps its greatest value and falls again.
    """
    h, c = 10 ** random.uniform(-2, 1), 1 + 10 ** random.uniform(-2, -0.2)
    a = min(1.5 * (1 - 1 / c), 0.5)
    value = 4 * (c * h) ** 2 / (3 * a) if c < 1.5 else 6 * h**2
    L: Integrand = lambda x, y, v, u: u**2 / 2  # noqa: E731
    bound = vc.Bound(lambda x, y, v: v, upper=c * h)
    return Statement(L, (0.0, 0.0, 0.0), (1.0, h, 0.0), Least(value, sole=True), (bound,), order=2)


def bent(random: np.random.Generator) -> Statement:
    """From above a level to below it, where a load turns, or falling and then rising with friction.

    Where y goes through the level all but the fourth derivative is continuous; where the slope changes its sign, all
    but the third, which jumps by twice the friction.
    """
    force, rubbing = 10 ** random.uniform(-1, 2.5), random.uniform() < 0.5
    while True:
        ends = np.array([random.uniform(0.2, 2), random.uniform(-1, 1), -random.uniform(0.2, 2), random.uniform(-1, 1)])
        if rubbing:
            ends[[1, 3]] = -random.uniform(0.5, 5), random.uniform(0.5, 5)
        found = _met(ends, force, rubbing)
        if found is not None:
            break
    (left, right), c = found
    if rubbing:
        L: Integrand = lambda x, y, v, u: u**2 / 2 + force * ca.fabs(v)  # noqa: E731
        parts = [p.deriv(2) ** 2 / 2 + side * force * p.deriv() for p, side in ((left, -1), (right, 1))]
    else:
        L = lambda x, y, v, u: u**2 / 2 + force * ca.fabs(y)  # noqa: E731
        parts = [p.deriv(2) ** 2 / 2 + side * force * p for p, side in ((left, 1), (right, -1))]
    before, after = (part.integ() for part in parts)
    value = before(c) - before(0.0) + after(1.0) - after(c)
    return Statement(L, (0.0, *ends[:2]), (1.0, *ends[2:]), Least(value, sole=True), points=(c,), order=2)


def _met(ends: Sequence[float], force: float, rubbing: bool) -> tuple[Pair, float] | None:
    """The two pieces and where they meet; None where they meet more than once, or change sides besides."""
    load = 0.0 if rubbing else force
    continuous, turned = ((0, 1, 2), 1) if rubbing else ((0, 1, 2, 3), 0)

    def joined(c: float) -> Pair:
        def missed(unknowns: np.ndarray) -> np.ndarray:
            left, right = _pieces(ends, unknowns, load)
            jumps = [_derivative(left, k)(c) - _derivative(right, k)(c) for k in continuous]
            if rubbing:
                jumps.append(left.deriv(3)(c) - right.deriv(3)(c) + 2 * force)
            return np.array(jumps)

        constant = missed(np.zeros(4))
        rates = np.array([missed(row) - constant for row in np.eye(4)]).T
        return _pieces(ends, np.linalg.solve(rates, -constant), load)

    def turns(c: float) -> float:
        return float(_derivative(joined(c)[0], turned)(c))

    places = np.linspace(0.05, 0.95, PLACES)
    changes = np.flatnonzero(np.diff(np.sign([turns(c) for c in places])))
    if len(changes) != 1:
        return None
    c = brentq(turns, places[changes[0]], places[changes[0] + 1], xtol=1e-15)
    left, right = (_derivative(part, turned) for part in joined(c))
    first, last = np.linspace(0.0, c, PLACES)[1:-1], np.linspace(c, 1.0, PLACES)[1:-1]
    sides = (left(first) * left(0.0) > 0).all() and (right(last) * right(1.0) > 0).all() and left(0.0) * right(1.0) < 0
    return (joined(c), c) if sides else None


def _pieces(ends: Sequence[float], unknowns: np.ndarray, load: float) -> Pair:
    """Quartics from both ends with the given ordinates and slopes and y'''' = -load and load."""
    left = Polynomial([*ends[:2], *unknowns[:2], -load / 24])
    right = Polynomial([*ends[2:], *unknowns[2:], load / 24])
    return left, right(Polynomial([-1.0, 1.0]))


def _derivative(part: Polynomial, k: int) -> Callable[[float], float]:
    return part.deriv(k) if k else part
