"""The terms of Hilbert's invariant integral at the ends: never negative, where an end is free or both are one."""

from __future__ import annotations

import math
from collections.abc import Callable

from varcalc.certificates.balls import Ball, flint
from varcalc.certificates.certificate import Hypothesis, Means
from varcalc.certificates.curve import end_values
from varcalc.certificates.integrals import Unproved
from varcalc.certificates.tube import Prover


def prove_ends(prover: Prover) -> list[Hypothesis]:
    """Prove w Q w at the end, less that at the start, not negative for admissible w; Unproved where it is not."""
    stated = prover.statement
    if stated.periodic:
        first, last = (_slopes(prover, end) for end in (0, 1))
        free = range(stated.bare)  # what is integrated to levels vanishes at both ends
        matrix = [[last[i][j] - first[i][j] for j in free] for i in free]
        if not _nonnegative(matrix):
            raise Unproved("Q at the end is not proved to exceed Q at the start, as a periodic curve needs")
        return [Hypothesis("Q at the end exceeds Q at the start", Means.BALLS)]
    proved, bends = [], _bends(prover)
    for end, name in ((0, "start"), (1, "end")):
        free = [i for i, held in enumerate(stated.held[end]) if not held]
        if not free:
            continue
        Q = _slopes(prover, end)
        sign = 1 if end else -1
        if not _nonnegative([[sign * Q[i][j] + bends(end, i, j) for j in free] for i in free]):
            raise Unproved(f"the term of the free {name} is not proved positive: a focal point lies near")
        proved.append(Hypothesis(f"the term of the free {name} is not negative", Means.BALLS))
    return proved


def _bends(prover: Prover) -> Callable[[int, int, int], Ball]:
    """The second derivatives of what the ends cost, by two states of one end, over the tube."""
    cost, found = prover.statement.cost, flint()
    if cost is None:
        return lambda end, i, j: found.arb(0)
    start, end, numbers = end_values(prover.statement, prover.joints)
    if prover.tube.delta < math.inf:
        units = prover.tube.sizes[0]
        room = [found.arb(0, prover.tube.delta * float(u)) for u in units]
        n, count = prover.statement.n, len(numbers)
        start, end = ([v + w for v, w in zip(values, room[:n], strict=True)] for values in (start, end))
        numbers = [v + w for v, w in zip(numbers, room[len(room) - count :], strict=True)]
    second = cost.jet(start, end, numbers, 2).second

    def bend(at: int, i: int, j: int) -> Ball:
        places = cost.index(at, i), cost.index(at, j)
        known = sorted(p for p in places if p is not None)
        return found.arb(0) + second.get((known[0], known[1]), 0) if len(known) == 2 else found.arb(0)

    return bend


def _slopes(prover: Prover, end: int) -> list[list[Ball]]:
    """Q at the start or the end."""
    k, at = (-1, flint().arb(1)) if end else (0, flint().arb(-1))
    Q = prover.slopes[k]
    if len(Q.U) == 1:
        return [[Q.M[0][0](at) / Q.U[0][0](at)]]
    return [[poly(at) for poly in row] for row in Q.M]


def _nonnegative(matrix: list[list[Ball]]) -> bool:
    """Whether a symmetric matrix of balls is zero, or positive definite by elimination."""
    if all(v.is_zero() for row in matrix for v in row):
        return True
    work = [list(row) for row in matrix]
    for k, row in enumerate(work):
        if not row[k] > 0:
            return False
        for i in range(k + 1, len(work)):
            factor = work[i][k] / row[k]
            work[i] = [a - factor * b for a, b in zip(work[i], row, strict=True)]
    return True
