"""Regular arcs next to singular ends, held against the cycloid."""

import math

import casadi as ca
import numpy as np
import pytest

import varcalc as vc
from varcalc.formulation.singular import forms
from varcalc.methods.shooting import regular_arc
from varcalc.methods.shooting.flow import EulerLagrangeFlow
from varcalc.methods.shooting.regular_arc import RegularEnd, stages

LAST = 2.0
"""Angle at which the cycloid x = a - sin a, y = 1 - cos a ends; in the form's coordinates (x, sqrt y)."""


def cycloid(t):
    """The form's ordinates (2, m) and their derivatives by t, which is the angle over LAST."""
    angle = LAST * np.asarray(t)
    points = np.array([angle - np.sin(angle), math.sqrt(2) * np.sin(angle / 2)])
    return points, LAST * np.array([1 - np.cos(angle), np.cos(angle / 2) / math.sqrt(2)])


@pytest.fixture(scope="module")
def equations():
    (x, root), _ = cycloid(1.0)
    problem = vc.Problem(lambda x, y, dy: ca.sqrt((1 + dy**2) / y), vc.Fixed(0, 0), vc.Fixed(x, root**2))
    form = next(f for f in forms(problem) if f is not None and not f.coordinates.weak_only)
    assert form.coordinates.singular == (True, False)
    np.testing.assert_allclose(form.ends.end[0], [x, root], atol=1e-15)
    return EulerLagrangeFlow(form)


class Meter:
    """What an arc is charged to."""

    runs = 0

    def charge(self, runs):
        self.runs += runs


@pytest.fixture
def end(equations):
    return RegularEnd(equations, 0.0, np.zeros(2), equations.form.start.curve)


@pytest.fixture(scope="module")
def constants(equations):
    line = equations.line(0.0, 1.0, (False, False))
    return np.concatenate([line, np.ones(2 + equations.integrals)])


@pytest.mark.parametrize("count", [6, 16])
def test_stages_integrate_polynomials_exactly(count):
    table = stages(count)
    c = table.points
    for power in range(count):
        twice = (c ** (power + 2) - c) / ((power + 1) * (power + 2))
        mean = 1 / ((power + 1) * (power + 2))
        np.testing.assert_allclose(table.twice @ c**power, twice, atol=1e-14)
        np.testing.assert_allclose(table.once @ c**power, c ** (power + 1) / (power + 1) - mean, atol=1e-14)
        assert table.left @ c**power == pytest.approx(-mean, abs=1e-14)
        assert table.right @ c**power == pytest.approx(1 / (power + 1) - mean, abs=1e-14)


@pytest.mark.parametrize("anchor", [0.1, 0.3, 0.6])
def test_the_slope_at_the_anchor_is_that_of_the_cycloid(end, constants, anchor):
    point, slope = cycloid(anchor)
    arc = end.passage(anchor, point, constants, 0, Meter())
    np.testing.assert_allclose(arc.near, slope, rtol=2e-14)
    np.testing.assert_allclose(arc.far, cycloid(0.0)[1], atol=1e-14)
    assert arc.integrals[0] == pytest.approx(math.sqrt(2) * LAST * anchor, rel=1e-14)
    t = np.linspace(0, anchor, 23)
    np.testing.assert_allclose(end.arc(anchor, arc)(t), np.concatenate(cycloid(t)).T, atol=1e-14)
    assert np.all(end.arc(anchor, arc)(t)[0, :2] == 0.0)


def test_the_error_falls_geometrically(end, constants, monkeypatch):
    point, slope = cycloid(0.6)
    monkeypatch.setattr(regular_arc, "ARC_UNRESOLVED", math.inf)
    errors = []
    for last in (5, 7, 9):
        monkeypatch.setattr(regular_arc, "STAGES", (3, last))
        monkeypatch.setattr(regular_arc, "COARSEST", 2)
        errors.append(np.abs(end.passage(0.6, point, constants, 0, Meter()).near - slope).max())
    assert errors[0] > 30 * errors[1] > 900 * errors[2] > 0


def test_derivatives_by_the_anchor(end, constants):
    anchor, step = 0.3, 1e-5
    point, _ = cycloid(anchor)
    arc = end.passage(anchor, point, constants, 0, Meter())
    for k in range(2):
        shift = step * np.eye(2)[k]
        more, less = (end.passage(anchor, point + sign * shift, constants, 0, Meter()) for sign in (1, -1))
        for by, values in (
            (arc.near_by, (more.near, less.near)),
            (arc.far_by, (more.far, less.far)),
            (arc.integrals_by, (more.integrals, less.integrals)),
        ):
            np.testing.assert_allclose(by[:, k], (values[0] - values[1]) / (2 * step), rtol=1e-6, atol=1e-7)


def test_an_arc_that_is_not_there(end, constants):
    # upward of the singular line only: the mirror image in w is an arc, a point on the line is none
    assert end.passage(0.3, np.array([0.5, 0.0]), constants, 0, Meter()) is None
