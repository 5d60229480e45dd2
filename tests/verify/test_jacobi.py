"""Conjugate and focal points against closed forms evaluated here with mpmath, to 1e-10."""

import math

import casadi as ca
import mpmath as mp
import numpy as np
import pytest
from geographiclib.geodesic import Geodesic

import varcalc as vc

TIGHT = 1e-10


def stationary(problem, guess=None, method=None):
    return vc.verify(vc.solve(problem, method or vc.Collocation(), guess=guess))


def area(x, y, dy):
    return y * ca.sqrt(1 + dy**2)


def swing(x, y, dy):
    return (dy**2 - y**2) / 2


def lindelof(c, x0):
    """Where the tangent meets the axis in the same point as that at x0 (Lindelof's construction)."""
    with mp.workdps(30):
        meets = mp.mpf(x0) - c * mp.coth(mp.mpf(x0) / c)
        return float(mp.findroot(lambda x: x - c * mp.coth(x / c) - meets, 0.15))


def neck(a, guess):
    with mp.workdps(30):
        return mp.findroot(lambda c: c * mp.cosh(mp.mpf(a) / c) - 1, guess)


@pytest.mark.parametrize("method", [vc.Collocation(), vc.Shooting()])
def test_soap_film_by_lindelofs_tangents(method):
    c = neck("0.5", 0.235)
    film = vc.Problem(area, vc.Fixed(-0.5, 1), vc.Fixed(0.5, 1))
    check = stationary(film, lambda x: float(c) * np.cosh(x / float(c)), method)
    assert check.verdict is vc.Verdict.SADDLE
    assert check.index == 1
    assert check.conjugate_points == pytest.approx([lindelof(c, -0.5)], abs=TIGHT)


@pytest.mark.parametrize("length", [2.0, 4.0, 10.0])
def test_oscillator_at_multiples_of_pi(length):
    check = stationary(vc.Problem(swing, vc.Fixed(0, 0), vc.Fixed(length, 1)))
    expected = math.pi * np.arange(1, int(length / math.pi) + 1)
    assert check.conjugate_points == pytest.approx(expected, abs=TIGHT)
    assert check.index == len(expected)


def test_points_of_even_multiplicity_are_counted_as_often_as_they_are():
    both = vc.Problem(lambda x, y, dy: (ca.sumsqr(dy) - ca.sumsqr(y)) / 2, vc.Fixed(0, [0, 0]), vc.Fixed(4, [1, 2]))
    check = stationary(both)
    assert check.conjugate_points == pytest.approx([math.pi, math.pi], abs=TIGHT)
    assert check.index == 2


def test_two_frequencies_close_to_each_other_are_told_apart():
    w = 1.0 + 1e-7
    both = vc.Problem(
        lambda x, y, dy: (ca.sumsqr(dy) - y[0] ** 2 - (w * y[1]) ** 2) / 2, vc.Fixed(0, [0, 0]), vc.Fixed(4, [1, 2])
    )
    assert stationary(both).conjugate_points == pytest.approx([math.pi / w, math.pi], abs=TIGHT)


def test_pendulum_by_elliptic_functions():
    k = mp.mpf("0.8")

    def height(t, modulus):
        return modulus * mp.ellipfun("sn", t, m=modulus**2)

    with mp.workdps(25):
        # the field that vanishes at the start is the derivative of theta = 2 asin(k sn(t, k)) by k
        first = float(mp.findroot(lambda t: mp.diff(lambda q: height(t, q), k), 5.0))
    T = 1.2 * first

    def theta(t):
        return 2 * float(mp.asin(height(mp.mpf(float(t)), k)))

    pendulum = vc.Problem(lambda x, y, dy: dy**2 / 2 + ca.cos(y), vc.Fixed(0, 0), vc.Fixed(T, theta(T)))
    check = stationary(pendulum, theta)
    assert check.conjugate_points == pytest.approx([first], abs=TIGHT)
    assert check.verdict is vc.Verdict.SADDLE


def test_great_circle_as_a_graph():
    sphere = vc.Problem(lambda x, y, dy: ca.sqrt(dy**2 + ca.cos(y) ** 2), vc.Fixed(0, 0), vc.Fixed(4, 0.1))
    tilt = math.atan(math.tan(0.1) / math.sin(4.0))
    check = stationary(sphere, lambda x: math.atan(math.tan(tilt) * math.sin(x)))
    assert check.conjugate_points == pytest.approx([math.pi], abs=TIGHT)


@pytest.mark.parametrize("dimension", [3, 4])
def test_great_circle_embedded(dimension):
    angle = 4.0

    def point(t):
        return [math.cos(angle * t), math.sin(angle * t), *[0.0] * (dimension - 2)]

    sphere = vc.Curve(
        lambda q, dq: ca.norm_2(dq), vc.At(point(0)), vc.At(point(1)), [vc.Holonomic(lambda q: ca.sumsqr(q) - 1)]
    )
    check = stationary(sphere, point)
    multiplicity = dimension - 2
    assert check.conjugate_points == pytest.approx([math.pi / angle] * multiplicity, abs=TIGHT)
    assert check.index == multiplicity
    assert check.routes == {"Jacobi": multiplicity, "Ritz": multiplicity}


def test_outer_equator_of_the_torus():
    R, r = 2.0, 0.7

    def length(x, y, dy):
        return ca.sqrt((r * dy) ** 2 + (R + r * ca.cos(y)) ** 2)

    # the curvature is 1/(r (R + r)) all along, and the arc is (R + r) x
    first = math.pi * math.sqrt(r / (R + r))
    check = stationary(vc.Problem(length, vc.Fixed(0, 0), vc.Fixed(4, 0)), lambda x: 0.0 * x)  # others are shorter
    assert check.conjugate_points == pytest.approx([first, 2 * first], abs=TIGHT)


