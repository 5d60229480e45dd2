"""Text and LaTeX of expressions: what they say, and that they say the same as CasADi's."""

import math
import time
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pytest

from varcalc.problem.conditions import Fixed
from varcalc.problem.lagrangian import Lagrangian
from varcalc.problem.problem import Problem
from varcalc.problem.reading import euler_lagrange_latex, euler_lagrange_text, first_integrals_text, latex, names, text
from varcalc.problem.reading.equations import collected, simplified
from varcalc.problem.reading.reader import EXPANDED, FACTORED, Reader, names_of
from varcalc.problem.reading.sums import Sum

LAGRANGIANS: dict[str, Callable[..., Any]] = {
    "soap film": lambda x, y, dy: y * ca.sqrt(1 + dy**2),
    "brachistochrone": lambda x, y, dy: ca.sqrt((1 + dy**2) / (2 * 9.81 * y)),
    "cube root": lambda x, y, dy: y ** (-1 / 3) * ca.sqrt(1 + dy**2),
    "great circle": lambda x, y, dy: ca.sqrt(1 + ca.sin(x) ** 2 * dy**2),
    "great circle, other way": lambda x, y, dy: ca.sqrt(dy**2 + ca.sin(y) ** 2),
    "fish-eye": lambda x, y, dy: 2 / (1 + x**2 + y**2) * ca.sqrt(1 + dy**2),
    "exponential": lambda x, y, dy: ca.exp(-y) * ca.sqrt(1 + dy**2),
    "linear index": lambda x, y, dy: ca.sqrt(3 - y / 2) * ca.sqrt(1 + dy**2),
    "Bolza": lambda x, y, dy: (1 - dy**2) ** 2 + y**2,
    "pendulum": lambda x, y, dy: dy**2 / 2 + 9.81 * ca.cos(y),
    "mixed": lambda x, y, dy: x * y * dy**3 - ca.log(y) / x + ca.tanh(y * dy) * x**2,
    "quotients": lambda x, y, dy: dy**2 / (1 + y**2) ** 2 + y / (x + y) - (y - x) / (2 * x),
    "branches": lambda x, y, dy: ca.if_else(y > 1, y, 2 * y) * dy**2 + ca.fabs(y - x),
}


def traced(lagrangian: Callable[..., Any], **options: Any) -> Problem:
    return Problem(lagrangian, Fixed(0, 1), Fixed(1, 2), **options)


def evaluated(total: Sum, values: dict[str, float]) -> float:
    """A sum at a point."""

    def power(a: Any, e: Any) -> float:
        if a.bracket is not None:
            base = evaluated(a.bracket, values)
        elif a.arguments:
            arguments = [ca.SX(evaluated(s, values)) for s in a.arguments]
            code = getattr(ca, f"OP_{a.name.upper()}")
            base = float(ca.SX.unary(code, *arguments) if len(arguments) == 1 else ca.SX.binary(code, *arguments))
        else:
            base = values[a.name]
        return base ** (int(e) if e.denominator == 1 else float(e))

    return sum(c * math.prod(power(a, e) for a, e in m) for m, c in total.terms)


POINTS = np.random.default_rng(7).uniform(0.3, 1.6, (12, 4))
SYMBOLS = ("x", "y", "y'", "y''")


