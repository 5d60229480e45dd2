"""The curve of a method that gives it in the user's coordinates alone, as an extremal of a form."""

from __future__ import annotations

import numpy as np

from varcalc.formulation import Form, Sampled
from varcalc.methods.answer import Extremal
from varcalc.solution import Solution
from varcalc.verify.along_curve import sliding_ends

DISTINCT_NODES = 1e-9
"""Relative distance of two nodes that are one but for round-off."""


def stated(solution: Solution, form: Form) -> Extremal:
    """A solution's curve pulled back to the coordinates of a form."""
    curve, problem = solution.curve, form.problem
    assert curve is not None
    nodes = distinct(solution.x)
    a, b = float(nodes[0]), float(nodes[-1])
    unknowns = form.start.unknowns.copy()
    unknowns[: len(problem.unknowns)] = [solution.unknowns[k] for k in problem.unknowns]
    lambdas = -form.sign * np.array([float(solution.multipliers[c.index]) for c in form.conditions.integrals])
    if form.lift is None:
        return Extremal(form, curve, unknowns, nodes, lambdas, {})
    if not form.coordinates.energetic and not any(form.coordinates.singular):  # ends that slide
        for number, value in zip(sliding_ends(form), (a, b), strict=True):
            if number is not None:
                unknowns[number] = value

        def evaluate(s: np.ndarray, derivative: int) -> np.ndarray:
            return curve(np.clip(a + s * (b - a), a, b), derivative) * (b - a) ** derivative

        return Extremal(form, evaluate, unknowns, (nodes - a) / (b - a), lambdas, {})
    pulled = form.coordinates.pull(ordinates_of(solution))
    return Extremal(form, lambda s, _: pulled(s), unknowns, np.array(form.span), lambdas, {})


def ordinates_of(solution: Solution) -> Sampled:
    """The curve as a function of abscissae (m,), its ordinates (n, m)."""
    curve = solution.curve
    assert curve is not None
    return lambda x: curve(x, 0)


def distinct(nodes: np.ndarray) -> np.ndarray:
    """Ascending nodes without those that all but coincide with a neighbour."""
    nodes = np.unique(nodes)
    kept = np.concatenate([[True], np.diff(nodes) > DISTINCT_NODES * (nodes[-1] - nodes[0])])
    kept[-1] = True
    return nodes[kept]
