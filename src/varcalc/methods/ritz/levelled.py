"""Many values of one form at once under prescribed integrals.

The directions that keep the levels to first order are the null space of their
gradients. There a Newton step is that of the Lagrangian function, with the
integrals' multipliers in it (Nocedal and Wright, "Numerical Optimization",
sect. 16.2 and 18.4): :mod:`varcalc.methods.ritz.newton` for arrays.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from varcalc.formulation import Form
from varcalc.methods.ritz.batch import (
    HALVINGS,
    Batch,
    Evaluated,
    Places,
    Steps,
    least_eigenvalue,
    positive,
    solutions,
)
from varcalc.methods.ritz.integrands import integrands, pointwise
from varcalc.methods.ritz.newton import (
    ARMIJO,
    CONVERGED,
    INEFFECTIVE,
    NEARLY_SINGULAR,
    SHRINK,
    lowest_eigenvalue,
)
from varcalc.symbolic.buffered import Pointwise
from varcalc.symbolic.derived import derived

ITERATIONS = 20
"""Newton steps after which a value is left to a solve of its own: a bend is further from a minimum than a neighbour."""
FEASIBLE = 1e-6
"""Relative miss of a level at which a step may be the last one."""
MET = 1e-10
"""Relative miss of a level that is none."""
DEPENDENT = 1e-13
"""Share of the largest gradient of a level by which another has to differ from it."""
MANY = 256
"""Points at which integrands are evaluated in one go."""
PENALTY = 1e-3
"""Least weight of a level's miss in the merit function, in units of the functional by the level."""


@dataclass
class LevelledEvaluated(Evaluated):
    """An evaluation under ``m`` levels; ``blocks`` and ``legendre`` are those of the Lagrangian function.

    ``sizes`` (K, m) are those of what is summed to the prescribed integrals, ``gradients`` (K, m, N) theirs,
    ``effective`` (K,) tells whether each of them can be changed, ``multipliers`` (K, m) are those in the
    Lagrangian function.
    """

    sizes: np.ndarray
    gradients: np.ndarray
    effective: np.ndarray
    multipliers: np.ndarray

    @property
    def sound(self) -> np.ndarray:
        """Where everything is a number and every level can be changed; (K,) of bool."""
        finite = np.isfinite(self.value) & np.isfinite(self.conditions).all(1)
        return finite & self.effective & np.isfinite(self.gradient).all(1) & np.isfinite(self.gradients).all((1, 2))

    @property
    def met(self) -> np.ndarray:
        """Where every level is met; (K,) of bool."""
        return np.all(np.abs(self.conditions) <= MET * self.sizes, axis=1)

    def reduced(self, matrices: np.ndarray) -> np.ndarray:
        """The matrices (K, N, N) on the directions that keep the levels to first order."""
        return _Frame.of(self.gradients).reduced(matrices)

    @property
    def spread(self) -> np.ndarray:
        """The size of what the value is made of, for its round-off: levels count with their multipliers."""
        return self.scale + (np.abs(self.multipliers) * self.sizes).sum(1)


@dataclass
class _Frame:
    """Where levels hold to first order: ``null`` (K, N, N - m); ``across`` (K, N, m) and ``r`` factor the gradients."""

    across: np.ndarray
    null: np.ndarray
    r: np.ndarray

    @classmethod
    def of(cls, gradients: np.ndarray) -> _Frame:
        m = gradients.shape[1]
        q, r = np.linalg.qr(gradients.transpose(0, 2, 1), mode="complete")
        return cls(q[:, :, :m], q[:, :, m:], r[:, :m])

    def __getitem__(self, rows: np.ndarray) -> _Frame:
        return _Frame(self.across[rows], self.null[rows], self.r[rows])

    def back(self, conditions: np.ndarray) -> np.ndarray:
        """The least step that makes up for missing the levels by ``conditions`` (K, m)."""
        return -_applied(self.across, solutions(self.r.transpose(0, 2, 1), conditions))

    def reduced(self, matrices: np.ndarray) -> np.ndarray:
        return self.null.transpose(0, 2, 1) @ matrices @ self.null


