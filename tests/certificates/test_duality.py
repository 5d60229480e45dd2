"""Certificates by convexity alone hold the truth: closed forms at the doubles of the problem, in 60 digits."""

from dataclasses import replace
from fractions import Fraction

import casadi as ca
import mpmath
import numpy as np
import pytest

import varcalc as vc
from varcalc.certificates import Scope
from varcalc.certificates.balls import working
from varcalc.certificates.duality import DualBound
from varcalc.certificates.integrals import Unproved
from varcalc.certificates.setting import as_graph
from varcalc.certificates.statement import statement

SLOPE = vc.Bound(lambda x, y, v: v, lower=-1.0, upper=1.0)


def between(certificate, exact):
    """Whether a number of 60 digits lies in the interval, and the doubles around it."""
    low, high = (mpmath.mpf(f.numerator) / f.denominator for f in map(Fraction, certificate.enclosure))
    return low <= exact <= high and certificate.lower <= exact <= certificate.upper


def certified(*problem, **options):
    return vc.certify(vc.solve(vc.Problem(*problem, **options)))


def sized(v, p):
    """|v|^p, as a power of v where that is a whole even number."""
    return v ** int(p) if p in (4.0, 6.0) else ca.fabs(v) ** p


def loaded(p, g):
    """int |v|^p/p + g y from 0 to 0 in 1: the slope is that of |g (x - 1/2)|^q/q, q = p/(p - 1)."""
    q = mpmath.mpf(p) / (mpmath.mpf(p) - 1)
    return -(mpmath.mpf(g) ** q) * 2 * mpmath.mpf(0.5) ** (q + 1) / (q * (q + 1))


@pytest.mark.parametrize(("p", "width"), [(1.5, 1e-15), (3.0, 1e-8), (4.0, 1e-8)])
def test_a_power_that_does_not_bend_where_the_curve_is_level_is_certified_among_all_curves(p, width):
    certificate = certified(lambda x, y, v: sized(v, p) / p + 0.75 * y, vc.Fixed(0, 0), vc.Fixed(1, 0))
    assert between(certificate, loaded(p, 0.75))
    assert certificate.scope is Scope.ALL
    assert certificate.width < width


@pytest.mark.parametrize("k", [1, 2, 4])
def test_a_radial_weight_is_certified_up_to_its_centre(k):
    """int x^k (v^2/2 - y), y(R) = 0: y' = -x/(k + 1), so J = -R^(k + 3)/(2 (k + 1)^2 (k + 3))."""
    R = mpmath.mpf(1.75)
    certificate = certified(lambda x, y, v: x**k * (v**2 / 2 - y), vc.Free(0), vc.Fixed(1.75, 0))
    assert between(certificate, -(R ** (k + 3)) / (2 * (k + 1) ** 2 * (k + 3)))
    assert certificate.width < 1e-18


def test_a_radial_weight_is_certified_at_an_end_as_well_as_at_a_start():
    R = mpmath.mpf(1.75)
    certificate = certified(lambda x, y, v: x**2 * v**2 / 2 - x**2 * y, vc.Fixed(-1.75, 0), vc.Free(0))
    assert between(certificate, -(R**5) / 90)
    assert certificate.width < 1e-18


def test_a_lagrangian_that_is_linear_in_the_slope_is_certified_between_bounds_of_the_slope():
    """int x y with |v| <= 1 from y(0) = 1: v = -1, so J = int x (1 - x) = -2/3 up to 2."""
    certificate = certified(lambda x, y, v: x * y, vc.Fixed(0, 1), vc.Free(2), [SLOPE])
    assert between(certificate, -mpmath.mpf(2) / 3)
    assert certificate.width < 1e-11


def test_a_size_alone_is_certified_and_no_singular_matrix_is_met():
    """int 0.46 |v| from 0 to 1: 0.46 times what y grows by."""
    certificate = certified(lambda x, y, v: 0.46 * ca.fabs(v), vc.Fixed(0, 0), vc.Fixed(1, 1))
    assert between(certificate, mpmath.mpf(0.46))


