"""From an extremal in the coordinates of a form to a :class:`Solution` in the person's own."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from varcalc.formulation import Form, Sampled
from varcalc.formulation.form import second_lift
from varcalc.formulation.singular import forms, number_of
from varcalc.methods.moved_ends import by_what_moves
from varcalc.numerics.mesh import CurveOrSlope, SpaceCurve, composite_gauss
from varcalc.numerics.resampled import Resampled, SentResampled, resampled
from varcalc.problem.breaks import moving_breaks
from varcalc.problem.conditions import Isoperimetric
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Curve, Problem
from varcalc.solution import ErrorEstimate, Solution, Stats, Status, Verdict, defined, no_answer
from varcalc.symbolic.derived import derived
from varcalc.symbolic.evaluation import in_columns

TURNED_BACK = 30.0
"""Factor by which a backward speed must exceed the relative error of all speeds to be believed."""
APPROACH = (2e-3, 2e-4)
"""Relative distances from a singular end between which the growth of the slope is judged."""
ASTRAY, ASTRAY_SHARE = 2e-2, 30.0
"""Relative error of the curve, and the same by the square root of the tolerance, with which no value counts."""
INVERSION_STEPS = 60
"""Bisections that bring any bracket to round-off."""
TABLED_A_PIECE = 33
"""Places of each element from between which an abscissa is inverted."""
PLACES_A_PIECE = 16
"""Places of each element at which it is seen whether a curve runs forwards."""
ALIKE_PLACES = 7
SAME_PLACE = 1e-6
"""Distance, in units of the curve, up to which two changes of variable send a curve to the same place."""
RISE_PLACES = 1001
RISE_NOISE, RISE_LEAST, BEND_LEAST = 1e-5, 1e-5, 1e-4
"""Slope below zero, relative to the largest, that is made of rounding, and slope and bend at an end that are none."""


SEEN_FORWARD = np.ones(1)
"""A speed dx/ds for curves that have been seen not to turn back."""


@dataclass(frozen=True)
class AlongGraph:
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
class SampledExtremal:
    """Where a method evaluated the problem: ascending ``s`` (m,), the user's ``x`` (m,), ordinates, slopes (n, m)."""

    s: np.ndarray
    x: np.ndarray
    y: np.ndarray
    dy: np.ndarray


@dataclass(frozen=True)
class Extremal:
    """An extremal of a form: what every method produces.

    ``evaluate(s, k)`` gives the k-th derivative of the unknown functions at s
    (m,) as (n, m); ``unknowns`` are all unknown numbers of the form;
    ``vertices`` cut the interval where the curve may be less smooth.
    ``lambdas`` are the multipliers of ``form.conditions.integrals`` in the Lagrangian
    function integrand + sum of lambda_j g_j, and ``path`` those of pathwise
    conditions: functions of s by the index of the constraint.
    """

    form: Form
    evaluate: CurveOrSlope
    unknowns: np.ndarray
    vertices: np.ndarray
    lambdas: np.ndarray
    path: Mapping[int, Callable[[np.ndarray], np.ndarray]]
    speed: np.ndarray | None = None
    """dx/ds at a number of points, where the method has it at hand."""
    coefficients: np.ndarray | None = None
    """Those of the curve in the basis of :class:`varcalc.numerics.mesh.Space`, where it was found so on one element."""
    along: AlongGraph | None = None
    """What was evaluated along the curve last, where the method has it at hand."""
    in_a_row: int = 0
    """How many solutions in a row, up to this one, were each begun from the one before."""
    forces: np.ndarray = field(default_factory=lambda: np.zeros(0))
    """Multipliers of the equations between ends and knots, where the method has them at hand."""
    samples: SampledExtremal | None = None
    """Where the problem was evaluated along the curve, where the method has that at hand."""

    @property
    def at_ends(self) -> tuple[np.ndarray, np.ndarray]:
        """The functions (n,) at the start and at the end."""
        first, last = (self.evaluate(np.array([s]), 0)[:, 0] for s in self.form.span)
        return first, last

    @cached_property
    def abscissae(self) -> tuple[np.ndarray, np.ndarray]:
        """Ascending s (m,), close together in every element, and the user's x there, ascending as well."""
        pieces = zip(self.vertices[:-1], self.vertices[1:], strict=True)
        table = np.unique(np.concatenate([np.linspace(left, right, TABLED_A_PIECE) for left, right in pieces]))
        return table, np.maximum.accumulate(lifted(self, table)[0])

    def __reduce__(self) -> tuple[Any, ...]:
        number = number_of(self.form)
        if number is None:  # the curve travels with the solution, in the user's own coordinates
            return _no_extremal, ()
        marks = [*self.form.span, *self.vertices]
        lasting = isinstance(self.evaluate, SpaceCurve | Resampled)
        evaluate = self.evaluate if lasting else resampled(self.evaluate, marks, 1 + self.form.order)
        path = {k: _resampled_density(mu, marks) for k, mu in self.path.items()}
        others = (self.speed, self.coefficients, self.along)
        return _of_form, (
            self.form.problem, number, evaluate, self.unknowns, self.vertices, self.lambdas, path, *others,
        )  # fmt: skip


