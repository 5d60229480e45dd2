"""Euler's second equation, d/dx (Σ y^(k+1) p_k - L) = -∂L/∂x, where x occurs in L (Brizard, sect. 1.2.2, eq. 1.24)."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import varcalc as vc
from varcalc.problem.lagrangian import Lagrangian

NUMBERS = st.floats(-2, 2).map(lambda value: round(value, 3))
KINDS = [(1, 1), (1, 2), (1, 3), (2, 1), (2, 2)]
"""Order of L, and how many functions it is of."""


def random_lagrangian(weights):
    """Products and compositions of x and of the functions and their derivatives, none of which can be left out."""

    def L(x, y, *slopes):
        entries = ca.vertcat(x, y, *slopes).elements() if isinstance(y, ca.SX) else [x, y, *slopes]
        total = 0
        for k, a in enumerate(entries):
            b, w = entries[(k + 1) % len(entries)], weights[k % len(weights)]
            total += w * a**2 * b + ca.sin(a * b + w) + ca.exp(-(a**2)) * (1 + w * entries[-1]) ** 2
        return total

    return L


@settings(max_examples=12, deadline=None)
@given(weights=st.lists(NUMBERS, min_size=3, max_size=5), values=st.lists(NUMBERS, min_size=16, max_size=16))
@pytest.mark.parametrize(("order", "n"), KINDS)
def test_it_is_what_the_first_equation_leaves_on_any_curve(order, n, weights, values):
    ends = [(x, *([[0.0] * n if n > 1 else 0.0] * order)) for x in (0, 1)]
    L = random_lagrangian(weights)
    problem = vc.Problem(L, *(vc.Fixed(*end) for end in ends), order=order)
    own = Lagrangian.of(problem)
    tower = own.derivatives_of_y
    by_x = ca.jacobian(own.expression, own.symbols.x)
    terms = [own.total_derivative(own.energy), by_x, ca.dot(tower[1], own.euler_lagrange)]
    function = ca.Function("terms", [own.symbols.x, *tower], [ca.vertcat(*terms)])
    given_values = iter(values)
    state = [next(given_values), *([next(given_values) for _ in range(n)] for _ in tower)]
    found = np.array(function(*state)).ravel()
    # d/dx of the energy is made of products of up to four numbers of size 2, by the thousand
    assert abs(found.sum()) <= 1e-12 * (1e3 + np.abs(found).sum())


CASES = {
    "one function": (
        1, lambda x, y, dy: dy**2 * (1 + x**2) / 2 + ca.cos(x) * y**2 / 2, vc.Fixed(0, 1), vc.Fixed(1.5, -0.3)
    ),
    "two functions": (
        1,
        lambda x, y, dy: ca.sumsqr(dy) * ca.exp(x / 2) / 2 + y[0] ** 2 * y[1] ** 2 / 2 + x * ca.sumsqr(y),
        vc.Fixed(0, [1, 0]), vc.Fixed(1, [0.2, 0.7]),
    ),
    "second order": (
        2, lambda x, y, dy, ddy: (1 + x) * ddy**2 / 2 + dy**2 + x * y, vc.Fixed(0, 0, 1), vc.Fixed(1, 1, 0)
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_it_holds_along_extremals(name):
    order, L, start, end = CASES[name]
    problem = vc.Problem(L, start, end, order=order)
    solution = vc.solve(problem, vc.Collocation(), tol=1e-12)
    own = Lagrangian.of(problem)
    nodes, weights = np.polynomial.legendre.leggauss(40)
    x0, x1 = start.x, end.x
    x = np.concatenate([[x0], x0 + (x1 - x0) * (1 + nodes) / 2, [x1]])
    y, dy = np.atleast_2d(solution.y(x)), np.atleast_2d(solution.dy(x))
    tower = own.derivatives_of_y
    arguments = [own.symbols.x, *tower[: 2 * order]]
    by_x = ca.jacobian(own.expression, own.symbols.x)
    values = [y, dy]
    if order == 2:  # y'' and y''' of the polynomial through what the solution gives
        slope = np.polynomial.Chebyshev.interpolate(solution.dy, 24, (x0, x1))
        values += [slope.deriv(k)(x)[None] for k in (1, 2)]
    function = ca.Function("both", arguments, [own.energy, by_x])
    energy, rate = (np.array(value).ravel() for value in function(x[None], *values))
    gained = (x1 - x0) / 2 * weights @ rate[1:-1]
    assert abs(gained) > 1e-2 * np.abs(energy).max()
    assert energy[-1] - energy[0] == pytest.approx(-gained, abs=1e-9 * np.abs(energy).max())
