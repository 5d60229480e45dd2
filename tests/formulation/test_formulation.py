"""Forms: one shape for graphs, sliding ends, curves in space, maxima."""

import math
from typing import Any

import casadi as ca
import numpy as np
import pytest

import varcalc as vc
from varcalc.formulation import Refraction, broken_form, formulate, on_curve, straight
from varcalc.formulation.form import through
from varcalc.formulation.height import height
from varcalc.methods.ritz.integrands import pointwise


def square(x: Any, y: Any, dy: Any) -> Any:
    return dy**2


def length(q: Any, dq: Any) -> Any:
    return ca.norm_2(dq)


def test_the_straight_line_keeps_what_one_end_leaves_open() -> None:
    nan = math.nan
    line = straight((0, 2), np.array([1, 2, nan, nan]), np.array([3, nan, 5, nan]))
    assert line(np.array([0.0, 1.0, 2.0])) == pytest.approx(np.array([[1, 2, 3], [2, 2, 2], [5, 5, 5], [0, 0, 0]]))


def test_the_broken_line_through_waypoints() -> None:
    line = straight((0, 1), np.zeros(2), np.ones(2))
    broken = through((0, 1), line, ((0.5, (3.0, 0.5)),))
    assert broken(np.array([0.25, 0.5, 0.75])) == pytest.approx(np.array([[1.5, 3, 2], [0.25, 0.5, 0.75]]))


def test_a_graph_keeps_its_symbols() -> None:
    given = vc.Problem(square, vc.Fixed(0, 1), vc.Free(2), [vc.Through(1.5, 0)], breakpoints=(0.5,))
    form = formulate(given)
    assert form.lift is None
    assert form.symbols is given.symbols
    assert form.span == (0, 2)
    assert form.conditions.knots == (0.5, 1.5)
    assert form.ends.start == pytest.approx(np.array([[1.0]]))
    assert np.isnan(form.ends.end).all()
    assert form.same_functional
    assert not form.has_inequalities


def test_slopes_fixed_at_second_order() -> None:
    given = vc.Problem(
        lambda x, y, dy, ddy: ca.sumsqr(ddy), vc.Fixed(0, (1, 2), (None, 4)), vc.Fixed(1, (None, 5)), order=2
    )
    form = formulate(given)
    assert np.array_equal(form.ends.start, [[1, 2], [math.nan, 4]], equal_nan=True)
    assert np.array_equal(form.ends.end, [[math.nan, 5], [math.nan] * 2], equal_nan=True)


def test_a_maximum_is_minimised_with_the_sign_turned() -> None:
    form = formulate(vc.Problem(square, vc.Fixed(0, 0), vc.Fixed(1, 1), maximise=True))
    assert form.sign == -1
    assert float(ca.Function("L", form.symbols.all, [form.integrand])(0, 0, 3, [], [], [])) == -9


def test_sliding_ends_are_stated_on_the_unit_interval() -> None:
    given = vc.Problem(
        lambda x, y, dy: x + y * dy**2, vc.OnCurve(lambda x, y: y - x, -1), vc.OnCurve(lambda x, y: x + y - 4, 3)
    )
    form = formulate(given)
    assert form.span == (0, 1)
    assert form.start.unknowns == pytest.approx([-1, 3])
    # from x = 1 to 5, at the quarter: x = 2, y' = 8 / 4
    value = ca.Function("L", form.symbols.all, [form.integrand])(0.25, 7, 8, [], [], [1, 5])
    assert float(value) == pytest.approx(4 * (2 + 7 * 4))
    assert form.lift is not None
    assert [float(v) for v in form.lift.function(0.25, 7, 8, [1, 5], [])] == [2, 7, 4, 8]
    assert form.ends.joint is not None
    equations = ca.Function(
        "e", [form.ends.joint.start, form.ends.joint.end, form.symbols.unknowns], [form.ends.joint.equations]
    )
    assert np.asarray(equations(2.5, 0.5, [1, 5])).ravel() == pytest.approx([1.5, 1.5])


