"""Every CasADi operation that has a heyoka counterpart, against CasADi's own numbers."""

import casadi as ca
import numpy as np
import pytest

from varcalc.integrators import CannotLower, Dop853, Taylor, default
from varcalc.integrators.lowering import lower, scalar_function

hy = pytest.importorskip("heyoka", reason="the Taylor engine is heyoka's")

SMOOTH = (
    "exp",
    "sin",
    "cos",
    "tan",
    "asin",
    "acos",
    "atan",
    "sinh",
    "cosh",
    "tanh",
    "asinh",
    "atanh",
    "erf",
    "expm1",
    "log1p",
)
UNARY = {
    "neg": (lambda x: -x, -2, 2),
    "square": (lambda x: x**2, -2, 2),
    "twice": (lambda x: x + x, -2, 2),
    "inverse": (lambda x: 1 / x, 0.3, 2),
    "abs": (ca.fabs, -2, 2),
    "sign": (ca.sign, -2, 2),
    "not": (lambda x: ca.logic_not(x > 0), -2, 2),
    "cube": (lambda x: x**3, -2, 2),
    "constant power": (lambda x: x**-1.5, 0.3, 2),
    "general power": (lambda x: 1.7**x, -2, 2),
    **{name: (getattr(ca, name), -0.9, 0.9) for name in SMOOTH},
    "log": (ca.log, 0.2, 3),
    "sqrt": (ca.sqrt, 0.2, 3),
    "acosh": (ca.acosh, 1.2, 3),
}
BINARY = {
    "add": lambda x, y: x + y,
    "subtract": lambda x, y: x - y,
    "multiply": lambda x, y: x * y,
    "divide": lambda x, y: x / y,
    "power": lambda x, y: ca.fabs(x) ** y,
    "atan2": ca.atan2,
    "hypot": ca.hypot,
    "less": lambda x, y: x < y,
    "at most": lambda x, y: x <= y,
    "equal": ca.eq,
    "unequal": ca.ne,
    "and": lambda x, y: ca.logic_and(x > 0, y),
    "or": lambda x, y: ca.logic_or(x > 0, y > 0),
    "choice": lambda x, y: ca.if_else(x > y, x * y, ca.sin(x)),
    "choice within a choice": lambda x, y: ca.if_else(
        x > y, ca.if_else(y > 0, x, ca.sqrt(-y)), ca.if_else(x < 0, y, 3)
    ),
    "choices of which none is the other's": lambda x, y: ca.if_else(x > y, x, 0) + ca.if_else(x > 0, y, 0),
    "least": ca.fmin,
    "greatest": ca.fmax,
    "copysign": ca.copysign,
}


def compared(expression: ca.SX, symbols: list[ca.SX], points: np.ndarray) -> None:
    """Assert that heyoka's compiled expression equals CasADi's function at points (inputs, m)."""
    function = ca.Function("f", symbols, [expression])
    names = hy.make_vars(*(f"x{i}" for i in range(len(symbols))))
    names = names if isinstance(names, list) else [names]
    compiled = hy.cfunc(lower(function, [[v] for v in names]), vars=names)
    expected = np.asarray(function(*(row[None, :] for row in points))).ravel()
    np.testing.assert_allclose(compiled(np.ascontiguousarray(points)).ravel(), expected, rtol=1e-13, atol=1e-14)


@pytest.mark.parametrize("name", UNARY)
def test_operation_of_one_argument(name):
    function, low, high = UNARY[name]
    x = ca.SX.sym("x")
    compared(function(x), [x], np.random.default_rng(1).uniform(low, high, (1, 30)))


@pytest.mark.parametrize("name", BINARY)
def test_operation_of_two_arguments(name):
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    points = np.random.default_rng(2).uniform(-2, 2, (2, 30))
    points[1, :3] = points[0, :3]
    compared(BINARY[name](x, y), [x, y], points)


@pytest.mark.parametrize(
    ("expression", "name"),
    [(ca.floor, "floor"), (ca.ceil, "ceil"), (ca.erfinv, "erfinv"), (lambda x: ca.fmod(x, 2), "fmod")],
)
def test_what_has_no_series_is_refused_by_name(expression, name):
    x = ca.SX.sym("x")
    with pytest.raises(CannotLower, match=f"`{name}`.*Dop853"):
        lower(ca.Function("f", [x], [expression(x)]), [[hy.expression("x")]])


def test_interpolated_data_is_refused_and_taken_by_the_other_engine():
    table = ca.interpolant("table", "bspline", [np.linspace(-1, 5, 30)], np.linspace(-1, 5, 30) ** 2)
    s, state, constants = ca.MX.sym("s"), ca.MX.sym("Y"), ca.MX.sym("c", 0)
    system = ca.Function("data", [s, state, constants], [table(state)])
    with pytest.raises(CannotLower, match="Dop853"):
        Taylor().compile(system)
    for engine in (Dop853(), default()):
        run = engine.compile(system).trajectory(np.array([0.0, 0.5]), np.array([1.0]), np.zeros(0))
        assert run.states[-1, 0] == pytest.approx(2.0, abs=1e-9)  # y' = y^2, which a cubic spline reproduces


def test_sparse_outputs_and_free_symbols():
    x, y = ca.SX.sym("x", 2), ca.SX.sym("y")
    sparse = ca.SX(3, 1)
    sparse[1] = x[1] * 2
    out = lower(ca.Function("f", [x], [sparse]), [[hy.expression("a"), hy.expression("b")]])
    assert [str(e) for e in out][::2] == ["0.0000000000000000", "0.0000000000000000"]
    with pytest.raises(CannotLower, match="free symbols: y"):
        lower(ca.Function("f", [x], [y], {"allow_free": True}), [[hy.expression("a"), hy.expression("b")]])


def test_an_mx_function_made_of_formulas_is_expanded():
    x = ca.MX.sym("x")
    assert scalar_function(ca.Function("f", [x], [ca.sin(x)])).is_a("SXFunction")
