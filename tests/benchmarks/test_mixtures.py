"""The polygons by hand that random mixtures are held against, and a few of these."""

import numpy as np
import pytest

from campaigns.admissible import least_polygon
from campaigns.mixtures import Mixture, mixture
from mixtures import told


def test_the_least_polygon_is_as_high_as_its_pieces_are_long():
    # v^2/2 + y from 0 to 0: y'' = 1, -1/24; a polygon on 128 pieces lies above by its share
    given = Mixture(1.0, 0.0, 0.0, lambda x, y, v: v**2 / 2 + y, None)
    value, x, y = least_polygon(given)
    assert -1 / 24 < value < -1 / 24 + 2e-4
    assert np.abs(y - (x**2 - x) / 2).max() < 0.02


def test_the_least_polygon_keeps_bounds_and_pays_for_its_end():
    # down to the floor as steeply as may be, and along it
    given = Mixture(2.0, 0.0, None, lambda x, y, v: y + 0 * v, lambda y: -0.1 * y, low=-0.5, steep=1.0)
    value, _, y = least_polygon(given)
    assert value == pytest.approx(-0.125 - 0.5 * 1.5 + 0.05, abs=2e-2)
    assert y.min() >= -0.5


def test_a_number_stands_for_one_mixture():
    one, other = mixture(7), mixture(7)
    assert (one.span, one.start, one.end) == (other.span, other.start, other.end)
    assert one.lagrangian(0.3, 0.2, 0.1) == other.lagrangian(0.3, 0.2, 0.1)


@pytest.mark.parametrize("number", [5])
def test_no_mixture_is_wrong(number):
    outcome, line = told(number)
    assert outcome != "wrong", line
