"""What the Lagrangian does at the ends: where it is infinite, how fast, and whether it is the length of a metric."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import casadi as ca
import numpy as np

from varcalc.conditions import Fixed, Free
from varcalc.formulation import formulate
from varcalc.functional import Functional
from varcalc.problem import Problem
from varcalc.tracing import Expression

PROBE = (1e-7, 1e-9)
"""Distances from a singular end, relative to the size of the problem, between which powers are measured."""
SLOPES = np.array([0.0, 0.7, -1.3, 2.9, -5.1])
POWERS = SLOPES[:, None] ** np.arange(3)
FIT = np.linalg.pinv(POWERS)
ACROSS = np.linspace(-1.6, 1.6, 64)
"""Ordinates, in units of the problem's size about its middle, at which the sign of L is looked at."""
QUADRATIC = 1e-9
"""Relative departure from a quadratic form below which L^2 is taken to be one."""
LARGEST_DENOMINATOR = 6


class Infinite(Exception):
    """The functional is infinite for every curve from a singular end."""


@dataclass(frozen=True)
class Metric:
    """L^2 dx^2 as a quadratic form: ``square`` in the symbols q = (x, y) and dq."""

    q: Expression
    dq: Expression
    square: Expression


@dataclass(frozen=True)
class Blowup:
    """How the metric behaves at an end: as distance^-power from a line with unit ``normal`` into the domain."""

    at_start: bool
    point: np.ndarray
    normal: np.ndarray
    power: float


def end_points(problem: Functional) -> list[np.ndarray]:
    """The two ends as points of the plane (x, y), NaN where a coordinate is free."""
    if isinstance(problem, Problem):
        return [_end_point(e) for e in (problem.start, problem.end)]
    form = formulate(problem)
    return [form.fixed_start[0], form.fixed_end[0]]


def _end_point(end: Any) -> np.ndarray:
    if isinstance(end, Fixed):
        return np.array([float(end.x), float(np.ravel(end.y)[0])])
    return np.array([float(end.x) if isinstance(end, Free) else np.nan, np.nan])


