"""Collocation of many values at once: as right as closed forms, and what is in doubt is left to solves of its own."""

import math

import casadi as ca
import numpy as np
import pytest

import varcalc as vc
from varcalc.formulation import formulate
from varcalc.methods.collocation import batched
from varcalc.methods.collocation.system import collocation_space
from varcalc.methods.ritz.system import Places
from varcalc.problems import bratu
from varcalc.problems._curves import Catenary

STRONGEST = 3.513830719125161
"""The strongest reaction that has a steady state (Bratu's problem)."""


def film():
    return vc.Problem(
        lambda x, y, dy, p: y * ca.sqrt(1 + dy**2),
        vc.Fixed(vc.Parameter("left"), 1), vc.Fixed(vc.Parameter("right"), vc.Parameter("height")),
        parameters={"left": -0.5, "right": 0.5, "height": 1.0},
    )  # fmt: skip


def reaction(rate=1.0):
    return vc.Problem(bratu.functional, vc.Fixed(0, 0), vc.Fixed(1, 0), parameters={"rate": rate})


def at_rates(rates):
    count = len(rates)
    return Places(np.tile([0.0, 1.0], (count, 1)), np.zeros((count, 1)), np.zeros((count, 1)), np.array(rates)[:, None])


def upper_state(rate):
    """The coefficients of the hotter of the two states, the unstable one, on one polynomial."""
    found = max(vc.extremals(reaction(rate)), key=lambda s: s.y(0.5))
    form = formulate(reaction(rate))
    space = collocation_space(form, np.array([0.0, 1.0]), 16)
    return space.fit(lambda x: found.y(x)[None]), form


@pytest.mark.parametrize("tol", [1e-4, 1e-8, 1e-12])
def test_a_sweep_of_bratus_reaction(tol):
    rates = np.linspace(0.1, 3.5, 60)
    found = vc.sweep(reaction(), {"rate": rates}, vc.Collocation(), tol=tol)
    exact = np.array([bratu.reaction(rate, "", "").exact.value for rate in rates])
    assert not found.failures
    assert np.all(np.abs(found.values - exact) <= found.claimed_errors + 1e-14)
    assert found.claimed_errors.max() <= tol * np.abs(exact).max()


def test_nothing_beyond_the_fold():
    found = vc.sweep(reaction(), {"rate": np.linspace(3.25, 3.75, 21)}, vc.Collocation())
    assert [p.ok for p in found.points] == [p.values[0] < STRONGEST for p in found.points]


def test_a_sweep_of_films_with_moving_ends():
    grid = {"left": np.linspace(-0.55, -0.3, 8), "right": np.linspace(0.3, 0.55, 8), "height": [1.0, 1.1]}
    found = vc.sweep(film(), grid, vc.Collocation(), tol=1e-11)
    exact = [Catenary.over_axis((a, 1.0), (b, c)).moment_about_axis for a, b, c in (p.values for p in found.points)]
    assert not found.failures
    assert np.abs(found.values.ravel() - exact).max() <= 1e-11
    assert np.all(np.abs(found.values.ravel() - exact) <= found.claimed_errors.ravel() + 2e-15)


def test_a_solution_begun_from_another():
    first = vc.solve(reaction(), vc.Collocation())
    second = vc.solve(reaction().with_parameters({"rate": 1.0}), vc.Collocation(), guess=first)
    assert second.value == pytest.approx(first.value, abs=1e-13)
    near = vc.solve(first.problem.with_parameters({"rate": 1.2}), vc.Collocation(), guess=first)
    exact = bratu.reaction(1.2, "", "").exact
    assert abs(near.value - exact.value) <= near.error.value + 1e-15
    x = np.linspace(0, 1, 101)
    assert np.abs(near.y(x) - exact.y(x)).max() <= 1.5 * near.error.curve
    assert isinstance(near.method, vc.Collocation)
    # other methods begin with methods of their own
    assert isinstance(vc.solve(first.problem.with_parameters({"rate": 1.2}), guess=first).method, vc.Ritz)


