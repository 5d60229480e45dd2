"""Forms of curves in space: the energy of a length, or a gauge that keeps the speed constant."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np

from varcalc.formulation.form import (
    Coordinates,
    Ends,
    Form,
    Sampled,
    Start,
    Stated,
    arched,
    conditions_of,
    end_conditions,
    extended,
    rewriter,
    straight,
)
from varcalc.problem.conditions import Isoperimetric
from varcalc.problem.functional import Symbols
from varcalc.problem.problem import Curve
from varcalc.symbolic.derived import Cache, derived
from varcalc.symbolic.evaluation import in_columns
from varcalc.symbolic.tracing import Expression

BASELINE_POINTS = 64
"""Points at which expressions are sampled along a baseline."""
POWER_STEPS = 3
"""Steps in which the radius of a ring is found; one does for a true power."""
NO_POWER = 1e-3
"""Exponents below this are no power."""


def curve_form(problem: Curve) -> Form:
    """A curve in space: its energy when that does, the functional with a gauge otherwise."""
    closed = problem.start.periodic
    plain = not closed and problem.end_cost is None and not any(problem.of_type(Isoperimetric))
    energetic = plain and _positive(problem)
    symbols = problem.symbols if energetic else extended(problem, problem.n, 1)
    rewrite = rewriter(problem, symbols, symbols.x, symbols.y, symbols.slopes, symbols.kind(1))
    functional = problem.sign * (problem.integrand if energetic else rewrite(problem.integrand, True))
    points = _end_points(problem)
    radius = _radius(problem) if closed else 0.0
    baseline = _ring(problem.n, radius) if closed else straight((0.0, 1.0), *points)
    length = 2 * math.pi * radius if closed else float(np.linalg.norm(np.nan_to_num(points[1] - points[0]))) or 1.0
    joint = end_conditions(problem, symbols, lambda _, q: (0.0, q))
    return Form(
        problem,
        Coordinates(
            Stated(
                symbols,
                functional**2 if energetic else functional + _price(problem, baseline, length) * _gauge(symbols),
                functional,
            ),
            note="energy" if energetic else "gauge of constant speed",
            energetic=energetic,
            gauged=not energetic,
        ),
        Ends(
            problem.start.values(problem.n)[None],
            problem.end.values(problem.n)[None],
            joint,
            problem.n if closed else 0,
        ),
        conditions_of(problem, rewrite),
        Start(baseline, np.array([*problem.unknown_guesses, *([] if energetic else [length])]), np.eye(problem.n)),
        cache=_energy_cache(problem) if energetic and joint is None else Cache(),
    )


@derived
def _energy_cache(problem: Curve) -> Cache:
    """What is derived from the energy, which is in the problem's own symbols, wherever its ends are."""
    return Cache()


def _gauge(symbols: Symbols) -> Expression:
    """A term that vanishes for constant speed, the speed being the last unknown.

    F is homogeneous of degree one, so dq . (Euler-Lagrange expression of F) is
    identically zero and this term alone decides the parametrisation: its
    extremals have |dq|^2 = l^2, where it is zero, and F is left as it is.
    """
    square, speed = ca.sumsqr(symbols.dy), symbols.unknowns[-1]
    return (square / speed - speed) ** 2 / (4 * speed)


def _price(problem: Curve, baseline: Sampled, length: float) -> float:
    """What a unit of length costs along the baseline: with it the gauge weighs as much as F in any units.

    Where F vanishes there, as an area does, it is what arches as high as the baseline is long cost at the most.
    """
    arches = [arched(baseline, (0.0, 1.0), length * direction) for direction in np.eye(problem.n)]
    for curves in ([baseline], arches):
        price = max(float(np.abs(_along(problem, [problem.integrand], curve)).mean()) for curve in curves) / length
        if math.isfinite(price) and price > 0.0:
            return price
    return 1.0


def _along(problem: Curve, expressions: list[Expression], curve: Sampled) -> np.ndarray:
    """Values of expressions of the problem at ``BASELINE_POINTS`` points along a curve, shape (expressions, points)."""
    s = (np.arange(BASELINE_POINTS) + 0.5) / BASELINE_POINTS
    step = 0.5 / BASELINE_POINTS
    slope = (curve(s + step) - curve(s - step)) / (2 * step)
    symbols = problem.symbols
    function = ca.Function("along", [symbols.y, symbols.dy, symbols.parameters, symbols.unknowns], expressions)
    numbers = in_columns(BASELINE_POINTS, problem.parameter_values, problem.unknown_guesses)
    results = function(curve(s), slope, *numbers)
    return np.vstack([np.asarray(r) for r in (results if isinstance(results, tuple) else (results,))])


def _radius(problem: Curve) -> float:
    """Radius at which a ring meets the first isoperimetric level, for a condition that is a power of the radius.

    1 where there is no level to go by, or the condition on a ring is no power.
    """
    levels = [
        (t.expression, bound)
        for t in problem.traced
        if isinstance(t.constraint, Isoperimetric)
        for bound in t.constraint.interval
        if math.isfinite(bound) and bound != 0.0
    ]
    radius = 1.0
    for _ in range(POWER_STEPS if levels else 0):
        expression, level = levels[0]
        here, twice = (
            float(_along(problem, [expression], _ring(problem.n, r)).mean()) / level for r in (radius, 2 * radius)
        )
        power = math.log2(twice / here) if here > 0.0 and twice > 0.0 else 0.0
        if not abs(power) > NO_POWER:
            return 1.0
        radius *= here ** (-1.0 / power)
    return radius if math.isfinite(radius) and radius > 0.0 else 1.0


def _positive(problem: Curve) -> bool:
    """True when sign * F > 0 in every direction tried along the line between the ends."""
    start, end = _end_points(problem)
    first, last = np.where(np.isnan(start), end, start), np.where(np.isnan(end), start, end)
    points = np.nan_to_num(np.array([[first, last]]))
    places, directions = positive_along(points, np.nan_to_num(end - start)[None])
    moving = directions[0].any(1)
    values = problem.sign * problem.integrand_values(places[0, moving].T, directions[0, moving].T)
    numbers = values[np.isfinite(values)]
    return bool(len(numbers)) and float(numbers.min()) > 0.0


def positive_along(points: np.ndarray, chord: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places along the lines between ends (K, 2, n) and directions at them, both (K, M, n): the axes, and the chord."""
    count, _, n = points.shape
    axes = np.broadcast_to(np.vstack([np.eye(n), -np.eye(n)]), (count, 2 * n, n))
    directions = np.concatenate([axes, chord[:, None], -chord[:, None]], axis=1)
    along = np.linspace(0.03, 0.97, 5)[:, None]
    places = points[:, :1] * (1 - along) + points[:, 1:] * along
    return np.repeat(places, directions.shape[1], axis=1), np.tile(directions, (1, len(along), 1))


def _end_points(problem: Curve) -> list[np.ndarray]:
    """The ends, guessed where they slide, NaN where they are free."""
    ends = problem.start, problem.end
    return [np.array(e.guess, dtype=float) if e.slides else e.values(problem.n) for e in ends]


def _ring(n: int, radius: float) -> Sampled:
    """A circle in the first two coordinates, counter-clockwise."""

    def circle(s: np.ndarray) -> np.ndarray:
        """The points (n, m) at shares s (m,) of a turn."""
        out = np.zeros((n, len(s)))
        out[0], out[1 % n] = radius * np.cos(2 * math.pi * s), radius * np.sin(2 * math.pi * s)
        return out

    return circle
