"""Quaternions, matrices and Euler angles: there and back, next to and on the singularity."""

import math

import mpmath as mp
import numpy as np
import pytest

from varcalc.mechanics import EulerAngles, quaternion_of, rotation_matrix


def test_euler_angles_are_three_turns():
    phi, theta, psi = 0.4, 1.1, -2.3

    def about(axis, angle):
        k = "xyz".index(axis)
        i, j = (k + 1) % 3, (k + 2) % 3
        turn = np.eye(3)
        turn[i, i] = turn[j, j] = math.cos(angle)
        turn[i, j], turn[j, i] = -math.sin(angle), math.sin(angle)
        return turn

    exact = about("z", phi) @ about("x", theta) @ about("z", psi)
    angles = EulerAngles(phi, theta, psi)
    np.testing.assert_allclose(angles.rotation, exact, atol=1e-15)
    np.testing.assert_allclose(rotation_matrix(5 * angles.quaternion), exact, atol=1e-15)
    again = EulerAngles.of(angles.quaternion)
    assert (again.phi, again.theta, again.psi) == pytest.approx((phi, theta, psi), abs=1e-15)


@pytest.mark.parametrize("theta", [1e-300, 1e-12, 1e-3, math.pi - 1e-12])
def test_theta_keeps_its_digits_next_to_the_poles(theta):
    q = EulerAngles(0.7, theta, 0.2).quaternion
    found = EulerAngles.of(q)
    # what the quaternion itself says, in more digits
    exact = float(2 * mp.atan2(mp.hypot(*map(mp.mpf, q[1:3])), mp.hypot(mp.mpf(q[0]), mp.mpf(q[3]))))
    assert found.theta == pytest.approx(exact, rel=4e-16)
    assert (found.phi, found.psi) == pytest.approx((0.7, 0.2), abs=1e-3 if theta > 3 else 1e-14)


@pytest.mark.parametrize(("theta", "psi"), [(0.0, 0.9), (math.pi, -0.5)])
def test_on_the_poles_all_turning_is_the_bodys_own(theta, psi):
    exact = {0.0: [math.cos(0.45), 0, 0, math.sin(0.45)], math.pi: [0, math.cos(0.25), math.sin(0.25), 0]}[theta]
    found = EulerAngles.of(exact)
    assert (found.phi, found.theta, found.psi) == pytest.approx((0.0, theta, psi), abs=1e-15)
    np.testing.assert_allclose(rotation_matrix(found.quaternion), rotation_matrix(exact), atol=1e-15)
    with pytest.raises(ValueError, match="sin θ is 0"):
        EulerAngles(0.0, 0.0, 0.9).rates([0, 0, 1])


def test_rates_and_angular_velocity_are_inverse_and_derivatives():
    start, rates, h = np.array([0.4, 1.1, -2.3]), np.array([0.7, -0.4, 1.9]), 1e-6
    angles = EulerAngles(*start)
    omega = angles.angular_velocity(rates)
    np.testing.assert_allclose(angles.rates(omega), rates, rtol=1e-14)
    after, before = (EulerAngles(*(start + sign * h * rates)).rotation for sign in (1, -1))
    spin = angles.rotation.T @ (after - before) / (2 * h)
    np.testing.assert_allclose([spin[2, 1], spin[0, 2], spin[1, 0]], omega, atol=1e-9)


def test_many_at_once():
    rng = np.random.default_rng(5)
    q = rng.normal(size=(4, 3, 5))
    angles = EulerAngles.of(q)
    assert angles.theta.shape == (3, 5)
    np.testing.assert_allclose(angles.rotation, rotation_matrix(q), atol=1e-14)


def test_a_matrix_gives_its_quaternion_whatever_its_trace():
    rng = np.random.default_rng(7)
    for q in [*rng.normal(size=(50, 4)), [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1], [1, 0, 0, 0], [1e-9, 1, 0, 0]]:
        exact = np.array(q) / np.linalg.norm(q)
        found = quaternion_of(rotation_matrix(q))
        assert min(np.abs(found - exact).max(), np.abs(found + exact).max()) <= 4e-16
    for wrong in (np.diag([1, 1, -1.0]), np.eye(2), 2 * np.eye(3)):
        with pytest.raises(ValueError, match="right-handed"):
            quaternion_of(wrong)
    with pytest.raises(ValueError, match="four numbers"):
        rotation_matrix([1, 0, 0])
