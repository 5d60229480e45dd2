"""The direct method for many values at once, against its own climb for one."""

import casadi as ca
import numpy as np
import pytest

import varcalc as vc
from varcalc.formulation.singular import forms
from varcalc.methods.ritz import family
from varcalc.methods.ritz.system import Places
from varcalc.numerics.mesh import Space


def graph(lagrangian, start=(0, 0), end=(1, 1)):
    return vc.Problem(lagrangian, vc.Fixed(*start), vc.Fixed(*end))


PROBLEMS = {
    "brachistochrone": graph(lambda x, y, dy: ca.sqrt((1 + dy**2) / y)),
    "flat brachistochrone": graph(lambda x, y, dy: ca.sqrt((1 + dy**2) / y), end=(5, 0.5)),
    "soap film": graph(lambda x, y, dy: y * ca.sqrt(1 + dy**2), (-0.3, 1), (0.3, 1.2)),
    "exponential": graph(lambda x, y, dy: dy**2 + 30 * y**2, (0, 1), (1, 2)),
    "two functions": vc.Problem(
        lambda x, y, dy: ca.sumsqr(dy) + ca.sumsqr(y) ** 2, vc.Fixed(0, [0, 1]), vc.Fixed(1, [1, None])
    ),
    "a curve": vc.Curve(lambda q, dq: ca.sqrt(ca.sumsqr(dq)) * (1 + q[1] ** 2), vc.At([0, 1]), vc.At([1, 0.5])),
}  # fmt: skip


@pytest.mark.parametrize("tol", [1e-6, 1e-12])
@pytest.mark.parametrize("name", PROBLEMS)
def test_the_answer_of_the_climb(name, tol):
    alone, form = vc.solve(PROBLEMS[name], vc.Ritz(), tol=tol), forms(PROBLEMS[name])[0]
    places = Places(np.array([form.span]), form.ends.start, form.ends.end, form.problem.parameter_values[None])
    degrees, lines = family.straight_starts(form, places)
    with np.errstate(all="ignore"):
        found = family.solved(form, places, degrees, lines, tol, near=False)
    assert found.stands[0]
    assert abs(found.value[0] - alone.value) <= found.error[0] + alone.error.value
    assert found.error[0] <= tol * max(1.0, abs(alone.value))
    assert found.degree[0] == alone.stats.degree
    # what the last step of one leaves, the other may have taken
    assert found.error[0] == pytest.approx(alone.error.value, rel=0.5, abs=1e-14 + 1e-4 * tol)


def test_many_intervals_at_once():
    # the integral of y'^2 + y^2 from (a, 1) to (b, 1) is 2 tanh((b - a) / 2)
    form = forms(graph(lambda x, y, dy: dy**2 + y**2, (0, 1), (1, 1)))[0]
    spans = np.array([[0.0, 1.0], [-1.0, 2.0], [3.0, 3.5]])
    ones = np.ones((3, 1))
    start = Space(np.array([-1.0, 1.0]), 6).fit(lambda s: np.ones((1, len(s))))
    places = Places(spans, ones, ones, np.zeros((3, 0)))
    found = family.solved(form, places, np.full(3, 6), [start] * 3, 1e-12, near=True)
    assert found.stands.all()
    exact = 2 * np.tanh(0.5 * np.diff(spans, axis=1)[:, 0])
    assert np.all(np.abs(found.value - exact) <= found.error + 1e-15)


def test_nothing_is_claimed_of_what_is_no_minimum():
    # beyond pi the second variation is negative, at pi it vanishes
    form = forms(graph(lambda x, y, dy: dy**2 - y**2, (0, 0), (1, 0)))[0]
    spans = np.array([[0.0, 3.0], [0.0, np.pi], [0.0, 3.3]])
    places = Places(spans, np.zeros((3, 1)), np.zeros((3, 1)), np.zeros((3, 0)))
    start = Space(np.array([-1.0, 1.0]), 10).fit(lambda s: 0.1 * (1 - s[None] ** 2))
    for near in (True, False):
        found = family.solved(form, places, np.full(3, 10), [start] * 3, 1e-10, near=near)
        assert not found.stands[1:].any()


def test_a_curve_that_leaves_the_domain_has_no_answer():
    form = forms(graph(lambda x, y, dy: dy**2 / y, (0, 1), (1, 1)))[0]
    places = Places(np.array([[0.0, 1.0]]), np.array([[1.0]]), np.array([[-1.0]]), np.zeros((1, 0)))
    start = Space(np.array([-1.0, 1.0]), 6).fit(lambda s: np.ones((1, len(s))))
    assert not family.solved(form, places, np.array([6]), [start], 1e-10, near=False).stands.any()
