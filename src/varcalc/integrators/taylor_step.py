"""One step of Taylor's method with its stops, as one function of one column of numbers.

A *traveller* is such a column: its state Y, the time t it has come to, the
bound on its next step, the time it is to go to, its constants, and for each stop
whether it stands on it, having just set out. The step carries Y as far as the series allows, yet
never over a zero of a stopping function unless it can be certain that there
is one only: where on [0, h] the higher terms are too small to bring the
function to zero, there is none, and where they are too small to turn its
slope, one at most. Steps are made shorter until one of the two is certain.
Of a floor, to which a solution sinks slowly, it is asked at the ends of steps
alone whether one has gone below it: that costs a tenth of it.
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
LARGEST = 1e300
"""A ratio above that is as good as infinite, of which no step is left."""
NO_SIGN = 4 * float(np.finfo(float).eps)
"""Of a stopping function: what says nothing of its sign."""
THROUGH = 1e-3
"""Of the time in which the state changes by its own size: so far on both sides of a stop its sign is told."""
NEAR_TERMS = 6
"""Of the series, that tell there to round-off."""
STOP_STEPS = 4
"""Newton's steps, kept inside a bracket, to the zero of a stopping function."""
LAST_CORRECTION = 1e-6
"""The last of them, as a part of the step: one more, on the function itself, leads to round-off."""


@dataclass(frozen=True)
class TaylorStep:
    """The ``function`` of travellers for a ``system`` with its ``stops``, floors where they are ``at_ends``.

    It takes a traveller (``rows``,) to where the step leaves it, with one number more: what the step came to.
    """

    system: ca.Function
    stops: ca.Function
    tolerance: float
    at_ends: tuple[int, ...] = ()
    function: ca.Function = field(init=False)

    def __post_init__(self) -> None:
        system, stops = _autonomous(self.system), _autonomous(self.stops)
        order = int(np.ceil(1 - np.log(self.tolerance) / 2))  # the cheapest: Jorba and Zou, sect. 3
        solution, levels, state, constants = solution_series(system, stops, order)
        time, bound, until, leaving = ca.SX.sym("t"), ca.SX.sym("h"), ca.SX.sym("e"), ca.SX.sym("l", len(levels))
        # what stands on a stop is asked for its next zero: its own is divided out
        looked_for = [j for j in range(len(levels)) if j not in self.at_ends]
        ahead = [ca.if_else(leaving[j], ca.vertcat(levels[j][1:], 0), levels[j]) for j in looked_for]
        known = [levels[j] for j in looked_for]
        longest, natural = _longest(solution, known, time, bound, until - time, self.tolerance * SERIES_SHARE)
        graze = GRAZE * natural
        length, certain = _allowed(ahead, longest, graze)
        length = ca.fmin(length, until - time)
        crossed = [_crossed(level, length, natural) for level in ahead]
        number, zero, found = _zero(looked_for, ahead, crossed, length)
        doubtful = ca.logic_or(sum(crossed, ca.SX(0)) > 1, ca.logic_not(found))
        going = ca.logic_and(certain, ca.logic_not(ca.logic_and(doubtful, length > graze)))
        met = ca.logic_and(going, number >= 0)
        taken = ca.if_else(met, zero, length)
        end = ca.vertcat(*(_polynomial(series, taken) for series in solution))
        reached = ca.if_else(met, number, -1)
        end, shift, over = _settled(system, stops, end, constants, reached, LAST_CORRECTION * length)
        lost = ca.logic_not(ca.logic_and(ca.norm_1(end) < np.inf, ca.logic_or(met, time + length > time)))
        there = ca.if_else(time + length >= until, ARRIVED, WENT)
        for j in self.at_ends:
            there = ca.if_else(ca.logic_and(over[j] <= 0, ca.logic_not(leaving[j])), MET + j, there)
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
    """By pairs, pairs of pairs and so on (Estrin's scheme), whose products need not wait for one another."""
    terms = [coefficients[k] for k in range(coefficients.numel())]
    while len(terms) > 1:
        pairs = [terms[k] + terms[k + 1] * h for k in range(0, len(terms) - 1, 2)]
        terms, h = pairs + terms[2 * len(pairs) :], h**2
    return terms[0]


def _slope(coefficients: Expression) -> Expression:
    """The coefficients of the derivative."""
    return ca.DM(range(1, coefficients.numel())) * coefficients[1:]


def _largest(columns: Sequence[Expression], k: int) -> Expression:
    return reduce(ca.fmax, (ca.fabs(column[k]) for column in columns))


