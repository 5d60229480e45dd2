"""A statement with its exact curve and its scales: what a proof begins with."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from varcalc.certificates.balls import Ball, flint
from varcalc.certificates.closer import stationary
from varcalc.certificates.curve import (
    Piece,
    Samples,
    at_crossings,
    edges_of,
    joint_states,
    pieces,
    sampled,
    sampled_on,
    state_sizes,
)
from varcalc.certificates.ends import tied
from varcalc.certificates.integrals import Along, Unproved, along_curve, check_enclosed
from varcalc.certificates.statement import Statement, statement
from varcalc.formulation.graph import graph_form
from varcalc.methods.answer import Extremal
from varcalc.problem.problem import Problem
from varcalc.solution import Solution
from varcalc.verify.along_curve import AlongCurve, in_form
from varcalc.verify.given_curve import distinct

VALUE_TOLERANCE = 1e-21
"""Share of the value that the remainders of its integral may come to."""


@dataclass(frozen=True)
class Setting:
    """The statement with its curve and its scales."""

    statement: Statement
    samples: Sequence[Samples]
    joints: np.ndarray
    pieces: Sequence[Piece]
    sizes: tuple[np.ndarray, np.ndarray]
    along: Along
    tolerance: float
    """What the remainders of the value's integral may come to."""

    @property
    def length(self) -> Ball:
        """Length of the interval."""
        return flint().arb(self.samples[-1].end) - flint().arb(self.samples[0].start)

    @property
    def scaled(self) -> list[np.ndarray]:
        """The second derivatives of H at the nodes of each piece, in units of states and controls."""
        scale = np.concatenate(self.sizes)
        return [s.hessian * scale[:, None] * scale for s in self.samples]


def setting_along(along: AlongCurve, value: float, beside: Any = 0, *, as_found: bool = False) -> Setting:
    """The statement of a curve whose value is about ``value``; Unproved where the Lagrangian is not enclosed on it.

    ``beside`` is an expression that is added to the Lagrangian. The curve is brought to the extremal it is near, unless
    it is to be taken ``as_found``.
    """
    stated = statement(along, beside)
    check_enclosed(stated.function, "the Lagrangian")
    samples = sampled(stated)
    if not as_found:
        stated, samples = stationary(stated, samples)
        samples = at_crossings(stated, samples)
    return setting_of(stated, samples, value)


def setting_of(stated: Statement, samples: list[Samples], value: float) -> Setting:
    """The setting of a statement's curve, sampled; Unproved where the Lagrangian is not enclosed on it."""
    if not all(np.isfinite(s.hessian).all() and np.isfinite(s.momenta).all() for s in samples):
        raise Unproved("the Lagrangian or its derivatives are no numbers on the curve")
    stated = tied(stated, samples)
    joints = joint_states(stated, samples)
    exact = pieces(stated, samples, joints)
    states = state_sizes(samples, stated)
    length = samples[-1].end - samples[0].start
    controls = states[(stated.order - 1) * stated.n : stated.order * stated.n] / 2.0 ** round(math.log2(length))
    sizes = states, controls
    tolerance = VALUE_TOLERANCE * (abs(value) or 1.0)
    return Setting(stated, samples, joints, exact, sizes, along_curve(stated, exact, sizes, tolerance), tolerance)


def as_graph(solution: Solution) -> AlongCurve | None:
    """The curve of a graph in the user's own coordinates, whichever it was solved in.

    None where its ends slide, where numbers are optimised with it, or where its multipliers are lost.
    """
    problem = solution.problem
    if not isinstance(problem, Problem) or any(problem.slides) or problem.unknowns or solution.curve is None:
        return None
    form = graph_form(problem)
    levels = form.conditions.integrals
    if levels and len(solution.multipliers) != len(problem.constraints):
        return None
    lambdas = np.array([-form.sign * solution.multipliers[c.index] for c in levels])
    return in_form(Extremal(form, solution.curve, np.zeros(0), distinct(solution.x), lambdas, {}))


def on_halves(setting: Setting, rough: Sequence[int]) -> Setting:
    """The same with some pieces halved."""
    stated = setting.statement
    edges = edges_of(setting.samples)
    samples = sampled_on(stated, sorted([*edges, *(0.5 * (edges[k] + edges[k + 1]) for k in rough)]))
    joints = joint_states(stated, samples)
    exact = pieces(stated, samples, joints)
    along = along_curve(stated, exact, setting.sizes, setting.tolerance)
    return replace(setting, samples=samples, joints=joints, pieces=exact, along=along)
