"""One value of a family, begun from a solution nearby: :mod:`varcalc.methods.ritz.family` where all goes well.

What is asked of an answer is the same; what would take more than whole Newton steps in the space of the
solution nearby has none here, and is left to the family.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np

from varcalc.formulation import Form
from varcalc.methods.ritz.batch import ITERATIONS
from varcalc.methods.ritz.degeneracy import SOFT as SOFT_MODE
from varcalc.methods.ritz.error import ROUND_OFF, SOFT, UNMOVED
from varcalc.methods.ritz.family import Answer, Reports, reports_of, short_of
from varcalc.methods.ritz.integrands import reported
from varcalc.methods.ritz.level import Level
from varcalc.methods.ritz.newton import ARMIJO, CONVERGED
from varcalc.methods.ritz.rungs import DEGREES
from varcalc.symbolic.buffered import BufferedCall
from varcalc.symbolic.derived import derived


class One:
    """The space of ``degree`` and the next richer one, kept with the form for one value after the other."""

    def __init__(self, form: Form, degree: int, richer: int) -> None:
        self.form, self.degree = form, degree
        self.here, self.there = Level(form, degree), Level(form, richer)
        places = {int(number): place for place, number in enumerate(self.there.basis.free)}
        common = self.there.basis.numbers[: degree + 1].ravel()
        own = {int(a): int(b) for a, b in zip(self.here.basis.numbers.ravel(), common, strict=True)}
        self._carried = np.array([places[own[int(number)]] for number in self.here.basis.free], dtype=int)
        self._report = None if form.same_functional and not form.stated.is_lifted else _Reported(self.there)

    @classmethod
    def of(cls, form: Form, degree: int) -> One | None:
        """The pair of spaces for a solution of ``degree``; None where there is no richer one to judge it in.

        Nor is there one for prescribed integrals.
        """
        ladder = DEGREES[form.order][:-1]
        if degree not in ladder[:-1] or form.integrals:
            return None
        return _one(form, degree, ladder[ladder.index(degree) + 1])

    def solved(
        self, span: np.ndarray, fixed: np.ndarray, parameters: np.ndarray, start: np.ndarray, tol: float
    ) -> Answer | None:
        """The minimum from the curve of the coefficients ``start``, where nothing about it is in doubt.

        ``span`` (2,), what is ``fixed`` at both ends (2 n,) and ``parameters`` are those of :meth:`Level.place`.
        """
        self.here.place(span, fixed, parameters)
        found = self._minimum(start[self.here.basis.free])
        if found is None:
            return None
        z, steps = found
        self.there.place(span, fixed, parameters)
        richer = np.zeros(len(self.there.basis.free))
        richer[self._carried] = z
        return self._judged(z, richer, steps, tol)

    def _minimum(self, z: np.ndarray) -> tuple[np.ndarray, int] | None:
        """Newton's iteration by whole steps, as in :func:`varcalc.methods.direct.batch.minimise`, and their number."""
        level = self.here
        value = level.evaluate(z)
        for iteration in range(1, ITERATIONS + 1):
            gradient, scale = level.gradient(), level.scale
            step = _solved(level.assembled(level.hessians), gradient)
            if step is None:
                return None
            fall = float(step @ gradient)
            z = z + step
            if -0.5 * fall <= CONVERGED * scale:
                return z, iteration
            moved = level.evaluate(z)
            if not moved <= value + ARMIJO * fall + 1e-14 * (scale + abs(value)):
                return None
            value = moved
        return None

    def _judged(self, z: np.ndarray, richer: np.ndarray, steps: int, tol: float) -> Answer | None:
        """The minimum ``z`` as an answer; see :func:`varcalc.methods.family._judged`."""
        there, n = self.there, self.form.n
        value, scale = there.evaluate(richer), there.scale
        top = there.hessians[:, n:, n:]
        soft = there.hessians.copy()
        soft[:, n:, n:] -= SOFT_MODE * top
        soft[:, :n, :n] -= (SOFT_MODE / there.length**2) * top
        if not (np.isfinite(value) and there.legendre()) or _lapack()[0](there.assembled(soft).T, lower=1)[1]:
            return None
        gradient = there.gradient()
        step = _solved(there.assembled(there.hessians), gradient)
        if step is None:
            return None
        moved = there.moved(step)
        decrement = -0.5 * float(step @ gradient)
        squares = moved * moved
        weight = there.weights[:, None] * np.abs(top.diagonal(0, 1, 2))
        size = 0.5 * float(np.vdot(weight, squares[1]) + np.vdot(weight, squares[0]) / there.length**2)
        if not (size <= UNMOVED**2 * scale or decrement >= SOFT * size):
            return None
        largest = max(float(np.abs(there.variables[0]).max()), 1e-300)
        reports = self._reports(z, value, scale, decrement, moved)
        if not (np.all(short_of(reports, largest, tol) <= 1) and reports.resolved.all() and reports.graph.all()):
            return None
        error = float(reports.error[0]) + ROUND_OFF * float(reports.scale[0])
        curve = max(float(reports.curve[0]), 4e-16 * largest)
        coefficients = self.here.coefficients(z)
        return Answer(float(reports.value[0]), error, curve, self.degree, coefficients, steps, np.zeros(0))

    def _reports(self, z: np.ndarray, value: float, scale: float, decrement: float, moved: np.ndarray) -> Reports:
        there = self.there
        here = beyond = there.out[None, :, :1]
        if self._report is not None:
            here, beyond = self._report(moved)
        own = self.here.evaluate(z) if self.form.same_functional else value
        return reports_of(
            self.form, there.weights, moved[0], np.array([there.length]), here, beyond,
            np.array([abs(decrement) + abs(value - own)]), np.array([scale]),
        )  # fmt: skip


