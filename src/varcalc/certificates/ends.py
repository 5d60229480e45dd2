"""The terms of Hilbert's invariant integral at the ends: never negative, where an end is free or both are one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from varcalc.certificates.balls import Ball, flint
from varcalc.certificates.certificate import Hypothesis, Means
from varcalc.certificates.cost import Cost
from varcalc.certificates.curve import Samples, end_values
from varcalc.certificates.field import JacobiFields
from varcalc.certificates.integrals import Unproved
from varcalc.certificates.jets import Jet
from varcalc.certificates.smooth import Undecided
from varcalc.certificates.statement import Statement

if TYPE_CHECKING:
    from varcalc.certificates.tube import Prover

STIFF = 100.0
"""Weight of an equation between the ends, in units of the least H_uu over the length of the interval."""


def tied(stated: Statement, samples: Sequence[Samples]) -> Statement:
    """The statement with multipliers and weights of the equations between its ends, from the curve's own momenta."""
    count = stated.along.form.ends.equations
    if not count:
        return stated
    cost = replace(stated, multipliers=(0.0,) * count, weights=(0.0,) * count).cost
    assert cost is not None
    n, first, last = stated.n, samples[0], samples[-1]
    numbers = np.asarray(stated.along.numbers, dtype=float)
    slope, rows = cost.gradients([first.states[:n, 0], last.states[:n, -1], numbers])
    # what is integrated to: p at the start less p at the end, of a number its whole force
    asked = np.r_[first.momenta[:n, 0], -last.momenta[:n, -1], -last.momenta[n * stated.order :, -1]] - slope
    free = np.r_[~stated.held[0][:n], ~stated.held[1][:n], np.ones(len(numbers), dtype=bool)]
    multipliers = np.linalg.lstsq(rows[:, free].T, asked[free], rcond=None)[0]
    stiffness = min(float(np.linalg.eigvalsh(s.hessian[:, -n:, -n:]).min()) for s in samples)
    length = last.end - first.start
    sizes = (rows[:, free] ** 2).sum(axis=1)
    weights = STIFF * max(stiffness, 0.0) / length / np.where(sizes > 0, sizes, 1.0)
    return replace(stated, multipliers=tuple(multipliers.tolist()), weights=tuple(weights.tolist()))


