"""Bounds that begin to hold a curve anywhere, beside a vertex of the first meshes too, against closed forms."""

import math

import casadi as ca
import numpy as np
import pytest

import varcalc as vc

PLACES = (0.25 + 1e-3, 0.25 + 2.9e-3, 0.25 - 3e-4, 0.5 - 1e-2, 0.137, 0.331)


def fall(k, d):
    """The least of v^2/2 + k y from k d^2/2 to zero, where y >= 0 is kept: y = k (d - x)^2 / 2."""
    return k**2 * d**3 / 3


@pytest.mark.parametrize(
    ("first", "last"), [*((place, 0.238) for place in PLACES), (PLACES[0], 0.25 - 1.7e-3), (PLACES[-1], 0.25 - 1.7e-3)]
)
def test_a_bound_on_one_of_two_functions_from_both_ends(first, last):
    """The second function goes straight, at the cost of 1/2."""
    k = 3 * math.sqrt(2)
    problem = vc.Problem(
        lambda x, y, v: ca.sumsqr(v) / 2 + k * y[0],
        vc.Fixed(0, [k * first**2 / 2, 0]),
        vc.Fixed(1, [k * last**2 / 2, 1]),
        [vc.Bound(lambda x, y, v: y[0], lower=0)],
    )
    solution = vc.solve(problem)
    assert abs(solution.value - fall(k, first) - fall(k, last) - 0.5) <= solution.error.value <= 1e-9


@pytest.mark.parametrize("joined", PLACES)
def test_a_bound_on_the_slope_from_the_start(joined):
    """v = k (1 - x) where that is below its bound, which it is from ``joined`` on."""
    k = 4.0
    steepest = k * (1 - joined)
    problem = vc.Problem(
        lambda x, y, v: v**2 / 2 - k * y,
        vc.Fixed(0, 0),
        vc.Free(1),
        [vc.Bound(lambda x, y, v: v, upper=steepest)],
    )
    held = steepest**2 * joined / 2 - k * steepest * (joined - joined**2 / 2)
    solution = vc.solve(problem)
    assert abs(solution.value - held + k**2 * (1 - joined) ** 3 / 6) <= solution.error.value <= 1e-9
    x = np.linspace(0, 1, 4001)
    assert np.max(solution.curve(x, 1)) <= steepest + 1e-6
