"""Scenes in space whose rays lie in planes: shells about a centre and layers, searched in the plane of both points."""

import numpy as np
import pytest
from scipy.optimize import brentq

from varcalc import optics

AIR, GLASS = optics.Uniform(1.0), optics.Uniform(1.5)
BALL = optics.Scene([AIR, GLASS, AIR], [optics.Sphere((0, 0, 0), 1.0)] * 2)
FLAT = optics.Scene([AIR, GLASS, AIR], [optics.Sphere((0, 0), 1.0)] * 2)


def zeros(function, places):
    at = np.flatnonzero(np.diff(np.sign(function(places))))
    return [brentq(function, places[k], places[k + 1], xtol=1e-15) for k in at]


def through_ball(away, i):
    """Tangent angles and paths of a ray that meets a ball of glass at the angle ``i``, from so far from its centre.

    Returned are the angle at the source, the angle with the axis behind the ball, and the path up to there.
    """
    inside = np.arcsin(np.sin(i) / 1.5)
    start = np.arcsin(np.sin(i) / away)
    return start, 2 * (i - inside) - start, away * np.cos(start) - np.cos(i) + 3 * np.cos(inside)


@pytest.mark.parametrize("seed", range(4))
def test_all_rays_in_a_mirror_ball(seed):
    """Alhazen's problem: paths by a point of the great circle are stationary, two or four times."""
    a, b = np.random.default_rng(seed).uniform(-0.55, 0.55, (2, 3))
    first = a / np.linalg.norm(a)
    second = b - (b @ first) * first
    second /= np.linalg.norm(second)

    def point(t):
        return np.multiply.outer(np.cos(t), first) + np.multiply.outer(np.sin(t), second)

    def path(t):
        return np.linalg.norm(point(t) - a, axis=-1) + np.linalg.norm(point(t) - b, axis=-1)

    def slope(t):
        along = point(t + np.pi / 2)
        return sum(
            np.sum(along * (point(t) - end), axis=-1) / np.linalg.norm(point(t) - end, axis=-1) for end in (a, b)
        )

    exact = sorted(path(t) for t in zeros(slope, np.linspace(0, 2 * np.pi, 4001)))
    rays = optics.Scene([AIR, AIR], [optics.Sphere((0, 0, 0), 1.0, mirror=True)]).rays(a, b)
    assert [ray.optical_path for ray in rays] == pytest.approx(exact, rel=1e-13)
    assert rays.unresolved == 0
    assert "of the plane" in rays.searched


def test_rays_through_a_slab_at_any_heights_in_space():
    scene = optics.Scene([AIR, GLASS, AIR], [optics.Plane((0, 0, h), (0, 0, 1)) for h in (1.0, 0.4)])
    a, b = np.array([0.2, -0.1, 2.0]), np.array([1.7, 0.8, -0.3])
    across = np.linalg.norm((b - a)[:2])

    def short(sine):
        return 1.7 * sine / np.sqrt(1 - sine**2) + 0.6 * sine / np.sqrt(1.5**2 - sine**2) - across

    sine = brentq(short, 0, 1 - 1e-9, xtol=1e-16)
    exact = 1.7 / np.sqrt(1 - sine**2) + 1.5**2 * 0.6 / np.sqrt(1.5**2 - sine**2)
    rays = scene.rays(a, b)
    assert [ray.optical_path for ray in rays] == pytest.approx([exact], rel=1e-14)
    assert rays.unresolved == 0


def test_a_ring_of_rays_through_a_ball_is_one_continuum():
    """From 4 radii the ball images the axis at 2.4 radii; nearer, where rays by its rim cross it, a ring comes in."""

    def behind(i):
        return np.sin(i) / np.sin(through_ball(4.0, i)[1])

    i = brentq(lambda i: behind(i) - 2.0, 0.1, 1.2, xtol=1e-15)
    _, slope, path = through_ball(4.0, i)
    ring = path + 2.0 * np.cos(slope) - np.cos(i)
    axis = np.array([2.0, -1.0, 0.5]) / np.linalg.norm([2.0, -1.0, 0.5])
    rays = BALL.rays(4.0 * axis, -2.0 * axis)
    assert [ray.optical_path for ray in rays] == pytest.approx(sorted([3.0 + 3.0 + 1.0, ring]), rel=1e-12)
    assert rays.continuum


def test_rays_beside_a_focus_on_the_axis_are_no_ring():
    for scene, d in ((BALL, 3), (FLAT, 2)):
        rays = scene.rays((3, 0, 0)[:d], (-3, 0, 0)[:d])
        assert [ray.optical_path for ray in rays] == pytest.approx([7.0], rel=1e-13)
        assert not rays.continuum


@pytest.mark.parametrize("aside", [0.4, 0.7, -0.2])
def test_what_grazes_a_ball_hides_no_other_ray(aside):
    """Beside grazing incidence neighbours as numbers come out far apart: between them there is no ray to elsewhere."""
    away, b = 3.0066592756745814, np.array([-3.0066592756745814, aside])

    def beside(i):
        _, slope, _ = through_ball(away, np.abs(i))
        # it leaves the ball on the other side of where it is aimed, down for rays above the axis
        out = np.abs(i) - slope
        place = np.stack([-np.cos(out), np.sign(i) * np.sin(out)])
        return (b[0] - place[0]) * -np.sin(slope) * np.sign(i) - (b[1] - place[1]) * -np.cos(slope)

    angles = np.linspace(-np.pi / 2, np.pi / 2, 200_000)
    count = np.count_nonzero(np.diff(np.sign(beside(angles))))
    rays = FLAT.rays((away, 0), b)
    assert (len(rays), rays.unresolved) == (count, 0)
