"""Tables are certified as the polynomials between knots that CasADi carries out: closed forms of these numbers."""

from dataclasses import replace
from fractions import Fraction

import casadi as ca
import mpmath
import numpy as np
import pytest

import varcalc as vc
from varcalc.certificates.balls import working
from varcalc.certificates.by_tube import certified
from varcalc.certificates.piecewise import value
from varcalc.certificates.proof import BITS, SERIES_LENGTH
from varcalc.certificates.splines import Spline, polynomial_of, spline
from varcalc.symbolic.instructions import Call, instructions
from varcalc.symbolic.look_up import within_knots
from varcalc.verify.candidate import candidate

KNOTS = [0.0, 0.125, 0.3, 0.5, 0.625, 0.8, 1.0]
VALUES = [1.0, 1.3, 1.1, 0.7, 0.9, 1.6, 1.2]


def table(kind, values=VALUES):
    return ca.interpolant(kind, kind, [KNOTS], values)


def read(function):
    """What a problem makes of a table, and the spline read of it."""
    x = ca.SX.sym("x")
    expression = within_knots(function(x))
    called = ca.Function("f", [x], [expression])
    of = next(i.operation.function for i in instructions(called) if isinstance(i.operation, Call))
    return called, spline(of)


def basis(knots, i, p, x):
    """The B-spline of Cox and de Boor, by its definition."""
    if p == 0:
        return mpmath.mpf(knots[i] <= x < knots[i + 1])
    t = [mpmath.mpf(v) for v in knots[i : i + p + 2]]
    left = (x - t[0]) / (t[p] - t[0]) * basis(knots, i, p - 1, x) if t[p] > t[0] else 0
    right = (t[-1] - x) / (t[-1] - t[1]) * basis(knots, i + 1, p - 1, x) if t[-1] > t[1] else 0
    return left + right


def defined(found, x):
    """A spline by the definition of its basis."""
    count = len(found.coefficients)
    return sum(mpmath.mpf(found.coefficients[i]) * basis(found.knots, i, found.degree, x) for i in range(count))


@pytest.mark.parametrize("kind", ["linear", "bspline"])
def test_a_table_is_read_to_the_last_bit_even_after_its_derivatives_were_taken(kind):
    function = table(kind)
    x = ca.SX.sym("x")
    slope = ca.Function("slope", [x], [ca.gradient(ca.gradient(within_knots(function(x)), x), x)])
    slope(0.4)
    called, found = read(function)
    assert found.degree == {"linear": 1, "bspline": 3}[kind]
    for at in (0.03, 0.2, 0.55, 0.99):
        assert abs(float(called(at)) - defined(found, mpmath.mpf(at))) < 1e-15


def test_the_pieces_are_those_of_the_definition():
    found = Spline(np.array([0, 0, 0, 0, 0.25, 0.5, 1, 1, 1, 1]), np.array([1.0, -2, 0.5, 3, -1, 2]), 3)
    for knot, x in ((0.0, "0.0625"), (0.25, "0.375"), (0.5, "0.75")):
        exact = value(polynomial_of(found, knot), Fraction(x) - Fraction(knot))
        assert (
            abs(mpmath.mpf(exact.numerator) / exact.denominator - defined(found, mpmath.mpf(x))) < mpmath.mpf(10) ** -50
        )


@pytest.mark.parametrize("kind", ["linear", "bspline"])
def test_a_stiffness_from_a_table(kind, bounds):
    """int a(x) v^2 from 0 to Y is Y^2 over the integral of 1/a."""
    function = table(kind)
    found = read(function)[1]
    edges = [mpmath.mpf(v) for v in np.unique(found.knots).tolist()]
    with mpmath.workdps(30):
        total = mpmath.quad(lambda x: 1 / defined(found, x), edges)
    solution = vc.solve(vc.Problem(lambda x, y, v: function(x) * v**2, vc.Fixed(0, 0), vc.Fixed(1, 0.5)))
    low, high = bounds(vc.certify(solution))
    assert low - mpmath.mpf(10) ** -28 <= mpmath.mpf("0.25") / total <= high + mpmath.mpf(10) ** -28
    assert high - low < 1e-18


@pytest.mark.parametrize("power", [2, 5, 9])
def test_a_wrong_curve_over_a_table_widens_the_interval_or_is_refused(power, bounds):
    """int a(x) v^2 is Y^2 over the integral of 1/a, which is w log(b/a)/(b - a) over a cell from a to b."""
    function = table("linear")
    solution = vc.solve(vc.Problem(lambda x, y, v: function(x) * v**2, vc.Fixed(0, 0), vc.Fixed(1, 0.5)))
    along = candidate(solution).along_best

    def waved(x, k):
        return along.evaluate(x, k) + 10.0**-power * (3 * np.pi) ** k * np.sin(3 * np.pi * x + k * np.pi / 2)

    with working(BITS, SERIES_LENGTH):
        low, high = bounds(certified(solution, replace(along, evaluate=waved), as_found=True))
    x, a = ([mpmath.mpf(v) for v in row] for row in (KNOTS, VALUES))
    total = sum((x[k + 1] - x[k]) * mpmath.log(a[k + 1] / a[k]) / (a[k + 1] - a[k]) for k in range(len(x) - 1))
    assert low <= mpmath.mpf("0.25") / total <= high


def test_a_table_of_two_arguments_is_named():
    grid = [[0.0, 0.5, 1.0], [-1.0, 0.0, 1.0]]
    surface = ca.interpolant("surface", "linear", grid, np.ones(9))
    solution = vc.solve(
        vc.Problem(lambda x, y, v: v**2 + surface(ca.vertcat(x, y)), vc.Fixed(0, 0.25), vc.Fixed(1, 0.5))
    )
    with pytest.raises(vc.VariationalError, match="surface"):
        vc.certify(solution)
