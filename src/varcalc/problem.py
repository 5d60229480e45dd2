"""The problem: a functional, the ends of its curve and what constrains it.

A :class:`Problem` calls the person's functions once, with symbols, checks all
that can be checked before any solve, and keeps the expressions. How to solve
is no business of this module.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import casadi as ca
import numpy as np

from varcalc.conditions import (
    At,
    Bound,
    Constraint,
    CurveEnd,
    End,
    Fixed,
    Free,
    Holonomic,
    Isoperimetric,
    OnCurve,
    OnSurface,
    Periodic,
    Through,
    components,
    finite,
    is_vector,
)
from varcalc.tracing import Expression, Names, NotSymbolic, trace

NUDGE = 1e-9
"""Relative step off an end at which the integrand must be a number at least on one side."""


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

    @property
    def slopes(self) -> list[Expression]:
        """``[dy]`` or ``[dy, ddy]``."""
        return [self.dy] if self.ddy.numel() == 0 else [self.dy, self.ddy]

    @property
    def all(self) -> list[Expression]:
        """Every symbol, in the order integrand functions take them."""
        return [self.x, self.y, self.dy, self.ddy, self.parameters, self.unknowns]


@dataclass(frozen=True)
class Traced:
    """A constraint and the expression its function gave."""

    constraint: Isoperimetric | Holonomic | Bound
    expression: Expression


class Functional:
    """What :class:`Problem` and :class:`Curve` share: the traced functional and its parameters.

    ``n`` is the number of unknown functions, ``scalar`` tells that they are
    handed over and returned as numbers rather than columns, ``integrand`` is
    the traced Lagrangian in ``symbols``; ``built`` keeps what methods derive
    from them, shared by copies with other parameter values.
    """

    start: Any
    end: Any
    order: int = 1
    span: tuple[float, float]
    scalar: bool
    n: int
    symbols: Symbols
    integrand: Expression
    traced: tuple[Traced, ...]
    end_cost_expression: tuple[list[Expression], Expression] | None = None
    breakpoints: tuple[float, ...] = ()

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
    ) -> None:
        if not callable(lagrangian):
            raise TypeError(f"lagrangian must be a function, not {lagrangian!r}")
        self.lagrangian = lagrangian
        self.start, self.end = start, end
        self.parameters = _named("parameters", parameters)
        self.unknowns = _named("unknowns", unknowns)
        both = self.parameters.keys() & self.unknowns.keys()
        if both:
            raise ValueError(f"{sorted(both)} are given both in parameters and in unknowns; choose one")
        self.end_cost = end_cost
        self.maximise = bool(maximise)
        self.name = name or getattr(lagrangian, "__name__", "functional")
        self.constraints = self._checked_constraints(constraints)
        self.built: dict[str, Any] = {}
        try:
            self._trace(ca.SX)
        except NotSymbolic:
            self._trace(ca.MX)

    # what Problem and Curve each define
    def _arguments(self) -> list[Expression]:
        raise TypeError("a functional is either a Problem or a Curve")

    def _position_arguments(self) -> list[Expression]:
        raise TypeError("a functional is either a Problem or a Curve")

    def _end_symbols(self) -> list[Expression]:
        raise TypeError("a functional is either a Problem or a Curve")

    def _checked_constraints(self, constraints: Sequence[Constraint]) -> tuple[Constraint, ...]:
        if isinstance(constraints, Isoperimetric | Holonomic | Bound | Through):
            raise TypeError("constraints must be a sequence; write constraints=[...]")
        for i, constraint in enumerate(constraints):
            if not isinstance(constraint, Isoperimetric | Holonomic | Bound | Through):
                raise TypeError(
                    f"constraints[{i}] must be Isoperimetric, Holonomic, Bound or Through, not {constraint!r}"
                )
        return tuple(constraints)

    def _handed(self, column: Expression) -> Expression:
        return column[0] if self.scalar else column

    def _names(self) -> list[Names]:
        s = self.symbols
        names = {k: s.parameters[i] for i, k in enumerate(self.parameters)}
        names |= {k: s.unknowns[i] for i, k in enumerate(self.unknowns)}
        return [Names(names)] if names else []

    def _trace(self, kind: type) -> None:
        self.symbols = Symbols.make(kind, self.n, self.order, len(self.parameters), len(self.unknowns))
        p = self._names()
        slopes = [self._handed(d) for d in self.symbols.slopes]
        full = [*self._arguments(), *slopes, *p]
        short = [*self._arguments(), slopes[0], *p]
        self.integrand = trace("lagrangian", self.lagrangian, full, kind)
        traced = []
        for i, constraint in enumerate(self.constraints):
            label = f"constraints[{i}]"
            if isinstance(constraint, Isoperimetric):
                traced.append(Traced(constraint, trace(f"{label}.g", constraint.g, full, kind)))
            elif isinstance(constraint, Bound):
                traced.append(Traced(constraint, trace(f"{label}.h", constraint.h, short, kind)))
            elif isinstance(constraint, Holonomic):
                traced.append(
                    Traced(constraint, trace(f"{label}.phi", constraint.phi, [*self._position_arguments(), *p], kind))
                )
        self.traced = tuple(traced)
        if self.end_cost is not None:
            ends = self._end_symbols()
            self.end_cost_expression = (
                ends,
                trace("end_cost", self.end_cost, [*map(self._end_handed, ends), *p], kind),
            )

    def _end_handed(self, symbol: Expression) -> Expression:
        return symbol if symbol.numel() != self.n or not self.scalar else symbol[0]

    @property
    def parameter_values(self) -> np.ndarray:
        """The parameters' values, in the order they were declared; shape (number of parameters,)."""
        return np.array(list(self.parameters.values()), dtype=float)

    @property
    def unknown_guesses(self) -> np.ndarray:
        """The first guesses of the unknowns, in the order they were declared."""
        return np.array(list(self.unknowns.values()), dtype=float)

    def of_type(self, constraint_type: type) -> Iterator[Any]:
        """The constraints of one type, in the order given."""
        return (c for c in self.constraints if isinstance(c, constraint_type))

    def with_parameters(self, values: Mapping[str, float]) -> Self:
        """The same problem for other parameter values; nothing is traced or built anew.

        Raises ValueError for a name that is not among ``parameters``.

        >>> import casadi as ca
        >>> fall = Problem(lambda x, y, dy, p: ca.sqrt((1 + dy**2) / (2 * p.g * y)),
        ...                Fixed(0, 0), Fixed(1, 1), parameters={"g": 9.81})
        >>> fall.with_parameters({"g": 1.62}).parameters
        {'g': 1.62}
        """
        strange = values.keys() - self.parameters.keys()
        if strange:
            raise ValueError(f"{sorted(strange)} are no parameters of this problem; it has {sorted(self.parameters)}")
        other = copy.copy(self)
        other.parameters = self.parameters | _named("parameters", values)
        return other

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r}, {self.start}, {self.end})"


