"""Instructions carried out in other algebras."""

import casadi as ca
import numpy as np
import pytest

from varcalc.symbolic.instructions import in_numbers, interpret, operate

X, Y = ca.SX.sym("x"), ca.SX.sym("y", 2)


def test_interpretation_in_another_algebra() -> None:
    function = ca.Function("f", [X, Y], [X * Y[1] + ca.sin(Y[0]) * 2])
    counts = interpret(function, [[1], [1, 1]], lambda _: 0, lambda _, operands: sum(operands))
    assert counts == [[3]]


def test_only_sx_functions_have_scalar_instructions() -> None:
    x = ca.MX.sym("x")
    with pytest.raises(TypeError, match="no SX function"):
        interpret(ca.Function("f", [x], [ca.sin(x)]), [[1]], float, lambda *_: 1)


KNOTS = np.linspace(0, 3, 7)
TABLE = ca.interpolant("table", "bspline", [KNOTS, KNOTS], np.add.outer(KNOTS**3, KNOTS**2).ravel(order="F"))
"""x^3 + y^2, which cubic splines hold exactly."""


def of_table():
    """fabs(y - table) and its derivatives, which call the table's own with two results."""
    whole = ca.sin(X) + ca.fabs(Y[0] - TABLE(ca.vertcat(X, Y[1])))
    return ca.Function("f", [X, Y], [whole, ca.gradient(whole, Y)])


def test_functions_that_are_no_formulas_are_called_again() -> None:
    function = of_table()
    results = interpret(function, [[X], Y.nonzeros()], ca.SX, operate)
    again = ca.Function("again", [X, Y], [ca.vertcat(*r) for r in results])
    for found, given in zip(again(1.2, [0.5, 1.7]), function(1.2, [0.5, 1.7]), strict=True):
        np.testing.assert_allclose(found, given, rtol=1e-15)


def test_functions_that_are_no_formulas_are_carried_out_in_numbers() -> None:
    values = np.linspace(0.5, 2.5, 5)
    (whole,), slopes = interpret(
        of_table(), [[values], [values, values]], np.float64, lambda operation, given: in_numbers(operation)(*given)
    )
    np.testing.assert_allclose(whole, np.sin(values) + np.abs(values - values**3 - values**2), rtol=1e-13)
    np.testing.assert_allclose(slopes[1], -2 * values * np.sign(values - values**3 - values**2), rtol=1e-13)
