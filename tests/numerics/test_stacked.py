"""Linear algebra on stacks of matrices."""

import numpy as np

from varcalc.numerics.stacked import positive, solutions


def test_a_singular_matrix_among_others_gives_no_number():
    matrices = np.array([[[2.0, 0.0], [0.0, 1.0]], [[1.0, 1.0], [1.0, 1.0]]])
    found = solutions(matrices, np.ones((2, 2)))
    np.testing.assert_allclose(found[0], [0.5, 1.0])
    assert np.isnan(found[1]).all()


def test_positive_matrices_among_others():
    matrices = np.array([np.diag([1.0, 2.0]), np.diag([1.0, -1.0]), np.diag([3.0, 1.0])])
    assert positive(matrices).tolist() == [True, False, True]
