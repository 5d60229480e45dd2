"""Closed curves by IPOPT, whose only element begins and ends at one vertex, against closed forms."""

import math

import casadi as ca
import pytest

import varcalc as vc

CLOSED = vc.Periodic(0, 1), vc.Periodic(0, 1)


def pulled(x, y, v):
    return 0.75 * v**2 - 0.7 * y


@pytest.mark.parametrize(
    ("bound", "rest"),
    [
        (vc.Bound(lambda x, y, v: y, upper=2), 2.0),
        (vc.Bound(lambda x, y, v: v + 0.7 * y, upper=1.513), 1.513 / 0.7),
        (vc.Bound(lambda x, y, v: y + 0.1 * v**2, lower=-3, upper=0.5), 0.5),
    ],
)
def test_what_pulls_a_closed_curve_brings_it_to_rest_at_its_bound(bound, rest):
    solution = vc.solve(vc.Problem(pulled, *CLOSED, [bound]))
    assert abs(solution.value + 0.7 * rest) < 1e-9
    assert abs(solution.y(0.3) - rest) < 1e-6


def test_a_bound_on_the_slope_holds_no_closed_curve_that_is_pulled():
    solution = vc.solve(vc.Problem(pulled, *CLOSED, [vc.Bound(lambda x, y, v: v, upper=1)]), throw=False)
    assert not solution.status.ok


def test_ipopt_and_newton_come_to_one_closed_curve():
    def fitted(x, y, v):
        return v**2 + (y - ca.cos(2 * math.pi * x)) ** 2

    turns = (2 * math.pi) ** 2
    for method in (vc.Ritz(), vc.Ritz(optimiser=vc.Ipopt())):
        solution = vc.solve(vc.Problem(fitted, *CLOSED), method)
        assert abs(solution.value - turns / (1 + turns) / 2) < 1e-10


def test_a_closed_curve_that_may_lie_anywhere_is_told_so_under_bounds_too():
    problem = vc.Problem(lambda x, y, v: v**2, *CLOSED, [vc.Bound(lambda x, y, v: y, upper=0.005)])
    assert vc.solve(problem, throw=False).verdict is vc.Verdict.DEGENERATE


def test_a_minimum_of_zero_under_a_bound_is_as_good_as_what_it_is_summed_of():
    ceiling = vc.Bound(lambda x, y, v: y + 0.3 * ca.fmax(0, 1 - ca.fabs(x - 0.6) / 0.1), upper=0.15)
    problem = vc.Problem(lambda x, y, v: v**2 / 2 + ((y / 3) ** 2 - 0.5) ** 2, *CLOSED, [ceiling])
    solution = vc.solve(problem)
    assert 0 <= solution.value < 1e-12
    assert abs(solution.y(0.4) + 3 / math.sqrt(2)) < 1e-5
