"""Whether an expression may do something between two samples that neither of them shows: read from its operations.

Sums and products of what varies gently vary gently. What is narrower than the box it lies in comes of an operation
whose argument goes, inside the box, further than it is at the two samples, by more than the scale on which the
operation itself varies: exp(u) where u comes to be larger by more than a few, 1/u where u comes nearer to zero by a
factor; or through more than a wave of what oscillates. The arguments are enclosed, so nothing lies between.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from typing import Any

import casadi as ca
import numpy as np

from varcalc.symbolic.instructions import BINARY, KEPT_FUNCTIONS, UNARY, Call, Instruction, instructions, program
from varcalc.symbolic.intervals import Interval, applied, constant
from varcalc.symbolic.look_up import cells, knots
from varcalc.symbolic.switches import ONE_SIDED, PAIRED, STEPPED

CHANGE = 1.5
"""By how much the argument of a function of scale 1 (exp, sin, tanh) may change."""
SATURATED, STEP = 6.0, 4.0
"""Arguments beyond which a step (tanh, a logistic function) has been made but for little, and how much of the way
from one to the other may lie between two samples. Both may show that there is a step: neither shows its form."""
FACTOR = 4.0
"""By what factor the argument of a root, a logarithm or a reciprocal may change."""
VANISHED, OVERFLOW = -50.0, 710.0
"""Exponents below which what is left of an exponential is nothing, whatever it is multiplied by, and above which it is
no number."""
FLAT_BEYOND = 20.0
"""Size of an argument beyond which tanh and erf are 1 to round-off."""
NARROWEST = 1e-12
"""Width of a box, relative to where it lies, that is not looked into."""
LEAST_POWER = 12
"""Whole power from which on it matters by what factor its base changes."""
UNSEEN_CELLS = 0.6
"""Cells of a table that may lie between two samples; three times as many at the middle of a box show it nothing."""
NUMBERS: dict[int, Any] = {**UNARY, **BINARY}
UNUSED = -1
"""The target of an instruction of whose result nothing is made."""
Rules = Mapping[int, Callable[..., np.ndarray]]
"""By what factor operations, by CasADi's codes, may go too far between samples of their operands."""


@dataclass(frozen=True)
class Between:
    """What lies between two samples: the values ``first`` and ``last`` there, and the ``range`` of all between."""

    range: Interval
    first: np.ndarray
    last: np.ndarray

    @cached_property
    def factor(self) -> np.ndarray:
        """By what factor the size goes beyond that of both samples; infinite where it comes to be zero between them."""
        low, high = self.range
        first, last = np.abs(self.first), np.abs(self.last)
        size, least = np.maximum(np.abs(low), np.abs(high)), _least_size(self.range)
        far = np.fmax(size / np.maximum(first, last), np.minimum(first, last) / least) / FACTOR
        return np.where(low == high, 0.0, far)

    @cached_property
    def inverse(self) -> Interval:
        """All that one divided by it can be: many quotients have one denominator."""
        return applied(ca.OP_INV, [self.range])


def gentle(function: ca.Function, rules: Rules) -> bool:
    """Whether no operation of an SX function has one of the ``rules``: nothing narrow can come of any."""
    fixed: dict[int, bool] = {}
    for i in instructions(function):
        fixed[i.target] = i.operation == ca.OP_CONST
        varied = i.sources[-1:] if i.operation == ca.OP_DIV else i.sources
        if i.operation in rules and not all(fixed.get(s, False) for s in varied):
            return False
    return True


def gentle_across(function: ca.Function, argument: int) -> bool:
    """Whether nothing narrow can come of any operation where one ``argument`` of an SX function alone changes.

    Powers of what is of first degree in it are infinite or no numbers on one line, and narrow nowhere else; what varies
    as narrowly everywhere is seen wherever one looks.
    """
    fixed, first_degree, power, other = range(4)
    kinds: dict[int, int] = {}
    for i in instructions(function):
        of = [kinds[s] for s in i.sources] if i.operation not in (ca.OP_CONST, ca.OP_INPUT) else []
        if i.operation == ca.OP_INPUT:
            kinds[i.target] = first_degree if i.sources[0] == argument else fixed
        elif max(of, default=fixed) == fixed:
            kinds[i.target] = fixed
        elif i.operation in FIRST_DEGREE and max(of) == first_degree:
            kinds[i.target] = first_degree
        elif i.operation in MULTIPLES and sorted(of)[:-1] in ([], [fixed]):
            kinds[i.target] = max(of)
        elif i.operation in MAKING_POWERS and max(of) <= power and (of[1:] in ([], [fixed]) or _divides(i, of)):
            kinds[i.target] = power
        elif i.operation in SWITCHED or (i.operation in NARROWING and (i.operation != ca.OP_DIV or of[1] != fixed)):
            return False
        else:
            kinds[i.target] = other
    return True


