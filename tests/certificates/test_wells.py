"""Certificates of curves with corners hold the truth, and nothing false is proved of others."""

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


def holds(certificate, exact):
    low, high = (mpmath.mpf(f.numerator) / f.denominator for f in map(Fraction, certificate.enclosure))
    return low <= exact <= high


def certified(*problem, **options):
    return vc.certify(vc.solve(vc.Problem(*problem, **options)))


def two_parabolas(x, y, v):
    return ca.fmin((v - 1) ** 2, (v + 1) ** 2) - y


def nearest_of_two(x, y, v):
    return (ca.fabs(v) - 1) ** 2 - y


@pytest.mark.parametrize("lagrangian", [two_parabolas, nearest_of_two])
def test_the_least_of_two_parabolas_is_certified_across_its_corner(lagrangian):
    """p = c - x and v = 1 + p/2 before x = c, -1 + p/2 beyond; y(1) = 5c/2 - 5/4 = 1/4, so c = 3/5."""
    c = Fraction(3, 5)
    bent = (c**3 + (1 - c) ** 3) / 12
    load = (c / 2 - Fraction(1, 6)) / 2 + c - c**2 / 2 - (1 - c) ** 2 / 2  # int (1 - x) v
    certificate = certified(lagrangian, vc.Fixed(0, 0), vc.Fixed(1, 0.25))
    assert holds(certificate, mpmath.mpf((bent - load).numerator) / (bent - load).denominator)
    assert certificate.scope is Scope.ALL
    assert certificate.width < 1e-18


def loaded_wells():
    """int (v^2 - 1)^2 + y from 0 to 1/4: p = x + c = 4 v^3 - 4 v, from v < -1 to the corner at p = 0, and on from 1."""
    with mpmath.workdps(40):

        def last(v):
            return mpmath.findroot(lambda w: 4 * w**3 - 4 * w - (4 * v**3 - 4 * v + 1), 1.1)

        def rise(v):
            return 3 * v**4 - 2 * v**2

        first = mpmath.findroot(lambda v: rise(last(v)) - rise(v) - mpmath.mpf(1) / 4, -1.1)
        c = 4 * first**3 - 4 * first

        def rate(v):
            return ((v**2 - 1) ** 2 + (1 - (4 * v**3 - 4 * v - c)) * v) * (12 * v**2 - 4)

        return mpmath.quad(rate, [first, -1]) + mpmath.quad(rate, [1, last(first)])


def wells(x, y, v):
    return (v**2 - 1) ** 2 + y


def test_a_broken_curve_between_two_wells_is_certified_among_all_curves(waving):
    solution = vc.solve(vc.Problem(wells, vc.Fixed(0, 0), vc.Fixed(1, 0.25)))
    certificate = vc.certify(solution)
    assert holds(certificate, loaded_wells())
    assert certificate.scope is Scope.ALL
    assert certificate.width < 1e-15
    # other curves, of the same ends, at every scale of what they are off by
    along, random = as_graph(solution), np.random.default_rng(5)
    for size in 10.0 ** random.uniform(-9, 0, 5):
        with working(128, 24):
            try:
                found = waving(along, size, random.integers(1, 6)).found()
            except Unproved:
                continue
            assert float((found.value - found.lost).lower()) <= float(loaded_wells()) + 1e-16
            assert float(found.value.upper()) >= float(loaded_wells()) - 1e-16


def test_a_slope_beyond_all_zigzags_is_certified_among_all_curves():
    """v^4 - v^2 at the slope 2, where it lies above its tangent: 12."""
    certificate = certified(lambda x, y, v: v**4 - v**2, vc.Fixed(0, 0), vc.Fixed(1, 2))
    assert holds(certificate, mpmath.mpf(12))
    assert certificate.scope is Scope.ALL


def test_an_end_that_costs_something_is_certified_beside_wells():
    """4 v^3 - 2 v = -2 (v - 3): v^3 = 3/2."""
    certificate = certified(
        lambda x, y, v: v**4 - v**2,
        vc.Fixed(0, 0),
        vc.Free(1),
        end_cost=lambda x0, y0, x1, y1: (y1 - 3) ** 2,
    )
    with mpmath.workdps(40):
        v = mpmath.mpf(1.5) ** (mpmath.mpf(1) / 3)
        assert holds(certificate, v**4 - v**2 + (v - 3) ** 2)
    assert certificate.scope is Scope.ALL


def test_nothing_is_proved_of_a_slope_between_two_wells():
    """v^4 - v^2 at the slope 1/2 is -3/16, and zigzags between +-1/sqrt(2) come to -1/4."""
    problem = vc.Problem(lambda x, y, v: v**4 - v**2, vc.Fixed(0, 0), vc.Fixed(1, 0.5))
    line = vc.solve(problem, vc.Collocation(), throw=False)
    along = as_graph(line)
    with working(128, 24):
        dual = DualBound(statement(along), [(-np.inf, np.inf)])
        dual.check()
        with pytest.raises(Unproved, match="does not bound"):
            dual.found()
