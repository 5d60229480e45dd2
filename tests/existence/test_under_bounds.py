"""Kinks under bounds that are narrow somewhere: held on the tip of a spike, however short the way along it is."""

import math

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

import varcalc as vc
from varcalc.existence.under_bounds import UnderBounds

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


def stepped(price, level):
    """Motion that costs more at or below a level."""
    return lambda x, y, v: v**2 / 2 + price * ca.if_else(y > level, 0, 1)


def through_a_jump(rise, fall, span, price):
    """The least of both stretches of a straight way that goes through a jump, by where it does."""
    share = np.linspace(0, 1, 2_000_001)[1:-1] * span
    return float((rise**2 / (2 * share) + fall**2 / (2 * (span - share)) + price * (span - share)).min())


@pytest.mark.parametrize("width", [3e-2, 1e-3])
def test_a_jump_is_gone_through_for_the_tip_of_a_spike_and_come_back_through(width):
    """Beyond the jump it is cheaper, and the only way past the spike is before it."""
    price, level, ends = 2.0, 0.1, 0.3
    problem = over_a_spike(lambda x: ca.fmax(0, 1 - ca.fabs(x - 0.2) / width), stepped(price, level), ends, ends)
    solution = vc.solve(problem, throw=False)
    down, tip = ends - level, TIP + 0.2
    value = sum(through_a_jump(down, level + 0.2, span, price) for span in (tip, 1 - tip))
    assert solution.status.ok
    assert not solution.local
    assert abs(solution.value - value) <= 1e-9
    assert abs(solution.y(tip) + 0.2) <= 1e-9


def test_a_curve_rests_on_the_cheaper_side_of_a_jump_before_it_falls_to_a_tip():
    price, level, width = 2.0, 0.1, 2e-2
    problem = over_a_spike(lambda x: ca.fmax(0, 1 - ca.fabs(x - 0.4) / width), stepped(price, level), -0.1, -0.2)
    solution = vc.solve(problem, throw=False)
    tip, pace = TIP + 0.4, math.sqrt(2 * price)  # at rest beside the jump, what it loses there is its energy
    # up to the level at the pace, along it, and down to the tip: each moving stretch costs pace times height
    along = pace * (level + 0.1 + level + 0.2)
    assert (level + 0.1 + level + 0.2) / pace < tip
    after = price * (1 - tip)
    assert solution.status.ok
    assert abs(solution.value - along - after) <= 1e-9


def test_what_is_above_a_polygon_of_another_valley_is_said_to_be_local():
    problem = over_a_spike(lambda x: ca.fmax(0, 1 - ca.fabs(x) / 1e-3), stepped(2.0, 0.1), 0.3, 0.3)
    solution = vc.solve(problem)
    lower = UnderBounds(None, solution.value - 0.1, several=True).judged(solution)
    assert lower.local
    assert lower.lower == solution.value - 0.1
    assert "a polygon has the value" in lower.message
    assert UnderBounds(None, solution.value + 1e-4, several=True).judged(solution) is solution
