"""Curves that run beside jumps: on which side, and along which stretches a slope at which L jumps is kept."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from varcalc.methods.crossings import ARGUMENT_ROUND_OFF, Crossing, switch_arguments
from varcalc.numerics.mesh import CurveOrSlope
from varcalc.problem.breaks import on_curve
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Problem
from varcalc.solution import Solution

SAME_PLACE = 1e-9
"""Share of the interval by which two crossings at one place may differ."""
BESIDE_JUMP, FURTHER_ASIDE = 1e-3, 10.0
"""Distance from a jump, in units of what counts as on it, at which a curve runs that would run along it; and by what
factor it grows where the curve strays across all the same."""
BESIDE_SLOPE = 1e-12
"""Argument of what jumps at a slope beside which that is kept."""
PLACES_OF_PIECE = 33
"""Places of a piece at which it is seen whether it runs along a jump."""


class Pieces(NamedTuple):
    """The ends of pieces, as they began and as they have been placed; (pieces + 1,) each."""

    began: np.ndarray
    edges: np.ndarray


def pieces_of(problem: Problem, found: list[Crossing], bent: Sequence[float], edges: np.ndarray) -> Pieces | None:
    """The pieces of a curve that was broken at crossings and corners, and has its ``edges``; None for more of these."""
    ends = {e for c in found for e in (c.x, c.x if c.until is None else c.until)}
    began = np.array(sorted({*problem.span, *bent, *ends}))
    return Pieces(began, edges) if len(edges) == len(began) else None


def aside(
    problem: Problem, curve: CurveOrSlope, found: list[Crossing], solution: Solution, pieces: Pieces | None
) -> list[Crossing]:
    """The crossings, those of a jump along which the solution runs moved to the side on which ``curve`` runs.

    On the jump itself round-off decides which side's L a curve is held against.
    """
    assert solution.curve is not None
    if pieces is None:
        return found
    began, numbers = pieces.began, problem.unknown_guesses
    ways = [np.linspace(a, b, PLACES_OF_PIECE) for a, b in pairwise(pieces.edges)]
    along = [switch_arguments(problem, solution.curve, way, numbers) for way in ways]
    middles = switch_arguments(problem, curve, 0.5 * (began[1:] + began[:-1]), numbers)
    moved = list(found)
    for k, c in enumerate(found):
        number = number_of(problem, c)
        small = ARGUMENT_ROUND_OFF * max(float(np.abs(piece[number]).max()) for piece in along)
        after = int(np.searchsorted(began, c.x))
        for piece in (after - 1, after) if c.until is None else (after,):
            # at a corner a slope is that of one side
            if c.switch.jumps and np.abs(along[piece][number][1:-1] - c.level).max() <= small:
                jump = round(c.level)
                away = max(BESIDE_JUMP * small, FURTHER_ASIDE * abs(c.level - jump))
                side = float(np.sign(c.level - jump) or np.sign(middles[number, piece] - jump))
                moved[k] = replace(c, level=jump + away * side)
    return moved


def number_of(problem: Functional, crossing: Crossing) -> int:
    """The number of a crossing's switch among those of ``on_curve``."""
    return next(i for i, switch in enumerate(on_curve(problem)) if switch.argument is crossing.switch.argument)


def go_through(problem: Problem, pieces: Pieces | None, seen: list[Crossing]) -> list[Crossing]:
    """The crossings at which a curve goes within a piece through a slope at which L jumps.

    L is that of one side in all of the piece: beyond the jump the curve has it for nothing.
    """
    if pieces is None:
        return []
    within = SAME_PLACE * (problem.span[1] - problem.span[0])
    inside = [c for c in seen if c.until is None and float(np.abs(pieces.edges - c.x).min()) > within]
    return [c for c in inside if c.switch.jumps and c.switch.depends_on(problem.symbols.highest)]


def keeping_slopes(
    problem: Problem, curve: CurveOrSlope, solution: Solution, pieces: Pieces | None, seen: list[Crossing]
) -> list[Crossing]:
    """The crossings, with a slope at which L jumps kept, beside it, where the solution goes through that.

    The stretch is the part of the piece that lies beyond; what is kept already stays on its side.
    """
    assert solution.curve is not None
    if pieces is None:
        return seen
    through, edges, numbers = go_through(problem, pieces, seen), pieces.edges, problem.unknown_guesses
    kept: list[Crossing] = []
    for c in seen:
        number, jump = number_of(problem, c), round(c.level)
        if c.until is not None and c.switch.jumps:
            middle = np.array([0.5 * (c.x + c.until)])
            side = np.sign(switch_arguments(problem, solution.curve, middle, numbers)[number, 0] - jump)
            kept.append(replace(c, level=jump + float(side) * BESIDE_SLOPE))
        elif any(c is other for other in through):
            piece = int(np.searchsorted(edges, c.x)) - 1
            middle = 0.5 * (pieces.began[[piece]] + pieces.began[piece + 1])
            side = np.sign(switch_arguments(problem, curve, middle, numbers)[number, 0] - jump)
            ways = [(float(edges[piece]), c.x), (c.x, float(edges[piece + 1]))]
            there = switch_arguments(problem, solution.curve, np.array([0.5 * sum(way) for way in ways]), numbers)
            beyond = [way for way, at in zip(ways, there[number] - jump, strict=True) if np.sign(at) != side]
            kept += [Crossing(c.switch, first, jump + float(side) * BESIDE_SLOPE, last) for first, last in beyond]
        else:
            kept.append(c)
    return kept


def bent_anew(problem: Problem, bent: Sequence[float], pieces: Pieces | None, seen: list[Crossing]) -> Sequence[float]:
    """Where corners have come to lie: where something is crossed, or left, at that very place."""
    if pieces is None:
        return bent
    within = SAME_PLACE * (problem.span[1] - problem.span[0])
    ends = np.array([e for c in seen for e in (c.x, c.x if c.until is None else c.until)] or [math.inf])
    placed = [float(pieces.edges[np.searchsorted(pieces.began, x)]) for x in bent]
    nearest = [float(ends[np.argmin(np.abs(ends - x))]) for x in placed]
    return [end if abs(end - x) <= within else x for x, end in zip(placed, nearest, strict=True)]
