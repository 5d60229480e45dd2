"""Motions of rigid bodies: against Jacobi's functions, cones, other coordinates, and what they keep."""

import math

import casadi as ca
import mpmath as mp
import numpy as np
import pytest

from varcalc.integrators.protocol import RunOutcome
from varcalc.mechanics import EulerAngles, Inertia, RigidBody, TopKind, rotation_matrix

UPRIGHT = (1.0, 0.0, 0.0, 0.0)


def jacobi(moments, first, third):
    """ω(t) of a free body that begins at (first, 0, third), for ascending moments, and its period.

    Landau and Lifshitz, "Mechanics", sect. 37, with the time from where ω2 is zero.
    """
    with mp.workdps(30):
        a, b, c = map(mp.mpf, moments)
        x, z = mp.mpf(first), mp.mpf(third)
        low, high = a * (b - a) * x**2, c * (c - b) * z**2
        if high > low:
            n = abs(z) * mp.sqrt((c - b) * (c - a) / (a * b))
            m, size = (b - a) * a * x**2 / (c * (c - b) * z**2), abs(x) * mp.sqrt(a * (c - a) / (b * (c - b)))
            names = "cn", "dn"
        else:
            n = abs(x) * mp.sqrt((b - a) * (c - a) / (b * c))
            m, size = (c - b) * c * z**2 / (a * (b - a) * x**2), abs(z) * mp.sqrt(c * (c - a) / (b * (b - a)))
            names = "dn", "cn"
        sense = mp.sign(x * z)  # (c - a) ω3 ω1 = b ω2' is positive at the start for x z > 0

        def omega(t):
            u = n * mp.mpf(t)
            values = (
                x * mp.ellipfun(names[0], u, m=m), sense * size * mp.ellipfun("sn", u, m=m),
                z * mp.ellipfun(names[1], u, m=m),
            )  # fmt: skip
            return [float(value) for value in values]

        return omega, float(4 * mp.ellipk(m) / n)


@pytest.mark.parametrize(
    ("moments", "first", "third"),
    [((1.0, 2.0, 3.0), 0.3, 1.0), ((1.0, 1.5, 2.2), 0.9, 1.3), ((0.2, 0.9, 1.0), 5.0, -2.0)],
)
def test_a_free_asymmetric_body_follows_jacobis_functions_over_ten_periods(moments, first, third):
    omega, period = jacobi(moments, first, third)
    body = RigidBody(moments)
    motion = body.motion(UPRIGHT, [first, 0.0, third], (0, 10 * period))
    t = np.linspace(0, 10 * period, 81)
    exact = np.array([omega(time) for time in t]).T
    off = np.abs(motion.angular_velocity(t) - exact).max()
    assert off <= 1e-13 * np.abs(exact).max()
    assert off <= motion.error * np.abs(exact).max()
    assert body.polhode([first, 0.0, third]).period == pytest.approx(period, rel=1e-14)


def test_momentum_and_energy_are_kept_and_the_quaternion_stays_one():
    _, period = jacobi((1.0, 2.0, 3.0), 0.3, 1.0)
    motion = RigidBody([1.0, 2.0, 3.0]).motion(UPRIGHT, [0.3, 0.0, 1.0], (0, 400 * period))
    assert motion.completed
    assert {motion.drift[name] for name in ("L_x", "L_y", "L_z")} == {0.0}
    assert motion.drift["energy"] <= 1e-13 * motion.energy(0.0)
    raw = motion.states(np.linspace(0, 400 * period, 40))[:, :4]
    np.testing.assert_allclose(np.linalg.norm(raw, axis=1), 1, rtol=1e-15)
    turned = motion.rotation(777.7) @ (np.array([1.0, 2.0, 3.0]) * motion.angular_velocity(777.7))
    np.testing.assert_allclose(turned, [0.3, 0.0, 3.0], atol=1e-14)


