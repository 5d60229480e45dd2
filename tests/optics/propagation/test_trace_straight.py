"""Straight rays through surfaces: Snell's law, mirrors, and what cannot be traced."""

import casadi as ca
import numpy as np
import pytest

from varcalc import optics
from varcalc.optics import RayStatus

AIR, WATER, GLASS = optics.Uniform(1.0), optics.Uniform(4 / 3), optics.Uniform(1.5)


def unit(v):
    v = np.asarray(v, dtype=float)
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def test_a_slab_in_space_keeps_the_tangential_momentum():
    scene = optics.Scene([AIR, GLASS, WATER], [optics.Plane((0, 0, 0), (0, 0, 2)), optics.Plane((0, 0, -1), (0, 0, 1))])
    heading = unit(np.random.default_rng(0).normal(size=(50, 3)) - [0, 0, 6])
    bundle = scene.trace((0.0, 0.0, 1.0), heading, until=optics.Plane((0, 0, -2), (0, 0, 1)))
    assert bundle.model == "straight segments"
    np.testing.assert_allclose(4 / 3 * bundle.directions[:, :2], heading[:, :2], atol=2e-15)
    tangents = [heading[:, :2] / np.sqrt(n**2 - np.sum(heading[:, :2] ** 2, axis=1))[:, None] for n in (1, 1.5, 4 / 3)]
    np.testing.assert_allclose(bundle.points[:, :2], sum(tangents), atol=4e-15)
    lengths = [n / np.sqrt(1 - np.sum((heading[:, :2] / n) ** 2, axis=1)) for n in (1, 1.5, 4 / 3)]
    np.testing.assert_allclose(bundle.optical_path, sum(lengths), rtol=1e-15)


def test_total_reflection_begins_at_the_critical_angle():
    scene = optics.Scene([GLASS, AIR], [optics.Plane((0, 0), (0, 1))])
    critical = np.arcsin(1 / 1.5)
    angle = critical + np.array([-1e-9, 1e-9])
    bundle = scene.trace((0, -1), np.column_stack([np.sin(angle), np.cos(angle)]), optical_path=5.0)
    assert list(bundle.status) == [RayStatus.ARRIVED, RayStatus.TOTAL_REFLECTION]
    np.testing.assert_allclose(bundle.points[1], [np.tan(angle[1]), 0.0], atol=1e-13)


def test_a_parabolic_mirror_brings_a_plane_wave_to_its_focus():
    height = np.linspace(-2, 2, 9)
    mirror = optics.Conic((0, 0), (-1, 0), 2.0, conic=-1.0, mirror=True)
    stop = optics.Sphere((-1, 0), 1e-3)
    end = optics.Scene([AIR], [mirror]).trace(
        np.column_stack([0 * height - 5, height])[height != 0], (1, 0), until=stop
    )
    aim = end.points - [-1, 0]
    np.testing.assert_allclose(aim[:, 0] * end.directions[:, 1] - aim[:, 1] * end.directions[:, 0], 0, atol=1e-14)
    np.testing.assert_allclose(end.optical_path, 5 + 1 - 1e-3, rtol=1e-13)


def test_a_cartesian_ellipsoid_collimates_without_aberration():
    """From glass into air an ellipsoid of eccentricity 1/n makes a point source a plane wave (Born and Wolf, 4.2.3)."""
    n = 1.5
    lens = optics.Conic((0, 0, 0), (0, 0, -1), 1.0, conic=-1 / n**2)
    focus = (0, 0, -n / (n - 1))
    heading = unit([(0.02, 0.1, 1), (0.2, -0.1, 1), (0, 0, 1)])
    scene = optics.Scene([GLASS, AIR], [lens])
    bundle = scene.trace(focus, heading, until=optics.Plane((0, 0, 3), (0, 0, 1)))
    np.testing.assert_allclose(bundle.directions, np.tile([0, 0, 1.0], (3, 1)), atol=3e-14)
    np.testing.assert_allclose(bundle.optical_path, bundle.optical_path[2], rtol=1e-14)


