"""Answers held against each other: rows, agreement, tables and records."""

import importlib
import json
import math
from dataclasses import dataclass

import numpy as np
import pytest

import varcalc as vc
from varcalc.solution import ErrorEstimate, Solution, Stats, Status, VariationalError, no_answer
from varcalc.study.compare import Comparison, Row, compare, label
from varcalc.study.reference import Exact
from varcalc.symbolic.derived import derived

# the package exports the function `compare` under the module's own name
compare_module = importlib.import_module("varcalc.study.compare")


@dataclass(frozen=True)
class Told:
    """A stand-in for a method: it answers what it is told to."""

    value: float
    claimed: float = 1e-12
    status: Status = Status.SOLVED
    throws: bool = False


@dataclass(frozen=True)
class Absent:
    """A stand-in for a method that does not apply."""


@pytest.fixture
def problem():
    return vc.Problem(lambda x, y, dy: (1 + dy**2) ** 0.5, vc.Fixed(0, 0), vc.Fixed(3, 4), name="shortest path")


@derived
def something_of(problem):
    return problem.name


@pytest.fixture
def told(monkeypatch):
    """Let `solve` answer as the stand-ins say; None, the ladder, answers 5."""

    def answer(problem, method=None, *, tol=1e-10, throw=True, progress=None):
        assert throw is False
        assert progress is False, "the comparison tells of itself"
        assert not problem.cache.products, "one method's build time would be paid by another"
        something_of(problem)
        method = method or Told(5.0)
        if method.status.ok:
            error = ErrorEstimate(method.claimed, method.claimed)
            stats = Stats(build=0.001, solve=0.002, unknowns=7)
            return Solution(problem, method, method.status, method.value, error, np.array([0.0, 3.0]), stats=stats)
        solution = no_answer(problem, method, method.status, "the iteration stalled")
        if method.throws:
            raise VariationalError(solution)
        return solution

    monkeypatch.setattr(compare_module, "solve", answer)


@pytest.mark.usefixtures("told")
class TestRows:
    def test_hold_what_the_solution_says(self, problem):
        comparison = compare(problem, [Told(5 + 1e-13)], 5)
        (row,) = comparison.rows
        assert row.ok
        assert row.outcome == "solved"
        assert row.value == 5 + 1e-13
        assert row.deviation == pytest.approx(1e-13, rel=0.01)
        assert (row.claimed, row.build, row.solve, row.unknowns) == (1e-12, 0.001, 0.002, 7)
        assert row.solution.method == Told(5 + 1e-13)

    def test_deviation_is_signed(self, problem):
        assert compare(problem, [Told(4.5)], 5).rows[0].deviation == -0.5

    def test_without_a_closed_form_there_is_no_deviation(self, problem):
        assert math.isnan(compare(problem, [Told(5.0)]).rows[0].deviation)

    @pytest.mark.parametrize("throws", [False, True])
    @pytest.mark.parametrize("status", [Status.NOT_CONVERGED, Status.REFUSED])
    def test_a_method_without_an_answer_is_a_row(self, problem, status, throws):
        comparison = compare(problem, [Told(0.0, status=status, throws=throws), Told(5.0)], 5.0)
        assert not comparison.rows[0].ok
        assert comparison.rows[0].reason == "the iteration stalled"
        assert math.isnan(comparison.rows[0].deviation)
        assert comparison.agree

    def test_a_method_that_does_not_apply_is_not_tried(self, problem):
        comparison = compare(problem, [Absent(), Told(5.0)], inapplicable={Absent: "x and y both appear"})
        assert comparison.rows[0].status is None
        assert comparison.rows[0].outcome == "not applicable"
        assert comparison.rows[0].reason == "x and y both appear"
        assert comparison.rows[0].unknowns is None

    def test_the_ladder_says_which_rung_answered(self, problem):
        assert compare(problem, [None]).rows[0].label == "ladder (Told)"

    def test_methods_may_be_a_generator(self, problem):
        assert len(compare(problem, (Told(5.0) for _ in range(3))).rows) == 3


@pytest.mark.usefixtures("told")
class TestAgreement:
    def test_within_the_sum_of_claimed_errors(self, problem):
        assert compare(problem, [Told(5.0, 1e-6), Told(5.0 + 1.5e-6, 1e-6)]).agree

    def test_beyond_the_sum_of_claimed_errors(self, problem):
        comparison = compare(problem, [Told(5.0, 1e-6), Told(5.0 + 2.5e-6, 1e-6)])
        assert not comparison.agree
        (sentence,) = comparison.disagreements
        assert "differ by 2.5e-06, more than the errors they claim, 1.0e-06 and 1.0e-06" in sentence

    def test_rounding_is_no_disagreement(self, problem):
        assert compare(problem, [Told(5.0, 0.0), Told(np.nextafter(5.0, 6.0), 0.0)], 5.0).agree

    def test_every_pair_is_looked_at(self, problem):
        comparison = compare(problem, [Told(1.0), Told(2.0), Told(3.0)])
        assert len(comparison.disagreements) == 3

    @pytest.mark.parametrize(("value", "agree"), [(5.0 + 9e-9, True), (5.0 + 1.1e-8, False), (5.0 - 1.1e-8, False)])
    def test_the_closed_form_within_ten_times_the_claim(self, problem, value, agree):
        assert compare(problem, [Told(value, 1e-9)], 5.0).agree is agree

    def test_the_closed_form_within_its_own_floor(self, problem):
        assert compare(problem, [Told(5.0 + 4e-13, 0.0)], 5.0).agree
        assert not compare(problem, [Told(5.0 + 6e-13, 0.0)], 5.0).agree

    def test_scales_with_the_value(self, problem):
        assert compare(problem, [Told(5e7, 0.0), Told(5e7 + 1e-8, 0.0)], 5e7).agree
        assert not compare(problem, [Told(5e-7, 0.0), Told(5e-7 + 1e-15, 0.0)], 5e-7).agree

    def test_no_answer_at_all_is_no_agreement(self, problem):
        comparison = compare(problem, [Told(0.0, status=Status.REFUSED)])
        assert not comparison.agree
        assert comparison.disagreements == ("no route answered, so there is nothing to hold against anything",)

    @pytest.mark.parametrize("bad", [Told(math.nan), Told(5.0, math.nan)])
    def test_what_is_not_a_number_never_agrees(self, problem, bad):
        assert not compare(problem, [bad, Told(5.0)]).agree


