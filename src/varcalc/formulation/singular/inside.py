"""Powers of the distance from places inside the interval at which L is singular in x, on either side of each.

Where L feels the slope like |x - c|^a v^2 the momentum L_y' = const makes y - y(c) grow like the power e of the
distance from c. In s with |x - c| ~ |s - c|^(1 / e) the curve leaves c straight, and L feels the slope there as
anywhere else. For e > 1 dx/ds is infinite at c: the power is k / e >= 1 where L holds more than the slope.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import casadi as ca
import numpy as np

from varcalc.formulation import Coordinates, Form, Sampled, Start, Stated, conditions_of, rewriter
from varcalc.formulation.form import extended
from varcalc.formulation.graph import graph_form
from varcalc.formulation.singular.indicial import growth
from varcalc.formulation.singular.offsets import gathered
from varcalc.problem.breaks import breaks
from varcalc.problem.problem import Problem
from varcalc.symbolic.derived import Cache
from varcalc.symbolic.tracing import Expression

MOST_STATED_PIECES = 16
"""Pieces of an interval, each of which states the Lagrangian once more."""

MOST_WHOLE = 2
"""Whole power of s up to which a curve keeps its digits where it is that flat."""


@dataclass(frozen=True)
class _Piece:
    """Between ``anchor`` and ``other`` the distance from the anchor is a power of its share in s; neither moves."""

    anchor: float
    other: float
    power: float

    @property
    def low(self) -> float:
        """The lesser of its two ends."""
        return min(self.anchor, self.other)

    def step(self, s: Expression) -> tuple[Expression, Expression]:
        """The way from the anchor, and its derivative by s."""
        length = self.other - self.anchor
        share = (s - self.anchor) / length
        return length * share**self.power, self.power * share ** (self.power - 1)


def inside_form(problem: Problem) -> Form | None:
    """The problem in s; None where nothing inside is singular, or no power explains what L does there."""
    pieces = _pieces(problem)
    if not any(piece.power != 1 for piece in pieces) or len(pieces) > MOST_STATED_PIECES:
        return None
    plain = graph_form(problem)
    symbols = extended(problem, problem.n, 0)
    steps = [piece.step(symbols.x) for piece in pieces]
    ways = [(piece.anchor + step, speed) for piece, (step, speed) in zip(pieces, steps, strict=True)]

    def joined(parts: list[Expression]) -> Expression:
        """One expression of what is said on each piece."""
        whole = parts[0]
        for piece, part in zip(pieces[1:], parts[1:], strict=True):
            whole = ca.if_else(symbols.x < piece.low, whole, part)
        return whole

    def rewrite(expression: Expression, integrated: bool) -> Expression:
        """An expression of the problem in s."""
        # each piece on its own: distances from its anchor keep their digits
        stated = (
            rewriter(problem, symbols, x, symbols.y, [symbols.dy / speed], speed)(expression, integrated)
            for x, speed in ways
        )
        return joined([gathered(part, symbols) if part.numel() == 1 else part for part in stated])

    x, speed = (joined(list(parts)) for parts in zip(*ways, strict=True))
    place = ca.Function("place", [symbols.x], [x])

    def pull(curve: Sampled) -> Sampled:
        return lambda s: curve(np.asarray(place(s[None])).ravel())

    integrand = problem.sign * rewrite(problem.integrand, True)
    knots = tuple(piece.low for piece in pieces[1:])
    lifted = (x, symbols.y, speed, symbols.dy)
    return Form(
        problem,
        Coordinates(
            Stated(symbols, integrand, integrand, lifted), problem.span, pull, weak_only=True,
            note="|x - c| ~ |s - c|^" + ", ".join(f"{p.power:.4g}" for p in pieces if p.power != 1),
        ),
        plain.ends,
        conditions_of(problem, rewrite, knots, plain.conditions.waypoints),
        Start(pull(plain.start.curve), plain.start.unknowns, plain.start.bumps),
        cache=Cache(),
    )  # fmt: skip


def _pieces(problem: Problem) -> list[_Piece]:
    """The interval cut at its breaks, and between two that are singular toward one another."""
    marks = [problem.span[0], *breaks(problem), problem.span[1]]
    found: list[_Piece] = []
    for k, (low, high) in enumerate(pairwise(marks)):
        left = _power(problem, low, high) if k else 1.0
        right = _power(problem, high, low) if k < len(marks) - 2 else 1.0
        middle = 0.5 * (low + high)
        if left != 1.0 and right != 1.0:
            found += [_Piece(low, middle, left), _Piece(high, middle, right)]
        else:
            found.append(_Piece(low, high, left) if right == 1.0 else _Piece(high, low, right))
    return found


def _power(problem: Problem, place: float, toward: float) -> float:
    """The power of the share in s by which the distance from a place grows."""
    found = growth(problem, place, toward)
    if found is None:
        return 1.0
    if found > 1 and ca.depends_on(problem.integrand, problem.symbols.y):
        return math.ceil(found) / found if found < MOST_WHOLE else 1.0
    return 1.0 / found
