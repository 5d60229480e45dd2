"""The regular extremals next to a singular end.

At an end where the integrand is infinite the Euler-Lagrange equation in
regularising coordinates is 0/0, and of its solutions only half as many as
elsewhere arrive there smoothly: one for each set of ordinates at a place
nearby, the anchor. So the arc between the two is not integrated but collocated:
y'' is a polynomial that obeys the equation at Gauss points, which lie strictly
inside, and y follows by integrating twice between the known ordinates. The
slope that the arc has at the anchor takes the place of the conditions at the
end. De Hoog and Weiss, "Collocation methods for singular boundary value
problems", SIAM J. Numer. Anal. 15 (1978) 198.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.polynomial import legendre

from varcalc.formulation import Sampled
from varcalc.integrators import Landing
from varcalc.methods.shooting.flow import EulerLagrangeFlow
from varcalc.numerics.damped_newton import Ending, LinearisedEquations, damped_newton
from varcalc.numerics.mesh import gauss

STAGES = (6, 9, 12, 16, 20, 24)
"""Numbers of Gauss points, each the start for the next: close to the end only a good start is a good start."""
COARSEST = 4
"""How many of them level 0 climbs; each level one more."""
ARC_UNRESOLVED = 1e-6
"""Relative change of slope and integrals between the last two numbers of points that calls for a shorter arc."""
ARC_ITERATIONS = 20
RUNS_PER_ITERATION = 2
"""Runs of a flow that take as long as one iteration."""
STEPS_PER_RUN = 10
"""Steps that take as long as it takes to begin a run and to read its end."""


@dataclass
class Work:
    """What was integrated so far, so that a search is bounded by work rather than by the clock."""

    runs: int = 0
    steps: int = 0

    @property
    def total(self) -> int:
        """Both in one number: runs, and steps by what they cost in runs."""
        return self.runs + self.steps // STEPS_PER_RUN

    def add(self, landing: Landing) -> None:
        """Count an ensemble."""
        self.runs += len(landing.steps)
        self.steps += int(landing.steps.sum())

    def charge(self, runs: int) -> None:
        """Count what is done in place of a run, in runs."""
        self.runs += runs


@dataclass(frozen=True)
class Stages:
    """Integration at s Gauss points c on [0, 1], with everything taken between two known ordinates.

    With y'' = k at the points, y = chord + h^2 ``twice`` k and y' = chord's
    slope + h ``once`` k there, y' at 1 and 0 the chord's slope + h ``right``,
    ``left`` k. ``series`` takes k to its Legendre coefficients.
    """

    points: np.ndarray
    weights: np.ndarray
    once: np.ndarray
    twice: np.ndarray
    left: np.ndarray
    right: np.ndarray
    series: np.ndarray


@lru_cache(maxsize=16)
def stages(count: int) -> Stages:
    """The tables for ``count`` points."""
    nodes, weights = gauss(count)
    c, b = 0.5 * (1 + nodes), 0.5 * weights
    series = (2 * np.arange(count) + 1)[:, None] * legendre.legvander(nodes, count - 1).T * b
    once = legendre.legval(nodes, legendre.legint(series, 1, lbnd=-1)).T / 2
    twice = legendre.legval(nodes, legendre.legint(series, 2, lbnd=-1)).T / 4
    mean = b * (1 - c)  # the double integral over [0, 1], by which the chord is met
    return Stages(c, b, once - mean, twice - np.outer(c, mean), -mean, b - mean, series)


@dataclass(frozen=True)
class Passage:
    """A regular arc, and how it depends on what was given: the anchor's ordinates, then unknowns and lambdas (p).

    ``near`` and ``far`` (n,) are dy/dt at the anchor and at the singular end,
    ``integrals`` (q,) run from the end to the anchor; each comes with its
    derivatives (.., p). ``rates`` (s, n) are the Legendre coefficients of y''.
    """

    near: np.ndarray
    near_by: np.ndarray
    far: np.ndarray
    far_by: np.ndarray
    integrals: np.ndarray
    integrals_by: np.ndarray
    rates: np.ndarray


@dataclass(frozen=True)
class RegularEnd:
    """The singular end at t = ``at`` (0 or 1) with its scaled ``ordinates`` (n,); ``curve`` is the first guess."""

    equations: EulerLagrangeFlow
    at: float
    ordinates: np.ndarray
    curve: Sampled
    """Scaled ordinates (n, m) at t (m,)."""
    found: dict[float, np.ndarray] = field(default_factory=dict, repr=False, compare=False)
    """The Legendre coefficients of y'' of the arc found last, by its anchor: the next is looked for from there."""

    def passage(
        self, anchor: float, ordinates: np.ndarray, constants: np.ndarray, level: int, work: Work
    ) -> Passage | None:
        """The regular arc to ``ordinates`` (n,) at t = ``anchor``; None where none is found, or it is unresolved.

        What it costs is charged to ``work``.
        """
        counts = STAGES[: COARSEST + level]
        known = self.found.get(anchor)
        passage = None
        if known is not None:  # the arcs of one search are neighbours, and two numbers of points tell whether it is met
            passage = self._climbed(counts[-2:], known, anchor, ordinates, constants, work)
        if passage is None:
            passage = self._climbed(counts, None, anchor, ordinates, constants, work)
        if passage is not None:
            self.found[anchor] = passage.rates
        return passage

    def _climbed(
        self, counts: tuple[int, ...], rates: np.ndarray | None, anchor: float, ordinates: np.ndarray,
        constants: np.ndarray, work: Work,
    ) -> Passage | None:  # fmt: skip
        """The arc by more and more points, from the ``rates`` of one nearby; None where the last two do not agree."""
        last, before = None, None
        for count in counts:
            collocated = _Collocated(self, anchor, ordinates, constants, stages(count))
            first = self._guess(collocated) if rates is None else _prolonged(rates, collocated.stages)
            k = collocated.solved(first, work)
            rates = None if k is None else collocated.stages.series @ k
            if count in counts[-2:]:
                before, last = last, None if k is None else collocated.passage(k)
        if last is None or before is None:
            return None
        changes = [(last.near, before.near), (last.integrals, before.integrals)]
        resolved = all(np.abs(new - old).max() <= ARC_UNRESOLVED * np.abs(new).max() for new, old in changes)
        return last if resolved else None

    def _guess(self, arc: _Collocated) -> np.ndarray:
        """y'' (s, n) of the first guess, stretched so that it meets the ordinates at the anchor."""
        t = np.append(arc.t, arc.anchor)
        values = self.curve(t).T - self.ordinates
        own, wanted = values[-1], arc.ordinates - self.ordinates
        stretched = np.abs(own) > 1e-6 * np.abs(values).max()
        factor = np.where(stretched, wanted / np.where(stretched, own, 1.0), 1.0)
        values = np.where(stretched, values[:-1] * factor, arc.stages.points[:, None] * wanted)
        bent = values - arc.stages.points[:, None] * wanted
        return np.linalg.solve(arc.stages.twice, bent) / arc.step**2

    def arc(self, anchor: float, passage: Passage) -> RegularArc:
        """The curve of a passage."""
        once, twice = (legendre.legint(passage.rates, k, lbnd=-1) / 2**k for k in (1, 2))
        return RegularArc(self.at, anchor - self.at, self.ordinates, passage.far, once, twice)


@dataclass(frozen=True)
class RegularArc:
    """The scaled y and dy/dt of a regular arc from t = ``at``, where they are ``ordinates`` and ``slope`` (n,).

    It is ``length`` long, towards smaller t where that is negative; ``once`` and ``twice`` are the Legendre
    coefficients of y'' integrated, over [0, 1].
    """

    at: float
    length: float
    ordinates: np.ndarray
    slope: np.ndarray
    once: np.ndarray
    twice: np.ndarray

    def __call__(self, t: np.ndarray) -> np.ndarray:
        """Both (m, 2 n) at t (m,)."""
        u = ((t - self.at) / self.length)[:, None]
        table = legendre.legvander(2 * u[:, 0] - 1, len(self.twice) - 1)
        slope = self.slope + self.length * (table[:, :-1] @ self.once)
        y = self.ordinates + u * self.length * self.slope + self.length**2 * (table @ self.twice)
        y[u[:, 0] == 0.0] = self.ordinates  # to the last digit
        return np.concatenate([y, slope], axis=1)


def _prolonged(rates: np.ndarray, finer: Stages) -> np.ndarray:
    return legendre.legval(2 * finer.points - 1, rates).T


@dataclass(frozen=True)
class _Point:
    """The equation on an arc: the residual (s, n) and the derivatives of all rates of the flow at its points."""

    residual: np.ndarray
    rates: np.ndarray
    by_state: np.ndarray
    by_numbers: np.ndarray


@dataclass(frozen=True)
class _Collocated:
    """The collocated equation for y'' (s, n) at the points of one arc, as :func:`damped_newton` takes it."""

    end: RegularEnd
    anchor: float
    ordinates: np.ndarray
    constants: np.ndarray
    stages: Stages

    @property
    def step(self) -> float:
        """From the end to the anchor; negative at t = 1."""
        return self.anchor - self.end.at

    @property
    def t(self) -> np.ndarray:
        """The abscissae of the stages."""
        return self.end.at + self.step * self.stages.points

    @property
    def _chord(self) -> np.ndarray:
        return (self.ordinates - self.end.ordinates) / self.step

    def evaluate(self, z: np.ndarray) -> _Point | None:
        """The equation for y'' = z, flat; None where it is not a number."""
        count, n, h, s = len(self.stages.points), len(self.ordinates), self.step, self.stages
        k = z.reshape(count, n)
        flow = self.end.equations
        state = np.zeros((count, flow.dimension + flow.integrals))
        state[:, :n] = self.end.ordinates + np.outer(s.points, h * self._chord) + h**2 * (s.twice @ k)
        state[:, n : 2 * n] = self._chord + h * (s.once @ k)
        rates, by_state, by_numbers = flow.linearised(self.t, state, self.constants)
        if not all(np.isfinite(v).all() for v in (rates, by_state, by_numbers)):
            return None
        return _Point(k - rates[:, n : 2 * n], rates.T, by_state, by_numbers)

    def _jacobian(self, at: _Point) -> np.ndarray:
        """The derivative (s n, s n) of the residual by y''."""
        n, h, s = len(self.ordinates), self.step, self.stages
        by_y, by_slope = at.by_state[:, n : 2 * n, :n], at.by_state[:, n : 2 * n, n:]
        matrix = -h * (
            by_y[:, :, None, :] * (h * s.twice[:, None, :, None]) + by_slope[:, :, None, :] * s.once[:, None, :, None]
        )
        size = matrix.shape[0] * n
        return np.eye(size) + matrix.reshape(size, size)

    def linearised(self, z: np.ndarray, at: _Point) -> LinearisedEquations[_Point]:  # noqa: ARG002 - the point holds it all
        """Corrections of y'', measured by what they do to y."""
        matrix = self._jacobian(at)
        rows = np.abs(matrix).max(axis=1)
        matrix = matrix / rows[:, None]
        sizes = np.abs(self.ordinates - self.end.ordinates)
        sizes = np.maximum(sizes, 1e-3 * float(sizes.max()))

        def correction(point: _Point) -> np.ndarray | None:
            """Newton's correction at a point; None where the matrix is singular."""
            try:
                return np.linalg.solve(matrix, -point.residual.ravel() / rows)
            except np.linalg.LinAlgError:
                return None

        def measure(step: np.ndarray) -> float:
            change = self.step**2 * (self.stages.twice @ step.reshape(-1, len(sizes))) / sizes
            return float(np.sqrt(np.mean(change**2)))

        return LinearisedEquations(correction, measure)

    def solved(self, first: np.ndarray, work: Work) -> np.ndarray | None:
        """y'' (s, n) at the points, from a first guess; None where the iteration does not get there."""
        at = self.evaluate(first.ravel())
        if at is None:
            return None
        result = damped_newton(self, first.ravel(), at, ARC_ITERATIONS)
        work.charge(RUNS_PER_ITERATION * result.iterations)
        return result.z.reshape(first.shape) if result.ending is Ending.CONVERGED else None

    def passage(self, k: np.ndarray) -> Passage | None:
        """The arc with y'' = k, and its derivatives by the implicit function theorem."""
        at = self.evaluate(k.ravel())
        if at is None:
            return None
        n, h, s = len(self.ordinates), self.step, self.stages
        given = n + at.by_numbers.shape[2]
        # the derivatives of y and y' at the points by what is given, y'' being kept
        y_by, slope_by = np.zeros((len(k), n, given)), np.zeros((len(k), n, given))
        y_by[:, :, :n] = s.points[:, None, None] * np.eye(n)
        slope_by[:, :, :n] = np.eye(n) / h
        rates_by = at.by_state[:, :, :n] @ y_by + at.by_state[:, :, n:] @ slope_by
        rates_by[:, :, n:] += at.by_numbers
        matrix = self._jacobian(at)
        rows = np.abs(matrix).max(axis=1)
        right = rates_by[:, n : 2 * n].reshape(-1, given)
        try:
            k_by = np.linalg.solve(matrix / rows[:, None], right / rows[:, None]).reshape(len(k), n, given)
        except np.linalg.LinAlgError:
            return None
        rates_by += at.by_state[:, :, :n] @ np.einsum("jl,lnp->jnp", h**2 * s.twice, k_by)
        rates_by += at.by_state[:, :, n:] @ np.einsum("jl,lnp->jnp", h * s.once, k_by)
        chord_by = slope_by[0]
        return Passage(
            self._chord + h * (s.right @ k), chord_by + h * np.einsum("l,lnp->np", s.right, k_by),
            self._chord + h * (s.left @ k), chord_by + h * np.einsum("l,lnp->np", s.left, k_by),
            h * (at.rates[2 * n :] @ s.weights), h * np.einsum("l,lqp->qp", s.weights, rates_by[:, 2 * n :]),
            s.series @ k,
        )  # fmt: skip
