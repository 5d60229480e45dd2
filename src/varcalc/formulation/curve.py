"""Forms of curves in space: the energy of a length, or a gauge that keeps the speed constant."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import permutations

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
NO_CHANGE = 1e-12
"""Relative change of a functional that is round-off."""
ALIKE_RINGS = 1e-9
"""Relative difference of the functional on two rings that are alike."""


def curve_form(problem: Curve) -> Form:
    """A curve in space: its energy when that does, the functional with a gauge otherwise."""
    closed = problem.start.periodic
    plain = not closed and problem.end_cost is None and not any(problem.of_type(Isoperimetric))
    energetic = plain and _positive(problem)
    symbols = problem.symbols if energetic else extended(problem, problem.n, 1)
    rewrite = rewriter(problem, symbols, symbols.x, symbols.y, symbols.slopes, symbols.kind(1))
    functional = problem.sign * (problem.integrand if energetic else rewrite(problem.integrand, True))
    points = _end_points(problem)
    baseline = _best_ring(problem) if closed else straight((0.0, 1.0), *points)
    chord = points[1] - points[0]
    length = baseline.length if isinstance(baseline, Ring) else float(np.linalg.norm(np.nan_to_num(chord))) or 1.0
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
    """What a unit of length costs: with it the gauge weighs as much as F in any units.

    It is by how much arches as high as the baseline is long change the functional, at the most. What is added to F
    without changing its extremals, the derivative of a function of place, does not change that; where no arch is in
    the domain of F, what the baseline costs stands in.
    """
    heights = [side * length * way for way in np.eye(problem.n) for side in (1.0, -1.0)]
    curves = [baseline, *(arched(baseline, (0.0, 1.0), height) for height in heights)]
    here, *others = _means(problem, problem.integrand, curves).tolist()
    changes = [abs(other - here) for other in others]
    known = [change for change in changes if math.isfinite(change) and change > NO_CHANGE * abs(here)]
    price = max(known, default=abs(here)) / length
    return price if math.isfinite(price) and price > 0.0 else 1.0


def _means(problem: Curve, expression: Expression, curves: Sequence[Sampled]) -> np.ndarray:
    """The mean of an expression of the problem at ``BASELINE_POINTS`` points along each of ``curves``."""
    s = (np.arange(BASELINE_POINTS) + 0.5) / BASELINE_POINTS
    step, symbols = 0.5 / BASELINE_POINTS, problem.symbols
    slopes = [(curve(s + step) - curve(s - step)) / (2 * step) for curve in curves]
    function = ca.Function("along", [symbols.y, symbols.dy, symbols.parameters, symbols.unknowns], [expression])
    numbers = in_columns(len(curves) * BASELINE_POINTS, problem.parameter_values, problem.unknown_guesses)
    values = np.asarray(function(np.hstack([curve(s) for curve in curves]), np.hstack(slopes), *numbers))
    with np.errstate(invalid="ignore"):  # of infinities of both signs
        return values.reshape(len(curves), BASELINE_POINTS).mean(1)


@dataclass(frozen=True)
class Ring:
    """A circle about the origin of so many coordinates, in the plane of two, turning from the first to the second."""

    coordinates: int
    plane: tuple[int, int]
    radius: float = 1.0

    @property
    def length(self) -> float:
        """Its circumference."""
        return 2 * math.pi * self.radius

    def __call__(self, s: np.ndarray) -> np.ndarray:
        """The points (coordinates, m) at shares s (m,) of a turn."""
        out = np.zeros((self.coordinates, len(s)))
        first, second = self.plane
        out[first], out[second] = self.radius * np.cos(2 * math.pi * s), self.radius * np.sin(2 * math.pi * s)
        return out


def _best_ring(problem: Curve) -> Ring:
    """The ring in two coordinates, either way round, that has the least functional among those that meet the level.

    The first of those that are alike.
    """
    planes = list(permutations(range(problem.n), 2)) or [(0, 0)]
    rings = [Ring(problem.n, plane) for plane in planes]
    sized = [replace(ring, radius=radius) for ring in rings if (radius := _radius(problem, ring)) is not None] or rings
    values = problem.sign * _means(problem, problem.integrand, sized)
    least = np.min(values, where=np.isfinite(values), initial=math.inf)
    return sized[int(np.argmax(values <= least + ALIKE_RINGS * abs(least)))]


def _radius(problem: Curve, ring: Ring) -> float | None:
    """Radius at which a ring meets the first isoperimetric level, for a condition that is a power of the radius.

    1 where there is no level to go by, None where the condition on a ring is no power, or of the other sign.
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
        rings = [replace(ring, radius=r) for r in (radius, 2 * radius)]
        here, twice = (_means(problem, expression, rings) / level).tolist()
        power = math.log2(twice / here) if here > 0.0 and twice > 0.0 else 0.0
        if not abs(power) > NO_POWER:
            return None
        radius *= here ** (-1.0 / power)
    return radius if math.isfinite(radius) and radius > 0.0 else None


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
