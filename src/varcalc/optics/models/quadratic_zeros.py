"""The values of σ at which a ray joins two points where n² is a polynomial of second degree: zeros of one function.

With d = b - a, the values at the middle m between both points, and in each principal direction κ, half the second
derivative of n² there, and g, half the first, r'' = ∇n²/2 is solved for a given σ by a momentum at a, the square of
which is n² where

    G(σ) = Σ (d² s₁(σ)² + g² s₂(σ)²) - n²(m) = 0,    s₁ = (w/2)/sin(wσ/2), s₂ = tan(wσ/2)/w, w² = -κ,

or their like for κ ≥ 0 (1/σ and σ/2 where κ = 0). Hamilton's principal function of a fixed σ has -G/2 for its
derivative (Goldstein, Poole and Safko, "Classical Mechanics", 3rd ed., sect. 10.1), whose conjugate points are at
multiples of π/w; one more is passed where G grows. Between these all terms are convex and monotone but for those of
s₂ where κ > 0, whose second derivative is bounded. G is parted until it has no zero, or is monotone, or has one
extremum: no ray can be passed over.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from varcalc.numerics.roots import EPSILON, bracketed_newton
from varcalc.optics.rays.beam import Rows

TOUCHES_ZERO = 4e-13
"""Of n²: an extremum of G so close to zero is one ray, which touches a caustic."""
MOST_SPANS = 4000
"""Spans between conjugate points of one pair; of a pair that has more the last ones are given up."""
SPANS_TOGETHER = 8192
"""Searched together; bounds the memory."""
FARTHER_AND_FARTHER = 60
"""Of σ, until what is beyond is known to hold no zero."""
HALVED_SPANS = 60
"""How often a span is halved in which G is neither monotone nor bent one way."""
LARGEST_ANGLE = 300.0
"""cosh of more is all but too large for a number."""
FEW_STEPS, MOST_STEPS = 6, 100
"""Newton's, of all zeros together, and of those that are left."""
LAST_STEP = 2 * EPSILON
"""Of a zero."""
OVERLAP = 0.6
"""Of what is between two marks: searched from either, so that no zero is at the end of both searches."""
SAME_ZERO = 1e-10
"""Of σ: zeros so close are one; two next to a caustic are farther apart, or one that touches it."""
STEEPEST = 2 / 3**1.5
"""The largest value of tanh/cosh²."""
Derivatives = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Values, first and second derivatives by σ."""


@dataclass(frozen=True)
class Questions(Rows):
    """q pairs by principal directions: ``way`` d, ``pull`` g at the middle and ``start`` at a (q, d), n² at the middle.

    ``squared`` (q,) is n² at a.
    """

    way: np.ndarray
    pull: np.ndarray
    start: np.ndarray
    middle: np.ndarray
    squared: np.ndarray


@dataclass(frozen=True)
class Spans(Rows):
    """k stretches from ``low`` to ``high`` (k,) of σ less that of the conjugate point number ``origin`` (k,).

    ``question`` (k,) is the number of the pair.
    """

    question: np.ndarray
    origin: np.ndarray
    low: np.ndarray
    high: np.ndarray


@dataclass(frozen=True)
class Zeros(Rows):
    """k zeros of G of the pairs ``question`` (k,), at ``offset`` (k,) from the conjugate points ``origin`` (k,).

    ``touching`` (k,) says that G is stationary there, ``free`` (k, d) which momenta may be any.
    """

    question: np.ndarray
    origin: np.ndarray
    offset: np.ndarray
    touching: np.ndarray
    free: np.ndarray


@dataclass(frozen=True)
class Terms:
    """s₁² and s₂² (k, d) with their first and second derivatives."""

    first: Derivatives
    second: Derivatives

    def summed(self, of: Questions, order: int) -> np.ndarray:
        """G or its derivative of an ``order`` (k,); infinite at conjugate points, unless they do not count."""
        return self.squares(of, order) - (of.middle if order == 0 else 0.0)

    def squares(self, of: Questions, order: int) -> np.ndarray:
        """The sum of squares in G, or its derivative of an ``order`` (k,)."""
        return _summed(of.way, self.first[order]) + _summed(of.pull, self.second[order])


@dataclass
class ZeroSearch:
    """The zeros of G of the pairs ``asked`` up to optical paths ``within`` (q,); ``curvature`` (d,) are the κ.

    ``marks`` are the conjugate points of a fixed σ, ascending from 0, near which what is singular is told from them.
    """

    asked: Questions
    curvature: np.ndarray
    within: np.ndarray
    marks: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        rates = np.sqrt(np.abs(self.curvature))
        self._turning, self._growing = (np.where(sign * self.curvature > 0, rates, 0.0) for sign in (-1, 1))
        self.marks = np.zeros(1)
        self._bounds = np.where(self.asked.middle > 0, self._last(), 0.0)
        longest, rates = float(self._bounds.max(initial=0.0)), np.unique(self._turning[self._turning > 0])
        counts = np.minimum(longest * rates / np.pi + 1, MOST_SPANS).astype(int)
        marks = [self.marks] + [np.arange(1, n + 1) * np.pi / rate for n, rate in zip(counts, rates, strict=True)]
        self.marks = np.unique(np.concatenate(marks))

    def found(self) -> tuple[Zeros, np.ndarray]:
        """The zeros, and of which pairs (q,) these are not all."""
        number, given_up = self._numbers()
        group = np.cumsum(number) // SPANS_TOGETHER
        parts = []
        for pairs in np.split(np.arange(len(number)), 1 + np.flatnonzero(np.diff(group))):
            spans = self._spans(pairs, number[pairs])
            parts += [self._distinct(self._zeros(spans)), self._foci(spans)]
        return Zeros.joined(parts), given_up

    def sigma(self, zeros: Zeros) -> np.ndarray:
        """σ (k,) of the ``zeros``."""
        return self.marks[zeros.origin] + zeros.offset

    def _last(self) -> np.ndarray:
        """σ (q,) beyond which there is no zero of G, or none of an optical path up to ``within``.

        The energies e = p² - κu² of the principal directions, u from the centre of n², add up to n² there, and over σ
        an optical path grows by no less than e(σ/2 - 1/(2w)) of each.
        """
        q, turns = len(self.asked), self._turning > 0
        straight = (self.curvature == 0) & (self.asked.pull != 0)
        curved = self.curvature != 0
        centre = self.asked.middle - (self.asked.pull[:, curved] ** 2 / self.curvature[curved]).sum(axis=1)
        last = np.full(q, np.inf)
        with np.errstate(all="ignore"):
            falls = 2 * np.sqrt(np.maximum(self.asked.middle, 0))[:, None] / np.abs(self.asked.pull)
            last = np.minimum(last, np.where(straight, falls, np.inf).min(axis=1))
            slow = 1 / self._turning[turns].min(initial=np.inf)
            grows = (centre > 0) & ~np.any(straight, axis=1) & np.any(self._growing == 0)
            last = np.where(grows, np.minimum(last, 2 * self.within / centre + slow), last)
        left, sigma = np.flatnonzero(~np.isfinite(last)), 1.0
        if len(left) and np.any(self._growing):
            sigma = 1 / self._growing.max()
        for _ in range(FARTHER_AND_FARTHER):
            if len(left) == 0:
                break
            last[left] = sigma
            left, sigma = left[~self._nothing_beyond(self.asked.take(left), sigma)], 2 * sigma
            if sigma * self._growing[self._growing > 0].min(initial=np.inf) > LARGEST_ANGLE:
                break  # nothing changes any more
        return last

    def _nothing_beyond(self, some: Questions, sigma: float) -> np.ndarray:
        """Whether (q,) G is known to have no zero beyond σ."""
        here = self._terms(np.zeros(len(some), dtype=int), np.full(len(some), sigma))
        flat = self._turning == 0
        with np.errstate(all="ignore"):
            lower = (some.pull**2 * here.second[0])[:, flat].sum(axis=1)
            most = np.where(self._growing > 0, 1 / self._growing**2, np.inf)
            limit = np.where(some.pull == 0, 0.0, some.pull**2 * most)
            upper = ((some.way**2 * here.first[0]) + limit)[:, flat].sum(axis=1)
        return (lower > some.middle) | (np.all(flat) & (upper < some.middle))

    def _numbers(self) -> tuple[np.ndarray, np.ndarray]:
        """How many spans between conjugate points of fixed σ each pair has (q,), and of which (q,) they are not all."""
        if not np.any(self._turning):
            return (self._bounds > 0).astype(int), np.zeros(len(self._bounds), dtype=int)
        number = np.minimum(np.searchsorted(self.marks, self._bounds), min(len(self.marks) - 1, MOST_SPANS))
        return number, (self.marks[number] < self._bounds).astype(int)

    def _spans(self, pairs: np.ndarray, number: np.ndarray) -> Spans:
        """What is to be searched for ``pairs`` with ``number`` (k,) spans between conjugate points of fixed σ."""
        question = np.repeat(pairs, number)
        origin = np.arange(len(question)) - np.repeat(np.cumsum(number) - number, number)
        nothing = np.zeros(len(question))
        if not np.any(self._turning):
            return Spans(question, origin, nothing, self._bounds[question])
        half = OVERLAP * (self.marks[origin + 1] - self.marks[origin])
        return Spans.joined([Spans(question, origin, nothing, half), Spans(question, origin + 1, -half, -nothing)])

    def _terms(self, origin: np.ndarray, offset: np.ndarray) -> Terms:
        """See :class:`Terms`, at ``offset`` (k,) from the ``marks`` number ``origin`` (k,)."""
        marks, found = self.marks, {}
        first, second = ([np.empty((len(origin), len(self.curvature))) for _ in range(3)] for _ in range(2))
        with np.errstate(all="ignore"):
            for k, (turning, growing) in enumerate(zip(self._turning, self._growing, strict=True)):
                if (turning, growing) in found:  # as across a round rod
                    parts = found[turning, growing]
                elif turning:
                    parts = _sines(turning, *half_angle(turning, marks, origin, offset))
                elif growing:
                    parts = _hyperbolic(growing, np.minimum(growing * (marks[origin] + offset) / 2, LARGEST_ANGLE))
                else:
                    sigma = marks[origin] + offset
                    once, twice = 1 / sigma, 1 / (sigma * sigma)
                    parts = (
                        (twice, -2 * once * twice, 6 * twice * twice),
                        (sigma * sigma / 4, sigma / 2, np.full(len(sigma), 0.5)),
                    )
                found[turning, growing] = parts
                for columns, values in zip((first, second), parts, strict=True):
                    for column, value in zip(columns, values, strict=True):
                        column[:, k] = value
        return Terms((first[0], first[1], first[2]), (second[0], second[1], second[2]))

    def _at(self, spans: Spans, offset: np.ndarray, order: int) -> np.ndarray:
        return self._terms(spans.origin, offset).summed(self.asked.take(spans.question), order)

    def _zeros(self, spans: Spans) -> Zeros:
        """All zeros of G in the ``spans``."""
        monotone, touched = [spans.take([])], []
        for _ in range(HALVED_SPANS):
            if len(spans) == 0:
                break
            of = self.asked.take(spans.question)
            low, high = (self._terms(spans.origin, end) for end in (spans.low, spans.high))
            may, steady, bent = self._enclosed(of, low, high)
            monotone.append(spans.take(np.flatnonzero(may & steady)))
            halves, touching = self._parted(spans.take(np.flatnonzero(may & ~steady & bent)))
            monotone.append(halves)
            touched.append(touching)
            spans = spans.take(np.flatnonzero(may & ~steady & ~bent))
            middle = (spans.low + spans.high) / 2
            spans = Spans.joined([
                Spans(spans.question, spans.origin, spans.low, middle),
                Spans(spans.question, spans.origin, middle, spans.high),
            ])  # fmt: skip
        return Zeros.joined([self._crossed(Spans.joined(monotone)), *touched])

    def _distinct(self, zeros: Zeros) -> Zeros:
        """The zeros, none twice."""
        sigma = self.marks[zeros.origin] + zeros.offset
        order = np.lexsort((sigma, zeros.question))
        sigma, question = sigma[order], zeros.question[order]
        other = (np.diff(question) > 0) | (np.diff(sigma) > SAME_ZERO * sigma[1:])
        return zeros.take(order[np.append(True, other)[: len(order)]])

    def _enclosed(self, of: Questions, low: Terms, high: Terms) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Whether (k,) G may vanish between two places, is monotone there, and bent one way."""
        room = TOUCHES_ZERO * of.middle
        bounds = []
        with np.errstate(all="ignore"):
            for order, extreme in ((0, None), (1, STEEPEST), (2, -1 / 6)):
                least, most = np.zeros(len(of)), np.zeros(len(of))
                for weight, one, other in ((of.way, low.first, high.first), (of.pull, low.second, high.second)):
                    ends = np.nan_to_num(np.stack([one[order], other[order]]), nan=np.inf)
                    under, over = ends.min(axis=0), ends.max(axis=0)
                    if extreme is not None and weight is of.pull:
                        under, over = self._between(under, over, one, other, order, extreme)
                    least += np.where(weight == 0, 0.0, weight**2 * under).sum(axis=1)
                    most += np.where(weight == 0, 0.0, weight**2 * over).sum(axis=1)
                bounds.append((least, most))
            (least, most), slope, bend = bounds
            may = (least <= of.middle + room) & (most >= of.middle - room)
            return may, (slope[0] >= 0) | (slope[1] <= 0), (bend[0] > 0) | (bend[1] < 0)

    def _between(
        self, under: np.ndarray, over: np.ndarray, low: Derivatives, high: Derivatives, order: int, extreme: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """The bounds of derivatives of s₂² with the extremum inside counted, where κ > 0."""
        for k in np.flatnonzero(self._growing > 0):
            w = self._growing[k]
            place = 1 / 3 if order == 1 else 2 / 3  # of tanh², where the derivative is extreme
            inside = (low[0][:, k] * w**2 < place) & (high[0][:, k] * w**2 > place)
            value = extreme / w if order == 1 else extreme
            under[:, k] = np.where(inside, np.minimum(under[:, k], value), under[:, k])
            over[:, k] = np.where(inside, np.maximum(over[:, k], value), over[:, k])
        return under, over

    def _parted(self, spans: Spans) -> tuple[Spans, Zeros]:
        """The parts on both sides of the one extremum of G in each of the ``spans``, and the zeros that are at one."""
        of = self.asked.take(spans.question)
        ends = [self._at(spans, end, 1) for end in (spans.low, spans.high)]
        with np.errstate(all="ignore"):
            inside = np.sign(ends[0]) * np.sign(ends[1]) < 0
        whole, rows = spans.take(np.flatnonzero(~inside)), np.flatnonzero(inside)
        spans, of, sign = spans.take(rows), of.take(rows), np.sign(ends[0][rows])
        at = self._solved(spans, sign, 1)
        value = self._at(spans, at, 0)
        touching = np.abs(value) <= TOUCHES_ZERO * of.middle
        free = np.zeros(of.way.shape, dtype=bool)
        zeros = Zeros(spans.question, spans.origin, at, touching, free).take(np.flatnonzero(touching))
        left, at = spans.take(np.flatnonzero(~touching)), at[~touching]
        parts = [
            Spans(left.question, left.origin, left.low, at), Spans(left.question, left.origin, at, left.high),
        ]  # fmt: skip
        return Spans.joined([whole, *parts]), zeros

    def _solved(self, spans: Spans, sign: np.ndarray, order: int) -> np.ndarray:
        """Where (k,) G or its derivative, by ``order``, vanishes, whose ``sign`` (k,) is that at the lower ends.

        Those that a few steps lead there are done; the others, which are halved again and again, go on alone.
        """
        at, rows = (spans.low + spans.high) / 2, np.arange(len(spans))
        for most in (FEW_STEPS, MOST_STEPS):
            if len(rows) == 0:
                break
            some = spans.take(rows)
            level = self._levelled(some, sign[rows], order)
            at[rows], moved = bracketed_newton(level, some.low, some.high, at[rows], relative=LAST_STEP, most=most)
            rows = rows[moved > LAST_STEP * np.abs(at[rows])]
        return at

    def _levelled(
        self, spans: Spans, sign: np.ndarray, order: int
    ) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]:
        """What falls through zero in the ``spans`` where G does or its derivative, by ``order``, times ``sign`` (k,).

        Of the squares Q in G it is 1 - n/√Q, or its derivative: beside conjugate points these are straight lines, on
        which Newton's steps end at once, where G itself goes as the inverse square.
        """
        of = self.asked.take(spans.question)
        index = np.sqrt(of.middle)

        def level(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            """The values (k,) at ``at``, and their rates."""
            terms = self._terms(spans.origin, at)
            squares, slope = terms.squares(of, 0), terms.squares(of, 1)
            with np.errstate(all="ignore"):
                root = np.sqrt(squares)
                rate = index / 2 * slope / (squares * root)
                if order == 0:
                    value = np.where(np.isfinite(squares), (squares - of.middle) / (root * (root + index)), 1.0)
                    return sign * value, sign * rate
                return sign * rate, sign * (index / 2 * terms.squares(of, 2) / root - 1.5 * rate * slope) / squares

        return level

    def _crossed(self, spans: Spans) -> Zeros:
        """The zeros of G in ``spans`` in which it is monotone."""
        ends = [self._at(spans, end, 0) for end in (spans.low, spans.high)]
        rows = np.flatnonzero((ends[0] > 0) != (ends[1] > 0))
        spans, sign = spans.take(rows), np.where(ends[0][rows] > 0, 1.0, -1.0)
        plain = np.zeros((len(rows), 1 + len(self.curvature)), dtype=bool)
        return Zeros(spans.question, spans.origin, self._solved(spans, sign, 0), plain[:, 0], plain[:, 1:])

    def _foci(self, spans: Spans) -> Zeros:
        """Conjugate points at which rays of all momenta in some principal directions come together, at b itself."""
        number = np.unique(spans.question * len(self.marks) + spans.origin)
        pairs, origin = number // len(self.marks), number % len(self.marks)
        pairs, origin = pairs[origin > 0], origin[origin > 0]
        here, odd = self.conjugate(origin)
        of = self.asked.take(pairs)
        free = here & (np.where(odd, of.pull, of.way) == 0)
        rows = np.flatnonzero(np.any(free, axis=1) & np.all(free | ~here, axis=1))
        nothing = np.zeros(len(rows))
        return Zeros(pairs[rows], origin[rows], nothing, nothing == 0, free[rows])

    def conjugate(self, origin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Which principal directions (k, d) the marks ``origin`` (k,) are of, and whether it is an odd one of these."""
        with np.errstate(all="ignore"):
            number = self.marks[origin][:, None] * self._turning / np.pi
        whole = np.round(number)
        return (self._turning > 0) & (np.abs(number - whole) <= 4 * EPSILON * whole), whole % 2 == 1

    def conjugate_points(self, zeros: Zeros) -> np.ndarray:
        """How many conjugate points (k,) the rays pass: those of a fixed σ, and one more where G grows."""
        here, _ = self.conjugate(zeros.origin)
        at = self.marks[zeros.origin]
        number = np.floor((at + zeros.offset)[:, None] * self._turning / np.pi)
        exact = np.round(at[:, None] * self._turning / np.pi) - (zeros.offset < 0)[:, None]
        slope = self._terms(zeros.origin, zeros.offset).summed(self.asked.take(zeros.question), 1)
        return np.where(here, exact, number).sum(axis=1).astype(int) + (slope > 0)


def _summed(weight: np.ndarray, term: np.ndarray) -> np.ndarray:
    """The sum (k,) of a ``term`` (k, d) times the square of its ``weight`` (k, d), without it where that is zero."""
    with np.errstate(all="ignore"):
        if not np.all(np.isfinite(term)):
            term = np.where(weight == 0, 0.0, np.nan_to_num(term, nan=np.inf))
        return np.einsum("kd,kd,kd->k", weight, weight, term)


def half_angle(rate: float, marks: np.ndarray, origin: np.ndarray, offset: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The sine and cosine (k,) of wσ/2, which next to its own conjugate points are told from these."""
    angle = rate * marks / 2
    number = np.round(angle / (np.pi / 2))
    rest = angle - number * (np.pi / 2)
    # nothing is added to what is beside its own: so the sign of -0 is kept
    rest, own = np.where(np.abs(rest) <= 8 * EPSILON * (1 + angle), -0.0, rest)[origin], rate * offset / 2
    sine, cosine = np.sin(rest + own), np.cos(rest + own)
    odd = (number % 2 == 1)[origin]
    return np.where(odd, cosine, sine), np.where(odd, -sine, cosine)


def _sines(w: float, s: np.ndarray, c: np.ndarray) -> tuple[Derivatives, Derivatives]:
    """s₁² and s₂² of κ < 0 and their derivatives, by the sine and cosine of wσ/2."""
    by_sine, by_cosine, cosine = 1 / (s * s), 1 / (c * c), c * c  # a product takes a tenth of the time of a power
    tangent = s * s * by_cosine
    first = w**2 / 4 * by_sine, -(w**3) / 4 * (c / s) * by_sine, w**4 / 8 * (1 + 2 * cosine) * by_sine * by_sine
    second = tangent / w**2, s / c * by_cosine / w, (1 + tangent) * (1 + 3 * tangent) / 2
    return first, second


def _hyperbolic(w: float, half: np.ndarray) -> tuple[Derivatives, Derivatives]:
    """The same of κ > 0, by wσ/2."""
    s, c = np.sinh(half), np.cosh(half)
    tangent = np.tanh(half) ** 2
    first = (w / 2 / s) ** 2, -(w**3) / 4 * c / s**3, w**4 / 8 * (1 + 2 * c**2) / s**4
    return first, (tangent / w**2, np.tanh(half) / c**2 / w, (1 - 3 * tangent) / c**2 / 2)
