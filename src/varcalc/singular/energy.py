"""The length of a Riemannian metric, minimised through its energy in regularising coordinates.

The minimiser of the energy has constant speed (Jost, "Riemannian Geometry and
Geometric Analysis", sect. 1.4). Where the metric blows up as a power of the
distance from a line through the end, that distance becomes a power of a new
coordinate in which the extremal is smooth, and the powers of s that the
extremal is known to start with are taken out as factors.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from typing import Any

import casadi as ca
import numpy as np

from varcalc.conditions import Free, OnCurve, OnSurface
from varcalc.formulation import Elsewhere, EndConditions, Form, Sampled, Stated, StatedLater, on_curve, straight
from varcalc.functional import Functional, Symbols
from varcalc.problem import Problem
from varcalc.singular.alike import alike, ends_at
from varcalc.singular.conformal import ConformalNumbers
from varcalc.singular.detection import LARGEST_DENOMINATOR, Blowup, Metric, end_points, extent
from varcalc.singular.offsets import gathered
from varcalc.tracing import Expression, trace

UNIT = np.array([[0.0, 1.0]])
"""The interval of s."""


def energy_forms(
    problem: Functional, metric: Metric, singular: tuple[bool, bool], blowups: dict[bool, Blowup | None]
) -> list[Callable[[], Form]]:
    """Makers of the energy of the metric: with the ends' powers as factors, and in coordinates that carry them.

    ``blowups`` are those of the ``singular`` ends, and of ends with a singular line just beyond them, at the start
    (True) and the end. Empty when a free end does not follow a coordinate line of the singular chart.
    """
    beyond = len(blowups) > sum(singular)
    chart = _chart(list(blowups.values()), beyond)
    free = isinstance(problem, Problem) and any(isinstance(e, Free) for e in (problem.start, problem.end))
    if chart is None or (free and np.all(chart.normal != 0.0)):
        return []
    if chart.power == 1.0:
        return [
            partial(
                _energy_form, problem, metric, chart, singular=(False, False), graded=(False, False), factored=False
            )
        ]
    # where the line lies beyond an end, the extremal has no power of s to take out there
    ways = (True, False) if chart.height is None and not beyond else (False,)
    graded = (True in blowups, False in blowups)
    lines = {at_start: line for at_start, line in blowups.items() if line is not None}
    return [
        partial(_movable, problem, metric, chart, lines, singular=singular, graded=graded, factored=way) for way in ways
    ]


def _movable(problem: Functional, metric: Metric, chart: Chart, lines: dict[bool, Blowup], **how: Any) -> Form:
    """:func:`_energy_form`, with how it serves where its parameters move the other end than the singular one."""
    form = _energy_form(problem, metric, chart, **how)
    if not isinstance(problem, Problem) or form.ends is not None or sum(how["singular"]) != 1 or len(lines) != 1:
        return form

    def placed(values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        points = ends_at(problem, values)
        own = chart.coordinates(points.reshape(-1, 2).T).T.reshape(-1, 2, 2)
        ends = own[:, 0], own[:, 1]
        if how["factored"]:
            ends = _factors(ends, how["singular"])
        return np.repeat(UNIT, len(points), axis=0), *ends

    def moved(other: Functional) -> Form:
        _, start, end = placed(other.parameter_values[None])
        curves = _curves(other, chart, **how)
        return replace(form, problem=other, elsewhere=None, fixed_start=start, fixed_end=end, **curves)

    def unchanged(values: np.ndarray) -> np.ndarray:
        return alike(problem, values, lines, metric.conformal)

    return replace(form, elsewhere=Elsewhere(placed, moved, unchanged))


def _factors(ends: tuple[np.ndarray, np.ndarray], singular: tuple[bool, bool]) -> tuple[np.ndarray, np.ndarray]:
    """What is fixed of the factors at the ends, each (K, 2), for one singular end: its own values are free."""
    known = np.array([ends[1][:, 0] - ends[0][:, 0], ends[1 if singular[0] else 0][:, 1]]).T
    blank = np.full(known.shape, np.nan)
    return (blank, known) if singular[0] else (known, blank)


def _stated(
    problem: Functional,
    metric: Metric,
    chart: Chart,
    line: tuple[float, float],
    singular: tuple[bool, bool],
    factored: bool,
) -> tuple[StatedLater, dict[Any, Any]]:
    """What an energy form says, and what is built from it: once for all parameter values at which it is the same.

    It is stated in symbols, the parameters among them; only the chart, the kind of the metric and, with
    ``factored``, the coordinates xi of the ends (``line``: start, end) are found from numbers.
    """
    needed = () if not factored else line if all(singular) else (line[0] if singular[0] else line[1],)
    kept = problem.built.setdefault("energy forms", {})
    key = (metric.conformal, chart.key, singular, needed)
    if key not in kept:
        make = partial(_expressions, problem, metric, chart, line, singular, factored)
        kept[key] = StatedLater(2, make), {}
    return kept[key]


def _expressions(
    problem: Functional,
    metric: Metric,
    chart: Chart,
    line: tuple[float, float],
    singular: tuple[bool, bool],
    factored: bool,
) -> Stated:
    """The energy, the length and the point of the plane with its velocity, in the chart's coordinates."""
    s = problem.symbols
    symbols = replace(Symbols.make(s.kind, 2, 1, 0, len(problem.unknowns)), parameters=s.parameters)
    q = chart.point(_factored(symbols, line, chart.growth, singular) if factored else symbols.y)
    velocity = ca.jtimes(q, symbols.y, symbols.dy) + ca.jacobian(q, symbols.x)
    square = metric.square(q, velocity, symbols.unknowns)
    if chart.origin.any():  # else there is no constant that could cancel against another
        square = gathered(square, symbols)
    # constant speed in tau ~ s^grade: the energy in tau, stated in s
    integrand = square / _grading(symbols.x, chart.grade, singular)
    lifted = (q[0], q[1], velocity[0], velocity[1])
    if not isinstance(problem, Problem):
        lifted = (symbols.x, q, s.kind(1), velocity)
    return Stated(symbols, integrand, ca.sqrt(square), lifted)


