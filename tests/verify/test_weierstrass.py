"""Slopes tried at a solution's points: few where few tell of all, and the same verdicts."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

import varcalc as vc
from varcalc.formulation.singular import forms
from varcalc.verify import slopes as trial
from varcalc.verify.slopes import vouched
from varcalc.verify.verification import SLOPE_TURNS


def graph(lagrangian, n=1):
    ends = [(0, 0), (1, 1)] if n == 1 else [(0, [0.0] * n), (1, [1.0] * n)]
    return vc.Problem(lagrangian, vc.Fixed(*ends[0]), vc.Fixed(*ends[1]))


def judged(problem):
    """The straight line from end to end as a solution of ``problem``, as far as other slopes vouch for it."""
    line = vc.solve(graph(lambda x, y, v: ca.sumsqr(v), problem.n))
    return vouched(replace(line, problem=problem), forms(problem)[0])


@pytest.mark.parametrize(
    ("lagrangian", "slopes"),
    [
        (lambda x, y, v: (2 + ca.sin(y)) * v**2 + x * v, [1]),
        (lambda x, y, v: ca.sqrt(1 + v**2), [len(SLOPE_TURNS)]),
        (lambda x, y, v: v**4 - v**2, [len(SLOPE_TURNS)]),
    ],
)
def test_where_l_is_quadratic_in_the_slope_its_own_tells_of_all(monkeypatch, lagrangian, slopes):
    counts = []
    original = trial.SlopeFan.least

    def counted(fan):
        counts.append(fan.tried.shape[2])
        return original(fan)

    monkeypatch.setattr(trial.SlopeFan, "least", counted)
    judged(graph(lagrangian))
    assert counts == slopes  # the straight line's own problem needs none


@pytest.mark.parametrize(
    ("lagrangian", "slopes"),
    [
        (lambda x, y, v: ca.sqrt(1 + v**2), 3),  # the root of a positive quadratic form
        (lambda x, y, v: (2 + ca.sin(y)) * ca.sqrt(2 + v + v**2), 3),
        (lambda x, y, v: ca.sqrt(1 + v**2) + v**2, 2 + len(SLOPE_TURNS)),
        (lambda x, y, v: ca.sqrt(1 + v**2) - 5, 2 + len(SLOPE_TURNS)),  # convex, but not positive
    ],
)
def test_what_was_evaluated_along_the_curve_is_enough(monkeypatch, lagrangian, slopes):
    # no fan of slopes is built; three slopes tell of all where L is the root of a quadratic form
    monkeypatch.setattr(trial.SlopeFan, "of", lambda *given: pytest.fail("a fan was built"))
    solution = vc.solve(graph(lagrangian))
    assert solution.status is vc.Status.SOLVED
    tried = []
    original = vc.Problem.integrand_values
    monkeypatch.setattr(
        vc.Problem, "integrand_values", lambda self, x, *rest: tried.append(len(x)) or original(self, x, *rest)
    )
    assert vouched(solution, solution.extremal.form) is solution
    assert sum(tried) == slopes * len(solution.extremal.along.x)


def test_a_solution_known_to_be_local_is_verified():
    line = vc.solve(graph(lambda x, y, v: v**2))
    check = vc.verify(replace(line, local=True))
    assert check.verdict is vc.Verdict.MINIMUM
    assert any("better curves are known" in str(finding) for finding in check.findings)


@pytest.mark.parametrize("curvature", [-1.0, -1e-3, -1e-7])
def test_a_concave_component_is_refused_however_slightly(curvature):
    bent = graph(lambda x, y, v: v[0] ** 2 + curvature * v[1] ** 2 + ca.sumsqr(y), 2)
    found = judged(bent)
    assert found.status is vc.Status.REFUSED
    assert found.verdict in {vc.Verdict.SADDLE, vc.Verdict.WEAK_MINIMUM}


def test_other_slopes_of_several_functions_are_tried():
    # y_0' = y_1' = 1 is a weak minimum, and 100 comes lower
    double = graph(lambda x, y, v: (v[0] - 1) ** 2 + (v[1] - 1) ** 2 * (1 - (v[1] - 1) ** 2 / 400), 2)
    found = judged(double)
    assert found.verdict is vc.Verdict.WEAK_MINIMUM
    assert "Weierstrass" in found.message


def test_what_is_evaluated_a_slope_does_not_grow_with_the_number_of_functions():
    rows = []
    for n in (2, 20):
        problem = graph(lambda x, y, v: ca.sqrt(1 + ca.sumsqr(v)), n)
        rows.append(trial._functions(problem).rows(1, *_at_ones(n)).shape[1])
    assert rows == [3, 3]


def _at_ones(n):
    one = np.ones((1, n))
    return np.ones((1, 1)), one, one, np.zeros((1, 0)), np.zeros((1, 0)), np.zeros((1, 0)), one
