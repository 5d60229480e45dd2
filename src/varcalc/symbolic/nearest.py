"""Of bounds on one expression the nearest: between two knots of a table no other knot is met."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca
import numpy as np

from varcalc.symbolic.switches import Switch
from varcalc.symbolic.tracing import Expression

DEEP = 8
"""Operations to which two expressions are compared."""
BESIDE = 1e-9
"""Of the size of bounds: those so close to the nearest are kept as well."""


def nearest(arguments: Sequence[Expression], signs: Sequence[int]) -> dict[int, Expression]:
    """Those of the ``arguments``, each of its sign, that may vanish before all others do: by numbers, or multiples.

    Of others another one's zero is on the way. All are written alike, as an expression less its bound.
    """
    inner, number, at, rates = by_bounds(arguments)
    lower = np.array(signs) * rates > 0
    kept = np.zeros(len(at), dtype=bool)
    for k in range(len(inner)):
        for side, way in ((lower, 1.0), (~lower, -1.0)):
            own = np.flatnonzero((number == k) & side)
            if len(own):
                room = BESIDE * np.abs(at[own]).max()
                kept[own] = way * at[own] >= np.max(way * at[own]) - room
    return {int(k): inner[number[k]] - at[k] for k in np.flatnonzero(kept)}


def by_bounds(arguments: Sequence[Expression]) -> tuple[list[Expression], np.ndarray, np.ndarray, np.ndarray]:
    """Different expressions; which of them each of the ``arguments`` is (k,), less what bound (k,), and its rate (k,).

    Where an argument vanishes its expression is at the bound; it grows ``rate`` (k,) times as fast.
    """
    inner: list[Expression] = []
    number, bounds, rates = np.zeros(len(arguments), dtype=int), np.zeros(len(arguments)), np.ones(len(arguments))
    for k, argument in enumerate(arguments):
        core, rates[k], rest = _affine(argument)
        same = next((j for j, other in enumerate(inner) if ca.is_equal(core, other, DEEP)), len(inner))
        if same == len(inner):
            inner.append(core)
        number[k], bounds[k] = same, -rest / rates[k]
    return inner, number, bounds, rates


def gathered(switches: Sequence[Switch]) -> list[Switch]:
    """The same, those of one expression less different numbers as one, that has these for levels.

    It stands where the first of them stood.
    """
    plain = [k for k, switch in enumerate(switches) if not switch.stepped and switch.levels == (0.0,)]
    inner, number, bounds, _ = by_bounds([switches[k].argument for k in plain])
    found = list(switches)
    for own in (np.flatnonzero(number == k) for k in range(len(inner))):
        if len(own) > 1:
            levels = tuple(np.unique(bounds[own]).tolist())
            found[plain[own[0]]] = replace(switches[plain[own[0]]], argument=inner[number[own[0]]], levels=levels)
    later = {plain[k] for k in range(len(plain)) if number[k] in number[:k]}
    return [switch for k, switch in enumerate(found) if k not in later]


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
