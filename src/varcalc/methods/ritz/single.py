"""One form on one element at its own parameter values: Newton's iteration and its error, in as few calls as can be.

A small problem that is solved once costs what its calls cost, not its arithmetic.
What is asked of an answer is what :mod:`varcalc.methods.ritz.family` asks of many;
where any of it is in doubt there is no answer here.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np

from varcalc.formulation import Form, Reported, Sampled
from varcalc.methods.answer import SEEN_FORWARD, TURNED, Along, Extremal, answer
from varcalc.methods.ritz.batch import HALVINGS, ITERATIONS, least_eigenvalue
from varcalc.methods.ritz.degeneracy import SOFT as SOFT_MODE
from varcalc.methods.ritz.element import OneElement
from varcalc.methods.ritz.error import ASTRAY, ASTRAY_SHARE, CURVE, ROUND_OFF, SAFETY, SOFT, UNMOVED
from varcalc.methods.ritz.newton import ARMIJO, CONVERGED, NEARLY_SINGULAR, SHRINK, lowest_eigenvalue
from varcalc.methods.ritz.quadrature import RESOLVED, missed
from varcalc.methods.ritz.rungs import DEGREES, quadrature_points
from varcalc.numerics.mesh import Space, gauss, interpolation, lobatto
from varcalc.solution import ErrorEstimate, Solution, Stats


@dataclass(frozen=True)
class Found:
    """A minimum: ``value`` in the sense that is minimised, the claimed errors, the curve's degree and coefficients."""

    value: float
    error: float
    curve: float
    degree: int
    coefficients: np.ndarray
    unknowns: int
    iterations: int
    along: Along | None
    build: float
    """Seconds before the first step."""


class _Table:
    """What all curves of one degree with the same ends ``held`` share: from free coefficients to (y, y') on [-1, 1]."""

    def __init__(self, n: int, degree: int, held: tuple[bool, ...]) -> None:
        space, self.count = Space(np.array([-1.0, 1.0]), degree, n, 1), quadrature_points(degree)
        self.numbers, self.size = space.numbers[0], space.size
        whole = OneElement(space, self.count, 1, np.arange(space.size), np.zeros(space.size), 0).matrix
        self.held = self.numbers[:2].ravel()[np.array(held)]
        self.free = np.delete(np.arange(self.size), self.held)
        self.matrix = np.ascontiguousarray(whole[:, :, self.free])
        self.known = np.ascontiguousarray(whole[:, :, self.held])
        self.nodes, self.weights = gauss(self.count)
        self.lobatto = 0.5 * (1 + lobatto(degree))
        self.fitting = np.linalg.inv(interpolation(1, degree))


_table = lru_cache(maxsize=64)(_Table)


@dataclass
class _At:
    """The functional at one curve: see :class:`varcalc.methods.ritz.batch.Evaluated`, of which this is one entry.

    ``u`` (Q, k) are the variables of the form's numbers at the Gauss points, ``integrand`` (Q,) what was summed,
    ``slopes`` (Q, k) its gradients, ``blocks`` (Q, k, k) the weighted Hessians.
    """

    u: np.ndarray
    integrand: np.ndarray
    slopes: np.ndarray
    value: float
    scale: float
    gradient: np.ndarray
    blocks: np.ndarray
    sound: bool


