"""Conditions that no curve meets together, and those that only look like it."""

from __future__ import annotations

import casadi as ca
import pytest

import varcalc as vc
from varcalc.existence.feasibility import contradiction, explained
from varcalc.solution import Status, no_answer


def graph(conditions, end=0.0, cost=lambda x, y, v: v**2):
    return vc.Problem(cost, vc.Fixed(0, 0), vc.Fixed(1, end), conditions)


def mean(value):
    return vc.Isoperimetric(lambda x, y, v: y, value)


CONTRADICTIONS = {
    # Cauchy and Schwarz: (int y)^2 <= int y^2
    "two levels": graph([mean(1.0), vc.Isoperimetric(lambda x, y, v: y**2, 0.5)]),
    "a bound and a level": graph([vc.Bound(lambda x, y, v: y, upper=0.5), mean(1.0)]),
    "a bound on the slope and the ends": graph([vc.Bound(lambda x, y, v: v, upper=1.0)], end=2.0),
    "two bounds": graph(
        [vc.Bound(lambda x, y, v: y - x, lower=0.0), vc.Bound(lambda x, y, v: y - x**2, upper=0.0)], end=1.0
    ),
    "a bound and a waypoint": graph([vc.Bound(lambda x, y, v: v, upper=1.0), vc.Through(0.5, 1.0)], end=1.0),
}


@pytest.mark.parametrize("name", CONTRADICTIONS)
def test_a_contradiction_is_infeasible(name):
    refused = vc.solve(CONTRADICTIONS[name], throw=False)
    assert refused.verdict is vc.Verdict.INFEASIBLE
    assert "constraints[0]" in refused.message


def test_the_least_miss_is_named():
    # the mean slope is 2, so that a slope of at most 1 is missed by 1
    with pytest.raises(vc.InfeasibleError, match="misses it by 1;"):
        vc.solve(CONTRADICTIONS["a bound on the slope and the ends"], vc.Ritz())


def test_conditions_give_way_by_the_same_share_of_their_sizes():
    # y <= (1 + m)/2 and a mean of 1 - m: ends that rise steeply cost little, so that m = 1/3
    found = contradiction(CONTRADICTIONS["a bound and a level"])
    assert [found.misses[0], found.misses[1]] == pytest.approx([1 / 6, 1 / 3], abs=2e-3)


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_units_do_not_matter(scale):
    problem = graph(
        [vc.Bound(lambda x, y, v: y / scale, upper=0.5), vc.Isoperimetric(lambda x, y, v: y, scale)],
        end=0.25 * scale,
    )
    assert contradiction(problem) is not None


def test_what_has_no_minimum_for_another_reason_is_not_called_infeasible():
    # -y'^2 falls for ever under a bound on y that every curve can keep
    unbounded = graph([vc.Bound(lambda x, y, v: y, upper=0.5)], cost=lambda x, y, v: -(v**2))
    assert contradiction(unbounded) is None


def test_a_steep_curve_is_no_contradiction():
    # |y'| up to 1000 is asked for, and can be had
    steep = graph(
        [vc.Isoperimetric(lambda x, y, v: ca.sqrt(1 + v**2), 500.0), vc.Bound(lambda x, y, v: y, lower=-1.0)],
        cost=lambda x, y, v: -(v**2),
    )
    assert contradiction(steep) is None


def test_an_end_on_a_curve_without_points_is_told_by_where_phi_is_least():
    end = vc.OnCurve(lambda x, y: (x - 2) ** 2 + y**2 + 0.25, x=1)
    with pytest.raises(vc.InfeasibleError, match=r"slides on no curve: \|phi\| comes down to 0.25, at \(2, 0\)"):
        vc.solve(vc.Problem(lambda x, y, dy: 1 + dy**2, vc.Fixed(0, 0), end))


def test_an_end_on_a_curve_that_has_points_is_not_said_to_have_none():
    end = vc.OnCurve(lambda x, y: (x - 2) ** 2 + y**2 - 0.25, x=1)
    solution = vc.solve(vc.Problem(lambda x, y, dy: -(dy**2), vc.Fixed(0, 0), end), throw=False)
    assert not solution.status.ok
    assert "slides on no curve" not in solution.message


@pytest.mark.parametrize("size", [lambda v: v**2, ca.fabs], ids=["square", "size"])
def test_slopes_that_alternate_may_meet_what_no_smooth_curve_does(size):
    """|v| >= 1 from (0, 0) to (1, 0.2) is met by slopes of 1 up to x = 0.6 and of -1 from there on."""
    problem = vc.Problem(
        lambda x, y, v: v**2 + y**2, vc.Fixed(0, 0), vc.Fixed(1, 0.2), [vc.Bound(lambda x, y, v: size(v), lower=1)]
    )
    failure = no_answer(problem, vc.Ritz(), Status.NOT_CONVERGED, "no curve was found")
    told = explained(problem, failure)
    assert told.verdict is not vc.Verdict.INFEASIBLE
