"""Grids: every place once, neighbours in turn, values that belong together, and what is none refused."""

import math
from itertools import pairwise

import numpy as np
import pytest

import varcalc as vc
from varcalc.solve.grid import Grid, spaced, walk


@pytest.mark.parametrize("shape", [(5,), (3, 4), (2, 3, 4)])
def test_a_grid_iswalked_from_neighbour_to_neighbour(shape):
    places = list(walk(shape))
    assert sorted(places) == list(np.ndindex(*shape))
    assert all(sum(abs(a - b) for a, b in zip(p, q, strict=True)) == 1 for p, q in pairwise(places))


def test_paired_values_are_taken_together():
    grid = Grid.of(vc.Paired({"a": np.array([1.0, 2.0, 3.0]), "b": [4, 5, 6]}))
    assert grid.shape == (3,)
    assert grid.points(list(grid.places())) == [{"a": 1.0, "b": 4.0}, {"a": 2.0, "b": 5.0}, {"a": 3.0, "b": 6.0}]


@pytest.mark.parametrize(
    ("values", "error", "message"),
    [
        ({"a": [1, 2], "b": [1]}, ValueError, "as many values of one name as of another, but a has 2, b has 1"),
        ({}, ValueError, r"Paired\.values must map names to values"),
        ({"a": []}, ValueError, r"Paired\.values\['a'\] is empty"),
        ({"a": np.array([1.0, math.inf])}, ValueError, r"Paired\.values\['a'\] must be finite"),
        ({"a": np.ones((2, 2))}, TypeError, r"Paired\.values\['a'\] must be a number"),
        ({"a": 3.0}, TypeError, r"Paired\.values\['a'\] must be a sequence"),
    ],
)
def test_what_cannot_be_paired_is_refused(values, error, message):
    with pytest.raises(error, match=message):
        vc.Paired(values)


@pytest.mark.parametrize("text", ["g", "=1:2:3", "g=1:2", "g=a", "g=1:2:x", "g="])
def test_a_grid_that_cannot_be_read_is_refused(text):
    with pytest.raises(ValueError, match="is no grid; write name=from:to:count"):
        spaced(text)
