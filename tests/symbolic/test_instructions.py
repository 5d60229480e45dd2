"""Instructions carried out in other algebras."""

import casadi as ca
import pytest

from varcalc.symbolic.instructions import interpret

X, Y = ca.SX.sym("x"), ca.SX.sym("y", 2)


def test_interpretation_in_another_algebra() -> None:
    function = ca.Function("f", [X, Y], [X * Y[1] + ca.sin(Y[0]) * 2])
    counts = interpret(function, [[1], [1, 1]], lambda _: 0, lambda _, operands: sum(operands))
    assert counts == [[3]]


def test_only_sx_functions_have_scalar_instructions() -> None:
    x = ca.MX.sym("x")
    with pytest.raises(TypeError, match="no SX function"):
        interpret(ca.Function("f", [x], [ca.sin(x)]), [[1]], float, lambda *_: 1)
