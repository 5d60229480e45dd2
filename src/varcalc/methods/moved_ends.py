"""How the functional changes when a fixed end, or a place where L switches, is moved: by momentum and energy there.

Along extremals dJ = p . dy - (p . y' - L) dx at the end, and the same with the
other sign at the start (Gelfand and Fomin, "Calculus of Variations", sect. 13
and 23); L is the Lagrangian function, prescribed integrals in it with their
multipliers. For a curve in space p = F_q' alone remains.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from varcalc.numerics.mesh import CurveOrSlope
from varcalc.problem.breaks import along_x, breaks, moving_breaks, switches_of
from varcalc.problem.conditions import Isoperimetric, parameters_of
from varcalc.problem.functional import Functional, arguments_along
from varcalc.problem.problem import Problem
from varcalc.symbolic.derived import derived

AT_BREAK, BESIDE_BREAK = 1e-9, 1e-12
"""Distance from a break, in units of the interval, that is none; and at which its sides are looked at."""


def by_what_moves(
    problem: Functional,
    curve: CurveOrSlope,
    multipliers: tuple[float | None, ...],
    unknowns: np.ndarray,
) -> np.ndarray | float:
    """dJ/dparameter by all that the parameters move, shape (parameters,); 0 where that is nothing."""
    total: np.ndarray | float = 0.0
    if problem.end_parameters:
        total = total + by_moved_ends(problem, curve, multipliers, unknowns)
    if moving_breaks(problem):
        total = total + by_moved_breaks(problem, curve, multipliers, unknowns)
    return total


def by_moved_ends(
    problem: Functional,
    curve: CurveOrSlope,
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


def by_moved_breaks(
    problem: Functional,
    curve: CurveOrSlope,
    multipliers: tuple[float | None, ...],
    unknowns: np.ndarray,
) -> np.ndarray:
    """dJ/dparameter by what the parameters move of the abscissae at which something switches, whatever the curve.

    The piece before ends there and the piece behind begins there; the momenta are the same. Shape (parameters,); NaN
    where the rate of a place is not known, at second order and under pathwise conditions.
    """
    s, total = problem.symbols, np.zeros(len(problem.parameters))
    pathwise = any(not isinstance(t.constraint, Isoperimetric) for t in problem.traced)
    a, b = problem.span
    for switch in switches_of(problem):
        if not (along_x(problem, switch) and switch.depends_on(s.parameters)):
            continue
        rows = ca.vertcat(
            switch.argument, ca.gradient(switch.argument, s.x), ca.gradient(switch.argument, s.parameters)
        )
        function = ca.Function("switch", [s.x, s.parameters], [ca.densify(rows)])
        for at in breaks(problem):
            value, by_x, *by_parameters = np.asarray(function(at, problem.parameter_values)).ravel().tolist()
            if not switch.met(*(np.array(value + side * AT_BREAK * abs(by_x) * (b - a)) for side in (-1, 1))):
                continue
            if problem.order > 1 or pathwise or not by_x:
                return np.full(len(total), np.nan)
            before, behind = (
                _covector(problem, curve, multipliers, unknowns, at + side * BESIDE_BREAK * (b - a))[0]
                for side in (-1, 1)
            )
            total += (before - behind) * -np.array(by_parameters) / by_x
    return total


def _none(problem: Functional) -> np.ndarray:
    return np.full(problem.n, np.nan)


def _covector(
    problem: Functional,
    curve: CurveOrSlope,
    multipliers: tuple[float | None, ...],
    unknowns: np.ndarray,
    x: float,
) -> tuple[float, np.ndarray]:
    """dJ/dx and dJ/dy (n,) of an end at x that lies on the right."""
    place = arguments_along(problem, curve, np.array([x]), unknowns[: len(problem.unknowns)])
    dy = place[2][:, 0]
    weights = np.array([1.0, *(-float(m or 0.0) for m in multipliers)])
    whole = np.asarray(_momenta(problem)(*place)) @ weights
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
