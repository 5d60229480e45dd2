"""A problem stated for any solver: functions of numbers, ends, levels and bounds as plain values."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from varcalc.problem.conditions import Bound, Holonomic, Isoperimetric, Through
from varcalc.problem.problem import Curve, Problem
from varcalc.showing import Brief, brief, line
from varcalc.study.reference import Reference
from varcalc.symbolic.tracing import Expression

Along = Callable[..., np.ndarray]
"""A function of (x, y, dy) along a curve, with ddy behind where the order is two."""


@dataclass(frozen=True)
class PlainEnd:
    """One end: the abscissa ``x`` (None of a Curve), ``y`` and the slopes ``dy`` (n,), NaN where they are free.

    Where the end slides, ``on(x, y)`` vanishes on what it slides on (``on(q)`` for a Curve), and ``x`` and ``y`` are
    where a guess may begin. ``periodic`` ends have no values: the curve goes on at the start as it left at the end.
    """

    x: float | None
    y: np.ndarray
    dy: np.ndarray
    on: Callable[..., float] | None = None
    periodic: bool = False

    @property
    def fixed(self) -> bool:
        """Whether every ordinate is given, and nothing slides."""
        return self.on is None and not self.periodic and bool(np.isfinite(self.y).all())


@dataclass(frozen=True)
class Limited:
    """What stays between two numbers: an integral along the curve, or ``function`` at every point of it."""

    function: Along
    lower: float
    upper: float


class PlainProblem(Brief):
    """A problem as any solver can take it: make the integral of ``lagrangian`` least (greatest with ``maximise``).

    ``name`` and ``sentence`` say what it is; ``is_curve`` tells a :class:`varcalc.Curve`, whose Lagrangian has no x and
    does not depend on the parametrisation, from a graph y(x) over ``interval``; ``n`` is the number of unknown
    functions, ``order`` that of the highest derivative in L. ``start`` and ``end`` are :class:`PlainEnd`; ``levels``
    are integrals that are held, ``bounds`` functions that are bounded at every point, both :class:`Limited`; ``held``
    are functions that vanish at every point, ``waypoints`` pairs (x, y). ``parameters`` are in the functions already,
    ``unknowns``, to be found with the curve, come with first guesses. ``end_cost(x0, y0, x1, y1)`` (of q0 and q1 for a
    Curve) is added to the integral, or None.

    All functions take numbers or arrays: x of any shape, y and dy of x's shape, or with the n functions in front.

    >>> from varcalc.study.reference import load
    >>> brachistochrone = PlainProblem(load("brachistochrone")[0])
    >>> brachistochrone.interval, brachistochrone.end.y.tolist()
    ((0.0, 1.0), [1.0])
    >>> round(float(brachistochrone.lagrangian(0.5, 0.5, 1.0)), 6)
    0.451524
    """

    def __init__(self, reference: Reference) -> None:
        problem = reference.problem
        self.problem: Problem | Curve = problem
        self.name: str = reference.name
        self.sentence: str = reference.statement
        self.is_curve: bool = isinstance(problem, Curve)
        self.n: int = problem.n
        self.order: int = problem.order
        self.maximise: bool = problem.maximise
        self.interval: tuple[float, float] = float(problem.span[0]), float(problem.span[1])
        self.parameters: Mapping[str, float] = dict(problem.parameters)
        self.unknowns: Mapping[str, float] = dict(problem.unknowns)
        self.breakpoints: tuple[float, ...] = tuple(problem.breakpoints)
        self.start: PlainEnd = self._end("start")
        self.end: PlainEnd = self._end("end")
        of = [(t.constraint, t.expression) for t in problem.traced]
        self.levels: tuple[Limited, ...] = tuple(self._limited(c, e) for c, e in of if isinstance(c, Isoperimetric))
        self.bounds: tuple[Limited, ...] = tuple(self._limited(c, e) for c, e in of if isinstance(c, Bound))
        self.held: tuple[Along, ...] = tuple(self._along([e])[0] for c, e in of if isinstance(c, Holonomic))
        places = problem.of_type(Through)
        self.waypoints: tuple[tuple[float, np.ndarray], ...] = tuple(
            (float(c.x), np.atleast_1d(c.values)) for c in places
        )
        self.end_cost: Callable[..., float] | None = self._end_cost()

    def __repr__(self) -> str:
        return line("PlainProblem", [brief(self.name), f"interval={self.interval}", f"n={self.n}"])

    @cached_property
    def lagrangian(self) -> Along:
        """L(x, y, dy), of x's shape; F(q, dq) of a Curve is called the same way, with any x."""
        return self._along([self.problem.integrand])[0]

    @cached_property
    def gradient(self) -> Callable[..., list[np.ndarray]]:
        """The derivatives of L by x, y, dy (and ddy), as a list; those by functions have the shape of y."""
        s = self.problem.symbols
        parts = self._along([ca.gradient(self.problem.integrand, v) for v in (s.x, s.y, *s.slopes)])
        return lambda *arguments, **unknowns: [part(*arguments, **unknowns) for part in parts]

    @cached_property
    def second_derivative(self) -> Along:
        """y''(x, y, dy) by the equation of Euler and Lagrange, of the shape of y.

        For a graph of first order whose L is strictly convex (or concave) in the slope; constraints are left out.
        """
        if self.is_curve or self.order != 1:
            raise ValueError(f"{self.name} has no equation y'' = f(x, y, y'); take its lagrangian and gradient")
        s, whole = self.problem.symbols, self.problem.integrand
        momentum = ca.gradient(whole, s.dy)
        rest = ca.gradient(whole, s.y) - ca.jacobian(momentum, s.x) - ca.jacobian(momentum, s.y) @ s.dy
        return self._along([ca.solve(ca.jacobian(momentum, s.dy), rest)])[0]

    def expression(self, x: Any, y: Any, dy: Any, ddy: Any = ()) -> Any:
        """L as CasADi's expression of CasADi's symbols, for packages that build on it; unknowns at their guesses."""
        p = self.problem
        function = ca.Function("L", p.symbols.all, [p.integrand])
        return function(x, y, dy, ca.vertcat(*ddy), p.parameter_values, p.unknown_guesses)

    def _limited(self, constraint: Isoperimetric | Bound, expression: Expression) -> Limited:
        lower, upper = constraint.interval
        return Limited(self._along([expression])[0], float(lower), float(upper))

    def _along(self, expressions: Sequence[Expression]) -> list[Along]:
        """Expressions as functions of numbers or arrays."""
        return [_function(self.problem, ca.densify(e)) for e in expressions]

    def _end(self, label: str) -> PlainEnd:
        problem, end = self.problem, getattr(self.problem, label)
        slides, n = end.slides, problem.n
        on, y = None, np.atleast_1d(end.values(n)).astype(float)
        x = None if self.is_curve else self.interval[label == "end"]
        if slides:
            s = problem.symbols
            phi = problem.traced_slide(label, s.x, s.y, s.kind)
            place = ca.Function("phi", problem.position(s.x, s.y), [phi])
            on = lambda *at: float(place(*at))  # noqa: E731  a function of as many arguments as there are
            y = np.array(end.guess, dtype=float) if self.is_curve else y
        return PlainEnd(x, y, np.atleast_1d(end.slopes(n)).astype(float), on, end.periodic)

    def _end_cost(self) -> Callable[..., float] | None:
        if self.problem.end_cost_expression is None:
            return None
        given, cost = self.problem.end_cost_expression
        s, p = self.problem.symbols, self.problem
        function = ca.Function("cost", [*given, s.parameters, s.unknowns], [cost])
        return lambda *ends: float(function(*ends, p.parameter_values, p.unknown_guesses))