def _of_form(problem: Functional, number: int, *parts: Any) -> Extremal:
    return Extremal(forms(problem)[number], *parts)


def _no_extremal() -> None:
    return None


@dataclass(frozen=True, eq=False)
class _Density:
    """A function of one number, by its polynomials."""

    curve: Resampled

    def __call__(self, s: np.ndarray) -> np.ndarray:
        return self.curve(s, 0)[0]


def _resampled_density(density: Callable[[np.ndarray], np.ndarray], marks: Iterable[float]) -> _Density:
    lasting = isinstance(density, _Density)
    return density if lasting else _Density(resampled(lambda s, _: density(s)[None], marks, 1))


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

    def __reduce__(self) -> tuple[Any, ...]:
        return dict, (self._all(),)


def sample(extremal: Extremal, s: np.ndarray) -> list[np.ndarray]:
    """The arguments of a form's functions at s (m,): s, y, dy, ddy, parameters, unknowns, each with m columns."""
    form = extremal.form
    y, dy = extremal.evaluate(s, 0), extremal.evaluate(s, 1)
    ddy = extremal.evaluate(s, 2) if form.symbols.ddy.numel() else np.zeros((0, len(s)))
    numbers = in_columns(len(s), form.problem.parameter_values, extremal.unknowns)
    return [s[None, :], y, dy, ddy, *numbers]


def end_cost(extremal: Extremal) -> float:
    """The cost of the ends, in the sense that is minimised; 0 where there is none."""
    form = extremal.form
    if form.ends.joint is None:
        return 0.0
    return cost_between(form, *extremal.at_ends, extremal.unknowns)


def cost_between(form: Form, start: np.ndarray, end: np.ndarray, unknowns: np.ndarray) -> float:
    """The same of ends at which a form's functions (n,) are known."""
    if form.ends.joint is None:
        return 0.0
    return float(_end_cost(form)(start, end, form.problem.parameter_values, unknowns))


@derived
def _end_cost(form: Form) -> ca.Function:
    assert form.ends.joint is not None
    e, s = form.ends.joint, form.symbols
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
    conditions = {c.index: c for c in form.conditions.pathwise}
    rows = [(form.functional, np.ones_like(s))]
    rows += [
        (c.expression, np.full_like(s, lam)) for c, lam in zip(form.conditions.integrals, extremal.lambdas, strict=True)
    ]
    rows += [(conditions[k].expression, mu(s)) for k, mu in extremal.path.items()]
    total = np.zeros(parameters.numel())
    for expression, factor in rows:
        function = ca.Function("partial", form.symbols.all, [ca.densify(ca.gradient(expression, parameters))])
        total += np.asarray(function(*arguments)) @ (weights * factor)
    if form.ends.joint is not None and form.problem.end_cost is not None:
        e = form.ends.joint
        partial = ca.Function(
            "partial",
            [e.start, e.end, parameters, form.symbols.unknowns],
            [ca.densify(ca.gradient(e.cost, parameters))],
        )
        total += np.asarray(partial(*extremal.at_ends, form.problem.parameter_values, extremal.unknowns)).ravel()
    total += _by_moved_surfaces(extremal)
    problem = form.problem
    levels = multipliers(extremal) if problem.constraints and (problem.end_parameters or moving_breaks(problem)) else ()
    return form.sign * total + by_what_moves(problem, person_curve(extremal), levels, extremal.unknowns)


