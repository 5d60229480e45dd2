"""Kinks under bounds that are narrow somewhere: held on the tip of a spike, however short the way along it is."""

import math

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

import varcalc as vc

TIP, DEPTH, FRICTION = 0.3141, 0.6, 0.3


def over_a_spike(spike, lagrangian, start=0.0, end=0.2):
    ceiling = vc.Bound(lambda x, y, v: y + DEPTH * spike(x - TIP), upper=0.4)
    return vc.Problem(lagrangian, vc.Fixed(0, start), vc.Fixed(1, end), [ceiling])


def friction(x, y, v):
    return v**2 / 2 + FRICTION * ca.fabs(v)


@pytest.mark.parametrize("width", [1e-2, 1e-4])
def test_friction_goes_straight_to_the_tip_of_a_tent(width):
    problem = over_a_spike(lambda x: ca.fmax(0, 1 - ca.fabs(x) / width), friction)
    solution = vc.solve(problem)
    down, up = 0.2, 0.4
    value = down**2 / (2 * TIP) + up**2 / (2 * (1 - TIP)) + FRICTION * (down + up)
    assert abs(solution.value - value) <= 1e-10


@pytest.mark.parametrize("width", [3e-2, 1e-3])
def test_friction_follows_the_tip_of_a_round_spike_for_a_short_while(width):
    def ceiling(x):
        return 0.4 - DEPTH * math.exp(-((x / width) ** 2))

    def slope(x):
        return 2 * x / width**2 * DEPTH * math.exp(-((x / width) ** 2))

    solution = vc.solve(over_a_spike(lambda x: ca.exp(-((x / width) ** 2)), friction))

    # from both ends it comes by a tangent
    steepest = width / math.sqrt(2)
    first = brentq(lambda x: ceiling(x) - slope(x) * (TIP + x), -steepest, 0, xtol=1e-16)
    last = brentq(lambda x: ceiling(x) + slope(x) * (1 - TIP - x) - 0.2, 0, steepest, xtol=1e-16)
    along = quad(lambda x: slope(x) ** 2 / 2, first, last, epsabs=1e-14)[0]
    energy = slope(first) ** 2 / 2 * (TIP + first) + along + slope(last) ** 2 / 2 * (1 - TIP - last)
    assert abs(solution.value - energy - FRICTION * (0.2 + 2 * -ceiling(0.0) - 0.0)) <= 1e-9
    assert solution.error.value <= 1e-8


def test_a_kink_of_the_ordinate_is_left_for_the_tip_of_a_spike():
    level, pull, width = 0.1, 30.0, 1e-3
    problem = over_a_spike(
        lambda x: ca.fmax(0, 1 - ca.fabs(x) / width),
        lambda x, y, v: v**2 / 2 + pull * ca.fabs(y - level),
        level,
        level,
    )
    solution = vc.solve(problem)
    # it leaves the level smoothly, with an acceleration of the pull
    away = math.sqrt(2 * (level + 0.2) / pull)
    assert away < TIP
    assert abs(solution.value - 2 * pull**2 * away**3 / 3) <= 1e-9


def test_a_rest_goes_through_no_tent_that_its_own_mesh_does_not_see():
    width = 4.6e-4
    problem = over_a_spike(
        lambda x: ca.fmax(0, 1 - ca.fabs(x) / width),
        lambda x, y, v: friction(x, y, v) + 3 * (y - 0.2) ** 2,
        0.1,
        0.2,
    )
    solution = vc.solve(problem, throw=False)
    assert solution.status.ok
    assert abs(solution.y(TIP) + 0.2) <= 1e-8


def test_what_is_above_a_polygon_is_no_minimum():
    # the curve rests at the height of the tip, is held there, and goes on
    ceiling = vc.Bound(lambda x, y, v: y + DEPTH * ca.fmax(0, 1 - ca.fabs(x - 0.7) / 4e-3), upper=0.5)
    problem = vc.Problem(
        lambda x, y, v: v**2 / 2 + 0.53 * ca.fabs(v) + 4 * (y + 0.1 - 0.45 * x) ** 2,
        vc.Fixed(0, -0.12),
        vc.Free(1),
        [ceiling],
    )
    solution = vc.solve(problem, throw=False)
    after = np.linspace(0.75, 1.0, 6)
    assert not solution.status.ok or np.ptp(solution.y(after)) > 1e-3
