"""A Lagrangian as a sum: what hangs on one function alone, or on one slope, and the rest of it."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from varcalc.certificates.degree import KEEPING, SUMS
from varcalc.certificates.statement import Statement
from varcalc.symbolic.instructions import Program, operate
from varcalc.symbolic.tracing import Expression, as_written

FREE, REST = -1, -2
"""The places of what hangs on no state and no control, and of what hangs on several."""

Sum = dict[int, Expression]
"""Terms by their place."""


def summands(stated: Statement) -> tuple[Expression, Sum]:
    """The rest of a Lagrangian, and its terms that hang on one state or control alone, by the number of that.

    States come first, the controls after them. Products with what hangs on no state are multiplied out.
    """
    s = stated.along.symbols
    variables, arguments = stated.variables.nonzeros(), [*s.all, *stated.along.multiplier_symbols]

    def given(e: Expression) -> Sum:
        places = [k for k, other in enumerate(variables) if ca.is_equal(e, other)]
        return {places[0] if places else FREE: e}

    entries = [[given(e) for e in a.nonzeros()] if a.numel() else [] for a in arguments]
    with as_written():
        total = Program(stated.function).run(entries, lambda c: {FREE: ca.SX(c)}, _applied)[0][0]
        rest = sum((total.pop(place) for place in (FREE, REST) if place in total), ca.SX(0))
    return rest, total


def _applied(operation: int, operands: Sequence[Sum]) -> Sum:
    if operation in KEEPING:
        return {place: operate(operation, [e]) for place, e in operands[0].items()}
    if operation in SUMS:
        return _added(operation, *operands)
    scaled = _scaled(operation, operands)
    if scaled is not None:
        return {place: operate(operation, pair) for place, pair in scaled.items()}
    places = {place for o in operands for place in o} - {FREE}
    place = FREE if not places else places.pop() if len(places) == 1 else REST
    return {place: operate(operation, list(map(_whole, operands)))}


def _added(operation: int, first: Sum, last: Sum) -> Sum:
    found = dict(first)
    for place, e in last.items():
        one = operate(ca.OP_NEG, [e]) if operation == ca.OP_SUB else e
        found[place] = operate(ca.OP_ADD, [found[place], one]) if place in found else one
    return found


def _scaled(operation: int, operands: Sequence[Sum]) -> dict[int, list[Expression]] | None:
    """The operands of a product, a quotient or a choice for each term of it; None where both hang on states."""
    if operation not in {ca.OP_MUL, ca.OP_DIV, ca.OP_IF_ELSE_ZERO}:
        return None
    first, last = operands
    if set(first) <= {FREE}:
        return None if operation == ca.OP_DIV else {place: [_whole(first), e] for place, e in last.items()}
    if set(last) <= {FREE} and operation != ca.OP_IF_ELSE_ZERO:
        return {place: [e, _whole(last)] for place, e in first.items()}
    return None


def _whole(terms: Sum) -> Expression:
    return sum(terms.values(), ca.SX(0))
