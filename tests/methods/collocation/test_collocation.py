"""Collocation against closed forms: values, curves, claims, orders, and the refusal to invent extremals."""

from __future__ import annotations

import math
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from varcalc.formulation import Conditions, Coordinates, Ends, Form, Start, Stated, formulate
from varcalc.methods.collocation.method import Collocation
from varcalc.numerics.mesh import gauss
from varcalc.problem.conditions import (
    At,
    Bound,
    Fixed,
    Free,
    Holonomic,
    Isoperimetric,
    OnCurve,
    Periodic,
    Through,
)
from varcalc.problem.functional import Symbols
from varcalc.problem.problem import Curve, Problem
from varcalc.solution import Status

FOLD = 0.662743419349182
"""Half the widest distance of two rings that a soap film spans: t / cosh t with t tanh t = 1."""


def solved(problem, method=None, tol=1e-10, guess=None):
    """The solution, checked to stand and to keep its promise of ``tol``."""
    solution = (method or Collocation()).solve(formulate(problem), tol=tol, guess=guess)
    assert solution.status is Status.SOLVED, solution.message
    return solution


def root(function, low, high):
    """A root of an increasing function by bisection to round-off."""
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if function(middle) < 0 else (low, middle)
    return 0.5 * (low + high)


def largest_error(solution, curve, count=801):
    x = np.linspace(*solution.problem.span, count)
    return float(np.abs(solution.y(x) - curve(x)).max())


def soap_film(a):
    return Problem(lambda x, y, dy: y * ca.sqrt(1 + dy**2), Fixed(-a, 1), Fixed(a, 1))


def catenary(a):
    """Neck and area / 2 pi of the stable catenary between rings of radius 1 at -a and a."""
    neck = root(lambda c: c * math.cosh(a / c) - 1, a / 1.19967864025773, 1.0)
    return neck, neck * (a + neck * math.sinh(2 * a / neck) / 2)


def layer(eps):
    return Problem(lambda x, y, dy: eps * dy**2 + y**2, Fixed(0, 1), Fixed(1, 0))


def layer_value(eps):
    return math.sqrt(eps) / math.tanh(eps**-0.5)


def oscillator(duration):
    return Problem(lambda x, y, dy: (dy**2 - y**2) / 2, Fixed(0, 0), Fixed(duration, 1))


def speed(dq):
    return ca.sqrt(ca.sumsqr(dq))


# existence, branches, folds


@pytest.mark.parametrize("a", [0.3, 0.5, 0.6, 0.66, FOLD - 1e-4, FOLD - 1e-7])
@pytest.mark.parametrize("tol", [1e-10, 1e-12])
def test_soap_film(a, tol):
    solution = solved(soap_film(a), tol=tol)
    neck, area = catenary(a)
    assert solution.value == pytest.approx(area, abs=tol)
    if a < FOLD - 1e-6:  # at the fold itself double precision does not fix the neck
        assert solution.y(0.0) == pytest.approx(neck, abs=2 * solution.error.curve + 1e-12)
        assert solution.error.curve < 1e-4


@pytest.mark.parametrize(("beyond", "tol"), [(1e-6, 1e-10), (1e-6, 1e-2), (1e-3, 1e-10), (1e-3, 1e-2), (0.3, 1e-2)])
def test_there_is_no_soap_film_beyond_the_fold(beyond, tol):
    problem = soap_film(FOLD + beyond)
    solution = Collocation().solve(formulate(problem), tol=tol, guess=None)
    assert solution.status is Status.NOT_CONVERGED
    assert "guess=" in solution.message


@pytest.mark.parametrize("elements", [1, 2, 5, 16])
@pytest.mark.parametrize("degree", [3, 4, 6, 9])
def test_no_mesh_holds_a_soap_film_beyond_the_fold(elements, degree):
    problem = soap_film(FOLD + 1e-6)
    method = Collocation(elements, degree, refine=False)
    assert method.solve(formulate(problem), tol=1e-3, guess=None).status is Status.NOT_CONVERGED


