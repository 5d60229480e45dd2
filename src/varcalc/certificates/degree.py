"""Of what degree an expression is in some of its arguments, by its operations.

Second derivatives that do not hang on a variable are no proof that an expression is of second degree in it: those of
``fabs(y - 3)`` vanish on both sides of its kink. What switches, or is no polynomial, is of no degree.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import casadi as ca

from varcalc.symbolic.instructions import POWERS, SUMS, Program

KEEPING = {ca.OP_ASSIGN, ca.OP_NEG, ca.OP_TWICE}


def degrees(function: ca.Function, watched: Sequence[Sequence[bool]]) -> list[list[float]]:
    """Of what degree at most each nonzero of each result is, jointly in the entries that are ``watched``.

    Infinity stands for what is no polynomial in them, or is not known to be one.

    >>> y, v = ca.SX.sym("y"), ca.SX.sym("v")
    >>> degrees(ca.Function("f", [y, v], [y * v + v**2, ca.fabs(y), ca.sqrt(y) * v]), [[False], [True]])
    [[2.0], [0.0], [1.0]]
    """
    if not function.is_a("SXFunction"):
        return [[math.inf] * function.nnz_out(i) for i in range(function.n_out())]
    # a number keeps its value, which an exponent's is
    given = [[(float(w), None) for w in argument] for argument in watched]
    results = Program(function).run(given, lambda value: (0.0, value), _applied)
    return [[degree for degree, _ in result] for result in results]


Degree = tuple[float, float | None]
"""A degree; of a constant its value too."""


def _applied(operation: int, operands: Sequence[Degree]) -> Degree:
    found = [degree for degree, _ in operands]
    if not any(found):
        return 0.0, None
    rule = RULES.get(operation)
    return (math.inf if rule is None else rule(*operands)), None


def _powered(base: Degree, exponent: Degree) -> float:
    power = exponent[1]
    return power * base[0] if power is not None and power >= 1.0 and power == round(power) else math.inf


RULES: dict[int, Callable[..., float]] = {
    **dict.fromkeys(KEEPING, lambda a: a[0]),
    **dict.fromkeys(SUMS, lambda a, b: max(a[0], b[0])),
    **dict.fromkeys(POWERS, _powered),
    ca.OP_MUL: lambda a, b: a[0] + b[0],
    ca.OP_SQ: lambda a: 2.0 * a[0],
    ca.OP_DIV: lambda a, b: math.inf if b[0] else a[0],
    ca.OP_IF_ELSE_ZERO: lambda a, b: math.inf if a[0] else b[0],
}
"""The degree of an operation on operands not all of which are of degree 0."""


def apart(function: ca.Function, groups: Sequence[Sequence[int]]) -> bool:
    """Whether every result is a sum of terms each of which hangs on the entries of one group at most.

    ``groups`` numbers the group of each entry of each argument; entries of group 0 belong to none.

    >>> a, b = ca.SX.sym("a"), ca.SX.sym("b")
    >>> apart(ca.Function("f", [a, b], [a**2 - 3 * ca.fabs(b)]), [[1], [2]])
    True
    >>> apart(ca.Function("f", [a, b], [ca.fabs(a - b)]), [[1], [2]])
    False
    """
    if not function.is_a("SXFunction"):
        return False
    given = [[(frozenset({g} - {0}), True) for g in argument] for argument in groups]
    results = Program(function).run(given, lambda _: (frozenset(), True), _parted)
    return all(parted for result in results for _, parted in result)


Parted = tuple[frozenset[int], bool]
"""The groups that a term hangs on, and whether it is a sum of terms of one each."""


def _parted(operation: int, operands: Sequence[Parted]) -> Parted:
    groups = frozenset[int]().union(*(g for g, _ in operands))
    scaled = operation in {ca.OP_MUL, ca.OP_DIV} and not operands[-1][0]
    scaled = scaled or (operation == ca.OP_MUL and not operands[0][0])
    if operation in KEEPING or operation in SUMS or scaled:
        return groups, all(parted for _, parted in operands)
    return groups, len(groups) <= 1
