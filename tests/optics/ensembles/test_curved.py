"""Rays as geodesics of the vacuum metric and of the conformal metric, against closed forms and Fermat's principle."""

import casadi as ca
import numpy as np
import pytest

import varcalc as vc
from varcalc import optics

FLAT = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
FORMS = ("by_index_gradient", "by_conformal_metric")


@pytest.mark.parametrize("form", FORMS)
def test_rays_of_luneburgs_medium_in_flat_space(form):
    """r = r0 cos(sigma) + p0 sin(sigma), and S is the integral of n² = |p|² over sigma."""
    medium = optics.CurvedMedium(lambda q: FLAT, lambda q: ca.sqrt(2 - ca.sumsqr(q)))
    start = np.array([0.4, -0.2, 0.1])
    headings = np.array([[1.0, 0.5, 0.0], [-0.3, 1.0, 2.0]])
    momenta = np.sqrt(2 - start @ start) * headings / np.linalg.norm(headings, axis=1)[:, None]
    sigma = 0.8
    ends = start * np.cos(sigma) + momenta * np.sin(sigma)
    ahead = -start * np.sin(sigma) + momenta * np.cos(sigma)
    path = sigma + ((momenta**2).sum(axis=1) - start @ start) * np.sin(2 * sigma) / 4
    path += (momenta @ start) * (np.cos(2 * sigma) - 1) / 2
    bundle = getattr(medium, form)(start, headings, path)
    assert bundle.arrived.all()
    np.testing.assert_allclose(bundle.points, ends, rtol=1e-12)
    np.testing.assert_allclose(bundle.directions, ahead / np.linalg.norm(ahead, axis=1)[:, None], rtol=1e-12)


@pytest.mark.parametrize("form", FORMS)
def test_polar_coordinates_give_the_rays_of_the_plane(form):
    """The fish-eye in (r, phi), with the metric diag(1, r²), against the ray the scene traces in (x, y)."""
    polar = optics.CurvedMedium(lambda q: [[1, 0], [0, q[0] ** 2]], lambda q: 2 / (1 + q[0] ** 2))
    bundle = getattr(polar, form)((0.5, 0.3), [(0.2, 1.4)] * 2, np.array([0.4, 1.9]))
    r, angle = bundle.points.T
    start, ahead = 0.5 * np.array([np.cos(0.3), np.sin(0.3)]), np.array([np.cos(0.3), np.sin(0.3)])
    heading = 0.2 * ahead + 0.5 * 1.4 * np.array([-ahead[1], ahead[0]])
    plane = optics.Scene(optics.fish_eye()).trace(start, [heading] * 2, optical_path=[0.4, 1.9])
    np.testing.assert_allclose(np.column_stack([r * np.cos(angle), r * np.sin(angle)]), plane.points, rtol=1e-12)


@pytest.mark.parametrize("form", FORMS)
def test_the_fish_eye_is_a_sphere(form):
    """A quarter of a great circle, in stereographic coordinates: the metric of the unit sphere is n² (dx² + dy²)."""
    plane = optics.CurvedMedium(lambda q: [[1, 0], [0, 1]], lambda q: 2 / (1 + ca.sumsqr(q)))
    bundle = getattr(plane, form)((1.0, 0.0), (0.0, 1.0), np.pi / 2)
    np.testing.assert_allclose(bundle.points, [[0.0, 1.0]], atol=1e-14)


def test_both_forms_agree_with_fermats_principle_on_a_sphere_with_a_graded_index():
    medium = optics.CurvedMedium(lambda q: [[1, 0], [0, ca.cos(q[0]) ** 2]], lambda q: 1 + 0.3 * q[0] ** 2)
    a, direction, path = (0.2, -0.4), (0.6, 1.0), 1.3
    first, second = (getattr(medium, form)(a, direction, path) for form in FORMS)
    np.testing.assert_allclose(first.points, second.points, rtol=1e-13)
    np.testing.assert_allclose(first.directions, second.directions, rtol=1e-12)
    b = tuple(first.points[0].tolist())
    fermat = vc.solve(vc.Curve(medium.optical_length, vc.At(a), vc.At(b)))
    assert fermat.status is vc.Status.SOLVED
    assert fermat.value == pytest.approx(path, rel=1e-12)


def test_what_is_refused():
    plane = optics.CurvedMedium(lambda q: [[1, 0], [0, 1]], lambda q: 1 - q[0])
    with pytest.raises(ValueError, match="the index is -1 at the source"):
        plane.by_index_gradient((2.0, 0.0), (1, 0), 1.0)
    with pytest.raises(ValueError, match="squared length of the direction in the metric is 0"):
        plane.by_index_gradient((0.0, 0.0), (0, 0), 1.0)
    with pytest.raises(ValueError, match="3 rows of 3 entries, not 2 of 2"):
        plane.by_conformal_metric((0.0, 0.0, 0.0), (1, 0, 0), 1.0)
    with pytest.raises(ValueError, match="there are 2 points and 3 directions"):
        plane.by_conformal_metric(np.zeros((2, 2)), np.ones((3, 2)), 1.0)
    with pytest.raises(ValueError, match="optical_path must not be negative"):
        plane.by_conformal_metric((0.0, 0.0), (1, 0), -1.0)


def test_a_ray_that_comes_where_the_index_is_zero_is_marked():
    plane = optics.CurvedMedium(lambda q: [[1, 0], [0, 1]], lambda q: 1 - q[0])
    bundle = plane.by_index_gradient((0.0, 0.0), [(1, 0), (-1, 0)], 0.6)  # S = 1/2 to the line where n = 0
    assert bundle.status.tolist() == [optics.RayStatus.SINGULAR, optics.RayStatus.ARRIVED]
    assert np.all(np.isfinite(bundle.points))
