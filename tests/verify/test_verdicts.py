"""One verdict, and the evidence behind it."""

import math
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from mpmath import besselj

import varcalc as vc


def stationary(problem, guess=None, method=None):
    # a curve that solve refuses as no minimum is still there to be looked at
    return vc.verify(vc.solve(problem, method or vc.Collocation(), guess=guess, throw=False))


def swing(x, y, dy):
    return (dy**2 - y**2) / 2


def travel_time(x, y, dy):
    return ca.sqrt((1 + dy**2) / (2 * 9.81 * y))


def sentences(check):
    return " / ".join(finding.sentence for finding in check.findings)


@pytest.mark.parametrize("method", [None, vc.Collocation(), vc.FirstIntegral()])
def test_the_brachistochrone_is_a_minimum_by_every_method(method):
    check = vc.verify(vc.solve(vc.Problem(travel_time, vc.Fixed(0, 0), vc.Fixed(1, 1)), method))
    assert (check.verdict, check.index) == (vc.Verdict.MINIMUM, 0)
    assert check.routes == {"Jacobi": 0, "Ritz": 0}
    assert check.residual < 1e-4
    assert check.invariants["energy"] < 1e-5


def test_a_conjugate_end_is_degenerate():
    check = stationary(vc.Problem(swing, vc.Fixed(0, 0), vc.Fixed(math.pi, 0)))
    assert check.verdict is vc.Verdict.DEGENERATE
    assert check.index == 0
    assert len(check.conjugate_points) == 0


def test_antipodes_are_degenerate():
    def point(t):
        return [math.cos(math.pi * t), math.sin(math.pi * t), 0.0]

    sphere = vc.Curve(
        lambda q, dq: ca.norm_2(dq), vc.At([1, 0, 0]), vc.At([-1, 0, 0]), [vc.Holonomic(lambda q: ca.sumsqr(q) - 1)]
    )
    solution = vc.solve(sphere, vc.Collocation(), guess=point, throw=False)
    assert solution.curve is not None
    assert vc.verify(solution).verdict is vc.Verdict.DEGENERATE


@pytest.mark.parametrize(
    ("degrees", "verdict", "index", "touches"),
    [(15, vc.Verdict.MINIMUM, 0, []), (75, vc.Verdict.SADDLE, 1, [math.tan(math.radians(15))])],
)
def test_rays_in_a_layered_medium(degrees, verdict, index, touches):
    # n^2 = 1 - 2 y: rays are the parabolas of a projectile of unit speed, and touch their envelope (the caustic)
    t = math.tan(math.radians(degrees))

    def parabola(x):
        return x * t - x**2 * (1 + t**2) / 2

    ray = vc.Problem(lambda x, y, dy: ca.sqrt((1 - 2 * y) * (1 + dy**2)), vc.Fixed(0, 0), vc.Fixed(0.5, 0))
    check = stationary(ray, parabola)
    assert (check.verdict, check.index) == (verdict, index)
    assert check.conjugate_points == pytest.approx(touches, abs=1e-10)


def test_where_legendres_condition_fails_the_index_is_infinite():
    bolza = vc.Problem(lambda x, y, dy: (1 - dy**2) ** 2 + y**2, vc.Fixed(0, 0), vc.Fixed(1, 0))
    check = stationary(bolza, lambda x: 0.0)
    assert check.verdict is vc.Verdict.SADDLE
    assert math.isinf(check.index)
    assert check.legendre == pytest.approx(-4.0)
    assert "Legendre's condition fails" in sentences(check)


@pytest.mark.parametrize("method", [vc.Collocation(), vc.Shooting()])
def test_a_maximum_is_no_weak_minimum(method):
    # y'' = -1/2 on -y'^2 + y: the extremal makes the concave functional greatest
    concave = vc.Problem(lambda x, y, dy: -(dy**2) + y, vc.Fixed(0, 0), vc.Fixed(1, 0.2))
    found = vc.solve(concave, method, throw=False)
    assert (found.status, found.verdict) == (vc.Status.REFUSED, vc.Verdict.SADDLE)
    assert vc.verify(found).verdict is vc.Verdict.SADDLE


def test_a_weak_minimum_is_told_from_a_strong_one():
    # E(w) = w^2 (1 + w) along y = 0: negative for w < -1
    weak = vc.Problem(lambda x, y, dy: dy**2 + dy**3, vc.Fixed(0, 0), vc.Fixed(1, 0))
    check = stationary(weak, lambda x: 0.0)
    assert check.verdict is vc.Verdict.WEAK_MINIMUM
    assert check.index == 0
    assert check.weierstrass < 0
    assert check.weierstrass.slope[0] < -1
    assert check.weierstrass.own == pytest.approx([0.0], abs=1e-12)


def test_a_weak_minimum_of_second_order():
    weak = vc.Problem(lambda x, y, dy, ddy: ddy**2 + ddy**3, vc.Fixed(0, 0, 0), vc.Fixed(1, 0, 0), order=2)
    assert stationary(weak, lambda x: 0.0).verdict is vc.Verdict.WEAK_MINIMUM


