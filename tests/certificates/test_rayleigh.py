"""The lowest eigenvalue is proved to be the lowest: bounds of Rayleigh's quotient over all curves."""

from dataclasses import replace
from fractions import Fraction

import casadi as ca
import mpmath
import numpy as np
import pytest

import varcalc as vc
from varcalc.certificates import Scope
from varcalc.certificates.balls import working
from varcalc.certificates.by_tube import certified
from varcalc.certificates.integrals import Unproved
from varcalc.certificates.proof import BITS, SERIES_LENGTH
from varcalc.verify.candidate import candidate


def unit(x, y, v):
    return ca.sumsqr(y)


def solved(lagrangian, start=None, end=None, weight=unit, level=1.0, **more):
    ends = start or vc.Fixed(0, 0), end or vc.Fixed(1, 0)
    return vc.solve(vc.Problem(lagrangian, *ends, [vc.Isoperimetric(weight, level)], **more))


def holds(certificate, exact):
    low, high = (mpmath.mpf(f.numerator) / f.denominator for f in map(Fraction, certificate.enclosure))
    return low <= exact <= high


def airy(energy):
    """Vanishes where y'' = (x - energy) y has a solution with zero ends in [0, 1]."""
    return mpmath.airyai(-energy) * mpmath.airybi(1 - energy) - mpmath.airyai(1 - energy) * mpmath.airybi(-energy)


def stretched():
    """(x y')' = -lambda y/x on [1, 2] is sin(pi log x/log 2), of (pi/log 2)^2; here of twice the norm."""
    return 2 * (mpmath.pi / mpmath.log(2)) ** 2


two = vc.Fixed(0, (0, 0)), vc.Fixed(1, (0, 0))
EIGENVALUES = {
    "string": (lambda x, y, v: v**2, {}, lambda: mpmath.pi**2),
    "lowered": (lambda x, y, v: v**2 - 30 * y**2, {}, lambda: mpmath.pi**2 - 30),
    "one free end": (lambda x, y, v: v**2, {"end": vc.Free(1)}, lambda: mpmath.pi**2 / 4),
    "a ramp": (lambda x, y, v: v**2 + x * y**2, {}, lambda: mpmath.findroot(airy, 10.37)),
    "a weight": (
        lambda x, y, v: x * v**2,
        {"start": vc.Fixed(1, 0), "end": vc.Fixed(2, 0), "weight": lambda x, y, v: y**2 / x, "level": 2.0},
        stretched,
    ),
    "two functions": (
        lambda x, y, v: v[0] ** 2 + 2 * v[1] ** 2 + 2 * y[0] * y[1],
        {"start": two[0], "end": two[1]},
        lambda: (3 * mpmath.pi**2 - mpmath.sqrt(mpmath.pi**4 + 4)) / 2,
    ),
    "the greatest": (lambda x, y, v: -(v**2), {"maximise": True}, lambda: -(mpmath.pi**2)),
}


@pytest.mark.parametrize("name", EIGENVALUES)
def test_the_lowest_eigenvalue_among_all_curves(name):
    lagrangian, more, exact = EIGENVALUES[name]
    certificate = vc.certify(solved(lagrangian, **more))
    assert holds(certificate, exact())
    assert certificate.scope is Scope.ALL
    assert certificate.width < 1e-18
    assert "all curves" in str(certificate)
    assert "Whatever is as good" not in str(certificate)  # the negative is


def test_a_column_that_buckles():
    """int y''^2 under int y'^2 = 1, clamped at both ends: 4 pi^2, Euler's load."""
    clamped = vc.Fixed(0, 0, dy=0), vc.Fixed(1, 0, dy=0)
    problem = vc.Problem(
        lambda x, y, v, a: a**2, *clamped, [vc.Isoperimetric(lambda x, y, v, a: v**2, 1.0)], order=2
    )  # fmt: skip
    certificate = vc.certify(vc.solve(problem))
    assert holds(certificate, 4 * mpmath.pi**2)
    assert certificate.scope is Scope.ALL


def displaced(solution, values):
    """The certificate of the curve values(x, k), k the order of the derivative, with the solution's multipliers."""
    along = candidate(solution).along_best
    with working(BITS, SERIES_LENGTH):
        return certified(solution, replace(along, evaluate=values), as_found=True)


@pytest.mark.parametrize("power", [2, 5, 8])
def test_a_wrong_eigenfunction_widens_the_interval_or_is_refused(power):
    def curve(x, k):
        parts = ((1.0, 1), (10.0**-power, 3))
        return sum(h * np.sqrt(2) * (n * np.pi) ** k * np.sin(n * np.pi * x + k * np.pi / 2) for h, n in parts)[None]

    solution = solved(lambda x, y, v: v**2)
    try:
        certificate = displaced(solution, curve)
    except Unproved:
        assert power == 2
    else:
        assert holds(certificate, mpmath.pi**2)


def test_a_higher_eigenfunction_is_not_the_lowest():
    solution = solved(lambda x, y, v: v**2)
    along = candidate(solution).along_best

    def second(x, k):
        return np.sqrt(2) * (2 * np.pi) ** k * np.sin(2 * np.pi * x + k * np.pi / 2)[None]

    with working(BITS, SERIES_LENGTH), pytest.raises(Unproved, match="conjugate point"):
        certified(solution, replace(along, evaluate=second, lambdas=np.array([-4 * np.pi**2])), as_found=True)


def test_the_eigenfunction_of_the_greater_of_two_uncoupled_is_not_the_lowest():
    """(sin(pi x), 0) of eigenvalue pi^2 + 5 beside (0, sin(pi x)) of pi^2: no tube around it has it for its least."""
    solution = solved(lambda x, y, v: ca.sumsqr(v) + 5 * y[0] ** 2, *two)
    along = candidate(solution).along_best

    def first(x, k):
        sine = np.sqrt(2) * np.pi**k * np.sin(np.pi * x + k * np.pi / 2)
        return np.array([sine, 0 * sine])

    with working(BITS, SERIES_LENGTH), pytest.raises(Unproved):
        certified(solution, replace(along, evaluate=first, lambdas=np.array([-(np.pi**2) - 5])), as_found=True)


@pytest.mark.parametrize("lagrangian", [lambda x, y, v: v**2 + y / 10, lambda x, y, v: v**2 + y**4 / 10])
def test_what_is_not_homogeneous_is_no_quotient(lagrangian):
    """The sign of the curve tells, or its size: the tube is all that is spoken of."""
    assert vc.certify(solved(lagrangian)).scope is not Scope.ALL


def test_an_end_that_is_not_zero_makes_no_quotient():
    certificate = vc.certify(solved(lambda x, y, v: v**2, end=vc.Fixed(1, 0.5)))
    assert certificate.scope is Scope.TUBE
