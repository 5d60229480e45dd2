"""Expressions that switch, piece by piece: smooth on each side of their switches, and where the sides end.

|u| is u on one side and -u on the other, floor(u) a number between two whole ones. What an integrator is given is one
piece, which goes on smoothly beyond its end, with the arguments of the switches as stopping functions: no step goes
over a kink or a jump without seeing it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.instructions import interpret
from varcalc.symbolic.switches import alike
from varcalc.symbolic.tracing import Expression

NEVER = {ca.OP_EQ: 0.0, ca.OP_NE: 1.0}
"""Comparisons that hold at single places only, or everywhere else."""


@dataclass(frozen=True)
class Piece:
    """What an expression is on one side of each of its switches.

    ``ends`` vanish where the piece does; ``beyond`` holds for each of them the sides of those of its switches that
    change there, by their numbers.
    """

    expression: Expression
    ends: tuple[Expression, ...]
    beyond: tuple[dict[int, int], ...]


@dataclass(frozen=True)
class _Part:
    """An expression and the numbers of the switches that it hangs on."""

    written: Expression
    of: frozenset[int] = frozenset()


@dataclass(frozen=True)
class Pieces:
    """The pieces of an SX ``expression`` of the ``symbols``, a column."""

    expression: Expression
    symbols: Expression
    _stepped: np.ndarray = field(init=False, repr=False, compare=False)
    _arguments: PointEvaluator = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        arguments: list[Expression] = []
        stepped: list[bool] = []

        def switched(operation: int, operands: Sequence[_Part]) -> _Part:
            written = [part.written for part in operands]
            arguments.append(_ARGUMENTS[operation](*written))
            stepped.append(operation in _STEPPED)
            return _Part(_carried_out(operation, written))

        self._read(switched)
        object.__setattr__(self, "_stepped", np.array(stepped, dtype=bool))
        function = ca.Function("arguments", [self.symbols], [ca.densify(ca.vertcat(ca.SX(0, 1), *arguments))])
        object.__setattr__(self, "_arguments", PointEvaluator(function))

    def __len__(self) -> int:
        return len(self._stepped)

    def _read(self, switched: Callable[[int, Sequence[_Part]], _Part]) -> _Part:
        """The expression, its operations that switch as they are ``switched``, in the order of their numbers."""

        def applied(operation: int, operands: Sequence[_Part]) -> _Part:
            if operation == ca.OP_COPYSIGN:
                size, sign = switched(ca.OP_FABS, operands[:1]), switched(ca.OP_SIGN, operands[1:])
                return _Part(size.written * sign.written, size.of | sign.of)
            if operation in _ARGUMENTS:
                return switched(operation, operands)
            first, of = operands[0].written, frozenset[int]().union(*(part.of for part in operands))
            if operation == ca.OP_IF_ELSE_ZERO and first.is_constant():
                return _Part(operands[1].written if float(first) else ca.SX(0), of if float(first) else operands[0].of)
            return _Part(_carried_out(operation, [part.written for part in operands]), of)

        function = ca.Function("read", [self.symbols], [ca.densify(self.expression)])
        given = [[_Part(s) for s in self.symbols.nonzeros()]]
        return interpret(function, given, lambda number: _Part(ca.SX(number)), applied)[0][0]

    def piece(self, sides: Sequence[int]) -> Piece:
        """The expression where its switches are on the ``sides``, and where that ends."""
        ends: list[list[tuple[Expression, int]]] = []

        def switched(operation: int, operands: Sequence[_Part]) -> _Part:
            number, written = len(ends), [part.written for part in operands]
            side, argument = sides[number], _ARGUMENTS[operation](*written)
            ends.append(_ends(operation, argument, side))
            of = frozenset[int]().union(*(part.of for part in operands))
            if argument.is_constant():
                return _Part(_carried_out(operation, written), of)
            return _Part(_ONE_SIDE[operation](*written, side), of | {number})

        last = self._read(switched)
        stops: list[Expression] = []
        beyond: list[dict[int, int]] = []
        for number in sorted(last.of):
            for end, other in ends[number]:
                same = (k for k, stop in enumerate(stops) if alike(end, stop))
                known = next(same, None)
                if known is None:
                    stops.append(end)
                    beyond.append({number: other})
                else:
                    beyond[known][number] = other
        return Piece(last.written, tuple(stops), tuple(beyond))

    def sides(self, points: np.ndarray) -> np.ndarray:
        """On which sides (m, switches) points (m, d) are: 1 or -1, the sign of an argument, or the number below it.

        Where an argument is no number, its operation is not asked for.
        """
        values = np.nan_to_num(self._arguments(len(points), points), nan=1.0)
        return np.where(self._stepped, np.floor(values), np.where(values < 0, -1, 1)).astype(int)


def _carried_out(operation: int, operands: Sequence[Expression]) -> Expression:
    if operation in NEVER and not (operands[0].is_constant() and operands[1].is_constant()):
        return ca.SX(NEVER[operation])
    return ca.SX.unary(operation, *operands) if len(operands) == 1 else ca.SX.binary(operation, *operands)


def _difference(a: Expression, b: Expression) -> Expression:
    return a - b


def _itself(a: Expression) -> Expression:
    return a


def _truncated(a: Expression, b: Expression, side: int) -> Expression:
    return a - b * (side if side >= 0 else side + 1)


_ARGUMENTS: dict[int, Callable[..., Expression]] = {
    ca.OP_FABS: _itself,
    ca.OP_SIGN: _itself,
    ca.OP_FMIN: _difference,
    ca.OP_FMAX: _difference,
    ca.OP_LT: _difference,
    ca.OP_LE: _difference,
    ca.OP_FLOOR: _itself,
    ca.OP_CEIL: _itself,
    ca.OP_FMOD: lambda a, b: a / b,
    ca.OP_REMAINDER: lambda a, b: a / b + 0.5,
}
"""What is zero, or a whole number, where an operation switches."""
_STEPPED = {ca.OP_FLOOR, ca.OP_CEIL, ca.OP_FMOD, ca.OP_REMAINDER}
_ONE_SIDE: dict[int, Callable[..., Expression]] = {
    ca.OP_FABS: lambda a, side: side * a,
    ca.OP_SIGN: lambda a, side: ca.SX(side),
    ca.OP_FMIN: lambda a, b, side: a if side < 0 else b,
    ca.OP_FMAX: lambda a, b, side: b if side < 0 else a,
    ca.OP_LT: lambda a, b, side: ca.SX(side < 0),
    ca.OP_LE: lambda a, b, side: ca.SX(side < 0),
    ca.OP_FLOOR: lambda a, side: ca.SX(side),
    ca.OP_CEIL: lambda a, side: ca.SX(side + 1),
    ca.OP_FMOD: _truncated,
    ca.OP_REMAINDER: lambda a, b, side: a - b * side,
}
"""What an operation is on one side."""


def _ends(operation: int, argument: Expression, side: int) -> list[tuple[Expression, int]]:
    """What vanishes at the ends of one side of an operation, and which side comes there."""
    if operation in _STEPPED:
        return [(argument - side, side - 1), (argument - (side + 1), side + 1)]
    return [(argument, -side)]
