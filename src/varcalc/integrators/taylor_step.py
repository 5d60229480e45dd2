"""One step of Taylor's method with its stops, as one function of one column of numbers.

A *traveller* is such a column: its state Y, the time t it has come to, the
bound on its next step, the time it is to go to, its constants, and for each stop
whether it stands on it, having just set out. The step carries Y as far as the series allows, yet
never over a zero of a stopping function unless it can be certain that there
is one only: where on [0, h] the higher terms are too small to bring the
function to zero, there is none, and where they are too small to turn its
slope, one at most. Steps are made shorter until one of the two is certain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import reduce
from typing import Any

import casadi as ca
import numpy as np

from varcalc.integrators.lowering import scalar_function
from varcalc.integrators.series import solution_series

Expression = Any
"""A CasADi SX expression."""
WENT, SHORTER, LOST, ARRIVED, MET = range(5)
"""What a step came to: it was made; it is to be tried again, shorter; it leads to no number; it has come to its time;
it ended at stop 0.

MET + k says that it ended at stop k. A traveller that has ended stays where it is, and ends again."""
SERIES_SHARE = 1 / 2
"""Of the tolerance: by so much of the step's own length may the series miss its end."""
LEVEL_SHARE = 1e-12
"""Of what a stopping function changes by: to which its series must tell it. Its zero is told on the function itself."""
SHRUNK = (1.0, 0.25)
"""The lengths, as parts of the longest step possible, of which the first is taken that the stops allow."""
LENGTHEN = 8.0
"""A step may be so many times as long as the last."""
UNBOUNDED = 1e8
"""In units of the time in which the state changes by its own size: where the series ends, no step is too long."""
GAP = 8
"""Terms of a series that may be nothing one after another."""
GRAZE = 1e-9
"""A stop that leaves no more of a step than this touches the solution, and is passed over."""
NO_SIGN = 4 * float(np.finfo(float).eps)
"""Of a stopping function: what says nothing of its sign."""
THROUGH = 1e-3
"""Of the time in which the state changes by its own size: so far on both sides of a stop its sign is told."""
STOP_STEPS = 4
"""Newton's steps, kept inside a bracket, to the zero of a stopping function."""
LAST_CORRECTION = 1e-6
"""The last of them, as a part of the step: one more, on the function itself, leads to round-off."""


@dataclass(frozen=True)
class TaylorStep:
    """The ``function`` of travellers for a ``system`` with its ``stops``.

    It takes a traveller (``rows``,) to where the step leaves it, with one number more: what the step came to.
    """

    system: ca.Function
    stops: ca.Function
    tolerance: float
    function: ca.Function = field(init=False)

    def __post_init__(self) -> None:
        system, stops = _autonomous(self.system), _autonomous(self.stops)
        order = int(np.ceil(1 - np.log(self.tolerance) / 2))  # the cheapest: Jorba and Zou, sect. 3
        solution, levels, state, constants = solution_series(system, stops, order)
        time, bound, until, leaving = ca.SX.sym("t"), ca.SX.sym("h"), ca.SX.sym("e"), ca.SX.sym("l", len(levels))
        # what stands on a stop is asked for its next zero: its own is divided out
        ahead = [ca.if_else(leaving[j], ca.vertcat(level[1:], 0), level) for j, level in enumerate(levels)]
        free, whole = _free_step(solution, time, until - time, self.tolerance * SERIES_SHARE)
        graze = GRAZE * ca.fmin(free, whole)
        longest = reduce(ca.fmin, [_told(level, whole) for level in levels], ca.fmin(bound, free))
        length, certain = _allowed(ahead, longest, graze)
        length = ca.fmin(length, until - time)
        natural = ca.fmin(free, whole)
        crossed = [_crossed(level, length, natural) for level in ahead]
        number, zero, found = _zero(ahead, crossed, length)
        doubtful = ca.logic_or(sum(crossed, ca.SX(0)) > 1, ca.logic_not(found))
        going = ca.logic_and(certain, ca.logic_not(ca.logic_and(doubtful, length > graze)))
        met = ca.logic_and(going, number >= 0)
        taken = ca.if_else(met, zero, length)
        end = ca.vertcat(*(_polynomial(series, taken) for series in solution))
        end, shift = _settled(system, stops, end, constants, ca.if_else(met, number, -1), LAST_CORRECTION * length)
        lost = ca.logic_not(ca.logic_and(ca.norm_1(end) < np.inf, ca.logic_or(met, time + length > time)))
        there = ca.if_else(time + length >= until, ARRIVED, WENT)
        code = ca.if_else(lost, LOST, ca.if_else(met, MET + number, ca.if_else(going, there, SHORTER)))
        code = ca.if_else(bound < 0, -bound, code)
        moved = ca.logic_or(code == WENT, ca.logic_and(code >= ARRIVED, bound >= 0))
        after = ca.vertcat(
            ca.if_else(moved, end, state),
            ca.if_else(moved, time + taken + shift, time),
            ca.if_else(code >= LOST, -code, ca.if_else(code == WENT, LENGTHEN, SHRUNK[-1] / 2) * length),
            until,
            constants,
            ca.if_else(code == WENT, 0, leaving),
            code,
        )
        traveller = ca.vertcat(state, time, bound, until, constants, leaving)
        object.__setattr__(self, "function", ca.Function("step", [traveller], [ca.densify(after)]))

    @property
    def rows(self) -> int:
        """The numbers in a traveller."""
        return int(self.function.numel_in(0))

    def travellers(
        self, states: np.ndarray, constants: np.ndarray, until: np.ndarray, leaving: Sequence[int]
    ) -> np.ndarray:
        """Columns (rows, m) for runs about to begin at ``states`` (m, N), to go on for ``until`` (m,) at most."""
        m, size = states.shape
        found = np.zeros((self.rows, m))
        found[:size] = states.T
        found[size + 1], found[size + 2] = np.inf, until
        found[size + 3 : size + 3 + constants.shape[1]] = constants.T
        found[[self.rows - self.stops.numel_out(0) + stop for stop in leaving]] = 1.0
        return found


