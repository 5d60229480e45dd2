"""Constants gathered in sums, so that coordinates measured from an end keep their digits."""

import math
from typing import Any

import casadi as ca
import pytest

import varcalc as vc
from varcalc.formulation.singular.offsets import gathered, multiplied_out
from varcalc.problem.functional import Symbols

SYMBOLS = Symbols.make(ca.SX, 1, 1, 0, 0)


@pytest.mark.parametrize(
    ("expression", "exact"),
    [
        (lambda t: 1 - (1 - t), lambda t: t),
        (lambda t: (3 - 2 * (1 - t)) - 1, lambda t: 2 * t),
        (lambda t: ca.sqrt(-(1 - t) + 1), lambda t: t**0.5),
        (lambda t: (2 - t) * (0.5 - (1 - t) * 0.5), lambda t: (2 - t) * 0.5 * t),
    ],
)
def test_constants_cancel_before_anything_is_rounded(expression: Any, exact: Any) -> None:
    t = SYMBOLS.x
    function = ca.Function("f", [t], [gathered(expression(t), SYMBOLS)])
    for at in (1e-30, 0.3):
        assert float(function(at)) == pytest.approx(exact(at), rel=1e-15)


def test_products_are_multiplied_out() -> None:
    t = SYMBOLS.x
    # the square of the rounded root of 2 is 2 but for rounding
    cases = [
        (1 - (1 - t) ** 2, 2e-30),
        (2 - (2**0.5 - t) * (2**0.5 - t), 2**1.5 * 1e-30),
        (1 - (3 - t) / 3, 1e-30 / 3),
        (math.pi / 2 - ca.asin(1 - t), 2**0.5 * 1e-15),
        (math.pi / 2 + ca.asin(t - 1), 2**0.5 * 1e-15),
    ]
    for expression, exact in cases:
        function = ca.Function("f", [t], [multiplied_out(expression, SYMBOLS)])
        assert float(function(1e-30)) == pytest.approx(exact, rel=1e-15)


@pytest.mark.parametrize("power", [0.3, 0.5, 0.75])
def test_a_weight_that_vanishes_at_the_end(power: float) -> None:
    # (1 - x)^s y' is constant, so y = 1 - (1 - x)^(1 - s)
    problem = vc.Problem(lambda x, y, dy: (1 - x) ** power * dy**2, vc.Fixed(0, 0), vc.Fixed(1, 1))
    solution = vc.solve(problem, tol=1e-13)
    assert solution.status is vc.Status.SOLVED
    assert solution.value == pytest.approx(1 - power, abs=1e-14)


@pytest.mark.parametrize("start", [1e-4, 1e-8, 1e-12])
def test_a_line_at_depth_three_costs_no_digits(start: float) -> None:
    # 3 - y, taken exactly of the rounded ordinate, is what the start is off the line
    ends = vc.Fixed(0, 3 - start), vc.Fixed(1, 2)
    shifted = vc.solve(vc.Problem(lambda x, y, dy: ca.sqrt((1 + dy**2) / (3 - y)), *ends), tol=1e-12)
    ends = vc.Fixed(0, 3 - (3 - start)), vc.Fixed(1, 1)
    plain = vc.solve(vc.Problem(lambda x, y, dy: ca.sqrt((1 + dy**2) / y), *ends), vc.FirstIntegral(), tol=1e-12)
    assert shifted.value == pytest.approx(plain.value, abs=4e-15)
