"""Lattices of polygons: least paths, turns of L along lines, and how far a lattice across hills and wells goes."""

from itertools import product

import casadi as ca
import numpy as np
import pytest

import varcalc as vc
from varcalc.existence.closed_paths import closed_paths
from varcalc.existence.polygons import Graphs, LeastPaths, PolygonLattice, across_the_landscape
from varcalc.existence.worth_crossing import nowhere_negative, worth_crossing
from varcalc.formulation.height import turns_along_lines


def test_least_paths_are_those_of_all():
    costs = np.random.default_rng(1).uniform(size=(4, 3, 3))
    barred = np.zeros((5, 3), dtype=bool)
    barred[2, 1] = True
    ends = np.array([np.inf, 0.5, 0.0]), np.array([0.0, np.inf, 0.25])
    paths = LeastPaths(costs, barred, ends)
    values = {
        path: ends[0][path[0]] + sum(costs[k, path[k], path[k + 1]] for k in range(4)) + ends[1][path[-1]]
        for path in product(range(3), repeat=5)
        if path[2] != 1
    }
    for row, node in product(range(5), range(3)):
        least = min((v for path, v in values.items() if path[row] == node), default=np.inf)
        assert paths.values[row, node] == pytest.approx(least, rel=1e-14)
    for value, path in paths.lowest(np.zeros(5, dtype=int)):
        assert value == pytest.approx(values[path], rel=1e-14)


def test_least_closed_paths_are_those_of_all():
    costs = np.random.default_rng(2).uniform(size=(4, 5, 5))
    for value, path in closed_paths(costs, np.zeros((5, 5), dtype=bool), 0):
        sums = [
            sum(costs[k, i, j] for k, (i, j) in enumerate(zip(other, (*other[1:], path[0]), strict=True)))
            for other in product([path[0]], *[range(5)] * 3)
        ]
        assert path[0] == path[-1] != 0
        assert value == pytest.approx(min(sums), rel=1e-14)


def test_a_double_well_turns_at_both_wells_and_on_its_hill():
    y = np.linspace(-2.0, 2.0, 41)[None]
    found = turns_along_lines(y, (y**2 - 1) ** 2, 1.0)
    assert found is not None
    assert sorted(found) == pytest.approx([-1.0, 0.0, 1.0], abs=1e-12)


def test_one_well_has_no_turns_that_count():
    y = np.linspace(-2.0, 2.0, 41)[None]
    assert turns_along_lines(y, (y - 0.3) ** 2, 1.0) is None


def test_what_falls_beyond_a_hill_is_a_valley():
    y = np.linspace(-2.0, 2.0, 41)[None]
    found = turns_along_lines(y, y**2 - y**4 / 4, 1.0)  # hills at both roots of 2
    assert found is not None
    assert {-1.0, 0.0, 1.0} <= set(np.round(found, 12))


@pytest.mark.parametrize(
    ("lagrangian", "known"),
    [
        (lambda x, y, dy: (2 - ca.cos(y)) * ca.sqrt(1 + dy**2), True),
        (lambda x, y, dy: ca.exp(-y) + dy**2, True),
        (lambda x, y, dy: dy**2 / 2 - ca.exp(y), False),
    ],
)
def test_what_is_nowhere_negative_is_enclosed(lagrangian, known):
    problem = vc.Problem(lagrangian, vc.Fixed(0, 0), vc.Fixed(1, 0))
    assert nowhere_negative(Graphs(problem)) is known


def test_levels_go_no_farther_than_a_curve_is_worth():
    # the index is 1 in all valleys 2 pi k, and no less anywhere
    problem = vc.Problem(lambda x, y, dy: (2 - ca.cos(y)) * ca.sqrt(1 + dy**2), vc.Fixed(0, 0), vc.Fixed(1, 0))
    about = PolygonLattice(Graphs(problem), np.zeros_like)
    all_levels = across_the_landscape(Graphs(problem), np.zeros_like)
    fewer = across_the_landscape(Graphs(problem), np.zeros_like, about)
    assert all_levels is not None
    assert fewer is not None
    low, high = worth_crossing(about)
    up_and_down = np.hypot(1, 2 * 0.875) * (2 - np.sin(0.875) / 0.875)  # along two straight pieces
    assert up_and_down < 2.5 * about.own_value
    assert 0.875 < high < 0.5 * np.sqrt(2.5**2 - 1) + 0.25  # nothing higher is so short, and the next node is near
    assert -high == pytest.approx(low, rel=1e-12)
    kept = all_levels.nodes[(all_levels.nodes >= low) & (all_levels.nodes <= high)]
    assert np.setdiff1d(np.round(kept, 9), np.round(fewer.nodes, 9)).size == 0
    assert fewer.nodes.shape[1] < 0.5 * all_levels.nodes.shape[1]


@pytest.mark.parametrize("width", [1.0, 10.0])
def test_a_curve_that_sums_nothing_is_least_where_l_is_nowhere_negative(width):
    """L = v² + (1 - y²)² from 1 to 1 is 0 along y = 1, which no polygon of the lattice comes below."""
    problem = vc.Problem(lambda x, y, v: v**2 + (1 - y**2) ** 2, vc.Fixed(0, 1), vc.Fixed(width, 1))
    solution = vc.solve(problem)
    assert solution.value == pytest.approx(0.0, abs=1e-14)
    assert not solution.local