def end_bends(stated: Statement, joints: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """The second derivatives (m, m) of what the start and the end cost on the curve, in numbers, to be tried.

    Of what both cost together each is given its share: less the row sums beside its block, which the whole matrix
    exceeds, or more, which it may where both ends move together.
    """
    m, n, cost = stated.states, stated.n, stated.cost
    found, across = np.zeros((2, m, m)), np.zeros((2, m, m))
    if cost is None:
        return [(found[0], found[1])]
    jet = cost.jet(*end_values(stated, joints), 2)
    for end, i, j in np.ndindex(2, stated.bare, stated.bare):
        places = cost.index(end, i), cost.index(end, j)
        found[end, i, j] = float(second(jet, *places).mid())
    for i, j in np.ndindex(n, n):
        size = abs(float(second(jet, i, n + j).mid()))
        across[0, i, i] += size
        across[1, j, j] += size
    shares = (-1.0, 1.0) if across.any() else (0.0,)
    return [(found[0] + share * across[0], found[1] + share * across[1]) for share in shares]


def end_cost(stated: Statement, joints: np.ndarray) -> Ball:
    """What the ends of a curve cost, by the functions where its pieces meet."""
    return flint().arb(0) if stated.cost is None else stated.cost.jet(*end_values(stated, joints), 0).value


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
    matrix = _matrix(stated, _cost(prover), (_slopes(prover, 0), _slopes(prover, 1)))
    if not matrix:
        return []
    if not _nonnegative(matrix):
        raise Unproved("the terms of the ends that are free or slide are not proved positive: a focal point lies near")
    return [Hypothesis("the terms of the ends that are free or slide are not negative", Means.BALLS)]


def bears(stated: Statement, joints: np.ndarray, field: JacobiFields) -> bool:
    """Whether a field leaves the terms of the ends positive, in numbers."""
    cost = stated.cost
    jet = None if cost is None else cost.jet(*end_values(stated, joints), 2)
    sides = [np.linalg.solve(U.T, M.T) for U, M in ((field.U[0, 0], field.M[0, 0]), (field.U[-1, -1], field.M[-1, -1]))]
    first, last = ((0.5 * (Q + Q.T)) for Q in sides)
    if stated.periodic:
        gained = (last - first)[: stated.bare, : stated.bare]
        return bool(np.linalg.eigvalsh(gained).min() > 0)
    matrix = np.array([[float(v.mid()) for v in row] for row in _matrix(stated, jet, (first.tolist(), last.tolist()))])
    return not matrix.size or bool(np.linalg.eigvalsh(matrix).min() > 0)


def _matrix(stated: Statement, jet: Jet | None, Q: tuple[list[list[Any]], ...]) -> list[list[Ball]]:
    """The quadratic form of what is free at the ends, and of numbers, which are the same at both."""
    number = stated.n * stated.order
    free = [(end, i) for end in (0, 1) for i in range(number) if not stated.held[end][i]]
    free += [(-1, i) for i in range(number, stated.bare)]
    return [[_entry(stated, jet, Q, a, b) for b in free] for a in free]


def fits(prover: Prover) -> bool:
    """Whether the terms of the ends are proved not negative in a tube."""
    try:
        prove_ends(prover)
    except (Unproved, Undecided):
        return False
    return True


def _entry(
    stated: Statement, jet: Jet | None, Q: tuple[list[list[Any]], ...], a: tuple[int, int], b: tuple[int, int]
) -> Ball:
    """An entry of the quadratic form of what is free at the ends: (0, i) and (1, i), numbers (-1, i)."""
    total = flint().arb(0)
    for end, sign in ((0, -1), (1, 1)):
        if {a[0], b[0]} <= {end, -1}:
            total += sign * Q[end][a[1]][b[1]]
    if jet is not None and stated.cost is not None:
        total += second(jet, *(_place(stated.cost, *at) for at in (a, b)))
    return total


def _place(cost: Cost, end: int, state: int) -> int | None:
    """The number of the variable of a cost that a state is at an end, a number at either."""
    ends = (end,) if end >= 0 else (0, 1)
    return next((place for e in ends if (place := cost.index(e, state)) is not None), None)


def second(jet: Jet, i: int | None, j: int | None) -> Ball:
    """The second derivative of a jet by two of its variables, zero by what is none."""
    found = flint().arb(0)
    return found if i is None or j is None else found + jet.second.get((min(i, j), max(i, j)), 0)


def _cost(prover: Prover) -> Jet | None:
    """What the ends cost over the tube, with second derivatives."""
    cost, found = prover.statement.cost, flint()
    if cost is None:
        return None
    start, end, numbers = end_values(prover.statement, prover.setting.joints)
    if prover.tube.delta < math.inf:
        n, first = prover.statement.n, prover.statement.n * prover.statement.order
        room = [found.arb(0, prover.tube.delta * float(u)) for u in prover.tube.sizes[0][: prover.statement.bare]]
        start, end = ([v + w for v, w in zip(values, room[:n], strict=True)] for values in (start, end))
        numbers = [v + w for v, w in zip(numbers, room[first:], strict=True)]
    return cost.jet(start, end, numbers, 2)


def _slopes(prover: Prover, end: int) -> list[list[Ball]]:
    """Q at the start or the end."""
    k, at = (-1, flint().arb(1)) if end else (0, flint().arb(-1))
    Q = prover.slopes[k]
    if len(Q.U) == 1:
        return [[Q.M[0][0](at) / Q.U[0][0](at)]]
    return [[poly(at) for poly in row] for row in Q.M]


def _nonnegative(matrix: list[list[Ball]]) -> bool:
    """Whether a symmetric matrix of balls is positive definite by elimination, but for rows of zeros."""
    kept = [i for i, row in enumerate(matrix) if not all(v.is_zero() for v in row)]
    work = [[matrix[i][j] for j in kept] for i in kept]
    for k, row in enumerate(work):
        if not row[k] > 0:
            return False
        for i in range(k + 1, len(work)):
            factor = work[i][k] / row[k]
            work[i] = [a - factor * b for a, b in zip(work[i], row, strict=True)]
    return True