def _named(name: str, values: Mapping[str, float] | None) -> dict[str, float]:
    if values is None:
        return {}
    if not isinstance(values, Mapping):
        raise TypeError(f"{name} must be a mapping from names to numbers, not {values!r}")
    for key in values:
        if not (isinstance(key, str) and key.isidentifier()):
            raise ValueError(f"{name}: {key!r} is no name that p.<name> could have")
    return {key: finite(f"{name}[{key!r}]", value) for key, value in values.items()}


class Problem(Functional):
    """Make the integral of ``lagrangian`` over the graph of y(x) least (or greatest).

    Parameters
    ----------
    lagrangian:
        ``L(x, y, dy)``, with ``ddy`` when ``order=2`` and ``p`` last when there
        are parameters or unknowns. Called once, with CasADi symbols: scalars,
        or columns when the ends give vectors.
    start, end:
        :class:`Fixed`, :class:`Free`, :class:`OnCurve`, or the same
        :class:`Periodic` twice.
    constraints:
        :class:`Isoperimetric`, :class:`Holonomic`, :class:`Bound`, :class:`Through`.
    parameters, unknowns:
        Names with values; unknowns are optimised with the curve, from the guesses given.
    end_cost:
        ``M(x0, y0, x1, y1[, p])``, added to the integral.
    order:
        Highest derivative in the Lagrangian, 1 or 2.
    breakpoints:
        Abscissae where L may jump in x.

    Raises TypeError or ValueError, naming the argument and the remedy, for
    input that cannot be a problem: mismatched dimensions, a function that
    does not return a scalar, an end where L is not a number.
    """

    def __init__(
        self,
        lagrangian: Callable[..., Any],
        start: End,
        end: End,
        constraints: Sequence[Constraint] = (),
        *,
        parameters: Mapping[str, float] | None = None,
        unknowns: Mapping[str, float] | None = None,
        end_cost: Callable[..., Any] | None = None,
        order: int = 1,
        maximise: bool = False,
        breakpoints: Sequence[float] = (),
        name: str = "",
    ) -> None:
        if order not in (1, 2):
            raise ValueError(f"order must be 1 or 2, not {order!r}")
        self.order = order
        self.n, self.scalar = _dimension(start, end)
        self.span = _span(start, end)
        _check_slopes(start, end, order)
        self.breakpoints = _inside("breakpoints", breakpoints, self.span, start, end)
        super().__init__(lagrangian, start, end, constraints, parameters, unknowns, end_cost, maximise, name)
        self._check_domain()

    def _arguments(self) -> list[Expression]:
        return [self.symbols.x, self._handed(self.symbols.y)]

    def _position_arguments(self) -> list[Expression]:
        return self._arguments()

    def _end_symbols(self) -> list[Expression]:
        kind = self.symbols.kind
        return [kind.sym("x0"), kind.sym("y0", self.n), kind.sym("x1"), kind.sym("y1", self.n)]

    def _checked_constraints(self, constraints: Sequence[Constraint]) -> tuple[Constraint, ...]:
        checked = super()._checked_constraints(constraints)
        for i, c in enumerate(checked):
            if isinstance(c, Through):
                _inside(f"constraints[{i}].x (Through)", (c.x,), self.span, self.start, self.end)
                if len(components("Through.y", c.y)) != self.n:
                    raise ValueError(f"constraints[{i}]: Through.y must have {self.n} components")
        return checked

    def _check_domain(self) -> None:
        """Refuse an end where L is not a number, however the end is approached."""
        known = [
            (label, end, np.array(components("y", end.y), dtype=float))
            for label, end in (("start", self.start), ("end", self.end))
            if isinstance(end, Fixed) and None not in components("y", end.y)
        ]
        if not known:
            return
        steps = np.vstack([np.zeros(self.n), *(sign * row for row in np.eye(self.n) for sign in (NUDGE, -NUDGE))])
        fans = [y + steps * max(1.0, float(np.abs(y).max())) for _, _, y in known]
        x = np.repeat([float(end.x) for _, end, _ in known], len(steps))
        slopes = np.repeat(self._chord_slope()[:, None], len(x), axis=1)
        values = self.integrand_values(x, np.vstack(fans).T, slopes).reshape(len(known), -1)
        for (label, end, _), row in zip(known, values, strict=True):
            if np.isnan(row).all():
                raise ValueError(
                    f"{label} = {end} lies outside the domain of the Lagrangian: L is not a number there; "
                    "move the end, or check the sign under roots and logarithms"
                )

    def _chord_slope(self) -> np.ndarray:
        ends = [components("y", e.y) if isinstance(e, Fixed) else (None,) * self.n for e in (self.start, self.end)]
        rise = [0.0 if a is None or b is None else b - a for a, b in zip(*ends, strict=True)]
        return np.array(rise) / (self.span[1] - self.span[0])

    def integrand_values(self, x: np.ndarray, y: np.ndarray, dy: np.ndarray) -> np.ndarray:
        """L at ``m`` points: x of shape (m,), y and dy of shape (n, m); unknowns at their guesses."""
        if "L" not in self.built:
            self.built["L"] = ca.Function("L", self.symbols.all, [self.integrand])
        ddy = np.zeros((self.symbols.ddy.numel(), len(x)))
        p, u = self.parameter_values, self.unknown_guesses
        columns = [np.repeat(v[:, None], len(x), axis=1) for v in (p, u)]
        return np.asarray(self.built["L"](x[None, :], y, dy, ddy, *columns)).ravel()


