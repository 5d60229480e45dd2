"""What multiple shooting starts from: the starting curve's derivatives, and multipliers that fit it.

The Lagrangian function is linear in its multipliers, so the isoperimetric
ones are first taken by least squares from the Euler-Lagrange expression on
the starting curve, and those of the end equations from the natural conditions.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.polynomial import legendre

from varcalc.formulation import Form, Sampled
from varcalc.formulation.height import height
from varcalc.methods.shooting.flow import EulerLagrangeFlow, Scales
from varcalc.numerics.mesh import gauss
from varcalc.symbolic.evaluation import in_columns

SEGMENT_POINTS = 9
"""Points of a segment at which the starting curve is sampled."""
NO_SPREAD = 1e-13
"""Of the size of ordinates: a difference between them that is round-off."""
STATES_DEGREE = 5
"""Degree of the polynomial through them."""
DERIVATIVE = np.pad(np.array([legendre.legder(row) for row in np.eye(STATES_DEGREE + 1)]), ((0, 0), (0, 1)))
"""From Legendre coefficients (.., STATES_DEGREE + 1) to those of the derivative."""
FITTED = (
    gauss(SEGMENT_POINTS)[1][:, None]
    * legendre.legvander(gauss(SEGMENT_POINTS)[0], STATES_DEGREE)
    * (np.arange(STATES_DEGREE + 1) + 0.5)
)
"""From values at the samples to Legendre coefficients, which are orthogonal under the Gauss rule: least squares."""


def scales(equations: EulerLagrangeFlow, curve: Sampled) -> Scales:
    """Units for the ordinates, from the curve, and for the integrals, from the integrands along it."""
    form = equations.form
    width = form.span[1] - form.span[0]
    s = np.linspace(*form.span, 17)
    values = curve(s)
    spread, farthest = np.ptp(values, axis=1), np.abs(values).max(axis=1)
    ordinates = np.where(spread > NO_SPREAD * farthest, spread, farthest)
    largest = float(ordinates.max()) or height(form)
    ordinates = np.where(ordinates > 1e-3 * largest, ordinates, largest)
    middle, slopes = s[1:-1], np.gradient(values, s, axis=1)[:, 1:-1]
    densities = np.abs(equations.densities_roughly(middle, values[:, 1:-1], slopes)) * width
    densities = np.where(np.isfinite(densities), densities, 0.0).max(axis=1)
    return Scales(ordinates, np.where(densities > 0, densities, densities.max() or 1.0))


def derivatives(curve: Sampled, left: np.ndarray, right: np.ndarray, at: np.ndarray, count: int) -> list[np.ndarray]:
    """A curve and its derivatives up to ``count`` at ``at`` (m,), each (n, m), by fits in [left, right] (m,)."""
    middle, half = 0.5 * (left + right), 0.5 * (right - left)
    nodes = gauss(SEGMENT_POINTS)[0]
    values = curve((middle[:, None] + half[:, None] * nodes).ravel()).reshape(-1, len(at), SEGMENT_POINTS)
    coefficients = values @ FITTED
    values_at = legendre.legvander((at - middle) / half, STATES_DEGREE)
    out = []
    for k in range(count + 1):
        out.append(np.einsum("nmd,md->nm", coefficients, values_at) / half**k)
        coefficients = coefficients @ DERIVATIVE
    return out


def states(
    equations: EulerLagrangeFlow, units: Scales, curve: Sampled, pieces: np.ndarray, at: np.ndarray
) -> np.ndarray:
    """The scaled states (N, D) on a curve at ``at`` (N,), by fits in the ``pieces`` (N, 2) around; both in t."""
    a, width = equations.form.span[0], equations.form.span[1] - equations.form.span[0]
    left, right = (a + width * pieces).T
    tower = derivatives(curve, left, right, a + width * at, 2 * equations.form.order - 1)
    return np.concatenate([d * width**k / units.ordinates[:, None] for k, d in enumerate(tower)]).T


def whole(equations: EulerLagrangeFlow, curve: Sampled, s: np.ndarray, count: int) -> list[np.ndarray]:
    """The curve and its derivatives up to ``count`` at s (m,) by one fit over the whole interval."""
    left, right = (np.full(len(s), end) for end in equations.form.span)
    return derivatives(curve, left, right, s, count)


def unknown_numbers(form: Form, curve: Sampled) -> np.ndarray:
    """The first values of the unknown numbers: the form's guesses, the constant speed being the curve's length."""
    guess = form.start.unknowns.copy()
    if form.coordinates.gauged:
        steps = np.diff(curve(np.linspace(*form.span, 129)), axis=1)
        guess[-1] = float(np.linalg.norm(steps, axis=0).sum()) or guess[-1]
    return guess


def lambdas(equations: EulerLagrangeFlow, curve: Sampled) -> np.ndarray:
    """The isoperimetric multipliers that fit the Euler-Lagrange equation best along a curve, by least squares."""
    form = equations.form
    count = len(form.conditions.integrals)
    if count == 0:
        return np.zeros(0)
    s = np.linspace(*form.span, 19)[1:-1]
    tower = whole(equations, curve, s, 2 * form.order)
    fixed = in_columns(len(s), form.problem.parameter_values, unknown_numbers(form, curve))

    def residual(multipliers: np.ndarray) -> np.ndarray:
        column = np.repeat(multipliers[:, None], len(s), axis=1)
        return np.asarray(equations.residual(s[None, :], *tower, *fixed, column)).ravel()

    base = residual(np.zeros(count))
    matrix = np.column_stack([residual(e) - base for e in np.eye(count)])
    sound = np.isfinite(base) & np.isfinite(matrix).all(axis=1)
    if not sound.any():
        return np.zeros(count)
    return np.linalg.lstsq(matrix[sound], -base[sound], rcond=1e-10)[0]


def nus(
    equations: EulerLagrangeFlow, units: Scales, ends: np.ndarray, unknowns: np.ndarray, lam: np.ndarray
) -> np.ndarray:
    """The multipliers of the end equations that fit the natural conditions best; ``ends`` are scaled states (2, D)."""
    count = equations.end_equations
    if count == 0:
        return np.zeros(0)
    known = [units.all, equations.form.problem.parameter_values]
    totals = np.zeros(equations.integrals)
    out = equations.conditions(*known, *ends, totals, unknowns, lam, np.zeros(count))
    residual, by_nus = np.asarray(out[0]).ravel(), np.asarray(out[1])[:, -count:]
    rows = np.any(by_nus != 0, axis=1) & np.isfinite(residual)
    if not rows.any() or not np.all(np.isfinite(by_nus[rows])):
        return np.zeros(count)
    # the rows of the unknown numbers hold totals that are not known yet; they count like the others all the same
    return np.linalg.lstsq(by_nus[rows], -residual[rows], rcond=1e-10)[0]


def growth_rate(
    equations: EulerLagrangeFlow, units: Scales, curve: Sampled, lam: np.ndarray, t: np.ndarray
) -> np.ndarray:
    """The fastest growth rate of errors, per unit of t, at t (m,) along a curve; 0 where it is not a number."""
    form = equations.form
    a, width = form.span[0], form.span[1] - form.span[0]
    tower = whole(equations, curve, a + width * t, 2 * form.order - 1)
    D, total = equations.dimension, equations.dimension + equations.integrals
    line = equations.line(0.0, 1.0, (False, False))
    numbers = np.concatenate([line, units.all, form.problem.parameter_values, unknown_numbers(form, curve), lam])
    state = np.zeros((len(t), total))
    state[:, :D] = np.concatenate([d * width**k / units.ordinates[:, None] for k, d in enumerate(tower)]).T
    augmented, columns = equations.system.start(state).T, np.repeat(numbers[:, None], len(t), axis=1)
    rates = np.asarray(equations.system.system(t[None, :], augmented, columns)).T
    matrices = equations.system.split(rates)[1][:, :D, :D]  # the variational equations at unit sensitivities
    sound = np.isfinite(matrices).all(axis=(1, 2))
    out = np.zeros(len(t))
    out[sound] = np.maximum(np.linalg.eigvals(matrices[sound]).real.max(axis=1), 0.0)
    return out


def partition(
    rate: np.ndarray, t: np.ndarray, marks: np.ndarray, per_segment: float, least: int, most: int
) -> np.ndarray:
    """Vertices in [0, 1] that contain ``marks`` and share the growth, at most ``per_segment`` each, evenly.

    ``rate`` is the growth rate at ``t``, both (m,). Some of the division is
    uniform, so that no segment is long only because the rate is small there.
    """
    total = float(np.sum(0.5 * (rate[1:] + rate[:-1]) * np.diff(t)))
    count = int(min(max(least, math.ceil(total / per_segment)), most))
    density = rate + max(total, 1.0)
    cumulative = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(t))])
    inner = np.interp(np.linspace(0, 1, count + 1)[1:-1] * cumulative[-1], cumulative, t)
    vertices = [0.0, 1.0, *marks]
    spacing = 0.2 / count
    vertices += [v for v in inner if np.abs(np.array(vertices) - v).min() > spacing * 0.25]
    return np.unique(vertices)
