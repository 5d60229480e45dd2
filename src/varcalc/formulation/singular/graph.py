"""A graph from or to singular ends in a parameter t, with the powers it leaves them with as factors.

x = x0 + width t^b and y_i = y0_i + t^q_i z_i, where b and q_i are the powers
of :mod:`varcalc.formulation.singular.departure`: the unknowns z are smooth, and free at that
end. Everything that is asked of a graph can be asked in these coordinates:
several functions, levels, bounds, waypoints, costs of the ends.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from varcalc.formulation import (
    Coordinates,
    Ends,
    Form,
    Sampled,
    Start,
    Stated,
    Waypoints,
    conditions_of,
    end_conditions,
    extended,
    guessed_abscissae,
    on_curve,
    rewriter,
    sliding_abscissae,
    straight,
)
from varcalc.formulation import through as broken
from varcalc.formulation.singular.departure import Departure
from varcalc.formulation.singular.detection import end_points
from varcalc.formulation.singular.indicial import SHRINK
from varcalc.formulation.singular.offsets import gathered
from varcalc.problem.breaks import breaks
from varcalc.problem.conditions import Through
from varcalc.problem.functional import Symbols
from varcalc.problem.problem import Problem
from varcalc.symbolic.tracing import Expression

BISECTIONS = 60
"""Halvings of [0, 1] that bring a parameter to round-off."""
CLEAR = 1e-3
"""Parameter nearer to a singular end than which a curve given as a guess is not divided by powers of it."""
OVERLAP = 0.4
"""Where, between two singular ends, what is measured from one of them is no longer asked for near the other."""
BULGE = 0.3
"""Height of the first curve between two singular ends, in units of its width."""


@dataclass(frozen=True)
class _Frame:
    """x(t), and y = base(t) + side (scale(t) z)^power: expressions in t and the abscissae of the ends, columns of n."""

    x: Expression
    base: Expression
    scale: Expression
    power: int = 1
    side: float = 1.0

    def ordinates(self, z: Expression) -> Expression:
        """y for given z."""
        return self.base + self.side * (self.scale * z) ** self.power

    def unknowns(self, rise: np.ndarray, scale: np.ndarray | float = 1.0) -> np.ndarray:
        """z for given y - base."""
        if self.power == 1:
            return rise / scale
        with np.errstate(invalid="ignore"):
            return np.maximum(self.side * rise, 0.0) ** (1 / self.power) / scale


def factored_graph(problem: Problem, departures: tuple[Departure | None, Departure | None]) -> Form:
    """The problem in t and z; ``departures`` are the powers at its singular ends, None at a regular one."""
    symbols = extended(problem, problem.n, sum(problem.slides))
    xs = sliding_abscissae(problem, symbols)
    frame = _frame(symbols.x, xs, end_points(problem), departures)
    speed, y, climb = _motion(frame, symbols)
    rewrite = rewriter(problem, symbols, frame.x, y, [climb / speed], speed)
    integrand = gathered(problem.sign * rewrite(problem.integrand, True), symbols)
    if None not in departures:
        mirrored = _from_the_end(problem, symbols, departures)
        integrand = _halves(symbols.x, integrand, gathered(problem.sign * mirrored, symbols))
    fixed, guesses = _far(problem, departures, frame)
    guess = np.array([*problem.unknown_guesses, *guessed_abscissae(problem)])
    there = ca.substitute([frame.x, frame.base, frame.scale], [symbols.unknowns], [symbols.kind(ca.DM(guess))])
    place = ca.Function("place", [symbols.x], there)
    waypoints = _waypoints(problem, frame, place)
    singular = (departures[0] is not None, departures[1] is not None)

    def at_end(k: int, z: Expression) -> tuple[Expression, Expression]:
        return xs[k], ca.substitute(frame.ordinates(symbols.y), ca.vertcat(symbols.x, symbols.y), ca.vertcat(k, z))

    form = Form(
        problem,
        Coordinates(
            Stated(symbols, integrand, integrand, (frame.x, y, speed, climb)), pull=_pull(frame, place, singular),
            note="powers of t as factors", singular=singular, weak_only=True,
        ),
        Ends(fixed[0][None], fixed[1][None], end_conditions(problem, symbols, at_end)),
        conditions_of(problem, rewrite, {_parameter(place, x) for x in breaks(problem)}, waypoints),
        Start(broken((0.0, 1.0), straight((0.0, 1.0), *guesses), waypoints), guess, np.eye(problem.n)),
    )  # fmt: skip
    return form.on_mesh(_layers([0 if one is None else one.layers for one in departures]))


def _layers(counts: list[int]) -> list[float]:
    """The vertices in t of so many layers beside each of the two ends."""
    width = 0.5 if all(counts) else 1.0
    first, last = ([width * SHRINK ** (k + 1) for k in range(count)] for count in counts)
    return [*first, *(1 - step for step in last)]


def _motion(frame: _Frame, symbols: Symbols) -> tuple[Expression, Expression, Expression]:
    """dx/dt, y and dy/dt."""
    y = frame.ordinates(symbols.y)
    return ca.jacobian(frame.x, symbols.x), y, ca.jacobian(y, symbols.x) + ca.jtimes(y, symbols.y, symbols.dy)


def _from_the_end(
    problem: Problem, symbols: Symbols, departures: tuple[Departure | None, Departure | None]
) -> Expression:
    """The integrand between two singular ends with abscissa and ordinates measured from the last one."""
    points = end_points(problem)
    turned = _frame(1 - symbols.x, (problem.span[1], problem.span[0]), points[::-1], (departures[1], departures[0]))
    speed, y, climb = _motion(turned, symbols)
    return rewriter(problem, symbols, turned.x, y, [climb / speed], speed)(problem.integrand, True)


def _halves(t: Expression, first: Expression, last: Expression) -> Expression:
    """One expression for the first half of [0, 1] and one for the last, neither taken where it loses its digits."""
    early = ca.substitute([first], [t], [ca.fmin(t, 1 - OVERLAP)])[0]
    late = ca.substitute([last], [t], [ca.fmax(t, OVERLAP)])[0]
    return ca.if_else(t < 0.5, early, late)


def _frame(
    t: Expression,
    span: tuple[Any, Any],
    points: list[np.ndarray],
    departures: tuple[Departure | None, Departure | None],
) -> _Frame:
    width, (start, end) = span[1] - span[0], (p[1:] for p in points)
    first, last = departures
    if first is not None and last is not None:
        base = [
            a if a == b else a + (b - a) * _step(t, p, q)
            for a, b, p, q in zip(start, end, first.ordinates, last.ordinates, strict=True)
        ]
        scale = [t**p * (1 - t) ** q for p, q in zip(first.ordinates, last.ordinates, strict=True)]
        return _Frame(span[0] + width * _step(t, first.abscissa, last.abscissa), ca.vertcat(*base), ca.vertcat(*scale))
    at_start = first is not None
    here = first or last
    assert here is not None
    near = t if at_start else 1 - t
    step = width * near**here.abscissa
    x = span[0] + step if at_start else span[1] - step
    base = type(t)(ca.DM(start if at_start else end))
    scale = ca.vertcat(*(near ** (q // here.power) for q in here.ordinates))
    return _Frame(x, base, scale, here.power, float(here.side[0]) if here.power != 1 else 1.0)


def _step(t: Expression, first: int, last: int) -> Expression:
    """The polynomial from 0 to 1 that leaves 0 like t^first and meets 1 like (1 - t)^last: an incomplete beta function.

    DLMF 8.17.5.
    """
    degree = first + last - 1
    return sum(
        (math.comb(degree, j) * t**j * (1 - t) ** (degree - j) for j in range(first, degree + 1)), start=type(t)(0)
    )


def _far(
    problem: Problem, departures: tuple[Departure | None, Departure | None], frame: _Frame
) -> tuple[list[np.ndarray], tuple[np.ndarray, np.ndarray]]:
    """The values of z fixed at either end, NaN where free, and first guesses of all of them."""
    ends, points = (problem.start, problem.end), end_points(problem)
    width = problem.span[1] - problem.span[0]
    free = np.full(problem.n, np.nan)
    first, last = departures
    if first is not None and last is not None:
        halves = 0.5 ** (np.array(first.ordinates) + np.array(last.ordinates))
        bulge = BULGE * width * first.side / halves
        return [free, free], (bulge, bulge)
    regular = 1 if first is not None else 0
    here = first or last
    assert here is not None
    rise = points[regular][1:] - points[1 - regular][1:]
    end, guessed = ends[regular], rise
    if end.slides:
        guessed = on_curve(end, problem) - points[1 - regular][1:]
    guessed = frame.unknowns(np.where(np.isnan(guessed), width * here.side, guessed))
    rise = np.where(np.isnan(rise), np.nan, frame.unknowns(rise))
    fixed = [free, rise] if regular else [rise, free]
    return fixed, (guessed, guessed)


def _parameter(place: ca.Function, x: float) -> float:
    """The t at which the abscissa is x."""
    low, high = 0.0, 1.0
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if float(place(middle)[0]) < x else (low, middle)
    return 0.5 * (low + high)


def _waypoints(problem: Problem, frame: _Frame, place: ca.Function) -> Waypoints:
    found = []
    for condition in problem.of_type(Through):
        t = _parameter(place, float(condition.x))
        _, base, scale = (np.asarray(v).ravel() for v in place(t))
        found.append((t, tuple(frame.unknowns(condition.values - base, scale).tolist())))
    return tuple(sorted(found, key=lambda w: w[0]))


def _pull(frame: _Frame, place: ca.Function, singular: tuple[bool, bool]) -> Callable[[Sampled], Sampled]:
    """The user's curve in terms of z."""
    low, high = CLEAR if singular[0] else 0.0, 1 - CLEAR if singular[1] else 1.0

    def pull(curve: Sampled) -> Sampled:
        """A curve y(x) as a function of t; at singular ends it is read a little inside."""

        def pulled(t: np.ndarray) -> np.ndarray:
            x, base, scale = (np.asarray(v) for v in place.map(len(t))(np.clip(t, low, high)[None]))
            return frame.unknowns(curve(x.ravel()) - base, scale)

        return pulled

    return pull


def applies(problem: Problem) -> bool:
    """Whether a problem is a graph of the first order with a fixed end, whatever else is asked of it."""
    return problem.order == 1 and (problem.start.fixed or problem.end.fixed)
