"""Whether a Lagrangian is convex in its slope at every point of a tube, for slopes of any size."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from varcalc.certificates.balls import Around, Ball, Box, above, below, flint
from varcalc.certificates.curve import Piece
from varcalc.certificates.statement import Statement
from varcalc.symbolic.convexity import Entry, proved_convex
from varcalc.symbolic.quadratics import AlongX


def convex_in_slope(
    statement: Statement, pieces: Sequence[Piece], boxes: Sequence[tuple[int, Box]], widths: np.ndarray
) -> bool:
    """Whether H is proved convex in the controls while the states (m,) lie within ``widths`` of the curve's."""
    n, order = statement.n, statement.order
    ranges: list[list[Ball]] = [_ranges(pieces[k], box, widths) for k, box in boxes]
    x, *states = (_between([row[i] for row in ranges]) for i in range(1 + statement.states))
    y, slopes, numbers = states[:n], states[n : n * order], states[n * order :]
    watched: list[Entry] = [None] * n
    first, second = (slopes, watched) if order == 2 else (watched, [])
    along = statement.along
    parameters, lambdas = ([float(v) for v in row] for row in (along.form.problem.parameter_values, along.lambdas))
    return proved_convex(statement.function, [[x], y, first, second, parameters, numbers, lambdas, []])


def _ranges(piece: Piece, box: Box, widths: np.ndarray) -> list[Ball]:
    """The abscissae of a box and the states of the tube there."""
    around = Around(box, 1, whole=True)
    states, _ = piece.lifted(around)
    room = [flint().arb(0, w) for w in widths.tolist()]
    return [around.abscissa()[0], *(s[0] + w for s, w in zip(states, room, strict=True))]


def _between(balls: Sequence[Ball]) -> Entry:
    return AlongX.between(np.array([below(b) for b in balls]), np.array([above(b) for b in balls]))
