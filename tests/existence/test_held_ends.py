"""Free ends that rest on kinks of what they cost, against closed forms."""

import math

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

import varcalc as vc


def problem(cost, lagrangian=lambda x, y, dy: dy**2 / 2, maximise=False):
    return vc.Problem(lagrangian, vc.Fixed(0, 0), vc.Free(1), end_cost=cost, maximise=maximise)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(("rate", "place"), [(1.0, 0.5), (3.0, 2.0), (0.2, 0.5), (2.0, -1.5)])
def test_what_distance_costs_holds_an_end_up_to_a_slope(rate, place, sign):
    solution = vc.solve(
        problem(lambda x0, y0, x1, y1: sign * rate * ca.fabs(y1 - place), lambda x, y, v: sign * v**2 / 2, sign < 0)
    )
    # the slope of the line to the place is held by no more than the rate; else the line has that slope
    exact = place**2 / 2 if abs(place) <= rate else rate * abs(place) - rate**2 / 2
    assert sign * solution.value == pytest.approx(exact, abs=1e-12)
    assert float(solution.curve([1.0], 0)[0, 0]) == pytest.approx(math.copysign(min(rate, abs(place)), place), abs=1e-9)


@pytest.mark.parametrize(
    "cost",
    [
        lambda x0, y0, x1, y1: ca.fmax(3 * (y1 - 1), 2 * (1 - y1)),
        lambda x0, y0, x1, y1: ca.if_else(y1 > 1, 3 * (y1 - 1), -2 * (y1 - 1)),
        lambda x0, y0, x1, y1: 2 * ca.fabs(ca.exp(y1) - math.e),
        lambda x0, y0, x1, y1: 3 * ca.fabs(y1 - 1) + ca.fabs(y1 + 2) - 3,
    ],
)
def test_kinks_however_they_are_written_hold_an_end(cost):
    solution = vc.solve(problem(cost))
    assert solution.value == pytest.approx(0.5, abs=1e-12)
    assert vc.verify(solution).verdict is vc.Verdict.MINIMUM


@pytest.mark.parametrize("method", [vc.Ritz(), vc.Collocation(), vc.Shooting()])
def test_every_method_that_optimises_costs_finds_the_held_end(method):
    # y'' = y from 0 to the place: y' y / 2 at the end
    solution = vc.solve(
        problem(lambda x0, y0, x1, y1: 3 * ca.fabs(y1 - 0.5), lambda x, y, v: (v**2 + y**2) / 2), method
    )
    assert solution.value == pytest.approx(0.125 / math.tanh(1), abs=1e-10)


def test_a_crest_of_the_cost_holds_no_end():
    solution = vc.solve(problem(lambda x0, y0, x1, y1: -ca.fabs(y1)))
    assert solution.value == pytest.approx(-0.5, abs=1e-12)  # slopes of 1 or -1


def test_a_level_beside_a_held_end():
    area = vc.Isoperimetric(lambda x, y, dy: y, 0.5)
    held = vc.Problem(
        lambda x, y, dy: dy**2 / 2,
        vc.Fixed(0, 0),
        vc.Free(1),
        [area],
        end_cost=lambda x0, y0, x1, y1: 5 * ca.fabs(y1 - 0.5),
    )
    # the parabola through both ends with that area: y = x/2 + 3/2 x (1 - x)
    assert vc.solve(held).value == pytest.approx(0.5 * (0.25 + 0.75), abs=1e-12)


@pytest.mark.parametrize("apart", [1e-2, 1e-4, 1e-6])
def test_an_end_near_a_faint_kink_is_where_it_costs_least(apart):
    faint, least = 1e-9, 0.5
    kink = least - apart
    solution = vc.solve(problem(lambda x0, y0, x1, y1: 10 * (y1 - 1.05 * least) ** 2 + faint * ca.fabs(y1 - kink)))
    end = least - faint / 21  # the rate of the kink moves it
    exact = end**2 / 2 + 10 * (end - 1.05 * least) ** 2 + faint * (end - kink)
    assert abs(solution.value - exact) <= solution.error.value + 1e-15


def test_an_end_is_held_beside_bounds_and_kinks_that_the_curve_does_not_meet():
    # y'' = -2 above the kink of the place at -0.3; the momentum at the end, 0, is less than what its cost holds
    problem = vc.Problem(
        lambda x, y, v: v**2 / 2 - 2 * ca.fabs(y + 0.3),
        vc.Fixed(0, 0),
        vc.Free(1),
        [vc.Bound(lambda x, y, v: v, lower=-3, upper=3)],
        end_cost=lambda x0, y0, x1, y1: 3 * ca.fabs(y1 - 1),
    )
    solution = vc.solve(problem)
    # y = 2 x - x^2: 2 (1 - x)^2 - 2 (2 x - x^2 + 0.3)
    assert abs(solution.value - (2 / 3 - 2 * (1 - 1 / 3 + 0.3))) <= 10 * solution.error.value + 1e-13


