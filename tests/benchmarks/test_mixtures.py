"""The polygons by hand that random mixtures are held against, and a few of these."""

import numpy as np
import pytest

from campaigns.admissible import least_polygon
from campaigns.kinds import KINDS, Drawn
from campaigns.least_seen import least_seen
from campaigns.mixtures import Mixture, mixture
from mixtures import told, told_of_kind


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


@pytest.mark.parametrize("kind", KINDS)
def test_a_number_of_a_kind_stands_for_one_problem(kind):
    one, other = Drawn(kind, 3).problem, Drawn(kind, 3).problem
    assert str(one.integrand) == str(other.integrand)


def test_what_is_seen_of_a_kind_is_no_lower_than_the_least():
    # a beam that nothing loads but its ends, y''^2 / 2 in units of its own: the cubic between them
    class Beam(Drawn):
        def lagrangian(self, x, y, v, bends, switches):
            return bends[0] ** 2 / 2

    given = Beam("bent", 1)
    given.free = False
    h, (a, b), (p, q) = given.span, (given.start[0], given.end[0]), given.slopes
    least = 2 * (p**2 + p * q + q**2) / h - 6 * (b - a) * (p + q) / h**2 + 6 * (b - a) ** 2 / h**3
    assert least_seen(given, starts=1) == pytest.approx(least, rel=1e-9)


def test_no_levelled_pair_is_wrong():
    outcome, line = told_of_kind("levelled-pair", 2)
    assert outcome != "wrong", line
