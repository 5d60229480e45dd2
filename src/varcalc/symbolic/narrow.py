"""Where in the plane an expression varies over less than the distance of samples could show.

A square is quartered again and again. The operands of each operation are enclosed over a box and compared with what
they are at its corners (:mod:`varcalc.symbolic.variation`): where nothing may hide between these, the box is done.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from varcalc.symbolic.instructions import BINARY, UNARY, interpret
from varcalc.symbolic.intervals import Interval, applied, constant
from varcalc.symbolic.variation import NARROWING, VARYING, Between, Rules, gentle

COARSEST, FINEST = 3, 30
"""How often the square is halved to begin with, and at most."""
MOST_QUARTERED, SOME_BOXES = 2048, 256
"""Boxes of one size that are quartered; and how many of them still are, evenly among all, where there are more."""
LOG_OF_NOTHING = 50.0
"""Logarithm of what is divided by where what is left is nothing."""


def _up_to(largest: float, rule: Callable[..., np.ndarray]) -> Callable[..., np.ndarray]:
    """A rule of an operation that makes nothing of what is larger, of its last operand."""

    def within(*operands: Between) -> np.ndarray:
        """The rule, of a last operand without what is larger."""
        a = operands[-1]
        low, high, first, last = (np.clip(v, -largest, largest) for v in (*a.range, a.first, a.last))
        return rule(*operands[:-1], Between((low, high), first, last))

    return within


RULES: Rules = {
    **{operation: VARYING[operation] for operation in NARROWING},
    **{operation: _up_to(LOG_OF_NOTHING, VARYING[operation]) for operation in (ca.OP_COSH, ca.OP_SINH)},
    **{operation: _up_to(math.exp(LOG_OF_NOTHING), VARYING[operation]) for operation in (ca.OP_INV, ca.OP_DIV)},
}
"""What varies as narrowly everywhere hides nowhere, and what is nothing is not narrow."""
QUARTERS = np.array([[0, 0], [0, 1], [1, 0], [1, 1]])
"""The corners of a square, and its quarters."""


@dataclass(frozen=True)
class NarrowPlaces:
    """Boxes of the plane that hold something whose width is about theirs: the ``middle`` (k, 2) and ``width`` (k,).

    ``settled`` (k,) says that nothing narrower is in the box.
    """

    middle: np.ndarray
    width: np.ndarray
    settled: np.ndarray

    @classmethod
    def none(cls) -> NarrowPlaces:
        """No boxes."""
        return cls(np.zeros((0, 2)), np.zeros(0), np.zeros(0, dtype=bool))


@dataclass(frozen=True)
class _Cornered:
    """What is enclosed over boxes, its ``corners`` (4, m) there, and by what factor what it is made of goes too far."""

    range: Interval
    corners: np.ndarray
    worst: np.ndarray


def narrow_places(function: ca.Function, middle: np.ndarray, width: float) -> NarrowPlaces:
    """What an SX ``function`` of a point in the plane may hide in the square of such a ``middle`` (2,) and ``width``.

    Sums, products and switches count as gentle.
    """
    if gentle(function, RULES):
        return NarrowPlaces.none()
    at = np.stack(np.meshgrid(*[np.arange(2**COARSEST)] * 2), axis=-1).reshape(-1, 2)
    before, found = np.zeros((0, 2), dtype=int), []
    corner = np.asarray(middle) - width / 2
    for level in range(COARSEST, FINEST + 1):
        size = width / 2**level
        at = at[_may_hide(function, corner + size * at, size)]
        # a box all of whose quarters are gentle holds what is as narrow as they are
        found.append(_boxes(before[~_among(before, at // 2)], corner, 2 * size, settled=True))
        if len(at) == 0 or level == FINEST:
            # at the last it is a point where the expression is not smooth
            found.append(_boxes(at, corner, size, settled=True))
            break
        if len(at) > MOST_QUARTERED:
            chosen = np.zeros(len(at), dtype=bool)
            chosen[np.linspace(0, len(at) - 1, SOME_BOXES).astype(int)] = True
            found.append(_boxes(at[~chosen], corner, size, settled=False))
            at = at[chosen]
        before, at = at, (2 * at[:, None] + QUARTERS).reshape(-1, 2)
    return NarrowPlaces(
        np.concatenate([f.middle for f in found]),
        np.concatenate([f.width for f in found]),
        np.concatenate([f.settled for f in found]),
    )


def _boxes(at: np.ndarray, corner: np.ndarray, size: float, settled: bool) -> NarrowPlaces:
    return NarrowPlaces(corner + size * (at + 0.5), np.full(len(at), size), np.full(len(at), settled))


def _among(some: np.ndarray, all_: np.ndarray) -> np.ndarray:
    """Which of the pairs of whole numbers ``some`` (m, 2) are among others (k, 2)."""
    one, other = (pairs[:, 0] * 2**32 + pairs[:, 1] for pairs in (some, all_))
    return np.isin(one, other)


def _may_hide(function: ca.Function, low: np.ndarray, size: float) -> np.ndarray:
    """True (m,) for the squares between ``low`` (m, 2) and so much more where an operation goes too far unseen.

    What is not taken in a whole square, on the other side of a switch, does not count.
    """

    def watched(operation: int, operands: Sequence[_Cornered]) -> _Cornered:
        """The operation in squares, with the worst that anything up to it may hide."""
        variation = RULES.get(operation)
        worst = [o.worst for o in operands]
        if operation == ca.OP_IF_ELSE_ZERO:
            never = (operands[0].range[0] == 0) & (operands[0].range[1] == 0)
            worst[1] = np.where(never, 0.0, worst[1])
        if variation is not None:
            ends = [Between(o.range, o.corners.min(axis=0), o.corners.max(axis=0)) for o in operands]
            worst.append(variation(*ends))
        of = UNARY.get(operation) or BINARY.get(operation)
        corners = np.full_like(operands[0].corners, np.nan) if of is None else of(*(o.corners for o in operands))
        return _Cornered(applied(operation, [o.range for o in operands]), corners, _largest(worst))

    def fixed(value: float) -> _Cornered:
        return _Cornered(constant(value), np.full((4, 1), value), np.zeros(1))

    corners = low[None] + size * QUARTERS[:, None]
    nothing = np.zeros(len(low))
    point = [_Cornered((low[:, k], low[:, k] + size), corners[..., k], nothing) for k in range(2)]
    with np.errstate(all="ignore"):
        (results,) = interpret(function, [point], fixed, watched)
    return np.broadcast_to(_largest([one.worst for one in results]), nothing.shape) > 1.0


def _largest(values: Sequence[np.ndarray]) -> np.ndarray:
    """The largest of the ``values``, those that are no numbers left out."""
    largest = values[0]
    for other in values[1:]:
        largest = np.fmax(largest, other)
    return largest
