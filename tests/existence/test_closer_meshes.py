"""What is narrow, beside kinks, corners and rests: never a curve that goes past a bound, nor a sum that missed it."""

import math

import casadi as ca
import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq

import varcalc as vc

NARROW = 1e-4


def spike(x, width=NARROW):
    return ca.exp(-(((x - 0.3) / width) ** 2))


def test_friction_that_is_strong_in_a_narrow_place_is_summed_there():
    problem = vc.Problem(
        lambda x, y, v: v**2 / 2 + (0.3 + 300 * spike(x)) * ca.fabs(v), vc.Fixed(0, 0), vc.Fixed(1, 0.2)
    )
    solution = vc.solve(problem, tol=1e-8)

    # v + mu = c where it moves, and it rests where mu is more than that
    def moving(c, of):
        edge = NARROW * math.sqrt(math.log(300 / (c - 0.3)))
        half = [quad(of, 0.3 + k * edge, 0.3 + k * 40 * NARROW, epsabs=1e-15, args=(c,))[0] for k in (-1, 1)]
        far = 1 - 80 * NARROW
        return far * of(0.0, c) + half[1] - half[0]

    def slope(x, c):
        return c - 0.3 - 300 * math.exp(-(((x - 0.3) / NARROW) ** 2))

    c = brentq(lambda c: moving(c, slope) - 0.2, 0.45, 0.55, xtol=1e-15)
    value = moving(c, lambda x, c: slope(x, c) ** 2 / 2 + (c - slope(x, c)) * slope(x, c))
    assert abs(solution.value - value) < 1e-8


def test_friction_takes_no_curve_past_a_narrow_ceiling():
    ceiling = vc.Bound(lambda x, y, v: y + 0.9 * spike(x), upper=0.5)
    friction = vc.Problem(lambda x, y, v: v**2 / 2 + 0.3 * ca.fabs(v), vc.Fixed(0, 0), vc.Fixed(1, 0.2), [ceiling])
    solution = vc.solve(friction, throw=False)
    # down to -0.4 there, and up to 0.2
    assert not solution.status.ok or solution.value > 0.16 / 0.6 + 0.36 / 1.4 + 0.3 * 1.0 - 1e-6


def test_a_kink_of_the_ordinate_takes_no_curve_past_a_narrow_ceiling():
    ceiling = vc.Bound(lambda x, y, v: y + 0.9 * spike(x), upper=1)
    problem = vc.Problem(
        lambda x, y, v: v**2 / 2 + 30 * ca.fabs(y - 0.5), vc.Fixed(0, 0.2), vc.Fixed(1, 0.2), [ceiling]
    )
    solution = vc.solve(problem, throw=False)
    assert not solution.status.ok or solution.y(0.3) < 0.1 + 1e-6


def test_a_bound_is_kept_between_the_points_of_a_coarse_mesh():
    limit = vc.Bound(lambda t, v, a: a + 0.01 * v, lower=-5.8, upper=5.8)
    way = vc.Isoperimetric(lambda t, v, a: v, 1)
    problem = vc.Problem(lambda t, v, a: a**2, vc.Fixed(0, 0), vc.Fixed(1, 0), [way, limit])
    solution = vc.solve(problem, vc.Ritz(degree=6, refine=False), throw=False)
    t = np.linspace(0, 1, 5001)
    assert not solution.status.ok or np.abs(solution.dy(t) + 0.01 * solution.y(t)).max() < 5.8 + 1e-5
