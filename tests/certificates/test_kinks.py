"""Lagrangians with convex kinks, held against closed forms in 60 digits."""

from dataclasses import replace
from functools import cache

import casadi as ca
import mpmath
import numpy as np
import pytest

import varcalc as vc
from varcalc.certificates import Scope
from varcalc.certificates.balls import working
from varcalc.certificates.integrals import Unproved
from varcalc.certificates.kinks import kinks
from varcalc.certificates.proof import BITS, SERIES_LENGTH


def solved(lagrangian, start, end, **options):
    return vc.solve(vc.Problem(lagrangian, vc.Fixed(*start), vc.Fixed(*end), **options))


def flat_top(k, f, length):
    """int v^2/2 + k |v| - f y between zeros: parabolas, and between them a flat top 2 k/f long."""
    k, f, length = map(mpmath.mpf, (k, f, length))
    side = (length - 2 * k / f) / 2
    return -(f**2) * side**3 / 3


def dead_core(k, h, length):
    """int v^2/2 + k |y| between heights h, further apart than the parabolas that end at y = 0."""
    k, h, length = map(mpmath.mpf, (k, h, length))
    side = mpmath.sqrt(2 * h / k)
    assert length > 2 * side
    return 2 * k**2 * side**3 / 3


def crossing():
    """int v^2/2 + |y| from (0, -1) to (1, 2): y'' is the sign of y."""

    def missed(a, c):
        return [-1 + a * c - c**2 / 2, (a - c) * (1 - c) + (1 - c) ** 2 / 2 - 2]

    a, c = mpmath.findroot(missed, (3.0, 0.34))
    left = mpmath.quad(lambda x: (a - x) ** 2 / 2 - (-1 + a * x - x**2 / 2), [0, c])
    return left + mpmath.quad(lambda x: (a - 2 * c + x) ** 2 / 2 + (a - c) * (x - c) + (x - c) ** 2 / 2, [c, 1])


CASES = {
    "a flat top": (lambda x, y, v: v**2 / 2 + ca.fabs(v) - 12 * y, (0, 0), (1, 0), lambda: flat_top(1, 12, 1)),
    # the slope where the top begins is round-off, of a sign that hangs on how it is evaluated
    "a flat top between places known to round-off": (
        lambda x, y, v: v**2 / 2 + 1.458596182954353 * ca.fabs(v) - 4.649965111096241 * y,
        (0, 0), (0.9761853994376252, 0),
        lambda: flat_top(1.458596182954353, 4.649965111096241, 0.9761853994376252),
    ),
    "a dead core": (lambda x, y, v: v**2 / 2 + ca.fabs(y), (0, 1), (4, 1), lambda: dead_core(1, 1, 4)),
    "a dead core on a mesh that ends a bit of round-off early": (
        lambda x, y, v: v**2 / 2 + 1.3233330121794862 * ca.fabs(y),
        (0, 1.4301679826311255), (3.6869803635091745, 1.4301679826311255),
        lambda: dead_core(1.3233330121794862, 1.4301679826311255, 3.6869803635091745),
    ),
    "numbers": (
        lambda x, y, v: v**2 / 2 + 0.1 * (7 * ca.fabs(y)), (0, 0.3), (4, 0.3),
        lambda: dead_core(mpmath.mpf(0.1) * 7, 0.3, 4),
    ),
    "the greater of two": (
        lambda x, y, v: v**2 + ca.fmax(y, 0.5), (0, 1), (4, 1), lambda: 2 + 2 * mpmath.sqrt(2) / 3
    ),
    "a kink that is crossed": (lambda x, y, v: v**2 / 2 + ca.fabs(y), (0, -1), (1, 2), crossing),
    "a kink beside the curve": (
        lambda x, y, v: v**2 / 2 + ca.fabs(y), (0, 1), (1, 1), lambda: mpmath.mpf(23) / 24
    ),
}  # fmt: skip


@cache
def solution_of(name):
    return solved(*CASES[name][:3])


@pytest.mark.parametrize("name", CASES)
def test_a_convex_kink_is_certified_among_all_curves(name, bounds):
    certificate = vc.certify(solution_of(name))
    low, high = bounds(certificate)
    assert low <= CASES[name][3]() <= high
    assert certificate.scope is Scope.ALL
    assert certificate.width < 2e-12