class Curve(Functional):
    """Make the integral of ``F(q, dq)`` along a curve in space least (or greatest).

    ``F(q, dq[, p])`` must be homogeneous of degree one in ``dq``, so that the
    integral does not depend on how the curve is parametrised; the solver fixes
    the parametrisation (constant speed) itself. ``start`` and ``end`` are
    :class:`At`, :class:`OnSurface`, or the same :class:`Periodic` twice for a
    closed curve. The other arguments are those of :class:`Problem`, with
    ``Holonomic(phi(q))``, ``Bound(h(q, dq))`` and ``end_cost(q0, q1[, p])``.

    Raises ValueError when ``F`` is not homogeneous of degree one.
    """

    def __init__(
        self,
        lagrangian: Callable[..., Any],
        start: CurveEnd,
        end: CurveEnd,
        constraints: Sequence[Constraint] = (),
        *,
        parameters: Mapping[str, float] | None = None,
        unknowns: Mapping[str, float] | None = None,
        end_cost: Callable[..., Any] | None = None,
        maximise: bool = False,
        name: str = "",
    ) -> None:
        self.n = _curve_dimension(start, end)
        self.scalar = False
        self.span = (0.0, 1.0)
        super().__init__(lagrangian, start, end, constraints, parameters, unknowns, end_cost, maximise, name)
        for i, c in enumerate(self.constraints):
            if isinstance(c, Through):
                raise TypeError(f"constraints[{i}]: Through needs an abscissa, which a Curve does not have")
        self._check_homogeneous("lagrangian", self.integrand)
        for i, t in enumerate(self.traced):
            if isinstance(t.constraint, Isoperimetric):
                self._check_homogeneous(f"constraints[{i}].g", t.expression)

    def _arguments(self) -> list[Expression]:
        return [self.symbols.y]

    def _position_arguments(self) -> list[Expression]:
        return self._arguments()

    def _end_symbols(self) -> list[Expression]:
        kind = self.symbols.kind
        return [kind.sym("q0", self.n), kind.sym("q1", self.n)]

    def _check_homogeneous(self, label: str, expression: Expression) -> None:
        """Compare F(q, 3 dq) with 3 F(q, dq) at points near the ends, in several directions."""
        s = self.symbols
        function = ca.Function("F", [s.y, s.dy, s.parameters, s.unknowns], [expression])
        ends = [_curve_point(e) for e in (self.start, self.end)]
        places = [np.zeros(self.n) if p is None else p for p in ends]
        scale = max(1.0, *(float(np.abs(p).max()) for p in places))
        # a low-discrepancy spread of places and directions: enough to catch any formula that is not homogeneous
        golden = np.array([math.modf((k + 1) * math.sqrt(2 + 3 * k))[0] for k in range(self.n)])
        tried = 0
        for k in range(1, 17):
            q = places[k % 2] + scale * 0.3 * (np.modf(k * golden)[0] - 0.4)
            dq = 2 * np.modf((k + 5) * golden * 1.7)[0] - 1
            once, thrice = (float(function(q, m * dq, self.parameter_values, self.unknown_guesses)) for m in (1.0, 3.0))
            if not (math.isfinite(once) and math.isfinite(thrice)):
                continue
            tried += 1
            if abs(thrice - 3 * once) > 1e-9 * (abs(thrice) + 3 * abs(once)):
                raise ValueError(
                    f"{label} is not homogeneous of degree one in dq: F(q, 3 dq) = {thrice:.12g} but "
                    f"3 F(q, dq) = {3 * once:.12g} at q = {q.tolist()}, dq = {dq.tolist()}; "
                    "a functional that depends on the parametrisation is a Problem in that parameter"
                )
        if tried == 0:
            raise ValueError(f"{label} is not a number anywhere near the ends; check them against its domain")


