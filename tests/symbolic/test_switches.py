"""What is read of an expression: where it is not smooth, what it is on one side, and what it can be over a box."""

import casadi as ca
import numpy as np
import pytest

from varcalc.symbolic.intervals import enclosures
from varcalc.symbolic.switches import held, smoothed, switches

X, Y, V = (ca.SX.sym(name) for name in "xyv")


def read(expression):
    return {(s.word, str(s.argument), s.jumps) for s in switches([expression], [X, Y, V])}


def test_every_operation_that_switches_is_read_with_what_it_switches_on():
    assert read(ca.fabs(V) + V**2) == {("fabs", "v", False)}
    assert read(ca.if_else(Y > 0.4, 1.5, 1) * ca.sqrt(1 + V**2)) == {("<", "(0.4-y)", True)}
    assert read(ca.fabs(ca.sqrt(Y - 5)) + ca.fmax(ca.sqrt(Y - 5), 0)) == {("fmax", "sqrt((y-5))", False)}
    assert read(ca.fabs(X - Y) + ca.sign(Y - X)) == {("sign", "(y-x)", True)}
    assert read(ca.fmax(Y, 0.5) + ca.sign(X - Y)) == {("fmax", "(y-0.5)", False), ("sign", "(x-y)", True)}
    assert read(ca.if_else(ca.logic_and(X > 0.25, X < 0.75), 1, 2) * V) == {
        ("<", "(0.25-x)", True), ("<", "(x-0.75)", True),
    }  # fmt: skip
    assert read(ca.sin(X) * ca.sqrt(1 + V**2) / Y) == set()


def test_what_switches_on_a_table_is_read_with_the_table():
    knots = np.linspace(0, 3, 7)
    table = ca.interpolant("table", "bspline", [knots], np.cos(knots))
    (found,) = switches([ca.fabs(Y - table(X))], [X, Y, V])
    place = ca.Function("place", [X, Y], [found.argument])
    assert float(place(1.3, 2.0)) == pytest.approx(2 - float(table(1.3)), abs=1e-15)
    assert read(held([ca.fabs(Y - table(X)) + V**2], [X, Y, V], [1.3, 2.0, 0.0])[0]) == set()


def test_what_switches_together_is_one_switch_and_a_jump_if_one_of_them_is():
    assert read(ca.fabs(X - Y) + ca.fabs(Y - X)) == {("fabs", "(x-y)", False)}
    assert {jumps for _, _, jumps in read(ca.fabs(Y) + ca.sign(Y))} == {True}


def test_floors_switch_at_whole_numbers():
    (switch,) = switches([ca.floor(3 * X) * V**2], [X, Y, V])
    assert switch.stepped


def test_an_expression_of_another_kind_has_nothing_to_be_read():
    assert switches([ca.fabs(ca.MX.sym("x"))], []) == ()


EXPRESSIONS = {
    "branches": ca.if_else(Y > X, Y**2, 3 * X) + ca.fmin(X, V) * ca.fmax(Y, 0.2) - ca.sign(V),
    "steps": ca.floor(4 * X) + ca.ceil(2 * Y) * ca.fabs(V - 0.3),
    "remainders": ca.fmod(3 * X, 1) + ca.remainder(2 * Y, 1) - ca.copysign(V, Y - 0.1) + ca.fmod(-5 * Y, 0.7),
    "logic": ca.if_else(ca.logic_or(X > Y, V < 0), ca.sqrt(1 + V**2), ca.exp(-Y)),
    "smooth": X * Y + ca.sin(3 * V) / (1 + X**2),
}


@pytest.mark.parametrize("name", EXPRESSIONS)
def test_an_expression_held_at_a_point_is_itself_there_and_smooth(name):
    rng = np.random.default_rng(1)
    whole = ca.Function("whole", [X, Y, V], [EXPRESSIONS[name]])
    for point in rng.uniform(-1.5, 1.5, (40, 3)):
        (side,) = held([EXPRESSIONS[name]], [X, Y, V], point)
        assert switches([side], [X, Y, V]) == ()
        assert float(ca.Function("side", [X, Y, V], [side])(*point)) == pytest.approx(float(whole(*point)), abs=1e-14)