@pytest.mark.parametrize("length", [3.6, 3.8, 4.2, 4.4, 4.7, 5.0])
def test_a_curve_that_rests_without_a_load_is_certified_wherever_round_off_puts_it(length, bounds):
    """The multiplier is -1 all along, and the curve is on either side of the kink by a bit of round-off."""
    certificate = vc.certify(solved(lambda x, y, v: v**2 + ca.fmax(y, 0.5), (0, 1), (length, 1)))
    low, high = bounds(certificate)
    assert low <= mpmath.mpf(length) / 2 + 2 * mpmath.sqrt(2) / 3 <= high
    assert certificate.scope is Scope.ALL
    assert certificate.width < 2e-12


def test_a_kink_that_is_followed_from_its_one_side_to_the_other_under_a_load(bounds):
    """int v^2/2 + b |v - s| - k cos(x) y: with p = C - k sin(x) the slope is p - b, s or p + b."""
    b, s, k, T = (float(v) for v in (0.4, 0.3, 2.0, 2.0))

    def slope(x, C):
        rest = C - k * mpmath.sin(x) - s
        return s + max(abs(rest) - b, 0) * mpmath.sign(rest)

    def places(C):
        return [0, mpmath.asin((C - s - b) / k), mpmath.asin((C - s + b) / k), mpmath.pi / 2, T]

    def rise(C):
        return mpmath.quad(lambda x: slope(x, C), places(C))

    end = float(rise(mpmath.mpf("1.5")))
    C = mpmath.findroot(lambda c: rise(c) - end, (1.49, 1.51))

    def rate(x):
        v = slope(x, C)
        return v**2 / 2 + b * abs(v - s) + k * mpmath.sin(x) * v

    exact = mpmath.quad(rate, places(C)) - k * mpmath.sin(T) * end
    certificate = vc.certify(
        solved(lambda x, y, v: v**2 / 2 + b * ca.fabs(v - s) - k * ca.cos(x) * y, (0, 0), (T, end))
    )
    low, high = bounds(certificate)
    assert low <= exact <= high
    assert certificate.width < 1e-10


def test_a_maximum(bounds):
    problem = vc.Problem(
        lambda x, y, v: -(v**2) / 2 - ca.fabs(y), vc.Fixed(0, 1), vc.Fixed(4, 1), maximise=True
    )  # fmt: skip
    low, high = bounds(vc.certify(vc.solve(problem)))
    assert low <= -dead_core(1, 1, 4) <= high


def test_a_potential_that_is_not_convex_is_certified_in_a_tube():
    """A kink that is crossed beside -cos(y)/3, in a tube that holds the curve of the upper bound."""
    solution = solved(lambda x, y, v: v**2 / 2 + ca.fabs(y) - ca.cos(y) / 3, (0, -1), (1, 2))
    certificate = vc.certify(solution)
    assert certificate.scope is Scope.TUBE
    assert certificate.lower - solution.error.value <= solution.value <= certificate.upper + solution.error.value


@pytest.mark.parametrize("power", [2, 4, 6, 9])
@pytest.mark.parametrize("name", ["a flat top", "a dead core", "a kink that is crossed"])
def test_a_wrong_curve_widens_the_interval_or_is_refused(name, power, bounds):
    _, start, end, exact = CASES[name]
    solution = solution_of(name)
    given = solution.curve
    w = 3 * np.pi / (end[0] - start[0])

    def wrong(x, k):
        return given(x, k) + 10.0**-power * w**k * np.sin(w * x + k * np.pi / 2)

    try:
        low, high = bounds(vc.certify(replace(solution, curve=wrong, extremal=None)))
    except vc.VariationalError:
        return
    assert low <= exact() <= high


@cache
def onto_a_kink_and_off():
    return solved(lambda x, y, v: v**2 / 2 + ca.fabs(y), (0, 1), (4, 1))


@pytest.mark.parametrize("shift", [-0.05, -1e-3, 1e-3, 0.05])
def test_places_where_the_curve_meets_its_kink_that_are_wrong(shift, bounds):
    """The signs of wrong pieces are still subgradients: the interval widens."""
    solution = onto_a_kink_and_off()
    moved = solution.x + shift * np.sin(np.pi * solution.x / 4)
    try:
        low, high = bounds(vc.certify(replace(solution, x=moved, extremal=None)))
    except vc.VariationalError:
        return
    assert low <= dead_core(1, 1, 4) <= high


