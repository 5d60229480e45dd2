"""Bounds: a lower bound by multipliers of their signs, an upper one from a curve proved to lie within them."""

from dataclasses import replace
from fractions import Fraction
from functools import cache

import casadi as ca
import mpmath
import numpy as np
import pytest

import varcalc as vc
from varcalc.certificates import Scope
from varcalc.certificates.balls import working
from varcalc.certificates.bounds import Bounds
from varcalc.certificates.by_tube import bounded
from varcalc.certificates.choice import silent
from varcalc.certificates.integrals import Unproved
from varcalc.certificates.proof import BITS, SERIES_LENGTH
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


def test_an_action_that_a_bound_alone_keeps_from_falling():
    """The oscillator with a load, for a time beyond pi under a ceiling: y + 1 is (1 + h) cos(s - x) up to it."""
    h = mpmath.mpf(0.3)
    ceiling = vc.Bound(lambda x, y, v: y, upper=0.3)
    certificate = certified(lambda x, y, v: (v**2 - y**2) / 2 - y, vc.Fixed(0, 0), vc.Fixed(4, 0), ceiling)
    s = mpmath.acos(1 / (1 + h))
    side = mpmath.quad(
        lambda t: ((1 + h) ** 2 * mpmath.sin(t) ** 2 - ((1 + h) * mpmath.cos(t) - 1) ** 2) / 2
        - (1 + h) * mpmath.cos(t) + 1, [0, s]
    )  # fmt: skip
    assert holds(certificate, 2 * side - (4 - 2 * s) * (h**2 / 2 + h))
    assert certificate.scope is Scope.TUBE


def test_a_length_below_a_ceiling_is_certified_in_a_tube():
    """The greatest area over [0, 1] in a length of 1.25 below 0.3: arcs R (1 - cos t) high that touch the ceiling."""
    held = [vc.Bound(lambda x, y, v: y, upper=0.3), vc.Isoperimetric(lambda x, y, v: ca.sqrt(1 + v**2), 1.25)]
    certificate = certified(lambda x, y, v: -y, vc.Fixed(0, 0), vc.Fixed(1, 0), *held)
    h = mpmath.mpf(0.3)

    def radius(t):
        return h / (1 - mpmath.cos(t))

    t = mpmath.findroot(lambda t: 2 * radius(t) * (t - mpmath.sin(t)) - 0.25, (0.8, 1.4), "anderson")
    R, s = radius(t), radius(t) * mpmath.sin(t)
    below = s * (h - R) + R**2 * (t + mpmath.sin(t) * mpmath.cos(t)) / 2
    assert holds(certificate, -(2 * below + (1 - 2 * s) * h))
    assert certificate.scope is Scope.TUBE


def test_what_is_left_of_a_curve_that_vanishes_has_no_size():
    """A pendulum that hangs upside down for a time below pi, solved to 1e-28 of zero."""
    ceiling = vc.Bound(lambda x, y, v: y, upper=0.5)
    certificate = certified(lambda x, y, v: v**2 / 2 + ca.cos(y), vc.Fixed(0, 0), vc.Fixed(3, 0), ceiling)
    assert holds(certificate, 3)
    assert certificate.tube > 1e-3


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
    with working(BITS, SERIES_LENGTH):
        Bounds(along).above(setting_along(Bounds(along).plain, solution.value, Bounds(along).terms))
        held = Bounds(bumped)
        setting = setting_along(held.plain, solution.value, held.terms)
        with pytest.raises(Unproved, match="within its bounds"):
            held.above(setting)


def rise(F, h, u):
    """int v^2/2 - F y over a parabola y = h - F (u - x)^2/2, x from 0 to u."""
    return F**2 * u**3 / 3 - F * h * u


def under_the_ceiling(F, h, T):
    """int v^2/2 - F y under y <= h between zeros at 0 and T, where it is touched."""
    c = mpmath.sqrt(2 * h / F)
    return 2 * rise(F, h, c) - F * h * (T - 2 * c)


def through_a_waypoint():
    """int v^2/2 - 8 y under y <= 0.2 between zeros at 0 and 1, by 0.1 in the middle."""
    h, least = mpmath.mpf(0.2), mpmath.mpf(0.1)
    c, u = mpmath.sqrt(h / 4), mpmath.sqrt((h - least) / 4)
    return 2 * (rise(8, h, c) + rise(8, h, u) - 8 * h * (0.5 - c - u))


def held_back():
    """int v^2/2 + 2 y^2 from 2 over a time 3, v >= -1: a line to s, then A cosh(2 (3 - x)) with 2 y tanh = 1."""
    s = mpmath.findroot(lambda s: 2 * (2 - s) * mpmath.tanh(2 * (3 - s)) - 1, (1.4, 1.6), "anderson")
    return s / 2 + 2 * (8 - (2 - s) ** 3) / 3 + (2 - s) / 2


