"""What the Lagrangian does at the ends: where it is infinite, how fast, and whether it is the length of a metric."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import casadi as ca
import numpy as np

from varcalc.problem.functional import Functional
from varcalc.problem.problem import FEW_FUNCTIONS, Curve, Problem
from varcalc.symbolic.derived import derived
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.tracing import Expression

PROBE = (1e-7, 1e-9)
"""Distances from a singular end, relative to the size of the problem, between which powers are measured."""
PROBED_SLOPES = np.array([0.0, 0.7, -1.3, 2.9, -5.1])
POWERS = PROBED_SLOPES[:, None] ** np.arange(3)
FIT = np.linalg.pinv(POWERS)
RING = np.array([[math.cos(a), math.sin(a)] for a in np.linspace(0.1, 0.1 + 2 * math.pi, 16, endpoint=False)]).T
ASLANT = np.array([0.7, -1.3])
"""Slopes of two directions, neither along an axis, over which a metric is summed."""
ACROSS = np.linspace(-1.6, 1.6, 64)
"""Ordinates, in units of the problem's size about its middle, at which the sign of L is looked at."""


def _survey() -> np.ndarray:
    """Where and with what slopes a Lagrangian is sampled: shares of the chord, offsets from it, slopes.

    The last entries cross the problem in the middle, at slope zero.
    """
    places = [(share, offset) for share in (0.13, 0.37, 0.61, 0.89) for offset in (0.0, 0.21, -0.21, 1.1, -1.1)]
    fans = [(*place, slope) for place in places for slope in PROBED_SLOPES]
    return np.array([*fans, *((0.5, offset, 0.0) for offset in ACROSS)]).T


SURVEY = _survey()
QUADRATIC = 1e-9
"""Relative departure from a quadratic form below which L^2 is taken to be one."""
LARGEST_DENOMINATOR = 6
A_FRACTION = 2e-3
"""Distance from a fraction of small denominator within which a measured power is that fraction."""
STEP_ASIDE, SHARE_LEFT = 0.05, 0.5
"""A step from an end, in units of the problem's size, that leaves less than this share of L: a singularity is near."""
LOOKS = 10
"""Times L is looked at next to an end: at it with five slopes, and about it with one."""
AROUND = (
    np.tile(np.vstack([np.zeros((5, 2)), STEP_ASIDE * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])]), (2, 1)),
    np.concatenate([np.tile(np.concatenate([PROBED_SLOPES, np.full(5, PROBED_SLOPES[1])]), 2), SURVEY[2]])[None],
)
"""Offsets from the two ends in units of the problem's size, and the slopes there and across the problem."""
GROWN = 1.2
"""Growth between the distances of PROBE beyond which L is taken to be infinite at an end: its 25th root."""
STRAIGHT = 2e-3
"""Relative departure, near an end, from what a power of the distance from a line would do."""


class Infinite(Exception):
    """The functional is infinite for every curve from a singular end."""


@dataclass(frozen=True)
class LengthElement:
    """The square of a length element as a function of symbols: ``square(q, dq, unknowns)``, scalar.

    ``conformal`` tells that it was written as a factor of the Euclidean one.
    """

    square: Callable[[Expression, Expression, Expression], Expression]
    conformal: bool = False


@dataclass(frozen=True)
class Blowup:
    """How the metric behaves at an end: as distance^-power from a line with unit ``normal`` into the domain.

    ``origin`` is the point of the line next to the end: the end itself, unless the line lies beyond it.
    """

    origin: np.ndarray
    normal: np.ndarray
    power: float


def end_points(problem: Functional) -> list[np.ndarray]:
    """The two ends as points (x, y_1, ..., y_n), of a Curve (q_1, ..., q_n), NaN where a coordinate is free."""
    ends = (problem.start, problem.end)
    points = [e.values(problem.n) for e in ends]
    if isinstance(problem, Problem):
        known = (math.nan if e.slides else x for e, x in zip(ends, problem.span, strict=True))
        points = [np.concatenate([[x], y]) for x, y in zip(known, points, strict=True)]
    return points