@derived
def _one(form: Form, degree: int, richer: int) -> One:
    return One(form, degree, richer)


class _Reported:
    """What is reported of the curve of a level and of one it is moved to, in one call."""

    def __init__(self, level: Level) -> None:
        function, count, n = reported(level.form), level.basis.count, level.n
        self.level = level
        self.x, self.parameters = np.zeros((2, count, 1)), np.zeros((2, count, level.parameters.shape[1]))
        self.y, self.dy = np.zeros((2, count, n)), np.zeros((2, count, n))
        self.out = np.zeros((2, count, function.numel_out(0)))
        blank = np.zeros((2 * count, 0))
        inputs = [self.x, self.y, self.dy, blank, self.parameters, blank]
        self._call = BufferedCall(function.map(2 * count), inputs, self.out)

    def __call__(self, moved: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The rows at the level's points, without and with the variables ``moved``; each (1, Q, rows)."""
        level = self.level
        self.x[:], self.parameters[:] = level.x, level.parameters
        for own, there, by in zip((self.y, self.dy), level.variables, moved, strict=True):
            own[0] = there
            np.add(there, by, out=own[1])
        self._call()
        return self.out[:1], self.out[1:]


def _solved(hessian: np.ndarray, gradient: np.ndarray) -> np.ndarray | None:
    """The Newton step; None where the Hessian is not positive definite, or something is no number."""
    dpotrf, dpotrs = _lapack()
    factor, failed = dpotrf(hessian.T, lower=1)
    if failed:
        return None
    step = dpotrs(factor, gradient, lower=1)[0]
    return -step if np.isfinite(step).all() else None


@lru_cache(maxsize=1)
def _lapack() -> tuple[Callable[..., Any], Callable[..., Any]]:
    """LAPACK's own factorisation by Cholesky and its solution: they take a tenth of the time of NumPy's."""
    from scipy.linalg.lapack import dpotrf, dpotrs  # loaded by the first call, not with the package

    return dpotrf, dpotrs
