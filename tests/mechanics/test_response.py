"""Linear response and its causality; the mean motion under a fast drive."""

import math

import casadi as ca
import numpy as np
import pytest

from varcalc import mechanics

DAMPING, OWN = 0.15, 1.3


def oscillator(damping=DAMPING):
    system = mechanics.System(
        lambda t, q, v: (v[0] ** 2 - OWN**2 * q[0] ** 2) / 2, ("x",), forces=lambda t, q, v: [-2 * damping * v[0]]
    )
    return mechanics.Response(system.linearised([0.0]))


def test_response_of_an_oscillator():
    response, w = oscillator(), np.linspace(-4, 4, 33)
    known = 1 / (OWN**2 - w**2 - 2j * DAMPING * w)
    np.testing.assert_allclose(response(w)[:, 0, 0], known, rtol=1e-14)
    np.testing.assert_allclose(response.amplitude(w)[:, 0, 0], np.abs(known), rtol=1e-14)
    lag = np.arctan2(2 * DAMPING * w, OWN**2 - w**2)
    np.testing.assert_allclose(response.phase(w)[:, 0, 0], lag, rtol=1e-14, atol=1e-14)
    slower = math.sqrt(OWN**2 - DAMPING**2)
    assert sorted(response.poles.real) == pytest.approx([-slower, slower], rel=1e-14)
    assert response.poles.imag == pytest.approx([-DAMPING] * 2, rel=1e-14)
    t = np.array([-1.0, 0.0, 0.5, 7.0])
    blow = np.where(t > 0, np.exp(-DAMPING * t) * np.sin(slower * t) / slower, 0)
    np.testing.assert_allclose(response.impulse(t)[:, 0, 0], blow, atol=1e-14)


@pytest.mark.parametrize("damping", [0.5, 0.01])
def test_kramers_and_kronig_hold_of_what_is_causal_alone(damping):
    for w in (0.0, 0.8, OWN, 5.0):
        right, wrong = oscillator(damping), oscillator(-damping)
        size = float(np.abs(right(OWN)).max())
        assert abs(right.from_absorption(w) - right(w).real).max() <= 1e-12 * size
        assert abs(wrong.from_absorption(w) + wrong(w).real).max() <= 1e-12 * size  # of the opposite sign
        assert (right.causal, wrong.causal) == (True, False)
    with pytest.raises(ValueError, match="real axis"):
        oscillator(0.0).from_absorption(1.0)


def test_response_of_several_directions_with_gyroscopic_forces():
    turn = 0.4
    system = mechanics.System(
        lambda t, q, v: ca.sumsqr(v) / 2 + turn * (q[0] * v[1] - q[1] * v[0]) - (q[0] ** 2 + 3 * q[1] ** 2) / 2,
        ("x", "y"), forces=lambda t, q, v: [-0.2 * v[0], -0.3 * v[1]],
    )  # fmt: skip
    response, w = mechanics.Response(system.linearised([0, 0])), 0.9
    # x'' - 2 turn y' + 0.2 x' + x = f1, y'' + 2 turn x' + 0.3 y' + 3 y = f2
    known = np.array([[1 - w**2 - 0.2j * w, 2j * w * turn], [-2j * w * turn, 3 - w**2 - 0.3j * w]])
    np.testing.assert_allclose(response(w) @ known, np.eye(2), atol=1e-14)
    np.testing.assert_allclose(response.from_absorption(w), np.real(response(w)), atol=1e-11)


def pendulum(**parameters):
    """A pendulum whose support goes as a cos(wt), up and down or across."""

    def lagrangian(t, q, v, p):
        up, across = p.up * p.w * ca.sin(p.w * t), p.across * p.w * ca.sin(p.w * t)
        x, y = p.l * ca.sin(q[0]), -p.l * ca.cos(q[0])
        return ((ca.jtimes(x, q, v) - across) ** 2 + (ca.jtimes(y, q, v) - up) ** 2) / 2 - 9.81 * (
            y + p.up * ca.cos(p.w * t)
        )

    given = {"up": 0.0, "across": 0.0, "l": 0.7, "w": 200.0} | parameters
    return mechanics.System(lagrangian, ("theta",), parameters=given)


