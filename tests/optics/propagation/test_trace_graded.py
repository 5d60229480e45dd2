"""Bundles in graded media against closed forms evaluated here (Born and Wolf, sect. 4.2; Brizard, sect. 1.3-1.4)."""

import casadi as ca
import numpy as np
import pytest

from varcalc import optics
from varcalc.optics import RayStatus

ANGLES = np.linspace(0.1, 2 * np.pi, 13)
PLANE = np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])
SPACE = np.column_stack([np.cos(ANGLES), np.sin(ANGLES) * 0.8, np.sin(ANGLES) * 0.6])


def test_a_luneburg_lens_focuses_a_plane_wave_on_its_rim():
    height = np.linspace(-0.999, 0.999, 21)
    rim = np.column_stack([-np.sqrt(1 - height**2), height])
    bundle = optics.Scene(optics.luneburg()).trace(rim, (1, 0), until=optics.Sphere((0, 0), 1.0))
    assert np.all(bundle.arrived)
    np.testing.assert_allclose(bundle.points, np.tile([1.0, 0.0], (21, 1)), atol=4e-15)
    np.testing.assert_allclose(bundle.optical_path, np.pi / 2 + np.sqrt(1 - height**2), rtol=4e-15)


@pytest.mark.parametrize("directions", [PLANE, SPACE], ids=["plane", "space"])
def test_every_ray_of_a_fish_eye_meets_the_antipode(directions):
    a, n0 = 1.3, 1.7
    source = np.array([0.47, 0.175, 0.2])[: directions.shape[1]]
    scene = optics.Scene(optics.fish_eye(n0, a))
    bundle = scene.trace(source, directions, optical_path=np.pi * n0 * a / 2, with_spreading=True)
    antipode = -(a**2) * source / np.dot(source, source)
    np.testing.assert_allclose(bundle.points, np.tile(antipode, (13, 1)), atol=1e-12 * np.linalg.norm(antipode))
    np.testing.assert_allclose(bundle.spreading, 0.0, atol=2e-9)  # rays that swing far out magnify round-off


@pytest.mark.parametrize("directions", [PLANE, SPACE], ids=["plane", "space"])
def test_distances_and_spreading_in_a_fish_eye(directions):
    source = np.array([0.4, -0.3, 0.2])[: directions.shape[1]]
    path = np.linspace(0.2, 2.2, 13)
    bundle = optics.Scene(optics.fish_eye()).trace(source, directions, optical_path=path, with_spreading=True)
    np.testing.assert_allclose(bundle.optical_path, path, rtol=4e-16)
    ends, squares = bundle.points, np.sum(bundle.points**2, axis=1)
    chord = np.linalg.norm(ends - source, axis=1)
    half = np.arcsin(np.minimum(1, chord / np.sqrt((1 + source @ source) * (1 + squares))))
    shorter = np.where(path < np.pi / 2, 2 * half, np.nan)  # to pi/2 from either side of the antipode
    np.testing.assert_allclose(shorter[path < 1.5], path[path < 1.5], rtol=1e-13)
    exact = (np.sin(path) * (1 + squares) / 2) ** (directions.shape[1] - 1)
    np.testing.assert_allclose(bundle.spreading, np.abs(exact), rtol=1e-12)


def test_an_eaton_lens_sends_rays_back():
    height = np.array([0.2, 0.5, -0.7, 0.95])
    rim = np.column_stack([-np.sqrt(1 - height**2), height])
    bundle = optics.Scene(optics.eaton()).trace(rim, (1, 0), until=optics.Sphere((0, 0), 1.0))
    np.testing.assert_allclose(bundle.points, np.column_stack([-np.sqrt(1 - height**2), -height]), atol=1e-13)
    np.testing.assert_allclose(bundle.directions, np.tile([-1.0, 0.0], (4, 1)), atol=1e-13)
    np.testing.assert_allclose(bundle.optical_path, np.pi + 2 * np.sqrt(1 - height**2), rtol=1e-13)


def test_rays_of_a_rod_are_sines():
    n0, a, length = 1.6, 0.7, 23.0
    start = np.array([[0.1, -0.2, 0.0], [0.0, 0.3, 0.0], [0.05, 0.05, 0.0]])
    heading = np.array([[0.1, 0.2, 1.0], [-0.2, 0.05, 1.0], [0.0, 0.0, 1.0]])
    bundle = optics.Scene(optics.selfoc(n0, a)).trace(start, heading, until=optics.Plane((0, 0, length), (0, 0, 1)))
    index = n0 * np.sqrt(1 - a**2 * np.sum(start[:, :2] ** 2, axis=1))
    p = index[:, None] * heading / np.linalg.norm(heading, axis=1)[:, None]
    sigma, w = length / p[:, 2], n0 * a
    exact = start[:, :2] * np.cos(w * sigma)[:, None] + p[:, :2] / w * np.sin(w * sigma)[:, None]
    np.testing.assert_allclose(bundle.points[:, :2], exact, atol=4e-14)
    np.testing.assert_allclose(bundle.points[:, 2], length, rtol=1e-15)


