"""Lagrangians that jump where the abscissa, or a multiple of it, is a whole number; and switches at quotients of it."""

from fractions import Fraction

import casadi as ca
import mpmath
import pytest

import varcalc as vc


def inside(certificate, exact):
    low, high = (mpmath.mpf(f.numerator) / f.denominator for f in map(Fraction, certificate.enclosure))
    return low <= exact <= high and certificate.lower <= exact <= certificate.upper


def stiff(stiffness, a=0.0, b=1.0):
    """int c(x) v^2 from 0 to b - a: (b - a)^2 over the integral of 1/c."""
    return vc.certify(vc.solve(vc.Problem(lambda x, y, v: stiffness(x) * v**2, vc.Fixed(a, 0), vc.Fixed(b, b - a))))


@pytest.mark.parametrize("count", [4, 10])
def test_a_floor_of_the_abscissa_is_certified(count):
    certificate = stiff(lambda x: 1 + ca.floor(count * x))
    assert inside(certificate, count / sum(1 / mpmath.mpf(k + 1) for k in range(count)))
    assert certificate.width < (1e-22 if count == 4 else 1e-12)


def test_a_ceiling_is_certified_where_no_double_is_at_its_jumps():
    certificate = stiff(lambda x: 5 + ca.ceil(3 * x), -1.0)
    assert inside(certificate, 4 / (sum(1 / mpmath.mpf(5 + k) for k in (-2, -1, 0, 1, 2, 3)) / 3))
    assert certificate.width < 1e-12


@pytest.mark.parametrize("b", [0.25, 0.3])
def test_a_remainder_of_the_abscissa_is_certified(b):
    step = mpmath.mpf(b)
    rest = 1 - step * int(1 / step)
    certificate = stiff(lambda x: 1 + ca.fmod(x, b))
    assert inside(certificate, 1 / (int(1 / step) * mpmath.log(1 + step) + mpmath.log(1 + rest)))


def test_a_remainder_towards_zero_is_certified_on_both_sides_of_it():
    certificate = stiff(lambda x: 2 + ca.fmod(x, 0.25), -1.0)
    sides = mpmath.log(mpmath.mpf(2.25) / 2) + mpmath.log(2 / mpmath.mpf(1.75))
    assert inside(certificate, 4 / (4 * sides))


@pytest.mark.parametrize("level", [0.1, 0.2])
def test_a_switch_at_a_quotient_of_the_abscissa_is_where_it_is_and_not_at_the_double_beside(level):
    """x/3 < 0.1 holds up to 3 * 0.1, which no double is: the interval missed the truth by 3e-17."""
    at = 3 * mpmath.mpf(level)
    certificate = stiff(lambda x: ca.if_else(x / 3 < level, 1, 2))
    assert inside(certificate, 1 / (at + (1 - at) / 2))


def test_a_switch_at_a_share_of_the_abscissa_is_where_it_is():
    at = mpmath.mpf(0.1) * mpmath.mpf(0.7)
    assert inside(stiff(lambda x: ca.if_else(x / 0.7 < 0.1, 1, 2)), 1 / (at + (1 - at) / 2))
