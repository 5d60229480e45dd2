"""What a form's integrand is at points, as numbers, where that is known without its expression.

A problem that is seen once is solved before CasADi could state it in other
coordinates and differentiate it there: the derivatives of L are taken once, in the
person's own variables, and the rest is the chain rule.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from varcalc.problem.problem import Problem


@dataclass(frozen=True)
class Reported:
    """The reported functional's integrand (Q,), the person's abscissa and ordinates and their derivatives by s.

    ``x`` and ``dx`` (Q,), ``y`` and ``dy`` (Q, n).
    """

    integrand: np.ndarray
    x: np.ndarray
    y: np.ndarray
    dx: np.ndarray
    dy: np.ndarray


class AtPoints(Protocol):
    """The integrand at Q points s, in variables u (Q, k) which are affine in the form's (y, y').

    ``transform`` (Q, k, k) and ``offset`` (Q, k) take (y, y') to u; None where they are the same.
    """

    transform: np.ndarray | None
    offset: np.ndarray | None

    def derivatives(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The integrand (Q,), its gradient (Q, k) and Hessian (Q, k, k)."""
        ...

    def reported(self, u: np.ndarray) -> Reported:
        """What is reported of the curve."""
        ...


class Numbers(Protocol):
    """A form's integrand as numbers."""

    def on(self, problem: Problem, s: np.ndarray) -> AtPoints:
        """The integrand at points s (Q,), at the parameter values of ``problem``."""
        ...


class GraphNumbers:
    """A graph in the person's own variables."""

    def on(self, problem: Problem, s: np.ndarray) -> AtPoints:  # noqa: D102
        return _GraphAtPoints(problem, s)


class _GraphAtPoints:
    transform: np.ndarray | None = None
    offset: np.ndarray | None = None

    def __init__(self, problem: Problem, s: np.ndarray) -> None:
        self.problem, self.s, self.n = problem, s, problem.n
        self.sign = -1.0 if problem.maximise else 1.0

    def derivatives(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        rows = self.problem.integrand_derivatives(self.s, u[:, : self.n].T, u[:, self.n :].T).rows
        rows, k = rows if self.sign > 0 else -rows, 1 + 2 * self.n
        return rows[:, 0], rows[:, 2 : 1 + k], rows[:, 1 + k :].reshape(-1, k, k)[:, 1:, 1:]

    def reported(self, u: np.ndarray) -> Reported:
        y, dy = u[:, : self.n], u[:, self.n :]
        values = self.sign * self.problem.integrand_values(self.s, y.T, dy.T)
        return Reported(values, self.s, y, np.ones_like(self.s), dy)
