"""Forms in which the greater of two branches is a function of its own, held above both by bounds.

Where L grows with max(a, b), as it does at a convex kink, the least of L with s in its place, over all s >= a and
s >= b, is the least of L itself (the epigraph form; Rockafellar, "Convex Analysis", 1970, sect. 4). That is smooth,
whatever the kink is of and however often a curve meets it or rests on it, and an interior-point method knows bounds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import casadi as ca
import numpy as np

from varcalc.formulation.form import Conditions, EndConditions, Ends, Form, Sampled, SideCondition, Start, Stated
from varcalc.formulation.height import height
from varcalc.problem.functional import Symbols, arguments_at
from varcalc.symbolic.branches import multiple
from varcalc.symbolic.derived import Cache
from varcalc.symbolic.instructions import interpret, operate
from varcalc.symbolic.joins import joined
from varcalc.symbolic.switches import CONTINUOUS, alike, arguments, switches
from varcalc.symbolic.tracing import Expression

PLACES_FOR_GROWTH = 201
"""Abscissae at which it is seen whether L grows with the greater branch."""
ABOVE = 1e-2
"""How far above both branches a function begins, in units of their largest size on the curve and on one bent aside."""
MOST_KINKS = 6
"""Kinks that have functions of their own."""
BRANCHES: dict[int, Callable[[Expression, Expression], tuple[Expression, Expression]]] = {
    ca.OP_FABS: lambda a, _: (a, -a),
    ca.OP_FMAX: lambda a, b: (a, b),
    ca.OP_FMIN: lambda a, b: (-a, -b),
}
"""The branches of which an operation is the greater one; of fmin it is less that."""

Restated = Callable[[Sequence[Expression]], list[Expression]]
"""Expressions in a form's symbols, stated in those with more functions."""


def epigraph_form(form: Form, curve: Sampled) -> Form | None:
    """The form with one function more for each kink of its integrand; None where it has others than convex ones.

    The highest derivative of each of them, which may jump, is the greater branch. That L grows with it is seen along
    ``curve``, in the form's own coordinates, from where it is to be minimised.
    """
    kinks = _kinks(form)
    if kinks is None or not kinks.tops:
        return None
    s = np.linspace(*form.span, PLACES_FOR_GROWTH)
    seen = kinks.along(form, curve(s), s)
    if seen is None:
        return None
    greater, sizes = seen
    arch = height(form) * form.start.bumps.sum(axis=0)[:, None] * (1 - np.linspace(-1, 1, PLACES_FOR_GROWTH) ** 2)
    bent = kinks.along(form, curve(s) + arch, s)
    # one branch may be zero wherever it is the greater
    room = ABOVE * np.hstack([sizes] if bent is None else [sizes, bent[1]]).max(axis=1, keepdims=True)
    old, count = form.symbols, len(kinks.tops)
    new = replace(Symbols.make(old.kind, form.n + count, form.order, 0, 0), x=old.x)
    new = replace(new, parameters=old.parameters, unknowns=old.unknowns)
    tops = new.slopes[-1][form.n :]
    before = [old.y, *old.slopes, ca.vertcat(*kinks.tops)]
    after = [new.y[: form.n], *(slope[: form.n] for slope in new.slopes), tops]

    def stated(expressions: Sequence[Expression]) -> list[Expression]:
        return ca.substitute([old.kind(e) for e in expressions], before, after)

    (integrand,) = stated([kinks.integrand])
    x, y, speed, slope = stated(form.lifted or (old.x, old.y, old.kind(1), old.dy))
    bounds = [tops[k] - branch for k, both in enumerate(kinks.branches) for branch in stated(both)]
    first = len(form.problem.constraints)
    above = (SideCondition(ca.densify(e), 0.0, math.inf, first + i) for i, e in enumerate(bounds))
    conditions = _restated(form.conditions, stated)
    coordinates = replace(
        form.coordinates,
        stated=Stated(new, integrand, integrand, (x, y, speed, slope)),
        numbers=None,
        note="the greater branches at kinks are functions of their own",
    )
    return replace(
        form,
        coordinates=coordinates,
        ends=_ends(form, new, count),
        conditions=replace(conditions, pathwise=(*conditions.pathwise, *above)),
        start=_start(form.start, curve, s, greater + room, form.order),
        cache=Cache(),
        elsewhere=None,
    )


