"""Functionals of second order with kinks and jumps: slopes are continuous where a curve meets them.

Where L jumps or has a kink in y, L_y'' is continuous and so is the energy L - y' (L_y' - (L_y'')') - y'' L_y''; where
it has a kink in y', L_y'' and L_y' - (L_y'')' are (Gelfand and Fomin, "Calculus of Variations", sect. 15).
"""

import casadi as ca
import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.optimize import brentq

import varcalc as vc

FIRST, LAST = (1.0, 0.0), (-0.4, 0.3)


def quartics(coefficients, load):
    """Two quartics with the ends' ordinates and slopes: beside 1 and x at each end, coefficients of x^2 and x^3."""
    left = Polynomial([FIRST[0], FIRST[1], *coefficients[:2], load[0] / 24])
    right = Polynomial([LAST[0], LAST[1], *coefficients[2:4], load[1] / 24])
    return left, right(Polynomial([-1.0, 1.0]))


def value(parts, costs, c):
    """The functional of two polynomials joined at c, each with its cost, a polynomial for a polynomial."""
    left, right = (cost(part).integ() for cost, part in zip(costs, parts, strict=True))
    return left(c) - left(0.0) + right(1.0) - right(c)


def solved(conditions, load, between=(0.02, 0.98)):
    """The two quartics and the abscissa c between them at which the ``conditions`` of both and c hold.

    At a given c all but the last are linear in the coefficients.
    """

    def joined(c):
        at = [np.array(conditions(*quartics(row, load), c)) for row in (np.zeros(4), *np.eye(4))]
        rates = np.array([v[:4] - at[0][:4] for v in at[1:]]).T
        return quartics(np.linalg.solve(rates, -at[0][:4]), load)

    def missed(c):
        return conditions(*joined(c), c)[4]

    places = np.linspace(*between, 49)
    signs = np.sign([missed(c) for c in places])
    (k,) = np.flatnonzero(np.diff(signs))
    c = brentq(missed, places[k], places[k + 1], xtol=1e-15)
    return (*joined(c), c)


def continuous(left, right, c, derivatives):
    return [left.deriv(k)(c) - right.deriv(k)(c) if k else left(c) - right(c) for k in derivatives]


def held(problem, parts, costs, c):
    solution = vc.solve(problem)
    assert solution.value == pytest.approx(value(parts, costs, c), abs=3 * solution.error.value + 1e-12)
    assert solution.error.value < 1e-8
    x = np.linspace(0, 1, 101)
    exact = np.where(x < c, parts[0](x), parts[1](x))
    np.testing.assert_allclose(solution.curve(x, 0)[0], exact, atol=10 * solution.error.curve + 1e-10)
    slopes = np.where(x < c, parts[0].deriv()(x), parts[1].deriv()(x))
    np.testing.assert_allclose(solution.curve(x, 1)[0], slopes, atol=1e-5)
    away = np.abs(x - c) > 1e-3
    bends = np.where(x < c, parts[0].deriv(2)(x), parts[1].deriv(2)(x))
    np.testing.assert_allclose(solution.curve(x, 2)[0][away], bends[away], atol=1e-3)


@pytest.mark.parametrize("force", [5.0, 100.0, 400.0])
def test_a_kink_in_the_ordinate(force):
    def conditions(left, right, c):
        return [*continuous(left, right, c, (0, 1, 2, 3)), left(c)]

    left, right, c = solved(conditions, (-force, force))
    problem = vc.Problem(
        lambda x, y, dy, ddy: ddy**2 / 2 + force * ca.fabs(y), vc.Fixed(0, *FIRST), vc.Fixed(1, *LAST), order=2
    )
    costs = [lambda y, side=side: y.deriv(2) ** 2 / 2 + side * force * y for side in (1, -1)]
    held(problem, (left, right), costs, c)


@pytest.mark.parametrize("stiffer", [3.0, 0.25])
def test_a_stiffness_that_jumps_at_an_ordinate(stiffer):
    load, level = 40.0, 0.3

    def conditions(left, right, c):
        def energy(part, stiffness):
            # L - y' S - y'' M with M = stiffness y'', S = -M'
            return (
                -stiffness * part.deriv(2)(c) ** 2 / 2 - load * part(c) + part.deriv()(c) * stiffness * part.deriv(3)(c)
            )

        moments = stiffer * left.deriv(2)(c) - right.deriv(2)(c)
        return [left(c) - level, right(c) - level, *continuous(left, right, c, (1,)), moments,
                energy(left, stiffer) - energy(right, 1.0)]  # fmt: skip

    left, right, c = solved(conditions, (load / stiffer, load))
    problem = vc.Problem(
        lambda x, y, dy, ddy: ca.if_else(y > level, stiffer, 1.0) * ddy**2 / 2 - load * y,
        vc.Fixed(0, *FIRST), vc.Fixed(1, *LAST), order=2,
    )  # fmt: skip
    costs = [lambda y, k=k: k * y.deriv(2) ** 2 / 2 - load * y for k in (stiffer, 1.0)]
    held(problem, (left, right), costs, c)


