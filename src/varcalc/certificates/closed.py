"""Closed Curves: of those that are one but for where they begin, or for where they lie, one is singled out.

Any closed curve may begin at any of its points. With t the share of its length from the start, the integral of
q (t - 1/2) for one coordinate q is a continuous function of where it begins, whose mean over all starts is zero: so
there are starts for which it is zero, and curves for which it is zero are all that need be looked at. Where neither
the functional nor what is prescribed changes if a coordinate is shifted, it is shifted to be zero at the start; of
other coordinates the start is a number that is optimised. What is left are curves between two ends that are given,
among which the minimum may be a strict one (Hurwitz, "Sur le problème des isopérimètres", C. R. Acad. Sci. 132 (1901)
401, singles out curves alike).
"""

from __future__ import annotations

import math

import casadi as ca
import numpy as np

from varcalc.certificates.degree import degrees
from varcalc.certificates.integrals import Unproved
from varcalc.formulation.graph import graph_form
from varcalc.methods.answer import Extremal
from varcalc.problem.conditions import Fixed, Isoperimetric
from varcalc.problem.functional import Functional, rebuilt, unused_names
from varcalc.problem.problem import Problem
from varcalc.symbolic.tracing import Expression, TracedFunction, as_written
from varcalc.verify.along_curve import AlongCurve, in_form
from varcalc.verify.given_curve import distinct

SPEED, START = "constant_speed", "start_of_{}"
"""The numbers of the problem that are the speed, and the coordinates of the start."""
STARTS = 512
"""Points of the curve from which the start is chosen."""


def begun(along: AlongCurve) -> AlongCurve:
    """The curve among those that are singled out, less its start, as a graph over the share of its length.

    ``along`` is the curve in the gauge of constant speed. Unproved where other conditions than prescribed integrals
    hold.
    """
    given, vertices = along.form.problem, along.vertices
    if not all(isinstance(c, Isoperimetric) and c.equality for c in given.constraints):
        raise Unproved("closed Curves are covered under no other conditions than prescribed integrals")
    placed = [k for k in range(along.n) if not _may_be_shifted(given, k)]
    turned, start = _start(along)
    place = along.evaluate(np.array([start]), 0)
    unit = 2.0 ** round(math.log2(np.ptp(along.evaluate(np.arange(STARTS) / STARTS, 0), axis=1).max()))

    def curve(t: np.ndarray, k: int) -> np.ndarray:
        there = along.evaluate(np.mod(t + start, 1.0), k)
        return there if k else there - place

    form = graph_form(_problem(along, placed, turned, unit))
    numbers = np.r_[along.numbers, unit + place[placed, 0]]
    shares = np.r_[0.0, np.sort(np.mod(vertices - start, 1.0)), 1.0]
    return in_form(Extremal(form, curve, numbers, distinct(shares), np.r_[along.lambdas, 0.0], {}))


def _problem(along: AlongCurve, placed: list[int], turned: int, unit: float) -> Problem:
    """The problem of the curves that are singled out; the start of the coordinates ``placed`` is optimised.

    It is counted from ``-unit``, so that as a number it is of the size of the curve wherever that lies.
    """
    given, s = along.form.problem, along.symbols
    added = unused_names(given, [SPEED, *(START.format(k) for k in placed)])
    names = tuple(given.parameters), (*given.unknowns, *added)
    begin, there = s.kind.sym("start", len(placed)), s.kind(s.y)
    with as_written():
        for k, number in zip(placed, begin.nonzeros(), strict=True):
            there[k] += number - unit
    arguments = [s.x, s.y, s.dy, s.parameters, ca.vertcat(s.unknowns, begin)]

    def stated(e: Expression) -> TracedFunction:
        """An expression of the form as a function of the new problem, ``y`` counted from the start."""
        with as_written():
            anew = ca.substitute([ca.densify(e)], [s.y], [there])
            return TracedFunction(ca.Function("traced", arguments, anew), names)

    levels = zip(along.integrals, along.form.conditions.integrals, strict=True)
    conditions = [Isoperimetric(stated(g), c.lower) for g, c in levels]
    conditions.append(Isoperimetric(stated(s.y[turned] * (s.x - 0.5)), 0.0))
    ends = (Fixed(share, [0.0] * along.n) for share in (0.0, 1.0))
    options = {"parameters": given.parameters, "unknowns": dict.fromkeys(names[1], 1.0), "maximise": given.maximise}
    found = rebuilt(Problem, (stated(given.sign * along.integrand), *ends, conditions), options | {"name": given.name})
    assert isinstance(found, Problem)
    return found


def _may_be_shifted(given: Functional, k: int) -> bool:
    """Whether shifting coordinate k leaves the functional and what is prescribed of closed curves as they are.

    It does where the derivatives by the coordinate are linear in the velocities alone: their integrals are zero.
    """
    s = given.symbols
    rates = [ca.gradient(e, s.y[k]) for e in (given.integrand, *(t.expression for t in given.traced))]
    if any(ca.depends_on(rate, s.y) or not ca.substitute(rate, s.dy, 0).is_zero() for rate in rates):
        return False
    slopes = [[symbol is s.dy] * int(symbol.numel()) for symbol in s.all]
    return all(degrees(ca.Function("rate", s.all, [ca.densify(rate)]), slopes)[0][0] <= 1.0 for rate in rates)


def _start(along: AlongCurve) -> tuple[int, float]:
    """The coordinate whose integral with t - 1/2 is made zero, and a start for which it about is."""
    t = np.arange(STARTS) / STARTS
    q = along.evaluate(t, 0)
    q = q - q.mean(axis=1, keepdims=True)
    # its derivative by the start is how far the start is from the mean
    first = (q * (t - 0.5)).mean(axis=1, keepdims=True)
    integral = first + (np.cumsum(q, axis=1) - 0.5 * (q + q[:, :1])) / STARTS
    crossed = integral * np.roll(integral, -1, axis=1) <= 0
    k, at = np.unravel_index(np.where(crossed, np.abs(q), -1.0).argmax(), q.shape)
    return int(k), float(t[at])