def test_a_curve_may_be_lower_by_zigzags():
    # F = |dq| - 2 |dq_y|^4/|dq|^3 costs less on directions that alternate steeply
    def cost(q, dq):
        return ca.norm_2(dq) - 2 * dq[1] ** 4 / ca.norm_2(dq) ** 3

    line = vc.Curve(cost, vc.At([0, 0]), vc.At([1, 0]))
    solution = vc.solve(line, vc.Collocation(), guess=lambda t: [t, 0.0], throw=False)
    assert solution.curve is not None
    check = vc.verify(solution)
    assert check.verdict is vc.Verdict.WEAK_MINIMUM


def test_maxima_are_judged_for_the_negative():
    up = vc.Problem(lambda x, y, dy: -swing(x, y, dy), vc.Fixed(0, 0), vc.Fixed(2, 1), maximise=True)
    check = vc.verify(vc.solve(up))
    assert (check.verdict, check.index) == (vc.Verdict.MAXIMUM, 0)
    assert check.legendre == pytest.approx(1.0)
    assert "lower bound of the maximum" in sentences(check)
    down = vc.Problem(lambda x, y, dy: -swing(x, y, dy), vc.Fixed(0, 0), vc.Fixed(4, 1), maximise=True)
    assert stationary(down).verdict is vc.Verdict.SADDLE


def test_where_legendres_condition_holds_only_weakly_nothing_is_claimed():
    # Gelfand and Fomin, sect. 15: the minimum 0 has a corner at 0, and L does not feel the slope where y = 0
    corner = vc.Problem(lambda x, y, dy: (y * (1 - dy)) ** 2, vc.Fixed(-1, 0), vc.Fixed(1, 1))
    solution = vc.solve(corner, vc.Ritz(elements=2), guess=lambda x: max(0.0, x), throw=False)
    assert solution.curve is not None
    check = vc.verify(solution)
    # along it every term of the Euler-Lagrange equation is what is left when larger ones cancel
    assert check.verdict is vc.Verdict.DEGENERATE
    assert check.residual < 1e-3


def test_the_kinks_of_a_coarse_mesh_are_no_corners():
    polygon = vc.solve(vc.Problem(swing, vc.Fixed(0, 0), vc.Fixed(2, 1)), vc.Ritz(elements=16, degree=1, refine=False))
    check = vc.verify(polygon)
    assert check.verdict is vc.Verdict.MINIMUM
    assert "corner" not in sentences(check)


def test_a_curve_that_is_no_extremal_is_found_out():
    solution = vc.solve(vc.Problem(swing, vc.Fixed(0, 0), vc.Fixed(2, 1)))

    def wrong(x, derivative):
        return np.atleast_2d(x / 2 + np.sin(math.pi * x) if derivative == 0 else 0.5 + math.pi * np.cos(math.pi * x))

    check = vc.verify(replace(solution, curve=wrong, extremal=None))
    assert check.verdict is vc.Verdict.NO_EXTREMAL
    assert check.residual > 0.1


def test_a_better_value_known_of_is_told():
    solution = replace(vc.solve(vc.Problem(swing, vc.Fixed(0, 0), vc.Fixed(2, 1))), local=True, lower=-1.0)
    assert "a better value is known, -1" in sentences(vc.verify(solution))


def test_an_obstacle_is_judged_by_the_variations_it_leaves():
    over = vc.Problem(
        lambda x, y, dy: ca.sqrt(1 + dy**2),
        vc.Fixed(-2, 0),
        vc.Fixed(2, 0),
        [vc.Bound(lambda x, y, dy: y - (1 - x**2), lower=0)],
    )
    check = vc.verify(vc.solve(over))
    assert (check.verdict, check.routes["Jacobi"], check.routes["Ritz"]) == (vc.Verdict.MINIMUM, None, 0)
    assert "touches a bound" in sentences(check)


@pytest.mark.parametrize("ends", [(0, 1), (1, 0)])
def test_a_bound_that_the_curve_begins_or_ends_on_leaves_the_slope_free(ends):
    start, end = ends
    above = vc.Bound(lambda x, y, dy: y, lower=0)
    string = vc.Problem(lambda x, y, dy: dy**2 + y**2, vc.Fixed(0, start), vc.Fixed(2, end), [above])
    check = vc.verify(vc.solve(string))
    assert check.legendre == 2  # L_y'y'
    assert "Legendre's condition holds" in sentences(check)


def test_where_bounds_leave_no_slope_free_none_is_told():
    along = [vc.Bound(lambda x, y, dy: y, lower=0)]
    check = vc.verify(vc.solve(vc.Problem(lambda x, y, dy: dy**2 + y, vc.Fixed(0, 0), vc.Fixed(1, 0), along)))
    assert check.legendre_in_words() == "not tested"
    assert "nan" not in str(check)


