"""One value from a curve nearby, against many values of which it is one."""

import casadi as ca
import numpy as np
import pytest

import varcalc as vc
from varcalc.formulation.singular import forms
from varcalc.methods.ritz import family
from varcalc.methods.ritz.system import Places
from varcalc.numerics.mesh import Space


def graph(lagrangian, start=(0, 0), end=(1, 1), **options):
    return vc.Problem(lagrangian, vc.Fixed(*start), vc.Fixed(*end), **options)


PROBLEMS = {
    "brachistochrone": graph(lambda x, y, v: ca.sqrt((1 + v**2) / y)),
    "soap film": graph(lambda x, y, v: y * ca.sqrt(1 + v**2), (-0.3, 1), (0.3, 1.2)),
    "a maximum": graph(lambda x, y, v: -(v**2) - y**4, (0, 1), (1, 2), maximise=True),
    "two functions": vc.Problem(
        lambda x, y, v: ca.sumsqr(v) + ca.sumsqr(y) ** 2, vc.Fixed(0, [0, 1]), vc.Fixed(1, [1, None])
    ),
    "three functions": vc.Problem(
        lambda x, y, v: ca.sqrt(1 + ca.sumsqr(v)) * (1 + y[0] ** 2), vc.Fixed(0, [0, 1, 2]), vc.Fixed(2, [1, 1, None])
    ),
    "a curve": vc.Curve(lambda q, dq: ca.sqrt(ca.sumsqr(dq)) * (1 + q[1] ** 2), vc.At([0, 1]), vc.At([1, 0.5])),
}  # fmt: skip


def both(form, degree, start, tol):
    """The solution of one value, None where there is none, and what is found for many values of which it is one."""
    with np.errstate(all="ignore"):
        alone = vc.Ritz().continued(form, degree, start, tol)
        places = Places(np.array([form.span]), form.ends.start, form.ends.end, form.problem.parameter_values[None])
        together = family.solved(form, places, np.array([degree]), [start], tol, near=True)
    return alone, together


@pytest.mark.parametrize("degree", [10, 16])
@pytest.mark.parametrize("name", PROBLEMS)
def test_the_answer_of_the_family(name, degree):
    solution = vc.solve(PROBLEMS[name], vc.Ritz(), tol=1e-6)
    form = forms(PROBLEMS[name])[0]
    near = Space(np.array(form.span), degree, form.n).fit(lambda s: solution.extremal.evaluate(s, 0))
    alone, together = both(form, degree, near, 1e-5)
    assert together.stands[0]
    assert alone is not None
    assert alone.stats.degree == together.degree[0] == degree
    assert alone.value == pytest.approx(form.sign * together.value[0], rel=1e-14)
    assert alone.error.value == pytest.approx(together.error[0], rel=1e-3, abs=4e-15)
    assert alone.error.curve == pytest.approx(together.curve[0], rel=1e-3, abs=1e-13)
    assert alone.extremal.coefficients == pytest.approx(together.coefficients[0], rel=1e-7, abs=1e-8)


@pytest.mark.parametrize("end", [np.pi, 3.3, 4.0])
def test_nothing_is_claimed_of_what_is_no_minimum(end):
    # beyond pi the second variation is negative, at pi it vanishes
    form = forms(graph(lambda x, y, v: v**2 - y**2, (0, 0), (end, 0)))[0]
    start = Space(np.array([0.0, end]), 10).fit(lambda s: 0.1 * s[None] * (end - s[None]))
    alone, together = both(form, 10, start, 1e-10)
    assert alone is None or not alone.status.ok
    assert not together.stands[0]


@pytest.mark.parametrize(
    "lagrangian",
    [
        lambda x, y, v: v**2 / y,  # no number on the way from 1 to -1
        lambda x, y, v: (v**2 - 25) ** 2,  # Legendre's condition fails at the slope of the chord
    ],
)
def test_a_curve_that_cannot_be_has_no_answer(lagrangian):
    form = forms(graph(lagrangian, (0, 1), (1, -1)))[0]
    start = Space(np.array([0.0, 1.0]), 6).fit(lambda s: 1 - 2 * s[None])
    alone, _ = both(form, 6, start, 1e-8)
    assert alone is None


def test_a_tolerance_that_the_degree_does_not_meet_is_left_to_the_family():
    form = forms(graph(lambda x, y, v: v**2 + 900 * y**2, (0, 1), (1, 1)))[0]
    start = Space(np.array([0.0, 1.0]), 6).fit(lambda s: np.ones((1, len(s))))
    alone, together = both(form, 6, start, 1e-10)
    assert alone is None
    assert together.stands[0]
    assert together.degree[0] > 6


def test_a_single_value_takes_this_way(monkeypatch):
    problem = graph(lambda x, y, v, p: v**2 + p.k * y**2, parameters={"k": 1.0})
    known = vc.solve(problem, vc.Ritz())
    monkeypatch.setattr("varcalc.methods.ritz.family.solved", None)
    moved = vc.solve(problem.with_parameters({"k": 1.1}), vc.Ritz(), guess=known)
    k = np.sqrt(1.1)
    assert moved.value == pytest.approx(k / np.tanh(k), rel=1e-11)
    assert moved.stats.unknowns == known.stats.unknowns
