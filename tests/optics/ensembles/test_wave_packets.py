"""Hamilton's ray equations from a dispersion relation, against closed forms."""

import casadi as ca
import numpy as np
import pytest

from varcalc import optics


def test_light_in_a_graded_medium_goes_along_its_rays():
    """ω = |k|/n(x): after the time S the packet is where the ray of the optical path S is."""
    light = optics.DispersionRelation(lambda x, k: ca.norm_2(k) * (1 + ca.sumsqr(x)) / 2)
    headings = np.array([(0.0, 1.0, 0.3), (-1.0, 0.2, 0.0)])
    packets = light.trace((0.5, 0.1, 0.0), headings, [0.7, 1.9])
    rays = optics.Scene(optics.fish_eye()).trace((0.5, 0.1, 0.0), headings, optical_path=[0.7, 1.9])
    assert packets.arrived.all()
    np.testing.assert_allclose(packets.points, rays.points, rtol=1e-12, atol=1e-13)
    ahead = packets.wavevectors / np.linalg.norm(packets.wavevectors, axis=1)[:, None]
    np.testing.assert_allclose(ahead, rays.directions, rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(packets.phase, 0, atol=1e-12)  # light's crests go as fast as its packets


def test_a_plasma_of_linear_density_throws_waves_like_stones():
    """ω² = c² k² + g x: d²x/dt² is constant where ω is, for dx/dt = c² k/ω and dk/dt = -g/(2 ω)."""
    c, g = 2.0, 0.7
    plasma = optics.DispersionRelation(lambda x, k: ca.sqrt(c**2 * ca.sumsqr(k) + g * x[1]))
    x, k, time = np.array([0.2, 0.5]), np.array([[0.6, 0.9], [1.0, -0.3]]), 1.7
    packets = plasma.trace(x, k, time)
    omega = np.sqrt(c**2 * np.sum(k**2, axis=1) + g * x[1])[:, None]
    down = np.array([0.0, 1.0])
    np.testing.assert_allclose(packets.wavevectors, k - down * g * time / (2 * omega), rtol=1e-13)
    ends = x + c**2 * k * time / omega - down * c**2 * g * time**2 / (4 * omega**2)
    np.testing.assert_allclose(packets.points, ends, rtol=1e-13)
    np.testing.assert_allclose(plasma.frequency(packets.points, packets.wavevectors), omega[:, 0], rtol=1e-14)


def test_waves_on_a_current_keep_their_frequency_and_the_wavenumber_along_it():
    """Deep water with a shear flow U(y) along x (the Doppler shift U k_x)."""
    water = optics.DispersionRelation(lambda x, k: ca.sqrt(9.81 * ca.norm_2(k)) + 0.4 * ca.tanh(x[1]) * k[0])
    start, k = np.array([0.0, -2.0]), np.array([[0.5, 0.8], [1.5, 1.0], [-2.0, 1.0]])
    packets = water.trace(start, k, 4.0)
    before, after = water.frequency(start, k), water.frequency(packets.points, packets.wavevectors)
    np.testing.assert_allclose(after, before, rtol=1e-13)
    np.testing.assert_array_equal(packets.wavevectors[:, 0], k[:, 0])
    turned = np.abs(packets.wavevectors[:, 1] - k[:, 1])
    assert np.all(turned > 1e-2)


def test_group_and_phase_of_waves_on_deep_water():
    water = optics.DispersionRelation(lambda x, k: ca.sqrt(9.81 * ca.norm_2(k)))
    k = np.array([[3.0, 4.0]])
    phase_velocity = water.frequency((0, 0), k)[:, None] * k / 25.0
    np.testing.assert_allclose(water.group_velocity((0, 0), k), phase_velocity / 2, rtol=1e-15)
    packets = water.trace((0, 0), k, 2.0)
    omega = np.sqrt(9.81 * 5)
    assert packets.phase[0] == pytest.approx(-omega * 2.0 / 2, rel=1e-14)  # k.x - ω t, with x at the group velocity


def test_what_is_refused():
    plasma = optics.DispersionRelation(lambda x, k: ca.sqrt(ca.sumsqr(k) - x[0]))
    with pytest.raises(ValueError, match=r"omega or its derivative by k is not a number at x = \[2\.0, 0\.0\]"):
        plasma.trace((2, 0), (1, 0), 1.0)
    with pytest.raises(ValueError, match="there are 2 points and 3 wavevectors"):
        plasma.trace(np.zeros((2, 2)), np.ones((3, 2)), 1.0)
    with pytest.raises(ValueError, match="time must not be negative"):
        plasma.trace((0, 0), (1, 0), -1.0)
    with pytest.raises(TypeError, match="omega must accept 2 arguments"):
        optics.DispersionRelation(lambda x: x).trace((0, 0), (1, 0), 1.0)