def of_energy(solution: Solution) -> bool:
    """Whether a curve in space was found by the problem of its energy, the square of its functional."""
    extremal = solution.extremal
    return extremal is not None and isinstance(solution.problem, Curve) and isinstance(extremal.form.problem, Problem)


def _by_moved_surfaces(extremal: Extremal) -> np.ndarray | float:
    """What parameters do by moving the surfaces on which a curve has its corners: the forces there do that work."""
    form, joint = extremal.form, extremal.form.ends.joint
    if joint is None or not ca.depends_on(joint.equations, form.symbols.parameters):
        return 0.0
    inside = [here for _, _, here in joint.inside]
    given = [joint.start, joint.end, form.symbols.parameters, form.symbols.unknowns, *inside]
    moved = ca.Function("moved", given, [ca.densify(ca.jacobian(joint.equations, form.symbols.parameters))])
    width = form.span[1] - form.span[0]
    held = [extremal.evaluate(np.array([at]), k)[:, 0] * width**k for at, k, _ in joint.inside]
    rates = np.asarray(moved(*extremal.at_ends, form.problem.parameter_values, extremal.unknowns, *held))
    return extremal.forces @ rates


def lift(form: Form, arguments: list[np.ndarray]) -> list[np.ndarray]:
    """The person's abscissa and ordinates and their derivatives by s: shapes (m,), (n, m), (m,), (n, m)."""
    assert form.lift is not None
    s, y, dy, _, parameters, unknowns = arguments
    x, *others = form.lift(s.size, s.reshape(-1, 1), y.T, dy.T, unknowns.T, parameters.T).T
    n = len(others) // 2
    return [x, np.array(others[:n]), others[n], np.array(others[n + 1 :])]


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
    if len(form.start.unknowns) != len(extremal.unknowns):
        return None
    a, b = form.span
    arguments = sample(extremal, a + (b - a) * (np.arange(ALIKE_PLACES) + 0.5) / ALIKE_PLACES)
    here = lift(own, arguments)
    arguments[4] = np.repeat(form.problem.parameter_values[:, None], ALIKE_PLACES, axis=1)
    there = lift(form, arguments)
    for k in (0, 1):
        if not np.abs(there[k] - here[k]).max() <= SAME_PLACE * np.abs(here[k]).max():
            return None
    return lambda s: extremal.evaluate(s, 0)