class Single:
    """The discretised functional of ``form``, polynomials of one degree; the form has numbers."""

    def __init__(self, form: Form, degree: int) -> None:
        n, (a, b) = form.n, form.span
        ends = np.concatenate([form.fixed_start[0], form.fixed_end[0]])
        held = ~np.isnan(ends)
        self.form, self.n, self.degree = form, n, degree
        self.table = table = _table(n, degree, tuple(held.tolist()))
        self.fixed, half = ends[held], 0.5 * (b - a)
        self.length = b - a
        self.weights = half * table.weights
        assert form.numbers is not None
        self.s = a + half * (1 + table.nodes)
        self.numbers = form.numbers.on(form.problem, self.s)  # type: ignore[arg-type]
        scale = np.array([1.0] * n + [1.0 / half] * n)
        self.own = table.matrix * scale[:, None]
        self.offset = (table.known @ self.fixed) * scale
        self.own_offset, self.matrix, transform = self.offset, self.own, self.numbers.transform
        if transform is not None and self.numbers.offset is not None:
            self.matrix = transform @ self.own
            self.offset = (transform @ self.offset[:, :, None])[:, :, 0] + self.numbers.offset
        self.k = self.offset.shape[1]
        self.flat = self.matrix.reshape(-1, self.matrix.shape[2])

    def fit(self, curve: Sampled) -> np.ndarray:
        """The unknowns of the polynomial that interpolates ``curve``."""
        table, (a, _) = self.table, self.form.span
        values = np.asarray(curve(a + self.length * table.lobatto), dtype=float)
        out = np.empty(table.size)
        out[table.numbers] = table.fitting @ values.T
        return out[table.free]

    def coefficients(self, z: np.ndarray) -> np.ndarray:
        """All coefficients, those of the ends included."""
        out = np.empty(self.table.size)
        out[self.table.free], out[self.table.held] = z, self.fixed
        return out

    def of_degree(self, coefficients: np.ndarray, other: Single) -> np.ndarray:
        """The unknowns of a curve with the ``coefficients`` of a poorer space."""
        out = np.zeros(self.table.size)
        out[self.table.numbers[: other.degree + 1]] = coefficients[other.table.numbers]
        return out[self.table.free]

    def moved(self, step: np.ndarray) -> np.ndarray:
        """By how much a step changes the variables of the form's numbers, (Q, k)."""
        return (self.flat @ step).reshape(-1, self.k)

    def own_moved(self, step: np.ndarray) -> np.ndarray:
        """By how much it changes (y, y'), (Q, 2 n)."""
        return self.own @ step

    def evaluate(self, z: np.ndarray) -> _At:
        """The functional and its derivatives; not sound where they are no numbers or Legendre's condition fails."""
        u, w, n = self.offset + self.moved(z), self.weights, self.n
        integrand, gradient, hessian = self.numbers.derivatives(u)
        value, scale = float(w @ integrand), float(w @ np.abs(integrand))
        total = (w[:, None] * gradient).ravel() @ self.flat
        top = hessian[:, n:, n:]
        legendre = float(top.min()) if n == 1 else float(least_eigenvalue(top[None])[0])
        sound = bool(np.isfinite(total).all()) and bool(np.isfinite(value)) and legendre > 0.0
        # the powers that numbers are stated with are positive, so that u has the signs of the form's own functions
        if self.form.one_sided and (u[:, self.form.one_sided] < 0).any():
            sound = False
        return _At(u, integrand, gradient, value, scale, total, hessian * w[:, None, None], sound)

    def assembled(self, blocks: np.ndarray) -> np.ndarray:
        """The matrix of a pointwise quadratic form (Q, k, k)."""
        return self.flat.T @ (blocks @ self.matrix).reshape(self.flat.shape)

    def metric(self, at: _At) -> np.ndarray:
        """The matrix of the metric, which weighs each function by its own second derivative in the slope."""
        weight, n = np.abs(np.einsum("qaa->qa", self.own_blocks(at))), self.n
        return self.leading(weight[:, :, None] * np.eye(n))

    def leading(self, blocks: np.ndarray) -> np.ndarray:
        """The matrix of pointwise blocks (Q, n, n) in the slopes, and in y on the interval's length."""
        n = self.n
        return _between(blocks, self.own[:, n:]) + _between(blocks, self.own[:, :n]) / self.length**2

    def own_blocks(self, at: _At) -> np.ndarray:
        """The second derivatives in the highest slopes of the form's own functions, weighted; (Q, n, n)."""
        n, transform = self.n, self.numbers.transform
        if transform is None:
            return at.blocks[:, n:, n:]
        return (transform.transpose(0, 2, 1) @ at.blocks @ transform)[:, n:, n:]


