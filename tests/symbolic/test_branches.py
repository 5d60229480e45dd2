"""Branches that meet are written by fmax and fmin, and only those."""

import casadi as ca
import numpy as np
import pytest

import varcalc as vc
from varcalc.symbolic.branches import JUMPING, continued

X, Y, V, MU = (ca.SX.sym(name) for name in ("x", "y", "v", "mu"))
POINTS = np.random.default_rng(7).normal(scale=3.0, size=(4, 4000))
BY_BRANCHES = ca.if_else

MEETING = {
    "size": BY_BRANCHES(V > 0, V, -V),
    "other slopes": BY_BRANCHES(V >= 0, 2 * V, -3 * V),
    "with what is smooth": BY_BRANCHES(V > 0, V**2 / 2 + V, V**2 / 2 - V),
    "a parameter": BY_BRANCHES(V > 0, MU * V, -MU * V),
    "a dead zone": BY_BRANCHES(V > 1, V - 1, BY_BRANCHES(V < -1, -V - 1, 0)),
    "a factor": ca.sqrt(1 + V**2) * BY_BRANCHES(Y > 0.5, 1 + 2 * (Y - 0.5), 1),
    "a sign": ca.sign(V) * V + V**2,
    "a comparison": Y * (Y > 0),
    "a disc": BY_BRANCHES(Y**2 + V**2 < 1, 1, Y**2 + V**2),
    "a moving level": BY_BRANCHES(ca.sin(X) < Y, Y - ca.sin(X), 2 * (ca.sin(X) - Y)),
    "a level that is a parameter": BY_BRANCHES(Y > MU, Y - MU, 0),
    "the greater": BY_BRANCHES(V**2 < 2 * V, 2 * V, V**2),
    "what rises throughout": BY_BRANCHES(Y > 0, ca.exp(Y), 1),
}
OTHERS = {
    "a jump": BY_BRANCHES(Y > 0, 2, 1) * V**2,
    "a jump in the slope": BY_BRANCHES(V > 0, V + 1, -V),
    "of one slope": BY_BRANCHES(Y > 0, Y**3 + Y, Y),
    "crossing once more": BY_BRANCHES(Y > 0.5, Y**2, 0.25),
    "no number": BY_BRANCHES(Y > 0, ca.sqrt(Y), 0),
    "along x": BY_BRANCHES(X > 0.5, X, 0.5) * V**2,
    "all but meeting": BY_BRANCHES(V > 0, V + 1e-6, -V),
    "two at once": BY_BRANCHES(ca.logic_and(V > 0, V < 1), V * (1 - V), 0),
}


def _rewritten(expression):
    return continued(expression, [X, Y, V, MU], ca.vertcat(Y, V))


@pytest.mark.parametrize("name", MEETING)
def test_branches_that_meet_are_written_by_fmax(name):
    written = _rewritten(MEETING[name])
    function = ca.Function("both", [X, Y, V, MU], [MEETING[name], written])
    new = ca.Function("new", [X, Y, V, MU], [written])
    operations = {new.instruction_id(k) for k in range(new.n_instructions())}
    assert JUMPING.isdisjoint(operations)
    before, after = (np.asarray(v) for v in function.map(POINTS.shape[1])(*(row[None] for row in POINTS)))
    assert np.allclose(after, before, rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("name", OTHERS)
def test_others_are_left_as_they_are(name):
    assert _rewritten(OTHERS[name]) is OTHERS[name]


def test_friction_by_branches_is_solved():
    problem = vc.Problem(
        lambda x, y, v: ca.if_else(v > 0, v**2 / 2 + v, v**2 / 2 - v) - 12 * y, vc.Fixed(0, 0), vc.Fixed(1, 0)
    )
    # slope 5 - 12 x up to a flat top of width 1/6
    assert vc.solve(problem).value == pytest.approx(-125 / 36, rel=1e-10)


def test_the_other_direction_of_friction_follows_its_parameter():
    problem = vc.Problem(
        lambda x, y, v, p: v**2 / 2 + ca.if_else(v > 0, p.mu * v, -p.mu * v) - 12 * y,
        vc.Fixed(0, 0), vc.Fixed(1, 0), parameters={"mu": 1.0},
    )  # fmt: skip
    for mu in (0.5, 1.0, 2.0):
        solution = vc.solve(problem.with_parameters({"mu": mu}))
        # y' = 6 - mu - 12 x up to y' = 0: -2 times the integral of (6 - mu - 12 x)^2 / 2
        assert solution.value == pytest.approx(-((6 - mu) ** 3) / 36, rel=1e-9)


@pytest.mark.parametrize("narrow", [
    lambda x: ca.fabs(x - 0.788) < 0.00857,
    lambda x: ca.logic_and(x > 0.4321, x < 0.4322),
], ids=["about a place", "between two"])  # fmt: skip
def test_a_condition_that_holds_on_a_narrow_range_is_left_as_it_is(narrow):
    """At all points at which sides are held against each other it is false, and both sides are 0."""
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    for condition in (y < 0.226, -(y - 0.226) < 0):
        written = continued(ca.if_else(ca.logic_and(narrow(x), condition), 5, 0), [x, y], y)
        function = ca.Function("written", [x, y], [written])
        place = 0.788 if float(ca.Function("n", [x], [narrow(x)])(0.788)) else 0.43215
        held = {float(function(place, height)) for height in (0.2, 0.3)}
        assert held == {0.0, 5.0}


def test_what_a_gaussian_leaves_of_a_jump_is_no_kink():
    """Both sides are 0 but for a thousandth of x; and they differ by y there and by more within it."""
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    spike = ca.exp(-(((x - 0.788) / 1e-4) ** 2))
    for branch, value in ((400 * spike, 400.0), (y + 400 * spike, 400.5)):
        function = ca.Function("written", [x, y], [continued(ca.if_else(y > 0, branch, 0), [x, y], y)])
        assert float(function(0.788, 0.5)) == pytest.approx(value, rel=1e-12)
        assert float(function(0.788, -0.5)) == 0.0


def test_what_numpy_has_no_form_of_is_held_against_itself():
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    rise = ca.erfinv(x)
    function = ca.Function("written", [x, y], [continued(ca.if_else(y > 0, y + rise, rise - y), [x, y], y)])
    assert JUMPING.isdisjoint(map(function.instruction_id, range(function.n_instructions())))
    assert float(function(0.3, -2.0)) == pytest.approx(2 + float(ca.erfinv(ca.DM(0.3))), rel=1e-14)
