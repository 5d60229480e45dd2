"""Functions at points: the same by CasADi and by NumPy, for any number of points and every operation."""

import pickle
from concurrent.futures import ThreadPoolExecutor

import casadi as ca
import numpy as np
import pytest

from varcalc.symbolic.evaluation import COLUMN, MOST_POINTS, POINTS_FOR_NUMPY, POINTS_TOGETHER, PointEvaluator
from varcalc.symbolic.instructions import UNARY

X, Y, P = ca.SX.sym("x"), ca.SX.sym("y", 2), ca.SX.sym("p")
UNITS = np.linspace(0.05, 0.95, 7)
EXPRESSIONS = {
    "arithmetic": ca.vertcat(X * Y[0] - Y[1] / (2 + X**2), 3.0, X, Y[0] + P, -Y[1], 2 * X, 1 / (1 + Y[0] ** 2)),
    "functions": ca.vertcat(
        ca.sin(X), ca.cos(Y[0]), ca.sqrt(1 + X**2), ca.exp(Y[1]), ca.atan2(X, Y[0]), (2 + ca.sin(X)) ** 1.7, ca.tanh(P)
    ),
    "branches": ca.vertcat(ca.if_else(Y[0] > X, X**2, Y[1]), ca.fmax(X, P), ca.fabs(Y[0]), ca.sign(Y[1])),
    "derivatives": ca.vec(ca.hessian(ca.sqrt(1 + Y[0] ** 2 * ca.cos(X * Y[1]) ** 2), Y)[0]),
}


@pytest.mark.parametrize("count", [1, 3, POINTS_TOGETHER, POINTS_TOGETHER + 5, POINTS_FOR_NUMPY, COLUMN + 17])
@pytest.mark.parametrize("name", EXPRESSIONS)
def test_any_number_of_points_gives_what_casadi_does(name, count):
    function = ca.Function("f", [X, Y, P], [ca.densify(EXPRESSIONS[name])])
    rng = np.random.default_rng(7)
    x, y, p = rng.normal(size=(count, 1)), rng.normal(size=(count, 2)), np.array([[0.3]])
    expected = np.array(
        [np.asarray(function(*point)).ravel() for point in zip(x, y, np.tile(p, (count, 1)), strict=True)]
    )
    evaluate = PointEvaluator(function)
    for _ in range(
        2 + MOST_POINTS // count if count >= POINTS_FOR_NUMPY else 2
    ):  # before the instructions are read, and after
        found = evaluate(count, x, y, p)
    np.testing.assert_allclose(found, expected, rtol=1e-13, atol=1e-15)


@pytest.mark.parametrize("count", [1, 5, 3 * MOST_POINTS])
def test_results_stand_side_by_side_with_the_zeros_that_casadi_leaves_out(count):
    value = ca.sin(Y[0]) + Y[1] ** 3
    hessian, gradient = ca.hessian(value, Y)
    assert hessian.nnz() == 2
    rows = PointEvaluator(ca.Function("f", [Y, ca.SX.sym("none", 0)], [value, gradient, hessian]))
    points = np.linspace(0.1, 2.0, 2 * count).reshape(count, 2)
    found = rows(count, points, np.zeros((1, 0)))
    a, b = points.T
    nothing = np.zeros(count)
    expected = [np.sin(a) + b**3, np.cos(a), 3 * b**2, -np.sin(a), nothing, nothing, 6 * b]
    np.testing.assert_allclose(found, np.column_stack(expected), rtol=1e-14, atol=1e-15)
    assert rows.occupied.tolist() == [True, True, True, True, False, False, True]


@pytest.mark.parametrize("count", [3, 3 * MOST_POINTS])
def test_one_row_serves_all_points(count):
    product = PointEvaluator(ca.Function("f", [Y, ca.SX.sym("q", 2)], [Y * 2]))
    found = product(count, np.array([[1.0, 2.0]]), np.zeros((count, 2)))
    assert found.tolist() == [[2.0, 4.0]] * count


def test_numbers_of_points_in_any_order():
    square = PointEvaluator(ca.Function("f", [X], [X**2 + ca.sqrt(X) ** 3]))
    for count in [1, 40, 2, 17, 64, 300, 5, 9000, 65, 1]:
        at = np.linspace(1, 2, count)[:, None]
        np.testing.assert_allclose(square(count, at), at**2 + at**1.5, rtol=1e-14)


def test_what_numpy_has_no_form_of_is_left_to_casadi():
    x = ca.MX.sym("x")
    table = ca.interpolant("table", "linear", [[0.0, 1.0, 2.0]], [0.0, 1.0, 4.0])
    evaluate = PointEvaluator(ca.Function("f", [x], [table(x)]))
    at = np.linspace(0, 2, 3 * MOST_POINTS)[:, None]
    np.testing.assert_allclose(evaluate(len(at), at)[:, 0], np.interp(at[:, 0], [0, 1, 2], [0, 1, 4]))
    with pytest.raises(TypeError, match="no SX function"):
        _ = evaluate.columns


