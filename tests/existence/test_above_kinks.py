"""Convex kinks as bounds of functions of their own, against closed forms.

A core of k |y| from a height a costs sqrt(k) (2 a)^(3/2) / 3 on the way down: y = k (d - x)^2 / 2 with
d = sqrt(2 a / k), on which v^2 / 2 and k y are the same.
"""

import math

import casadi as ca
import numpy as np
import pytest

import varcalc as vc


def core(k, a):
    """The least value of v^2 / 2 + k |y| from a to zero, where there is room for it."""
    return math.sqrt(k) * (2 * a) ** 1.5 / 3


def kink(u):
    """What every problem here has."""
    return ca.fabs(u)


def two_cores():
    problem = vc.Problem(
        lambda x, y, v: ca.sumsqr(v) / 2 + kink(y[0]) + 2 * kink(y[1]), vc.Fixed(0, [2, 1]), vc.Fixed(4, [0, 0])
    )
    return problem, core(1, 2) + core(2, 1)


def tied():
    """y1 - y2 rests; in the sum and the difference over sqrt(2) the problem is a line and a core."""
    problem = vc.Problem(
        lambda x, y, v: ca.sumsqr(v) / 2 + 3 * kink(y[0] - y[1]), vc.Fixed(0, [0, 0.19]), vc.Fixed(1, [0.6, 0.77])
    )
    k, root = 3 * math.sqrt(2), math.sqrt(2)
    return problem, (1.37 - 0.19) ** 2 / 4 + core(k, 0.19 / root) + core(k, 0.17 / root)


def with_level():
    """The multiplier of the level adds to the load: curvature 16/9 down to zero at 3/2."""
    problem = vc.Problem(
        lambda x, y, v: v**2 / 2 + kink(y), vc.Fixed(0, 2), vc.Fixed(4, 0), [vc.Isoperimetric(lambda x, y, v: y, 1)]
    )
    return problem, (16 / 9) ** 2 * 1.5**3 / 6 + 1


def with_bound():
    """A line of the steepest slope allowed, then the parabola."""
    problem = vc.Problem(
        lambda x, y, v: v**2 / 2 + kink(y), vc.Fixed(0, 2), vc.Fixed(4, 0), [vc.Bound(lambda x, y, v: v, lower=-1.5)]
    )
    joined = 1.5**2 / 2
    time = (2 - joined) / 1.5
    return problem, time * (1.5**2 / 2 + (2 + joined) / 2) + core(1, joined)


def sliding():
    """The core ends where the line y = x - 1 meets the level."""
    problem = vc.Problem(
        lambda x, y, v: v**2 / 2 + 4 * kink(y), vc.Fixed(0, 1), vc.OnCurve(lambda x, y: y - x + 1, x=1.5)
    )
    return problem, core(4, 1)


def held_to_a_free_end():
    return vc.Problem(lambda x, y, v: v**2 / 2 + kink(v - 0.5), vc.Fixed(0, 0), vc.Free(1)), 1 / 8


def scaled_friction():
    """Friction that differs forwards and backwards, and holds throughout, in a factor."""
    return (
        vc.Problem(lambda x, y, v: (1.5 + v**2 / 2 + ca.fmax(v, -2 * v)) * 2.2, vc.Fixed(0, 0), vc.Fixed(1, 0)),
        3.3,
    )


@pytest.mark.parametrize(
    "case", [two_cores, tied, with_level, with_bound, sliding, held_to_a_free_end, scaled_friction]
)
def test_a_convex_kink_is_solved_whatever_is_beside_it(case):
    problem, least = case()
    solution = vc.solve(problem)
    assert abs(solution.value - least) <= solution.error.value <= 1e-9 * max(1.0, least)


def test_the_curve_of_two_cores():
    problem, _ = two_cores()
    curve = vc.solve(problem).curve
    x = np.linspace(0, 4, 41)
    exact = [np.maximum(2 - x, 0) ** 2 / 2, np.maximum(1 - x, 0) ** 2]
    np.testing.assert_allclose(curve(x, 0), exact, atol=1e-5)


def test_a_concave_kink_is_none_of_these():
    """-|y| has its minimum aside of the kink, 2 (1/2)^3 / 3 of it lost on either way: y'' = -1 over (0, 1) from 0."""
    problem = vc.Problem(
        lambda x, y, v: ca.sumsqr(v) / 2 - kink(y[0]) + kink(y[1]), vc.Fixed(0, [0, 0]), vc.Fixed(1, [0, 0])
    )
    solution = vc.solve(problem, throw=False)
    assert not solution.status.ok or abs(solution.value + 1 / 24) <= solution.error.value


@pytest.mark.parametrize(("start", "end"), [(2, -1), (2, 0), (2, 1)])
def test_sensitivities_count_every_part(start, end):
    problem = vc.Problem(
        lambda x, y, v, p: v**2 / 2 + p.k * kink(y), vc.Fixed(0, start), vc.Fixed(5, end), parameters={"k": 1.0}
    )
    solution = vc.solve(problem)
    # the value is a multiple of sqrt(k)
    assert solution.sensitivities["k"] == pytest.approx((core(1, start) + core(1, abs(end))) / 2, abs=1e-6)


def test_sensitivities_of_a_curve_that_a_kink_holds():
    held = vc.Problem(
        lambda x, y, v, p: v**2 / 2 + kink(v) + p.k * y**2, vc.Fixed(0, 0.5), vc.Fixed(2, 0.5), parameters={"k": 0.1}
    )
    assert vc.solve(held).sensitivities["k"] == pytest.approx(0.5**2 * 2, rel=1e-12)
    moved = vc.Problem(
        lambda x, y, v, p: v**2 / 2 + kink(v - p.k), vc.Fixed(0, 0), vc.Fixed(1, 0.8), parameters={"k": 0.8}
    )
    assert math.isnan(vc.solve(moved).sensitivities["k"])
