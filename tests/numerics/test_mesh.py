"""Gauss rules, the hierarchical basis, and spaces of piecewise polynomials."""

import math
from functools import partial

import mpmath
import numpy as np
import pytest
from numpy.polynomial import legendre

from varcalc.numerics.mesh import Space, basis, basis_at_gauss, gauss, lobatto

POINTS = np.linspace(-1, 1, 23)
MESH = np.array([-1.0, -0.2, 0.5, 2.0])


def polynomial(degree: int, n: int = 1) -> np.ndarray:
    """Coefficients, ascending, of ``n`` polynomials; shape (degree + 1, n)."""
    return np.cos(np.arange(1.0, (degree + 1) * n + 1)).reshape(degree + 1, n)


def value(coefficients: np.ndarray, x: np.ndarray, derivative: int = 0) -> np.ndarray:
    """The derivative of the polynomials at x (m,); shape (n, m)."""
    return np.polynomial.polynomial.polyval(x, np.polynomial.polynomial.polyder(coefficients, derivative))


@pytest.mark.parametrize("count", [1, 2, 5, 12, 40])
def test_gauss_is_exact_up_to_twice_its_number_of_points(count: int) -> None:
    nodes, weights = gauss(count)
    for power in range(2 * count):
        exact = 0.0 if power % 2 else 2 / (power + 1)
        assert weights @ nodes**power == pytest.approx(exact, abs=1e-14)
    # and no further: the monic Legendre polynomial squared is missed wholly
    missed = 2.0 / (2 * count + 1) * (2**count * math.factorial(count) ** 2 / math.factorial(2 * count)) ** 2
    assert 2 / (2 * count + 1) - weights @ nodes ** (2 * count) == pytest.approx(missed, abs=1e-14)


def test_lobatto_nodes() -> None:
    assert lobatto(1) == pytest.approx([-1, 1], abs=0)
    assert lobatto(2) == pytest.approx([-1, 0, 1], abs=1e-16)
    assert lobatto(4) == pytest.approx([-1, -math.sqrt(3 / 7), 0, math.sqrt(3 / 7), 1], abs=1e-15)
    for degree in (7, 12, 32):
        nodes = lobatto(degree)
        assert len(nodes) == degree + 1
        assert np.all(np.diff(nodes) > 0)
        derivative = legendre.legder([0.0] * degree + [1.0])
        assert np.abs(legendre.legval(nodes[1:-1], derivative)).max() < 1e-11 * degree**2


@pytest.mark.parametrize("count", [17, 40, 61])
def test_gauss_is_right_to_round_off_next_to_the_ends_too(count: int) -> None:
    nodes, weights = gauss(count)
    extended = np.finfo(np.longdouble).eps < np.finfo(float).eps  # not on every machine
    with mpmath.workdps(40):
        for node, weight in zip(nodes[:3], weights[:3], strict=False):
            x = mpmath.findroot(partial(mpmath.legendre, count), mpmath.mpf(float(node)))
            slope = count * (mpmath.legendre(count - 1, x) - x * mpmath.legendre(count, x)) / (1 - x**2)
            assert abs(node - x) <= 1.2e-16
            assert abs(weight * (1 - x**2) * slope**2 / 2 - 1) <= (4e-16 if extended else 4e-12)


@pytest.mark.parametrize("smoothness", [1, 2])
@pytest.mark.parametrize("degree", [3, 4, 7, 11])
def test_the_derivatives_of_the_basis(smoothness: int, degree: int) -> None:
    # through degree + 1 values each function is a known polynomial, whose derivative is exact
    nodes = lobatto(degree)
    exact = np.linalg.solve(legendre.legvander(nodes, degree), basis(smoothness, degree, nodes, 0)[0])
    table = basis(smoothness, degree, POINTS, smoothness)
    for d in range(smoothness + 1):
        expected = legendre.legval(POINTS, legendre.legder(exact, d)).T if d else legendre.legval(POINTS, exact).T
        assert table[d] == pytest.approx(expected, abs=1e-11)