def _abscissae_to_s(extremal: Extremal, x: np.ndarray) -> np.ndarray:
    """The s at which the monotone abscissa x(s) takes the values x, from the chords of a table by Newton."""
    (a, b), (table, known) = extremal.form.span, extremal.abscissae
    s = np.where(x <= known[0], a, b)
    left = np.flatnonzero((x > known[0]) & (x < known[-1]))
    at = np.clip(np.searchsorted(known, x[left], side="right"), 1, len(table) - 1)
    low, high = table[at - 1], table[at]
    s[left] = low + (high - low) * (x[left] - known[at - 1]) / (known[at] - known[at - 1])
    for _ in range(INVERSION_STEPS):
        if not len(left):
            break
        here, there = s[left], x[left]
        value, _, speed, _ = lifted(extremal, here)
        miss = value - there
        low, high = np.where(miss <= 0, here, low), np.where(miss >= 0, here, high)
        with np.errstate(divide="ignore", invalid="ignore"):
            newton = here - miss / speed
        inside = np.isfinite(newton) & (newton >= low) & (newton <= high)
        following = np.where(inside, newton, 0.5 * (low + high))
        # beyond that a step is made of the round-off of x(s), however often it is taken
        settled = np.abs(following - here) <= np.finfo(float).eps * (b - a)
        going = ~(settled | (np.abs(miss) <= 2 * np.spacing(np.abs(there))))
        left, low, high = left[going], low[going], high[going]
        s[left] = following[going]
    knots = np.array(extremal.form.conditions.knots)
    if len(knots):
        # beside a place at which dx/ds vanishes many s have the same x but for round-off, and the curve is steep
        at, _, speed, _ = lifted(extremal, knots)
        slowest = np.lexsort((np.abs(speed), at))
        places, first = np.unique(at[slowest], return_index=True)
        which = np.minimum(np.searchsorted(places, x), len(places) - 1)
        s = np.where(x == places[which], knots[slowest][first[which]], s)
    return s


def person_curve(extremal: Extremal) -> CurveOrSlope:
    """The curve (or its slope) as a function of the person's abscissa."""
    return UserCurve(extremal)


@dataclass(frozen=True, eq=False)
class UserCurve(SentResampled):
    """The curve of an extremal, and its slope, at abscissae of the user's."""

    extremal: Extremal
    _last: list[tuple[bytes, list[np.ndarray]]] = field(default_factory=list, init=False, repr=False)

    @property
    def order(self) -> int:
        """That of the functional."""
        return self.extremal.form.order

    @property
    def nodes(self) -> np.ndarray:
        """Abscissae at which it may be less smooth."""
        return person_nodes(self.extremal, self.extremal.vertices)

    def __call__(self, x: np.ndarray, derivative: int) -> np.ndarray:
        """The curve (derivative 0), its slope (1) or, at second order, that one's (2) at x (m,), shape (n, m)."""
        extremal = self.extremal
        if not extremal.form.stated.is_lifted:
            return extremal.evaluate(x, derivative)
        s, y, dx, dy = self._lifted(x)
        if derivative == 0:
            return y.copy()
        if derivative == 2:
            return _bend(extremal, s, dx, dy)
        with np.errstate(divide="ignore", invalid="ignore"):
            return _slope_at_ends(extremal, s, dy / dx)

    def _lifted(self, x: np.ndarray) -> list[np.ndarray]:
        """The s of abscissae x (m,), the ordinates there, and dx/ds and theirs.

        They are kept until others are asked for: who asks for the curve asks for its slope next.
        """
        key, last = x.tobytes(), self._last[-1:]
        if last and last[0][0] == key:
            return last[0][1]
        s = _abscissae_to_s(self.extremal, x)
        found = [s, *lifted(self.extremal, s)[1:]]
        self._last[:] = [(key, found)]
        return found

    def __reduce__(self) -> tuple[Any, ...]:
        extremal = self.extremal
        if number_of(extremal.form) is not None:
            return UserCurve, (extremal,)
        if not extremal.form.stated.is_lifted and isinstance(extremal.evaluate, SpaceCurve | Resampled):
            return _as_it_is, (extremal.evaluate,)
        return super().__reduce__()


def _as_it_is(curve: SpaceCurve | Resampled) -> SpaceCurve | Resampled:
    return curve


def _bend(extremal: Extremal, s: np.ndarray, dx: np.ndarray, dy: np.ndarray) -> np.ndarray:
    """The second derivative (n, m) by the user's abscissa at s (m,), with the first ones by s."""
    at, y, slope, bend, parameters, unknowns = sample(extremal, s)
    ddx, ddy = (np.asarray(v) for v in second_lift(extremal.form)(at, y, slope, bend, unknowns, parameters))
    return (ddy - dy / dx * ddx) / dx**2


