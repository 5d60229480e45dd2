"""Measuring speed and accuracy: what a record holds, and that a stored file holds the same."""

import json
import math
import sys
from dataclasses import replace

import casadi as ca
import pytest

import varcalc as vc
from varcalc.study.records import Record, measured_order
from varcalc.study.reference import load
from varcalc.study.routes import Knob, Route, mesh_dials
from varcalc.study.work_precision import LINE_TOLERANCES, convergence, naively


def arc_length(x, y, dy):
    return ca.sqrt(1 + dy**2)


def line(**options):
    return vc.Problem(arc_length, vc.Fixed(0, 0), vc.Fixed(3, 4), name="line", **options)


def film():
    (reference, *_) = load("soap_film")
    return reference


def measured(problems, methods, tolerances=(1e-6,), **options):
    return vc.work_precision(problems, methods, tolerances, repeats=1, **options)


def test_a_line_has_a_point_for_each_tolerance_from_1e_2_to_1e_14():
    assert LINE_TOLERANCES[0] == 1e-2
    assert LINE_TOLERANCES[-1] == 1e-14
    assert len(LINE_TOLERANCES) == 13


def test_a_record_holds_costs_and_the_errors_delivered_and_claimed():
    coarse = vc.Ritz(degree=3, refine=False)
    (record,) = measured([film()], [coarse]).records
    solution = vc.solve(film().problem, coarse, tol=1e-6)
    assert (record.problem, record.method, record.setting) == ("soap_film", "Ritz(degree=3, refine=False)", 1e-6)
    assert record.status == solution.status.name.lower().replace("_", " ")
    # a trial curve lies above the minimum, so the sign is known
    assert record.value_error == pytest.approx(solution.value - film().exact.value, rel=1e-6)
    assert record.value_error > 0
    assert record.claimed_error == pytest.approx(solution.error.value)
    assert 0 < record.curve_error < 1e-2
    assert record.unknowns == solution.stats.unknowns
    assert record.iterations == solution.stats.iterations
    assert min(record.build_ms, record.solve_ms, record.resolve_ms) > 0


def test_the_error_of_the_curve_is_its_largest_distance_from_the_exact_one():
    off = vc.Exact(5.0, lambda x: 4 * x / 3 + 1e-3)
    (record,) = measured([line()], [vc.Ritz()], exact=[off]).records
    assert record.curve_error == pytest.approx(1e-3, rel=1e-9)


def test_every_problem_by_every_method_at_every_tolerance():
    found = measured([film(), line()], [vc.Ritz(), None], (1e-3, 1e-9), exact=[None, 5.0])
    assert len(found.records) == 8
    assert {r.method for r in found.records} == {"Ritz", "ladder"}
    assert all(r.ok and abs(r.value_error) <= 10 * r.claimed_error + 1e-13 for r in found.records)
    assert found.astray == ()


def test_a_method_that_finds_nothing_is_recorded_with_its_time_and_reason():
    wall = line(constraints=[vc.Bound(lambda x, y, dy: dy, upper=2)])
    (record,) = measured([wall], [vc.Collocation()], exact=[5.0]).records
    assert (record.status, record.ok, record.value_error, record.resolve_ms) == ("refused", False, None, None)
    assert record.solve_ms > 0
    assert record.reason


def test_what_does_not_apply_is_not_tried():
    reference = vc.Reference("line", line(), vc.Exact(5.0), inapplicable={vc.Ritz: "for the test"})
    (record,) = measured([reference], [vc.Ritz()]).records
    assert (record.status, record.reason, record.solve_ms) == ("not applicable", "for the test", None)


def test_without_a_closed_form_no_error_is_made_up():
    (record,) = measured([line()], [vc.Ritz()]).records
    assert record.ok
    assert record.claimed_error is not None
    assert record.value_error is None
    assert record.curve_error is None


def test_a_wrong_closed_form_leaves_the_answer_astray():
    found = measured([line()], [vc.Ritz()], exact=[5.1])
    assert found.astray == found.records
    assert found.records[0].value_error == pytest.approx(-0.1)


def test_errors_are_relative_to_the_size_of_the_value():
    large = vc.Problem(arc_length, vc.Fixed(0, 0), vc.Fixed(3e6, 4e6))
    (record,) = measured([large], [vc.Ritz()], exact=[5e6]).records
    assert record.size == 5e6


def test_a_warm_solve_begins_from_the_last_curve_at_a_moved_parameter(monkeypatch):
    seen = []
    spring = vc.Problem(
        lambda x, y, dy, p: dy**2 + p.k * y**2, vc.Fixed(0, 0), vc.Fixed(1, 1), parameters={"k": 4.0}, name="spring"
    )
    original = vc.solve

    def watched(problem, method, **options):
        seen.append((problem.parameters["k"], options.get("guess") is not None))
        return original(problem, method, **options)

    monkeypatch.setattr(sys.modules["varcalc.study.work_precision"], "solve", watched)
    measured([spring], [vc.Ritz()], exact=[2 / math.tanh(2)])
    warm = [k for k, guessed in seen if guessed]
    assert warm
    assert set(warm) == {4.0 * 1.001, 4.0}
    assert [k for k, guessed in seen if not guessed] == [4.0, 4.0]


