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
from functools import partial
from typing import Any

import casadi as ca
import numpy as np

from varcalc.formulation import (
    Conditions,
    Coordinates,
    Elsewhere,
    EndConditions,
    Ends,
    Form,
    Sampled,
    Start,
    Stated,
    StatedLater,
    end_conditions,
    on_curve,
)
from varcalc.formulation.singular.alike import alike, ends_at
from varcalc.formulation.singular.chart import (
    Chart,
    chart_of,
    divided,
    factored_ends,
    factored_line,
    factors_at,
    graded_line,
    grading,
    with_factors,
)
from varcalc.formulation.singular.conformal import ConformalNumbers
from varcalc.formulation.singular.detection import Blowup, LengthElement, end_points, extent
from varcalc.formulation.singular.offsets import gathered
from varcalc.problem.functional import Functional, Symbols
from varcalc.problem.problem import Problem
from varcalc.symbolic.derived import Cache, derived
from varcalc.symbolic.tracing import Expression

UNIT = np.array([[0.0, 1.0]])
"""The interval of s."""


def energy_forms(
    problem: Functional, metric: LengthElement, singular: tuple[bool, bool], blowups: dict[bool, Blowup | None]
) -> list[partial[Form]]:
    """Makers of the energy of the metric: with the ends' powers as factors, and in coordinates that carry them.

    ``blowups`` are those of the ``singular`` ends, and of ends with a singular line just beyond them, at the start
    (True) and the end. Empty when a free end does not follow a coordinate line of the singular chart.
    """
    beyond = len(blowups) > sum(singular)
    chart = chart_of(list(blowups.values()), beyond)
    free = any(not (e.fixed or e.slides) for e in (problem.start, problem.end))
    if chart is None or (free and np.all(chart.normal != 0.0)):
        return []
    if chart.power == 1.0:
        return [partial(Energy.form, Energy(problem, metric, chart, (False, False), (False, False), factored=False))]
    # where the line lies beyond an end, the extremal has no power of s to take out there
    ways = (True, False) if chart.height is None and not beyond else (False,)
    graded = (True in blowups, False in blowups)
    lines = {at_start: line for at_start, line in blowups.items() if line is not None}
    return [
        partial(Energy.movable, Energy(problem, metric, chart, singular, graded, factored=way), lines) for way in ways
    ]


@derived
def _stated_energies(problem: Functional) -> dict[tuple[Any, ...], tuple[StatedLater, Cache]]:
    """The statements of energy forms, each with what is derived from it, by what decides them."""
    return {}


