"""Curves that cross the knots of smooth tables, and places that no double is, at which L switches."""

from fractions import Fraction

import casadi as ca
import mpmath
import numpy as np
import pytest

import varcalc as vc
from varcalc.certificates.balls import flint
from varcalc.certificates.jets import Jet, jets
from varcalc.certificates.smooth import Undecided
from varcalc.symbolic.instructions import Program

KNOTS = [-1.0, -0.4, -0.1, 0.3, 0.75, 1.0]


def between(certificate, exact):
    low, high = (mpmath.mpf(f.numerator) / f.denominator for f in map(Fraction, certificate.enclosure))
    return low <= exact <= high


@pytest.mark.parametrize("ends", [(-0.8, 0.9), (0.85, -0.3)])
def test_a_curve_that_crosses_the_knots_of_a_cubic_spline(ends):
    """int c(y) v^2 with c the spline through 1 + y^2, which is 1 + y^2: (the integral of sqrt(1 + y^2))^2."""
    table = ca.interpolant("c", "bspline", [KNOTS], [1 + k * k for k in KNOTS])
    problem = vc.Problem(lambda x, y, v: table(y) * v**2, vc.Fixed(0, ends[0]), vc.Fixed(1, ends[1]))
    certificate = vc.certify(vc.solve(problem))
    length = [(y * mpmath.sqrt(1 + y * y) + mpmath.asinh(y)) / 2 for y in map(mpmath.mpf, ends)]
    # the spline is the parabola to the round-off of its coefficients
    assert abs(certificate.lower - (length[1] - length[0]) ** 2) < 1e-14
    assert certificate.width < 1e-18


def test_a_ray_through_a_measured_index_is_certified():
    """Optical path through an index given at depths, which the ray goes down through; a straight ray is longer."""
    index = ca.interpolant("n", "bspline", [[-1.0, -0.5, 0.0, 0.5, 1.0, 1.5]], [1.0, 1.1, 1.3, 1.25, 1.2, 1.4])
    path = vc.Problem(lambda x, y, v: index(y) * ca.sqrt(1 + v**2), vc.Fixed(0, -0.6), vc.Fixed(1, 1.3))
    certificate = vc.certify(vc.solve(path))
    t = (np.arange(20_000) + 0.5) / 20_000
    straight = np.hypot(1, 1.9) * np.asarray(index(-0.6 + 1.9 * t)).mean()
    assert certificate.upper < straight
    assert certificate.width < 1e-18


@pytest.mark.parametrize(("factor", "place"), [(3.0, 1.0), (7.0, 3.0), (3.0, 2.0)])
def test_a_place_that_is_no_double(factor, place):
    """int n v^2, n = 1 before place/factor and 2 behind: 1/(x0 + (1 - x0)/2)."""
    problem = vc.Problem(lambda x, y, v: ca.if_else(factor * x < place, 1, 2) * v**2, vc.Fixed(0, 0), vc.Fixed(1, 1))
    certificate = vc.certify(vc.solve(problem))
    x0 = mpmath.mpf(place) / mpmath.mpf(factor)
    assert between(certificate, 1 / (x0 + (1 - x0) / 2))
    assert certificate.width < 1e-12


def test_what_bends_at_a_place_that_is_no_double():
    """int (1 + max(x^2 - 1/2, 0)) v^2: one over the integral of 1/(1/2 + x^2) from the root of 1/2 on, and of 1."""
    problem = vc.Problem(lambda x, y, v: (1 + ca.fmax(x**2 - 0.5, 0)) * v**2, vc.Fixed(0, 0), vc.Fixed(1, 1))
    root = mpmath.sqrt(mpmath.mpf(1) / 2)
    rest = (mpmath.atan(1 / root) - mpmath.atan(1)) / root
    certificate = vc.certify(vc.solve(problem))
    assert between(certificate, 1 / (root + rest))
    assert certificate.width < 1e-20


def test_both_sides_are_told_of_numbers_alone_and_of_abscissae_alone():
    """|x - 1| y about x = 1 is y's slope between 0 and 1; |y| about 0 is refused, and so is a jump in y."""
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    ball = flint().arb(0, 0.5)

    def told(expression, order=2):
        program = Program(ca.Function("f", [x, y], [expression]))
        given = [[Jet(flint().arb(1) + ball)], [Jet(ball, {0: flint().arb(1)} if order else None)]]
        return jets(program, given, order, crossing=True)[0][0]

    slope = told(ca.fabs(x - 1) * y).first[0]
    assert slope.contains(0.5)
    assert slope.contains(0)
    assert told(ca.if_else(x < 1, 2.0, 3.0) * y).first[0] >= 1.99
    for refused in (ca.fabs(y), ca.if_else(y < 0, 1.0, 2.0), ca.fmax(x * y, 0)):
        with pytest.raises(Undecided):
            told(refused)
    with pytest.raises(Undecided):
        told(ca.fabs(y), order=0)


def test_knots_at_which_the_slope_of_a_table_jumps_are_refused():
    """Lines between values, which turn up and down where the curve goes through them."""
    lines = ca.interpolant("c", "linear", [[-1.0, -0.5, 0.0, 0.5, 1.0]], [1.5, 1.2, 1.0, 1.1, 1.05])
    solution = vc.solve(vc.Problem(lambda x, y, v: lines(y) * v**2, vc.Fixed(0, -0.8), vc.Fixed(1, 0.9)))
    with pytest.raises(vc.VariationalError):
        vc.certify(solution)
