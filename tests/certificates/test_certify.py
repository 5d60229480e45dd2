"""The infimum lies in the interval: closed forms at the doubles of the problem, in 60 digits."""

from dataclasses import replace
from fractions import Fraction

import casadi as ca
import mpmath
import numpy as np
import pytest

import varcalc as vc
from varcalc.certificates import Means, Scope
from varcalc.certificates.shifts import pinned


def between(certificate, exact):
    """Whether a number of 60 digits lies in the interval, and the doubles around it."""
    low, high = (mpmath.mpf(f.numerator) / f.denominator for f in map(Fraction, certificate.enclosure))
    return low <= exact <= high and certificate.lower <= low and high <= certificate.upper


def certified(*problem, **options):
    return vc.certify(vc.solve(vc.Problem(*problem, **options)))


def oscillator(x, y, v):
    return (v**2 - y**2) / 2


def area(x, y, v):
    return y * ca.sqrt(1 + v**2)


def film(a):
    """Least area over 2 pi between rings of radius 1 at -a and a: c cosh(x/c) with c cosh(a/c) = 1."""
    # t/cosh(t) is concave up to the fold, so Newton's iteration climbs to the shallow catenary from a < t
    t = mpmath.findroot(lambda t: t / mpmath.cosh(t) - a, a, solver="newton", maxsteps=200)
    c = a / t
    return c * a + c * c * mpmath.sinh(2 * t) / 2


def test_an_action_that_is_of_second_degree_is_certified_among_all_curves():
    certificate = certified(oscillator, vc.Fixed(0, 0), vc.Fixed(3, 1))
    assert between(certificate, mpmath.cot(3) / 2)
    assert certificate.scope is Scope.ALL
    assert certificate.tube == np.inf
    assert certificate.width < 1e-17


@pytest.mark.parametrize("a", [0.3, 0.6, 0.662])
def test_a_soap_film_is_certified_in_a_tube(a):
    certificate = certified(area, vc.Fixed(-a, 1), vc.Fixed(a, 1))
    assert between(certificate, film(mpmath.mpf(a)))
    assert certificate.scope is Scope.TUBE  # two discs may have less area
    assert certificate.width < 1e-17
    assert 0 < certificate.distance.largest < certificate.tube


def test_a_convex_problem_is_certified_among_all_curves_in_its_own_parameters():
    """int (g v^2 + y^4 + c y)/2 has no closed form; int (a v^2 + b y^2)/2 has: sqrt(a b) coth(sqrt(b/a) T)/2."""
    certificate = certified(
        lambda x, y, v, p: (p.a * v**2 + p.b * y**2) / 2,
        vc.Fixed(0, 0),
        vc.Fixed(1.5, 1),
        parameters={"a": 0.1, "b": 0.7},
    )
    a, b = mpmath.mpf(0.1), mpmath.mpf(0.7)
    assert between(certificate, mpmath.sqrt(a * b) * mpmath.coth(mpmath.sqrt(b / a) * mpmath.mpf(1.5)) / 2)
    assert certificate.scope is Scope.ALL


def test_a_jointly_convex_problem_that_is_not_of_second_degree_is_certified_among_all_curves():
    """int sqrt(1 + y'^2) is the distance."""
    certificate = certified(lambda x, y, v: ca.sqrt(1 + v**2), vc.Fixed(0, 0), vc.Fixed(1, 2.5))
    assert between(certificate, mpmath.sqrt(mpmath.mpf("7.25")))
    assert certificate.scope is Scope.ALL
    assert any(h.means is Means.COMPOSITION for h in certificate.proved)


def test_a_maximum_is_certified_as_one():
    certificate = certified(lambda x, y, v: (y**2 - v**2) / 2, vc.Fixed(0, 0), vc.Fixed(2, 1), maximise=True)
    assert between(certificate, -mpmath.cot(2) / 2)
    assert "supremum" in str(certificate)


def test_a_free_end():
    certificate = certified(oscillator, vc.Fixed(0, 1), vc.Free(1))
    assert between(certificate, -mpmath.tan(1) / 2)