def test_an_end_slides_on_a_curve() -> None:
    # the shortest way from the origin to the line x + y = 2, and between two circles
    line = vc.Problem(lambda x, y, dy: ca.sqrt(1 + dy**2), vc.Fixed(0, 0), vc.OnCurve(lambda x, y: x + y - 2, 1.5))
    solution = vc.solve(line)
    assert solution.value == pytest.approx(math.sqrt(2), rel=1e-12)
    assert solution.x[-1] == pytest.approx(1, abs=1e-6)
    assert solution.y(0.5) == pytest.approx(0.5, abs=1e-6)


def test_a_point_of_the_curve_is_found_for_the_guess() -> None:
    given = vc.Problem(square, vc.Fixed(0, 0), vc.OnCurve(lambda x, y: ca.exp(y) - x, 2))
    assert isinstance(given.end, vc.OnCurve)
    assert on_curve(given.end, given) == pytest.approx([math.log(2)], abs=1e-10)
    never = vc.OnCurve(lambda x, y: 1 + y**2, 2)
    assert np.isnan(on_curve(never, given)).all()


def test_side_conditions_know_their_constraint() -> None:
    form = formulate(
        vc.Problem(
            square,
            vc.Fixed(0, 0),
            vc.Fixed(1, 1),
            [
                vc.Bound(lambda x, y, dy: y, upper=2),
                vc.Isoperimetric(lambda x, y, dy: y, 0.7),
                vc.Through(0.5, 0.6),
                vc.Holonomic(lambda x, y: (y - x) * (y - 0.6)),
                vc.Isoperimetric(lambda x, y, dy: y, lower=0),
            ],
        )
    )
    assert [(c.index, c.equality) for c in form.conditions.integrals] == [(1, True), (4, False)]
    assert [(c.index, c.lower, c.upper) for c in form.conditions.pathwise] == [(0, -math.inf, 2), (3, 0, 0)]
    assert form.has_inequalities


def test_a_constraint_given_twice_counts_twice() -> None:
    constraint = vc.Isoperimetric(lambda x, y, dy: y, lower=0.0)
    form = formulate(vc.Problem(square, vc.Fixed(0, 0), vc.Fixed(1, 1), [constraint, vc.Through(0.5, 1)]))
    assert [c.index for c in form.conditions.integrals] == [0]


def test_a_positive_curve_is_solved_by_its_energy() -> None:
    form = formulate(vc.Curve(length, vc.At((0, 0)), vc.At((3, 4))))
    assert form.coordinates.energetic
    assert not form.coordinates.gauged
    value = ca.Function("F", form.symbols.all, [form.integrand, form.functional])(0, [0, 0], [3, 4], [], [], [])
    assert [float(v) for v in value] == [25, 5]


def test_a_closed_curve_has_a_gauge() -> None:
    def swept(q: Any, dq: Any) -> Any:
        return (q[0] * dq[1] - q[1] * dq[0]) / 2

    given = vc.Curve(swept, vc.Periodic(), vc.Periodic(), [vc.Isoperimetric(length, 2 * math.pi)], maximise=True)
    form = formulate(given)
    assert form.coordinates.gauged
    assert form.ends.periodic
    assert not form.coordinates.energetic
    # the gauge vanishes at constant speed, and only there
    functions = ca.Function("F", form.symbols.all, [form.integrand, form.functional])
    here, there = (functions(0, [1, 0], [0, speed], [], [], [2.0]) for speed in (2.0, 3.0))
    assert float(here[0]) == float(here[1]) == -1
    assert float(there[0]) > float(there[1])
    solution = vc.solve(given)
    assert solution.value == pytest.approx(math.pi, rel=1e-10)
    # the circle of radius 1: dA / dlength = 1
    assert solution.multipliers[0] == pytest.approx(1, rel=1e-7)


@pytest.mark.parametrize(("plane", "side"), [((0, 1), 1), ((1, 0), 1), ((0, 2), 1), ((1, 2), -1)])
def test_a_closed_curve_begins_as_the_circle_that_is_best(plane: tuple[int, int], side: int) -> None:
    first, second = plane

    def swept(q: Any, dq: Any) -> Any:
        return side * (q[first] * dq[second] - q[second] * dq[first]) / 2

    count = 2 if max(plane) == 1 else 3
    loop = vc.Periodic(n=count)
    given = vc.Curve(swept, loop, loop, [vc.Isoperimetric(length, 3)], maximise=True)
    assert vc.solve(given, vc.Collocation()).value == pytest.approx(9 / (4 * math.pi), abs=1e-9)


