"""Closed orbits: stationary points of the action among closed curves, and what becomes of motions beside them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from scipy.linalg import block_diag, eigh

from varcalc.mechanics.action import Action
from varcalc.mechanics.linearised import UNLIKE
from varcalc.mechanics.monodromy import OUTSIDE_CIRCLE, Floquet, Monodromy
from varcalc.mechanics.motion import Motion
from varcalc.mechanics.orbit_symmetry import Repeats, Returns, TurningFrame, turning_frame
from varcalc.problem.conditions import finite, positive, reals
from varcalc.problem.problem import Problem
from varcalc.showing import Fact, Plotted, Shown, line
from varcalc.solution import Solution
from varcalc.symbolic.evaluation import PointEvaluator

SHOWN = 4
"""Multipliers that a print tells."""
CLOSED, OPEN = 1e-14, 1e-9
"""Of the state: by how much an orbit is off its start that closes but for round-off, and one that does not."""
NEIGHBOURHOOD = 0.1
"""Of the state: what is farther off is not next to it."""
SHOTS = 8
"""Newton's steps that close an orbit."""
STAYS_CLOSED = 1e-5
"""Of the largest singular value: directions in which a neighbour stays a closed orbit, which closing leaves alone."""
FEWEST_SAMPLES, MOST_SAMPLES = 128, 1 << 16
"""Times at which L is summed over a period."""
AGREED = 1e-14
WAVES, MOST_WAVES = 8, 512
"""In a period, of variations."""
LOW = 0.1
"""Eigenvalues above that may become no zeros with more waves."""
VANISHES = 1e-6
"""An eigenvalue that is zero but for what is left of the orbit's error."""
SLOW = 0.01
"""Of what an eigenvalue lies above those that are low: one that falls by less as waves are doubled stays above."""


@dataclass(frozen=True, repr=False)
class ClosedOrbit(Plotted):
    """A closed orbit of a ``period``: its ``motion`` once round, and the motions beside it.

    ``closure`` is how far the state is from where it began after a period, by the motion; ``floquet`` holds the
    monodromy matrix with Krein's signatures; ``action`` is the integral of L over the period.
    """

    period: float
    motion: Motion
    closure: float
    floquet: Floquet
    action: float
    _second_variation: PointEvaluator = field(repr=False)

    def __repr__(self) -> str:
        return line("ClosedOrbit", [f"period {self.period:.12g}", "stable" if self.stable else "unstable"])

    def _headline(self) -> str:
        return f"A closed orbit of period {self.period:.12g}"

    def _facts(self) -> Iterator[Fact]:
        yield Fact("closes", f"to {self.closure:.1g} of its state")
        yield Fact("action", f"{self.action:.12g}")
        grows = "stays near it" if self.stable else "leaves it exponentially"
        yield Fact("stability", f"a motion beside it {grows}, as far as the linear equations tell")
        yield Fact("multipliers", ", ".join(f"{m:.6g}" for m in self.multipliers[:SHOWN]))

    def q(self, t: Any) -> np.ndarray:
        """The coordinates, shape (n,) + t.shape, at any times."""
        return self.motion.q(reals("t", t) % self.period)

    def v(self, t: Any) -> np.ndarray:
        """The rates of the coordinates, shape (n,) + t.shape, at any times."""
        return self.motion.v(reals("t", t) % self.period)

    @property
    def multipliers(self) -> np.ndarray:
        """Floquet's multipliers (2n,): the eigenvalues of the monodromy matrix, largest first."""
        return self.floquet.multipliers

    @cached_property
    def _spectrum(self) -> tuple[int, int]:
        return _signs(self.motion, self._second_variation)

    @property
    def index(self) -> int:
        """Morse's: in how many directions, among closed curves of this period, the action falls away from the orbit."""
        return self._spectrum[0]

    @property
    def nullity(self) -> int:
        """In how many directions the second variation vanishes: at least one where L does not know the time."""
        return self._spectrum[1]

    @property
    def stable(self) -> bool:
        """Whether no motion beside the orbit leaves it exponentially."""
        return bool(np.abs(self.multipliers).max() <= 1 + OUTSIDE_CIRCLE)