def test_periodic_ends():
    """int (v^2 + y^2)/2 - x y over a period of length 1: y = x - sinh(x - 1/2)/(2 sinh(1/2))."""
    ring = vc.Periodic(0, 1)
    certificate = certified(lambda x, y, v: (v**2 + y**2) / 2 - x * y, ring, ring)
    s, c = mpmath.sinh(mpmath.mpf("0.5")), mpmath.cosh(mpmath.mpf("0.5"))
    assert between(certificate, -(mpmath.mpf(1) / 3 - (c - 2 * s) / (2 * s)) / 2)


def ring_under_thrust(P, T):
    """The least int (y'')^2/2 - P y'^2 + y^2/2 - x y around [0, T]: y is x and what falls by T over the period."""
    rates = mpmath.polyroots([1, 0, 2 * P, 0, 1], asc=True)
    rows = [[r**k * (mpmath.exp(r * T) - 1) for r in rates] for k in range(4)]
    factors = mpmath.lu_solve(mpmath.matrix(rows), mpmath.matrix([-T, 0, 0, 0]))

    def load(x):
        return x * (x + mpmath.re(sum(c * mpmath.exp(r * x) for c, r in zip(factors, rates, strict=True))))

    return -mpmath.quad(load, [0, T]) / 2  # a form less a load is half of what the load does


@pytest.mark.parametrize(("P", "T"), [(0.0, 1), (0.9, 6), (1.05, 6)])
def test_periodic_ends_of_second_order(P, T):
    """Beyond P = 1.004 the wave of length 6 buckles; around 1 the curve lies near 1/2 and varies by far less."""
    ring = vc.Periodic(0, T)
    problem = vc.Problem(lambda x, y, v, a: a**2 / 2 - P * v**2 + y**2 / 2 - x * y, ring, ring, order=2)
    solution = vc.solve(problem, vc.Collocation())
    if P < 1:
        certificate = vc.certify(solution)
        assert between(certificate, ring_under_thrust(mpmath.mpf(P), T))
        assert certificate.width < 1e-15
    else:
        with pytest.raises(vc.VariationalError, match="conjugate point"):
            vc.certify(solution)


def test_breakpoints_are_gone_through_piece_by_piece():
    """int a(x) v^2 with a = 1, 3: the values of springs in series, 1/(1/1 + 1/3) over [0, 2]."""
    certificate = certified(
        lambda x, y, v: ca.if_else(x < 1, 1, 3) * v**2, vc.Fixed(0, 0), vc.Fixed(2, 1), breakpoints=[1.0]
    )
    assert between(certificate, mpmath.mpf(3) / 4)


def test_several_functions():
    """Two oscillators, the axes turned by an angle of sine 0.6: the actions add up."""

    def action(t, q, v):
        a, b = 0.8 * q[0] + 0.6 * q[1], 0.8 * q[1] - 0.6 * q[0]
        return (ca.sumsqr(v) - a**2 - b**2 / 4) / 2

    certificate = certified(action, vc.Fixed(0, (0, 0)), vc.Fixed(2, (1, 0)))
    # the doubles 0.6 and 0.8 are not quite sine and cosine: the stiffness is theirs
    c, s = mpmath.mpf(0.8), mpmath.mpf(0.6)
    K = mpmath.matrix([[c * c + s * s / 4, c * s * 3 / 4], [c * s * 3 / 4, s * s + c * c / 4]])
    values, vectors = mpmath.eigsy(K)
    exact = (
        sum(vectors[0, k] ** 2 * mpmath.sqrt(values[k]) * mpmath.cot(2 * mpmath.sqrt(values[k])) for k in (0, 1)) / 2
    )
    assert between(certificate, exact)
    assert certificate.scope is Scope.ALL


def test_second_order():
    """A clamped beam under a uniform load: -q^2 l^5/1440."""
    certificate = certified(lambda x, y, v, a: a**2 / 2 - y, vc.Fixed(0, 0, 0), vc.Fixed(1, 0, 0), order=2)
    assert between(certificate, -mpmath.mpf(1) / 1440)


def test_unknown_numbers():
    """int v^2/2 + (y - c)^2/2 from 0 to 1 on [0, 1], c free: y - c = cosh, sinh with ends -+1/2; tanh(1/2)..."""
    certificate = certified(
        lambda x, y, v, p: (v**2 + (y - p.c) ** 2) / 2, vc.Fixed(0, 0), vc.Fixed(1, 1), unknowns={"c": 0.2}
    )
    assert between(certificate, mpmath.coth(mpmath.mpf(1) / 2) / 4)