def test_threads_do_not_disturb_each_other():
    evaluate = PointEvaluator(ca.Function("f", [X], [ca.exp(ca.sin(X))]))

    def agrees(k):
        at = np.full((10 + k % 3, 1), 0.1 * k)
        return all(np.allclose(evaluate(len(at), at), np.exp(np.sin(at)), rtol=1e-14) for _ in range(50))

    with ThreadPoolExecutor(4) as pool:
        assert all(pool.map(agrees, range(24)))


def test_a_copy_in_another_process_evaluates_too():
    evaluate = pickle.loads(pickle.dumps(PointEvaluator(ca.Function("f", [X], [X**3]))))
    assert evaluate(1, np.array([[2.0]])).tolist() == [[8.0]]


def test_a_bound_call_works_in_place():
    at, found = np.zeros((3, 1)), np.zeros((3, 1))
    call = PointEvaluator(ca.Function("f", [X, ca.SX.sym("none", 0)], [X**2])).bound([at, np.zeros((3, 0))], found)
    at[:, 0] = [1.0, 2.0, 3.0]
    call()
    assert found.ravel().tolist() == [1.0, 4.0, 9.0]


@pytest.mark.parametrize("shape", [(3,), (1, 3), (2, 1)])
def test_a_bound_call_refuses_arrays_of_another_shape(shape):
    evaluate = PointEvaluator(ca.Function("f", [X], [X**2]))
    with pytest.raises(ValueError, match=r"inputs\[0\] has the shape .* must have \(3, 1\)"):
        evaluate.bound([np.zeros(shape)], np.zeros((3, 1)))


def test_every_unary_operation_agrees_with_casadi() -> None:
    for code in UNARY:
        at = 1 / UNITS if code == ca.OP_ACOSH else UNITS
        function = ca.Function("f", [X], [ca.SX.unary(code, X)])
        found = PointEvaluator(function).columns(at)[0]
        assert found == pytest.approx(np.asarray(function(at[None, :])).ravel(), rel=1e-14)


def test_columns_of_several_outputs_and_vectors() -> None:
    function = ca.Function(
        "f",
        [X, Y],
        [ca.if_else(Y[0] < X, ca.atan2(X, Y[1]), ca.fmin(X, Y[1])), ca.vertcat(3, X**2.5, ca.hypot(X, Y[0]))],
    )
    columns = [UNITS, UNITS[::-1] ** 2, UNITS + 1]
    found = PointEvaluator(function).columns(columns[0], columns[1:])
    exact = function(columns[0][None, :], np.array(columns[1:]))
    rows = np.vstack([np.asarray(exact[0]), np.asarray(exact[1])])
    for one, row in zip(found, rows, strict=True):
        assert np.broadcast_to(one, row.shape) == pytest.approx(row, rel=1e-14)


def test_what_is_no_number_is_none_and_says_nothing():
    evaluate = PointEvaluator(ca.Function("f", [X], [ca.vertcat(ca.log(X), ca.sqrt(X), 1 / X)]))
    with np.errstate(all="raise"):
        found = np.array(evaluate.columns(np.array([-1.0, 0.0]))).T
    np.testing.assert_array_equal(found, [[np.nan, np.nan, -1.0], [-np.inf, 0.0, np.inf]])
    np.testing.assert_array_equal(evaluate(2, np.array([[-1.0], [0.0]])), found)


class Counted(ca.Callback):
    """Twice its argument, and how often that was asked for."""

    def __init__(self):
        super().__init__()
        self.count = 0
        self.construct("counted", {})

    def eval(self, arguments):
        self.count += 1
        return [2 * arguments[0]]


def test_what_takes_long_is_evaluated_at_the_points_that_are_wanted_and_no_others():
    function = Counted()
    evaluate = PointEvaluator(function)
    asked = [1, 7, 3, POINTS_TOGETHER, 1, POINTS_TOGETHER + 5, 2]
    for count in asked:
        points = np.arange(float(count))[:, None]
        np.testing.assert_array_equal(evaluate(count, points), 2 * points)
    assert function.count == sum(asked)


def test_a_call_of_a_table_takes_as_long_as_many_instructions():
    table = ca.interpolant("table", "bspline", [np.linspace(-1, 2, 13).tolist()], np.linspace(0, 3, 13).tolist())
    called, written = (PointEvaluator(ca.Function("f", [X], [y])) for y in (sum(table(k * X) for k in range(3)), X**3))
    assert called.usual < 10 < written.usual


@pytest.mark.parametrize("shape", [(50_000, 8), (3, 20_000), (2, 30_000, 2)])
def test_large_arrays_are_taken_part_by_part(shape: tuple[int, ...]) -> None:
    x, y = ca.SX.sym("x"), ca.SX.sym("y", 3)
    function = ca.Function("f", [x, y], [ca.sin(x) * y[0] + ca.exp(y[1]) / y[2], ca.SX(3), x**2])
    rng = np.random.default_rng(1)
    last, large, side = rng.random(shape[-1]), rng.random(shape), rng.random((*shape[:-1], 1))
    found = PointEvaluator(function).columns(last, [large, side, 0.5])
    exact = [np.sin(last) * large + np.exp(side) / 0.5, 3.0, last**2]
    for column, expected in zip(found, exact, strict=True):
        np.testing.assert_array_equal(np.broadcast_to(column, shape), np.broadcast_to(expected, shape))
