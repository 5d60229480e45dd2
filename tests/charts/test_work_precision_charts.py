"""The pictures of speed against accuracy: what is drawn where, and what is refused."""

import numpy as np
import pytest

from varcalc.charts import claims_picture, cold_picture, work_precision_picture
from varcalc.charts.colours import COLOURS, colours_by_label
from varcalc.charts.work_precision import BRIEFEST, FLOOR
from varcalc.study.work_precision import Record


def record(method="Ritz", setting=1e-6, error=1e-7, claimed=2e-7, **options):
    times = {"build_ms": 1.0, "solve_ms": 2.0, "resolve_ms": 0.5}
    given = {"problem": "a", "status": "solved", "size": 1.0, "value_error": error, "claimed_error": claimed}
    return Record(**{"method": method, "setting": setting} | given | times | options)


def failed(method="Shooting", **options):
    return record(method, status="refused", value_error=None, claimed_error=None, resolve_ms=None, **options)


def points(panel, colour, marker="o"):
    lines = [line for line in panel.get_lines() if line.get_color() == colour and line.get_marker() == marker]
    return [tuple(p) for line in lines for p in zip(line.get_xdata(), line.get_ydata(), strict=True)]


def test_a_point_a_tolerance_at_its_time_and_relative_error():
    records = [record(error=-1e-3, setting=1e-2, size=10.0), record(error=1e-9, setting=1e-8, solve_ms=7.0)]
    panels = work_precision_picture(records).axes
    assert points(panels[0], COLOURS["Ritz"][0]) == [(1.0, 1e-4), (1.0, 1e-9)]
    assert points(panels[1], COLOURS["Ritz"][0]) == [(2.0, 1e-4), (7.0, 1e-9)]
    assert points(panels[2], COLOURS["Ritz"][0]) == [(0.5, 1e-4), (0.5, 1e-9)]
    assert [p.get_title(loc="left") for p in panels] == ["build", "solve", "re-solve, everything built"]
    assert all(p.get_xscale() == p.get_yscale() == "log" for p in panels)


def test_a_failure_is_drawn_at_the_top_edge_at_the_time_it_took():
    panels = work_precision_picture([record(), failed(solve_ms=40.0)]).axes
    assert points(panels[1], COLOURS["Shooting"][0], "x") == [(40.0, panels[1].get_ylim()[1])]
    assert points(panels[2], COLOURS["Shooting"][0], "x") == []


def test_every_problem_has_its_row_and_every_method_its_line():
    records = [record(m, problem=p) for p in "ab" for m in ("Ritz", "Ritz(degree=4)", "ladder", "a peer")]
    figure = work_precision_picture(records)
    assert len(figure.axes) == 6
    assert [figure.axes[i].get_ylabel().split("\n")[0] for i in (0, 3)] == ["a", "b"]
    (legend,) = figure.legends
    assert [t.get_text() for t in legend.get_texts()] == ["Ritz", "Ritz(degree=4)", "ladder", "a peer"]
    assert len({line.get_color() for line in legend.get_lines()}) == 4


def test_what_is_zero_has_a_place_on_a_logarithmic_axis():
    (first, *_) = work_precision_picture([record(error=0.0, build_ms=0.0)]).axes
    assert points(first, COLOURS["Ritz"][0]) == [(BRIEFEST, FLOOR)]
    assert first.get_xlim()[0] <= BRIEFEST


def test_claims_are_drawn_against_what_was_delivered():
    records = [record(error=-3e-7, claimed=5e-7, size=10.0), record("Shooting", error=1e-3), failed("Collocation")]
    (panel,) = claims_picture(records).axes
    assert points(panel, COLOURS["Ritz"][0]) == [pytest.approx((3e-8, 5e-8))]
    assert points(panel, COLOURS["Shooting"][0]) == [pytest.approx((1e-3, 2e-7))]
    assert panel.get_xlim() == panel.get_ylim()


def test_claims_of_many_problems_are_a_grid():
    visible = [p.get_visible() for p in claims_picture([record(problem=p) for p in "abcd"]).axes]
    assert visible == [True] * 4 + [False] * 2


@pytest.mark.parametrize("draw", [work_precision_picture, cold_picture, claims_picture])
def test_nothing_to_draw_is_refused_with_the_reason(draw):
    with pytest.raises(ValueError, match="no method applied"):
        draw([record(status="not applicable")])
    with pytest.raises(ValueError, match="the errors of a are not known, as no closed form was given"):
        draw([record(value_error=None)])


def test_claims_without_answers_are_refused():
    with pytest.raises(ValueError, match="no method found an answer"):
        claims_picture([failed()])


def test_failures_alone_are_drawn():
    panels = work_precision_picture([failed()]).axes
    assert np.isfinite(panels[0].get_ylim()).all()


def test_only_the_fastest_way_to_an_accuracy_is_joined():
    times = {1e-2: (1.0, 1e-3), 1e-4: (9.0, 1e-3), 1e-6: (3.0, 1e-7), 1e-8: (20.0, 1e-9)}
    records = [record(setting=tol, build_ms=t / 2, solve_ms=t / 2, error=e) for tol, (t, e) in times.items()]
    (panel,) = cold_picture([*records, failed(build_ms=1.0, solve_ms=4.0)]).axes
    colour = COLOURS["Ritz"][0]
    assert sorted(points(panel, colour)) == [(1.0, 1e-3), (3.0, 1e-7), (9.0, 1e-3), (20.0, 1e-9)]
    assert points(panel, colour, "None") == [(1.0, 1e-3), (3.0, 1e-7), (20.0, 1e-9)]
    assert points(panel, COLOURS["Shooting"][0], "x") == [(5.0, panel.get_ylim()[1])]


def test_many_packages_have_colours_of_their_own():
    names = ["Ritz", "ladder", *(f"package {i}" for i in range(8))]
    assert len(set(colours_by_label(names).values())) == len(names)