def from_ceiling_to_floor():
    """int v^2/2 - 20 sin(2 pi x) y within 0.1: four parts alike of y'' = -20 sin(2 pi x), and what rests on either."""
    w, h = 2 * mpmath.pi, mpmath.mpf(0.1)

    def height(x, s):
        return 20 / w * (mpmath.sin(w * x) / w - x * mpmath.cos(w * s))

    s = mpmath.findroot(lambda s: height(s, s) - h, (0.1, 0.2), "anderson")
    part = mpmath.quad(
        lambda x: (20 / w * (mpmath.cos(w * x) - mpmath.cos(w * s))) ** 2 / 2 - 20 * mpmath.sin(w * x) * height(x, s),
        [0, s],
    )
    return 4 * part - 2 * 20 * h * 2 * mpmath.cos(w * s) / w


def round_a_disc():
    """Half the square of the length from (-1, 0.1) to (1, 0.1) above a disc of radius 1/2: tangents and an arc."""
    far, h = mpmath.sqrt(1 + mpmath.mpf(0.1) ** 2), mpmath.mpf(0.1)
    arc = mpmath.pi - 2 * mpmath.atan(h) - 2 * mpmath.acos(1 / (2 * far))
    return (2 * mpmath.sqrt(far**2 - mpmath.mpf("0.25")) + arc / 2) ** 2 / 2


def area_under_a_ceiling(h, c):
    """int v^2/2 between zeros over an area c under y <= h: parabolas that reach h at s, by h - c = 2 h s/3."""
    s = (1 - c / h) * 3 / 2
    return (2 * h / s**2) ** 2 * s**3 / 3


def area_under_slopes(a, c):
    """int v^2/2 between zeros over an area c with |v| <= a: v is a up to s, and falls to 0 in the middle."""

    def area(s):
        return a * s * (1 - s) + a * (1 - 2 * s) ** 2 / 6

    s = mpmath.findroot(lambda s: area(s) - c, (0.01, 0.45), "anderson")
    return a**2 * s + a**2 * (0.5 - s) / 3


def slopes_about_a_waypoint(h):
    """int v^2/2 - 4 y between zeros at 0 and 2 by (1, h), |v| <= 1: v is 1, and 1 - 4 u on the last sqrt((1 - h)/2)."""
    u = mpmath.sqrt((1 - h) / 2)
    s = 1 - u
    line = s / 2 - 2 * s**2
    return 2 * (line + mpmath.quad(lambda t: (1 - 4 * t) ** 2 / 2 - 4 * (s + t - 2 * t**2), [0, u]))


def load(x, y, v):
    return v**2 / 2 - 8 * y


def bare(x, y, v):
    return v**2 / 2


def loads(x, y, v):
    return ca.sumsqr(v) / 2 - 8 * y[0] - 8 * y[1]


LOW = vc.Bound(lambda x, y, v: y, upper=0.2)
WITHIN = {
    "slopes on both sides": (
        lambda x, y, v: v**2 / 2 - 4 * y, vc.Fixed(0, 0), vc.Fixed(2, 0),
        [vc.Bound(lambda x, y, v: v, lower=-1, upper=1)], lambda: -mpmath.mpf(37) / 12,
    ),
    "a slope up to a free end": (
        lambda x, y, v: v**2 / 2 - 4 * y, vc.Fixed(0, 0), vc.Free(2),
        [vc.Bound(lambda x, y, v: v, upper=3)], lambda: -mpmath.mpf(16.125),
    ),
    "a slope of what is drawn to zero": (
        lambda x, y, v: v**2 / 2 + 2 * y**2, vc.Fixed(0, 2), vc.Free(3),
        [vc.Bound(lambda x, y, v: v, lower=-1, upper=1)], held_back,
    ),
    "an end that is free on the bound": (
        load, vc.Fixed(0, 0), vc.Free(1), [LOW], lambda: under_the_ceiling(8, mpmath.mpf(0.2), 2) / 2
    ),
    "a waypoint below the bound": (
        load, vc.Fixed(0, 0), vc.Fixed(1, 0), [LOW, vc.Through(0.5, 0.1)],
        through_a_waypoint,
    ),
    "slopes about a waypoint": (
        lambda x, y, v: v**2 / 2 - 4 * y, vc.Fixed(0, 0), vc.Fixed(2, 0),
        [vc.Bound(lambda x, y, v: v, lower=-1, upper=1), vc.Through(1.0, 0.6)],
        lambda: slopes_about_a_waypoint(mpmath.mpf(0.6)),
    ),
    "an area under a ceiling": (
        bare, vc.Fixed(0, 0), vc.Fixed(1, 0), [LOW, vc.Isoperimetric(lambda x, y, v: y, 0.15)],
        lambda: area_under_a_ceiling(mpmath.mpf(0.2), mpmath.mpf(0.15)),
    ),
    "an area under slopes": (
        bare, vc.Fixed(0, 0), vc.Fixed(1, 0),
        [vc.Bound(lambda x, y, v: v, lower=-0.9, upper=0.9), vc.Isoperimetric(lambda x, y, v: y, 0.18)],
        lambda: area_under_slopes(mpmath.mpf(0.9), mpmath.mpf(0.18)),
    ),
    "a ceiling and a floor": (
        lambda x, y, v: v**2 / 2 - 20 * ca.sin(2 * np.pi * x) * y, vc.Fixed(0, 0), vc.Fixed(1, 0),
        [vc.Bound(lambda x, y, v: y, lower=-0.1, upper=0.1)], from_ceiling_to_floor,
    ),
    "one of two functions": (
        lambda x, y, v: ca.sumsqr(v) / 2 - 8 * y[0] + y[1] ** 2 / 2, vc.Fixed(0, (0, 0)), vc.Fixed(1, (0, 1)),
        [vc.Bound(lambda x, y, v: y[0], upper=0.2)],
        lambda: under_the_ceiling(8, mpmath.mpf(0.2), 1) + mpmath.coth(1) / 2,
    ),
    "both of two functions": (
        loads, vc.Fixed(0, (0, 0)), vc.Fixed(1, (0, 0)),
        [vc.Bound(lambda x, y, v: y[0], upper=0.2), vc.Bound(lambda x, y, v: y[1], upper=0.3)],
        lambda: under_the_ceiling(8, mpmath.mpf(0.2), 1) + under_the_ceiling(8, mpmath.mpf(0.3), 1),
    ),
    "a disc that two functions go round": (
        lambda x, y, v: ca.sumsqr(v) / 2, vc.Fixed(0, (-1, 0.1)), vc.Fixed(1, (1, 0.1)),
        [vc.Bound(lambda x, y, v: ca.sumsqr(y), lower=0.25)], round_a_disc,
    ),
}  # fmt: skip