def minimum(system: Single, z: np.ndarray) -> tuple[np.ndarray, float, int] | None:
    """Newton's guarded iteration from ``z``: the minimum, the value there, the steps; None where it is in doubt."""
    at = system.evaluate(z)
    for iteration in range(1, ITERATIONS + 1):
        if not at.sound:
            return None
        hessian = system.assembled(at.blocks)
        step = definite = descent(hessian, at.gradient)
        if step is None:
            step = _shifted(hessian, system.metric(at), at.gradient)
        if step is None:
            return None
        fall = float(step @ at.gradient)
        if -0.5 * fall <= CONVERGED * at.scale and definite is not None:
            return z + step, at.value + 0.5 * fall, iteration
        found = _search(system, z, at, step, fall)
        if found is None:
            return None
        z, at = found
    return None


def descent(matrix: np.ndarray, gradient: np.ndarray) -> np.ndarray | None:
    """The Newton step of a positive definite Hessian; None of any other."""
    _, step, info = _dposv()(matrix, -gradient)
    return step if info == 0 else None


def load() -> None:
    """Load what takes a tenth of a second once in a process, and is no part of a solve."""
    _dposv()


@lru_cache(maxsize=1)
def _dposv() -> Callable[..., Any]:
    """LAPACK's own solution by Cholesky's factors: NumPy's two calls cost ten times as much on a small matrix."""
    from scipy.linalg.lapack import dposv  # loaded by the first solve, not with the package

    return dposv


def _shifted(hessian: np.ndarray, metric: np.ndarray, gradient: np.ndarray) -> np.ndarray | None:
    """The step of a Hessian that a multiple of the metric makes positive; None where nothing tells how far to go."""
    lowest = lowest_eigenvalue(hessian, metric)
    return descent(hessian - 1.5 * lowest * metric, gradient) if lowest < -NEARLY_SINGULAR else None


def _search(system: Single, z: np.ndarray, at: _At, step: np.ndarray, fall: float) -> tuple[np.ndarray, _At] | None:
    """Backtrack to where the functional falls, inside the guarded domain."""
    length, noise = 1.0, 1e-14 * (at.scale + abs(at.value))
    for _ in range(1 + HALVINGS):
        moved = z + length * step
        trial = system.evaluate(moved)
        if trial.sound and trial.value <= at.value + ARMIJO * length * fall + noise:
            return moved, trial
        length *= SHRINK
    return None


def solved(form: Form, tol: float, guess: Sampled | None) -> Found | None:
    """The minimum that the first starting curve leads to without difficulty; None where there is one."""
    started = time.perf_counter()
    ladder = [d for d in DEGREES[form.order][:-1] if d >= form.least_degree]
    here = Single(form, ladder[0])
    z, taken = here.fit(form.baseline if guess is None else guess), 0
    build = time.perf_counter() - started
    for _, richer in pairwise(ladder):
        found = minimum(here, z)
        if found is None:
            return None
        there = Single(form, richer)
        z, value, steps = found
        taken += steps
        judged = _judged(here, there, z, value, taken, tol)
        if not isinstance(judged, np.ndarray):
            return None if judged is None else replace(judged, build=build)
        here, z = there, judged
    return None


def _judged(
    here: Single, there: Single, z: np.ndarray, value: float, taken: int, tol: float
) -> Found | np.ndarray | None:
    """The minimum when it stands; where to begin in the richer space, when that would mend it; None in doubt.

    See :func:`varcalc.methods.direct.error.estimate`, of which this is the case without conditions.
    """
    coefficients = here.coefficients(z)
    start = there.of_degree(coefficients, here)
    at = there.evaluate(start)
    if not at.sound:
        return None
    hessian = there.assembled(at.blocks)
    top, n, length = there.own_blocks(at), there.n, there.length
    # what is positive with a part of the leading term taken off has no soft mode, and is no saddle
    step = descent(hessian, at.gradient)
    if step is None or descent(hessian - SOFT_MODE * there.leading(top), at.gradient) is None:
        return None
    decrement, moved = -0.5 * float(step @ at.gradient), there.own_moved(step)
    weight = np.abs(np.einsum("qaa->qa", top))
    size = 0.5 * float((weight * (moved[:, n:] ** 2 + (moved[:, :n] / length) ** 2)).sum())
    if not (size <= UNMOVED**2 * at.scale or decrement >= SOFT * size):
        return None
    report = _report(there, at, step, decrement, value)
    largest = max(float(np.abs(there.own_offset[:, :n] + there.own_moved(start)[:, :n]).max()), 1e-300)
    if not _met(report, largest, tol):
        return start + step
    if not (report.resolved and report.graph):
        return None
    error, size = report.error + ROUND_OFF * report.scale, max(report.curve, 4e-16 * largest)
    along = None
    if not there.form.stated.is_lifted:
        curvature = at.blocks[:, n:, n:] / there.weights[:, None, None]
        along = Along(there.s, at.u[:, :n].T, at.u[:, n:].T, at.integrand, at.slopes[:, n:].T, curvature)
    return Found(report.value, error, size, here.degree, coefficients, len(z), taken, along, 0.0)


