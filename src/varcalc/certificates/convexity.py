"""Whether a Lagrangian is convex in its slope at every point of a tube, for slopes of any size."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from varcalc.certificates.balls import Around, Ball, Box, above, below, flint
from varcalc.certificates.tube import Prover
from varcalc.symbolic.convexity import Entry, proved_convex
from varcalc.symbolic.quadratics import AlongX


def convex_in_slope(prover: Prover, boxes: Sequence[tuple[int, Box]]) -> bool:
    """Whether H - sigma f is proved convex in the controls throughout the tube.

    f are the rates of what is integrated to levels, sigma = Q w, so that it is H with other multipliers.
    """
    statement = prover.statement
    n, order, bare = statement.n, statement.order, statement.bare
    ranges = [_ranges(prover, k, box) for k, box in boxes]
    x, *rest = (_between([row[i] for row in ranges]) for i in range(1 + statement.states))
    states, lambdas = rest[:bare], rest[bare:]
    y, slopes, numbers = states[:n], states[n : n * order], states[n * order :]
    watched: list[Entry] = [None] * n
    first, second = (slopes, watched) if order == 2 else (watched, [])
    parameters: list[Entry] = [float(v) for v in statement.along.form.problem.parameter_values]
    return proved_convex(statement.function, [[x], y, first, second, parameters, numbers, lambdas, []])


def _ranges(prover: Prover, k: int, box: Box) -> list[Ball]:
    """The abscissae of a box, the states of the tube there, and the multipliers less sigma."""
    around, statement = Around(box, 1, whole=True), prover.statement
    states, _ = prover.pieces[k].lifted(around)
    room = [flint().arb(0, w) for w in (prover.tube.delta * prover.tube.sizes[0]).tolist()]
    ranges = [around.abscissa()[0], *(s[0] + w for s, w in zip(states, room[: len(states)], strict=True))]
    if statement.levels:
        _, M = prover.slopes[k].series(around)
        for row, multiplier in zip(M[statement.bare :], statement.along.lambdas, strict=True):
            ranges.append(flint().arb(float(multiplier)) - sum(q[0] * w for q, w in zip(row, room, strict=True)))
    return ranges


def _between(balls: Sequence[Ball]) -> Entry:
    return AlongX.between(np.array([below(b) for b in balls]), np.array([above(b) for b in balls]))
