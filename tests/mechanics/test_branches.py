"""Bifurcation charts: branches of equilibria with their folds, pitchforks, crossings and losses of stability."""

import math

import casadi as ca
import numpy as np
import pytest

from varcalc import mechanics
from varcalc.mechanics import BifurcationKind


def landscape(potential, h=0.0):
    return mechanics.System(lambda t, q, v, p: v[0] ** 2 / 2 - potential(q[0], p.h), ("x",), parameters={"h": h})


def test_a_bead_leaves_the_bottom_of_its_hoop_where_the_turning_is_critical():
    g = 9.81 / 0.8
    hoop = mechanics.System(
        lambda t, q, v, p: (v[0] ** 2 + (p.w * ca.sin(q[0])) ** 2) / 2 + g * ca.cos(q[0]), ("theta",),
        parameters={"w": 1.0},
    )  # fmt: skip
    chart = mechanics.bifurcation_chart(hoop, [-1.6], [1.5], "w", (2.0, 6.0))
    assert chart.unresolved == 0
    (met,) = chart.bifurcations
    assert met.kind is BifurcationKind.PITCHFORK
    assert abs(met.parameter - math.sqrt(g)) <= max(met.error, 1e-15) <= 1e-12
    bottom, side = sorted(chart.branches, key=lambda one: np.ptp(one.places))
    assert np.abs(bottom.places).max() < 1e-12
    assert np.array_equal(bottom.stable, bottom.parameter < math.sqrt(g))
    known = np.arccos(np.minimum(g / side.parameter**2, 1))
    np.testing.assert_allclose(np.abs(side.places[:, 0]), known, rtol=0, atol=1e-7)
    away = known > 0.1
    np.testing.assert_allclose(np.abs(side.places[away, 0]), known[away], rtol=0, atol=1e-12)
    assert side.stable[away].all()


def test_folds_of_an_s_shaped_branch():
    chart = mechanics.bifurcation_chart(
        landscape(lambda x, h: x**4 / 4 - x**2 / 2 + h * x), [-2.0], [2.1], "h", (-1, 1)
    )
    (branch,) = chart.branches
    assert [one.kind for one in chart.bifurcations] == [BifurcationKind.FOLD] * 2
    for one in chart.bifurcations:
        assert abs(abs(one.parameter) - 2 / math.sqrt(27)) <= max(one.error, 1e-15) <= 1e-12
        assert abs(one.place[0]) == pytest.approx(1 / math.sqrt(3), abs=1e-9)
    np.testing.assert_allclose(branch.parameter, branch.places[:, 0] - branch.places[:, 0] ** 3, rtol=0, atol=1e-12)
    assert np.array_equal(branch.stable, 3 * branch.places[:, 0] ** 2 > 1)


def test_two_branches_that_cross():
    chart = mechanics.bifurcation_chart(landscape(lambda x, h: x**3 / 3 - h * x**2 / 2), [-2.0], [2.1], "h", (-1, 1.1))
    (met,) = chart.bifurcations
    assert met.kind is BifurcationKind.TRANSCRITICAL
    assert abs(met.parameter) <= 1e-14
    assert len(chart.branches) == 2


def test_the_side_branches_of_a_pitchfork_are_found_from_the_one_that_they_leave():
    # x (h - x² ) near 0 between two looks, where the sides end at folds and come back
    chart = mechanics.bifurcation_chart(
        landscape(lambda x, h: -(h * x**2 / 2 + x**4 / 4 - x**6 / 6)), [-1.4], [1.3], "h", (-0.5, 0.3)
    )
    kinds = sorted((one.kind.name, round(one.parameter, 12)) for one in chart.bifurcations)
    assert kinds == [("FOLD", -0.25), ("FOLD", -0.25), ("PITCHFORK", 0.0)]


def test_a_loss_of_stability_by_swinging_is_where_the_exponents_meet():
    hill = mechanics.System(
        lambda t, q, v, p: ca.sumsqr(v) / 2 + p.w * (q[0] * v[1] - q[1] * v[0]) + ca.sumsqr(q) / 2, ("x", "y"),
        parameters={"w": 0.5},
    )  # fmt: skip
    chart = mechanics.bifurcation_chart(hill, [-1, -1], [1.1, 1.2], "w", (0.5, 1.7))
    (met,) = chart.bifurcations
    assert met.kind is BifurcationKind.OSCILLATION
    assert abs(met.parameter - 1) <= met.error <= 1e-7


def test_arguments_are_named():
    system = landscape(lambda x, h: x**2 - h)
    with pytest.raises(ValueError, match="no parameter"):
        mechanics.bifurcation_chart(system, [-1], [1], "w", (0, 1))
    with pytest.raises(ValueError, match="ascending"):
        mechanics.bifurcation_chart(system, [-1], [1], "h", (1, 0))
    with pytest.raises(ValueError, match="are no parameters of this system"):
        system.with_parameters({"w": 1.0})