@pytest.mark.parametrize(
    "other",
    [
        optics.Asphere((0, 0), (1, 0), 2.0, conic=0.0),
        optics.Implicit(lambda x, y: ca.sqrt((x - 2) ** 2 + y**2) - 2),
        optics.Sphere((2, 0), 2.0),
    ],
    ids=lambda s: type(s).__name__,
)
def test_one_sphere_in_four_ways(other):
    height = np.linspace(-1.5, 1.5, 7)
    start = np.column_stack([0 * height - 3, height])
    ends = [
        optics.Scene([AIR, GLASS], [surface]).trace(start, (1, 0), optical_path=6.0, with_spreading=True)
        for surface in (optics.Conic((0, 0), (1, 0), 2.0), other)
    ]
    np.testing.assert_allclose(ends[1].points, ends[0].points, atol=4e-15)
    np.testing.assert_allclose(ends[1].spreading, ends[0].spreading, rtol=1e-13)
    sag = 2 - np.sqrt(4 - height**2)
    bend = np.arcsin(height / 2) - np.arcsin(height / 3)
    path = (6 - 3 - sag) / 1.5
    exact = np.column_stack([sag + path * np.cos(bend), height - path * np.sin(bend)])
    np.testing.assert_allclose(ends[0].points, exact, atol=4e-15)


def test_the_first_rainbow_turns_back_at_its_least_deviation():
    """One reflection inside a drop: the deviation is stationary at cos² i = (n² - 1)/3 (Descartes, 1637)."""
    n = 4 / 3
    i = np.arccos(np.sqrt((n**2 - 1) / 3))
    drop = optics.Sphere((0, 0), 1.0)
    scene = optics.Scene([AIR, WATER, AIR], [drop, optics.Sphere((0, 0), 1.0, mirror=True), drop])
    heights = np.sin(i) + np.array([-0.01, 0.0, 0.01])
    bundle = scene.trace(np.column_stack([0 * heights - 2, heights]), (1, 0), optical_path=12.0)
    assert np.all(bundle.arrived)
    turn = np.degrees(np.arctan2(bundle.directions[:, 1], bundle.directions[:, 0])) % 360
    deviation = np.minimum(turn, 360 - turn)
    assert deviation[1] == pytest.approx(np.degrees(np.pi + 2 * i - 4 * np.arcsin(np.sin(i) / n)), abs=1e-12)
    assert deviation[1] < min(deviation[0], deviation[2])


def test_rays_in_another_order_and_rays_that_miss():
    lens = [optics.Sphere((0, 0), 1.0), optics.Plane((3, 0), (1, 0))]
    scene = optics.Scene([AIR, GLASS, WATER], lens)
    bundle = scene.trace(
        [(-2, 0.0), (-2, 2.0), (-2, 0.5)], [(1, 0), (1, 0), (-1, 0)], until=optics.Plane((5, 0), (1, 0))
    )
    assert list(bundle.status) == [RayStatus.OUT_OF_ORDER, RayStatus.OUT_OF_ORDER, RayStatus.MISSED]


def test_spreading_of_a_uniform_medium_is_the_inverse_square_law():
    bundle = optics.Scene(GLASS).trace((1, 2, 3), [(1, 0, 2), (0, 1, 0)], optical_path=[3.0, 6.0], with_spreading=True)
    np.testing.assert_allclose(bundle.spreading, [4.0, 16.0], rtol=1e-15)


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: optics.Uniform(-1), ValueError, "positive index"),
        (lambda: optics.Uniform("glass"), TypeError, "must be a number"),
        (lambda: optics.Plane((0, 0), (0, 0)), ValueError, "normal has length zero"),
        (lambda: optics.Plane((0, 0), (0, 0, 1)), ValueError, "point has 2 coordinates and normal 3"),
        (lambda: optics.Sphere((0, 0), -1), ValueError, "radius must be a positive"),
        (lambda: optics.Conic((0, 0), (1, 0), 0), ValueError, "other than zero"),
        (lambda: optics.Scene([AIR, GLASS]), ValueError, "so that 0 surfaces need 1 medium; there are 2"),
        (lambda: optics.Scene([1.0]), TypeError, "media must hold"),
        (
            lambda: optics.Scene([AIR, GLASS], [optics.Plane((0, 0), (0, 1), mirror=True)]),
            ValueError,
            "surface 0 is a mirror",
        ),
        (lambda: optics.Scene(AIR).trace((0, 0), (0, 0), optical_path=1), ValueError, "length zero"),
        (lambda: optics.Scene(AIR).trace((0, 0), (0, 1)), ValueError, "give optical_path=, until=, or both"),
        (lambda: optics.Scene(AIR).trace((0, 0), (0, 1), optical_path=-1), ValueError, "must not be negative"),
        (lambda: optics.Scene(AIR).trace((0, 0), (0, 0, 1), optical_path=1), ValueError, "2 coordinates here, not 3"),
        (lambda: optics.Scene(AIR).trace((0, np.nan), (0, 1), optical_path=1), ValueError, "must be finite"),
        (
            lambda: optics.Scene([AIR, GLASS], [optics.Plane((0, 0), (0, 1))]).trace((3, 0), (0, 1), optical_path=1),
            ValueError,
            "lies on surface 0",
        ),
        (
            lambda: optics.Scene(optics.Stratified(lambda y: 1 - y)).trace((0, 2), (0, 1), optical_path=1),
            ValueError,
            "index is -1 at the source",
        ),
        (
            lambda: optics.Scene(optics.luneburg()).trace((0, 2), (0, 1), optical_path=1),
            ValueError,
            "index is nan at the source",
        ),
    ],
)
def test_bad_scenes_are_refused_with_a_sentence(call, error, message):
    with pytest.raises(error, match=message):
        call()