def _applied(matrices: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Each of the matrices (K, a, b) times its vector (K, b)."""
    return (matrices @ vectors[:, :, None])[:, :, 0]


class Levelled(Batch):
    """A batch whose form prescribes the values of integrals."""

    def __init__(self, form: Form, degree: int, places: Places) -> None:
        super().__init__(form, degree, places)
        self.levels = np.array([c.lower for c in form.integrals])
        self.least = np.maximum(np.abs(self.levels), 1e-300)

    def evaluate(self, z: np.ndarray, multipliers: np.ndarray | None = None) -> LevelledEvaluated:
        """The functionals, the levels and their derivatives; by default with least-squares multipliers."""
        k, m, variables = 2 * self.n, len(self.levels), self.variables(z)
        out = self._called(pointwise, variables).reshape(*self.x.shape, 1 + m, -1)
        integrands, across = out[:, :, :, 0], self.weights[:, None, :]
        values, summed = (across @ integrands)[:, 0], (across @ np.abs(integrands))[:, 0]
        rows = out[:, :, :, 1 : 1 + k] * self.first[:, :, None]
        gradients = rows.transpose(0, 2, 1, 3).reshape(len(z), 1 + m, -1) @ self.flat
        value = values[:, 0]
        if self.form.one_sided:
            value = np.where((variables[:, :, self.form.one_sided] < 0).any((1, 2)), np.inf, value)
        levels = gradients[:, 1:]
        if multipliers is None:
            multipliers = _least_squares(gradients[:, 0], levels)
        weights = np.concatenate([np.ones((len(z), 1)), multipliers], axis=1)
        whole = (weights[:, None, None] @ out[:, :, :, 1 + k :]).reshape(*self.x.shape, k, k)
        legendre = least_eigenvalue(whole[:, :, self.n :, self.n :])
        effective = np.all(np.abs(levels).max(2) > INEFFECTIVE * np.abs(rows[:, :, 1:]).sum((1, 3)), axis=1)
        if m > 1:
            effective &= _independent(levels)
        sizes = np.maximum(self.least, summed[:, 1:])
        return LevelledEvaluated(
            value, out[:, :, 0, 0], summed[:, 0], gradients[:, 0], whole * self.second, legendre,
            values[:, 1:] - self.levels, integrands[:, :, 1:], sizes, levels, effective, multipliers,
        )  # fmt: skip

    def checked(self, z: np.ndarray, multipliers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See :meth:`Batch.checked`."""
        at = self.evaluate(z, multipliers)
        return at.value, at.met

    def measured(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Functional (K, R) and integrals less their levels (K, R, m) along curves ``z`` (K, R, N), and no more."""
        shape = (*z.shape[:2], self.count, 2 * self.n)
        variables = (self.offset[:, None] + z @ self.flat.T).reshape(shape) * self.scale[:, None]
        rows, blank = variables.reshape(-1, 2 * self.n), np.zeros((1, 0))
        x = np.broadcast_to(self.x[:, None], shape[:3]).reshape(-1, 1)
        parameters = self.places.parameters
        if parameters.shape[1] and len(parameters) > 1:
            parameters = np.repeat(parameters, shape[1] * shape[2], axis=0)
        out = _integrands(self.form)(len(rows), x, rows[:, : self.n], rows[:, self.n :], blank, parameters, blank)
        sums = (self.weights[:, None, None] @ out.reshape(*shape[:3], -1))[:, :, 0]
        return sums[:, :, 0], sums[:, :, 1:] - self.levels

    def _weights(self, at: Evaluated) -> np.ndarray:
        """That of a batch, by the mean of its absolute value where the Legendre condition fails somewhere."""
        whole = super()._weights(at)
        mean = whole.mean(1, keepdims=True)
        mean = np.where(mean > 0, mean, np.where(mean.max(2, keepdims=True) > 0, mean.max(2, keepdims=True), 1.0))
        return np.where((at.legendre > 0)[:, None, None], whole, mean)

    def newton(self, at: Evaluated) -> Steps:
        """The Newton steps, where the second variation is positive on the directions that keep the levels."""
        assert isinstance(at, LevelledEvaluated)
        frame, hessians = _Frame.of(at.gradients), self.assembled(at.blocks)
        return _steps(at, frame, hessians, frame.reduced(hessians))

    def minimise(self, z: np.ndarray, *, shifting: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
        """Newton's iteration from ``z`` (K, N); the minima, their multipliers, where they are, and the steps taken.

        Where the second variation is not positive it is shifted by a multiple of the metric, or, without
        ``shifting``, the value is given up.
        """
        return _minimise(self, z, shifting=shifting)


def _minimise(batch: Levelled, z: np.ndarray, *, shifting: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    z, done, every = z.copy(), np.zeros(len(z), dtype=bool), np.zeros((len(z), len(batch.levels)))
    at = batch.evaluate(z)
    rows, batch, at = _kept(np.arange(len(z)), batch, at, at.sound)
    for iteration in range(1, ITERATIONS + 1):
        if not len(rows):
            return z, every, done, iteration - 1
        frame, hessians = _Frame.of(at.gradients), batch.assembled(at.blocks)
        reduced = frame.reduced(hessians)
        definite = positive(reduced)
        if shifting and not definite.all():
            hessians = _shifted(batch, at, frame, hessians, definite)
            reduced = frame.reduced(hessians)
        elif not definite.all():
            rows, batch, at = _kept(rows, batch, at, definite)
            frame, hessians, reduced = frame[definite], hessians[definite], reduced[definite]
            definite = definite[definite]
        steps = _steps(at, frame, hessians, reduced)
        feasible = (np.abs(at.conditions) <= FEASIBLE * at.sizes).all(1)
        last = definite & feasible & (steps.decrement <= CONVERGED * at.spread)
        if last.any():
            z[rows[last]] += steps.change[last]
            done[rows[last]], every[rows[last]] = True, steps.multipliers[last]
            if last.all():
                return z, every, done, iteration
            left = ~last
            rows, batch, at = _kept(rows, batch, at, left)
            frame = frame[left]
            steps = Steps(steps.change[left], steps.multipliers[left], steps.decrement[left])
        found, z[rows], at = _search(batch, z[rows], at, steps, frame)
        rows, batch, at = _kept(rows, batch, at, found)
    return z, every, done, ITERATIONS


def _kept(
    rows: np.ndarray, batch: Levelled, at: LevelledEvaluated, which: np.ndarray
) -> tuple[np.ndarray, Levelled, LevelledEvaluated]:
    """Rows, batch and evaluation of those that are to be gone on with."""
    return (rows, batch, at) if which.all() else (rows[which], batch.restricted(which), at[which])


def _shifted(
    batch: Levelled, at: LevelledEvaluated, frame: _Frame, hessians: np.ndarray, definite: np.ndarray
) -> np.ndarray:
    """The Hessians with those made positive that are not so on the directions that keep the levels."""
    bad = np.flatnonzero(~definite)
    part = batch.restricted(bad)
    metrics = part.assembled(part.metric(at[bad]))
    out = hessians.copy()
    for k, metric in zip(bad, metrics, strict=True):
        null = frame.null[k]
        lowest = lowest_eigenvalue(null.T @ hessians[k] @ null, null.T @ metric @ null)
        # along a symmetry, or where there is no metric, nothing tells how far to go
        out[k] = hessians[k] + (-1.5 * lowest if lowest < -NEARLY_SINGULAR else np.nan) * metric
    return out


def _search(
    batch: Levelled, z: np.ndarray, at: LevelledEvaluated, steps: Steps, frame: _Frame
) -> tuple[np.ndarray, np.ndarray, LevelledEvaluated]:
    """Backtrack on the l1 merit function; where it falls, the curves there and what is there.

    A full step along curved levels leaves them by its square: it is corrected once before it is shortened.
    """
    weights = 2 * np.abs(steps.multipliers) + PENALTY * at.scale[:, None] / at.sizes
    penalty = (weights * np.abs(at.conditions)).sum(1)
    merit, fall = at.value + penalty, np.einsum("kn,kn->k", steps.change, at.gradient) - penalty
    noise = 1e-14 * (at.scale + np.abs(merit))

    def descends(trial: LevelledEvaluated, rows: np.ndarray, length: float) -> np.ndarray:
        value = trial.value + (weights[rows] * np.abs(trial.conditions)).sum(1)
        return trial.sound & (value <= merit[rows] + ARMIJO * length * np.minimum(fall[rows], 0) + noise[rows])

    moved = z + steps.change
    trial = batch.evaluate(moved, steps.multipliers)
    found = descends(trial, np.arange(len(z)), 1.0)
    length, correcting = 1.0, True
    for _ in range(HALVINGS + 1):
        left = np.flatnonzero(~found)
        if not len(left):
            break
        if correcting:
            shorter, correcting = moved[left] + frame[left].back(trial.conditions[left]), False
        else:
            length *= SHRINK
            shorter = z[left] + length * steps.change[left]
        there = batch.restricted(left).evaluate(shorter, steps.multipliers[left])
        good = descends(there, left, length)
        moved[left[good]] = shorter[good]
        for name, values in vars(there).items():
            getattr(trial, name)[left[good]] = values[good]
        found[left[good]] = True
    return found, moved, trial


def _steps(at: LevelledEvaluated, frame: _Frame, hessians: np.ndarray, reduced: np.ndarray) -> Steps:
    """The steps of the quadratic models under the linearised levels; ``reduced`` are their Hessians there."""
    back = frame.back(at.conditions)
    slope = at.gradient + _applied(hessians, back)
    along = -solutions(reduced, _applied(frame.null.transpose(0, 2, 1), slope))
    change = back + _applied(frame.null, along)
    pull = _applied(frame.across.transpose(0, 2, 1), at.gradient + _applied(hessians, change))
    multipliers = -solutions(frame.r, pull)
    return Steps(change, multipliers, 0.5 * np.einsum("ka,kab,kb->k", along, reduced, along))


def _independent(gradients: np.ndarray) -> np.ndarray:
    """Whether no level's gradient (K, m, N) is a combination of the others'; (K,) of bool."""
    finite = np.all(np.isfinite(gradients), axis=(1, 2))
    sizes = np.linalg.norm(gradients, axis=2, keepdims=True)
    units = np.where(finite[:, None, None], gradients / np.where(sizes > 0, sizes, 1.0), 0.0)
    return finite & (np.linalg.svd(units, compute_uv=False)[:, -1] > DEPENDENT)


def _least_squares(gradient: np.ndarray, levels: np.ndarray) -> np.ndarray:
    """The multipliers (K, m) that make the gradient of the Lagrangian function smallest; 0 where they are no numbers.

    With none at all an isoperimetric problem may look concave, the convexity being in the constraint.
    """
    found = np.zeros(levels.shape[:2])
    sound = np.isfinite(gradient).all(1) & np.isfinite(levels).all((1, 2))
    if levels.shape[1] == 1:
        squares = (levels[:, 0] ** 2).sum(1)
        sound &= squares > 0
        found[sound, 0] = -np.einsum("kn,kn->k", gradient[sound], levels[sound, 0]) / squares[sound]
    else:
        for k in np.flatnonzero(sound):
            found[k] = np.linalg.lstsq(levels[k].T, -gradient[k], rcond=None)[0]
    return found


@derived
def _integrands(form: Form) -> Pointwise:
    """Those of the functional and the levels at points."""
    return Pointwise(integrands(form), MANY)
