"""Curves that meet kinks, with an end that slides, against closed forms."""

import math

import casadi as ca
import pytest
from scipy.optimize import brentq

import varcalc as vc


def test_a_curve_through_a_kink_of_its_place_begins_where_its_energy_is_zero():
    # onto a level line the energy is zero, so the value is that of sqrt(2 (e + c |y - a|)) summed over y
    c, a, e, top = 0.6, 0.3, 0.7, 1.2
    problem = vc.Problem(
        lambda x, y, v, p: v**2 / 2 + p.c * ca.fabs(y - a) + e,
        vc.OnCurve(lambda x, y: y - top, x=-1), vc.Fixed(0, vc.Parameter("y")),
        constraints=[vc.Bound(lambda x, y, v, p: v, lower=-3.0, upper=3.0)], parameters={"c": c, "y": 0.0},
    )  # fmt: skip
    solution = vc.solve(problem)

    def exact(c):
        return sum((2 * (e + c * way)) ** 1.5 - (2 * e) ** 1.5 for way in (a, top - a)) / (3 * c)

    assert solution.value == pytest.approx(exact(c), abs=1e-11)
    assert solution.error.value <= 1e-10
    assert solution.sensitivities["c"] == pytest.approx((exact(c + 1e-5) - exact(c - 1e-5)) / 2e-5, abs=1e-8)
    assert math.isnan(solution.sensitivities["y"])  # rather than what it is with that end left out


def test_a_curve_that_rests_up_to_its_end_ends_on_a_slope_by_the_momentum_that_it_has_there():
    # it rises with m y'' = w (y - 1) until it rests, at a, and what presses it then changes the momentum from 1
    m, w, e, s, b = 0.5, 0.966, 0.4, -0.585, 0.832
    pace = math.sqrt(w / m)

    def height(a):
        return 1 - 1 / math.cosh(pace * a)

    def end(a):
        return 1 + (height(a) - b) / s

    def missed(a):
        momentum = 1 + w * (height(a) - 1) * (end(a) - a)
        return w * (height(a) - 1) ** 2 / 2 + e + s * momentum

    a = brentq(missed, 0.1, 1.4, xtol=1e-15)
    # on the way up y - 1 = -cosh(pace (a - x)) / cosh(pace a): both squares sum to w cosh(2 pace (a - x)) / cosh^2 / 2
    rising = w * math.sinh(2 * pace * a) / (4 * pace * math.cosh(pace * a) ** 2)
    exact = rising + height(a) + e * end(a) + w * (height(a) - 1) ** 2 / 2 * (end(a) - a)
    problem = vc.Problem(
        lambda x, y, v: ca.fabs(v) + m * v**2 / 2 + w * (y - 1) ** 2 / 2 + e,
        vc.Fixed(0, 0), vc.OnCurve(lambda x, y: y - b - s * (x - 1), x=1),
    )  # fmt: skip
    solution = vc.solve(problem)
    assert solution.value == pytest.approx(exact, abs=1e-10)
    assert solution.interval[1] == pytest.approx(end(a), abs=1e-5)