def test_a_stored_file_holds_the_measurements(tmp_path):
    found = measured([film()], [vc.Ritz(), vc.FirstIntegral()])
    path = tmp_path / "measured.json"
    found.save(path)
    again = vc.WorkPrecision.load(path)
    assert again == found
    assert {"varcalc", "casadi", "python", "processor"} <= set(again.about)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("not json", "holds no JSON"),
        ("[]", "holds no measurements of format 1"),
        ('{"format": 0}', "holds no measurements of format 1"),
        ('{"format": 1, "about": {}, "records": [{"problem": "a", "speed": 3}]}', "is damaged"),
        ('{"format": 1, "about": {}}', "is damaged"),
    ],
)
def test_a_file_of_something_else_is_refused(tmp_path, text, message):
    path = tmp_path / "other.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=message):
        vc.WorkPrecision.load(path)


@pytest.mark.parametrize(
    ("arguments", "options", "error", "message"),
    [
        (([], [vc.Ritz()]), {}, ValueError, "problems is empty"),
        (([line()], []), {}, ValueError, "methods is empty"),
        (([line()], [vc.Ritz()], []), {}, ValueError, "tolerances is empty"),
        (([3.0], [vc.Ritz()]), {}, TypeError, r"problems\[0\] must be a Reference, a Problem or a Curve"),
        (([line()], [vc.Ritz]), {}, TypeError, r"methods\[0\] is the class Ritz"),
        (([line()], [vc.Ritz()]), {"exact": [5.0, 5.0]}, ValueError, "exact must have one entry a problem, 1 of them"),
        (([line()], [vc.Ritz()]), {"repeats": 0}, ValueError, "repeats must be at least 1"),
        (([line()], [vc.Ritz()], [-1.0]), {}, ValueError, "tol must be a positive number"),
    ],
)
def test_what_cannot_be_measured_is_refused(arguments, options, error, message):
    with pytest.raises(error, match=message):
        vc.work_precision(*arguments, **options)


def along_h(errors, lengths):
    return [
        Record("a", "m", h, "solved", value_error=e, claimed_error=abs(e), knob=Knob.ELEMENT)
        for h, e in zip(lengths, errors, strict=True)
    ]


def test_the_order_is_the_slope_of_the_resolved_part():
    lengths = [1.0, 0.5, 0.25, 0.125, 0.0625, 0.03125]
    errors = [
        0.3,
        *(h**6 for h in lengths[1:4]),
        3e-16,
        1e-16,
    ]  # far from convergence, then sixth order, then round-off
    assert measured_order(along_h(errors, lengths)) == pytest.approx(6.0)
    assert measured_order(along_h(errors[:2], lengths[:2])) is None
    assert measured_order(along_h([0.1, 0.09, 0.5], lengths[:3])) is None


def test_each_dial_of_a_route_is_measured_from_coarse_to_fine():
    ritz = vc.Ritz()
    route = Route(ritz, direct=True, dials=mesh_dials(ritz, (1, 2), (2, 4, 8, 16), (2, 4)))
    records = convergence(film(), route, repeats=1).records
    by_curve = {name: [r for r in records if r.curve == name] for name in dict.fromkeys(r.curve for r in records)}
    assert {name: len(rs) for name, rs in by_curve.items()} == {"h, degree 1": 4, "h, degree 2": 4, "p, one element": 2}
    assert {r.route for r in records} == {"Ritz"}
    assert by_curve["h, degree 2"][0].method == "Ritz(degree=2, refine=False)"
    assert [r.turned for r in by_curve["h, degree 2"]] == ["h = 1/2", "h = 1/4", "h = 1/8", "h = 1/16"]
    assert [r.turned for r in by_curve["p, one element"]] == ["p = 2", "p = 4"]
    # a stationary value converges twice as fast as its curve
    assert measured_order(by_curve["h, degree 1"]) == pytest.approx(2, abs=0.1)
    assert measured_order(by_curve["h, degree 2"]) == pytest.approx(4, abs=0.2)
    assert all(r.value_error > 0 and r.resolve_ms > 0 for r in records)
    once = convergence(film(), replace(route, dials=route.dials[:1]), repeats=1, warm=False).records
    assert [(r.setting, r.value_error, r.resolve_ms) for r in once] == [
        (r.setting, r.value_error, None) for r in by_curve["h, degree 1"]
    ]


def test_a_naive_rule_at_a_singular_end_lies_below_the_minimum_with_every_sign_of_success():
    (reference, *_) = load("brachistochrone")
    records = naively(reference).records
    assert all(r.ok and r.claimed_error is None and not r.astray for r in records)
    assert all(r.value_error < -0.06 for r in records)
    assert naively(film()).records == ()  # where L is finite at the ends it teaches nothing


def test_the_table_names_every_row_and_the_reasons():
    records = (Record("a", "Ritz", 1e-4, "solved", 1, 2, 3, 4, 5, 1e-5, 1e-4, 2e-5, 10.0),)
    text = vc.WorkPrecision((*records, Record("a", "Other", 1e-4, "refused", reason="it does not apply"))).table()
    assert "+1.0e-06" in text
    assert "a, Other: it does not apply" in text


def test_the_document_is_plain_json():
    json.dumps(measured([film()], [vc.Ritz()]).document(), allow_nan=False)


def test_a_line_without_time_leaves_its_finer_settings_out():
    [reference] = load("shortest_path/curve")
    route = Route(vc.Ritz(), dials=mesh_dials(vc.Ritz(), (), (1,), (2, 4, 6)))
    found = convergence(reference, route, repeats=1, within=1e-9).records
    assert len(found) < 3
    assert len(convergence(reference, route, repeats=1, within=math.inf).records) == 3
