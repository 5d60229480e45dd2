"""Prescribed integrals that are inequalities, held against closed forms in 60 digits."""

from dataclasses import replace

import casadi as ca
import mpmath
import pytest

import varcalc as vc
from varcalc.certificates import Scope


def string(*constraints):
    return vc.Problem(lambda x, y, v: v**2 / 2, vc.Fixed(0, 0), vc.Fixed(1, 0), constraints)


def area(x, y, v):
    return y


def moment(x, y, v):
    return x * y


def numbered(x, y, v):
    return 0.1 * (0.3 * y)


CASES = {
    # 6 c^2, by 6 c x (1 - x)
    "at least": (string(vc.Isoperimetric(area, lower=0.3)), lambda m: 6 * m(0.3) ** 2),
    "at most": (string(vc.Isoperimetric(area, upper=-0.3)), lambda m: 6 * m(0.3) ** 2),
    "between": (string(vc.Isoperimetric(area, lower=0.3, upper=0.5)), lambda m: 6 * m(0.3) ** 2),
    "numbers": (string(vc.Isoperimetric(numbered, lower=0.02)), lambda m: 6 * (m(0.02) / (m(0.1) * m(0.3))) ** 2),
    "idle": (string(vc.Isoperimetric(area, lower=-0.3, upper=0.5)), lambda m: m(0)),
    "one of two": (
        string(vc.Isoperimetric(area, lower=0.3), vc.Isoperimetric(lambda x, y, v: y**2, upper=7.0)),
        lambda m: 6 * m(0.3) ** 2,
    ),
    # 6 c^2 + 60 (m - c/2)^2 3 for the area c and the first moment m, by Legendre's polynomials as slopes
    "beside one that is prescribed": (
        string(vc.Isoperimetric(area, 0.3), vc.Isoperimetric(moment, lower=0.2)),
        lambda m: 6 * m(0.3) ** 2 + 360 * (m(0.2) - m(0.3) / 2) ** 2,
    ),
    "idle beside one that is prescribed": (
        string(vc.Isoperimetric(moment, upper=5.0), vc.Isoperimetric(area, 0.3)),
        lambda m: 6 * m(0.3) ** 2,
    ),
}


@pytest.mark.parametrize(("problem", "exact"), CASES.values(), ids=CASES)
def test_a_level_that_is_an_inequality_is_certified_among_all_curves(problem, exact, bounds):
    certificate = vc.certify(vc.solve(problem))
    low, high = bounds(certificate)
    assert low <= exact(mpmath.mpf) <= high
    assert certificate.scope is Scope.ALL
    assert certificate.width < 1e-15


def test_the_greatest_area_under_an_arc_that_is_no_longer_than_given(bounds):
    """A chord of 2 and an arc of 3: sin(a)/a = 2/3, r = 1/sin(a), r^2 (2a - sin 2a)/2."""
    a = mpmath.findroot(lambda a: mpmath.sin(a) / a - mpmath.mpf(2) / 3, 1.5)
    exact = (2 * a - mpmath.sin(2 * a)) / (2 * mpmath.sin(a) ** 2)
    longest = vc.Isoperimetric(lambda x, y, v: ca.sqrt(1 + v**2), upper=3)
    certificate = vc.certify(vc.solve(vc.Problem(area, vc.Fixed(-1, 0), vc.Fixed(1, 0), [longest], maximise=True)))
    low, high = bounds(certificate)
    assert low <= exact <= high
    assert certificate.scope is Scope.ALL


@pytest.mark.parametrize(("lower", "upper"), [(-1.0, 0.3), (0.2, 1.0), (0.3 + 1e-9, 1.0)])
def test_the_curve_of_another_level_is_refused_or_the_interval_holds_the_truth(lower, upper, bounds):
    """The string of area 0.3, taken for that of levels it is beside, or meets on the wrong side."""
    held = vc.solve(string(vc.Isoperimetric(area, 0.3)))
    problem = string(vc.Isoperimetric(area, lower=lower, upper=upper))
    try:
        low, high = bounds(vc.certify(replace(held, problem=problem, extremal=None)))
    except vc.VariationalError:
        return
    assert low <= 6 * mpmath.mpf(max(lower, 0.0)) ** 2 <= high


def test_what_bends_down_under_a_level_is_certified_in_a_tube_or_refused():
    """int v^2/2 - cos(y) 3 under a level of the area that is met: never a proof for all curves."""
    level = vc.Isoperimetric(area, lower=0.3)
    problem = vc.Problem(lambda x, y, v: v**2 / 2 - 3 * ca.cos(2 * y), vc.Fixed(0, 0), vc.Fixed(1, 0), [level])
    solution = vc.solve(problem)
    certificate = vc.certify(solution)
    assert certificate.scope is Scope.TUBE
    assert certificate.lower - solution.error.value <= solution.value <= certificate.upper + solution.error.value
