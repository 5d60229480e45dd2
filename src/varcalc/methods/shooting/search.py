"""The search for extremals by multiple shooting: where to start, where to cut, which to keep."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from varcalc.formulation import Sampled
from varcalc.formulation.height import height
from varcalc.integrators import Flow, RunOutcome
from varcalc.methods.ritz.starts import LADDER, bent, scaled_ring
from varcalc.methods.shooting.flow import EulerLagrangeFlow, Scales
from varcalc.methods.shooting.initial_states import (
    growth_rate,
    lambdas,
    nus,
    partition,
    scales,
    states,
    unknown_numbers,
)
from varcalc.methods.shooting.newton import LOOK, Matched, Termination, iterate
from varcalc.methods.shooting.regular_arc import RegularEnd, Work
from varcalc.methods.shooting.segments import Mismatch, Segments
from varcalc.methods.shooting.shot_extremal import value_of
from varcalc.methods.shooting.shots import Failure

MOST_GROWTH = math.exp(10.0)
"""Growth of errors across a segment beyond which it is cut in two."""
PLANNED = 6.0
"""Logarithm of the growth planned for a segment: less than is allowed, since the plan is made on a guess."""
FEWEST_SEGMENTS, MOST_SEGMENTS, MOST_NONLINEAR = 4, 20000, 2000
"""Segments planned at least and at most; a nonlinear problem's plan rests on a guess and is not worth more."""
BUDGET, PER_SEGMENT = 2500, 24
"""Work, in runs of the flow, spent on one start: the larger of the first, and the second for each planned segment."""
TOTAL = 6000
"""Work spent on all starts after which no other is tried: some two seconds."""
ALL_FAIL = 64
"""Segments beyond which a start is given up when every one of them fails."""
SHORTEST = 1e-6
"""Part of the interval below which a segment that cannot be crossed is not cut any more."""
MANY_SEGMENTS = 4
"""A start that needs so many times the segments of a flat one is tried after it."""
FIRST_AMPLITUDES = (0.3, -0.3)
"""Bent starts that are tried even where the straight one led somewhere: the lower extremal may lie elsewhere."""
OTHER_AMPLITUDES = (1.0, -1.0, 3.0, -3.0, 0.1, -0.1, 10.0, -10.0)
"""Bent starts that are tried where none has led anywhere yet."""
GROWTH_POINTS = 65
"""Points at which the growth along a starting curve is looked at."""
LARGEST_CONDITION = 1e12
"""Condition number beyond which a linear system is called singular."""
UNSURE = 1e5
"""Condition number beyond which a look does not tell whether there is an extremal."""
FLOOR = 1e-3
"""Sizes of states, relative to their units, below which they are not measured by themselves."""


@dataclass(frozen=True)
class ShootingStart:
    """A starting curve with its units, isoperimetric multipliers and first vertices, in t."""

    curve: Sampled
    units: Scales
    lambdas: np.ndarray
    vertices: np.ndarray

    @property
    def planned(self) -> int:
        """The number of segments that the curve calls for."""
        return len(self.vertices) - 1


@dataclass(frozen=True)
class Found:
    """Converged segments, their unknowns x (M,) with the sizes they are measured by, and what is minimised there.

    ``work`` is what it took, in runs of the flow.
    """

    segments: Segments
    x: np.ndarray
    at: Mismatch
    floor: np.ndarray
    value: float
    iterations: int
    work: int


@dataclass(frozen=True)
class NoneFound:
    """No start led to an extremal, and why."""

    message: str
    iterations: int
    work: int = 0


def describe(failure: Failure) -> str:
    """A failed integration in words."""
    return (
        f"the Euler-Lagrange equation could not be integrated beyond {failure.s:.6g} "
        f"(in segment {failure.segments[0] + 1}): {failure.outcome.value}"
    )


