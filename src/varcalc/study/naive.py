"""What a first attempt does: straight pieces, the integrand at the middle of each, the sum minimised by IPOPT.

It is charted beside the methods and is none of them. The midpoint rule never
samples the ends: where L is infinite at one, the sum misses part of the
integral, the minimiser exploits that, and the value falls below the minimum
with every sign of success.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import casadi as ca
import numpy as np

from varcalc.methods.ritz.ipopt import quiet
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Problem

NAIVE_NAME = "naive midpoint rule"
PIECES = (4, 8, 16, 32, 64, 128, 256)
NAIVE_ITERATIONS = 300


@dataclass(frozen=True)
class NaiveAnswer:
    """The sum at its minimiser, whether IPOPT claims success, the seconds to build and to solve, and the ordinates."""

    value: float
    success: bool
    build: float
    solve: float
    ordinates: np.ndarray
    iterations: int


def applies(problem: Functional) -> bool:
    """True where there is something to be learnt: a plain graph between fixed points, at one of which L is infinite."""
    plain = (
        isinstance(problem, Problem)
        and problem.order == 1
        and not problem.maximise
        and not (problem.constraints or problem.unknowns or problem.breakpoints)
        and problem.end_cost is None
        and not np.isnan(_ordinates(problem)).any()
    )
    return plain and not all(math.isfinite(value) for value in _at_ends(problem))


def _integrand(problem: Functional) -> ca.Function:
    s = problem.symbols
    return ca.Function("L", [s.x, s.y, s.dy, s.parameters], [problem.integrand])


def _at_ends(problem: Functional) -> list[float]:
    """L at either end with the slope of the line between them."""
    (a, b), integrand = problem.span, _integrand(problem)
    first, last = _ordinates(problem)
    slope = (last - first) / (b - a)
    return [float(integrand(x, y, slope, problem.parameter_values)) for x, y in ((a, first), (b, last))]


def _ordinates(problem: Functional) -> np.ndarray:
    """Those of both ends, (2, n)."""
    return np.array([problem.start.values(problem.n), problem.end.values(problem.n)])


class MidpointRule:
    """The sum over ``pieces`` equal pieces as a problem for IPOPT in the ordinates between them."""

    def __init__(self, problem: Functional, pieces: int) -> None:
        began = time.process_time()
        a, b = problem.span
        first, last = _ordinates(problem)
        self.line = first[:, None] + (last - first)[:, None] * np.linspace(0, 1, pieces + 1)
        self.sign = problem.sign
        h = (b - a) / pieces
        inner = ca.MX.sym("y", problem.n, pieces - 1)
        y = ca.horzcat(first, inner, last)
        middles = a + h * (np.arange(pieces) + 0.5)
        sampled = _integrand(problem).map(pieces)(
            middles[None, :], (y[:, :-1] + y[:, 1:]) / 2, (y[:, 1:] - y[:, :-1]) / h, problem.parameter_values
        )
        nlp = {"x": ca.vec(inner), "f": self.sign * h * ca.sum2(sampled)}
        self.solver = ca.nlpsol("naive", "ipopt", nlp, quiet({"max_iter": NAIVE_ITERATIONS}))
        self.build = time.process_time() - began

    def minimised(self, start: np.ndarray | None = None) -> NaiveAnswer:
        """IPOPT's answer from the straight line between the ends, or from ordinates (n, pieces + 1)."""
        began = time.process_time()
        found = self.solver(x0=(self.line if start is None else start)[:, 1:-1].ravel(order="F"))
        stats = self.solver.stats()
        y = self.line.copy()
        y[:, 1:-1] = np.asarray(found["x"]).reshape((len(y), -1), order="F")
        value = self.sign * float(found["f"])
        success = bool(stats["success"]) and np.isfinite(value)
        spent = time.process_time() - began
        return NaiveAnswer(value, success, self.build, spent, y, int(stats["iter_count"]))
