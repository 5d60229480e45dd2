"""The Lagrangian function along one curve: what every check looks at.

Along an extremal the Lagrangian function

    H = L + sum of lambda_j g_j + sum of mu_k(s) phi_k

is stationary without side conditions. A :class:`AlongCurve` holds its parts, the
curve and its multipliers in coordinates whose interval is fixed: those of the
form, or for an abscissa that slides the user's own, in which the end the
curve has found is as good as fixed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np

from varcalc.formulation import Form, Sampled, SideCondition
from varcalc.methods.answer import Extremal, lifted, sample
from varcalc.numerics.mesh import CurveOrSlope, composite_gauss
from varcalc.problem.functional import Symbols, arguments_at
from varcalc.problem.lagrangian import Lagrangian
from varcalc.problem.problem import Problem
from varcalc.symbolic.derived import Cache
from varcalc.symbolic.evaluation import in_columns
from varcalc.symbolic.tracing import Expression

TOUCHED_AT = 1e-7
"""Relative distance from a bound within which it is touched."""
NEARLY_TOUCHED = 1e-3
"""The same where what matters is that the bound may be touched: between the nodes at which it is imposed."""


@dataclass(frozen=True)
class AlongCurve:
    """A functional (in the minimising sense), one curve, and its multipliers.

    ``evaluate(s, k)`` gives the k-th derivative of the n functions at s (m,)
    as (n, m), for k up to ``order`` at least; ``numbers`` are the values of
    the unknown numbers, ``forces`` the multipliers of ``paths`` as functions of s,
    ``limits`` what each of these is held between.
    """

    extremal: Extremal
    symbols: Symbols
    order: int
    integrand: Expression
    integrals: tuple[Expression, ...]
    paths: tuple[Expression, ...]
    limits: tuple[SideCondition, ...]
    lambdas: np.ndarray
    forces: tuple[Sampled, ...]
    span: tuple[float, float]
    vertices: np.ndarray
    evaluate: CurveOrSlope
    numbers: np.ndarray
    slides: bool
    held: tuple[float, ...] = ()
    """Waypoints, and where the curve goes through a surface on which the problem is not smooth: momenta jump there."""
    rides: tuple[tuple[float, float], ...] = ()
    """Stretches along which the curve follows such a surface."""

    @property
    def form(self) -> Form:
        """The form the curve was solved in."""
        return self.extremal.form

    @property
    def n(self) -> int:
        """Number of unknown functions."""
        return int(self.symbols.y.numel())

    @property
    def length(self) -> float:
        """Length of the interval."""
        return self.span[1] - self.span[0]

    def abscissa(self, s: np.ndarray) -> np.ndarray:
        """The person's abscissa (the parameter t of a Curve) at s (m,)."""
        if self.slides or self.form.lift is None:
            return s
        return lifted(self.extremal, s)[0]

    def arguments(self, s: np.ndarray) -> list[np.ndarray]:
        """s, y, dy, ddy, parameters, unknowns, lambda and mu at s (m,), each with m columns."""
        derivatives = [self.evaluate(s, k) for k in range(self.order + 1)]
        forces = np.array([mu(s) for mu in self.forces]).reshape(len(self.forces), len(s))
        known = arguments_at(self.form.problem, s, *derivatives, unknowns=self.numbers)
        return [*known, *in_columns(len(s), self.lambdas), forces]

    @cached_property
    def multiplier_symbols(self) -> list[Expression]:
        """The symbols of lambda and mu in :attr:`whole`."""
        kind = self.symbols.kind
        return [kind.sym("lambda", len(self.integrals)), kind.sym("mu", len(self.paths))]

    @cached_property
    def whole(self) -> Lagrangian:
        """The Lagrangian function H."""
        total = self.integrand
        for symbol, expressions in zip(self.multiplier_symbols, (self.integrals, self.paths), strict=True):
            for j, expression in enumerate(expressions):
                total = total + symbol[j] * expression
        return Lagrangian(self.symbols, total)

    def function(self, *expressions: Expression) -> Callable[[np.ndarray], list[np.ndarray]]:
        """Expressions in ``symbols`` and multipliers, as a function of s (m,): arrays of shape (m, rows, columns)."""
        columns = [ca.vec(ca.densify(e)) for e in expressions]
        function = ca.Function("along", [*self.symbols.all, *self.multiplier_symbols], columns)

        def along(s: np.ndarray) -> list[np.ndarray]:
            """The values at s (m,)."""
            out: Any = function.call(self.arguments(s))
            arrays = [
                np.asarray(v).T.reshape(len(s), e.shape[1], e.shape[0]) for v, e in zip(out, expressions, strict=True)
            ]
            return [a.transpose(0, 2, 1) for a in arrays]

        return along

    def forbidden_slopes(self, s: np.ndarray) -> np.ndarray:
        """The changes of slope (m, r, n) at s (m,) that take a curve of first order off its pathwise equations."""
        if not self.paths or self.order != 1:
            return np.zeros((len(s), 0, self.n))
        gradients = self.function(ca.jacobian(ca.vertcat(*self.paths), self.symbols.y))(s)[0]
        return gradients[:, [k for k, c in enumerate(self.limits) if c.equality]]

    def rule(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Nodes and weights of the composite Gauss rule on the vertices, each flat."""
        return composite_gauss(self.vertices, count)

    def parts(self) -> list[tuple[float, float]]:
        """The intervals between the ends and where the curve is held, but for those along which it is."""
        edges = {e for ride in self.rides for e in ride}
        marks = sorted({self.span[0], *self.held, *edges, self.span[1]})
        return [(a, b) for a, b in pairwise(marks) if (a, b) not in self.rides]


def along_curve(extremal: Extremal) -> AlongCurve:
    """The Lagrangian function along an extremal; where an abscissa slides in the user's own."""
    form = extremal.form
    slides = isinstance(form.problem, Problem) and not form.coordinates.energetic and any(form.problem.slides)
    plain = in_form(extremal)
    return _in_own_abscissa(plain) if slides else plain


def in_form(extremal: Extremal) -> AlongCurve:
    """The Lagrangian function along an extremal in the coordinates of its form, sliding abscissae being numbers."""
    form = extremal.form
    return AlongCurve(
        extremal=extremal,
        symbols=form.symbols,
        order=form.order,
        integrand=form.integrand,
        integrals=tuple(c.expression for c in form.conditions.integrals),
        paths=tuple(c.expression for c in form.conditions.pathwise),
        limits=form.conditions.pathwise,
        lambdas=np.asarray(extremal.lambdas, dtype=float),
        forces=tuple(extremal.path.get(c.index, np.zeros_like) for c in form.conditions.pathwise),
        span=form.span,
        vertices=extremal.vertices,
        evaluate=extremal.evaluate,
        numbers=extremal.unknowns,
        slides=False,
        held=form.held,
        rides=form.rides,
    )


def sliding_ends(form: Form) -> tuple[int | None, int | None]:
    """Which unknown number of a form is the abscissa of its start, and of its end; None where that is fixed."""
    count = len(form.problem.unknowns)
    at_start, at_end = form.problem.slides
    return (count if at_start else None, count + at_start if at_end else None)


def _in_own_abscissa(plain: AlongCurve) -> AlongCurve:
    """The same curve as a function of the user's abscissa, between the ends it has found."""
    form, problem = plain.form, plain.form.problem
    found = [
        given if number is None else float(plain.numbers[number])
        for given, number in zip(problem.span, sliding_ends(form), strict=True)
    ]
    a, width = found[0], found[1] - found[0]
    expressions = {id(t.constraint): t.expression for t in problem.traced}

    def own(conditions: tuple[Any, ...]) -> tuple[Expression, ...]:
        return tuple(expressions[id(problem.constraints[c.index])] for c in conditions)

    def evaluate(x: np.ndarray, derivative: int) -> np.ndarray:
        return plain.evaluate((x - a) / width, derivative) / width**derivative

    def scaled(mu: Sampled) -> Sampled:
        return lambda x: mu((x - a) / width) / width

    return replace(
        plain,
        symbols=problem.symbols,
        integrand=form.sign * problem.integrand,
        integrals=own(form.conditions.integrals),
        paths=own(form.conditions.pathwise),
        forces=tuple(scaled(mu) for mu in plain.forces),
        span=(found[0], found[1]),
        vertices=a + width * plain.vertices,
        evaluate=evaluate,
        numbers=plain.numbers[: len(problem.unknowns)],
        slides=True,
    )


def complement(rows: np.ndarray) -> np.ndarray:
    """Orthonormal bases (m, n, n - r) of what ``rows`` (m, r, n) leave."""
    m, r, n = rows.shape
    return np.linalg.svd(rows)[2][:, r:].transpose(0, 2, 1) if r else np.broadcast_to(np.eye(n), (m, n, n))


def inner_points(points: AlongCurve, count: int) -> np.ndarray:
    """``count`` Gauss points inside each element."""
    return composite_gauss(points.vertices, count)[0]


def at_limit(values: np.ndarray, conditions: Sequence[SideCondition], near: float) -> np.ndarray:
    """Whether ``values`` (m, k) are within ``near``, relative, of what the k ``conditions`` hold them between."""
    room = near * np.maximum(1.0, np.abs(values))
    lower, upper = (np.array([getattr(c, side) for c in conditions]) for side in ("lower", "upper"))
    return (values <= lower + room) | (values >= upper - room)


def touches(extremal: Extremal) -> bool:
    """Whether a Bound is active somewhere along the curve."""
    bounds = [c for c in extremal.form.conditions.pathwise if not c.equality]
    if not bounds:
        return False
    # a curve may touch one in a point, which is a vertex then
    s = np.concatenate([composite_gauss(extremal.vertices, 16)[0], extremal.vertices[1:-1]])
    function = ca.Function("h", extremal.form.symbols.all, [ca.vertcat(*(c.expression for c in bounds))])
    return bool(at_limit(np.asarray(function(*sample(extremal, s))).T, bounds, TOUCHED_AT).any())


def touched(along: AlongCurve, s: np.ndarray, near: float = NEARLY_TOUCHED) -> np.ndarray:
    """Whether an inequality is active at s (m,), within ``near``, relative."""
    limits = [(k, c) for k, c in enumerate(along.limits) if not c.equality]
    if not along.paths or not limits:
        return np.zeros(len(s), dtype=bool)
    values = along.function(ca.vertcat(*(along.paths[k] for k, _ in limits)))(s)[0][:, :, 0]
    return np.any(at_limit(values, [c for _, c in limits], near), axis=1)


def without_inequalities(extremal: Extremal) -> Extremal:
    """The extremal of the same form with every inequality left out, or turned into an equality where it is active."""
    form = extremal.form
    if not form.has_inequalities:
        return extremal
    pathwise = tuple(c for c in form.conditions.pathwise if c.equality)
    kept, lambdas = [], []
    for condition, multiplier in zip(form.conditions.integrals, extremal.lambdas, strict=True):
        if condition.equality:
            kept.append(condition)
        elif abs(multiplier) > TOUCHED_AT:
            # with L + lambda g a positive multiplier pushes the integral down: it is at its upper level
            level = condition.upper if multiplier > 0 else condition.lower
            kept.append(replace(condition, lower=level, upper=level))
        else:
            continue
        lambdas.append(float(multiplier))
    # what is derived from the form holds for its own conditions only
    bare = replace(form, conditions=replace(form.conditions, integrals=tuple(kept), pathwise=pathwise), cache=Cache())
    return replace(extremal, form=bare, lambdas=np.array(lambdas))