def test_a_guess_leads_to_the_other_catenary():
    neck = root(lambda c: 1 - c * math.cosh(0.5 / c), 0.15, 0.4)
    problem = soap_film(0.5)
    solution = solved(problem, guess=lambda s: (neck * np.cosh(s / neck))[None] + 0.01 * (s**2 - 0.25))
    assert solution.y(0.0) == pytest.approx(neck, abs=1e-6)
    assert solution.value == pytest.approx(neck * (0.5 + neck * math.sinh(1 / neck) / 2), abs=1e-10)


@pytest.mark.parametrize("strength", [0.5, 3.0, 3.5138])
def test_bratu(strength):
    problem = Problem(lambda x, y, dy: dy**2 / 2 - strength * ca.exp(y), Fixed(0, 0), Fixed(1, 0))
    solution = solved(problem, tol=1e-12)
    turning = root(lambda t: t * math.tanh(t) - 1, 1.0, 2.0)
    height = root(lambda t: t / math.cosh(t) - math.sqrt(strength / 8), 0.0, turning)
    assert solution.y(0.5) == pytest.approx(2 * math.log(math.cosh(height)), abs=2e-6)


@pytest.mark.parametrize("strength", [3.514, 4.0])
def test_bratu_beyond_the_fold(strength):
    problem = Problem(lambda x, y, dy: dy**2 / 2 - strength * ca.exp(y), Fixed(0, 0), Fixed(1, 0))
    solution = Collocation().solve(formulate(problem), tol=1e-6, guess=None)
    assert solution.status is Status.NOT_CONVERGED


@pytest.mark.parametrize("duration", [1.0, 2.0, 3.0, 4.0, 20.0])
def test_oscillator_before_and_after_conjugate_points(duration):
    solution = solved(oscillator(duration), tol=1e-12)
    assert solution.value == pytest.approx(0.5 / math.tan(duration), abs=1e-12)
    assert largest_error(solution, lambda x: np.sin(x) / math.sin(duration)) < 1e-6


def steep():
    """A smooth Lagrangian whose extremal turns steep (slope 41) just before its end."""
    return Problem(lambda x, y, dy: ca.sqrt(0.1 + dy**2 + 0.867 * dy * y + y**2), Fixed(0, -0.134), Fixed(1.9937, 0.63))


def test_a_steep_extremal_is_found_and_warm_starts():
    first = solved(steep(), tol=1e-8)
    again = solved(steep(), tol=1e-12, guess=lambda s: np.atleast_2d(first.y(s)))
    assert again.stats.iterations < 10 < first.stats.iterations
    assert abs(first.value - again.value) <= 10 * first.error.value
    invariant = again.dy(1.9) * momentum(again, 1.9) - lagrangian_value(again, 1.9)
    assert invariant == pytest.approx(again.dy(0.3) * momentum(again, 0.3) - lagrangian_value(again, 0.3), abs=1e-6)


def lagrangian_value(solution, x):
    y, v = solution.y(x), solution.dy(x)
    return math.sqrt(0.1 + v**2 + 0.867 * v * y + y**2)


def momentum(solution, x):
    return (solution.dy(x) + 0.4335 * solution.y(x)) / lagrangian_value(solution, x)


# prescribed integrals


@pytest.mark.parametrize("length", [2.1, 2.5, 3.0])
def test_isoperimetric_arc(length):
    half_angle = root(lambda t: t / math.sin(t) - length / 2, 1e-6, math.pi / 2)
    radius = 1 / math.sin(half_angle)
    area = radius**2 * (half_angle - math.sin(half_angle) * math.cos(half_angle))
    arc = Isoperimetric(lambda x, y, dy: ca.sqrt(1 + dy**2), length)
    solution = solved(Problem(lambda x, y, dy: y, Fixed(-1, 0), Fixed(1, 0), [arc], maximise=True))
    assert solution.value == pytest.approx(area, abs=1e-10)
    assert solution.multipliers[0] == pytest.approx(radius, abs=1e-7)


