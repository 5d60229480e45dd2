"""The campaign of all rays between random pairs, in little."""

import numpy as np
import pytest

from arrivals import tally
from campaigns.arrival_pairs import Drawn, Layers, layered_receivers, linear_pair, linear_scene
from varcalc import optics


def test_no_ray_is_missed_and_none_is_false_where_rays_are_parabolas():
    rng = np.random.default_rng(11)
    pairs = [linear_pair(rng, near=number % 2 == 0) for number in range(60)]
    answers = linear_scene().arrivals([d.source for d in pairs], [d.receiver for d in pairs])
    found = tally("", pairs, answers, 0.0)
    assert (found.missed, found.false, found.beyond) == (0, 0, 0)
    assert found.near >= 25
    assert found.rays >= 40


def test_no_ray_is_missed_and_none_is_false_through_layers():
    rng = np.random.default_rng(12)
    layers = Layers()
    receivers = layered_receivers(rng, layers, 150)
    answers = layers.scene().arrivals(receivers[0].source, [d.receiver for d in receivers], within=40.0)
    found = tally("", receivers, answers, 0.0)
    assert (found.missed, found.false, found.beyond) == (0, 0, 0)
    assert found.near >= 30
    assert found.rays >= 100


def test_exhaustion_agrees_with_the_closed_form_where_only_the_last_layer_bends():
    """Above, n² of the last layer everywhere: the parabola from the source itself."""
    layers = Layers(top=np.sqrt(1.69), middle=1.69, gain=1e-9, bottom=1.69, fall=0.6)
    [drawn] = layered_receivers(np.random.default_rng(3), layers, 1)
    assert all(path > 0 for path in drawn.paths)
    kappa, depth = np.array([0.9]), -1.5
    for back in (False, True):
        x, path = layers.arrival(kappa, depth, back)
        down, last = np.sqrt(1.69 - 0.81), np.sqrt(1.69 - 0.6 - 0.81)
        sigma = 1.6 / down + (down + last * (1 if back else -1)) / 0.6
        assert x[0] == pytest.approx(0.9 * sigma, rel=1e-6)
        assert path[0] == pytest.approx(
            1.69 * 1.6 / down + 0.81 * (sigma - 1.6 / down) + (down**3 + last**3 * (1 if back else -1)) / 1.8, rel=1e-6
        )


def test_a_lost_and_an_invented_ray_are_counted():
    scene = linear_scene()
    there, dark = scene.rays((0, 0), (0.5, 0)), scene.rays((0, 0), (1.1, 0))
    paths = tuple(ray.optical_path for ray in there)
    drawn = [Drawn((0, 0), (0.5, 0), (*paths, 9.0), np.inf), Drawn((0, 0), (0.5, 0), paths[:1], np.inf)]
    found = tally("", drawn, [there, there], 0.0)
    assert (found.missed, found.false) == (1, 1)
    wrong = Drawn((0, 0), (0.5, 0), (paths[0] + 1e-9, paths[1]), np.inf)
    assert tally("", [wrong], [there], 0.0).beyond == 1
    assert isinstance(dark, optics.Rays)
