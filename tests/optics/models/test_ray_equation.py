"""The ray equation itself: curvature (Brizard eq. 1.41) and what layers conserve (eq. 1.42)."""

import casadi as ca
import numpy as np
import pytest

from varcalc import optics


def lobatto(count):
    """Chebyshev's points on [-1, 1] and the matrix that differentiates there (Trefethen, "Spectral Methods", ch. 6)."""
    x = np.cos(np.pi * np.arange(count + 1) / count)
    c = np.r_[2, np.ones(count - 1), 2] * (-1.0) ** np.arange(count + 1)
    apart = x[:, None] - x + np.eye(count + 1)
    matrix = np.outer(c, 1 / c) / apart
    return x, matrix - np.diag(matrix.sum(axis=1))


def mixed(x, y, z):
    return 1.5 + 0.3 * ca.sin(x + 2 * y) * ca.exp(-(z**2)) + 0.1 * z


@pytest.mark.parametrize("heading", [(1, 0.3, 0.2), (-0.4, 1, 1)])
def test_curvature_along_a_ray(heading):
    """k = |khat x grad ln n|: the rate at which the tangent turns, with the length for parameter."""
    path = 1.2
    tube = optics.ray_tube(optics.Scene(optics.Graded(mixed)), optics.PointSource((0.1, -0.2, 0.3)), heading, path)
    places, differentiate = lobatto(28)
    s = path * (1 + places) / 2
    tangents, points = tube.direction(s), tube.point(s)
    x = ca.SX.sym("x", 3)
    n = mixed(x[0], x[1], x[2])
    field = ca.Function("n", [x], [n, ca.gradient(n, x) / n])
    index, log_slope = (np.array(part) for part in field(points.T))
    turning = differentiate @ tangents * (2 / path) * index.T  # d/ds = n d/dS
    expected = np.linalg.norm(np.cross(tangents, log_slope.T), axis=1)
    np.testing.assert_allclose(np.linalg.norm(turning, axis=1), expected, rtol=1e-9)
    assert np.ptp(expected) > 0.1


def test_layers_conserve_the_direction_cosines():
    """n nhat x khat in a profile n(z), through interfaces between layers as well, in space."""
    rng = np.random.default_rng(5)
    headings = rng.standard_normal((40, 3))
    headings[:, 2] = 0.3 + np.abs(headings[:, 2])
    up = np.array([0.0, 0.0, 1.0])
    profile = optics.Stratified(lambda z: 1.4 + 0.2 * ca.sin(3 * z))
    scene = optics.Scene(
        [optics.Uniform(1.1), profile, optics.Uniform(1.6)], [optics.Plane((0, 0, 0), up), optics.Plane((0, 0, 1), up)]
    )
    start = 1.1 * np.cross(up, headings / np.linalg.norm(headings, axis=1)[:, None])
    for height, index in ((0.7, 1.4 + 0.2 * np.sin(2.1)), (1.5, 1.6)):
        bundle = scene.trace((0, 0, -0.5), headings, until=optics.Plane((0, 0, height), up))
        assert bundle.arrived.all()
        np.testing.assert_allclose(index * np.cross(up, bundle.directions), start, atol=1e-13)