def _autonomous(function: ca.Function) -> ca.Function:
    """``function`` of scalars; ValueError where it depends on s."""
    function = scalar_function(function)
    s, state, constants = (ca.SX.sym(name, function.numel_in(k)) for k, name in enumerate("sYc"))
    if ca.depends_on(function(s, state, constants), s):
        raise ValueError("a system with stopping functions, and these, must not depend on s")
    return function


def _polynomial(coefficients: Expression, h: Expression) -> Expression:
    return ca.polyval(coefficients[::-1], h)


def _slope(coefficients: Expression) -> Expression:
    """The coefficients of the derivative."""
    return ca.DM(range(1, coefficients.numel())) * coefficients[1:]


def _largest(columns: Sequence[Expression], k: int) -> Expression:
    return reduce(ca.fmax, (ca.fabs(column[k]) for column in columns))


def _free_step(
    solution: Sequence[Expression], time: Expression, left: Expression, share: float
) -> tuple[Expression, Expression]:
    """The step after which the last terms of the series are ``share`` of what the step changes, and a natural time.

    That is the one in which the state changes by its own size. The measure is the change and not the state, which may
    be at the origin of its coordinates, or very far from it.
    """
    order = solution[0].numel() - 1
    change = _largest(solution, 1)
    # in logarithms: a power of one's own for every term would cost as much as the whole series
    falls = {k: _logarithm(change) - _logarithm(_largest(solution, k)) for k in range(order - GAP, order + 1)}
    # a series may have gaps: of what is even in time every other term is nothing. Terms before the last two tell of
    # its radius too, and what grows less than others, such as a sine, gets k/order of it
    radii = [np.log(order / k) + falls[k] / (k - 1) for k in range(order - GAP, order - 1)]
    steps = [(np.log(share) + falls[k]) / (k - 1) for k in (order - 1, order)]
    free = ca.exp(reduce(ca.fmin, [*steps, reduce(ca.fmin, radii) + np.log(share) / (order - 1)]))
    whole = time + _largest(solution, 0) / change
    # at the origin, at the time 0, there is no size to go by
    whole = ca.if_else(whole > 0, whole, ca.fmin(free, ca.if_else(left < np.inf, left, 1.0)))
    return ca.fmin(free, UNBOUNDED * whole), whole


def _told(level: Expression, whole: Expression) -> Expression:
    """The step up to which the series of a stopping function tells it, beside what it changes by in the time ``whole``.

    The solution may be told much farther: beside a straight line the distance from a point is no polynomial.
    """
    order, size = level.numel() - 1, _logarithm(_size(level, whole))
    told = [(np.log(LEVEL_SHARE) + size - _logarithm(ca.fabs(level[k]))) / k for k in (order - 1, order)]
    return ca.exp(reduce(ca.fmin, told))


