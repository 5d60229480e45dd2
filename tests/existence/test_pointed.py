"""Kinks that point up, which no minimum follows: wells with steep sides, and ridges."""

import casadi as ca
import mpmath as mp
import numpy as np
import pytest

import varcalc as vc
from varcalc.existence.pointed import points_up
from varcalc.methods.crossings import Crossing, on_curve


def rest_in_well(deep, centre, wide, until):
    """The least ∫ v²/2 - deep max(0, 1 - ((y - centre)/wide)²) from 0 back to 0, and when it comes into the well.

    Straight to the side, in the well y'' = k² (y - centre) with k² = 2 deep/wide²; the slope does not jump.
    """
    k = mp.sqrt(2 * deep) / wide
    away = abs(mp.mpf(centre)) - wide
    begun = mp.findroot(
        lambda t: away / t - wide * k * mp.tanh(k * (until - 2 * t) / 2), [away / (wide * k), until / 2.1],
        solver="anderson",
    )  # fmt: skip
    inside = until - 2 * begun
    return away**2 / begun + deep * (2 * mp.tanh(k * inside / 2) / k - inside), begun


@pytest.mark.parametrize(
    ("deep", "centre", "wide", "until"), [(4.6131, 2.329, 0.147, 3.0), (3.0, -2.0, 0.1, 4.0), (40.0, 1.0, 0.02, 1.0)]
)
def test_a_curve_goes_straight_into_a_well_with_kinked_sides(deep, centre, wide, until):
    problem = vc.Problem(
        lambda x, y, v: v**2 / 2 - deep * ca.fmax(0, 1 - ((y - centre) / wide) ** 2), vc.Fixed(0, 0), vc.Fixed(until, 0)
    )
    solution = vc.solve(problem)
    value, begun = rest_in_well(deep, centre, wide, until)
    assert solution.status.ok
    assert not solution.local
    assert abs(solution.value - value) <= 10 * solution.error.value <= 1e-9
    side = float(centre - np.copysign(wide, centre))
    assert solution.y(float(begun)) == pytest.approx(side, abs=1e-6)


def along(problem, level=0.0):
    """A curve along the first kink of the problem, near 1, and the crossing that says so."""

    def curve(x, k):
        return np.full((1, len(x)), 1.1) if k == 0 else np.zeros((1, len(x)))

    return curve, Crossing(x=0.5, switch=on_curve(problem)[0], level=level, until=1.5)


@pytest.mark.parametrize("unit", [1.0, 1e-6, 1e6])
@pytest.mark.parametrize(("factor", "up"), [(-3.0, True), (3.0, False), (0.0, False)])
def test_a_ridge_points_up_and_a_valley_does_not(factor, up, unit):
    """The factor 0 leaves a concave L beside a kink that is that of a level alone."""
    level = vc.Isoperimetric(lambda x, y, v: ca.fabs(y / unit - 1), 1.0)
    problem = vc.Problem(
        lambda x, y, v: v**2 / 2 + factor * ca.fabs(y / unit - 1) - (y / unit) ** 2, vc.Fixed(0, 0), vc.Fixed(2, 0),
        constraints=[] if factor else [level],
    )  # fmt: skip
    curve, crossing = along(problem)
    assert points_up(problem, lambda x, k: unit * curve(x, k), crossing) is up


def test_which_way_a_kink_points_that_a_level_weighs_is_not_known():
    both = vc.Problem(
        lambda x, y, v: v**2 / 2 - ca.fabs(y - 1), vc.Fixed(0, 0), vc.Fixed(2, 0),
        constraints=[vc.Isoperimetric(lambda x, y, v: ca.fabs(y - 1), 1.0)],
    )  # fmt: skip
    assert not points_up(both, *along(both))