@pytest.mark.parametrize("scale", [1e-9, 1e9])
def test_units_do_not_matter(scale):
    certificate = certified(lambda x, y, v: v**2 / 2 + scale**2 * ca.cos(y / scale), vc.Fixed(0, 0), vc.Fixed(2, scale))
    one = certified(lambda x, y, v: v**2 / 2 + ca.cos(y), vc.Fixed(0, 0), vc.Fixed(2, 1))
    assert certificate.lower / scale**2 == pytest.approx(one.lower, rel=1e-14)
    assert certificate.width < 1e-16 * abs(certificate.lower)


def test_beyond_a_conjugate_point_nothing_is_proved():
    solution = vc.solve(vc.Problem(oscillator, vc.Fixed(0, 0), vc.Fixed(3.2, 1)), vc.Collocation())
    with pytest.raises(vc.VariationalError, match="conjugate point"):
        vc.certify(solution)


def test_a_saddle_is_not_certified():
    """The deep catenary between rings at +-0.5."""
    problem = vc.Problem(area, vc.Fixed(-0.5, 1), vc.Fixed(0.5, 1))
    saddle = vc.solve(problem, vc.Collocation(), guess=lambda x: 0.235 * np.cosh(x / 0.235))
    assert saddle.value > 1.0
    with pytest.raises(vc.VariationalError, match="conjugate point"):
        vc.certify(saddle)


def test_a_minimum_of_what_is_not_convex_in_the_slope_is_one_among_near_slopes():
    certificate = certified(lambda x, y, v: v**2 + 4 * ca.exp(-((v - 4) ** 2)), vc.Fixed(0, 0), vc.Fixed(1, 0.5))
    assert certificate.scope is Scope.WEAK
    assert certificate.slopes < 3.5
    assert between(certificate, mpmath.mpf("0.25") + 4 * mpmath.exp(mpmath.mpf("-12.25")))
    assert "of its slope" in str(certificate)


def test_what_is_asked_for_and_not_reached_is_refused():
    solution = vc.solve(vc.Problem(oscillator, vc.Fixed(0, 0), vc.Fixed(2, 1)))
    assert vc.certify(solution, digits=15).width < 1e-15
    with pytest.raises(vc.VariationalError, match="too much for 60 digits"):
        vc.certify(solution, digits=60)


def test_arguments_are_checked():
    solution = vc.solve(vc.Problem(oscillator, vc.Fixed(0, 0), vc.Fixed(2, 1)))
    with pytest.raises(TypeError, match="solution must be what"):
        vc.certify(3.0)
    with pytest.raises(ValueError, match="digits must be at least 1"):
        vc.certify(solution, digits=0)
    with pytest.raises(TypeError, match="digits must be a whole number"):
        vc.certify(solution, digits=1.5)


def test_what_has_no_enclosure_is_refused_by_name():
    solution = vc.solve(vc.Problem(lambda x, y, v: v**2 + ca.remainder(x, 0.3) * y, vc.Fixed(0, 0), vc.Fixed(1, 1)))
    with pytest.raises(vc.VariationalError, match="remainder"):
        vc.certify(solution)


def test_it_states_its_theorem():
    text = str(certified(area, vc.Fixed(-0.5, 1), vc.Fixed(0.5, 1)))
    assert "infimum of area over the curves within" in text
    assert text.count("by ball arithmetic") >= 3
    assert "by the rules of composition" in text


def test_what_the_ends_cost():
    """int (v^2 + y^2)/2 + y(1)^2 from y(0) = 1: the Riccati solution s at 0, s' = s^2 - 1 back from s(1) = 2."""
    certificate = certified(
        lambda x, y, v: (v**2 + y**2) / 2, vc.Fixed(0, 1), vc.Free(1), end_cost=lambda x0, y0, x1, y1: y1**2
    )
    c, s = mpmath.cosh(1), mpmath.sinh(1)
    assert between(certificate, (2 * c + s) / (c + 2 * s) / 2)
    assert certificate.scope is Scope.ALL


