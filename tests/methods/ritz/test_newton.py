"""The guarded Newton iteration: the region it stays in, what it gives up on, and what it says then."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np
import pytest

import varcalc as vc
from varcalc.formulation import formulate
from varcalc.methods.ritz import newton
from varcalc.methods.ritz.newton import NullSpace, minimise, newton_step
from varcalc.methods.ritz.system import RitzSystem, quadrature_points
from varcalc.numerics.mesh import Space

WIDEST = 0.662743419349182
"""Half the widest distance of two rings of radius 1 that a soap film spans: t / cosh t with t tanh t = 1."""


def system_of(problem, elements=8, degree=4):
    form = formulate(problem)
    space = Space(np.linspace(*form.span, elements + 1), degree, form.n, form.order, form.ends.periodic)
    return RitzSystem(form, space, quadrature_points(degree))


def fitted(system, curve):
    return system.pack(system.space.fit(lambda x: np.atleast_2d(curve(x))), system.form.start.unknowns)


def iterate(problem, curve, elements=8, degree=4, iterations=100):
    system = system_of(problem, elements, degree)
    z = fitted(system, curve)
    multipliers = np.zeros(len(system.levels))
    return system, minimise(system, z, multipliers, vc.Newton(iterations))


def soap_film(a):
    return vc.Problem(lambda x, y, v: y * ca.sqrt(1 + v**2), vc.Fixed(-a, 1), vc.Fixed(a, 1))


def sagging(a, neck):
    """From ring to ring, hanging down to ``neck`` in the middle."""
    return lambda x: neck + (1 - neck) * (x / a) ** 8


def catenary(a):
    """Neck and area / 2 pi of the stable catenary; c cosh(a / c) increases in c above a / t."""
    low, high = a / 1.19967864025773, 1.0
    for _ in range(200):
        neck = 0.5 * (low + high)
        low, high = (neck, high) if neck * math.cosh(a / neck) < 1 else (low, neck)
    return neck, neck * (a + neck * math.sinh(2 * a / neck) / 2)


def drop(x):
    return (x - 1) * x


# the guard


@pytest.mark.parametrize("a", [0.3, 0.5, 0.6, 0.65])
@pytest.mark.parametrize("neck", [0.3, 0.1, 0.01, 1e-3])
def test_a_soap_film_stays_above_its_axis(a, neck):
    # y sqrt(1 + y'^2) has no lower bound below the axis, and Legendre's condition fails there
    system, outcome = iterate(soap_film(a), sagging(a, neck), elements=6)
    assert system.ordinates(outcome.z).min() > 0
    if not outcome.reason:
        assert outcome.value == pytest.approx(catenary(a)[1], rel=1e-6)


def test_a_soap_film_is_found_from_the_axis():
    solution = vc.solve(soap_film(0.5), guess=sagging(0.5, 0.05))
    neck, area = catenary(0.5)
    assert solution.value == pytest.approx(area, rel=1e-10)
    assert solution.y(0.0) == pytest.approx(neck, abs=1e-5)


@pytest.mark.parametrize("beyond", [1e-3, 0.1, 1.0])
@pytest.mark.parametrize("neck", [0.5, 0.05])
def test_beyond_the_widest_distance_the_iteration_ends_above_the_axis_with_a_reason(beyond, neck):
    a = WIDEST + beyond
    system, outcome = iterate(soap_film(a), sagging(a, neck), elements=6)
    assert outcome.reason
    assert system.ordinates(outcome.z).min() > 0


def test_without_the_guard_a_soap_film_slides_below_its_axis(monkeypatch):
    search = newton._search
    monkeypatch.setattr(
        newton, "_search", lambda system, z, at, step, _, last: search(system, z, at, step, False, last)
    )
    a = WIDEST + 0.1
    system, outcome = iterate(soap_film(a), sagging(a, 0.05), elements=6)
    assert system.ordinates(outcome.z).min() < 0


# runaways


@pytest.mark.parametrize(
    "problem",
    [
        vc.Problem(lambda x, y, v: (v**2 - y**2) / 2, vc.Fixed(0, 0), vc.Fixed(4, 1)),
        vc.Problem(lambda x, y, v: v**2 / 2 - y**4, vc.Fixed(0, 0), vc.Fixed(2, 3)),
        vc.Problem(lambda x, y, v: v**2 / 2 - 5 * ca.exp(y), vc.Fixed(0, 0), vc.Fixed(1, 0)),
    ],
    ids=["oscillator beyond its conjugate point", "quartic well", "Bratu beyond its fold"],
)
def test_a_runaway_is_told(problem):
    # none of these has a lower bound, and none a minimum on the way down
    _, outcome = iterate(problem, lambda x: x * problem.end.y / problem.end.x)
    assert outcome.reason
    assert outcome.value < 0


def test_the_sentence_of_a_runaway():
    problem = vc.Problem(lambda x, y, v: (v**2 - y**2) / 2, vc.Fixed(0, 0), vc.Fixed(4, 1))
    _, outcome = iterate(problem, lambda x: x / 4, iterations=1000)
    assert outcome.reason == "the functional appears to have no lower bound"


def test_a_large_functional_is_no_runaway():
    # -1e12 below a small start, but bounded: y'' = -1e6 with y = 0 at the ends, J = -(1e6)^2/24
    problem = vc.Problem(lambda x, y, v: v**2 / 2 - 1e6 * y, vc.Fixed(0, 0), vc.Fixed(1, 0))
    _, outcome = iterate(problem, lambda x: 1e-6 * drop(x))
    assert outcome.reason == ""
    assert outcome.value == pytest.approx(-1e12 / 24, rel=1e-12)


# degenerate conditions


def with_levels(*levels):
    return vc.Problem(lambda x, y, v: v**2, vc.Fixed(0, 0), vc.Fixed(1, 0), [vc.Isoperimetric(g, c) for g, c in levels])


def test_independent_levels_are_met():
    _, outcome = iterate(with_levels((lambda x, y, v: y, 1.0), (lambda x, y, v: x * y, 0.5)), drop)
    assert outcome.reason == ""
    # symmetric: y = 6 x (1 - x), J = 12
    assert outcome.value == pytest.approx(12, rel=1e-12)
    assert outcome.multipliers == pytest.approx([-24, 0], abs=1e-9)


def test_a_level_asked_for_twice_has_no_multipliers():
    # y y' is the derivative of y^2/2: its integral is fixed by the ends
    system, outcome = iterate(with_levels((lambda x, y, v: y, 1.0), (lambda x, y, v: 2 * y + y * v, 2.0)), drop)
    assert "degenerate" in outcome.reason
    assert newton_step(system, system.evaluate(outcome.z), outcome.multipliers) is None


def test_a_level_that_no_bend_changes_has_no_multiplier():
    # y y' is the derivative of y^2/2: its integral is fixed by the ends
    _, outcome = iterate(with_levels((lambda x, y, v: y * v, 0.0)), drop)
    assert outcome.reason


def test_a_chain_as_long_as_its_span_has_no_answer():
    # the straight line is the only admissible curve, and the length is stationary there
    chain = vc.Problem(
        lambda x, y, v: y, vc.Fixed(0, 0), vc.Fixed(1, 0), [vc.Isoperimetric(lambda x, y, v: ca.sqrt(1 + v**2), 1.0)]
    )
    _, outcome = iterate(chain, lambda x: 0 * x)
    assert outcome.reason


def test_a_lagrangian_linear_in_the_slope_has_no_minimum():
    # cos(x) y' + sin(x) y is 2 sin(x) y but for a derivative: there is no equation for the slope, and no lower bound
    problem = vc.Problem(lambda x, y, v: ca.cos(x) * v + ca.sin(x) * y, vc.Fixed(0, 0), vc.Fixed(1, 1))
    _, outcome = iterate(problem, lambda x: x)
    assert outcome.reason


def test_a_symmetry_is_no_degeneracy():
    # only differences of y matter, and both ends are free: the Hessian has a zero mode, the minimum is a valley
    problem = vc.Problem(lambda x, y, v: 1 + (v - ca.cos(x)) ** 2, vc.Free(0), vc.Free(2))
    system, outcome = iterate(problem, lambda x: x**2, elements=1, degree=10)
    assert outcome.reason == ""
    x = system.space.quadrature(system.count)[0].ravel()
    assert outcome.value == pytest.approx(2, rel=1e-12)
    assert np.ptp(system.ordinates(outcome.z)[:, 0] - np.sin(x)) < 1e-6


# what a person is told


def test_a_start_that_is_no_number():
    problem = vc.Problem(lambda x, y, v: ca.sqrt(y) * (1 + v**2), vc.Fixed(0, 1), vc.Fixed(1, 1))
    _, outcome = iterate(problem, lambda x: 1 - 8 * x * (1 - x))
    assert "not a number" in outcome.reason
    assert outcome.iterations == 0


def test_too_few_iterations():
    problem = vc.Problem(lambda x, y, v: v**2 + ca.cosh(3 * y), vc.Fixed(0, 2), vc.Fixed(1, -1))
    _, outcome = iterate(problem, lambda x: 2 - 3 * x, iterations=1)
    assert outcome.reason == "no convergence within 1 iterations"
    _, outcome = iterate(problem, lambda x: 2 - 3 * x)
    assert outcome.reason == ""
    assert outcome.iterations < 12


def test_a_quadratic_functional_takes_one_step():
    problem = vc.Problem(lambda x, y, v: v**2 + y**2, vc.Fixed(0, 0), vc.Fixed(1, 1))
    _, outcome = iterate(problem, lambda x: x**2, degree=10, elements=1)
    assert outcome.reason == ""
    assert outcome.iterations <= 2
    assert outcome.value == pytest.approx(1 / math.tanh(1), rel=1e-14)


@pytest.mark.parametrize("shape", [(1, 7), (2, 9), (3, 5, 8), (4, 2, 12), (5, 5), (6, 5)])
def test_forms_are_reduced_to_the_directions_that_keep_conditions(shape):
    random = np.random.default_rng(0)
    jacobian, square = random.normal(size=shape), random.normal(size=(*shape[:-2], shape[-1], shape[-1]))
    null, form = NullSpace(jacobian), square + square.swapaxes(-1, -2)
    assert np.abs(jacobian @ null.basis).max(initial=0.0) < 1e-13
    expected = null.basis.swapaxes(-1, -2) @ form @ null.basis
    assert null.reduced(form) == pytest.approx(expected, abs=1e-13)
