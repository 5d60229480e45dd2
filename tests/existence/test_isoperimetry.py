"""What a curve of a given length encloses at most, against circles and their segments."""

import casadi as ca
import numpy as np
import pytest

import varcalc as vc
from varcalc.existence.of_given_length import least_by_length

START, END = vc.At((1.0, 2.0)), vc.At((3.0, 2.5))


def area(q, dq):
    return (q[0] * dq[1] - q[1] * dq[0]) / 2


def closed(lagrangian, level, value=3.0, maximise=True):
    return vc.Curve(lagrangian, vc.Periodic(), vc.Periodic(), [vc.Isoperimetric(level, value)], maximise=maximise)


def test_a_closed_curve_encloses_no_more_than_a_circle():
    problem = closed(area, lambda q, dq: ca.norm_2(dq))
    assert least_by_length(problem) == pytest.approx(-9 / (4 * np.pi), rel=1e-14)


def test_what_ends_alone_say_adds_nothing_along_a_closed_curve():
    problem = closed(lambda q, dq: -3 * q[1] * dq[0] + q[0] * dq[0] + 2 * dq[1], lambda q, dq: ca.norm_2(dq))
    assert least_by_length(problem) == pytest.approx(-27 / (4 * np.pi), rel=1e-14)


def test_a_level_may_be_of_a_multiple_of_the_length():
    problem = closed(area, lambda q, dq: ca.sqrt(4 * dq[0] ** 2 + 4 * dq[1] ** 2), maximise=False)
    assert least_by_length(problem) == pytest.approx(-2.25 / (4 * np.pi), rel=1e-14)


@pytest.mark.parametrize(
    ("lagrangian", "level"),
    [
        (lambda q, dq: q[0] ** 2 * dq[1], lambda q, dq: ca.norm_2(dq)),
        (lambda q, dq: area(q, dq) + ca.norm_2(dq), lambda q, dq: ca.norm_2(dq)),
        (area, lambda q, dq: ca.sqrt(dq[0] ** 2 + 2 * dq[1] ** 2)),
        (area, lambda q, dq: ca.norm_2(dq) + ca.fabs(dq[0])),
        (area, lambda q, dq: ca.sqrt(dq[0] ** 2 + dq[1] ** 2 + (q[0] * dq[0]) ** 2)),
        (area, lambda q, dq: (1 + q[0] ** 2) * ca.norm_2(dq)),
    ],
)
def test_of_what_is_no_area_or_no_length_nothing_is_told(lagrangian, level):
    assert least_by_length(closed(lagrangian, level)) is None


def test_nothing_is_told_of_ends_that_are_free():
    level = vc.Isoperimetric(lambda q, dq: ca.norm_2(dq), 3.0)
    assert least_by_length(vc.Curve(area, START, vc.OnSurface(lambda q: q[1], (1, 0)), [level], maximise=True)) is None


@pytest.mark.parametrize("maximise", [False, True])
def test_an_arc_between_two_points(maximise):
    level = vc.Isoperimetric(lambda q, dq: ca.norm_2(dq), 3.0)
    problem = vc.Curve(lambda q, dq: q[1] * dq[0] + 3 * dq[0], START, END, [level], maximise=maximise)
    chord, half = np.hypot(2, 0.5), 1.2656  # sin(half)/half is the chord over the length
    for _ in range(5):
        half -= (np.sin(half) - chord / 3 * half) / (np.cos(half) - chord / 3)
    segment = 2.25 / half**2 * (half - np.sin(half) * np.cos(half))
    least = problem.sign * (2.25 * 2 + 3 * 2) - segment
    assert least_by_length(problem) == pytest.approx(least, rel=1e-13)
    solution = vc.solve(problem)
    assert solution.value == pytest.approx(problem.sign * least, rel=1e-10)
    assert not solution.local
    assert "isoperimetric inequality" in solution.searched


@pytest.mark.parametrize("height", [0.0, 2.5])
@pytest.mark.parametrize("both", [False, True])
def test_a_shore_and_a_curve_enclose_no_more_than_a_semicircle(height, both):
    level, shore = vc.Isoperimetric(lambda q, dq: ca.norm_2(dq), 3.0), lambda q: 2 * (height - q[1])
    start = vc.OnSurface(shore, (0.0, height)) if both else vc.At((0.0, height))
    ends = start, vc.OnSurface(shore, (1.0, height))
    problem = vc.Curve(lambda q, dq: (q[1] - height) * dq[0], *ends, [level], maximise=True)
    assert least_by_length(problem) == pytest.approx(-9 / (2 * np.pi), rel=1e-14)
    solution = vc.solve(problem)
    assert solution.value == pytest.approx(9 / (2 * np.pi), rel=1e-10)
    assert not solution.local
    assert "isoperimetric inequality" in solution.searched


def test_of_shores_that_bend_or_part_or_are_paid_for_nothing_is_told():
    level, land = vc.Isoperimetric(lambda q, dq: ca.norm_2(dq), 3.0), lambda q, dq: q[1] * dq[0]
    flat, other = vc.OnSurface(lambda q: q[1], (1, 0)), vc.OnSurface(lambda q: q[1] - 0.1 * q[0], (0, 0))
    bent = vc.OnSurface(lambda q: q[1] - 0.1 * q[0] ** 2, (1, 0.1))
    ends = [(other, flat), (flat, other), (flat, bent), (bent, flat), (bent, bent), (vc.At((0, 1e-9)), flat)]
    # a step has no slope and is no line
    stepped = vc.OnSurface(lambda q: q[1] - 0.3 * ca.floor(q[0]), (0.5, 0))
    ends += [(stepped, stepped), (vc.At((0, 0)), vc.OnSurface(lambda q: q[1] - 0.1 * ca.sign(q[0]), (0, 0)))]
    ends += [(vc.At((0, 0)), bent), (flat, vc.At((0, 1)))]
    for pair in ends:
        assert least_by_length(vc.Curve(land, *pair, [level], maximise=True)) is None
    for paid in (lambda q, dq: q[1] * dq[0] + dq[0], lambda q, dq: (q[1] + 0.1 * q[0]) * dq[0]):
        assert least_by_length(vc.Curve(paid, flat, flat, [level], maximise=True)) is None


def test_an_extremal_that_encloses_less_is_looked_around():
    # twice around a circle of half the length is an extremal as well
    problem = closed(area, lambda q, dq: ca.norm_2(dq))
    twice = lambda t: (3 / (4 * np.pi) * np.cos(4 * np.pi * t), 3 / (4 * np.pi) * np.sin(4 * np.pi * t))  # noqa: E731
    solution = vc.solve(problem, vc.Ritz(starts=1), guess=twice, throw=False)
    assert solution.value == pytest.approx(9 / (4 * np.pi), rel=1e-9) or "isoperimetric" not in solution.searched
