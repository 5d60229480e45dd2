"""Closed forms of the linear ray equation, against Hamilton's equations and what is known."""

import math

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import brentq

from varcalc import optics
from varcalc.optics import RayStatus
from varcalc.optics.media.medium import squared
from varcalc.optics.models.linear import is_linear, ratio
from varcalc.optics.rays.beam import NOTHING, launched
from varcalc.optics.surfaces import Geometry

BOWL = optics.Graded(lambda x, y, z: ca.sqrt(3 - 0.8 * x**2 + 0.3 * y**2 + 0.2 * x * y + 0.1 * z - 0.05 * x))
ROD = optics.selfoc(1.6, 0.7)
CASES = {
    "rod to a plane across it": (ROD, optics.Plane((0, 0, 2.3), (0, 0, 1))),
    "rod to a plane along it": (ROD, optics.Plane((0.15, 0.1, 0), (1, 0.5, 0))),
    "rod to its wall": (ROD, optics.Implicit(lambda x, y, z: x**2 + y**2 - 0.04)),
    "lens to a plane": (optics.luneburg(), optics.Plane((0.2, 0.3, 0.1), (1, 0.3, -0.5))),
    "lens to its rim": (optics.luneburg(), optics.Sphere((0, 0, 0), 1.0)),
    "parabolas to a plane": (optics.Stratified(lambda y: ca.sqrt(2 - y)), optics.Plane((0, 0.2, 0.1), (0, 1, 2))),
    "bowl to a plane": (BOWL, optics.Plane((0, 0, 0.7), (0, 0, 1))),
    "bowl to an optical path": (BOWL, None),
    "hill": (optics.Graded(lambda x, y, z: ca.sqrt(1 + 0.7 * (x**2 + y**2 + z**2))), optics.Sphere((0, 0, 0), 1.5)),
    "weak": (optics.Graded(lambda x, y, z: ca.sqrt(2 - z + 1e-9 * x**2)), None),
}


def beam(medium, count=200):
    generator = np.random.default_rng(3)
    points = generator.uniform(-0.12, 0.12, (count, 3))
    headings = generator.normal(size=(count, 3))
    headings /= np.linalg.norm(headings, axis=1)[:, None]
    index = optics.media.medium.Field(medium, 3).index(points)
    return launched(points, headings, index, neighbours=True)


@pytest.mark.parametrize(("medium", "surface"), CASES.values(), ids=CASES.keys())
def test_closed_forms_agree_with_hamiltons_equations(medium, surface):
    geometries = [] if surface is None else [Geometry(surface, 3)]
    assert is_linear(medium, 3)
    assert all(ratio(medium, geometry) is not None for geometry in geometries)
    limit = np.full(200, 2.5)
    for leaving in (NOTHING,) if surface is None else (NOTHING, 0):
        start = beam(medium)
        if leaving != NOTHING:
            there = optics.Linear().carrier(medium, 3, geometries).advance(start, np.full(200, np.inf))
            start = there.beam.take(np.flatnonzero(there.struck == 0))
            assert len(start) > 50
            limit = start.optical_path + 2.5
        ends = [
            model.carrier(medium, 3, geometries).advance(start, limit, leaving)
            for model in (optics.Linear(), optics.Hamilton())
        ]
        np.testing.assert_array_equal(ends[0].struck, ends[1].struck)
        assert np.all(ends[0].status == ends[1].status)
        for part in ("position", "momentum", "optical_path", "moved", "turned"):
            exact, found = (getattr(end.beam, part) for end in ends)
            np.testing.assert_allclose(found, exact, rtol=1e-11, atol=2e-12)


def test_what_is_not_linear_is_told():
    assert not is_linear(optics.fish_eye(), 3)
    assert not is_linear(optics.Stratified(lambda y: 1 / y), 2)
    assert ratio(ROD, Geometry(optics.Sphere((0, 0, 0), 1.0), 3)) is None
    assert ratio(ROD, Geometry(optics.Plane((0, 0, 1), (0.1, 0, 1)), 3)) is None
    assert ratio(optics.luneburg(), Geometry(optics.Sphere((0.1, 0, 0), 1.0), 3)) is None
    assert ratio(optics.luneburg(), Geometry(optics.Conic((0, 0, 0), (0, 0, 1), 2.0), 3)) is None


def test_other_surfaces_are_left_to_hamiltons_equations():
    bundle = optics.Scene(ROD).trace((0.1, 0, 0), (0.1, 0, 1), until=optics.Sphere((0, 0, 0), 2.0))
    assert bundle.model == "Hamilton's ray equations"
    assert np.linalg.norm(bundle.points[0]) == pytest.approx(2, rel=1e-15)


def test_a_ray_that_grazes_a_plane_meets_it_and_one_a_little_lower_does_not():
    """n² = 1 - 2y: from the ground at 45 degrees the top of the parabola is at 1/4."""
    scene = optics.Scene(optics.Stratified(lambda y: ca.sqrt(1 - 2 * y)))
    for gap, status in ((-1e-9, RayStatus.ARRIVED), (1e-9, RayStatus.MISSED)):
        bundle = scene.trace((0, 0), (1, 1), until=optics.Plane((0, 0.25 + gap), (0, 1)))
        assert bundle.model == "linear ray equation"
        assert list(bundle.status) == [status]


def test_a_ray_from_the_rim_of_a_lens_comes_back_to_it():
    bundle = optics.Scene(optics.luneburg()).trace((-1, 0), [(1, 0), (1, 1), (-1, 0)], until=optics.Sphere((0, 0), 1))
    assert np.all(bundle.arrived)
    np.testing.assert_allclose(np.linalg.norm(bundle.points, axis=1), 1.0, rtol=1e-15)


