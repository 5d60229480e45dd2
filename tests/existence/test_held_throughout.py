"""Curves that lie on kinks: all along, as far as an end, or but for the ends; bounds that hold a curve all along."""

import math

import casadi as ca
import numpy as np
import pytest
from mpmath import mpf, quad

import varcalc as vc


def solved(lagrangian, start, end, constraints=()):
    return vc.solve(vc.Problem(lagrangian, vc.Fixed(*start), vc.Fixed(*end), list(constraints)))


@pytest.mark.parametrize(
    ("lagrangian", "start", "end", "value"),
    [
        (lambda x, y, dy: dy**2 / 2 + ca.fabs(y), (0, 0), (1, 0), 0.0),
        (lambda x, y, dy: dy**2 / 2 + 5 * ca.fabs(y - 0.2), (0, 0.2), (1, 0.2), 0.0),
        (lambda x, y, dy: ca.sqrt(1 + dy**2) * (1 + ca.fabs(y)), (0, 0), (1, 0), 1.0),
        (lambda x, y, dy: dy**2 / 2 + ca.fabs(y) + ca.fabs(y - 0.1), (0, 0), (1, 0), 0.1),
        # the rate of the momentum may be anything from -2 to 1, and x is on its way there
        (lambda x, y, dy: dy**2 / 2 + ca.fmax(y, -2 * y) - x * y, (0, 0), (1, 0), 0.0),
        (lambda x, y, dy: ca.fabs(dy) ** 1.5 + ca.fabs(y), (0, 0), (1, 0), 0.0),
        (lambda x, y, dy: dy**2 / 2 + ca.fabs(dy) + ca.fabs(y), (0, 0), (1, 0), 0.0),
        # friction holds what is pushed by no more than 2 over the length: the momentum goes from 1 to -1
        (lambda x, y, dy: dy**2 / 2 + ca.fabs(dy) + 1.9 * y, (0, 0.3), (1, 0.3), 0.57),
        (lambda x, y, dy: dy**2 + ca.fabs(dy - 1) + y**2, (0, 0), (1, 1), 4 / 3),
        (lambda x, y, dy: dy**2 / 2 + 3 * ca.fabs(dy - 2 * x), (0, 0), (1, 1), 2 / 3),
    ],
)  # fmt: skip
def test_a_kink_holds_a_curve_from_end_to_end(lagrangian, start, end, value):
    solution = solved(lagrangian, start, end)
    assert abs(solution.value - value) <= solution.error.value + 1e-15
    assert solution.error.value < 1e-11


@pytest.mark.parametrize(
    ("potential", "value", "local"),
    [(lambda y: -2 * y**2, 0.0, False), (ca.cos, 1.0, False), (lambda y: -20 * y**2, 0.0, True)],
)  # fmt: skip
def test_friction_holds_a_curve_on_top_of_a_hill(potential, value, local):
    # the integral of |eta'| is 2 max |eta| at least: more than the square of a small eta gains
    solution = solved(lambda x, y, dy: dy**2 / 2 + ca.fabs(dy) + potential(y), (0, 0), (1, 0))
    assert abs(solution.value - value) <= solution.error.value
    assert solution.local == local


def test_what_is_looked_at_ends_where_l_is_concave_in_the_slope():
    walled = solved(lambda x, y, dy: (1 + dy**2) * (2 - y), (0, 0), (1, 0))
    assert "as far as L is convex in the slope" in walled.searched
    open_everywhere = solved(lambda x, y, dy: dy**2 / 2 + ca.cos(y), (0, 0), (1, 0))
    assert "as far as" not in open_everywhere.searched


@pytest.mark.parametrize("push", [2.2, 4.0])
def test_more_than_friction_holds_moves(push):
    # p = L_y' goes from 1 to -1 over a length 2 / push, in the middle, where the curve stays; beside it |v'| = push
    solution = solved(lambda x, y, dy: dy**2 / 2 + ca.fabs(dy) - push * y, (0, 0), (1, 0))
    moving = 0.5 - 1 / push
    assert solution.value == pytest.approx(-(push**2) * moving**3 / 3, abs=1e-10)


