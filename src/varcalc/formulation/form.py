"""The form itself, and what all forms share: side conditions, ends, changes of variable, lines to start from."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import casadi as ca
import numpy as np

from varcalc.formulation.numbers import Numbers
from varcalc.numerics.mesh import apart
from varcalc.problem.conditions import Bound, Holonomic, Isoperimetric
from varcalc.problem.functional import Functional, Symbols
from varcalc.symbolic.derived import Cache, derived
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.tracing import Expression

Sampled = Callable[[np.ndarray], np.ndarray]
"""A curve to start from: abscissae (m,) to ordinates (n, m)."""


Waypoints = tuple[tuple[float, tuple[float, ...]], ...]
"""Abscissae, and the values demanded there."""


@dataclass(frozen=True)
class SideCondition:
    """``lower <= expression <= upper``, integrated (isoperimetric) or at every point (pathwise)."""

    expression: Expression
    lower: float
    upper: float
    index: int
    """Position of the constraint in ``problem.constraints``."""
    where: tuple[float, float] | None = None
    """The interval of s on which a pathwise condition is asked; None for all of it."""
    smoothly: tuple[bool, bool] = (False, False)
    """Whether a curve comes to that interval, and leaves it, with the slope that the condition gives along it."""

    @property
    def bounds(self) -> tuple[float, float]:
        """The lower and the upper bound."""
        return self.lower, self.upper

    @property
    def equality(self) -> bool:
        """True when both bounds coincide."""
        return self.lower == self.upper


@dataclass(frozen=True)
class EndConditions:
    """Cost of the ends and equations between them, in symbols of their own.

    ``equations`` (a column, zero on admissible curves) and ``cost`` (a scalar)
    are expressions in ``start`` and ``end``, the unknown functions at the two
    ends, in those at the knots ``inside``, or their derivatives (times the length of the
    interval to that power), each with its abscissa and the number of times it is
    differentiated, and in the parameters and unknowns of the form.
    """

    start: Expression
    end: Expression
    equations: Expression
    cost: Expression
    inside: tuple[tuple[float, int, Expression], ...] = ()

    @property
    def places(self) -> list[Expression]:
        """The unknown functions at the ends, and at knots inside."""
        return [self.start, self.end, *(y for *_, y in self.inside)]


@dataclass(frozen=True)
class Elsewhere:
    """A form at other parameter values, some of which may move its ends.

    ``placed`` takes values (K, parameters) to the spans of s (K, 2) and to what is fixed at the start and the end,
    each (K, functions), NaN where it is free. ``form`` makes the form of a problem. Both hold where ``alike``, from
    values to (K,) of bool, finds that the ends, singular or not, are what they are here.
    """

    placed: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]
    form: Callable[[Functional], Form]
    alike: Callable[[np.ndarray], np.ndarray]


class Stated:
    """What a form says: its symbols, the ``integrand`` that is minimised, the ``functional`` that is reported.

    ``lifted`` holds the user's abscissa and ordinates and their derivatives by s; None when they are the same.
    """

    def __init__(
        self,
        symbols: Symbols,
        integrand: Expression,
        functional: Expression,
        lifted: tuple[Expression, Expression, Expression, Expression] | None = None,
    ) -> None:
        self.symbols: Symbols = symbols
        self.integrand: Expression = integrand
        self.functional: Expression = functional
        self.lifted: tuple[Expression, Expression, Expression, Expression] | None = lifted
        self.n: int = int(symbols.y.numel())
        self.is_lifted: bool = lifted is not None
        self.same_functional: bool = functional is integrand


class StatedLater:
    """What a form of ``n`` functions in coordinates of its own says, stated by ``make`` when it is first asked for.

    A method that has the form's numbers need not ask.
    """

    is_lifted: bool = True
    same_functional: bool = False

    def __init__(self, n: int, make: Callable[[], Stated]) -> None:
        self.n: int = n
        self._make = make

    def __getattr__(self, name: str) -> Any:
        """One of the expressions, for which all of them are made."""
        if name not in ("symbols", "integrand", "functional", "lifted"):
            raise AttributeError(name)
        self.__dict__.update(vars(self._make()))
        return self.__dict__[name]


@dataclass(frozen=True)
class Coordinates:
    """How curves are written: on ``span``, in the expressions that are ``stated``; ``pull`` brings the user's there."""

    stated: Stated | StatedLater
    span: tuple[float, float] = (0.0, 1.0)
    pull: Callable[[Sampled], Sampled] = lambda curve: curve
    note: str = ""
    energetic: bool = False
    """True when the integral of the square of the functional's integrand is what is minimised."""
    least_degree: int = 1
    """Degree of a polynomial below which the extremal is known not to be resolved."""
    singular: tuple[bool, bool] = (False, False)
    """Ends where abscissa and ordinate were given powers, so that their derivatives by s vanish."""
    weak_only: bool = False
    """True when regularity alone decides at a singular end: no boundary condition exists for an indirect method."""
    gauged: bool = False
    """True when the last unknown number is the constant speed of a Curve."""
    one_sided: tuple[int, ...] = ()
    """Functions that stay positive: beyond zero they would describe the mirror image, another curve."""
    corners: int = 0
    """How many of the unknown numbers are abscissae of corners."""
    numbers: Numbers | None = None
    """The integrand as numbers, where they are known without its expression."""