def _dimension(start: Any, end: Any) -> tuple[int, bool]:
    """Number of unknown functions, and whether they are handed over as scalars."""
    told = []
    for label, e in (("start", start), ("end", end)):
        if not isinstance(e, Fixed | Free | OnCurve | Periodic):
            raise TypeError(f"{label} must be Fixed, Free, OnCurve or Periodic, not {e!r}")
        if isinstance(e, Fixed):
            told.append((label, len(components(f"{label}.y", e.y)), not is_vector(e.y)))
        elif e.n is not None:
            told.append((label, e.n, False))
    if isinstance(start, Periodic) != isinstance(end, Periodic) or (isinstance(start, Periodic) and start != end):
        raise ValueError("Periodic must be given as both ends, with the same abscissae")
    if not told:
        return 1, True
    (first, n, scalar), (last, m, also) = told[0], told[-1]
    if n != m or scalar != also:
        raise ValueError(f"{first} has {n} components and {last} has {m}; both ends need the same form of y")
    return n, scalar


def _span(start: Any, end: Any) -> tuple[float, float]:
    if isinstance(start, Periodic):
        if start.x0 is None or start.x1 is None:
            raise ValueError("Periodic ends of a Problem need abscissae: Periodic(x0, x1)")
        return float(start.x0), float(start.x1)
    a, b = float(start.x), float(end.x)
    if not a < b:
        raise ValueError(f"the end must lie right of the start: start.x = {a}, end.x = {b}")
    return a, b


