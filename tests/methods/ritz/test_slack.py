"""Inequalities that bind nothing: the minimum without them, found by Newton's iteration, is the answer."""

import math

import casadi as ca
import numpy as np
import pytest

import varcalc as vc


def rope(*conditions, length=3.0):
    """v^2/2 + y^2/2 between heights of 1: cosh(x - T/2)/cosh(T/2), of which the value is tanh(T/2)."""
    return vc.Problem(lambda x, y, v: (v**2 + y**2) / 2, vc.Fixed(0, 1), vc.Fixed(length, 1), conditions)


@pytest.mark.parametrize(
    "condition",
    [
        vc.Bound(lambda x, y, v: y, upper=1.5),
        vc.Bound(lambda x, y, v: v, lower=-5, upper=5),
        vc.Bound(lambda x, y, v: y - 0.1 * x, lower=-3),
        vc.Isoperimetric(lambda x, y, v: y, upper=10),
    ],
    ids=["ordinate", "slope", "slanted", "level"],
)
def test_what_binds_nothing_costs_nothing(condition):
    found = vc.solve(rope(condition))
    assert found.value == pytest.approx(math.tanh(1.5), abs=1e-13)
    multiplier = found.multipliers[0]
    pushes = multiplier(np.linspace(0, 3, 7)) if callable(multiplier) else multiplier
    assert np.all(np.asarray(pushes) == 0.0)
    assert vc.verify(found).verdict is vc.Verdict.MINIMUM


def test_a_bound_between_the_points_is_no_slack_one():
    """A ceiling with a narrow slot that the free minimum goes through: the curve keeps below it."""
    slot = vc.Bound(lambda x, y, v: y + 2 * ca.exp(-(((x - 1.3) / 2e-2) ** 2)), upper=1.5)
    found = vc.solve(rope(slot), throw=False)
    x = 1.3 + np.linspace(-0.1, 0.1, 4001)
    if found.status.ok:
        assert (found.curve(x, 0)[0] + 2 * np.exp(-(((x - 1.3) / 2e-2) ** 2))).max() <= 1.5 + 1e-6


def test_a_wavy_floor_of_valleys_beside_a_bound_that_is_never_met_is_found_quickly():
    """The same curve as without the bound, which an interior-point method leaves its valley for."""
    wavy = lambda x, y, v: v**2 / 2 + 1.2 * ca.sin(5.7 * y - 1.4)  # noqa: E731
    ends = vc.Fixed(0, -0.45), vc.Fixed(5, 1.2)
    free, bounded = (
        vc.solve(vc.Problem(wavy, *ends, conditions)) for conditions in ([], [vc.Bound(lambda x, y, v: y, upper=2.1)])
    )
    energies, told = [], []
    for found in (free, bounded):
        x = np.linspace(0, 5, 41)
        y, v = found.curve(x, 0)[0], found.curve(x, 1)[0]
        energies.append(v**2 / 2 - 1.2 * np.sin(5.7 * y - 1.4))
        assert not found.local
        # the slope is off by the root of what the value is above the least at the tolerance, the energy by v times that
        told.append(np.abs(v).max() * np.sqrt(2e-10 * abs(found.value)))
        assert np.ptp(energies[-1]) < told[-1]  # energy is conserved off the bound
    assert energies[0] == pytest.approx(energies[1], abs=sum(told))


@pytest.mark.parametrize(
    "bounds",
    [[], [vc.Bound(lambda x, y, v: y, lower=-0.5, upper=0.6)], [vc.Bound(lambda x, y, v: v, upper=0.6)]],
    ids=["none", "place", "slope"],
)
def test_a_curve_that_begins_at_a_minimum_of_zero_is_at_its_end(bounds):
    problem = vc.Problem(lambda x, y, v: v**2 / 2, vc.Fixed(0, 0.3), vc.Free(2), bounds)
    solution = vc.solve(problem)
    assert 0 <= solution.value < 1e-28
    assert solution.stats.iterations < 20
