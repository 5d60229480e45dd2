"""Passages of rays read from tables, against closed forms; and what tables may not tell is not read from them."""

import itertools

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from varcalc import optics
from varcalc.optics.models.passage_tables import MOST_TABLES, PassageTables, TabledPassages
from varcalc.optics.models.passages import RayPassages
from varcalc.optics.models.reduction import Profile


def tabled(medium, ends, within, probe=0.0):
    passages = RayPassages.between(Profile(medium, 1.0, probe), ends, np.full(len(ends), within))[0]
    return TabledPassages(passages, PassageTables(), at_once=True)


def drawn(rng, passages, count):
    """Angles all over, close to level and close to upright."""
    pair = np.repeat(np.arange(len(passages.start)), count)
    share = rng.uniform(size=len(pair))
    angles = [np.pi / 2 * share, 10 ** (-7 * share), np.pi / 2 - 10 ** (-5.9 * share)]
    return pair, np.choose(rng.integers(0, 3, len(pair)), angles).clip(1e-9, np.pi / 2 - 2e-6)


def fish_eye_passages(passages, pair, angles):
    """By sinh u, which is a sine of τ where g = 1/cosh² u, as in Maxwell's fish-eye: angles and optical paths."""
    low, high = passages.start[pair], passages.end[pair]
    c, w = np.cos(angles) / np.cosh(low), np.sin(angles) / np.cosh(low)
    last = np.sqrt(w**2 + 1 / np.cosh(high) ** 2 - 1 / np.cosh(low) ** 2)
    parts = []
    for share in (c, 1.0):
        start, end = (np.arctan2(share * np.sinh(u), v * np.cosh(u)) for u, v in ((low, w), (high, last)))
        up = np.where(high > low, 1, -1)
        parts += [np.abs(end - start), np.pi / 2 - up * end, np.pi / 2 + up * start]
    return np.column_stack(parts)


def test_passages_about_the_centre_of_a_fish_eye_are_arcs(monkeypatch):
    rng = np.random.default_rng(3)
    read = tabled(optics.fish_eye(), rng.uniform(-1.5, 1.0, (12, 2)), 8.0)
    pair, angles = drawn(rng, read.passages, 200)
    expected = fish_eye_passages(read.passages, pair, angles)

    def integrated(self, pair, angles):
        raise AssertionError(f"{len(pair)} passages were not read from tables")

    monkeypatch.setattr(RayPassages, "at", integrated)
    got = read.at(pair, angles, np.full((len(pair), 6), np.pi))
    np.testing.assert_allclose(got, expected, rtol=0, atol=4e-13 * np.pi)
    assert len(read.tables.made) == 1


def test_other_pairs_of_about_the_same_heights_are_read_from_the_same_tables():
    """Beyond the channel, where n falls to 0 at infinity, how deep rays may come depends on the pairs."""
    rng = np.random.default_rng(7)
    profile, tables = Profile(optics.munk_profile(), 1.0, -1000.0), PassageTables()
    made = []
    for _ in range(2):
        ends = np.concatenate([rng.uniform((-4000, -400), (-3700, -100), (4, 2)), rng.uniform(-3700, -400, (8, 2))])
        read = TabledPassages(RayPassages.between(profile, ends, np.full(12, 2.0**19))[0], tables, at_once=True)
        pair, angles = drawn(rng, read.passages, 20)
        read.at(pair, angles, np.full((len(pair), 6), 1e5))
        made.append(set(tables.made))
    assert made[0] == made[1]
    assert len(made[0]) > 1


def test_pairs_asked_about_one_by_one_are_read_from_the_same_tables_where_their_heights_are_much_the_same():
    tables = PassageTables()
    first = tables.box(-3900.0, -150.0, -9000.0, 0.0)
    assert first[0] <= -3900.0 < -150.0 <= first[1]
    assert tables.box(-3000.0, -700.0, -9000.0, 0.0) == first
    assert tables.box(-3000.0, -700.0, -9000.0, -10.0)[1] <= -10.0  # no higher than is asked
    narrow = tables.box(-1001.0, -1000.0, -9000.0, 0.0)
    assert -1002.0 <= narrow[0] <= -1001.0 < -1000.0 <= narrow[1] <= -999.0
    for place in np.geomspace(1.0, 1e9, 2 * MOST_TABLES):
        tables.box(place, 1.5 * place, -np.inf, np.inf)
    assert len(tables.boxes) <= MOST_TABLES


def test_tables_are_made_once_many_motions_were_asked_about():
    read = tabled(optics.fish_eye(), np.array([[-0.5, 0.4]]), 8.0)
    often = TabledPassages(read.passages, PassageTables())
    angles, scale = np.linspace(0.65, 0.651, 100), np.full((100, 6), np.pi)
    first = often.at(np.zeros(100, dtype=int), angles, scale)
    [table] = often.tables.made.values()
    assert not table.leaves
    second = often.at(np.zeros(100, dtype=int), angles, scale)
    assert table.leaves
    expected = fish_eye_passages(read.passages, np.zeros(100, dtype=int), angles)
    for got in (first, second):
        np.testing.assert_allclose(got, expected, rtol=0, atol=4e-13 * np.pi)


