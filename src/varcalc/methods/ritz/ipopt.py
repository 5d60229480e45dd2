"""CasADi/IPOPT on the same discretised functional: bounds, inequalities, pathwise conditions.

The variables are the free coefficients and the unknown numbers, scaled to the
size of the curve; the objective is the mapped integrand summed by the Gauss
rule, with exact first and second derivatives (Waechter and Biegler, Mathematical
Programming 106, 2006). Pathwise conditions hold at the
Lobatto nodes of every element, inequalities at its Gauss points as well.

The derivatives that IPOPT is handed are put together from those at the points, see
:mod:`varcalc.methods.ritz.derivatives`. The differentiation of the whole program would
take longer than its solution.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import casadi as ca
import numpy as np
from numpy.polynomial import legendre

from varcalc.formulation import SideCondition
from varcalc.formulation.form import Form
from varcalc.formulation.height import flat, height
from varcalc.methods.ritz.derivatives import (
    ColumnFunctions,
    CurvePoints,
    EndPlaces,
    ExpressionColumn,
    ProgramDerivatives,
    along_diagonal,
    column_functions,
)
from varcalc.methods.ritz.integrands import integrands, pointwise
from varcalc.methods.ritz.newton import Descent
from varcalc.methods.ritz.starts import bent
from varcalc.methods.ritz.system import RitzSystem
from varcalc.numerics.mesh import gauss, inner_nodes
from varcalc.problem.conditions import finite, whole
from varcalc.spelling import spelled
from varcalc.symbolic.derived import derived

GOOD = ("Solve_Succeeded", "Solved_To_Acceptable_Level")
FINISHED = ("Search_Direction_Becomes_Too_Small", "Maximum_Iterations_Exceeded", "Restoration_Failed")
"""Ends at which round-off, not the point, may be what stopped IPOPT."""
STATIONARY = 1e-8
"""Infeasibilities, primal and dual in IPOPT's own scaling, below which such an end is a minimum."""
VERTEX_OFFSET = 64 * float(np.finfo(float).eps)
"""Distance from a vertex, relative to the abscissae, at which a condition is asked on either side of it."""
SUMMED_ROUND_OFF = 1e-13
"""What is summed along a curve, in units of that along one bent aside, that is made of round-off."""
ORDINATE_ROUND_OFF = 1e-12
"""Relative size of an ordinate or slope that is round-off."""

AT_MINIMUM = {"bound_mult_init_method": "mu-based", "mu_init": 1e-6, "slack_bound_push": 1e-8, "slack_bound_frac": 1e-8}
"""What keeps IPOPT where it begins: by its own defaults it pushes a curve that lies on a bound away from there."""
SIZED_AT, SHRUNK = 17, 1e-3
"""Places at which the form's own starting curve is sized, and the part of it to which a function may shrink."""
LEAST_EXACT = 1e-10
"""IPOPT's own scaled error that is allowed to what is lost in the terms of a gradient."""
GRADIENT_ROUND_OFF = float(np.finfo(float).eps)
"""Relative to the sizes of the terms that a derivative is summed from."""


@spelled
@dataclass(frozen=True)
class Ipopt:
    """IPOPT with exact Hessians. ``iterations`` bounds one solve, ``tol`` is its own scaled tolerance.

    Raises TypeError or ValueError where either is not a positive number, the first a whole one.
    """

    iterations: int = 200
    tol: float = 1e-13

    def __post_init__(self) -> None:
        whole("Ipopt.iterations", self.iterations)
        if not finite("Ipopt.tol", self.tol) > 0:
            raise ValueError(f"Ipopt.tol must be a positive number, not {self.tol!r}")


@dataclass(frozen=True)
class _Label:
    """What a column of constraints stands for: its kind, the number of the condition, rows, elements (of bool).

    ``rule`` has the nodes and weights, on [-1, 1], of each of these elements.
    """

    kind: str
    index: int
    rows: int
    elements: np.ndarray | None
    rule: tuple[np.ndarray, np.ndarray] | None


