"""A variational integrator of Galerkin's kind: one polynomial a step, on which the discrete action is stationary.

In a step of length h the coordinates are a polynomial of degree s through Lobatto's points, whose weights sum L. The
momenta at both ends are the derivatives of that sum, so that steps join into a map that keeps the symplectic form,
and the momenta of symmetries, to round-off, and whose energy does not drift. Its order is 2 s. Holonomic constraints
hold at Lobatto's points, with momenta that keep to them at the ends of steps (J. E. Marsden, M. West, Acta Numer. 10
(2001), 357, sect. 2.2.6 and 3.5; L. O. Jay, SIAM J. Numer. Anal. 33 (1996), 368).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from varcalc.mechanics.constraints import Held
from varcalc.mechanics.lagrange import Lagrange
from varcalc.numerics.mesh import lobatto
from varcalc.showing import Shown
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.tracing import Expression

NEWTON = 12
"""Steps for one step in time."""
LAST = 1e-16
"""A step of Newton's, of the size of the coordinates, after which nothing is left: earlier ends cost momenta digits."""
MISSED_MOMENTUM = 1e-8
"""What the equations of a step may leave, of the momenta."""
CHUNK = 1000
"""Steps in one call."""


@dataclass(frozen=True, repr=False, eq=False)
class Stepped(Shown):
    """Coordinates ``q``, rates ``v``, momenta ``p`` (n, k + 1) and the ``energy`` (k + 1,) at ``times`` (k + 1,)."""

    times: np.ndarray
    q: np.ndarray
    v: np.ndarray
    p: np.ndarray
    energy: np.ndarray


