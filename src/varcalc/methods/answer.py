"""From an extremal in the coordinates of a form to a :class:`Solution` in the person's own."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from varcalc.formulation import Form, Sampled
from varcalc.methods.moved_ends import by_moved_ends
from varcalc.numerics.mesh import gauss
from varcalc.problem.conditions import Isoperimetric, OnCurve
from varcalc.problem.problem import Problem
from varcalc.solution import ErrorEstimate, Solution, Stats, Status, Verdict, defined, no_answer
from varcalc.symbolic.derived import derived

TURNED = 30.0
"""Factor by which a backward speed must exceed the relative error of the curve to be believed."""
APPROACH = (2e-2, 2e-3)
"""Relative distances from a singular end between which the growth of the slope is judged."""
INVERSION_STEPS = 60
"""Bisections that bring any bracket to round-off."""
ALIKE_PLACES = 7
ALIKE = 1e-6
"""Distance, in units of the curve, up to which two changes of variable send a curve to the same place."""


SEEN_FORWARD = np.ones(1)
"""A speed dx/ds for curves that have been seen not to turn back."""


@dataclass(frozen=True)
class Along:
    """What was evaluated along a graph in the person's own coordinates, in the sense that is minimised, at Q points.

    The abscissae ``x`` (Q,), ordinates and slopes (n, Q), L (Q,), its derivatives in the slopes, (n, Q) and (Q, n, n).
    """

    x: np.ndarray
    y: np.ndarray
    dy: np.ndarray
    value: np.ndarray
    momenta: np.ndarray
    curvature: np.ndarray


@dataclass(frozen=True)
class Extremal:
    """An extremal of a form: what every method produces.

    ``evaluate(s, k)`` gives the k-th derivative of the unknown functions at s
    (m,) as (n, m); ``unknowns`` are all unknown numbers of the form;
    ``vertices`` cut the interval where the curve may be less smooth.
    ``lambdas`` are the multipliers of ``form.integrals`` in the Lagrangian
    function integrand + sum of lambda_j g_j, and ``path`` those of pathwise
    conditions: functions of s by the index of the constraint.
    """

    form: Form
    evaluate: Callable[[np.ndarray, int], np.ndarray]
    unknowns: np.ndarray
    vertices: np.ndarray
    lambdas: np.ndarray
    path: Mapping[int, Callable[[np.ndarray], np.ndarray]]
    speed: np.ndarray | None = None
    """dx/ds at a number of points, where the method has it at hand."""
    coefficients: np.ndarray | None = None
    """Those of the curve in the basis of :class:`varcalc.numerics.mesh.Space`, where it was found so on one element."""
    along: Along | None = None
    """What was evaluated along the curve last, where the method has it at hand."""


class Deferred(Mapping[str, float]):
    """A mapping computed when it is first looked at."""

    def __init__(self, names: Sequence[str], compute: Callable[[], np.ndarray]) -> None:
        self._names, self._compute = tuple(names), compute
        self._values: dict[str, float] | None = None

    def _all(self) -> dict[str, float]:
        if self._values is None:
            self._values = {k: float(v) for k, v in zip(self._names, self._compute(), strict=True)}
        return self._values

    def __getitem__(self, key: str) -> float:
        return self._all()[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def __repr__(self) -> str:
        return repr(self._all())


def sample(extremal: Extremal, s: np.ndarray) -> list[np.ndarray]:
    """The arguments of a form's functions at s (m,): s, y, dy, ddy, parameters, unknowns, each with m columns."""
    form = extremal.form
    y, dy = extremal.evaluate(s, 0), extremal.evaluate(s, 1)
    ddy = extremal.evaluate(s, 2) if form.symbols.ddy.numel() else np.zeros((0, len(s)))
    numbers = [np.repeat(v[:, None], len(s), axis=1) for v in (form.problem.parameter_values, extremal.unknowns)]
    return [s[None, :], y, dy, ddy, *numbers]