def test_a_length_is_certified_through_its_energy():
    """The hyperbolic distance between (0, 1) and (1, 2): arcosh(1 + 2/4)."""
    half_plane = vc.Curve(lambda q, dq: ca.sqrt(ca.sumsqr(dq)) / q[1], vc.At((0, 1)), vc.At((1, 2)))
    certificate = vc.certify(vc.solve(half_plane))
    assert between(certificate, mpmath.acosh(mpmath.mpf("1.5")))
    line = vc.Curve(lambda q, dq: ca.norm_2(dq), vc.At((0, 0)), vc.At((1, 2)))
    certificate = vc.certify(vc.solve(line))
    assert between(certificate, mpmath.sqrt(5))
    assert certificate.scope is Scope.ALL


@pytest.mark.parametrize("length", [1.1, 1.5])
def test_a_prescribed_integral(length):
    """A hanging chain between points at distance 1: y = c cosh((x - 1/2)/c) - c cosh(a), a = 1/(2c), L = 2 c sinh(a).

    Long chains are minima only among chains of their length: as soap films they have conjugate points.
    """
    chain = vc.Problem(
        area, vc.Fixed(0, 0), vc.Fixed(1, 0), [vc.Isoperimetric(lambda x, y, v: ca.sqrt(1 + v**2), length)]
    )
    certificate = vc.certify(vc.solve(chain))
    L = mpmath.mpf(length)
    a = mpmath.findroot(lambda a: mpmath.sinh(a) / a - L, mpmath.mpf(3), solver="newton", maxsteps=200)
    c = 1 / (2 * a)
    assert between(certificate, c**2 * (a + mpmath.sinh(2 * a) / 2) - c * mpmath.cosh(a) * L)
    assert certificate.scope is Scope.TUBE
    assert certificate.width < 1e-16


def test_a_prescribed_integral_of_first_degree():
    """int v^2 over [0, 1] with zero ends and area 1: 12."""
    problem = vc.Problem(
        lambda x, y, v: v**2, vc.Fixed(0, 0), vc.Fixed(1, 0), [vc.Isoperimetric(lambda x, y, v: y, 1.0)]
    )
    certificate = vc.certify(vc.solve(problem))
    assert between(certificate, mpmath.mpf(12))
    assert certificate.scope is Scope.ALL


def test_inequalities_are_refused_for_what_they_are():
    levels = [vc.Isoperimetric(lambda x, y, v: y, lower=1.0), vc.Through(0.5, 1.5)]
    problem = vc.Problem(lambda x, y, v: v**2, vc.Fixed(0, 0), vc.Fixed(1, 0), levels)
    with pytest.raises(vc.VariationalError, match="levels that are inequalities are covered of graphs without other"):
        vc.certify(vc.solve(problem))


@pytest.mark.parametrize(("end", "scope"), [((1, 0.7), Scope.TUBE), ((1, 0), Scope.ALL)])
def test_a_singular_end(end, scope):
    """The brachistochrone: a sqrt(r/g) on the cycloid x = r (a - sin a), y = r (1 - cos a).

    With y = z^2 and x' = z a' the square of the time is int (a'^2 + 4 z'^2)/(2 g) at constant pace, under int z a' = x:
    between ends on one height a Rayleigh quotient, whose least value is that among all curves.
    """

    def time(x, y, v, p):
        return ca.sqrt((1 + v**2) / (2 * p.g * y))

    problem = vc.Problem(time, vc.Fixed(0, 0), vc.Fixed(*end), parameters={"g": 9.81})
    certificate = vc.certify(vc.solve(problem))
    across, depth = map(mpmath.mpf, end)
    if depth:
        a = mpmath.findroot(lambda a: depth * (a - mpmath.sin(a)) - across * (1 - mpmath.cos(a)), 2.7)
        r = depth / (1 - mpmath.cos(a))
    else:
        a, r = 2 * mpmath.pi, across / (2 * mpmath.pi)
    assert between(certificate, a * mpmath.sqrt(r / mpmath.mpf(9.81)))
    assert certificate.scope is scope


def test_a_singular_end_before_a_free_one():
    """The brachistochrone to a line straight down: half an arch, pi sqrt(2 d/pi), the least of all descents to it."""
    problem = vc.Problem(lambda x, y, v: ca.sqrt((1 + v**2) / y), vc.Fixed(0.25, 0), vc.Free(1.5))
    certificate = vc.certify(vc.solve(problem))
    assert between(certificate, mpmath.sqrt(2 * mpmath.pi * mpmath.mpf(1.25)))
    assert certificate.scope is Scope.ALL
    assert certificate.width < 1e-18


