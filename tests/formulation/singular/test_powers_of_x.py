"""Weights that are powers of the distance from an end, of any exponent: x^a y'^2 has the minimum 1 - a on [0, 1]."""

from __future__ import annotations

import math

import pytest

import varcalc as vc

EXPONENTS = (-1, -2, -7.3, -0.03, -1 / 3, -math.sqrt(2), 0.03, 0.5, 0.9, 1 / math.pi, 1 / math.sqrt(2))


def between(lagrangian, start=(0, 0), end=(1, 1)):
    return vc.Problem(lagrangian, vc.Fixed(*start), vc.Fixed(*end))


def check(problem, value, tol=1e-10):
    solution = vc.solve(problem, throw=False)
    assert solution.status is vc.Status.SOLVED, solution.message
    assert not solution.local
    assert abs(solution.value - value) <= tol * max(1, value)
    assert abs(solution.value - value) <= 10 * solution.error.value + 1e-13 * value


@pytest.mark.parametrize("a", EXPONENTS)
@pytest.mark.parametrize("at_start", [True, False])
def test_a_power_of_the_distance_from_an_end(a, at_start):
    check(between(lambda x, y, v: (x if at_start else 1 - x) ** a * v**2), 1 - a)


@pytest.mark.parametrize(("a", "b"), [(-1, -1), (-0.5, -0.5), (0.03, -0.03), (-1, 0.5), (-math.sqrt(2), 0.4)])
def test_powers_of_the_distances_from_both_ends(a, b):
    beta = math.gamma(1 - a) * math.gamma(1 - b) / math.gamma(2 - a - b)
    check(between(lambda x, y, v: x**a * (1 - x) ** b * v**2), 1 / beta)


@pytest.mark.parametrize("a", [-1, -0.03, 0.5])
def test_shifted_and_scaled(a):
    check(between(lambda x, y, v: 70 * ((x - 3) / 7) ** a * v**2, (3, 2), (10, 3)), 10 * (1 - a))
    check(between(lambda x, y, v: 1e-3 * (5 - x) ** a * v**2, (4, 700), (5, 800)), 10 * (1 - a))


@pytest.mark.parametrize("a", [-1.9, -1, -0.5, 1])
@pytest.mark.parametrize("low", [True, False])
def test_a_power_of_the_ordinate(a, low):
    # y^(a / 2) y' is the derivative of y^(1 + a / 2) / (1 + a / 2), a straight line along the extremal
    check(between(lambda x, y, v: (y if low else 1 - y) ** a * v**2), (1 + a / 2) ** -2, tol=3e-10)


@pytest.mark.parametrize("a", [1.0, 1.5])
def test_from_one_on_no_curve_attains_the_infimum(a):
    solution = vc.solve(between(lambda x, y, v: x**a * v**2), throw=False)
    assert not solution.status.ok
    assert solution.verdict is vc.Verdict.NOT_ATTAINED, solution.message


def test_up_to_one_some_curve_does_however_steep_it_leaves_the_end():
    check(between(lambda x, y, v: x**0.97 * v**2), 1 - 0.97)