@pytest.mark.parametrize("length", [1.0001, 1.01, 1.5, 3.0])
def test_hanging_chain_hangs(length):
    half = root(lambda t: math.sinh(t) / t - length, 1e-9, 10.0)
    c = 0.5 / half
    sag = c * (math.cosh(half) - 1)
    chain = Isoperimetric(lambda x, y, dy: ca.sqrt(1 + dy**2), length)
    solution = solved(Problem(lambda x, y, dy: y * ca.sqrt(1 + dy**2), Fixed(0, 0), Fixed(1, 0), [chain]), tol=1e-12)
    assert -solution.y(0.5) == pytest.approx(sag, abs=2e-6)
    assert solution.multipliers[0] == pytest.approx(-c * math.cosh(half), rel=1e-5)


def test_a_chain_shorter_than_its_span_does_not_hang():
    chain = Isoperimetric(lambda x, y, dy: ca.sqrt(1 + dy**2), 0.99)
    problem = Problem(lambda x, y, dy: y * ca.sqrt(1 + dy**2), Fixed(0, 0), Fixed(1, 0), [chain])
    assert not Collocation().solve(formulate(problem), tol=1e-6, guess=None).status.ok


def test_closed_curve_and_shore_of_greatest_area():
    length = 5.0
    rope = Isoperimetric(lambda q, dq: speed(dq), length)
    ring = Curve(lambda q, dq: (q[0] * dq[1] - q[1] * dq[0]) / 2, Periodic(), Periodic(), [rope], maximise=True)
    shore = Curve(lambda q, dq: -q[1] * dq[0], At((0, 0)), At((None, 0)), [rope], maximise=True)
    assert solved(ring).value == pytest.approx(length**2 / (4 * math.pi), abs=1e-10)
    assert solved(shore).value == pytest.approx(length**2 / (2 * math.pi), abs=1e-10)


# charts, ends, vectors


@pytest.mark.parametrize("latitude", [0.5, 1.2, 1.5])
def test_great_circle_as_a_graph(latitude):
    problem = Problem(lambda x, y, dy: ca.sqrt(dy**2 + ca.cos(y) ** 2), Fixed(0, 0.2), Fixed(2, latitude))
    cosine = math.sin(0.2) * math.sin(latitude) + math.cos(0.2) * math.cos(latitude) * math.cos(2)
    assert solved(problem).value == pytest.approx(math.acos(cosine), abs=1.5e-10)


@pytest.mark.parametrize("angle", [0.7, 2.0])
def test_great_circle_on_the_sphere_with_its_multiplier(angle):
    end = (math.cos(angle), 0.6 * math.sin(angle), 0.8 * math.sin(angle))
    sphere = Holonomic(lambda q: ca.sumsqr(q) - 1)
    solution = solved(Curve(lambda q, dq: speed(dq), At((1, 0, 0)), At(end), [sphere]), tol=1e-12)
    assert solution.value == pytest.approx(angle, abs=1e-12)
    # d/dt (dq / |dq|) = -angle q must equal 2 mu q
    assert solution.multipliers[0](np.array([0.1, 0.5])) == pytest.approx(-angle / 2, abs=1e-5)
    assert np.abs((solution.q(np.linspace(0, 1, 33)) ** 2).sum(0) - 1).max() < 1e-6


def test_a_pathwise_equality_at_a_free_end():
    cylinder = Holonomic(lambda x, y: ca.sumsqr(y) - 1)
    problem = Problem(
        lambda x, y, dy: ca.sumsqr(dy) / 2 - y[1], Fixed(0, (1, 0)), Free(1, n=2), [cylinder]
    )  # a pendulum in angle: theta'' = -cos theta with theta'(1) = 0
    angle = Problem(lambda x, y, dy: dy**2 / 2 - ca.sin(y), Fixed(0, 0), Free(1))
    embedded, graph = solved(problem), solved(angle)
    assert embedded.value == pytest.approx(graph.value, abs=2e-10)
    assert embedded.y(1.0) == pytest.approx([math.cos(graph.y(1.0)), math.sin(graph.y(1.0))], abs=1e-5)