@pytest.mark.parametrize("smoothness", [1, 2])
def test_partition_of_unity_and_vertex_values(smoothness: int) -> None:
    m, degree = smoothness, 8
    table = basis(m, degree, np.array([-1.0, 1.0]), m)
    for d in range(m):
        # each vertex function carries one derivative at one vertex; bubbles carry none
        expected = np.zeros((2, degree + 1))
        expected[0, d] = expected[1, m + d] = 1.0
        assert table[d] == pytest.approx(expected, abs=1e-14)
    inner = basis(m, degree, POINTS, 1)
    assert inner[0][:, 0] + inner[0][:, m] == pytest.approx(np.ones(len(POINTS)), abs=1e-14)
    assert inner[1][:, 0] + inner[1][:, m] == pytest.approx(np.zeros(len(POINTS)), abs=1e-14)


@pytest.mark.parametrize("smoothness", [1, 2])
@pytest.mark.parametrize("degree", [4, 9, 32])
def test_the_highest_derivatives_of_bubbles_are_orthonormal(smoothness: int, degree: int) -> None:
    table = basis_at_gauss(smoothness, degree, degree + 2, smoothness)[smoothness][:, 2 * smoothness :]
    gram = (table * gauss(degree + 2)[1][:, None]).T @ table
    assert gram == pytest.approx(np.eye(degree + 1 - 2 * smoothness), abs=1e-12)


def test_bubbles_keep_their_relative_accuracy_close_to_a_vertex() -> None:
    # psi_2 = sqrt(5/2) (s^2 - 1) s / 2 at s = -1 + h: h small, computed by 1 + s
    h = 2.0**-40
    found = basis(1, 3, np.array([-1 + h]), 0)[0][0, 3]
    assert found == pytest.approx(math.sqrt(2.5) / 2 * (h - 1) * h * (h - 2), rel=1e-14)


def test_the_kept_table_cannot_be_spoilt() -> None:
    with pytest.raises(ValueError, match="read-only"):
        basis_at_gauss(1, 3, 4, 1)[0, 0, 0] = 7.0


def test_a_degree_too_low_is_refused() -> None:
    with pytest.raises(ValueError, match="degree must be at least 3 here, not 2"):
        Space(MESH, 2, smoothness=2)


@pytest.mark.parametrize("smoothness", [1, 2])
@pytest.mark.parametrize("n", [1, 3])
def test_polynomials_are_reproduced(smoothness: int, n: int) -> None:
    degree = 6
    space = Space(MESH, degree, n, smoothness)
    exact = polynomial(degree, n)
    coefficients = space.fit(lambda x: value(exact, x))
    x = np.linspace(-1, 2, 31)
    for d in range(smoothness + 1):
        assert space.evaluate(coefficients, x, d) == pytest.approx(value(exact, x, d), abs=1e-10)
    assert space.evaluate(coefficients, np.array([-1.3, 2.4])) == pytest.approx(
        value(exact, np.array([-1.3, 2.4])), abs=1e-9
    )
    at, weights = space.quadrature(9)
    for d, found in enumerate(space.at_quadrature(coefficients, 9, smoothness)):
        assert found.shape == (3, 9, n)
        by_row = found.reshape(-1, n).T
        assert by_row == pytest.approx(value(exact, at.ravel(), d), abs=1e-10)
    primitive = np.polynomial.polynomial.polyint(exact)
    integral = np.einsum("eq,eqa->a", weights, space.at_quadrature(coefficients, 9, 0)[0])
    assert integral == pytest.approx(value(primitive, np.array([2.0]))[:, 0] - value(primitive, np.array([-1.0]))[:, 0])


@pytest.mark.parametrize("smoothness", [1, 2])
def test_functions_are_continuous_with_their_derivatives(smoothness: int) -> None:
    space = Space(MESH, 5, 2, smoothness)
    assert space.size == 2 * (4 * smoothness + 3 * (6 - 2 * smoothness))
    coefficients = np.sin(np.arange(1.0, space.size + 1))
    jumps = jumps_at(space, coefficients, 0.5, smoothness)
    assert jumps[:smoothness] == pytest.approx(np.zeros(smoothness), abs=1e-11)
    assert jumps[smoothness] > 1e-2