def _energy_form(
    problem: Functional,
    metric: Metric,
    chart: Chart,
    *,
    singular: tuple[bool, bool],
    graded: tuple[bool, bool],
    factored: bool,
) -> Form:
    """Minimise the energy of the metric in (tangential, regularised normal) coordinates.

    The first curve is ``graded`` toward ends next to a singular line. With
    ``factored`` the unknown functions are what remains when the known powers
    of s are taken out; they are free at singular ends.
    """
    guess = _guessed(problem, chart)
    line = float(guess[0][0]), float(guess[1][0])
    stated, built = _stated(problem, metric, chart, line, singular, factored)
    fixed = tuple(chart.coordinates(np.array(end_points(problem)).T).T)
    if factored:
        fixed = _factored_ends(fixed, guess, singular)
    sliding = _sliding(problem, stated)
    return Form(
        problem=problem,
        stated=stated,
        sign=-1.0 if problem.maximise else 1.0,
        span=(0.0, 1.0),
        integrals=(),
        pathwise=(),
        fixed_start=fixed[0][None, :],
        fixed_end=fixed[1][None, :],
        **_curves(problem, chart, singular=singular, graded=graded, factored=factored),
        ends=sliding,
        periodic=False,
        knots=(),
        waypoints=(),
        unknown_guess=problem.unknown_guesses,
        bumps=np.array([[0.0, 1.0]]),
        note="energy" + (", regularised" if chart.power != 1.0 else "") + (", factored" if factored else ""),
        energetic=True,
        least_degree=math.ceil(chart.growth) + 1 if any(singular) and not factored else 1,
        singular=singular,
        weak_only=factored,
        # w and -w are one place: from a line beyond the ends a curve might reach the mirror image of its end
        one_sided=() if chart.power == 1.0 or chart.height is not None else (1,),
        # expressions for the ends that slide are made with the form
        built=built if sliding is None else {},
        numbers=_numbers(problem, metric, chart, line, singular, factored),
    )


