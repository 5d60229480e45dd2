"""What every problem is made of: the symbols a functional is traced with, its constraints and parameters."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from types import FunctionType
from typing import Any, ClassVar, Self

import casadi as ca
import numpy as np

from varcalc.axes import Axis
from varcalc.numerics.mesh import CurveOrSlope
from varcalc.problem.conditions import (
    Bound,
    Constraint,
    Holonomic,
    Isoperimetric,
    OfFunction,
    Through,
    named,
    parameters_of,
    placed,
    sequence,
    text,
    told,
    truth,
)
from varcalc.showing import Fact, Shown, brief, line
from varcalc.spelling import check_names, spelled
from varcalc.symbolic.branches import continued
from varcalc.symbolic.derived import Cache, derived
from varcalc.symbolic.evaluation import PointEvaluator, in_columns
from varcalc.symbolic.look_up import as_sums
from varcalc.symbolic.tracing import (
    Expression,
    Names,
    NotSymbolic,
    TracedFunction,
    called,
    check_arity,
    name_of,
    scalar,
    trace,
)

SPACE = 3
"""Coordinates of a place on a surface in space."""
LOWERED = (
    "where y itself does not occur, take v = y' for the unknown function, and what y gains as an Isoperimetric of v"
)
"""How what is of too high an order can be stated."""
FIRST_SLOPE = f"a Bound is on the curve and its first slope, h(x, y, dy), also with order=2; {LOWERED}"
"""What is told of a bound that is called with more."""
OTHER_WAYS = {"rays": "scene.rays(A, B)", "motion": "system.motion(q0, v0, span)"}
"""What is asked of what is no problem, by the name of what it does."""


@dataclass(frozen=True)
class Symbols:
    """The symbols a functional is written in: abscissa, unknown functions, slopes, parameters."""

    kind: type
    x: Expression
    y: Expression
    dy: Expression
    ddy: Expression
    parameters: Expression
    unknowns: Expression

    @classmethod
    def make(cls, kind: type, n: int, order: int, parameters: int, unknowns: int) -> Symbols:
        """Fresh symbols for ``n`` unknown functions of a functional of the given order."""
        return cls(
            kind,
            kind.sym("x"),
            kind.sym("y", n),
            kind.sym("dy", n),
            kind.sym("ddy", n if order == 2 else 0),
            kind.sym("parameters", parameters),
            kind.sym("unknowns", unknowns),
        )

    @classmethod
    @lru_cache(maxsize=64)
    def common(cls, kind: type, n: int, order: int, parameters: int, unknowns: int) -> Symbols:
        """The symbols that all functionals of one kind are traced with: they stand for nothing but their place."""
        return cls.make(kind, n, order, parameters, unknowns)

    @cached_property
    def variables(self) -> Expression:
        """x, y, dy and ddy as one column: what a Lagrangian is differentiated by."""
        return ca.vertcat(self.x, self.y, *self.slopes)

    @property
    def slopes(self) -> list[Expression]:
        """``[dy]`` or ``[dy, ddy]``."""
        return [self.dy] if self.ddy.numel() == 0 else [self.dy, self.ddy]

    @property
    def highest(self) -> Expression:
        """The highest derivatives, which may jump along a curve."""
        return self.slopes[-1]

    @property
    def all(self) -> list[Expression]:
        """Every symbol, in the order integrand functions take them."""
        return [self.x, self.y, self.dy, self.ddy, self.parameters, self.unknowns]


@dataclass(frozen=True)
class Traced:
    """A constraint and the expression its function gave."""

    constraint: Isoperimetric | Holonomic | Bound
    expression: Expression


class Functional(Shown):
    """What :class:`Problem` and :class:`Curve` share: the traced functional and its parameters.

    ``n`` is the number of unknown functions, ``scalar`` tells that they are
    handed over and returned as numbers rather than columns, ``integrand`` is
    the traced Lagrangian in ``symbols``; ``cache`` keeps what methods derive
    from them, shared by copies with other parameter values. ``templates`` are the
    ends as they were given, parameters among their coordinates. ``abscissa`` and
    ``ordinates`` are the names and units of the variables.
    """

    start: Any
    end: Any
    order: int = 1
    span: tuple[float, float]
    scalar: bool
    n: int
    symbols: Symbols
    integrand: Expression
    original: Self | None = None
    traced: tuple[Traced, ...]
    abscissa: Axis
    ordinates: tuple[Axis, ...]
    surface_expressions: tuple[Expression, ...] = ()
    end_cost_expression: tuple[list[Expression], Expression] | None = None
    breakpoints: tuple[float, ...] = ()
    written: ClassVar[tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]]
    """What textbooks call the place, the slopes and the two ends: what functions of the user's are called with."""
    slide_takes: ClassVar[str]
    slide_idle: ClassVar[str]

    def __init__(
        self,
        lagrangian: Callable[..., Any],
        start: Any,
        end: Any,
        constraints: Sequence[Constraint],
        parameters: Mapping[str, float] | None,
        unknowns: Mapping[str, float] | None,
        end_cost: Callable[..., Any] | None,
        maximise: bool,
        name: str,
        names: Sequence[str],
        units: Sequence[str],
        surface: Callable[..., Any] | None,
    ) -> None:
        self.lagrangian: Callable[..., Any] = lagrangian
        self.templates: tuple[Any, Any] = (start, end)
        self.parameters: dict[str, float] = named("parameters", parameters)
        self.start, self.end = self.placed_ends()
        self.unknowns: dict[str, float] = named("unknowns", unknowns)
        both = self.parameters.keys() & self.unknowns.keys()
        if both:
            raise ValueError(f"{sorted(both)} are given both in parameters and in unknowns; choose one")
        self.end_cost: Callable[..., Any] | None = end_cost
        self.maximise: bool = truth("maximise", maximise)
        self.name: str = text("name", name) or _own_name(lagrangian)
        self.constraints: tuple[Constraint, ...] = self._checked_constraints(constraints)
        self.abscissa, self.ordinates = self._named_axes(names, units)
        self.surface: Callable[..., Any] | None = surface
        self.cache: Cache = Cache()
        self.answers: Cache = Cache()
        try:
            self._trace(ca.SX)
        except NotSymbolic:
            self._trace(ca.MX)

    def placed_ends(self) -> tuple[Any, Any]:
        """The ends at the present parameter values; ValueError for a parameter that has none."""
        ends = []
        for label, end in zip(("start", "end"), self.templates, strict=True):
            own = parameters_of(end)
            unknown = {name for name, _, _ in own} - self.parameters.keys()
            if unknown:
                raise ValueError(
                    f"{label} = {end} holds the parameter {min(unknown)}, which is not declared; "
                    f"give its value in parameters= (declared: {', '.join(sorted(self.parameters)) or 'none'})"
                )
            ends.append(placed(end, self.parameters) if own else end)
        return ends[0], ends[1]

    @property
    def end_parameters(self) -> frozenset[str]:
        """The parameters that are coordinates of the ends."""
        return frozenset(name for end in self.templates for name, _, _ in parameters_of(end))

    @property
    def axes(self) -> tuple[Axis, ...]:
        """The names and units of the variables, in the order in which ``names`` and ``units`` declare them."""
        return (self.abscissa, *self.ordinates)

    @property
    def sign(self) -> float:
        """-1.0 where the functional is to be greatest: times it, everything is least."""
        return -1.0 if self.maximise else 1.0

    def number(self, column: Expression) -> Expression:
        """A column of ordinates or slopes as a user's function is handed it: a number where they are given as such."""
        # a column of one SX entry is a scalar; one of MX is not known to be
        return column[0] if self.scalar and column.numel() == self.n else column

    def position(self, x: Expression, y: Expression) -> list[Expression]:  # noqa: ARG002  what each defines
        """What a place is: x and y of a graph, the point of a Curve."""
        raise TypeError("a functional is either a Problem or a Curve")

    def handed(self, x: Expression, y: Expression) -> list[Expression]:
        """The place (x, y) as a user's function is handed it."""
        return [self.number(v) for v in self.position(x, y)]

    def traced_slide(self, label: str, x: Expression, y: Expression, kind: type) -> Expression | None:
        """What is zero where the ``"start"`` or the ``"end"`` slides, at (x, y); None where that does not slide."""
        end = getattr(self, label)
        if not end.slides:
            return None
        return trace(f"{label}.phi", end.phi, self.handed(x, y), kind, self.slide_takes)

    @property
    def slides(self) -> tuple[bool, bool]:
        """Whether the start slides on a curve or a surface, and whether the end does."""
        return self.start.slides, self.end.slides

    # what Problem and Curve each define
    def _named_axes(self, names: Sequence[str], units: Sequence[str]) -> tuple[Axis, tuple[Axis, ...]]:  # noqa: ARG002
        """The abscissa and the ordinates, as they are declared; TypeError or ValueError for what are none."""
        raise TypeError("a functional is either a Problem or a Curve")

    def check_ends(self) -> None:
        """Raise ValueError where parameters have moved an end to where none can be."""
        raise TypeError("a functional is either a Problem or a Curve")

    def _options(self) -> dict[str, Any]:
        raise TypeError("a functional is either a Problem or a Curve")

    def _end_symbols(self) -> list[Expression]:
        raise TypeError("a functional is either a Problem or a Curve")

    def check_places(self) -> None:
        """Raise ValueError where a point that is given whole violates a constraint, at the present parameters."""
        raise TypeError("a functional is either a Problem or a Curve")

    def _checked_constraints(self, constraints: Sequence[Constraint]) -> tuple[Constraint, ...]:
        given = sequence("constraints", constraints)
        for i, constraint in enumerate(given):
            if not isinstance(constraint, Isoperimetric | Holonomic | Bound | Through):
                raise TypeError(
                    f"constraints[{i}] must be Isoperimetric, Holonomic, Bound or Through, not {constraint!r}"
                )
        return given

    def _names(self) -> list[Names]:
        s = self.symbols
        names = {k: s.parameters[i] for i, k in enumerate(self.parameters)}
        names |= {k: s.unknowns[i] for i, k in enumerate(self.unknowns)}
        return [Names(names)] if names else []

    def _trace(self, kind: type, *, as_given: bool = False) -> None:
        """Call the functions; where their branches meet is written by fmax, unless they are to be left ``as_given``."""
        self.symbols = Symbols.common(kind, self.n, self.order, len(self.parameters), len(self.unknowns))
        p, symbols = self._names(), self.symbols
        slopes = [self.number(d) for d in symbols.slopes]
        position = self.handed(symbols.x, symbols.y)
        place, rates, end_names = self.written
        order = [*place, *rates[: len(slopes)]]
        more = "".join(f", and {rate} before it with order=2" for rate in rates[len(slopes) :])
        lagrangian = trace("lagrangian", self.lagrangian, [*position, *slopes, *p], kind, more, order)
        traced = self._traced_constraints(kind)
        for label in ("start", "end"):
            phi = self.traced_slide(label, symbols.x, symbols.y, kind)
            if phi is not None and not ca.depends_on(phi, ca.vertcat(*self.position(symbols.x, symbols.y))):
                raise ValueError(f"{label}.phi {self.slide_idle}")
        if self.surface is not None:
            self.surface_expressions = _traced_surface(self.surface, [*position, *p], kind)
        ends, cost = list[Expression](), None
        if self.end_cost is not None:
            ends = self._end_symbols()
            cost = trace("end_cost", self.end_cost, [*map(self.number, ends), *p], kind, order=end_names)
        if not as_given:
            watched = ca.vertcat(symbols.y, *symbols.slopes)
            lagrangian = continued(as_sums(lagrangian, watched), symbols.all, watched)
            traced = [
                Traced(t.constraint, continued(as_sums(t.expression, watched), symbols.all, watched)) for t in traced
            ]
            if cost is not None:
                cost = continued(cost, [*ends, symbols.parameters, symbols.unknowns], ca.vertcat(*ends))
        self.integrand, self.traced = lagrangian, tuple(traced)
        self.end_cost_expression = None if cost is None else (ends, cost)

    def _traced_constraints(self, kind: type) -> list[Traced]:
        """What the functions of the constraints give."""
        p, slopes = self._names(), [self.number(d) for d in self.symbols.slopes]
        position = self.handed(self.symbols.x, self.symbols.y)
        place, rates, _ = self.written
        traced: list[Traced] = []
        for i, constraint in enumerate(self.constraints):
            if isinstance(constraint, Through):
                continue
            label = f"constraints[{i}].{constraint.written}"
            names = constraint.arguments(list(place), list(rates[: len(slopes)]))
            if isinstance(constraint, Bound) and len(slopes) > 1:
                check_arity(label, constraint.function, len(names) + len(p), FIRST_SLOPE)
            expression = trace(
                label, constraint.function, [*constraint.arguments(position, slopes), *p], kind,
                order=names if len(names) > len(place) else (),
            )  # fmt: skip
            if isinstance(constraint, Holonomic) and not ca.depends_on(expression, self.symbols.y):
                raise ValueError(f"{label} does not depend on the curve, so phi = 0 constrains nothing")
            if isinstance(constraint, Bound):
                self._check_bounding(label, expression)
            if isinstance(constraint, Bound) and constraint.lower == constraint.upper:
                self._check_equation(i, expression)
            traced.append(Traced(constraint, expression))
        return traced

    def _check_bounding(self, label: str, expression: Expression) -> None:
        """ValueError for a bound on what no curve changes: what it holds to its value is nowhere free."""
        moved = [self.symbols.y, *self.symbols.slopes, self.symbols.unknowns]
        # an end that slides is bounded by its abscissa
        moved += [self.symbols.x] if any(end.slides for end in (self.start, self.end)) else []
        if not ca.depends_on(expression, ca.vertcat(*moved)):
            raise ValueError(f"{label} does not depend on the curve, so it bounds nothing; leave the Bound out")

    def _check_equation(self, index: int, expression: Expression) -> None:
        """ValueError for a bound from both sides alike on the slope: no method solves differential equations beside."""
        if ca.depends_on(expression, ca.vertcat(*self.symbols.slopes)):
            raise ValueError(
                f"constraints[{index}] (Bound) with lower = upper is a differential equation for the curve, which no "
                "method here holds: let it eliminate a function, write y'' with order=2, or give lower < upper"
            )

    @property
    def parameter_values(self) -> np.ndarray:
        """The parameters' values, in the order they were declared; shape (number of parameters,), not to be changed."""
        return self._listed("parameters")

    @property
    def unknown_guesses(self) -> np.ndarray:
        """The first guesses of the unknowns, in the order they were declared; not to be changed."""
        return self._listed("unknowns")

    def _listed(self, name: str) -> np.ndarray:
        """The values of a mapping, listed once."""
        given, kept = getattr(self, name), self.__dict__.get(f"_{name}_listed")
        if kept is None or kept[0] is not given:  # a copy has been given other values
            values = np.array(list(given.values()), dtype=float)
            values.setflags(write=False)
            kept = self.__dict__[f"_{name}_listed"] = given, values
        return kept[1]

    def of_type(self, constraint_type: type) -> Iterator[Any]:
        """The constraints of one type, in the order given."""
        return (c for c in self.constraints if isinstance(c, constraint_type))

    @spelled
    def with_parameters(self, values: Mapping[str, float]) -> Self:
        """The same problem for other parameter values; nothing is traced or built anew.

        Raises ValueError for a name that is not among ``parameters``, where an
        end violates a constraint at these values, and where one that is moved
        by them lies where no end can be.

        >>> import casadi as ca
        >>> import varcalc as vc
        >>> fall = vc.Problem(lambda x, y, dy, p: ca.sqrt((1 + dy**2) / (2 * p.g * y)),
        ...                   vc.Fixed(0, 0), vc.Fixed(1, 1), parameters={"g": 9.81})
        >>> fall.with_parameters({"g": 1.62}).parameters
        {'g': 1.62}
        """
        given = named("parameters", values)
        check_names("parameters of this problem", given, self.parameters)
        other = copy.copy(self)
        other.original = self.original or self
        other.parameters = self.parameters | given
        if self.end_parameters & given.keys():
            other.start, other.end = other.placed_ends()
            other.check_ends()
        other.check_places()
        return other

    def __copy__(self) -> Self:
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__, answers=Cache())  # whoever copies a problem asks another one
        return other

    def __reduce__(self) -> tuple[Any, ...]:
        if self.original is not None:
            return _at_values, (self.original, self.parameters)
        return rebuilt, (type(self), *self.sent(_as_it_is))

    def sent(self, put: Callable[[TracedFunction], Callable[..., Any]]) -> tuple[tuple[Any, ...], dict[str, Any]]:
        """What makes this problem anew, positional and by name; for each function what ``put`` makes of what it gave.

        A function that an end slides on is called without parameters, and has no :attr:`TracedFunction.names`.
        """
        s, position = self.symbols, self.position(self.symbols.x, self.symbols.y)

        def traced(expression: Expression, arguments: list[Expression], called: str = "") -> Callable[..., Any]:
            function = ca.Function("traced", [*arguments, s.parameters, s.unknowns], [expression])
            return put(TracedFunction(function, (tuple(self.parameters), tuple(self.unknowns)), called))

        rest = iter(self.traced)
        constraints = [
            c.stated(traced(next(rest).expression, c.arguments(position, s.slopes), name_of(c.function)))
            if isinstance(c, OfFunction)
            else c
            for c in self.constraints
        ]
        cost = None
        if self.end_cost_expression is not None:
            ends, value = self.end_cost_expression
            cost = traced(value, ends)
        lagrangian = traced(self.integrand, [*position, *s.slopes])
        statement = (lagrangian, *(self._sent_end(end, put) for end in self.templates), constraints)
        surface = traced(ca.vertcat(*self.surface_expressions), position) if self.surface else None
        options = {
            "parameters": self.parameters, "unknowns": self.unknowns, "end_cost": cost,
            "maximise": self.maximise, "name": self.name, "surface": surface,
            "names": [axis.name for axis in self.axes], "units": [axis.unit for axis in self.axes],
        }  # fmt: skip
        return statement, options | self._options()

    def with_integrand(
        self, integrand: Expression, numbers: Mapping[str, float] | None = None, symbols: Expression | None = None,
        **changed: Any,
    ) -> Self:  # fmt: skip
        """The problem of another ``integrand``, an expression of its symbols, and of what its other functions gave.

        ``numbers`` are parameters besides its own, with their ``symbols``; ``changed`` are arguments of its class, with
        constraints of this problem's as they are.
        """
        s, more = self.symbols, dict(numbers or {})
        added, group = ([symbols], [tuple(more)]) if more and symbols is not None else ([], [])

        def put(traced: TracedFunction) -> TracedFunction:
            """The same function, which is called with the further numbers as well."""
            if not (added and traced.names):
                return traced  # ends slide on it: it is called without parameters
            given = [s.kind.sym("a", *traced.function.size_in(k)) for k in range(traced.function.n_in())]
            function = ca.Function("traced", [*given, *added], traced.function.call(given, True, False))
            return TracedFunction(function, (*traced.names, *group), traced.__name__)

        (_, start, end, constraints), options = self.sent(put)
        arguments = [*self.position(s.x, s.y), *s.slopes, s.parameters, s.unknowns, *added]
        names = tuple(self.parameters), tuple(self.unknowns), *group
        sent = {id(own): c for own, c in zip(self.constraints, constraints, strict=True)}
        kept = [sent.get(id(c), c) for c in changed.pop("constraints", self.constraints)]
        options |= {"start": start, "end": end, "constraints": kept, "parameters": self.parameters | more}
        return type(self)(TracedFunction(ca.Function("traced", arguments, [integrand]), names), **options | changed)

    def _sent_end(self, end: Any, put: Callable[[TracedFunction], Callable[..., Any]]) -> Any:
        """An end whose function, if it has one, is what it gave."""
        if not isinstance(end, OfFunction):
            return end
        phi = trace("phi", end.function, self.handed(self.symbols.x, self.symbols.y), self.symbols.kind)
        function = ca.Function("traced", self.position(self.symbols.x, self.symbols.y), [phi])
        return end.stated(put(TracedFunction(function, (), name_of(end.function))))

    def retraced(self) -> Self:
        """A copy whose functions have been called again and are left as they are given, with a cache of its own."""
        other = copy.copy(self)
        other.cache, other.original = Cache(), None
        other._trace(self.symbols.kind, as_given=True)  # noqa: SLF001  of the same class
        return other

    def on_surface(self, q: np.ndarray) -> np.ndarray:
        """The points in space (3, m) of places q (number of arguments of ``surface``, m): x and y, or a Curve's q.

        Raises ValueError where no surface was declared.
        """
        if not self.surface_expressions:
            raise ValueError(f"{self.name} lies on no surface that was declared; give the problem surface=")
        return _surface(self)(len(q.T), q.T, self.parameter_values[None], self.unknown_guesses[None]).T

    def _headline(self) -> str:
        unknown = ", ".join(axis.name for axis in self.ordinates)
        told = f"functional of {unknown}, to be made {'greatest' if self.maximise else 'least'}"
        return f"A {told}" if self.name == UNNAMED else f"{self.name}: a {told}"

    def _facts(self) -> Iterator[Fact]:
        from varcalc.problem.reading.statement import statement  # which reads problems

        yield from statement(self)

    def _repr_latex_(self) -> str:
        """The functional, its ends and conditions and the Euler-Lagrange equation, typeset."""
        from varcalc.problem.reading.statement import statement_latex

        return statement_latex(self)

    def __repr__(self) -> str:
        return line(type(self).__name__, [brief(self.name), *map(brief, self.templates)])


