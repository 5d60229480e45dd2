"""Two ends that slide have places of their own: where each is best alone says nothing of both."""

import casadi as ca
import numpy as np
import pytest

import varcalc as vc


def between(*constraints, about=0.05):
    """From y = -x to y = x, which meet at 0; L = y'²/2 + 1 - 10 x²/9 + x⁴/9, of which the last is least from -3 to 3.

    A curve at rest between those places costs nothing else, and none at all where the two meet.
    """
    start, end = vc.OnCurve(lambda x, y: y + x, x=-about), vc.OnCurve(lambda x, y: y - x, x=about)
    return vc.Problem(lambda x, y, v: v**2 / 2 + 1 - 10 * x**2 / 9 + x**4 / 9, start, end, constraints)


def from_to(a):
    """The integral of the polynomial from -a to a."""
    return 2 * (a - 10 * a**3 / 27 + a**5 / 45)


@pytest.mark.parametrize(
    ("bound", "about"),
    [
        (vc.Bound(lambda x, y, v: v, lower=-2, upper=2), 0.05),
        (vc.Bound(lambda x, y, v: v, lower=-2, upper=2), 0.5),
        (vc.Bound(lambda x, y, v: y, lower=-2, upper=20), 0.05),
    ],
)
def test_a_curve_that_drew_to_nothing_is_drawn_to_other_places_of_both_its_ends(bound, about):
    solution = vc.solve(between(bound, about=about))
    assert solution.value == pytest.approx(from_to(3.0), rel=1e-9)
    assert solution.x[[0, -1]] == pytest.approx([-3, 3], abs=1e-5)


def test_a_level_does_not_keep_ends_from_other_places():
    # at rest from -a to a the integral of y is 2 a²: with 8 at most a is 2 at most, and curves that sag come farther
    solution = vc.solve(between(vc.Isoperimetric(lambda x, y, v: y, upper=8.0)))
    assert solution.value < from_to(2.0) - 0.1
    x = np.linspace(*solution.x[[0, -1]], 2001)
    assert np.trapezoid(solution.curve(x, 0)[0], x) == pytest.approx(8.0, abs=1e-5)


def test_a_closed_curve_of_second_order_finds_the_deeper_well_of_two_functions():
    # at rest in a well nothing else costs anything: 4 times the least potential, about (1, 1)
    def potential(y):
        wells = [(1.0, np.zeros(2)), (2.0, np.ones(2))]
        return -sum(depth * ca.exp(-ca.sumsqr(y - at) / 0.18) for depth, at in wells)

    y = ca.SX.sym("y", 2)
    newton = ca.rootfinder("least", "newton", {"x": y, "g": ca.gradient(potential(y), y)}, {"abstol": 1e-15})
    known = 4 * float(potential(newton([1.0, 1.0], [])))
    closed = vc.Periodic(0, 4, 2)
    problem = vc.Problem(
        lambda x, y, v, bends: ca.sumsqr(v) / 2 + ca.sumsqr(bends) / 10 + potential(y), closed, closed, order=2
    )
    solution = vc.solve(problem)
    assert solution.value == pytest.approx(known, rel=1e-9)
    assert not solution.local