@pytest.mark.parametrize("name", LAGRANGIANS)
@pytest.mark.parametrize("reader", [FACTORED, EXPANDED])
def test_what_is_read_has_the_same_value(name: str, reader: Reader) -> None:
    problem = traced(LAGRANGIANS[name])
    lagrangian = Lagrangian.of(problem)
    named = names_of(problem, lagrangian)
    y, dy, ddy = lagrangian.derivatives_of_y[:3]
    for expression in (lagrangian.expression, lagrangian.euler_lagrange, lagrangian.energy):
        function = ca.Function("f", [problem.symbols.x, y, dy, ddy], [expression])
        read = reader.read(expression, named)
        for point in POINTS:
            exact = float(function(*point))
            values = dict(zip(SYMBOLS, point, strict=True))
            assert evaluated(read, values) == pytest.approx(exact, rel=1e-10, abs=1e-10)
            assert evaluated(collected(read), values) == pytest.approx(exact, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("name", [n for n in LAGRANGIANS if n != "branches"])
def test_the_short_equation_has_the_same_solutions(name: str) -> None:
    problem = traced(LAGRANGIANS[name])
    lagrangian = Lagrangian.of(problem)
    y, dy = lagrangian.derivatives_of_y[:2]
    left = simplified(EXPANDED.read(lagrangian.euler_lagrange, names_of(problem, lagrangian)))
    solved = ca.Function("ddy", [problem.symbols.x, y, dy], [lagrangian.highest_derivative()])
    for point in POINTS:
        second = float(solved(*point[:3]))
        on, off = (dict(zip(SYMBOLS, [*point[:3], v], strict=True)) for v in (second, second + 1))
        assert abs(evaluated(left, on)) < 1e-9 * abs(evaluated(left, off))


EQUATIONS = {
    "soap film": "y y'' - y'^2 - 1 = 0",
    "brachistochrone": "2 y y'' + y'^2 + 1 = 0",
    "cube root": "3 y y'' + y'^2 + 1 = 0",
    "exponential": "y'' + y'^2 + 1 = 0",
    "Bolza": "6 y'^2 y'' - 2 y'' - y = 0",
    "great circle": "y'' sin(x) + y'^3 cos(x) sin(x)^2 + 2 y' cos(x) = 0",
}


@pytest.mark.parametrize("name", EQUATIONS)
def test_euler_lagrange_reads_as_a_textbook_has_it(name: str) -> None:
    assert euler_lagrange_text(traced(LAGRANGIANS[name])) == EQUATIONS[name]


def test_names_of_parameters_and_vectors() -> None:
    gravity = traced(
        lambda x, y, dy, p: p.l**2 * dy**2 / 2 + p.omega0**2 * ca.cos(y), parameters={"l": 1.0, "omega0": 2.0}
    )
    assert euler_lagrange_text(gravity) == "l^2 y'' + omega0^2 sin(y) = 0"
    assert euler_lagrange_latex(gravity) == r"l^{2} y'' + \omega_{0}^{2} \sin\left(y\right) = 0"
    assert text(gravity.integrand, names(gravity)) == "l^2 y'^2/2 + omega0^2 cos(y)"
    pair = Problem(lambda x, y, dy: ca.sumsqr(dy) / 2 - y[0] ** 2 * y[1], Fixed(0, [0, 1]), Fixed(1, [1, 1]))
    assert euler_lagrange_text(pair).splitlines() == ["y_1'' + 2 y_1 y_2 = 0", "y_2'' + y_1^2 = 0"]


def test_second_order() -> None:
    beam = traced(lambda x, y, dy, ddy: ddy**2 / 2 - y, order=2)
    assert euler_lagrange_text(beam) == "y'''' - 1 = 0"
    assert first_integrals_text(beam)["energy"] == "y''^2/2 - y' y''' + y"


def test_first_integrals() -> None:
    assert first_integrals_text(traced(LAGRANGIANS["soap film"])) == {"energy": "-y/sqrt(1 + y'^2)"}
    line = first_integrals_text(traced(lambda x, y, dy: ca.sqrt(1 + dy**2)))
    assert line == {"momentum of y": "y'/sqrt(1 + y'^2)", "energy": "-1/sqrt(1 + y'^2)"}
    assert first_integrals_text(traced(LAGRANGIANS["fish-eye"])) == {}


def test_parentheses_signs_and_folded_numbers() -> None:
    y, g = ca.SX.sym("y"), ca.SX.sym("g")
    assert text(-(y - 1) * 2) == "2 (1 - y)"
    assert text(2 * 3 + 0 * y + ca.SX(1) * y) == "6 + y"
    assert text(1 / (1 / y)) == "y"
    assert text(y**-2) == "1/y^2"
    assert text((y + 1) ** 2 / (2 * g)) == "(y + 1)^2/(2 g)"
    assert text(ca.sqrt(-y)) == "sqrt(-y)"
    assert text(ca.SX(0)) == "0"
    assert text(ca.exp(y + g) * y) == "y exp(y + g)"
    assert text(y - y) == "0"


def test_a_root_is_not_split_over_factors_that_may_both_be_negative() -> None:
    a, b = ca.SX.sym("a"), ca.SX.sym("b")
    assert text(ca.sqrt(a * b)) == "sqrt(a b)"
    assert text(ca.sqrt(a**2 * b)) != "a sqrt(b)"


def test_latex_of_fractions_and_roots() -> None:
    fall = traced(lambda x, y, dy, p: ca.sqrt((1 + dy**2) / (2 * p.g * y)), parameters={"g": 9.81})
    assert latex(fall.integrand, names(fall)) == r"\sqrt{\frac{1 + y'^{2}}{2 g y}}"
    assert latex(ca.log(ca.SX.sym("lambda")) / ca.SX.sym("mu_1")) == r"\frac{\ln\left(\lambda\right)}{\mu_{1}}"


def test_interpolated_data_is_written_as_casadi_writes_it() -> None:
    table = ca.interpolant("n", "bspline", [np.linspace(0, 3, 9)], np.linspace(1, 2, 9) ** 2)
    problem = traced(lambda x, y, dy: table(y) * ca.sqrt(1 + dy**2))
    assert euler_lagrange_text(problem).endswith(" = 0")
    assert text(problem.integrand, names(problem))


@pytest.mark.parametrize("formula", [lambda u: u**60, lambda u: u ** ca.SX(300), lambda u: 1 / u ** ca.SX(300)])
def test_high_powers_of_sums_are_not_multiplied_out(formula):
    problem = Problem(lambda x, y, dy: dy**2 / 2 + formula(1 + x + y), Fixed(0, 0), Fixed(1, 1))
    begun = time.process_time()
    equation = euler_lagrange_text(problem)
    assert time.process_time() - begun < 2.0
    assert "(1 + x + y)" in equation
    assert len(equation) < 80


def test_numbers_beyond_all_floats_are_written():
    wall = Problem(lambda x, y, dy: ca.if_else(y < 0, ca.inf, dy**2), Fixed(0, 1), Fixed(1, 1))
    assert "if(y < 0, inf)" in str(wall)
    falling = Problem(lambda x, y, dy: dy**2 / 2 + ca.inf * y, Fixed(0, 1), Fixed(1, 1))
    assert euler_lagrange_latex(falling) == r"\infty - y'' = 0"
    huge = Problem(lambda x, y, dy: dy**2 / 2 + (1e200 * y) ** 2, Fixed(0, 1), Fixed(1, 1))
    assert euler_lagrange_text(huge) == "inf y - y'' = 0"
    steep = Problem(lambda x, y, dy: 1e300 * dy**2 / 2 + y, Fixed(0, 1), Fixed(1, 1))
    assert euler_lagrange_text(steep) == "1e+300 y'' - 1 = 0"
