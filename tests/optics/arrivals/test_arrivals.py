"""The rays of a pair of points are the same however many pairs are asked for in one call."""

import casadi as ca
import numpy as np
import pytest

from varcalc import optics


def drawn(low, high, count=40, seed=0):
    return np.random.default_rng(seed).uniform(low, high, (count, 2))


EATON = optics.Scene(optics.eaton()), (-0.5, 0.6), np.vstack([[0.4, 0.5], drawn(-0.6, 0.6, 39)]), None
FISH_EYE = optics.Scene(optics.fish_eye()), (0.6, 0.1), drawn(-0.5, 0.5), 2.5
LUNEBURG = optics.Scene(optics.luneburg()), (-0.4, 0.3), drawn(-0.6, 0.6), None
CHANNEL = optics.Scene(optics.munk_profile()), (0.0, -1000.0), drawn((2e4, -3000.0), (4e4, -300.0)), None
LAYER = optics.Scene(optics.Stratified(lambda y: ca.sqrt(1 - 2 * y)))
LINEAR = LAYER, (0.1, -0.2), drawn((-0.9, -1.0), (0.9, 0.05)), None


@pytest.mark.parametrize(
    ("scene", "source", "receivers", "within"),
    [EATON, FISH_EYE, LUNEBURG, CHANNEL, LINEAR],
    ids=["eaton", "fish-eye", "luneburg", "channel", "linear"],
)
def test_arrivals_are_the_rays_of_each_pair_however_many_are_asked_for(scene, source, receivers, within):
    alone = [scene.rays(source, receiver, within=within) for receiver in receivers[:2]]
    assert any(len(rays) > 0 for rays in alone)
    for count in (1, 5):
        same(alone, scene.arrivals(source, receivers[:count], within=within))


def test_receivers_at_the_same_height_share_what_is_found_and_none_is_answered_otherwise():
    """Half of the rays of a fish-eye go out of any circle and come back within one turn."""
    scene, source, receivers = FISH_EYE[0], (0.19, -0.32), drawn(-0.7, 0.7, 3)[1:]
    receivers = np.vstack([receivers, receivers @ [[0.6, 0.8], [-0.8, 0.6]], receivers[:, ::-1]])
    alone = [scene.rays(source, receiver, within=8.0) for receiver in receivers]
    same(alone, scene.arrivals(source, receivers, within=8.0))


def test_every_arc_between_points_of_a_fish_eye_with_no_end_in_common():
    """Rays are great circles of a sphere, either way round (Luneburg, "Mathematical Theory of Optics", sect. 28).

    Those past its pole go far out, where the spreading has fewer digits.
    """
    a, b = drawn((-1.2, -1.2), (1.2, 1.2), 60, 5), drawn((-1.2, -1.2), (1.2, 1.2), 60, 6)
    first, last = (
        np.column_stack([2 * p, np.sum(p**2, axis=1) - 1]) / (1 + np.sum(p**2, axis=1))[:, None] for p in (a, b)
    )
    arc = 2 * np.arcsin(np.linalg.norm(first - last, axis=1) / 2)
    for number, rays in enumerate(FISH_EYE[0].arrivals(a, b, within=2 * np.pi)):
        paths = np.array([arc[number], 2 * np.pi - arc[number]])
        np.testing.assert_allclose([ray.optical_path for ray in rays], paths, rtol=1e-12)
        assert [ray.index for ray in rays] == [0, 1]
        index_at_end = 2 / (1 + b[number] @ b[number])
        np.testing.assert_allclose([ray.spreading for ray in rays], np.sin(arc[number]) / index_at_end, rtol=1e-7)
        assert rays.unresolved == 0


@pytest.mark.parametrize(
    "channel", [CHANNEL[0], optics.Scene(optics.Stratified(lambda y: 1 + 1e-4 * ca.exp(-(y**2) / 1e6)))]
)
def test_pairs_with_no_end_in_common_are_answered_as_each_is_alone(channel):
    """What all pairs share is made anew, whatever was asked before and however much of it."""
    sources, receivers = drawn((0.0, -2500.0), (1e3, -200.0), 40, 1), drawn((2e4, -2500.0), (6e4, -200.0), 40, 2)
    together = channel.arrivals(sources, receivers)
    alone = [channel.rays(*pair) for pair in zip(sources[:4], receivers[:4], strict=True)]
    fresh = optics.Scene(channel.media[0])
    same(alone, together)
    same([fresh.rays(*pair) for pair in zip(sources[:4], receivers[:4], strict=True)], together)
    same(channel.arrivals(sources[30:], receivers[30:]), together[30:])


def test_pairs_about_a_pointed_centre_are_answered_as_each_is_alone():
    """What all pairs share reaches closer to the centre of n = 1/(1 + r) than what one pair needs.

    With v = c (1 + 1/r) rays turn by dφ = dv/√(1 - v²) + c dv/((v - c) √(1 - v²)), which is elementary.
    """
    scene = optics.Scene(optics.Radial(lambda r: 1 / (1 + r)))
    sources, receivers = drawn((-2.0, -2.0), (2.0, 2.0), 30, 3), drawn((-2.0, -2.0), (2.0, 2.0), 30, 4)
    together = scene.arrivals(sources, receivers)
    assert not any(rays.unresolved for rays in together)
    same([scene.rays(*pair) for pair in zip(sources[:4], receivers[:4], strict=True)], together)
    for a, b, rays in zip(sources, receivers, together, strict=True):
        ray, turn = rays[0], np.arccos(a @ b / np.linalg.norm(a) / np.linalg.norm(b))
        r = np.linalg.norm([a, b], axis=1)
        c = abs(a @ (ray.tangents[0][::-1] * (1, -1))) / (1 + r[0])
        first, last = _turned(c * (1 + 1 / r), c)
        turns = a @ ray.tangents[0] < 0 < b @ ray.tangents[1]
        came = 2 * _turned(1.0, c) - first - last if turns else abs(first - last)
        assert came == pytest.approx(turn, abs=1e-7)


def _turned(v, c):
    """How far a ray of n = 1/(1 + r) with the invariant c has turned where c (1 + 1/r) = v, but for a constant."""
    root = np.sqrt((1 - c**2) * (1 - v**2))
    return np.arcsin(v) - c / np.sqrt(1 - c**2) * np.log((1 - c * v + root) / (v - c))


def same(alone, together):
    for one, other in zip(alone, together, strict=False):
        assert (one.unresolved, other.unresolved) == (0, 0)
        assert [ray.index for ray in one] == [ray.index for ray in other]
        paths = [[ray.optical_path for ray in rays] for rays in (one, other)]
        np.testing.assert_allclose(*paths, rtol=1e-11)
