"""The damped Newton iteration on equations whose roots are known."""

from dataclasses import dataclass

import numpy as np
import pytest

from varcalc.numerics.damped_newton import Ending, LinearisedEquations, damped_newton


@dataclass
class Scaled:
    """A function with its derivative, multiplied by ``matrix``; asked for no more than ``allowed`` points."""

    function: object
    derivative: object
    matrix: np.ndarray
    allowed: float = np.inf
    evaluated: int = 0

    def evaluate(self, z):
        self.evaluated += 1
        with np.errstate(invalid="ignore"):
            value = self.function(z)
        return (z, self.matrix @ value) if self.evaluated <= self.allowed and np.isfinite(value).all() else None

    def linearised(self, z, at):
        jacobian = self.matrix @ self.derivative(at[0])

        def correction(point):
            try:
                return np.linalg.solve(jacobian, -point[1])
            except np.linalg.LinAlgError:
                return None

        return LinearisedEquations(correction, lambda step: float(np.linalg.norm(step)))


def run(function, derivative, z, matrix=None, iterations=60, **options):
    z = np.array(z, dtype=float)
    equations = Scaled(function, derivative, np.eye(len(z)) if matrix is None else matrix, **options)
    return damped_newton(equations, z, equations.evaluate(z), iterations), equations


def rosenbrock(z):
    return np.array([10 * (z[1] - z[0] ** 2), 1 - z[0]])


def rosenbrock_by(z):
    return np.array([[-20 * z[0], 10.0], [-1.0, 0.0]])


@pytest.mark.parametrize("start", [0.5, 3.0, -10.0])
def test_the_arctangent_from_where_undamped_steps_diverge(start):
    result, _ = run(np.arctan, lambda z: np.diag(1 / (1 + z**2)), [start])
    assert result.ending is Ending.CONVERGED
    assert abs(result.z[0]) < 1e-15


def test_the_path_does_not_depend_on_how_the_equations_are_scaled():
    plain, _ = run(rosenbrock, rosenbrock_by, [-1.2, 1.0])
    mixed, _ = run(rosenbrock, rosenbrock_by, [-1.2, 1.0], np.array([[1e8, 3.0], [-1e-3, 1e-6]]))
    np.testing.assert_allclose(plain.z, [1, 1], atol=1e-14)
    np.testing.assert_allclose(mixed.z, [1, 1], atol=1e-8)
    assert mixed.iterations == plain.iterations


def test_points_out_of_the_question_are_avoided():
    result, _ = run(np.log, lambda z: np.diag(1 / z), [20.0])  # the full step leads to z < 0
    assert result.ending is Ending.CONVERGED
    assert result.z[0] == pytest.approx(1, abs=1e-15)


def test_how_it_ends_without_a_root():
    assert run(lambda z: z**2 + 1, lambda z: np.diag(2 * z), [0.3])[0].ending is Ending.DAMPED_OUT
    assert run(lambda z: z**2 + 1, lambda z: np.diag(2 * z), [0.0])[0].ending is Ending.SINGULAR
    assert run(rosenbrock, rosenbrock_by, [-1.2, 1.0], iterations=1)[0].ending is Ending.TOO_MANY
    refused, equations = run(rosenbrock, rosenbrock_by, [-1.2, 1.0], allowed=1)
    assert refused.ending is Ending.DAMPED_OUT
    assert equations.evaluated < 30


def test_equations_may_give_up():
    class Tired(Scaled):
        def linearised(self, z, at):
            return None if self.evaluated > 2 else super().linearised(z, at)

    z = np.array([-1.2, 1.0])
    equations = Tired(rosenbrock, rosenbrock_by, np.eye(2))
    assert damped_newton(equations, z, equations.evaluate(z), 60).ending is Ending.GIVEN_UP