@pytest.mark.parametrize("factor", [1.001, -1.5, 1e3])
def test_what_is_no_subgradient_is_refused(factor):
    kinked = kinks(solved(lambda x, y, v: v**2 / 2 + ca.fabs(v) - 12 * y, (0, 0), (1, 0)))
    assert kinked is not None
    wrong = [[factor * c if len(c) > 1 else c for c in row] for row in kinked.subgradients]
    kinked.__dict__["subgradients"] = wrong
    with working(BITS, SERIES_LENGTH), pytest.raises(Unproved, match="subgradient"):
        kinked.prove()


TURNED_OVER = (
    "what a kink is multiplied by|kinks and jumps that the curve meets|the Lagrangian is not enclosed.*switches"
)


@pytest.mark.parametrize(
    "lagrangian",
    [
        lambda x, y, v: v**2 / 2 - 0.3 * ca.fabs(y),
        lambda x, y, v: v**2 / 2 + x * ca.fabs(y),
        lambda x, y, v: v**2 / 2 + ca.fmin(y, 2 * y),
    ],
)
def test_a_kink_that_is_not_convex_is_not_taken_for_one(lagrangian):
    """Through y = 0 from x = -1 on: nothing is proved where the kink is turned over."""
    solution = vc.solve(vc.Problem(lagrangian, vc.Fixed(-1, -1), vc.Fixed(1, 2)))
    with pytest.raises(vc.VariationalError, match=f"no certificate: ({TURNED_OVER})"):
        vc.certify(solution)


def test_a_curve_outside_the_tube_bounds_nothing_in_it():
    """Of the curve of the upper bound it is proved that it lies where the theorem speaks of."""
    solution = solved(lambda x, y, v: v**2 / 2 + ca.fabs(y) - ca.cos(y) / 3, (0, -1), (1, 2))

    def far(x, k):
        return solution.curve(x, k) + 0.5 * np.pi**k * np.sin(np.pi * x + k * np.pi / 2)

    with pytest.raises(vc.VariationalError, match="no certificate"):
        vc.certify(replace(solution, curve=far, extremal=None))


def test_a_kink_that_is_written_twice(bounds):
    """|y| + |y|/2 along a dead core is 3/2 |y|."""
    certificate = vc.certify(solved(lambda x, y, v: v**2 / 2 + ca.fabs(y) + ca.fabs(y) / 2, (0, 1), (5, 1)))
    low, high = bounds(certificate)
    assert low <= dead_core(1.5, 1, 5) <= high
    assert certificate.width < 1e-11


def test_a_kink_beside_a_level_that_is_an_inequality_is_refused_for_that():
    level = vc.Isoperimetric(lambda x, y, v: y, lower=0.5)
    problem = vc.Problem(lambda x, y, v: v**2 / 2 + ca.fabs(v), vc.Fixed(0, 0), vc.Fixed(1, 0), [level])
    solution = vc.solve(problem)
    with pytest.raises(vc.VariationalError, match="kinks and jumps that the curve meets are covered where"):
        vc.certify(solution)


def top_of_an_area(c):
    """int v^2/2 + |v| between zeros over an area c: v = b (s - x) up to s = 1/2 - 1/b, and flat."""

    def area(b):
        s = mpmath.mpf("0.5") - 1 / b
        return b * s**3 * 2 / 3 + (1 - 2 * s) * b * s**2 / 2

    b = mpmath.findroot(lambda b: area(b) - c, (2.1, 40), "anderson")
    s = mpmath.mpf("0.5") - 1 / b
    return b**2 * s**3 / 3 + b * s**2


def rest_over_an_area(k, h, c):
    """int v^2/2 + k |y - h| between zeros over an area c: parabolas that reach h at s, by h - c = 2 h s/3."""
    s = (1 - c / h) * 3 / 2
    b = 2 * h / s**2
    return b**2 * s**3 / 3 + k * b * s**3 / 3