def jumps_at(space: Space, coefficients: np.ndarray, vertex: float, highest: int) -> np.ndarray:
    """The largest jump of each derivative up to ``highest`` between the polynomials that meet at an inner vertex."""
    index = int(np.searchsorted(space.vertices, vertex))
    local = space.local(coefficients)
    jumps = []
    for d in range(highest + 1):
        left = basis(space.smoothness, space.degree, np.array([1.0]), d)[d][0] @ local[index - 1]
        right = basis(space.smoothness, space.degree, np.array([-1.0]), d)[d][0] @ local[index]
        scales = (2 / space.widths[index - 1]) ** d, (2 / space.widths[index]) ** d
        jumps.append(float(np.abs(left * scales[0] - right * scales[1]).max()))
    return np.array(jumps)


def test_a_broken_vertex_lets_the_slope_jump_and_the_value_not() -> None:
    space = Space(MESH, 5, 1, 2, broken=(1,))
    coefficients = np.sin(np.arange(1.0, space.size + 1))
    value_jump, slope_jump = jumps_at(space, coefficients, -0.2, 1)
    assert value_jump < 1e-12
    assert slope_jump > 1e-2
    assert jumps_at(space, coefficients, 0.5, 1) == pytest.approx([0, 0], abs=1e-11)
    assert space.size == Space(MESH, 5, 1, 2).size + 1


@pytest.mark.parametrize("smoothness", [1, 2])
def test_a_periodic_space_closes(smoothness: int) -> None:
    space = Space(MESH, 5, 2, smoothness, periodic=2)
    coefficients = np.sin(np.arange(1.0, space.size + 1))
    for d in range(smoothness):
        left, right = (space.evaluate(coefficients, np.array([x]), d) for x in (-1.0, 2.0))
        assert left == pytest.approx(right, abs=1e-11)
    assert space.size == Space(MESH, 5, 2, smoothness).size - 2 * smoothness


@pytest.mark.parametrize("smoothness", [1, 2])
def test_of_several_functions_the_first_may_close_alone(smoothness: int) -> None:
    space = Space(MESH, 5, 2, smoothness, periodic=1)
    coefficients = np.sin(np.arange(1.0, space.size + 1))
    for d in range(smoothness):
        left, right = (space.evaluate(coefficients, np.array([x]), d) for x in (-1.0, 2.0))
        assert left[0] == pytest.approx(right[0], abs=1e-11)
        assert abs(left[1] - right[1]) > 1e-3
    assert space.size == Space(MESH, 5, 2, smoothness).size - smoothness


@pytest.mark.parametrize("smoothness", [1, 2])
@pytest.mark.parametrize(("periodic", "broken"), [(0, ()), (2, ()), (1, ()), (0, (2,)), (2, (1,)), (1, (1,))])
def test_prolonging_and_splitting_keep_every_function(smoothness: int, periodic: int, broken: tuple[int, ...]) -> None:
    space = Space(MESH, 5, 2, smoothness, periodic, broken)
    coefficients = np.sin(np.arange(1.0, space.size + 1))
    x = np.linspace(-1, 2, 41)[:-1] + 0.01
    expected = [space.evaluate(coefficients, x, d) for d in range(smoothness + 1)]
    richer = Space(MESH, 8, 2, smoothness, periodic, broken)
    finer, split = space.split(coefficients, np.array([True, False, True]))
    assert finer.vertices == pytest.approx([-1, -0.6, -0.2, 0.5, 1.25, 2], abs=1e-15)
    assert finer.broken == tuple({1: 2, 2: 3}[b] for b in broken)
    for d in range(smoothness + 1):
        assert richer.evaluate(space.prolonged(coefficients, richer), x, d) == pytest.approx(expected[d], abs=1e-12)
        assert finer.evaluate(split, x, d) == pytest.approx(expected[d], abs=1e-10)


def test_vertex_coefficients_are_derivatives() -> None:
    space = Space(MESH, 7, 2, 2)
    exact = polynomial(7, 2)
    coefficients = space.fit(lambda x: value(exact, x))
    for vertex, x in enumerate(MESH):
        for d in (0, 1):
            for component in (0, 1):
                found = coefficients[space.vertex_number(vertex, d, component)] / space.vertex_scale**d
                assert found == pytest.approx(value(exact, np.array([x]), d)[component, 0], abs=1e-9)
