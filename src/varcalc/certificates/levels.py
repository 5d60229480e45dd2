"""A curve that meets prescribed integrals exactly, close to one that all but does.

To the curve a combination e_1 eta_1 + ... + e_k eta_k of bumps is added. That the integrals are met for some e in a
small box is proved by Newton's interval operator (Moore, Kearfott and Cloud, "Introduction to Interval Analysis",
SIAM 2009, sect. 8.4): it needs not be known for which.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from varcalc.certificates.balls import Around, Ball, Box, Poly, Series, above, flint, integral
from varcalc.certificates.curve import Piece, Samples
from varcalc.certificates.integrals import Unproved
from varcalc.certificates.jets import Jet, Undecided
from varcalc.certificates.setting import Setting
from varcalc.certificates.statement import Statement

TERMS = 14
"""Order of the Taylor forms of integrals."""
WIDER = 8.0
"""How much wider than Newton's step the box is in which the integrals are proved to be met."""
BUMPS = 4
"""Bumps of each function to choose from."""


@dataclass(frozen=True)
class Bump:
    """A polynomial in x, zero at both ends, that is added to one function."""

    function: int
    degree: int
    span: tuple[float, float]

    def values(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The bump and its slope at x."""
        poly = np.polynomial.Chebyshev.basis(self.degree, domain=list(self.span))
        shape = np.polynomial.Polynomial.fromroots(self.span)
        return poly(x) * shape(x), poly.deriv()(x) * shape(x) + poly(x) * shape.deriv()(x)

    def series(self, around: Around) -> tuple[Series, Series]:
        """The bump and its slope as series, exactly the polynomial of :meth:`values`."""
        found = flint()
        a, b = (found.arb(v) for v in self.span)
        x = around.abscissa()
        t = (2 * x - (a + b)) / (b - a)
        poly = found.arb_poly(found.fmpz_poly.chebyshev_t(self.degree))
        shape = (x - a) * (x - b)
        value, slope = _evaluated(poly, t), _evaluated(poly.derivative(), t) * 2 / (b - a)
        return value * shape, slope * shape + value * (2 * x - (a + b))


def _evaluated(poly: Poly, t: Series) -> Series:
    total = 0 * t
    for c in reversed(poly.coeffs()):
        total = total * t + c
    return total


@dataclass(frozen=True)
class Meeting:
    """The integrals along the curves about the given one, by the bumps that are added."""

    statement: Statement
    pieces: Sequence[Piece]
    boxes: Sequence[tuple[int, Box]]
    bumps: Sequence[Bump]

    def correction(self) -> Ball:
        """What the integral of H changes by from the curve to one near it that meets every level; Unproved if none."""
        steps, slopes = self._steps()
        return sum((step * slope for step, slope in zip(steps, slopes[0], strict=True)), flint().arb(0))

    def reach(self) -> float:
        """How much of each bump is added at most."""
        return max(above(abs(step)) for step in self._steps()[0])

    def _steps(self) -> tuple[list[Ball], list[list[Ball]]]:
        """What is added of each bump, and :meth:`_slopes` for that."""
        found = flint()
        count = self.statement.levels
        missed = [-self._missed(j) for j in range(count)]
        slopes = self._slopes([found.arb(0)] * count)
        steps = _solved([row[:] for row in slopes[1:]], missed)
        room = [found.arb(0, WIDER * float(abs(step).upper()) + 1e-300) for step in steps]
        slopes = self._slopes(room)
        steps = _solved([row[:] for row in slopes[1:]], missed)
        if not all(bool(abs(step) < abs(wide).upper()) for step, wide in zip(steps, room, strict=True)):
            raise Unproved("no curve near the one that was found is proved to meet the prescribed integrals")
        return steps, slopes

    def _missed(self, j: int) -> Ball:
        level = flint().arb(self.statement.along.form.conditions.integrals[j].lower)
        return self._integrated(lambda k, around: [self._at(k, around, [], 0)[1 + j].value])[0] - level

    def _slopes(self, room: Sequence[Ball]) -> list[list[Ball]]:
        """Derivatives by each e of the integrals of H and of what is integrated to levels, while e lies in ``room``."""

        def series(k: int, around: Around) -> list[Series]:
            shapes = [bump.series(around) for bump in self.bumps]
            bare = self.statement.bare
            found = []
            for jet in self._at(k, around, list(zip(room, shapes, strict=True)), 1):
                for bump, (value, slope) in zip(self.bumps, shapes, strict=True):
                    i = bump.function
                    found.append(jet.first.get(i, 0) * value + jet.first.get(bare + i, 0) * slope)
            return found

        flat, count = self._integrated(series), len(self.bumps)
        return [flat[i : i + count] for i in range(0, len(flat), count)]

    def _at(self, k: int, around: Around, moved: list[tuple[Ball, tuple[Series, Series]]], order: int) -> list[Jet]:
        """H and what is integrated to levels, along the moved curve."""
        piece = self.pieces[k]
        states, controls = piece.lifted(around)
        for bump, (e, (value, slope)) in zip(self.bumps, moved, strict=False):
            i = bump.function
            states[i], controls[i] = states[i] + e * value, controls[i] + e * slope
        x = around.abscissa()
        own = self.statement.jet(x, states, controls, order, piece.switches)
        return [own, *self.statement.level_jets(x, states, controls, order)]

    def _integrated(self, series: Callable[[int, Around], list[Series]]) -> list[Ball]:
        """Integrals over all boxes."""
        totals: list[Ball] = []
        for k, box in self.boxes:
            try:
                views = [series(k, Around(box, TERMS + whole, whole)) for whole in (False, True)]
            except Undecided as undecided:
                raise Unproved(f"a prescribed integral is not enclosed near {box.at:.6g}: {undecided}") from None
            parts = [sum(integral(c, w, TERMS)) * box.unit for c, w in zip(*views, strict=True)]
            totals = [a + b for a, b in zip(totals, parts, strict=True)] if totals else parts
        return totals


def meeting(setting: Setting) -> Meeting:
    """The integrals about the curve of a setting."""
    stated = setting.statement
    return Meeting(stated, setting.pieces, setting.along.boxes, bumps_for(stated, setting.samples))


def bumps_for(statement: Statement, samples: Sequence[Samples]) -> list[Bump]:
    """Bumps by which the prescribed integrals can be changed each by itself; Unproved where they cannot."""
    span = float(samples[0].x[0]), float(samples[-1].x[-1])
    offered = [Bump(i, degree, span) for degree in range(BUMPS) for i in range(statement.n)]
    bare = statement.bare
    effects = np.zeros((statement.levels, len(offered)))
    for s in samples:
        for b, bump in enumerate(offered):
            value, slope = bump.values(s.x)
            rates = (
                s.turning[:, :, bump.function] * value[:, None] + s.turning[:, :, bare + bump.function] * slope[:, None]
            )
            effects[:, b] += np.trapezoid(rates, s.x, axis=0)
    chosen: list[int] = []
    rest = effects.copy()
    for _ in range(statement.levels):
        best = int(np.linalg.norm(rest, axis=0).argmax())
        size = float(np.linalg.norm(rest[:, best]))
        if not size > 0:
            raise Unproved("the prescribed integrals cannot be changed independently near the curve")
        chosen.append(best)
        direction = rest[:, best] / size
        rest = rest - np.outer(direction, direction @ rest)
    return [offered[b] for b in chosen]


def _solved(matrix: list[list[Ball]], right: list[Ball]) -> list[Ball]:
    """Gauss elimination in balls; Unproved where a pivot may vanish."""
    found = flint()
    try:
        solution = found.arb_mat(matrix).solve(found.arb_mat([[v] for v in right]))
    except ZeroDivisionError:
        raise Unproved("the prescribed integrals are not proved to change independently near the curve") from None
    return [solution[i, 0] for i in range(len(right))]
