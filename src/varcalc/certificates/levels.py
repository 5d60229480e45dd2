"""A curve that meets prescribed integrals and equations of its ends exactly, close to one that all but does.

To the curve a combination e_1 eta_1 + ... + e_k eta_k of bumps is added. That all is met for some e in a small box is
proved by Newton's interval operator (Moore, Kearfott and Cloud, "Introduction to Interval Analysis",
SIAM 2009, sect. 8.4): it needs not be known for which.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from varcalc.certificates.balls import Around, Ball, Poly, Series, above, flint, integral, most, solved
from varcalc.certificates.curve import end_values, widened
from varcalc.certificates.integrals import Along, Unproved
from varcalc.certificates.jets import Jet, jets
from varcalc.certificates.setting import Setting
from varcalc.certificates.smooth import Undecided, head
from varcalc.certificates.statement import Statement
from varcalc.certificates.tube import Prover
from varcalc.symbolic.instructions import Program

LEVEL_ORDER = 14
"""Order of the Taylor forms of integrals."""
WIDER = 8.0
"""How much wider than Newton's step the box is in which the integrals are proved to be met."""
BUMPS = 4
"""Bumps of each function to choose from."""


@dataclass(frozen=True)
class Bump:
    """A polynomial in x that is added to one function; or 1, added to a number.

    ``state`` is the number of the function, or of the number, among the states. The polynomial vanishes at ``zeros``
    with its derivatives below ``order``, 0 for a number.
    """

    state: int
    degree: int
    span: tuple[float, float]
    zeros: tuple[float, ...]
    order: int

    def values(self, x: np.ndarray) -> list[np.ndarray]:
        """The bump at x and its derivatives up to ``order``."""
        bump = np.polynomial.Chebyshev.basis(self.degree, domain=list(self.span)).convert(kind=np.polynomial.Polynomial)
        if self.zeros:
            bump = bump * np.polynomial.Polynomial.fromroots(self.zeros) ** self.order
        return [bump.deriv(k)(x) if k else bump(x) for k in range(self.order + 1)]

    def at(self, x: float) -> Ball:
        """The bump at x."""
        return self._polynomials[0](flint().arb(x))

    @cached_property
    def _polynomials(self) -> list[Poly]:
        """Exactly the polynomials of :meth:`values`, in balls."""
        found = flint()
        a, b = (found.arb(v) for v in self.span)
        t = found.arb_poly([-(a + b) / (b - a), 2 / (b - a)])
        polys = [found.arb_poly(found.fmpz_poly.chebyshev_t(self.degree))(t)]
        for zero in self.zeros:
            polys[0] *= found.arb_poly([-found.arb(zero), 1]) ** self.order
        for _ in range(self.order):
            polys.append(polys[-1].derivative())
        return polys

    def sizes(self) -> list[Ball]:
        """What the bump and its derivatives stay below."""
        a, b = (flint().arb(v) for v in self.span)
        along = flint().arb_poly([(a + b) / 2, (b - a) / 2])
        return [most(poly(along)) for poly in self._polynomials]

    def series(self, around: Around) -> list[Series]:
        """The bump and its derivatives as series."""
        along = flint().arb_poly([around.box.x, around.box.unit])
        return [around.series(poly(along)) for poly in self._polynomials]