def _values(problem: Functional, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
    """L dx (or F) at points q (2, m) with velocities dq (2, m)."""
    if isinstance(problem, Problem):
        return problem.integrand_values(q[0], q[1:], dq[1:] / dq[0]) * dq[0]
    s = problem.symbols
    if "F" not in problem.built:
        problem.built["F"] = ca.Function("F", [s.y, s.dy, s.parameters, s.unknowns], [problem.integrand])
    count = q.shape[1]
    numbers = [np.repeat(v[:, None], count, axis=1) for v in (problem.parameter_values, problem.unknown_guesses)]
    return np.asarray(problem.built["F"](q, dq, *numbers)).ravel()


def singular_ends(problem: Functional) -> tuple[bool, bool]:
    """Whether the integrand is infinite or no number at each end, along the chord or any slope tried."""
    points = end_points(problem)
    count = len(SLOPES)
    directions = np.tile(np.vstack([np.ones(count), SLOPES]), 2)
    finite = np.isfinite(_values(problem, np.repeat(np.array(points).T, count, axis=1), directions))
    start, end = (
        not (np.isnan(point).any() or part.all())
        for point, part in zip(points, (finite[:count], finite[count:]), strict=True)
    )
    return start, end


def extent(problem: Functional) -> float:
    """The larger extension of the problem along an axis, as far as its ends tell."""
    start, end = end_points(problem)
    known = np.abs(end - start)
    known = known[np.isfinite(known)]
    width = problem.span[1] - problem.span[0]
    return float(known.max(initial=0.0)) or width


def riemannian(problem: Problem) -> Metric | None:
    """The quadratic form L^2 dx^2, or None when L^2 is not quadratic in the slope or L changes its sign."""
    start, end = _completed(problem)
    middle, size = 0.5 * (start + end), extent(problem)
    along = np.array([0.13, 0.37, 0.61, 0.89])
    offsets = size * np.array([0.0, 0.21, -0.21, 1.1, -1.1])
    x = np.repeat(start[0] + along * (end[0] - start[0]), len(offsets))
    y = (start[1] + along[:, None] * (end[1] - start[1]) + offsets).ravel()
    count, slopes = len(x), len(SLOPES)
    across = middle[1] + size * ACROSS
    values = problem.integrand_values(
        np.concatenate([np.repeat(x, slopes), np.full(len(across), middle[0])]),
        np.concatenate([np.repeat(y, slopes), across])[None],
        np.concatenate([np.tile(SLOPES, count), np.zeros(len(across))])[None],
    )
    sampled = values[: count * slopes].reshape(count, slopes)
    squares = sampled[np.isfinite(sampled).all(1) & (sampled > 0).all(1)] ** 2
    if len(squares) < 2 or _passes_zero(values[count * slopes :]):
        return None
    fit = FIT @ squares.T
    if np.any(np.abs(POWERS @ fit - squares.T).max(0) > QUADRATIC * squares.max(1)):
        return None
    return _metric(problem, _is_conformal(fit))


def _metric(problem: Problem, conformal: bool) -> Metric:
    """The coefficients of L^2 in powers of the slope, by differentiation at slope zero."""
    s = problem.symbols
    kind = s.kind
    q, dq = kind.sym("q", 2), kind.sym("dq", 2)
    square = problem.integrand**2
    old, new = [s.x, s.y, s.dy], [q[0], q[1], kind(0)]
    if conformal:
        return Metric(q, dq, ca.substitute([square], old, new)[0] * ca.sumsqr(dq))
    slope = ca.gradient(square, s.dy)
    a, b, c = ca.substitute([square, slope, ca.gradient(slope, s.dy)], old, new)
    return Metric(q, dq, a * dq[0] ** 2 + b * dq[0] * dq[1] + 0.5 * c * dq[1] ** 2)


def _passes_zero(values: np.ndarray) -> bool:
    """Whether L passes through zero across the problem: then its square is another functional, not its own.

    A change of sign through infinity is a barrier that no curve of finite
    value crosses, and does no harm.
    """
    values = values[np.isfinite(values)]
    change = np.flatnonzero(np.diff(np.sign(values)) != 0)
    if not len(change):
        return bool((values <= 0).any())
    near = np.abs(values[change[0] : change[0] + 2]).max()
    return bool(near < np.median(np.abs(values)))


def _completed(problem: Problem) -> list[np.ndarray]:
    """The ends, with what is free at one taken from the other."""
    start, end = _spanned(problem)
    return [np.where(np.isnan(start), end, start), np.where(np.isnan(end), start, end)]


def _spanned(problem: Problem) -> list[np.ndarray]:
    """The ends with the abscissae of the problem's span, also where they slide."""
    points = end_points(problem)
    for point, x in zip(points, problem.span, strict=True):
        point[0] = x
    return points


def _is_conformal(fit: np.ndarray) -> bool:
    """Whether the fitted quadratic forms a + b v + c v^2 are multiples of 1 + v^2."""
    return bool(np.all(np.abs(fit[1]) + np.abs(fit[2] - fit[0]) <= QUADRATIC * np.abs(fit[0])))


def blowup(problem: Functional, metric: Metric, at_start: bool) -> Blowup | None:
    """The power and direction in which the metric blows up at an end; None when no line explains it."""
    s = problem.symbols
    axes = (ca.DM([1, 0]), ca.DM([0, 1]))
    trace = sum(ca.substitute([metric.square], [metric.dq], [s.kind(direction)])[0] for direction in axes)
    function = ca.Function("trace", [metric.q, s.parameters, s.unknowns], [trace, ca.gradient(ca.log(trace), metric.q)])
    point, size = end_points(problem)[0 if at_start else 1], extent(problem)

    def probe(offsets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        count = offsets.shape[1]
        numbers = [np.repeat(v[:, None], count, axis=1) for v in (problem.parameter_values, problem.unknown_guesses)]
        values, slopes = function(point[:, None] + size * offsets, *numbers)
        return np.asarray(values).ravel(), np.asarray(slopes)

    angles = np.linspace(0.0, 2 * math.pi, 16, endpoint=False) + 0.1
    values, slopes = probe(PROBE[0] * np.vstack([np.cos(angles), np.sin(angles)]))
    length = np.linalg.norm(slopes, axis=0)
    usable = np.isfinite(values) & (values > 0) & np.isfinite(length) & (length > 0)
    if not usable.any():
        return None
    normals = -(slopes / np.where(usable, length, 1.0))[:, usable]
    normal = normals[:, 0]
    if np.any(np.abs(normal @ normals) < 1 - 1e-4):
        return None  # singular at a point, not along a line
    normal = np.where(np.abs(normal) < 1e-6, 0.0, normal)
    normal /= np.linalg.norm(normal)
    far, near = (float(v) for v in probe(normal[:, None] * np.array(PROBE))[0])
    if not (far > 0 and near > 0 and math.isfinite(far) and math.isfinite(near)):
        return None
    power = rational(0.5 * math.log(near / far) / math.log(PROBE[0] / PROBE[1]))
    if power >= 1:
        raise Infinite(
            f"the Lagrangian grows like distance^-{power:.4g} at the {'start' if at_start else 'end'}, "
            "so the functional is infinite for every curve that ends there"
        )
    return Blowup(at_start, point, normal, power) if power > 0 else None


def rational(value: float, denominator: int = LARGEST_DENOMINATOR) -> float:
    """The nearest fraction of small denominator when the value is one to measuring accuracy."""
    if not math.isfinite(value):
        return value
    fraction = Fraction(value).limit_denominator(denominator)
    return float(fraction) if abs(float(fraction) - value) < 2e-3 else value
