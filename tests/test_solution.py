"""A Solution answers where its curve is known, and nowhere else."""

import math
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest

import varcalc as vc
from varcalc.solution import ErrorEstimate, defined


def line(first: float, last: float) -> vc.Solution:
    return vc.solve(vc.Problem(lambda x, y, dy: dy**2, vc.Fixed(first, 0), vc.Fixed(last, 1)))


def test_outside_the_interval_nothing_is_known() -> None:
    solution = line(1, 3)
    assert solution.interval == (1, 3)
    for x in (0.99, 3.01, math.nan, [2.0, 3.5]):
        with pytest.raises(ValueError, match=r"the curve is known from 1.0 to 3.0 only, not at"):
            solution.y(x)
        with pytest.raises(ValueError, match=r"from 1\.0 to 3\.0"):
            solution.dy(x)


@pytest.mark.parametrize("width", [1e-6, 1.0, 1e6])
def test_round_off_of_the_abscissa_is_forgiven(width: float) -> None:
    solution = line(0, width)
    assert solution.y(width * (1 + 5e-13)) == pytest.approx(1, abs=1e-11)
    assert solution.y(np.array([-5e-13 * width, width])) == pytest.approx([0, 1], abs=1e-11)
    with pytest.raises(ValueError, match="only, not at"):
        solution.y(width * (1 + 1e-11))


def test_a_curve_is_known_from_zero_to_one() -> None:
    solution = vc.solve(vc.Curve(lambda q, dq: ca.norm_2(dq), vc.At((1, 1)), vc.At((4, 5))))
    assert solution.interval == (0, 1)
    assert solution.q(1) == pytest.approx([4, 5])
    with pytest.raises(ValueError, match=r"from 0.0 to 1.0 only, not at 1.5"):
        solution.q(1.5)


def test_a_sliding_end_is_where_it_slid_to() -> None:
    shore = vc.OnCurve(lambda x, y: x + y - 2, 1.7)
    problem = vc.Problem(lambda x, y, dy: ca.sqrt(1 + dy**2), vc.Fixed(0, 0), shore)
    for method in (vc.Ritz(), vc.Collocation(), vc.FirstIntegral()):
        assert vc.solve(problem, method).interval == pytest.approx((0, 1), abs=1e-8)


def test_without_a_curve_there_is_no_interval() -> None:
    refused = vc.solve(vc.Problem(lambda x, y, dy: -(dy**2), vc.Fixed(0, 0), vc.Fixed(1, 1)), throw=False)
    with pytest.raises(ValueError, match="there is no curve to evaluate"):
        _ = refused.interval


def test_the_shape_of_the_abscissae_is_kept() -> None:
    solution = line(0, 1)
    assert isinstance(solution.y(0.5), float)
    assert solution.y(np.full((2, 3), 0.5)).shape == (2, 3)
    assert solution.y([]).shape == (0,)


@pytest.mark.parametrize(
    ("wrong", "ordinates"),
    [
        ({"value": math.inf}, 1.0),
        ({"value": math.nan}, 1.0),
        ({"error": ErrorEstimate(math.inf, 0.0)}, 1.0),
        ({"error": ErrorEstimate(0.0, math.nan)}, 1.0),
        ({}, math.nan),
    ],
)
def test_what_is_not_a_number_is_no_answer(wrong: dict[str, Any], ordinates: float) -> None:
    solution = line(0, 1)
    assert defined(solution, np.ones((1, 2))) is solution
    refused = defined(replace(solution, **wrong), np.array([[0.0, ordinates]]))
    assert refused.status is vc.Status.NOT_CONVERGED
    assert "number" in refused.message or "error" in refused.message
    assert refused.curve is None
