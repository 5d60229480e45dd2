"""A power of the abscissa that makes the extremal analytic at an end where L is singular in x.

With x = x0 + t^b and y = y0 + t^q z the unknown z is smooth, and free at that end: b and q are whole numbers that make
so of the powers of the distance that y grows with there (:mod:`varcalc.formulation.singular.indicial`).
"""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np

from varcalc.formulation import Conditions, Coordinates, Ends, Form, Sampled, Start, Stated, rewriter, straight
from varcalc.formulation.singular.departure import Departure
from varcalc.formulation.singular.detection import end_points
from varcalc.formulation.singular.graph import factored_graph
from varcalc.formulation.singular.indicial import SHRINK, powers_at_ends
from varcalc.formulation.singular.offsets import gathered
from varcalc.problem.functional import Symbols
from varcalc.problem.problem import Problem


def abscissa_form(problem: Problem) -> Form | None:
    """The problem in t with x ~ t^b at one end or both; None when the abscissa itself serves."""
    start, end = end_points(problem)
    width = end[0] - start[0]
    exponents = powers_at_ends(problem)
    singular = [not e.plain for e in exponents]
    if not any(singular):
        return None
    if all(singular):
        first, last = (Departure.like(leaves) for leaves in exponents)
        return factored_graph(problem, (first, last))
    at_start = singular[0]
    corner, other, leaves = (start, end, exponents[0]) if at_start else (end, start, exponents[1])
    b, q = leaves.fractional, leaves.ordinate
    inward = width if at_start else -width
    s = problem.symbols
    symbols = replace(Symbols.make(s.kind, 1, 1, 0, len(problem.unknowns)), parameters=s.parameters)
    t, z = symbols.x, symbols.y
    # t runs from 0 or to 0 at the singular end, next to which 1 - t would have no digits
    side, span = (1.0, (0.0, 1.0)) if at_start else (-1.0, (-1.0, 0.0))
    near = side * t
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
            near = np.maximum(side * at, 1e-3)
            return (curve(corner[0] + inward * near**b) - corner[1]) / near**q

        return pulled

    form = Form(
        problem,
        Coordinates(
            Stated(symbols, integrand, integrand, (x, y, speed, climb)), span, pull, note=f"x ~ t^{b:.4g}, y ~ t^{q}",
            singular=(at_start, not at_start), weak_only=True,
        ),
        Ends((free if at_start else far)[None], (far if at_start else free)[None]),
        Conditions(),
        Start(straight(span, far, far), problem.unknown_guesses, np.eye(1)),
    )  # fmt: skip
    return form.on_mesh([side * SHRINK ** (k + 1) for k in range(leaves.layers)])