@cache
def within(name):
    lagrangian, start, end, bounds, _ = WITHIN[name]
    return vc.solve(vc.Problem(lagrangian, start, end, bounds))


@pytest.mark.parametrize("name", WITHIN)
def test_what_is_held_within_bounds(name):
    """The wider intervals are of curves whose places of contact are known to the mesh alone."""
    certificate = vc.certify(within(name))
    assert holds(certificate, WITHIN[name][-1]())
    assert certificate.scope is Scope.ALL
    assert certificate.width < 1e-5


@pytest.mark.parametrize(
    "name",
    ["slopes on both sides", "a ceiling and a floor", "an end that is free on the bound", "an area under a ceiling"],
)
@pytest.mark.parametrize("power", [2, 5, 9])
def test_a_wrong_curve_within_bounds_widens_the_interval_or_is_refused(name, power):
    end, exact = WITHIN[name][2], WITHIN[name][-1]
    solution = within(name)
    along, w = along_curve(solution.extremal), np.pi / end.x

    def wrong(x, k):
        return along.evaluate(x, k) + 10.0**-power * w**k * np.sin(w * x + k * np.pi / 2)

    with working(BITS, SERIES_LENGTH):
        held = Bounds(replace(along, evaluate=wrong))
        try:
            held.prove_signs()
            certificate = bounded(solution, setting_along(held.plain, solution.value, held.terms), silent, held)[2]
        except Unproved:
            return
    assert holds(certificate, exact())


def test_a_free_end_that_costs_stays_where_it_is():
    """int v^2/2 - 8 y with y <= 0.2 up to a free end of the cost 3 y^2, which the curve leaves the bound for."""
    problem = vc.Problem(load, vc.Fixed(0, 0), vc.Free(1), [LOW], end_cost=lambda a, b, x, y: 3 * y**2)
    h = mpmath.mpf(0.2)
    c, u = mpmath.sqrt(h / 4), (mpmath.sqrt(4 + 36 * h) - 2) / 12  # 8 u = 6 (h - 4 u^2)
    exact = rise(8, h, c) + rise(8, h, u) - 8 * h * (1 - c - u) + 3 * (h - 4 * u**2) ** 2
    assert holds(vc.certify(vc.solve(problem)), exact)


def test_a_mesh_that_ends_a_bit_of_round_off_beside_the_interval():
    """A load under a ceiling: -f^2 c^3/3 - f h (T - 2 c), c = sqrt(2 h/f), to less than a bit of T."""
    f, T, h = 6.1750694964189705, 0.9309929118798045, 0.663771401645407
    ceiling = [vc.Bound(lambda x, y, v: y, upper=h)]
    problem = vc.Problem(lambda x, y, v: v**2 / 2 - f * y, vc.Fixed(0, 0), vc.Fixed(T, 0), ceiling)
    certificate = vc.certify(vc.solve(problem))
    F, L, H = map(mpmath.mpf, (f, T, h))
    c = mpmath.sqrt(2 * H / F)
    low, high = (mpmath.mpf(g.numerator) / g.denominator for g in map(Fraction, certificate.enclosure))
    assert low <= -(F**2) * c**3 / 3 - F * H * (L - 2 * c) <= high
