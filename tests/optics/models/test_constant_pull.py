"""All rays where ∇n² is constant, in any direction and dimension, against the angles at which a stone is thrown."""

import math

import casadi as ca
import numpy as np
import pytest

from varcalc import optics


def elevations(speed, pull, ahead, above):
    """Angles at which a stone of that speed hits a point so far ahead and above (Goldstein et al., ch. 1)."""
    inside = speed**4 - pull * (pull * ahead**2 + 2 * above * speed**2)
    if inside < 0:
        return []
    return sorted(math.atan2(speed**2 + sign * math.sqrt(inside), pull * ahead) for sign in (1, -1))


@pytest.mark.parametrize("dimension", [2, 3])
def test_every_pair_has_the_two_throws_or_none(dimension):
    rng = np.random.default_rng(dimension)
    gradient = rng.normal(size=dimension)  # of n²: the pull is half of it
    index = lambda *r: ca.sqrt(4 + sum(g * x for g, x in zip(gradient.tolist(), r, strict=False)))  # noqa: E731
    scene = optics.Scene(optics.Graded(index))
    sources, receivers = rng.uniform(-0.3, 0.3, (2, 60, dimension))
    receivers = sources + (receivers - sources) * 10.0 ** rng.uniform(-1, 2.2, (60, 1))
    keep = 4 + receivers @ gradient > 0.05
    sources, receivers = sources[keep], receivers[keep]
    down, pull = gradient / np.linalg.norm(gradient), np.linalg.norm(gradient) / 2
    counts = set()
    for a, b, rays in zip(sources, receivers, scene.arrivals(sources, receivers, within=1e6), strict=True):
        above = float((a - b) @ down)
        level = (b - a) + above * down
        speed = math.sqrt(4 + a @ gradient)
        exact = elevations(speed, pull, float(np.linalg.norm(level)), above)
        found = sorted(
            math.atan2(-ray.tangents[0] @ down, ray.tangents[0] @ level / np.linalg.norm(level)) for ray in rays
        )
        assert found == pytest.approx(exact, abs=1e-9)
        assert rays.unresolved == 0
        counts.add(len(found))
    assert counts == {0, 2}


def test_a_point_on_the_caustic_has_one_ray_that_touches_it():
    # n² = 1 - 2y from the origin: the envelope of the throws is y = 1/2 - x²/2
    (ray,) = optics.Scene(optics.Stratified(lambda y: ca.sqrt(1 - 2 * y))).rays((0, 0), (0.8, 0.5 - 0.32))
    assert ray.degenerate
    # there σ² is twice the distance of the points, and the path ∫(1 - 2y) dσ with y = tσ - σ²/2
    sigma = math.sqrt(2 * math.hypot(0.8, 0.18))
    climb = (0.18 + sigma**2 / 2) / sigma
    assert ray.optical_path == pytest.approx(sigma - climb * sigma**2 + sigma**3 / 3, rel=1e-12)


def test_no_ray_longer_than_is_asked_for():
    scene = optics.Scene(optics.Stratified(lambda y: ca.sqrt(1 - 2 * y)))
    low, high = scene.rays((0, 0), (0.5, 0.1))
    rays = scene.rays((0, 0), (0.5, 0.1), within=(low.optical_path + high.optical_path) / 2)
    assert [ray.optical_path for ray in rays] == [low.optical_path]


@pytest.mark.parametrize("medium", [optics.Uniform(1.4), optics.Radial(lambda r: 1.4 + 0 * r)])
@pytest.mark.parametrize("dimension", [2, 3])
def test_in_a_uniform_medium_the_straight_line_is_all_there_is(medium, dimension):
    sources, receivers = np.random.default_rng(8).normal(size=(2, 20, dimension))
    away = np.linalg.norm(receivers - sources, axis=1)
    answers = optics.Scene(medium).arrivals(sources, receivers, within=2.8)
    for way, far, rays in zip(receivers - sources, away, answers, strict=True):
        assert rays.searched.startswith("the straight line")
        assert len(rays) == (1.4 * far <= 2.8)
        for ray in rays:
            assert ray.optical_path == pytest.approx(1.4 * far, rel=1e-15)
            np.testing.assert_allclose(ray.tangents, [way / far] * 2, rtol=0, atol=1e-15)
            assert (ray.index, ray.degenerate) == (0, False)
            assert ray.spreading == pytest.approx(far ** (dimension - 1), rel=1e-14)
    assert {len(rays) for rays in answers} == {0, 1}