def test_the_optical_path_of_a_ray_straight_up_to_where_the_index_vanishes():
    """S = σ - σ² + σ³/3 has its rate zero at the top, S = 1/3, and grows on beyond it."""
    scene = optics.Scene(optics.Stratified(lambda y: ca.sqrt(1 - 2 * y)))
    bundle = scene.trace((0, 0), [(0, 1)] * 3, optical_path=[0.1, 1 / 3, 1.0])
    assert np.all(bundle.arrived)
    sigma = 1 + np.cbrt(3 * bundle.optical_path - 1)
    np.testing.assert_allclose(bundle.points[:, 1], sigma - sigma**2 / 2, atol=1e-10)


@pytest.mark.parametrize("value", [1.7, -2.0])
def test_squares_are_written_without_roots(value):
    x = ca.SX.sym("x")
    for written in (ca.sqrt(x), -3 * ca.sqrt(1 - x), 2 / ca.sqrt(x), x + 1, ca.SX(value), x):
        there = ca.Function("there", [x], [squared(written), written**2])
        first, second = there(0.3)
        assert float(first) == pytest.approx(float(second), rel=1e-15)
        assert "sqrt" not in str(squared(written))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("limit", [20.0, 500.0, 1e8])
def test_rays_of_a_saddle_stop_at_their_optical_paths(limit):
    """n^2 = 3 + x^2 - y^2, x'' = x and y'' = -y: rays were said to stop at 500 that went on to 1e98."""
    scene = optics.Scene(optics.Graded(lambda x, y: ca.sqrt(3 + x**2 - y**2)))
    turn = np.linspace(-3, 3, 40)
    bundle = scene.trace((0.0, 0.1), np.column_stack([np.cos(turn), np.sin(turn)]), optical_path=limit)
    assert bundle.arrived.all()
    assert bundle.optical_path == pytest.approx(np.full(40, limit), rel=1e-12)
    p, q = np.sqrt(2.99) * np.cos(turn), np.sqrt(2.99) * np.sin(turn)
    sigma = np.arcsinh(bundle.points[:, 0] / p)
    assert bundle.points[:, 1] == pytest.approx(0.1 * np.cos(sigma) + q * np.sin(sigma), abs=1e-7)
    path = p**2 * (sigma + np.sinh(sigma) * np.cosh(sigma)) / 2
    path += q**2 * (sigma + np.sin(sigma) * np.cos(sigma)) / 2 + 0.01 * (sigma - np.sin(sigma) * np.cos(sigma)) / 2
    path -= 0.1 * q * np.sin(sigma) ** 2
    assert path == pytest.approx(np.full(40, limit), rel=1e-12)


def test_the_optical_path_of_a_ray_that_comes_to_a_saddle_loses_no_digits_to_what_grows():
    """In n^2 = 3 + x^2 - y^2 from (2, 0) along p = (-2, √3): x = 2 exp(-σ) and y = √3 sin σ."""
    scene = optics.Scene(optics.Graded(lambda x, y: ca.sqrt(3 + x**2 - y**2)))
    for sigma in (2.0, 9.0):
        path = 2 * (1 - np.exp(-2 * sigma)) + 1.5 * (sigma + np.sin(sigma) * np.cos(sigma))
        bundle = scene.trace((2.0, 0.0), [(-2.0, np.sqrt(3.0))], optical_path=path)
        assert bundle.points[0, 1] == pytest.approx(np.sqrt(3) * np.sin(sigma), abs=1e-11)


@pytest.mark.filterwarnings("error")
def test_rays_beside_a_saddle_are_found_without_warnings():
    """p(σ) is known where a ray comes to B after σ, and |p|² = n²(A) is one equation: its first five zeros."""

    def excess(s):
        return (2.5 / np.sinh(s)) ** 2 + ((0.3 - 0.1 * np.cos(s)) / np.sin(s)) ** 2 - 2.99

    s = np.linspace(0.01, 8.0, 80001)
    ahead = excess(s)
    change = np.flatnonzero((ahead[1:] * ahead[:-1] < 0) & (np.abs(ahead[1:]) < 100))
    sigma = np.array([brentq(excess, s[k], s[k + 1], xtol=1e-15) for k in change])
    p, q = 2.5 / np.sinh(sigma), (0.3 - 0.1 * np.cos(sigma)) / np.sin(sigma)
    path = p**2 * (sigma + np.sinh(sigma) * np.cosh(sigma)) / 2 - 0.1 * q * np.sin(sigma) ** 2
    path += q**2 * (sigma + np.sin(sigma) * np.cos(sigma)) / 2 + 0.01 * (sigma - np.sin(sigma) * np.cos(sigma)) / 2
    rays = optics.Scene(optics.Graded(lambda x, y: ca.sqrt(3 + x**2 - y**2))).rays((0, 0.1), (2.5, 0.3))
    found = [ray.optical_path for ray in rays if ray.optical_path < 13.0]
    assert found == pytest.approx(sorted(path[path < 13.0]), rel=1e-11)


def test_a_ray_comes_to_rest_where_the_index_vanishes():
    """n = |y| from y = -1 straight up: the optical path to y = 0 is 1/2, and takes for ever."""
    scene = optics.Scene(optics.Graded(lambda x, y: ca.fabs(y)))
    bundle = scene.trace([(0.3, -1.0), (0.3, -1.0)], [(0.0, 1.0), (0.0, -1.0)], optical_path=5)
    assert list(bundle.status) == [RayStatus.SINGULAR, RayStatus.ARRIVED]
    assert bundle.points[1] == pytest.approx([0.3, -math.sqrt(11.0)], abs=1e-12)
