"""The cases of ray optics, asked of scenes: total reflection, shadows, images of points."""

import math

import casadi as ca
import mpmath as mp
import numpy as np
import pytest

from varcalc import optics


def test_total_reflection_begins_at_the_critical_angle():
    critical = float(mp.degrees(mp.asin(1 / mp.mpf("1.5"))))
    glass = optics.Scene([optics.Uniform(1.5), optics.Uniform(1.0)], [optics.Plane((0, 0), (0, 1))])
    angles = np.radians([critical - 1e-9, critical + 1e-9])
    bundle = glass.trace((0, -1), np.column_stack([np.sin(angles), np.cos(angles)]), optical_path=5.0)
    assert list(bundle.status) == [optics.RayStatus.ARRIVED, optics.RayStatus.TOTAL_REFLECTION]


def test_a_fish_eye_images_a_point_on_its_antipode():
    scene = optics.Scene(optics.fish_eye())  # n = 2/(1 + r^2)
    source = np.array([0.6, 0.3])
    rays = scene.rays(source, -source / (source @ source))
    assert rays.continuum
    assert rays[0].degenerate
    assert rays[0].optical_path == pytest.approx(math.pi, abs=1e-12)


def test_a_luneburg_lens_from_rim_to_rim():
    # a plane wave at height h goes n ds = pi/2 + cos(asin h) inside; the ray through the centre pi/2 + 1
    [ray] = optics.Scene(optics.luneburg()).rays((-1.0, 0.0), (1.0, 0.0), within=3.0)  # after pi all come there
    assert (ray.index, ray.tangents[0]) == (0, pytest.approx([1.0, 0.0], abs=1e-12))
    assert ray.optical_path == pytest.approx(1 + math.pi / 2, abs=1e-12)


@pytest.mark.parametrize(("reach", "count"), [(0.999, 2), (1 + 1e-6, 0), (1.5, 0)])
def test_two_rays_or_none_where_the_squared_index_falls(reach, count):
    rays = optics.Scene(optics.Stratified(lambda y: ca.sqrt(1 - 2 * y))).rays((0, 0), (reach, 0))
    assert [ray.index for ray in rays] == [0, 1][:count]
    assert bool(rays.reason) == (count == 0)
    if count:
        angles = [mp.asin(reach) / 2, mp.pi / 2 - mp.asin(reach) / 2]
        # sigma = 2 sin(angle): S = sigma - sin(angle) sigma^2 + sigma^3/3
        paths = [2 * mp.sin(a) - 4 * mp.sin(a) ** 3 + 8 * mp.sin(a) ** 3 / 3 for a in angles]
        assert [ray.optical_path for ray in rays] == pytest.approx([float(p) for p in paths], abs=1e-12)