def test_a_free_end_before_a_singular_one():
    """The same the other way round, down an ordinate that points down."""
    problem = vc.Problem(lambda x, y, v: ca.sqrt((1 + v**2) / -y), vc.Free(-2), vc.Fixed(0, 0))
    certificate = vc.certify(vc.solve(problem))
    assert between(certificate, mpmath.sqrt(4 * mpmath.pi))


def test_a_free_end_on_a_vertical_line_of_a_curve():
    """The same of a Curve that runs to the left."""
    problem = vc.Curve(lambda q, v: ca.sqrt(ca.sumsqr(v) / q[1]), vc.At((0, 0)), vc.At((-200, None)))
    assert between(vc.certify(vc.solve(problem)), mpmath.sqrt(400 * mpmath.pi))


def descent(across, depth):
    """int sqrt((dx^2 + dy^2)/y) along the cycloid from rest: a sqrt(2 r), see above."""
    ratio = lambda a: (a - mpmath.sin(a)) / (1 - mpmath.cos(a))  # noqa: E731  short
    a = mpmath.findroot(lambda a: ratio(a) - across / depth, (0.01, 6.2), solver="ridder", verify=False)
    a = mpmath.findroot(lambda a: depth * (a - mpmath.sin(a)) - across * (1 - mpmath.cos(a)), a)
    return a * mpmath.sqrt(2 * depth / (1 - mpmath.cos(a)))


@pytest.mark.parametrize(
    ("start", "end"),
    # 0.7 - 0.1 is no double; the same curve in other units; deep, far, and back
    [((0.1, 0), (0.7, 0.7)), ((0, 0), (0.01, 0.01)), ((0, 0), (300, 90)), ((1, 0), (1.75, 6)), ((2, 0), (-1, 0.5))],
)
@pytest.mark.parametrize("as_curve", [False, True])
def test_a_singular_end_wherever_it_lies(start, end, as_curve):
    """The brachistochrone in any place and unit, as a graph and as a Curve, which may run backward."""
    if as_curve:
        problem = vc.Curve(lambda q, v: ca.sqrt(ca.sumsqr(v) / q[1]), vc.At(start), vc.At(end))
    else:
        ends = sorted([vc.Fixed(*start), vc.Fixed(*end)], key=lambda e: e.x)
        problem = vc.Problem(lambda x, y, v: ca.sqrt((1 + v**2) / y), *ends)
    certificate = vc.certify(vc.solve(problem))
    exact = descent(abs(mpmath.mpf(end[0]) - mpmath.mpf(start[0])), mpmath.mpf(end[1]))
    assert between(certificate, exact)
    assert certificate.width < 1e-20 * exact


def test_a_power_whose_exponent_is_rounded_is_refused_beside_another():
    """y^(-1/3) at y = 0: the double next to 1/3 leaves a power of the regular coordinate that is not whole."""
    problem = vc.Problem(lambda x, y, v: ca.sqrt(1 + v**2) / y ** (1 / 3) / (1 + y), vc.Fixed(0, 0), vc.Fixed(1, 1))
    with pytest.raises(vc.VariationalError, match="no whole power"):
        vc.certify(vc.solve(problem))


def test_an_end_that_slides_on_a_curve():
    """int (v^2/2 + 1) from the origin to y = 1 is least for the time sqrt(2): the value is sqrt(2)."""
    problem = vc.Problem(lambda x, y, v: v**2 / 2 + 1, vc.Fixed(0, 0), vc.OnCurve(lambda x, y: y - 1, x=1.2))
    certificate = vc.certify(vc.solve(problem))
    assert between(certificate, mpmath.sqrt(2))
    assert certificate.scope is Scope.TUBE