@dataclass(frozen=True)
class Meeting:
    """What is prescribed, along the curves about that of a setting by the bumps that are added."""

    setting: Setting
    bumps: Sequence[Bump]

    @property
    def statement(self) -> Statement:
        """What the certificate is about."""
        return self.setting.statement

    def correction(self) -> Ball:
        """What the value changes by from the curve to one near it that meets all exactly; Unproved if none does."""
        steps, slopes = self._steps
        return sum((step * slope for step, slope in zip(steps, slopes[0], strict=True)), flint().arb(0))

    def reach(self) -> float:
        """How much of each bump is added at most."""
        return max(above(abs(step)) for step in self._steps[0])

    def moved(self) -> list[Ball]:
        """How far at most each state, with what is integrated to levels, and each control is moved at any x."""
        stated, found = self.statement, flint()
        bare, room = stated.bare, self._steps[0]
        far = [found.arb(0)] * (bare + stated.n)
        for step, bump in zip(room, self.bumps, strict=True):
            for place, size in zip(self._places(bump), bump.sizes(), strict=True):
                far[place] += (abs(step) * size).upper()
        row = [*far[:bare], *([found.arb(0)] * stated.levels), *far[bare:]]
        missed = [abs(miss).upper() for miss in self.missed()]
        return [*far[:bare], *map(operator.add, missed, grown(self.setting, row)), *far[bare:]]

    @cached_property
    def _steps(self) -> tuple[list[Ball], list[list[Ball]]]:
        """What is added of each bump, and :meth:`_slopes` for that."""
        found = flint()
        missed = [-miss for miss in [*self.missed(), *self._missed_ends()]]
        slopes = self._slopes([found.arb(0)] * len(missed))
        steps = _solved([row[:] for row in slopes[1:]], missed)
        widths = [WIDER * float(abs(step).upper()) + 1e-300 for step in steps]
        slopes = self._slopes([found.arb(0, width) for width in widths])
        steps = _solved([row[:] for row in slopes[1:]], missed)
        if not all(bool(abs(step) < width) for step, width in zip(steps, widths, strict=True)):
            raise Unproved("no curve near the one that was found is proved to meet all that is prescribed")
        return steps, slopes

    def missed(self) -> list[Ball]:
        """By how much the integrals along the curve exceed what is prescribed."""
        levels = [flint().arb(c.lower) for c in self.statement.along.form.conditions.integrals]
        along = self._integrated(lambda k, around: [jet.value for jet in self._at(k, around, [], 0)[1:]])
        return [value - level for value, level in zip(along, levels, strict=True)]

    def _missed_ends(self) -> list[Ball]:
        """What the equations of the ends come to on the curve."""
        cost = self.statement.cost
        return [] if cost is None else [jet.value for jet in cost.equations(*self._ends([]))]

    def _ends(self, room: Sequence[Ball]) -> tuple[list[Ball], list[Ball], list[Ball]]:
        """The functions at the start and the end of the moved curve, and the numbers."""
        start, end, numbers = end_values(self.statement, self.setting.joints)
        for bump, e in zip(self.bumps, room, strict=False):
            if bump.state < self.statement.n:
                a, b = bump.span
                start[bump.state] += e * bump.at(a)
                end[bump.state] += e * bump.at(b)
            else:
                numbers[bump.state - self.statement.n * self.statement.order] += e
        return start, end, numbers

    def _end_slopes(self, room: Sequence[Ball]) -> list[list[Ball]]:
        """Derivatives by each e of what the ends cost, and of their equations."""
        cost, found = self.statement.cost, flint()
        if cost is None:
            return [[found.arb(0)] * len(self.bumps)]
        n, ends = self.statement.n, self._ends(room)
        rows = []
        for jet in [cost.jet(*ends, 1), *cost.equations(*ends)]:
            row = []
            for bump in self.bumps:
                i = bump.state
                by_number = jet.first.get(2 * n + i - n * self.statement.order, 0)
                by_ends = [jet.first.get(i + n * k, 0) * bump.at(x) for k, x in enumerate(bump.span)]
                row.append(found.arb(0) + (sum(by_ends) if i < n else by_number))
            rows.append(row)
        return rows

    def _slopes(self, room: Sequence[Ball]) -> list[list[Ball]]:
        """Derivatives by each e of the value, of what is integrated to levels and of the equations of the ends.

        They hold while e lies in ``room``.
        """

        def series(k: int, around: Around) -> list[Series]:
            """The derivatives of all that is integrated, by each e, as series around a place of a piece."""
            shapes = [bump.series(around) for bump in self.bumps]
            return [
                sum(jet.first.get(place, 0) * shape for place, shape in zip(self._places(bump), shapes_of, strict=True))
                for jet in self._at(k, around, list(zip(room, shapes, strict=True)), 1)
                for bump, shapes_of in zip(self.bumps, shapes, strict=True)
            ]

        flat, count = self._integrated(series), len(self.bumps)
        value, *levels = [flat[i : i + count] for i in range(0, len(flat), count)]
        cost, *equations = self._end_slopes(room)
        return [[a + b for a, b in zip(value, cost, strict=True)], *levels, *equations]

    def _places(self, bump: Bump) -> list[int]:
        """The numbers of the function that a bump is added to and of its derivatives, among states and controls."""
        return places(self.statement, bump.state)

    def _at(self, k: int, around: Around, moved: list[tuple[Ball, list[Series]]], order: int) -> list[Jet]:
        """H and what is integrated to levels, along the moved curve."""
        x, states, controls = self._moved(k, around, moved)
        own = self.statement.jet(x, states, controls, order, self.setting.pieces[k].switches)
        return [own, *self.statement.level_jets(x, states, controls, order)]

    def _moved(
        self, k: int, around: Around, moved: list[tuple[Ball, list[Series]]]
    ) -> tuple[Series, list[Series], list[Series]]:
        """The abscissa, the states and the controls of the moved curve."""
        states, controls = self.setting.pieces[k].lifted(around)
        row, bare = [*states, *controls], self.statement.bare
        for bump, (e, shapes) in zip(self.bumps, moved, strict=False):
            for place, shape in zip(self._places(bump), shapes, strict=True):
                row[place] = row[place] + e * shape
        return around.abscissa(), row[:bare], row[bare:]

    def integrals(self, program: Program) -> list[Ball]:
        """The integrals of what a function of the form's symbols gives, along the curve that meets all exactly."""
        room = self._steps[0] if self.bumps else []

        def series(k: int, around: Around) -> list[Series]:
            """Each of the results as a series around a place of a piece."""
            moved = [(e, bump.series(around)) for e, bump in zip(room, self.bumps, strict=True)]
            x, states, controls = self._moved(k, around, moved)
            arguments = self.statement.arguments(Jet(x), [Jet(s) for s in states], [Jet(s) for s in controls])
            return [jet.value for jet in jets(program, arguments[:-2], 0)[0]]

        return self._integrated(series)

    def _integrated(self, series: Callable[[int, Around], list[Series]]) -> list[Ball]:
        """Integrals over all boxes."""
        totals: list[Ball] = []
        for k, box in self.setting.along.boxes:
            try:
                views = [series(k, Around(box, LEVEL_ORDER + whole, whole)) for whole in (False, True)]
            except Undecided as undecided:
                raise Unproved(
                    f"near {box.at:.6g} the curves among which one meets all that is prescribed leave where the "
                    f"Lagrangian is enclosed: {undecided}"
                ) from None
            parts = [sum(integral(c, w, LEVEL_ORDER)) * box.unit for c, w in zip(*views, strict=True)]
            totals = [a + b for a, b in zip(totals, parts, strict=True)] if totals else parts
        return totals