@pytest.mark.parametrize(("up", "across"), [(0.03, 0.0), (0.0, 0.04)])
def test_kapitzas_effective_potential(up, across):
    shaken = pendulum(up=up, across=across)
    slow = mechanics.averaged(shaken, lambda p: 2 * np.pi / p.w)
    length, w = 0.7, 200.0
    # Landau and Lifshitz, "Mechanics", sect. 30, problems 1 and 2, for mass 1
    for angle in (0.3, 1.2, 2.7):
        force = -9.81 * length * math.sin(angle)
        force -= w**2 / 4 * math.sin(2 * angle) * (up**2 - across**2)
        found = slow.system.accelerations(0.0, [angle], [0.4])[0] * length**2
        assert found == pytest.approx(force, rel=1e-12)
        # its swing has the amplitude a sin(angle)/l, or a cos(angle)/l
        size = (up * math.sin(angle) + across * math.cos(angle)) / length
        assert slow.swing([angle])[0] == pytest.approx(abs(size), rel=1e-12)
    rests = slow.system.equilibria([-0.5], [4.0]).places[:, 0]
    side = math.acos(-2 * 9.81 * length / (w**2 * (up**2 - across**2)))
    assert rests == pytest.approx([0, side, math.pi], abs=1e-12)
    assert [slow.system.normal_modes([x]).stable for x in rests] == (
        [True, False, True] if up else [False, True, False]
    )


def test_the_mean_motion_is_left_by_the_square_of_the_period_and_inertia_may_bend():
    # a bead on y = x²/2, shaken across: M = 1 + x²
    def bead(w):
        return mechanics.System(
            lambda t, q, v: ((v[0] ** 2) * (1 + q[0] ** 2)) / 2 - q[0] ** 2 / 2 + 0.8 * w * q[0] * ca.cos(w * t), ("x",)
        )

    misses = []
    for w in (40.0, 80.0, 160.0):
        slow = mechanics.averaged(bead(w), 2 * math.pi / w).system
        # the fast force is f = 0.8 w cos wt, so that <g²>/(2 M) = 0.16/(1 + x²)
        x = 0.4
        known = (-x + 0.32 * x / (1 + x**2) ** 2) / (1 + x**2)
        assert slow.accelerations(0.0, [x], [0.0])[0] == pytest.approx(known, rel=1e-12)
        periods = math.floor(3.0 * w / (2 * math.pi))
        end = periods * 2 * math.pi / w
        # at t = 0 the fast rate vanishes, and its displacement is -0.8/(w M)
        start = x - 0.8 / (w * (1 + x**2))
        fast = bead(w).motion([start], [0.0], (0, end)).q(end)[0]
        mean = slow.motion([x], [0.0], (0, end)).q(end)[0]
        misses.append(abs(fast + 0.8 / (w * (1 + mean**2)) - mean))
    assert np.all(np.log2(np.array(misses[:-1]) / misses[1:]) > 1.5)


def test_what_cannot_be_averaged_is_refused():
    with pytest.raises(ValueError, match="not the same after"):
        mechanics.averaged(pendulum(up=0.03), 0.02)
    with pytest.raises(ValueError, match="given by L"):
        mechanics.averaged(
            mechanics.System(lambda t, q, v: v[0] ** 2, ("x",), forces=lambda t, q, v: [ca.cos(t)]), 2 * math.pi
        )
    with pytest.raises(ValueError, match="inertia"):
        mechanics.averaged(mechanics.System(lambda t, q, v: v[0] ** 2 * (2 + ca.cos(t)), ("x",)), 2 * math.pi)
