"""Bounds: a lower bound by multipliers of their signs, an upper one from a curve proved to lie within them."""

from dataclasses import replace
from fractions import Fraction

import casadi as ca
import mpmath
import pytest

import varcalc as vc
from varcalc.certificates import Scope
from varcalc.certificates.balls import working
from varcalc.certificates.bounds import Bounds
from varcalc.certificates.integrals import Unproved
from varcalc.certificates.proof import BITS, TERMS
from varcalc.certificates.setting import setting_along
from varcalc.verify.along_curve import along_curve


def hill(x, y, v):
    return y - (1 - x**2)


def certified(lagrangian, start, end, *bounds):
    return vc.certify(vc.solve(vc.Problem(lagrangian, start, end, list(bounds))))


def holds(certificate, exact):
    low, high = (mpmath.mpf(f.numerator) / f.denominator for f in map(Fraction, certificate.enclosure))
    return low <= exact <= high


def test_a_string_over_a_hill():
    """It leaves y = 1 - x^2 at s = 2 - sqrt(3) along tangents."""
    certificate = certified(
        lambda x, y, v: ca.sqrt(1 + v**2), vc.Fixed(-2, 0), vc.Fixed(2, 0), vc.Bound(hill, lower=0)
    )  # fmt: skip
    s = 2 - mpmath.sqrt(3)
    tangent = mpmath.sqrt(1 + 4 * s**2)
    assert holds(certificate, 2 * (2 - s) * tangent + s * tangent + mpmath.asinh(2 * s) / 2)
    assert certificate.scope is Scope.ALL
    assert certificate.width < 1e-11


def test_a_load_under_a_ceiling():
    """int v^2/2 - 4 y with y <= 1: parabolas that reach the ceiling at 1/sqrt(2)."""
    ceiling = vc.Bound(lambda x, y, v: y, upper=1)
    certificate = certified(lambda x, y, v: v**2 / 2 - 4 * y, vc.Fixed(0, 0), vc.Fixed(2, 0), ceiling)
    c = 1 / mpmath.sqrt(2)
    assert holds(certificate, 2 * (16 * c**3 / 3 - 4 * c) - 4 * (2 - 2 * c))


def test_an_action_that_is_not_convex_is_certified_in_a_tube():
    """The oscillator with a force under the same ceiling: 5 cos(x - c) - 4 up to it."""
    ceiling = vc.Bound(lambda x, y, v: y, upper=1)
    certificate = certified(lambda x, y, v: (v**2 - y**2) / 2 - 4 * y, vc.Fixed(0, 0), vc.Fixed(2, 0), ceiling)
    # off the ceiling y'' = -y - 4, so y = 5 cos(x - c) - 4, y(0) = 0: cos(c) = 4/5; the action is then elementary
    c = mpmath.acos(mpmath.mpf(4) / 5)
    side = mpmath.quad(
        lambda t: (25 * mpmath.sin(t) ** 2 - (5 * mpmath.cos(t) - 4) ** 2) / 2 - 4 * (5 * mpmath.cos(t) - 4), [0, c]
    )
    assert holds(certificate, 2 * side - (2 - 2 * c) * mpmath.mpf(9) / 2)


def test_a_bound_that_is_not_touched():
    ceiling = vc.Bound(lambda x, y, v: y, upper=3)
    certificate = certified(lambda x, y, v: v**2 / 2 - 4 * y, vc.Fixed(0, 0), vc.Fixed(2, 0), ceiling)
    assert holds(certificate, -mpmath.mpf(16) / 3)
    assert certificate.width < 1e-18


def test_a_bump_of_the_bound_between_the_points_is_seen():
    """A line below a bump of width 1e-4, on none of whose samples it stands."""
    floor = vc.Bound(lambda x, y, v: y, lower=-0.005)
    solution = vc.solve(vc.Problem(lambda x, y, v: v**2 / 2, vc.Fixed(0, 0), vc.Fixed(2, 0), [floor]))
    along = along_curve(solution.extremal)
    x, y = along.symbols.x, along.symbols.y
    bumped = replace(along, paths=(y - 0.01 * ca.exp(-(((x - 0.7373) / 1e-4) ** 2)),))
    with working(BITS, TERMS):
        Bounds(along).above(setting_along(Bounds(along).with_multipliers(), solution.value))
        held = Bounds(bumped)
        setting = setting_along(held.with_multipliers(), solution.value)
        with pytest.raises(Unproved, match="within its bounds"):
            held.above(setting)


def test_a_bound_on_the_slope_is_refused():
    bound = vc.Bound(lambda x, y, v: v, lower=-9, upper=9)
    with pytest.raises(vc.VariationalError, match="bounds on the slope"):
        certified(lambda x, y, v: v**2 / 2 - 4 * y, vc.Fixed(0, 0), vc.Fixed(2, 0), bound)