@pytest.mark.parametrize("upper", [1.0, 5.0])
def test_a_free_end_that_a_bound_holds_is_certified(upper):
    """int v^2/2 - 3 y(1) with y <= u: u^2/2 - 3 u below u = 3, and -9/2 beyond."""
    certificate = certified(
        lambda x, y, v: v**2 / 2,
        vc.Fixed(0, 0),
        vc.Free(1),
        [vc.Bound(lambda x, y, v: y, upper=upper)],
        end_cost=lambda x0, y0, x1, y1: -3 * y1,
    )
    u = mpmath.mpf(min(upper, 3.0))
    assert between(certificate, u**2 / 2 - 3 * u)
    assert certificate.width < 1e-13


def test_a_curve_that_starts_on_its_bound_is_certified():
    """int v^2/2 + 10 y, y >= 0, from 0 to 1: y = 5 (x - c)^2 from c = 1 - 1/sqrt 5 on, so J = 100 (1 - c)^3/3."""
    certificate = certified(
        lambda x, y, v: v**2 / 2 + 10 * y,
        vc.Fixed(0, 0),
        vc.Fixed(1, 1),
        [vc.Bound(lambda x, y, v: y, lower=0.0)],
    )
    assert between(certificate, 100 * mpmath.mpf(5) ** mpmath.mpf(-1.5) / 3)
    assert certificate.width < 1e-12


def test_slopes_that_rest_at_bounds_up_to_a_free_end_are_certified():
    """int v^2/2 + 10 y, |v| <= 1, from y(0) = 0 to a free end: p = 10 (x - 1), and J = - int of p^2/2 or |p| - 1/2."""
    certificate = certified(lambda x, y, v: v**2 / 2 + 10 * y, vc.Fixed(0, 0), vc.Free(1), [SLOPE])
    assert between(certificate, -mpmath.mpf(1) / 60 - (mpmath.mpf(99) / 20 - mpmath.mpf(9) / 20))
    assert certificate.width < 1e-10


@pytest.mark.parametrize("p", [1.5, 3.0, 4.0])
@pytest.mark.parametrize("smallest", [-8, -4])
def test_no_curve_however_wrong_gives_a_bound_above_the_infimum(smallest, p, waving):
    """Every power with an error too small to be told from round-off, and with a large one."""
    random = np.random.default_rng([-smallest, int(2 * p)])
    size = 10.0 ** random.uniform(smallest, smallest + 4)
    solution = vc.solve(vc.Problem(lambda x, y, v: sized(v, p) / p + 0.75 * y, vc.Fixed(0, 0), vc.Fixed(1, 0)))
    with working(128, 24):
        try:
            found = waving(as_graph(solution), size, random.integers(1, 6)).found()
        except Unproved:
            return
        low, high = found.value - found.lost, found.value
        assert float(low.lower()) <= float(loaded(p, 0.75)) <= float(high.upper()) + 1e-16


def test_a_curve_that_is_steep_where_it_should_not_be_gives_no_bound_above_the_infimum():
    """int |v|^3/3 + y to a free end in 1/2: places next to each other, far from the curve, were taken for one."""
    solution = vc.solve(vc.Problem(lambda x, y, v: ca.fabs(v) ** 3 / 3 + y, vc.Fixed(0, 0), vc.Free(0.5)))
    along = as_graph(solution)

    def evaluate(x, k):
        # at the start, where it is held, it is off: it comes from there in a straight line
        return along.evaluate(x, k) + 4.0 * [np.cos, lambda t: -np.sin(t), lambda t: -np.cos(t)][k](x)

    with working(128, 24):
        dual = DualBound(statement(replace(along, evaluate=evaluate)), [(-np.inf, np.inf)])
        dual.check()
        found = dual.found()
        assert float((found.value - found.lost).lower()) <= -(0.5**2.5) * 4 / 15


def test_what_is_not_convex_is_not_certified_by_convexity():
    with pytest.raises(vc.VariationalError):
        certified(lambda x, y, v: v**4 / 4 - 40 * y**2, vc.Fixed(0, 0), vc.Fixed(1, 0))
