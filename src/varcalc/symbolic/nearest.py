"""Of bounds on one expression the nearest: between two knots of a table no other knot is met."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from varcalc.symbolic.tracing import Expression

DEEP = 8
"""Operations to which two expressions are compared."""
BESIDE = 1e-9
"""Of the size of bounds: those so close to the nearest are kept as well."""


def nearest(arguments: Sequence[Expression], signs: Sequence[int]) -> dict[int, Expression]:
    """Those of the ``arguments``, each of its sign, that may vanish before all others do: by numbers, or multiples.

    Of others another one's zero is on the way. All are written alike, as an expression less its bound.
    """
    inner: list[Expression] = []
    group, bound, above = [], [], []
    for argument, sign in zip(arguments, signs, strict=True):
        core, rate, rest = _affine(argument)
        same = [k for k, other in enumerate(inner) if ca.is_equal(core, other, DEEP)]
        if not same:
            inner.append(core)
        group.append(same[0] if same else len(inner) - 1)
        bound.append(-rest / rate)
        above.append(sign * rate > 0)
    number, at, lower = np.array(group), np.array(bound), np.array(above, dtype=bool)
    kept = np.zeros(len(at), dtype=bool)
    for k in range(len(inner)):
        for side, way in ((lower, 1.0), (~lower, -1.0)):
            own = np.flatnonzero((number == k) & side)
            if len(own):
                room = BESIDE * np.abs(at[own]).max()
                kept[own] = way * at[own] >= np.max(way * at[own]) - room
    return {int(k): inner[group[k]] - bound[k] for k in np.flatnonzero(kept)}


def _affine(expression: Expression) -> tuple[Expression, float, float]:
    """An expression e and numbers a, not zero, and b with ``expression`` = a e + b, as it is written."""
    e, a, b = ca.SX(expression), 1.0, 0.0
    while not (e.is_constant() or e.is_symbolic()):
        first, second = e.dep(0), e.dep(e.n_dep() - 1)
        left = float(first) if first.is_constant() else np.nan
        right = float(second) if second.is_constant() else np.nan
        number = left if np.isfinite(left) else right
        if e.is_op(ca.OP_NEG):
            e, a = first, -a
        elif e.is_op(ca.OP_ADD) and np.isfinite(number):
            e, b = (second if np.isfinite(left) else first), b + a * number
        elif e.is_op(ca.OP_SUB) and np.isfinite(right):
            e, b = first, b - a * right
        elif e.is_op(ca.OP_SUB) and np.isfinite(left):
            e, a, b = second, -a, b + a * left
        elif e.is_op(ca.OP_MUL) and np.isfinite(number) and number != 0:
            e, a = (second if np.isfinite(left) else first), a * number
        elif e.is_op(ca.OP_DIV) and np.isfinite(right) and right != 0:
            e, a = first, a / right
        elif e.is_op(ca.OP_TWICE):
            e, a = first, 2 * a
        else:
            break
    return e, a, b
