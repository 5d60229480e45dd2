"""Levels: other valleys that keep them, what is proved with them, and corners that they ask for."""

import math

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import brentq

import varcalc as vc


def length(x, y, v):
    return ca.sqrt(1 + v**2)


def between(lagrangian, level, value, height=0.0, **options):
    return vc.Problem(lagrangian, vc.Fixed(0, 0), vc.Fixed(1, height), [vc.Isoperimetric(level, value)], **options)


def test_a_valley_is_found_that_keeps_the_level_of_two_functions():
    # the integrand is a sum of squares that vanishes along the aim alone, which keeps the level
    aim = [[0.26, -0.3, -0.18], [-0.39, 1.63, 0.57]]
    other = [[-1.22, -0.57, 0.28], [-0.27, 0.57, -1.03]]

    def sines(shares, x, sin):
        return [a * sin(np.pi * x / 2) + b * sin(2 * np.pi * x) + c * sin(3 * np.pi * x) for a, b, c in shares]

    def slopes(x):
        turns = np.pi * np.array([0.5, 2, 3])
        return [
            sum(float(share * turn) * ca.cos(float(turn) * x) for share, turn in zip(a, turns, strict=True))
            for a in aim
        ]

    def lagrangian(x, y, v):
        off, aside = (sum((y[i] - sines(shares, x, ca.sin)[i]) ** 2 for i in range(2)) for shares in (aim, other))
        return 0.02 * sum((v[i] - slopes(x)[i]) ** 2 for i in range(2)) + 20 * off * (aside + 0.01)

    x, weights = np.polynomial.legendre.leggauss(60)
    along = sines(aim, (x + 1) / 2, np.sin)
    level = float(weights / 2 @ sum(y**3 + y for y in along))
    problem = vc.Problem(
        lagrangian, vc.Fixed(0, [0, 0]), vc.Free(1, n=2),
        [vc.Isoperimetric(lambda x, y, v: y[0] ** 3 + y[0] + y[1] ** 3 + y[1], level)],
    )  # fmt: skip
    solution = vc.solve(problem)
    assert not solution.local
    assert abs(solution.value) < 1e-9


def test_what_is_convex_less_its_level_is_proved_least():
    # Dido's segment of a circle: 2 r sin(half) is the chord, 2 r half the arc (Gelfand and Fomin, sect. 12)
    arc = 1.3
    half = brentq(lambda t: math.sin(t) / t - 1 / arc, 1e-3, math.pi / 2)
    radius = arc / (2 * half)
    solution = vc.solve(between(lambda x, y, v: y, length, arc, maximise=True))
    assert solution.value == pytest.approx(radius**2 * (half - math.sin(half) * math.cos(half)), abs=1e-10)
    assert "proved convex" in solution.searched
    assert "multiplier" in solution.searched


@pytest.mark.parametrize(
    ("lagrangian", "level"),
    [
        (lambda x, y, v: v**2 - y**2, lambda x, y, v: y),  # concave in y, as is what is left of it
        (lambda x, y, v: v**2, lambda x, y, v: -ca.exp(y)),  # the multiplier's sign makes it concave
        (lambda x, y, v: y * ca.sqrt(1 + v**2), length),
    ],
)
def test_what_is_not_convex_less_its_level_is_not_proved(lagrangian, level):
    problem = vc.Problem(
        lagrangian, vc.Fixed(0, 2), vc.Fixed(1, 2), [vc.Isoperimetric(level, -8.0 if level is not length else 1.3)]
    )
    assert "less its levels" not in vc.solve(problem, throw=False).searched


@pytest.mark.parametrize("first", ["waypoint", "level"])
def test_a_waypoint_beside_a_level_has_no_multiplier(first):
    # parabolas on either side of it: -m/2 x (1 - x) + slopes, of equal halves; y = x (1 - x) keeps both
    conditions = [vc.Through(0.5, 0.25), vc.Isoperimetric(lambda x, y, v: y, 1 / 6)]
    ends = vc.Fixed(0, 0), vc.Fixed(1, 0)
    solution = vc.solve(
        vc.Problem(lambda x, y, v: ca.exp(0 * y) * v**2, *ends, conditions[:: 1 if first == "waypoint" else -1])
    )
    assert solution.value == pytest.approx(1 / 3, abs=1e-10)