@pytest.mark.parametrize("friction", [2.0, 30.0])
def test_a_kink_in_the_slope(friction):
    """The slope comes from 0 at the start and rises through 0 on its way to 0.3."""

    def conditions(left, right, c):
        forces = -friction - left.deriv(3)(c), friction - right.deriv(3)(c)
        return [*continuous(left, right, c, (0, 1, 2)), forces[0] - forces[1], left.deriv()(c)]

    left, right, c = solved(conditions, (0.0, 0.0), (0.5, 0.98))
    problem = vc.Problem(
        lambda x, y, dy, ddy: ddy**2 / 2 + friction * ca.fabs(dy), vc.Fixed(0, *FIRST), vc.Fixed(1, *LAST), order=2
    )
    costs = [lambda y, side=side: y.deriv(2) ** 2 / 2 + side * friction * y.deriv() for side in (-1, 1)]
    held(problem, (left, right), costs, c)


def test_what_rests_on_a_kink_of_its_place_is_refused_by_its_name():
    """It comes to rest by infinitely many crossings (Fuller's phenomenon)."""
    upon = vc.Problem(
        lambda x, y, dy, ddy: ddy**2 / 2 + 400 * ca.fabs(y), vc.Fixed(0, 1, 0), vc.Fixed(1, 1, 0), order=2
    )
    with pytest.raises(vc.VariationalError, match=r"kink .fabs. where y = 0"):
        vc.solve(upon)


def test_a_curve_whose_slope_rests_on_a_kink_is_that_of_first_order():
    along = vc.Problem(
        lambda x, y, dy, ddy: ddy**2 / 2 + 20 * ca.fabs(dy) - 130 * y * ca.sin(5 * x),
        vc.Fixed(0, 0, 0), vc.Fixed(1, 0.1, -0.5), order=2,
    )  # fmt: skip
    solution = vc.solve(along)
    # the slope u alone, y sin(5x) by parts, with the area that is the rise
    slope = vc.Problem(
        lambda x, u, du: du**2 / 2 + 20 * ca.fabs(u) - 26 * u * ca.cos(5 * x),
        vc.Fixed(0, 0), vc.Fixed(1, -0.5), [vc.Isoperimetric(lambda x, u, du: u, 0.1)],
    )  # fmt: skip
    assert solution.value == pytest.approx(vc.solve(slope).value + 2.6 * np.cos(5), abs=1e-9)


def test_friction_that_holds_a_curve_all_the_way():
    """The momentum 260 (1 - cos 5x) + c stays between -400 and 400 for a c: y = 1 is the minimum."""
    problem = vc.Problem(
        lambda x, y, dy, ddy: ddy**2 / 2 + 400 * ca.fabs(dy) - 1300 * y * ca.sin(5 * x),
        vc.Fixed(0, 1, 0), vc.Fixed(1, 1, 0), order=2,
    )  # fmt: skip
    solution = vc.solve(problem)
    assert solution.value == pytest.approx(-260 * (1 - np.cos(5)), abs=3 * solution.error.value)
    np.testing.assert_allclose(solution.curve(np.linspace(0, 1, 11), 0), 1.0, atol=1e-8)


def test_a_valley_that_is_gone_where_kinks_are_rounded_off():
    """A ridge of 4e-4 lies before it. IPOPT came to 4.8719 over Hermite's cubics, from curves at random."""

    def lagrangian(x, y, v, a):
        away = (y[0] + 0.816834) ** 2 + (y[1] - 0.365818) ** 2
        plate = 1.769580 * ca.fabs(0.402672 * y[0] + 0.0546885 * y[1] + 0.828665)
        bowl = 0.856511 * (2 * ca.fmax(away - 0.5, 0) - ca.fmax(0.3 - away, 0))
        return 0.15 * ca.sumsqr(a) + (ca.sumsqr(v) - 1) ** 2 / 4 + bowl + plate

    first, last = vc.Fixed(0, [-0.843, 0.397], [-0.126] * 2), vc.Fixed(4, [-0.06, -0.734], [0.045] * 2)
    found = vc.solve(vc.Problem(lagrangian, first, last, order=2))
    assert found.value < 4.872
