"""Motions: against closed forms, with events, constraints and their reactions; ensembles; the catalogue."""

import math
import pickle

import casadi as ca
import numpy as np
import pytest
from mpmath import ellipfun
from mpmath import ellipk as quarter
from scipy.special import ellipj, ellipk

import varcalc as vc
from varcalc import mechanics
from varcalc.integrators import crossings
from varcalc.integrators.protocol import RunOutcome
from varcalc.mechanics.motion import Checkpoints
from varcalc.study.experiments import experiment_catalogue, load_experiment

PENDULUM = mechanics.System(lambda t, q, v: v[0] ** 2 / 2 + ca.cos(q[0]), ("theta",))
EPS = np.finfo(float).eps


@pytest.mark.parametrize("amplitude", [0.3, 2.0, 3.0])
def test_a_pendulum_follows_jacobis_functions_and_claims_no_less_than_it_is_off(amplitude):
    k = math.sin(amplitude / 2)
    motion = PENDULUM.motion([amplitude], [0.0], (0, 40 * ellipk(k**2)))
    t = np.linspace(*motion.span, 400)
    exact = 2 * np.arcsin(k * ellipj(t + ellipk(k**2), k**2)[0])
    assert np.abs(motion.q(t)[0] - exact).max() <= max(motion.error, 2e-12)
    assert motion.drift["energy"] <= 20 * EPS * math.sqrt(motion.steps)
    assert motion.q(t.reshape(20, 20)).shape == (1, 20, 20)
    assert motion.energy(t) == pytest.approx(-math.cos(amplitude), abs=1e-13)


def test_energy_over_a_thousand_periods():
    motion = PENDULUM.motion([1.0], [0.0], (0, 4000 * ellipk(math.sin(0.5) ** 2)))
    assert motion.drift["energy"] <= 20 * EPS * math.sqrt(motion.steps)


def test_forces_and_explicit_time():
    # x'' + 2 d x' + x = cos(w t) from rest in its steady state
    d, w = 0.1, 1.7
    driven = mechanics.System(
        lambda t, q, v: v[0] ** 2 / 2 - q[0] ** 2 / 2 + q[0] * ca.cos(w * t),
        ("x",),
        forces=lambda t, q, v: [-2 * d * v[0]],
    )
    response = 1 / (1 - w**2 + 2j * d * w)
    motion = driven.motion([response.real], [(1j * w * response).real], (0, 50))
    t = np.linspace(0, 50, 300)
    np.testing.assert_allclose(motion.q(t)[0], (response * np.exp(1j * w * t)).real, rtol=0, atol=1e-12)
    assert motion.drift == {}


def test_events_are_all_found_in_order_and_end_the_motion_where_they_are_to():
    # x = cos t: turning points at k pi, through zero at pi/2 + k pi
    oscillator = mechanics.System(lambda t, q, v: (v[0] ** 2 - q[0] ** 2) / 2, ("x",))
    through = mechanics.Event(lambda t, q, v: q[0], "through")
    rising = mechanics.Event(lambda t, q, v: q[0], "rising", direction=1)
    turns = mechanics.Event(lambda t, q, v: v[0], "turn")
    motion = oscillator.motion([1.0], [0.0], (0, 20), events=[through, turns])
    assert [e.name for e in motion.events] == ["through", "turn"] * 6
    assert [e.t for e in motion.events] == pytest.approx(np.arange(1, 13) * np.pi / 2, abs=1e-13)
    motion = oscillator.motion([1.0], [0.0], (0, 20), events=[rising])
    assert [e.t for e in motion.events] == pytest.approx(np.pi * (np.arange(3) * 2 + 1.5), abs=1e-13)
    stop = mechanics.Event(lambda t, q, v: q[0] + 0.5, "wall", terminal=True)
    motion = oscillator.motion([1.0], [0.0], (0, 20), events=[stop])
    assert motion.span[1] == pytest.approx(2 * np.pi / 3, abs=1e-13)
    late = mechanics.Event(lambda t, q, v: t - 3.0, "three", terminal=True)
    assert oscillator.motion([1.0], [0.0], (0, 20), events=[late]).span[1] == pytest.approx(3.0, abs=1e-14)


def test_a_motion_that_ends_in_a_singularity_says_so():
    falling = mechanics.System(lambda t, q, v: v[0] ** 2 / 2 + 1 / q[0], ("r",))
    motion = falling.motion([1.0], [0.0], (0, 5))
    assert not motion.completed
    # the fall takes pi / (2 sqrt 2)
    assert motion.span[1] == pytest.approx(np.pi / np.sqrt(8), abs=1e-2)


