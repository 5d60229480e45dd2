"""The initial-value engines against closed forms: the same questions put to each."""

import importlib.util

import casadi as ca
import mpmath
import numpy as np
import pytest

from varcalc import integrators
from varcalc.integrators import Dop853, OnDemand, RunOutcome, Taylor, variational

pytest.importorskip("heyoka", reason="the Taylor engine is heyoka's")

ENGINES = [Taylor(), Taylor(compact=False), Dop853(), OnDemand(steps=3)]
START = np.array([1.2, 0.0])


def pendulum() -> ca.Function:
    s, state, constants = ca.SX.sym("s"), ca.SX.sym("Y", 2), ca.SX.sym("c", 1)
    return ca.Function("pendulum", [s, state, constants], [ca.vertcat(state[1], -constants * ca.sin(state[0]))])


def swing(time: float, amplitude: float = 1.2, gravity: float = 1.0) -> tuple[float, float]:
    """Angle and velocity released from rest at ``amplitude``: sin(angle / 2) = k sn(K - w t) (Lawden, sect. 5.1)."""
    with mpmath.workdps(30):
        k, rate = mpmath.sin(mpmath.mpf(amplitude) / 2), mpmath.sqrt(gravity)
        at = mpmath.ellipk(k**2) - rate * mpmath.mpf(time)
        angle = 2 * mpmath.asin(k * mpmath.ellipfun("sn", at, m=k**2))
        return float(angle), float(-2 * rate * k * mpmath.ellipfun("cn", at, m=k**2))


@pytest.mark.parametrize("engine", ENGINES, ids=lambda e: e.name)
@pytest.mark.parametrize("stop", [7.0, -4.0])
def test_pendulum_against_elliptic_functions(engine, stop):
    times = np.linspace(0.0, stop, 9)
    run = engine.compile(pendulum()).trajectory(times, START, np.array([1.0]), dense=True)
    assert run.completed
    assert run.reached == stop
    exact = np.array([swing(t) for t in times])
    np.testing.assert_allclose(run.states, exact, atol=2e-11)
    between = np.linspace(0.3 * stop, 0.9 * stop, 7)
    np.testing.assert_allclose(run.trajectory(between), [swing(t) for t in between], atol=2e-11)


@pytest.mark.parametrize("engine", ENGINES, ids=lambda e: e.name)
def test_constants_that_do_not_occur_are_passed_over(engine):
    s, state, constants = ca.SX.sym("s"), ca.SX.sym("Y", 1), ca.SX.sym("c", 3)
    growth = ca.Function("growth", [s, state, constants], [constants[1] * state])
    run = engine.compile(growth).trajectory(np.array([0.0, 1.0]), np.array([1.0]), np.array([9.0, 2.0, 9.0]))
    np.testing.assert_allclose(run.states[-1], [np.exp(2.0)], rtol=1e-11)


def test_taylor_reaches_round_off():
    run = Taylor().compile(pendulum()).trajectory(np.array([0.0, 7.0]), START, np.array([1.0]))
    np.testing.assert_allclose(run.states[-1], swing(7.0), atol=2e-15)


@pytest.mark.parametrize("engine", ENGINES, ids=lambda e: e.name)
def test_a_higher_level_tells_the_error_of_a_lower_one(engine):
    flow = engine.compile(pendulum())
    usual, fine = (flow.trajectory(np.array([0.0, 40.0]), START, np.array([1.0]), level=k).states[-1] for k in (0, 1))
    delivered = np.abs(usual - swing(40.0)).max()
    assert np.abs(fine - swing(40.0)).max() <= max(delivered, 2e-14)
    assert np.abs(usual - fine).max() + 1e-14 >= 0.1 * delivered


