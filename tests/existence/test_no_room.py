"""Bounds that leave no room somewhere are told of at once, whatever L is."""

import time

import casadi as ca
import pytest

import varcalc as vc
from varcalc.existence.no_room import no_room


def spike(x, width):
    return ca.exp(-(((x - 0.3141) / width) ** 2))


LAGRANGIANS = {
    "friction": lambda x, y, v: v**2 / 2 + 0.3 * ca.fabs(v),
    "kink": lambda x, y, v: v**2 / 2 + 5 * ca.fabs(y - 0.3),
    "wells": lambda x, y, v: (v**2 - 1) ** 2 / 4 + y**2,
}


def between(name, width, height):
    """A floor that comes up to ``height`` where a ceiling comes down to 0.1."""
    ceiling = vc.Bound(lambda x, y, v: 2 * y + 1.8 * spike(x, width), upper=2.0)
    floor = vc.Bound(lambda x, y, v: (height + 0.1) * spike(x, width) - y, upper=0.1)
    return vc.Problem(LAGRANGIANS[name], vc.Fixed(0, 0), vc.Fixed(1, 0.2), [ceiling, floor])


@pytest.mark.parametrize("name", LAGRANGIANS)
def test_walls_that_cross_in_a_narrow_place_leave_no_curve(name):
    begun = time.process_time()
    solution = vc.solve(between(name, 1e-3, 0.2), throw=False)
    assert solution.verdict is vc.Verdict.INFEASIBLE
    assert "constraints[0] (Bound) and constraints[1] (Bound) cannot be met together: at x = 0.314" in solution.message
    assert time.process_time() - begun < 1


def test_walls_that_leave_a_little_room_are_no_contradiction():
    solution = vc.solve(between("friction", 1e-2, 0.09), throw=False)
    assert solution.verdict is not vc.Verdict.INFEASIBLE


def test_levels_that_contradict_each_other_are_told_of_before_broken_curves():
    levels = [vc.Isoperimetric(lambda x, y, v: y, 1.0), vc.Isoperimetric(lambda x, y, v: 2 * y + x, 0.5)]
    problem = vc.Problem(LAGRANGIANS["friction"], vc.Fixed(0, 0), vc.Fixed(1, 0.2), levels)
    begun = time.process_time()
    assert vc.solve(problem, throw=False).verdict is vc.Verdict.INFEASIBLE
    assert time.process_time() - begun < 3


@pytest.mark.parametrize(
    ("shore", "bound", "words"),
    [
        (lambda x, y: y - 1, vc.Bound(lambda x, y, v: y, upper=0.8), "0.2 off it"),
        (lambda x, y: 2 * y - x - 2, vc.Bound(lambda x, y, v: 2 * y - x, lower=-1.0, upper=1.5), "0.5 off it"),
        (lambda x, y: x - 1, vc.Bound(lambda x, y, v: 3 * x - y, lower=0.0, upper=3.0), None),
        (lambda x, y: y - 1, vc.Bound(lambda x, y, v: y - v, upper=0.8), None),
    ],
)
def test_a_line_that_bounds_keep_a_curve_from_is_no_place_to_slide_on(shore, bound, words):
    problem = vc.Problem(LAGRANGIANS["kink"], vc.Fixed(0, 0), vc.OnCurve(shore, x=1), [bound])
    found = no_room(problem)
    assert (found is None) == (words is None)
    assert words is None or words in found.sentence
