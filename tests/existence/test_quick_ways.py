"""Long intervals on most of which the least curve rests in another well than the one it begins and ends in."""

import casadi as ca
import pytest
from mpmath import findroot, mp, quad, sqrt

import varcalc as vc

mp.dps = 30
TILT, STEEP = 8, 10
"""What the tilt adds over the whole interval in the upper well, and how steep wells are."""


def wells(y, length):
    return STEEP * (y**2 - 1) ** 2 + y * TILT / length


def down_and_back(length):
    """The value by way of the lower well, into which the curve falls by v²/2 = V - V(rest), but for exp(-9 length)."""
    rest = findroot(lambda y: 4 * STEEP * y * (y**2 - 1) + mp.mpf(TILT) / length, -1)
    above = wells(rest, mp.mpf(length))
    way = quad(lambda y: sqrt(2 * abs(wells(y, mp.mpf(length)) - above)), [rest, 0, 1])
    return float(above * length + 2 * way)


def near(solution, exact):
    return abs(solution.value - exact) <= max(10 * solution.error.value, 1e-12 * abs(exact)) and not solution.local


@pytest.mark.parametrize("length", [40, 400, 2000])
def test_the_lower_well_is_found_however_long_the_curve_rests_there(length):
    problem = vc.Problem(lambda x, y, v: v**2 / 2 + wells(y, length), vc.Fixed(0, 1), vc.Fixed(length, 1))
    assert near(vc.solve(problem), down_and_back(length))


def test_so_it_is_of_a_maximum_in_other_units():
    length = 100

    def action(x, y, v):
        return -1e6 * ((1e3 * v) ** 2 / 2 + wells(1e3 * y - 7, length))

    solution = vc.solve(vc.Problem(action, vc.Fixed(50, 8e-3), vc.Fixed(150, 8e-3), maximise=True))
    assert near(solution, -1e6 * down_and_back(length))


@pytest.mark.parametrize("bounded", [True, False])
def test_so_it_is_under_a_bound_and_beside_another_function(bounded):
    length = 100
    if bounded:
        kept = [vc.Bound(lambda x, y, v: y, lower=-3.0, upper=3.0)]
        problem = vc.Problem(lambda x, y, v: v**2 / 2 + wells(y, length), vc.Fixed(0, 1), vc.Fixed(length, 1), kept)
        assert near(vc.solve(problem), down_and_back(length))
        return

    def pair(x, y, v):
        return v[0] ** 2 / 2 + wells(y[0], length) + v[1] ** 2 / 2 + y[1] ** 2

    solution = vc.solve(vc.Problem(pair, vc.Fixed(0, (1, 0)), vc.Fixed(length, (1, 1))))
    # the other one goes as sinh(x sqrt 2), which adds coth(length sqrt 2)/sqrt 2
    assert near(solution, down_and_back(length) + float(1 / sqrt(2) / mp.tanh(length * sqrt(2))))


def test_where_the_lower_well_changes_the_curve_goes_over_there():
    """The tilt changes its sign half way, and with it the well: a polygon that goes over there comes close."""
    length, width = 100, 0.6

    def action(x, y, v):
        return v**2 / 2 + STEEP * (y**2 - 1) ** 2 + 0.4 * y * ca.tanh((x - 45) / 20)

    solution = vc.solve(vc.Problem(action, vc.Fixed(0, -1), vc.Free(length)))

    def polygon(x):
        return -1 if x < width else 1 if x < 45 else -1

    # from -1 up to 1 at once, and down half way: each costs no more than a straight way
    straight = 2 * (2 / width + width * STEEP * 8 / 15)
    rests = float(quad(lambda x: 0.4 * polygon(x) * mp.tanh((x - 45) / mp.mpf(20)), [0, width, 45, length]))
    assert solution.value < rests + straight + 0.4 * 2 * width