@pytest.mark.parametrize(("belt", "push", "end"), [(0.5, 3.0, 0.3), (0.0, 3.0, -0.2), (-0.7, 2.5, -0.9)])
def test_friction_holds_a_curve_from_its_start_for_a_while(belt, push, end):
    # the slope is the belt's on [0, t], then falls at the rate of the push: end = belt - push (1 - t)^2 / 2
    sliding = mpf(2 * (mpf(belt) - mpf(end)) / push) ** mpf("0.5")
    t = 1 - sliding

    def cost(x):
        since = max(x - t, 0)
        slope, y = belt - push * since, belt * x - push * since**2 / 2
        return slope**2 / 2 + abs(slope - belt) - push * y

    exact = quad(cost, [0, t, 1])
    solution = solved(lambda x, y, dy: dy**2 / 2 + ca.fabs(dy - belt) - push * y, (0, 0), (1, end))
    assert abs(solution.value - exact) <= solution.error.value + 1e-15
    assert solution.error.value < 1e-11


@pytest.mark.parametrize("level", [0.0, 0.2])
@pytest.mark.parametrize("rise", [0.0, 0.1])
def test_a_curve_leaves_the_kink_that_it_begins_on(level, rise):
    solution = solved(lambda x, y, dy: dy**2 / 2 - ca.fabs(y - level), (0, level), (1, level + rise))
    # y'' = -1 on the upper side: y = level + rise x + x (1 - x) / 2
    assert solution.value == pytest.approx(rise**2 / 2 - 1 / 24 - rise / 2, abs=1e-12)


def test_a_curve_rests_on_one_of_two_kinks_of_one_kind():
    solution = solved(lambda x, y, dy: dy**2 / 2 + ca.fabs(ca.fabs(y) - 0.1), (0, 0), (1, 0))
    # from 0 to the level it rises along a parabola that comes to it level: its energy is zero
    rising = math.sqrt(0.2)
    assert solution.value == pytest.approx(2 * rising**3 / 3, abs=1e-10)


@pytest.mark.parametrize("pull", [lambda x, y: y, lambda x, y: 5 * y, lambda x, y: y - 0.3 * x * y])
def test_a_bound_holds_a_curve_all_along(pull):
    held = vc.Bound(lambda x, y, dy: y, lower=0)
    solution = solved(lambda x, y, dy: dy**2 / 2 + pull(x, y), (0, 0), (1, 0), [held])
    assert abs(solution.value) <= solution.error.value < 1e-10
    assert np.abs(solution.curve(np.linspace(0, 1, 11), 0)).max() < 1e-10


@pytest.mark.parametrize(
    ("lagrangian", "held"),
    [
        (lambda x, y, dy: dy**2, vc.Bound(lambda x, y, dy: y, upper=0)),
        (lambda x, y, dy: ca.sqrt(1 + dy**2) - 1, vc.Bound(lambda x, y, dy: y, lower=0)),
        (lambda x, y, dy: dy**2 + y, vc.Bound(lambda x, y, dy: y, lower=0, upper=0)),
    ],
)
def test_a_bound_that_pushes_nothing_is_touched_all_along(lagrangian, held):
    solution = solved(lagrangian, (0, 0), (1, 0), [held])
    assert abs(solution.value) <= solution.error.value < 1e-9


def test_an_integral_that_only_zero_has_leaks_no_warning():
    # the level is its own least value: only y = 0 is admissible
    refused = vc.solve(
        vc.Problem(
            lambda x, y, dy: dy**2, vc.Fixed(0, 0), vc.Fixed(1, 0), [vc.Isoperimetric(lambda x, y, dy: y**2, 0)]
        ),
        throw=False,
    )
    assert refused.verdict is vc.Verdict.DEGENERATE


