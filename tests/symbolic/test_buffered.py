"""Calls of CasADi functions on memory of their own."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from varcalc.symbolic.buffered import Pointwise

X, P = ca.SX.sym("x", 2), ca.SX.sym("p", 0)


@pytest.mark.parametrize("count", [1, 4, 5, 11])
def test_results_stand_side_by_side_with_the_zeros_that_casadi_leaves_out(count):
    value = ca.sin(X[0]) + X[1] ** 3
    hessian, gradient = ca.hessian(value, X)
    assert hessian.nnz() == 2
    rows = Pointwise(ca.Function("f", [X, P], [value, gradient, hessian]), 4)
    points = np.linspace(0.1, 2.0, 2 * count).reshape(count, 2)
    found = rows(count, points, np.zeros((1, 0)))
    a, b = points.T
    nothing = np.zeros(count)
    expected = [np.sin(a) + b**3, np.cos(a), 3 * b**2, -np.sin(a), nothing, nothing, 6 * b]
    np.testing.assert_allclose(found, np.column_stack(expected), rtol=1e-15, atol=0)
    assert rows.occupied.tolist() == [True, True, True, True, False, False, True]


def test_one_row_serves_all_points():
    product = Pointwise(ca.Function("f", [X, ca.SX.sym("q", 2)], [X * 2]), 8)
    found = product(3, np.array([[1.0, 2.0]]), np.zeros((3, 2)))
    assert found.tolist() == [[2.0, 4.0]] * 3