def _logarithm(size: Expression) -> Expression:
    return ca.log(size + np.finfo(float).tiny)


def _allowed(levels: Sequence[Expression], longest: Expression, graze: Expression) -> tuple[Expression, Expression]:
    """The first of the lengths at which every function has one zero at most, and whether there is one.

    What is no longer than ``graze`` is gone over.
    """
    part = ca.SX(0)
    for share in reversed(SHRUNK):
        part = ca.if_else(_certain(levels, longest * share), share, part)
    touching = longest <= graze
    length = ca.if_else(touching, graze, ca.if_else(part > 0, part, 1.0) * longest)
    return length, ca.logic_or(touching, part > 0)


def _certain(levels: Sequence[Expression], h: Expression) -> Expression:
    """Whether each of the functions is known to have one zero at most on [0, h]; one that is no number has none."""
    doubtful = ca.SX(0)
    for level in levels:
        size = ca.fabs(level)
        steeper = _slope(size)
        may_vanish = size[0] < _polynomial(size[1:], h) * h
        may_turn = steeper[0] < _polynomial(steeper[1:], h) * h
        doubtful = ca.logic_or(doubtful, ca.logic_and(may_vanish, may_turn))
    return ca.logic_not(doubtful)


def _crossed(level: Expression, h: Expression, natural: Expression) -> Expression:
    """Whether a function is zero between 0 and ``h``, where it has one zero at most.

    One that is no more than round-off at both ends, beside what it changes by in the time ``natural``, may have any
    sign: where it is touched it is not crossed.
    """
    end, far = _polynomial(level, h), THROUGH * natural
    through = _polynomial(level, far) * _polynomial(level, -far) < 0
    told = ca.fabs(end - level[0]) > NO_SIGN * _size(level, natural)
    return ca.logic_and(ca.logic_and(level[0] != 0, level[0] * end <= 0), ca.logic_or(told, through))


def _size(level: Expression, whole: Expression) -> Expression:
    """What the first terms of a series come to in the time ``whole``."""
    return reduce(ca.fmax, (ca.fabs(level[k]) * whole**k for k in range(3)))


def _zero(
    levels: Sequence[Expression], crossed: Sequence[Expression], h: Expression
) -> tuple[Expression, Expression, Expression]:
    """The number of the function that is ``crossed``, -1 where none is, its zero on [0, h], and whether that is exact.

    Newton's iteration, with bisection where it would leave the bracket.
    """
    number, level = ca.SX(-1), ca.SX(0)
    for j, one in reversed(list(enumerate(levels))):  # of stops at one place the first counts
        number, level = ca.if_else(crossed[j], j, number), ca.if_else(crossed[j], one, level)
    slope = _slope(level)
    low, high, at, step = ca.SX(0), h, h * level[0] / (level[0] - _polynomial(level, h)), ca.SX(0)
    for _ in range(STOP_STEPS):
        here = _polynomial(level, at)
        before = here * level[0] > 0
        low, high = ca.if_else(before, at, low), ca.if_else(before, high, at)
        newton = at - here / _polynomial(slope, at)
        inside = ca.logic_and(newton >= low, newton <= high)
        better = ca.if_else(inside, newton, (low + high) / 2)
        step, at = better - at, better
    return number, at, ca.logic_or(number < 0, ca.fabs(step) <= LAST_CORRECTION * h)


def _settled(
    system: ca.Function, stops: ca.Function, there: Expression, constants: Expression, number: Expression,
    most: Expression,
) -> tuple[Expression, Expression]:  # fmt: skip
    """Y moved along its rate onto the stop itself, off which it is by round-off, and by how much in t."""
    state, known = ca.SX.sym("Y", there.numel()), ca.SX.sym("c", constants.numel())
    rate, level = system(0, state, known), stops(0, state, known)
    results = [rate, level, ca.jtimes(level, state, rate)]
    rate, level, slope = ca.Function("there", [state, known], [ca.densify(r) for r in results])(there, constants)
    shift = ca.SX(0)
    for j in range(level.numel()):
        shift = ca.if_else(ca.logic_and(number == j, slope[j] != 0), -level[j] / slope[j], shift)
    shift = ca.if_else(ca.fabs(shift) <= most, shift, 0)  # farther it lies only where the stop is touched
    return there + shift * rate, shift