@pytest.mark.parametrize("power", [1.2, 1.5, 2.5, 3.0])
@pytest.mark.parametrize("written", [lambda v, p: ca.fabs(v) ** p, lambda v, p: (v**2) ** (p / 2)])
def test_powers_of_a_size_are_smooth(power, written):
    solution = solved(lambda x, y, dy: written(dy, power) - 5 * y, (0, 0), (1, 0))
    # p |v|^(p-1) = 5 |1/2 - x|, and the functional is (1 - p) times the integral of |v|^p
    total = power / (power - 1) + 1
    least = (1 - power) * 2 * (5 / power) ** (power / (power - 1)) * 0.5**total / total
    assert abs(solution.value - least) <= solution.error.value < 1e-9


def test_what_slips_is_not_held():
    # x^2 would need a momentum that changes by 4 where friction allows for 2
    solution = solved(lambda x, y, dy: dy**2 + ca.fabs(dy - 2 * x), (0, 0), (1, 1))
    assert solution.value < 4 / 3 - 0.04


def test_a_switch_that_no_slope_leads_onto_is_not_followed_for_ever():
    """The slopes along it were no numbers from the start on, and SciPy went on trying its first step."""
    width, level = 0.753326886, 0.57167
    problem = vc.Problem(
        lambda x, y, dy: ca.fmin((x + dy) ** (y * dy), ca.fmin(dy, -level)) + dy**2,
        vc.Fixed(-0.506015171, -1),
        vc.Fixed(0.247311715, 1),
    )
    solution = vc.solve(problem, tol=1e-6)
    assert abs(solution.value - (4 / width - level * width)) <= solution.error.value + 1e-14


def lowest_well():
    """The least of (y^2 - 1)^2 + y/5, from the roots of its slope."""
    return min((y**2 - 1) ** 2 + y / 5 for y in np.roots([4, 0, -4, 0.2]).real)


@pytest.mark.parametrize(
    ("potential", "value"),
    [
        (lambda x, y: (y - 0.7) ** 2, 0.0),
        # friction of 0.3 holds what a wave pulls at by less; the wave's square sums to half its height's
        (lambda x, y: (y - 0.7 - 0.05 * ca.sin(np.pi * x)) ** 2, 0.0025),
        (lambda x, y: ca.fabs(y - 0.4) + y**2, 0.32),
        (lambda x, y: (y**2 - 1) ** 2 + y / 5, 2 * lowest_well()),
        (lambda x, y: 1e-6 * (y - 700) ** 2, 0.0),
    ],
    ids=["a well", "a wave", "a kink in the well", "two wells", "far away"],
)
@pytest.mark.parametrize("sign", [1, -1], ids=["least", "greatest"])
def test_friction_holds_a_closed_curve(potential, value, sign):
    problem = vc.Problem(
        lambda x, y, v: sign * (v**2 / 2 + 0.3 * ca.fabs(v) + potential(x, y)), vc.Periodic(0, 2), vc.Periodic(0, 2),
        maximise=sign < 0,
    )  # fmt: skip
    found = vc.solve(problem)
    assert abs(found.value - sign * value) <= found.error.value
    assert not found.local


def test_a_wave_that_friction_does_not_hold_moves_a_closed_curve():
    found = vc.solve(
        vc.Problem(
            lambda x, y, v: v**2 / 2 + 0.3 * ca.fabs(v) + (y - 3 * ca.sin(np.pi * x)) ** 2, vc.Periodic(0, 2),
            vc.Periodic(0, 2),
        ),
        throw=False,
    )  # fmt: skip
    assert not found.status.ok or found.value < 9 - 1e-3  # at rest it is 9


def at_rest(x, y, v):
    return v**2 / 2 + ca.fabs(v)


