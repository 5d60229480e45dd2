"""One value alone: the answers of a climb, and none where there is any doubt."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np
import pytest

import varcalc as vc
from varcalc.formulation.singular import forms
from varcalc.methods.ritz.method import _Climb
from varcalc.methods.ritz.single import Single, minimum, solved
from varcalc.problems._curves import Catenary, Cycloid


def graph(lagrangian, start=(0, 0), end=(1, 1), **more):
    return vc.Problem(lagrangian, vc.Fixed(*start), vc.Fixed(*end), **more)


def alone(problem, tol=1e-10):
    with np.errstate(all="ignore"):
        return solved(forms(problem)[0], tol, None)


FALL = (lambda x, y, v: ca.sqrt((1 + v**2) / (2 * 9.81 * y)), (0, 0))
CASES = {
    "descent": (*FALL, (1, 1), Cycloid.through(1, 1).descent_time(9.81)),
    "flat descent": (*FALL, (5, 1), Cycloid.through(5, 1).descent_time(9.81)),
    "film": (
        lambda x, y, v: y * ca.sqrt(1 + v**2), (-0.5, 1), (0.5, 1),
        Catenary.over_axis((-0.5, 1), (0.5, 1)).moment_about_axis,
    ),
    "spring": (lambda x, y, v: v**2 + y**2, (0, 0), (1, 1), 1 / math.tanh(1)),
    "two springs": (lambda x, y, v: ca.sumsqr(v) + y[0] ** 2, (0, [0, 0]), (1, [1, 1]), 1 / math.tanh(1) + 1),
}  # fmt: skip


@pytest.mark.parametrize("tol", [1e-4, 1e-8, 1e-12])
@pytest.mark.parametrize("name", CASES)
def test_values_are_those_of_the_closed_forms_within_what_is_claimed(name, tol):
    lagrangian, start, end, exact = CASES[name]
    found = alone(graph(lagrangian, start, end), tol)
    assert abs(found.value - exact) <= found.error + 4e-16 * abs(exact)
    assert found.error <= tol * max(1.0, abs(exact))


@pytest.mark.parametrize("name", CASES)
def test_a_climb_finds_the_same_curve(name):
    lagrangian, start, end, _ = CASES[name]
    problem = graph(lagrangian, start, end)
    found, climbed = vc.solve(problem, vc.Ritz(), tol=1e-12), _Climb(vc.Ritz(), forms(problem)[0], 1e-12).run(None)
    x = np.linspace(*problem.span, 41)[1:-1]
    np.testing.assert_allclose(found.y(x), climbed.y(x), rtol=0, atol=10 * (found.error.curve + climbed.error.curve))


def test_a_maximum_is_the_minimum_of_the_negative():
    found = vc.solve(graph(lambda x, y, v: -(v**2) - y**2, maximise=True), vc.Ritz())
    assert found.value == pytest.approx(-1 / math.tanh(1), rel=1e-12)


@pytest.mark.parametrize(
    "lagrangian",
    [
        lambda x, y, v: -(v**2) + y**2,  # Legendre's condition fails
        lambda x, y, v: v**2 - 100 * y**2,  # beyond the first conjugate point
        lambda x, y, v: ca.sqrt(v**2 + 1e-12),  # not resolved by any of the degrees
    ],
)
def test_where_there_is_doubt_there_is_no_answer(lagrangian):
    assert alone(graph(lagrangian)) is None


def test_gradient_and_hessian_are_those_of_the_functional():
    form = forms(graph(*CASES["descent"][:3]))[0]
    with np.errstate(all="ignore"):
        system = Single(form, 6)
        z = system.fit(form.baseline) + 0.01 * np.cos(np.arange(12))
        at, step = system.evaluate(z), 1e-5
        hessian = system.assembled(at.blocks)
        for k, unit in enumerate(np.eye(len(z))):
            after, before = system.evaluate(z + step * unit), system.evaluate(z - step * unit)
            assert (after.value - before.value) / (2 * step) == pytest.approx(at.gradient[k], rel=1e-7, abs=1e-9)
            np.testing.assert_allclose(
                (after.gradient - before.gradient) / (2 * step),
                hessian[k],
                rtol=1e-6,
                atol=1e-7 * np.abs(hessian).max(),
            )


def test_the_value_beyond_the_last_step_is_told_from_the_step():
    form = forms(graph(*CASES["film"][:3]))[0]
    with np.errstate(all="ignore"):
        system = Single(form, 10)
        z, value, _ = minimum(system, system.fit(form.baseline))
        assert system.evaluate(z).value == pytest.approx(value, rel=4e-16)
