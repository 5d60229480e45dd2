"""What becomes of all motions beside one in a period: the monodromy matrix and Floquet's multipliers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from varcalc import integrators
from varcalc.integrators.protocol import COMPLETED, Flow
from varcalc.integrators.variational import Variational, variational
from varcalc.numerics.spectrum import Spectrum
from varcalc.showing import Fact, Shown

SYMPLECTIC = 1e-8
"""Of what is multiplied: how far a matrix that keeps the symplectic form may be off it."""
ONE_SIGNATURE = 1e-6
"""Multipliers so near to each other have one signature between them."""
OUTSIDE_CIRCLE = 1e-5
"""How far a multiplier may lie outside the unit circle for being rounded, where several are the same."""
TOLD_MULTIPLIERS = 6
"""Multipliers that a print shows."""
DEFINITE = 1e-8
"""Of the form: what is less has no sign."""


@dataclass(frozen=True, repr=False, eq=False)
class Floquet(Shown):
    """Motions beside one that repeats itself, or beside a place of rest of a system that does, after a ``period``.

    ``monodromy`` (2n, 2n) takes small changes of the coordinates and rates at the beginning to those after a period,
    ``form`` (2n, 2n) is the symplectic form dq ∧ dp of such changes, p being the momenta (Yakubovich and Starzhinskii,
    "Linear Differential Equations with Periodic Coefficients", ch. II, III).
    """

    period: float
    monodromy: np.ndarray
    form: np.ndarray

    def _headline(self) -> str:
        return f"Small motions over a period of {self.period:.12g}"

    def _facts(self) -> Iterator[Fact]:
        yield Fact("stable", "yes" if self.stable else "no")
        yield Fact("growth", f"{self.growth:.6g}, the rate at which motions part at most")
        told = ", ".join(f"{m:.6g}" for m in self.multipliers[:TOLD_MULTIPLIERS])
        yield Fact("multipliers", told + (", ..." if len(self.multipliers) > TOLD_MULTIPLIERS else ""))

    @cached_property
    def _spectrum(self) -> Spectrum:
        found = Spectrum.of(self.monodromy)
        return found[np.lexsort([np.angle(found.values), -np.abs(found.values)])]

    @property
    def multipliers(self) -> np.ndarray:
        """Floquet's multipliers (2n,): the eigenvalues of the monodromy matrix, largest first."""
        return self._spectrum.values

    @property
    def exponents(self) -> np.ndarray:
        """Characteristic exponents (2n,), ln(multiplier)/period; their imaginary parts are known but for 2π/period."""
        with np.errstate(divide="ignore"):
            return np.log(self.multipliers.astype(complex)) / self.period

    @property
    def growth(self) -> float:
        """The rate at which motions part at most, ln|largest multiplier|/period; negative where all die away."""
        return float(np.log(np.abs(self.multipliers[0]))) / self.period

    @cached_property
    def symplectic(self) -> bool:
        """Whether the symplectic form is kept, as it is where all forces come from L."""
        kept = self.monodromy.T @ self.form @ self.monodromy
        sizes = np.abs(self.monodromy)
        return bool(np.all(np.abs(kept - self.form) <= SYMPLECTIC * (sizes.T @ np.abs(self.form) @ sizes)))

    @cached_property
    def signatures(self) -> np.ndarray:
        """Krein's signatures (2n,) of the multipliers: 1 or -1 on the unit circle, 0 elsewhere.

        It is the sign of Im(xᴴ S x) for the vector x of the multiplier and the form S, such that exp(iωT) of an
        oscillator with the energy (p² + ω² q²)/2 has 1. Of multipliers that are the same, those of the form on all
        their vectors; 0 where that has no sign, and everywhere for what does not keep the form. Multipliers that meet
        on the circle leave it only where their signatures differ (Krein 1950; Yakubovich and Starzhinskii, ch. III).
        """
        signs = np.zeros(len(self.multipliers), dtype=int)
        if not self.symplectic:
            return signs
        values, vectors = self.multipliers, self._spectrum.vectors
        left = np.flatnonzero(np.abs(np.abs(values) - 1) <= np.maximum(self._spectrum.noise, ONE_SIGNATURE))
        while len(left):
            near = np.abs(values[left] - values[left[0]]) <= ONE_SIGNATURE
            group, left = left[near], left[~near]
            on_them = -1j * vectors[:, group].conj().T @ self.form @ vectors[:, group]
            kinds = np.linalg.eigvalsh((on_them + on_them.conj().T) / 2)
            sizes = np.abs(vectors[:, group])
            sure = np.abs(kinds) > DEFINITE * np.max(np.sum(sizes * (np.abs(self.form) @ sizes), axis=0))
            signs[group] = np.where(sure, np.sign(kinds), 0)[::-1]
        return signs

    @property
    def stable(self) -> bool:
        """Whether every small motion stays small, as far as the linear equations say.

        Not so where multipliers on the circle are the same and may lack a vector, along which motions grow as powers:
        a closed orbit of a system that does not know the time always has such a pair, being one of a family, and
        :attr:`ClosedOrbit.stable` leaves that out.
        """
        sizes, noise = np.abs(self.multipliers), np.minimum(self._spectrum.noise, OUTSIDE_CIRCLE)
        on_circle = np.abs(sizes - 1) <= noise
        return bool(np.all(sizes <= 1 + noise) and np.all(self._spectrum.alone[on_circle]))