def _slope_at_ends(extremal: Extremal, s: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """Replace 0 / 0 at a singular end by the limit: infinite, finite or zero as the slope grows towards it."""
    a, b = extremal.form.span
    for end, singular in zip((a, b), extremal.form.coordinates.singular, strict=True):
        at = np.abs(s - end) <= 1e-12 * (b - a)
        if not singular or not at.any():
            continue
        inward = (b - a) * (1.0 if end == a else -1.0)
        _, _, dx, dy = lifted(extremal, end + inward * np.array(APPROACH))
        far, near = (dy / dx).T
        limit = near + (near - far) * APPROACH[1] / (APPROACH[0] - APPROACH[1])  # it is smooth in s
        grown = np.where(np.abs(near) > 2 * np.abs(far), np.sign(near) * np.inf, limit)
        slope[:, at] = np.where(np.abs(near) < np.abs(far) / 2, 0.0, grown)[:, None]
    return slope


def person_nodes(extremal: Extremal, nodes: np.ndarray) -> np.ndarray:
    """Nodes in s as abscissae of the person's."""
    problem = extremal.form.problem
    fixed = isinstance(problem, Problem) and not any(problem.slides)
    if fixed and len(nodes) == 2:
        return np.array(problem.span)
    return nodes if not extremal.form.stated.is_lifted else lifted(extremal, nodes)[0]


def multipliers(extremal: Extremal) -> tuple[Any, ...]:
    """One entry for each constraint: dJ/dlevel, a function of x for pathwise ones, None for a waypoint."""
    form = extremal.form
    levels = {c.index: lam for c, lam in zip(form.conditions.integrals, extremal.lambdas, strict=True)}
    out: list[Any] = []
    for i, constraint in enumerate(form.problem.constraints):
        if isinstance(constraint, Isoperimetric):
            # the Lagrangian function is J + lambda (G - level), so J changes by -lambda with the level; a form that
            # leaves a level out is one that it does not hold
            out.append(-form.sign * float(levels.get(i, 0.0)))
        else:
            out.append(Multiplier(_PathDensity(extremal, i)) if i in extremal.path else None)
    return tuple(out)


@dataclass(frozen=True, eq=False)
class Multiplier:
    """The multiplier of a pathwise condition as a function of the user's abscissa, a number or an array."""

    density: Callable[[np.ndarray], np.ndarray]

    def __call__(self, x: Any) -> Any:
        """The multiplier at x, in its shape."""
        at = np.asarray(x, dtype=float)
        values = self.density(at.ravel()).reshape(at.shape)
        return float(values) if at.ndim == 0 else values


@dataclass(frozen=True, eq=False)
class _PathDensity:
    """The multiplier of constraint ``index`` of an extremal, at abscissae of the user's."""

    extremal: Extremal
    index: int

    def __call__(self, x: np.ndarray) -> np.ndarray:
        extremal, mu = self.extremal, self.extremal.path[self.index]
        if not extremal.form.stated.is_lifted:
            return extremal.form.sign * mu(x)
        # a density in s is stated in the user's abscissa
        s = _abscissae_to_s(extremal, x)
        return extremal.form.sign * (mu(s) / lifted(extremal, s)[2])

    def __reduce__(self) -> tuple[Any, ...]:
        if number_of(self.extremal.form) is not None:
            return _PathDensity, (self.extremal, self.index)
        return _Density, (_resampled_density(self, person_nodes(self.extremal, self.extremal.vertices)).curve,)


def runs_forwards(extremal: Extremal) -> bool:
    """Whether no piece of a curve with corners at unknown abscissae has turned inside out."""
    points = np.concatenate([composite_gauss(extremal.vertices, PLACES_A_PIECE)[0], extremal.form.span])
    return bool(lifted(extremal, points)[2].min() > 0.0)


def _turns_back(extremal: Extremal, value: float, error: float) -> bool:
    """Whether the abscissa decreases, by more than its error, along a curve that should be a graph.

    ``value`` is that of the curve's length, and ``error`` its error.
    """
    speed = extremal.speed
    if speed is SEEN_FORWARD:
        return False
    if speed is None:
        points = np.concatenate([composite_gauss(extremal.vertices, PLACES_A_PIECE)[0], extremal.form.span])
        speed = lifted(extremal, points)[2]
        speed = speed[np.isfinite(speed)]  # an end may be singular
    return bool(speed.min() < -speed_error(value, error) * np.abs(speed).max())


def with_ends(s: np.ndarray, speed: np.ndarray, span: tuple[float, float]) -> np.ndarray:
    """The speeds (.., Q) at the points s (Q,) of a rule and, last, at the two ends of ``span``, which are none of them.

    A curve that is to turn back does so at an end first. The speeds there are those of the parabola through the last
    three and what it differs by from the tangent, by which the true ones may be larger: they may vanish at an end.
    """
    ends = []
    for end, (i, j, k) in zip(span, ((0, 1, 2), (-1, -2, -3)), strict=True):
        first = (speed[..., i] - speed[..., j]) / (s[..., i] - s[..., j])
        second = (speed[..., j] - speed[..., k]) / (s[..., j] - s[..., k])
        tangent = speed[..., i] + (end - s[..., i]) * first
        bend = (end - s[..., i]) * (end - s[..., j]) * (first - second) / (s[..., i] - s[..., k])
        ends.append(tangent + bend + np.abs(bend))
    return np.concatenate([speed, np.stack(ends, axis=-1)], axis=-1)


def speed_error(value: Any, error: Any) -> Any:
    """The error of the speeds along a curve of a certain length, relative to the largest, that is sure to cover them.

    The length lies above the least one by their square. How far a curve is moved at an abscissa says nothing of it
    where the curve is upright, which is where it turns.
    """
    return 1e-9 + TURNED_BACK * np.sqrt(error / np.maximum(np.abs(value), error))


def unsettled(tol: float) -> float:
    """The error of a curve, relative to its size, that belies its value: it does not settle, and none may attain it."""
    return max(ASTRAY, ASTRAY_SHARE * tol**0.5)


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
    if (
        extremal.form.coordinates.energetic
        and isinstance(problem, Problem)
        and _turns_back(extremal, value, error.value)
    ):
        return no_answer(
            problem, method, Status.REFUSED,
            "the shortest curve turns back in x: it is no graph, and among graphs the infimum is not attained; "
            "state the problem as a Curve",
            Verdict.NOT_ATTAINED, stats,
        )  # fmt: skip
    if extremal.form.runs_back(extremal.unknowns):
        return no_answer(
            problem, method, Status.NOT_CONVERGED,
            "the curve found runs backwards: the end that slides lies before the start, where no graph leads; "
            "another guess of its abscissa may lead to a curve that runs forwards",
            stats=stats,
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


def rises_throughout(form: Form, curve: CurveOrSlope) -> bool:
    """Whether the slope of a curve of one function has one sign from end to end, where the integrand does not hold s.

    That slope solves Jacobi's equation then, and a solution without a zero shows that no point is conjugate to the
    start (Gelfand and Fomin, sect. 26), however soft the mode: that of a kink that is hardly held falls exponentially
    toward the ends. A slope that goes to zero there in a straight line has zeros: the ends are conjugate.
    """
    if form.n > 1 or form.order > 1 or ca.depends_on(form.integrand, form.symbols.x):
        return False
    inside = form.conditions.pathwise or form.conditions.integrals or form.held or len(form.start.unknowns)
    if inside or not form.ends.separate or form.refused:  # knots do no harm: the integrand does not change there
        return False
    s = np.linspace(*form.span, RISE_PLACES)
    slope = curve(s, 1)[0]
    slope = slope * np.sign(slope.sum())
    bend = np.abs(np.gradient(slope))
    size = slope.max()
    if not size > 0.0 or slope.min() < -RISE_NOISE * size:
        return False
    return all(slope[k] > RISE_LEAST * size or bend[k] <= BEND_LEAST * bend.max() for k in (0, -1))
