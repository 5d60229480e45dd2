"""How the functional changes when a fixed end is moved: the momentum and the energy there.

Along extremals dJ = p . dy - (p . y' - L) dx at the end, and the same with the
other sign at the start (Gelfand and Fomin, "Calculus of Variations", sect. 13
and 23); L is the Lagrangian function, prescribed integrals in it with their
multipliers. For a curve in space p = F_q' alone remains.
"""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np

from varcalc.problem.conditions import Isoperimetric, parameters_of
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Problem
from varcalc.symbolic.derived import derived


def by_moved_ends(
    problem: Functional,
    curve: Callable[[np.ndarray, int], np.ndarray],
    multipliers: tuple[float | None, ...],
    unknowns: np.ndarray,
) -> np.ndarray:
    """dJ/dparameter by what the parameters move of the ends; shape (parameters,).

    ``curve(x, k)`` is the extremal in the person's coordinates. NaN where the
    slope or L is not finite, at second order, and where the ends have a cost or
    the curve pathwise conditions, which have a part in it.
    """
    names = list(problem.parameters)
    total = np.zeros(len(names))
    pathwise = any(not isinstance(t.constraint, Isoperimetric) for t in problem.traced)
    known = problem.order == 1 and problem.end_cost is None and not pathwise
    for at, outward, template in zip(problem.span, (-1.0, 1.0), problem.templates, strict=True):
        found = parameters_of(template)
        by_x, by_y = np.nan, _none(problem)
        if found and known:
            by_x, by_y = _covector(problem, curve, multipliers, unknowns, at)
        for name, field, component in found:
            total[names.index(name)] += outward * (by_x if field == "x" else float(by_y[component]))
    return total


def _none(problem: Functional) -> np.ndarray:
    return np.full(problem.n, np.nan)


def _covector(
    problem: Functional,
    curve: Callable[[np.ndarray, int], np.ndarray],
    multipliers: tuple[float | None, ...],
    unknowns: np.ndarray,
    x: float,
) -> tuple[float, np.ndarray]:
    """dJ/dx and dJ/dy (n,) of an end at x that lies on the right."""
    s = problem.symbols
    place = np.array([x])
    y, dy = curve(place, 0)[:, 0], curve(place, 1)[:, 0]
    arguments = [x, y, dy, np.zeros(s.ddy.numel()), problem.parameter_values, unknowns[: len(problem.unknowns)]]
    weights = np.array([1.0, *(-float(m or 0.0) for m in multipliers)])
    whole = np.asarray(_momenta(problem)(*arguments)) @ weights
    if not (np.isfinite(whole).all() and np.isfinite(dy).all()):
        return np.nan, _none(problem)
    momentum = whole[1:]
    return (float(whole[0] - momentum @ dy) if isinstance(problem, Problem) else np.nan), momentum


@derived
def _momenta(problem: Functional) -> ca.Function:
    """The integrand and those of the levels, each with its derivatives in the slopes; one column each."""
    s, levels = problem.symbols, [t.expression for t in problem.traced]
    rows = [ca.vertcat(e, ca.gradient(e, s.dy)) for e in (problem.integrand, *levels)]
    return ca.Function("momenta", s.all, [ca.densify(ca.horzcat(*rows))])
