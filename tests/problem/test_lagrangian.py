"""The Lagrangian's derivatives against formulas by hand, and its first integrals along exact extremals."""

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pytest

import varcalc as vc

RANDOM = np.random.default_rng(7)
SQUARED = {"a": 2.0, "b": -0.3}


def evaluated(lagrangian: vc.Lagrangian, expression: Any, x: Any, tower: list[Any], parameters: Any = ()) -> np.ndarray:
    """An expression at x for given y, y', y'', ..."""
    symbols = lagrangian.derivatives_of_y[: len(tower)]
    function = ca.Function("f", [lagrangian.symbols.x, *symbols, lagrangian.symbols.parameters], [expression])
    return np.asarray(function(x, *tower, np.array(list(parameters)))).ravel()


def first(function: Callable[..., Any], **options: Any) -> vc.Lagrangian:
    return vc.Lagrangian.of(vc.Problem(function, vc.Fixed(0, 0), vc.Fixed(1, 1), **options))


def test_first_order_by_hand() -> None:
    # L = a x y'^2 + b y^3 y' + sin(x) y^2
    given = first(lambda x, y, dy, p: p.a * x * dy**2 + p.b * y**3 * dy + ca.sin(x) * y**2, parameters=SQUARED)
    a, b = SQUARED.values()
    assert (given.n, given.order) == (1, 1)
    for x, y, v, w in RANDOM.uniform(0.2, 2, (5, 4)):
        tower = [y, v, w]
        momentum, residual = 2 * a * x * v + b * y**3, 2 * np.sin(x) * y - 2 * a * v - 2 * a * x * w
        assert evaluated(given, given.partial(0), x, tower, SQUARED.values()) == pytest.approx(
            3 * b * y**2 * v + 2 * np.sin(x) * y, rel=1e-14
        )
        assert evaluated(given, given.momenta[0], x, tower, SQUARED.values()) == pytest.approx(momentum, rel=1e-14)
        assert evaluated(given, given.euler_lagrange, x, tower, SQUARED.values()) == pytest.approx(
            residual, rel=1e-13, abs=1e-13
        )
        energy = a * x * v**2 - np.sin(x) * y**2
        assert evaluated(given, given.energy, x, tower, SQUARED.values()) == pytest.approx(energy, rel=1e-13, abs=1e-13)
        assert evaluated(given, given.highest_derivative(), x, tower, SQUARED.values()) == pytest.approx(
            (np.sin(x) * y - a * v) / (a * x), rel=1e-13
        )


def test_second_order_by_hand() -> None:
    # L = x y''^2 + y'^2 y + y'' y': L_y = y'^2, L_y' = 2 y y' + y'', L_y'' = 2 x y'' + y'
    problem = vc.Problem(
        lambda x, y, dy, ddy: x * ddy**2 + dy**2 * y + ddy * dy, vc.Fixed(0, 0), vc.Fixed(1, 1), order=2
    )
    given = vc.Lagrangian.of(problem)
    assert (given.n, given.order) == (1, 2)
    for x, *tower in RANDOM.uniform(0.2, 2, (5, 6)):
        y, v, w, j, s = tower
        momentum = 2 * y * v + w - (2 * w + 2 * x * j + w)
        residual = v**2 - (2 * v**2 + 2 * y * w + j) + (2 * j + 2 * j + 2 * x * s + j)
        assert evaluated(given, given.momenta[0], x, tower) == pytest.approx(momentum, rel=1e-13, abs=1e-13)
        assert evaluated(given, given.momenta[1], x, tower) == pytest.approx(2 * x * w + v, rel=1e-14)
        assert evaluated(given, given.euler_lagrange, x, tower) == pytest.approx(residual, rel=1e-13, abs=1e-13)
        energy = v * momentum + w * (2 * x * w + v) - (x * w**2 + v**2 * y + w * v)
        assert evaluated(given, given.energy, x, tower) == pytest.approx(energy, rel=1e-13, abs=1e-12)
        top = -(residual - 2 * x * s) / (2 * x)
        assert evaluated(given, given.highest_derivative(), x, tower) == pytest.approx(top, rel=1e-13, abs=1e-13)


def test_a_vector_by_hand() -> None:
    # L = y1'^2 + y1' y2' + y2'^2 + x y1 y2
    problem = vc.Problem(
        lambda x, y, dy: dy[0] ** 2 + dy[0] * dy[1] + dy[1] ** 2 + x * y[0] * y[1], vc.Fixed(0, (0, 0)), vc.Free(1, n=2)
    )
    given = vc.Lagrangian.of(problem)
    assert given.n == 2
    matrix = np.array([[2, 1], [1, 2]])
    for row in RANDOM.uniform(0.2, 2, (5, 7)):
        x, y, v, w = row[0], row[1:3], row[3:5], row[5:7]
        assert evaluated(given, given.momenta[0], x, [y, v, w]) == pytest.approx(matrix @ v, rel=1e-14)
        residual = x * y[::-1] - matrix @ w
        assert evaluated(given, given.euler_lagrange, x, [y, v, w]) == pytest.approx(residual, rel=1e-13, abs=1e-13)
        energy = v @ matrix @ v / 2 - x * y[0] * y[1]
        assert evaluated(given, given.energy, x, [y, v, w]) == pytest.approx(energy, rel=1e-13, abs=1e-13)
        solved = np.linalg.solve(matrix, x * y[::-1])
        assert evaluated(given, given.highest_derivative(), x, [y, v]) == pytest.approx(solved, rel=1e-13)


