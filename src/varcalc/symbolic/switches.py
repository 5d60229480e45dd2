"""Where an expression stops being smooth, read from its instructions.

A kink or a jump that is read is never missed, however narrow: |u| has its kink where u = 0, a comparison of a and b
its jump where a - b = 0, floor(u) one at each whole number u.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from varcalc.symbolic.instructions import NAMES, SUMS, Call, in_numbers, interpret, operate
from varcalc.symbolic.look_up import knots, straight
from varcalc.symbolic.tracing import Expression

ONE_SIDED = {ca.OP_FABS, ca.OP_SIGN}
PAIRED = {ca.OP_FMIN, ca.OP_FMAX, ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE}
STEPPED = {ca.OP_FLOOR, ca.OP_CEIL, ca.OP_FMOD, ca.OP_REMAINDER}
SWITCHING = ONE_SIDED | PAIRED | STEPPED | {ca.OP_COPYSIGN}
"""Operations that are not smooth in what they are done to."""
CONTINUOUS = {ca.OP_FABS, ca.OP_FMIN, ca.OP_FMAX}
"""Those whose result does not jump."""
CONDITIONS = {ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_NOT, ca.OP_AND, ca.OP_OR}
"""Those whose result is a condition."""
SWITCH_ROUND_OFF = 1e-12
"""Relative difference that is round-off."""
WORDS = {"lt": "<", "le": "<=", "eq": "==", "ne": "!="}


@dataclass(frozen=True)
class Switch:
    """A place where an expression is not smooth: where ``argument`` is one of the ``levels``.

    Those are zero, any whole number of what is ``stepped``, or the knots of a table. ``word`` is what was written there
    (``fabs``, ``fmax``, ``<``), ``jumps`` whether the operation itself jumps, ``smooth`` whether what is made of it has
    no kink there.
    """

    argument: Expression
    word: str
    jumps: bool
    stepped: bool = False
    smooth: bool = False
    levels: tuple[float, ...] = (0.0,)

    def met(self, least: np.ndarray, greatest: np.ndarray) -> np.ndarray:
        """How many of the levels lie between values of the argument, the ends among them; floats."""
        if self.stepped:
            return np.floor(greatest) - np.ceil(least) + 1
        first, last = np.searchsorted(self.levels, least, "left"), np.searchsorted(self.levels, greatest, "right")
        return np.where(least <= greatest, last - first, 0.0)

    def within(self, least: float, greatest: float) -> np.ndarray:
        """The levels between two values, the ends among them."""
        if self.stepped:
            return np.arange(np.ceil(least), np.floor(greatest) + 1)
        levels = np.array(self.levels)
        return levels[(levels >= least) & (levels <= greatest)]

    def depends_on(self, symbols: Expression) -> bool:
        """Whether the place moves with any of the ``symbols``."""
        return bool(ca.depends_on(self.argument, symbols))


def switches(expressions: Sequence[Expression], symbols: Sequence[Expression]) -> tuple[Switch, ...]:
    """The switches of SX ``expressions`` in ``symbols``, each once, in the order in which they are carried out.

    Expressions of another kind than SX have none that could be read.
    """
    if not all(isinstance(e, ca.SX) for e in expressions):
        return ()
    read = [(operation, argument) for operation, argument in switching(expressions, symbols)
            if not argument.is_constant()]  # fmt: skip
    every = [argument for _, argument in read]
    same = likeness(every, every, ca.vertcat(*(ca.vec(s) for s in symbols)))
    stepped = np.array([operation in STEPPED for operation, _ in read], dtype=bool)
    same[stepped[:, None] != stepped] = 0
    found: dict[int, Switch] = {}
    for number, (operation, argument) in enumerate(read):
        name = NAMES[operation]
        switch = Switch(argument, WORDS.get(name, name), operation not in CONTINUOUS, bool(stepped[number]))
        known = next((k for k in found if same[k, number]), number)
        if known not in found or (switch.jumps and not found[known].jumps):
            found[known] = switch
    return tuple(found.values())


def switching(expressions: Sequence[Expression], symbols: Sequence[Expression]) -> list[tuple[int, Expression]]:
    """The operations of SX ``expressions`` that switch, as they are carried out, each with what it switches by."""
    function = ca.Function("read", list(symbols), list(expressions))
    found: list[tuple[int, Expression]] = []

    def applied(operation: int, operands: Sequence[Expression]) -> Expression:
        found.extend((operation, argument) for argument in arguments(operation, operands))
        return operate(operation, operands)

    interpret(function, [s.nonzeros() if s.numel() else [] for s in symbols], ca.SX, applied)
    return found


def tables(expression: Expression, symbols: Expression) -> tuple[Switch, ...]:
    """The tables in an SX ``expression`` of a column of ``symbols``: less smooth where an argument is at a knot."""
    function = ca.Function("read", [symbols], [expression])
    if ca.OP_CALL not in map(function.instruction_id, range(function.n_instructions())):
        return ()
    found: list[Switch] = []

    def applied(operation: int, operands: Sequence[Expression]) -> Expression:
        """The operation; the tables that it looks up are noted."""
        if isinstance(operation, Call):
            for argument, edges in zip(operands, knots(operation.function)):  # noqa: B905  what is no table has none
                levels = tuple(edges.tolist())
                if not any(levels == known.levels and ca.is_equal(argument, known.argument, 8) for known in found):
                    smooth = len(edges) == 2 or not straight(operation.function)
                    found.append(Switch(argument, "interpolant", jumps=False, smooth=smooth, levels=levels))
        return operate(operation, operands)

    interpret(function, [symbols.elements()], ca.SX, applied)
    return tuple(found)


def arguments(operation: int, operands: Sequence[Expression]) -> tuple[Expression, ...]:
    """What is zero, or a whole number for what is STEPPED, where an operation switches: mostly one, nothing or two."""
    a, b = operands[0], operands[-1]
    if operation == ca.OP_COPYSIGN:
        return a, b
    if operation in PAIRED:
        return (a - b,)
    if operation == ca.OP_FMOD:
        return (a / b,)
    if operation == ca.OP_REMAINDER:  # from the nearest multiple: it jumps half way between two
        return (a / b + 0.5,)
    return (a,) if operation in SWITCHING else ()


def alike(a: Expression, b: Expression) -> int:
    """1 where two arguments are the same at every point tried, -1 where one is minus the other, 0 where neither."""
    return int(likeness([a], [b], ca.vertcat(*ca.symvar(ca.vertcat(a, b))))[0, 0])


def likeness(some: Sequence[Expression], others: Sequence[Expression], symbols: Expression) -> np.ndarray:
    """What :func:`alike` says of each of ``some`` and each of ``others``, arguments of a column of ``symbols``.

    Every argument is evaluated once: there are as many as a table has knots.
    """
    if not (some and others):
        return np.zeros((len(some), len(others)), dtype=int)
    points = np.modf(np.outer(np.sqrt([2.0, 3.0, 5.0]), 1.0 + np.arange(symbols.numel())))[0]
    function = ca.Function("arguments", [symbols], [ca.densify(ca.vertcat(*some, *others))])
    values = np.column_stack([np.asarray(function(point)).ravel() for point in points])
    a, b = values[: len(some), None], values[None, len(some) :]
    with np.errstate(all="ignore"):
        room = SWITCH_ROUND_OFF * (np.abs(a) + np.abs(b))
        same, opposite = (np.all(np.abs(a - sign * b) <= room, axis=-1) for sign in (1, -1))
    for i, k in zip(*np.nonzero(np.any(np.isnan(a) & np.isnan(b), axis=-1)), strict=True):  # numbers do not tell
        same[i, k] = ca.is_equal(some[i], others[k], 8)
    return np.where(same, 1, np.where(opposite, -1, 0))


def held(
    expressions: Sequence[Expression], symbols: Sequence[Expression], point: Sequence[np.ndarray],
    moving: Expression | None = None, loose: Sequence[Expression] = (),
) -> list[Expression]:  # fmt: skip
    """SX ``expressions`` of ``symbols`` with every switch left on the side on which it is at a ``point``.

    What is returned is smooth, and is what was given as far as the next switch. Where there are ``moving`` symbols,
    switches that others decide are left as they are, and so are those that have a ``loose`` argument.
    """
    function = ca.Function("held", list(symbols), [ca.densify(ca.vertcat(*expressions))])
    variables = ca.vertcat(*(ca.vec(s) for s in symbols))

    def applied(operation: int, operands: Sequence[_Held]) -> _Held:
        """The operation, or the side it is on at the point."""
        value = float(in_numbers(operation)(*(o.value for o in operands)))
        decisive = operands[:1] if operation == ca.OP_IF_ELSE_ZERO else operands
        kept = moving is not None and not any(ca.depends_on(o.written, moving) for o in decisive)
        left = any(o.left for o in decisive)
        if loose and (decided_by := arguments(operation, [o.written for o in operands])):
            left = left or bool(likeness(decided_by, loose, variables).any())
        written = None if kept or left else _side(operation, operands, value)
        if written is None:
            written = operate(operation, [o.written for o in operands])
        return _Held(written, value, left and operation in CONDITIONS)

    given = [
        [_Held(e, float(v)) for e, v in zip(s.nonzeros(), np.ravel(at), strict=True)] if s.numel() else []
        for s, at in zip(symbols, point, strict=True)
    ]
    with np.errstate(all="ignore"):
        (results,) = interpret(function, given, lambda c: _Held(ca.SX(c), c), applied)
    return [r.written for r in results]


@dataclass(frozen=True)
class _Held:
    """An expression, its value at the point, and whether it is a condition that is left to decide."""

    written: Expression
    value: float
    left: bool = False


def _side(operation: int, operands: Sequence[_Held], value: float) -> Expression | None:
    """What an operation that switches is on one side; None for one that does not."""
    a, b = operands[0], operands[-1]
    if operation == ca.OP_FABS:
        return a.written if a.value >= 0 else -a.written
    if operation in (ca.OP_FMIN, ca.OP_FMAX):
        return a.written if (a.value <= b.value) == (operation == ca.OP_FMIN) else b.written
    if operation == ca.OP_COPYSIGN:
        return a.written if (a.value >= 0) == (b.value >= 0) else -a.written
    if operation in (ca.OP_FMOD, ca.OP_REMAINDER):
        return a.written - b.written * round((a.value - value) / b.value)
    if operation == ca.OP_IF_ELSE_ZERO:
        return b.written if a.value else ca.SX(0)
    return ca.SX(value) if operation in SWITCHING else None


@dataclass(frozen=True)
class _Sized:
    """Values at points, and how large what they were summed from is there."""

    values: np.ndarray
    terms: np.ndarray

    def unit(self) -> float:
        """The largest of the values; of their terms where those are round-off of them, and 1 where all are zero."""
        largest, terms = (
            float(np.abs(v[np.isfinite(v)]).max(initial=0.0)) for v in map(np.atleast_1d, (self.values, self.terms))
        )
        return (largest if largest > SWITCH_ROUND_OFF * terms else terms) or 1.0


def _measured(operation: int, operands: Sequence[_Sized]) -> _Sized:
    """What an operation makes of values; only a sum may be far smaller than what it is made of."""
    a, b = operands[0], operands[-1]
    values = np.asarray(in_numbers(operation)(*(o.values for o in operands)))
    if operation in SUMS:
        return _Sized(values, a.terms + b.terms)
    if operation in (ca.OP_NEG, ca.OP_FABS):
        return _Sized(values, a.terms)
    return _Sized(values, np.abs(values))


def _switched_by(operation: int, operands: Sequence[_Sized]) -> _Sized:
    """What an operation that is smoothed switches by."""
    if operation in PAIRED:
        return _measured(ca.OP_SUB, operands)
    if operation in (ca.OP_FMOD, ca.OP_REMAINDER):
        return _measured(ca.OP_DIV, operands)
    return operands[-1]


def units(
    expressions: Sequence[Expression], symbols: Sequence[Expression], points: Sequence[Sequence[np.ndarray]]
) -> tuple[list[float], list[float]]:
    """How large SX ``expressions`` are at ``points``, and the argument of each of their operations that switches.

    The points are one array for each entry of a symbol. What is zero there but for round-off has the size of its
    terms, and what is zero has the size 1.
    """
    switching: list[float] = []

    def applied(operation: int, operands: Sequence[_Sized]) -> _Sized:
        """The size of the operation; that of its argument is noted where it switches."""
        if operation in SMOOTHED:
            switching.append(_switched_by(operation, operands).unit())
        return _measured(operation, operands)

    def sized(values: np.ndarray | float) -> _Sized:
        return _Sized(np.asarray(values), np.abs(values))

    function = ca.Function("units", list(symbols), [ca.densify(ca.vertcat(*expressions))])
    with np.errstate(all="ignore"):
        (results,) = interpret(function, [[sized(v) for v in entries] for entries in points], sized, applied)
    return [result.unit() for result in results], switching


def smoothed(
    expressions: Sequence[Expression], symbols: Sequence[Expression], widths: Sequence[float]
) -> list[Expression]:
    """SX ``expressions`` with each operation that switches, in their order, smooth over one of the ``widths``."""
    left = iter(widths)

    def applied(operation: int, operands: Sequence[Expression]) -> Expression:
        """The operation, smooth over the next width where it switches."""
        if operation in SMOOTHED:
            return SMOOTHED[operation](*operands, next(left))
        if operation in LOGICAL:
            return LOGICAL[operation](*operands)
        return operate(operation, operands)

    function = ca.Function("smoothed", list(symbols), [ca.densify(ca.vertcat(*expressions))])
    given = [s.nonzeros() if s.numel() else [] for s in symbols]
    return interpret(function, given, ca.SX, applied)[0]


def _size(a: Expression, width: float) -> Expression:
    return ca.sqrt(a**2 + width * width)  # Python raises where a power is too large for a number


def _step(a: Expression, width: float) -> Expression:
    return 0.5 * (1 + ca.tanh(a / width))


def _stairs(a: Expression, width: float) -> Expression:
    """The whole number below, with steps spread as an arctan is: a sawtooth's Fourier series by Poisson's kernel."""
    share, turn = math.exp(-2 * math.pi * width), 2 * math.pi * a
    return a - 0.5 + ca.atan2(share * ca.sin(turn), 1 - share * ca.cos(turn)) / math.pi


def _toward_zero(a: Expression, width: float) -> Expression:
    """The whole number next to it toward zero: the same stairs without the step at zero."""
    return _stairs(a, width) + 0.5 - ca.atan(a / width) / math.pi


SMOOTHED: dict[int, Callable[..., Expression]] = {
    ca.OP_FABS: _size,
    ca.OP_SIGN: lambda a, width: ca.tanh(a / width),
    ca.OP_COPYSIGN: lambda a, b, width: ca.fabs(a) * ca.tanh(b / width),
    ca.OP_FLOOR: _stairs,
    ca.OP_CEIL: lambda a, width: -_stairs(-a, width),
    ca.OP_FMOD: lambda a, b, width: a - b * _toward_zero(a / b, width),
    ca.OP_REMAINDER: lambda a, b, width: a - b * _stairs(a / b + 0.5, width),
    ca.OP_FMAX: lambda a, b, width: 0.5 * (a + b + _size(a - b, width)),
    ca.OP_FMIN: lambda a, b, width: 0.5 * (a + b - _size(a - b, width)),
    ca.OP_LT: lambda a, b, width: _step(b - a, width),
    ca.OP_LE: lambda a, b, width: _step(b - a, width),
}
LOGICAL: dict[int, Callable[..., Expression]] = {
    ca.OP_NOT: lambda a: 1 - a,
    ca.OP_AND: lambda a, b: a * b,
    ca.OP_OR: lambda a, b: a + b - a * b,
    ca.OP_IF_ELSE_ZERO: lambda condition, value: condition * value,
}
"""Operations on what is true or not, where that is a number between 0 and 1."""
