"""Many runs of DOP853 at once, few enough for CasADi and so many that NumPy evaluates them, against closed forms."""

import casadi as ca
import numpy as np
import pytest

from varcalc.integrators.dop853 import Dop853
from varcalc.integrators.protocol import STOPPED
from varcalc.integrators.stops import STEP_PLACES, Interpolant, Stops
from varcalc.symbolic.evaluation import POINTS_FOR_NUMPY

s, state, frequency = ca.SX.sym("s"), ca.SX.sym("Y", 2), ca.SX.sym("c", 1)
OSCILLATOR = ca.Function("f", [s, state, frequency], [ca.vertcat(state[1], -(frequency**2) * state[0])])
HEIGHT = ca.Function("g", [s, state, frequency], [state[0]])


@pytest.mark.parametrize("count", [5, 4 * POINTS_FOR_NUMPY])
def test_oscillators_come_to_where_cosines_are(count):
    omega = np.linspace(0.5, 2.0, count)
    starts = np.tile([1.0, 0.0], (count, 1))
    landed = Dop853(1e-14).compile(OSCILLATOR).ensemble(starts, omega[:, None], until=7.0)
    exact = np.stack([np.cos(7 * omega), -omega * np.sin(7 * omega)], axis=1)
    assert np.abs(landed.states - exact).max() < 1e-12


@pytest.mark.parametrize("count", [5, 4 * POINTS_FOR_NUMPY])
def test_oscillators_stop_where_cosines_vanish(count):
    omega = np.linspace(0.5, 2.0, count)
    starts = np.tile([1.0, 0.0], (count, 1))
    landed = Dop853(1e-14).compile(OSCILLATOR, HEIGHT).ensemble(starts, omega[:, None], until=20.0)
    assert np.all(landed.outcomes == STOPPED)
    assert np.abs(landed.reached - np.pi / 2 / omega).max() < 1e-12


def test_all_places_of_a_step_at_once_are_those_one_by_one():
    rng = np.random.default_rng(3)
    step = Interpolant(np.zeros(4), np.ones(4), rng.normal(size=(4, 2)), rng.normal(size=(7, 4, 2)))
    parts = np.arange(1, STEP_PLACES + 1) / STEP_PLACES
    assert np.allclose(step.at(parts), [step(np.full(4, part)) for part in parts], rtol=0, atol=1e-14)


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