def _curves(
    problem: Functional, chart: Chart, *, singular: tuple[bool, bool], graded: tuple[bool, bool], factored: bool
) -> dict[str, Any]:
    """The first curve of an energy form, and how it takes a person's: made when they are asked for."""

    def baseline(s: np.ndarray) -> np.ndarray:
        guess = _guessed(problem, chart)
        return (_factored_line(guess, singular) if factored else _graded_line(*guess, chart.growth, graded))(s)

    def pull(curve: Sampled) -> Sampled:
        known = singular if factored else (False, False)
        return _energy_pull(problem, chart, _guessed(problem, chart), known)(curve)

    return {"baseline": baseline, "pull": pull}


def _guessed(problem: Functional, chart: Chart) -> tuple[np.ndarray, np.ndarray]:
    """Chart coordinates of both ends with a first guess for what is free: as far off the line as along it."""
    points = end_points(problem)
    for k, end in enumerate((problem.start, problem.end)):
        if isinstance(end, OnCurve) and isinstance(problem, Problem):
            points[k] = np.array([end.x, on_curve(end, problem)[0]])
        elif isinstance(end, OnSurface):
            points[k] = np.array(end.guess, dtype=float)
    found = [chart.coordinates(p[:, None])[:, 0] for p in points]
    for k in (0, 1):
        unknown = np.isnan(found[k])
        found[k][unknown] = found[1 - k][unknown]
        if unknown[1] and found[k][1] == 0.0:
            found[k][1] = extent(problem) ** (1.0 / chart.power)
    return found[0], found[1]


def _numbers(
    problem: Functional,
    metric: Metric,
    chart: Chart,
    line: tuple[float, float],
    singular: tuple[bool, bool],
    factored: bool,
) -> ConformalNumbers | None:
    """The energy as numbers, for a conformal metric next to one line along which a coordinate is zero.

    Elsewhere constants have to be gathered before anything is rounded (:mod:`varcalc.singular.offsets`).
    """
    if not (isinstance(problem, Problem) and metric.conformal and not problem.unknowns and sum(singular) == 1):
        return None
    across = int(np.argmax(np.abs(chart.normal)))
    if chart.height is not None or chart.normal[1 - across] != 0.0 or chart.origin[across] != 0.0:
        return None
    return ConformalNumbers(
        chart.origin, chart.normal, chart.power, chart.growth, chart.grade, line, singular, factored
    )


def _sliding(problem: Functional, stated: StatedLater) -> EndConditions | None:
    """The equation of the curve that an end slides on."""
    if not any(isinstance(e, OnCurve | OnSurface) for e in (problem.start, problem.end)):
        return None
    symbols, (x, y, _, _) = stated.symbols, stated.lifted
    q = ca.vertcat(x, y) if isinstance(problem, Problem) else y
    kind = symbols.kind
    first, last = kind.sym("first", 2), kind.sym("last", 2)
    equations = []
    for at, end, place in ((0.0, problem.start, first), (1.0, problem.end, last)):
        if isinstance(end, OnCurve | OnSurface):
            point = ca.substitute([q], [symbols.x, symbols.y], [kind(at), place])[0]
            arguments = [point[0], point[1] if problem.scalar else point[1:]]
            equations.append(trace("phi", end.phi, arguments if isinstance(end, OnCurve) else [point], kind))
    return EndConditions(first, last, ca.vertcat(*equations), kind(0))


def _factored(symbols: Symbols, line: tuple[float, float], growth: float, singular: tuple[bool, bool]) -> Expression:
    """(xi, w) as known powers of s times unknown functions, free at the singular ends; ``line``: xi at both ends.

    One singular end: xi = xi_end + r^growth z, w = r omega with r the
    distance in s from it; z and omega keep the values of the other end. Two:
    xi = the graded line + (s (1 - s))^growth z, w = s (1 - s) omega.
    """
    s, z, omega = symbols.x, symbols.y[0], symbols.y[1]
    if all(singular):
        edge = s * (1 - s)
        graded = line[0] + (line[1] - line[0]) * _incomplete_beta(s, growth)
        return ca.vertcat(graded + edge**growth * z, edge * omega)
    at_start = singular[0]
    near, origin, sign = (s, line[0], 1.0) if at_start else (1 - s, line[1], -1.0)
    step = near**growth * z if sign > 0 else -(near**growth) * z
    xi = step if origin == 0.0 else origin + step
    return ca.vertcat(xi, near * omega)


