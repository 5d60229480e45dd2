"""The picture of a comparison: what is drawn, and that nothing global is touched."""

import subprocess
import sys
from dataclasses import dataclass, replace

import numpy as np
import pytest

import varcalc as vc
from varcalc.charts import comparison_picture
from varcalc.charts.colours import COLOURS
from varcalc.charts.comparison import ROUNDING_LABEL
from varcalc.charts.lines import ALIGNED, DRAWN_POINTS, DrawnCurve, distance_to, free_directions
from varcalc.charts.panels import FLOOR, LABEL_GAP, apart
from varcalc.solution import ErrorEstimate, Solution, Status
from varcalc.study.compare import Comparison, Row
from varcalc.study.reference import Exact


@dataclass(frozen=True)
class Route:
    """A stand-in for a method."""


def length(q, dq):
    return (dq.T @ dq) ** 0.5


@pytest.fixture
def graph():
    return vc.Problem(lambda x, y, dy: (1 + dy**2) ** 0.5, vc.Fixed(0, 0), vc.Fixed(3, 4), name="shortest path")


def row(problem, label, curve, span=(0.0, 1.0), claimed=1e-9):
    """A route that answered with ``curve``, shape (m,) to (n, m)."""
    x = np.linspace(*span, 5)
    error = ErrorEstimate(claimed, claimed)
    solution = Solution(problem, Route(), Status.SOLVED, 5.0, error, x, lambda s, derivative: curve(s))
    return Row(label, solution.method, Status.SOLVED, 5.0, claimed=claimed, solution=solution)


def straight(offset=0.0):
    return lambda x: 4 * x[None] / 3 + offset * np.sin(np.pi * x[None] / 3)


def drawn(panel, label):
    (line,) = (line for line in panel.get_lines() if line.get_label() == label)
    return line


def test_every_curve_and_every_difference_is_drawn(graph):
    rows = (row(graph, "A", straight(1e-6), (0, 3)), row(graph, "B", straight(1e-9), (0, 3)))
    figure = comparison_picture(Comparison(graph, rows, Exact(5.0, lambda x: 4 * x / 3), 1e-10))
    upper, lower = figure.axes
    for label in ("closed form", "A", "B"):
        line = drawn(upper, label)
        assert len(line.get_xdata()) == DRAWN_POINTS
        np.testing.assert_allclose(line.get_ydata(), 4 * line.get_xdata() / 3, atol=2e-6)
    assert lower.get_yscale() == "log"
    differences = sorted({float(np.max(line.get_ydata())) for line in lower.get_lines()})[1:]
    np.testing.assert_allclose(differences, [1e-9, 1e-6], rtol=1e-3)
    assert [text.get_text() for text in upper.get_legend().get_texts()] == ["closed form", "A", "B"]
    assert {"A", "B"} <= {text.get_text() for text in lower.texts}
    assert upper.get_title(loc="left") == "shortest path: J = 5"
    assert (upper.get_ylabel(), lower.get_xlabel()) == ("y", "x")


def test_curves_that_coincide_alternate_in_stripes(graph):
    rows = tuple(row(graph, label, straight(), (0, 3)) for label in "ABC")
    upper = comparison_picture(Comparison(graph, rows, None, 1e-10)).axes[0]
    offsets = {drawn(upper, label)._unscaled_dash_pattern[0] for label in "ABC"}
    assert len(offsets) == 3
    assert all(line.get_linestyle() == "-" for line in upper.get_legend().get_lines())


def test_a_method_has_its_colour_in_every_picture(graph):
    methods = [vc.Ritz(), vc.Ritz(optimiser=vc.Ipopt()), vc.Collocation(), vc.Shooting(), vc.FirstIntegral(), None]

    def colours(chosen):
        rows = []
        for method in chosen:
            answered = row(graph, vc.compare(graph, [method], tol=1e-3).rows[0].label, straight(), (0, 3))
            rows.append(replace(answered, method=method))
        upper = comparison_picture(Comparison(graph, tuple(rows), None, 1e-10)).axes[0]
        return {r.label: drawn(upper, r.label).get_color() for r in rows}

    everything = colours(methods)
    assert len(set(everything.values())) == len(methods)
    assert everything["Ritz"] == COLOURS["Ritz"][0]
    for chosen in (methods[::-1], methods[1:3], methods[4:], [methods[1]]):
        assert colours(chosen).items() <= everything.items()


