"""Instructions carried out on arrays and on other objects."""

import casadi as ca
import numpy as np
import pytest

from varcalc.symbolic.instructions import UNARY, Vectorised, interpret

X, Y = ca.SX.sym("x"), ca.SX.sym("y", 2)
UNITS = np.linspace(0.05, 0.95, 7)


def test_every_unary_operation_agrees_with_casadi() -> None:
    for code in UNARY:
        at = 1 / UNITS if code == ca.OP_ACOSH else UNITS
        function = ca.Function("f", [X], [ca.SX.unary(code, X)])
        assert Vectorised(function)(at)[0] == pytest.approx(np.asarray(function(at[None, :])).ravel(), rel=1e-14)


def test_several_outputs_and_vectors() -> None:
    function = ca.Function(
        "f",
        [X, Y],
        [ca.if_else(Y[0] < X, ca.atan2(X, Y[1]), ca.fmin(X, Y[1])), ca.vertcat(3, X**2.5, ca.hypot(X, Y[0]))],
    )
    columns = [UNITS, UNITS[::-1] ** 2, UNITS + 1]
    found = Vectorised(function)(columns[0], columns[1:])
    exact = function(columns[0][None, :], np.array(columns[1:]))
    rows = np.vstack([np.asarray(exact[0]), np.asarray(exact[1])])
    for one, row in zip(found, rows, strict=True):
        assert np.broadcast_to(one, row.shape) == pytest.approx(row, rel=1e-14)


def test_overflow_is_silent() -> None:
    function = Vectorised(ca.Function("f", [X], [1 / X, ca.log(X)]))
    assert function(np.array([0.0, 1.0]))[0].tolist() == [np.inf, 1.0]
    assert np.isnan(function(np.array([-1.0]))[1][0])


def test_interpretation_in_another_algebra() -> None:
    function = ca.Function("f", [X, Y], [X * Y[1] + ca.sin(Y[0]) * 2])
    counts = interpret(function, [[1], [1, 1]], lambda _: 0, lambda _, operands: sum(operands))
    assert counts == [[3]]


def test_only_sx_functions_have_scalar_instructions() -> None:
    x = ca.MX.sym("x")
    with pytest.raises(TypeError, match="no SX function"):
        Vectorised(ca.Function("f", [x], [ca.sin(x)]))
