"""Legendre's transformation: the Hamiltonian of a regular Lagrangian, and Hamilton's equations."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from varcalc.mechanics.lagrange import Lagrange
from varcalc.problem.conditions import reals
from varcalc.showing import Shown

STEPS = 60
"""Newton's, for the velocities of momenta that are not linear in them."""
FOUND, MISSED = 1e-14, 1e-9
"""Of velocities and momenta: a step that is none, and what may be left."""


@dataclass(frozen=True, repr=False, eq=False)
class Hamiltonian(Shown):
    """H(t, q, p) = p·v - L of a Lagrangian, with the velocities that belong to momenta.

    Arrays are (n,) or (n, m), of m states; ``numbers`` are the values of the parameters.
    """

    lagrange: Lagrange
    numbers: np.ndarray

    @cached_property
    def _parts(self) -> ca.Function:
        s, one = self.lagrange.symbols, self.lagrange
        rate_of_p = ca.densify(ca.gradient(one.value, s.q))
        return ca.Function("parts", s.all, [one.momenta, one.mass, one.energy, rate_of_p])

    def velocity(self, t: float, q: ArrayLike, p: ArrayLike) -> np.ndarray:
        """The v of the momenta ``p``: by one solution where they are linear in v, by Newton's iteration elsewhere."""
        q, p = reals("q", q), reals("p", p)
        if q.ndim == 2:
            return np.stack([self.velocity(t, a, b) for a, b in zip(q.T, p.T, strict=True)], axis=1)
        v, step = np.zeros_like(q), np.full_like(q, np.inf)
        if np.linalg.matrix_rank(np.array(self._parts(t, q, v, self.numbers)[1])) < len(q):
            v = p.copy()  # no inertia at rest, as of v⁴
        for _ in range(STEPS):
            momenta, mass, _, _ = (np.array(part) for part in self._parts(t, q, v, self.numbers))
            step = np.linalg.lstsq(mass, p - momenta.ravel(), rcond=None)[0]
            best = 1.0
            while best > FOUND:  # a step may lead out of L's domain
                there = np.array(self._parts(t, q, v + best * step, self.numbers)[0]).ravel()
                if np.all(np.isfinite(there)) and np.abs(there - p).max() <= np.abs(momenta.ravel() - p).max():
                    break
                best /= 2
            v = v + best * step
            if np.abs(step).max() <= FOUND * max(np.abs(v).max(), 1e-300):
                break
        short = np.abs(np.array(self._parts(t, q, v, self.numbers)[0]).ravel() - p).max()
        if not short <= MISSED * max(np.abs(p).max(), 1e-300):
            raise ValueError(f"no velocity was found whose momenta are p = {p} at t = {t:.6g}, q = {q}")
        return v

    def __call__(self, t: float, q: ArrayLike, p: ArrayLike) -> float:
        """H at coordinates and momenta (n,)."""
        return float(self._parts(t, q, self.velocity(t, q, p), self.numbers)[2])

    def equations(self, t: float, q: ArrayLike, p: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Hamilton's equations: dq/dt = H_p and dp/dt = -H_q (n,), without forces that no Lagrangian gives."""
        v = self.velocity(t, q, p)
        return v, np.array(self._parts(t, q, v, self.numbers)[3]).ravel()