def test_second_order_vector() -> None:
    # L = |y''|^2 / 2 + y1' y2: y1'''' = y2', y2'''' = -y1'
    problem = vc.Problem(
        lambda x, y, dy, ddy: ca.sumsqr(ddy) / 2 + dy[0] * y[1], vc.Fixed(0, (0, 0)), vc.Fixed(1, (1, 1)), order=2
    )
    given = vc.Lagrangian.of(problem)
    tower = [RANDOM.uniform(-1, 1, 2) for _ in range(4)]
    assert evaluated(given, given.highest_derivative(), 0.3, tower) == pytest.approx([tower[1][1], -tower[1][0]])


@pytest.mark.parametrize(
    ("lagrangian", "of_x", "of_y"),
    [
        (lambda x, y, dy: ca.sqrt(1 + dy**2), True, (0,)),
        (lambda x, y, dy: y * ca.sqrt(1 + dy**2), True, ()),
        (lambda x, y, dy: dy**2 / x, False, (0,)),
        (lambda x, y, dy: x * y + dy**2, False, ()),
    ],
)
def test_ignorable_coordinates(lagrangian: Callable[..., Any], of_x: bool, of_y: tuple[int, ...]) -> None:
    given = first(lagrangian)
    assert given.ignorable_abscissa is of_x
    assert given.ignorable == of_y


def test_ignorable_components() -> None:
    problem = vc.Problem(lambda x, y, dy: ca.sumsqr(dy) + y[1] ** 2, vc.Fixed(0, (0, 0, 0)), vc.Fixed(1, (1, 1, 1)))
    assert vc.Lagrangian.of(problem).ignorable == (0, 2)


def test_energy_along_a_catenary() -> None:
    given = first(lambda x, y, dy: y * ca.sqrt(1 + dy**2))
    c, b = 0.7, 0.2
    for x in np.linspace(-1, 1, 9):
        h = (x - b) / c
        tower = [c * np.cosh(h), np.sinh(h), np.cosh(h) / c]
        assert evaluated(given, given.euler_lagrange, x, tower) == pytest.approx(0, abs=1e-14)
        # y' L_y' - L = -y / sqrt(1 + y'^2)
        assert evaluated(given, given.energy, x, tower) == pytest.approx(-c, rel=1e-13)
        assert evaluated(given, given.highest_derivative(), x, tower[:2]) == pytest.approx(tower[2], rel=1e-13)


def test_energy_along_a_cycloid() -> None:
    given = first(lambda x, y, dy: ca.sqrt((1 + dy**2) / y))
    r = 0.6
    for angle in np.linspace(0.3, 6, 9):
        y = r * (1 - np.cos(angle))
        tower = [y, np.sin(angle) / (1 - np.cos(angle)), -r / y**2]
        assert evaluated(given, given.euler_lagrange, 0.0, tower) == pytest.approx(0, abs=1e-11)
        assert evaluated(given, given.energy, 0.0, tower) == pytest.approx(-1 / np.sqrt(2 * r), rel=1e-13)


def test_momentum_along_a_ray() -> None:
    # index 1/x: circles about the axis, where the momentum y' / (x sqrt(1 + y'^2)) is 1/R
    given = first(lambda x, y, dy: ca.sqrt(1 + dy**2) / (x + 1e-300))
    radius = 2.0
    for x in np.linspace(0.2, 1.8, 7):
        y = -np.sqrt(radius**2 - x**2)
        tower = [y, -x / y, -(radius**2) / y**3]
        assert evaluated(given, given.momenta[0], x, tower) == pytest.approx(1 / radius, rel=1e-14)
        assert evaluated(given, given.euler_lagrange, x, tower) == pytest.approx(0, abs=1e-13)


def test_energy_and_momentum_of_second_order_extremals() -> None:
    # y''^2 / 2 + y'^2 / 2: y = A + B x + C cosh x + D sinh x, momentum y' - y''' = B, energy (B^2 + D^2 - C^2) / 2
    problem = vc.Problem(lambda x, y, dy, ddy: ddy**2 / 2 + dy**2 / 2, vc.Fixed(0, 0), vc.Fixed(1, 1), order=2)
    given = vc.Lagrangian.of(problem)
    assert given.ignorable_abscissa
    assert given.ignorable == (0,)
    A, B, C, D = 0.3, -0.8, 0.5, 1.2
    energies = []
    for x in np.linspace(0, 2, 7):
        c, s = np.cosh(x), np.sinh(x)
        tower = [A + B * x + C * c + D * s, B + C * s + D * c, C * c + D * s, C * s + D * c, C * c + D * s]
        assert evaluated(given, given.euler_lagrange, x, tower) == pytest.approx(0, abs=1e-13)
        assert evaluated(given, given.momenta[0], x, tower) == pytest.approx(B, rel=1e-13)
        energies.append(float(evaluated(given, given.energy, x, tower)[0]))
    assert energies == pytest.approx([(B**2 + C**2 - D**2) / 2] * 7, rel=1e-12)


def test_pointwise_has_values_gradients_and_hessians() -> None:
    given = first(lambda x, y, dy: x * y**2 * dy**3)
    x, y, v = 1.3, 0.7, -0.4
    rows = np.asarray(given.pointwise([given.symbols.y * given.symbols.dy])(x, y, v, [], [], [])).ravel()
    L = [x * y**2 * v**3, 2 * x * y * v**3, 3 * x * y**2 * v**2]
    L += [2 * x * v**3, 6 * x * y * v**2, 6 * x * y * v**2, 6 * x * y**2 * v]
    assert rows == pytest.approx([*L, y * v, v, y, 0, 1, 1, 0], rel=1e-14)


def test_a_lagrangian_is_not_negated_when_it_is_maximised() -> None:
    given = first(lambda x, y, dy: dy**2, maximise=True)
    assert evaluated(given, given.momenta[0], 0.0, [0.0, 3.0]) == pytest.approx(6)
