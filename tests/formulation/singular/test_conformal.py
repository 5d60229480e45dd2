"""The energy of a conformal metric in numbers, against what its form says of it."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import varcalc as vc
from varcalc.formulation.singular import forms
from varcalc.problem.lagrangian import Lagrangian

S = np.array([0.05, 0.4, 0.9])
CURVE = np.array([[0.3, 1.1, 0.2, -0.4], [0.5, 0.9, 0.1, 0.2], [1.2, 0.7, -0.3, 0.1]])
"""(z, omega, z', omega') at three points."""
PROBLEMS = {
    "descent": (lambda x, y, v, p: ca.sqrt((1 + v**2) / (2 * p.g * y)), (0, 0), (1, 1)),
    "ascent": (lambda x, y, v, p: ca.sqrt((1 + v**2) / (2 * p.g * y)), (0, 1), (1, 0)),
    "a third": (lambda x, y, v, p: p.g * ca.sqrt(1 + v**2) * y ** (-1 / 3) * (2 + x), (-1, 0), (1, 1)),
    "graded, downward": (lambda x, y, v, p: p.g * ca.sqrt(1 + v**2) * (-y) ** -0.4 * (3 + x), (-1, -1), (1, 0)),
    "an upright line": (lambda x, y, v, p: p.g * ca.sqrt((1 + v**2) / x) * (5 + y), (0, 1), (1, 0)),
    "off the axis": (lambda x, y, v, p: ca.sqrt((1 + v**2) / (2 * p.g * (y - 1))), (0, 1), (1, 2)),
    "off the axis, upward": (lambda x, y, v, p: ca.sqrt((1 + v**2) / (2 * p.g * (7 - y))) * (3 + x), (-1, 7), (1, 5)),
    "off the axis, by its energy": (lambda x, y, v, p: p.g * ca.sqrt((1 + v**2) / (6 - 2 * y)), (0, 3), (1, 2)),
    "an upright line at the end": (lambda x, y, v, p: p.g * ca.sqrt((1 + v**2) / (2 - x)) * (5 + y), (0, 1), (2, 0)),
}


def rows(form, expressions):
    """Expressions of a form at the points, parameters at the problem's values: shape (points, rows)."""
    blank, parameters = np.zeros((0, 3)), np.tile(form.problem.parameter_values[:, None], 3)
    function = ca.Function("rows", form.symbols.all, [ca.densify(ca.vertcat(*expressions))])
    return np.asarray(function(S[None], CURVE[:, :2].T, CURVE[:, 2:].T, blank, parameters, blank)).T


@pytest.mark.parametrize("name", PROBLEMS)
@pytest.mark.parametrize("factored", [0, 1])
def test_numbers_are_those_of_the_expressions(name, factored):
    lagrangian, start, end = PROBLEMS[name]
    problem = vc.Problem(lagrangian, vc.Fixed(*start), vc.Fixed(*end), parameters={"g": 9.81})
    problem = problem.with_parameters({"g": 1.7})
    form = forms(problem)[factored]
    assert form.coordinates.energetic
    assert any(form.coordinates.singular)
    at = form.coordinates.numbers.on(problem, S)
    transform = np.tile(np.eye(4), (3, 1, 1)) if at.transform is None else at.transform
    u = np.einsum("qab,qb->qa", transform, CURVE) + (0.0 if at.offset is None else at.offset)
    value, gradient, hessian = at.derivatives(u)
    s = form.symbols
    variables = ca.vertcat(s.y, s.dy)
    second, first = ca.hessian(form.integrand, variables)
    expected = rows(form, [form.integrand, first, ca.vec(ca.densify(second))])
    np.testing.assert_allclose(value, expected[:, 0], rtol=1e-14)
    first, second = np.einsum("qab,qa->qb", transform, gradient), transform.transpose(0, 2, 1) @ hessian @ transform
    np.testing.assert_allclose(first, expected[:, 1:5], rtol=1e-12, atol=1e-14 * np.abs(expected[:, 1:5]).max())
    np.testing.assert_allclose(
        second.reshape(3, -1), expected[:, 5:], rtol=1e-12, atol=1e-14 * np.abs(expected[:, 5:]).max()
    )
    told = at.reported(u)
    reported = np.column_stack([told.integrand, told.x, told.y, told.dx, told.dy])
    np.testing.assert_allclose(reported, rows(form, [form.functional, *form.lifted]), rtol=1e-13, atol=1e-15)


@pytest.mark.parametrize("place", [1.0, -0.3, 1e3])
@pytest.mark.parametrize("upright", [False, True])
@pytest.mark.parametrize("side", [1, -1])
def test_the_line_may_lie_anywhere(place, upright, side):
    # the time of descent from a line at ``place``, on either side of it, to a point one away both ways
    if upright:
        lagrangian, first, last = lambda x, y, v: ca.sqrt((1 + v**2) / (side * (x - place))), (place, 0), (place + 1, 1)
        if side < 0:
            first, last = (place - 1, 1), (place, 0)
    else:
        lagrangian, first, last = (
            lambda x, y, v: ca.sqrt((1 + v**2) / (side * (y - place))),
            (0, place),
            (1, place + side),
        )
    solution = vc.solve(vc.Problem(lagrangian, vc.Fixed(*first), vc.Fixed(*last)))
    assert solution.extremal.form.coordinates.numbers is not None
    assert "integrand" not in vars(solution.extremal.form.stated)
    at_origin = vc.solve(vc.Problem(lambda x, y, v: ca.sqrt((1 + v**2) / y), vc.Fixed(0, 0), vc.Fixed(1, 1)))
    assert solution.value == pytest.approx(at_origin.value, rel=1e-14)


def test_expressions_are_made_when_they_are_asked_for():
    lagrangian, start, end = PROBLEMS["descent"]
    problem = vc.Problem(lagrangian, vc.Fixed(*start), vc.Fixed(*end), parameters={"g": 9.81})
    form = vc.solve(problem, vc.Ritz()).extremal.form
    assert "integrand" not in vars(form.stated)
    assert isinstance(Lagrangian(form.symbols, form.integrand).n, int)
    assert "integrand" in vars(form.stated)