@pytest.mark.parametrize("guess", [(1, 0), (-1, 0)])
def test_an_end_that_slides_on_a_circle_is_a_minimum_on_the_near_side_alone(guess):
    """From (1/2, 0) to the unit circle: 1/2, and 3/2, which a focal point lies before."""
    wall = vc.OnSurface(lambda q: ca.sumsqr(q) - 1, guess)
    solution = vc.solve(vc.Curve(lambda q, dq: ca.norm_2(dq), vc.At((0.5, 0)), wall), vc.Collocation())
    if guess[0] > 0:
        certificate = vc.certify(solution)
        assert between(certificate, mpmath.mpf("0.5"))
        assert certificate.scope is Scope.TUBE  # the circle is no convex set
    else:
        with pytest.raises(vc.VariationalError, match="no certificate"):
            vc.certify(solution)


@pytest.mark.parametrize("sides", [(1, 2), (-1, 2), (-1, 4)])
def test_both_ends_that_slide_on_circles_are_a_minimum_between_these_alone(sides):
    """The circles of radius 1 about 0 and 3 are 1 apart, where the squares in their equations are of -1."""
    left = vc.OnSurface(lambda q: ca.sumsqr(q) - 1, (sides[0], 0))
    right = vc.OnSurface(lambda q: (q[0] - 3) ** 2 + q[1] ** 2 - 1, (sides[1], 0))
    solution = vc.solve(vc.Curve(lambda q, dq: ca.norm_2(dq), left, right), vc.Collocation())
    if sides == (1, 2):
        certificate = vc.certify(solution)
        assert between(certificate, 1)
        assert certificate.width < 1e-20
    else:
        with pytest.raises(vc.VariationalError, match="conjugate point"):
            vc.certify(solution)


def test_ends_that_cost_something_together():
    """int v^2 with a cost of both ends: a line, and a quadratic form in its ends."""

    def cost(x0, y0, x1, y1):
        return (y0 + y1 - 1) ** 2 + y0**2 / 3 + 0.7 * (y1 - y0)

    certificate = certified(lambda x, y, v: v**2, vc.Free(0), vc.Free(1), end_cost=cost)
    third, c = mpmath.mpf(1) / 3, mpmath.mpf(0.7)
    y0, y1 = mpmath.lu_solve(mpmath.matrix([[4 + 2 * third, 0], [0, 4]]), mpmath.matrix([2 + c, 2 - c]))
    assert between(certificate, (y1 - y0) ** 2 + (y0 + y1 - 1) ** 2 + third * y0**2 + c * (y1 - y0))


def test_a_waypoint_lets_momenta_jump():
    """int v^2 + y^2 through (0.7, 0.9): two hyperbolic sines."""
    certificate = certified(
        lambda x, y, v: v**2 + y**2, vc.Fixed(0, 0), vc.Fixed(2, 1), [vc.Through(0.7, 0.9)]
    )  # fmt: skip
    t, h = mpmath.mpf(0.7), mpmath.mpf(0.9)
    rest = 2 - t
    second = mpmath.coth(rest) * (h * h + 1) - 2 * h / mpmath.sinh(rest)
    assert between(certificate, mpmath.coth(t) * h * h + second)


def test_a_waypoint_past_which_each_part_is_short_enough():
    """The oscillator for a time 4 > pi, held at 2."""
    certificate = certified(
        lambda x, y, v: v**2 - y**2, vc.Fixed(0, 0), vc.Fixed(4, 1), [vc.Through(2.0, 0.5)]
    )  # fmt: skip
    h = mpmath.mpf(1) / 2
    exact = mpmath.cot(2) * h * h + mpmath.cot(2) * (h * h + 1) - 2 * h / mpmath.sin(2)
    assert between(certificate, exact)
    assert certificate.scope is Scope.ALL


def test_a_waypoint_and_a_level():
    """int v^2 from 0 to 0 in 2 through (1, 1/2) with int y = 0.3: lines, and parabolas that share what is missing."""
    problem = [vc.Through(1.0, 0.5), vc.Isoperimetric(lambda x, y, v: y, 0.3)]
    certificate = certified(lambda x, y, v: v**2, vc.Fixed(0, 0), vc.Fixed(2, 0), problem)
    assert between(certificate, mpmath.mpf(1) / 2 + 24 * ((mpmath.mpf(0.3) - mpmath.mpf(1) / 2) / 2) ** 2)


