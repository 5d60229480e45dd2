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