@derived
def _surface(problem: Functional) -> PointEvaluator:
    s = problem.symbols
    place = ca.vertcat(*problem.position(s.x, s.y))
    return PointEvaluator(
        ca.Function("surface", [place, s.parameters, s.unknowns], [ca.vertcat(*problem.surface_expressions)])
    )


def _traced_surface(surface: Callable[..., Any], arguments: list[Any], kind: type) -> tuple[Expression, ...]:
    """The three coordinates in space that a person's function gives."""
    check_arity("surface", surface, len(arguments), "it takes a place, as phi does, and p last where there are any")
    given = called("surface", surface, arguments, kind)
    parts = ca.vertsplit(given) if isinstance(given, kind) else sequence("what surface returns", given)
    if len(parts) != SPACE:
        raise ValueError(f"surface must return the 3 coordinates of a point in space, not {len(parts)}")
    return tuple(scalar(f"surface[{k}]", part, kind) for k, part in enumerate(parts))


def arguments_at(
    problem: Functional, x: np.ndarray, y: np.ndarray, dy: np.ndarray, ddy: np.ndarray | None = None,
    unknowns: np.ndarray | None = None,
) -> list[np.ndarray]:  # fmt: skip
    """What :attr:`Symbols.all` stand for at m points, a column each: x (m,), y, dy and, at second order, ddy (n, m).

    Without a bend ddy is zero, without ``unknowns`` these are the guesses.
    """
    bends = np.zeros((problem.symbols.ddy.numel(), len(x))) if ddy is None else ddy
    numbers = problem.parameter_values, problem.unknown_guesses if unknowns is None else unknowns
    return [x[None], y, dy, bends, *in_columns(len(x), *numbers)]


