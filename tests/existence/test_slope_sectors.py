"""Curves that keep a slope at which L jumps, or has a kink beside a hollow: corners between that slope and others."""

import casadi as ca
import mpmath
import numpy as np
import pytest

import varcalc as vc
from varcalc.existence.slope_sectors import slope_sectors


def problem_of(L, end, load=None):
    return vc.Problem(
        lambda x, y, v: L(v) + (0 if load is None else load(x) * y),
        vc.Fixed(0, 0),
        vc.Free(1) if end is None else vc.Fixed(1, end),
    )


# between the slopes on which the chord lies that supports L at the mean slope
CORNERED = {
    # from (1, 1) to (2, 5), whose slope is that of v² + 1 there
    "jump": (lambda v: v**2 + (v > 1), 1.5, 3.0),
    "jump downward": (lambda v: v**2 + (-v > 1), -1.5, 3.0),
    "as branches": (lambda v: ca.if_else(v <= 1, v**2, v**2 + 1), 1.5, 3.0),
    "below a ramp": (lambda v: ca.fmin(ca.fmax(v**2, v**2 + 40 * (v - 1)), v**2 + 1), 1.5, 3.0),
    # on the tangent of v²/2 + 3 through (1, 1/2), at 1 + sqrt 6
    "on both sides": (lambda v: v**2 / 2 + 3 * (ca.fabs(v) > 1), 1.2, 0.5 + 0.2 * (1 + 6**0.5)),
    # between two slopes at which it jumps
    "stairs": (lambda v: v**2 / 2 + 2 * ca.ceil(v), 1.2, 2.5 + 0.2 * 3.5),
    "greatest": (lambda v: -(v**2) - (v > 1), 1.5, -3.0),
}


@pytest.mark.parametrize("name", CORNERED)
def test_corners_between_a_slope_that_is_kept_and_another(name):
    L, end, value = CORNERED[name]
    problem = vc.Problem(lambda x, y, v: L(v), vc.Fixed(0, 0), vc.Fixed(1, end), maximise=value < 0)
    solution = vc.solve(problem)
    assert solution.value == pytest.approx(value, rel=1e-10)
    assert not solution.local


@pytest.mark.parametrize("unit", [1e-9, 1e-6, 1.0, 1e6])
def test_slopes_of_any_size_are_kept_as_nearly_as_is_claimed(unit):
    """(v/u)² + (v > u) to 3 u/2 is 3 in every unit; the slope is kept just beside that of the jump."""
    problem = vc.Problem(lambda x, y, v: (v / unit) ** 2 + (v > unit), vc.Fixed(0, 0), vc.Fixed(1, 1.5 * unit))
    solution = vc.solve(problem)
    assert abs(solution.value - 3) <= solution.error.value <= 1e-10


def test_a_load_drives_a_curve_off_the_slope_at_a_corner():
    """Of v² + (v > 1) + 2 x y the momentum rises by x²; the corner is where it is 4, the chord's slope."""

    def end(s):
        return s + mpmath.quad(lambda x: 2 + (x**2 - s**2) / 2, [s, 1])

    s = mpmath.findroot(lambda s: end(s) - 1.5, 0.55)
    slope = lambda x: 1 if x < s else 2 + (x**2 - s**2) / 2  # noqa: E731
    y = lambda x: x if x < s else s + mpmath.quad(slope, [s, x])  # noqa: E731
    value = mpmath.quad(lambda x: slope(x) ** 2 + (x > s) + 2 * x * y(x), [0, s, 1])
    solution = vc.solve(problem_of(lambda v: v**2 + (v > 1), 1.5, lambda x: 2 * x))
    assert solution.value == pytest.approx(float(value), rel=1e-10)
    assert not solution.local


def test_a_curve_goes_off_the_slope_smoothly():
    """Of v² + 5 (v > 1) - 2 c y with a free end: the momentum is 2 c (1 - x), and the slope half of it, at most 1."""
    c = 1.7
    solution = vc.solve(problem_of(lambda v: v**2 + 5 * (v > 1), None, lambda x: -2 * c))
    left = 1 - 1 / c  # where the momentum has come down to 2
    value = left + c**2 * (1 - left) ** 3 / 3 - 2 * c * (left - left**2 / 2 + c * (1 - left) ** 3 / 3)
    assert solution.value == pytest.approx(value, rel=1e-9)
    assert not solution.local


def test_a_free_end_may_leave_nothing_but_the_slope():
    """Beside v = -0.2 L is higher by 1/2 on one side, and v²/2 pulls to 0 on the other."""
    problem = problem_of(lambda v: v**2 / 2 + 0.5 * (v > -0.2), None)
    solution = vc.solve(problem)
    assert solution.value == pytest.approx(0.02, rel=1e-9)


@pytest.mark.parametrize(("L", "end", "limit"), [
    (lambda v: v**2 + (v >= 1), 1.5, 3.0),
    (lambda v: v**2 / 2 + 2 * ca.floor(v), 1.2, 0.5 + 0.2 * 3.5),
], ids=["jump", "stairs"])  # fmt: skip
def test_an_infimum_beside_a_slope_is_not_attained(L, end, limit):
    """At the slope itself L has the value of the higher side: curves come near to the lower one's alone."""
    solution = vc.solve(problem_of(L, end), throw=False)
    assert solution.verdict is vc.Verdict.NOT_ATTAINED
    assert f"{limit:.6g}" in solution.message
    assert "just beside" in solution.message


def test_what_has_no_sectors_is_one():
    sectors = slope_sectors(problem_of(lambda v: v**2, 1.0))
    assert sectors.levels == ()
    assert np.array_equal(sectors.edges, [[-np.inf], [np.inf]])
    assert slope_sectors(vc.Problem(lambda x, y, v: v**2 + (v > y), vc.Fixed(0, 0), vc.Fixed(1, 1))).levels == ()


def test_levels_are_where_what_switches_is_zero():
    sectors = slope_sectors(problem_of(lambda v: v**2 + ca.fabs(v - 0.25) + (v**2 > 2), 1.0))
    assert [level.slope for level in sectors.levels] == pytest.approx([-(2**0.5), 0.25, 2**0.5], rel=1e-14)
    assert np.array_equal(sectors.of(np.array([0.0, 0.25])), [[2, 2], [2, 4], [2, 3]])