def test_a_number_that_is_optimised_on_several_pieces():
    """int (v - c)^2 + c^2 from 0 to 1 in 1, with a breakpoint at 1/2: c is 1/2."""
    free = {"breakpoints": [0.5], "unknowns": {"c": 0.1}}
    certificate = certified(lambda x, y, v, p: (v - p.c) ** 2 + p.c**2, vc.Fixed(0, 0), vc.Fixed(1, 1), **free)
    assert between(certificate, mpmath.mpf(1) / 2)


def test_the_greatest_area_over_a_shore_in_the_gauge_of_constant_speed():
    """Dido's semicircle of length 3, from a point of the shore to the shore: 9/(2 pi)."""
    length = vc.Isoperimetric(lambda q, dq: ca.norm_2(dq), 3.0)
    shore = vc.OnSurface(lambda q: q[1], guess=(1, 0))
    problem = vc.Curve(lambda q, dq: q[1] * dq[0], vc.At((0, 0)), shore, [length], maximise=True)
    certificate = vc.certify(vc.solve(problem))
    assert between(certificate, 9 / (2 * mpmath.pi))
    assert certificate.scope is Scope.WEAK


SHORE = vc.OnSurface(lambda q: q[1], guess=(1, 0))


@pytest.mark.parametrize(
    "start", [vc.OnSurface(lambda q: q[1], guess=(-1, 0)), vc.At((None, 0.0))], ids=["slides", "free"]
)
def test_curves_that_may_be_shifted(start):
    """Dido's semicircle of length 3 anywhere on the shore: 9/(2 pi)."""
    length = vc.Isoperimetric(lambda q, dq: ca.norm_2(dq), 3.0)
    certificate = vc.certify(vc.solve(vc.Curve(lambda q, dq: q[1] * dq[0], start, SHORE, [length], maximise=True)))
    assert between(certificate, 9 / (2 * mpmath.pi))


def shore_of(phi):
    length = vc.Isoperimetric(lambda q, dq: ca.norm_2(dq), 3.0)
    start, end = (vc.OnSurface(phi, guess=(x, 0.3)) for x in (-1, 1))
    return vc.Curve(lambda q, dq: q[1] * dq[0], start, end, [length], maximise=True)


@pytest.mark.parametrize("phi", [lambda q: 3 * q[1] - 1, lambda q: q[1] * (q[1] - 4), lambda q: q[1] - 0.1 * q[0]])
def test_a_start_is_pinned_only_where_it_is_known_exactly(phi):
    """3 y = 1 has no double for its root, y (y - 4) two, and on a slope a curve is not shifted freely."""
    solution = vc.solve(shore_of(lambda q: q[1]))
    assert pinned(solution) is not None
    assert pinned(replace(solution, problem=shore_of(phi))) is None


def test_a_curve_that_is_not_known_well_enough_is_brought_nearer():
    """A ray low over the half-plane: the hyperbolic distance of two points 0.1 above it, 2 apart."""
    certificate = certified(lambda x, y, v: ca.sqrt(1 + v**2) / y, vc.Fixed(0, 0.1), vc.Fixed(2, 0.1))
    assert between(certificate, 2 * mpmath.asinh(1 / mpmath.mpf(0.1)))
    assert certificate.width < 1e-16


def test_what_is_all_but_flat_between_the_points_that_are_looked_at():
    """The second derivative 72 y^2 vanishes where the line y = x - c crosses zero, between two nodes."""
    c = 0.5975

    def bent(x, y, v):
        return 0.1 * v**2 + 6 * y**4 - 24 * (x - c) ** 3 * y

    certificate = certified(bent, vc.Fixed(0, -c), vc.Fixed(1, 1 - c))
    C = mpmath.mpf(c)
    assert between(certificate, mpmath.mpf(0.1) - mpmath.mpf(18) / 5 * ((1 - C) ** 5 + C**5))
    assert certificate.scope is Scope.ALL


def test_several_functions_near_a_conjugate_point():
    """int (v^2 - w^2 y^2)/2 of two oscillators, one of them for a time pi - 0.05: a sum of w Y^2 cot(w T)/2."""
    T, Y, w2 = float(np.pi) - 0.05, (0.25, -1.0), 0.5

    def action(x, y, v):
        return (ca.sumsqr(v) - y[0] ** 2 - w2 * y[1] ** 2) / 2

    certificate = certified(action, vc.Fixed(0, (0, 0)), vc.Fixed(T, Y))
    terms = zip((mpmath.mpf(1), mpmath.sqrt(mpmath.mpf(w2))), map(mpmath.mpf, Y), strict=True)
    assert between(certificate, sum(w * y**2 * mpmath.cot(w * mpmath.mpf(T)) / 2 for w, y in terms))
    assert certificate.scope is Scope.ALL