def _divides(instruction: Instruction, kinds: Sequence[int]) -> bool:
    """Whether it divides what does not change."""
    return instruction.operation == ca.OP_DIV and kinds[0] == 0


def excess(
    function: ca.Function, boxes: Sequence[Sequence[Between] | Mapping[int, Between]], shape: tuple[int, ...],
    rules: Rules,
) -> np.ndarray:  # fmt: skip
    """By what factor the worst operation of an SX function may go too far between samples; at most 1 where none does.

    ``boxes`` hold the nonzeros of each argument, or those it is ``varied_by``, arrays that broadcast to ``shape``.
    Operations without one of the ``rules`` count as gentle.
    """
    worst, work = np.zeros(shape), dict[int, Between]()
    with np.errstate(all="ignore"):
        for i in _leading_to(function, frozenset(rules)):
            if i.operation == ca.OP_CONST:
                work[i.target] = _constant(i.constant)
            elif i.operation == ca.OP_INPUT:
                work[i.target] = boxes[i.sources[0]][i.sources[1]]
            else:
                operands = [work[s] for s in i.sources]
                if isinstance(i.operation, Call) and i.operation in rules:
                    np.fmax(worst, _cells(i.operation, operands), out=worst)
                elif i.operation in rules:
                    np.fmax(worst, rules[i.operation](*operands), out=worst)
                if i.target != UNUSED:
                    work[i.target] = _carried_out(i.operation, operands)
    return worst


@lru_cache(maxsize=KEPT_FUNCTIONS)
def _leading_to(function: ca.Function, operations: frozenset[int]) -> tuple[Instruction, ...]:
    """The instructions of an SX function up to operands of the ``operations``; what nothing more comes of is UNUSED."""
    used, kept = set[int](), list[Instruction]()
    for i in reversed(program(function).steps):
        if i.target in used or i.operation in operations:
            kept.append(i if i.target in used else i._replace(target=UNUSED))
            used.discard(i.target)
            if i.operation != ca.OP_INPUT:
                used.update(i.sources)
    return tuple(reversed(kept))


def varied_by(function: ca.Function, rules: Rules, argument: int) -> list[int]:
    """The nonzeros of one ``argument`` of an SX function that its operations with one of the ``rules`` depend on."""
    leading = _leading_to(function, frozenset(rules))
    return sorted({i.sources[1] for i in leading if i.operation == ca.OP_INPUT and i.sources[0] == argument})


def _carried_out(operation: int, operands: Sequence[Between]) -> Between:
    of = operation.at if isinstance(operation, Call) and _is_table(operation) else NUMBERS.get(operation, _unknown)
    first = of(*(o.first for o in operands))
    same = all(o.first is o.last for o in operands)
    last = first if same else of(*(o.last for o in operands))
    ranges = [o.range for o in operands]
    if operation == ca.OP_DIV:
        operation, ranges = ca.OP_MUL, [ranges[0], operands[1].inverse]
    return Between(applied(operation, ranges), first, last)


