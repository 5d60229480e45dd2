"""The pictures of speed against accuracy: what is drawn where, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from varcalc.charts import claims_picture, cold_picture, convergence_picture, work_precision_picture
from varcalc.charts.colours import COLOURS, colours_by_label
from varcalc.charts.panels import FLOOR
from varcalc.charts.work_precision import BRIEFEST
from varcalc.study.records import Record
from varcalc.study.routes import Knob


def record(method="Ritz", setting=1e-6, error=1e-7, claimed=2e-7, **options):
    times = {"build_ms": 1.0, "solve_ms": 2.0, "resolve_ms": 0.5}
    given = {"problem": "a", "status": "solved", "size": 1.0, "value_error": error, "claimed_error": claimed}
    return Record(**{"method": method, "setting": setting} | given | times | options)


def failed(method="Shooting", **options):
    return record(method, status="refused", value_error=None, claimed_error=None, resolve_ms=None, **options)


def points(panel, colour, marker="o"):
    lines = [line for line in panel.get_lines() if line.get_color() == colour and line.get_marker() == marker]
    return [tuple(p) for line in lines for p in zip(line.get_xdata(), line.get_ydata(), strict=True)]


def times(figure):
    """The panels of times, three a problem; those of convergence and claims come before them."""
    return [panel for i, panel in enumerate(figure.axes) if i % 5 >= 2]


def along_h(errors, unknowns=(4, 8, 16), **options):
    return [
        record("Ritz(degree=1)", 1 / n, e, knob=Knob.ELEMENT, curve="h, degree 1", route="Ritz", unknowns=n, **options)
        for n, e in zip(unknowns, errors, strict=True)
    ]


def test_a_point_a_tolerance_at_its_time_and_relative_error():
    records = [record(error=-1e-3, setting=1e-2, size=10.0), record(error=1e-9, setting=1e-8, solve_ms=7.0)]
    panels = times(work_precision_picture(records))
    assert points(panels[0], COLOURS["Ritz"][0]) == [(1.0, 1e-4), (1.0, 1e-9)]
    assert points(panels[1], COLOURS["Ritz"][0]) == [(2.0, 1e-4), (7.0, 1e-9)]
    assert points(panels[2], COLOURS["Ritz"][0]) == [(0.5, 1e-4), (0.5, 1e-9)]
    names = [p.get_xlabel().partition(",")[0] for p in panels]
    assert names == ["build", "solve", "re-solve"]
    assert all(p.get_xscale() == p.get_yscale() == "log" for p in panels)


def test_a_failure_is_drawn_at_the_top_edge_at_the_time_it_took():
    panels = times(work_precision_picture([record(), failed(solve_ms=40.0)]))
    assert points(panels[1], COLOURS["Shooting"][0], "x") == [(40.0, panels[1].get_ylim()[1])]
    assert points(panels[2], COLOURS["Shooting"][0], "x") == []


def test_an_option_that_is_turned_is_a_line_over_the_unknowns_with_its_order():
    (convergence, *_) = work_precision_picture(along_h([1e-4, 1e-4 / 16, 1e-4 / 256])).axes
    assert points(convergence, COLOURS["Ritz"][0]) == [(4, 1e-4), (8, 1e-4 / 16), (16, 1e-4 / 256)]
    assert [t.get_text() for t in convergence.texts] == ["$h^{4.0}$"]


def test_convergence_by_itself_is_the_same_panel():
    [panel] = convergence_picture(along_h([1e-4, 1e-4 / 16, 1e-4 / 256])).axes
    assert points(panel, COLOURS["Ritz"][0]) == [(4, 1e-4), (8, 1e-4 / 16), (16, 1e-4 / 256)]
    with pytest.raises(ValueError, match="no route has an option to turn"):
        convergence_picture([record()])


def test_values_better_than_the_closed_form_are_hollow_and_what_does_not_converge_says_so():
    naive = along_h([-0.1, -0.09, -0.089], claimed=None)
    (convergence, *_) = work_precision_picture([record(), *naive]).axes
    hollow = [line for line in convergence.get_lines() if line.get_markerfacecolor() == "white"]
    assert [tuple(p) for line in hollow for p in line.get_xydata()] == [(4, 0.1), (8, 0.09), (16, 0.089)]
    assert [t.get_text() for t in convergence.texts] == ["below the minimum,\nand not converging to it"]
    greatest = [replace(r, sought="maximum") for r in naive]
    (convergence, *_) = work_precision_picture([record(), *greatest]).axes
    assert not [p for li in convergence.get_lines() if li.get_markerfacecolor() == "white" for p in li.get_xydata()]
    assert not convergence.texts
    above = [replace(r, value_error=-r.value_error) for r in greatest]
    (convergence, *_) = work_precision_picture([record(), *above]).axes
    assert [t.get_text() for t in convergence.texts] == ["above the maximum,\nand not converging to it"]


def test_what_comes_nearer_without_an_order_is_not_said_to_stay():
    degrees = [
        record("Ritz", p, -(10.0**-p), knob=Knob.DEGREE, curve="p, one element", unknowns=p) for p in (1.0, 2.0, 3.0)
    ]
    (convergence, *_) = work_precision_picture(degrees).axes
    assert not convergence.texts


def test_a_curve_ends_at_its_first_point_at_round_off():
    (convergence, *_) = work_precision_picture(along_h([1e-9, 3e-16, 2e-16])).axes
    assert points(convergence, COLOURS["Ritz"][0]) == [(4, 1e-9), (8, 3e-16)]


def test_the_ladder_is_a_star():
    panels = times(work_precision_picture([record(), record("ladder", solve_ms=1.5)]))
    assert points(panels[1], COLOURS["NoneType"][0], "*") == [(1.5, 1e-7)]


def test_claims_lie_beside_the_convergence_of_their_problem():
    (_, claims, *_) = work_precision_picture([record(error=-3e-7, claimed=5e-7, size=10.0)]).axes
    assert points(claims, COLOURS["Ritz"][0]) == [pytest.approx((3e-8, 5e-8))]


def test_every_problem_has_its_panels_and_every_method_its_colour():
    records = [record(m, problem=p) for p in "ab" for m in ("Ritz", "Ritz(degree=4)", "ladder", "a peer")]
    figure = work_precision_picture(records)
    assert len(figure.axes) == 10
    assert [figure.axes[i].get_title(loc="left") for i in (0, 5)] == ["a", "b"]
    (legend,) = figure.legends
    names = [t.get_text() for t in legend.get_texts()][:4]
    assert names == ["Ritz", "Ritz(degree=4)", "ladder's choice", "a peer"]


def test_what_is_zero_has_a_place_on_a_logarithmic_axis():
    (first, *_) = times(work_precision_picture([record(error=0.0, build_ms=0.0)]))
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


@pytest.mark.parametrize("draw", [work_precision_picture, convergence_picture, cold_picture, claims_picture])
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
    assert all(np.isfinite(p.get_ylim()).all() for p in panels)


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