def _function(problem: Problem | Curve, expression: Expression) -> Along:
    """An expression as a function of (x, y, dy[, ddy]) on arrays; ``unknowns`` by name, where not the guesses."""
    function = ca.Function("along", problem.symbols.all, [expression])
    rows = expression.numel()

    def evaluated(x: Any, y: Any, dy: Any, ddy: Any = (), *, unknowns: Mapping[str, float] | None = None) -> np.ndarray:
        """The values (rows, *x.shape), or (*x.shape) of one row."""
        x = np.asarray(x, dtype=float)
        count = max(x.size, 1)
        sought = [{**problem.unknowns, **(unknowns or {})}[name] for name in problem.unknowns]
        numbers = [np.reshape(v, (-1, 1)) for v in (problem.parameter_values, np.array(sought, dtype=float))]
        given = zip((1, problem.n, problem.n, problem.symbols.ddy.numel()), (x, y, dy, ddy), strict=True)
        curve = [np.reshape(np.asarray(v, dtype=float), (size, count)) for size, v in given]
        spread = [*curve, *(np.repeat(v, count, axis=1) for v in numbers)]
        values = function.map(count)(*spread).full().reshape(rows, *x.shape)
        return values if rows > 1 else values[0]

    return evaluated


def size_of(value: float) -> float:
    """What a tolerance of a value is relative to."""
    return max(1.0, abs(value)) if math.isfinite(value) else 1.0