def test_holonomic_constraints_are_kept_and_their_reaction_is_the_tension():
    m, g = 1.3, 9.81
    rod = mechanics.System(
        lambda t, q, v: m * ca.sumsqr(v) / 2 - m * g * q[1], ("x", "y"),
        constraints=[mechanics.Holonomic(lambda t, q: (ca.sumsqr(q) - 1) / 2)],
    )  # fmt: skip
    motion = rod.motion([math.sin(2), -math.cos(2)], [0, 0], (0, 200))
    t = np.linspace(0, 200, 300)
    q, v = motion.q(t), motion.v(t)
    assert np.abs(np.hypot(*q) - 1).max() <= 1e-14
    tension = m * ((v**2).sum(axis=0) - g * q[1])
    np.testing.assert_allclose(motion.reactions(t), -tension * q, rtol=0, atol=1e-10)
    with pytest.raises(ValueError, match=r"constraints\[0\] in its phi"):
        rod.motion([1.1, 0], [0, 0], (0, 1))
    with pytest.raises(ValueError, match=r"constraints\[0\] in its rate"):
        rod.motion([1, 0], [1, 0], (0, 1))


@pytest.mark.parametrize(
    ("conditions", "said"),
    [
        ([lambda t, q: q[0], lambda t, q: q[1], lambda t, q: 2 * q[0]], r"\[0\] and constraints\[2\] say the same"),
        (
            [lambda t, q: q[0], lambda t, q: q[1], lambda t, q: q[0] + q[1]],
            r"\[0\] and .*\[1\] and .*\[2\] say the same",
        ),
        ([lambda t, q: q[0], lambda t, q: q[0] - 1], r"\[0\] and constraints\[1\] contradict"),
        ([lambda t, q: q[0], lambda t, q: q[0] - t], "contradict"),
        ([lambda t, q: q[0], lambda t, q: q[0] - t**2], "contradict"),
        ([lambda t, q: ca.sumsqr(q)], r"\[0\] holds nothing"),
    ],
)
def test_constraints_that_say_the_same_or_contradict_each_other_are_refused_by_name(conditions, said):
    system = mechanics.System(
        lambda t, q, v: ca.sumsqr(v) / 2, ("x", "y"), constraints=[mechanics.Holonomic(phi) for phi in conditions]
    )
    with pytest.raises(ValueError, match=said):
        system.motion([0, 0], [0, 0], (0, 1))


def test_a_disc_that_rolls_upright_turns_in_a_circle():
    # contact (x, y), heading phi, rolling angle psi: x' = r psi' cos phi, y' = r psi' sin phi
    r = 0.5
    disc = mechanics.System(
        lambda t, q, v: (v[0] ** 2 + v[1] ** 2 + 0.25 * r**2 * v[2] ** 2 + 0.5 * r**2 * v[3] ** 2) / 2,
        ("x", "y", "phi", "psi"),
        constraints=[
            mechanics.Pfaffian(lambda t, q: [1, 0, 0, -r * ca.cos(q[2])]),
            mechanics.Pfaffian(lambda t, q: [0, 1, 0, -r * ca.sin(q[2])]),
        ],
    )
    turn, roll = 0.7, 3.0
    motion = disc.motion([0, 0, 0, 0], [r * roll, 0, turn, roll], (0, 30))
    t = np.linspace(0, 30, 200)
    radius = r * roll / turn
    exact = [radius * np.sin(turn * t), radius * (1 - np.cos(turn * t)), turn * t, roll * t]
    np.testing.assert_allclose(motion.q(t), exact, rtol=0, atol=1e-12)
    assert motion.drift["energy"] <= 1e-13


def test_an_ensemble_goes_as_its_motions_do_and_says_which_ended():
    amplitudes = np.linspace(0.1, 3.0, 17)
    times = np.linspace(0, 10, 6)
    many = PENDULUM.ensemble(amplitudes[:, None], np.zeros((17, 1)), times)
    assert many.q.shape == (17, 1, 6)
    assert many.completed.all()
    for k in (0, 9, 16):
        alone = PENDULUM.motion([amplitudes[k]], [0.0], (0, 10))
        np.testing.assert_allclose(many.q[k], alone.q(times), rtol=0, atol=1e-12)
    falling = mechanics.System(lambda t, q, v: v[0] ** 2 / 2 + 1 / q[0], ("r",))
    some = falling.ensemble([[1.0], [1.0]], [[0.0], [2.0]], [0.0, 0.5, 3.0])
    assert some.completed.tolist() == [False, True]
    assert some.outcomes[0] is not RunOutcome.COMPLETED
    assert np.isfinite(some.q[0, 0, 1])
    assert np.isnan(some.q[0, 0, 2])


@pytest.mark.parametrize("name", list(experiment_catalogue()))
def test_every_experiment_is_right_to_twelve_digits(name):
    moved = load_experiment(name).run()
    assert moved.completed
    assert moved.largest <= 1e-12
    exact = moved.experiment.exact if isinstance(moved, mechanics.Moved) else None
    if exact is not None:
        t = np.linspace(*moved.motion.span, 301)
        assert np.abs(moved.motion.q(t) - exact(t)).max() <= moved.motion.error


