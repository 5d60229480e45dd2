"""Many runs by Dormand and Prince's methods at once, few enough for CasADi and so many that NumPy evaluates them."""

import casadi as ca
import numpy as np
import pytest

from varcalc.integrators.dop853 import Dop853
from varcalc.integrators.nystrom import Nystrom
from varcalc.integrators.protocol import NONE, STOPPED
from varcalc.integrators.stops import Interpolant, Stops
from varcalc.integrators.written import FEW_RUNS
from varcalc.symbolic.evaluation import POINTS_FOR_NUMPY

s, state, frequency = ca.SX.sym("s"), ca.SX.sym("Y", 2), ca.SX.sym("c", 1)
OSCILLATOR = ca.Function("f", [s, state, frequency], [ca.vertcat(state[1], -(frequency**2) * state[0])])
TURNING = ca.Function("f", [s, state, frequency], [frequency * ca.vertcat(state[1], -state[0])])
"""The same of v / ω in place of v, of which no rate is the velocity itself: for the method of order 8."""
BOTH = [OSCILLATOR, TURNING]
HEIGHT = ca.Function("g", [s, state, frequency], [state[0]])


@pytest.mark.parametrize("system", BOTH, ids=["order 12", "order 8"])
@pytest.mark.parametrize("count", [5, 4 * POINTS_FOR_NUMPY])
def test_oscillators_come_to_where_cosines_are(count, system):
    omega = np.linspace(0.5, 2.0, count)
    starts = np.tile([1.0, 0.0], (count, 1))
    flow = Dop853(1e-14).compile(system)
    assert isinstance(flow.method, Nystrom) == (system is OSCILLATOR)
    landed = flow.ensemble(starts, omega[:, None], until=7.0)
    speed = omega if system is OSCILLATOR else 1
    exact = np.stack([np.cos(7 * omega), -speed * np.sin(7 * omega)], axis=1)
    assert np.abs(landed.states - exact).max() < 1e-12


@pytest.mark.parametrize("system", BOTH, ids=["order 12", "order 8"])
@pytest.mark.parametrize("count", [5, 4 * POINTS_FOR_NUMPY])
def test_oscillators_stop_where_cosines_vanish(count, system):
    omega = np.linspace(0.5, 2.0, count)
    starts = np.tile([1.0, 0.0], (count, 1))
    landed = Dop853(1e-14).compile(system, HEIGHT).ensemble(starts, omega[:, None], until=20.0)
    assert np.all(landed.outcomes == STOPPED)
    assert np.abs(landed.reached - np.pi / 2 / omega).max() < 1e-12


def test_all_places_of_a_step_at_once_are_those_one_by_one():
    rng = np.random.default_rng(3)
    step = Interpolant(np.zeros(4), np.ones(4), rng.normal(size=(4, 3)), rng.normal(size=(7, 4, 3)))
    parts = np.arange(13) / 12
    one_by_one = np.array([step(np.full(4, part)) for part in parts])
    assert np.allclose(step.at(parts, (0, 2)), one_by_one[:, :, [0, 2]], rtol=0, atol=1e-14)


@pytest.mark.parametrize("system", BOTH, ids=["order 12", "order 8"])
def test_a_stop_that_is_crossed_and_crossed_again_within_a_step_is_met(system):
    """x = sin ωs comes over 1 - depth for no longer than 2 arccos(1 - depth)."""
    depth = np.repeat(np.geomspace(1e-10, 0.5, 60), 5)
    omega = np.tile(np.linspace(0.7, 1.9, 5), 60)
    c = ca.SX.sym("c", 2)
    wall = ca.Function("g", [s, state, c], [1 - c[1] - state[0]])
    turning = ca.Function("f", [s, state, c], [system(s, state, c[0])])
    starts = np.stack([0 * omega, omega if system is OSCILLATOR else 1 + 0 * omega], axis=1)
    flow = Dop853(1e-14).compile(turning, wall)
    landed = flow.ensemble(starts, np.stack([omega, depth], axis=1), until=2.5 / omega)
    assert np.all(landed.outcomes == STOPPED)
    assert np.abs(landed.reached - np.arcsin(1 - depth) / omega)[depth > 1e-6].max() < 1e-9
    # of what is touched the place is no better known than the root of round-off
    assert np.abs(landed.reached - np.arcsin(1 - depth) / omega).max() < 1e-5
    over = flow.ensemble(starts, np.stack([omega, -depth], axis=1), until=2.5 / omega)
    assert np.all(over.stopped_by == NONE)


