"""Rays by Fermat's principle itself: the optical path among all paths from A to B is stationary.

What is made stationary is the energy ½ ∫ n² |q'|² dt of each leg over the
share T of the parameter that the leg has: ½ Σ S²/T with Σ T = 1 is least at
½ (Σ S)², so that S = sqrt(2 E) (Brizard, "An Introduction to Lagrangian
Mechanics", sect. 1.4.1, for the metric n² |dq|²). Every leg is a chord and a
deviation from it; where surfaces join the legs, the points on them are
unknowns of the same problem, which gives Snell's law unasked.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from varcalc.methods.collocation.method import Collocation
from varcalc.methods.ritz.method import Ritz
from varcalc.optics.media.medium import Expression, Medium
from varcalc.optics.models.model import Carrier, DoesNotApply, Model, Question
from varcalc.optics.rays.beam import frames
from varcalc.optics.rays.ray import Ray, Rays
from varcalc.optics.surfaces import Geometry, Surface
from varcalc.problem.conditions import Fixed
from varcalc.problem.problem import Problem
from varcalc.solution import Solution
from varcalc.solve.ladder import solve

ENERGY_TOLERANCE = 1e-11
"""Of the energy in units of its size: what the solver is asked for."""
ERRORS_APART = 4.0
"""Times the sum of the claimed errors: an optical path farther from that of a ray is another ray's."""
CHART_STEPS = 6
"""Newton's steps from a tangent plane to its surface."""
NO_RAY = 1e-8
"""Of the optical path: a path that a ray from A differs from by more is that of no ray."""
GUESS_SAMPLES = 65
"""Places of a ray that a solve starts from."""


@dataclass(frozen=True)
class Fermat(Model):
    """Fermat's principle: Ritz's method for rays of least optical path, Collocation for stationary ones.

    It finds the shortest ray by itself, starting from the straight line, and confirms the others that the search of
    the scene finds: each is solved for again as a stationary path, and left out unless the two agree. It joins two
    points and carries no bundles.
    """

    @property
    def companion(self) -> Model | None:
        """None: the cheapest model carries what belongs to each ray, its neighbours and conjugate points."""
        return None

    def carrier(self, medium: Medium, dimension: int, surfaces: Sequence[Geometry]) -> Carrier:  # noqa: ARG002
        """Never; see :meth:`Model.carrier`."""
        raise DoesNotApply("Fermat needs two points to join, and a bundle has one end only; take Hamilton()")

    def between(self, question: Question) -> Rays:
        """See :meth:`Model.between`."""
        search = question.search()
        confirmed = [ray for ray in (_confirmed(question, ray) for ray in search) if ray is not None]
        straight = _solved(question, _straight(question), Ritz())
        new = None if straight is None else _shortest(question, straight, confirmed)
        if new is not None:
            confirmed.append(new)
        how = f"{len(confirmed)} stationary paths, of {len(search)} that were found by: {search.searched}"
        reason = "" if confirmed else search.reason or f"no stationary path was confirmed (searched: {how})"
        return Rays(tuple(sorted(confirmed, key=lambda r: r.optical_path)), reason, how, search.continuum)


NAME = "Fermat's principle"


@dataclass(frozen=True)
class _Path:
    """A path as a solve starts from it: the ``points`` on the surfaces, the shares of the legs, and the deviations.

    ``deviation`` takes t in [0, 1] to those of all legs from their chords, one after the other.
    """

    points: list[np.ndarray]
    shares: list[float]
    deviation: Callable[[float], np.ndarray]


def _straight(question: Question) -> _Path:
    """The straight line, or as much of it as there is: points on the surfaces next to it."""
    legs, d = len(question.media), len(question.a)
    points = [
        _onto(surface, question.a + (question.b - question.a) * (k + 1) / legs)
        for k, surface in enumerate(question.surfaces)
    ]
    return _Path(points, [1 / legs] * legs, lambda _: np.zeros(legs * d))


