"""Minima of L that is linear in the slope but for kinks, as where total variation is weighed against a fit to data.

The curve moves where its equation puts it, and rests on lines in between. Where a line is kept to, the momentum is no
more than the kink takes, and where the curve moves its slope is one of its piece of L: then it is an extremal (Euler
and Lagrange's inclusion; Clarke, "Optimization and Nonsmooth Analysis", 1983, sect. 4.4).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import casadi as ca
import numpy as np

from varcalc.existence.held_throughout import answer_along
from varcalc.existence.least_paths import Chain, LeastPath, drawn_finely, least_path
from varcalc.existence.linear_between import LinearBetweenKinks, linear_between_kinks
from varcalc.existence.on_level import least_on_level, level_let_go, level_of
from varcalc.existence.placed_lines import BEYOND_KINK, PLACES_OF_CHANGE, SHORTEST_LINE, OnLines, settled
from varcalc.methods.ritz.method import Ritz
from varcalc.numerics.mesh import CurveOrSlope, composite_gauss
from varcalc.numerics.resampled import resampled
from varcalc.problem.convexity import proved_jointly_convex
from varcalc.problem.problem import Problem
from varcalc.solution import Finding, Solution, refusal
from varcalc.symbolic.evaluation import PointEvaluator

MET_TO = 1e-9
"""How nearly curves and lines are to meet, and what L changes by beside a kink to be told."""
SLOPE_BEYOND = 1e-6
"""By how much, relatively, a slope may be beyond those of its piece."""
ROUNDS_OF_LINES = 4
"""Times that lines are looked for which the path goes past."""
PIECES_SUMMED, POINTS_SUMMED = 8, 12
"""Pieces of a stretch, and Gauss points on each, by which rates are summed."""


def least_by_lines(problem: Problem, method: Ritz) -> Solution | None:
    """The least curve where L is linear in the slope but for kinks; None for others, and where none is shown to be.

    It may have to keep one level.
    """
    if not problem.constraints:
        found = _least(problem, method)
    elif level_of(problem) is None or linear_between_kinks(level_let_go(problem, 0.0)) is None:
        return None
    else:
        found = least_on_level(problem, lambda free: _least(free, method))
    return refusal(problem, method, found) if isinstance(found, Finding) else found


def _least(problem: Problem, method: Ritz) -> Solution | Finding | None:
    """The same without a level, or that the best curve jumps."""
    kinks = linear_between_kinks(problem)
    # of several kinks the path is known near one that others led to, and not the least of all
    if kinks is None or (len(kinks.slopes) > 1 and not proved_jointly_convex(problem)):
        return None
    with np.errstate(all="ignore"):
        path = least_path(kinks)
        if path is None:
            return None
        if (jump := path.jump()) is not None:
            return jump
        finely = drawn_finely(path)
        return None if finely is None else _near(kinks, finely, method)


def _near(kinks: LinearBetweenKinks, path: LeastPath, method: Ritz) -> Solution | None:
    """The minimum near a path, with its value; None where there is no extremal that keeps to lines as the path does."""
    places, seen = OnLines(kinks, path), path.chains()
    chains, curve = list[Chain](), None
    for _ in range(ROUNDS_OF_LINES):
        together = settled(places, [*chains, *seen])
        if together is None:
            return None
        chains, curve = together, _CurveOnLines(places, together, path.piece_alone())
        # the path goes past lines that are shorter than its pieces
        seen = list(curve.passed_by())
        if not seen:
            break
    if curve is None or not (curve.joined and curve.moves_rightly and all(map(places.holds, chains))):
        return None
    edges = np.unique([*curve.edges, *curve.marks])
    own = resampled(curve, edges, 2)
    return answer_along(kinks.problem, method, own, edges, rates=curve.rates(own))


@dataclass(frozen=True)
class _OfCurve:
    """Between two abscissae: a line of a ``kink``, or where the curve moves on a ``piece``."""

    start: float
    end: float
    ordinate: float = 0.0
    kink: int | None = None
    piece: int = 0


class _CurveOnLines:
    """The curve along chains and between them, where it moves; without any it moves on the piece ``alone``."""

    def __init__(self, places: OnLines, chains: Sequence[Chain], alone: int) -> None:
        self.places, self.chains = places, chains
        first, last = places.span
        lines = sorted(self._lines(), key=lambda stretch: stretch.start)
        stretches, at = list[_OfCurve](), first
        for line in lines:
            if line.start - at > SHORTEST_LINE * (last - first):
                stretches.append(_OfCurve(at, line.start, piece=self._piece_at(line.start, 0)))
            stretches.append(line)
            at = line.end
        if last - at > SHORTEST_LINE * (last - first):
            stretches.append(_OfCurve(at, last, piece=self._piece_at(at, 1) if lines else alone))
        self.stretches = stretches
        self.edges = np.array([first, *(stretch.end for stretch in stretches)])

    def _lines(self) -> Iterator[_OfCurve]:
        """The lines within the interval, one that goes on past the seam of a closed curve in two."""
        first, last = self.places.span
        for chain in self.chains:
            y = self.places.ordinates(chain)
            for kink, (a, b), at in zip(chain.kinks, pairwise(chain.corners), y, strict=False):
                slope, edge = self.places.kinks.slopes[kink], first if a < first < b else last
                if a < edge < b:
                    yield _OfCurve(first, b if edge == first else b - last + first, at + slope * (edge - a), kink)
                    yield _OfCurve(a + last - first if edge == first else a, last, at, kink)
                else:
                    by = last - first if b <= first else first - last if a >= last else 0.0
                    yield _OfCurve(a + by, b + by, at, kink)

    def _piece_at(self, x: float, side: int) -> int:
        """The piece on which the curve comes to the chain that begins at x, or leaves the one that ends there."""
        width = self.places.span[1] - self.places.span[0]
        ends = [(abs((c.corners[-side] - x + 0.5 * width) % width - 0.5 * width), c.sides[side]) for c in self.chains]
        piece = min(ends, key=lambda end: end[0])[1]
        return -1 if piece is None else piece

    def __call__(self, x: np.ndarray, derivative: int) -> np.ndarray:
        """Ordinates (1, m) at x (m,), or slopes."""
        number = np.clip(np.searchsorted(self.edges, x, side="right") - 1, 0, len(self.stretches) - 1)
        out = np.empty(len(x))
        for k in np.unique(number).tolist():
            at = number == k
            out[at] = self._along(self.stretches[k], x[at], derivative)
        return out[None]

    def _along(self, stretch: _OfCurve, x: np.ndarray, derivative: int) -> np.ndarray:
        if stretch.kink is not None:
            slope = float(self.places.kinks.slopes[stretch.kink])
            return np.full(len(x), slope) if derivative else stretch.ordinate + slope * (x - stretch.start)
        y = self.places.moving(stretch.piece, x, self.places.near(x))
        return self.places.slopes(stretch.piece, x, y) if derivative else y

    @cached_property
    def marks(self) -> list[float]:
        """Abscissae within stretches at which the curve, or L along it, is less smooth."""
        return [
            x for s in self.stretches for x in self.places.changes(lambda x, s=s: self._along(s, x, 0), s.start, s.end)
        ]

    @property
    def joined(self) -> bool:
        """Whether each stretch begins where the one before ends, and the curve has the ends that it should have."""
        first, last, places = *self.places.span, self.places
        ends = np.array([
            [self._along(s, np.array([x]), 0)[0] for x in (s.start, s.end)] for s in self.stretches
        ])  # fmt: skip
        missed = [ends[1:, 0] - ends[:-1, 1]]
        if places.problem.start.periodic:
            missed.append(ends[:1, 0] - ends[-1:, 1])
        for given, end, y in zip(places.given, (places.problem.start, places.problem.end), ends.ravel()[[0, -1]],
                                 strict=True):  # fmt: skip
            missed.append(np.array([y - end.values(1)[0]] if given else []))
        whole = abs(self.edges[0] - first) + abs(self.edges[-1] - last) <= MET_TO * (last - first)
        return whole and bool((np.abs(np.concatenate(missed)) <= MET_TO * places.size).all())

    @property
    def moves_rightly(self) -> bool:
        """Whether slopes are those of the pieces on which the curve moves, and free ends ask for no more."""
        kinks, (first, last) = self.places.kinks, self.places.span
        for stretch in self._moving:
            x = np.linspace(stretch.start, stretch.end, PLACES_OF_CHANGE)
            if stretch.piece < 0 or self._beyond_slopes(stretch, x[1:-1]).any():
                return False
            for free, end, at in zip(self.places.free, (first, last), (0, -1), strict=True):
                momenta = kinks.beside(x[[at]], self._along(stretch, x[[at]], 0)).momenta[:, 0]
                if free and x[at] == end and abs(momenta[stretch.piece]) > BEYOND_KINK * np.ptp(momenta):
                    return False
        return True

    @property
    def _moving(self) -> list[_OfCurve]:
        return [stretch for stretch in self.stretches if stretch.kink is None]

    def _beyond_slopes(self, stretch: _OfCurve, x: np.ndarray) -> np.ndarray:
        """1 where the slope at x (m,) is greater than those of the piece, -1 where it is less, and 0 elsewhere."""
        slopes = np.array([-np.inf, *self.places.kinks.slopes, np.inf])
        v = self._along(stretch, x, 1)
        room = SLOPE_BEYOND * np.abs(v).max(initial=0.0)
        return 1 * ~(v <= slopes[stretch.piece + 1] + room) - 1 * ~(v >= slopes[stretch.piece] - room)

    def passed_by(self) -> Iterator[Chain]:
        """Lines on which it would be where its slope is none of its piece, or it has not the ends that it should."""
        (first, last), places = self.places.span, self.places
        for s in self._moving:
            if s.piece < 0:
                continue
            x = np.linspace(s.start, s.end, PLACES_OF_CHANGE)
            y, beyond = self._along(s, x, 0), self._beyond_slopes(s, x)
            for given, end, at, way in zip(
                places.given, (places.problem.start, places.problem.end), (0, -1), (1, -1), strict=True
            ):
                off = end.values(1)[0] - y[at]
                if not given or x[at] != (first, last)[at] or abs(off) <= MET_TO * places.size:
                    continue
                # the line is the flatter one where the curve is to come up to it
                kink, slope = s.piece - int(off * way > 0), self._along(s, x[[at]], 1)[0]
                if 0 <= kink < len(places.kinks.slopes):
                    long = way * min(abs(2 * off / (slope - places.kinks.slopes[kink])), s.end - s.start)
                    yield self._line(s, kink, x[at], x[at] + long, end.values(1)[0])
                    beyond[at] = 0
            edges = np.flatnonzero(np.diff(beyond)) + 1
            for run in np.split(np.arange(len(x)), edges):
                side = int(beyond[run[0]])
                if side:
                    longer = 0.5 * (x[run[-1]] - x[run[0]]) + (x[1] - x[0])
                    start, end = max(x[run[0]] - longer, s.start), min(x[run[-1]] + longer, s.end)
                    yield self._line(s, s.piece if side > 0 else s.piece - 1, start, end, float(y[run].mean()))

    def _line(self, stretch: _OfCurve, kink: int, start: float, end: float, ordinate: float) -> Chain:
        """A line from one place of where the curve moves to another."""
        low, high = sorted((float(start), float(end)))
        at_end = [x == edge for x, edge in zip((low, high), self.places.span, strict=True)]
        sides = [None if at and not self.places.problem.start.periodic else stretch.piece for at in at_end]
        return Chain((low, high), float(ordinate), (kink,), (sides[0], sides[1]))

    def rates(self, curve: CurveOrSlope) -> dict[str, float]:
        """dJ/dparameter, what L changes by along the curve; NaN where that differs beside a kink that then moves."""
        problem, kinks = self.places.problem, self.places.kinks
        s, names = problem.symbols, list(problem.parameters)
        if not names:
            return {}
        gradients = [ca.gradient(piece, s.parameters) for piece in kinks.pieces]
        rates = PointEvaluator(
            ca.Function("rates", [s.x, s.y, s.dy, s.parameters], [ca.densify(ca.horzcat(*gradients))])
        )
        edges, total = np.unique([*self.edges, *self.marks]), np.zeros(len(names))
        for start, end in pairwise(edges):
            stretch = self.stretches[int(np.searchsorted(self.edges, 0.5 * (start + end))) - 1]
            x, weights = composite_gauss(np.linspace(start, end, PIECES_SUMMED + 1), POINTS_SUMMED)
            y, v = curve(x, 0)[0], curve(x, 1)[0]
            on = (self.places.sides(x, y) == 0.0).any()
            columns = rates(len(x), x[:, None], y[:, None], v[:, None], problem.parameter_values[None])
            by_piece = columns.reshape(len(x), len(kinks.pieces), len(names))
            beside = [stretch.piece] if stretch.kink is None else [stretch.kink, stretch.kink + 1]
            each = np.array([weights @ by_piece[:, piece] for piece in beside])
            sizes = np.abs(by_piece).max(axis=(0, 1)) * (end - start)
            told = (np.ptp(each, axis=0) <= MET_TO * sizes) & ~on
            total += np.where(told, each[0], np.nan)
        return dict(zip(names, (problem.sign * total).tolist(), strict=True))