@dataclass(frozen=True)
class Monodromy:
    """Motions with all that begin beside them."""

    equations: Variational
    flow: Flow

    @classmethod
    def of(cls, rates: ca.Function) -> Monodromy:
        """Of a system d(q, v)/dt of (t, (q, v), constants)."""
        equations = variational(rates, range(rates.numel_in(1)), ())
        return cls(equations, integrators.Piecewise(integrators.for_many()).compile(equations.system))

    def __call__(self, state: np.ndarray, numbers: np.ndarray, period: float) -> tuple[np.ndarray, np.ndarray]:
        """The state (2n,) after a period, and its derivatives (2n, 2n) by the first."""
        run = self.flow.trajectory(np.array([0.0, period]), self.equations.start(state), numbers, level=1)
        if not run.completed:
            raise ValueError(f"the motion does not last for a period: {run.outcome.value}")
        return self.equations.split(run.states[-1])


@dataclass(frozen=True)
class MonodromyAtRest:
    """Small motions of N = 2n coordinates and rates about a place that stands still, which need no motion to follow.

    Beside the matrix the integral of its rates' trace is carried, of which its determinant is the exponential
    (Liouville): where the matrix is large, its own determinant is round-off.
    """

    flow: Flow
    size: int

    @classmethod
    def of(cls, rates: ca.Function) -> MonodromyAtRest:
        """Of a system d(q, v)/dt of (t, (q, v), constants); the place is a constant, behind the others."""
        size = rates.numel_in(1)
        t, state, numbers = ca.SX.sym("t"), ca.SX.sym("y", size), ca.SX.sym("c", rates.numel_in(2))
        place, columns = ca.SX.sym("q0", size // 2), ca.SX.sym("Y", size * size + 1)
        slope = ca.jacobian(rates(t, state, numbers), state)
        slope = ca.substitute(slope, state, ca.vertcat(place, ca.SX.zeros(size // 2)))
        moved = ca.mtimes(slope, ca.reshape(columns[: size * size], size, size))
        rate = ca.densify(ca.vertcat(ca.vec(moved), ca.trace(slope)))
        system = ca.Function("about_rest", [t, columns, ca.vertcat(numbers, place)], [rate], {"cse": True})
        return cls(integrators.Piecewise(integrators.for_many()).compile(system), size)

    def __call__(self, q0: np.ndarray, numbers: np.ndarray, periods: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The matrices (m, N, N) and the logarithms of their determinants (m,), for constants (m, c)."""
        start = np.append(np.eye(self.size).ravel(), 0.0)
        constants = np.hstack([numbers, np.broadcast_to(q0, (len(numbers), len(q0)))])
        landing = self.flow.ensemble(np.tile(start, (len(numbers), 1)), constants, until=periods)
        states = np.where((landing.outcomes == COMPLETED)[:, None], landing.states, np.nan)
        return states[:, :-1].reshape(-1, self.size, self.size).swapaxes(1, 2), states[:, -1]
