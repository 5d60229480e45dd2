"""A lower bound by convexity alone: it serves where L does not bend, as |v|, or stops bending, as |v|^p and x^k v^2.

Let H = sum f_j + R, each f_j a convex function of x and one slope, R jointly convex and smooth along the curve y0. Let
momenta be p' = R_y along it, exactly, and vanish with what the ends that are free cost. By the lines of support of R

    J[y] - J[y0] >= integral of sum phi_j(v_j) - phi_j(v0_j),   phi_j(v) = f_j(x, v) - s_j v,   s_j = p_j - R_(v_j),

for all curves: that is Fenchel's inequality for the momenta p (Rockafellar, "Conjugate convex functionals in optimal
control and the calculus of variations", J. Math. Anal. Appl. 32 (1970) 174; Ekeland and Temam, "Convex Analysis and
Variational Problems", ch. III). What phi_j is less elsewhere than along the curve is bounded by three of its values,
see :mod:`three_values`. Slopes may be bounded.

Of f_j no more is asked than that phi_j is bounded so: a polynomial of one slope need not be convex, see :mod:`wells`.

Where both ends are free p needs a constant more, r in p' = R_y + r, and the terms of one function alone are dealt with
like those of one slope.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from varcalc.certificates.balls import Ball, Box, above, coefficient, flint, nodes
from varcalc.certificates.curve import (
    Piece,
    Samples,
    end_values,
    integrated,
    joint_states,
    pieces,
    sampled,
    state_sizes,
)
from varcalc.certificates.integrals import Unproved, check_enclosed
from varcalc.certificates.jets import Jet
from varcalc.certificates.smooth import Undecided
from varcalc.certificates.statement import Statement, statement
from varcalc.certificates.summands import summands
from varcalc.certificates.taylor import TAYLOR_ORDER, AtEnd, Values, views_of
from varcalc.certificates.three_values import Part, Term, ThreeValues
from varcalc.certificates.wells import LeastOfPolynomial, NotPolynomial, branches, shifted
from varcalc.symbolic.convexity import Entry, proved_convex
from varcalc.symbolic.tracing import Expression

WELL_KNOWN, FEW_BOXES = 2.0**-80, 40
"""Remainder of R, relative to it, with which a box will do; boxes of a piece after which any will."""
FALLING, SMALL = 0.9, 2.0**-72
"""Share of all that is lost that must be left, at most, where there are twice as many boxes, for more to be cut; what
may be lost, relative to the value."""
MOST_BOXES = 600
SHRUNK = 2.0**-48
"""What constants of momenta are made smaller by, relative to them: at the very edge of what a kink bears round-off is
beyond it, and elsewhere so little costs its square."""
NOT_CONVEX = (
    "the Lagrangian is not proved to be a sum of convex functions of one slope each and of a jointly convex one"
)


@dataclass(frozen=True)
class Dual:
    """What a functional comes to on the curve, or a little more; by how much it may be less elsewhere.

    ``momenta`` are those at both ends.
    """

    value: Ball
    lost: Ball
    momenta: tuple[list[Ball], list[Ball]]


@dataclass(frozen=True)
class DualBound:
    """A curve and a lower bound of the functional over all curves, by convexity; ``stated`` is what is minimised.

    ``between`` are bounds of the slopes.
    """

    stated: Statement
    between: Sequence[tuple[float, float]]

    @cached_property
    def _samples(self) -> list[Samples]:
        return sampled(self.stated)

    @cached_property
    def joints(self) -> np.ndarray:
        """The functions where pieces meet."""
        return joint_states(self.stated, self._samples)

    @cached_property
    def pieces(self) -> list[Piece]:
        """The exact curve."""
        return pieces(self.stated, self._samples, self.joints)

    @cached_property
    def _split(self) -> tuple[Statement, list[Term]]:
        """R, and a term of each slope, and of each function that is ``_loose``."""
        n, (rest, found) = self.stated.n, summands(self.stated)
        terms = []
        for place in (*self._loose, *range(n, 2 * n)):
            low, high = self.between[place - n] if place >= n else (-math.inf, math.inf)
            terms.append(Term(place, self._of(found.pop(place, ca.SX(0))), low, high))
        return self._of(sum(found.values(), rest)), terms

    def _of(self, integrand: Expression) -> Statement:
        return statement(replace(self.stated.along, integrand=integrand))

    @cached_property
    def _polynomials(self) -> dict[int, list[list[Statement]]]:
        """Of terms of a slope that are not proved convex, by their places: polynomials one of which each is."""
        found = {}
        for term in self._split[1]:
            bounded = math.isfinite(term.low) or math.isfinite(term.high)
            if term.place >= self.stated.n and not bounded and not self._convex(term.stated):
                try:
                    found[term.place] = [[self._of(c) for c in one] for one in branches(term.stated, term.place)]
                except NotPolynomial:
                    raise Unproved(NOT_CONVEX) from None
        return found

    def _convex(self, stated: Statement) -> bool:
        parameters: list[Entry] = [float(v) for v in stated.along.form.problem.parameter_values]
        watched: list[Entry] = [None] * stated.n
        return proved_convex(stated.function, [[stated.along.span], watched, watched, [], parameters, [], [], []])

    @property
    def convex(self) -> bool:
        """Whether all terms are proved convex."""
        return not self._polynomials

    @cached_property
    def _loose(self) -> list[int]:
        """The functions whose momenta are known at both ends."""
        held = self.stated.held
        return [i for i in range(self.stated.n) if self.stated.periodic or not (held[0][i] or held[1][i])]

    def check(self) -> None:
        """Prove that all is convex but polynomials of one slope, and no operation unknown; Unproved where it is not."""
        rest, terms = self._split
        for stated in (rest, *(t.stated for t in terms)):
            check_enclosed(stated.function, "the Lagrangian")
        of_slopes = self._polynomials
        if not all(map(self._convex, [rest, *(t.stated for t in terms if t.place not in of_slopes)])):
            raise Unproved(NOT_CONVEX)

    @cached_property
    def _sizes(self) -> list[float]:
        """Powers of two of the sizes of the functions and of their slopes."""
        states = state_sizes(self._samples, self.stated) / self.stated.along.length
        slopes = np.abs(np.hstack([s.controls for s in self._samples])).max(axis=1)
        found = [*states * self.stated.along.length, *np.maximum(slopes, states)]
        return [2.0 ** round(math.log2(size)) for size in found]

    def found(self) -> Dual:
        """The value on the curve, and what it may be less; Unproved where that is not bounded."""
        parts = list(self._parts())
        momenta = self._momenta(parts)
        boxes = [self._on(part, momenta, start) for part, start in zip(parts, momenta.starts, strict=True)]
        heapq.heapify(boxes)
        size = sum(abs(float(box.value)) for box in boxes if box.lost < math.inf) or 1.0
        seen, last = len(boxes), math.inf
        while len(boxes) < MOST_BOXES:
            if boxes[0].lost < math.inf:
                lost = sum(box.lost for box in boxes)
                if lost <= SMALL * size or (len(boxes) >= 2 * seen and lost > FALLING * last):
                    break
                seen, last = (len(boxes), lost) if len(boxes) >= 2 * seen or last == math.inf else (seen, last)
            worst = heapq.heappop(boxes)
            if worst.part.box.narrow:
                heapq.heappush(boxes, worst)
                break
            left, right = (self._looked_at(worst.part.k, half) for half in worst.part.box.halves())
            for half, start in ((left, worst.start), (right, momenta.after(left, worst.start))):
                heapq.heappush(boxes, self._on(half, momenta, start))
        if not boxes[0].lost < math.inf:
            raise Unproved(f"convexity alone does not bound the functional from below near {boxes[0].part.box.at:.6g}")
        value, lost = flint().arb(0), flint().arb(0)
        for box in boxes:
            value, lost = value + box.value, lost + box.lost
        ends = momenta.starts[0], momenta.after(parts[-1], momenta.starts[-1])
        return Dual(value, lost.upper(), ends)

    def _parts(self) -> Iterator[Part]:
        """Boxes on which the rest of the Lagrangian is enclosed."""
        for k, piece in enumerate(self.pieces):
            waiting, tried = [piece.box()], 0
            while waiting:
                box, tried = waiting.pop(), tried + 1
                try:
                    part = self._looked_at(k, box)
                except Undecided as undecided:
                    if tried > MOST_BOXES or box.narrow:
                        raise Unproved(f"the Lagrangian is not enclosed near {box.at:.6g}: {undecided}") from None
                else:
                    if tried > FEW_BOXES or part.value.rough <= WELL_KNOWN * max(
                        1.0, float(abs(part.value.ball).upper())
                    ):
                        yield part
                        continue
                waiting += reversed(box.halves())

    def _looked_at(self, k: int, box: Box) -> Part:
        piece, n, (rest, terms) = self.pieces[k], self.stated.n, self._split
        a, b = self.stated.along.span
        views = views_of(box, None if k else a, b if k == len(self.pieces) - 1 else None)
        rows = [[*states, *controls] for states, controls in map(piece.lifted, views)]

        def jets(stated: Statement) -> list[Jet]:
            switches = stated.switches(piece.centre, piece.half)
            return [stated.jet(v.abscissa(), row[:n], row[n:], 1, switches) for v, row in zip(views, rows, strict=True)]

        def slope(found: Sequence[Jet], place: int) -> Values:
            return Values.on(views, [jet.first.get(place, flint().arb(0)) for jet in found])

        own = jets(rest)
        return Part(
            k,
            box,
            views,
            [Values.on(views, column) for column in zip(*rows, strict=True)],
            Values.on(views, [jet.value for jet in own]),
            [slope(own, place) for place in range(2 * n)],
            {t.place: slope(jets(t.stated), t.place) for t in terms if t.place < n},
        )

    def _momenta(self, parts: Sequence[Part]) -> Momenta:
        """The momenta at the left end of each box, and the constants r."""
        found, stated, n = flint(), self.stated, self.stated.n
        plain = Momenta([], [found.arb(0)] * n, [None] * n)
        none = [found.arb(0)] * n
        total = none
        for part in parts:
            total = plain.after(part, total)
        own = [found.arb(c) * (1 - SHRUNK) for c in self._constants()]
        first, last = self._at_ends()
        if stated.periodic:
            first = last = own
        length = found.arb(stated.along.span[1]) - stated.along.span[0]
        start = [
            a if a is not None else own[i] if b is None else b - total[i]
            for i, (a, b) in enumerate(zip(first, last, strict=True))
        ]
        extra = [
            none[i] if a is None or b is None else (b - a - total[i]) / length
            for i, (a, b) in enumerate(zip(first, last, strict=True))
        ]
        momenta = Momenta([start], extra, last)
        for part in parts[:-1]:
            momenta.starts.append(momenta.after(part, momenta.starts[-1]))
        return momenta

    def _constants(self) -> list[float]:
        """About what the momenta are at the start: H_v less what they grow by, at most nodes."""
        rows, reached, weights = [], np.zeros(self.stated.n), []
        for s in self._samples:
            grown = reached + s.half * integrated(s.forces.T)
            rows.append(s.pulls - grown)
            reached = grown[-1]
            weights.append(s.half * np.gradient(nodes(len(s.x) - 1)))
        missed, shares = np.concatenate(rows), np.concatenate(weights)
        found = []
        for column in missed.T:
            # beside a kink, or where the curve is known but roughly, some may be far off: not their mean
            order = np.argsort(column)
            at = np.searchsorted(np.cumsum(shares[order]), 0.5 * shares.sum())
            found.append(float(column[order][at]))
        return found

    def _at_ends(self) -> list[list[Ball | None]]:
        """The momenta at free ends; None where the end is held."""
        stated, cost, zero = self.stated, self.stated.cost, flint().arb(0)
        jet = None if cost is None else cost.jet(*end_values(stated, self.joints), 1)
        rows: list[list[Ball | None]] = []
        for end, sign in ((0, 1), (1, -1)):
            slopes = [zero if jet is None else zero + jet.first.get(i + end * stated.n, 0) for i in range(stated.n)]
            rows.append([None if held else sign * s for held, s in zip(stated.held[end], slopes, strict=True)])
        return rows

    def _on(self, part: Part, momenta: Momenta, start: list[Ball]) -> Bounded:
        """What is found on a box."""
        value, lost, n = part.value.integral(), flint().arb(0), self.stated.n
        piece, nothing = self.pieces[part.k], Bounded(part, start, flint().arb(0), math.inf)
        for term in self._split[1]:
            i = term.place % n
            if term.place < n:
                slope = part.rates[i] + momenta.extra[i]
            else:
                slope = momenta.along(part, i, start[i]) - part.slopes[term.place]
            switches = term.stated.switches(piece.centre, piece.half)
            values = ThreeValues(part, term, slope, self._sizes[term.place], switches)
            found = self._least(values) if term.place in self._polynomials else values.least()
            if found is None:
                return nothing
            value, lost = value + found[0], lost + found[1]
        value, lost = value * part.box.unit, 2 * lost * part.box.unit
        # what is not known of the value narrows with the box as well
        return Bounded(part, start, value, above(lost + 2 * value.rad())) if value.is_finite() else nothing

    def _least(self, values: ThreeValues) -> tuple[Ball, Ball] | None:
        """What :meth:`ThreeValues.least` is, of a term that is one of some polynomials."""
        on, part, n = values.at(0.0), values.part, self.stated.n
        if on is None:
            return None
        slope, less, piece = part.rows[values.term.place], flint().arb(0), self.pieces[part.k]
        rows = list(zip(*(r.by_views() for r in part.rows), strict=True))

        def along(c: Statement) -> Values:
            """What one of the polynomials is along the curve, in each of the part's views."""
            switches = c.switches(piece.centre, piece.half)
            series = [c.jet(v.abscissa(), r[:n], r[n:], 0, switches) for v, r in zip(part.views, rows, strict=True)]
            return Values.on(part.views, [jet.value for jet in series])

        for one in self._polynomials[values.term.place]:
            around = shifted(list(map(along, one)), slope)
            around[0], around[1] = around[0] - on, around[1] - values.slope
            found = LeastOfPolynomial(around, values.size).less_than_nothing()
            if found is None:
                return None
            less = less.max(found)
        return on.integral(), less


