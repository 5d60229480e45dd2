"""Certificates by duality and one admissible curve: of convex functionals, and where slopes alone are not convex."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from varcalc.certificates.balls import Ball, flint
from varcalc.certificates.bounds import Bounds, Side, bounds
from varcalc.certificates.certificate import Hypothesis, Means
from varcalc.certificates.curve import end_values
from varcalc.certificates.duality import Dual, DualBound
from varcalc.certificates.ends import end_cost
from varcalc.certificates.integrals import Unproved
from varcalc.certificates.jets import Jet
from varcalc.certificates.setting import as_graph, setting_along
from varcalc.certificates.statement import Statement, statement
from varcalc.formulation import SideCondition
from varcalc.problem.convexity import end_cost_proved_convex, proved_jointly_convex
from varcalc.solution import Solution
from varcalc.symbolic.tracing import Expression
from varcalc.verify.along_curve import AlongCurve

CONVEX = "L is a sum of convex functions of one slope each and of a jointly convex one, and so is what bounds add to it"
OF_POLYNOMIALS = "L is a sum of polynomials of one slope each, or the least of some, and of a jointly convex function"
MOMENTA = (
    "with momenta p that grow by L_y along y0 and are at free ends what these ask for, L - p v is nowhere less "
    "than on y0 by more than the lower bound allows for"
)


@dataclass(frozen=True)
class ByConvexity:
    """The proof of a graph's ``solution``, of the curve ``along`` in its own coordinates."""

    solution: Solution
    along: AlongCurve

    @cached_property
    def _of_slopes(self) -> list[tuple[Expression, SideCondition]]:
        """The bounds of slopes."""
        along = self.along
        return [
            pair for pair in zip(along.paths, along.limits, strict=True) if ca.depends_on(pair[0], along.symbols.dy)
        ]

    @cached_property
    def _between(self) -> list[tuple[float, float]]:
        """What each slope lies between."""
        found = [(-math.inf, math.inf)] * self.along.n
        for path, limit in self._of_slopes:
            places = [i for i, dy in enumerate(self.along.symbols.dy.nonzeros()) if ca.is_equal(path, dy)]
            if not places:
                raise Unproved("bounds on what is not a slope itself are not covered by convexity alone")
            (low, high), i = found[places[0]], places[0]
            found[i] = max(low, limit.lower), min(high, limit.upper)
        return found

    @cached_property
    def _held(self) -> Bounds | None:
        """All bounds; None where there are none."""
        return bounds(self.along)[0] if self.along.paths else None

    @cached_property
    def _stated(self) -> Statement:
        """What is minimised, with multipliers of the bounds on the curve."""
        plain = replace(self.along, paths=(), limits=(), forces=())
        kept = [k for k, path in enumerate(self.along.paths) if not ca.depends_on(path, self.along.symbols.dy)]
        if not kept or self._held is None:
            return statement(plain)
        rows = {name: tuple(getattr(self._held.along, name)[k] for k in kept) for name in ("paths", "limits", "forces")}
        of_curve = Bounds(replace(self._held.along, **rows))
        of_curve.prove_signs()
        return statement(of_curve.plain, of_curve.terms)

    @cached_property
    def _pressed(self) -> list[tuple[int, int, Side]]:
        """Where a free end is at a bound of one function: the end, the function and the side of the bound."""
        if self._held is None or self.along.form.ends.periodic:
            return []
        functions = self.along.symbols.y.nonzeros()
        found = []
        for end in (0, 1):
            for side in self._held.touched_at(np.array([self.along.span[end]])):
                places = [i for i, y in enumerate(functions) if ca.is_equal(self.along.paths[side.number], y)]
                found += [(end, i, side) for i in places if not self._stated.held[end][i]]
        return found

    def bounds(self) -> tuple[Ball, Ball, bool]:
        """The two numbers, of what is minimised, and whether all of its terms are proved convex."""
        dual = DualBound(self._with_ends(), self._between)
        dual.check()
        found = dual.found()
        cost = self._cost(dual, found)
        value = found.value + cost
        return (value - found.lost).lower(), self._above(value).upper(), dual.convex

    def _with_ends(self) -> Statement:
        """The statement with ends given where bounds hold them."""
        held, values = ([row.copy() for row in rows] for rows in (self._stated.held, self._stated.values))
        for end, i, side in self._pressed:
            held[end][i], values[end][i] = True, side.limit
        return replace(self._stated, held=tuple(held), values=tuple(values))

    def _above(self, value: Ball) -> Ball:
        """What a curve within the bounds comes to: the curve itself, whose ``value`` that is, where there are none."""
        if self._held is None:
            return value
        setting = setting_along(self._held.plain, self.solution.value, as_found=True)
        return self._held.above(setting).value + end_cost(setting.statement, setting.joints)

    def _cost(self, dual: DualBound, found: Dual) -> Ball:
        """What the ends cost; Unproved where an end may be better off its bound."""
        cost, zero = self._stated.cost, flint().arb(0)
        jet = Jet(zero) if cost is None else cost.jet(*end_values(self._stated, dual.joints), 1)
        for end, i, side in self._pressed:
            momentum = found.momenta[end][i] * (1 if end else -1)
            if not (momentum + jet.first.get(i + end * self.along.n, 0)) * side.sign >= 0:
                raise Unproved("an end that a bound holds is not proved to be pressed against it")
        return zero + jet.value


def by_convexity(solution: Solution) -> tuple[Ball, Ball, list[Hypothesis]]:
    """Two numbers between which what a graph minimises lies, and what was proved; Unproved where it is not."""
    along = as_graph(solution)
    if along is None:
        raise Unproved("convexity alone is of use for graphs between given abscissae")
    form = along.form
    reasons = {
        "convexity alone is of use for Lagrangians of first order without other conditions than bounds": along.order
        == 2
        or bool(along.integrals)
        or bool(len(along.numbers))
        or bool(form.conditions.waypoints),
        "the functional and what it is made least over are not proved convex": bool(along.paths)
        and not proved_jointly_convex(solution.problem),
        "what the ends cost is not proved convex": not end_cost_proved_convex(solution.problem),
        "periodic ends that cost something are not covered": form.ends.periodic and form.ends.joint is not None,
    }
    reason = next((reason for reason, holds in reasons.items() if holds), "")
    if reason:
        raise Unproved(reason)
    low, high, convex = ByConvexity(solution, along).bounds()
    return (
        low,
        high,
        [Hypothesis(CONVEX if convex else OF_POLYNOMIALS, Means.COMPOSITION), Hypothesis(MOMENTA, Means.BALLS)],
    )