def _values(problem: Functional, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
    """L dx (or F) at points q (2, m) with velocities dq (2, m)."""
    if isinstance(problem, Problem):
        return problem.integrand_values(q[0], q[1:], dq[1:] / dq[0]) * dq[0]
    assert isinstance(problem, Curve)
    return problem.integrand_values(q, dq)


def singular_ends(problem: Functional) -> tuple[bool, bool]:
    """Whether the integrand is infinite or no number at each end, along the chord or any slope tried."""
    points = end_points(problem)
    count = len(PROBED_SLOPES)
    directions = np.tile(np.vstack([np.ones(count), *[PROBED_SLOPES] * (len(points[0]) - 1)]), 2)
    finite = np.isfinite(_values(problem, np.repeat(np.array(points).T, count, axis=1), directions))
    start, end = (
        not (np.isnan(point).any() or part.all())
        for point, part in zip(points, (finite[:count], finite[count:]), strict=True)
    )
    return start, end


def grows(problem: Functional, at_start: bool) -> bool:
    """Whether L becomes ever larger toward an end, rather than being no number for some slopes there."""
    point, size = end_points(problem)[0 if at_start else 1], extent(problem)
    around = _directions(len(point))
    far, near = (
        np.abs(_values(problem, point[:, None] + size * distance * around, np.ones(around.shape))) for distance in PROBE
    )
    usable = np.isfinite(far) & np.isfinite(near) & (far > 0)
    return bool(usable.any() and np.median(near[usable] / far[usable]) > GROWN)


def almost_singular_ends(problem: Functional) -> tuple[bool, bool]:
    """Whether L is finite at each end but falls so steeply from it that it may be infinite just beyond."""
    points, step = end_points(problem), STEP_ASIDE * extent(problem)
    offsets = step * np.array([[0.0, 1.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0, -1.0]])
    count = offsets.shape[1]
    around = np.hstack([point[:, None] + offsets for point in points])
    directions = np.repeat([[1.0], [PROBED_SLOPES[1]]], 2 * count, axis=1)
    values = np.abs(_values(problem, around, directions)).reshape(2, count)
    start, end = (
        bool(np.isfinite(row[0]) and np.nanmin(row, initial=math.inf) < SHARE_LEFT * row[0]) for row in values
    )
    return start, end


def extent(problem: Functional) -> float:
    """The larger extension of the problem along an axis, as far as its ends tell."""
    start, end = end_points(problem)
    known = np.abs(end - start)
    known = known[np.isfinite(known)]
    width = problem.span[1] - problem.span[0]
    return float(known.max(initial=0.0)) or width


class Survey:
    """What L does at the ends of a graph of one function and between them, all looked at in one go.

    ``singular`` and ``beyond`` are what :func:`singular_ends` and :func:`almost_singular_ends` tell.
    """

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        points, size = np.array(end_points(problem)), extent(problem)
        start, end = completed_ends(problem)
        around = points.repeat(LOOKS, axis=0) + size * AROUND[0]
        across = start + SURVEY[0][:, None] * (end - start)
        across[:, 1] += size * SURVEY[1]
        places = np.concatenate([around, across])
        values = problem.integrand_values(places[:, 0], places[:, 1:].T, AROUND[1])
        ends = values[: 2 * LOOKS].reshape(2, -1)
        known = ~np.isnan(points).any(1)
        at, aside = ends[:, : len(PROBED_SLOPES)], np.abs(ends[:, len(PROBED_SLOPES) :])
        infinite = np.logical_and(known, np.logical_not(np.all(np.isfinite(at), axis=1))).tolist()
        self.singular: tuple[bool, bool] = (infinite[0], infinite[1])
        least = np.fmin.reduce(aside, axis=1)
        steep = np.isfinite(aside[:, 0]) & (least < SHARE_LEFT * aside[:, 0])
        self.beyond = bool(steep[0]), bool(steep[1])
        self._across, self._places = values[2 * LOOKS :], across

    @property
    def metric(self) -> LengthElement | None:
        """The quadratic form L^2 dx^2, or None when L^2 is not quadratic in the slope or L changes its sign.

        Where a maximum is asked for, it is -L that must be positive.
        """
        return None if self._fit is None else _metric(self.problem, _is_conformal(self._fit))

    @property
    def unit(self) -> float | None:
        """The slope at which a metric weighs both coordinates alike: one unit of y for one of x; None where none is."""
        if self._fit is None:
            return None
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = float(np.median(self._fit[0] / self._fit[2]))
        return math.sqrt(ratio) if math.isfinite(ratio) and ratio > 0 else None

    @cached_property
    def _fit(self) -> np.ndarray | None:
        sign = -1.0 if self.problem.maximise else 1.0
        fit, known = _fitted(sign * self._across)
        return fit if fit is not None and self._weighs_alike(fit, self._places[: -len(ACROSS)][known]) else None

    def _weighs_alike(self, fit: np.ndarray, places: np.ndarray) -> bool:
        """Whether L² is quadratic at ``places`` (m, 2) about the slopes that make half of it, by a ``fit`` (3, m), too.

        Where ordinates have other units than abscissae the slopes that were tried may make next to nothing of L.
        """
        with np.errstate(all="ignore"):
            slopes = PROBED_SLOPES[:, None] * np.sqrt(np.abs(fit[0] / fit[2]))
            at = np.tile(places.T, len(slopes))
            squares = self.problem.integrand_values(at[0], at[1:], slopes.reshape(1, -1)).reshape(slopes.shape) ** 2
        return _quadratic(squares[:, np.isfinite(squares).all(0)])


def _quadratic(squares: np.ndarray) -> bool:
    """Whether values (., m) at the slopes that are tried are those of quadratic forms."""
    return bool(np.all(np.abs(POWERS @ (FIT @ squares) - squares).max(0) <= QUADRATIC * squares.max(0)))


def _fitted(values: np.ndarray) -> tuple[np.ndarray | None, np.ndarray]:
    """The metrics a + b v + c v^2 (3, m) whose length L has these ``values`` at SURVEY, and where those that count are.

    None where there are none.
    """
    sampled = values[: -len(ACROSS)].reshape(-1, len(PROBED_SLOPES))
    with np.errstate(over="ignore"):
        squares = sampled**2
    kept = np.flatnonzero(np.isfinite(squares).all(1) & (sampled > 0).all(1))
    squares, known = squares[kept], len(PROBED_SLOPES) * kept
    if len(squares) < 2 or _passes_zero(values[-len(ACROSS) :]):
        return None, known
    return FIT @ squares.T if _quadratic(squares.T) else None, known


def _metric(problem: Problem, conformal: bool) -> LengthElement:
    """The coefficients of L^2 in powers of the slope, by differentiation at slope zero."""
    s = problem.symbols

    def square(q: Expression, dq: Expression, unknowns: Expression) -> Expression:
        """L² at the point ``q``, a quadratic form of ``dq``."""
        old, new = [s.x, s.y, s.dy, s.unknowns], [q[0], q[1], s.kind(0), unknowns]
        if conformal:
            return ca.substitute([problem.integrand], old, new)[0] ** 2 * ca.sumsqr(dq)
        whole = problem.integrand**2
        slope = ca.gradient(whole, s.dy)
        a, b, c = ca.substitute([whole, slope, ca.gradient(slope, s.dy)], old, new)
        return a * dq[0] ** 2 + b * dq[0] * dq[1] + 0.5 * c * dq[1] ** 2

    return LengthElement(square, conformal)


def homogeneous(problem: Functional) -> LengthElement:
    """The square of a Curve's integrand, which is taken to be the length element of a metric."""
    s = problem.symbols

    def square(q: Expression, dq: Expression, unknowns: Expression) -> Expression:
        return ca.substitute([problem.integrand**2], [s.y, s.dy, s.unknowns], [q, dq, unknowns])[0]

    return LengthElement(square)


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


def completed_ends(problem: Problem) -> list[np.ndarray]:
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


def blowup(problem: Functional, at_start: bool) -> Blowup | None:
    """The power and direction in which a metric blows up at an end; None when no line explains it.

    Raises Infinite when the power leaves no curve of finite length.
    """
    line = line_through(problem, at_start)
    return None if line is None else finite_cost(line, at_start)


def finite_cost(line: Blowup, at_start: bool) -> Blowup:
    """The line, when a length that grows so has a finite integral; raises Infinite otherwise."""
    if line.power >= 1:
        raise Infinite(
            f"the Lagrangian grows like distance^-{line.power:.4g} at the {'start' if at_start else 'end'}, "
            "so the functional is infinite for every curve that ends there"
        )
    return line


def line_through(problem: Functional, at_start: bool) -> Blowup | None:
    """The line (or surface) through an end from which L falls like a power; None when no line explains it."""
    point, size = end_points(problem)[0 if at_start else 1], extent(problem)

    def probe(offsets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return _trace(problem, point[:, None] + size * offsets)

    values, slopes = probe(PROBE[0] * _directions(len(point)))
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
    return Blowup(point, normal, power) if power > 0 else None


def _directions(dimension: int) -> np.ndarray:
    """Unit vectors, one a column: a ring in the plane, scattered in more dimensions."""
    if dimension == 2:
        return RING
    scattered = np.random.default_rng(0).standard_normal((dimension, 16 * dimension))
    return scattered / np.linalg.norm(scattered, axis=0)


def blowup_beyond(problem: Functional, at_start: bool) -> Blowup | None:
    """The line just beyond an end on which the metric is infinite; None when there is none of finite cost.

    For a metric factor (d + d0)^-2s the inverse of its logarithmic derivative along the normal is (d + d0) / 2s,
    linear in the distance d from the end: its slope tells s and its value d0.
    """
    point = end_points(problem)[0 if at_start else 1]
    here = _trace(problem, point[:, None])[1][:, 0]
    steepness = float(np.linalg.norm(here))
    if not (math.isfinite(steepness) and steepness > 0):
        return None
    normal, unit = -here / steepness, 1.0 / steepness
    normal = np.where(np.abs(normal) < 1e-6, 0.0, normal)
    normal /= np.linalg.norm(normal)
    tangent = np.array([normal[1], -normal[0]])
    offsets = np.array([normal, 4 * normal, tangent, -tangent]).T
    slopes = _trace(problem, point[:, None] + unit * offsets)[1]
    falls = -(normal @ slopes) * unit
    if not np.isfinite(slopes).all() or not np.all(falls[:2] > 0):
        return None
    # the inverse steepness, 1 at the end, in units of ``unit``: linear along the normal and constant across it
    near, far = 1 / falls[0], 1 / falls[1]
    power = rational(2 / (far - 1)) if far > 1 else math.inf
    bent = abs(near - 1 - (far - 1) / 4) > STRAIGHT * near
    turned = np.abs(slopes[:, 2:] * unit + normal[:, None]).max() > STRAIGHT
    if bent or turned or not power < 1:
        return None
    return Blowup(point - 2 * power * unit * normal, normal, power)


def _trace(problem: Functional, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """:func:`traced_metric` at the problem's own parameter values."""
    return traced_metric(problem, points, problem.parameter_values[None])


def traced_metric(problem: Functional, points: np.ndarray, parameters: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The metric summed over two directions at points (2, m), and the gradient (2, m) of its logarithm.

    ``parameters`` has one row for each point, or one for all.
    """
    count, n = points.shape[1], problem.n
    numbers = parameters if len(parameters) == 1 else np.tile(parameters, (2, 1))
    if isinstance(problem, Problem) and n <= FEW_FUNCTIONS:
        twice, slopes = np.hstack([points, points]), np.repeat(ASLANT, count)
        found = problem.integrand_derivatives(twice[0], twice[1:], np.tile(slopes, (n, 1)), numbers)
        rows = found.rows[:, : 2 + n].reshape(2, count, -1)
    else:
        rows = _first_derivatives(problem, points, numbers).reshape(2, count, -1)
    values = (rows[:, :, 0] ** 2).sum(0)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return values, 2 * np.einsum("dm,dmk->km", rows[:, :, 0], rows[:, :, 1:]) / values


def _first_derivatives(problem: Functional, points: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """The integrand and its gradient in the place, at points (d, m) in two directions; (2 m, 1 + d)."""
    count = points.shape[1]
    if isinstance(problem, Problem):
        slopes = np.tile(np.repeat(ASLANT, count)[:, None], (1, problem.n))
        place = [np.tile(points[:1].T, (2, 1)), np.tile(points[1:].T, (2, 1)), slopes]
    else:
        directions = np.vstack([np.ones(2), ASLANT]).T
        place = [np.zeros((1, 1)), np.tile(points.T, (2, 1)), np.repeat(directions, count, axis=0)]
    return _with_gradient(problem)(2 * count, *place, np.zeros((1, 0)), numbers, problem.unknown_guesses[None])


@derived
def _with_gradient(problem: Functional) -> PointEvaluator:
    s = problem.symbols
    position = ca.vertcat(s.x, s.y) if isinstance(problem, Problem) else s.y
    rows = ca.vertcat(problem.integrand, ca.gradient(problem.integrand, position))
    return PointEvaluator(ca.Function("metric", s.all, [ca.densify(rows)]))


def rational(value: float) -> float:
    """The nearest fraction of small denominator when the value is one to measuring accuracy."""
    if not math.isfinite(value):
        return value
    fraction = Fraction(value).limit_denominator(LARGEST_DENOMINATOR)
    return float(fraction) if abs(float(fraction) - value) < A_FRACTION else value