@dataclass(frozen=True, repr=False, eq=False)
class ClosedOrbits(Shown):
    """Closed orbits of an ``action`` with a ``period`` and a ``symmetry``; see :meth:`System.periodic`.

    Raises TypeError or ValueError for a period that is no positive number, nor the name of a parameter that is one, and
    for a symmetry that the action does not have.
    """

    action: Action
    carried: Callable[[np.ndarray, np.ndarray, float, np.ndarray | None], ClosedOrbit]
    """From coordinates and rates (n,), a period and the matrix of :class:`Returns` to the orbit."""
    period: float | str
    symmetry: Sequence[Repeats | Returns] = ()

    def __post_init__(self) -> None:
        if isinstance(self.period, str) and self.period not in self.action.parameters:
            raise ValueError(f"period must be a number or name one of the parameters, not {self.period!r}")
        positive("period", self.duration)
        n, frame = self.action.lagrange.symbols.q.numel(), self.frame
        assert len(frame.axes) == n
        for one in self.symmetry:
            self._check(one)

    @property
    def duration(self) -> float:
        """The period as a number."""
        return self.action.parameters[self.period] if isinstance(self.period, str) else finite("period", self.period)

    @cached_property
    def frame(self) -> TurningFrame:
        """The coordinates of the problem."""
        return turning_frame(self.symmetry, self.action.lagrange.symbols.q.numel())

    @property
    def _unit(self) -> float:
        """Of the problem's abscissa, in time."""
        return self.duration if isinstance(self.period, str) else 1.0

    @property
    def _length(self) -> float:
        """Of the interval of the problem."""
        return self.frame.part * self.duration / self._unit

    def _check(self, one: Repeats | Returns) -> None:
        """Refuse what is no symmetry of L."""
        lagrange, matrix = self.action.lagrange, np.asarray(one.matrix, dtype=float)
        function = ca.Function("L", lagrange.symbols.all, [lagrange.value])
        for t, q, v, numbers in lagrange.places(self.action.parameters):
            later, sign = (t + self.duration / one.times, 1) if isinstance(one, Repeats) else (-t, -1)
            here = float(function(t, q, v, numbers))
            there = float(function(later, matrix @ q, sign * matrix @ v, numbers))
            if np.isfinite(here) and not abs(there - here) <= UNLIKE * max(1.0, abs(here)):
                raise ValueError(
                    f"symmetry: this {type(one).__name__} is no symmetry of L, which it changes by {there - here:.3g}"
                )

    @cached_property
    def problem(self) -> Problem:
        """The action of the part of the orbit that the rest follows from, in the coordinates of :attr:`frame`."""
        scale = self.period if isinstance(self.period, str) else None
        ends = self.frame.ends(self._length)
        if not self.symmetry and scale is None:
            return self.action.problem(*ends)
        return self.action.placed(*ends, lambda s, z: ca.mtimes(self.frame.matrix(s / self._length), z), scale)

    def guess(self, q: Callable[[np.ndarray], np.ndarray]) -> Callable[[np.ndarray], np.ndarray]:
        """A guess for the problem from a curve ``q``: times (m,) of the orbit, or one, to coordinates (n, m)."""

        def z(s: np.ndarray) -> np.ndarray:
            """The coordinates of the problem (n, *s.shape) at its abscissae ``s``."""
            shares = np.atleast_1d(reals("s", s))
            places = np.asarray(q(self._unit * reals("s", s)), dtype=float).reshape(-1, len(shares))
            matrices, _ = self.frame.at(shares / self._length)
            return np.linalg.solve(matrices, places.T[:, :, None])[:, :, 0].T.reshape(-1, *np.shape(s))

        return z

    def orbit(self, solution: Solution) -> ClosedOrbit:
        """The whole orbit that a ``solution`` of the problem is a part of; ValueError for one without a curve."""
        curve = solution.curve
        if curve is None:
            raise ValueError("the solution has no curve; solve the problem first")
        z, w = (np.asarray(curve(np.zeros(1), k)).reshape(-1) for k in (0, 1))
        (matrix,), (slope,) = self.frame.at(np.zeros(1))
        period = self._period(solution)
        unit = period if isinstance(self.period, str) else 1.0
        back = next((np.asarray(one.matrix, dtype=float) for one in self.symmetry if isinstance(one, Returns)), None)
        return self.carried(matrix @ z, (matrix @ w + slope @ z / self._length) / unit, period, back)

    def _period(self, solution: Solution) -> float:
        """The period of a solution, which a parameter may have changed."""
        return solution.problem.parameters[self.period] if isinstance(self.period, str) else self.duration


