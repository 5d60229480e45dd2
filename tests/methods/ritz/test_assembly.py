"""Matrices of pointwise quadratic forms."""

import numpy as np
import pytest

from varcalc.methods.ritz.system import SEVERAL, assembly
from varcalc.numerics.mesh import Space


@pytest.mark.parametrize("n", [1, 2, SEVERAL, SEVERAL + 1, 9])
@pytest.mark.parametrize("order", [1, 2])
def test_matrices_of_quadratic_forms(n, order):
    space = Space(np.array([-1.0, 1.0]), 6, n, order)
    own = assembly(space, order, 11, np.array([0, space.size - n]), 0)
    random = np.random.default_rng(0).standard_normal((3, 11, own.k, own.k))
    expected = np.einsum("qki,Kqkl,qlj->Kij", own.matrix, random, own.matrix)
    assert own.matrices(random) == pytest.approx(expected, rel=1e-12, abs=1e-11)
