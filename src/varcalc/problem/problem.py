"""The problem: a functional, the ends of its curve and what constrains it.

A :class:`Problem` calls the person's functions once, with symbols, checks all
that can be checked before any solve, and keeps the expressions. How to solve
is no business of this module.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any, ClassVar

import casadi as ca
import numpy as np

from varcalc.axes import Axis, coordinates, declared_axes, numbered
from varcalc.problem.conditions import (
    AnyEnd,
    Constraint,
    Isoperimetric,
    Through,
    components,
    sequence,
)
from varcalc.problem.conditions import (
    function as check_function,
)
from varcalc.problem.consistency import Place, check_levels, check_places
from varcalc.problem.functional import LOWERED, Functional
from varcalc.problem.shape import check_slopes, curve_dimension, dimension, inside, span_of
from varcalc.spelling import spelled
from varcalc.symbolic.derived import derived
from varcalc.symbolic.evaluation import Derivatives, PointEvaluator
from varcalc.symbolic.tracing import Expression

SAME_ABSCISSA = 1e-12
"""Distance of two abscissae that counts as none, relative to the interval."""
NUDGE = 1e-9
"""Relative step off an end at which the integrand must be a number at least on one side."""


FEW_FUNCTIONS = 3
"""Unknown functions up to which it is cheaper to take all derivatives of L than to state those that are asked for."""


@spelled
class Problem(Functional):
    """Make the integral of ``lagrangian`` over the graph of y(x) least (or greatest).

    Raises TypeError or ValueError, naming the argument and the remedy, for input that cannot be a problem: mismatched
    dimensions, a function that does not return a scalar, an end where L is not a number.

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
    name:
        What the problem is called; by default the Lagrangian's own name.
    names, units:
        Of the axes: texts for x and each unknown function, such as ``names=("t", "height"), units=("s", "m")``. They
        stand in equations, prints and pictures.
    surface:
        ``surface(x, y[, p])``: the point in space (three coordinates) that x and y are coordinates of. Pictures then
        show the curve on its surface, as is fit for a geodesic.
    """

    written: ClassVar[tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]] = (
        ("x", "y"),
        ("dy", "ddy"),
        ("x0", "y0", "x1", "y1"),
    )
    slide_takes = "phi takes x and y, never p"
    slide_idle = "depends neither on x nor on y, so phi = 0 is no curve to slide on"

    def __init__(
        self,
        lagrangian: Callable[..., Any],
        start: AnyEnd,
        end: AnyEnd,
        constraints: Sequence[Constraint] = (),
        *,
        parameters: Mapping[str, float] | None = None,
        unknowns: Mapping[str, float] | None = None,
        end_cost: Callable[..., Any] | None = None,
        order: int = 1,
        maximise: bool = False,
        breakpoints: Sequence[float] = (),
        name: str = "",
        names: Sequence[str] = (),
        units: Sequence[str] = (),
        surface: Callable[..., Any] | None = None,
    ) -> None:
        check_function("lagrangian", lagrangian)
        if isinstance(order, bool) or not isinstance(order, int | np.integer) or order not in (1, 2):
            remedy = f"; {LOWERED}" if order == 3 else ""
            raise ValueError(f"order must be 1 or 2, not {order!r}{remedy}")
        self.order: int = int(order)
        n, scalar = dimension(start, end)
        self.n: int = n
        self.scalar: bool = scalar
        self._level = np.zeros((1, self.n if self.order == 2 else 0))
        if self.order == 1:
            check_slopes(start, end)
        self.breakpoints: tuple[float, ...] = sequence(
            "breakpoints", breakpoints
        )  # checked with the ends, whose coordinates may be parameters
        super().__init__(
            lagrangian, start, end, constraints, parameters, unknowns, end_cost, maximise, name, names, units, surface
        )
        self._check_domain()
        self.check_places()
        check_levels(self)

    def restated(
        self, start: AnyEnd | None = None, end: AnyEnd | None = None, constraints: Sequence[Constraint] | None = None,
        breakpoints: Sequence[float] | None = None, end_cost: Callable[..., Any] | None = None,
    ) -> Problem:  # fmt: skip
        """The problem with other ends, other costs of them, conditions, or breakpoints, where they are given."""
        return Problem(
            self.lagrangian, self.start if start is None else start, self.end if end is None else end,
            self.constraints if constraints is None else constraints, parameters=self.parameters,
            unknowns=self.unknowns, end_cost=end_cost or self.end_cost, order=self.order, maximise=self.maximise,
            breakpoints=self.breakpoints if breakpoints is None else breakpoints, name=self.name,
        )  # fmt: skip

    def position(self, x: Expression, y: Expression) -> list[Expression]:
        """The abscissa and the ordinates."""
        return [x, y]

    def _named_axes(self, names: Sequence[str], units: Sequence[str]) -> tuple[Axis, tuple[Axis, ...]]:
        abscissa, *ordinates = declared_axes(names, units, ("x", *numbered("y", self.n)))
        return abscissa, tuple(ordinates)

    def _options(self) -> dict[str, Any]:
        return {"order": self.order, "breakpoints": self.breakpoints}

    def placed_ends(self) -> tuple[Any, Any]:
        """The ends, and with them the interval and the breakpoints within it."""
        start, end = super().placed_ends()
        self.span: tuple[float, float] = span_of(start, end)
        self.breakpoints = inside("breakpoints", self.breakpoints, self.span, start, end)
        return start, end

    def check_ends(self) -> None:
        """Raise ValueError where what is given inside the interval no longer lies there."""
        for i, c in enumerate(self.constraints):
            if isinstance(c, Through):
                self._check_beside_ends(i, c)
                inside(f"constraints[{i}].x (Through)", (c.x,), self.span, self.start, self.end)
        self._check_domain()

    def _end_symbols(self) -> list[Expression]:
        kind = self.symbols.kind
        return [kind.sym("x0"), kind.sym("y0", self.n), kind.sym("x1"), kind.sym("y1", self.n)]

    def _checked_constraints(self, constraints: Sequence[Constraint]) -> tuple[Constraint, ...]:
        checked = super()._checked_constraints(constraints)
        for i, c in enumerate(checked):
            if isinstance(c, Through):
                if len(components("Through.y", c.y)) != self.n:
                    raise ValueError(f"constraints[{i}]: Through.y must have {self.n} components")
                self._check_beside_ends(i, c)
                inside(f"constraints[{i}].x (Through)", (c.x,), self.span, self.start, self.end)
                if any(isinstance(d, Through) and d.x == c.x for d in checked[:i]):
                    raise ValueError(
                        f"constraints[{i}]: there is another Through at x = {c.x}; give one for each abscissa"
                    )
        return checked

    def _check_beside_ends(self, index: int, waypoint: Through) -> None:
        """Refuse a waypoint at the abscissa of a fixed end, where it either says nothing or contradicts the end."""
        for label, end in (("start", self.start), ("end", self.end)):
            if not end.fixed or abs(waypoint.x - end.x) > SAME_ABSCISSA * (self.span[1] - self.span[0]):
                continue
            miss = np.nanmax(np.abs(end.values(self.n) - waypoint.values))
            raise ValueError(
                f"constraints[{index}]: {waypoint} lies at the abscissa of {label} = {end}"
                + (f" and misses it by {miss:.6g}; move one of the two" if miss else "; leave it out, or fix it there")
            )

    def check_places(self) -> None:
        """Raise ValueError where a fixed end or a waypoint violates a constraint."""
        if not self.traced:
            return
        ends = [(label, e, e.values(self.n)) for label, e in (("start", self.start), ("end", self.end)) if e.fixed]
        waypoints = [
            (f"constraints[{i}]", c, c.values) for i, c in enumerate(self.constraints) if isinstance(c, Through)
        ]
        check_places(
            self,
            [
                Place(f"{label} = {point}", float(point.x), y)
                for label, point, y in (*ends, *waypoints)
                if not np.isnan(y).any()
            ],
        )

    def _check_domain(self) -> None:
        """Refuse an end where L is not a number, however the end is approached."""
        known = [
            (label, end, y)
            for label, end in (("start", self.start), ("end", self.end))
            if not np.isnan(y := end.values(self.n)).any()
        ]
        if not known:
            return
        steps, width = _nudges(self.n), self.span[1] - self.span[0]
        fans = np.vstack([y + steps[:, 1:] * max(1.0, *map(abs, y.tolist())) for _, _, y in known])
        x = np.concatenate([end.x + steps[:, 0] * (width if end is self.start else -width) for _, end, _ in known])
        slopes = np.broadcast_to(self._chord_slope()[:, None], fans.T.shape)
        nowhere = np.all(np.isnan(self.integrand_values(x, fans.T, slopes)).reshape(len(known), -1), axis=1)
        for (label, end, _), bad in zip(known, nowhere.tolist(), strict=True):
            if bad:
                raise ValueError(
                    f"{label} = {end} lies outside the domain of the Lagrangian: L is not a number there; "
                    "move the end, or check the sign under roots and logarithms"
                )

    def _chord_slope(self) -> np.ndarray:
        rise = self.end.values(self.n) - self.start.values(self.n)
        return np.nan_to_num(rise) / (self.span[1] - self.span[0])

    def integrand_values(
        self, x: np.ndarray, y: np.ndarray, dy: np.ndarray, parameters: np.ndarray | None = None,
        unknowns: np.ndarray | None = None, ddy: np.ndarray | None = None,
    ) -> np.ndarray:  # fmt: skip
        """L at ``m`` points: x of shape (m,), y, dy and, at second order, ddy of shape (n, m).

        ``parameters`` and ``unknowns`` (m, number of them) are other values than the problem's own and its guesses.
        """
        numbers = [
            own[None] if given is None else given
            for own, given in ((self.parameter_values, parameters), (self.unknown_guesses, unknowns))
        ]
        bends = self._level if ddy is None else ddy.T
        return _integrand(self)(len(x), x[:, None], y.T, dy.T, bends, *numbers)[:, 0]

    @property
    def vectorised(self) -> bool:
        """Whether :meth:`integrand_on` has L: it holds nothing that NumPy has no form of, such as a table."""
        return _integrand(self).vectorised

    def integrand_on(self, x: np.ndarray, y: np.ndarray, dy: np.ndarray) -> np.ndarray:
        """L of one unknown function on arrays that broadcast; unknowns at their guesses.

        Raises TypeError or ValueError where L holds what NumPy has no form of, such as a table.
        """
        numbers = self.parameter_values.tolist(), self.unknown_guesses.tolist()
        return _integrand(self).columns(x, [y], [dy], [], *numbers)[0]

    def integrand_derivatives(
        self, x: np.ndarray, y: np.ndarray, dy: np.ndarray, parameters: np.ndarray | None = None
    ) -> Derivatives:
        """L with its first and second derivatives in (x, y, y'[, y'']), arguments as in :meth:`integrand_values`.

        One function serves whatever is asked of L on the way to an answer: derivatives are CasADi's, at a tenth of
        the cost of stating what is asked as an expression of its own.
        """
        numbers = self.parameter_values[None] if parameters is None else parameters, self.unknown_guesses[None]
        return Derivatives(_derivatives(self)(len(x), x[:, None], y.T, dy.T, self._level, *numbers))

    @property
    def linear(self) -> bool:
        """Whether a first-order Lagrangian shows no second derivative in the slope: it is linear there."""
        if self.n > FEW_FUNCTIONS:
            return not _curved(self)
        k = 1 + 2 * self.n
        return not _derivatives(self).occupied[1 + k :].reshape(k, k)[1 + self.n :, 1 + self.n :].any()


@spelled
class Curve(Functional):
    """Make the integral of ``F(q, dq)`` along a curve in space least (or greatest).

    ``F(q, dq[, p])`` must be homogeneous of degree one in ``dq``, so that the
    integral does not depend on how the curve is parametrised; the solver fixes
    the parametrisation (constant speed) itself. ``start`` and ``end`` are
    :class:`At`, :class:`OnSurface`, or the same :class:`Periodic` twice for a
    closed curve. The other arguments are those of :class:`Problem`, with
    ``Holonomic(phi(q))``, ``Bound(h(q, dq))``, ``end_cost(q0, q1[, p])``, ``names`` and ``units``
    of the coordinates, and ``surface(q[, p])``.

    Raises ValueError when ``F`` is not homogeneous of degree one.
    """

    written: ClassVar[tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]] = ("q",), ("dq",), ("q0", "q1")
    slide_takes = "phi takes q, never p"
    slide_idle = "does not depend on q, so phi = 0 is no surface to slide on"

    def __init__(
        self,
        lagrangian: Callable[..., Any],
        start: AnyEnd,
        end: AnyEnd,
        constraints: Sequence[Constraint] = (),
        *,
        parameters: Mapping[str, float] | None = None,
        unknowns: Mapping[str, float] | None = None,
        end_cost: Callable[..., Any] | None = None,
        maximise: bool = False,
        name: str = "",
        names: Sequence[str] = (),
        units: Sequence[str] = (),
        surface: Callable[..., Any] | None = None,
    ) -> None:
        check_function("lagrangian", lagrangian)
        self.n: int = curve_dimension(start, end)
        self.scalar: bool = False
        self.span: tuple[float, float] = (0.0, 1.0)
        super().__init__(
            lagrangian, start, end, constraints, parameters, unknowns, end_cost, maximise, name, names, units, surface
        )
        for i, c in enumerate(self.constraints):
            if isinstance(c, Through):
                raise TypeError(f"constraints[{i}]: Through needs an abscissa, which a Curve does not have")
        self._check_homogeneous("lagrangian", self.integrand)
        for i, t in enumerate(self.traced):
            if isinstance(t.constraint, Isoperimetric):
                self._check_homogeneous(f"constraints[{i}].g", t.expression)
        self.check_places()
        check_levels(self)

    def check_ends(self) -> None:
        """A point anywhere may be the end of a Curve."""

    def position(self, x: Expression, y: Expression) -> list[Expression]:  # noqa: ARG002
        """The point alone: the parameter is no part of a place."""
        return [y]

    def _named_axes(self, names: Sequence[str], units: Sequence[str]) -> tuple[Axis, tuple[Axis, ...]]:
        return Axis("t"), declared_axes(names, units, coordinates(self.n))

    @property
    def axes(self) -> tuple[Axis, ...]:
        """The names and units of the coordinates: the parameter along a Curve has none."""
        return self.ordinates

    def _options(self) -> dict[str, Any]:
        return {}

    def _end_symbols(self) -> list[Expression]:
        kind = self.symbols.kind
        return [kind.sym("q0", self.n), kind.sym("q1", self.n)]

    def check_places(self) -> None:
        """Raise ValueError where an end violates a constraint."""
        check_places(
            self,
            [
                Place(f"{label} = {end}", 0.0, q)
                for label, end in (("start", self.start), ("end", self.end))
                if not np.isnan(q := end.values(self.n)).any()
            ],
        )

    def integrand_values(self, q: np.ndarray, dq: np.ndarray, parameters: np.ndarray | None = None) -> np.ndarray:
        """F at ``m`` points: q and dq of shape (n, m); unknowns at their guesses.

        ``parameters`` (m, number of them) are other values of the parameters than the problem's own.
        """
        numbers = self.parameter_values[None] if parameters is None else parameters, self.unknown_guesses[None]
        return _homogeneous(self)(q.shape[1], q.T, dq.T, *numbers)[:, 0]

    def _check_homogeneous(self, label: str, expression: Expression) -> None:
        """Compare F(q, 3 dq) with 3 F(q, dq) at points near the ends, in several directions."""
        s = self.symbols
        function = ca.Function("F", [s.y, s.dy, s.parameters, s.unknowns], [expression])
        places = [
            np.array(e.guess, dtype=float) if e.slides else np.nan_to_num(e.values(self.n))
            for e in (self.start, self.end)
        ]
        scale = max(float(np.abs(p).max()) for p in places) or 1.0
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


@derived
def _integrand(problem: Problem) -> PointEvaluator:
    return PointEvaluator(ca.Function("L", problem.symbols.all, [problem.integrand]))


@derived
def _derivatives(problem: Problem) -> PointEvaluator:
    hessian, gradient = ca.hessian(problem.integrand, problem.symbols.variables)
    return PointEvaluator(ca.Function("derivatives", problem.symbols.all, [problem.integrand, gradient, hessian]))


@derived
def _curved(problem: Problem) -> bool:
    """Whether L has a second derivative in the slope that does not vanish by itself."""
    return ca.hessian(problem.integrand, problem.symbols.dy)[0].nnz() > 0


@derived
def _homogeneous(problem: Curve) -> PointEvaluator:
    s = problem.symbols
    return PointEvaluator(ca.Function("F", [s.y, s.dy, s.parameters, s.unknowns], [problem.integrand]))


@lru_cache(maxsize=16)
def _nudges(n: int) -> np.ndarray:
    """Steps off an end: none, one either way in each of ``n`` ordinates, and one inward in x; (2 + 2 n, 1 + n)."""
    beside = NUDGE * np.vstack([np.zeros(n), *(sign * row for row in np.eye(n) for sign in (1.0, -1.0)), np.zeros(n)])
    return np.column_stack([NUDGE * (np.arange(2 + 2 * n) == 1 + 2 * n), beside])
