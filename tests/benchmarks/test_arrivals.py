"""The campaign of all rays between random pairs, in little."""

import dataclasses
import itertools

import numpy as np
import pytest

from arrivals import RECORDS
from campaigns.arrival_pairs import Drawn, Layers, layered_receivers, linear_pair, linear_scene
from campaigns.exact_pairs import compared
from campaigns.ray_campaign import Family, Tally, counted_block, store, stored, summed, table, wanted
from varcalc import optics


def judged(drawn, answers):
    """What came of pairs, and the lines about them."""
    tally = Tally("")
    return tally, list(compared(tally, drawn, answers))


def test_no_ray_is_missed_and_none_is_false_where_rays_are_parabolas():
    rng = np.random.default_rng(11)
    pairs = [linear_pair(rng, near=number % 2 == 0) for number in range(60)]
    answers = linear_scene().arrivals([d.source for d in pairs], [d.receiver for d in pairs])
    found, said = judged(pairs, answers)
    assert (found.missed, found.false, found.beyond) == (0, 0, 0), said
    assert found.near >= 25
    assert found.rays >= 40


def test_no_ray_is_missed_and_none_is_false_through_layers():
    rng = np.random.default_rng(12)
    layers = Layers()
    receivers = layered_receivers(rng, layers, 150)
    answers = layers.scene().arrivals(receivers[0].source, [d.receiver for d in receivers], within=40.0)
    found, said = judged(receivers, answers)
    assert (found.missed, found.false, found.beyond) == (0, 0, 0), said
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
    found, said = judged(drawn, [there, there])
    assert (found.missed, found.false, found.missed_and_said, len(said)) == (1, 1, 0, 2)
    doubted, _ = judged(drawn, [dataclasses.replace(there, unresolved=1)] * 2)
    assert (doubted.missed, doubted.false, doubted.missed_and_said, doubted.unresolved) == (0, 1, 1, 2)
    wrong = Drawn((0, 0), (0.5, 0), (paths[0] + 1e-9, paths[1]), np.inf)
    off, said = judged([wrong], [there])
    assert (off.beyond, off.wrong, len(said)) == (1, True, 1)
    assert isinstance(dark, optics.Rays)


def test_blocks_are_drawn_by_their_number_and_stored_one_by_one(tmp_path):
    drawn = []

    def block(rng, tally):
        drawn.append(rng.uniform())
        tally.pairs, tally.rays, tally.worst, tally.seconds = 5, 7, 2e-15, 0.25
        return []

    first, again, second = (counted_block("one", block, number, "abc") for number in (0, 0, 1))
    assert drawn[0] == drawn[1] != drawn[2]
    path = tmp_path / "blocks.csv"
    assert stored(path) == {}
    store(path, [first, second])
    assert stored(path) == {("one", 0): again, ("one", 1): second}
    assert [file.name for file in tmp_path.iterdir()] == ["blocks.csv"]


def test_what_is_begun_is_a_fair_sample_of_what_is_wanted():
    families = {"one": Family(lambda rng, tally: [], 3), "two": Family(lambda rng, tally: [], 1)}
    assert wanted(families, ["one", "two"], None) == [("one", 0), ("two", 0), ("one", 1), ("one", 2)]
    assert wanted(families, ["one"], 2) == [("one", 0), ("one", 1)]


def test_families_are_summed_with_their_worst_error():
    rows = [
        Tally("one", 0, pairs=2, rays=3, worst=1e-15, seconds=1.0),
        Tally("one", 1, pairs=4, missed=1, worst=5e-16, seconds=2.0),
        Tally("two", 0, pairs=4, worst=2e-15, seconds=2.0),
    ]
    one, two, both = summed(rows)
    assert (one.pairs, one.rays, one.missed, one.worst, one.seconds, one.wrong) == (6, 3, 1, 1e-15, 3.0, True)
    assert (two.wrong, both.family, both.pairs, both.worst) == (False, "all", 10, 2e-15)
    lines = table([one, two, both]).splitlines()
    assert len(lines) == 5
    assert lines[2] == "| one | 6 | 3 | 1 | 0 | 0 | 0 | 0 | 0.5 |"
    assert all(a.count("|") == b.count("|") for a, b in itertools.pairwise(lines))


def test_the_page_says_what_the_record_holds():
    rows = stored(RECORDS)
    assert table(summed(rows.values())) in (RECORDS.parent.parent / "README.md").read_text(encoding="utf-8")
    assert not any(row.wrong for row in rows.values())
