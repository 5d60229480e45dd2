"""Convex terms that are polynomials between breaks, Huber's loss, dead zones and nested maxima, by closed forms."""

from fractions import Fraction

import casadi as ca
import mpmath
import numpy as np
import pytest

import varcalc as vc
from varcalc.certificates import Scope
from varcalc.certificates.kink_reading import convex_terms
from varcalc.certificates.piecewise import value
from varcalc.problem.functional import Symbols

H, K = 0.3, 5.0


def by_if_else(e):
    return ca.if_else(ca.fabs(e) < H, e**2 / 2, H * (ca.fabs(e) - H / 2))


def by_the_lesser(e):
    part = ca.fmin(ca.fabs(e), H)
    return part * (ca.fabs(e) - part / 2)


def by_what_is_taken_away(e):
    return e**2 / 2 - ca.fmax(ca.fabs(e) - H, 0) ** 2 / 2


def by_branches_that_meet_but_for_round_off(e):
    return ca.if_else(ca.fabs(e) < H, e**2 / 2, H * ca.fabs(e) - 0.045)


def by_branches(e):
    return ca.if_else(e > H, H * (e - H / 2), ca.if_else(e < -H, -H * (e + H / 2), e**2 / 2))


def dead_zone(e):
    return ca.fmax(ca.fabs(e) - H, 0) ** 2 / 2


def line_then_parabola(k, h, end, length):
    """int v^2/2 + k phi(y) from 0 to ``end``: a sinh(w x) up to h, at c, and a parabola of bend k h beyond."""
    k, h, end, length = map(mpmath.mpf, (k, h, end, length))
    w = mpmath.sqrt(k)

    def slope(c):
        return h * w / mpmath.tanh(w * c)

    c = mpmath.findroot(
        lambda c: h + slope(c) * (length - c) + k * h * (length - c) ** 2 / 2 - end,
        (length / 100, length * 99 / 100),
        "anderson",
    )
    s, u = slope(c), length - c
    kinetic = s**2 * u / 2 + s * k * h * u**2 / 2 + (k * h) ** 2 * u**3 / 6
    return h * s / 2 + kinetic + k * h * (h * u / 2 + s * u**2 / 2 + k * h * u**3 / 6)


def line_then_sinh(k, h, end, length):
    """int v^2/2 + k fmax(|y| - h, 0)^2/2 from 0 to ``end``: a line up to h, at c, and s sinh(w (x - c))/w beyond."""
    k, h, end, length = map(mpmath.mpf, (k, h, end, length))
    w = mpmath.sqrt(k)
    c = mpmath.findroot(
        lambda c: h / c * mpmath.sinh(w * (length - c)) / w - (end - h), (length / 100, length * 99 / 100), "anderson"
    )
    s = h / c
    return s**2 * c / 2 + s**2 * mpmath.sinh(2 * w * (length - c)) / (4 * w)


def soft_friction(k, h, f, length):
    """int v^2/2 + k phi(v) - f y between zeros: v + k phi'(v) = f (length/2 - x)."""
    k, h, f, length = map(mpmath.mpf, (k, h, f, length))
    until = length / 2 - h * (1 + k) / f

    def rate(x):
        p = f * (length / 2 - x)
        v = p / (1 + k) if p < h * (1 + k) else p - k * h
        return v**2 / 2 + k * (v**2 / 2 if v < h else h * (v - h / 2)) + f * (x - length / 2) * v

    return 2 * mpmath.quad(rate, [0, until, length / 2])


