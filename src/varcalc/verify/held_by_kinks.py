"""Whether a kink along which a curve runs holds it: small bumps either way must make the functional no better.

Beside a kink L has two gradients. A variation leads to one side of the kink or the other, place by place, and the first
variation takes the gradient of that side: that it is nowhere less than zero is necessary for a minimum, and sufficient
where L is convex (Clarke, "Optimization and Nonsmooth Analysis", 1983, sect. 4.4).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import casadi as ca
import numpy as np
from numpy.polynomial import Polynomial

from varcalc.formulation import formulate
from varcalc.formulation.height import height
from varcalc.methods.crossings import Crossing, met_by, on_curve
from varcalc.numerics.mesh import composite_gauss
from varcalc.numerics.runs import runs
from varcalc.problem.breaks import bounds, integrals
from varcalc.problem.conditions import Bound, Holonomic
from varcalc.problem.functional import Functional, arguments_at
from varcalc.solution import Finding, Solution, Verdict
from varcalc.symbolic.derived import derived
from varcalc.verify.candidate import HELD_TO, Candidate
from varcalc.verify.check import Check

ARCH = Polynomial([0.0, 0.0, 16.0, -32.0, 16.0])
"""A bump on [0, 1] that is level at its ends, and 1 high."""
PARTS, FEWER, POINTS_A_PART = 64, 4, 8
"""Parts of a stretch that have bumps of their own; by how many fewer there are next; Gauss points of a part."""
BESIDE_KINK = 1e-7
"""Distance from a kink, in units of what the functional feels, at which the gradients on its sides are taken."""
NOT_NEGATIVE = 1e-5
"""Part of its terms by which a first variation may be less than zero: what gradients beside a kink are off by."""
HEIGHTS = np.geomspace(1e-7, 1.0, 29)
"""Heights of bumps, in units of what the functional feels, of which the best one is taken."""
SUM_ROUND_OFF = 1e-13
"""Part of what is summed by which two sums may differ."""
LET_GO_WIDER = (0.0, 0.25, 0.5)
"""By how much, in units of its width, what is let go is tried wider at either end."""
TRIED = 6
"""Places where a kink may not hold the curve that are tried, the likeliest first."""
CLEAR_OF_BOUND = 1e-6
"""Distance from a bound, in units of what it bounds, from which on it presses nothing."""


@dataclass(frozen=True)
class Release:
    """Where a kink does not hold a curve that runs along it: between which abscissae, and which way the curve goes.

    A bump as high as ``step`` (n,), in the curve's own units, makes what is minimised less by ``gain``.
    """

    start: float
    end: float
    step: np.ndarray
    gain: float = 0.0

    def bump(self, x: np.ndarray, derivative: int) -> np.ndarray:
        """The bump at x (m,), or its derivative; shape (n, m)."""
        width = self.end - self.start
        part = (x - self.start) / width
        form = ARCH.deriv(derivative) if derivative else ARCH
        return self.step[:, None] * np.where((part > 0) & (part < 1), form(part), 0.0) / width**derivative


def released(solution: Solution, crossing: Crossing) -> Release | None:
    """Where the switch that a solution's curve runs along does not hold it; None where it does, or a bound may.

    The first variation tells where; that a bump lowers what is minimised, by more than the solution claims, shows it:
    something else may hold the curve as well.
    """
    problem, until = solution.problem, crossing.until
    if solution.curve is None or until is None or any(problem.of_type(Holonomic)):
        return None
    edges = np.linspace(crossing.x, until, PARTS + 1)
    x, weights = composite_gauss(edges, POINTS_A_PART)
    sides = _Sides(solution, crossing, x)
    if not sides.known or sides.beside_bound():
        return None
    suspected = sorted(_suspected(sides, weights, edges), key=lambda found: found[0])
    freed = (_let_go(solution, list(_wider(release, crossing.x, until))) for _, release in suspected[:TRIED])
    return next(filter(None, freed), None)


def _wider(release: Release, first: float, last: float) -> Iterator[Release]:
    """The release, and wider ones: a curve lets go before it is pulled too hard, and comes back later."""
    width = release.end - release.start
    for before, after in product(LET_GO_WIDER, repeat=2):
        start, end = max(first, release.start - before * width), min(last, release.end + after * width)
        yield replace(release, start=start, end=end)


def _suspected(sides: _Sides, weights: np.ndarray, edges: np.ndarray) -> Iterator[tuple[float, Release]]:
    """Runs of parts on which a bump's first variation is negative: how much so, in units of its terms, and they."""
    for direction in np.concatenate([np.eye(sides.problem.n), -np.eye(sides.problem.n)]):
        parts = PARTS
        while parts >= 1:
            ends = edges[:: PARTS // parts]
            variation, size = sides.first_variation(direction, weights, ends)
            for first, last in runs(variation < -NOT_NEGATIVE * size):
                share = float((variation[first : last + 1] / size[first : last + 1]).min())
                yield share, Release(float(ends[first]), float(ends[last + 1]), sides.unit * direction)
            parts //= FEWER


def _let_go(solution: Solution, releases: Sequence[Release]) -> Release | None:
    """The release, and the height of its bump, that make what is minimised least; None where none lowers it surely."""
    problem, curve = solution.problem, solution.curve
    assert curve is not None
    first, last = min(r.start for r in releases), max(r.end for r in releases)
    x, weights = composite_gauss(np.linspace(first, last, PARTS + 1), POINTS_A_PART)
    known = [curve(x, k) for k in range(1 + problem.order)]
    weighed = np.array([1.0, *(-m for m in solution.multipliers if isinstance(m, float))])
    held = [c.interval for c in problem.constraints if isinstance(c, Bound)]

    def values(heights: np.ndarray, release: Release) -> np.ndarray:
        """What is summed at x, infinite where a bound is passed, with bumps so high (h,); shape (h, m)."""
        bent = [np.hstack([rows + height * release.bump(x, k) for height in heights]) for k, rows in enumerate(known)]
        at = arguments_at(problem, np.tile(x, len(heights)), *bent, unknowns=solution.unknown_values)
        terms = np.vstack([np.asarray(term) for term in integrals(problem).call(at)])
        summed = problem.sign * (weighed @ terms)
        for (low, high), row in zip(held, np.asarray(bounds(problem)(*at)) if held else (), strict=True):
            summed = np.where((low <= row) & (row <= high), summed, np.inf)
        return summed.reshape(len(heights), len(x))

    own = values(np.zeros(1), releases[0])[0]
    best, enough = None, solution.error.value + SUM_ROUND_OFF * float(np.abs(own) @ weights)
    for release in releases:
        with np.errstate(invalid="ignore"):
            gains = np.nan_to_num((own - values(HEIGHTS, release)) @ weights, nan=-np.inf)
        k = int(np.argmax(gains))
        if gains[k] > (enough if best is None else best.gain):
            best = replace(release, step=HEIGHTS[k] * release.step, gain=float(gains[k]))
    return best


class _Sides:
    """The gradients of what is minimised on both sides of a switch along which a curve runs, at abscissae x (m,)."""

    def __init__(self, solution: Solution, crossing: Crossing, x: np.ndarray) -> None:
        problem, curve = solution.problem, solution.curve
        assert curve is not None
        self.problem, self.x = problem, x
        self.unit, order = height(formulate(problem)), problem.order
        length = problem.span[1] - problem.span[0]
        units = np.repeat(self.unit / length ** np.arange(1 + order), problem.n)[:, None]
        self._unknowns = solution.unknown_values
        number = next(i for i, switch in enumerate(on_curve(problem)) if switch is crossing.switch)
        on = np.concatenate([curve(x, k) for k in range(1 + order)])
        value, rate = (np.asarray(v) for v in _argument(problem)[number](*self._at(on)))
        self._rate = rate  # of the argument, by the ordinates and their derivatives
        scaled = self._rate * units
        steepness = np.sqrt((scaled**2).sum(0))
        with np.errstate(all="ignore"):
            self._on = on - (value - crossing.level) * units * scaled / steepness**2
            aside = BESIDE_KINK * units * scaled / steepness
            self._gradients = [self._gradient(solution, self._on + way * aside) for way in (-1, 1)]
        self.known = bool(np.isfinite(self._gradients).all())

    def _at(self, state: np.ndarray) -> list[np.ndarray]:
        """The arguments of the problem's expressions where ordinates and their derivatives are ``state``."""
        derivatives = state.reshape(-1, self.problem.n, len(self.x))
        return arguments_at(self.problem, self.x, *derivatives, unknowns=self._unknowns)

    def _gradient(self, solution: Solution, state: np.ndarray) -> np.ndarray:
        """That of what is minimised, levels with their multipliers included; shape (n (1 + order), m)."""
        weighed = np.array([1.0, *(-m for m in solution.multipliers if isinstance(m, float))])
        rates = np.asarray(_gradients(self.problem)(*self._at(state))).reshape(len(state), len(self.x), -1)
        return self.problem.sign * rates @ weighed

    def beside_bound(self) -> bool:
        """Whether a bound may press the curve."""
        held = [*self.problem.of_type(Bound)]
        if not held:
            return False
        along = np.asarray(bounds(self.problem)(*self._at(self._on)))
        return any(
            bool((np.abs(row - level) <= CLEAR_OF_BOUND * max(1.0, float(np.abs(row).max()))).any())
            for bound, row in zip(held, along, strict=True) for level in bound.interval if np.isfinite(level)
        )  # fmt: skip

    def first_variation(
        self, direction: np.ndarray, weights: np.ndarray, edges: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """That for a bump on each part between ``edges``, all in one direction (n,); and the size of its terms."""
        parts, width = len(edges) - 1, float(edges[1] - edges[0])
        part = (self.x - np.repeat(edges[:-1], len(self.x) // parts)) / width
        shapes = [(ARCH.deriv(k) if k else ARCH)(part) / width**k for k in range(1 + self.problem.order)]
        variation = np.concatenate([direction[:, None] * shape for shape in shapes])
        above = (self._rate * variation).sum(0) > 0
        terms = np.where(above, self._gradients[1], self._gradients[0]) * variation
        apart = np.abs(self._gradients[1] * variation) + np.abs(self._gradients[0] * variation)
        return (weights * terms.sum(0)).reshape(parts, -1).sum(1), (weights * apart.sum(0)).reshape(parts, -1).sum(1)


@derived
def _argument(problem: Functional) -> list[ca.Function]:
    """What decides each switch of ``on_curve``, and its rates by the ordinates and their derivatives."""
    s = problem.symbols
    state = ca.vertcat(s.y, s.dy, s.ddy)
    return [
        ca.Function("argument", s.all, [switch.argument, ca.densify(ca.gradient(switch.argument, state))])
        for switch in on_curve(problem)
    ]


@derived
def _gradients(problem: Functional) -> ca.Function:
    """The rates of what is integrated, one column a term, by the ordinates and their derivatives."""
    s = problem.symbols
    terms = ca.vertcat(*integrals(problem).call(s.all))
    return ca.Function("gradients", s.all, [ca.densify(ca.jacobian(terms, ca.vertcat(s.y, s.dy, s.ddy)).T)])


@dataclass(frozen=True)
class HeldByKinks(Check[tuple[Release, ...]]):
    """Whether kinks along which the curve runs hold it."""

    name = "kinks"

    def measure(self, candidate: Candidate) -> tuple[Release, ...]:
        """Where they do not."""
        solution = candidate.solution
        along = [c for c in met_by(solution, HELD_TO) if c.until is not None] if on_curve(solution.problem) else []
        return tuple(release for c in along if (release := released(solution, c)) is not None)

    def findings(self, candidate: Candidate) -> Iterator[Finding]:
        """Every place where one does not."""
        for release in candidate.measured(self):
            change = -candidate.problem.sign * release.gain
            sentence = (
                f"the curve is not stationary: it runs along a kink of L that does not hold it from "
                f"{release.start:.6g} to {release.end:.6g}, where a bump to one side changes the functional by "
                f"{change:.2g}"
            )
            yield Finding(Verdict.NO_EXTREMAL, sentence, {"from": release.start, "to": release.end, "by": change})
