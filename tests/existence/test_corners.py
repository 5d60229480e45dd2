"""Minima with corners and infima that are not attained, against closed forms."""

from __future__ import annotations

import math

import casadi as ca
import mpmath
import numpy as np
import pytest

import varcalc as vc
from varcalc.existence.corners import convex
from varcalc.existence.relaxation import relaxed
from varcalc.formulation import broken_form


def two_wells(unit=1.0, maximise=False):
    """(1 - v^2)^2 + x v between (0, 0) and (1, 0), lengths in units of ``unit``."""
    sign = -1.0 if maximise else 1.0
    return vc.Problem(
        lambda x, y, v: sign * ((1 - v**2) ** 2 + x / unit * v), vc.Fixed(0, 0), vc.Fixed(unit, 0), maximise=maximise
    )


def two_wells_value():
    # L_v = 4 v (v^2 - 1) + x is constant; at the corner both wells have the same tangent, which makes it 1/2, the
    # corner's abscissa by symmetry. v > 1/sqrt 3 before the corner, and the mirror image after it.
    def slope(x):
        return mpmath.findroot(lambda v: 4 * v * (v**2 - 1) + x - mpmath.mpf(1) / 2, 1.05)

    left = mpmath.quad(lambda x: (1 - slope(x) ** 2) ** 2 + (x - mpmath.mpf(1) / 2) * slope(x), [0, 0.25, 0.5])
    return float(2 * left)


@pytest.mark.parametrize("maximise", [False, True])
@pytest.mark.parametrize("unit", [1e-7, 1.0, 1e7])
def test_a_corner_between_two_wells_is_placed(unit, maximise):
    solution = vc.solve(two_wells(unit, maximise))
    expected = -two_wells_value() if maximise else two_wells_value()
    assert solution.value == pytest.approx(unit * expected, rel=1e-12)
    assert solution.y(0.5 * unit) == pytest.approx(max(solution.y(np.linspace(0, unit, 501))), rel=1e-12)


@pytest.mark.parametrize("guess", [0.4, 0.5, 0.7])
def test_a_corner_moves_to_where_erdmanns_conditions_hold(guess):
    form = broken_form(two_wells(), [guess], lambda x: np.interp(x, [0, guess, 1], [0, guess, 0])[None])
    solution = vc.Ritz().solve(form, tol=1e-12, guess=None)
    assert solution.value == pytest.approx(two_wells_value(), abs=1e-14)
    before, after = solution.dy(0.5 - 1e-9), solution.dy(0.5 + 1e-9)
    assert [before, after] == pytest.approx([1, -1], abs=1e-6)


def newtons_body(height):
    """Nose radius, end slope and drag (a cone of equal height has 1/(1 + height^2)); Newton's Principia, II, 34.

    x = k (1 + t^2)^2 / t with the slope t >= 1, hence y = k (3 t^4/4 + t^2 - log t - 7/4), and x = 4 k at t = 1.
    """

    def x(t):
        return (1 + t**2) ** 2 / t

    def y(t):
        return 3 * t**4 / 4 + t**2 - mpmath.log(t) - mpmath.mpf(7) / 4

    last = mpmath.findroot(lambda t: y(t) - height * x(t), 1.9 * height)
    k = 1 / x(last)
    drag = (4 * k) ** 2 + 2 * k**2 * mpmath.quad(lambda t: x(t) / (1 + t**2) * (3 * t**2 + 2 - t**-2), [1, last])
    return float(4 * k), float(last), float(drag)


@pytest.mark.parametrize("height", [0.7, 1.0, 2.0])
def test_newtons_body_of_least_resistance(height):
    body = vc.Problem(
        lambda x, y, v: 2 * x / (1 + v**2),
        vc.Fixed(0, 0),
        vc.Fixed(1, height),
        [vc.Bound(lambda x, y, v: v, lower=0)],
    )
    nose, last, drag = newtons_body(height)
    solution = vc.solve(body)
    assert drag < 1 / (1 + height**2)
    assert solution.value == pytest.approx(drag, abs=1e-10)
    assert abs(solution.value - drag) <= 10 * solution.error.value <= 1e-8
    assert solution.dy(1.0) == pytest.approx(last, rel=1e-4)
    assert solution.dy(nose - 1e-4) == pytest.approx(0, abs=1e-4)
    assert np.abs(solution.y(np.linspace(0, nose - 1e-5, 20))).max() < 1e-8
    assert solution.dy(nose + np.array([1e-4, 1e-5])) == pytest.approx(1, abs=1e-2)
    assert vc.verify(solution).verdict is vc.Verdict.MINIMUM