@pytest.mark.parametrize("power", [2, 4])
@pytest.mark.parametrize("height", [0.0, 0.5])
def test_a_tent_is_least_of_all_that_are_so_long(power, height):
    # of one length the mean of a convex function of sqrt(1 + v^2) is least where that is constant (Jensen)
    solution = vc.solve(between(lambda x, y, v: v**power, length, 1.25, height))
    assert solution.value == pytest.approx(0.75**power, abs=1e-9)
    assert not solution.local


def test_what_zigzags_come_to_that_keep_a_level_of_the_slope_is_not_attained():
    # v = 2 and -2 in turn: y comes as near to 0 as one likes, and by Jensen's inequality no curve comes lower
    problem = between(lambda x, y, v: v**2 / 2 + y**2, lambda x, y, v: ca.fabs(v), 2.0)
    solution = vc.solve(problem, throw=False)
    assert solution.local or not solution.status.ok
    assert "finer and finer corners bring the functional to 2" in solution.message


def test_zigzags_of_one_length_are_told_where_the_smooth_problem_has_no_answer():
    # sqrt(1 + v^2) = 3/2 throughout, y as near to 0 as one likes
    solution = vc.solve(between(lambda x, y, v: v**2 / 2 + y**2, length, 1.5), throw=False)
    assert solution.verdict is vc.Verdict.NOT_ATTAINED
    assert "bring the functional to 0.625" in solution.message


@pytest.mark.parametrize("level", [lambda x, y, v: v**4, lambda x, y, v: v**4 - v**6])
def test_a_level_that_waves_reach_is_not_said_to_be_out_of_reach(level):
    # at rest all derivatives of y'^4 vanish, as they would at its greatest
    solution = vc.solve(between(lambda x, y, v: v**2 / 2 + y**2, level, 0.01), vc.Ritz(), throw=False)
    assert solution.verdict is not vc.Verdict.INFEASIBLE


def test_a_square_is_never_less_than_nothing_though_no_graph_makes_it_least():
    problem = vc.Problem(
        lambda x, y, v: v**2 / 2, vc.Fixed(0, 0.3), vc.Fixed(2, -0.6), [vc.Isoperimetric(lambda x, y, v: y**2, -0.2)]
    )
    solution = vc.solve(problem, throw=False)
    assert solution.verdict is vc.Verdict.INFEASIBLE
    assert "between 0 and inf" in solution.message


def test_a_level_out_of_reach_is_told():
    solution = vc.solve(between(lambda x, y, v: v**2 / 2, lambda x, y, v: v**4, -0.1), throw=False)
    assert solution.verdict is vc.Verdict.INFEASIBLE
    assert "between 0 and inf" in solution.message


def test_zigzags_elsewhere_that_keep_a_length_are_told():
    # where the curve runs L less the level is convex in the slope; along a hill's foot two slopes in turn come lower
    def lagrangian(x, y, v, m):
        hills = 1.3175 * ((y + 0.085) ** 2 - 0.5) ** 2 + 0.0855 * (y + 0.56) ** 2 - 0.152 * m.sin(0.732 * y + 1.353 * x)
        return (3.5 + m.tanh(hills)) * m.sqrt(1 + 0.963 * v**2)

    found = vc.solve(
        vc.Problem(
            lambda x, y, v: lagrangian(x, y, v, ca), vc.Fixed(0, -0.493), vc.Free(4), [vc.Isoperimetric(length, 4.482)]
        ),
        throw=False,
    )
    # steeply down, then along y = -0.8 by two slopes in turn for a while
    x = np.array([0, 0.125, 0.25, 0.5, 1, 2.125, 4])
    y, spread = np.array([-0.493, -0.598, -0.67, -0.742, -0.769, -0.798, -0.788]), [0, 0, 0, 0, 1, 0]
    nodes, weights = np.polynomial.legendre.leggauss(40)

    def mixed(function, half):
        parts = zip(x[:-1], x[1:], y[:-1], y[1:], spread, strict=True)
        return sum(
            0.5 * (b - a) * weight * function(a + (1 + t) / 2 * (b - a), p + (1 + t) / 2 * (q - p), slope) / 2
            for a, b, p, q, turn in parts for t, weight in zip(nodes, weights, strict=True)
            for slope in ((q - p) / (b - a) + half * turn, (q - p) / (b - a) - half * turn)
        )  # fmt: skip

    half = brentq(lambda half: mixed(lambda x, y, v: np.hypot(1, v), half) - 4.482, 0, 10)
    known = mixed(lambda x, y, v: lagrangian(x, y, v, np), half)
    assert known < 15.7
    assert found.local or found.value <= known or not found.status.ok