@dataclass(frozen=True)
class GalerkinSteps:
    """Steps of polynomials of one ``degree`` for a Lagrangian, its forces, and holonomic constraints ``held``."""

    lagrange: Lagrange
    held: Held | None
    degree: int
    size: float = 1.0
    """Of the coordinates, to tell when Newton's iteration has come to its end."""

    @property
    def _options(self) -> dict[str, Any]:
        return {"max_iter": NEWTON, "abstol": 0.0, "abstolStep": LAST * self.size, "error_on_fail": False}

    @cached_property
    def _rule(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Lobatto's points on [0, 1], their weights, and the derivatives (s + 1, s + 1) of polynomials there."""
        x = (np.asarray(lobatto(self.degree)) - lobatto(self.degree)[0]) / np.ptp(lobatto(self.degree))
        powers = np.arange(self.degree + 1)
        table = np.vander(2 * x - 1, increasing=True)
        weights = np.linalg.solve(table.T, np.where(powers % 2 == 0, 1 / (powers + 1), 0.0))
        slopes = np.column_stack([np.zeros(len(x)), table[:, :-1] * (2 * powers[1:])])
        return x, weights, np.linalg.solve(table.T, slopes.T).T

    @property
    def _constraints(self) -> int:
        return 0 if self.held is None else self.held.level.numel()

    def _sums(
        self, q: Expression, gone: list[Expression], multipliers: list[Expression], t: Expression, h: Expression
    ) -> list[Expression]:
        """The derivatives of the discrete action by the coordinates at the points, with forces and constraints.

        The points are ``q`` and as much beyond it as each has ``gone``: of these rates lose no digits.
        """
        s = self.lagrange.symbols
        x, weights, slopes = self._rule
        inner = ca.Function("L", s.all, [self.lagrange.value])
        forces = ca.Function("Q", s.all, [self.lagrange.forces])
        rates = [sum(slopes[i, j + 1] * one for j, one in enumerate(gone)) / h for i in range(len(x))]
        at = [(t + x[i] * h, q + ahead, rates[i]) for i, ahead in enumerate([ca.SX.zeros(*q.shape), *gone])]
        sums = [h * weights[i] * inner(*place, s.p) for i, place in enumerate(at)]
        beyond = [ca.gradient(sum(sums), one) for one in gone]
        found = [ca.gradient(sum(sums), q) - sum(beyond), *beyond]
        found = [part + h * weights[i] * forces(*at[i], s.p) for i, part in enumerate(found)]
        if self.held is not None:
            rows = ca.Function("rows", s.all, [self.held.rows])
            for i, own in enumerate(multipliers):
                found[i] += h * weights[i] * ca.mtimes(rows(*at[i], s.p).T, own)
        return found

    @cached_property
    def _step(self) -> ca.Function:
        """(q, p, guess), t, h and parameters to (q, p, guess) after a step, the rates there and what is missed."""
        s, n, k, degree = self.lagrange.symbols, self.lagrange.symbols.q.numel(), self._constraints, self.degree
        t, h, q, p = ca.SX.sym("t"), ca.SX.sym("h"), ca.SX.sym("q", n), ca.SX.sym("p", n)
        later, multipliers = ca.SX.sym("z", n, degree), ca.SX.sym("l", k, degree)
        gone = ca.horzsplit(later)
        sums = self._sums(q, gone, ca.horzsplit(multipliers) if k else [], t, h)
        equations = [p + sums[0], *sums[1:-1]]
        if self.held is not None:
            level = ca.Function("level", [s.t, s.q, s.p], [self.held.level])
            x = self._rule[0]
            equations += [level(t + x[i + 1] * h, q + one, s.p) / h**2 for i, one in enumerate(gone)]
        unknowns = ca.vertcat(ca.vec(later), ca.vec(multipliers))
        given, left = ca.vertcat(t, h, q, p, s.p), ca.vertcat(*equations)
        solver = ca.rootfinder(
            "step", "newton", ca.Function("equations", [unknowns, given], [left, sums[-1], ca.norm_inf(left)]),
            self._options,
        )  # fmt: skip
        return self._joined(solver, n, k)

    def _joined(self, solver: ca.Function, n: int, k: int) -> ca.Function:
        s = self.lagrange.symbols
        t, h, numbers = ca.MX.sym("t"), ca.MX.sym("h"), ca.MX.sym("c", s.p.numel())
        state = ca.MX.sym("state", 2 * n + (n + k) * self.degree)
        q, p, guess = ca.vertsplit(state, [0, n, 2 * n, state.numel()])
        solved, end, missed = solver(guess, ca.vertcat(t, h, q, p, numbers))
        last = solved[n * (self.degree - 1) : n * self.degree]
        v, momenta = self._at_end(q + last, end, t + h, numbers, last / h)
        # the next step begins to be looked for where this one went
        return ca.Function("joined", [state, t, h, numbers], [ca.vertcat(q + last, momenta, solved), v, missed])

    def _at_end(self, q: Expression, raw: Expression, t: Expression, numbers: Expression, guess: Expression) -> Any:
        """The rates and momenta at the end of a step, brought onto the constraints."""
        s, n, k = self.lagrange.symbols, self.lagrange.symbols.q.numel(), self._constraints
        push, own = ca.SX.sym("raw", n), ca.SX.sym("mu", k)
        rows = ca.SX(0, n) if self.held is None else self.held.rows
        drift = ca.SX(0, 1) if self.held is None else self.held.drift
        left = ca.vertcat(self.lagrange.momenta - push - ca.mtimes(rows.T, own), ca.mtimes(rows, s.v) + drift)
        solver = ca.rootfinder(
            "end", "newton",
            ca.Function("end", [ca.vertcat(s.v, own), ca.vertcat(s.t, s.q, push, s.p)], [left, self.lagrange.momenta]),
            self._options,
        )  # fmt: skip
        found, momenta = solver(ca.vertcat(guess, ca.MX.zeros(k)), ca.vertcat(t, q, raw, numbers))
        return found[:n], momenta

    def run(self, q: np.ndarray, v: np.ndarray, times: np.ndarray, numbers: np.ndarray) -> Stepped:
        """Steps from coordinates ``q`` and rates ``v`` (n,) through equidistant ``times`` (k + 1,).

        Raises ValueError where a step has no solution that is found: it is too long.
        """
        s, n, h = self.lagrange.symbols, len(q), float(times[1] - times[0])
        p = np.array(ca.Function("momenta", s.all, [self.lagrange.momenta])(times[0], q, v, numbers)).ravel()
        x = self._rule[0]
        guess = np.concatenate([np.concatenate([c * h * v for c in x[1:]]), np.zeros(self._constraints * self.degree)])
        state, states, rates = np.concatenate([q, p, guess]), [np.concatenate([q, p])], [v]
        for first in range(0, len(times) - 1, CHUNK):
            begins = times[first : min(first + CHUNK, len(times) - 1)]
            chain = self._step.mapaccum("steps", len(begins))
            after, along, missed = chain(state, begins[None, :], h, ca.repmat(ca.DM(numbers), 1, len(begins)))
            columns = np.array(after)
            wrong = ~(
                np.array(missed).ravel() <= MISSED_MOMENTUM * max(1e-300, float(np.abs(columns[n : 2 * n]).max()))
            )
            if np.any(wrong):
                raise ValueError(f"a step from t = {begins[np.argmax(wrong)]:.6g} has no solution: take more steps")
            states += list(columns[: 2 * n].T)
            rates += list(np.array(along).T)
            state = columns[:, -1]
        both, v_all = np.array(states).T, np.array(rates).T
        energies = PointEvaluator(ca.Function("energies", s.all, [self.lagrange.energy]))
        energy = energies(len(times), times[:, None], both[:n].T, v_all.T, np.reshape(numbers, (1, -1)))[:, 0]
        return Stepped(times, both[:n], v_all, both[n:], energy)