def _factored_ends(
    fixed: tuple[np.ndarray, ...], guess: tuple[np.ndarray, np.ndarray], singular: tuple[bool, bool]
) -> tuple[np.ndarray, np.ndarray]:
    """Fixed values of the factors at the ends."""
    blank = np.full(2, np.nan)
    if all(singular):
        return blank, blank
    ends = np.where(np.isnan(fixed[1 if singular[0] else 0]), np.nan, _known_factors(guess, singular))
    return (blank, ends) if singular[0] else (ends, blank)


def _factored_line(guess: tuple[np.ndarray, np.ndarray], singular: tuple[bool, bool]) -> Sampled:
    """The factors of the graded straight line."""
    if all(singular):
        return lambda s: np.zeros((2, len(s)))
    return lambda s: np.repeat(_known_factors(guess, singular)[:, None], len(s), axis=1)


def _known_factors(guess: tuple[np.ndarray, np.ndarray], singular: tuple[bool, bool]) -> np.ndarray:
    """The factors at the regular end: z is the step along the line there, and omega the distance itself."""
    return np.array([guess[1][0] - guess[0][0], guess[1 if singular[0] else 0][1]])


def _incomplete_beta(s: Expression, growth: float) -> Expression:
    """A smooth step that behaves as s^growth at 0 and 1 - (1 - s)^growth at 1."""
    head, tail = s**growth, (1 - s) ** growth
    return head / (head + tail)


def _graded_line(start: np.ndarray, end: np.ndarray, growth: float, singular: tuple[bool, bool]) -> Sampled:
    """From start to end with the tangential coordinate growing like s^growth at singular ends."""
    line = straight((0.0, 1.0), start, end)
    if growth == 1.0:
        return line

    def graded(s: np.ndarray) -> np.ndarray:
        head = s**growth if singular[0] else s
        tail = (1 - s) ** growth if singular[1] else 1 - s
        points = line(s)
        points[0] = start[0] + (end[0] - start[0]) * head / (head + tail)
        return points

    return graded


def _grading(s: Expression, grade: int, singular: tuple[bool, bool]) -> Expression:
    """dtau/ds for a parameter tau ~ s^grade at singular ends, scaled to run over [0, 1]."""
    if grade == 1:
        return type(s)(1)
    rate = type(s)(1)
    if singular[0]:
        rate = rate * s ** (grade - 1)
    if singular[1]:
        rate = rate * (1 - s) ** (grade - 1)
    a, b = (grade if bad else 1 for bad in singular)
    total = math.gamma(a) * math.gamma(b) / math.gamma(a + b)
    return rate / total


SAME_LINE = 1e-6
"""Relative distance within which two singular ends lie on one line."""


@dataclass(frozen=True)
class Chart:
    """Coordinates (xi, w): xi along the singular line, w^power the distance from it.

    Between two parallel singular lines ``height`` apart, with the metric
    blowing up as distance^-1/2 at each, the distance from the first is height
    sin(w)^2 instead.
    """

    origin: np.ndarray
    normal: np.ndarray
    power: float
    grade: int
    growth: float
    """Power of s with which the tangential coordinate grows along an extremal."""
    height: float | None = None

    @property
    def key(self) -> tuple[Any, ...]:
        """What tells one chart from another."""
        return self.origin.tobytes(), self.normal.tobytes(), self.power, self.grade, self.growth, self.height

    @property
    def tangent(self) -> np.ndarray:
        """Unit vector along the line."""
        return np.array([self.normal[1], -self.normal[0]])

    def point(self, coordinates: Expression) -> Expression:
        """The point of the plane with symbolic coordinates (xi, w)."""
        w = coordinates[1]
        if self.height is not None:
            distance = self.height * ca.sin(w) ** 2
        else:
            distance = w if self.power == 1.0 else w**self.power
        return ca.vertcat(
            *(
                combination(o, (t, n), (coordinates[0], distance))
                for o, t, n in zip(self.origin, self.tangent, self.normal, strict=True)
            )
        )

    def coordinates(self, points: np.ndarray) -> np.ndarray:
        """(xi, w) of points (2, m)."""
        offset = points - self.origin[:, None]
        distance = _projected(self.normal, offset)
        if self.height is not None:
            w = np.arcsin(np.sqrt(np.clip(distance / self.height, 0.0, 1.0)))
        else:
            w = distance if self.power == 1.0 else np.maximum(distance, 0.0) ** (1.0 / self.power)
        return np.array([_projected(self.tangent, offset), w])


