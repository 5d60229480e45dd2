"""All rays between two points where n² is a polynomial of second degree: the zeros of one function of σ.

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

from dataclasses import dataclass, field, replace

import casadi as ca
import numpy as np

from varcalc.numerics.roots import bracketed_newton
from varcalc.optics.media.medium import Medium
from varcalc.optics.models.aimed import CARRIED_WELL, Aimed, Carry, Tell, Told
from varcalc.optics.models.linear import LinearRays, motions
from varcalc.optics.rays.beam import Rows
from varcalc.optics.rays.ray import SHADOW, Ray, Rays, no_rays
from varcalc.symbolic.evaluation import PointEvaluator

EPS = float(np.finfo(float).eps)
SAME_CURVATURE = 16 * EPS
"""Of the largest: principal curvatures that differ by less are the same, or none."""
NO_COORDINATE = 8 * EPS
"""Of the distance of two points and of where they are: what is less is zero."""
TOUCHES_ZERO = 4e-13
"""Of n²: an extremum of G so close to zero is one ray, which touches a caustic."""
MOST_SPANS = 4000
"""Spans between conjugate points of one pair; of a pair that has more the last ones are given up."""
TOGETHER = 128
"""Pairs searched together; bounds the memory."""
FARTHER_AND_FARTHER = 60
"""Of σ, until what is beyond is known to hold no zero."""
HALVED_SPANS = 60
"""How often a span is halved in which G is neither monotone nor bent one way."""
LARGEST_ANGLE = 300.0
"""cosh of more is all but too large for a number."""
OVERLAP = 0.6
"""Of what is between two marks: searched from either, so that no zero is at the end of both searches."""
SAME_ZERO = 1e-10
"""Of σ: zeros so close are one; two next to a caustic are farther apart, or one that touches it."""
STEEPEST = 2 / 3**1.5
"""The largest value of tanh/cosh²."""
SUMMED_ROUND_OFF = 64 * EPS
"""Of what is summed in an optical path."""

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
        with np.errstate(all="ignore"):
            parts = [
                np.where(weight == 0, 0.0, weight**2 * np.nan_to_num(term[order], nan=np.inf))
                for weight, term in ((of.way, self.first), (of.pull, self.second))
            ]
            return (parts[0] + parts[1]).sum(axis=1) - (of.middle if order == 0 else 0.0)


@dataclass
class QuadraticIndex:
    """The rays of a ``medium`` whose n² is a polynomial of second degree in ``dimension`` coordinates."""

    medium: Medium
    dimension: int
    curvature: np.ndarray = field(init=False)
    axes: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        curvature, self.axes, _ = LinearRays(self.medium, self.dimension, ()).principal
        room = SAME_CURVATURE * np.abs(curvature).max()
        curvature = np.where(np.abs(curvature) <= room, 0.0, curvature)
        for k in range(1, len(curvature)):
            for j in range(k):
                if abs(curvature[k] - curvature[j]) <= room:
                    curvature[k] = curvature[j]
        self.curvature = curvature
        position = ca.SX.sym("r", self.dimension)
        squared = ca.SX(self.medium.squared_index(position))
        results = [ca.densify(squared), ca.densify(ca.gradient(squared, position) / 2)]
        self._field = PointEvaluator(ca.Function("field", [position], results))
        rates = np.sqrt(np.abs(curvature))
        self._turning, self._growing = np.where(curvature < 0, rates, 0.0), np.where(curvature > 0, rates, 0.0)

    def applies(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:  # noqa: ARG002
        """True (q,): for all points."""
        return np.ones(len(a), dtype=bool)

    def rays(
        self, a: np.ndarray, b: np.ndarray, within: np.ndarray, carry: Carry, careful: Carry | None = None,  # noqa: ARG002  there is no better way
        tell: Tell | None = None,
    ) -> list[Rays]:  # fmt: skip
        """The rays from each point ``a`` (q, d) to ``b`` (q, d) up to an optical path ``within`` (q,)."""
        answers: list[Rays] = []
        for first in range(0, len(a), TOGETHER):
            part = slice(first, first + TOGETHER)

            def carried_there(
                question: np.ndarray, headings: np.ndarray, paths: np.ndarray, touching: np.ndarray,
                counts: np.ndarray, first: int = first,
            ) -> list[tuple[Ray | None, float]]:  # fmt: skip
                return carry(question + first, headings, paths, touching, counts)

            def told_there(told: Told, first: int = first) -> list[Ray]:
                return tell(replace(told, question=told.question + first)) if tell else []

            answers += self._rays(a[part], b[part], within[part], carried_there, told_there if tell else None)
        return answers

    def _rays(self, a: np.ndarray, b: np.ndarray, within: np.ndarray, carry: Carry, tell: Tell | None) -> list[Rays]:
        """The same for some of the pairs."""
        asked = self._asked(a, b)
        spans, given_up = self._spans(asked, within)
        zeros = Zeros.joined([self._distinct(self._zeros(asked, spans)), self._foci(asked, spans)])
        told, clear, touching, continuum = self._told(asked, zeros, within)
        alone = np.flatnonzero(clear) if tell is not None else np.zeros(0, dtype=int)
        others = np.setdiff1d(np.arange(len(told)), alone)
        some = told.take(others)
        aimed = Aimed(some.question, some.headings, some.paths, touching[others], np.zeros(len(some)), some.counts)
        rays = aimed.carried(len(a), carry, None)
        if tell is not None:
            for question, ray in zip(told.question[alone], tell(told.take(alone)), strict=True):
                rays[question].append(ray)
        lost = np.bincount(told.question, minlength=len(a)) - np.array([len(own) for own in rays])
        answers = zip(rays, within, continuum.tolist(), lost.tolist(), given_up.tolist(), strict=True)
        return [_answer(*own) for own in answers]

    def _asked(self, a: np.ndarray, b: np.ndarray) -> Questions:
        at, middle = self._field(len(a), a), self._field(len(a), (a + b) / 2)
        way, pull = (b - a) @ self.axes, middle[:, 1:] @ self.axes
        room = NO_COORDINATE * (np.linalg.norm(a, axis=1) + np.linalg.norm(b, axis=1))[:, None]
        way[np.abs(way) <= room] = 0.0
        pull[np.abs(pull) <= room * np.abs(self.curvature).max() + NO_COORDINATE * np.abs(at[:, 1:]).max()] = 0.0
        return Questions(way, pull, at[:, 1:] @ self.axes, middle[:, 0], at[:, 0])

    def _last(self, asked: Questions, within: np.ndarray) -> np.ndarray:
        """σ (q,) beyond which there is no zero of G, or none of an optical path up to ``within`` (q,).

        The energies e = p² - κu² of the principal directions, u from the centre of n², add up to n² there, and over σ
        an optical path grows by no less than e(σ/2 - 1/(2w)) of each.
        """
        q, turns = len(asked), self._turning > 0
        straight = (self.curvature == 0) & (asked.pull != 0)
        curved = self.curvature != 0
        centre = asked.middle - (asked.pull[:, curved] ** 2 / self.curvature[curved]).sum(axis=1)
        last = np.full(q, np.inf)
        with np.errstate(all="ignore"):
            falls = 2 * np.sqrt(np.maximum(asked.middle, 0))[:, None] / np.abs(asked.pull)
            last = np.minimum(last, np.where(straight, falls, np.inf).min(axis=1))
            slow = 1 / self._turning[turns].min(initial=np.inf)
            grows = (centre > 0) & ~np.any(straight, axis=1) & np.any(self._growing == 0)
            last = np.where(grows, np.minimum(last, 2 * within / centre + slow), last)
        left, sigma = np.flatnonzero(~np.isfinite(last)), 1.0
        if len(left) and np.any(self._growing):
            sigma = 1 / self._growing.max()
        for _ in range(FARTHER_AND_FARTHER):
            if len(left) == 0:
                break
            last[left] = sigma
            left, sigma = left[~self._nothing_beyond(asked.take(left), sigma)], 2 * sigma
            if sigma * self._growing[self._growing > 0].min(initial=np.inf) > LARGEST_ANGLE:
                break  # nothing changes any more
        return last

    def _nothing_beyond(self, asked: Questions, sigma: float) -> np.ndarray:
        """Whether (q,) G is known to have no zero beyond σ."""
        some = asked.take(np.arange(len(asked)))
        here = self._terms(np.zeros(len(some), dtype=int), np.full(len(some), sigma), np.zeros(1))
        flat = self._turning == 0
        with np.errstate(all="ignore"):
            lower = (some.pull**2 * here.second[0])[:, flat].sum(axis=1)
            most = np.where(self._growing > 0, 1 / self._growing**2, np.inf)
            limit = np.where(some.pull == 0, 0.0, some.pull**2 * most)
            upper = ((some.way**2 * here.first[0]) + limit)[:, flat].sum(axis=1)
        return (lower > some.middle) | (np.all(flat) & (upper < some.middle))

    def _spans(self, asked: Questions, within: np.ndarray) -> tuple[Spans, np.ndarray]:
        """What is to be searched, between conjugate points of fixed σ, and for which pairs (q,) it is not all."""
        last = np.where(asked.middle > 0, self._last(asked, within), 0.0)
        longest, rates = float(last.max(initial=0.0)), np.unique(self._turning[self._turning > 0])
        counts = np.minimum(longest * rates / np.pi + 1, MOST_SPANS).astype(int)
        marks = [np.zeros(1)] + [np.arange(1, n + 1) * np.pi / rate for n, rate in zip(counts, rates, strict=True)]
        self._marks = marks = np.unique(np.concatenate(marks))
        if len(rates) == 0:
            pairs = np.flatnonzero(last > 0)
            origin = np.zeros(len(pairs), dtype=int)
            return Spans(pairs, origin, np.zeros(len(pairs)), last[pairs]), np.zeros(len(last), dtype=int)
        number = np.minimum(np.searchsorted(marks, last), min(len(marks) - 1, MOST_SPANS))
        given_up = (marks[number] < last).astype(int)
        pairs = np.repeat(np.arange(len(last)), number)
        origin = np.arange(len(pairs)) - np.repeat(np.cumsum(number) - number, number)
        half = OVERLAP * (marks[origin + 1] - marks[origin])
        nothing = np.zeros(len(pairs))
        return Spans.joined([Spans(pairs, origin, nothing, half), Spans(pairs, origin + 1, -half, -nothing)]), given_up

    def _terms(self, origin: np.ndarray, offset: np.ndarray, marks: np.ndarray) -> Terms:
        """See :class:`Terms`, at ``offset`` (k,) from the ``marks`` number ``origin`` (k,)."""
        first, second = ([np.empty((len(origin), self.dimension)) for _ in range(3)] for _ in range(2))
        with np.errstate(all="ignore"):
            for k, (turning, growing) in enumerate(zip(self._turning, self._growing, strict=True)):
                if turning:
                    parts = _sines(turning, *_half_angle(turning, marks, origin, offset))
                elif growing:
                    parts = _hyperbolic(growing, np.minimum(growing * (marks[origin] + offset) / 2, LARGEST_ANGLE))
                else:
                    sigma = marks[origin] + offset
                    parts = (
                        (1 / sigma**2, -2 / sigma**3, 6 / sigma**4),
                        (sigma**2 / 4, sigma / 2, np.full(len(sigma), 0.5)),
                    )
                for columns, values in zip((first, second), parts, strict=True):
                    for column, value in zip(columns, values, strict=True):
                        column[:, k] = value
        return Terms((first[0], first[1], first[2]), (second[0], second[1], second[2]))

    def _at(self, asked: Questions, spans: Spans, offset: np.ndarray, order: int) -> np.ndarray:
        return self._terms(spans.origin, offset, self._marks).summed(asked.take(spans.question), order)

    def _zeros(self, asked: Questions, spans: Spans) -> Zeros:
        """All zeros of G in the ``spans``."""
        monotone, touched = [spans.take([])], []
        for _ in range(HALVED_SPANS):
            if len(spans) == 0:
                break
            of = asked.take(spans.question)
            low, high = (self._terms(spans.origin, end, self._marks) for end in (spans.low, spans.high))
            may, steady, bent = self._enclosed(of, low, high)
            monotone.append(spans.take(np.flatnonzero(may & steady)))
            halves, touching = self._parted(asked, spans.take(np.flatnonzero(may & ~steady & bent)))
            monotone.append(halves)
            touched.append(touching)
            spans = spans.take(np.flatnonzero(may & ~steady & ~bent))
            middle = (spans.low + spans.high) / 2
            spans = Spans.joined([
                Spans(spans.question, spans.origin, spans.low, middle),
                Spans(spans.question, spans.origin, middle, spans.high),
            ])  # fmt: skip
        return Zeros.joined([self._crossed(asked, Spans.joined(monotone)), *touched])

    def _distinct(self, zeros: Zeros) -> Zeros:
        """The zeros, none twice."""
        sigma = self._marks[zeros.origin] + zeros.offset
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

    def _parted(self, asked: Questions, spans: Spans) -> tuple[Spans, Zeros]:
        """The parts on both sides of the one extremum of G in each of the ``spans``, and the zeros that are at one."""
        of = asked.take(spans.question)
        ends = [self._at(asked, spans, end, 1) for end in (spans.low, spans.high)]
        with np.errstate(all="ignore"):
            inside = np.sign(ends[0]) * np.sign(ends[1]) < 0
        whole, rows = spans.take(np.flatnonzero(~inside)), np.flatnonzero(inside)
        spans, of, sign = spans.take(rows), of.take(rows), np.sign(ends[0][rows])
        at = self._solved(asked, spans, sign, 1)
        value = self._at(asked, spans, at, 0)
        touching = np.abs(value) <= TOUCHES_ZERO * of.middle
        free = np.zeros(of.way.shape, dtype=bool)
        zeros = Zeros(spans.question, spans.origin, at, touching, free).take(np.flatnonzero(touching))
        left, at = spans.take(np.flatnonzero(~touching)), at[~touching]
        parts = [
            Spans(left.question, left.origin, left.low, at), Spans(left.question, left.origin, at, left.high),
        ]  # fmt: skip
        return Spans.joined([whole, *parts]), zeros

    def _solved(self, asked: Questions, spans: Spans, sign: np.ndarray, order: int) -> np.ndarray:
        """Where (k,) the derivative of an ``order`` of G vanishes, whose ``sign`` (k,) is that at the lower ends."""

        def signed(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            terms, of = self._terms(spans.origin, at, self._marks), asked.take(spans.question)
            return sign * terms.summed(of, order), sign * terms.summed(of, order + 1)

        if len(spans) == 0:
            return np.zeros(0)
        return bracketed_newton(signed, spans.low, spans.high, (spans.low + spans.high) / 2, relative=2 * EPS)[0]

    def _crossed(self, asked: Questions, spans: Spans) -> Zeros:
        """The zeros of G in ``spans`` in which it is monotone."""
        ends = [self._at(asked, spans, end, 0) for end in (spans.low, spans.high)]
        rows = np.flatnonzero((ends[0] > 0) != (ends[1] > 0))
        spans, sign = spans.take(rows), np.where(ends[0][rows] > 0, 1.0, -1.0)
        plain = np.zeros((len(rows), 1 + self.dimension), dtype=bool)
        return Zeros(spans.question, spans.origin, self._solved(asked, spans, sign, 0), plain[:, 0], plain[:, 1:])

    def _foci(self, asked: Questions, spans: Spans) -> Zeros:
        """Conjugate points at which rays of all momenta in some principal directions come together, at b itself."""
        pairs, origin = np.unique(np.stack([spans.question, spans.origin]), axis=1)
        pairs, origin = pairs[origin > 0], origin[origin > 0]
        here, odd = self._conjugate(origin)
        of = asked.take(pairs)
        free = here & (np.where(odd, of.pull, of.way) == 0)
        rows = np.flatnonzero(np.any(free, axis=1) & np.all(free | ~here, axis=1))
        nothing = np.zeros(len(rows))
        return Zeros(pairs[rows], origin[rows], nothing, nothing == 0, free[rows])

    def _conjugate(self, origin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Which principal directions (k, d) the marks ``origin`` (k,) are of, and whether it is an odd one of these."""
        with np.errstate(all="ignore"):
            number = self._marks[origin][:, None] * self._turning / np.pi
        whole = np.round(number)
        return (self._turning > 0) & (np.abs(number - whole) <= 4 * EPS * whole), whole % 2 == 1

    def _courses(self, asked: Questions, zeros: Zeros) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The momenta (k, d) of the rays of ``zeros`` at both ends, and their optical paths (k,).

        About the middle of σ momenta are d s₁ cos wτ - g/(w cos(wσ/2)) sin wτ, or their like.
        """
        of, sigma = asked.take(zeros.question), self._marks[zeros.origin] + zeros.offset
        first, last, path = np.zeros_like(of.way), np.zeros_like(of.way), np.zeros(len(sigma))
        with np.errstate(all="ignore"):
            for k, curvature in enumerate(self.curvature):
                w = np.sqrt(abs(curvature))
                if curvature < 0:
                    s, c = _half_angle(w, self._marks, zeros.origin, zeros.offset)
                    even, odd = of.way[:, k] * w / 2 / s, of.pull[:, k] / w / c
                elif curvature > 0:
                    half = np.minimum(w * sigma / 2, LARGEST_ANGLE)
                    s, c = np.sinh(half), np.cosh(half)
                    even, odd = of.way[:, k] * w / 2 / s, of.pull[:, k] / w / c
                else:
                    s, c = sigma / 2, np.ones(len(sigma))
                    even, odd = of.way[:, k] / sigma, of.pull[:, k]
                even, odd = (np.where(weight[:, k] == 0, 0.0, v) for weight, v in ((of.way, even), (of.pull, odd)))
                parts = motions(float(curvature), sigma / 2)
                path += 2 * (even**2 * parts.of_zeroth + (odd * (w or 1.0)) ** 2 * parts.of_first)
                first[:, k], last[:, k] = even * c - odd * s, even * c + odd * s
        return first, last, path

    def _focused(self, asked: Questions, foci: Zeros, first: np.ndarray, last: np.ndarray, path: np.ndarray) -> None:
        """Give the rays of ``foci``, in place, the momenta in their free directions that are missing of n²."""
        free = foci.free
        missing = asked.squared[foci.question] - np.sum(first**2, axis=1)
        one = np.argmax(free, axis=1)
        rows = np.arange(len(one))
        with np.errstate(invalid="ignore"):
            momentum = np.sqrt(missing)
        _, odd = self._conjugate(foci.origin)
        first[rows, one] = momentum
        last[rows, one] = np.where(odd[rows, one], -momentum, momentum)
        path += momentum**2 * self._marks[foci.origin] / 2  # whole turns: the mean of the square is half

    def _told(
        self, asked: Questions, zeros: Zeros, within: np.ndarray
    ) -> tuple[Told, np.ndarray, np.ndarray, np.ndarray]:
        """What is known of rays, of which (k,) that is enough, which touch caustics, and pairs (q,) with continua."""
        first, last, path = self._courses(asked, zeros)
        focus = np.any(zeros.free, axis=1)
        foci = np.flatnonzero(focus)
        parts = first[foci], last[foci], path[foci]
        self._focused(asked, zeros.take(foci), *parts)
        first[foci], last[foci], path[foci] = parts
        counts = self._conjugate_points(asked, zeros)
        many = zeros.free.sum(axis=1) > 1
        rows = np.flatnonzero(path <= within[zeros.question])  # what is no number is no ray
        other = rows[focus[rows] & ~many[rows]]  # the ray with the opposite momentum
        both = np.concatenate([rows, other])
        back = np.append(np.zeros(len(rows), dtype=bool), np.ones(len(other), dtype=bool))[:, None] & zeros.free[both]
        first, last = np.where(back, -first[both], first[both]), np.where(back, -last[both], last[both])
        touching = zeros.touching[both] & (many[both] | ~focus[both])
        counts = np.where(zeros.touching[both] | focus[both], -1, counts[both])
        headings, arriving = ((v / np.linalg.norm(v, axis=1, keepdims=True)) @ self.axes.T for v in (first, last))
        nothing, paths = np.ones(len(both)), path[both]
        told = Told(zeros.question[both], headings, arriving, paths, SUMMED_ROUND_OFF * paths, counts, nothing)
        continuum = np.bincount(zeros.question[both][many[both]], minlength=len(within)) > 0
        with np.errstate(over="ignore"):  # rays that grow apart are only where directions tell them if they are carried
            apart = EPS * np.exp(self._growing.max() * (self._marks[zeros.origin] + zeros.offset)[both])
        return told, ~focus[both] & ~touching & (apart <= CARRIED_WELL), touching, continuum

    def _conjugate_points(self, asked: Questions, zeros: Zeros) -> np.ndarray:
        """How many conjugate points (k,) the rays pass: those of a fixed σ, and one more where G grows."""
        here, _ = self._conjugate(zeros.origin)
        at = self._marks[zeros.origin]
        number = np.floor((at + zeros.offset)[:, None] * self._turning / np.pi)
        exact = np.round(at[:, None] * self._turning / np.pi) - (zeros.offset < 0)[:, None]
        slope = self._terms(zeros.origin, zeros.offset, self._marks).summed(asked.take(zeros.question), 1)
        return np.where(here, exact, number).sum(axis=1).astype(int) + (slope > 0)


def _answer(rays: list[Ray], within: float, continuum: bool, apart: int, given_up: int) -> Rays:
    """What is said of one pair."""
    lost, unresolved = f"; {apart} that grow apart beyond what directions tell" if apart else "", apart + given_up
    lost += f"; not beyond {MOST_SPANS} conjugate points" if given_up else ""
    searched = f"all zeros of one function of the ray parameter, as n² is of second degree{lost}, "
    searched += f"optical paths up to {within:.6g}"
    if not rays:
        return no_rays(SHADOW, searched, unresolved)
    return Rays(tuple(sorted(rays, key=lambda ray: ray.optical_path)), "", searched, continuum, unresolved)


def _half_angle(
    rate: float, marks: np.ndarray, origin: np.ndarray, offset: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The sine and cosine (k,) of wσ/2, which next to its own conjugate points are told from these."""
    angle = rate * marks[origin] / 2
    number = np.round(angle / (np.pi / 2))
    rest = angle - number * (np.pi / 2)
    beside = rate * offset / 2
    rest = np.where(np.abs(rest) <= 8 * EPS * (1 + angle), beside, rest + beside)  # which keeps the sign of -0
    sine, cosine = np.sin(rest), np.cos(rest)
    odd = number % 2 == 1
    return np.where(odd, cosine, sine), np.where(odd, -sine, cosine)


def _sines(w: float, s: np.ndarray, c: np.ndarray) -> tuple[Derivatives, Derivatives]:
    """s₁² and s₂² of κ < 0 and their derivatives, by the sine and cosine of wσ/2."""
    tangent = (s / c) ** 2
    first = (w / 2 / s) ** 2, -(w**3) / 4 * c / s**3, w**4 / 8 * (1 + 2 * c**2) / s**4
    return first, (tangent / w**2, s / c**3 / w, (1 + tangent) * (1 + 3 * tangent) / 2)


def _hyperbolic(w: float, half: np.ndarray) -> tuple[Derivatives, Derivatives]:
    """The same of κ > 0, by wσ/2."""
    s, c = np.sinh(half), np.cosh(half)
    tangent = np.tanh(half) ** 2
    first = (w / 2 / s) ** 2, -(w**3) / 4 * c / s**3, w**4 / 8 * (1 + 2 * c**2) / s**4
    return first, (tangent / w**2, np.tanh(half) / c**2 / w, (1 - 3 * tangent) / c**2 / 2)