def test_rays_where_the_squared_index_is_linear_are_parabolas():
    n0, g, path = 1.2, 0.35, np.linspace(0.1, 6.0, 13)
    medium = optics.Stratified(lambda y: ca.sqrt(n0**2 - 2 * g * y))
    bundle = optics.Scene(medium).trace((0, 0), PLANE, optical_path=path, with_spreading=True)
    roots = [np.roots([g**2 / 3, -n0 * g * t[1], n0**2, -s]) for t, s in zip(PLANE, path, strict=True)]
    sigma = np.array([r[np.abs(r.imag) < 1e-9].real.min() for r in roots])
    exact = n0 * PLANE * sigma[:, None] - np.column_stack([0 * sigma, g * sigma**2 / 2])
    np.testing.assert_allclose(bundle.points, exact, atol=1e-13)


def test_the_half_plane_has_circles_for_rays():
    path = np.linspace(0.3, 3.0, 13)
    bundle = optics.Scene(optics.Stratified(lambda y: 2.0 / y)).trace(
        (0.3, 1.5), PLANE, optical_path=path, with_spreading=True
    )
    squared = np.sum((bundle.points - [0.3, 1.5]) ** 2, axis=1)
    np.testing.assert_allclose(2.0 * np.arccosh(1 + squared / (3.0 * bundle.points[:, 1])), path, rtol=1e-12)
    np.testing.assert_allclose(bundle.spreading, bundle.points[:, 1] * np.sinh(path / 2), rtol=1e-11)


def test_a_ray_starts_on_the_surface_it_is_to_come_back_to():
    scene = optics.Scene(optics.Stratified(lambda y: ca.sqrt(1 - 2 * y)))
    angle = np.deg2rad([15.0, 75.0, 45.0, 89.999])
    heading = np.column_stack([np.cos(angle), np.sin(angle)])
    bundle = scene.trace((0, 0), heading, until=optics.Plane((0, 0), (0, 1)))
    np.testing.assert_allclose(bundle.points[:, 0], np.sin(2 * angle), atol=1e-14)


def test_surfaces_that_are_never_met_are_told():
    scene = optics.Scene(optics.Stratified(lambda y: ca.sqrt(1 - 2 * y)))
    bundle = scene.trace((0, 0), [(0, 1), (1, 1), (1, -1)], until=optics.Plane((0, 0.4), (0, 1)))
    assert list(bundle.status) == [RayStatus.ARRIVED, RayStatus.MISSED, RayStatus.MISSED]
    assert "2 rays: the ray meets neither" in str(bundle)


def test_a_ray_that_falls_into_a_singular_index_is_marked_and_harms_no_other():
    rim = [(-1.0, 0.0), (-0.8, 0.6), (-0.6, 0.8)]
    bundle = optics.Scene(optics.eaton()).trace(rim, (1, 0), optical_path=3.0)
    assert bundle.status[0] in (RayStatus.SINGULAR, RayStatus.TOO_MANY_STEPS)
    assert np.all(np.isfinite(bundle.points))
    assert np.all(bundle.arrived[1:])


def test_a_lens_of_graded_glass_between_air_and_air():
    """A Wood lens: a plane-parallel rod of length L; with the closed form inside and Snell at both faces."""
    n0, a, length, height = 1.5, 0.4, 1.0, np.array([0.05, 0.2, -0.3])
    faces = [optics.Plane((0, 0), (1, 0)), optics.Plane((length, 0), (1, 0))]
    rod = optics.Graded(lambda x, y: n0 * ca.sqrt(1 - a**2 * y**2))
    scene = optics.Scene([optics.Uniform(1.0), rod, optics.Uniform(1.0)], faces)
    bundle = scene.trace(np.column_stack([0 * height - 1, height]), (1, 0), until=optics.Plane((3, 0), (1, 0)))
    pz = n0 * np.sqrt(1 - a**2 * height**2)
    y, py = height * np.cos(n0 * a * length / pz), -height * n0 * a * np.sin(n0 * a * length / pz)
    np.testing.assert_allclose(bundle.points[:, 1], y + 2 * py / np.sqrt(1 - py**2), atol=1e-14)


def test_a_surface_far_away_is_reached_from_the_origin():
    scene = optics.Scene(optics.Stratified(lambda y: 1 + 1e-9 * y / 1e7))
    bundle = scene.trace((0, 0), (1, 0), until=optics.Plane((1e8, 0), (1, 0)))
    assert bundle.arrived[0]
    np.testing.assert_allclose(bundle.points[0, 0], 1e8, rtol=1e-15)


@pytest.mark.parametrize("size", [1e200, 1e-200])
def test_directions_of_any_length_point_the_way(size):
    bundle = optics.Scene(optics.Uniform(2.0)).trace((0, 0), (3 * size, 4 * size), optical_path=2)
    assert bundle.points[0] == pytest.approx([0.6, 0.8], abs=1e-15)
