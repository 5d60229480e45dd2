"""Functions on columns of points: what CasADi's interpreter finds, for every operation that NumPy has."""

import casadi as ca
import numpy as np
import pytest

from varcalc.symbolic.buffered import Pointwise
from varcalc.symbolic.columns import MANY, ROWS, SOME, Columns, FewOrMany

X, Y, P = ca.SX.sym("x"), ca.SX.sym("y", 2), ca.SX.sym("p")
EXPRESSIONS = {
    "arithmetic": ca.vertcat(X * Y[0] - Y[1] / (2 + X**2), 3.0, X, Y[0] + P, -Y[1], 2 * X, 1 / (1 + Y[0] ** 2)),
    "functions": ca.vertcat(
        ca.sin(X), ca.cos(Y[0]), ca.sqrt(1 + X**2), ca.exp(Y[1]), ca.atan2(X, Y[0]), (2 + ca.sin(X)) ** 1.7, ca.tanh(P)
    ),
    "branches": ca.vertcat(ca.if_else(Y[0] > X, X**2, Y[1]), ca.fmax(X, P), ca.fabs(Y[0]), ca.sign(Y[1])),
    "derivatives": ca.vec(ca.hessian(ca.sqrt(1 + Y[0] ** 2 * ca.cos(X * Y[1]) ** 2), Y)[0]),
}


@pytest.mark.parametrize("count", [1, SOME, ROWS, 2 * ROWS + 17])
@pytest.mark.parametrize("name", EXPRESSIONS)
def test_the_same_as_point_by_point(name, count):
    function = ca.Function("f", [X, Y, P], [ca.densify(EXPRESSIONS[name])])
    rng = np.random.default_rng(7)
    x, y, p = rng.normal(size=(count, 1)), rng.normal(size=(count, 2)), np.array([[0.3]])
    expected = Pointwise(function)(count, x, y, p)
    np.testing.assert_allclose(Columns(function)(count, x, y, p), expected, rtol=1e-13, atol=1e-15)
    np.testing.assert_allclose(FewOrMany(function)(count, x, y, p), expected, rtol=1e-13, atol=1e-15)


def test_what_is_no_number_is_none_and_says_nothing():
    function = ca.Function("f", [X], [ca.vertcat(ca.log(X), ca.sqrt(X), 1 / X)])
    with np.errstate(all="raise"):
        found = Columns(function)(2, np.array([[-1.0], [0.0]]))
    np.testing.assert_array_equal(found, [[np.nan, np.nan, -1.0], [-np.inf, 0.0, np.inf]])


def test_what_numpy_has_no_form_of_is_left_to_casadi():
    x = ca.MX.sym("x")
    table = ca.interpolant("table", "linear", [[0.0, 1.0, 2.0]], [0.0, 1.0, 4.0])
    function = ca.Function("f", [x], [table(x)])
    with pytest.raises(TypeError, match="no SX function"):
        Columns(function)
    at = np.linspace(0, 2, 2 * MANY)[:, None]
    np.testing.assert_allclose(FewOrMany(function)(len(at), at)[:, 0], np.interp(at[:, 0], [0, 1, 2], [0, 1, 4]))