def test_a_saddle_is_left_alone():
    coefficients, form = upper_state(2.0)
    places = at_rates([2.0])
    answers = batched.solved(form, places, np.array([16]), [coefficients], 1e-6, near=True)
    assert not answers.stands.any()


def test_a_climb():
    form = formulate(reaction())
    rates = np.linspace(3.3, 3.5, 5)
    degrees, lines = batched.straight_starts(form, at_rates(rates))
    with np.errstate(all="ignore"):
        answers = batched.solved(form, at_rates(rates), degrees, lines, 1e-12, near=False)
    exact = [bratu.reaction(rate, "", "").exact.value for rate in rates]
    assert answers.stands.all()
    assert answers.degree.min() > batched.DEGREES[0]
    assert answers.value == pytest.approx(exact, abs=1e-12)


def test_straight_lines():
    form = formulate(film())
    places = Places(np.array([[-1.0, 3.0]]), np.array([[2.0]]), np.array([[5.0]]), np.zeros((1, 3)))
    degrees, lines = batched.straight_starts(form, places)
    x, y, slopes = batched.sampled(form, places, degrees[0], np.array(lines))
    assert y[0, :, 0] == pytest.approx(2 + 0.75 * (x[0] + 1))
    assert slopes == pytest.approx(np.full(slopes.shape, 0.75))


@pytest.mark.parametrize(
    "problem",
    [
        vc.Problem(lambda x, y, dy: dy**2, vc.Fixed(0, 0), vc.Free(1)),
        vc.Problem(lambda x, y, dy: ca.sumsqr(dy), vc.Fixed(0, [0, 0]), vc.Fixed(1, [1, 1])),
        vc.Problem(lambda x, y, dy, ddy: ddy**2, vc.Fixed(0, 0, 0), vc.Fixed(1, 1, 1), order=2),
        vc.Problem(lambda x, y, dy: dy**2, vc.Fixed(0, 0), vc.Fixed(1, 1), [vc.Isoperimetric(lambda x, y, dy: y, 1.0)]),
    ],
)
def test_where_it_does_not_apply(problem):
    assert not batched.applies(formulate(problem))


def test_oscillations_beyond_the_first_conjugate_point_are_left_alone():
    # y'' = -k y: conjugate to the start at pi / sqrt(k); J = sqrt(k) cot(sqrt(k)) / 2 is a minimum before it only
    swing = vc.Problem(
        lambda x, y, dy, p: (dy**2 - p.k * y**2) / 2, vc.Fixed(0, 0), vc.Fixed(1, 1), parameters={"k": 1.0}
    )
    rates = np.array([1.0, 4.0, 9.0, 9.8, 10.2, 16.0])
    degrees, lines = batched.straight_starts(formulate(swing), at_rates(rates))
    places = Places(np.tile([0.0, 1.0], (6, 1)), np.zeros((6, 1)), np.ones((6, 1)), rates[:, None])
    degrees, lines = batched.straight_starts(formulate(swing), places)
    answers = batched.solved(formulate(swing), places, degrees, lines, 1e-9, near=False)
    assert answers.stands.tolist() == [True, True, True, True, False, False]
    exact = [math.sqrt(k) / math.tan(math.sqrt(k)) / 2 for k in rates[:4]]
    assert answers.value[:4] == pytest.approx(exact, abs=1e-9)


def test_no_luck_next_to_the_fold():
    # beyond it Newton's steps wander, and of many values none may seem to have settled
    beyond = STRONGEST + np.geomspace(1e-13, 1e-3, 400)
    form = formulate(reaction())
    known = vc.solve(reaction(STRONGEST - 1e-6), vc.Collocation()).extremal
    starts = [known.coefficients] * len(beyond)
    degrees = np.full(len(beyond), len(known.coefficients) - 1)
    with np.errstate(all="ignore"):
        assert not batched.solved(form, at_rates(beyond), degrees, starts, 1e-9, near=True).stands.any()
