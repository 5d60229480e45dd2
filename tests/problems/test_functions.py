"""The numerical tools of the problem files: roots, differences without cancellation, quadrature."""

import math

import mpmath as mp
import numpy as np
import pytest

from varcalc.problems._functions import sine_deficit, sinh_excess
from varcalc.problems._quadrature import integral
from varcalc.problems._roots import increasing_root


@pytest.mark.parametrize("z", [1e-9, 1e-3, 0.5, 1.9999, 2.0, 3.0, -0.5])
def test_differences_keep_their_digits(z):
    assert float(sine_deficit(z)) == pytest.approx(float(mp.mpf(z) - mp.sin(z)), rel=1e-15)
    assert float(sinh_excess(z)) == pytest.approx(float(mp.sinh(z) - mp.mpf(z)), rel=1e-15)


def test_roots_of_many_targets_at_once():
    targets = np.array([0.0, 1e-9, 2.0, 1e9])
    roots = increasing_root(lambda x: (x**3, 3 * x**2), 0.0, 2e3, targets)
    np.testing.assert_allclose(roots[1:], np.cbrt(targets[1:]), rtol=4e-16)
    assert roots[0] < 1e-30


def test_a_bracket_of_no_width_is_its_own_root():
    assert increasing_root(lambda x: (x**3, 3 * x**2), 0.0, 0.0) == 0.0


def test_a_root_where_the_slope_is_infinite_at_an_end():
    root = increasing_root(lambda x: (np.arctanh(x), 1 / (1 - x**2)), -1.0, 1.0, 3.0)
    assert root == pytest.approx(math.tanh(3.0), rel=1e-15)


def test_integrals_to_many_ends():
    ends = np.array([[0.0, 1.0], [2.0, 3.0]])
    np.testing.assert_allclose(integral(np.cos, 0.0, ends), np.sin(ends), rtol=1e-15, atol=0)