@pytest.mark.parametrize("fine", [0.0, 40.0])
def test_no_stop_is_met_in_a_step_that_is_not_looked_at(fine):
    """Steps along circles that reach the wall x = c + 0.1 sin(fine y), the waves of which are shorter than steps."""
    rng = np.random.default_rng(5)
    wall = ca.Function("g", [s, state, frequency], [state[0] - frequency - 0.1 * ca.sin(fine * state[1])])
    circle = ca.Function("f", [s, state, frequency], [ca.vertcat(state[1], -state[0])])
    start, lengths = rng.uniform(0, 2 * np.pi, 4000), rng.uniform(0.01, 0.7, 4000)
    angles = start + np.linspace(0, 1, 400)[:, None] * lengths
    x, y, c = np.cos(angles), -np.sin(angles), rng.uniform(-1.2, 1.2, 4000)
    levels = x - c - 0.1 * np.sin(fine * y)
    ends = [np.stack([x[k], y[k]], axis=1) for k in (0, -1)]
    rates = [np.stack([y[k], -x[k]], axis=1) for k in (0, -1)]
    looked = Stops(circle, wall).may_stop(
        (ends[0], ends[1]), (rates[0], rates[1]), lengths, c[:, None], np.sign(levels[:1].T)
    )
    met = np.any(levels * np.sign(levels[0]) < 0, axis=0)
    assert met.sum() > 300
    assert np.all(looked[met])
    assert not looked.all()


def test_a_stop_is_looked_for_no_longer_than_round_off_lets_it_be(monkeypatch):
    """Newton's iteration on the interpolant went on to its last round where one run among many had not settled."""
    asked = []
    values = Stops.__call__
    monkeypatch.setattr(Stops, "__call__", lambda self, *given: asked.append(1) or values(self, *given))
    omega = np.linspace(0.5, 2.0, 500)
    wall = ca.Function("g", [s, state, frequency], [(state[0] + 30) ** 2 - 900])
    landed = Dop853(1e-14).compile(OSCILLATOR, wall).ensemble(np.tile([1.0, 0.0], (500, 1)), omega[:, None], until=20.0)
    assert np.abs(landed.reached - np.pi / 2 / omega).max() < 1e-11
    assert len(asked) < 3 * landed.rounds


@pytest.mark.parametrize("system", BOTH, ids=["order 12", "order 8"])
def test_few_runs_take_the_steps_of_many(system):
    """One function a step, and stages of all runs at once, are the same method: as many steps, the same states."""
    omega = np.linspace(0.5, 2.0, 2 * FEW_RUNS)
    starts = np.tile([1.0, 0.0], (len(omega), 1))
    for stops in (None, HEIGHT):
        flow = Dop853(1e-12).compile(system, stops)
        many = flow.ensemble(starts, omega[:, None], until=7.0, dense=stops is None)
        few = flow.ensemble(starts[:FEW_RUNS], omega[:FEW_RUNS, None], until=7.0, dense=stops is None)
        np.testing.assert_array_equal(few.steps, many.steps[:FEW_RUNS])
        np.testing.assert_allclose(few.states, many.states[:FEW_RUNS], rtol=0, atol=1e-13)
        np.testing.assert_allclose(few.reached, many.reached[:FEW_RUNS], rtol=0, atol=1e-13)
        times = np.linspace(0.0, 7.0, 101)
        for row in range(FEW_RUNS) if stops is None else ():
            np.testing.assert_allclose(few.dense[row](times), many.dense[row](times), rtol=0, atol=1e-12)


def test_what_follows_a_velocity_is_the_same_for_few_runs_and_many():
    """A watched state whose rate is v²: of cos t, (t - sin t cos t)/2."""
    longer = ca.SX.sym("Y", 3)
    system = ca.Function("f", [s, longer, frequency], [ca.vertcat(longer[1], -longer[0], longer[1] ** 2)])
    flow = Dop853(1e-12).compile(system, watching=1)
    assert isinstance(flow.method, Nystrom)
    starts = np.tile([1.0, 0.0, 0.0], (2 * FEW_RUNS, 1))
    for count in (1, 2 * FEW_RUNS):
        landed = flow.ensemble(starts[:count], np.ones((count, 1)), until=5.0, dense=True)
        times = np.linspace(0, 5, 51)
        exact = np.stack([np.cos(times), -np.sin(times), (times - np.sin(times) * np.cos(times)) / 2], axis=1)
        np.testing.assert_allclose(landed.dense[0](times), exact, rtol=0, atol=1e-9)
        np.testing.assert_allclose(landed.states[0], exact[-1], rtol=0, atol=1e-9)
