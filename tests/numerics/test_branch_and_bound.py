import numpy as np
import pytest

from varcalc.numerics.branch_and_bound import boxes_about, least_points


def wells(centres, width):
    """Functions -1/(1 + |z - c|^2/w^2), one a centre (f, k), at points and over boxes."""

    def at(distance2):
        return -1 / (1 + distance2 / width**2)

    def value(points, number):
        return at(((points - centres[:, number]) ** 2).sum(0))

    def bound(low, high, number):
        nearest = np.clip(centres[:, number], low, high)
        return at(((nearest - centres[:, number]) ** 2).sum(0))

    return value, bound


@pytest.mark.parametrize("dimension", [1, 2, 3])
@pytest.mark.parametrize("width", [1e-1, 1e-4, 1e-8])
def test_wells_are_found_however_narrow(dimension, width):
    centres = np.random.default_rng(3).uniform(-1, 1, (dimension, 4))
    low, high = boxes_about(np.linspace(-2, 2, 4), dimension)
    number = np.repeat(np.arange(4), low.shape[1])
    low, high = (np.tile(side, 4) for side in (low, high))
    places, least = least_points(low, high, number, *wells(centres, width), np.full(4, -0.5), 1e-6, 1e-6)
    assert least == pytest.approx(-1, abs=1e-5)
    assert places == pytest.approx(centres, abs=1e-2 * width)


def test_what_is_not_low_enough_is_no_place():
    centres = np.array([[0.3]])
    low, high = boxes_about(np.linspace(-2, 2, 4), 1)
    places, least = least_points(
        low, high, np.zeros(3, dtype=int), *wells(centres, 0.1), np.array([-1.5]), 1e-6, 1e-6
    )  # fmt: skip
    assert np.isnan(places).all()
    assert least == [-1.5]


@pytest.mark.parametrize("dimension", [1, 2])
@pytest.mark.parametrize("width", [1e-1, 1e-4])
def test_a_well_of_no_known_size_is_told_to_a_share_of_its_depth(dimension, width):
    """Otherwise boxes beside the lowest point are halved to round-off, and ever more of them."""
    centres, halved = np.full((dimension, 1), 0.3), []
    value, bound = wells(centres, width)

    def counted(low, high, number):
        halved.append(float((high - low).max()))
        return bound(low, high, number)

    low, high = boxes_about(np.linspace(-2, 2, 4), dimension)
    number = np.zeros(low.shape[1], dtype=int)
    _, least = least_points(low, high, number, value, counted, np.zeros(1), 0.0, 1e-3)
    assert -1 <= least[0] <= -1 + 1e-3
    assert min(halved) > 1e-3 * width
