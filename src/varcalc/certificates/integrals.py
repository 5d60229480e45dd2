"""The functional on the curve, and how far the curve is from stationary, both in balls."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import casadi as ca
import numpy as np

from varcalc.certificates.balls import Around, Ball, Box, Series, coefficient, enclosed, flint, integral, largest
from varcalc.certificates.curve import Piece
from varcalc.certificates.field import dynamics
from varcalc.certificates.jets import without_enclosure
from varcalc.certificates.smooth import Undecided, head
from varcalc.certificates.statement import Statement

INTEGRAL_ORDER = 20
"""Order of the Taylor forms of integrals."""
MOST_TRIED, MOST_ALONG = 600, 3000
"""Boxes tried after which no proof is looked for: of a part of the curve, and of all of it while they lead on."""
SLIVER = 2.0**-48
"""Length of a box, relative to where it lies, up to which H may switch anywhere in it: it is taken on either side."""
FALLS, AIM = 30.0, 1e-2
"""The power of a box's length that remainders fall with, more than that of their order as balls are narrower; what a
remainder is to be of what is allowed."""
MOST_GROWTH, LEAST_SHRINKING, MOST_SHRINKING = 2.0, 0.7, 1.0 / 12.0
"""How much longer the next box may be, and how much shorter it is after one that fails."""
ROUGH_RESIDUALS = 1e6
"""What a residual's remainder may come to anyway, in units of the value's: then it is about 1e-13 of the value."""
SHORT_ENOUGH = 2.0**-4
"""Share of a piece from which on boxes are not cut for the sake of residuals: round-off has been left behind."""


class Unproved(Exception):
    """An inequality that a certificate needs is not proved; the message says which, and where."""


def check_enclosed(function: ca.Function, of: str) -> None:
    """Unproved where a function ``of`` something holds an operation that no enclosure is known of."""
    if strange := without_enclosure(function):
        raise Unproved(f"{of} holds {strange}, of which no enclosure is known")


@dataclass(frozen=True)
class Along:
    """What was found along the curve, box by box.

    ``value`` is the integral of H on the curve. ``residuals[b]`` bounds |r| and |q| on box b, in units of the states
    and controls: r = H_z - p' - A^T p and q = H_u - B^T p. ``boxes`` are pairs of a piece's number and a box.
    """

    value: Ball
    residuals: list[tuple[Ball, Ball]]
    boxes: list[tuple[int, Box]]


def along_curve(
    statement: Statement, pieces: Sequence[Piece], sizes: tuple[np.ndarray, np.ndarray], tolerance: float
) -> Along:
    """Integrate H and bound the residuals; each remainder is held below its share of ``tolerance``.

    Residuals that are bounded by their remainders are bounded on shorter boxes: on long ones round-off in the last
    coefficients of a curve grows with the power that the remainder is of.

    Raises Unproved where H cannot be enclosed.
    """
    length = float((pieces[-1].centre + pieces[-1].half - pieces[0].centre + pieces[0].half).mid())
    allowed = 2.0 * tolerance / length
    value, residuals, boxes, tried, done = flint().arb(0), [], [], 0, 0.0
    for k, piece in enumerate(pieces):
        waiting, step = [piece.box()], 1.0
        sliver = float(((abs(piece.centre) + piece.half) / piece.half).mid()) * SLIVER
        while waiting:
            first = waiting.pop()
            box, after = first.cut(step)
            tried += 1
            found, reason = _enclosed(statement, piece, box, sizes, allowed, sliver)
            if found is not None and found[2] <= 1.0:
                value += found[0]
                residuals.append(found[1])
                boxes.append((k, box))
                done += 2.0 * float(box.unit) / length
                waiting += [] if after is None else [after]
            elif tried > max(MOST_TRIED, done * MOST_ALONG) or box.narrow:
                raise Unproved(f"the Lagrangian is not enclosed near {box.at:.6g}: {reason}")
            else:
                apart = found is None and first.width == 1
                waiting += reversed(first.ends_apart(sliver)) if apart else [first]
            step = 1.0 if box.width <= sliver else float(box.width) * _longer(math.inf if found is None else found[2])
    return Along(value, residuals, boxes)


OnBox: TypeAlias = tuple[Ball, tuple[Ball, Ball], float]
"""The integral of H over a box; bounds of |r| and |q|; and how many times too large remainders are."""


def _enclosed(
    statement: Statement,
    piece: Piece,
    box: Box,
    sizes: tuple[np.ndarray, np.ndarray],
    allowed: float,
    sliver: float,
) -> tuple[OnBox | None, str]:
    """What is found on a box; None, and the reason, where H is not enclosed. On a sliver H may switch."""
    try:
        return _on_box(statement, piece, box, sizes, allowed), "it is too rough there"
    except Undecided as undecided:
        reason = str(undecided)
    try:
        return (_across(statement, piece, box, sizes) if box.width <= sliver else None), reason
    except Undecided as undecided:
        return None, str(undecided)


def _longer(excess: float) -> float:
    """How much longer than a box with that excess of its remainders the next one should be."""
    most = MOST_GROWTH if excess <= 1.0 else LEAST_SHRINKING
    return min(most, max(MOST_SHRINKING, (AIM / max(excess, 1e-300)) ** (1.0 / FALLS)))


def _on_box(
    statement: Statement, piece: Piece, box: Box, sizes: tuple[np.ndarray, np.ndarray], allowed: float
) -> OnBox:
    views = [_terms(statement, piece, Around(box, INTEGRAL_ORDER + whole, whole)) for whole in (False, True)]
    (L, r, q), (L_, r_, q_) = views
    main, rest = integral(L, L_, INTEGRAL_ORDER)
    if not (main.is_finite() and rest.is_finite()):
        raise Undecided("it is not a number throughout")
    bounds, excess = [], float(abs(rest).upper()) / allowed
    for centred, whole, unit in ((r, r_, sizes[0]), (q, q_, sizes[1])):
        squares, remainder = flint().arb(0), flint().arb(0)
        for c, w, size in zip(centred, whole, unit[: len(centred)].tolist(), strict=True):
            squares += (abs(enclosed(c, w, INTEGRAL_ORDER - 1)).upper() * size) ** 2
            remainder = largest([remainder, coefficient(w, INTEGRAL_ORDER - 1) * size])
        bounds.append(squares.sqrt().upper())
        if not bounds[-1].is_finite():
            raise Undecided("its derivatives are no numbers throughout")
        if not box.width <= SHORT_ENOUGH and not 2 * remainder <= bounds[-1]:
            excess = max(excess, float(remainder.upper()) / (ROUGH_RESIDUALS * allowed))
    return (main + rest) * box.unit, (bounds[0], bounds[1]), excess


def _across(statement: Statement, piece: Piece, box: Box, sizes: tuple[np.ndarray, np.ndarray]) -> OnBox:
    """The same of all that H is on either side of what it switches on."""
    L, r, q = map(_heads, _terms(statement, piece, Around(box, 2, True), crossing=True))
    bounds = []
    for rows, unit in ((r, sizes[0]), (q, sizes[1])):
        squares = flint().arb(0)
        for v, size in zip(rows, unit[: len(rows)].tolist(), strict=True):
            squares += (abs(v).upper() * size) ** 2
        bounds.append(squares.sqrt().upper())
    if not all(v.is_finite() for v in (*L, *bounds)):
        raise Undecided("it is not a number throughout")
    return 2 * L[0] * box.unit, (bounds[0], bounds[1]), 0.0


def _heads(terms: Series | list[Series]) -> list[Ball]:
    return [flint().arb(0) + head(v) for v in (terms if isinstance(terms, list) else [terms])]


def _terms(
    statement: Statement, piece: Piece, around: Around, *, crossing: bool = False
) -> tuple[Series, list[Series], list[Series]]:
    """H, and the residuals r and q, as series; as numbers where H may be ``crossing`` what it switches on."""
    states, controls = piece.lifted(around)
    x = around.abscissa()
    if crossing:
        x, states, controls = x[0], list(map(head, states)), list(map(head, controls))
    jet = statement.jet(x, states, controls, 1, piece.switches, crossing=crossing)
    p = [around.series(around.box.local(m)) for m in piece.momenta]
    A, B = dynamics(statement.n, statement.order, statement.bare)
    m = statement.bare
    r = []
    for i in range(m):
        total = jet.first.get(i, 0) - around.slope(p[i])
        for j in np.flatnonzero(A[:, i]):
            total = total - p[j]
        r.append(total)
    q = [jet.first.get(m + i, 0) - p[int(np.flatnonzero(B[:, i])[0])] for i in range(statement.n)]
    return jet.value, r, q


def total(along: Along, kappa: float, mu: float) -> Ball:
    """The integral of |r|^2/(2 kappa) + |q|^2/(2 mu): how far below the curve's value the infimum may lie."""
    found = flint()
    energy = found.arb(0)
    for (r, q), (_, box) in zip(along.residuals, along.boxes, strict=True):
        energy += 2 * box.unit * (r * r / (2 * found.arb(kappa)) + q * q / (2 * found.arb(mu)))
    return energy.upper()


def worst(along: Along) -> tuple[Ball, Ball]:
    """The largest |r| and |q|."""
    return largest([r for r, _ in along.residuals]), largest([q for _, q in along.residuals])