@pytest.mark.parametrize("side", [1, -1])
def test_a_closed_curve_begins_as_a_circle_that_meets_the_level(side: int) -> None:
    def swept(q: Any, dq: Any) -> Any:
        return side * (q[0] * dq[1] - q[1] * dq[0]) / 2

    given = vc.Curve(length, vc.Periodic(), vc.Periodic(), [vc.Isoperimetric(swept, 2)])
    assert vc.solve(given, vc.Collocation()).value == pytest.approx(2 * math.sqrt(2 * math.pi), abs=1e-9)


def test_a_gauge_weighs_the_same_with_a_derivative_added() -> None:
    def area(q: Any, dq: Any) -> Any:
        return q[1] * dq[0]

    def more(q: Any, dq: Any) -> Any:
        return area(q, dq) + 50 * dq[0] - 7 * q[0] * dq[0]

    # it is what the price of length is times that of another length, and vanishes with the right one
    forms = [formulate(vc.Curve(f, vc.At((-1, 0)), vc.At((1, 0)), [vc.Isoperimetric(length, 4)])) for f in (area, more)]
    gauges = [
        float(
            ca.Function("gauge", form.symbols.all, [form.integrand - form.functional])(0, [0, 3], [5, 1], [], [], [2])
        )
        for form in forms
    ]
    assert gauges[1] == pytest.approx(gauges[0], rel=1e-2)


def test_end_costs_are_stated_with_the_sign() -> None:
    form = formulate(
        vc.Problem(
            square, vc.Free(0, n=None), vc.Fixed(1, 1), end_cost=lambda x0, y0, x1, y1: x1 + 10 * y0, maximise=True
        )
    )
    assert form.ends.joint is not None
    assert float(ca.Function("M", [form.ends.joint.start, form.ends.joint.end], [form.ends.joint.cost])(2, 1)) == -21


def test_the_wrong_thing_is_refused() -> None:
    with pytest.raises(TypeError, match="problem must be a Problem or a Curve, not 3"):
        formulate(3)  # type: ignore[arg-type]


def test_derivatives_of_a_curve_that_is_broken_often_do_not_take_every_piece_for_every_entry() -> None:
    problem = vc.Problem(
        lambda x, y, dy: dy**2 / 2 + y**4 - 9 * ca.sign(ca.fabs(dy) - 2), vc.Fixed(0, 0), vc.Fixed(1, 0)
    )

    def instructions_each(count: int) -> float:
        corners = np.arange(1, count + 1) / (count + 1)
        turns = np.arange(count + 2) % 2 * 3.0 / (count + 1)
        places = [Refraction(c, None) for c in corners]
        function = pointwise(
            broken_form(problem, [], lambda x: np.interp(x, [0, *corners, 1], turns)[None], None, places)
        )
        return float(function.n_instructions() / function.numel_out(0))

    assert instructions_each(32) < 1.5 * instructions_each(8)


def test_vertices_within_round_off_of_others_or_of_an_end_are_left_out():
    form = formulate(vc.Problem(lambda x, y, v: v**2, vc.Fixed(-50, 0), vc.Fixed(50, 1)))
    near = np.nextafter(12.0, 13.0)
    assert form.on_mesh([12.0, near, np.nextafter(50.0, 0.0), -50.0, 20.0]).conditions.knots == (12.0, 20.0)


def test_bends_that_ordinates_round_off_are_not_felt():
    """About 3/4 a parabola of second degree grows with one power, though what is added there below 1e-15 is rounded."""
    problem = vc.Problem(
        lambda x, y, v: v**2 / 4 + 2 * ca.cos(2 * x + 3) * (y - 0.75) ** 2, vc.Fixed(0, 0.75), vc.Fixed(math.pi, 0.75),
        [vc.Isoperimetric(lambda x, y, v: (y - 0.75) ** 2, 0.5)],
    )  # fmt: skip
    assert height(formulate(problem)) == math.pi