@pytest.mark.parametrize(
    ("lagrangian", "start", "end", "cost", "value"),
    [
        (at_rest, vc.Fixed(0, 0.3), vc.Free(2), None, 0.0),
        (at_rest, vc.Free(0), vc.Fixed(2, 0.3), None, 0.0),
        # what pulls is less than friction on the way to the free end, or is not
        (lambda x, y, v: at_rest(x, y, v) + y, vc.Fixed(0, 0.3), vc.Free(0.9), None, 0.27),
        (lambda x, y, v: at_rest(x, y, v) + y, vc.Fixed(0, 0.3), vc.Free(2), None, 0.6 - 1 / 6),
        (at_rest, vc.Fixed(0, 0), vc.Free(1), lambda x0, y0, x1, y1: (y1 - 0.4) ** 2, 0.16),
        (at_rest, vc.Fixed(0, 0), vc.Free(1), lambda x0, y0, x1, y1: (y1 - 2) ** 2, 2.5),
        (at_rest, vc.Free(0), vc.Free(1), lambda x0, y0, x1, y1: (y1 - 0.4) ** 2 + (y0 + 0.4) ** 2, 0.32),
        # the mean of what it is fitted to, and of two valleys the lower
        (lambda x, y, v: at_rest(x, y, v) + (y - x) ** 2, vc.Free(0), vc.Free(1), None, 1 / 12),
        (
            lambda x, y, v: at_rest(x, y, v) + (y**2 - 1) ** 2 - ca.sin(3 * y) ** 3,
            vc.Free(0),
            vc.Free(1),
            None,
            None,
        ),
    ],
)
def test_friction_holds_what_is_free_at_an_end(lagrangian, start, end, cost, value):
    if value is None:
        y = np.linspace(0, 2, 200001)
        value = float(((y**2 - 1) ** 2 - np.sin(3 * y) ** 3).min())
    solution = vc.solve(vc.Problem(lagrangian, start, end, end_cost=cost))
    assert abs(solution.value - value) < 1e-9


@pytest.mark.parametrize(
    "bound",
    [vc.Bound(lambda x, y, v: y, upper=0.5), vc.Bound(lambda x, y, v: v, lower=-1, upper=1.4)],
)
def test_a_curve_at_rest_keeps_bounds_that_it_would_without_them(bound):
    solution = vc.solve(vc.Problem(at_rest, vc.Fixed(0, 0.3), vc.Free(2), [bound]))
    assert abs(solution.value) < 1e-12
    assert solution.multipliers[0](np.array([1.0])) == 0.0


def test_a_closed_curve_on_a_kink_keeps_a_bound_of_its_slope():
    def lagrangian(x, y, v):
        return (4 + ca.tanh(ca.fabs(y - 0.2) + (y**2 - 0.04) ** 2)) * ca.sqrt(1 + v**2)

    limit = vc.Bound(lambda x, y, v: v + 0.7 * y, upper=1.9)
    assert abs(vc.solve(vc.Problem(lagrangian, vc.Periodic(0, 2), vc.Periodic(0, 2), [limit])).value - 8) < 1e-9


@pytest.mark.parametrize(("place", "end"), [(lambda x: x**2, 1.0), (ca.sin, 1.5), (lambda x: x, 2.0), (ca.exp, 1.0)])
def test_a_curve_that_a_moving_kink_holds_all_along_is_verified(place, end):
    """Along y = p(x) with p'' between -5 and 5 the kink of 5 |y - p| holds the curve; L is convex."""
    first, last = (float(ca.DM(place(ca.DM(x)))) for x in (0.0, end))
    problem = vc.Problem(lambda x, y, v: v**2 / 2 + 5 * ca.fabs(y - place(x)), vc.Fixed(0, first), vc.Fixed(end, last))
    solution = vc.solve(problem)
    assert vc.verify(solution).verdict is vc.Verdict.MINIMUM
    x = np.linspace(0, end, 7)
    assert solution.y(x) == pytest.approx(np.asarray(ca.DM(place(ca.DM(x)))).ravel(), abs=1e-12)


@pytest.mark.parametrize("k", [1.01, 1.0001, 0.999])
def test_a_kink_next_to_the_start_is_come_to(k):
    """Of y'² + |y - k| the way from a distance a costs 4/3 a^1.5; it takes a hundredth of the interval here."""
    solution = vc.solve(vc.Problem(lambda x, y, v: v**2 + ca.fabs(y - k), vc.Fixed(0, 1), vc.Fixed(5, -1)))
    assert solution.value == pytest.approx(4 / 3 * (abs(1 - k) ** 1.5 + (1 + k) ** 1.5), rel=1e-9)
    assert not solution.local