def test_free_end_and_end_cost():
    free = solved(Problem(lambda x, y, dy: (dy**2 + y**2) / 2, Fixed(0, 1), Free(1)), tol=1e-12)
    assert free.value == pytest.approx(math.tanh(1) / 2, abs=1e-12)
    assert free.dy(1.0) == pytest.approx(0.0, abs=1e-9)

    def cost(x0, y0, x1, y1):
        return (y0 - 1) ** 2 / 2 + (y1 - 2) ** 2 / 2

    sprung = solved(Problem(lambda x, y, dy: dy**2 / 2, Free(0), Free(2), end_cost=cost))
    assert sprung.value == pytest.approx(0.125, abs=1e-14)
    assert largest_error(sprung, lambda x: 1.25 + 0.25 * x) < 1e-13


def test_sliding_ends():
    def length(x, y, dy):
        return ca.sqrt(1 + dy**2)

    def upper(x, y):
        return y - x - 5

    def parabola(x, y):
        return x - 1 - y**2 / 4

    to_line = solved(Problem(length, Fixed(0, 0), OnCurve(lambda x, y: x + y - 2, x=1.5)))
    between = solved(Problem(length, OnCurve(upper, x=-1), OnCurve(parabola, x=1.5)))
    assert to_line.value == pytest.approx(math.sqrt(2), abs=1e-12)
    assert between.value == pytest.approx(5 / math.sqrt(2), abs=1e-12)
    assert between.dy(1.0) == pytest.approx(-1.0, abs=1e-7)


def test_vector_oscillator_with_a_free_component():
    problem = Problem(
        lambda x, y, dy: (ca.sumsqr(dy) - y[0] ** 2 - 4 * y[1] ** 2) / 2, Fixed(0, (0, 1)), Fixed(1, (1, None))
    )
    solution = solved(problem, tol=1e-12)
    x = np.linspace(0, 1, 101)
    exact = np.array([np.sin(x) / math.sin(1), np.cos(2 * x) + math.tan(2) * np.sin(2 * x)])
    assert np.abs(solution.y(x) - exact).max() < 1e-6
    assert solution.value == pytest.approx(0.5 / math.tan(1) - math.tan(2), abs=1e-12)


# second order


def load(x, y, dy, ddy):
    return ddy**2 / 2 - y


@pytest.mark.parametrize(
    ("start", "end", "curve", "value"),
    [
        (Fixed(0, 0, 0), Fixed(1, 0, 0), lambda x: x**2 * (1 - x) ** 2 / 24, -1 / 1440),
        (Fixed(0, 0), Fixed(1, 0), lambda x: x * (1 - 2 * x**2 + x**3) / 24, -1 / 240),
        (Fixed(0, 0, 0), Free(1), lambda x: x**2 * (6 - 4 * x + x**2) / 24, -1 / 40),
    ],
    ids=["clamped", "hinged", "cantilever"],
)
def test_beam(start, end, curve, value):
    solution = solved(Problem(load, start, end, order=2))
    assert solution.value == pytest.approx(value, abs=1e-15)
    assert largest_error(solution, curve) < 1e-14


def manufactured(order):
    """A Lagrangian with y'(x)^4 whose extremal is sin(2 x), by a source along the chosen curve."""

    def extremal(x):
        return ca.sin(2 * x)

    x = ca.SX.sym("x")
    y = extremal(x)
    slopes = [y]
    for _ in range(4):
        slopes.append(ca.jacobian(slopes[-1], x))
    if order == 1:
        source = 3 * slopes[1] ** 2 * slopes[2] + slopes[2] - y
    else:
        source = -(slopes[4] - 3 * slopes[1] ** 2 * slopes[2] + y)
    function = ca.Function("source", [x], [source])

    def lagrangian(x, y, dy, ddy=None):
        kinetic = dy**4 / 4 + (dy**2 / 2 if order == 1 else ddy**2 / 2)
        return kinetic + y**2 / 2 + function(x) * y

    ends = [
        Fixed(s, math.sin(2 * s)) if order == 1 else Fixed(s, math.sin(2 * s), 2 * math.cos(2 * s)) for s in (0.1, 1.3)
    ]
    return Problem(lagrangian, *ends, order=order), lambda x: np.sin(2 * x)


