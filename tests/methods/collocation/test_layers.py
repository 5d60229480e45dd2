"""Boundary layers: seen before they are solved, resolved by the first mesh, and as right as is claimed."""

import math

import casadi as ca
import mpmath
import numpy as np
import pytest

import varcalc as vc
from varcalc.formulation import formulate
from varcalc.methods.collocation.layers import STIFF, growth_rates, layered_vertices
from varcalc.methods.collocation.method import first_unknowns
from varcalc.methods.collocation.newton import factorised
from varcalc.methods.collocation.system import CollocationSystem, State, collocation_space


def layered(epsilon, **more):
    return vc.Problem(
        lambda x, y, dy: (epsilon * dy**2 + y**2) / 2, vc.Fixed(0, 1), vc.Fixed(1, 1), name="layers", **more
    )


def looked_at(problem, degree=10):
    form = formulate(problem)
    system = CollocationSystem(form, collocation_space(form, np.array(form.span), degree))
    return system, system.evaluate(first_unknowns(system, form.start.curve))


@pytest.mark.parametrize("tol", [1e-4, 1e-10, 1e-13])
@pytest.mark.parametrize("epsilon", [1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-10])
def test_two_layers_by_the_first_mesh(epsilon, tol):
    # eps y'' = y: y = cosh((x - 1/2) / w) / cosh(1 / (2 w)), J = w tanh(1 / (2 w)), w = sqrt(eps)
    width = math.sqrt(epsilon)
    solution = vc.solve(layered(epsilon), vc.Collocation(), tol=tol)
    near = width * np.linspace(0, 30, 301)
    x = np.unique(np.concatenate([near, 1 - near, np.linspace(0, 1, 101)]).clip(0, 1))
    exact = (np.exp(-x / width) + np.exp((x - 1) / width)) / (1 + math.exp(-1 / width))
    assert abs(solution.value - width * math.tanh(0.5 / width)) <= 10 * solution.error.value + 1e-14 * width
    assert solution.error.value <= tol
    assert np.abs(solution.y(x) - exact).max() <= 1.5 * solution.error.curve
    assert solution.stats.iterations <= 2  # linear: one root of the first mesh, whatever is left is an error estimate
    assert solution.stats.unknowns <= 200


def airy(left, right):
    """J of (y'^2 + q y^2) / 2 with q linear between 1/left and 1/right, y = 1 at the ends: half the jump of y'."""
    with mpmath.workdps(120):
        first, slope = mpmath.mpf(1 / left), mpmath.mpf(1 / right) - mpmath.mpf(1 / left)
        unit = mpmath.cbrt(slope) if slope > 0 else -mpmath.cbrt(-slope)

        def at(x, derivative):
            t = (first + slope * x) / unit**2
            return [unit**derivative * f(t, derivative=derivative) for f in (mpmath.airyai, mpmath.airybi)]

        matrix = mpmath.matrix([at(0, 0), at(1, 0)])
        c = mpmath.lu_solve(matrix, mpmath.matrix([1, 1]))
        rates = [sum(c[k] * v for k, v in enumerate(at(x, 1))) for x in (0, 1)]
        return float((rates[1] - rates[0]) / 2)


@pytest.mark.parametrize("method", [vc.Collocation(), vc.Ritz()])
@pytest.mark.parametrize(("left", "right"), [(1e-4, 1.0), (1.0, 1e-4), (1e-3, 1e-4)])
def test_a_layer_that_is_wider_at_one_end(left, right, method):
    problem = vc.Problem(
        lambda x, y, dy: (dy**2 + y**2 * ((1 - x) / left + x / right)) / 2, vc.Fixed(0, 1), vc.Fixed(1, 1)
    )
    solution = vc.solve(problem, method, tol=1e-11)
    assert abs(solution.value - airy(left, right)) <= solution.error.value


@pytest.mark.parametrize(
    "lagrangian",
    [
        lambda x, y, dy: (dy**2 + y**2) / 2,  # as wide as the interval
        lambda x, y, dy: (1e-6 * dy**2 - y**2) / 2,  # oscillates
        lambda x, y, dy: ca.sqrt(1 + dy**2),
    ],
)
def test_no_layers(lagrangian):
    assert layered_vertices(*looked_at(vc.Problem(lagrangian, vc.Fixed(0, 1), vc.Fixed(1, 2)))) is None


def test_where_layers_lie():
    system, residual = looked_at(layered(1e-6))
    assert growth_rates(system, residual) == pytest.approx(np.full(9, 1e3))
    vertices = layered_vertices(system, residual)
    assert vertices is not None
    assert np.all(np.diff(vertices) > 0)
    assert vertices == pytest.approx(1 - vertices[::-1])
    assert vertices[1] <= 10 / 1e3
    # as many widths as make the layers narrow, and fewer elements where there is less room
    few = layered_vertices(*looked_at(layered(1 / (1.01 * STIFF) ** 2)))
    assert few is not None
    assert len(few) < len(vertices)
    # two functions, of which one has layers
    two = vc.Problem(
        lambda x, y, dy: (dy[0] ** 2 + 1e-6 * dy[1] ** 2 + ca.sumsqr(y)) / 2, vc.Fixed(0, [1, 1]), vc.Fixed(1, [1, 1])
    )
    assert growth_rates(*looked_at(two)) == pytest.approx(np.full(9, 1e3))


def test_a_mesh_that_was_asked_for_is_kept():
    solution = vc.solve(layered(1e-6), vc.Collocation(elements=40, degree=12, refine=False), throw=False)
    assert solution.stats.elements == 40


def test_banded_steps_are_those_of_the_dense_matrix():
    form = formulate(vc.Problem(lambda x, y, dy: y * ca.sqrt(1 + dy**2), vc.Fixed(0, 1), vc.Fixed(1, 1)))
    system = CollocationSystem(form, collocation_space(form, np.array([0.0, 0.1, 0.3, 0.35, 0.8, 1.0]), 12))
    state = system.fitted(lambda s: 1 - 0.3 * s[None] * (1 - s[None]), np.zeros(0))
    assert isinstance(state, State)
    residual = system.evaluate(system.pack(state))
    below, above, _ = system.band
    rows, columns, values = system.triplets(residual)
    assert (rows - columns).max() == below
    assert (columns - rows).max() == above
    matrix = np.zeros((system.size, system.size))
    matrix[rows, columns] = values
    assert np.array_equal(matrix, system.dense(residual))
    solve = factorised(system, residual, np.ones(system.size))
    assert solve is not None
    right = np.random.default_rng(3).standard_normal(system.size)
    assert matrix @ solve(right) == pytest.approx(right, abs=1e-8)