def _inside(name: str, values: Sequence[float], span: tuple[float, float], start: Any, end: Any) -> tuple[float, ...]:
    marks = tuple(sorted(finite(name, v) for v in values))
    if marks and (isinstance(start, OnCurve) or isinstance(end, OnCurve)):
        raise ValueError(f"{name}: abscissae inside the interval cannot be kept while an end slides on a curve")
    for v in marks:
        if not span[0] < v < span[1]:
            raise ValueError(f"{name} = {v} must lie strictly between the ends, {span[0]} and {span[1]}")
    return marks


def _check_slopes(start: Any, end: Any, order: int) -> None:
    for label, e in (("start", start), ("end", end)):
        if isinstance(e, Fixed) and e.dy is not None and order == 1:
            raise ValueError(f"{label}.dy cannot be fixed for a first-order Lagrangian; leave it out, or use order=2")


def _curve_point(end: Any) -> np.ndarray | None:
    """A point near the end of a Curve, zeros for free components, None for a closed curve."""
    if isinstance(end, At):
        return np.array([0.0 if v is None else v for v in components("At.q", end.q)])
    if isinstance(end, OnSurface):
        return np.array(end.guess, dtype=float)
    return None


def _curve_dimension(start: Any, end: Any) -> int:
    for label, e in (("start", start), ("end", end)):
        if not isinstance(e, At | OnSurface | Periodic):
            raise TypeError(f"{label} must be At, OnSurface or Periodic, not {e!r}")
    if isinstance(start, Periodic) or isinstance(end, Periodic):
        if start != end:
            raise ValueError("Periodic must be given as both ends of a closed Curve")
        if start.x0 is not None:
            raise ValueError("Periodic ends of a Curve take no abscissae; write Periodic()")
        return start.n or 2
    sizes = [len(p) for p in map(_curve_point, (start, end)) if p is not None]
    if sizes[0] != sizes[1]:
        raise ValueError(f"start has {sizes[0]} coordinates and end has {sizes[1]}; they must agree")
    return sizes[0]
