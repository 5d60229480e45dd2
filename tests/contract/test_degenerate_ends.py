"""Ends at which L_y'y' vanishes, so that a layer of no cost would carry a curve to any ordinate there."""

import math

import casadi as ca
import pytest

import varcalc as vc

METHODS = [None, vc.Ritz(), vc.Ritz(optimiser=vc.Ipopt()), vc.Collocation(), vc.Shooting()]
GOLDEN = (math.sqrt(5) - 1) / 2
"""x^2 y'' + 2 x y' = y has the powers x^0.618 and x^-1.618, of which the first alone has a finite value: 0.618."""


PROBLEMS = [
    vc.Problem(lambda x, y, v: x**2 * v**2 + y**2, vc.Fixed(0, 1), vc.Fixed(1, 1)),
    vc.Problem(lambda x, y, v: 70 * (ca.sin(1 - x) ** 2 * v**2 + y**2), vc.Fixed(0, 0), vc.Fixed(1, 1)),
]


@pytest.mark.parametrize("method", METHODS, ids=["ladder", "Newton", "IPOPT", "Collocation", "Shooting"])
@pytest.mark.parametrize("problem", PROBLEMS, ids=["at the start", "at the end"])
def test_an_infimum_that_only_a_jump_attains_is_no_answer(problem, method):
    solution = vc.solve(problem, method, throw=False)
    assert not solution.status.ok
    assert solution.verdict in (None, vc.Verdict.NOT_ATTAINED)


@pytest.mark.parametrize("method", METHODS[:-1], ids=["ladder", "Newton", "IPOPT", "Collocation"])
def test_the_power_that_ends_there_is_found(method):
    solution = vc.solve(
        vc.Problem(lambda x, y, v: x**2 * v**2 + y**2, vc.Fixed(0, 0), vc.Fixed(1, 1)), method, throw=False
    )
    assert solution.status.ok
    assert abs(solution.value - GOLDEN) <= 10 * solution.error.value
    assert solution.y(0.25) == pytest.approx(0.25**GOLDEN, abs=2 * solution.error.curve)