def test_variants_and_strangers_are_told_apart(graph):
    methods = [vc.Ritz(), *(vc.Ritz(degree=d) for d in (4, 6, 8)), Route(), Route()]
    rows = tuple(replace(row(graph, str(i), straight(), (0, 3)), method=m, label=str(i)) for i, m in enumerate(methods))
    upper = comparison_picture(Comparison(graph, rows, None, 1e-10)).axes[0]
    assert len({drawn(upper, r.label).get_color() for r in rows}) == len(rows)


def test_labels_stay_by_their_lines_without_overlap():
    for heights in ([0.5], [0.0, 0.001, 0.5, 0.999, 1.0], [0.3, 0.31, 0.32, 0.4], [-0.2, 1.3], [0.98] * 4):
        placed = apart(np.array(heights))
        assert np.all(np.diff(placed) >= LABEL_GAP - 1e-9)
        assert placed.min() >= 0
        assert placed.max() <= 1
    np.testing.assert_allclose(apart(np.array([0.1, 0.5, 0.9])), [0.1, 0.5, 0.9])
    np.testing.assert_allclose(apart(np.array([0.1, 0.5, 0.5])), [0.1, 0.5 - LABEL_GAP / 2, 0.5 + LABEL_GAP / 2])


def test_nothing_is_written_upon_the_differences(graph):
    rows = tuple(row(graph, label, straight(), (0, 3)) for label in "AB")
    lower = comparison_picture(Comparison(graph, rows, None, 1e-10)).axes[-1]
    assert ROUNDING_LABEL in {text.get_text() for text in lower.texts}
    assert all(text.xy[0] > 1 for text in lower.texts)


def circle(middle=(0.0, 0.0), start=0.0, radius=1.0):
    def curve(t):
        angle = 2 * np.pi * (t + start)
        return np.array(middle)[:, None] + radius * np.array([np.cos(angle), np.sin(angle)])

    return curve


def area(q, dq):
    return (q[0] * dq[1] - q[1] * dq[0]) / 2


def enclosing(lagrangian):
    return vc.Curve(lagrangian, vc.Periodic(), vc.Periodic(), [vc.Isoperimetric(length, 2 * np.pi)], maximise=True)


def test_closed_curves_are_laid_upon_each_other():
    problem = enclosing(area)
    rows = (row(problem, "A", circle((3, -1), 0.3, 1 + 1e-9)), row(problem, "B", circle(), claimed=1e-13))
    upper, lower = comparison_picture(Comparison(problem, rows, None, 1e-10)).axes
    assert upper.get_legend().get_title().get_text() == ALIGNED
    for a, b in zip(drawn(upper, "A").get_data(), drawn(upper, "B").get_data(), strict=True):
        np.testing.assert_allclose(a, b, atol=3e-9)
    np.testing.assert_allclose(lower.get_lines()[0].get_ydata(), 1e-9, rtol=1e-3)


def test_an_open_curve_stays_where_it_is():
    problem = vc.Curve(length, vc.At((0, 0)), vc.At((1, 1)))
    rows = tuple(row(problem, label, lambda t: np.tile(t, (2, 1)), claimed=1e-9) for label in "AB")
    upper = comparison_picture(Comparison(problem, rows, None, 1e-10)).axes[0]
    assert upper.get_legend().get_title().get_text() == ""


def test_a_closed_curve_is_moved_only_where_that_costs_nothing():
    assert free_directions(enclosing(area)).tolist() == [True, True]
    assert free_directions(enclosing(lambda q, dq: length(q, dq) * (1 + q[1] ** 2))).tolist() == [True, False]
    wall = [vc.Isoperimetric(length, 3), vc.Bound(lambda q, dq: q[0], lower=0)]
    assert free_directions(vc.Curve(area, vc.Periodic(), vc.Periodic(), wall)).tolist() == [False, True]


def test_without_a_closed_form_the_most_certain_route_is_the_measure(graph):
    rows = (row(graph, "A", straight(1e-6), (0, 3)), row(graph, "B", straight(), (0, 3), claimed=1e-13))
    lower = comparison_picture(Comparison(graph, rows, None, 1e-10)).axes[-1]
    assert lower.get_ylabel() == "distance from\nB"
    assert "B" not in {text.get_text() for text in lower.texts}


def test_equal_numbers_are_drawn_at_the_floor(graph):
    rows = tuple(row(graph, label, straight(), (0, 3)) for label in "AB")
    lower = comparison_picture(Comparison(graph, rows, None, 1e-10)).axes[-1]
    assert np.all(lower.get_lines()[0].get_ydata() == pytest.approx(4 * FLOOR))


def test_one_curve_alone_has_no_differences(graph):
    figure = comparison_picture(Comparison(graph, (row(graph, "A", straight(), (0, 3)),), None, 1e-10))
    assert len(figure.axes) == 1
    assert figure.axes[0].get_xlabel() == "x"