def test_round_off_in_the_last_coefficients_of_a_curve_does_not_widen_the_interval(bounds):
    """int v^2/2 + 10 e^y of which a quartic is made the minimiser, on one box: Taylor's remainders of it were large."""

    def quartic(x):
        return 0.21875 + 0.8125 * x + 0.125 * x**2 + 0.234375 * x**3 + 0.875 * x**4

    def slope(x):
        return 0.8125 + 0.25 * x + 0.703125 * x**2 + 3.5 * x**3

    def lagrangian(x, y, v):
        return v**2 / 2 + 10 * ca.exp(y) - 10 * ca.exp(quartic(x)) * y - slope(x) * v

    with mpmath.workdps(40):
        exact = mpmath.quad(lambda x: 10 * mpmath.exp(quartic(x)) * (1 - quartic(x)) - slope(x) ** 2 / 2, [0, 1])
    certificate = vc.certify(vc.solve(vc.Problem(lagrangian, vc.Fixed(0, quartic(0.0)), vc.Fixed(1, quartic(1.0)))))
    low, high = bounds(certificate)
    assert low <= exact <= high
    assert certificate.width < 1e-17


def test_three_functions_whose_field_turns_fast_are_certified(bounds):
    """Of v.K v/2 + 30 cosh(d.y) a cubic each is made the minimiser; Q changes by orders of magnitude near the ends."""
    K, d = np.array([[9.0, 3.0, -2.0], [3.0, 2.0, 0.0], [-2.0, 0.0, 1.5]]), (1.0, -0.75, 0.5)
    cubics = [(0.25, 0.5, -0.5, 1.0), (0.0, -1.0, 0.5, 0.25), (0.5, 0.25, -0.75, 0.5)]

    def y0(x, k):
        return [(a + x * (b + x * (c + x * e)), b + x * (2 * c + 3 * e * x))[k] for a, b, c, e in cubics]

    def momenta(x):
        return [sum(float(K[i, j]) * y0(x, 1)[j] for j in range(3)) for i in range(3)]

    def along(x):
        return sum(c * v for c, v in zip(d, y0(x, 0), strict=True))

    def lagrangian(x, y, v):
        load = 30 * ca.sinh(along(x)) * ca.dot(ca.DM(d), y)
        return ca.bilin(K, v, v) / 2 + 30 * ca.cosh(ca.dot(ca.DM(d), y)) - load - ca.dot(ca.vertcat(*momenta(x)), v)

    def rate(x):
        kinetic = -sum(p * v for p, v in zip(momenta(x), y0(x, 1), strict=True)) / 2
        return kinetic + 30 * (mpmath.cosh(along(x)) - along(x) * mpmath.sinh(along(x)))

    with mpmath.workdps(40):
        exact = mpmath.quad(rate, [0, 1])
    certificate = vc.certify(vc.solve(vc.Problem(lagrangian, vc.Fixed(0, y0(0.0, 0)), vc.Fixed(1, y0(1.0, 0)))))
    low, high = bounds(certificate)
    assert low <= exact <= high
    assert certificate.width < 1e-15


def test_fast_coefficients():
    """int w v^2 from 0 to 1 is least with w v constant: 1/int 1/w, here over 32 periods of w, summed one by one."""
    rate = 200.0
    problem = vc.Problem(lambda x, y, v: (1 + ca.sin(rate * x) / 2) * v**2, vc.Fixed(0, 0), vc.Fixed(1, 1))
    certificate = vc.certify(vc.solve(problem))
    period = 2 * mpmath.pi / rate
    rest = 1 - 31 * period

    def reciprocal(x):
        return 1 / (1 + mpmath.sin(rate * x) / 2)

    # over a period it is 2 pi/sqrt(1 - 1/4) by residues
    total = 31 * period / mpmath.sqrt(mpmath.mpf(3) / 4) + mpmath.quad(reciprocal, [0, rest / 2, rest])
    assert between(certificate, 1 / total)
    assert certificate.width < 1e-17