@pytest.mark.parametrize("order", [1, 2])
def test_manufactured_extremal(order):
    problem, curve = manufactured(order)
    assert largest_error(solved(problem, tol=1e-12), curve) < 1e-6


# layers


@pytest.mark.parametrize("eps", [1e-2, 1e-4, 1e-6, 1e-8, 1e-10])
def test_boundary_layer(eps):
    solution = solved(layer(eps))
    assert solution.value == pytest.approx(layer_value(eps), abs=1e-10)
    assert abs(solution.value - layer_value(eps)) <= 10 * solution.error.value


@pytest.mark.parametrize(
    ("mu", "slope", "relative"),
    [(5, 0.0457504614063187, 1e-9), (10, 3.58337784630814e-4, 1e-9), (30, 7.48609379504381e-13, 1e-4)],
)
def test_troesch(mu, slope, relative):
    problem = Problem(lambda x, y, dy: dy**2 / 2 + ca.cosh(mu * y), Fixed(0, 0), Fixed(1, 1))
    assert solved(problem, tol=1e-12).dy(0.0) == pytest.approx(slope, rel=relative)


# knots, waypoints, periods


@pytest.mark.parametrize("pieces", [2, 20, 100, 400])
def test_momenta_agree_across_however_many_knots(pieces):
    # the momentum is one number, rise / (sum of lengths / coefficients), and half of the way either coefficient is met
    layers = Problem(
        lambda x, y, dy: ca.if_else(ca.sin(pieces * np.pi * x) > 0, 2, 1) * dy**2 / 2, Fixed(0, 0), Fixed(1, 1),
        breakpoints=[k / pieces for k in range(1, pieces)],
    )  # fmt: skip
    solution = solved(layers)
    assert solution.value == pytest.approx(2 / 3, rel=1e-12)
    assert solution.y(0.5) == pytest.approx(1 / 3 if pieces == 2 else 1 / 2, rel=1e-12)


def test_snell_refraction_at_a_breakpoint():
    problem = Problem(
        lambda x, y, dy: ca.if_else(x < 0.4, 1.0, 1.5) * ca.sqrt(1 + dy**2), Fixed(0, 0), Fixed(1, 1), breakpoints=[0.4]
    )
    height = root(lambda y: y / math.hypot(0.4, y) - 1.5 * (1 - y) / math.hypot(0.6, 1 - y), 0.0, 1.0)
    solution = solved(problem)
    assert solution.value == pytest.approx(math.hypot(0.4, height) + 1.5 * math.hypot(0.6, 1 - height), abs=1e-13)
    assert largest_error(solution, lambda x: np.interp(x, [0, 0.4, 1], [0, height, 1])) < 1e-13


def test_waypoints_of_either_order():
    first = Problem(lambda x, y, dy: (dy**2 + y**2) / 2, Fixed(0, 0), Fixed(2, 0), [Through(1.0, 1.0)])
    assert solved(first, tol=1e-12).value == pytest.approx(1 / math.tanh(1), abs=1e-12)
    spline = Problem(lambda x, y, dy, ddy: ddy**2 / 2, Fixed(0, 0), Fixed(2, 0), [Through(1.0, 1.0)], order=2)
    solution = solved(spline)
    assert solution.value == pytest.approx(3.0, abs=1e-13)
    assert solution.dy(1.0) == pytest.approx(0.0, abs=1e-12)


def test_periodic_forced_oscillator():
    ends = Periodic(0, 2 * math.pi)
    solution = solved(Problem(lambda x, y, dy: dy**2 / 2 + y**2 - y * ca.cos(x), ends, ends), tol=1e-12)
    assert solution.value == pytest.approx(-math.pi / 6, abs=1e-12)
    assert largest_error(solution, lambda x: np.cos(x) / 3) < 1e-6