def closed_state(
    monodromy: Monodromy, state: np.ndarray, numbers: np.ndarray, period: float, back: np.ndarray | None
) -> np.ndarray:
    """The state (2n,) nearest to ``state`` that comes again after the period.

    Newton's steps are the least ones: along the orbit and along families of orbits nothing is moved. Of an orbit that
    goes ``back`` the way it came, by this matrix, they keep the start where it turns.
    """
    kept = np.eye(len(state))
    if back is not None:
        one = np.eye(len(back))
        kept = block_diag(one + back, one - back) / 2
        state = kept @ state
    size, best, least, given = max(1.0, float(np.abs(state).max())), state, np.inf, state
    for _ in range(SHOTS):
        after, by_first = monodromy(state, numbers, period)
        miss = after - state
        if not np.abs(miss).max() < least:
            break
        best, least = state, float(np.abs(miss).max())
        if least <= CLOSED * size:
            break
        state = state - kept @ np.linalg.lstsq((by_first - np.eye(len(state))) @ kept, miss, rcond=STAYS_CLOSED)[0]
    if (away := float(np.abs(best - given).max())) > NEIGHBOURHOOD * size:
        raise ValueError(f"no closed orbit is next to this motion: the one that was looked for lies {away:.2g} off")
    if not least <= OPEN * size:
        raise ValueError(f"no closed orbit was found next to this motion, which misses its start by {least:.2g}")
    return best


def closed_orbit(
    monodromy: Monodromy, motion: Motion, form: np.ndarray, lagrangian: PointEvaluator, second_variation: PointEvaluator
) -> ClosedOrbit:
    """What there is to know of an orbit that closes, from its ``motion`` once round."""
    first, period = motion.span
    state = np.concatenate([motion.q(first), motion.v(first)])
    after, by_first = monodromy(state, motion.numbers, period)
    return ClosedOrbit(
        period, motion, float(np.abs(after - state).max()), Floquet(period, by_first, form),
        _action(motion, lagrangian), second_variation,
    )  # fmt: skip


def _along(function: PointEvaluator, motion: Motion, count: int) -> np.ndarray:
    """A function of the state (count, entries) at so many equal parts of the period."""
    t = motion.span[0] + np.arange(count) * ((motion.span[1] - motion.span[0]) / count)
    return function(count, t[:, None], motion.q(t).T, motion.v(t).T, motion.numbers[None, :])


def _action(motion: Motion, lagrangian: PointEvaluator) -> float:
    """The integral of L by sums over equal parts, which converge faster than any power on what is periodic."""
    period, count, before = motion.span[1], FEWEST_SAMPLES, np.nan
    while True:
        values = _along(lagrangian, motion, count)[:, 0]
        total = float(np.sum(values)) * period / count
        if abs(total - before) <= AGREED * period * float(np.abs(values).max()) or count >= MOST_SAMPLES:
            return total
        before, count = total, 2 * count


def _signs(motion: Motion, second_variation: PointEvaluator) -> tuple[int, int]:
    """How many eigenvalues of the second variation on closed variations are negative, and how many vanish.

    The variations are trigonometric polynomials, as many terms of which are taken as it needs for the lowest
    eigenvalues, relative to a norm with the rates, to stay what they are.
    """
    before, waves = np.zeros(0), WAVES
    while True:
        lowest = _eigenvalues(motion, second_variation, waves)
        near = min(np.count_nonzero(lowest <= LOW) + 1, len(before))
        slack = VANISHES + SLOW * np.maximum(lowest[:near] - LOW, 0)
        if near > 0 and np.all(np.abs(lowest[:near] - before[:near]) <= slack):
            return int(np.count_nonzero(lowest < -VANISHES)), int(np.count_nonzero(np.abs(lowest) <= VANISHES))
        if waves >= MOST_WAVES:
            raise ValueError(f"the second variation is not resolved by {waves} waves in a period")
        before, waves = lowest, 2 * waves


def _eigenvalues(motion: Motion, second_variation: PointEvaluator, waves: int) -> np.ndarray:
    """The ascending eigenvalues of the second variation on so many waves, on a scale on which L_vv alone has 1."""
    n, period, count = len(motion.q(motion.span[0])), motion.span[1] - motion.span[0], 8 * waves
    mass, mixed, bent = (
        part.reshape(count, n, n).swapaxes(1, 2)
        for part in np.split(_along(second_variation, motion, count), 3, axis=1)
    )
    phase = 2 * np.pi * np.outer(np.arange(count) / count, np.arange(1, waves + 1))
    frequency = 2 * np.pi / period * np.arange(1, waves + 1)
    one = np.column_stack([np.ones(count), np.cos(phase), np.sin(phase)]) / np.sqrt(count)
    rate = np.column_stack([np.zeros(count), -frequency * np.sin(phase), frequency * np.cos(phase)]) / np.sqrt(count)

    def form(left: np.ndarray, matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
        return np.block([[left.T @ (matrix[:, i, j, None] * right) for j in range(n)] for i in range(n)])

    kinetic, cross = form(rate, mass, rate), form(rate, mixed, one)
    whole = kinetic + cross + cross.T + form(one, bent, one)
    norm = kinetic + (2 * np.pi / period) ** 2 * form(one, mass, one)
    return eigh(whole, norm, eigvals_only=True)
