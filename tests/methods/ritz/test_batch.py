"""The arithmetic of batches."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import varcalc as vc
from varcalc.formulation.singular import forms
from varcalc.methods.ritz.batch import SEVERAL, Basis, Batch, Places, solutions
from varcalc.methods.ritz.level import Level


@pytest.mark.parametrize("n", [1, 2, SEVERAL, SEVERAL + 1, 9])
def test_matrices_of_quadratic_forms(n):
    end = [None if a == n - 2 else 1.0 for a in range(n)]
    form = forms(vc.Problem(lambda x, y, v: ca.sumsqr(v), vc.Fixed(0, [0.0] * n), vc.Fixed(1, end)))[0]
    basis = Basis.of(form, 6)
    random = np.random.default_rng(0).standard_normal((3, basis.count, 2 * n, 2 * n))
    expected = np.einsum("qki,Kqkl,qlj->Kij", basis.matrix, random, basis.matrix)
    assert basis.assembled(random) == pytest.approx(expected, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("n", [2, 6])
def test_a_level_is_a_batch_of_one(n):
    form = forms(vc.Problem(lambda x, y, v: ca.sqrt(1 + ca.sumsqr(v)) + y[0] ** 4 * y[1] ** 2,
                            vc.Fixed(1, [0.5] * n), vc.Fixed(3.5, [1.0] * n)))[0]  # fmt: skip
    span, start, end, parameters = np.array([form.span]), form.fixed_start, form.fixed_end, np.zeros((1, 0))
    batch, level = Batch(form, 6, Places(span, start, end, parameters)), Level(form, 6)
    level.place(span[0], np.append(start, end), parameters[0])
    z = np.random.default_rng(1).standard_normal(len(batch.basis.free))
    at = batch.evaluate(z[None])
    assert level.evaluate(z) == pytest.approx(at.value[0], rel=1e-13)
    assert level.scale == pytest.approx(at.scale[0], rel=1e-13)
    assert level.legendre() == bool(at.legendre[0] > 0)
    assert level.gradient() == pytest.approx(at.gradient[0], rel=1e-11, abs=1e-11)
    assert level.assembled(level.hessians) == pytest.approx(batch.assembled(at.blocks)[0], rel=1e-11, abs=1e-11)
    assert level.coefficients(z) == pytest.approx(batch.coefficients(z[None])[0])


def test_a_singular_matrix_among_others_gives_no_number():
    matrices = np.array([[[2.0, 0.0], [0.0, 1.0]], [[1.0, 1.0], [1.0, 1.0]]])
    found = solutions(matrices, np.ones((2, 2)))
    np.testing.assert_allclose(found[0], [0.5, 1.0])
    assert np.isnan(found[1]).all()