def greatest_of_three_lines():
    """int v^2/2 + 4 max(-y, y/2, 2 y - 1) from (0, -1) to (3/2, 1): parabolas that meet at y = 0 and 2/3."""
    bends, end = (mpmath.mpf(-4), mpmath.mpf(2), mpmath.mpf(8)), mpmath.mpf("1.5")

    def parts(v, c, d):
        y, found = mpmath.mpf(-1), []
        for bend, u in zip(bends, (c, d - c, end - d), strict=True):
            found.append((y, v, bend, u))
            y, v = y + v * u + bend * u**2 / 2, v + bend * u
        return found, y

    def missed(v, c, d):
        found, last = parts(v, c, d)
        return [found[1][0], found[2][0] - mpmath.mpf(2) / 3, last - 1]

    def energy(y, v, bend, u, offset):
        return mpmath.quad(lambda t: (v + bend * t) ** 2 / 2 + bend * (y + v * t + bend * t**2 / 2) - offset, [0, u])

    found, _ = parts(*mpmath.findroot(missed, (3.5, 0.42, 0.97)))
    return sum(energy(*part, offset) for part, offset in zip(found, (0, 0, 4), strict=True))


FORMS = (by_if_else, by_the_lesser, by_what_is_taken_away, by_branches, by_branches_that_meet_but_for_round_off)
CASES = {
    **{f"Huber's loss {form.__name__}": (
        lambda x, y, v, form=form: v**2 / 2 + K * form(y), (0, 0), (1, 1), lambda: line_then_parabola(K, H, 1, 1)
    ) for form in FORMS},
    "a dead zone": (
        lambda x, y, v: v**2 / 2 + K * dead_zone(y), (0, 0), (1, 1), lambda: line_then_sinh(K, H, 1, 1)
    ),
    "Huber's loss of the slope": (
        lambda x, y, v: v**2 / 2 + K * by_if_else(v) - 8 * y, (0, 0), (1, 0), lambda: soft_friction(K, H, 8, 1)
    ),
    "nested maxima": (
        lambda x, y, v: v**2 / 2 + 4 * ca.fmax(ca.fmax(-y, y / 2), 2 * y - 1), (0, -1), (1.5, 1),
        greatest_of_three_lines,
    ),
}  # fmt: skip


@pytest.mark.parametrize(("lagrangian", "start", "end", "exact"), CASES.values(), ids=CASES)
def test_a_convex_term_is_certified_among_all_curves(lagrangian, start, end, exact, bounds):
    certificate = vc.certify(vc.solve(vc.Problem(lagrangian, vc.Fixed(*start), vc.Fixed(*end))))
    low, high = bounds(certificate)
    assert low <= exact() <= high
    assert certificate.width < 1e-9
    assert certificate.scope is Scope.ALL


@pytest.mark.parametrize("power", [2, 5, 9])
def test_a_wrong_curve_widens_the_interval_or_is_refused(power, holds_of_a_wave):
    solution = vc.solve(vc.Problem(lambda x, y, v: v**2 / 2 + K * by_if_else(y), vc.Fixed(0, 0), vc.Fixed(1, 1)))
    assert holds_of_a_wave(solution, 10.0**-power, line_then_parabola(K, H, 1, 1))


@pytest.mark.parametrize("jump", [1e-13, -1e-13, 1e-6])
def test_branches_that_do_not_meet_are_no_convex_term(jump):
    assert pytest.approx(0.045, abs=1e-17) == H * H / 2
    assert Fraction(H) ** 2 / 2 != Fraction(0.045)
    assert read(lambda y, h: ca.if_else(ca.fabs(y) < h, y**2 / 2, h * ca.fabs(y) - (0.045 + jump))) is None


@pytest.mark.parametrize("half", [0.045, float(np.nextafter(0.045, 0)), float(np.nextafter(0.045, 1))])
def test_lines_of_support_of_branches_that_all_but_meet_lie_below_both(half):
    """In exact fractions: each part, lowered, lies below the function on either side of its breaks."""
    found = read(lambda y, h: ca.if_else(ca.fabs(y) < h, y**2 / 2, h * ca.fabs(y) - half))
    assert found is not None
    (term,) = found[1]
    lowered, h = Fraction(term.lowered), Fraction(H)
    written = [(-Fraction(half), -h), (Fraction(0), Fraction(0), Fraction(1, 2)), (-Fraction(half), h)]
    for part, own in zip(term.function.parts, written, strict=True):
        for at in (-2 * h, -h, Fraction(0), h, 2 * h):
            # a part of the convex function is one that was written, less no more than what lines are lowered by
            assert value(own, at) - lowered < value(part, at) <= value(own, at)
    assert term.function.convex
    assert term.slack == 2 * term.lowered < 1e-14