def bolza(rise):
    return vc.Problem(lambda x, y, v: (1 - v**2) ** 2 + y**2, vc.Fixed(0, 0), vc.Fixed(1, rise))


def bolza_infimum(rise):
    # the envelope is (v^2 - 1)^2 beyond the wells and 0 between them: y = 0 first, at no cost, then
    # v L_v - L = 0, that is (v^2 - 1)(3 v^2 + 1) = y^2
    def slope(y):
        return mpmath.sqrt((1 + mpmath.sqrt(4 + 3 * y**2)) / 3)

    return float(mpmath.quad(lambda y: ((slope(y) ** 2 - 1) ** 2 + y**2) / slope(y), [0, rise]))


@pytest.mark.parametrize("rise", [0.0, 0.5])
def test_an_infimum_that_no_curve_attains(rise):
    with pytest.raises(vc.VariationalError) as refusal:
        vc.solve(bolza(rise))
    assert refusal.value.verdict is vc.Verdict.NOT_ATTAINED
    coarse, fine = (relaxed(bolza(rise), pieces) for pieces in (32, 64))
    expected = bolza_infimum(rise)
    assert fine.value >= expected - 1e-12  # relaxed polygons are admissible for the envelope
    assert fine.value - expected <= 0.3 * (coarse.value - expected) + 1e-12  # of second order
    assert fine.value == pytest.approx(expected, abs=1e-5)
    assert fine.mixed.mean() == pytest.approx(1 - rise, abs=0.05)


def test_wells_alone_are_reached_by_a_corner():
    # any curve of slopes +-1 costs nothing: one corner is enough
    solution = vc.solve(vc.Problem(lambda x, y, v: (1 - v**2) ** 2, vc.Fixed(0, 0), vc.Fixed(1, 0.5)))
    assert solution.value == pytest.approx(0, abs=1e-20)
    slopes = solution.dy(np.array([0.05, 0.95]))
    assert np.sort(slopes) == pytest.approx([-1, 1], abs=1e-9)


def test_convexity_in_the_slope():
    ends = vc.Fixed(0, 0), vc.Fixed(1, 1)
    assert convex(vc.Problem(lambda x, y, v: ca.sqrt(1 + v**2) * (1 + y**2), *ends))
    assert not convex(two_wells())
    assert not convex(vc.Problem(lambda x, y, v: ca.sqrt(1 + v**2), *ends, maximise=True))


def test_a_relaxed_convex_problem_is_itself():
    found = relaxed(vc.Problem(lambda x, y, v: v**2 + y**2, vc.Fixed(0, 0), vc.Fixed(1, 1)), 64)
    assert found.value == pytest.approx(1 / math.tanh(1), rel=1e-4)
    assert not found.mixed.any()


@pytest.mark.parametrize("well", [1 / 256, 1.0, 50.0])
@pytest.mark.parametrize("share", [0.6, 0.89, 0.985])
def test_corners_are_found_in_any_unit_of_the_slope(well, share):
    """((y'/w)^2 - 1)^2 vanishes for the slopes w and -w, and one corner leads from one to the other."""
    rise = well * (2 * share - 1)
    wells = vc.Problem(lambda x, y, dy: ((dy / well) ** 2 - 1) ** 2, vc.Fixed(0, 0), vc.Fixed(1, rise))
    solution = vc.solve(wells)
    assert abs(solution.value) <= 1e-12
    slopes = np.abs(solution.dy(np.linspace(0.001, 0.999, 57)))
    assert np.sort(slopes)[2:-2] == pytest.approx(well, rel=1e-5)


def test_no_straight_line_is_called_a_minimum_where_wells_are_small():
    """Between the wells at slopes of 1/256 no smooth curve is a strong minimum, at whatever height it lies."""
    wells = vc.Problem(lambda x, y, dy: ((256 * dy) ** 2 - 1) ** 2, vc.Fixed(0, 0.3), vc.Fixed(1, 0.3 + 0.78 / 256))
    solution = vc.solve(wells, throw=False)
    assert not solution.status.ok or abs(solution.value) <= 1e-12
