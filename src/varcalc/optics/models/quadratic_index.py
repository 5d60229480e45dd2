"""All rays between two points where n² is a polynomial of second degree: those at the zeros of one function of σ."""

from __future__ import annotations

from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from varcalc.numerics.roots import EPSILON
from varcalc.optics.media.medium import Medium
from varcalc.optics.models.aimed import CARRIED_WELL, Aimed, Carry, Tell, Told, met
from varcalc.optics.models.linear import LinearRays, motions
from varcalc.optics.models.quadratic_zeros import (
    LARGEST_ANGLE,
    MOST_SPANS,
    Questions,
    Zeros,
    ZeroSearch,
    half_angle,
)
from varcalc.optics.rays.beam import frames
from varcalc.optics.rays.ray import SHADOW, Ray, Rays, no_rays
from varcalc.symbolic.evaluation import PointEvaluator

SAME_CURVATURE = 16 * EPSILON
"""Of the largest: principal curvatures that differ by less are the same, or none."""
NO_COORDINATE = 8 * EPSILON
"""Of the distance of two points and of where they are: what is less is zero."""
SUMMED_ROUND_OFF = 64 * EPSILON
"""Of what is summed in an optical path."""


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

    def applies(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:  # noqa: ARG002
        """True (q,): for all points."""
        return np.ones(len(a), dtype=bool)

    def rays(
        self, a: np.ndarray, b: np.ndarray, within: np.ndarray, carry: Carry, careful: Carry | None = None,  # noqa: ARG002  there is no better way
        tell: Tell | None = None,
    ) -> list[Rays]:  # fmt: skip
        """The rays from each point ``a`` (q, d) to ``b`` (q, d) up to an optical path ``within`` (q,)."""
        asked = self._asked(a, b)
        search = ZeroSearch(asked, self.curvature, within)
        zeros, given_up = search.found()
        told, touching, continuum = self._told(search, zeros)
        nothing = np.zeros(len(told))
        aimed = Aimed(told.question, told.headings, told.paths, touching, nothing, told.counts)
        rays = met(len(a), aimed, told, carry, None, tell)
        lost = np.bincount(told.question, minlength=len(a)) - np.array([len(own) for own in rays])
        answers = zip(rays, within, continuum.tolist(), lost.tolist(), given_up.tolist(), strict=True)
        return [_answer(*own) for own in answers]

    def _asked(self, a: np.ndarray, b: np.ndarray) -> Questions:
        at, middle = self._field(len(a), a), self._field(len(a), (a + b) / 2)
        way, pull = (b - a) @ self.axes, middle[:, 1:] @ self.axes
        room = NO_COORDINATE * (np.linalg.norm(a, axis=1) + np.linalg.norm(b, axis=1))[:, None]
        way[np.abs(way) <= room] = 0.0
        slope = np.abs(at[:, 1:]).max(axis=1, keepdims=True)
        pull[np.abs(pull) <= room * np.abs(self.curvature).max() + NO_COORDINATE * slope] = 0.0
        return Questions(way, pull, at[:, 1:] @ self.axes, middle[:, 0], at[:, 0])

    def _courses(self, search: ZeroSearch, zeros: Zeros) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The momenta (k, d) of the rays of ``zeros`` at both ends, and their optical paths (k,).

        About the middle of σ momenta are d s₁ cos wτ - g/(w cos(wσ/2)) sin wτ, or their like.
        """
        of, sigma = search.asked.take(zeros.question), search.sigma(zeros)
        first, last, path = np.zeros_like(of.way), np.zeros_like(of.way), np.zeros(len(sigma))
        with np.errstate(all="ignore"):
            for k, curvature in enumerate(self.curvature):
                w = np.sqrt(abs(curvature))
                if curvature < 0:
                    s, c = half_angle(w, search.marks, zeros.origin, zeros.offset)
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

    def _focused(self, search: ZeroSearch, foci: Zeros, first: np.ndarray, last: np.ndarray, path: np.ndarray) -> None:
        """Give the rays of ``foci``, in place, the momenta in their free directions that are missing of n²."""
        free = foci.free
        missing = search.asked.squared[foci.question] - np.sum(first**2, axis=1)
        one = np.argmax(free, axis=1)
        rows = np.arange(len(one))
        with np.errstate(invalid="ignore"):
            momentum = np.sqrt(missing)
        _, odd = search.conjugate(foci.origin)
        first[rows, one] = momentum
        last[rows, one] = np.where(odd[rows, one], -momentum, momentum)
        path += momentum**2 * search.marks[foci.origin] / 2  # whole turns: the mean of the square is half

    def _told(self, search: ZeroSearch, zeros: Zeros) -> tuple[Told, np.ndarray, np.ndarray]:
        """What is known of rays, which of them (k,) touch caustics, and pairs (q,) with continua."""
        within = search.within
        first, last, path = self._courses(search, zeros)
        focus = np.any(zeros.free, axis=1)
        foci = np.flatnonzero(focus)
        parts = first[foci], last[foci], path[foci]
        self._focused(search, zeros.take(foci), *parts)
        first[foci], last[foci], path[foci] = parts
        counts = search.conjugate_points(zeros)
        many = zeros.free.sum(axis=1) > 1
        rows = np.flatnonzero(path <= within[zeros.question])  # what is no number is no ray
        other = rows[focus[rows] & ~many[rows]]  # the ray with the opposite momentum
        both = np.concatenate([rows, other])
        back = np.append(np.zeros(len(rows), dtype=bool), np.ones(len(other), dtype=bool))[:, None] & zeros.free[both]
        first, last = np.where(back, -first[both], first[both]), np.where(back, -last[both], last[both])
        touching = zeros.touching[both] & (many[both] | ~focus[both])
        counts = np.where(zeros.touching[both] | focus[both], -1, counts[both])
        headings, arriving = ((v / np.linalg.norm(v, axis=1, keepdims=True)) @ self.axes.T for v in (first, last))
        continuum = np.bincount(zeros.question[both][many[both]], minlength=len(within)) > 0
        sigma = search.sigma(zeros)[both]
        with np.errstate(over="ignore"):  # rays that grow apart are only where directions tell them if they are carried
            grows = np.sqrt(max(float(self.curvature.max()), 0.0))
            apart = EPSILON * np.exp(grows * sigma)
        paths, level, alone = path[both], np.ones(len(both)), ~focus[both] & ~touching
        well, spreads = alone & (apart <= CARRIED_WELL), np.full(len(both), np.nan)
        astray = np.flatnonzero(alone & ~well)
        spreads[astray] = self._spreads(first[astray], last[astray], sigma[astray])
        errors = np.where(well | np.isfinite(spreads), SUMMED_ROUND_OFF * paths, np.inf)
        told = Told(zeros.question[both], headings, arriving, paths, errors, counts, level, spreads, well)
        return told, touching, continuum

    def _spreads(self, first: np.ndarray, last: np.ndarray, sigma: np.ndarray) -> np.ndarray:
        """How rays with momenta ``first`` and ``last`` (k, d) at their ends spread (k,) over σ: :attr:`Ray.spreading`.

        In each principal direction neighbours come apart as their momenta did at first, times sin(wσ)/w or its like.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            apart = np.column_stack([motions(float(curvature), sigma).first for curvature in self.curvature])
            n = np.linalg.norm(first, axis=1, keepdims=True)
            across = frames(first / n) * (n * apart)[:, None, :]
            ahead = last / np.linalg.norm(last, axis=1, keepdims=True)
            return np.abs(np.linalg.det(np.concatenate([across, ahead[:, None]], axis=1)))


def _answer(rays: list[Ray], within: float, continuum: bool, apart: int, given_up: int) -> Rays:
    """What is said of one pair."""
    lost, unresolved = f"; {apart} that grow apart beyond what directions tell" if apart else "", apart + given_up
    lost += f"; not beyond {MOST_SPANS} conjugate points" if given_up else ""
    searched = f"all zeros of one function of the ray parameter, as n² is of second degree{lost}, "
    searched += f"optical paths up to {within:.6g}"
    if not rays:
        return no_rays(SHADOW, searched, unresolved)
    return Rays(tuple(rays), "", searched, continuum, unresolved)
