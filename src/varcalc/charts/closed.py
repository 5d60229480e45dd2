"""Closed curves: their place and their start may be free, so they are laid upon each other before they are drawn."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np

from varcalc.charts.lines import SAMPLES, Line, nearest
from varcalc.problem.conditions import Isoperimetric
from varcalc.problem.functional import Functional
from varcalc.problem.lagrangian import Lagrangian
from varcalc.problem.problem import Curve

ALIGNED = "place and start moved to coincide"
"""Said where closed curves are drawn upon each other: the functional does not tell where one lies or begins."""


def is_closed(problem: Functional) -> bool:
    """True for a closed :class:`varcalc.Curve`."""
    return isinstance(problem, Curve) and problem.start.periodic


def free_directions(problem: Functional) -> np.ndarray:
    """Along which coordinates a closed curve may be moved at no cost, as n truth values.

    Those that occur neither in the Euler-Lagrange equations of the functional
    and its prescribed integrals, nor in any pathwise constraint, as far as
    the formulas show it: terms that would cancel are not looked for.
    """
    integrals = [t.expression for t in problem.traced if isinstance(t.constraint, Isoperimetric)]
    pathwise = [t.expression for t in problem.traced if not isinstance(t.constraint, Isoperimetric)]
    equations = [Lagrangian(problem.symbols, e).euler_lagrange for e in (problem.integrand, *integrals)]
    by_place = ca.jacobian(ca.vertcat(*equations, *pathwise), problem.symbols.y)
    return np.array(ca.DM(by_place.sparsity(), 1)).any(axis=0) == 0


def aligned(line: Line, reference: Line, free: np.ndarray) -> Line:
    """A closed curve with its middle moved onto that of another along ``free``, beginning where that one begins."""
    once = np.arange(SAMPLES) / SAMPLES
    move = np.where(free, reference.at(once).mean(axis=1) - line.at(once).mean(axis=1), 0.0)[:, None]
    moved = replace(line, at=lambda t: line.at(t) + move)
    (first,) = nearest(moved, reference.at(np.zeros(1)))
    return replace(line, at=lambda t: moved.at(np.mod(t + first, 1.0)))