def solution(form: Form, method: Any, found: Found, seconds: float) -> Solution:
    """A minimum as the Solution by ``method`` of the form's problem, found in ``seconds``."""
    vertices = np.array(form.span)
    evaluate = Space(vertices, found.degree, form.n, 1).curve(found.coefficients)
    none = np.zeros(0)
    extremal = Extremal(form, evaluate, none, vertices, none, {}, SEEN_FORWARD, found.coefficients, found.along)
    stats = Stats(found.build, seconds - found.build, found.iterations, found.unknowns, 1, found.degree)
    error, rule = ErrorEstimate(found.error, found.curve), quadrature_points(found.degree)
    return answer(extremal, method, form.sign * found.value, error, vertices, stats, rule=rule)


def _between(blocks: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Pointwise blocks (Q, n, n) between matrices (Q, n, N): shape (N, N)."""
    flat = matrix.reshape(-1, matrix.shape[2])
    return flat.T @ (blocks @ matrix).reshape(flat.shape)


@dataclass(frozen=True)
class _Report:
    """One entry of the family's reports."""

    value: float
    error: float
    scale: float
    curve: float
    resolved: bool
    graph: bool


def _report(there: Single, at: _At, step: np.ndarray, decrement: float, own: float) -> _Report:
    """Value and errors of a curve, which the step mends; ``own`` is its value by the poorer rule."""
    w, half = there.weights, 0.5 * there.length
    moved = there.moved(step)
    if there.form.stated.same_functional:
        error, curve = abs(decrement) + abs(at.value - own), float(np.abs(moved[:, : there.n]).max())
        value, scale, graph, integrand = at.value, at.scale, True, at.integrand
    else:
        here, beyond = there.numbers.reported(at.u), there.numbers.reported(at.u + moved)
        integrand, value = here.integrand, float(w @ here.integrand)
        error, scale = abs(value - float(w @ beyond.integrand)), abs(value)
        curve, graph = _apart(here, beyond, w)
    resolved = bool(missed(integrand[None])[0] * half <= RESOLVED * scale)
    return _Report(value, SAFETY * error, scale, SAFETY * curve, resolved, graph)


def _apart(here: Reported, beyond: Reported, weights: np.ndarray) -> tuple[float, bool]:
    """The largest distance of two curves at one abscissa, and whether the first goes on in it as a graph does."""
    dx = here.dx[:, None]
    slope = np.where(dx != 0, here.dy / dx, 0.0)
    curve = float(np.abs(beyond.y - here.y - slope * (beyond.x - here.x)[:, None]).max())
    backward = 1e-9 + TURNED * SAFETY * curve / float(weights @ here.dx)
    return curve, bool(here.dx.min() >= -backward * np.abs(here.dx).max())


def _met(report: _Report, size: float, tol: float) -> bool:
    """Whether value and curve are as good as a climb asks of them, and not limited by round-off."""
    whole = max(1.0, abs(report.value))
    target = min(tol * min(whole, 10 * report.scale), tol * whole - ROUND_OFF * report.scale)
    settled = min(max(ASTRAY, ASTRAY_SHARE * tol**0.5), max(CURVE * tol**0.5, 1e-14)) * size
    return report.error <= target and report.curve <= settled