@dataclass(frozen=True)
class Ends:
    """What is asked at the ends: ``start[k, a]`` is the value of the k-th derivative of function a, NaN where free.

    The first ``periodic`` functions end as they begin.
    """

    start: np.ndarray
    end: np.ndarray
    joint: EndConditions | None = None
    """Cost of the ends and equations between them."""
    periodic: int = 0

    @property
    def separate(self) -> bool:
        """True where each end is fixed or free by itself: neither slides, costs anything, or is both."""
        return self.joint is None and not self.periodic

    @property
    def equations(self) -> int:
        """How many equations tie the ends."""
        return 0 if self.joint is None else int(self.joint.equations.numel())


@dataclass(frozen=True)
class Conditions:
    """What is asked between the ends.

    ``knots`` are abscissae that must be vertices of every mesh, where slopes may jump; ``waypoints`` pairs of a knot
    and the values demanded there.
    """

    integrals: tuple[SideCondition, ...] = ()
    pathwise: tuple[SideCondition, ...] = ()
    knots: tuple[float, ...] = ()
    waypoints: Waypoints = ()


@dataclass(frozen=True)
class Start:
    """The first ``curve`` to try, first guesses of the ``unknowns``, and directions in which to bend the curve."""

    curve: Sampled
    unknowns: np.ndarray
    bumps: np.ndarray