FLATTENING = 1 / 298.257223563


def radii(latitude):
    e2 = FLATTENING * (2 - FLATTENING)
    N = 1 / ca.sqrt(1 - e2 * ca.sin(latitude) ** 2)
    return (1 - e2) * N**3, N


def test_equator_of_the_spheroid_is_shortest_to_180_times_1_minus_f():
    def length(x, y, dy):
        M, N = radii(y)
        return ca.sqrt((M * dy) ** 2 + (N * ca.cos(y)) ** 2)

    check = stationary(vc.Problem(length, vc.Fixed(0, 0), vc.Fixed(3.5, 0)))
    assert check.conjugate_points == pytest.approx([math.pi * (1 - FLATTENING)], abs=TIGHT)


def test_geodesic_of_the_spheroid_against_geographiclibs_reduced_length():
    from scipy.optimize import brentq

    line = Geodesic(1.0, FLATTENING).Line(30.0, 0.0, 40.0, Geodesic.ALL | Geodesic.LONG_UNROLL)

    def reduced(s):
        return line.Position(s, Geodesic.REDUCEDLENGTH)["m12"]

    first = brentq(reduced, 2.9, 3.4, xtol=1e-15)
    total = 4.0

    def point(t):
        at = line.Position(float(t) * total, Geodesic.STANDARD | Geodesic.LONG_UNROLL)
        return np.radians([at["lat2"], at["lon2"]])

    def speed(q, dq):
        M, N = radii(q[0])
        return ca.sqrt((M * dq[0]) ** 2 + (N * ca.cos(q[0]) * dq[1]) ** 2)

    check = stationary(vc.Curve(speed, vc.At(point(0)), vc.At(point(1))), point)
    assert check.bound == pytest.approx(total, abs=1e-9)
    assert total * check.conjugate_points == pytest.approx([first], abs=TIGHT)


def column(load):
    return lambda x, y, dy, ddy: (ddy**2 - load * dy**2) / 2


def second_mode():
    """The least root of tan(m/2) = m/2 beyond zero: asymmetric buckling of a clamped column."""
    return float(2 * mp.findroot(lambda m: mp.tan(m) - m, 4.49))


def test_clamped_column():
    load = 90.0
    check = stationary(vc.Problem(column(load), vc.Fixed(0, 0, 0), vc.Fixed(1, 0, 0), order=2))
    expected = np.array([2 * math.pi, second_mode()]) / math.sqrt(load)
    assert check.conjugate_points == pytest.approx(expected, abs=TIGHT)


def test_isoperimetric_condition_moves_the_conjugate_points():
    area_given = vc.Problem(swing, vc.Fixed(0, 0), vc.Fixed(10, 1), [vc.Isoperimetric(lambda x, y, dy: y, 1.3)])
    check = stationary(area_given)
    # fields c (1 - cos x) + .. with vanishing integral: the same equation as that of the clamped column
    assert check.conjugate_points == pytest.approx([2 * math.pi, second_mode()], abs=TIGHT)
    assert check.index == 2


def test_free_start_has_focal_points():
    check = stationary(vc.Problem(swing, vc.Free(0), vc.Fixed(10, 1)))
    assert check.conjugate_points == pytest.approx(math.pi * (np.arange(3) + 0.5), abs=TIGHT)


def distance(x, y, dy):
    return ca.sqrt(1 + dy**2)


def test_start_on_a_parabola_is_focal_at_its_centre_of_curvature():
    # at (t, t^2/2) the normal points to the left end's outside; the centre of curvature is (-t^3, 1 + 3 t^2/2)
    t = -1.0
    start, centre = np.array([t, t**2 / 2]), np.array([-(t**3), 1 + 1.5 * t**2])
    end = start + 1.3 * (centre - start)
    slope = (centre - start)[1] / (centre - start)[0]
    problem = vc.Problem(distance, vc.OnCurve(lambda x, y: y - x**2 / 2, x=t), vc.Fixed(*end.tolist()))
    check = stationary(problem, lambda x: start[1] + slope * (x - start[0]))
    assert check.conjugate_points == pytest.approx([centre[0]], abs=TIGHT)
    assert (check.index, check.verdict) == (1, vc.Verdict.SADDLE)
    nearer = start + 0.7 * (centre - start)
    problem = vc.Problem(distance, vc.OnCurve(lambda x, y: y - x**2 / 2, x=t), vc.Fixed(*nearer.tolist()))
    check = stationary(problem, lambda x: start[1] + slope * (x - start[0]))
    assert (check.index, check.verdict) == (0, vc.Verdict.MINIMUM)


def test_units_do_not_matter():
    second, metre = 1e-6, 1e7
    fast = vc.Problem(
        lambda x, y, dy: ((dy * second / metre) ** 2 - (y / metre) ** 2) / 2,
        vc.Fixed(0, 0),
        vc.Fixed(4 * second, 1 * metre),
    )
    assert stationary(fast).conjugate_points / second == pytest.approx([math.pi], abs=TIGHT)


def test_growing_fields_do_not_hide_a_point():
    # from x = 0 fields grow as sinh(30 x) until the potential turns over, where they swing
    stiff = vc.Problem(
        lambda x, y, dy: (dy**2 + ca.if_else(x < 1, 900.0, -100.0) * y**2) / 2,
        vc.Fixed(0, 0),
        vc.Fixed(1.5, 0),
        breakpoints=[1.0],
    )
    # beyond 1: eta = sin(10 (x - 1) + phase), tan(phase) = 10 tanh(30)/30
    phase = float(mp.atan(10 * mp.tanh(30) / 30))
    assert stationary(stiff).conjugate_points == pytest.approx([1 + (math.pi - phase) / 10], abs=TIGHT)