def test_heights_beyond_which_rays_would_come_back_too_late_are_not_looked_at():
    """Deep below the channel n falls as one over the depth, so that the path grows as its logarithm only."""
    medium, within = optics.munk_profile(), 2.0**19
    passages = RayPassages.between(Profile(medium, 1.0, -1000.0), np.array([[-3000.0, -1100.0]]), np.array([within]))[0]

    depths = [-3000.0, *(-np.geomspace(3001, -passages.low[0], 60))]
    there = sum(
        quad(lambda z: float(np.sqrt(passages.profile.at(np.array([z]))[0][0])), b, a)[0]
        for a, b in itertools.pairwise(depths)
    )
    assert within / 2 <= there <= 0.6 * within
    assert passages.mild[0, 1]  # they do not rest there


@pytest.mark.parametrize("strength", [1e-1, 1e-3, 1e-6])
def test_passages_in_a_duct_are_what_is_integrated(strength):
    """Trapped rays and those that pass, up to angles that turn where next to nothing is left of the duct."""
    rng = np.random.default_rng(4)
    medium = optics.Stratified(lambda y: 1 + strength * ca.exp(-(y**2)))
    read = tabled(medium, rng.uniform(-1.5, 1.5, (8, 2)), 256.0)
    pair, angles = drawn(rng, read.passages, 60)
    scale = np.full((len(pair), 6), 50.0)
    got, expected = read.at(pair, angles, scale), read.passages.at(pair, angles)
    assert np.array_equal(np.isnan(got), np.isnan(expected))
    known = np.maximum(read.passages.noise(pair, angles), 1e-13)[:, None]
    off = np.abs(got - expected) / np.fmax(scale, np.abs(expected))
    assert np.nanmax(off / known) < 10.0
    kinds = {table.slopes.kind.__name__ for table in read.tables.made.values()}
    assert kinds == {"TwoTurns", "NoTurn"}


def test_a_narrow_layer_between_samples_of_the_table_is_seen():
    """A wall a hundred thousand times narrower than the channel it stands in: rays turn at it, or go through."""
    medium = optics.Stratified(lambda y: ca.sqrt(2 - y**2 - 0.5 * ca.exp(-(((y - 0.37) / 1e-5) ** 2))))
    ends = np.array([[0.1, -0.3], [0.1, 0.6], [0.5, -0.2]])
    read = tabled(medium, ends, 16.0)
    pair, angles = drawn(np.random.default_rng(5), read.passages, 60)
    got = read.at(pair, angles, np.full((len(pair), 6), 10.0))
    expected = read.passages.at(pair, angles)
    assert np.array_equal(np.isnan(got), np.isnan(expected))
    sound = np.isfinite(expected)
    np.testing.assert_allclose(got[sound], expected[sound], rtol=1e-9, atol=1e-9)


def test_a_kinked_index_has_no_tables():
    read = tabled(optics.Stratified(lambda y: 1.5 - 0.1 * ca.fabs(y)), np.array([[-0.5, 0.4]]), 8.0)
    assert not read.applies
    got = read.at(np.zeros(3, dtype=int), np.array([0.1, 0.5, 1.2]), np.ones((3, 6)))
    np.testing.assert_array_equal(got, read.passages.at(np.zeros(3, dtype=int), np.array([0.1, 0.5, 1.2])))
    assert not read.tables.made


@pytest.mark.parametrize("height", [0.0, 0.25, 0.3])
@pytest.mark.parametrize("width", [1e-3, 1e-5])
def test_a_thin_step_on_the_edge_of_a_panel_is_seen(height, width):
    """Rays through a smooth step are refracted as by a plane, but for its width, wherever in a table it stands."""
    rng = np.random.default_rng(6)
    scene = optics.Scene(optics.Stratified(lambda y: 1.5 + 0.1 * ca.tanh((y - height) / width)))
    below = np.column_stack([np.zeros(12), rng.uniform(-0.5, height - 0.1, 12)])
    above = np.column_stack([rng.uniform(0.2, 2.0, 12), rng.uniform(height + 0.1, 0.6, 12)])
    for a, b, rays in zip(below, above, scene.arrivals(below, above), strict=True):
        (ray,) = rays
        assert rays.unresolved == 0

        def snell(x, a=a, b=b):
            first, last = (x - a[0]) / np.hypot(x - a[0], a[1] - height), (b[0] - x) / np.hypot(b[0] - x, b[1] - height)
            return 1.4 * first - 1.6 * last

        x = brentq(snell, a[0], b[0], xtol=1e-14)
        sharp = 1.4 * np.hypot(x - a[0], a[1] - height) + 1.6 * np.hypot(b[0] - x, b[1] - height)
        assert abs(ray.optical_path - sharp) < width
