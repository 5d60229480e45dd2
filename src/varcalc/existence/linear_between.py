"""What L is on lines and beside them where it is linear in the slope but for kinks, as a total variation is.

Where such a curve moves Euler and Lagrange's equation holds no second derivative: it says where the curve is. Elsewhere
a kink holds it on a line, until that comes to such a curve again, or to a line of the next kink; what presses it along
the line is what its momentum changes by. (For sums of y'^2 that is Rudin, Osher and Fatemi, Physica D 60, 1992.)
"""

from __future__ import annotations

from functools import cached_property

import casadi as ca
import numpy as np

from varcalc.formulation import formulate
from varcalc.problem.breaks import on_curve
from varcalc.problem.problem import Problem
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.switches import Switch, held
from varcalc.symbolic.tracing import Expression

KINKS_ALIKE = 1e-12
"""Difference of two kinks' slopes, in units of the larger one, that is round-off."""


class LinearBetweenKinks:
    """The kinks of such an L, at ascending ``slopes`` (k,), and what L is on the k + 1 pieces between and beyond them.

    A kink has the number of the piece below it. Kinks of the place alone may be met as well.
    """

    def __init__(self, problem: Problem, slopes: np.ndarray, placed: list[Switch]) -> None:
        self.problem, self.slopes = problem, slopes
        s, x = problem.symbols, 0.5 * sum(problem.span)
        y = formulate(problem).start.curve(np.array([x]))[:, 0]
        none, numbers = np.zeros(0), problem.parameter_values
        beyond = slopes[[0, -1]] + [-1.0, 1.0]
        between = [beyond[0], *(0.5 * (slopes[1:] + slopes[:-1])), beyond[1]]
        self.surfaces = [w.argument - w.levels[0] for w in placed]
        self.pieces = [
            held(
                [problem.sign * problem.integrand], s.all,
                [np.array([x]), y, np.array([slope]), none, numbers, none], ca.vertcat(s.y, s.dy), self.surfaces,
            )[0]
            for slope in between
        ]  # fmt: skip
        self._momenta = [ca.gradient(piece, s.dy) for piece in self.pieces]

    @property
    def places(self) -> bool:
        """Whether L is linear in the slope on all pieces, and what is missed of its equation there says where y is."""
        dy, y = self.problem.symbols.dy, self.problem.symbols.y
        told = all(ca.depends_on(missed, y) for missed in self._missed)
        return told and not any(ca.depends_on(momentum, dy) for momentum in self._momenta)

    @cached_property
    def _missed(self) -> list[Expression]:
        """What is missed of Euler and Lagrange's equation by a curve of any slope, on each piece of L."""
        s = self.problem.symbols
        missed = [
            ca.gradient(piece, s.y) - ca.gradient(momentum, s.x) - ca.gradient(momentum, s.y) * s.dy
            for piece, momentum in zip(self.pieces, self._momenta, strict=True)
        ]
        return ca.substitute(missed, [s.dy], [ca.SX(0.0)])

    @cached_property
    def _on_lines(self) -> PointEvaluator:
        """At (x, y): L on the line of each kink, and the momenta of the pieces."""
        dy = self.problem.symbols.dy
        along = [ca.substitute(piece, dy, c) for piece, c in zip(self.pieces, self.slopes, strict=False)]
        return self._evaluator([*along, *self._momenta])

    @cached_property
    def _beside(self) -> PointEvaluator:
        """At (x, y): momenta, what they miss of their equations, what presses each line, rates of what is missed.

        Last come the surfaces at which kinks of the place are, with their rates.
        """
        s = self.problem.symbols
        pressed = [
            ca.substitute(ca.gradient(piece, s.y), s.dy, c) for piece, c in zip(self.pieces, self.slopes, strict=False)
        ]
        rates = [ca.gradient(e, v) for v in (s.x, s.y) for e in self._missed]
        of_surfaces = [ca.gradient(e, v) for v in (s.x, s.y) for e in self.surfaces]
        return self._evaluator([*self._momenta, *self._missed, *pressed, *rates, *self.surfaces, *of_surfaces])

    def _evaluator(self, expressions: list[Expression]) -> PointEvaluator:
        s = self.problem.symbols
        stated = ca.densify(ca.vertcat(*expressions))
        stated = ca.substitute(stated, s.parameters, ca.SX(self.problem.parameter_values))
        return PointEvaluator(ca.Function("on_lines", [s.x, s.y], [stated]))

    def summed(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """L on the lines of the kinks through points (m,), (k, m), and the momenta of the pieces there, (k + 1, m)."""
        values = self._on_lines(len(x), around(self.problem, x)[:, None], y[:, None]).T
        return values[: len(self.slopes)], values[len(self.slopes) :]

    def beside(self, x: np.ndarray, y: np.ndarray) -> Beside:
        """What holds and presses a curve at points (m,)."""
        return Beside(self._beside(len(x), around(self.problem, x)[:, None], y[:, None]).T, len(self.slopes))


def around(problem: Problem, x: np.ndarray) -> np.ndarray:
    """Abscissae (m,) in the interval: beyond one end of a closed curve it is at the other."""
    (first, last), closed = problem.span, problem.start.periodic
    width = last - first
    return np.where(x < first, x + width, np.where(x > last, x - width, x)) if closed else x


class Beside:
    """What holds and presses a curve at points (m,), of so many ``kinks``, as rows of ``values``."""

    def __init__(self, values: np.ndarray, kinks: int) -> None:
        pieces = kinks + 1
        edges = np.cumsum([pieces, pieces, kinks, pieces, pieces])
        self.momenta, self.missed, self.pressed, by_x, by_y, surfaces = np.split(values, edges)
        self.rates = by_x, by_y
        self.surfaces, *of_surfaces = np.split(surfaces, 3)
        self.surface_rates = tuple(of_surfaces)


def linear_between_kinks(problem: Problem) -> LinearBetweenKinks | None:
    """The kinks of a graph of one function, at known slopes, where L is linear in that between them; else None."""
    s, switches = problem.symbols, on_curve(problem)
    graph = problem.n == problem.order == 1 and s.kind is ca.SX and not (problem.unknowns or problem.constraints)
    if not graph or problem.end_cost is not None or any(problem.slides):
        return None
    if any(switch.jumps or switch.stepped or switch.smooth or len(switch.levels) > 1 for switch in switches):
        return None
    steep = [switch for switch in switches if switch.depends_on(s.dy)]
    slopes = [_slope(problem, switch) for switch in steep]
    known = np.unique([slope for slope in slopes if slope is not None])
    if not steep or None in slopes or (np.diff(known) <= KINKS_ALIKE * np.abs(known).max()).any():
        return None
    kinks = LinearBetweenKinks(problem, known, [switch for switch in switches if not switch.depends_on(s.dy)])
    return kinks if kinks.places else None


def _slope(problem: Problem, switch: Switch) -> float | None:
    """The slope at which a kink is, wherever the curve is; None where that moves."""
    s = problem.symbols
    rate = ca.gradient(switch.argument, s.dy)
    level = ca.substitute(switch.argument, s.dy, 0.0)
    if ca.depends_on(ca.vertcat(rate, level), ca.vertcat(s.x, s.y, s.dy)):
        return None
    numbers = ca.Function("kink", [s.parameters], [switch.levels[0] - level, rate])
    away, per_slope = (float(v) for v in numbers(problem.parameter_values))
    return away / per_slope if per_slope != 0.0 else None
