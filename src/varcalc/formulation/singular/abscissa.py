"""A power of the abscissa that makes the extremal analytic at an end where L is singular in x.

Where the dependence of L on the slope blows up or dies like a power of the
distance from an end, x^s y'^2 say, the momentum L_y' = const makes y - y0 grow
like a power e of that distance. With x = x0 + t^b and y = y0 + t^q z, q / b = e,
the unknown z is smooth, and free at that end. Where e is no fraction of small
denominator, b is large enough for t^(e b), q the whole number below e b, to be
a curve that polynomials come near fast.
"""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

import casadi as ca
import numpy as np

from varcalc.formulation import Conditions, Coordinates, Ends, Form, Sampled, Start, Stated, rewriter, straight
from varcalc.formulation.singular.departure import Departure
from varcalc.formulation.singular.detection import LARGEST_DENOMINATOR, PROBE, end_points
from varcalc.formulation.singular.graph import factored_graph
from varcalc.formulation.singular.offsets import gathered
from varcalc.formulation.singular.powers import scaling
from varcalc.problem.functional import Symbols
from varcalc.problem.problem import Problem

FEW_SLOPES = np.array([-1e6, -1e3, -1.0, -1e-3, 1e-3, 1.0, 1e3, 1e6])
ANY_SLOPES = np.geomspace(1e-70, 1e70, 1401)
"""Slopes among which a level of the momentum is looked for: close to an end a power makes them very small or large."""
MEASURED = 1e-4
"""Accuracy with which an exponent is measured."""
SMOOTH = 6
"""Power of t that a curve grows with next to an end where no whole power of t is all of it."""
LARGEST_POWER = 40
"""Largest power of t in x: a step of a twentieth in t leaves numbers that can still be squared."""
SAME_MOMENTUM = 1e-3
"""Slopes by which it is seen that the momentum is the same at both distances, and its relative change that is none:
the least power that counts, a twelfth, changes it by a third."""


def abscissa_form(problem: Problem) -> Form | None:
    """The problem in t with x ~ t^b at one end or both; None when the abscissa itself serves."""
    start, end = end_points(problem)
    if regular(problem):
        return None
    width = end[0] - start[0]
    exponents = powers_at_ends(problem)
    singular = [e != (1, 1) for e in exponents]
    if not any(singular):
        return None
    if all(singular):
        first, last = (Departure(b, (q,), np.zeros(1)) for b, q in exponents)
        return factored_graph(problem, (first, last))
    at_start = singular[0]
    corner, other, (b, q) = (start, end, exponents[0]) if at_start else (end, start, exponents[1])
    inward = width if at_start else -width
    s = problem.symbols
    symbols = replace(Symbols.make(s.kind, 1, 1, 0, len(problem.unknowns)), parameters=s.parameters)
    t, z = symbols.x, symbols.y
    near = t if at_start else 1 - t
    step = inward * near**b
    x = step if corner[0] == 0.0 else corner[0] + step
    y = corner[1] + near**q * z
    speed = width * b * near ** (b - 1)
    climb = ca.gradient(near**q, t) * z + near**q * symbols.dy
    integrand = problem.sign * rewriter(problem, symbols, x, y, [climb / speed], speed)(problem.integrand, True)
    integrand = gathered(integrand, symbols)
    far = np.array([other[1] - corner[1]])
    free = np.array([np.nan])

    def pull(curve: Sampled) -> Sampled:
        """A curve y(x) in the coordinates of the form."""

        def pulled(at: np.ndarray) -> np.ndarray:
            near = np.maximum(at if at_start else 1 - at, 1e-3)
            return (curve(corner[0] + inward * near**b) - corner[1]) / near**q

        return pulled

    return Form(
        problem,
        Coordinates(
            Stated(symbols, integrand, integrand, (x, y, speed, climb)), pull=pull, note=f"x ~ t^{b}, y ~ t^{q}",
            singular=(at_start, not at_start), weak_only=True,
        ),
        Ends((free if at_start else far)[None], (far if at_start else free)[None]),
        Conditions(),
        Start(straight((0.0, 1.0), far, far), problem.unknown_guesses, np.eye(1)),
    )  # fmt: skip


def regular(problem: Problem) -> bool:
    """Whether the momentum is the same at both distances from either end, whatever the slope: no power of x then."""
    ((x0, y0), (x1, y1)), count = (end.tolist() for end in end_points(problem)), len(FEW_SLOPES)
    steps = (x1 - x0) * np.array(PROBE)
    x = np.concatenate([x0 + steps, x1 - steps]).repeat(count)
    y = np.array([y0, y0, y1, y1]).repeat(count)
    momenta = problem.integrand_derivatives(x, y[None], np.tile(FEW_SLOPES, 4)[None]).gradient[:, 2]
    far, near = momenta.reshape(2, 2, count).swapaxes(0, 1)
    with np.errstate(invalid="ignore"):  # infinite ones are not the same
        return bool((np.abs(near - far) <= SAME_MOMENTUM * np.minimum(np.abs(near), np.abs(far))).all())


def powers_at_ends(problem: Problem) -> list[tuple[int, int]]:
    """(b, q) at both ends, the coordinates of which are known: see :func:`_exponent`."""
    start, end = end_points(problem)
    width = end[0] - start[0]
    return [_exponent(problem, start, width), _exponent(problem, end, -width)]


def _exponent(problem: Problem, point: np.ndarray, inward: float) -> tuple[int, int]:
    """(b, q): y grows like the power q / b of the distance from one end; (1, 1) where regular."""
    found = growth(problem, float(point[0]), float(point[0]) + inward)
    return (1, 1) if found is None else whole_powers(found)


def growth(problem: Problem, place: float, toward: float) -> float | None:
    """The power of the distance from a ``place``, on the way ``toward`` another, that y grows with there: L_y' = const.

    None where no power that is a curve's does.
    """
    # the level of the momentum is that of the chord half way: far from it another power may rule
    ends = np.array(end_points(problem))
    trial = float((ends[1, 1] - ends[0, 1]) / (ends[1, 0] - ends[0, 0])) or 1.0
    count = len(ANY_SLOPES)
    steps = (toward - place) * np.array([0.5, *PROBE])
    x = (place + steps).repeat([1, count, count])
    y = np.interp([place + steps[0], place], *ends.T).repeat([1, 2 * count])
    slopes = np.concatenate([[trial], np.tile(math.copysign(1.0, trial) * ANY_SLOPES, 2)])
    momenta = problem.integrand_derivatives(x, y[None], slopes[None]).gradient[:, 2]
    slope = scaling(ANY_SLOPES, list(momenta[1:].reshape(2, -1)), float(momenta[0]))
    return None if slope is None or not math.isfinite(slope) or slope <= -1 else 1.0 + slope


def whole_powers(exponent: float) -> tuple[int, int]:
    """(b, q) with q / b the exponent, where it is a fraction of small numbers; else not above it, and q large."""
    fraction = Fraction(exponent).limit_denominator(2 * LARGEST_DENOMINATOR)
    if abs(exponent - fraction) <= MEASURED and 0 < fraction.numerator <= 2 * LARGEST_DENOMINATOR:
        return fraction.denominator, fraction.numerator
    b = min(math.ceil(SMOOTH / exponent), LARGEST_POWER)
    return b, max(1, math.floor(b * exponent + MEASURED))
