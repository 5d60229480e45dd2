"""Curves that may be shifted: of those that are alike the one is taken whose start has a given coordinate.

Where neither the functional nor what a Curve is held by depends on a coordinate, each curve has the same value as one
that begins at any given number of that coordinate. So the infimum is that of the curves that begin there, among which
the minimum may be a strict one (Olver, "Applications of Lie Groups to Differential Equations", 1993, sect. 4.1).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import casadi as ca
import numpy as np

from varcalc.certificates.balls import Ball, flint
from varcalc.certificates.degree import degrees
from varcalc.certificates.jets import Jet, jets, without_enclosure
from varcalc.certificates.smooth import head
from varcalc.problem.conditions import At, OnSurface, Through
from varcalc.problem.problem import Curve
from varcalc.solution import Solution
from varcalc.symbolic.instructions import Program
from varcalc.symbolic.tracing import Expression


def pinned(solution: Solution) -> tuple[Curve, Callable[[Any], np.ndarray]] | None:
    """The problem of the curves that begin at zero of a coordinate that may be shifted, and the solution's curve there.

    None where there is no such coordinate.
    """
    problem = solution.problem
    if not isinstance(problem, Curve) or problem.symbols.kind is not ca.SX or solution.curve is None:
        return None
    if problem.end_cost is not None or any(problem.of_type(Through)):
        return None
    y = problem.symbols.y
    phis = [problem.traced_slide(label, problem.symbols.x, y, ca.SX) for label in ("start", "end")]
    held = ca.vertcat(problem.integrand, *(t.expression for t in problem.traced), *(p for p in phis if p is not None))
    at = np.asarray(solution.curve(np.asarray(solution.x[:1], dtype=float), 0))[:, 0]
    for k in range(problem.n):
        start = None if ca.depends_on(held, y[k]) or not _free(problem.end, k) else _start(problem, phis[0], k, at)
        if start is not None:
            by = np.where(np.arange(problem.n) == k, at[k], 0.0)
            return problem.with_integrand(problem.integrand, start=start), partial(_shifted, solution, by)
    return None


def _shifted(solution: Solution, by: np.ndarray, t: Any) -> np.ndarray:
    """The solution's curve at t, a number or an array, less a vector."""
    q = np.asarray(solution.y(t), dtype=float)
    return (q.T - by).T


def _free(end: object, k: int) -> bool:
    """Whether nothing but a surface holds an end in a coordinate."""
    return isinstance(end, OnSurface) or (isinstance(end, At) and end.q[k] is None)


def _start(problem: Curve, phi: Expression | None, k: int, at: np.ndarray) -> At | None:
    """The start with its coordinate k held at zero; where it slides in the plane, at the one place of its line."""
    if not _free(problem.start, k):
        return None
    q = [None if isinstance(problem.start, OnSurface) else v for v in getattr(problem.start, "q", at)]
    q[k] = 0.0
    if phi is None:
        return At(q)
    if problem.n != 2:
        return None
    q[1 - k] = _root(ca.Function("phi", [problem.symbols.y], [phi]), 1 - k, at)
    return None if q[1 - k] is None else At(q)


def _root(phi: ca.Function, k: int, at: np.ndarray) -> float | None:
    """The double near a point at which a function of the coordinate k, of first degree, is exactly zero; None for none.

    It is known not to depend on the other coordinates.
    """
    if degrees(phi, [[True] * len(at)])[0][0] != 1.0 or without_enclosure(phi):
        return None
    program = Program(phi)

    def value(place: float) -> Ball:
        point = [Jet(flint().arb(float(place if i == k else v))) for i, v in enumerate(at)]
        return flint().arb(0) + head(jets(program, [point], 0)[0][0].value)

    roots = [
        v for v in (0.0, float(round(at[k])), float(at[k])) if value(v).is_zero() and not value(v + 1.0).contains(0)
    ]
    return roots[0] if roots else None
