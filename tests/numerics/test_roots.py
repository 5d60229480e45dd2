"""Roots, minima and edges on arrays."""

import numpy as np
import pytest

from varcalc.numerics.roots import bracketed_newton, edges, first_ahead, growing, least, quadratic, scanned_root


@pytest.mark.parametrize(("low", "high"), [(0.0, 3.0), (3.0, 0.0)])
def test_a_root_by_scans_takes_few_of_them(low: float, high: float) -> None:
    calls = []

    def function(x: np.ndarray) -> np.ndarray:
        calls.append(len(x))
        return np.exp(x) - 5

    assert scanned_root(function, low, high, 1e-13) == pytest.approx(np.log(5), rel=1e-14)
    assert len(calls) <= 4


def test_a_root_that_no_polynomial_foretells() -> None:
    assert scanned_root(lambda x: np.cbrt(x - 0.3), -1.0, 2.0, 0.0) == pytest.approx(0.3, rel=1e-14)
    assert scanned_root(lambda x: np.where(x < 0.3, -1.0, 1.0), -1.0, 2.0, 0.0) == pytest.approx(0.3, rel=1e-14)


def test_no_root_where_no_sign_changes_or_beside_what_is_no_number() -> None:
    assert scanned_root(lambda x: x**2 + 1, -1.0, 1.0, 0.0) is None
    assert scanned_root(lambda x: np.where(x > 0.5, np.nan, 1.0), 0.0, 1.0, 0.0) is None


def test_newton_in_brackets_on_arrays() -> None:
    """x³ = a for many a at once, from the middle of brackets that hold it; steep and flat ones."""
    a = np.array([1e-12, 0.3, 2.0, 26.9])
    low, high = np.zeros(4), np.full(4, 3.0)
    x, moved = bracketed_newton(lambda x: (a - x**3, -3 * x**2), low, high, (low + high) / 2, relative=1e-15)
    np.testing.assert_allclose(x, np.cbrt(a), rtol=1e-14)
    assert np.all(moved <= 1e-14 * x)


def test_a_root_is_met_where_the_derivative_is_zero_too() -> None:
    x, _ = bracketed_newton(lambda x: (-(x**2), -2 * x), -np.ones(1), np.ones(1), np.zeros(1))
    assert x[0] == 0.0


def test_what_is_no_number_stays_so() -> None:
    start = np.array([np.nan, 0.5])
    x, _ = bracketed_newton(lambda x: (1 - 4 * x, -4.0), np.zeros(2), np.ones(2), start, absolute=1e-12)
    np.testing.assert_array_equal(x, [np.nan, 0.25])


def test_edges_are_neighbouring_numbers() -> None:
    wanted = np.array([[1 / 3], [np.pi]])
    inside, outside = edges(lambda x: x < wanted, np.zeros(2), np.full(2, 7.0))
    np.testing.assert_array_equal(np.nextafter(inside, 9), outside)
    assert np.all(inside < wanted[:, 0])
    assert np.all(outside >= wanted[:, 0])


def test_a_minimum_by_scans() -> None:
    assert least(lambda x: np.cosh(x - 0.7), -3.0, 5.0) == pytest.approx(0.7, abs=1e-7)


@pytest.mark.parametrize(("near", "far"), [(1e-9, 1e9), (-1e-9, 1e9), (2.0, -3.0), (0.0, 5.0)])
def test_zeros_of_a_quadratic_without_cancellation(near: float, far: float) -> None:
    for scale in (1.0, -2.0):
        zeros = quadratic(np.array(near * far * scale), np.array(-(near + far) * scale), np.array(scale))
        np.testing.assert_allclose(np.sort(zeros), np.sort([near, far]), rtol=4e-16)


def test_a_quadratic_without_zeros_and_one_that_is_a_straight_line() -> None:
    zeros = quadratic(np.array([1.0, 1.0]), np.array([0.0, -2.0]), np.array([1.0, 0.0]))
    assert np.all(np.isnan(zeros[:, 0]))
    assert first_ahead(zeros).tolist() == [np.inf, 0.5]


def test_where_growing_functions_vanish_however_far_from_the_guess() -> None:
    roots = np.array([0.0, 1e-6, 1.0, 1e5])
    found = growing(lambda x: (x**3 - roots**3, 3 * x**2), np.array([1.0, 1.0, 1e-3, 1.0]), 1e-15)
    np.testing.assert_allclose(found, roots, rtol=1e-14, atol=1e-15)


def test_where_exponentials_vanish_however_far_beyond_they_are_begun() -> None:
    """Newton's steps from x0 go back by one each: what ends after a hundred of them is no zero."""
    found = growing(lambda x: (np.exp(x) - 5.0, np.exp(x)), np.array([1.0, 300.0, 700.0]), 1e-15)
    np.testing.assert_allclose(found, np.log(5.0), rtol=1e-14)