@dataclass(frozen=True, eq=False)
class Form:
    """A functional on a fixed interval, ready for any method: coordinates, ends, conditions and a start.

    What is reported is the functional that is stated, times ``sign``. Two forms are one where they are the same object.
    """

    problem: Functional
    coordinates: Coordinates
    ends: Ends
    conditions: Conditions
    start: Start
    refused: str = ""
    """Why nothing that samples the integrand near an end can resolve it; empty where it can be tried."""
    cache: Cache = field(default_factory=Cache, repr=False)
    """What methods derive from the expressions; shared by copies for other parameter values."""
    elsewhere: Elsewhere | None = None
    """How the same expressions serve at other parameter values; None where they may not."""

    @property
    def span(self) -> tuple[float, float]:
        """The interval of the reference variable."""
        return self.coordinates.span

    @property
    def sign(self) -> float:
        """-1.0 where the functional is to be greatest."""
        return self.problem.sign

    def on_mesh(self, vertices: Sequence[float]) -> Form:
        """The form with more ``vertices`` that every mesh has, but those within round-off of others or of an end."""
        knots = tuple(sorted([*self.conditions.knots, *apart(vertices, [*self.span, *self.conditions.knots])]))
        if knots == self.conditions.knots:
            return self
        return replace(self, conditions=replace(self.conditions, knots=knots), cache=Cache())

    @property
    def stated(self) -> Stated | StatedLater:
        """What the form says."""
        return self.coordinates.stated

    @property
    def symbols(self) -> Symbols:
        """What the expressions are written in."""
        return self.stated.symbols

    @property
    def integrand(self) -> Expression:
        """What is minimised."""
        return self.stated.integrand

    @property
    def functional(self) -> Expression:
        """What is reported, times ``sign``."""
        return self.stated.functional

    @property
    def lifted(self) -> tuple[Expression, Expression, Expression, Expression] | None:
        """The user's abscissa and ordinates and their derivatives by s; None when they are the same."""
        return self.stated.lifted

    @property
    def lift(self) -> PointEvaluator | None:
        """:attr:`lifted` as a function of (s, y, dy, unknowns, parameters), at any number of points."""
        return _lift(self) if self.stated.is_lifted else None

    @property
    def n(self) -> int:
        """Number of unknown functions of the form."""
        return self.stated.n

    @property
    def order(self) -> int:
        """Highest derivative in the integrand."""
        return self.problem.order

    @property
    def same_functional(self) -> bool:
        """True when what is minimised is what is reported."""
        return self.stated.same_functional

    @property
    def plainly_reported(self) -> bool:
        """True when a curve is reported as it is minimised: the same functional, the same coordinates."""
        return self.same_functional and not self.stated.is_lifted

    def runs_back(self, unknowns: np.ndarray) -> bool:
        """Whether no curve with these ``unknowns`` (m,) runs forwards: an end that slides has passed the other."""
        width = self.width
        return width is not None and not float(width(unknowns, self.problem.parameter_values)) > 0

    @property
    def width(self) -> ca.Function | None:
        """The interval's length as a function of (unknowns, parameters) where an end slides; None elsewhere."""
        slides = self.stated.is_lifted and len(self.start.unknowns) > len(self.problem.unknowns)
        return _width(self) if slides else None

    @property
    def bare(self) -> bool:
        """True where curves run between separate ends under levels at most: smooth, and without unknown numbers."""
        inside = self.conditions.pathwise or self.conditions.knots or len(self.start.unknowns)
        return self.ends.separate and not inside and not self.refused

    @property
    def held(self) -> tuple[float, ...]:
        """Abscissae where curves are held: waypoints, and where they go through surfaces of kinks and jumps."""
        inside = () if self.ends.joint is None else self.ends.joint.inside
        return tuple(sorted({at for at, *_ in (*self.conditions.waypoints, *inside)}))

    @property
    def rides(self) -> tuple[tuple[float, float], ...]:
        """Stretches along which curves follow a surface on which the problem has a kink."""
        return tuple(c.where for c in self.conditions.pathwise if c.index < 0 and c.equality and c.where is not None)

    @property
    def broken_at_switches(self) -> bool:
        """True where curves go through surfaces on which the problem is not smooth, or follow them."""
        return bool(self.rides) or (self.ends.joint is not None and bool(self.ends.joint.inside))

    @property
    def has_bounds(self) -> bool:
        """True where something between the ends is asked to lie between bounds."""
        return any(not c.equality for c in (*self.conditions.pathwise, *self.conditions.integrals))

    @property
    def has_inequalities(self) -> bool:
        """True when an interior-point method is called for."""
        return bool(self.conditions.pathwise) or any(not c.equality for c in self.conditions.integrals)


@derived
def _lift(form: Form) -> PointEvaluator:
    s = form.symbols
    arguments = [s.x, s.y, s.dy, s.unknowns, s.parameters]
    return PointEvaluator(ca.Function("lift", arguments, [ca.densify(s.kind(e)) for e in form.lifted or ()]))


@derived
def second_lift(form: Form) -> ca.Function:
    """The second derivatives by s of the user's abscissa and ordinates, of (s, y, dy, ddy, unknowns, parameters)."""
    assert form.lifted is not None
    s, (_, _, speed, slope) = form.symbols, form.lifted
    arguments = [s.x, s.y, s.dy, s.ddy, s.unknowns, s.parameters]
    before, rates = ca.vertcat(s.x, s.y, s.dy), ca.vertcat(1, s.dy, s.ddy)
    return ca.Function("lift", arguments, [ca.densify(ca.jtimes(s.kind(e), before, rates)) for e in (speed, slope)])


@derived
def _width(form: Form) -> ca.Function | None:
    """dx/ds as a function of (unknowns, parameters), where it is the same all along and on every curve."""
    s, speed = form.symbols, form.lifted[2] if form.lifted else 1
    if ca.depends_on(s.kind(speed), ca.vertcat(s.x, s.y, s.dy)):
        return None
    return ca.Function("width", [s.unknowns, s.parameters], [speed])


def conditions_of(
    problem: Functional,
    rewrite: Callable[[Expression, bool], Expression],
    breakpoints: Iterable[float] = (),
    waypoints: Waypoints = (),
) -> Conditions:
    """What a problem asks between its ends, each expression passed through ``rewrite``.

    ``rewrite(expression, integrated)`` states it in the form's own coordinates, in which ``breakpoints`` and
    ``waypoints`` are already.
    """
    integrals, pathwise = [], []
    numbers = {id(c): i for i, c in enumerate(problem.constraints)}
    for t in problem.traced:
        index = numbers[id(t.constraint)]
        if isinstance(t.constraint, Isoperimetric):
            lower, upper = t.constraint.interval
            integrals.append(SideCondition(rewrite(t.expression, True), lower, upper, index))
        elif isinstance(t.constraint, Bound):
            lower, upper = t.constraint.interval
            pathwise.append(SideCondition(rewrite(t.expression, False), lower, upper, index))
        elif isinstance(t.constraint, Holonomic):
            pathwise.append(SideCondition(rewrite(t.expression, False), 0.0, 0.0, index))
    knots = tuple(sorted({*breakpoints, *(w[0] for w in waypoints)}))
    return Conditions(tuple(integrals), tuple(pathwise), knots, waypoints)