def test_closed_form_alone_is_drawn(graph):
    refused = Row("A", Route(), Status.REFUSED, reason="why")
    figure = comparison_picture(Comparison(graph, (refused,), Exact(5.0, lambda x: 4 * x / 3), 1e-10))
    assert drawn(figure.axes[0], "closed form").get_xdata()[-1] == 3.0


def test_nothing_to_draw_is_said(graph):
    refused = Row("A", Route(), Status.REFUSED, reason="why")
    with pytest.raises(ValueError, match="there is no curve to draw"):
        comparison_picture(Comparison(graph, (refused,), Exact(5.0), 1e-10))


@pytest.mark.parametrize("downward", [False, True])
def test_downward_turns_the_last_coordinate(graph, downward):
    comparison = Comparison(graph, (row(graph, "A", straight(), (0, 3)),), None, 1e-10)
    low, high = comparison.chart(downward=downward).axes[0].get_ylim()
    assert bool(low > high) is downward


def test_a_sliding_end_is_compared_where_both_curves_are(graph):
    rows = (row(graph, "A", straight(), (0.0, 2.9)), row(graph, "B", straight(), (0.0, 3.0), claimed=1e-13))
    lower = comparison_picture(Comparison(graph, rows, None, 1e-10)).axes[-1]
    assert max(lower.get_lines()[0].get_xdata()) == pytest.approx(2.9)


def test_each_component_has_its_panel():
    problem = vc.Problem(lambda x, y, dy: dy.T @ dy, vc.Fixed(0, (0, 0)), vc.Fixed(1, (1, 2)), name="pair")
    rows = tuple(row(problem, label, lambda x: np.array([x, 2 * x])) for label in "AB")
    figure = comparison_picture(Comparison(problem, rows, Exact(5.0, lambda x: np.array([x, 2 * x])), 1e-10))
    assert [panel.get_ylabel() for panel in figure.axes[:-1]] == ["$y_{1}$", "$y_{2}$"]
    np.testing.assert_allclose(drawn(figure.axes[1], "B").get_ydata()[-1], 2.0)


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_curve_is_drawn_in_its_plane_or_by_components(dimension):
    problem = vc.Curve(length, vc.At([0.0] * dimension), vc.At([1.0] * dimension), name="line")
    rows = tuple(row(problem, label, lambda t: np.tile(t, (dimension, 1))) for label in "AB")
    figure = comparison_picture(Comparison(problem, rows, None, 1e-10))
    if dimension == 2:
        assert (figure.axes[0].get_xlabel(), figure.axes[0].get_ylabel()) == ("x", "y")
        assert figure.axes[0].get_aspect() == 1.0
    else:
        assert [panel.get_ylabel() for panel in figure.axes[:-1]] == ["x", "y", "z"]
    assert figure.axes[-1].get_xlabel() == "t"


def test_distance_does_not_depend_on_the_parametrisation():
    circle = DrawnCurve(
        "circle", "0", lambda t: np.array([np.cos(2 * np.pi * t**2), np.sin(2 * np.pi * t**2)]), (0.0, 1.0)
    )
    angles = np.linspace(0.1, 6.1, 200)
    outside = (1 + 1e-11) * np.array([np.cos(angles), np.sin(angles)])
    np.testing.assert_allclose(distance_to(circle, outside), 1e-11, rtol=1e-4)


@pytest.mark.parametrize("suffix", ["png", "pdf", "svg"])
def test_the_picture_can_be_written(graph, tmp_path, suffix):
    rows = (row(graph, "A", straight(1e-6), (0, 3)), row(graph, "B", straight(), (0, 3)))
    path = tmp_path / f"picture.{suffix}"
    Comparison(graph, rows, None, 1e-10).chart().savefig(path)
    assert path.stat().st_size > 5000


def test_the_legend_may_stand_beneath(graph):
    rows = (row(graph, "A", straight(1e-6), (0, 3)), row(graph, "B", straight(1e-9), (0, 3)))
    figure = comparison_picture(Comparison(graph, rows, Exact(5.0, lambda x: 4 * x / 3), 1e-10), legend_beneath=True)
    assert [panel.get_legend() for panel in figure.axes] == [None, None]
    [legend] = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["closed form", "A", "B"]


def test_drawing_needs_no_pyplot_and_leaves_settings_alone():
    code = (
        "import sys, matplotlib; before = matplotlib.rcParams.copy(); import varcalc.charts; "
        "assert matplotlib.rcParams.copy() == before; print('matplotlib.pyplot' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-W", "ignore", "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