@dataclass(frozen=True)
class Bounded:
    """What is found on a box: the integral of H along the curve, or a little more; by how much it may be less."""

    part: Part
    start: list[Ball]
    value: Ball
    lost: float

    def __lt__(self, other: Bounded) -> bool:
        return self.lost > other.lost


@dataclass(frozen=True)
class Momenta:
    """Momenta at the left end of each box, the constants r, and what they are at the end of the interval, if known."""

    starts: list[list[Ball]]
    extra: list[Ball]
    last: list[Ball | None]

    def _force(self, part: Part, i: int) -> Values:
        force = part.slopes[i] + self.extra[i]
        return force + part.rates[i] if i in part.rates else force

    def after(self, part: Part, start: Sequence[Ball]) -> list[Ball]:
        """The momenta at the right end of a box."""
        return [p + self._force(part, i).integral() * part.box.unit for i, p in enumerate(start)]

    def along(self, part: Part, i: int, start: Ball) -> Values:
        """The momentum of function i on a box."""
        unit, force = part.box.unit, self._force(part, i)
        constants = [
            start + unit * force.half_integral(),
            start + unit * force.ball * flint().arb(1, 1),
            start if isinstance(part.views[-1], AtEnd) and part.views[-1].side < 0 else self.last[i],
        ]
        rows = []
        for series, constant in zip((force.middle, force.whole, force.end), constants, strict=True):
            grown = (
                None
                if series is None or constant is None
                else [constant, *(unit * coefficient(series, k) / (k + 1) for k in range(TAYLOR_ORDER))]
            )
            rows.append(None if grown is None else flint().arb_series(grown, TAYLOR_ORDER + 1))
        return Values.on(part.views, rows[: len(part.views)])
