"""Zeros by series that stand for functions: all of them, touching ones, and none beyond what series know."""

import numpy as np
import pytest

from varcalc.numerics.proxies import proxies, zeros


class Known:
    """sin 40s, cos 3s and log s, to all digits, and as another family all of them at s + 1."""

    def scale(self, family):
        return np.full((len(family), 3), 1e-3)

    def __call__(self, family, at, enough=0.0):
        at = at + family
        return np.column_stack([np.sin(40 * at), np.cos(3 * at), np.log(at)])

    def sampled(self, family, at, enough):
        return self(np.repeat(family, at.shape[1]), at.ravel()).reshape(*at.shape, 3)

    def noise(self, family, at):
        return np.zeros((len(at), 3))

    def inside(self, at, way):
        return at

    def beyond(self, family, values):
        return np.zeros((len(values), 3), dtype=bool)


EDGES = np.linspace(1e-3, 1, 5)
SERIES = proxies(Known(), np.zeros(4, dtype=int), EDGES[:-1], EDGES[1:])


def found(weights, offset):
    panels = np.arange(len(SERIES.low))
    return zeros(
        SERIES,
        panels,
        np.tile(np.array(weights, float), (len(panels), 1)),
        np.full(len(panels), offset),
        np.full(len(panels), 2e-13),
    )


def test_a_function_is_replaced_by_few_series():
    assert np.all(SERIES.given_up == 0)
    assert len(SERIES.low) < 60


@pytest.mark.parametrize("offset", [0.3, -0.7, 1 - 1e-9])
def test_every_zero_is_found(offset):
    # sin 40s = offset at asin(offset) + 2 pi k and pi - asin(offset) + 2 pi k, over 40
    turns = 2 * np.pi * np.arange(8)[:, None]
    exact = (np.array([np.arcsin(offset), np.pi - np.arcsin(offset)]) + turns).ravel() / 40
    exact = np.sort(exact[(exact > 1e-3) & (exact < 1)])
    np.testing.assert_allclose(np.sort(found([1, 0, 0], offset).at), exact, rtol=0, atol=1e-9)


def test_a_turn_at_zero_touches_and_one_beyond_it_is_no_zero():
    touching = found([1, 0, 0], 1.0)
    # an edge of a panel beside a turn may show it once more
    assert len(np.unique(np.round(touching.at, 6))) == np.count_nonzero(touching.touching) == 7
    assert len(found([1, 0, 0], 1 + 1e-9).at) == 0


def test_combinations_share_the_series():
    for weights, offset in (([1, 0.5, 0], 0.2), ([0, 0, 1], -5), ([0.1, 1, 0.3], 0.4)):
        at = found(weights, offset).at
        dense = np.linspace(1e-3, 1, 200_001)
        signs = np.sign(Known()(np.zeros(len(dense)), dense) @ np.array(weights, float) - offset)
        assert len(at) == np.count_nonzero(np.diff(signs))
        np.testing.assert_allclose(Known()(np.zeros(len(at)), at) @ np.array(weights, float), offset, atol=1e-12)


def test_families_have_zeros_of_their_own():
    edges = np.tile(EDGES, 2).reshape(2, -1)
    series = proxies(Known(), np.repeat([0, 1], 4), edges[:, :-1].ravel(), edges[:, 1:].ravel())
    panels = np.arange(len(series.low))
    weights = np.tile([1.0, 0.0, 0.0], (len(panels), 1))
    got = zeros(series, panels, weights, np.zeros(len(panels)), np.full(len(panels), 2e-13))
    own = series.family[panels[got.which]]
    for family, first in ((0, 1), (1, 13)):  # sin 40 (s + family) vanishes at k pi / 40 - family
        exact = np.arange(first, 1 + int((1 + family) * 40 / np.pi)) * np.pi / 40 - family
        np.testing.assert_allclose(np.sort(got.at[own == family]), exact, rtol=0, atol=1e-12)


class Noisy(Known):
    """The same with noise of several units in the last place, and the places that are asked for one by one."""

    asked = 0

    def __call__(self, family, at, enough=0.0):
        self.asked += len(at)
        return super().__call__(family, at, enough) + 2e-14 * np.sin(1e16 * at)[:, None]


def test_what_is_found_is_not_asked_for_again_with_what_is_not():
    functions = Noisy()
    series = proxies(functions, np.zeros(40, dtype=int), np.linspace(0.1, 1, 41)[:-1], np.linspace(0.1, 1, 41)[1:])
    panels, functions.asked = np.arange(len(series.low)), 0
    offsets = np.repeat(np.linspace(-0.9, 0.9, 50), len(panels))
    panel = np.tile(panels, 50)
    got = zeros(series, panel, np.tile([1.0, 0.0, 0.0], (len(panel), 1)), offsets, np.full(len(panel), 2e-13))
    exact = sum(
        np.count_nonzero(np.diff(np.sign(np.sin(40 * np.linspace(0.1, 1, 100_001)) - o)))
        for o in offsets[:: len(panels)]
    )
    assert len(got.at) == exact > 500
    np.testing.assert_allclose(np.sin(40 * got.at), offsets[got.which], rtol=0, atol=1e-12)
    assert functions.asked < 12 * len(got.at)


class AskedInPart(Known):
    """The same, of which nobody asks for what is where the logarithm is less than that of 0.4."""

    def beyond(self, family, values):
        return np.repeat(np.all(values[..., 2] < np.log(0.4), axis=1)[:, None], 3, axis=1)


def test_panels_in_which_nobody_asks_for_anything_are_left_out():
    edges = np.arange(1, 6) / 5
    series = proxies(AskedInPart(), np.zeros(4, dtype=int), edges[:-1], edges[1:])
    assert series.low.min() == 0.4
    assert np.isfinite(series.coefficients).all()
    assert series.looked_at[0] > 0


class Bow:
    """sin of s, which turns at π/2."""

    def scale(self, family):
        return np.ones((len(family), 1))

    def __call__(self, family, at, enough=0.0):
        return np.sin(at)[:, None]

    def sampled(self, family, at, enough):
        return np.sin(at)[..., None]

    def noise(self, family, at):
        return np.zeros((len(at), 1))

    def inside(self, at, way):
        return at

    def beyond(self, family, values):
        return np.zeros((len(values), 1), dtype=bool)


@pytest.mark.parametrize("width", [0.1, 0.3, 0.77, 1.3])
@pytest.mark.parametrize("beside", [-1e-9, -1e-15, 0.0, 1e-15, 1e-9])
@pytest.mark.parametrize("short", [-1e-15, 0.0, 1e-15])
def test_a_turn_at_the_edge_of_a_panel_touches_from_either_side(width, beside, short):
    # its sides are no zeros by themselves, which round-off puts 1e-8 from it
    edges = np.pi / 2 + beside + np.array([-width, 0.0, 1.5 * width])
    series = proxies(Bow(), np.zeros(2, dtype=int), edges[:-1], edges[1:])
    count = len(series.low)
    own = zeros(series, np.arange(count), np.ones((count, 1)), np.full(count, 1.0 + short), np.full(count, 2e-13))
    assert len(own.at) >= 1
    assert np.all(own.touching)
    np.testing.assert_allclose(own.at, np.pi / 2, rtol=0, atol=2e-9)
