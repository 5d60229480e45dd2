"""Branches that meet: what ``if_else``, comparisons and signs make where both sides agree in value is written by fmax.

``if_else(v > 0, a v, -b v)`` has a kink and no jump, but an instruction that jumps does not tell so, nor which way the
kink points. Every operation is carried out on what it is on either side of each jump. Where the two sides A (above) and
B (below) of u = 0 differ by a multiple of u, A - B = q u, they are B + q fmax(u, 0); where A - B rises or falls
throughout with some entry with which u does as well, they are the greater or the lesser of A and B. What does neither
is left as it was written.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import casadi as ca
import numpy as np

from varcalc.symbolic import intervals
from varcalc.symbolic.instructions import BINARY, UNARY, Call, in_numbers, interpret, operate
from varcalc.symbolic.switches import CONDITIONS, CONTINUOUS, SWITCHING, alike, arguments
from varcalc.symbolic.tracing import Expression

TWO_SIDED = {ca.OP_LT, ca.OP_LE, ca.OP_SIGN}
"""Operations that jump from one number to another where their argument changes its sign."""
JUMPING = SWITCHING - CONTINUOUS
TRIED = np.modf(np.outer(np.sqrt(np.arange(2.0, 34.0)), np.sqrt(np.arange(3.0, 43.0))))[0] * 2 - 1
"""Points at which two expressions are held against each other, a row each, between -1 and 1."""
SIZES = np.array([1.0, 30.0])
"""Multiples of them that are tried."""
IDENTICAL = 1e-11
"""Difference, relative to what it is made of, of two expressions that are one."""
EQUAL_TO = 8
"""Operations deep to which two expressions are compared as they are written."""
MOST_OPEN = 6
"""Jumps that an operation may stand on; beyond them nothing is joined."""
ZERO_OVER_RANGES = SWITCHING | {ca.OP_EXP, ca.OP_TANH, ca.OP_ERF, ca.OP_COSH, ca.OP_SINH}
"""Operations whose results, or what is made of them, may be 0 over wide ranges of what they are done to."""
MIXING, SPREADING, EITHER = (12.9898, 78.233, 37.719), 43758.5453, 0.5
"""Of numbers that seem drawn at random: factors of arguments, and of a sine, whose last digits they are."""
DOMAINS: dict[int, tuple[int, float]] = {
    ca.OP_SQRT: (0, 0.0), ca.OP_LOG: (0, math.ulp(0.0)), ca.OP_INV: (0, math.ulp(0.0)), ca.OP_DIV: (1, math.ulp(0.0)),
}  # fmt: skip
"""Operations that are numbers where one of their operands is at least so much: its place, and the least."""
NOT_EVERYWHERE = {
    ca.OP_POW, ca.OP_CONSTPOW, ca.OP_TAN, ca.OP_ASIN, ca.OP_ACOS, ca.OP_ACOSH, ca.OP_ATANH, ca.OP_LOG1P, ca.OP_ATAN2,
}  # fmt: skip
"""Operations that are no numbers somewhere."""


def continued(expression: Expression, symbols: Sequence[Expression], watched: Expression) -> Expression:
    """An ``expression`` of ``symbols``, its jumps written by fmax and fmin where its branches agree.

    Those that do not depend on what is ``watched`` stay as they are, and so does an expression of another kind than SX.
    """
    if not isinstance(expression, ca.SX):
        return expression
    function = ca.Function("read", list(symbols), [ca.densify(expression)])
    if JUMPING.isdisjoint(map(function.instruction_id, range(function.n_instructions()))):
        return expression
    reader = _Reader(ca.vertcat(*(ca.vec(s) for s in symbols)), watched)
    given = [[_Branched(e) for e in s.nonzeros()] if s.numel() else [] for s in symbols]
    ((result,),) = interpret(function, given, lambda c: _Branched(ca.SX(c)), reader.applied)
    written = reader.closed(result.written, result.sides).written
    return written if reader.joined else expression


Sides: TypeAlias = dict[int, tuple[Expression, Expression, Expression]]
"""What an expression is above, below and on each jump that is open in it, by the number of the jump."""


@dataclass(frozen=True)
class _Branched:
    """An expression, and its sides. ``half`` is what is 0 where a condition does not hold."""

    written: Expression
    sides: Sides = field(default_factory=Sides)
    half: bool = False

    def on(self, jump: int, side: int) -> Expression:
        """The expression on a side of a jump: 0 above it, 1 below, 2 where its argument is zero."""
        return self.sides[jump][side] if jump in self.sides else self.written


class _Reader:
    """Carries operations out on what they are on either side of each jump; ``joined`` tells whether any was closed."""

    def __init__(self, variables: Expression, watched: Expression) -> None:
        self.variables, self.watched = variables, watched
        self.jumps: list[Expression] = []
        self.joined = False

    def applied(self, operation: int, operands: Sequence[_Branched]) -> _Branched:
        """The operation, with the jumps that it leaves open."""
        if operation != ca.OP_ADD:  # two halves of if_else are added, and make one kink together
            operands = [self.closed(o.written, o.sides) if o.half else o for o in operands]
        written = operate(operation, [o.written for o in operands])
        if operation in TWO_SIDED and not any(o.sides for o in operands):
            return self._opened(operation, written, *arguments(operation, [o.written for o in operands]))
        sides: Sides = {}
        for jump in sorted({jump for o in operands for jump in o.sides}):
            above, below, itself = (operate(operation, [o.on(jump, side) for o in operands]) for side in (0, 1, 2))
            sides[jump] = above, below, itself
        half = operation == ca.OP_IF_ELSE_ZERO
        return _Branched(written, sides, half) if half else self.closed(written, sides)

    def closed(self, written: Expression, sides: Sides) -> _Branched:
        """What is ``written``, with the jumps at which its ``sides`` meet written as kinks."""
        left: Sides = {}
        for jump, (above, below, itself) in sides.items():
            u, few = self.jumps[jump], len(sides) <= MOST_OPEN
            joined = _joined(above, below, u, self.variables, self.watched) if few else None
            if joined is None or not _among(itself, above, below, u, self.variables, self.watched):
                left[jump] = above, below, itself
            else:
                written, self.joined = joined, True
        return _Branched(written, left)

    def _opened(self, operation: int, written: Expression, u: Expression) -> _Branched:
        """A comparison or a sign, which jumps where u = 0."""
        if u.is_constant() or not ca.depends_on(u, self.watched):
            return _Branched(written)
        above, below = (ca.SX(1), ca.SX(-1)) if operation == ca.OP_SIGN else (ca.SX(0), ca.SX(1))
        itself = ca.SX(1) if operation == ca.OP_LE else ca.SX(0)
        for number, known in enumerate(self.jumps):
            if turned := alike(known, u):
                return _Branched(written, {number: (above, below, itself) if turned > 0 else (below, above, itself)})
        self.jumps.append(u)
        return _Branched(written, {len(self.jumps) - 1: (above, below, itself)})


def _joined(
    above: Expression, below: Expression, u: Expression, variables: Expression, watched: Expression
) -> Expression | None:
    """What is ``above`` where u > 0 and ``below`` where u < 0, by fmax or fmin; None where that is not found."""
    difference = above - below
    if difference.is_constant():
        return above if float(difference) == 0.0 else None
    if variables.numel() > TRIED.shape[1]:
        return None
    for variable in watched.nonzeros():
        rate = ca.gradient(u, variable)
        if not (rate.is_constant() and float(rate)):
            continue
        on_surface = ca.substitute(difference, variable, variable - u / rate)
        if not _vanishes(on_surface, difference, variables):
            return None
        change = ca.gradient(difference, variable)
        quotient = ca.substitute(change, variable, 0.0) / rate
        if _vanishes(difference - quotient * u, difference, variables):
            return below + quotient * ca.fmax(u, 0)
        kinked = not _vanishes(ca.substitute(change, variable, variable - u / rate), change, variables)
        if trend := kinked and _trend(difference, variable, variables) * float(rate):
            return ca.fmax(above, below) if trend > 0 else ca.fmin(above, below)
    share = multiple(difference, u)
    return None if not share else ca.fmax(above, below) if share > 0 else ca.fmin(above, below)


def _among(
    itself: Expression, above: Expression, below: Expression, u: Expression, variables: Expression, watched: Expression
) -> bool:
    """Whether what stands where u = 0 is what its sides come to there, and no third value, as of |sign(u)|."""
    difference = itself - above
    if difference.is_constant():
        return float(difference) == 0.0
    if ca.is_equal(itself, above, EQUAL_TO) or ca.is_equal(itself, below, EQUAL_TO):
        return True
    for variable in watched.nonzeros() if variables.numel() <= TRIED.shape[1] else ():
        rate = ca.gradient(u, variable)
        if rate.is_constant() and float(rate):
            return _vanishes(ca.substitute(difference, variable, variable - u / rate), difference, variables)
    return multiple(difference, u) != 0.0


def _vanishes(expression: Expression, terms: Expression, variables: Expression) -> bool:
    """Whether an expression is zero wherever it was tried, in units of its ``terms``."""
    values, sizes = _tried([expression, terms], variables)
    largest = np.abs(sizes).max(-1, where=np.isfinite(sizes), initial=0.0, keepdims=True)
    return bool(np.isfinite(values).all() and (np.abs(values) <= IDENTICAL * largest).all())


def multiple(expression: Expression, other: Expression) -> float:
    """The number of which times the ``other`` is an expression, wherever it was tried; 0 where there is none."""
    variables = ca.vertcat(*ca.symvar(ca.vertcat(expression, other)))
    if not 0 < variables.numel() <= TRIED.shape[1]:
        return 0.0
    p, q = _tried([expression, other], variables)
    with np.errstate(all="ignore"):
        quotients = p / q
    steady = np.isfinite(quotients).all() and np.ptp(quotients) <= IDENTICAL * np.abs(quotients).max()
    return float(np.median(quotients)) if steady else 0.0


def _tried(expressions: Sequence[Expression], variables: Expression) -> np.ndarray:
    """Expressions at the points tried, with every function, and with any for those that vanish; (expressions, ., .).

    What is narrow, as a condition on x is, and a Gaussian, is nothing at all points that are tried. What agrees
    whatever number such a function has, the same for the same argument, agrees everywhere.
    """
    points = (SIZES[:, None, None] * TRIED[:, : variables.numel()]).reshape(-1, variables.numel()).T
    function = ca.Function("tried", [variables], [ca.densify(ca.vertcat(*expressions))])
    known = np.asarray(function(points)).reshape(len(expressions), len(SIZES), -1)
    with np.errstate(all="ignore"):
        (anyhow,) = interpret(function, [list(points)], np.array, _any_number)
    rows = [np.broadcast_to(row, points.shape[1:]).reshape(len(SIZES), -1) for row in anyhow]
    return np.concatenate([known, np.array(rows, dtype=float)], axis=1)


def _any_number(operation: int, operands: Sequence[np.ndarray]) -> np.ndarray:
    """The operation; where it may vanish over wide ranges some number for each of its arguments, or some condition."""
    known = isinstance(operation, Call) or operation in UNARY or operation in BINARY
    if known and (operation not in ZERO_OVER_RANGES or all(np.ptp(o) == 0 for o in operands)):
        return np.asarray(in_numbers(operation)(*operands))
    mixed = sum(factor * np.asarray(o) for factor, o in zip(MIXING, operands, strict=False))
    number = np.modf(np.abs(np.sin(mixed)) * SPREADING)[0]
    return np.where(number < EITHER, 0.0, 1.0) if operation in CONDITIONS else number


def _trend(difference: Expression, variable: Expression, variables: Expression) -> float:
    """1 where a difference is shown to rise throughout with a variable, -1 to fall, 0 for neither.

    It is a number everywhere then, and does not jump. On either side of a kink it has the rate of a branch: a share, 0
    or 1, tells of which.
    """
    function = ca.Function("difference", [variables], [difference])
    if not _steady(function):
        return 0.0
    shares: list[Expression] = []

    def applied(operation: int, operands: Sequence[Expression]) -> Expression:
        """The operation, or any share of the way between both branches of one that is continuous."""
        if operation not in CONTINUOUS:
            return operate(operation, operands)
        shares.append(ca.SX.sym("share"))
        first, last = operands[0], operands[-1] if len(operands) > 1 else -operands[0]
        return first + shares[-1] * (last - first)

    ((branch,),) = interpret(function, [variables.nonzeros()], ca.SX, applied)
    rate = ca.densify(ca.gradient(branch, variable))
    function = ca.Function("rate", [variables, ca.vertcat(ca.SX(0, 1), *shares)], [rate])
    boxes = [[intervals.EVERYTHING] * variables.numel(), [(np.array(0.0), np.array(1.0))] * len(shares)]
    (((low, high),),) = intervals.enclosures(function, boxes)
    return 1.0 if low >= 0.0 else -1.0 if high <= 0.0 else 0.0


def _steady(function: ca.Function) -> bool:
    """Whether a function is shown to be a number, and not to jump, whatever its arguments."""
    sound = True

    def applied(operation: int, operands: Sequence[intervals.Interval]) -> intervals.Interval:
        """The range of the operation; it is noted where that may be no number, or jump."""
        nonlocal sound
        place, least = DOMAINS.get(operation, (0, -math.inf))
        inside = operands[place][0] >= least or (operation in {ca.OP_INV, ca.OP_DIV} and operands[place][1] <= -least)
        known = operation not in NOT_EVERYWHERE | JUMPING and not isinstance(operation, Call)
        sound = sound and known and bool(inside)
        return intervals.applied(operation, operands)

    with np.errstate(all="ignore"):
        interpret(function, [[intervals.EVERYTHING] * function.nnz_in(0)], intervals.constant, applied)
    return sound
