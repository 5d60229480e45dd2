"""A curve that meets prescribed integrals exactly, close to one that all but does.

To the curve a combination e_1 eta_1 + ... + e_k eta_k of bumps is added. That the integrals are met for some e in a
small box is proved by Newton's interval operator (Moore, Kearfott and Cloud, "Introduction to Interval Analysis",
SIAM 2009, sect. 8.4): it needs not be known for which.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from varcalc.certificates.balls import Around, Ball, Box, Poly, Series, above, flint, integral
from varcalc.certificates.curve import Piece, Samples
from varcalc.certificates.integrals import Along, Unproved
from varcalc.certificates.jets import Jet, Undecided, head
from varcalc.certificates.setting import Setting
from varcalc.certificates.statement import Statement
from varcalc.certificates.tube import Prover

TERMS = 14
"""Order of the Taylor forms of integrals."""
WIDER = 8.0
"""How much wider than Newton's step the box is in which the integrals are proved to be met."""
BUMPS = 4
"""Bumps of each function to choose from."""


@dataclass(frozen=True)
class Bump:
    """A polynomial in x, zero at both ends with its derivatives below ``order``, that is added to one function."""

    function: int
    degree: int
    span: tuple[float, float]
    order: int

    def values(self, x: np.ndarray) -> list[np.ndarray]:
        """The bump at x and its derivatives up to ``order``."""
        poly = np.polynomial.Chebyshev.basis(self.degree, domain=list(self.span)).convert(kind=np.polynomial.Polynomial)
        bump = poly * np.polynomial.Polynomial.fromroots(self.span) ** self.order
        return [bump.deriv(k)(x) if k else bump(x) for k in range(self.order + 1)]

    @cached_property
    def _polynomials(self) -> list[Poly]:
        """Exactly the polynomials of :meth:`values`, in balls."""
        found = flint()
        a, b = (found.arb(v) for v in self.span)
        t = found.arb_poly([-(a + b) / (b - a), 2 / (b - a)])
        shape = found.arb_poly([-a, 1]) * found.arb_poly([-b, 1])
        polys = [found.arb_poly(found.fmpz_poly.chebyshev_t(self.degree))(t) * shape**self.order]
        for _ in range(self.order):
            polys.append(polys[-1].derivative())
        return polys

    def series(self, around: Around) -> list[Series]:
        """The bump and its derivatives as series."""
        along = flint().arb_poly([around.box.x, around.box.unit])
        return [around.series(poly(along)) for poly in self._polynomials]


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
        missed = [-miss for miss in self.missed()]
        slopes = self._slopes([found.arb(0)] * count)
        steps = _solved([row[:] for row in slopes[1:]], missed)
        room = [found.arb(0, WIDER * float(abs(step).upper()) + 1e-300) for step in steps]
        slopes = self._slopes(room)
        steps = _solved([row[:] for row in slopes[1:]], missed)
        if not all(bool(abs(step) < abs(wide).upper()) for step, wide in zip(steps, room, strict=True)):
            raise Unproved("no curve near the one that was found is proved to meet the prescribed integrals")
        return steps, slopes

    def missed(self) -> list[Ball]:
        """By how much the integrals along the curve exceed what is prescribed."""
        levels = [flint().arb(c.lower) for c in self.statement.along.form.conditions.integrals]
        along = self._integrated(lambda k, around: [jet.value for jet in self._at(k, around, [], 0)[1:]])
        return [value - level for value, level in zip(along, levels, strict=True)]

    def _slopes(self, room: Sequence[Ball]) -> list[list[Ball]]:
        """Derivatives by each e of the integrals of H and of what is integrated to levels, while e lies in ``room``."""

        def series(k: int, around: Around) -> list[Series]:
            shapes = [bump.series(around) for bump in self.bumps]
            return [
                sum(jet.first.get(place, 0) * shape for place, shape in zip(self._places(bump), shapes_of, strict=True))
                for jet in self._at(k, around, list(zip(room, shapes, strict=True)), 1)
                for bump, shapes_of in zip(self.bumps, shapes, strict=True)
            ]

        flat, count = self._integrated(series), len(self.bumps)
        return [flat[i : i + count] for i in range(0, len(flat), count)]

    def _places(self, bump: Bump) -> list[int]:
        """The numbers of the function that a bump is added to and of its derivatives, among states and controls."""
        return places(self.statement, bump.function)

    def _at(self, k: int, around: Around, moved: list[tuple[Ball, list[Series]]], order: int) -> list[Jet]:
        """H and what is integrated to levels, along the moved curve."""
        piece, bare = self.pieces[k], self.statement.bare
        states, controls = piece.lifted(around)
        row = [*states, *controls]
        for bump, (e, shapes) in zip(self.bumps, moved, strict=False):
            for place, shape in zip(self._places(bump), shapes, strict=True):
                row[place] = row[place] + e * shape
        x = around.abscissa()
        own = self.statement.jet(x, row[:bare], row[bare:], order, piece.switches)
        return [own, *self.statement.level_jets(x, row[:bare], row[bare:], order)]

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


def allowed_for(setting: Setting, prover: Prover) -> Along:
    """What was found along the curve, with residuals that allow for its not meeting the prescribed integrals exactly.

    Let it miss them by e. Counted from what they are along the curve plus (x - a) e/(b - a) the states of the levels
    vanish at both ends; their rates are those of the curve plus e/(b - a), and F gains the term -w Q e/(b - a).
    """
    stated, along = setting.statement, setting.along
    if not stated.levels:
        return along
    missed = [abs(miss) / setting.length for miss in meeting(setting).missed()]
    residuals = []
    for (r, q), (k, box) in zip(along.residuals, along.boxes, strict=True):
        _, M = prover.slopes[k].series(Around(box, 1, whole=True))
        squares = flint().arb(0)
        for row, size in zip(M, setting.sizes[0].tolist(), strict=True):
            squares += sum(abs(head(v)) * e for v, e in zip(row[stated.bare :], missed, strict=True)) ** 2 * size**2
        residuals.append(((r + squares.upper().sqrt()).upper(), q))
    return replace(along, residuals=residuals)


def bumps_for(statement: Statement, samples: Sequence[Samples]) -> list[Bump]:
    """Bumps by which the prescribed integrals can be changed each by itself; Unproved where they cannot."""
    span = float(samples[0].x[0]), float(samples[-1].x[-1])
    offered = [Bump(i, degree, span, statement.order) for degree in range(BUMPS) for i in range(statement.n)]
    effects = np.zeros((statement.levels, len(offered)))
    for s in samples:
        for b, bump in enumerate(offered):
            shapes = zip(places(statement, bump.function), bump.values(s.x), strict=True)
            rates = sum(s.turning[:, :, place] * shape[:, None] for place, shape in shapes)
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


def places(statement: Statement, function: int) -> list[int]:
    """The numbers of a function and of its derivatives, among states without levels and controls."""
    n = statement.n
    return [*(function + k * n for k in range(statement.order)), statement.bare + function]


def _solved(matrix: list[list[Ball]], right: list[Ball]) -> list[Ball]:
    """Gauss elimination in balls; Unproved where a pivot may vanish."""
    found = flint()
    try:
        solution = found.arb_mat(matrix).solve(found.arb_mat([[v] for v in right]))
    except ZeroDivisionError:
        raise Unproved("the prescribed integrals are not proved to change independently near the curve") from None
    return [solution[i, 0] for i in range(len(right))]
