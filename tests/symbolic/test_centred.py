"""Expressions that depend on one distance alone, read from their operations."""

import casadi as ca
import numpy as np
import pytest

from varcalc.symbolic.centred import about_centre, over_plane

R = ca.SX.sym("r", 3)
X, Y, Z = R.elements()
SQUARED = (X - 1) ** 2 + (Y + 2) ** 2 + Z**2


@pytest.mark.parametrize(
    "expression",
    [
        1 + ca.exp(-SQUARED),
        ca.fmax(ca.sqrt(SQUARED), 1.0) / (1 + SQUARED),
        ca.if_else(SQUARED < 2, ca.sqrt(3 - SQUARED), 1.0),
        ca.sqrt(2 - (X**2 - 2 * X + 4 * Y + Y * Y + Z * Z)),
    ],
)
def test_what_depends_on_the_distance_from_a_centre(expression):
    centre, function = about_centre(expression, R)
    np.testing.assert_allclose(centre, [1, -2, 0], rtol=1e-15)
    value = ca.Function("value", [R], [expression])
    for place in np.random.default_rng(1).uniform(-1, 1, (20, 3)) + centre:
        assert float(function(np.sum((place - centre) ** 2))) == pytest.approx(float(value(place)), rel=1e-13)


@pytest.mark.parametrize(
    "expression",
    [
        ca.exp(-(X**2) - Y**2),
        ca.exp(-SQUARED) + 1e-30 * X,
        ca.exp(-SQUARED) + ca.exp(-((X - 1.1) ** 2) - (Y + 2) ** 2 - Z**2),
        X * ca.exp(-SQUARED),
        ca.SX(1.5),
        ca.sin(X),
    ],
)
def test_what_does_not(expression):
    assert about_centre(expression, R) is None


HEIGHT = 2 * X - 3 * Y + 6 * Z


@pytest.mark.parametrize(
    "expression",
    [
        1 + ca.exp(-HEIGHT),
        ca.fabs(1.0 - HEIGHT) + ca.sin(HEIGHT / 7),
        ca.sqrt(5 + (2 * X - 3 * Y + 6 * Z - 1) ** 2) / ca.cosh(-2 * HEIGHT),
        ca.if_else(2 * X + 6 * Z < 3 * Y, 1 + ca.tanh(HEIGHT), 1.0),
    ],
)
def test_what_depends_on_the_height_over_a_plane(expression):
    up, function = over_plane(expression, R)
    np.testing.assert_allclose(up, np.array([2, -3, 6]) / 7, rtol=1e-15)
    value = ca.Function("value", [R], [expression])
    for place in np.random.default_rng(1).uniform(-1, 1, (20, 3)):
        assert float(function(place @ up)) == pytest.approx(float(value(place)), rel=1e-12)


@pytest.mark.parametrize(
    "expression",
    [ca.exp(-HEIGHT) + 1e-6 * X, ca.sin(X) + ca.sin(Y), X * Y, SQUARED, HEIGHT**2 + X, ca.exp(HEIGHT * X), ca.SX(2.0)],
)
def test_what_does_not_depend_on_one_height(expression):
    assert over_plane(expression, R) is None