@pytest.mark.usefixtures("told")
class TestOutput:
    @pytest.fixture
    def comparison(self, problem):
        methods = [Told(5.0), Told(5.1), Told(0.0, status=Status.NOT_CONVERGED), Absent(), None]
        return compare(
            problem, methods, Exact(5.0, description="a straight line"), inapplicable={Absent: "no symmetry"}
        )

    def test_table_is_text_that_nothing_is_cut_from(self, comparison):
        text = comparison.table()
        assert "\x1b" not in text
        assert "…" not in text
        for expected in ("Told(value=5.1)", "+1.0e-01", "not converged", "ladder (Told)", "a straight line"):
            assert expected in text
        assert "Absent: no symmetry" in text
        assert "the routes disagree:" in text
        assert all(line == line.rstrip() for line in text.splitlines())

    def test_table_says_when_routes_agree(self, problem):
        pair = [Told(5.0), Told(5.0, claimed=1e-11)]
        assert compare(problem, pair).table().endswith("the routes agree")
        assert compare(problem, pair, 5.0).table().endswith("the routes agree with each other and with the closed form")

    def test_table_says_when_only_one_route_answered(self, problem):
        refused = Told(0.0, status=Status.REFUSED)
        alone = compare(problem, [Told(5.0), refused]).table().splitlines()[-1]
        assert alone == "Told(value=5.0) is the only route that answered; there is nothing to hold it against"
        held = compare(problem, [Told(5.0), refused], 5.0).table().splitlines()[-1]
        assert held == "Told(value=5.0), the only route that answered, agrees with the closed form"

    def test_table_says_when_none_answered(self, problem):
        table = compare(problem, [Told(0.0, status=Status.REFUSED)], 5.0).table()
        assert table.endswith("\nno route answered")
        assert "disagree" not in table

    def test_record_is_plain_json(self, comparison):
        record = json.loads(json.dumps(comparison.record(), allow_nan=False))
        assert record["problem"] == "shortest path"
        assert record["exact"] == 5.0
        assert record["agree"] is False
        assert len(record["disagreements"]) == 3
        stalled = record["rows"][2]
        assert stalled["value"] is None
        assert stalled["error"] is None
        assert stalled["reason"] == "the iteration stalled"
        assert record["rows"][0]["build_seconds"] == 0.001


def test_label_shows_options_that_are_not_the_default():
    assert label(vc.Ritz()) == "Ritz"
    assert label(vc.Ritz(elements=8, degree=4)) == "Ritz(elements=8, degree=4)"
    assert label(vc.Ritz(optimiser=vc.Ipopt())) == "Ritz(optimiser=Ipopt())"


@pytest.mark.parametrize(
    ("methods", "error", "message"),
    [
        ([], ValueError, "methods is empty"),
        ([vc.Ritz], TypeError, r"methods\[0\] is the class Ritz; give an object: Ritz\(\)"),
        (["Ritz"], TypeError, r"methods\[0\] must be a method such as Ritz\(\)"),
        (vc.Ritz(), TypeError, r"methods must be a sequence, not Ritz.*; write methods=\[...\]"),
    ],
)
def test_refuses_what_is_no_method(problem, methods, error, message):
    with pytest.raises(error, match=message):
        compare(problem, methods)


def test_refuses_what_is_no_problem():
    with pytest.raises(TypeError, match="problem must be a Problem or a Curve, not 3"):
        compare(3, [vc.Ritz()])


def test_real_methods_agree_on_the_shortest_path(problem):
    methods = [vc.Ritz(), vc.Ritz(optimiser=vc.Ipopt()), vc.Collocation(), vc.Shooting(), vc.FirstIntegral(), None]
    comparison = compare(problem, methods, 5.0)
    assert isinstance(comparison, Comparison)
    assert all(isinstance(row, Row) and row.ok for row in comparison.rows), comparison.table()
    assert comparison.agree, comparison.table()


def test_the_ladder_is_no_second_route():
    wall = vc.Problem(lambda x, y, dy: dy**2, vc.Fixed(0, 0), vc.Fixed(1, 1), [vc.Bound(lambda x, y, dy: dy, upper=2)])
    table = compare(wall, [vc.Ritz(), None], tol=1e-6).table()
    assert table.endswith("Ritz is the only route that answered; there is nothing to hold it against")


def test_table_says_when_the_ladder_fails_alone():
    # stationary, but no minimum: the interval is longer than half a period
    saddle = vc.Problem(lambda x, y, dy: dy**2 - y**2, vc.Fixed(0, 0), vc.Fixed(4, 1))
    lines = compare(saddle, [vc.Collocation(), vc.Shooting(), None]).table().splitlines()
    assert lines[-2:] == ["the routes agree", "the ladder has no answer that stands"]
