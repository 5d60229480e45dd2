"""Lagrangians that are lengths of a metric for all slopes but a few: what is not, is not solved as if it were."""

import casadi as ca
import pytest

import varcalc as vc

CYCLOID = 2.5819045128277724
"""int sqrt((1 + y'^2)/y) from (0, 0) to (1, 1): sqrt(D) phi at the end of the cycloid of diameter D = 1.1458340750."""


@pytest.mark.parametrize("width", [1e-2, 1e-4])
def test_a_spike_at_one_slope_of_the_cycloid(width):
    spiked = vc.Problem(
        lambda x, y, dy: ca.sqrt((1 + dy**2) / y) * (1 + 1e6 * ca.exp(-(((dy - 0.777) / width) ** 2))),
        vc.Fixed(0, 0), vc.Fixed(1, 1),
    )  # fmt: skip
    solution = vc.solve(spiked, vc.Ritz(), throw=False)
    assert not solution.status.ok
    assert "is not the length of a metric" in solution.message


def test_a_length_is_solved():
    cycloid = vc.Problem(lambda x, y, dy: ca.sqrt((1 + dy**2) / y), vc.Fixed(0, 0), vc.Fixed(1, 1))
    solution = vc.solve(cycloid)
    assert abs(solution.value - CYCLOID) <= solution.error.value + 1e-14