def _longest(
    solution: Sequence[Expression], levels: Sequence[Expression], time: Expression, bound: Expression, left: Expression,
    share: float,
) -> tuple[Expression, Expression]:  # fmt: skip
    """The longest step up to a ``bound`` that series allow, and a natural time, in which the state changes by its size.

    The last terms of the solution are to be ``share`` of what the step changes. The measure is the change and not the
    state, which may be at the origin of its coordinates, or very far from it. A stopping function may be told less far
    than the solution: beside a straight line the distance from a point is no polynomial.
    """
    order = solution[0].numel() - 1
    change, room = _largest(solution, 1), ca.if_else(left < np.inf, left, 1.0)
    size = time + _largest(solution, 0) / change
    begun = size > 0  # at the origin, at the time 0, there is no size to go by
    trial = ca.if_else(bound < np.inf, bound / LENGTHEN, ca.if_else(begun, size, room))
    power = trial ** (order - 2)
    last = _times_allowed(
        ca.fmax(_largest(solution, order - 1), _largest(solution, order) * trial) * power / change, share
    )
    # from the terms before the last or from the last: a longer step by the lesser of both powers, as a shorter one
    free = trial * ca.exp(-ca.fmax(last / (order - 2), last / (order - 1)))
    whole = ca.if_else(begun, size, ca.fmin(free, room))
    free = ca.fmin(free, UNBOUNDED * whole)
    gap, power = ca.SX(0), free ** (order - GAP - 1)
    # a series may have gaps: of what is even in time every other term is nothing. Terms before the last two tell of
    # its radius too, and what grows less than others, such as a sine, gets k/order of it
    for k in range(order - GAP, order - 1):
        weight = (k / order * share ** (-1 / (order - 1))) ** (k - 1)
        gap, power = ca.fmax(gap, weight * _largest(solution, k) * power), power * free
    beyond = ca.fmax(0.0, _times_allowed(gap / change, 1.0) / (order - GAP - 1))
    longest = ca.fmin(bound, free)
    power = longest ** (order - 1)
    told = [ca.fmax(ca.fabs(level[order - 1]), ca.fabs(level[order]) * longest) * power / _size(level, whole)
            for level in levels]  # fmt: skip
    if told:
        beyond = ca.fmax(beyond, _times_allowed(reduce(ca.fmax, told), LEVEL_SHARE) / (order - 1))
    return longest * ca.exp(-beyond), ca.fmin(free, whole)


def _times_allowed(value: Expression, allowed: float) -> Expression:
    """The logarithm of how many times a value is what is allowed.

    In logarithms, and few of them: a power of one's own for every term would cost as much as the whole series.
    """
    return ca.log(ca.fmin(ca.fmax(np.finfo(float).tiny, value / allowed), LARGEST))


def _allowed(levels: Sequence[Expression], longest: Expression, graze: Expression) -> tuple[Expression, Expression]:
    """The first of the lengths at which every function has one zero at most, and whether there is one.

    What is no longer than ``graze`` is gone over.
    """
    part, doubts = ca.SX(0), [_doubts(level, longest) for level in levels]
    for share in reversed(SHRUNK):
        doubtful = sum((ca.logic_and(a * share > 1, b * share > 1) for a, b in doubts), ca.SX(0))
        part = ca.if_else(doubtful, part, share)
    touching = longest <= graze
    length = ca.if_else(touching, graze, ca.if_else(part > 0, part, 1.0) * longest)
    return length, ca.logic_or(touching, part > 0)


def _doubts(level: Expression, h: Expression) -> tuple[Expression, Expression]:
    """How large on [0, h] the higher terms of a function, and those of its slope, are beside the first.

    Where one is less than 1 it has one zero at most; one that is no number has none. On a part of [0, h] both are less
    by as much as the part is shorter, or more.
    """
    size = ca.fabs(level)
    steeper = _slope(size)
    return _polynomial(size[1:], h) * h / size[0], _polynomial(steeper[1:], h) * h / steeper[0]


def _crossed(level: Expression, h: Expression, natural: Expression) -> Expression:
    """Whether a function is zero between 0 and ``h``, where it has one zero at most.

    One that is no more than round-off at both ends, beside what it changes by in the time ``natural``, may have any
    sign: where it is touched it is not crossed.
    """
    end, far = _polynomial(level, h), THROUGH * natural
    near = level[:NEAR_TERMS]
    through = _polynomial(near, far) * _polynomial(near, -far) < 0
    told = ca.fabs(end - level[0]) > NO_SIGN * _size(level, natural)
    return ca.logic_and(ca.logic_and(level[0] != 0, level[0] * end <= 0), ca.logic_or(told, through))


def _size(level: Expression, whole: Expression) -> Expression:
    """What the first terms of a series come to in the time ``whole``."""
    return reduce(ca.fmax, (ca.fabs(level[k]) * whole**k for k in range(3)))


def _zero(
    numbers: Sequence[int], levels: Sequence[Expression], crossed: Sequence[Expression], h: Expression
) -> tuple[Expression, Expression, Expression]:
    """The number of the function that is ``crossed``, -1 where none is, its zero on [0, h], and whether that is exact.

    Newton's iteration, with bisection where it would leave the bracket.
    """
    if not levels:
        return ca.SX(-1), h, ca.SX(1)
    number, level = ca.if_else(crossed[-1], numbers[-1], -1), levels[-1]
    for j, one, here in reversed(list(zip(numbers[:-1], levels, crossed, strict=False))):
        number, level = ca.if_else(here, j, number), ca.if_else(here, one, level)  # of stops at one place the first
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
) -> tuple[Expression, Expression, Expression]:  # fmt: skip
    """Y moved along its rate onto the stop itself, off which it is by round-off, by how much in t, and all stops."""
    state, known = ca.SX.sym("Y", there.numel()), ca.SX.sym("c", constants.numel())
    rate, level = system(0, state, known), stops(0, state, known)
    results = [rate, level, ca.jtimes(level, state, rate)]
    rate, level, slope = ca.Function("there", [state, known], [ca.densify(r) for r in results])(there, constants)
    shift = ca.SX(0)
    for j in range(level.numel()):
        shift = ca.if_else(ca.logic_and(number == j, slope[j] != 0), -level[j] / slope[j], shift)
    shift = ca.if_else(ca.fabs(shift) <= most, shift, 0)  # farther it lies only where the stop is touched
    return there + shift * rate, shift, level