@pytest.mark.parametrize("engine", ENGINES, ids=lambda e: e.name)
def test_sensitivities_of_a_driven_oscillator(engine):
    s, state, constants = ca.SX.sym("s"), ca.SX.sym("Y", 2), ca.SX.sym("c", 2)
    system = ca.Function(
        "oscillator", [s, state, constants], [ca.vertcat(state[1], constants[1] - constants[0] ** 2 * state[0])]
    )
    augmented = variational(system, [0, 1], [0, 1])
    w, force, t = 1.3, 0.7, 2.1
    y, v = 0.4, -0.2
    run = engine.compile(augmented.system).trajectory(
        np.array([0.0, t]), augmented.start(np.array([y, v])), np.array([w, force])
    )
    reached, by = augmented.split(run.states[-1])
    c, z = np.cos(w * t), np.sin(w * t)
    rest = y - force / w**2  # y(t) = force / w^2 + rest cos wt + v sin(wt) / w
    np.testing.assert_allclose(reached, [force / w**2 + rest * c + v * z / w, -rest * w * z + v * c], atol=1e-12)
    by_w = -2 * force / w**3 + 2 * force / w**3 * c - rest * t * z + v * (t * c / w - z / w**2)
    np.testing.assert_allclose(by[0], [c, z / w, by_w, (1 - c) / w**2], atol=1e-11)
    np.testing.assert_allclose(by[1, :2], [-w * z, c], atol=1e-11)


@pytest.mark.parametrize("engine", ENGINES, ids=lambda e: e.name)
def test_blow_up_is_told_with_its_place(engine):
    s, state, constants = ca.SX.sym("s"), ca.SX.sym("Y"), ca.SX.sym("c", 0)
    flow = engine.compile(ca.Function("square", [s, state, constants], [state**2]))
    run = flow.trajectory(np.array([0.0, 0.5, 3.0]), np.array([1.0]), np.zeros(0))
    assert run.outcome in (RunOutcome.BLOW_UP, RunOutcome.TOO_MANY_STEPS)
    assert run.reached == pytest.approx(1.0, abs=1e-6)
    assert np.isnan(run.states[-1, 0])
    assert run.states[1, 0] == pytest.approx(2.0, rel=1e-11)


@pytest.mark.parametrize("engine", ENGINES, ids=lambda e: e.name)
def test_a_start_outside_the_domain_is_told(engine):
    s, state, constants = ca.SX.sym("s"), ca.SX.sym("Y"), ca.SX.sym("c", 0)
    flow = engine.compile(ca.Function("root", [s, state, constants], [ca.sqrt(state - 2)]))
    run = flow.trajectory(np.array([0.0, 1.0]), np.array([1.0]), np.zeros(0))
    assert run.outcome is RunOutcome.NOT_FINITE
    assert run.reached == 0.0


@pytest.mark.parametrize("engine", ENGINES, ids=lambda e: e.name)
def test_steps_are_bounded(engine):
    few = OnDemand(Dop853(most_steps=3)) if isinstance(engine, OnDemand) else type(engine)(most_steps=3)
    run = few.compile(pendulum()).trajectory(np.array([0.0, 1000.0]), START, np.array([1.0]))
    assert run.outcome is RunOutcome.TOO_MANY_STEPS


def test_on_demand_goes_over_to_taylor_when_that_pays():
    flow = OnDemand(steps=20).compile(pendulum())
    first = flow.trajectory(np.array([0.0, 10.0]), START, np.array([1.0]))
    second = flow.trajectory(np.array([0.0, 10.0]), START, np.array([1.0]))
    assert second.steps != first.steps
    np.testing.assert_allclose(first.states[-1], second.states[-1], atol=1e-10)


def test_engines_are_chosen_by_what_is_installed(monkeypatch):
    assert integrators.available() == (Taylor(), Dop853())
    assert integrators.default() == OnDemand()
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "heyoka" else object())
    assert integrators.default() == Dop853()
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    with pytest.raises(ImportError, match="install scipy"):
        integrators.default()


@pytest.mark.parametrize("engine", [Taylor(), Dop853()], ids=lambda e: e.name)
def test_arguments_that_do_not_fit_are_refused(engine):
    flow = engine.compile(pendulum())
    with pytest.raises(ValueError, match="ascending or all descending"):
        flow.trajectory(np.array([0.0, 1.0, 0.5]), START, np.array([1.0]))
    with pytest.raises(ValueError, match="2 states and 1 constants"):
        flow.trajectory(np.array([0.0, 1.0]), START, np.zeros(0))
    with pytest.raises(ValueError, match="takes"):
        engine.compile(ca.Function("no", [ca.SX.sym("x")], [1]))