def arguments_along(
    problem: Functional, curve: CurveOrSlope, x: np.ndarray, unknowns: np.ndarray | None = None
) -> list[np.ndarray]:
    """The same at places x (m,) of a curve."""
    return arguments_at(problem, x, curve(x, 0), curve(x, 1), curve(x, 2) if problem.order == 2 else None, unknowns)


def unused_names(problem: Functional, names: list[str]) -> list[str]:
    """Names of numbers, lengthened until the problem has none of them."""
    while {*names} & {*problem.parameters, *problem.unknowns}:
        names = [f"{name}_" for name in names]
    return names


def check_functional(problem: Any) -> None:
    """TypeError for anything but a problem; it says where to find that of what holds one."""
    if not isinstance(problem, Functional):
        held = isinstance(getattr(problem, "problem", None), Functional)
        what = type(problem).__name__ if held else told(problem)
        raise TypeError(f"problem must be a Problem or a Curve, not {what}{_instead(problem, held)}")


def _instead(given: Any, held: bool) -> str:
    """What to write instead of what is no problem, where that can be told; ``held``: it holds one."""
    if held:
        return f"; give its problem: {type(given).__name__.lower()}.problem"
    if isinstance(given, FunctionType):
        return "; write Problem(lagrangian, start, end)"
    # scenes and systems, which are declared above this module, are known by what they do
    asked = next((way for name, way in OTHER_WAYS.items() if callable(getattr(given, name, None))), "")
    return f"; a {type(given).__name__} is asked by {asked}" if asked else ""


def _as_it_is(function: TracedFunction) -> TracedFunction:
    return function


def rebuilt(cls: type[Functional], statement: tuple[Any, ...], options: dict[str, Any]) -> Functional:
    """A problem from what :meth:`Functional.sent` gave."""
    return cls(*statement, **options)


def _at_values(problem: Functional, parameters: dict[str, float]) -> Functional:
    return problem.with_parameters(parameters)


UNNAMED = "functional"
"""What a functional is called that was given no name and whose function has none."""


def _own_name(lagrangian: Callable[..., Any]) -> str:
    name = getattr(lagrangian, "__name__", UNNAMED)
    return UNNAMED if name == "<lambda>" else name