@dataclass
class _Program:
    """The nonlinear program: symbols, rows of constraints, and what each row stands for."""

    w: Any
    objective: Any
    derivatives: ProgramDerivatives
    rows: list[Any] = field(default_factory=list)
    lower: list[np.ndarray] = field(default_factory=list)
    upper: list[np.ndarray] = field(default_factory=list)
    labels: list[_Label] = field(default_factory=list)
    sizes: list[np.ndarray] = field(default_factory=list)

    @property
    def count(self) -> int:
        """The rows there are."""
        return sum(label.rows for label in self.labels)

    def add(
        self,
        kind: str,
        index: int,
        row: Any,
        bounds: tuple[float, float],
        size: float = 1.0,
        elements: np.ndarray | None = None,
        rule: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> None:
        """Append a column of constraints with common bounds, in units of ``size``."""
        count = row.numel()
        self.rows.append(ca.vec(row) / size)
        self.lower.append(np.full(count, bounds[0] / size))
        self.upper.append(np.full(count, bounds[1] / size))
        self.labels.append(_Label(kind, index, count, elements, rule))
        self.sizes.append(np.full(count, size))


def optimise(
    system: RitzSystem, z: np.ndarray, multipliers: np.ndarray, ipopt: Ipopt, *, known: bool = False
) -> tuple[Descent, dict[Any, Any]]:
    """A minimum near ``z``, which is ``known`` to be one itself, in another space, or any curve.

    Returns the outcome and the multipliers of pathwise conditions (functions of
    s, by index of the constraint) and of integral inequalities (floats, by
    ``("integral", index)``).
    """
    if not system.size:  # everything is fixed by the ends: there is nothing to optimise
        return Descent(z, multipliers, system.evaluate(z).value, 0, ""), {}
    scale, size = _scales(system, z), _summed(system, z)
    program, options = _posed(system, z, scale, size, ipopt)
    # beyond round-off the multipliers of bounds that hold a curve wander, and with them what is left of the gradient
    if known:
        options["ipopt"] |= AT_MINIMUM
    nlp = {"x": program.w, "f": program.objective}
    if program.rows:
        nlp["g"] = ca.densify(ca.vertcat(*program.rows))
    solver = ca.nlpsol("ritz", "ipopt", nlp, options)
    bounds = {"lbg": np.concatenate(program.lower), "ubg": np.concatenate(program.upper)} if program.rows else {}
    result = solver(x0=z / scale, **bounds)
    stats = solver.stats()
    found = np.asarray(result["x"]).ravel() * scale
    at = system.evaluate(found)
    status = str(stats["return_status"])
    good = np.isfinite(at.value) and (status in GOOD or (status in FINISHED and _stationary(stats)))
    reason = "" if good else f"IPOPT stopped with {status}"
    given = _balancing(solver, program, result) if good and status not in GOOD else np.asarray(result["lam_g"]).ravel()
    lam = size * given / np.concatenate([np.zeros(0), *program.sizes])
    gap = size * _gap(program, result, given) if program.rows else 0.0
    equalities, others = _sort_multipliers(system, program, lam, len(multipliers))
    return Descent(found, equalities, at.value, int(stats["iter_count"]), reason, gap=gap), others


def _posed(
    system: RitzSystem, z: np.ndarray, scale: np.ndarray, size: float, ipopt: Ipopt
) -> tuple[_Program, dict[str, Any]]:
    """The program in unknowns in units of ``scale``, its sums in units of ``size``, and the options of its solver."""
    if _only_minimised(system):
        alone = summed_up(system, scale, size)
        program, derivatives = _Program(alone.unknowns, alone.value, ProgramDerivatives(alone.unknowns)), alone.options
        straight = False
    else:
        program = program_of(system, z, scale, size)
        derivatives, straight = program.derivatives.options(program.count), program.derivatives.straight
    lost = _round_off(derivatives["hess_lag"], z / scale, program.count)
    settings = {
        "tol": ipopt.tol,
        "acceptable_tol": min(max(ipopt.tol, lost), LEAST_EXACT),
        "acceptable_iter": 1,
        "acceptable_compl_inf_tol": 1e-15,  # the barrier is as low as it gets
        "acceptable_constr_viol_tol": ipopt.tol,
        "max_iter": ipopt.iterations,
        "mu_strategy": "adaptive",
        "mu_min": 1e-16,  # what the barrier leaves is an error of the value
        "constr_viol_tol": 1e-12,
        "bound_relax_factor": 0.0,
        # the variables are of size one: beyond this the functional has no lower bound
        "diverging_iterates_tol": 1e8,
    } | ({"jac_c_constant": "yes", "jac_d_constant": "yes"} if straight else {})
    # the sensitivities are taken from the curve, by the envelope theorem
    return program, quiet(settings) | {"no_nlp_grad": True} | derivatives


def quiet(settings: Mapping[str, Any]) -> dict[str, Any]:
    """The options of a solver of CasADi's for which IPOPT, with these ``settings``, prints nothing."""
    own = {"print_level": 0, "sb": "yes", **settings}
    return {"print_time": False, "show_eval_warnings": False, "ipopt": own}


def _round_off(hessian: ca.Function, start: np.ndarray, rows: int) -> float:
    """What the gradient of the functional is off by for what is lost in its terms: short elements have large ones."""
    upper = ca.DM(hessian(start, [], 1.0, np.zeros(rows)))
    row, column = (np.array(k, dtype=int) for k in upper.sparsity().get_triplet())
    values, sizes = np.abs(np.array(upper.nonzeros())), np.abs(start)
    terms = np.bincount(row, values * sizes[column], len(start))
    terms += np.bincount(column, np.where(row < column, values * sizes[row], 0.0), len(start))
    largest = float(terms.max(initial=0.0))
    return GRADIENT_ROUND_OFF * largest if np.isfinite(largest) else 0.0


def _balancing(solver: ca.Function, program: _Program, result: Mapping[str, Any]) -> np.ndarray:
    """The multipliers that come closest to balance the gradient: where a restoration failed, IPOPT hands out none."""
    rows = np.asarray(result["g"]).ravel()
    if not program.rows:
        return rows
    lower, upper = np.concatenate(program.lower), np.concatenate(program.upper)
    held = (rows - lower <= STATIONARY) | (upper - rows <= STATIONARY)
    gradient, jacobian = (
        np.asarray(solver.get_function(name)(result["x"], [])[1].full()) for name in ("nlp_grad_f", "nlp_jac_g")
    )
    found = np.zeros(len(rows))
    found[held] = np.linalg.lstsq(jacobian[held].T, -gradient.ravel(), rcond=None)[0]
    return found


def _gap(program: _Program, result: Mapping[str, Any], multipliers: np.ndarray) -> float:
    """The sum of the multipliers times the room to their bounds, which the barrier leaves."""
    rows = np.asarray(result["g"]).ravel()
    lower, upper = np.concatenate(program.lower), np.concatenate(program.upper)
    bound = np.where(multipliers > 0, upper, lower)
    held = np.isfinite(bound)
    return float(np.abs(multipliers[held]) @ np.abs(rows - bound)[held])


def _only_minimised(system: RitzSystem) -> bool:
    """Whether there are no conditions, no unknown numbers and no cost of the ends."""
    form = system.form
    return not (form.conditions.integrals or form.conditions.pathwise or system.extra) and form.ends.joint is None


def _stationary(stats: dict[str, Any]) -> bool:
    """Whether the last iterate is feasible and stationary though IPOPT's own test was not met."""
    trace = stats["iterations"]
    return bool(trace["inf_pr"]) and trace["inf_pr"][-1] <= STATIONARY**1.5 and trace["inf_du"][-1] <= STATIONARY


def _summed(system: RitzSystem, z: np.ndarray) -> float:
    """What is summed along a curve, without regard to sign: along a bent one where that is zero but for round-off.

    Where it is summed of nothing, as along a line on which a load is counted from, there is no unit to take from it.
    """
    sizes = [system.evaluate(z).scale]
    if system.form.start.bumps.size:
        curve = system.fitted(bent(system.form, height(system.form), system.form.start.bumps[0]))
        sizes.append(system.evaluate(curve).scale)
    own, other = (float(size) if np.isfinite(size) else 0.0 for size in (*sizes, 0.0)[:2])
    return (own if own > SUMMED_ROUND_OFF * other else other) or 1.0


def _scales(system: RitzSystem, z: np.ndarray) -> np.ndarray:
    """A size for each unknown: that of its function along the starting curve, and not far below the form's own."""
    first = system.form.start.curve(np.linspace(*system.form.span, SIZED_AT))
    values = np.maximum(np.abs(system.ordinates(z)).max(0), SHRUNK * np.abs(first).max(1))
    seen = values > flat(system.form)
    values = np.where(seen, values, values.max() if seen.any() else height(system.form))
    column = np.empty((system.space.size,))
    for a in range(system.n):
        column[system.space.numbers[:, :, a].ravel()] = values[a]
    unknowns = np.abs(system.unknowns(z))
    unknowns = np.where(unknowns > 0, unknowns, 1.0)
    if corners := system.form.coordinates.corners:  # they move by shares of the pieces between them
        places = system.unknowns(z)[-corners:]
        order = np.argsort(places)
        pieces = np.diff(np.concatenate([system.space.vertices[:1], places[order], system.space.vertices[-1:]]))
        shorter = np.minimum(pieces[1:], pieces[:-1])[np.argsort(order)]
        unknowns[-corners:] = np.where(shorter > 0, shorter, unknowns[-corners:])
    return np.concatenate([column[system.free], unknowns])


class _Sizes:
    """By how much conditions change when the curve and the unknown numbers change by their own size: their units."""

    def __init__(self, system: RitzSystem, z: np.ndarray) -> None:
        self.form = system.form
        self.arguments = system.arguments(z)
        reach = np.concatenate([np.abs(self.arguments[i]).max(1, initial=0.0) for i in (1, 2, 3, 5)])
        # a straight line along the axis is one but for round-off
        self.reach = np.where(
            reach > ORDINATE_ROUND_OFF * max(reach.max(initial=0.0), np.ptp(self.arguments[0])), reach, 0.0
        )

    def of_integrand(self, condition: SideCondition) -> float:
        """The largest change along the curve, or the bound when that is larger; 1 where there is none to go by."""
        return _largest(float(self._changes(condition.expression).max(initial=0.0)), *condition.bounds)

    def _changes(self, expression: Any) -> np.ndarray:
        return self.reach @ np.abs(np.asarray(_gradient(self.form, ExpressionColumn(expression))(*self.arguments)))


@derived
def _gradient(form: Form, column: ExpressionColumn) -> ca.Function:
    """That of one expression by the curve, its derivatives and the unknown numbers."""
    s, [expression] = form.symbols, column.expressions
    gradient = ca.gradient(expression, ca.vertcat(s.y, s.dy, s.ddy, s.unknowns))
    return ca.Function("gradient", s.all, [ca.densify(gradient)])


def _largest(*sizes: float) -> float:
    return max((abs(s) for s in sizes if np.isfinite(s) and s != 0.0), default=1.0)


def program_of(system: RitzSystem, z: np.ndarray, scale: np.ndarray, size: float) -> _Program:
    """The program of a minimum near ``z``, unknowns in ``scale`` and the functional in ``size``."""
    form = system.form
    w = ca.MX.sym("w", system.size)
    at_gauss = CurvePoints.of(system, scale)
    integrals = [form.integrand, *(c.expression for c in form.conditions.integrals)]
    functions, arguments = column_functions(form, ExpressionColumn(*integrals)), at_gauss.arguments(w)
    values = ca.mtimes(functions.values.map(len(system.weights))(*arguments), ca.DM(system.weights))
    program = _Program(w, values[0] / size, ProgramDerivatives(w))
    for j, condition in enumerate(form.conditions.integrals):
        program.add("integral", condition.index, values[1 + j], condition.bounds)
    m, count = len(integrals), len(system.weights)
    factors = np.repeat(system.weights[:, None], m, axis=1)
    factors[:, 0] /= size
    shares = np.arange(m * count), np.tile(np.arange(m), count), factors.ravel()
    program.derivatives.at_points(at_gauss, functions, arguments, shares)
    if form.ends.joint is not None:
        _add_ends(system, program, scale, z / scale, size)
    if form.conditions.pathwise:
        _Pathwise(system, program, scale, at_gauss, _Sizes(system, z), z / scale).add()
    if form.width is not None:  # beyond that a curve runs backwards, and what is positive sums to less than nothing
        anywhere = at_gauss.kept(np.arange(count) == 0)
        arguments = anywhere.arguments(w)
        program.add("width", -1, form.width(arguments[5], form.problem.parameter_values), (0.0, np.inf))
        one = np.ones(1, dtype=int)
        shares = 0 * one, program.count * one, np.ones(1)
        program.derivatives.at_points(anywhere, _width_functions(form), arguments, shares)
    return program


@derived
def _width_functions(form: Form) -> ColumnFunctions:
    assert form.width is not None
    s = form.symbols
    return ColumnFunctions.of(s.all, [s.y, *s.slopes, s.unknowns], [form.width(s.unknowns, s.parameters)])


def _add_ends(system: RitzSystem, program: _Program, scale: np.ndarray, start: np.ndarray, size: float) -> None:
    ends = EndPlaces(system, scale)
    function = ca.Function("ends", ends.symbols, [ends.joint.cost, ends.joint.equations])
    cost, equations = function(*ends.arguments(program.w))
    program.objective += cost / size
    factors, first = [1 / size], program.count
    for row in ca.vertsplit(equations) if equations.numel() else []:
        gradient = np.asarray(ca.DM(ca.evalf(ca.substitute(ca.gradient(row, program.w), program.w, start))))
        change = float(np.abs(gradient).max(initial=0.0))
        change = change if np.isfinite(change) and change > 0 else 1.0
        program.add("ends", -1, row, (0.0, 0.0), change)
        factors.append(1 / change)
    rows = np.arange(len(factors))
    program.derivatives.at_ends(ends, (rows, np.where(rows > 0, first + rows, 0), np.array(factors)))


@dataclass
class _Pathwise:
    """Pathwise conditions, left out where the fixed ends already decide them."""

    system: RitzSystem
    program: _Program
    scale: np.ndarray
    at_gauss: CurvePoints
    sizes: _Sizes
    start: np.ndarray
    _known: dict[bytes, CurvePoints] = field(default_factory=dict)

    def _at(self, nodes: np.ndarray) -> CurvePoints:
        """The points of every element at ``nodes`` of the reference element, which conditions share."""
        key = nodes.tobytes()
        if key not in self._known:
            self._known[key] = CurvePoints.of(self.system, self.scale, nodes)
        return self._known[key]

    def add(self) -> None:
        """Append the rows of every condition to the program."""
        system, ends = self.system, np.array([-1.0])
        # the first vertex of each element but the first is interior
        vertices = self._at(ends)
        for condition in system.form.conditions.pathwise:
            size = self.sizes.of_integrand(condition)
            elements, corners = _asked(system, condition)
            given = _given_at_vertices(system, condition)
            for some, rule in _nodes(system, condition, given, elements):
                inner = self._at(rule[0])
                kind = "equations" if condition.equality else "nodes"
                self._append(kind, condition, inner.kept(np.repeat(some, len(rule[0]))), size, some, rule)
            if corners.any() and given:
                beside = [_beside(vertices, side) for side in (-1, 1)]
                jumping, sides = corners.copy(), [self._values(condition, side.kept(corners)) for side in beside]
                jumping[corners] = _differ(sides, self.program.w, self.start, ORDINATE_ROUND_OFF * size)
                # a bound that jumps there is kept on both sides
                for points, kept in ((vertices, corners & ~jumping), *((side, jumping) for side in beside)):
                    self._append("vertices", condition, points.kept(kept), size, elements)
                if condition.equality and given > 1:
                    self._append("vertices", _rate(system, condition, 1), vertices.kept(corners), size, elements)
            if condition.equality and condition.where is not None:
                self._end_stretches(condition, size, elements, given)
            if not condition.equality:
                self._keep_free_ends(condition, size, elements * bool(given))
                kept = np.repeat(elements, system.count)
                self._append("gauss", condition, self.at_gauss.kept(kept), size, elements, gauss(system.count))

    def _keep_free_ends(self, condition: SideCondition, size: float, elements: np.ndarray) -> None:
        """Append that a bound, or a stretch that comes to a free end, keeps its condition there."""
        system, space = self.system, self.system.space
        y = system.form.symbols.y
        felt = [a for a in range(system.n) if ca.depends_on(condition.expression, y[a])]
        ends = ((0, 0, -1.0), (space.elements, -1, 1.0))
        for vertex, element, node in ends[:1] if system.form.ends.periodic else ends:  # that ends where it begins
            numbers = [space.vertex_number(vertex, 0, a) for a in felt]
            if elements[element] and np.isin(numbers, system.free).any():
                at = np.zeros(space.elements, dtype=bool)
                at[element] = True
                points = self._at(np.array([node])).kept(at)
                self._append("vertices", condition, points, size, elements)

    def _end_stretches(self, condition: SideCondition, size: float, elements: np.ndarray, given: int) -> None:
        """Append that a curve comes to a stretch, and leaves it, with the rate that a condition has along it.

        That the functional is stationary in where the stretch ends says the square of it, which is no minimum there but
        an inflection. Where the ends of stretches are no unknowns, they are moved there. A condition on the slope, of
        which none is ``given`` at a vertex, says at which ends there is no corner.
        """
        if given:
            self._keep_free_ends(condition, size, elements)
        if not self.system.form.coordinates.corners:
            return
        rate = _rate(self.system, condition, given) if given else condition
        ends = (True, True) if given else condition.smoothly
        changes, size = np.diff(elements.astype(int)), self.sizes.of_integrand(rate)
        coming, leaving = ends[0] & np.append(changes > 0, False), ends[1] & np.append(False, changes < 0)
        for node, free in ((1.0, coming), (-1.0, leaving)):
            points = self._at(np.array([node]))
            self._append("vertices", rate, _beside(points, -int(node)).kept(free), size, elements)

    def _values(self, condition: SideCondition, points: CurvePoints) -> Any:
        return self._functions(condition).values.map(len(points.s))(*points.arguments(self.program.w))

    def _functions(self, condition: SideCondition) -> ColumnFunctions:
        return column_functions(self.system.form, ExpressionColumn(condition.expression))

    def _append(
        self, kind: str, condition: SideCondition, points: CurvePoints, size: float, elements: np.ndarray,
        rule: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> None:  # fmt: skip
        if not len(points.s):
            return
        rows, first = np.arange(len(points.s)), 1 + self.program.count
        functions, arguments = self._functions(condition), points.arguments(self.program.w)
        values = functions.values.map(len(rows))(*arguments)
        self.program.add(kind, condition.index, values, condition.bounds, size, elements, rule)
        shares = (rows, first + rows, np.full(len(rows), 1 / size))
        self.program.derivatives.at_points(points, functions, arguments, shares)


def _beside(vertices: CurvePoints, side: int) -> CurvePoints:
    """The vertices with abscissae just beside them, where what jumps has the value of that side."""
    ends = vertices.system.space.vertices[[0, -1]]
    return replace(vertices, s=vertices.s + side * VERTEX_OFFSET * float(max(np.abs(ends).max(), np.ptp(ends))))


def _differ(sides: list[Any], w: Any, start: np.ndarray, least: float) -> np.ndarray:
    """Where two rows differ at the start by more than the ``least``."""
    before, after = ca.substitute(sides, [w], [ca.MX(ca.DM(start))])
    return np.asarray(ca.evalf(ca.fabs(after - before))).ravel() > least


def _asked(system: RitzSystem, condition: SideCondition) -> tuple[np.ndarray, np.ndarray]:
    """The elements on which a condition is asked, and those whose left vertex is interior and has to keep it."""
    left, right = system.space.vertices[:-1], system.space.vertices[1:]
    low, high = (-np.inf, np.inf) if condition.where is None else condition.where
    middle = 0.5 * (left + right)
    near = 1e-9 * (right[-1] - left[0])
    corners = (left >= low - near) & (left <= high + near)
    corners[0] = False
    return (middle > low) & (middle < high), corners


def _given_at_vertices(system: RitzSystem, condition: SideCondition) -> int:
    """How many derivatives of a condition, from none on, the functions have in common at a vertex."""
    slopes = system.form.symbols.slopes
    highest = max((k for k, d in enumerate(slopes, 1) if ca.depends_on(condition.expression, d)), default=0)
    return system.order - highest


def _nodes(
    system: RitzSystem, condition: SideCondition, given: int, elements: np.ndarray
) -> list[tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]]:
    """Nodes inside the ``elements`` (of bool), with weights, some of the elements after the others.

    They hold a polynomial with as many derivatives ``given`` at its ends. An equation for the highest derivative, which
    has none, is asked at as many as that has coefficients; where both ends of a curve are given they say one of them.
    """
    highest = system.space.degree + 1 - system.order
    if not condition.equality:
        rules = [(elements, inner_nodes(system.space.degree - 1, 1))]
    elif given:
        rules = [(elements, inner_nodes(highest - given, given))]
    else:
        ends = system.form.ends
        decided = elements.all() and not np.isnan([ends.start[0], ends.end[0]]).any()
        first = elements & decided & (np.arange(len(elements)) == 0)
        rules = [(first, gauss(max(highest - 1, 1))), (elements & ~first, gauss(highest))]
    return [(some, rule) for some, rule in rules if some.any() and len(rule[0])]  # a straight element may have none


def _rate(system: RitzSystem, condition: SideCondition, times: int) -> SideCondition:
    """That the rate of a condition along the curve, or the rate of that, is zero."""
    rate = _rate_of(system.form, ExpressionColumn(condition.expression), times)
    return replace(condition, expression=rate, lower=0.0, upper=0.0)


@derived
def _rate_of(form: Form, column: ExpressionColumn, times: int) -> Any:
    s, [rate] = form.symbols, column.expressions
    for _ in range(times):
        rate = ca.jtimes(rate, ca.vertcat(s.x, s.y, *s.slopes[:-1]), ca.vertcat(1, *s.slopes))
    return rate


def _sort_multipliers(
    system: RitzSystem, program: _Program, lam: np.ndarray, count: int
) -> tuple[np.ndarray, dict[Any, Any]]:
    """Multipliers of equalities in the order of the system, and the others by their constraint."""
    others: dict[Any, Any] = {}
    pieces: dict[int, list[Callable[[np.ndarray], np.ndarray]]] = {}
    equalities: list[float] = []
    ends: list[float] = []
    integrals = {c.index: c for c in system.form.conditions.integrals}
    start = 0
    for label in program.labels:
        block = lam[start : start + label.rows]
        start += label.rows
        if label.kind == "integral":
            (equalities if integrals[label.index].equality else []).append(float(block[0]))
            others["integral", label.index] = float(block[0])
        elif label.kind == "ends":
            ends.extend(block)
        elif label.kind not in ("vertices", "width"):
            pieces.setdefault(label.index, []).append(_density(system, label, block))
    for index, densities in pieces.items():
        # rows at nodes and at Gauss points each carry a share of one load: the shares add up
        others[index] = lambda x, parts=densities: sum((part(x) for part in parts), np.zeros(np.shape(x)))
    return np.array([*equalities, *ends])[:count], others


def _density(system: RitzSystem, label: _Label, block: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """The multiplier mu(s) of a pathwise condition from the multipliers of its rows.

    A row at a node stands for the condition near it: its multiplier is mu there times the node's quadrature weight. In
    between it is interpolated, by each element's polynomial where the condition is an equation, else linearly: a bound
    may cease to hold the curve within an element. Where the condition is not asked it is zero.
    """
    space, elements = system.space, label.elements
    assert elements is not None
    assert label.rule is not None
    nodes, weights = label.rule
    edges = np.append(space.vertices[:-1][elements], space.vertices[1:][elements][-1])
    half = 0.5 * np.diff(edges)[:, None]
    values = block.reshape(half.size, -1) / (half * weights)
    if label.kind == "equations":
        series = np.linalg.solve(legendre.legvander(nodes, len(nodes) - 1), values.T)
        return lambda x: _in_elements(edges, series, x)
    at = (edges[:-1, None] + half * (1 + nodes)).ravel()
    return lambda x: np.where((x >= edges[0]) & (x <= edges[-1]), np.interp(x, at, values.ravel()), 0.0)


def _in_elements(edges: np.ndarray, series: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Legendre series, a column an element between ``edges``, at x (m,); zero outside them."""
    at = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, len(edges) - 2)
    places = (2 * x - edges[at] - edges[at + 1]) / np.diff(edges)[at]
    values = (legendre.legvander(places, len(series) - 1) * series[:, at].T).sum(axis=-1)
    return np.where((x >= edges[0]) & (x <= edges[-1]), values, 0.0)


# the functional alone, with its derivatives


@dataclass(frozen=True)
class Summed:
    """The value as an expression in ``unknowns``, and the ``options`` that give a solver its derivatives."""

    unknowns: Any
    value: Any
    options: dict[str, Any]


def summed_up(system: RitzSystem, scale: np.ndarray, size: float) -> Summed:
    """The functional of ``system`` in units of ``size``, its unknowns in units of ``scale`` (unknowns,)."""
    w, points = ca.MX.sym("w", system.size), CurvePoints.of(system, scale)
    count, whole = len(points.s), points.matrix
    k = whole.shape[0] // count
    arguments, weights = points.arguments(w), ca.diag(ca.DM(system.weights / size))
    out = ca.mtimes(pointwise(system.form).map(count)(*arguments), weights)
    # a search along a line asks for values alone
    value = ca.sum2(ca.mtimes(integrands(system.form).map(count)(*arguments), weights))
    blocks = ca.MX(along_diagonal(ca.Sparsity.dense(k, k), count), ca.vec(out[1 + k :, :]))
    hessian = ca.mtimes(whole.T, ca.mtimes(blocks, whole))
    p, lam_f, lam_g = ca.MX.sym("p", 0), ca.MX.sym("lam_f"), ca.MX.sym("lam_g", 0)
    gradient = ca.Function(
        "grad_f", [w, p], [value, ca.mtimes(whole.T, ca.vec(out[1 : 1 + k, :]))], ["x", "p"], ["f", "grad_f_x"]
    )
    second = ca.Function(
        "hess_lag", [w, p, lam_f, lam_g], [ca.triu(lam_f * hessian)],
        ["x", "p", "lam_f", "lam_g"], ["triu_hess_gamma_x_x"],
    )  # fmt: skip
    return Summed(w, value, {"grad_f": gradient, "hess_lag": second})