@dataclass(frozen=True)
class _Kinks:
    """An integrand in which ``tops``, symbols, stand for the greater of two ``branches``; these may hold such too."""

    integrand: Expression
    branches: tuple[tuple[Expression, Expression], ...]
    tops: tuple[Expression, ...]

    def along(self, form: Form, y: np.ndarray, s: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """The greater branches (kinks, m) along a curve y (n, m) at s (m,), and the larger sizes of either branch.

        None where L does not grow with all of the greater ones.
        """
        symbols, tops = form.symbols, ca.vertcat(*self.tops)
        slopes = np.gradient(y, s, axis=1)
        bends = np.gradient(slopes, s, axis=1)[: symbols.ddy.numel()]
        point = arguments_at(form.problem, s, y, slopes, bends, form.start.unknowns)
        greater = ca.vertcat(*(ca.fmax(a, b) for a, b in self.branches))
        larger = ca.vertcat(*(ca.fmax(ca.fabs(a), ca.fabs(b)) for a, b in self.branches))
        growth = ca.densify(ca.gradient(self.integrand, tops))
        function = ca.Function("greater", [*symbols.all, tops], [greater, larger, growth])
        values = np.zeros((len(self.tops), len(s)))
        for _ in self.tops:  # those of a kink within another come first
            values = np.asarray(function(*point, values)[0])
        sizes, grown = map(np.asarray, function(*point, values)[1:])
        seen = np.isfinite(values).all() and np.isfinite(sizes).all() and np.isfinite(grown).all()
        return (values, sizes) if seen and (grown >= 0.0).all() else None


def _kinks(form: Form) -> _Kinks | None:
    """The integrand with its kinks as functions of their own; None where it jumps, or what else is asked switches."""
    symbols = form.symbols
    if not isinstance(form.integrand, ca.SX) or form.conditions.waypoints or not form.same_functional:
        return None
    asked = [c.expression for c in (*form.conditions.integrals, *form.conditions.pathwise)]
    asked += [] if form.ends.joint is None else [form.ends.joint.cost, form.ends.joint.equations]
    moving = ca.vertcat(symbols.y, symbols.dy, symbols.ddy)
    every = (w for w in switches([form.integrand], symbols.all) if w.depends_on(moving))
    found = [w for w in joined([form.integrand], symbols.all, every) if not w.smooth]
    places = [] if form.ends.joint is None else form.ends.joint.places
    # what switches at abscissae does so between the elements
    curve = ca.vertcat(moving, *places, symbols.unknowns)
    asked_switching = any(w.depends_on(curve) for w in switches(asked, [*symbols.all, *places]))
    if len(found) > MOST_KINKS or any(w.jumps or w.stepped for w in found) or asked_switching:
        return None
    kinks = [w.argument for w in found]
    tops: list[Expression] = []
    lifted: list[tuple[Expression, Expression]] = []

    def applied(operation: int, operands: Sequence[Expression]) -> Expression:
        """The operation, or a symbol for the greater of its sides where it is a kink that moves with the curve."""
        if operation not in CONTINUOUS or not ca.depends_on(operate(operation, operands), ca.vertcat(moving, *tops)):
            return operate(operation, operands)
        (argument,) = arguments(operation, operands)
        within = bool(tops) and ca.depends_on(argument, ca.vertcat(*tops))
        if not (within or any(alike(argument, kink) for kink in kinks)):
            return operate(operation, operands)
        both = BRANCHES[operation](operands[0], operands[-1])
        greater = next((g for g in map(partial(_greater, both), lifted, tops) if g is not None), None)
        if greater is None:
            greater = ca.SX.sym(f"greater{len(tops)}")
            lifted.append(both)
            tops.append(greater)
        return -greater if operation == ca.OP_FMIN else greater

    function = ca.Function("read", symbols.all, [form.integrand])
    ((integrand,),) = interpret(function, [v.nonzeros() if v.numel() else [] for v in symbols.all], ca.SX, applied)
    return _Kinks(integrand, tuple(lifted), tuple(tops))


def _greater(
    both: tuple[Expression, Expression], known: tuple[Expression, Expression], top: Expression
) -> Expression | None:
    """The greater of two branches by the ``top`` of others, which part at the same kink; None where they do not."""
    (a, b), (first, last) = both, known
    share = multiple(a - b, first - last)
    if share == 0.0:
        return None
    base = last if share > 0.0 else first
    return top if abs(share) == 1.0 and alike(b, base) == 1 else b + abs(share) * (top - base)


def _restated(conditions: Conditions, stated: Restated) -> Conditions:
    """Conditions in symbols with more functions."""

    def each(given: tuple[SideCondition, ...]) -> tuple[SideCondition, ...]:
        return tuple(replace(c, expression=stated([c.expression])[0]) for c in given)

    return replace(conditions, integrals=each(conditions.integrals), pathwise=each(conditions.pathwise))


def _ends(form: Form, symbols: Symbols, count: int) -> Ends:
    """The ends with ``count`` functions more, which begin at zero and end as they may."""
    ends, joint = form.ends, form.ends.joint
    start = np.hstack([ends.start, np.zeros((len(ends.start), count))])
    end = np.hstack([ends.end, np.full((len(ends.end), count), np.nan)])
    if joint is not None:
        places = [symbols.kind.sym(name, form.n + count) for name in ("start", "end")]
        equations, cost = ca.substitute(
            [joint.equations, joint.cost], [joint.start, joint.end], [place[: form.n] for place in places]
        )
        joint = EndConditions(places[0], places[1], equations, cost)
    return replace(ends, start=start, end=end, joint=joint)


def _start(start: Start, curve: Sampled, s: np.ndarray, greater: np.ndarray, order: int) -> Start:
    """A curve to start from, with the functions of which ``greater`` are derivatives, and bumps of what was there."""
    sums = greater
    for _ in range(order):
        pieces = 0.5 * (sums[:, 1:] + sums[:, :-1]) * np.diff(s)
        sums = np.hstack([np.zeros((len(sums), 1)), np.cumsum(pieces, axis=1)])

    def extended(at: np.ndarray) -> np.ndarray:
        return np.vstack([curve(at), *(np.interp(at, s, row) for row in sums)])

    bumps = np.hstack([start.bumps, np.zeros((len(start.bumps), len(greater)))])
    return replace(start, curve=extended, bumps=bumps)