def composite_gauss(vertices: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights of the composite Gauss rule on a mesh, each flat."""
    nodes, weights = gauss(count)
    half = 0.5 * np.diff(vertices)[:, None]
    return (vertices[:-1, None] + half * (1 + nodes)).ravel(), (half * weights).ravel()


def end_cost(extremal: Extremal) -> float:
    """The cost of the ends, in the sense that is minimised; 0 where there is none."""
    form = extremal.form
    if form.ends is None:
        return 0.0
    first, last = (extremal.evaluate(np.array([s]), 0)[:, 0] for s in form.span)
    return float(end_cost_function(form)(first, last, form.problem.parameter_values, extremal.unknowns))


@derived
def end_cost_function(form: Form) -> ca.Function:
    """The cost of the ends of a form that has any, as a function of (start, end, parameters, unknowns)."""
    assert form.ends is not None
    e, s = form.ends, form.symbols
    return ca.Function("cost", [e.start, e.end, s.parameters, s.unknowns], [e.cost])


def functional_value(extremal: Extremal, count: int) -> float:
    """The reported functional (with the person's sign) on the curve, by a Gauss rule of ``count`` points an element."""
    form = extremal.form
    s, weights = composite_gauss(extremal.vertices, count)
    values = np.asarray(functional(form)(*sample(extremal, s))).ravel()
    return form.sign * (float(weights @ values) + end_cost(extremal))


@derived
def functional(form: Form) -> ca.Function:
    """The reported functional's integrand as a function of ``symbols.all``."""
    return ca.Function("functional", form.symbols.all, [form.functional])


def sensitivities(extremal: Extremal, count: int) -> np.ndarray:
    """dJ/dparameter by the envelope theorem: the partial derivative of the Lagrangian function at fixed curve.

    To it comes what the parameters do by moving ends.
    """
    form = extremal.form
    s, weights = composite_gauss(extremal.vertices, count)
    arguments = sample(extremal, s)
    parameters = form.symbols.parameters
    conditions = {c.index: c for c in form.pathwise}
    rows = [(form.functional, np.ones_like(s))]
    rows += [(c.expression, np.full_like(s, lam)) for c, lam in zip(form.integrals, extremal.lambdas, strict=True)]
    rows += [(conditions[k].expression, mu(s)) for k, mu in extremal.path.items()]
    total = np.zeros(parameters.numel())
    for expression, factor in rows:
        function = ca.Function("partial", form.symbols.all, [ca.densify(ca.gradient(expression, parameters))])
        total += np.asarray(function(*arguments)) @ (weights * factor)
    if form.ends is not None and form.problem.end_cost is not None:
        e = form.ends
        partial = ca.Function(
            "partial",
            [e.start, e.end, parameters, form.symbols.unknowns],
            [ca.densify(ca.gradient(e.cost, parameters))],
        )
        first, last = (extremal.evaluate(np.array([t]), 0)[:, 0] for t in form.span)
        total += np.asarray(partial(first, last, form.problem.parameter_values, extremal.unknowns)).ravel()
    if not form.problem.end_parameters:
        return form.sign * total
    levels = multipliers(extremal) if form.problem.constraints else ()
    return form.sign * total + by_moved_ends(form.problem, person_curve(extremal), levels, extremal.unknowns)


def lift(form: Form, arguments: list[np.ndarray]) -> list[np.ndarray]:
    """The person's abscissa and ordinates and their derivatives by s: shapes (m,), (n, m), (m,), (n, m)."""
    assert form.lift is not None
    x, y, dx, dy = form.lift(arguments[0], arguments[1], arguments[2], arguments[5], arguments[4])
    return [np.asarray(x).ravel(), np.asarray(y), np.asarray(dx).ravel(), np.asarray(dy)]


def lifted(extremal: Extremal, s: np.ndarray) -> list[np.ndarray]:
    """:func:`lift` along an extremal at s (m,)."""
    return lift(extremal.form, sample(extremal, s))


def in_coordinates_of(form: Form, extremal: Extremal) -> Sampled | None:
    """The curve of an extremal in the coordinates of ``form``, where they are those it was found in; else None.

    They are where both changes of variable send the curve to the same place. Then nothing has to be inverted,
    which costs more than the solve that a curve is carried over for.
    """
    own = extremal.form
    if not (own.stated.is_lifted and form.stated.is_lifted) or (own.n, own.span) != (form.n, form.span):
        return None
    if len(form.unknown_guess) != len(extremal.unknowns):
        return None
    a, b = form.span
    arguments = sample(extremal, a + (b - a) * (np.arange(ALIKE_PLACES) + 0.5) / ALIKE_PLACES)
    here = lift(own, arguments)
    arguments[4] = np.repeat(form.problem.parameter_values[:, None], ALIKE_PLACES, axis=1)
    there = lift(form, arguments)
    for k in (0, 1):
        if not np.abs(there[k] - here[k]).max() <= ALIKE * np.abs(here[k]).max():
            return None
    return lambda s: extremal.evaluate(s, 0)


def _abscissae_to_s(extremal: Extremal, x: np.ndarray) -> np.ndarray:
    """The s at which the monotone abscissa x(s) takes the values x, by bisection from a table, then Newton."""
    a, b = extremal.form.span
    pieces = zip(extremal.vertices[:-1], extremal.vertices[1:], strict=True)
    table = np.unique(np.concatenate([np.linspace(left, right, 33) for left, right in pieces]))
    known = np.maximum.accumulate(lifted(extremal, table)[0])
    at = np.clip(np.searchsorted(known, x, side="right"), 1, len(table) - 1)
    low, high = table[at - 1].copy(), table[at].copy()
    s = 0.5 * (low + high)
    for _ in range(INVERSION_STEPS):
        value, _, speed, _ = lifted(extremal, s)
        miss = value - x
        low, high = np.where(miss <= 0, s, low), np.where(miss >= 0, s, high)
        with np.errstate(divide="ignore", invalid="ignore"):
            newton = s - miss / speed
        inside = np.isfinite(newton) & (newton >= low) & (newton <= high)
        following = np.where(inside, newton, 0.5 * (low + high))
        if np.all(np.abs(following - s) <= 1e-16 * (b - a)):
            break
        s = following
    s = np.where(x <= known[0], a, s)
    return np.where(x >= known[-1], b, s)


def person_curve(extremal: Extremal) -> Callable[[np.ndarray, int], np.ndarray]:
    """The curve (or its slope) as a function of the person's abscissa."""
    if not extremal.form.stated.is_lifted:
        return extremal.evaluate

    def curve(x: np.ndarray, derivative: int) -> np.ndarray:
        s = _abscissae_to_s(extremal, x)
        _, y, dx, dy = lifted(extremal, s)
        if derivative == 0:
            return y
        with np.errstate(divide="ignore", invalid="ignore"):
            return _slope_at_ends(extremal, s, dy / dx)

    return curve


def _slope_at_ends(extremal: Extremal, s: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """Replace 0 / 0 at a singular end by the limit: infinite, finite or zero as the slope grows towards it."""
    a, b = extremal.form.span
    for end, singular in zip((a, b), extremal.form.singular, strict=True):
        at = np.abs(s - end) <= 1e-12 * (b - a)
        if not singular or not at.any():
            continue
        inward = (b - a) * (1.0 if end == a else -1.0)
        _, _, dx, dy = lifted(extremal, end + inward * np.array(APPROACH))
        far, near = (dy / dx).T
        grown = np.where(np.abs(near) > 2 * np.abs(far), np.sign(near) * np.inf, near)
        slope[:, at] = np.where(np.abs(near) < np.abs(far) / 2, 0.0, grown)[:, None]
    return slope


def person_nodes(extremal: Extremal, nodes: np.ndarray) -> np.ndarray:
    """Nodes in s as abscissae of the person's."""
    problem = extremal.form.problem
    fixed = isinstance(problem, Problem) and not (
        isinstance(problem.start, OnCurve) or isinstance(problem.end, OnCurve)
    )
    if fixed and len(nodes) == 2:
        return np.array(problem.span)
    return nodes if not extremal.form.stated.is_lifted else lifted(extremal, nodes)[0]


def multipliers(extremal: Extremal) -> tuple[Any, ...]:
    """One entry for each constraint: dJ/dlevel, a function of x for pathwise ones, None for a waypoint."""
    form = extremal.form
    levels = {c.index: lam for c, lam in zip(form.integrals, extremal.lambdas, strict=True)}
    out: list[Any] = []
    for i, constraint in enumerate(form.problem.constraints):
        if isinstance(constraint, Isoperimetric):
            # the Lagrangian function is J + lambda (G - level), so J changes by -lambda with the level
            out.append(-form.sign * float(levels[i]))
        else:
            out.append(extremal.path.get(i) and _of_abscissa(extremal, i))
    return tuple(out)


def _of_abscissa(extremal: Extremal, index: int) -> Callable[[Any], Any]:
    mu, sign = extremal.path[index], extremal.form.sign

    def multiplier(x: Any) -> Any:
        at = np.asarray(x, dtype=float)
        if not extremal.form.stated.is_lifted:
            density = mu(at.ravel())
        else:  # a density in s is stated in the person's abscissa
            s = _abscissae_to_s(extremal, at.ravel())
            density = mu(s) / lifted(extremal, s)[2]
        values = sign * density.reshape(at.shape)
        return float(values) if at.ndim == 0 else values

    return multiplier


def _turns_back(extremal: Extremal, curve_error: float) -> bool:
    """Whether the abscissa decreases, by more than the curve's error, along a curve that should be a graph."""
    speed = extremal.speed
    if speed is None:
        speed = lifted(extremal, composite_gauss(extremal.vertices, 16)[0])[2]
    span = extremal.form.problem.span
    return bool(speed.min() < -(1e-9 + TURNED * curve_error / (span[1] - span[0])) * np.abs(speed).max())


def answer(
    extremal: Extremal,
    method: Any,
    value: float,
    error: ErrorEstimate,
    nodes: np.ndarray,
    stats: Stats,
    status: Status = Status.SOLVED,
    message: str = "",
    rule: int = 32,
) -> Solution:
    """The Solution for an extremal: ``value`` with the person's sign, ``nodes`` in s.

    ``rule`` is the number of Gauss points an element for what is integrated on demand.
    """
    problem = extremal.form.problem
    if extremal.form.energetic and isinstance(problem, Problem) and _turns_back(extremal, error.curve):
        return no_answer(
            problem, method, Status.REFUSED,
            "the shortest curve turns back in x: it is no graph, and among graphs the infimum is not attained; "
            "state the problem as a Curve",
            Verdict.NOT_ATTAINED, stats,
        )  # fmt: skip
    found = Solution(
        problem=problem,
        method=method,
        status=status,
        value=value,
        error=error,
        x=person_nodes(extremal, nodes),
        curve=person_curve(extremal),
        multipliers=multipliers(extremal) if problem.constraints else (),
        sensitivities=Deferred(tuple(problem.parameters), lambda: sensitivities(extremal, rule)),
        unknowns=dict(zip(problem.unknowns, map(float, extremal.unknowns), strict=False)),
        stats=stats,
        message=message,
        extremal=extremal,
    )
    known = extremal.coefficients
    return defined(found, extremal.evaluate(nodes, 0) if known is None else known)
