"""Curves held as polynomials on pieces, against the functions they stand for."""

import numpy as np

from varcalc.numerics.resampled import resampled


def bent(x, derivative):
    """sin x up to 1, and from there on a parabola from the same point with another slope."""
    t = x - 1.0
    parts = [(np.sin(x), np.sin(1.0) - 2 * t + t**2), (np.cos(x), -2 + 2 * t)][derivative]
    return np.where(x < 1, *parts)[None]


def test_the_slope_next_to_a_corner_is_that_of_its_own_side():
    held = resampled(bent, [0.0, 1.0, 3.0], 2)
    for x in (np.nextafter(1.0, 0.0), 1 - 1e-15, 1 - 1e-14, 1 - 1e-13):
        assert abs(held(np.array([x]), 1)[0, 0] - np.cos(1.0)) <= 1e-12
    for x in (1.0, 1 + 1e-15, 1 + 1e-13):
        assert abs(held(np.array([x]), 1)[0, 0] + 2.0) <= 1e-12


def test_a_corner_at_an_edge_needs_no_small_pieces():
    held = resampled(bent, [0.0, 1.0, 3.0], 2)
    assert min(np.diff(part.edges).min() for part in held.derivatives) > 0.1
    x = np.linspace(0, 3, 301)
    for k in (0, 1):
        np.testing.assert_allclose(held(x, k), bent(x, k), rtol=0, atol=1e-13)
