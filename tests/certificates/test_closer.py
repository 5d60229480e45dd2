"""A curve that is but roughly known is brought to its extremal: closed forms, and what the interval narrows to."""

from dataclasses import replace

import casadi as ca
import mpmath
import numpy as np
import pytest

import varcalc as vc
from varcalc.certificates.balls import enclosed, flint, nodes, working
from varcalc.certificates.by_tube import certified
from varcalc.certificates.curve import CURVE_DEGREE
from varcalc.certificates.field import propagated
from varcalc.certificates.proof import BITS, SERIES_LENGTH
from varcalc.verify.candidate import candidate


def square(x, y, v):
    return v**2


def offset(x, y, v, p):
    return (v - p.c) ** 2 + p.c**2


def held_by(*constraints, end=None, lagrangian=square, **options):
    return vc.Problem(lagrangian, vc.Fixed(0, 0), end or vc.Fixed(1, 0), list(constraints), **options)


ROUGH = {
    "a level": (held_by(vc.Isoperimetric(lambda x, y, v: y, 1.0)), 12),
    "a waypoint": (held_by(vc.Through(0.5, 1.0)), 4),
    "a cost of the end": (held_by(end=vc.Free(1), end_cost=lambda a, b, x, y: (y - 1) ** 2), 0.5),
    "a number": (held_by(end=vc.Fixed(1, 1), lagrangian=offset, unknowns={"c": 0.1}), 0.5),
}  # fmt: skip


@pytest.mark.parametrize(("problem", "exact"), ROUGH.values(), ids=ROUGH)
def test_a_curve_that_is_off_by_a_wave_is_brought_back(problem, exact, bounds):
    solution = vc.solve(problem)
    along = candidate(solution).along_best

    def waved(x, k):
        return along.evaluate(x, k) + 1e-4 * (4 * np.pi) ** k * np.sin(4 * np.pi * x + k * np.pi / 2)

    rough = replace(along, evaluate=waved, numbers=along.numbers + 1e-4, lambdas=along.lambdas + 1e-4)
    with working(BITS, SERIES_LENGTH):
        low, high = bounds(certified(solution, rough))
        wide = certified(solution, rough, as_found=True).width
    assert low <= exact <= high
    assert high - low < 1e-20
    assert wide > 1e-10


def test_a_closed_curve_is_brought_back(bounds):
    """int (v^2 + y^2)/2 - cos(2 pi x) y over a period is -1/(4 (1 + 4 pi^2))."""
    ring = vc.Periodic(0, 1)
    problem = vc.Problem(lambda x, y, v: (v**2 + y**2) / 2 - ca.cos(2 * np.pi * x) * y, ring, ring)
    solution = vc.solve(problem)
    along = candidate(solution).along_best
    rough = replace(along, evaluate=lambda x, k: along.evaluate(x, k) + 1e-4 * (k == 0))
    with working(BITS, SERIES_LENGTH):
        low, high = bounds(certified(solution, rough))
    turn = 2 * mpmath.mpf(np.pi)  # not quite a period of the load, which adds 1e-17 and less
    assert abs((low + high) / 2 + 1 / (4 * (1 + turn**2))) < 1e-15
    assert high - low < 1e-20


@pytest.mark.parametrize("seed", range(12))
def test_where_an_end_slides_to_does_not_hang_on_the_last_bit(seed, bounds):
    """int 1 + v^2 to the line y = h is 2 h, to y = a - b x it is 2 a (sqrt(1 + b^2) - b), by straight lines."""
    h, a, b = (float(v) for v in np.random.default_rng(seed).uniform([0.5, 1, 0.2], [3, 2, 2]))
    slant = vc.OnCurve(lambda x, y: y - (a - b * x), x=a / 2)
    found = {
        vc.OnCurve(lambda x, y: y - h, x=h * 1.2): 2 * mpmath.mpf(h),
        slant: 2 * mpmath.mpf(a) * (mpmath.sqrt(1 + mpmath.mpf(b) ** 2) - mpmath.mpf(b)),
    }
    for end, exact in found.items():
        low, high = bounds(vc.certify(vc.solve(vc.Problem(lambda x, y, v: 1 + v**2, vc.Fixed(0, 0), end))))
        assert low <= exact <= high
        assert high - low < 1e-23


def test_the_propagator_is_that_of_the_oscillator():
    """(cos wt, sin wt/w; -w sin wt, cos wt) on pieces of lengths 1 and 3."""
    w, lengths = 2.5, np.array([1.0, 3.0])
    G = np.broadcast_to(np.array([[0.0, 1.0], [-(w**2), 0.0]]), (2, CURVE_DEGREE + 1, 2, 2))
    for found, length in zip(propagated(G, lengths / 2), lengths, strict=True):
        t = length * (1 + nodes(CURVE_DEGREE)) / 2
        exact = np.array([[np.cos(w * t), np.sin(w * t) / w], [-w * np.sin(w * t), np.cos(w * t)]])
        assert np.abs(found - exact.transpose(2, 0, 1)).max() < 1e-13


@pytest.mark.parametrize("degree", [3, 12, 19])
def test_a_form_is_enclosed_by_little_more_than_it_takes(degree):
    """T_n + T_1 lies within 2, and its powers of t add up to (1 + sqrt 2)^n."""
    with working(BITS, SERIES_LENGTH):
        found = flint()
        poly = found.arb_poly(found.fmpz_poly.chebyshev_t(degree)) + found.arb_poly([0, 1])
        series = found.arb_series([*poly.coeffs(), *[0] * (20 - degree)], 21)
        ball = enclosed(series, series * 0 + found.arb_series([0], 21), 20)
    assert ball.contains(2)
    assert ball.contains(-2 if degree % 2 else 0)
    assert float(ball.rad()) < 2.001
