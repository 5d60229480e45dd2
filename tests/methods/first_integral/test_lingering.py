"""Curves that stay by an equilibrium: how long goes as the logarithm of the least slope, far below round-off."""

import math

import pytest

import varcalc as vc
from varcalc.numerics import roots


def kink(left: float, length: float) -> tuple[vc.Problem, float]:
    """The kink tanh((x - left)/sqrt(2)) of v^2/2 + (1 - y^2)^2/4 and its value: that of (1 - y^2)/sqrt(2) over y."""
    ends = [math.tanh(x / math.sqrt(2)) for x in (-left, length - left)]
    primitive = [(y - y**3 / 3) / math.sqrt(2) for y in ends]
    problem = vc.Problem(
        lambda x, y, dy: dy**2 / 2 + (1 - y**2) ** 2 / 4, vc.Fixed(0, ends[0]), vc.Fixed(length, ends[1])
    )
    return problem, primitive[1] - primitive[0]


@pytest.mark.parametrize(
    ("left", "length", "method"),
    [
        *((*kept, None) for kept in ((6, 30), (7.5, 26), (5, 100), (8, 18))),
        *((*kept, vc.FirstIntegral()) for kept in ((5, 100), (8, 18))),
    ],
)
def test_a_kink_is_where_the_ends_hold_it(left, length, method):
    """Their hold falls as exp(-2 sqrt(2) left): an optimiser alone stops anywhere on the way."""
    problem, value = kink(left, length)
    solution = vc.solve(problem, method)
    assert solution.value == pytest.approx(value, rel=1e-13)
    assert solution.curve([float(left)], 0)[0, 0] == pytest.approx(0, abs=1e-4)


def test_slopes_beside_a_long_rest_are_found_in_few_steps(monkeypatch):
    """L - y' L_y' falls through zero there at a slope that differs from the curve's by less than round-off."""
    monkeypatch.setattr(roots, "NEWTON_STEPS", 12)
    problem, value = kink(6, 30)
    assert vc.solve(problem, vc.FirstIntegral()).value == pytest.approx(value, rel=1e-13)


@pytest.mark.parametrize("length", [10, 100, 250])
def test_a_layer_beside_a_long_rest_by_quadrature(length):
    """The integral of (v^2 + y^2)/2 from y = 0 to 1 is coth(length)/2, along sinh x/sinh length."""
    problem = vc.Problem(lambda x, y, dy: (dy**2 + y**2) / 2, vc.Fixed(0, 0), vc.Fixed(length, 1))
    solution = vc.solve(problem, vc.FirstIntegral())
    assert solution.value == pytest.approx(0.5 / math.tanh(length), rel=1e-12)