def _onto(surface: Surface, point: np.ndarray) -> np.ndarray:
    """``point`` (d,) moved to the surface along its gradient."""
    geometry = Geometry(surface, len(point))
    for _ in range(20):
        level, gradient = geometry.level(point[None, :])[0], geometry.gradient(point[None, :])[0]
        point = point - level * gradient / np.dot(gradient, gradient)
    return point


def _along(question: Question, ray: Ray) -> _Path:
    """The path of a ray."""
    starts = [float(leg.at(np.zeros(1)).optical_path[0]) for leg in ray.legs]
    ends = [*starts[1:], ray.optical_path]
    joints = [question.a, *(leg.at(np.zeros(1)).position[0] for leg in ray.legs[1:]), question.b]
    t = np.linspace(0, 1, GUESS_SAMPLES)
    table = []
    for k, (start, end) in enumerate(zip(starts, ends, strict=True)):
        chord = joints[k] + t[:, None] * (joints[k + 1] - joints[k])
        table.append(ray.point(np.clip(start + t * (end - start), 0, ray.optical_path)) - chord)
    values = np.concatenate(table, axis=1)
    values[[0, -1]] = 0.0
    shares = [(end - start) / ray.optical_path for start, end in zip(starts, ends, strict=True)]
    return _Path(
        [np.asarray(j) for j in joints[1:-1]],
        shares,
        lambda at: np.array([np.interp(at, t, column) for column in values.T]),
    )


def _problem(question: Question, path: _Path) -> Problem:
    """The energy of all legs as one functional of the deviations, the points on surfaces and the shares."""
    d, legs = len(question.a), len(question.media)
    ends = Fixed(0.0, [0.0] * (legs * d)), Fixed(1.0, [0.0] * (legs * d))
    if legs == 1:
        return Problem(lambda x, y, dy: _energy(question, [], [1.0], x, y, dy), *ends, name=NAME)
    charts = [_Chart.at(surface, point) for surface, point in zip(question.surfaces, path.points, strict=True)]
    unknowns = {f"P{k}_{i}": 0.0 for k in range(legs - 1) for i in range(d - 1)}
    unknowns |= {f"T{k}": share for k, share in enumerate(path.shares[:-1])}

    def lagrangian(x: Any, y: Any, dy: Any, p: Any) -> Any:
        """The energy of all legs at x, the points and the shares read from ``p``."""
        points = [
            chart.point(ca.vertcat(*(getattr(p, f"P{k}_{i}") for i in range(d - 1)))) for k, chart in enumerate(charts)
        ]
        shares = [getattr(p, f"T{k}") for k in range(legs - 1)]
        return _energy(question, points, [*shares, 1 - sum(shares)], x, y, dy)

    return Problem(lagrangian, *ends, unknowns=unknowns, name=NAME)


@dataclass(frozen=True)
class _Chart:
    """A surface over its tangent plane at ``origin`` (d,), which ``axes`` (d - 1, d) span; ``normal`` (d,) is unit."""

    surface: Surface
    origin: np.ndarray
    normal: np.ndarray
    axes: np.ndarray

    @classmethod
    def at(cls, surface: Surface, origin: np.ndarray) -> _Chart:
        """The chart about a point of ``surface``."""
        gradient = Geometry(surface, len(origin)).gradient(origin[None, :])
        normal = gradient / np.linalg.norm(gradient)
        return cls(surface, origin, normal[0], frames(normal)[0])

    def point(self, coordinates: Expression) -> Expression:
        """The point of the surface over ``coordinates`` (d - 1,), by Newton's steps along the normal."""
        symbol = ca.SX.sym("P", len(self.origin))
        level = self.surface.level(symbol)
        step = ca.Function("step", [symbol], [level / ca.dot(ca.gradient(level, symbol), ca.DM(self.normal))])
        point = ca.DM(self.origin) + ca.DM(self.axes.T) @ coordinates
        for _ in range(CHART_STEPS):
            point -= step(point) * ca.DM(self.normal)
        return point


