"""A power of the abscissa that makes the extremal analytic at an end where L is singular in x.

With x = x0 + t^b and y = y0 + t^q z the unknown z is smooth, and free at that end: b and q are whole numbers that make
so of the powers of the distance that y grows with there (:mod:`varcalc.formulation.singular.indicial`).
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from varcalc.formulation import (
    Conditions,
    Coordinates,
    Ends,
    Form,
    Sampled,
    Start,
    Stated,
    extended,
    rewriter,
    straight,
)
from varcalc.formulation.singular.departure import Departure
from varcalc.formulation.singular.detection import end_points
from varcalc.formulation.singular.graph import factored_graph
from varcalc.formulation.singular.indicial import SHRINK, Growth, powers_at_a_free_end, powers_at_ends
from varcalc.formulation.singular.offsets import gathered
from varcalc.problem.problem import Problem


def abscissa_form(problem: Problem) -> Form | None:
    """The problem in t with x ~ t^b at one end or both; None when the abscissa itself serves."""
    start, end = end_points(problem)
    exponents = powers_at_ends(problem)
    singular = [not e.plain for e in exponents]
    if not any(singular):
        return None
    if all(singular):
        first, last = (Departure.like(leaves) for leaves in exponents)
        return factored_graph(problem, (first, last))
    at_start = singular[0]
    corner, leaves = (start, exponents[0]) if at_start else (end, exponents[1])
    return _beside(problem, at_start, leaves, float(corner[1]))


def free_end_form(problem: Problem) -> Form | None:
    """The problem in t with x ~ t^b at its one free end; None when the abscissa itself serves."""
    at_start = not problem.start.fixed
    leaves = powers_at_a_free_end(problem, at_start)
    return None if leaves is None or leaves.growth.plain else _beside(problem, at_start, leaves.growth, leaves.ordinate)


def _beside(problem: Problem, at_start: bool, leaves: Growth, ordinate: float | None) -> Form:
    """The problem in t with x ~ t^b at one end, of ``ordinate``; where that is None it is one more unknown number."""
    other = end_points(problem)[1 if at_start else 0]
    inward = float(problem.span[1] - problem.span[0]) * (1.0 if at_start else -1.0)
    here, b, q = problem.span[0 if at_start else 1], leaves.fractional, leaves.ordinate
    unknown = ordinate is None
    symbols = extended(problem, 1, int(unknown))
    t, z = symbols.x, symbols.y
    # t runs from 0 or to 0 at the singular end, next to which 1 - t would have no digits
    side, span = (1.0, (0.0, 1.0)) if at_start else (-1.0, (-1.0, 0.0))
    near = side * t
    step = inward * near**b
    x = step if here == 0.0 else here + step
    base = symbols.unknowns[-1] if unknown else ordinate
    rise = z - base if unknown else z
    y = base + near**q * rise
    speed = abs(inward) * b * near ** (b - 1)
    climb = ca.gradient(near**q, t) * rise + near**q * symbols.dy
    integrand = problem.sign * rewriter(problem, symbols, x, y, [climb / speed], speed)(problem.integrand, True)
    integrand = gathered(integrand, symbols)
    far = other[1:] if unknown else other[1:] - ordinate
    free = np.array([np.nan])
    guess = np.array([*problem.unknown_guesses, *(other[1:] if unknown else ())])

    def pull(curve: Sampled) -> Sampled:
        """A curve y(x) in the coordinates of the form."""

        def pulled(at: np.ndarray) -> np.ndarray:
            """The ordinate at places t of the form, in its unit there."""
            near = np.maximum(side * at, 1e-3)
            from_end = other[1] if ordinate is None else ordinate
            return (curve(here + inward * near**b) - from_end) / near**q + (from_end if unknown else 0.0)

        return pulled

    form = Form(
        problem,
        Coordinates(
            Stated(symbols, integrand, integrand, (x, y, speed, climb)), span, pull, note=f"x ~ t^{b:.4g}, y ~ t^{q}",
            singular=(at_start, not at_start), weak_only=True,
        ),
        Ends((free if at_start else far)[None], (far if at_start else free)[None]),
        Conditions(),
        Start(straight(span, far, far), guess, np.eye(1)),
    )  # fmt: skip
    return form.on_mesh([side * SHRINK ** (k + 1) for k in range(leaves.layers)])