def meeting(setting: Setting) -> Meeting:
    """What is prescribed about the curve of a setting."""
    return Meeting(setting, bumps_for(setting))


def grown(setting: Setting, far: Sequence[Ball]) -> list[Ball]:
    """By how much what is integrated to levels, up to any x, differs where states and controls do by ``far``."""
    stated, found = setting.statement, flint()
    total = [found.arb(0)] * stated.levels
    for k, box in setting.along.boxes:
        around = Around(box, 1, whole=True)
        states, controls = setting.pieces[k].lifted(around)
        near = widened(stated, states, controls, far)
        places = [*range(stated.bare), *range(stated.states, stated.states + stated.n)]
        for j, jet in enumerate(stated.level_jets(around.abscissa(), *near, 1)):
            rate = sum(
                (abs(head(jet.first.get(i, 0) * far[p] + found.arb(0))) for i, p in enumerate(places)), found.arb(0)
            )
            total[j] = (total[j] + 2 * box.unit * rate).upper()
    return total


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


def bumps_for(setting: Setting) -> list[Bump]:
    """Bumps by which all that is prescribed can be changed each by itself; Unproved where it cannot."""
    offered = _offered(setting)
    effects = np.array([_effects(setting, bump) for bump in offered]).T
    count = len(effects)
    sizes = np.abs(effects).max(axis=1, initial=0.0) if count else np.zeros(0)
    rest = effects / np.where(sizes > 0, sizes, 1.0)[:, None]
    chosen: list[int] = []
    for _ in range(count):
        best = int(np.linalg.norm(rest, axis=0).argmax())
        size = float(np.linalg.norm(rest[:, best]))
        if not size > 0:
            raise Unproved("what is prescribed cannot be changed independently near the curve")
        chosen.append(best)
        direction = rest[:, best] / size
        rest = rest - np.outer(direction, direction @ rest)
    return [offered[b] for b in chosen]


def _offered(setting: Setting) -> list[Bump]:
    """Bumps to choose from: inside, and where equations hold between the ends there and of the numbers."""
    statement = setting.statement
    a, b = span = setting.samples[0].start, setting.samples[-1].end
    inside, n, order = tuple(statement.waypoints), statement.n, statement.order
    found = [Bump(i, degree, span, (a, b, *inside), order) for degree in range(BUMPS) for i in range(n)]
    if statement.along.form.ends.equations:
        for end, other in ((0, b), (1, a)):
            found += [Bump(i, 0, span, (other, *inside), order) for i in range(n) if not statement.held[end][i]]
        found += [Bump(i, 0, span, (), 0) for i in range(n * order, statement.bare)]
    return found


def _effects(setting: Setting, bump: Bump) -> list[float]:
    """What a bump changes of each prescribed integral and each equation of the ends, in numbers."""
    statement, cost, n = setting.statement, setting.statement.cost, setting.statement.n
    levels = np.zeros(statement.levels)
    for s in setting.samples:
        shapes = zip(places(statement, bump.state), bump.values(s.x), strict=True)
        rates = sum(s.turning[:, :, place] * shape[:, None] for place, shape in shapes)
        levels += np.trapezoid(rates, s.x, axis=0)
    if cost is None or not statement.along.form.ends.equations:
        return levels.tolist()
    joints, numbers = setting.joints, np.asarray(statement.along.numbers, dtype=float)
    _, rows = cost.gradients([joints[0, :n], joints[-1, :n], numbers])
    i = bump.state
    if i >= n:
        return [*levels, *rows[:, 2 * n + i - n * statement.order]]
    at = [float(bump.values(np.array([x]))[0][0]) for x in bump.span]
    return [*levels, *(rows[:, i] * at[0] + rows[:, n + i] * at[1])]


def places(statement: Statement, state: int) -> list[int]:
    """The numbers of a function and of its derivatives, among states and controls; of a number its own."""
    n = statement.n
    if state >= n:
        return [state]
    return [*(state + k * n for k in range(statement.order)), statement.bare + state]


def _solved(matrix: list[list[Ball]], right: list[Ball]) -> list[Ball]:
    """The solution of linear equations; Unproved where a pivot may vanish."""
    try:
        return solved(matrix, right)
    except ZeroDivisionError:
        raise Unproved("the prescribed integrals are not proved to change independently near the curve") from None