def test_a_bound_that_is_not_touched_changes_nothing():
    bounded = vc.Problem(swing, vc.Fixed(0, 0), vc.Fixed(2, 1), [vc.Bound(lambda x, y, dy: y, upper=5)])
    check = vc.verify(vc.solve(bounded))
    assert (check.verdict, check.routes) == (vc.Verdict.MINIMUM, {"Jacobi": 0, "Ritz": 0})


def test_an_integral_between_levels_counts_when_it_is_at_one():
    def problem(upper):
        kept = vc.Isoperimetric(lambda x, y, dy: y, upper=upper)
        return vc.Problem(lambda x, y, dy: dy**2 / 2 - y, vc.Fixed(0, 0), vc.Fixed(1, 0), [kept])

    # the free minimum is y = x (1 - x)/2, with integral 1/12
    for upper in (0.05, 0.2):
        check = vc.verify(vc.solve(problem(upper)))
        assert (check.verdict, check.routes) == (vc.Verdict.MINIMUM, {"Jacobi": 0, "Ritz": 0})


def test_the_report_is_one_a_student_understands():
    check = stationary(vc.Problem(swing, vc.Fixed(0, 0), vc.Fixed(4, 1), name="swing"))
    lines = str(check).splitlines()
    assert lines[0] == "swing: stationary, but neither a minimum nor a maximum"
    assert "  Jacobi          conjugate or focal at x = 3.14159265359" in lines
    assert "  index           1 (Jacobi 1, Ritz 1)" in lines
    assert "- one variation of the curve lowers the functional: a saddle" in lines


def test_what_cannot_be_verified_is_refused():
    with pytest.raises(TypeError, match=r"what varcalc[.]solve gives back, not 3"):
        vc.verify(3)
    nowhere = vc.solve(vc.Problem(lambda x, y, dy: y, vc.Fixed(0, 0), vc.Fixed(1, 1)), throw=False)
    with pytest.raises(ValueError, match="holds no curve to verify"):
        vc.verify(nowhere)


def test_a_bang_bang_arc_of_a_convex_problem_is_a_minimum():
    steep = [vc.Bound(lambda x, y, dy: dy, lower=-1, upper=1)]
    check = vc.verify(vc.solve(vc.Problem(lambda x, y, dy: -y, vc.Fixed(0, 0), vc.Fixed(1, 0), steep)))
    assert check.verdict is vc.Verdict.MINIMUM
    assert "proved convex" in sentences(check)
    assert "0 (by convexity)" in str(check)


@pytest.mark.parametrize("power", [2, 3, 6])
def test_where_a_power_of_y_is_a_factor_of_the_slope(power):
    # with u = y^(1 + power / 2) it is the integral of u'^2, up to a factor: u = x
    solution = vc.solve(vc.Problem(lambda x, y, dy: y**power * dy**2, vc.Fixed(0, 0), vc.Fixed(1, 1)))
    assert solution.value == pytest.approx(1 / (1 + power / 2) ** 2, abs=1e-12)
    assert vc.verify(solution).verdict is vc.Verdict.MINIMUM


def test_where_l_does_not_feel_the_slope_at_an_end_alone_the_hessian_decides():
    # a drum up to radius 2, before the first zero of Bessel's function: DLMF 10.2
    drum = vc.Problem(lambda r, y, dy: r * (dy**2 - y**2), vc.Free(0), vc.Fixed(2, 1))
    solution = vc.solve(drum)
    assert solution.value == pytest.approx(float(-2 * besselj(1, 2) / besselj(0, 2)), abs=1e-9)
    check = vc.verify(solution)
    assert check.verdict is vc.Verdict.MINIMUM
    assert "an end, where the Hessian must decide" in sentences(check)
    beyond = vc.solve(vc.Problem(lambda r, y, dy: r * (dy**2 - y**2), vc.Free(0), vc.Fixed(3, 1)), throw=False)
    assert not beyond.status.ok


def test_a_rest_on_a_shelf_behind_another_jump_is_a_minimum():
    """Where L falls by 1.1 at y = 1/2 and by 3 at 1.45 the curve goes straight there, rests and comes back."""
    shelf, step = lambda y: ca.if_else(y >= 1.45, -3.0, 0.0), lambda y: ca.if_else(y > 0.5, 0.2, 1.3)
    problem = vc.Problem(lambda x, y, v: v**2 + shelf(y) + step(y), vc.Fixed(0, 0), vc.Fixed(3, 0.2))
    solution = vc.solve(problem)
    # on the way v² is how much L lies above that of the shelf
    low, high = np.sqrt(1.3 + 2.8), np.sqrt(0.2 + 2.8)
    times = 0.8 / low, 2 * 0.95 / high
    value = times[0] * (low**2 + 1.3) + times[1] * (high**2 + 0.2) - 2.8 * (3 - sum(times))
    assert solution.value == pytest.approx(value, rel=1e-10)
    assert vc.verify(solution).verdict is vc.Verdict.MINIMUM
