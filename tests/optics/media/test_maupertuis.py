"""Particles as rays: orbits and times of Newton's equations."""

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from varcalc import optics


def test_kepler_orbits():
    """In U = -1/r with E = -1/2 the orbit is an ellipse of semi-axis 1; half round it S = ∫ sqrt(E - U) ds."""
    eccentricity = 0.6
    medium = optics.maupertuis(lambda x, y: -1 / ca.sqrt(x**2 + y**2), -0.5)
    perihelion = (1 - eccentricity, 0.0)
    bundle = optics.Scene(medium).trace(perihelion, (0.0, 1.0), until=optics.Plane((-0.5, 0), (1, 0)))
    x, y = bundle.points[0]
    assert x == pytest.approx(-0.5, abs=1e-13)
    assert y == pytest.approx(np.sqrt((1 - eccentricity**2) * (1 - (x + eccentricity) ** 2)), rel=1e-12)


def test_orbits_and_times_are_those_of_newton():
    """An anharmonic potential; time of flight by Jacobi's t = ∂W/∂E."""
    mass, energy = 1.7, 1.3

    def potential(x, y):
        return 0.3 * x**2 + 0.1 * y**4 + 0.2 * x * y

    def force(position):
        x, y = position
        return -np.array([0.6 * x + 0.2 * y, 0.4 * y**3 + 0.2 * x])

    start, heading = np.array([0.1, -0.2]), np.array([0.6, 0.8])
    speed = np.sqrt(2 * (energy - potential(*start)) / mass)
    newton = solve_ivp(
        lambda t, s: np.concatenate([s[2:], force(s[:2]) / mass]), (0, 0.9), [*start, *(speed * heading)],
        method="DOP853", rtol=1e-13, atol=1e-14,
    )  # fmt: skip
    end = newton.y[:2, -1]
    scene = optics.Scene(optics.maupertuis(potential, energy))
    stop = optics.Plane(tuple(end), tuple(newton.y[2:, -1]))
    np.testing.assert_allclose(scene.trace(start, heading, until=stop).points, [end], atol=1e-11)
    ray = scene.rays(start, end, within=2.0)[0]
    assert np.sqrt(2 * mass) * ray.derivatives["energy"] == pytest.approx(0.9, rel=1e-10)
    np.testing.assert_allclose(ray.tangents[0], heading, atol=1e-10)


def test_times_of_thrown_stones():
    """t² from (t g)² = 2 (v² - g y) -+ 2 sqrt((v² - g y)² - g² d²), for mass 1."""
    g, speed, target = 0.8, 1.5, (1.1, 0.3)
    medium = optics.maupertuis(lambda x, y, p: p.g * y, speed**2 / 2, {"g": g})
    rays = optics.Scene(medium).rays((0, 0), target)
    mean = speed**2 - g * target[1]
    roots = np.sqrt(mean**2 - g**2 * (target[0] ** 2 + target[1] ** 2)) * np.array([-1, 1])
    times = [np.sqrt(2) * ray.derivatives["energy"] for ray in rays]
    np.testing.assert_allclose(times, np.sqrt(2 * (mean + roots)) / g, rtol=1e-12)


def test_a_soft_sphere_refracts_as_a_ball_of_glass_does():
    energy, depth = 0.8, 0.5
    well = [optics.maupertuis(0.0, energy), optics.maupertuis(-depth, energy), optics.maupertuis(0.0, energy)]
    glass = [optics.Uniform(1.0), optics.Uniform(np.sqrt(1 + depth / energy)), optics.Uniform(1.0)]
    ball = [optics.Sphere((0, 0), 1.0)] * 2
    starts = np.array([(-2.0, h) for h in (-0.8, 0.1, 0.6)])
    stop = optics.Plane((3, 0), (1, 0))
    particles, light = (optics.Scene(m, ball).trace(starts, (1, 0), until=stop) for m in (well, glass))
    np.testing.assert_allclose(particles.directions, light.directions, rtol=1e-14, atol=1e-15)
    heights = starts[:, 1]
    turned = 2 * (np.arcsin(heights) - np.arcsin(heights / np.sqrt(1 + depth / energy)))  # towards the axis
    np.testing.assert_allclose(np.arctan2(*particles.directions.T[::-1]), -turned, rtol=1e-13)


def test_a_particle_that_cannot_move_is_refused():
    with pytest.raises(ValueError, match="must exceed the potential"):
        optics.maupertuis(2.0, 1.0)
