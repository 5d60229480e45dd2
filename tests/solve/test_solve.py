"""solve: answers in any unit, multipliers and sensitivities, and what is refused."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import casadi as ca
import mpmath
import numpy as np
import pytest
from scipy.optimize import brentq

import varcalc as vc
from varcalc.solution import Stats, no_answer
from varcalc.solve import ladder
from varcalc.solve.ladder import _compared

UNITS = [1e7, 1e-7]


def area(x: Any, y: Any, dy: Any) -> Any:
    return y * ca.sqrt(1 + dy**2)


def arc_length(x: Any, y: Any, dy: Any) -> Any:
    return ca.sqrt(1 + dy**2)


def quickest(x: Any, y: Any, dy: Any) -> Any:
    return ca.sqrt((1 + dy**2) / y)


def oscillator(x: Any, y: Any, dy: Any) -> Any:
    return dy**2 - y**2


def film(half: float, unit: float = 1.0) -> vc.Problem:
    return vc.Problem(area, vc.Fixed(-half * unit, unit), vc.Fixed(half * unit, unit))


def chain(length: float, unit: float = 1.0) -> vc.Problem:
    return vc.Problem(
        area, vc.Fixed(0, 0), vc.Fixed(unit, 0), [vc.Isoperimetric(arc_length, length * unit)], name="chain"
    )


def chain_parameter(length: float) -> float:
    """c of the catenary of a chain over a unit span: 2 c sinh(1 / (2 c)) = length."""
    return brentq(lambda c: 2 * c * math.sinh(0.5 / c) - length, 0.05, 50, xtol=1e-16)


def chain_energy(length: float) -> float:
    c = chain_parameter(length)
    h = 0.5 / c
    return -(c**2) * (math.sinh(2 * h) - 2 * h) / 2


def film_area(half: float) -> float:
    """The stable catenary c cosh(x / c) through (half, 1): the larger c."""
    c = brentq(lambda c: c * math.cosh(half / c) - 1, half / 1.19968, 1, xtol=1e-16)
    return c * half + c**2 * math.sinh(2 * half / c) / 2


def beam(unit: float) -> vc.Problem:
    return vc.Problem(
        lambda x, y, dy, ddy, p: ddy**2 / 2 - p.w * y,
        vc.Fixed(0, 0, 0),
        vc.Fixed(unit, 0, 0),
        order=2,
        parameters={"w": 3 / unit**3},
    )


def spheroid(unit: float) -> vc.Problem:
    """Along a meridian and across it, latitude as the abscissa; ``unit`` is the equatorial radius."""

    def length(x: Any, y: Any, dy: Any, p: Any) -> Any:
        square = 1 - 0.3 * ca.sin(x) ** 2
        return p.a * ca.sqrt((0.7 / square**1.5) ** 2 + ca.cos(x) ** 2 / square * dy**2)

    return vc.Problem(length, vc.Fixed(-0.5, 0), vc.Fixed(0.8, 0.7), parameters={"a": unit})


@pytest.mark.parametrize(
    ("problem", "power", "position"),
    [
        (lambda u: vc.Problem(quickest, vc.Fixed(0, 0), vc.Fixed(u, u)), 0.5, (0.4, 1)),
        (lambda u: film(0.5, u), 2, (0.3, 1)),
        (lambda u: chain(1.5, u), 2, (0.3, 1)),
        (spheroid, 1, (0.3, 0)),
        (beam, -1, (0.3, 1)),
    ],
    ids=["brachistochrone", "soap film", "chain", "spheroid", "beam"],
)
@pytest.mark.parametrize("unit", UNITS)
def test_the_same_digits_in_any_unit(
    problem: Callable[[float], vc.Problem], power: float, position: tuple[float, int], unit: float
) -> None:
    one, other = vc.solve(problem(1.0)), vc.solve(problem(unit))
    x, scaled = position
    assert other.status is vc.Status.SOLVED
    assert other.value / unit**power == pytest.approx(one.value, rel=1e-12)
    assert other.error.value / unit**power < 1e-12 * abs(one.value)
    lengths = unit**scaled
    assert other.y(x * lengths) / lengths == pytest.approx(one.y(x), rel=1e-7)


@pytest.mark.parametrize("unit", [1.0, *UNITS])
def test_the_values_in_any_unit_are_right(unit: float) -> None:
    # clamped beam: -w^2 L^5 / 1440
    assert vc.solve(beam(unit)).value == pytest.approx(-9 / (1440 * unit), rel=1e-12)
    assert vc.solve(film(0.5, unit)).value == pytest.approx(film_area(0.5) * unit**2, rel=1e-12)
    assert vc.solve(chain(1.5, unit)).value == pytest.approx(chain_energy(1.5) * unit**2, rel=1e-12)


# what the arguments do


def test_a_refusal_is_raised_or_returned() -> None:
    # a chain shorter than its span
    with pytest.raises(vc.InfeasibleError, match=r"constraints\[0\] .* asks for 0.9") as caught:
        vc.solve(chain(0.9))
    assert isinstance(caught.value, vc.VariationalError)
    assert isinstance(caught.value, ValueError)
    assert caught.value.verdict is vc.Verdict.INFEASIBLE
    returned = vc.solve(chain(0.9), throw=False)
    assert (returned.status, returned.verdict) == (caught.value.status, caught.value.verdict)
    assert returned.status is vc.Status.REFUSED
    assert str(caught.value) == returned.message
    assert math.isnan(returned.value)
    assert caught.value.solution.message == returned.message


def test_a_solution_without_a_curve_says_why() -> None:
    returned = vc.solve(film(0.8), vc.FirstIntegral(), throw=False)
    assert returned.curve is None
    with pytest.raises(ValueError, match="there is no curve to evaluate"):
        returned.y(0.0)
    with pytest.raises(ValueError, match="guess is a Solution that holds no curve"):
        vc.solve(film(0.5), guess=returned)


@pytest.mark.parametrize(
    ("arguments", "options", "error", "message"),
    [
        ((arc_length,), {}, TypeError, "problem must be a Problem or a Curve"),
        ((film(0.5), "Ritz"), {}, TypeError, "method must be a method object such as"),
        ((film(0.5), vc.Ritz), {}, TypeError, r"write Ritz\(\)"),
        ((film(0.5),), {"tol": 0.0}, ValueError, "tol must be a positive number, not 0.0"),
        ((film(0.5),), {"tol": -1e-6}, ValueError, "tol must be a positive number"),
        ((film(0.5),), {"tol": math.nan}, ValueError, "tol must be a positive number"),
        ((film(0.5),), {"tol": "fine"}, ValueError, "tol must be a positive number"),
        ((film(0.5),), {"guess": 3.0}, TypeError, "guess must be a function of x or a Solution, not 3.0"),
        ((film(0.5),), {"guess": lambda x: (1.0, 2.0)}, ValueError, "guess must return 1 number at each x, not 2"),
        ((film(0.5),), {"guess": lambda x, y: x}, TypeError, "guess must accept 1 argument here"),
        ((film(0.5),), {"guess": lambda x: math.nan}, ValueError, "guess is not a finite number at -0.46875"),
        ((film(0.5),), {"guess": lambda x: "high"}, TypeError, "guess must return numbers at each x, not 'high'"),
        ((film(0.5),), {"tol": True}, ValueError, "tol must be a positive number, not True"),
        ((film(0.5),), {"tolerance": 1e-8}, TypeError, "tolerance"),
    ],
)
def test_unusable_arguments(arguments: tuple[Any, ...], options: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        vc.solve(*arguments, **options)


@pytest.mark.parametrize(
    ("wrong", "error", "message"),
    [
        ({"elements": 0}, ValueError, "must be at least 1"),
        ({"degree": 0}, ValueError, "must be at least 1"),
        ({"degree": 2.5}, TypeError, "must be a whole number"),
        ({"starts": 0}, ValueError, "must be at least 1"),
    ],
)
def test_a_mesh_that_cannot_be(wrong: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=rf"Ritz\.{next(iter(wrong))} {message}"):
        vc.Ritz(**wrong)
    with pytest.raises(TypeError, match="grid"):
        vc.Ritz(grid=3)  # type: ignore[call-arg]


def test_a_guess_is_a_function_or_a_solution() -> None:
    exact = film_area(0.6)
    cold = vc.solve(film(0.6))
    c = brentq(lambda c: c * math.cosh(0.6 / c) - 1, 0.5, 1, xtol=1e-16)
    warm = vc.solve(film(0.6), guess=lambda x: c * math.cosh(x / c))
    again = vc.solve(film(0.6), guess=cold)
    for solution in (cold, warm, again):
        assert solution.value == pytest.approx(exact, rel=1e-12)
    assert again.stats.iterations < cold.stats.iterations
    assert warm.stats.iterations < cold.stats.iterations


def test_a_guess_of_another_kind_of_problem_is_refused() -> None:
    pair = vc.Problem(lambda x, y, dy: ca.sumsqr(dy), vc.Fixed(-0.5, (0, 0)), vc.Fixed(0.5, (1, 1)))
    wider = vc.Problem(lambda x, y, dy: dy**2, vc.Fixed(-0.5, 0), vc.Fixed(1.5, 1))
    curve = vc.Curve(lambda q, dq: ca.norm_2(dq), vc.At((0, 0)), vc.At((3, 4)))
    for other, message in (
        (pair, "guess is a Solution with 2 unknown functions and the problem has 1; give a function"),
        (wider, "guess is a Solution from -0.5 to 1.5 and the problem goes from -0.5 to 0.5"),
        (curve, "guess is a Solution of a Curve and the problem is a Problem"),
    ):
        with pytest.raises(ValueError, match=message):
            vc.solve(film(0.5), guess=vc.solve(other))


def test_a_guess_that_is_nowhere_a_number_is_refused() -> None:
    solution = vc.solve(film(0.5))
    broken = replace(solution, curve=lambda x, derivative: np.full((1, len(x)), math.nan), extremal=None)
    with pytest.raises(ValueError, match=r"guess is not a finite number at -0\.46875"):
        vc.solve(film(0.5), guess=broken)


def test_a_solution_is_taken_over_in_its_own_coordinates(monkeypatch: pytest.MonkeyPatch) -> None:
    fall = vc.Problem(
        lambda x, y, dy, p: ca.sqrt((1 + dy**2) / (2 * p.g * y)), vc.Fixed(0, 0), vc.Fixed(1, 1), parameters={"g": 9.81}
    )
    earth = vc.solve(fall)

    def inverted(*_: Any) -> Any:
        raise AssertionError("inverting x(s) costs more than the solve it is done for")

    monkeypatch.setattr("varcalc.methods.answer._abscissae_to_s", inverted)
    moon = vc.solve(fall.with_parameters({"g": 1.62}), guess=earth)
    assert moon.value == pytest.approx(earth.value * math.sqrt(9.81 / 1.62), rel=1e-12)
    assert moon.stats.iterations < earth.stats.iterations


def test_a_guess_in_other_coordinates_is_pulled_there() -> None:
    quadratic = vc.solve(vc.Problem(lambda x, y, dy: dy**2, vc.Fixed(0, 0), vc.Fixed(1, 1)))
    fall = vc.solve(vc.Problem(quickest, vc.Fixed(0, 0), vc.Fixed(1, 1)), guess=quadratic)
    back = vc.solve(vc.Problem(lambda x, y, dy: dy**2, vc.Fixed(0, 0), vc.Fixed(1, 1)), guess=fall)
    assert fall.value == pytest.approx(math.sqrt(2 * 9.81) * 0.582895463154743, rel=1e-12)
    assert back.value == pytest.approx(1.0, rel=1e-14)


def test_a_guess_may_slide_to_other_abscissae() -> None:
    def to_line(at: float) -> vc.Problem:
        return vc.Problem(
            lambda x, y, dy: ca.sqrt(1 + dy**2), vc.Fixed(0, 0), vc.OnCurve(lambda x, y: x + y - at, at / 3)
        )

    assert vc.solve(to_line(2), guess=vc.solve(to_line(1))).value == pytest.approx(math.sqrt(2), rel=1e-12)


def test_a_guess_for_several_functions() -> None:
    problem = vc.Problem(lambda x, y, dy: ca.sumsqr(dy) + ca.sumsqr(y), vc.Fixed(0, (0, 1)), vc.Fixed(1, (1, 0)))
    solution = vc.solve(problem, guess=lambda x: (x, 1 - x))
    # sinh x / sinh 1 and its mirror image: each gives coth 1
    assert solution.value == pytest.approx(2 / math.tanh(1), rel=1e-12)


def test_the_shapes_of_values() -> None:
    scalar = vc.solve(film(0.5))
    assert isinstance(scalar.y(0.1), float)
    assert isinstance(scalar.dy(0.1), float)
    assert scalar.y([0.1, 0.2, 0.3]).shape == (3,)
    assert scalar.dy(np.zeros((2, 3))).shape == (2, 3)
    vector = vc.solve(vc.Problem(lambda x, y, dy: ca.sumsqr(dy), vc.Fixed(0, (0, 1)), vc.Fixed(1, (1, 3))))
    assert vector.y(0.5) == pytest.approx([0.5, 2])
    assert vector.dy(np.zeros((2, 3))).shape == (2, 2, 3)
    one = vc.solve(vc.Problem(lambda x, y, dy: ca.sumsqr(dy), vc.Fixed(0, (0,)), vc.Fixed(1, (1,))))
    assert one.y(0.5).shape == (1,)
    curve = vc.solve(vc.Curve(lambda q, dq: ca.norm_2(dq), vc.At((0, 0)), vc.At((3, 4))))
    assert curve.q(0.5) == pytest.approx([1.5, 2])
    assert curve.q(np.zeros((2, 3))).shape == (2, 2, 3)
    assert curve.dq(0.2) == pytest.approx([3, 4])


def test_maximise() -> None:
    # y'' = -1: y = x (1 - x) / 2, and the value is half the integral of y
    problem = vc.Problem(lambda x, y, dy: -(dy**2) / 2 + y, vc.Fixed(0, 0), vc.Fixed(1, 0), maximise=True)
    solution = vc.solve(problem)
    assert solution.value == pytest.approx(1 / 24, rel=1e-12)
    assert solution.y(0.5) == pytest.approx(1 / 8, rel=1e-10)
    with pytest.raises(vc.VariationalError):
        vc.solve(vc.Problem(lambda x, y, dy: dy**2, vc.Fixed(0, 0), vc.Fixed(1, 1), maximise=True))


def test_a_tolerance_below_round_off() -> None:
    solution = vc.solve(film(0.5), tol=1e-18)
    assert solution.status is vc.Status.ROUND_OFF
    assert abs(solution.value - film_area(0.5)) < 1e-14
    assert 0 < solution.error.value < 1e-14


def test_a_refused_problem_stays_refused_at_any_tolerance() -> None:
    assert not vc.solve(film(0.8), tol=1e3, throw=False).status.ok
    assert not vc.solve(chain(0.9), tol=1e3, throw=False).status.ok


def test_with_a_fixed_mesh_the_value_comes_with_its_error() -> None:
    solution = vc.solve(film(0.5), vc.Ritz(elements=2, degree=3, refine=False))
    assert solution.status is vc.Status.SOLVED
    error = solution.value - film_area(0.5)
    assert 1e-9 < error < 1e-2  # an upper bound, and no more
    assert error / 10 < solution.error.value < 100 * error


# multipliers and sensitivities against closed forms and differences


def test_the_multiplier_of_the_chain() -> None:
    # U'(length) = -k, where the catenary is c cosh((x - 1/2) / c) + k: the tension times its height
    solution = vc.solve(chain(1.5))
    c = chain_parameter(1.5)
    assert solution.multipliers == (pytest.approx(-c * math.cosh(0.5 / c), rel=1e-9),)
    step = 1e-3
    values = [vc.solve(chain(1.5 + k * step)).value for k in (-2, -1, 1, 2)]
    slope = (values[0] - 8 * values[1] + 8 * values[2] - values[3]) / (12 * step)
    assert solution.multipliers[0] == pytest.approx(slope, rel=1e-8)


def test_the_multiplier_of_a_maximum() -> None:
    # the largest area under an arc of given length over a unit chord: dA/dlength is the radius of the circle
    def dido(length: float) -> vc.Problem:
        return vc.Problem(
            lambda x, y, dy: y,
            vc.Fixed(0, 0),
            vc.Fixed(1, 0),
            [vc.Isoperimetric(arc_length, length)],
            maximise=True,
        )

    length = 1.2
    half = brentq(lambda a: a / math.sin(a) - length, 0.1, 1.5, xtol=1e-16)
    radius = 0.5 / math.sin(half)
    solution = vc.solve(dido(length))
    assert solution.value == pytest.approx(radius**2 * (half - math.sin(half) * math.cos(half)), rel=1e-10)
    assert solution.multipliers[0] == pytest.approx(radius, rel=1e-7)


def test_multipliers_of_two_levels() -> None:
    # int y'^2 with int y = a and int x y = b given: a quadratic form in (a, b)
    def problem(a: float, b: float) -> vc.Problem:
        levels = [vc.Isoperimetric(lambda x, y, dy: y, a), vc.Isoperimetric(lambda x, y, dy: x * y, b)]
        return vc.Problem(lambda x, y, dy: dy**2, vc.Fixed(0, 0), vc.Fixed(1, 0), levels)

    solution = vc.solve(problem(1.0, 0.7))
    step = 0.1  # exact for a quadratic value
    first = (vc.solve(problem(1 + step, 0.7)).value - vc.solve(problem(1 - step, 0.7)).value) / (2 * step)
    second = (vc.solve(problem(1, 0.7 + step)).value - vc.solve(problem(1, 0.7 - step)).value) / (2 * step)
    assert solution.multipliers == (pytest.approx(first, rel=1e-9), pytest.approx(second, rel=1e-9))
    # Euler: a form of degree two
    assert solution.multipliers[0] + 0.7 * solution.multipliers[1] == pytest.approx(2 * solution.value, rel=1e-10)


def test_a_level_between_bounds() -> None:
    def problem(**levels: float) -> vc.Problem:
        return vc.Problem(
            lambda x, y, dy: dy**2, vc.Fixed(0, 0), vc.Fixed(1, 0), [vc.Isoperimetric(lambda x, y, dy: y, **levels)]
        )

    # int y'^2 >= 12 a^2 for the area a: dJ/da = 24 a
    active = vc.solve(problem(lower=0.5, upper=2))
    assert active.value == pytest.approx(3, rel=1e-9)
    assert active.multipliers[0] == pytest.approx(12, rel=1e-6)
    idle = vc.solve(problem(lower=-1, upper=2))
    assert idle.value == pytest.approx(0, abs=1e-10)
    assert idle.multipliers[0] == pytest.approx(0, abs=1e-6)


def test_sensitivities_to_parameters() -> None:
    # int k y'^2 + m y^2, from 0 to 1: J = sqrt(k m) coth sqrt(m / k)
    def exact(k: float, m: float) -> float:
        return math.sqrt(k * m) / math.tanh(math.sqrt(m / k))

    problem = vc.Problem(
        lambda x, y, dy, p: p.k * dy**2 + p.m * y**2,
        vc.Fixed(0, 0),
        vc.Fixed(1, 1),
        parameters={"k": 2.0, "m": 3.0},
    )
    solution = vc.solve(problem, tol=1e-12)
    assert solution.value == pytest.approx(exact(2, 3), rel=1e-12)
    assert set(solution.sensitivities) == {"k", "m"}
    step = 1e-3
    for name, at in (("k", 2.0), ("m", 3.0)):
        values = [vc.solve(problem.with_parameters({name: at + s * step})).value for s in (-2, -1, 1, 2)]
        slope = (values[0] - 8 * values[1] + 8 * values[2] - values[3]) / (12 * step)
        assert solution.sensitivities[name] == pytest.approx(slope, rel=1e-9)
    # homogeneous of degree one in (k, m)
    assert 2 * solution.sensitivities["k"] + 3 * solution.sensitivities["m"] == pytest.approx(solution.value)


def test_sensitivities_see_constraints_and_end_costs() -> None:
    problem = vc.Problem(
        lambda x, y, dy, p: dy**2,
        vc.Fixed(0, 0),
        vc.Free(1),
        [vc.Isoperimetric(lambda x, y, dy, p: p.w * y, 1.0)],
        parameters={"w": 2.0, "s": 1.5},
        end_cost=lambda x0, y0, x1, y1, p: p.s * (y1 - 1) ** 2,
    )
    solution = vc.solve(problem)
    for name, at in problem.parameters.items():
        step = 1e-3
        values = [vc.solve(problem.with_parameters({name: at + s * step})).value for s in (-2, -1, 1, 2)]
        slope = (values[0] - 8 * values[1] + 8 * values[2] - values[3]) / (12 * step)
        assert solution.sensitivities[name] == pytest.approx(slope, rel=1e-8)
        assert abs(slope) > 1e-2


def test_sensitivities_of_a_maximum() -> None:
    problem = vc.Problem(
        lambda x, y, dy, p: -(dy**2) / 2 + p.w * y, vc.Fixed(0, 0), vc.Fixed(1, 0), maximise=True, parameters={"w": 3.0}
    )
    # w^2 / 24
    assert vc.solve(problem).sensitivities["w"] == pytest.approx(3 / 12, rel=1e-12)


def test_unknowns_are_optimised_with_the_curve() -> None:
    problem = vc.Problem(
        lambda x, y, dy, p: (dy - p.k) ** 2 + p.c * p.k**2,
        vc.Fixed(0, 0),
        vc.Fixed(1, 1),
        parameters={"c": 3.0},
        unknowns={"k": -5.0},
    )
    solution = vc.solve(problem)
    # y = x, (1 - k)^2 + c k^2 least at k = 1 / (1 + c), c / (1 + c) there
    assert solution.unknowns == {"k": pytest.approx(0.25, abs=1e-9)}
    assert solution.value == pytest.approx(0.75, rel=1e-12)
    assert solution.sensitivities["c"] == pytest.approx(1 / 16, rel=1e-9)


def test_the_multiplier_of_a_holonomic_constraint() -> None:
    # two functions held together, y1 = y2, of int |y'|^2 / 2 - f(x) y1: the reaction is f/2
    problem = vc.Problem(
        lambda x, y, dy: ca.sumsqr(dy) / 2 - ca.sin(x) * y[0],
        vc.Fixed(0, (0, 0)),
        vc.Fixed(1, (0, 0)),
        [vc.Holonomic(lambda x, y: y[0] - y[1])],
    )
    solution = vc.solve(problem)
    x = np.linspace(0.1, 0.9, 9)
    # y1'' + f = mu and y2'' = -mu in the Lagrangian function L + mu phi, up to its sign: y'' = -f / 2
    assert solution.y(x)[0] == pytest.approx((np.sin(x) - x * math.sin(1)) / 2, abs=1e-7)
    assert solution.multipliers[0](x) == pytest.approx(np.sin(x) / 2, abs=1e-3)
    assert isinstance(solution.multipliers[0](0.5), float)


def membrane(depth: float) -> vc.Problem:
    """A membrane under the load 8 over a floor at depth f, touched from sqrt(f)/2 on: J = 16/3 f^(3/2) - 8 f."""
    return vc.Problem(
        lambda x, y, dy, p: dy**2 / 2 + 8 * y,
        vc.Fixed(0, 0),
        vc.Fixed(1, 0),
        [vc.Bound(lambda x, y, dy, p: y + p.depth, lower=0)],
        parameters={"depth": depth},
    )


def test_a_bound_that_is_touched() -> None:
    solution = vc.solve(membrane(0.25), tol=1e-6)
    assert solution.value == pytest.approx(16 / 3 * 0.25**1.5 - 2, abs=1e-6)
    assert solution.y(0.125) == pytest.approx(4 / 64 - 0.25, abs=1e-3)
    assert solution.y(0.5) == pytest.approx(-0.25, abs=1e-6)


def test_the_multiplier_of_a_bound() -> None:
    # the floor bears the whole load where it is touched, nothing elsewhere: y'' = 8 + mu
    solution = vc.solve(membrane(0.25), tol=1e-6)
    middle, free = (np.mean(solution.multipliers[0](np.linspace(a, b, 201))) for a, b in ((0.3, 0.7), (0.02, 0.2)))
    assert middle == pytest.approx(-8, rel=0.05)
    assert free == pytest.approx(0, abs=0.2)
    assert solution.sensitivities["depth"] == pytest.approx(8 * math.sqrt(0.25) - 8, rel=0.05)


# what has no answer


@pytest.mark.parametrize(("lowered", "local"), [(0.1, True), (0.0, False), (-0.1, False)])
@pytest.mark.parametrize("maximise", [False, True])
def test_a_better_value_met_on_the_way_makes_an_answer_local(lowered: float, local: bool, maximise: bool) -> None:
    sign = -1 if maximise else 1
    found = vc.solve(vc.Problem(lambda x, y, dy: sign * dy**2, vc.Fixed(0, 0), vc.Fixed(1, 1), maximise=maximise))
    assert (found.local, found.lower) == (False, None)
    better = replace(found, value=found.value - sign * lowered)
    compared = _compared(found, better)
    assert compared.local is local
    assert compared.lower == (better.value if local else None)


def test_a_chain_as_long_as_its_span() -> None:
    with pytest.raises(vc.VariationalError, match="only the extreme curve is admissible") as caught:
        vc.solve(chain(1.0))
    assert caught.value.verdict is vc.Verdict.DEGENERATE
    assert not isinstance(caught.value, vc.InfeasibleError)


def fold() -> float:
    """Half the distance of unit rings beyond which there is no film: h / cosh h with h tanh h = 1."""
    h = brentq(lambda h: h * math.tanh(h) - 1, 1, 1.5, xtol=1e-16)
    return h / math.cosh(h)


@pytest.mark.parametrize("method", [None, vc.Ritz(), vc.Ritz(optimiser=vc.Ipopt()), vc.Collocation()])
@pytest.mark.parametrize("beyond", [1e-9, 1e-8])
def test_a_soap_film_beyond_the_fold(beyond: float, method: object) -> None:
    # so near to the fold the area of the film that is no more is all but stationary, to 14 digits of it
    solution = vc.solve(film(fold() + beyond), method, throw=False)
    assert not solution.status.ok


@pytest.mark.parametrize("before", [1e-9, 1e-8, 1e-4, 1e-2])
def test_a_soap_film_before_the_fold(before: float) -> None:
    half = fold() - before
    assert vc.solve(film(half)).value == pytest.approx(film_area(half), abs=1e-10)


@pytest.mark.parametrize("end", [(4.0, 0.0), (4.0, 1.0), (math.pi, 1.0)])
def test_an_oscillator_beyond_its_conjugate_point(end: tuple[float, float]) -> None:
    assert not vc.solve(vc.Problem(oscillator, vc.Fixed(0, 0), vc.Fixed(*end)), throw=False).status.ok


def test_an_oscillator_up_to_its_conjugate_point() -> None:
    # y = c sin x for every c
    assert not vc.solve(vc.Problem(oscillator, vc.Fixed(0, 0), vc.Fixed(math.pi, 0)), throw=False).status.ok


def test_an_oscillator_before_its_conjugate_point() -> None:
    solution = vc.solve(vc.Problem(oscillator, vc.Fixed(0, 0), vc.Fixed(3, 1)))
    assert solution.value == pytest.approx(1 / math.tan(3), rel=1e-11)


@pytest.mark.parametrize("end", [(1, 0), (1, 0.5)])
def test_a_functional_whose_infimum_is_not_attained(end: tuple[float, float]) -> None:
    # Bolza's: broken lines of slope +-1 come as low as one likes and never there
    problem = vc.Problem(lambda x, y, dy: (dy**2 - 1) ** 2 + y**2, vc.Fixed(0, 0), vc.Fixed(*end))
    assert not vc.solve(problem, throw=False).status.ok


def linear_between(start: float, end: float) -> vc.Problem:
    return vc.Problem(lambda x, y, dy: y**2 + x * y * dy, vc.Fixed(0, start), vc.Fixed(1, end))


@pytest.mark.parametrize("ends", [(0, 0), (0, 1)])
def test_a_lagrangian_linear_in_the_slope_is_called_singular(ends: tuple[float, float]) -> None:
    solution = vc.solve(linear_between(*ends), throw=False)
    assert (solution.status, solution.verdict) == (vc.Status.REFUSED, vc.Verdict.SINGULAR)


def test_a_total_derivative_fixes_no_curve() -> None:
    solution = vc.solve(vc.Problem(lambda x, y, dy: y * dy, vc.Fixed(0, 0), vc.Fixed(1, 1)), throw=False)
    assert solution.verdict is vc.Verdict.SINGULAR


def test_a_lagrangian_that_overflows_for_steep_slopes():
    """L = e^y' + y: e^y' = x + c, and c follows from the ends; warnings are errors here."""
    with mpmath.workdps(30):
        c = mpmath.findroot(lambda c: (1 + c) * mpmath.log(1 + c) - c * mpmath.log(c) - 2, 2.0)
        y = lambda x: (x + c) * mpmath.log(x + c) - c * mpmath.log(c) - x  # noqa: E731
        exact = float(mpmath.quad(lambda x: x + c + y(x), [0, 1]))
    solution = vc.solve(vc.Problem(lambda x, y, dy: ca.exp(dy) + y, vc.Fixed(0, 0), vc.Fixed(1, 1)), tol=1e-10)
    assert abs(solution.value - exact) <= solution.error.value + 1e-15


def test_a_pole_between_the_ends_is_refused():
    """u = log|y - 1/2| would have to pass through infinity; warnings are errors here."""
    problem = vc.Problem(lambda x, y, dy: dy**2 / (y - 0.5) ** 2, vc.Fixed(0, 0), vc.Fixed(1, 1))
    with pytest.raises(vc.VariationalError):
        vc.solve(problem)


@pytest.mark.parametrize(
    "step", [lambda u: 1 / (1 + ca.exp(-u)), lambda u: 1 / ca.cosh(u) ** 2], ids=["logistic", "sech^2"]
)
@pytest.mark.parametrize("ends", [(0, 0.2), ([0, 0], [0.2, 0.1])])
def test_derivatives_that_overflow_are_the_reason_and_no_lack_of_extremals(step, ends):
    """The chord is the minimum: the step lies beyond it, and makes no number of the derivatives of L there."""
    first = lambda y: y if isinstance(ends[0], int) else y[0]  # noqa: E731
    found = vc.solve(
        vc.Problem(
            lambda x, y, v: ca.sumsqr(v) / 2 - step((first(y) - 0.7) / 1e-4),
            vc.Fixed(0, ends[0]), vc.Fixed(10, ends[1]),
        ),
        throw=False,
    )  # fmt: skip
    assert found.status.ok or (found.verdict is None and "its derivatives are not" in found.message)


def test_where_every_curve_costs_infinitely_much_there_is_no_answer_and_no_warning():
    found = vc.solve(vc.Problem(lambda x, y, v: math.inf * v**2, vc.Fixed(0, 0), vc.Fixed(1, 1)), throw=False)
    assert not found.status.ok
    assert found.message


@pytest.mark.parametrize(("left", "asked"), [(False, [2]), (True, [2, 12])])
def test_a_climb_is_done_again_only_where_starting_curves_were_left(
    left: bool, asked: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    starts = []

    def failing(method: vc.Ritz, form: Any, tol: float, start: object) -> vc.Solution:
        starts.append(method.starts)
        return no_answer(form.problem, method, vc.Status.NOT_CONVERGED, "none", stats=Stats(more_starts=left))

    monkeypatch.setattr(ladder, "_in_form", failing)
    floor = vc.Bound(lambda x, y, dy: y, lower=-1)
    ladder._attempt(vc.Problem(oscillator, vc.Fixed(0, 0), vc.Fixed(1, 1), [floor]), vc.Ritz(), 1e-10, None)
    assert starts == asked


def test_it_is_told_whether_starting_curves_were_left() -> None:
    solved = vc.solve(vc.Problem(oscillator, vc.Fixed(0, 0), vc.Fixed(1, 1)))
    assert not solved.stats.more_starts
    beyond = vc.Problem(oscillator, vc.Fixed(0, 0), vc.Fixed(4, 1))
    assert vc.solve(beyond, vc.Ritz(starts=1), throw=False).stats.more_starts


def test_a_functional_without_the_slope_is_least_where_its_integrand_is():
    solution = vc.solve(vc.Problem(lambda x, y, v: y**2 + x * y, vc.Free(0), vc.Free(1)))
    assert solution.value == pytest.approx(-1 / 12, abs=1e-14)
    assert vc.verify(solution).verdict is vc.Verdict.MINIMUM
    logarithm = vc.solve(vc.Problem(lambda x, y, v: ca.exp(y) - x * y, vc.Free(1), vc.Free(2)))
    x = np.linspace(1, 2, 9)
    assert np.ravel(logarithm.y(x)) == pytest.approx(np.log(x), abs=1e-7)
    assert vc.verify(logarithm).verdict is vc.Verdict.MINIMUM
    with pytest.raises(vc.VariationalError, match="does not contain the slope"):
        vc.solve(vc.Problem(lambda x, y, v: (y**2 - 1) ** 2 + (x - 0.5) * y, vc.Free(0), vc.Free(1)))


def test_marks_of_another_valley_are_abscissae_where_an_end_slides() -> None:
    # the shortest way from the origin to x + y = 4 ends at (2, 2), far from where the end is guessed
    problem = vc.Problem(arc_length, vc.Fixed(0, 0), vc.OnCurve(lambda x, y: x + y - 4, 1.0))
    known = vc.solve(problem)
    again = ladder._beside(1e-10, known)(vc.Ritz(starts=1), np.atleast_2d, (0.7, 1.6))
    assert again.value == pytest.approx(2 * math.sqrt(2), abs=1e-12)
    assert again.interval == pytest.approx((0.0, 2.0), abs=1e-7)
    assert again.extremal.vertices == pytest.approx([0.0, 0.35, 0.8, 1.0], abs=1e-7)


@pytest.mark.parametrize(("error", "known"), [(1e-8, True), (1e-5, False)])
def test_what_is_known_under_bounds_to_fewer_digits_is_an_answer_with_its_own_claim(error: float, known: bool) -> None:
    floor = vc.Bound(lambda x, y, dy: y, lower=-0.5)
    problem = vc.Problem(lambda x, y, dy: dy**2 / 2 + 8 * y, vc.Fixed(0, 0), vc.Fixed(1, 0), [floor])
    solved = vc.solve(problem, tol=1e-8)
    failure = replace(
        solved, status=vc.Status.NOT_CONVERGED, error=replace(solved.error, value=error, curve=1e-6), message="stopped"
    )
    found = ladder._short_of_tolerance([failure, replace(failure, error=replace(failure.error, value=1.0))], 1e-10)
    assert (found is not None) == known
    if found is not None:
        assert found.status is vc.Status.ROUND_OFF
        assert found.error.value == error
        assert not found.message
