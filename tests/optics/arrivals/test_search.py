"""Which search finds the rays of a pair, against closed forms evaluated here."""

import casadi as ca
import numpy as np
import pytest

from varcalc import optics

FISH_EYE = optics.Scene(optics.fish_eye())


def on_the_sphere(point):
    """Maxwell's fish-eye 2 / (1 + r²) is the stereographic picture of the unit sphere."""
    point = np.asarray(point)
    squared = point @ point
    return np.append(2 * point, squared - 1) / (1 + squared)


def both_ways_round(a, b, within):
    """The lengths of all arcs of the great circle through two points, over any number of turns."""
    first, last = on_the_sphere(a), on_the_sphere(b)
    angle = np.arctan2(np.linalg.norm(np.cross(first, last)), first @ last)
    turns = 2 * np.pi * np.arange(40)
    arcs = np.sort(np.concatenate([turns + angle, turns + 2 * np.pi - angle]))
    return arcs[arcs <= within]


@pytest.mark.parametrize("seed", range(6))
def test_every_arc_of_a_fish_eye_is_found_however_far_out_it_leads(seed):
    a, b = np.random.default_rng(seed).uniform(-0.7, 0.7, (2, 2))
    rays = FISH_EYE.rays(a, b, within=20.0)
    exact = both_ways_round(a, b, 20.0)
    assert (rays.unresolved, rays.continuum) == (0, False)
    np.testing.assert_allclose([ray.optical_path for ray in rays], exact, rtol=1e-11)
    for ray, length in zip(rays, exact, strict=True):
        assert abs(ray.optical_path - length) <= ray.error + 1e-12 * length


def test_without_a_range_nothing_is_left_unresolved():
    rays = FISH_EYE.rays((0.3, 0.1), (0.5, -0.2))
    within = float(rays.searched.rpartition(" ")[2])
    assert rays.unresolved == 0
    assert len(rays) == len(both_ways_round((0.3, 0.1), (0.5, -0.2), within))


def test_the_image_in_a_fish_eye_has_one_continuum_for_each_turn():
    source = np.array([0.6, 0.3])
    rays = FISH_EYE.rays(source, -source / (source @ source), within=10 * np.pi)
    assert rays.continuum
    assert rays.unresolved == 0
    np.testing.assert_allclose([ray.optical_path for ray in rays], np.pi * np.arange(1, 10, 2), rtol=1e-11)


def test_six_turns_about_a_centre():
    a, b = (1.2, 0), (0, 0.7)
    rays = FISH_EYE.rays(a, b, within=12 * np.pi)
    np.testing.assert_allclose([r.optical_path for r in rays], both_ways_round(a, b, 12 * np.pi), rtol=1e-11)


def test_a_layer_that_brings_all_rays_together_again():
    """n = sech y is Mercator's picture of the sphere: the fish-eye's arcs, x being the longitude."""
    scene = optics.Scene(optics.Stratified(lambda y: 1 / ca.cosh(y)))
    (x, y0), y1 = (1.3, 0.2), -0.4
    exact = np.arccos(np.tanh(y0) * np.tanh(y1) + np.cos(x) / np.cosh(y0) / np.cosh(y1))
    [ray] = scene.rays((0, y0), (x, y1), within=3.0)
    assert ray.optical_path == pytest.approx(exact, rel=1e-12)
    image = scene.rays((0, y0), (np.pi, -y0), within=4.0)
    assert image.continuum
    assert [ray.optical_path for ray in image] == pytest.approx([np.pi], rel=1e-12)


def test_level_rays_of_a_centre_stay_level():
    rays = FISH_EYE.rays((1, 0), (0, 1), within=6.0)
    np.testing.assert_allclose([ray.optical_path for ray in rays], [np.pi / 2, 3 * np.pi / 2], rtol=1e-12)


def test_a_ray_that_starts_level_does_not_jump_back_to_its_source():
    a, b = (1.1, 0), (0, 1.1)
    rays = FISH_EYE.rays(a, b, within=14.0)
    np.testing.assert_allclose([ray.optical_path for ray in rays], both_ways_round(a, b, 14.0), rtol=1e-11)


def test_the_centre_of_the_index_is_left_to_the_fan():
    [ray, *_] = FISH_EYE.rays((0, 0), (0.5, 0.5), within=3.0)
    assert ray.optical_path == pytest.approx(2 * np.arctan(np.sqrt(0.5)), rel=1e-12)


def test_rays_that_go_a_thousand_times_as_far_out_come_back_with_all_digits():
    """Points all but opposite of the centre: the circle through both is all but a straight line."""
    a, b = (-0.0127, 0.0651), (0.0094, 0.0374)
    rays = FISH_EYE.rays(a, b, within=6 * np.pi)
    exact = both_ways_round(a, b, 6 * np.pi)
    assert rays.unresolved == 0
    assert len(rays) == len(exact)
    for ray, length in zip(rays, exact, strict=True):
        assert abs(ray.optical_path - length) <= ray.error <= 1e-11 * length