def gentle_boxes(function: ca.Function, edges: np.ndarray, most: int) -> np.ndarray:
    """Edges (k,), from ascending ``edges`` (m,) on, between which an SX function of one variable varies gently.

    Boxes are halved until nothing may hide in one, or round-off ends it; and no more of them than ``most``, those
    next to the middle of the edges first.
    """
    if gentle(function, VARYING):
        return edges[[0, -1]]
    found, low, high = [edges], edges[:-1], edges[1:]
    here = edges[len(edges) // 2]
    while len(low) > 0 and sum(map(len, found)) < most:
        over = excess(function, [[Between((low, high), low, high)]], low.shape, VARYING)
        middle = (low + high) / 2
        wide = (middle > low) & (middle < high) & (high - low > NARROWEST * np.maximum(np.abs(low), np.abs(high)))
        varies = np.flatnonzero((over > 1.0) & wide)
        nearest = varies[np.argsort(np.abs(middle[varies] - here))[:most]]
        found.append(middle[nearest])
        low, high = np.append(low[nearest], middle[nearest]), np.append(middle[nearest], high[nearest])
    return np.unique(np.concatenate(found))


def _unknown(*operands: np.ndarray) -> np.ndarray:
    """What a function that is no formula makes of its operands: no number that is known here."""
    return np.full(np.broadcast_shapes(*(np.shape(o) for o in operands)), np.nan)


def _is_table(operation: Call) -> bool:
    """Whether a call looks up one number in a table: then what it can be between samples is known."""
    return operation.function.n_in() == 1 and len(knots(operation.function)) == 1


def _cells(operation: Call, operands: Sequence[Between]) -> np.ndarray:
    """By how many times more cells of a table than may lie unseen there are between samples; 0 of what is no table."""
    edges = knots(operation.function)
    counts = [cells(operation.function, k, *o.range) for k, o in zip(range(len(edges)), operands, strict=False)]
    return np.asarray(sum(counts, np.zeros(())) / UNSEEN_CELLS)


def _constant(value: float) -> Between:
    range_ = constant(value)
    return Between(range_, range_[0], range_[0])


def _beyond(a: Between) -> np.ndarray:
    """How far the range goes beyond the two samples, on a scale of 1."""
    low, high = a.range
    return np.fmax(high - np.maximum(a.first, a.last), np.minimum(a.first, a.last) - low) / CHANGE


def _through(a: Interval) -> np.ndarray:
    """How much of a step lies in a range, on a scale of 1."""
    low, high = (np.clip(v, -SATURATED, SATURATED) for v in a)
    return (high - low) / STEP


def _within(a: Between, least: float, greatest: float) -> Between:
    """The same of an argument beyond whose ``least`` and ``greatest`` values nothing changes."""
    low, high, first, last = (np.clip(v, least, greatest) for v in (*a.range, a.first, a.last))
    return Between((low, high), first, last)


def _exponent(a: Between) -> np.ndarray:
    return np.fmax(_beyond(_within(a, VANISHED, OVERFLOW)), _through(a.range))


def _step(a: Between) -> np.ndarray:
    return np.fmax(_beyond(_within(a, -FLAT_BEYOND, FLAT_BEYOND)), _through(a.range))


def _phase(a: Between) -> np.ndarray:
    return (a.range[1] - a.range[0]) / CHANGE


def _on_own_scale(a: Between) -> np.ndarray:
    """The same as :func:`_beyond` where a function varies on the scale of max(1, abs(u))."""
    return _beyond(a) / np.maximum(1.0, _least_size(a.range))


def _slow_step(a: Between) -> np.ndarray:
    return np.fmax(_on_own_scale(a), _through(a.range))


def _least_size(a: Interval) -> np.ndarray:
    return np.where((a[0] <= 0) & (a[1] >= 0), 0.0, np.minimum(np.abs(a[0]), np.abs(a[1])))


def _factor(a: Between) -> np.ndarray:
    return a.factor


def _from(edge: float) -> Callable[[Between], np.ndarray]:
    """The factor by which the distance from an ``edge`` of the domain goes beyond that at the samples."""
    return lambda a: Between((a.range[0] - edge, a.range[1] - edge), a.first - edge, a.last - edge).factor


def _from_one(a: Between) -> np.ndarray:
    return np.fmax(_from(1.0)(a), _from(-1.0)(a))


def _power(a: Between, b: Between) -> np.ndarray:
    """Of a whole power nothing narrow comes unless it is high, of another where the base goes by a factor."""
    exponent, fixed = b.range[0], b.range[0] == b.range[1]
    whole = fixed & (exponent == np.round(exponent)) & (exponent >= 0)
    size = np.maximum(np.abs(a.range[0]), np.abs(a.range[1]))
    high = exponent * np.log(size / np.maximum(np.abs(a.first), np.abs(a.last))) / CHANGE
    whole_power = np.where((exponent < LEAST_POWER) | (a.range[0] == a.range[1]), 0.0, high)
    return np.where(whole, whole_power, np.where(fixed, a.factor, np.fmax(a.factor, _beyond(b))))


def _divided(_: Between, b: Between) -> np.ndarray:
    return b.factor


def _length(a: Between, b: Between) -> np.ndarray:
    """The factor of the distance from the origin."""
    range_ = applied(ca.OP_HYPOT, [a.range, b.range])
    return Between(range_, np.hypot(a.first, b.first), np.hypot(a.last, b.last)).factor


def _switches(a: Between, b: Between | None = None) -> np.ndarray:
    """More than 1 where zero lies between what is compared: a pair of switches hides anything between them."""
    low, high = a.range
    if b is not None:
        low, high = low - b.range[1], high - b.range[0]
    return np.where((low <= 0) & (high >= 0) & (low < high), 2.0, 0.0)


def _steps(a: Between, b: Between | None = None, beyond: float = 0.0) -> np.ndarray:
    """The same where so far ``beyond`` a whole multiple of the second operand, or of 1, lies in the first's range."""
    size = 1.0 if b is None else np.maximum(np.abs(b.range[0]), np.abs(b.range[1]))
    low, high = (v / size + beyond for v in a.range)
    return np.where(np.floor(low) != np.floor(high), 2.0, 0.0)


FIRST_DEGREE = {ca.OP_ADD, ca.OP_SUB, ca.OP_NEG, ca.OP_TWICE}
"""Operations that keep what is of first degree so."""
MULTIPLES = {ca.OP_MUL, ca.OP_NEG, ca.OP_TWICE}
"""Operations that keep anything what it is but for a factor, where one operand alone changes."""
MAKING_POWERS = {ca.OP_SQ, ca.OP_SQRT, ca.OP_INV, ca.OP_DIV, ca.OP_POW, ca.OP_CONSTPOW}
"""Operations that make powers of their first operand, and of their second one where they divide by it."""


LOCAL: Rules = {
    ca.OP_EXP: _exponent, ca.OP_EXPM1: _exponent, ca.OP_SINH: _beyond, ca.OP_COSH: _beyond, ca.OP_SIN: _phase,
    ca.OP_COS: _phase, ca.OP_TAN: _phase, ca.OP_TANH: _step, ca.OP_ERF: _step, ca.OP_ATAN: _slow_step,
    ca.OP_ASINH: _on_own_scale, ca.OP_CALL: lambda *_: np.zeros(()),
}  # fmt: skip
"""By what factor an operation that varies on a scale of its own may go too far between samples, by CasADi's codes."""
VARYING: Rules = {
    **LOCAL, ca.OP_SQRT: _factor, ca.OP_LOG: _factor, ca.OP_INV: _factor, ca.OP_DIV: _divided,
    ca.OP_LOG1P: _from(-1.0), ca.OP_ACOSH: _from(1.0), ca.OP_ASIN: _from_one, ca.OP_ACOS: _from_one,
    ca.OP_ATANH: _from_one, ca.OP_POW: _power, ca.OP_CONSTPOW: _power, ca.OP_HYPOT: _length, ca.OP_ATAN2: _length,
}  # fmt: skip
"""The same with the operations that vary by the factor by which their operand changes."""
SWITCHED: Rules = {
    **dict.fromkeys(ONE_SIDED | PAIRED, _switches), **dict.fromkeys(STEPPED, _steps),
    ca.OP_REMAINDER: partial(_steps, beyond=0.5),  # from the nearest multiple: it jumps half way between two
    ca.OP_COPYSIGN: lambda a, b: np.fmax(_switches(a), _switches(b)),
}  # fmt: skip
"""More than 1 where an operation is not smooth between samples."""
SEEN_FROM_AFAR = {ca.OP_SIN, ca.OP_COS, ca.OP_TAN}
"""Operations that are nowhere nothing: a series tells of them wherever it is begun."""
NARROWING = frozenset(VARYING) - SEEN_FROM_AFAR - {ca.OP_CALL}
"""Operations of which something narrow may come at one place."""