def pulled_loss(k, h, c):
    """int v^2/2 + k Huber(y) from (0, 0) to (1, 1) over an area c: y'' = k y + m up to h, at s, and k h + m."""
    w = mpmath.sqrt(k)

    def low(x, a, m):
        return a * mpmath.sinh(w * x) + m / k * (mpmath.cosh(w * x) - 1)

    def slope(x, a, m):
        return a * w * mpmath.cosh(w * x) + m / w * mpmath.sinh(w * x)

    def high(x, a, m, s):
        return h + slope(s, a, m) * (x - s) + (k * h + m) * (x - s) ** 2 / 2

    def missed(a, m, s):
        area = mpmath.quad(lambda x: low(x, a, m), [0, s]) + mpmath.quad(lambda x: high(x, a, m, s), [s, 1])
        return [low(s, a, m) - h, high(1, a, m, s) - 1, area - c]

    a, m, s = mpmath.findroot(missed, (1.5, -4.0, 0.05))
    near = mpmath.quad(lambda x: (slope(x, a, m) ** 2 + k * low(x, a, m) ** 2) / 2, [0, s])
    return near + mpmath.quad(
        lambda x: (slope(s, a, m) + (k * h + m) * (x - s)) ** 2 / 2 + k * h * (high(x, a, m, s) - h / 2), [s, 1]
    )


LEVELS = {
    "a flat top": (lambda x, y, v: v**2 / 2 + ca.fabs(v), 0, 0.3, {}, lambda: top_of_an_area(mpmath.mpf(0.3))),
    "a maximum": (
        lambda x, y, v: -(v**2) / 2 - ca.fabs(v), 0, 0.3, {"maximise": True}, lambda: -top_of_an_area(mpmath.mpf(0.3))
    ),
    "a height that is rested on": (
        lambda x, y, v: v**2 / 2 + 9 * ca.fabs(y - 0.25), 0, 0.18, {},
        lambda: rest_over_an_area(9, mpmath.mpf(0.25), mpmath.mpf(0.18)),
    ),
    "Huber's loss": (
        lambda x, y, v: v**2 / 2 + 5 * ca.if_else(ca.fabs(y) < 0.25, y**2 / 2, 0.25 * (ca.fabs(y) - 0.125)), 1, 0.7, {},
        lambda: pulled_loss(5, mpmath.mpf(0.25), mpmath.mpf(0.7)),
    ),
}  # fmt: skip


@cache
def on_a_level(name):
    lagrangian, height, area, options, _ = LEVELS[name]
    level = vc.Isoperimetric(lambda x, y, v: y, area)
    return vc.solve(vc.Problem(lagrangian, vc.Fixed(0, 0), vc.Fixed(1, height), [level], **options))


@pytest.mark.parametrize("name", LEVELS)
def test_kinks_beside_a_prescribed_integral(name, bounds):
    certificate = vc.certify(on_a_level(name))
    low, high = bounds(certificate)
    assert low <= LEVELS[name][-1]() <= high
    assert certificate.scope is Scope.ALL
    assert certificate.width < 1e-7


@pytest.mark.parametrize("power", [2, 5, 9])
def test_a_wrong_curve_beside_a_prescribed_integral_widens_the_interval_or_is_refused(power, holds_of_a_wave):
    assert holds_of_a_wave(on_a_level("a flat top"), 10.0**-power, LEVELS["a flat top"][-1]())


def test_a_kink_of_one_of_two_functions(bounds):
    """The places where the first comes to zero and leaves it are known to the mesh alone."""
    solution = vc.solve(
        vc.Problem(
            lambda x, y, v: ca.sumsqr(v) / 2 + 2 * ca.fabs(y[0]) + y[1] ** 2 / 2,
            vc.Fixed(0, (1, 0)),
            vc.Fixed(4, (1, 1)),
        )
    )
    low, high = bounds(vc.certify(solution))
    assert low <= dead_core(2, 1, 4) + mpmath.coth(4) / 2 <= high
    assert high - low < 1e-5


def test_a_kink_beside_an_integral_of_second_degree_is_certified_in_a_tube(bounds):
    """int v^2/2 + |v| between zeros, int y^2 = c: a quarter of a wave h sin(w x) on either side of a flat top.

    Along the top the momentum falls from 1 to -1 by w^2 h.
    """
    level = vc.Isoperimetric(lambda x, y, v: y**2, 0.3)
    problem = vc.Problem(lambda x, y, v: v**2 / 2 + ca.fabs(v), vc.Fixed(0, 0), vc.Fixed(1, 0), [level])
    certificate = vc.certify(vc.solve(problem))

    def missed(w, h):
        top = 1 - mpmath.pi / w
        return [h**2 * (mpmath.pi / (2 * w) + top) - mpmath.mpf(0.3), w**2 * h * top - 2]

    w, h = mpmath.findroot(missed, (4.0, 0.65))
    low, high = bounds(certificate)
    assert low <= h**2 * w * mpmath.pi / 4 + 2 * h <= high
    assert certificate.scope is Scope.TUBE