def about(axis, angle):
    """The rotation matrices (3, 3, m) about a unit axis, by Rodrigues's formula."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])[:, :, None]
    outer, one = np.outer(axis, axis)[:, :, None], np.eye(3)[:, :, None]
    return outer + np.cos(angle) * (one - outer) + np.sin(angle) * cross


@pytest.mark.parametrize("third", [2.0, 0.6])
def test_a_free_symmetric_body_goes_by_its_cones(third):
    body = RigidBody([1.0, 1.0, third])
    omega = np.array([0.7, 0.0, 1.9])
    start = EulerAngles(0.4, 1.1, -0.8)
    motion = body.motion(start, omega, (0, 50))
    t = np.linspace(0, 50, 101)
    cones = body.cones(omega)
    assert cones.body_frequency == pytest.approx(1.9 * (third - 1), rel=1e-15)
    angle = cones.body_frequency * t
    exact = [0.7 * np.cos(angle), 0.7 * np.sin(angle), np.full(101, 1.9)]
    np.testing.assert_allclose(motion.angular_velocity(t), exact, atol=1e-13)
    momentum = start.rotation @ ([1, 1, third] * omega)
    size = np.linalg.norm(momentum)
    assert cones.space_frequency == pytest.approx(size, rel=1e-15)
    space, own = about(momentum / size, size * t), about((0, 0, 1), -angle)
    rotation = np.einsum("ijt,jk,klt->ilt", space, start.rotation, own)
    off = np.abs(motion.rotation(t) - rotation).max()
    assert off <= min(1e-13, motion.error)
    assert math.tan(cones.momentum_angle) == pytest.approx(math.tan(cones.body_angle) / third, rel=1e-14)
    inclined = np.arccos(motion.rotation(t)[:, 2].T @ momentum / size)
    np.testing.assert_allclose(inclined, cones.momentum_angle, atol=1e-13)


def test_the_middle_axis_is_left_along_the_separatrix():
    # L² = 2 E I2: ω2 = Ω tanh(n t), ω1 and ω3 by 1/cosh (Landau and Lifshitz, sect. 37)
    moments, big = np.array([1.0, 2.0, 3.0]), 1.7
    a, b, c = moments
    n = big * math.sqrt((c - b) * (b - a) / (a * c))
    size = [big * math.sqrt(b * (c - b) / (a * (c - a))), 0, big * math.sqrt(b * (b - a) / (c * (c - a)))]
    body = RigidBody(moments)
    found = body.polhode(size)
    assert found.kind.name == "SEPARATRIX"
    assert found.period == math.inf
    motion = body.motion(UPRIGHT, size, (0, 10 / n))
    t = np.linspace(0, 10 / n, 60)
    exact = np.outer(size, 1 / np.cosh(n * t)) + np.outer([0, big, 0], np.tanh(n * t))
    off = np.abs(motion.angular_velocity(t) - exact).max()
    assert off <= 1e-15 * math.exp(10)  # what round-off grows to beside the middle axis
    middle = body.steady_rotations[1]
    assert not middle.stable
    assert middle.rate * big == pytest.approx(n, rel=1e-14)
    assert [steady.stable for steady in body.steady_rotations] == [True, False, True]


@pytest.mark.parametrize("third", [1e-8, 0.3, 1 - 1e-9, 1 + 1e-9, 40.0])
def test_the_period_of_a_polhode_however_near_the_separatrix(third):
    first = math.sqrt(3.0)  # about which axis: I1 (I2 - I1) ω1² against I3 (I3 - I2) ω3²
    with mp.workdps(40):
        x, z = mp.mpf(first), mp.mpf(third)
        low, high = x**2, 3 * z**2
        complement = abs(high - low) / max(high, low)
        exact = 4 * mp.ellipk(1 - complement) / (z if high > low else x / mp.sqrt(3))
    found = RigidBody([1.0, 2.0, 3.0]).polhode([first, 0, third]).period
    assert found == pytest.approx(float(exact), rel=1e-15 / min(abs(third - 1), 0.5))


def test_polhodes_are_told_apart():
    body = RigidBody([1.0, 2.0, 3.0])
    assert body.polhode([0, 0, 2.0]).kind.name == "STEADY"
    assert body.polhode([0.1, 0, 2.0]).kind.name == "ABOUT_GREATEST"
    assert body.polhode([2.0, 0, 0.1]).kind.name == "ABOUT_LEAST"
    assert RigidBody([1.0, 1.0, 1.0]).polhode([1.0, 2.0, 3.0]).kind.name == "STEADY"
    symmetric = RigidBody([1.0, 1.0, 2.0])
    assert symmetric.polhode([1.0, 0, 3.0]).period == pytest.approx(2 * math.pi / 3.0, rel=1e-14)
    assert [s.stable for s in symmetric.steady_rotations] == [False, False, True]


def test_axes_need_not_be_principal_ones():
    moments, omega = np.array([1.0, 2.0, 3.0]), np.array([0.5, 0.2, 0.9])
    turn = EulerAngles(0.3, 0.8, -1.2).rotation
    plain = RigidBody(moments).motion(UPRIGHT, omega, (0, 20))
    turned = RigidBody(turn @ np.diag(moments) @ turn.T).motion(UPRIGHT, turn @ omega, (0, 20))
    np.testing.assert_allclose(turned.angular_velocity(17.3), turn @ plain.angular_velocity(17.3), atol=1e-13)


def test_friction_and_parameters():
    ball = RigidBody(
        Inertia.sphere(2.0, 0.5), torque=lambda t, R, omega, p: -p.c * omega, parameters={"c": 0.03}, name="ball"
    )
    assert ball.kept == ()
    assert ball.principal.kind is TopKind.SPHERICAL
    motion = ball.motion(UPRIGHT, [1.0, -2.0, 0.5], (1.0, 11.0))
    t = np.linspace(1, 11, 21).reshape(3, 7)
    exact = np.multiply.outer([1.0, -2.0, 0.5], np.exp(-0.03 * (t - 1) / 0.2))
    np.testing.assert_allclose(motion.angular_velocity(t), exact, atol=1e-14)
    assert motion.drift == {}
    assert motion.energy(t).shape == (3, 7)


def test_what_is_kept_is_found():
    def field(t, R, p):
        return p.B * R[0, 2]  # a magnet along e3 in a field along x

    assert RigidBody([1, 1, 2], potential=field, parameters={"B": 0.3}).kept == ("energy", "L_x", "L_3")
    assert RigidBody([1, 1.5, 2], potential=field, parameters={"B": 0.3}).kept == ("energy", "L_x")
    assert RigidBody([1, 1, 1]).kept == ("energy", "L_x", "L_y", "L_z", "L_1", "L_2", "L_3")
    driven = RigidBody([1, 1, 2], potential=lambda t, R: R[2, 2] * ca.cos(t))
    assert driven.kept == ("L_z", "L_3")
    gyroscopic = RigidBody([1, 2, 3], torque=lambda t, R, omega: ca.cross(omega, ca.DM([0.0, 0.0, 1.0])))
    assert gyroscopic.kept == ("energy",)


def test_a_compound_pendulum_of_any_shape():
    # about a level axis: I θ'' = -m g d sin θ, small and large, by Jacobi's sn
    box = Inertia.box(2.0, 0.1, 0.3, 0.7)
    body = RigidBody.pivoted(box, (0, 0, 0.3))
    moment, pull = box.about((0, 0, 0.3))[0, 0], 2.0 * 9.81 * 0.3
    motion = body.motion(EulerAngles(0.0, 2.0, 0.0), [0, 0, 0], (0, 10.0))  # hangs at θ = 0
    k, w = math.sin(1.0), math.sqrt(pull / moment)
    t = np.linspace(0, 10, 50)
    quarter = mp.ellipk(k**2)
    exact = [float(abs(2 * mp.asin(k * mp.ellipfun("sn", w * time + quarter, m=k**2)))) for time in t]
    np.testing.assert_allclose(motion.euler_angles(t).theta, exact, atol=2e-12)
    assert motion.error >= np.abs(motion.euler_angles(t).theta - exact).max()


def test_units_do_not_matter():
    moments, omega, start = np.array([1.0, 2.0, 3.0]), np.array([0.3, 0.1, 1.0]), EulerAngles(0, 1, 0)

    def leaning(inertia, weight):
        return RigidBody(inertia, potential=lambda t, R, p: p.weight * R[2, 2], parameters={"weight": weight})

    plain = leaning(moments, 1.0).motion(start, omega, (0, 20)).orientation(20.0)
    for scale in (1e-9, 1e9):
        scaled = leaning(moments * scale, scale).motion(start, omega, (0, 20))
        np.testing.assert_allclose(scaled.orientation(20.0), plain, atol=1e-13)
        timed = leaning(moments, scale**2).motion(start, omega * scale, (0, 20 / scale))
        np.testing.assert_allclose(timed.orientation(20.0 / scale), plain, atol=1e-13)


def test_a_motion_that_cannot_go_on_says_so():
    blowing = RigidBody([1.0, 1.0, 1.0], torque=lambda t, R, omega: omega * ca.sumsqr(omega))
    motion = blowing.motion(UPRIGHT, [1.0, 0, 0], (0, 3.0))  # ω² = 1/(1 - 2 t)
    assert not motion.completed
    assert motion.outcome is not RunOutcome.COMPLETED
    assert motion.span[1] == pytest.approx(0.5, abs=1e-2)
    with pytest.raises(ValueError, match="t must lie between"):
        motion.energy(1.0)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: RigidBody(Inertia.rod(1.0, 1.0)), r"no moment about \(0, 0, 1\)"),
        (lambda: RigidBody([1.0, 1.0, 3.0]), "of no body"),
        (
            lambda: RigidBody([1, 1, 1], torque=lambda t, R, omega: [1, 2]),
            "3 numbers, one along each of the body's axes",
        ),
        (lambda: RigidBody([1, 1, 1], potential=lambda t, R: R), "scalar"),
        (lambda: RigidBody([1, 1, 1]).motion((0, 0, 0, 0), (0, 0, 1), (0, 1)), "finite and not zero"),
        (lambda: RigidBody([1, 1, 1]).motion((1, 0, 0), (0, 0, 1), (0, 1)), "four numbers"),
        (lambda: RigidBody([1, 1, 1]).motion(UPRIGHT, (0, 1), (0, 1)), "three finite numbers"),
        (lambda: RigidBody([1, 1, 1]).motion(UPRIGHT, (0, 0, 1), (1, 0)), "ascending"),
        (lambda: RigidBody([1, 1, 1]).motion(UPRIGHT, (0, 0, 1), (1, 2, 3)), "two ascending times"),
        (lambda: RigidBody([1, 1, 1], parameters={"c": math.inf}), r"parameters\['c'\] must be finite"),
        (lambda: RigidBody([1, 2, 3]).cones((0, 0, 1)), "symmetric body"),
    ],
)
def test_what_is_wrong_is_named(make, said):
    with pytest.raises(ValueError, match=said):
        make()


def test_a_torque_that_jumps_turns_a_body_to_and_fro():
    """About its x axis θ'' = -sign(sin θ): parabolas from rest at θ = 1/2, of period 4 √(2 θ)."""
    body = RigidBody([1, 1, 1], torque=lambda t, R, omega: [-ca.sign(R[2, 1]), 0, 0])
    motion = body.motion((math.cos(0.25), math.sin(0.25), 0, 0), (0, 0, 0), (0, 4))
    angle = [math.atan2(motion.rotation(t)[2, 1], motion.rotation(t)[2, 2]) for t in (0.5, 1.0, 2.0, 3.5, 4.0)]
    np.testing.assert_allclose(angle, [0.5 - 0.125, 0.0, -0.5, 0.5 - 0.125, 0.5], rtol=0, atol=1e-13)


def test_a_body_that_is_not_an_inertia_has_no_pivot():
    with pytest.raises(TypeError, match=r"mechanics\.Inertia"):
        RigidBody.pivoted([1, 2, 3], (0, 0, 0))
    assert rotation_matrix(np.ones((4, 5))).shape == (3, 3, 5)