def read(integrand):
    symbols = Symbols.make(ca.SX, 1, 1, 1, 0)
    return convex_terms(symbols, integrand(symbols.y, symbols.parameters), [H])


@pytest.mark.parametrize(
    ("integrand", "at"),
    [
        (lambda y, h: ca.fabs(y) + ca.fabs(y) / 2 - ca.fmax(y, 0), [(-2, 3), (1, 0.5)]),
        (lambda y, h: 3 * ca.if_else(y > h, h * (y - h / 2), ca.if_else(y < -h, -h * (y + h / 2), y**2 / 2)),
         [(0.2, 0.06), (2, 1.665), (-2, 1.665)]),
        (lambda y, h: ca.fmax(ca.fabs(2 * y - 1) - h, 0) ** 3, [(2, 2.7**3), (0.5, 0)]),
        (lambda y, h: ca.fmax(y, 0) ** 2 + ca.fmin(y, 0) ** 2 + ca.fabs(y), [(2, 6), (-2, 6)]),
    ],
)  # fmt: skip
def test_terms_of_one_expression_are_read_as_one_function(integrand, at):
    """Values of the function are those of the integrand; numbers that are parameters count as numbers."""
    found = read(integrand)
    assert found is not None
    smooth, (term,) = found
    for place, expected in at:
        part = term.function.parts[np.searchsorted(term.breaks, place)]
        beside = float(ca.substitute(smooth, ca.symvar(smooth)[0], place)) if ca.symvar(smooth) else float(smooth)
        assert float(value(part, Fraction(place))) + beside == pytest.approx(expected)


def test_sizes_that_cancel_are_no_kink():
    assert read(lambda y, h: ca.fabs(y - h) + y - 2 * ca.fmax(y - h, 0)) is None


def grown(random, y, h, depth):
    """A random expression of y that switches."""
    if depth == 0:
        return [y, y - h, 2 * y + 1, ca.SX(0.5), h, y**2][random.integers(6)]
    a, b, c = (grown(random, y, h, depth - 1) for _ in range(3))
    return [
        ca.fabs(a), ca.fmax(a, b), ca.fmin(a, b), a + b, a - b, 0.75 * a, ca.fmax(a, 0) ** 2, a * h + b,
        ca.if_else(a < b, c, a), ca.if_else(ca.fabs(a) < h, a**2 / 2, h * (ca.fabs(a) - h / 2)),
    ][random.integers(10)]  # fmt: skip


def test_what_is_read_is_the_integrand():
    """Of random expressions: the smooth rest and each term by its branches, between their breaks."""
    symbols, read_some = Symbols.make(ca.SX, 1, 1, 1, 0), 0
    for seed in range(60):
        random = np.random.default_rng(seed)
        integrand = symbols.dy**2 + sum(grown(random, symbols.y, symbols.parameters, 2) for _ in range(2))
        found = convex_terms(symbols, integrand, [H])
        if found is None:
            continue
        read_some += 1
        total = found[0]
        for term in found[1]:
            sides = [*(2 * k for k in range(len(term.breaks) + 1))]
            value_of = term.expression(sides[0])
            for at, side in zip(term.breaks, sides[1:], strict=True):
                value_of = ca.if_else(term.argument > at, term.expression(side), value_of)
            total = total + value_of
        both = ca.Function("both", symbols.all, [integrand, total])
        for place in random.uniform(-3, 3, 20):
            given, again = map(float, both(0, place, 0.3, [], H, []))
            assert again == pytest.approx(given, abs=1e-12)
    assert read_some > 10
