"""L = f(y) √(c + k y'²) with ln f convex is convex in z = ∫ f dy: an extremal is least, and nothing is looked for."""

import math

import casadi as ca
import mpmath as mp
import numpy as np
import pytest
from scipy.optimize import brentq

import varcalc as vc
from varcalc.problem.convexity import proved_in_another_ordinate

CONVEX = {
    "descent": (lambda y: 1 / np.sqrt(19.62 * y), lambda y, v: ca.sqrt((1 + v**2) / (19.62 * y))),
    "descent, downwards": (lambda y: 1 / np.sqrt(-2 * (y - 3)), lambda y, v: ca.sqrt((1 + v**2) / (-2 * (y - 3)))),
    "half plane": (lambda y: 1 / y, lambda y, v: ca.hypot(v, 1) / y),
    "falling index": (lambda y: 1.4 * np.exp(-0.7 * y), lambda y, v: 1.4 * ca.exp(-0.7 * y) * ca.sqrt(1 + v**2)),
    "power": (lambda y: y**-0.75, lambda y, v: 2 * ca.sqrt(1 + (3 * v) ** 2) * y**-0.75),
    "ball": (lambda y: 1 / (y * (5 - y)), lambda y, v: ca.sqrt(4 * v**2 + 3) / (y * (5 - y))),
    "hyperbolic cosine": (np.cosh, lambda y, v: ca.sqrt((2 + v**2) / 5) * ca.cosh(y)),
    "sum": (lambda y: np.exp(y) + y**-0.5, lambda y, v: (ca.exp(y) + 1 / ca.sqrt(y)) * ca.sqrt(1 + v**2)),
}
OTHERS = {
    "film": lambda x, y, v: y * ca.sqrt(1 + v**2),
    "index of a place": lambda x, y, v: ca.exp(-x * y) * ca.sqrt(1 + v**2),
    "two poles": lambda x, y, v: ca.sqrt(1 + v**2) / y**2,
    "circles": lambda x, y, v: ca.sqrt(y**2 + v**2) / y**0.5,
    "other power": lambda x, y, v: (1 + v**2) ** 0.75 / y**0.5,
    "tilted": lambda x, y, v: ca.sqrt((1 + v + v**2) / y),
    "sum of two": lambda x, y, v: ca.sqrt((1 + v**2) / y) + ca.exp(y),
    "sine": lambda x, y, v: ca.sqrt(1 + v**2) / ca.sin(y) ** 2,
    "square under a root": lambda x, y, v: ca.sqrt((1 + v**2) / (1 - y) ** 2),
}


def problem(L, **more):
    return vc.Problem(L, vc.Fixed(0, 0.7), vc.Fixed(1, 1.9), **more)


@pytest.mark.parametrize(("f", "L"), CONVEX.values(), ids=CONVEX.keys())
def test_what_is_proved_is_convex_along_lines_between_curves_in_the_other_ordinate(f, L):
    assert proved_in_another_ordinate(problem(lambda x, y, v: L(y, v)))
    rng, x = np.random.default_rng(7), np.linspace(0, 1, 2001)
    y = np.linspace(0.05, 2.9, 4001)
    z = np.concatenate([[0.0], np.cumsum(np.diff(y) * (f(y[1:]) + f(y[:-1])) / 2)])
    slope, place = ca.SX.sym("v"), ca.SX.sym("y")
    integrand = ca.Function("L", [place, slope], [L(place, slope)]).map(len(x))
    for _ in range(20):
        own = 0.3 + 2 * rng.random((2, 6))
        ends = [np.interp(np.polynomial.chebyshev.chebval(2 * x - 1, 0.2 * c) + 1.5, y, z) for c in own]
        sums = []
        for curve in (ends[0], (ends[0] + ends[1]) / 2, ends[1]):
            of_x = np.interp(curve, z, y)
            sums.append(np.trapezoid(np.array(integrand(of_x, np.gradient(of_x, x))).ravel(), x))
        assert sums[1] <= (sums[0] + sums[2]) / 2 + 1e-3 * abs(sums[1])


