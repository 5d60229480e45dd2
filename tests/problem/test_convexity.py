"""Problems proved convex as a whole: functional, constraints, end cost and unknowns."""

import casadi as ca
import pytest

import varcalc as vc
from varcalc.problem.convexity import proved_jointly_convex

ENDS = vc.Fixed(0, 0), vc.Fixed(1, 1)


def energy(x, y, dy):
    return dy**2 / 2 + y**2


def stated(lagrangian=energy, *constraints, ends=ENDS, **options):
    return proved_jointly_convex(vc.Problem(lagrangian, *ends, constraints, **options))


def test_a_convex_lagrangian_with_fixed_free_and_periodic_ends():
    assert stated()
    assert stated(ends=(vc.Fixed(0, 0), vc.Free(1)))
    assert stated(ends=(vc.Periodic(0, 1), vc.Periodic(0, 1)))
    assert stated(lambda x, y, dy, ddy: ddy**2 - x * y, ends=(vc.Fixed(0, 0, 0), vc.Fixed(1, 0)), order=2)
    assert stated(lambda x, y, dy: ca.sumsqr(dy) + y[0] * y[1] + ca.sumsqr(y), ends=(vc.Fixed(0, [0, 0]), vc.Free(1)))
    assert not stated(lambda x, y, dy: dy**2 - y**2)
    assert not stated(lambda x, y, dy: y * ca.sqrt(1 + dy**2), ends=(vc.Fixed(0, 1), vc.Fixed(1, 1)))


def test_a_functional_to_be_made_greatest_is_to_be_concave():
    assert stated(lambda x, y, dy: y - ca.sqrt(1 + dy**2), maximise=True)
    assert not stated(maximise=True)
    assert not stated(lambda x, y, dy: y - ca.sqrt(1 + dy**2))


def test_parameters_count_at_their_values():
    problem = vc.Problem(lambda x, y, dy, p: dy**2 + p.k * y**2, *ENDS, parameters={"k": 1.0})
    assert proved_jointly_convex(problem)
    assert not proved_jointly_convex(problem.with_parameters({"k": -1.0}))


def test_the_interval_counts_at_its_ends_values():
    problem = vc.Problem(
        lambda x, y, dy, p: (2 - x) * dy**2, vc.Fixed(0, 0), vc.Fixed(vc.Parameter("b"), 1), parameters={"b": 1.0}
    )
    assert proved_jointly_convex(problem)
    assert not proved_jointly_convex(problem.with_parameters({"b": 3.0}))


def test_unknowns_are_watched_with_the_curve():
    assert stated(lambda x, y, dy, p: dy**2 + (y - p.c * x) ** 2, unknowns={"c": 0.5})
    assert not stated(lambda x, y, dy, p: dy**2 + p.c * y, unknowns={"c": 0.5})


@pytest.mark.parametrize(
    ("constraint", "expected"),
    [
        (vc.Isoperimetric(lambda x, y, dy: x * y, 0.5), True),
        (vc.Isoperimetric(lambda x, y, dy: x * y, lower=0.2, upper=0.5), True),
        (vc.Isoperimetric(lambda x, y, dy: ca.sqrt(1 + dy**2), 1.6), False),
        (vc.Isoperimetric(lambda x, y, dy: ca.sqrt(1 + dy**2), upper=1.6), True),
        (vc.Isoperimetric(lambda x, y, dy: ca.sqrt(1 + dy**2), lower=1.6), False),
        (vc.Bound(lambda x, y, dy: y - x**2, lower=0.0), True),
        (vc.Bound(lambda x, y, dy: dy, lower=-2.0, upper=2.0), True),
        (vc.Bound(lambda x, y, dy: y**2 + dy**2, upper=9.0), True),
        (vc.Bound(lambda x, y, dy: y**2 + (x - 0.5) ** 2, lower=0.04), False),
        (vc.Bound(lambda x, y, dy: ca.sqrt(y + 1), lower=0.5), True),
        (vc.Through(0.5, 0.7), True),
    ],
)
def test_constraints_are_to_admit_a_convex_set(constraint, expected):
    assert stated(energy, constraint) == expected


def test_holonomic_constraints_are_to_be_affine():
    ends = vc.Fixed(0, [0, 0]), vc.Fixed(1, [1, 1])
    assert stated(lambda x, y, dy: ca.sumsqr(dy), vc.Holonomic(lambda x, y: y[0] - y[1]), ends=ends)
    assert not stated(lambda x, y, dy: ca.sumsqr(dy), vc.Holonomic(lambda x, y: y[0] - y[1] ** 2), ends=ends)


def test_the_end_cost_is_to_be_convex_and_no_end_may_slide():
    ends = vc.Fixed(0, 0), vc.Free(1)
    assert stated(ends=ends, end_cost=lambda x0, y0, x1, y1: x1 * (y1 - 1) ** 2)
    assert not stated(ends=ends, end_cost=lambda x0, y0, x1, y1: -x1 * y1**2)
    assert not stated(ends=(vc.Fixed(0, 0), vc.OnCurve(lambda x, y: y - 1 + x, 1.0)))


def test_curves_in_space():
    start, end = vc.At([0, 0]), vc.At([1, 1])
    length, above = lambda q, dq: ca.norm_2(dq), vc.Bound(lambda q, dq: q[1], lower=-1.0)
    assert proved_jointly_convex(vc.Curve(length, start, end, [above]))
    assert not proved_jointly_convex(vc.Curve(lambda q, dq: (2 + q[1]) * ca.norm_2(dq), start, end))
    slow = vc.Bound(lambda q, dq: ca.norm_2(dq), upper=5.0)
    assert not proved_jointly_convex(vc.Curve(length, start, end, [slow]))
    surface = vc.OnSurface(lambda q: q[0] + q[1] - 3, [1.5, 1.5])
    assert not proved_jointly_convex(vc.Curve(length, start, surface))


def test_a_lagrangian_of_tabulated_data_is_convex_where_the_data_are_nowhere_negative():
    table = ca.interpolant("n", "linear", [[0.0, 0.5, 1.0]], [1.0, 2.0, 3.0])
    assert stated(lambda x, y, dy: table(x) * dy**2)
    assert not stated(lambda x, y, dy: (table(x) - 1.5) * dy**2)
    assert not stated(lambda x, y, dy: table(y) * dy**2)
