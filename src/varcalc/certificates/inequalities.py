"""Prescribed integrals that are inequalities: those that hold with equality take a multiplier of the right sign.

With lambda >= 0 where the integral of g is at most c, and lambda <= 0 where it is at least c, the integral of L +
lambda g less lambda c is no more than that of L on all curves that are admissible: bounded over all curves, it bounds
theirs from below (weak duality; Luenberger, "Optimization by Vector Space Methods", 1969, sect. 8.6). The curve of the
upper bound meets what holds with equality exactly, and the rest is proved of it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca

from varcalc.certificates.balls import Ball, flint
from varcalc.certificates.integrals import Unproved
from varcalc.certificates.levels import meeting
from varcalc.certificates.nearness import Attained
from varcalc.certificates.setting import Setting
from varcalc.formulation import SideCondition
from varcalc.problem.conditions import Constraint, Isoperimetric
from varcalc.problem.functional import unused_names
from varcalc.problem.problem import Problem
from varcalc.symbolic.instructions import Program
from varcalc.symbolic.tracing import Expression


@dataclass(frozen=True)
class Inequalities:
    """The levels of a graph that are inequalities; ``setting`` is its curve's, on which some hold with equality."""

    problem: Problem
    setting: Setting

    @cached_property
    def _active(self) -> list[tuple[Expression, float, float]]:
        """Integrand, level and multiplier of each that holds with equality; Unproved where the sign is wrong."""
        found = []
        for (condition, multiplier), prescribed in zip(self._met, self._prescribed, strict=True):
            if prescribed:
                continue
            low, high = self._interval(condition.index)
            level = high if multiplier > 0 else low
            if not (math.isfinite(level) and condition.lower == level and multiplier):
                raise Unproved("the multiplier of a level has not the sign that the inequality asks for")
            found.append((condition.expression, level, multiplier))
        return found

    @property
    def _met(self) -> list[tuple[SideCondition, float]]:
        """The levels that hold with equality, each with its multiplier."""
        along = self.setting.statement.along
        return list(zip(along.form.conditions.integrals, along.lambdas.tolist(), strict=True))

    @property
    def _prescribed(self) -> list[bool]:
        """Which of these are no inequalities."""
        intervals = [self._interval(condition.index) for condition, _ in self._met]
        return [low == high for low, high in intervals]

    def _interval(self, index: int) -> tuple[float, float]:
        condition = self.problem.constraints[index]
        assert isinstance(condition, Isoperimetric)
        return condition.interval

    @cached_property
    def shift(self) -> Ball:
        """The sum of the multipliers times the levels."""
        return sum((flint().arb(level) * multiplier for _, level, multiplier in self._active), flint().arb(0))

    def lower(self) -> Problem:
        """The problem of L + lambda g without the levels that are inequalities."""
        kept = [c for c in self.problem.constraints if isinstance(c, Isoperimetric) and c.equality]
        return with_multipliers(self.problem, [(g, multiplier) for g, _, multiplier in self._active], kept)

    def above(self, setting: Setting) -> Attained:  # noqa: ARG002  what others ask of theirs
        """A curve that meets all levels, its value with :attr:`shift`."""
        met = meeting(self.setting)
        numbers = {c.index for c in self.setting.statement.along.form.conditions.integrals}
        idle = [(k, t) for k, t in self._levels() if k not in numbers]
        if idle:
            s = self.problem.symbols
            function = ca.Function("idle", s.all, [ca.densify(ca.vertcat(*(e for _, e in idle)))])
            for value, (k, _) in zip(met.integrals(Program(function)), idle, strict=True):
                low, high = self._interval(k)
                if not (value >= low and value <= high):
                    raise Unproved("the curve of the upper bound is not proved to satisfy a level")
        value, pieces, bare = self.setting.along.value, self.setting.pieces, self.setting.statement.bare
        if not self._met:
            return Attained(value, pieces)
        for (condition, multiplier), prescribed in zip(self._met, self._prescribed, strict=True):
            value -= flint().arb(condition.lower) * multiplier if prescribed else 0
        moved, count = met.moved(), len(self._met)
        levels = [far for far, kept in zip(moved[bare : bare + count], self._prescribed, strict=True) if kept]
        return Attained(value + met.correction(), pieces, [*moved[:bare], *levels, *moved[bare + count :]])

    def _levels(self) -> list[tuple[int, Expression]]:
        """The numbers of the constraints that are levels, and what they integrate."""
        numbers = {id(c): k for k, c in enumerate(self.problem.constraints)}
        return [(numbers[id(t.constraint)], t.expression) for t in self.problem.traced]


def inequalities(problem: Problem, setting: Setting) -> Inequalities:
    """The levels of a problem that are inequalities; Unproved where they are not covered."""
    form = setting.statement.along.form
    if not all(isinstance(c, Isoperimetric) for c in problem.constraints) or form.lift is not None:
        raise Unproved("levels that are inequalities are covered of graphs without other conditions")
    if form.ends.joint is not None or form.ends.periodic or problem.unknowns:
        raise Unproved("levels that are inequalities are covered where each end is given or free by itself")
    return Inequalities(problem, setting)


def with_multipliers(
    problem: Problem, terms: Sequence[tuple[Expression, float]], constraints: Sequence[Constraint]
) -> Problem:
    """The problem of L + lambda g + ..., L in the sense that is minimised, under ``constraints``.

    Of these each Isoperimetric is one of the problem's own.
    """
    names = unused_names(problem, [f"multiplier_{k}" for k in range(len(terms))])
    symbols = ca.SX.sym("multipliers", len(names))
    total = problem.sign * problem.integrand
    for k, (integrand, _) in enumerate(terms):
        total = total + symbols[k] * integrand

    values = {name: multiplier for name, (_, multiplier) in zip(names, terms, strict=True)}
    return problem.with_integrand(problem.sign * total, values, symbols, constraints=constraints)
