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


def same(alone, together):
    for one, other in zip(alone, together, strict=False):
        assert (one.unresolved, other.unresolved) == (0, 0)
        assert [ray.index for ray in one] == [ray.index for ray in other]
        paths = [[ray.optical_path for ray in rays] for rays in (one, other)]
        np.testing.assert_allclose(*paths, rtol=1e-11)
