"""Where a curve goes through what its Lagrangian switches on, so that pieces of a proof begin there."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from itertools import pairwise

import numpy as np

from varcalc.certificates.balls import flint
from varcalc.certificates.jets import SELECTED, Algebra, Jet
from varcalc.certificates.smooth import Undecided
from varcalc.certificates.statement import Statement
from varcalc.symbolic.instructions import Call

LOOKED_AT = 16
"""Parts of a piece at whose ends signs are looked at."""
SAME_PLACE, BESIDE = 1e-15, 1e-6
"""Lengths, relative to the interval, within which a crossing lies where pieces meet already, and within which they are
moved to it."""
BISECTIONS = 60


def edges_at_crossings(statement: Statement, edges: list[float]) -> list[float]:
    """The edges of pieces with those added, or moved, where a curve crosses what H switches on."""
    if not any(isinstance(step.operation, Call) or step.operation in SELECTED for step in statement.program.steps):
        return edges
    length, waypoints = edges[-1] - edges[0], set(statement.waypoints)
    found = [
        c
        for c in _crossings(statement, edges)
        if min(abs(c - e) for e in edges) > SAME_PLACE * length and min(c - edges[0], edges[-1] - c) > BESIDE * length
    ]
    found = [c for k, c in enumerate(found) if not k or c - found[k - 1] > BESIDE * length]
    kept = [e for e in edges[1:-1] if e in waypoints or all(abs(c - e) > BESIDE * length for c in found)]
    return sorted({edges[0], *kept, *found, edges[-1]})


def _crossings(statement: Statement, edges: Sequence[float]) -> list[float]:
    """Where signs change along the curve, to the last bit."""
    found = []
    for a, b in pairwise(edges):
        places = np.linspace(a, b, LOOKED_AT + 1)[:-1] + (b - a) / (2 * LOOKED_AT)
        places = np.r_[a + 1e-12 * (b - a), places, b - 1e-12 * (b - a)]
        told = _signs(statement, places)
        for (low, before), (high, after) in pairwise(zip(places.tolist(), told, strict=True)):
            if before != after:
                found.append(_between(statement, low, high, before))
    return found


def _between(statement: Statement, low: float, high: float, before: tuple[int | None, ...]) -> float:
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        if not low < middle < high:
            break
        low, high = (middle, high) if _signs(statement, np.array([middle]))[0] == before else (low, middle)
    return high


def _signs(statement: Statement, x: np.ndarray) -> list[tuple[int | None, ...]]:
    """The signs of what H switches on at points of the curve; as many as there are before one is none."""
    n, along, ball = statement.n, statement.along, flint().arb
    rows = np.vstack([along.evaluate(x, k) for k in range(statement.order + 1)]).T.tolist()
    numbers = [Jet(ball(float(c))) for c in along.numbers]
    found = []
    for at, row in zip(x.tolist(), rows, strict=True):
        values = [Jet(ball(float(v))) for v in row]
        algebra = Algebra(0)
        arguments = statement.arguments(Jet(ball(at)), [*values[: n * statement.order], *numbers], values[-n:])
        with suppress(Undecided):  # what was told up to there
            statement.program.run(arguments, algebra.constant, algebra.apply)
        found.append(tuple(algebra.signs))
    return found
