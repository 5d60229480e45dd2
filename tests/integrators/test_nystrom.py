"""Nyström's method of order 12: its coefficients, what it takes for a system of second order, and its solutions."""

import pickle

import casadi as ca
import mpmath
import numpy as np
import pytest

from varcalc.integrators.dop853 import SMALLEST, Dop853
from varcalc.integrators.nystrom import (
    FIRST,
    NODES,
    UNUSED,
    Nystrom,
    NystromStepper,
    _tables,
    _velocities,
    second_order,
)
from varcalc.integrators.protocol import COMPLETED

s = ca.SX.sym("s")
AT, _, PLACES, OUTCOME = _tables()


def system(rates, states, constants=0):
    state, c = ca.SX.sym("Y", states), ca.SX.sym("c", constants)
    return ca.Function("f", [s, state, c], [ca.vertcat(*rates(state, c))])


def pendulum(state, c):
    """Angle and velocity, what goes on with the place alone, and the action without its constant part."""
    return [state[1], -ca.sin(state[0]), ca.cos(state[0]), state[1] ** 2]


def test_coefficients_are_those_of_quadratures():
    """Of every power of s the rates are integrated: once for velocities, twice for places."""
    when = AT.copy()
    when[[UNUSED, FIRST]] = AT[[1, 0]]
    for power in range(11):
        place, velocity, place_error, velocity_error = (row @ when**power for row in OUTCOME)
        assert velocity == pytest.approx(1 / (power + 1), rel=1e-13)
        assert place == pytest.approx(1 / (power + 1) / (power + 2), rel=1e-13)
        if power < 9:
            assert abs(place_error) + abs(velocity_error) < 1e-15
    assert abs(OUTCOME[3] @ when**10) > 1e-7
    for node in NODES:
        for power in range(4):
            there = PLACES[node] @ when**power
            assert there == pytest.approx(AT[node] ** (power + 2) / (power + 1) / (power + 2), abs=2e-14)
        for power in range(10):
            assert _velocities()[node] @ when**power == pytest.approx(AT[node] ** (power + 1) / (power + 1), abs=1e-13)


def test_steps_are_of_order_twelve():
    """θ'' = -sin θ from 0 in one step: θ = 2 arcsin(k sn(t, k)), where k is half the velocity at the start."""
    flow = second_order(system(pendulum, 4), 1)
    errors = []
    for h in (2.4, 0.6):
        stepper = NystromStepper(Nystrom(flow), 1)
        start, time = np.array([[0.0, 1.6, 0.0, 0.0]]), np.zeros(1)
        end, _ = stepper.step(time, np.array([h]), start, stepper.slope(time, start))
        with mpmath.workdps(30):
            k = mpmath.mpf(1.6) / 2
            angle = 2 * mpmath.asin(k * mpmath.ellipfun("sn", h, m=k**2))
            errors.append(float(abs(angle - end[0, 0])))
    assert errors[1] < 1e-12
    assert errors[0] / errors[1] > 4**12


@pytest.mark.parametrize("count", [3, 600])
@pytest.mark.parametrize("order", [(0, 1, 2, 3), (2, 1, 0, 3)])
def test_all_states_are_followed_through_their_steps(count, order):
    """Of the pendulum θ'²/2 - cos θ = E is constant, so that ∫θ'² ds = 2 ∫cos θ ds + 2 E s."""
    back = np.argsort(order)
    rates = system(lambda y, c: [pendulum(ca.vertcat(*(y[int(k)] for k in back)), c)[k] for k in order], 4)
    flow = Dop853(SMALLEST).compile(rates, watching=1)
    assert isinstance(flow.method, Nystrom)
    speeds = np.linspace(0.2, 3.0, count)
    starts = np.stack([0 * speeds, speeds, 0 * speeds, 0 * speeds], axis=1)[:, list(order)]
    landing = flow.ensemble(starts, np.zeros((count, 0)), until=10.0, dense=True)
    assert np.all(landing.outcomes == COMPLETED)
    energy, ends = speeds**2 / 2 - 1, landing.states[:, back]
    np.testing.assert_allclose(ends[:, 1] ** 2 / 2 - np.cos(ends[:, 0]), energy, atol=1e-13)
    np.testing.assert_allclose(ends[:, 3], 2 * ends[:, 2] + 20 * energy, atol=1e-10)  # it only tells of the steps
    times = np.linspace(0.1, 9.9, 173)
    for k in (0, count - 1):
        within = landing.dense[k](times)[:, back]
        np.testing.assert_allclose(within[:, 1] ** 2 / 2 - np.cos(within[:, 0]), energy[k], atol=5e-12)
        np.testing.assert_allclose(within[:, 3], 2 * within[:, 2] + 2 * times * energy[k], atol=1e-10)


def test_what_follows_velocities_must_only_tell_of_the_steps():
    action = system(lambda y, c: [y[1], -y[0], y[1] ** 2], 3)
    assert second_order(action) is None
    assert second_order(action, 1).followed == [2]


def test_a_flow_that_has_been_used_can_be_sent():
    flow = Dop853(SMALLEST).compile(system(lambda y, c: [y[1], -y[0]], 2))
    ends = [f.ensemble(np.eye(2), np.zeros((2, 0)), until=1.0).states for f in (flow, pickle.loads(pickle.dumps(flow)))]
    np.testing.assert_array_equal(*ends)


def test_the_abscissa_may_occur():
    """y'' = cos s, so that y = 1 - cos s from rest."""
    flow = Dop853(SMALLEST).compile(system(lambda y, c: [y[1], ca.cos(s)], 2))
    assert isinstance(flow.method, Nystrom)
    for until in (9.0, -9.0):
        landing = flow.ensemble(np.zeros((2, 2)), np.zeros((2, 0)), until=until)
        np.testing.assert_allclose(landing.states, [[1 - np.cos(until), np.sin(until)]] * 2, atol=1e-13)


@pytest.mark.parametrize(
    ("rates", "states"),
    [
        (lambda y, c: [y[1], -y[1]], 2),  # damped
        (lambda y, c: [y[1], y[2], -y[0]], 3),  # of third order
        (lambda y, c: [y[1], -y[0], y[2] * y[0]], 3),  # what grows by itself
        (lambda y, c: [y[2], y[2], -y[0]], 3),  # one velocity of two places
        (lambda y, c: [2 * y[1], -y[0]], 2),
        (lambda y, c: [y[0]], 1),
        (lambda y, c: [y[1], -y[0], y[0], y[2] + y[1]], 4),  # what follows by what is carried along
    ],
)
def test_other_systems_are_of_no_such_kind(rates, states):
    assert second_order(system(rates, states), 1) is None
