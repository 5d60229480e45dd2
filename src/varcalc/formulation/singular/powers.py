"""Abscissa and ordinate as powers that make the extremal analytic at a singular end.

For Lagrangians that are no metric: the exponent of the extremal at the end
follows from the first integral v L_v - L = const.
"""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

import casadi as ca
import numpy as np

from varcalc.formulation import Conditions, Coordinates, Ends, Form, Sampled, Start, Stated, rewriter, straight
from varcalc.formulation.singular.chart import combination
from varcalc.formulation.singular.detection import LARGEST_DENOMINATOR, PROBE, end_points, rational
from varcalc.formulation.singular.offsets import gathered
from varcalc.problem.functional import Symbols
from varcalc.problem.problem import Problem

ANY_SLOPES = np.geomspace(1e-70, 1e70, 1401)
"""Slopes among which level lines are looked for: close to an end a power makes them very small or large."""


def power_form(problem: Problem, singular: tuple[bool, bool]) -> Form | None:
    """x = x0 + t^b and y = y0 + w^a at a singular end of a Lagrangian that is no metric; None where no power serves."""
    at_start = singular[0]
    start, end = end_points(problem)
    corner, other = (start, end) if at_start else (end, start)
    found = exponent(problem, corner, other)
    if found is None:
        return None
    power, side = found
    fraction = Fraction(power).limit_denominator(2 * LARGEST_DENOMINATOR)
    a, b = fraction.numerator, fraction.denominator
    s = problem.symbols
    symbols = replace(Symbols.make(s.kind, 1, 1, 0, len(problem.unknowns)), parameters=s.parameters)
    t, w, dw = symbols.x, symbols.y, symbols.dy
    width = end[0] - start[0]
    inward = 1.0 if at_start else -1.0
    # t is the distance from the singular end, to the power 1/b; it runs from 0 (start) or to 0 (end)
    root = width ** (1.0 / b)
    near = t if at_start else root - t
    x = combination(corner[0], (inward, 0.0), (near**b, near))
    speed = b * near ** (b - 1)
    y = combination(corner[1], (side, 0.0), (w**a, w))
    slope = side * a * w ** (a - 1) * dw / speed
    integrand = problem.sign * rewriter(problem, symbols, x, y, [slope], speed)(problem.integrand, True)
    integrand = gathered(integrand, symbols)
    far = (max(side * (other[1] - corner[1]), 0.0)) ** (1.0 / a)
    fixed = [0.0, far] if at_start else [far, 0.0]

    def pull(curve: Sampled) -> Sampled:
        """A curve y(x) as w(t)."""

        def pulled(at: np.ndarray) -> np.ndarray:
            near = at if at_start else root - at
            return np.maximum(side * (curve(corner[0] + inward * near**b) - corner[1]), 0.0) ** (1.0 / a)

        return pulled

    return Form(
        problem,
        Coordinates(
            Stated(symbols, integrand, integrand, (x, y, speed, side * a * w ** (a - 1) * dw)), (0.0, root), pull,
            note=f"powers x ~ t^{b}, y ~ w^{a}", singular=(at_start, not at_start),
        ),
        Ends(np.array([[fixed[0]]]), np.array([[fixed[1]]])),
        Conditions(),
        Start(straight((0.0, root), np.array([fixed[0]]), np.array([fixed[1]])), problem.unknown_guesses, np.eye(1)),
    )  # fmt: skip


def exponent(problem: Problem, corner: np.ndarray, other: np.ndarray) -> tuple[float, float] | None:
    """The exponent alpha of the extremal y - y0 ~ side * (x - x0)^alpha at a singular end, and its side.

    None where no power explains what L does. From the first integral v L_v - L = const at two small distances: v grows
    like distance^(1 - 1/alpha).
    """
    size = max(abs(other[1] - corner[1]), abs(other[0] - corner[0]))
    s = problem.symbols
    energy = ca.dot(ca.gradient(problem.integrand, s.dy), s.dy) - problem.integrand
    function = ca.Function("energy", [s.x, s.y, s.dy, s.parameters, s.unknowns], [energy])
    slopes = ANY_SLOPES
    numbers = (problem.parameter_values, problem.unknown_guesses)
    # the constant is that of the chord half way: a level without relation to it may be ruled by another power
    rise, run = (float(v) for v in (other - corner)[::-1])
    level = float(function(*(0.5 * (corner + other)), rise / run or 1.0, *numbers))
    for side in (1.0, -1.0) if other[1] >= corner[1] else (-1.0, 1.0):
        logs = []
        for distance in PROBE:
            y = corner[1] + side * distance * size
            direction = side * (1.0 if other[0] > corner[0] else -1.0)
            values = np.asarray(
                function(
                    corner[0],
                    np.full((1, len(slopes)), y),
                    direction * slopes[None],
                    *numbers,
                )
            ).ravel()
            logs.append(values)
        found = scaling(slopes, logs, level if math.isfinite(level) else None)
        if found is not None and math.isfinite(found) and found < 1:
            return rational(1.0 / (1.0 - found)), side
    return None


def scaling(slopes: np.ndarray, values: list[np.ndarray], level: float | None = None) -> float | None:
    """The power of the distance that v grows with at fixed first integral, from its level lines at two distances."""
    far, near = values
    ratio = math.log(PROBE[0] / PROBE[1])
    middle = float(np.median(far[np.isfinite(far)])) if np.isfinite(far).any() else math.nan
    middle = middle if level is None else level
    if not math.isfinite(middle):
        return None
    crossings = []
    for row in (far, near):
        with np.errstate(invalid="ignore"):
            step = np.diff(np.sign(row - middle))
        change = np.flatnonzero(np.isfinite(step) & (step != 0))
        if not len(change):
            return None
        k = int(change[0])
        first, last = float(row[k]), float(row[k + 1])
        if middle * first > 0 and middle * last > 0:  # a power is a straight line in logarithms
            share = math.log(middle / first) / math.log(last / first)
        else:
            share = (middle - first) / (last - first)
        crossings.append(math.log(slopes[k]) + share * math.log(slopes[k + 1] / slopes[k]))
    return -(crossings[1] - crossings[0]) / ratio
