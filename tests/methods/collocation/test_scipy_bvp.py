"""SciPy's solver as a second opinion: it agrees where there is an answer, and is not believed where there is none."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np
import pytest

from varcalc.formulation import formulate
from varcalc.methods.collocation.method import Collocation
from varcalc.methods.collocation.scipy_bvp import SciPyBvp
from varcalc.problem.conditions import Fixed, Free, Isoperimetric, Periodic, Through
from varcalc.problem.problem import Problem
from varcalc.solution import Status

ROUND = Periodic(0, 2 * math.pi)


def soap_film(a):
    return Problem(lambda x, y, dy: y * ca.sqrt(1 + dy**2), Fixed(-a, 1), Fixed(a, 1))


def spring(x0, y0, x1, y1):
    return (y1 - 2) ** 2 / 2


@pytest.mark.parametrize(
    "problem",
    [
        soap_film(0.5),
        Problem(lambda x, y, dy: dy**2 / 2 - 3 * ca.exp(y), Fixed(0, 0), Fixed(1, 0)),
        Problem(lambda x, y, dy: 0.01 * dy**2 + y**2, Fixed(0, 1), Fixed(1, 0)),
        Problem(lambda x, y, dy: (dy**2 + y**2) / 2, Fixed(0, 1), Free(1), end_cost=spring),
        Problem(lambda x, y, dy: (ca.sumsqr(dy) - y[0] ** 2) / 2 + y[1] ** 2, Fixed(0, (0, 1)), Fixed(1, (1, None))),
        Problem(lambda x, y, dy: dy**2 / 2 + y**2 - y * ca.cos(x), ROUND, ROUND),
        Problem(lambda x, y, dy, ddy: ddy**2 / 2 - y + y**2, Fixed(0, 0, 0), Free(1), order=2),
        Problem(lambda x, y, dy, ddy: ddy**2 / 2 + dy**4 / 4 - y, Fixed(0, 0), Fixed(1, 0.5), order=2),
    ],
    ids=["soap film", "Bratu", "layer", "end cost", "vector", "periodic", "cantilever", "hinged"],
)
def test_second_opinion_agrees(problem):
    form = formulate(problem)
    second = SciPyBvp().solve(form, tol=1e-10, guess=None)
    assert second.status is Status.SOLVED, second.message
    first = Collocation().solve(form, tol=1e-12, guess=None)
    assert abs(second.value - first.value) <= second.error.value + first.error.value + 1e-13
    x = np.linspace(*problem.span, 101)
    assert np.abs(second.y(x) - first.y(x)).max() <= 2 * (second.error.curve + first.error.curve) + 1e-12


@pytest.mark.parametrize("beyond", [1e-6, 1e-4])
def test_its_claim_beyond_the_fold_is_not_believed(beyond):
    problem = soap_film(0.662743419349182 + beyond)
    solution = SciPyBvp(nodes=200).solve(formulate(problem), tol=1e-4, guess=None)
    assert solution.status is Status.NOT_CONVERGED
    assert "solve_bvp" in solution.message


@pytest.mark.parametrize(
    "constraint", [Isoperimetric(lambda x, y, dy: y, 1.0), Through(0.5, 1.0)], ids=["level", "waypoint"]
)
def test_what_it_does_not_treat_is_refused(constraint):
    problem = Problem(lambda x, y, dy: dy**2, Fixed(0, 0), Fixed(1, 0), [constraint])
    assert SciPyBvp().solve(formulate(problem), tol=1e-6, guess=None).status is Status.REFUSED


def test_nodes_are_checked():
    with pytest.raises(ValueError, match=r"SciPyBvp\.nodes"):
        SciPyBvp(nodes=1)
