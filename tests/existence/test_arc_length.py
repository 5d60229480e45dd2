"""Chains are least of all curves as long, by their arc length; what does not hang is not proved so."""

import casadi as ca
import numpy as np
import pytest

import varcalc as vc
from varcalc.existence.of_given_length import proved_in_arc_length

HALF = 0.8
"""Half the span in units of the catenary's parameter, which is 1."""
LENGTH = 2 * np.sinh(HALF)
X = np.linspace(-HALF, HALF, 9)


def length(x, y, dy):
    return ca.sqrt(1 + dy**2)


def chain(lagrangian=lambda x, y, dy: y * ca.sqrt(1 + dy**2), level=length, more=(), **others):
    start, end = vc.Fixed(-HALF, 0), vc.Fixed(HALF, 0)
    return vc.Problem(lagrangian, start, end, [vc.Isoperimetric(level, LENGTH), *more], **others)


def test_a_catenary_hangs():
    # y = cosh(x) - cosh(HALF), and f - lambda = cosh(x)
    assert proved_in_arc_length(chain(), [-np.cosh(HALF)], np.cosh(X) - np.cosh(HALF))


def test_the_arch_that_it_makes_upside_down_does_not():
    assert not proved_in_arc_length(chain(), [np.cosh(HALF)], np.cosh(HALF) - np.cosh(X))


def test_it_is_the_highest_curve_of_its_length():
    assert proved_in_arc_length(chain(maximise=True), [np.cosh(HALF)], np.cosh(HALF) - np.cosh(X))


@pytest.mark.parametrize(
    "problem",
    [
        chain(lambda x, y, dy: -(y**2) * ca.sqrt(1 + dy**2)),  # f is not convex
        chain(lambda x, y, dy: (x + y) * ca.sqrt(1 + dy**2)),  # it depends on the abscissa
        chain(level=lambda x, y, dy: ca.sqrt(1 + 2 * dy**2)),  # another length
        chain(level=lambda x, y, dy: (2 + y) * ca.sqrt(1 + dy**2)),
        chain(lambda x, y, dy: y * (1 + dy**2)),
        chain(more=[vc.Through(0.0, -0.2)]),  # which a curve of that length passes anywhere on its way
    ],
)
def test_what_the_proof_does_not_cover(problem):
    assert not proved_in_arc_length(problem, [-np.cosh(HALF), None], np.cosh(X) - np.cosh(HALF))


@pytest.mark.parametrize(("scale", "level_scale"), [(1.0, 1.0), (4.0, 3.0)])
def test_a_solution_says_so(scale, level_scale):
    w = lambda dy: ca.sqrt(1 + dy**2)  # noqa: E731
    problem = vc.Problem(
        lambda x, y, dy: scale * y * w(dy), vc.Fixed(-HALF, 0), vc.Fixed(HALF, 0),
        [vc.Isoperimetric(lambda x, y, dy: level_scale * w(dy), level_scale * LENGTH)],
    )  # fmt: skip
    solution = vc.solve(problem)
    exact = HALF + np.sinh(HALF) * np.cosh(HALF) - LENGTH * np.cosh(HALF)
    assert solution.value == pytest.approx(scale * exact, rel=1e-10)
    assert "arc length" in solution.searched
    assert not solution.local