@pytest.mark.parametrize("name", ["branches", "steps", "remainders", "logic"])
def test_what_is_rounded_off_comes_to_the_expression_as_the_width_goes_to_zero(name):
    whole = ca.Function("whole", [X, Y, V], [EXPRESSIONS[name]])
    point = (0.31, 0.33, 0.04)
    misses = []
    for width in (1e-1, 1e-3, 1e-8):
        (soft,) = smoothed([EXPRESSIONS[name]], [X, Y, V], [width] * 9)
        misses.append(abs(float(ca.Function("soft", [X, Y, V], [soft])(*point)) - float(whole(*point))))
    assert misses[0] > misses[1] >= misses[2]
    assert misses[2] < 1e-6


def test_a_width_whose_square_is_beyond_all_floats_is_one():
    (soft,) = smoothed([ca.fabs(X)], [X, Y, V], [1e200])
    assert np.isinf(float(ca.Function("soft", [X, Y, V], [soft])(0.5, 0.0, 0.0)))


BOXED = {
    **EXPRESSIONS,
    "powers": (X + 2) ** -1.5 + (Y - 0.3) ** 3 + (V + 0.1) ** -2 + (Y + 2) ** V,
    "functions": ca.cosh(X - Y) * ca.tanh(V) + ca.atan(X) * ca.cos(7 * Y) + ca.log(3 + V) * ca.acos(X / 3),
    "inverse trigonometric": ca.asin(Y / 2) + ca.asinh(V) + ca.atanh(X / 2) + ca.erf(V) + ca.log1p(Y + 1.6),
}


@pytest.mark.parametrize("name", BOXED)
def test_an_enclosure_holds_every_value_over_the_box(name):
    rng = np.random.default_rng(2)
    function = ca.Function("f", [X, Y, V], [BOXED[name]])
    low = rng.uniform(-1.5, 1.0, (3, 200))
    high = low + rng.uniform(0, 0.5, low.shape)
    ((least, greatest),) = enclosures(function, [[(a, b)] for a, b in zip(low, high, strict=True)])[0]
    for share in rng.random((30, 3, 200)):
        values = np.asarray(function(*(row[None] for row in low + share * (high - low)))).ravel()
        known = np.isfinite(values)
        room = 1e-12 * (1 + np.abs(values[known]))
        assert np.all(np.broadcast_to(least, known.shape)[known] <= values[known] + room)
        assert np.all(values[known] <= np.broadcast_to(greatest, known.shape)[known] + room)


def test_an_operation_without_a_rule_encloses_everything():
    function = ca.Function("f", [X], [ca.erfinv(X)])
    ((least, greatest),) = enclosures(function, [[(np.zeros(1), np.ones(1))]])[0]
    assert (least, greatest) == (-np.inf, np.inf)


def test_a_choice_is_enclosed_by_its_branches_and_no_sum_of_them():
    inner = ca.if_else(X > 0.2, Y, 3)
    for expression, low, high in (
        (ca.if_else(X > 0.5, 1.5, 1), 1, 1.5),
        (ca.if_else(ca.logic_and(X > 0.25, X < 0.75), -2, -1), -2, -1),
        (ca.if_else(X > 0.5, inner, 5) * 2, 2, 10),
    ):
        ((found,),) = enclosures(ca.Function("f", [X, Y], [expression]), [[(0.0, 1.0)], [(1.0, 2.0)]])
        assert tuple(map(float, found)) == (low, high)
    ((sure,),) = enclosures(ca.Function("f", [X, Y], [inner]), [[(0.3, 1.0)], [(1.0, 2.0)]])
    assert tuple(map(float, sure)) == (1, 2)