@dataclass(frozen=True)
class Energy:
    """The energy of a metric in (tangential, regularised normal) coordinates.

    The first curve is ``graded`` toward ends next to a singular line. With
    ``factored`` the unknown functions are what remains when the known powers
    of s are taken out; they are free at ``singular`` ends.
    """

    problem: Functional
    metric: LengthElement
    chart: Chart
    singular: tuple[bool, bool]
    graded: tuple[bool, bool]
    factored: bool

    def movable(self, lines: dict[bool, Blowup]) -> Form:
        """:meth:`form`, with how it serves where its parameters move the other end than the singular one."""
        form, problem, chart = self.form(), self.problem, self.chart
        if not isinstance(problem, Problem) or form.ends.joint or sum(self.singular) != 1 or len(lines) != 1:
            return form

        def placed(values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
            """The spans of s, and both ends of the form, at parameter values (k, parameters): a row for each."""
            points = ends_at(problem, values)
            own = chart.coordinates(points.reshape(-1, 2).T).T.reshape(-1, 2, 2)
            ends = own[:, 0], own[:, 1]
            if self.factored:
                ends = factors_at(ends, self.singular)
            return np.repeat(UNIT, len(points), axis=0), *ends

        def moved(other: Functional) -> Form:
            """The form at the parameter values of another problem."""
            _, start, end = placed(other.parameter_values[None])
            there = replace(self, problem=other)
            # where one solution follows another, the expressions, differentiated once, are cheaper than numbers
            coordinates = replace(form.coordinates, numbers=None, pull=there.pull)
            return replace(
                form, problem=other, elsewhere=None, coordinates=coordinates, ends=Ends(start, end),
                start=replace(form.start, curve=there.baseline),
            )  # fmt: skip

        def unchanged(values: np.ndarray) -> np.ndarray:
            return alike(problem, values, lines, self.metric.conformal)

        return replace(form, elsewhere=Elsewhere(placed, moved, unchanged))

    def _stated(self, line: tuple[float, float]) -> tuple[StatedLater, Cache]:
        """What the form says, and what is built from it: once for all parameter values at which it is the same.

        It is stated in symbols, the parameters among them; only the chart, the kind of the metric and, with
        ``factored``, the coordinates xi of the ends (``line``: start, end) are found from numbers.
        """
        needed: tuple[float, ...] = ()
        if self.factored:
            needed = line if all(self.singular) else (line[0] if self.singular[0] else line[1],)
        kept = _stated_energies(self.problem)
        key = (self.metric.conformal, self.chart.key, self.singular, needed)
        if key not in kept:
            kept[key] = StatedLater(2, partial(self._expressions, line)), Cache()
        return kept[key]

    def _expressions(self, line: tuple[float, float]) -> Stated:
        """The energy, the length and the point of the plane with its velocity, in the chart's coordinates."""
        s, chart = self.problem.symbols, self.chart
        symbols = replace(Symbols.make(s.kind, 2, 1, 0, len(self.problem.unknowns)), parameters=s.parameters)
        q = chart.point(with_factors(symbols, line, chart.growth, self.singular) if self.factored else symbols.y)
        velocity = ca.jtimes(q, symbols.y, symbols.dy) + ca.jacobian(q, symbols.x)
        square = self.metric.square(q, velocity, symbols.unknowns)
        if chart.origin.any():  # else there is no constant that could cancel against another
            square = gathered(square, symbols)
        # constant speed in tau ~ s^grade: the energy in tau, stated in s
        integrand = square / grading(symbols.x, chart.grade, self.singular)
        lifted = (q[0], q[1], velocity[0], velocity[1])
        if not isinstance(self.problem, Problem):
            lifted = (symbols.x, q, s.kind(1), velocity)
        return Stated(symbols, integrand, ca.sqrt(square), lifted)

    def form(self) -> Form:
        """The form to be minimised."""
        problem, chart, factored = self.problem, self.chart, self.factored
        guess = _guessed(problem, chart)
        line = float(guess[0][0]), float(guess[1][0])
        stated, cache = self._stated(line)
        fixed = tuple(chart.coordinates(np.array(end_points(problem)).T).T)
        if factored:
            fixed = factored_ends(fixed, guess, self.singular)
        joint = self._joint(stated) if any(problem.slides) else None
        return Form(
            problem,
            Coordinates(
                stated,
                pull=self.pull,
                note="energy" + (", regularised" if chart.power != 1.0 else "") + (", factored" if factored else ""),
                energetic=True,
                least_degree=math.ceil(chart.growth) + 1 if any(self.singular) and not factored else 1,
                singular=self.singular,
                weak_only=factored,
                # w and -w are one place: from a line beyond the ends a curve might reach the mirror image of its end
                one_sided=() if chart.power == 1.0 or chart.height is not None else (1,),
                numbers=self._numbers(line),
            ),
            Ends(fixed[0][None, :], fixed[1][None, :], joint),
            Conditions(),
            Start(self.baseline, problem.unknown_guesses, np.array([[0.0, self._rise(guess)]])),
            # expressions for the ends that slide are made with the form
            cache=cache if joint is None else Cache(),
        )

    def _joint(self, stated: StatedLater) -> EndConditions | None:
        """The curves that ends slide on."""
        symbols, (x, y, _, _) = stated.symbols, stated.lifted

        def place(k: int, z: Expression) -> tuple[Expression, Expression]:
            at = ca.substitute([x, y], [symbols.x, symbols.y], [symbols.kind(k), z])
            return at[0], at[1]

        return end_conditions(self.problem, symbols, place)

    def _rise(self, guess: tuple[np.ndarray, np.ndarray]) -> float:
        """How high w is where xi is as large as the problem: a power has a unit of its own."""
        if self.chart.power == 1.0 and self.chart.height is None:
            return 1.0
        size = 1.0 if self.chart.height is not None else extent(self.problem) ** (1.0 / self.chart.power)
        return size / (float(np.abs(guess[1] - guess[0]).max()) or size)

    def baseline(self, s: np.ndarray) -> np.ndarray:
        """The first curve of the form."""
        guess = _guessed(self.problem, self.chart)
        if self.factored:
            return factored_line(guess, self.singular)(s)
        return graded_line(*guess, self.chart.growth, self.graded)(s)

    def pull(self, curve: Sampled) -> Sampled:
        """The user's curve in the form's coordinates."""
        known = self.singular if self.factored else (False, False)
        return _energy_pull(self.problem, self.chart, _guessed(self.problem, self.chart), known)(curve)

    def _numbers(self, line: tuple[float, float]) -> ConformalNumbers | None:
        """The energy as numbers, for a conformal metric next to one line along which a coordinate is constant.

        Where that constant is not zero, it has to be gathered with those of L, which takes a formula for L, and a
        number that no parameter moves (:mod:`varcalc.formulation.singular.offsets`).
        """
        problem, chart = self.problem, self.chart
        conformal = isinstance(problem, Problem) and self.metric.conformal and not problem.unknowns
        if not conformal or sum(self.singular) != 1:
            return None
        across = int(np.argmax(np.abs(chart.normal)))
        if chart.height is not None or chart.normal[1 - across] != 0.0:
            return None
        shifted = chart.origin[across] != 0.0
        if shifted and (problem.end_parameters or problem.symbols.kind is not ca.SX):
            return None
        return ConformalNumbers(
            chart.origin, chart.normal, chart.power, chart.growth, chart.grade, line, self.singular, self.factored,
            shifted,
        )  # fmt: skip


def _guessed(problem: Functional, chart: Chart) -> tuple[np.ndarray, np.ndarray]:
    """Chart coordinates of both ends with a first guess for what is free: as far off the line as along it."""
    points = end_points(problem)
    for k, end in enumerate((problem.start, problem.end)):
        if end.slides and isinstance(problem, Problem):
            points[k] = np.array([end.x, on_curve(end, problem)[0]])
        elif end.slides:
            points[k] = np.array(end.guess, dtype=float)
    found = [chart.coordinates(p[:, None])[:, 0] for p in points]
    for k in (0, 1):
        unknown = np.isnan(found[k])
        found[k][unknown] = found[1 - k][unknown]
        if unknown[1] and found[k][1] == 0.0:
            found[k][1] = extent(problem) ** (1.0 / chart.power)
    return found[0], found[1]


def _energy_pull(
    problem: Functional, chart: Chart, fixed: tuple[np.ndarray, np.ndarray], factored: tuple[bool, bool]
) -> Callable[[Sampled], Sampled]:
    """A person's curve in the coordinates of the form, parametrised by (regularised) arc length."""
    graph = isinstance(problem, Problem)

    def pull(curve: Sampled) -> Sampled:
        """A curve of the problem as a function of its share of the length, in the coordinates of the form."""
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
            return divided(plain, s, chart.growth, fixed, factored)

        return pulled

    return pull