def end_conditions(
    problem: Functional, symbols: Symbols, place: Callable[[int, Expression], tuple[Any, Expression]]
) -> EndConditions | None:
    """Cost of the ends and the curves they slide on, in a form's ``symbols``; None when there are neither.

    ``place(k, z)`` is the user's (x, y) at the start (k = 0) or the end (1), where the form's functions are z.
    """
    if problem.end_cost_expression is None and not any(problem.slides):
        return None
    kind, n = symbols.kind, int(symbols.y.numel())
    z = kind.sym("start", n), kind.sym("end", n)
    places = [(kind(x), y) for x, y in (place(k, at) for k, at in enumerate(z))]
    slides = [problem.traced_slide(name, *at, kind) for name, at in zip(("start", "end"), places, strict=True)]
    equations = [phi for phi in slides if phi is not None]
    cost = kind(0)
    if problem.end_cost_expression is not None:
        given, expression = problem.end_cost_expression
        old = [*given, problem.symbols.unknowns, problem.symbols.parameters]
        ends = [v for at in places for v in problem.position(*at)]
        new = [*ends, symbols.unknowns[: len(problem.unknowns), :], symbols.parameters]
        cost = problem.sign * ca.substitute([expression], old, new)[0]
    return EndConditions(*z, ca.vertcat(*equations) if equations else kind(0, 1), cost)


def extended(problem: Functional, n: int, extra: int) -> Symbols:
    """Fresh symbols for ``n`` functions, the problem's parameters, its unknowns and ``extra`` more numbers."""
    s = problem.symbols
    count = len(problem.unknowns) + extra
    fresh = Symbols.make(s.kind, n, problem.order, 0, count)
    return replace(fresh, parameters=s.parameters)


def rewriter(
    problem: Functional, symbols: Symbols, x: Expression, y: Expression, slopes: list[Expression], speed: Expression
) -> Callable[[Expression, bool], Expression]:
    """A function that states an expression of the problem in other coordinates.

    ``x, y, slopes`` are the problem's variables in terms of ``symbols``;
    integrated expressions are multiplied by ``speed`` = dx/ds.
    """
    old = problem.symbols
    count = len(problem.unknowns)
    before = [old.x, old.y, old.dy, old.ddy, old.unknowns]
    acceleration = slopes[1] if len(slopes) > 1 else old.kind(0, 1)
    after = [x, y, slopes[0], acceleration, symbols.unknowns[:count, :]]

    def rewrite(expression: Expression, integrated: bool) -> Expression:
        stated = ca.substitute([expression], before, after)[0]
        return stated * speed if integrated else stated

    return rewrite


def straight(span: tuple[float, float], start: np.ndarray, end: np.ndarray) -> Sampled:
    """The straight line between two points, components that are NaN at one end kept constant (0 at both)."""
    first = np.where(np.isnan(start), end, start)
    last = np.where(np.isnan(end), start, end)
    first, last = np.nan_to_num(first), np.nan_to_num(last)

    def line(s: np.ndarray) -> np.ndarray:
        along = (s - span[0]) / (span[1] - span[0])
        return first[:, None] * (1 - along) + last[:, None] * along

    return line


def arched(line: Sampled, span: tuple[float, float], height: np.ndarray) -> Sampled:
    """A curve with a parabolic arch over all of ``span``, ``height`` (n,) in the middle."""

    def arch(s: np.ndarray) -> np.ndarray:
        along = (s - span[0]) / (span[1] - span[0])
        return line(s) + height[:, None] * 4 * along * (1 - along)

    return arch


def through(span: tuple[float, float], line: Sampled, waypoints: Waypoints) -> Sampled:
    """The broken line from end to end through the waypoints."""
    if not waypoints:
        return line
    marks = np.array([span[0], *(w[0] for w in waypoints), span[1]])
    values = line(marks)
    for k, (_, demanded) in enumerate(waypoints, start=1):
        values[:, k] = demanded
    return lambda s: np.array([np.interp(s, marks, row) for row in values])