def test_a_long_motion_keeps_its_energy_and_is_known_everywhere():
    k = math.sin(0.5)
    period = 4 * ellipk(k**2)
    motion = PENDULUM.motion([1.0], [0.0], (0, 5000 * period))
    assert motion.steps > 20_000
    assert motion.drift["energy"] <= 20 * EPS * math.sqrt(motion.steps)
    t = np.array([0.3, 1234.5, 2000 * period + 0.1, 5000 * period])
    exact = 2 * np.arcsin(k * ellipj(t % period + ellipk(k**2), k**2)[0])
    np.testing.assert_allclose(motion.q(t)[0], exact, rtol=0, atol=1e-9)


def test_arguments_are_named():
    with pytest.raises(TypeError, match=r"events\[0\] must be"):
        PENDULUM.motion([1.0], [0.0], (0, 1), events=[lambda t, q, v: q[0]])


def test_no_inertia_at_rest_and_a_ring_of_equilibria():
    # p = v³ and H = 3 v⁴/4
    assert mechanics.System(lambda t, q, v: v[0] ** 4 / 4, ("x",)).hamiltonian()(0, [0.0], [8.0]) == pytest.approx(12)
    ring = mechanics.System(lambda t, q, v: ca.sumsqr(v) / 2 - (ca.sumsqr(q) - 1) ** 2, ("x", "y"))
    assert ring.equilibria([-2, -2], [2, 2.1]).unresolved > 0


def test_a_long_motion_tells_how_far_it_has_come_and_keeps_it_when_it_is_stopped():
    told: list[tuple[int, int]] = []

    def stopping(done, total, what):
        told.append((done, total))
        if done == total // 2:
            raise KeyboardInterrupt

    with pytest.raises(vc.Interrupted) as stopped:
        PENDULUM.motion([1.0], [0.0], (0, 6000.0), progress=stopping)
    known = stopped.value.known
    assert known.span == (0.0, 3000.0)
    assert told == [(k, told[0][1]) for k in range(len(told))]
    k = math.sin(0.5) ** 2  # sin(theta / 2) = sin(1/2) sn(K - t)
    exact = 2 * math.asin(math.sin(0.5) * float(ellipfun("sn", quarter(k) - 3000, m=k)))
    assert abs(known.q(3000.0)[0] - exact) <= known.error < 1e-9


def test_a_motion_goes_to_another_process():
    """As a kink ends one run and begins the next: x'' = -sign x from x = 1 has the period 4 sqrt 2."""
    swing = mechanics.System(lambda t, q, v: v[0] ** 2 / 2 - ca.fabs(q[0]), ("x",))
    sent = pickle.loads(pickle.dumps(swing.motion([1.0], [0.0], (0, 4 * math.sqrt(2)))))
    assert abs(sent.q(4 * math.sqrt(2))[0] - 1) < 1e-13
    assert abs(sent.q(2 * math.sqrt(2))[0] + 1) < 1e-13
    assert abs(sent.q(1.0)[0] - 0.5) < 1e-13


def test_a_motion_cannot_begin_where_the_lagrangian_is_no_number():
    """The force 1/q of ln q is one on both sides of 0."""
    system = mechanics.System(lambda t, q, v: v**2 / 2 + ca.log(q), ["q"])
    with pytest.raises(ValueError, match=r"L is not a number at the start, where q0 = \[-0.5\] and v0 = \[1.0\]"):
        system.motion([-0.5], [1.0], (0.0, 1.0))
    assert system.motion([0.5], [1.0], (0.0, 1.0)).completed


def test_a_motion_over_jumps_without_number_is_told_of_and_ends(monkeypatch):
    """A body at 1e6 meets 2e6 stairs of no height: a part of the pieces that are allowed shows how it ends."""
    monkeypatch.setattr(crossings, "MOST_RUN_PIECES", 300)
    told = []
    system = mechanics.System(lambda t, q, v: v**2 / 2 + ca.fmin(-q, ca.floor(q)), ["q"])
    motion = system.motion([1.0], [1e6], (0.0, 2.0), progress=lambda done, total, what: told.append(done))
    assert not motion.completed
    assert motion.outcome is RunOutcome.TOO_MANY_STEPS
    assert told
    # parts lead no farther than the whole, which is known between: nothing is carried again when it is read
    assert not isinstance(motion.states, Checkpoints)
    # q = 1 + 1e6 t - t²/2 under the force -1
    t = np.linspace(0, motion.span[1], 5)
    np.testing.assert_allclose(motion.q(t)[0], 1 + 1e6 * t - t**2 / 2, rtol=1e-12)


def test_what_is_no_number_is_known_to_nothing():
    """The energy of a pace whose square is beyond all floats is lost, and with it what is known of the motion."""
    motion = mechanics.System(lambda t, q, v: v[0] ** 2 / 2, ("x",)).motion([0.0], [1e200], (0, 1))
    assert motion.drift["energy"] == math.inf
    assert "nan" not in str(motion)