def test_unknown_numbers_and_sensitivities():
    def energy(x, y, dy, p):
        return dy**2 / 2 + (y - p.k * x) ** 2 + (p.k - p.a) ** 2

    def at(a):
        problem = Problem(energy, Fixed(0, 0), Fixed(1, 1), unknowns={"k": 0.0}, parameters={"a": a})
        return solved(problem, tol=1e-13)

    solution = at(2.0)
    fine = [solved(Problem(lambda x, y, dy, k=k: dy**2 / 2 + (y - k * x) ** 2 + (k - 2) ** 2, Fixed(0, 0), Fixed(1, 1)),
                   tol=1e-13).value for k in solution.unknowns["k"] + np.array([-0.01, 0.0, 0.01])]  # fmt: skip
    assert fine[1] == pytest.approx(solution.value, abs=1e-12)
    assert fine[1] < min(fine[0], fine[2])
    step = 1e-4
    difference = (at(2.0 + step).value - at(2.0 - step).value) / (2 * step)
    assert solution.sensitivities["a"] == pytest.approx(difference, abs=1e-7)


def test_level_multiplier_is_the_derivative_by_the_level():
    def value(length):
        chain = Isoperimetric(lambda x, y, dy: ca.sqrt(1 + dy**2), length)
        problem = Problem(lambda x, y, dy: y * ca.sqrt(1 + dy**2), Fixed(0, 0), Fixed(1, 0), [chain])
        return solved(problem, tol=1e-12)

    step = 1e-4
    difference = (value(1.5 + step).value - value(1.5 - step).value) / (2 * step)
    assert value(1.5).multipliers[0] == pytest.approx(difference, abs=1e-6)


# a singular end, regularised


@pytest.mark.parametrize("tol", [1e-10, 1e-12])
def test_regularised_brachistochrone(tol):
    """y = w^2 and the energy of the metric: smooth inside, 0/0 at the very end, which no Gauss point touches."""
    problem = Problem(
        lambda x, y, dy, p: ca.sqrt((1 + dy**2) / (2 * p.g * y)), Fixed(0, 0), Fixed(1, 1), parameters={"g": 9.81}
    )
    symbols = replace(Symbols.make(ca.SX, 2, 1, 0, 0), parameters=problem.symbols.parameters)
    (x, w), (dx, dw), g = ca.vertsplit(symbols.y), ca.vertsplit(symbols.dy), problem.symbols.parameters
    square = (dx**2 + 4 * w**2 * dw**2) / (2 * g * w**2)
    stated = Stated(symbols, square, ca.sqrt(square), (x, w**2, dx, 2 * w * dw))
    form = Form(
        problem, Coordinates(stated, energetic=True, singular=(True, False)), Ends(np.zeros((1, 2)), np.ones((1, 2))),
        Conditions(), Start(lambda s: np.vstack([s**3, s]), np.zeros(0), np.eye(2)),
    )  # fmt: skip
    angle = root(lambda t: (t - math.sin(t)) / (1 - math.cos(t)) - 1, 1.0, 6.0)
    radius = 1 / (1 - math.cos(angle))
    solution = Collocation().solve(form, tol=tol, guess=None)
    assert solution.status is Status.SOLVED
    assert solution.value == pytest.approx(angle * math.sqrt(radius / 9.81), abs=1e-14)
    turn = np.linspace(0.5, angle - 0.1, 9)
    points = radius * (turn - np.sin(turn)), radius * (1 - np.cos(turn))
    assert solution.y(points[0]) == pytest.approx(points[1], abs=1e-5)


# numbers: orders, claims, tolerances, units


@pytest.mark.parametrize(("degree", "expected"), [(3, 6), (4, 8), (5, 10)])
def test_order_of_the_value(degree, expected):
    """The value converges at twice the degree: it is stationary, and the slope converges at the degree."""
    meshes = (2, 4, 8)
    errors = [
        abs(solved(layer(0.1), Collocation(count, degree, refine=False)).value - layer_value(0.1)) for count in meshes
    ]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders[-1] == pytest.approx(expected, abs=0.35)