@dataclass(frozen=True)
class Search:
    """All starts for one compiled system; ``count`` fixes the number of segments."""

    equations: EulerLagrangeFlow
    flow: Flow
    work: Work
    count: int | None

    def best(self, guess: Sampled | None) -> Found | NoneFound:
        """The extremal of the lowest value among those found, or why there is none."""
        found: list[Found] = []
        iterations, last, budget, spent = 0, "", 0, 0
        for first, start in self._starts(guess):
            if (found and not first) or spent > TOTAL:
                break
            outcome = self._attempt(start, budget)
            iterations, spent = iterations + outcome.iterations, spent + outcome.work
            if isinstance(outcome, NoneFound):
                hopeless = self.equations.linear and outcome.work > 0
                last = last or outcome.message
                if hopeless:
                    break
                continue
            found.append(outcome)
            budget = 2 * max(f.work for f in found)
            if guess is not None or self.equations.linear:
                break
        if found:
            return min(found, key=lambda f: f.value)
        return NoneFound(f"no starting curve led to an extremal; of the first one: {last}", iterations)

    def _starts(self, guess: Sampled | None) -> Iterator[tuple[bool, ShootingStart]]:
        """Starting curves; those marked True are tried whatever the others gave."""
        form = self.equations.form
        if guess is not None:
            yield True, self._start(guess)
        if form.conditions.integrals:
            yield from ((True, self._start(curve)) for curve in self._meeting_level())
        scale, straight = height(form), self._start(form.start.curve)
        steep = self.count is None and straight.planned > MANY_SEGMENTS * FEWEST_SEGMENTS
        steep = steep and straight.planned > MANY_SEGMENTS * min(start.planned for start in self._flat())
        if steep:
            yield from ((False, start) for start in self._flat())
        yield not steep, straight
        for first, amplitudes in ((not steep, FIRST_AMPLITUDES), (False, OTHER_AMPLITUDES)):
            for direction in form.start.bumps:
                for amplitude in amplitudes:
                    if any(amplitude * direction[k] < 0 for k in form.coordinates.one_sided):
                        continue
                    yield first, self._start(bent(form, amplitude * scale, direction))
        if not steep:
            yield from ((False, start) for start in self._flat())

    def _flat(self) -> list[ShootingStart]:
        """The ordinates of one end all along: a start need not meet the ends, and steep ends make steep starts."""
        form = self.equations.form
        levels = [form.start.curve(np.array([end])) for end in form.span]
        starts = [self._start(lambda s, level=level: np.repeat(level, len(s), axis=1)) for level in levels]
        return sorted(starts, key=lambda start: start.planned)

    def _start(self, curve: Sampled) -> ShootingStart:
        """A starting curve with what it calls for."""
        units, lam = scales(self.equations, curve), lambdas(self.equations, curve)
        return ShootingStart(curve, units, lam, self._vertices(curve, units, lam))

    def _vertices(self, curve: Sampled, units: Scales, lam: np.ndarray) -> np.ndarray:
        """The vertices of the first segments, in t."""
        form = self.equations.form
        marks = (np.array(form.conditions.knots) - form.span[0]) / (form.span[1] - form.span[0])
        if self.count is not None:
            least = max(self.count, sum(form.coordinates.singular))  # a regular arc leads to one end
            return np.unique([*np.linspace(0, 1, least + 1), *marks])
        t = np.linspace(0, 1, GROWTH_POINTS)
        rate = growth_rate(self.equations, units, curve, lam, t)
        for singular, inward in zip(form.coordinates.singular, (t, 1 - t), strict=True):
            if singular:  # the plan is for a regular arc, along which errors do not grow
                rate[inward < 1 / FEWEST_SEGMENTS] = 0.0
        most = MOST_SEGMENTS if self.equations.linear else MOST_NONLINEAR
        return partition(rate, t, marks, PLANNED, FEWEST_SEGMENTS, most)

    def _meeting_level(self) -> Iterator[Sampled]:
        """The baseline bent, or blown up, until the first isoperimetric condition holds; each way."""
        form = self.equations.form
        scale = height(form)
        ring = form.ends.periodic and form.n > 1 and bool(np.any(form.start.curve(np.array(form.span))))
        ways = [None] if ring else [sign * d for d in form.start.bumps for sign in (1.0, -1.0)]
        for way in ways:
            previous, best = math.nan, (math.inf, form.start.curve)
            for amplitude in LADDER:
                curve = scaled_ring(form, amplitude * scale) if way is None else bent(form, amplitude * scale, way)
                miss = self._level(curve) - form.conditions.integrals[0].lower
                if abs(miss) < best[0]:
                    best = (abs(miss), curve)
                if previous * miss < 0:
                    break
                previous = miss
            if math.isfinite(best[0]):
                yield best[1]

    def _level(self, curve: Sampled) -> float:
        """The first isoperimetric integral along a curve, roughly; NaN where it is not a number."""
        form = self.equations.form
        s = np.linspace(*form.span, 2 * GROWTH_POINTS - 1)
        middle, width = 0.5 * (s[1:] + s[:-1]), np.diff(s)
        slopes = np.diff(curve(s), axis=1) / width
        return float(self.equations.densities_roughly(middle, curve(middle), slopes)[1] @ width)

    def _attempt(self, start: ShootingStart, budget: int) -> Found | NoneFound:
        """Newton from one starting curve, cutting segments where that is called for; ``budget`` 0 is the usual one.

        A look finds most extremals as well as an exact integration; what it does not find is looked for again.
        """
        segments, x = self._first(start)
        if budget and segments.count > budget:
            return NoneFound("too many segments", 0)
        budget = budget or max(BUDGET, PER_SEGMENT * segments.count)
        iterations, begun = 0, self.work.total
        exact = self.count is not None or self.equations.linear or start.planned > FEWEST_SEGMENTS
        level = 0 if exact else LOOK
        while True:
            floor = self._floor(segments, x)
            limit = MOST_GROWTH if self.count is None else math.inf
            result = iterate(segments, x, floor, limit, begun + budget - self.work.total, level)
            iterations += result.iterations
            work = self.work.total - begun
            if level == LOOK and self._unsure(result):
                level = 0
                continue
            if result.ending is Termination.CONVERGED and result.at is not None:
                value = value_of(segments, result.x, result.at.shots)
                return Found(segments, result.x, result.at, floor, value, iterations, work)
            marked = self._marked(segments, result)
            hopeless = result.ending is Termination.FAILED and marked.all() and segments.count > ALL_FAIL
            over = hopeless or work + segments.count + marked.sum() > budget
            if over or not marked.any():
                return NoneFound(_reason(result, self.count), iterations, work)
            segments, x = self._cut(segments, result, marked, start)

    def _unsure(self, result: Matched) -> bool:
        """Whether a look ended where an exact integration may end otherwise."""
        if (
            result.ending is Termination.CONVERGED and result.at is not None
        ):  # a closed curve may be shifted along itself
            return not (self.equations.form.ends.periodic or result.at.jacobian.condition < UNSURE)
        return result.ending in {Termination.DAMPED_OUT, Termination.SINGULAR, Termination.GROWTH}

    def _marked(self, segments: Segments, result: Matched) -> np.ndarray:
        """The segments to cut in two."""
        marked = np.zeros(segments.count, dtype=bool)
        if self.count is not None or result.ending in (Termination.SINGULAR, Termination.RUNAWAY, Termination.TOO_MANY):
            return marked
        if result.ending is Termination.GROWTH and result.at is not None:
            return result.at.growth > MOST_GROWTH
        if result.failure is not None and result.failure.outcome is not RunOutcome.NOT_FINITE:
            marked[list(result.failure.segments)] = True
            return marked & (np.diff(segments.vertices) > SHORTEST)
        return ~marked if result.at is not None and segments.count < 4 * FEWEST_SEGMENTS else marked

    def _cut(
        self, segments: Segments, result: Matched, marked: np.ndarray, start: ShootingStart
    ) -> tuple[Segments, np.ndarray]:
        paths = None if result.at is None else segments.paths(result.x, 0)

        def states_at(segment: np.ndarray, t: np.ndarray) -> np.ndarray:
            """The states at places of segments, from the runs where these were kept, or else from the start."""
            if paths is not None:
                return paths.states_at(segment, t)
            pieces = np.column_stack([segments.vertices[segment], segments.vertices[segment + 1]])
            return states(self.equations, start.units, start.curve, pieces, t)

        return segments.halved(result.x, marked, states_at)

    def _first(self, start: ShootingStart) -> tuple[Segments, np.ndarray]:
        """The first segments and the unknowns of a starting curve."""
        equations, form = self.equations, self.equations.form
        units, lam, vertices = start.units, start.lambdas, start.vertices
        pieces = np.column_stack([vertices[:-1], vertices[1:]])
        # at the left vertices, and at the end
        z = states(equations, units, start.curve, np.concatenate([pieces, pieces[-1:]]), vertices)
        ends, z = z[[0, -1]], z[:-1]
        anchors = vertices[:-1].copy()
        anchors[0] = self._first_anchor(start, ends[0])
        if anchors[0] != vertices[0]:
            z[0] = states(equations, units, start.curve, pieces[:1], anchors[:1])[0]
        unknowns = unknown_numbers(form, start.curve)
        x = np.concatenate([z.ravel(), unknowns, lam, nus(equations, units, ends, unknowns, lam)])
        waypoints, (a, b) = dict(form.conditions.waypoints), form.span
        knots = {
            int(np.searchsorted(vertices, (s - a) / (b - a))): equations.knot(s, waypoints.get(s))
            for s in form.conditions.knots
        }
        regular = self._regular(start.curve, units)
        return Segments(equations, self.flow, self.work, units, vertices, anchors, knots, regular), x

    def _first_anchor(self, start: ShootingStart, state: np.ndarray) -> float:
        """The start; another place in the first segment where the system is no number at the ``state`` (D,) there."""
        equations, form = self.equations, self.equations.form
        line = equations.line(0.0, 1.0, (True, False))
        numbers = [line, start.units.all, form.problem.parameter_values, form.start.unknowns, start.lambdas]
        state = np.concatenate([state, np.zeros(equations.integrals)])
        if form.coordinates.singular[0]:
            return float(start.vertices[1])
        if np.all(np.isfinite(np.asarray(equations.scaled(0.0, state, np.concatenate(numbers))))):
            return 0.0
        return float(start.vertices[1]) if start.planned > 1 else 0.5

    def _regular(self, curve: Sampled, units: Scales) -> tuple[RegularEnd | None, RegularEnd | None]:
        """The singular ends, with a starting curve."""
        form = self.equations.form
        a, width = form.span[0], form.span[1] - form.span[0]

        def scaled(t: np.ndarray) -> np.ndarray:
            return curve(a + width * t) / units.ordinates[:, None]

        start, end = (
            RegularEnd(self.equations, at, fixed[0] / units.ordinates, scaled) if singular else None
            for at, fixed, singular in zip(
                (0.0, 1.0), (form.ends.start, form.ends.end), form.coordinates.singular, strict=True
            )
        )
        return start, end

    def _floor(self, segments: Segments, x: np.ndarray) -> np.ndarray:
        """Sizes below which the unknowns are not measured by themselves."""
        z, unknowns, lam, nu = segments.parts(x)
        typical = np.maximum(np.abs(z).max(axis=0), FLOOR)
        states_ = np.tile(np.maximum(typical, 1.0), (segments.count, 1)).ravel()
        others = [np.where(np.abs(v) > 0, np.abs(v), 1.0) for v in (unknowns, lam, nu)]
        return np.concatenate([states_, *others])


def _reason(result: Matched, count: int | None) -> str:
    """Why an iteration ended without an extremal, and what to do about it."""
    if result.ending is Termination.SINGULAR or (
        result.at is not None and result.at.jacobian.condition > LARGEST_CONDITION
    ):
        return (
            "the linear system of the segments is singular: the ends may be conjugate to each other, so that no "
            "isolated extremal joins them, or a constraint may not depend on the curve"
        )
    if result.failure is not None and result.failure.outcome is not RunOutcome.COMPLETED:
        text = describe(result.failure)
    else:
        text = f"{result.ending.value}, the last correction being {result.correction:.1e} of the unknowns"
    if count is not None and result.at is not None and result.at.growth.max() > MOST_GROWTH:
        digits = math.log10(float(result.at.growth.max()))
        text += (
            f"; errors grow by 1e{digits:.1f} across a segment, which costs {digits:.1f} of the 16 digits: "
            "use Shooting() with segments chosen by the growth"
        )
    return text
