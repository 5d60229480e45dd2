"""A deeper well on the other side is found in whatever units x and y are measured."""

import casadi as ca
import numpy as np
import pytest

import varcalc as vc

LENGTH, TILT = 10.0, 0.3
UNITS = [(1e3, 1), (1e6, 1), (1e-3, 1), (1e-6, 1), (1, 1e3), (1, 1e6), (1, 1e-3), (1, 1e-6)]
"""Of x and of y."""


def wells(y):
    """With a minimum near 1 and a deeper one near -1."""
    return (y**2 - 1) ** 2 + TILT * y


def action(x_unit, y_unit):
    return lambda x, y, v: ((v * x_unit / y_unit) ** 2 / 2 + wells(y / y_unit)) / x_unit


def graph(x, y):
    return vc.Problem(action(x, y), vc.Fixed(0, y), vc.Fixed(LENGTH * x, y)), 1


def pair(x, y):
    both = action(x, y)
    ends = vc.Fixed(0, [y, y]), vc.Fixed(LENGTH * x, [y, y])
    return vc.Problem(lambda s, q, v: both(s, q[0], v[0]) + both(s, q[1], v[1]), *ends), 2


def under_a_bound(x, y):
    bound = vc.Bound(lambda s, q, v: q, upper=5 * y)
    return vc.Problem(action(x, y), vc.Fixed(0, y), vc.Fixed(LENGTH * x, y), [bound]), 1


def levelled(x, y):
    """A level that every curve keeps that is its own mirror image."""
    odd = vc.Isoperimetric(lambda s, q, v: ca.sin(2 * np.pi * s / LENGTH / x) * q / y / x, 0.0)
    return vc.Problem(action(x, y), vc.Fixed(0, y), vc.Fixed(LENGTH * x, y), [odd]), 1


@pytest.mark.parametrize("units", UNITS)
@pytest.mark.parametrize("stated", [graph, pair, under_a_bound, levelled])
def test_the_deeper_well_is_found(stated, units):
    problem, count = stated(*units)
    solution = vc.solve(problem)
    # half of the way into the deeper well and back costs less than the shallow one for all of the way
    s = np.linspace(0, 1, 20_001)
    path = 1 - 2 * s**2 * (3 - 2 * s)
    into = 2 * np.trapezoid((12 * s * (1 - s) / 1.8) ** 2 / 2 + wells(path), s) * 1.8
    least = min(wells(np.roots([4, 0, -4, TILT]).real))
    assert solution.value < count * (into + (LENGTH - 3.6) * least) < count * LENGTH * wells(1.0)
    assert not solution.local


@pytest.mark.parametrize("units", UNITS)
def test_of_second_order_as_well(units):
    x_unit, y_unit = units
    bent = vc.Problem(
        lambda x, y, v, w: ((w * x_unit**2 / y_unit) ** 2 / 2 + wells(y / y_unit)) / x_unit,
        vc.Fixed(0, y_unit, 0), vc.Fixed(LENGTH * x_unit, y_unit, 0), order=2,
    )  # fmt: skip
    s = np.linspace(0, 1, 20_001)
    path = 1 - 2 * s**2 * (3 - 2 * s)
    passing, bending = np.trapezoid(wells(path), s), np.trapezoid((12 * (1 - 2 * s)) ** 2 / 2, s)
    width = (3 * bending / (passing - wells(-1.0))) ** 0.25  # at which the way into the deeper well costs least
    into = 2 * (bending / width**3 + passing * width)
    solution = vc.solve(bent)
    assert solution.value < into + (LENGTH - 2 * width) * wells(-1.0) < LENGTH * wells(1.0)
    assert not solution.local
