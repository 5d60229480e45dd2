"""Expressions that differ by their numbers alone, so that what is compiled for one of them serves them all."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import casadi as ca

from varcalc.symbolic.instructions import POWERS, Call, operate, program
from varcalc.symbolic.tracing import Expression

"""Operations whose second number says of what kind they are."""
NUMBER = -1
"""In the key, in place of where a number is."""


@dataclass(frozen=True)
class WrittenShape:
    """Expressions with symbols in place of their numbers.

    The ``key`` is the same for all that differ by numbers alone. ``expressions`` are of their own symbols and of the
    column ``numbers``, for which ``values`` stand.
    """

    key: Hashable
    expressions: tuple[Expression, ...]
    numbers: Expression
    values: tuple[float, ...]


@dataclass(frozen=True)
class _Written:
    """What was computed at a ``place`` of the key; a ``number`` where there is no ``expression``."""

    place: int
    expression: Expression | None
    number: float = 0.0


def shape(expressions: Sequence[Expression], symbols: Expression) -> WrittenShape | None:
    """That of SX scalars of a column of ``symbols``; None of what is looked up, whose numbers are not all written."""
    steps = program(ca.Function("shape", [symbols], [ca.vertcat(*expressions)])).steps
    if any(isinstance(step.operation, Call) for step in steps):
        return None
    work: dict[int, _Written] = {}
    key: list[Hashable] = []
    numbers: list[Expression] = []
    values: list[float] = []
    found = [ca.SX(0)] * len(expressions)

    def written(part: _Written) -> Expression:
        """The expression of a part; a number becomes a symbol, and its value is noted."""
        if part.expression is not None:
            return part.expression
        values.append(part.number)
        numbers.append(ca.SX.sym("number"))
        return numbers[-1]

    for step in steps:
        if step.operation == ca.OP_CONST:
            work[step.target] = _Written(NUMBER, None, float(step.constant))
            continue
        operands = [] if step.operation == ca.OP_INPUT else [work[k] for k in step.sources]
        if step.operation in POWERS and operands[1].expression is None:
            operands[1] = _Written(NUMBER, ca.SX(operands[1].number))
            key.append(str(operands[1].expression))
        key.append((step.operation, step.place, *(part.place for part in operands)))
        if step.operation == ca.OP_INPUT:
            key.append(step.sources)
            work[step.target] = _Written(len(key), symbols[step.sources[1]])
        elif step.operation == ca.OP_OUTPUT:
            found[step.place[1]] = written(operands[0])
        else:
            work[step.target] = _Written(len(key), operate(step.operation, [written(part) for part in operands]))
    return WrittenShape(tuple(key), tuple(found), ca.vertcat(ca.SX(0, 1), *numbers), tuple(values))
