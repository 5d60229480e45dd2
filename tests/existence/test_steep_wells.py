"""Wells with steep or kinked sides, wherever they lie and in whatever units: closed forms and straight ways."""

import casadi as ca
import mpmath as mp
import numpy as np
import pytest

import varcalc as vc


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


@pytest.mark.parametrize("unit", [1e-2, 1e3, 1e6])
@pytest.mark.parametrize("centre", [(1.5,), (1.2, -0.7), (1.2, -0.7, 0.4)], ids=len)
def test_a_narrow_well_is_found_in_whatever_unit(centre, unit):
    """Beside a rest nothing says how far off it lies but L itself; to the middle of a round one the way is straight."""
    n = len(centre)

    def lagrangian(x, y, v):
        (places, slopes) = ([y], [v]) if n == 1 else (y, v)
        away = sum(((places[k] / unit - centre[k]) / 0.2) ** 2 for k in range(n))
        return unit**2 * (sum((slopes[k] / unit) ** 2 for k in range(n)) / 2 - 8 * ca.fmax(0, 1 - away))

    rest = [0.0] * n if n > 1 else 0.0
    solution = vc.solve(vc.Problem(lagrangian, vc.Fixed(0, rest), vc.Fixed(3, rest)))
    value, _ = rest_in_well(8.0, mp.norm(centre), mp.mpf("0.2"), 3.0)
    assert not solution.local
    assert abs(solution.value / unit**2 - value) <= 10 * solution.error.value / unit**2 <= 1e-5


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e5])
def test_a_narrow_well_that_a_bound_cuts_off_is_found_in_whatever_unit(unit):
    """From 0 straight to the bound in 0.6 and back, from where the well is deepest within it."""
    problem = vc.Problem(
        lambda x, y, v: v**2 / 2 - 4 * unit**2 * ca.exp(-(((y / unit - 1.5) / 0.2) ** 2)),
        vc.Fixed(0, 0), vc.Fixed(3, 0), [vc.Bound(lambda x, y, v: y, upper=1.45 * unit)],
    )  # fmt: skip
    ramp = 0.6
    way = mp.quad(lambda y: mp.exp(-(((y - 1.5) / 0.2) ** 2)), [0, 1.2, 1.45]) * ramp / 1.45
    straight = 1.45**2 / ramp - 4 * (2 * way + (3 - 2 * ramp) * mp.exp(-((0.05 / 0.2) ** 2)))
    assert vc.solve(problem).value / unit**2 <= straight