@pytest.mark.parametrize("L", OTHERS.values(), ids=OTHERS.keys())
def test_nothing_else_is_proved(L):
    assert not proved_in_another_ordinate(problem(L))


def test_what_is_stated_besides_may_take_the_proof_away():
    def descent(x, y, v):
        return ca.sqrt((1 + v**2) / y)

    assert proved_in_another_ordinate(problem(descent, constraints=[vc.Bound(lambda x, y, v: y, upper=2.5)]))
    assert not proved_in_another_ordinate(problem(descent, constraints=[vc.Bound(lambda x, y, v: v, upper=2.5)]))
    assert not proved_in_another_ordinate(problem(descent, constraints=[vc.Isoperimetric(lambda x, y, v: y, 1.5)]))
    assert not proved_in_another_ordinate(problem(descent, maximise=True))


def test_the_descent_is_least_of_all_curves_and_verified_so():
    # a cycloid y = k (1 - cos t), x = k (t - sin t), through (1, 1): it takes t √(k/g)
    g = 9.81
    t = brentq(lambda t: (t - math.sin(t)) - (1 - math.cos(t)), 1.0, 3.0, xtol=1e-15)
    k = 1 / (1 - math.cos(t))
    solution = vc.solve(vc.Problem(lambda x, y, v: ca.sqrt((1 + v**2) / (2 * g * y)), vc.Fixed(0, 0), vc.Fixed(1, 1)))
    assert solution.value == pytest.approx(t * math.sqrt(k / g), rel=1e-13)
    assert not solution.local
    assert solution.searched.startswith("L is proved convex in the ordinate z")
    assert "least of all curves" in str(solution)
    assert vc.verify(solution).verdict is vc.Verdict.MINIMUM


def test_a_ray_in_an_exponential_index_is_least_of_all_curves():
    # n = e^y: n/√(1 + y'²) is constant along a ray, so that y = ln(cos 1/2) - ln(cos x) through (∓1/2, 0)
    index = vc.Problem(lambda x, y, v: ca.exp(y) * ca.sqrt(1 + v**2), vc.Fixed(-0.5, 0), vc.Fixed(0.5, 0))
    solution = vc.solve(index)
    assert solution.searched.startswith("L is proved convex in the ordinate z")
    assert solution.value == pytest.approx(2 * math.sin(0.5), rel=1e-13)
    x = np.linspace(-0.5, 0.5, 11)
    exact = math.log(math.cos(0.5)) - np.log(np.cos(x))
    assert np.abs(solution.curve(x, 0)[0] - exact).max() <= solution.error.curve


@pytest.mark.parametrize("a", [0.7, 0.8881, 0.95])
def test_a_singular_power_is_followed_to_its_pole(a):
    # y^-a/√(1 + y'²) is constant: with y = Y cos(f)^(1/a) and y' = tan f, dx = Y/a cos(f)^(1/a) df and the integrand
    # Y^(1-a)/a cos(f)^(1/a - 2) df, from f = π/2 at the pole over the top to y = 1. At 0.9 x is about the power 60 of
    # the curve's own coordinate
    power = mp.mpf(str(a))

    def over_the_top(exponent, last):
        half = (exponent + 1) / 2
        return (mp.beta(0.5, half) + mp.betainc(0.5, half, 0, mp.sin(last) ** 2)) / 2

    def far(top):
        return top / power * over_the_top(1 / power, mp.acos(top**-power))

    with mp.workdps(30):
        top = mp.findroot(lambda top: far(top) - 2.5, (1.05, 1.6), solver="anderson")
        known = top ** (1 - power) / power * over_the_top(1 / power - 2, mp.acos(top**-power))
    solution = vc.solve(vc.Problem(lambda x, y, v: y**-a * ca.sqrt(1 + v**2), vc.Fixed(0, 0), vc.Fixed(2.5, 1)))
    assert abs(solution.value - known) <= solution.error.value
    assert not solution.local
