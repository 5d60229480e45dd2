"""Zero false successes, on the first random problems of the campaign in benchmarks/ and on what judges them."""

import casadi as ca
import numpy as np
import pytest

import varcalc as vc
from campaigns.manufactured import KINDS, draw, kind_of
from campaigns.records import Record
from campaigns.routes import ROUTES
from campaigns.truth import Answer, Extremal, Outcome, Truth, judged
from campaigns.witness import index, residual
from random_pairs import SEED, solved

PAIRS = range(7, 37)
"""The sixth of all is refused only after many seconds (a weight x^4 of the slope that vanishes inside)."""


@pytest.mark.parametrize("route", ["Ritz (Newton)", "Collocation"])
def test_no_wrong_answer_is_called_right(route):
    records = [solved(Record(kind_of(n), str(n), "1", route)) for n in PAIRS]
    assert [record for record in records if record.outcome == Outcome.FALSE.name] == []
    right = sum(record.outcome == Outcome.RIGHT.name for record in records)
    assert right >= len(PAIRS) // 3  # a method that refuses everything would pass the rest


def test_every_kind_is_among_the_first_draws():
    assert {kind_of(n) for n in PAIRS} == set(KINDS)


def test_a_manufactured_curve_is_the_extremal_with_the_value_said():
    numbers = [n for n in PAIRS if kind_of(n) in ("convex", "quadratic")]
    for number in numbers[:10]:
        _, drawn = draw(SEED, number)
        solution = vc.solve(drawn.problem, vc.Collocation())
        assert abs(solution.value - drawn.truth.extremals[0].value) <= 1e-9 * max(1.0, abs(solution.value))
        assert (vc.verify(solution).index == 0) is drawn.truth.has_minimum


def test_the_witness_tells_a_stationary_curve_and_its_index():
    swing = vc.Problem(lambda x, y, dy: (dy**2 - y**2) / 2, vc.Fixed(0, 0), vc.Fixed(4, np.sin(4)))
    assert residual(swing, np.sin, np.cos) < 1e-4
    assert residual(swing, lambda x: x * np.sin(4) / 4, lambda x: np.full_like(x, np.sin(4) / 4)) > 0.1
    assert index(swing, np.sin, np.cos) == 1


SADDLE_AND_MINIMUM = Truth((Extremal(1.0, True), Extremal(2.0, False)), frozenset({vc.Verdict.UNBOUNDED}))


@pytest.mark.parametrize(
    ("answer", "truth", "minimises", "outcome"),
    [
        (Answer(True, 1.0, 1e-12), SADDLE_AND_MINIMUM, True, Outcome.RIGHT),
        (Answer(True, 2.0, 1e-12), SADDLE_AND_MINIMUM, True, Outcome.FALSE),
        (Answer(True, 2.0, 1e-12), SADDLE_AND_MINIMUM, False, Outcome.OTHER),
        (Answer(True, 1.5, 1e-12), SADDLE_AND_MINIMUM, False, Outcome.FALSE),
        (Answer(True, 1.0, 1e-12), Truth(()), False, Outcome.FALSE),
        (Answer(False), SADDLE_AND_MINIMUM, True, Outcome.MISSED),
        (Answer(False), Truth((Extremal(2.0, False),)), True, Outcome.REFUSED),
        (Answer(False), Truth((Extremal(2.0, False),)), False, Outcome.MISSED),
        (Answer(False, verdict=vc.Verdict.UNBOUNDED), Truth(()), True, Outcome.MISREASONED),
        (Answer(False, applies=False), SADDLE_AND_MINIMUM, True, Outcome.INAPPLICABLE),
    ],
)  # fmt: skip
def test_an_answer_is_judged(answer, truth, minimises, outcome):
    assert judged(answer, truth, minimises)[0] is outcome


def test_of_two_extremals_nearer_than_the_floor_the_nearer_one_was_found():
    close = Truth((Extremal(1.0, True), Extremal(1.0 + 1e-10, False)))
    assert judged(Answer(True, 1.0 + 1e-10, 1e-14), close, True)[0] is Outcome.FALSE
    assert judged(Answer(True, 1.0 + 1e-11, 1e-14), close, True)[0] is Outcome.RIGHT


def test_routes_name_the_methods():
    film = vc.Problem(lambda x, y, dy: y * ca.sqrt(1 + dy**2), vc.Fixed(-0.5, 1), vc.Fixed(0.5, 1))
    answer, solution = ROUTES["Collocation"].answer(film, None)
    assert answer.ok
    assert solution.rung == "Collocation"