def _projected(direction: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """direction . offsets (2, m), where an unknown coordinate that does not enter does no harm."""
    parts = [row if d == 1.0 else d * row for d, row in zip(direction, offsets, strict=True) if d != 0.0]
    return parts[0] if len(parts) == 1 else parts[0] + parts[1]


def combination(origin: float, factors: tuple[float, float], symbols: tuple[Expression, Expression]) -> Expression:
    """origin + sum of factor * symbol without the terms that vanish, so that no digits are lost to them."""
    terms = [v if f == 1.0 else f * v for f, v in zip(factors, symbols, strict=True) if f != 0.0]
    total = terms[0] if len(terms) == 1 else terms[0] + terms[1]
    return total if origin == 0.0 else origin + total


def _chart(blowups: list[Blowup | None], beyond: bool) -> Chart | None:
    """The coordinates in which every singular end is regular; None when no one chart serves."""
    if not blowups:
        return Chart(np.zeros(2), np.array([0.0, 1.0]), 1.0, 1, 1.0)
    first, last = blowups[0], blowups[-1]
    if first is None or last is None:
        return None
    power = 1.0 / (1.0 - first.power)
    # along the line x' ~ w^(2 s m): a power of tau that may be fractional; grade s so that it is a whole one, where
    # tau is measured from the line
    ratio = (1 + first.power) / (1 - first.power)
    grade = 1 if beyond else Fraction(ratio).limit_denominator(LARGEST_DENOMINATOR).denominator
    height = float(first.normal @ (last.origin - first.origin))
    if abs(height) <= SAME_LINE * max(1.0, float(np.abs(last.origin - first.origin).max())):
        if first.power != last.power or float(first.normal @ last.normal) < 1 - SAME_LINE:
            return None
        return Chart(first.origin, first.normal, power * grade, grade, grade * ratio)
    facing = float(first.normal @ last.normal) < -1 + SAME_LINE
    if not (facing and first.power == last.power == 0.5):
        return None
    return Chart(first.origin, first.normal, power, 1, ratio, height)


def _energy_pull(
    problem: Functional, chart: Chart, fixed: tuple[np.ndarray, np.ndarray], factored: tuple[bool, bool]
) -> Callable[[Sampled], Sampled]:
    """A person's curve in the coordinates of the form, parametrised by (regularised) arc length."""
    graph = isinstance(problem, Problem)

    def pull(curve: Sampled) -> Sampled:
        # clustered at both ends, where regularised coordinates vary fastest
        fine = 0.5 - 0.5 * np.cos(np.linspace(0, math.pi, 401))
        if graph:
            x = problem.span[0] + (problem.span[1] - problem.span[0]) * fine**2 * (3 - 2 * fine)
            points = np.vstack([x, curve(x)])
        else:
            points = curve(fine)
        own = chart.coordinates(points)
        length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(own, axis=1), axis=0))])
        length /= length[-1]

        def pulled(s: np.ndarray) -> np.ndarray:
            plain = np.array([np.interp(s, length, row) for row in own])
            return _divided(plain, s, chart.growth, fixed, factored)

        return pulled

    return pull


def _divided(
    plain: np.ndarray, s: np.ndarray, growth: float, fixed: tuple[np.ndarray, np.ndarray], factored: tuple[bool, bool]
) -> np.ndarray:
    """Take the known powers out of sampled coordinates (2, m); see :func:`_factored`."""
    if not any(factored):
        return plain
    if all(factored):
        edge = np.maximum(s * (1 - s), 1e-3)
        head, tail = s**growth, (1 - s) ** growth
        line = fixed[0][0] + (fixed[1][0] - fixed[0][0]) * head / (head + tail)
        return np.vstack([(plain[0] - line) / edge**growth, plain[1] / edge])
    near = np.maximum(s if factored[0] else 1 - s, 1e-3)
    step = plain[0] - fixed[0][0] if factored[0] else fixed[1][0] - plain[0]
    return np.vstack([step / near**growth, plain[1] / near])