def test_a_kink_of_the_cost_turns_an_end_away_and_a_kink_of_the_place_holds_the_curve():
    # down to the level, at rest on it, up again to where the momentum v^3 + v/2 is what the end costs on its lower side
    load, level, first, pull, span = 1.577, -1.197, -0.322, 2.229, 4.0

    def steep(p):
        return max(v.real for v in np.roots([1, 0, 0.5, -p]) if abs(v.imag) < 1e-12)

    def moved(p):  # in the time p / load: v dp / load
        return quad(lambda q: steep(q) / load, 0, p, epsabs=1e-14)[0]

    def summed(p):  # of L along that, with the height above the level
        def here(q):
            v = steep(q)
            return (v**4 / 4 + v**2 / 4 + load * moved(q)) / load

        return quad(here, 0, p, epsabs=1e-12)[0]

    down = brentq(lambda p: moved(p) - (first - level), 0.1, 5, xtol=1e-14)
    end = level + moved(pull)
    least = summed(down) + summed(pull) + pull * (-0.03 - end)
    assert end < -0.03
    problem = vc.Problem(
        lambda x, y, v: v**4 / 4 + v**2 / 4 + load * ca.fmax(0, y - level),
        vc.Fixed(0, first),
        vc.Free(span),
        end_cost=lambda x0, y0, x1, y1: pull * ca.fabs(y1 + 0.03),
    )
    solution = vc.solve(problem)
    assert abs(solution.value - least) < 1e-8
    assert abs(float(solution.y(span)) - end) < 1e-6


def test_a_kink_that_a_bound_keeps_the_end_from_is_no_end():
    ceiling = vc.Bound(lambda x, y, v: y, upper=0.3)
    problem = vc.Problem(
        lambda x, y, v: v**2 / 2, vc.Fixed(0, 0), vc.Free(1), [ceiling],
        end_cost=lambda x0, y0, x1, y1: 3 * ca.fabs(y1 - 0.5),
    )  # fmt: skip
    assert abs(vc.solve(problem).value - (0.3**2 / 2 + 0.6)) < 1e-9


def rubbed(x, y, v):
    return v**2 / 2 + ca.fabs(v)


@pytest.mark.parametrize(
    ("lagrangian", "bound", "value"),
    [
        # straight down to the bound, along it or not
        (rubbed, vc.Bound(lambda x, y, v: y + 0.1 * x, upper=0.35), 0.15**2 / 4 + 0.15),
        (rubbed, vc.Bound(lambda x, y, v: y + 0.1 * x, upper=0.3), 0.2**2 / 4 + 0.2),
        (rubbed, vc.Bound(lambda x, y, v: -2 * y, lower=-1), 0.0),
        # a load of 0.3 brings it down by 0.15 in a time of 1, with y'' = 0.3 up to rest; it rests from there
        (
            lambda x, y, v: rubbed(x, y, v) + 0.3 * y,
            vc.Bound(lambda x, y, v: y + 0.1 * x, upper=0.35),
            0.09 / 6 + 0.15 + 0.3 * (0.15 * 2 + 0.05),
        ),
    ],
)
def test_a_bound_holds_a_free_end_of_what_friction_does_not(lagrangian, bound, value):
    solution = vc.solve(vc.Problem(lagrangian, vc.Fixed(0, 0.3), vc.Free(2), [bound]))
    assert abs(solution.value - value) < 1e-9


@pytest.mark.parametrize("level", [None, 0.3])
def test_a_bound_holds_an_end_that_slides(level):
    # freely, the line would end on x + y = 2 where r + r^2/2 = 1 of r = y/x, above the bound: it ends in the corner
    value, conditions = 1.5 + 0.25 / 3, [vc.Bound(lambda x, y, v: y, upper=0.5)]
    if level is not None:  # k x (3/2 - x) is added to the line, whose area is 0.375
        bent = (level - 0.375) * 6 / 1.5**3
        value, conditions = value + bent**2 * 1.5**3 / 6, [*conditions, vc.Isoperimetric(lambda x, y, v: y, level)]
    problem = vc.Problem(
        lambda x, y, v: v**2 / 2 + 1, vc.Fixed(0, 0), vc.OnCurve(lambda x, y: x + y - 2, 1.0), conditions
    )
    solution = vc.solve(problem)
    assert abs(solution.value - value) < 1e-10
    assert solution.interval[1] == pytest.approx(1.5, abs=1e-6)