def _energy(question: Question, points: list[Expression], shares: list[Any], x: Any, y: Any, dy: Any) -> Any:
    """½ Σ n² |q'|²/T at the parameter ``x``."""
    d, total = len(question.a), 0.0
    y, dy = y - _bulge(question, x), dy - _bulge_rate(question, x)
    joints = [ca.DM(question.a), *points, ca.DM(question.b)]
    for k, (medium, share) in enumerate(zip(question.media, shares, strict=True)):
        chord = joints[k + 1] - joints[k]
        position, velocity = joints[k] + x * chord + y[k * d : (k + 1) * d], chord + dy[k * d : (k + 1) * d]
        total += medium.squared_index(position) * ca.sumsqr(velocity) / (2 * share)
    return total


def _bulge(question: Question, x: Any) -> Any:
    """What is added to all deviations: errors are asked for relative to their size, and straight legs have none."""
    return float(np.linalg.norm(question.b - question.a)) * x * (1 - x)


def _bulge_rate(question: Question, x: Any) -> Any:
    return float(np.linalg.norm(question.b - question.a)) * (1 - 2 * x)


@dataclass(frozen=True)
class _Stationary:
    """A stationary path: its optical path, the error claimed, and the unit vector (d,) along which it leaves A."""

    optical_path: float
    error: float
    heading: np.ndarray


def _solved(question: Question, path: _Path, method: Ritz | Collocation) -> _Stationary | None:
    """The stationary path next to ``path``; None where there is none."""
    problem = _problem(question, path)
    solution = solve(
        problem,
        method,
        tol=ENERGY_TOLERANCE,
        throw=False,
        guess=lambda t: path.deviation(float(t)) + _bulge(question, float(t)),
    )
    if not solution.status.ok or not solution.value > 0:
        return None
    S = float(np.sqrt(2 * solution.value))
    return _Stationary(S, float(solution.error.value) / S, _heading(question, path, solution))


def _heading(question: Question, path: _Path, solution: Solution) -> np.ndarray:
    d, first = len(question.a), question.b
    if len(question.media) > 1:
        chart = _Chart.at(question.surfaces[0], path.points[0])
        coordinates = ca.DM([solution.unknowns[f"P0_{i}"] for i in range(d - 1)])
        first = np.array(ca.DM(chart.point(coordinates))).ravel()
    velocity = first - question.a + np.asarray(solution.dy(0.0))[:d] - _bulge_rate(question, 0.0)
    return velocity / np.linalg.norm(velocity)


def _confirmed(question: Question, ray: Ray) -> Ray | None:
    """``ray`` with the optical path of the stationary path next to it; None where they differ."""
    found = _solved(question, _along(question, ray), Ritz() if ray.index == 0 else Collocation())
    if found is None or abs(found.optical_path - ray.optical_path) > ERRORS_APART * (found.error + ray.error):
        return None
    return _named(ray, found.optical_path, found.error)


def _shortest(question: Question, found: _Stationary, known: list[Ray]) -> Ray | None:
    """The path that was found from the straight line as a ray, where it is none of those known."""
    if any(abs(found.optical_path - ray.optical_path) <= ERRORS_APART * (found.error + ray.error) for ray in known):
        return None
    [(ray, _)] = question.built(found.heading[None], np.array([found.optical_path]), np.zeros(1, dtype=bool))
    if ray is None or ray.error > NO_RAY * ray.optical_path:  # it meets surfaces in another order
        return None
    return _named(ray, found.optical_path, max(found.error, ray.error))


def _named(ray: Ray, optical_path: float, error: float) -> Ray:
    """``ray`` with an optical path that this model found."""
    return replace(ray, optical_path=optical_path, error=error, together=replace(ray.together, model=NAME))