@pytest.mark.parametrize(("degree", "expected"), [(3, 4), (4, 5), (5, 6), (6, 7)])
def test_order_of_the_curve(degree, expected):
    k = 0.1**-0.5

    def exact(x):
        return np.sinh(k * (1 - x)) / math.sinh(k)

    errors = [largest_error(solved(layer(0.1), Collocation(n, degree, refine=False)), exact) for n in (4, 8, 16)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders[-1] == pytest.approx(expected, abs=0.4)


def test_order_of_the_curve_at_second_order():
    problem = Problem(lambda x, y, dy, ddy: (ddy**2 + 900 * y**2) / 2, Fixed(0, 0, 0), Fixed(1, 1, 0), order=2)
    fine = solved(problem, tol=1e-13)
    errors = [largest_error(solved(problem, Collocation(n, 7, refine=False)), fine.y) for n in (1, 2, 4)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders[-1] > 6.5


def test_claims_against_delivered_errors():
    """Never below a tenth of the delivered error, and a median ratio near one."""
    half = 0.5 * math.sqrt(2)
    cases = [
        *((soap_film(a), catenary(a)[1]) for a in (0.3, 0.5, 0.6, 0.65)),
        *((oscillator(t), 0.5 / math.tan(t)) for t in (1.0, 2.0, 4.0)),
        *((layer(eps), layer_value(eps)) for eps in (0.1, 0.01, 0.001)),
        (Problem(lambda x, y, dy: ca.sqrt(1 + dy**2) * ca.exp(0 * y), Fixed(0, 0), Fixed(half, half)), 1.0),
    ]
    adaptive = [(Collocation(), tol) for tol in (1e-3, 1e-5, 1e-8, 1e-10, 1e-12)]
    kept = [(Collocation(elements, degree, refine=False), 1e-10) for elements in (1, 2, 4) for degree in (3, 4, 6)]
    ratios = []
    for problem, exact in cases:
        form = formulate(problem)
        for method, tol in adaptive + kept:
            solution = method.solve(form, tol=tol, guess=None)
            if method.refine:
                assert solution.status is Status.SOLVED
            elif solution.curve is None:  # a mesh may be too coarse to tell
                continue
            delivered = abs(solution.value - exact)
            if delivered > 1e-13:
                ratios.append(solution.error.value / delivered)
    assert len(ratios) > 60
    assert min(ratios) >= 0.1
    assert np.median(ratios) < 2
    assert np.quantile(ratios, 0.95) < 10


def test_a_tolerance_below_round_off_is_met_as_well_as_can_be():
    problem = soap_film(0.5)
    solution = Collocation().solve(formulate(problem), tol=1e-18, guess=None)
    assert solution.status is Status.ROUND_OFF
    assert solution.value == pytest.approx(catenary(0.5)[1], abs=1e-14)


@pytest.mark.parametrize("unit", [1e-7, 1e7])
def test_units_make_no_difference(unit):
    a = 0.6 * unit
    film = Problem(lambda x, y, dy: y * ca.sqrt(1 + dy**2), Fixed(-a, unit), Fixed(a, unit))
    assert solved(film).value / unit**2 == pytest.approx(catenary(0.6)[1], abs=1e-9)


def test_a_mesh_that_is_kept_reports_its_error():
    solution = solved(layer(0.01), Collocation(4, 4, refine=False))
    assert "kept" in solution.message
    assert (solution.stats.elements, solution.stats.degree) == (4, 4)
    delivered = abs(solution.value - layer_value(0.01))
    assert 0.5 * delivered <= solution.error.value <= 2 * delivered


def test_interpolated_data_in_the_lagrangian():
    grid = np.linspace(-1, 2, 40)
    table = ca.interpolant("index", "bspline", [grid], 1.0 + grid**2)
    tabulated = Problem(
        lambda x, y, dy: table(y) * ca.sqrt(1 + dy**2),
        Fixed(0, 0.2),
        Fixed(1, 0.3),
    )
    smooth = Problem(lambda x, y, dy: (1 + y**2) * ca.sqrt(1 + dy**2), Fixed(0, 0.2), Fixed(1, 0.3))
    assert solved(tabulated, tol=1e-8).value == pytest.approx(solved(smooth).value, abs=1e-6)


# what it does not treat


@pytest.mark.parametrize(
    "constraint",
    [
        Isoperimetric(lambda x, y, dy: ca.sqrt(1 + dy**2), lower=1.0, upper=2.0),
        Bound(lambda x, y, dy: y, lower=0.0),
    ],
)
def test_inequalities_are_refused(constraint):
    problem = Problem(lambda x, y, dy: dy**2 + y, Fixed(0, 0), Fixed(1, 0), [constraint])
    solution = Collocation().solve(formulate(problem), tol=1e-6, guess=None)
    assert solution.status is Status.REFUSED
    assert "constraints[0]" in solution.message


def test_meshes_that_cannot_be():
    with pytest.raises(ValueError, match=r"Collocation\.elements"):
        Collocation(elements=0)
    with pytest.raises(ValueError, match=r"Collocation\.degree"):
        Collocation(degree=2)
    problem = Problem(load, Fixed(0, 0), Fixed(1, 0), order=2)
    solution = Collocation(degree=5).solve(formulate(problem), tol=1e-6, guess=None)
    assert solution.status is Status.REFUSED
    assert "at least 7" in solution.message
    for options in ({"elements": 1.5}, {"elements": True}, {"degree": "high"}):
        with pytest.raises(TypeError, match="must be a whole number"):
            Collocation(**options)
    with pytest.raises(TypeError, match=r"Collocation\.refine must be True or False, not 'no'"):
        Collocation(refine="no")


def test_a_constant_guess_needs_no_fine_mesh():
    # round-off about a constant is no feature of a guess that a mesh would have to resolve
    rest = Problem(lambda x, y, dy: ca.sumsqr(dy) / 2 + ca.sumsqr(y - 0.1), Fixed(0, [0.1, 0.1]), Fixed(1, [0.1, 0.1]))
    solution = Collocation().solve(formulate(rest), tol=1e-10, guess=lambda s: np.full((2, len(s)), 0.1))
    assert solution.stats.elements <= 4


def test_beyond_a_fold_finer_meshes_show_nothing_but_round_off():
    # Bratu's reaction has no state beyond 3.513830719125161; that close to it residuals are of the size of rounding
    for excess in (1e-13, 5e-13, 5e-12):
        problem = Problem(
            lambda x, y, dy, e=excess: dy**2 / 2 - (3.513830719125161 + e) * ca.exp(y), Fixed(0, 0), Fixed(1, 0)
        )
        refused = Collocation().solve(formulate(problem), tol=1e-10, guess=None)
        assert refused.status is Status.NOT_CONVERGED


def test_at_resonance_nothing_is_called_an_extremal():
    """y'' + w^2 y = f x has no solution where w times the interval is a multiple of pi and the ends do not suit."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        n, w, end, force = rng.integers(1, 4), rng.uniform(0.5, 3), rng.uniform(0.5, 2), rng.normal()
        problem = Problem(
            lambda x, y, v, w=w, force=force: (v**2 - w**2 * y**2) / 2 + force * x * y,
            Fixed(0, 0),
            Fixed(n * math.pi / w, end),
        )
        assert not Collocation().solve(formulate(problem), tol=1e-6, guess=None).status.ok


@pytest.mark.parametrize("refine", [False, True])
def test_a_value_that_is_infinite_is_no_answer(refine):
    """L is infinite at one point, which the rule for the value meets and the collocation points do not."""
    point = 0.5 * (1 + float(gauss(24)[0][7]))
    spiked = Problem(lambda x, y, dy: dy**2 + y**2 + 1e-40 / (x - point) ** 2, Fixed(0, 0), Fixed(1, 1))
    found = Collocation(degree=10, refine=refine).solve(formulate(spiked), tol=1e-10, guess=None)
    assert not found.status.ok or math.isfinite(found.value + found.error.value)
    assert found.status.ok is refine