def test_the_axial_ray_of_a_cartesian_oval_goes_to_the_focus_like_the_others():
    # |r - F| + 1.5 |r - G| is the same on the oval, whose vertex is the origin: every ray from F comes to G
    far, near = np.array([-2.0, 0.0]), np.array([1.5, 0.0])

    def oval(x, y):
        from_far, from_near = (ca.sqrt((x - f[0]) ** 2 + (y - f[1]) ** 2) for f in (far, near))
        return from_far + 1.5 * from_near - 4.25

    scene = optics.Scene([optics.Uniform(1.0), optics.Uniform(1.5)], optics.Implicit(oval))
    angles = np.array([-0.1, 0.0, 1e-9, 0.1])
    bundle = scene.trace(far, np.column_stack([np.cos(angles), np.sin(angles)]), optical_path=4.25)
    assert np.all(bundle.status == optics.RayStatus.ARRIVED)
    np.testing.assert_allclose(bundle.points, np.tile(near, (4, 1)), atol=1e-14)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("wave", [1.0, 30.0, 1000.0])
def test_a_ray_just_below_a_crest_of_a_surface_meets_it(dimension, wave):
    # a ray along x at the height 1 - d meets cos(k (x - 50)) where its angle is arccos(1 - d) before that of a crest
    depth = np.array([10.0**-k for k in range(13)])
    scene = optics.Scene(AIR)
    crests = optics.Implicit(
        (lambda x, h: h - ca.cos(wave * (x - 50)))
        if dimension == 2
        else (lambda x, y, h: h - ca.cos(wave * (x - 50)) + 0 * y)
    )
    sources = np.zeros((len(depth), dimension))
    sources[:, 0], sources[:, -1] = 50 - 2.5 / wave, 1 - depth
    bundle = scene.trace(sources, np.eye(dimension)[0], until=crests)
    met = -2 * np.arcsin(np.sqrt(depth / 2))
    steepness = np.sin(-met)  # the height is round-off at 1e-16
    off = np.abs(wave * (bundle.points[:, 0] - 50) - met)
    np.testing.assert_array_less(off, 1e-12 + 1e-13 * wave + 4e-16 / steepness)
    over = scene.trace(sources[0] + (1e-9 + depth[0]) * np.eye(dimension)[-1], np.eye(dimension)[0], until=crests)
    assert over.status == RayStatus.MISSED


def test_all_rays_into_a_bowl_that_ends_meet_it():
    # beyond a rim the level is no number: what is known of its slope inside tells nothing of a stretch that leads there
    down = np.random.default_rng(3).normal(size=(400, 3)) * (1, 1, -1)
    down[:, 2] = -np.abs(down[:, 2])
    bowl = optics.Asphere((0, 0, 0), (0, 0, 1), 5.0, 0.3, (1e-3,))
    bundle = optics.Scene(AIR).trace((0, 0, 2), down, until=bowl)
    assert np.all(bundle.status == RayStatus.ARRIVED)
    squared = np.sum(bundle.points[:, :2] ** 2, axis=1)
    sag = squared / 5 / (1 + np.sqrt(1 - 1.3 * squared / 25)) + 1e-3 * squared**2
    np.testing.assert_allclose(bundle.points[:, 2], sag, rtol=0, atol=4e-15)
