"""Rungs of the direct method: one form minimised in one space of piecewise polynomials."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np

from varcalc.formulation import Form, Sampled
from varcalc.methods.answer import Along, Extremal
from varcalc.methods.ritz.ipopt import Ipopt, optimise
from varcalc.methods.ritz.newton import NO_NUMBER, Newton, minimise
from varcalc.methods.ritz.starts import COMPARED, candidates, meeting_levels
from varcalc.methods.ritz.system import Evaluation, RitzSystem
from varcalc.numerics.mesh import Space

DEGREES = {1: (6, 10, 16, 24, 36, 52), 2: (7, 11, 16, 24, 36)}
"""The rungs of the degree, by the order of the Lagrangian."""
NOWHERE = (
    "the Lagrangian is not a number on any of the starting curves tried; "
    "check its domain between the ends, or give guess= a curve on which it is one"
)
NEAR = 12
"""Newton steps that lead to a minimum from one nearby."""
MOST_ITERATIONS = 600
"""Iterations in all after which a solve is given up."""


@dataclass
class Rung:
    """A minimum in one space. ``path`` holds the multipliers of pathwise conditions by their index."""

    system: RitzSystem
    z: np.ndarray
    multipliers: np.ndarray
    value: float
    path: dict[int, Callable[[np.ndarray], np.ndarray]] = field(default_factory=dict)
    levels: dict[int, float] = field(default_factory=dict)
    """Multipliers of integral inequalities by their index."""


@lru_cache(maxsize=64)
def on_one_element(start: float, end: float, degree: int, n: int, smoothness: int = 1) -> Space:
    """The polynomials of a degree, kept for the life of the process with what is numbered in them."""
    return Space(np.array([start, end]), degree, n, smoothness)


class Rungs:
    """Solves one form in one space after another, and counts the iterations."""

    def __init__(self, form: Form, optimiser: Newton | Ipopt | None, starts: int) -> None:
        self.form, self.starts = form, starts
        self.optimiser = optimiser if optimiser is not None else Newton()
        # Newton's iteration knows no inequalities and no pathwise conditions
        self.constrained = form.has_inequalities
        if self.constrained and isinstance(self.optimiser, Newton):
            self.optimiser = Ipopt()
        self.inequalities = any(not c.equality for c in (*form.pathwise, *form.integrals))
        self.iterations = 0

    def first_space(self, elements: int, degree: int | None) -> Space:
        """The first mesh: equal elements and the form's knots."""
        (a, b), vertices = self.form.span, np.array(self.form.span)
        if elements > 1 or self.form.knots:
            vertices = np.unique(np.concatenate([np.linspace(a, b, elements + 1), self.form.knots]))
            close = np.diff(vertices) < 1e-12 * (b - a)
            vertices = vertices[np.concatenate([[True], ~close])]
        lowest = 2 * self.form.order - 1
        least = max(self.form.least_degree, lowest)
        first = min(d for d in DEGREES[self.form.order] if d >= least) if degree is None else max(degree, lowest)
        return self.space(vertices, first)

    def space(self, vertices: np.ndarray, degree: int) -> Space:
        """The form's functions on a mesh."""
        if len(vertices) == 2 and not self.form.periodic:
            return on_one_element(*vertices.tolist(), degree, self.form.n, self.form.order)
        return Space(vertices, degree, self.form.n, self.form.order, self.form.periodic)

    def richer(self, degree: int) -> int:
        """The degree of the next rung: two more at least, as symmetry may leave nothing to gain by one more."""
        if self.inequalities:
            return degree + 4
        above = [d for d in DEGREES[self.form.order] if d > degree + 1]
        return above[0] if above else degree + max(4, degree // 3)

    def system(self, space: Space) -> RitzSystem:
        """The form discretised on a space."""
        return RitzSystem(self.form, space)

    def prolonged(self, system: RitzSystem, z: np.ndarray) -> tuple[RitzSystem, np.ndarray]:
        """The next richer space on the same mesh, and the curve of ``z`` in it."""
        space = system.space
        richer = self.space(space.vertices, self.richer(space.degree))
        coefficients = space.prolonged(system.coefficients(z), richer)
        following = self.system(richer)
        return following, following.pack(coefficients, system.unknowns(z))

    def optimise(self, system: RitzSystem, z: np.ndarray, multipliers: np.ndarray) -> Rung | str:
        """A minimum near ``z``, or why there is none."""
        if self.iterations > MOST_ITERATIONS:
            return f"{self.iterations} iterations led to no minimum"
        path: dict[Any, Any] = {}
        if isinstance(self.optimiser, Ipopt):
            outcome, path = optimise(system, z, multipliers, self.optimiser)
        else:
            outcome = minimise(system, z, multipliers, self.optimiser)
        self.iterations += outcome.iterations
        if outcome.reason:
            return outcome.reason
        along = {k: v for k, v in path.items() if isinstance(k, int)}
        levels = {k[1]: v for k, v in path.items() if isinstance(k, tuple)}
        return Rung(system, outcome.z, outcome.multipliers, outcome.value, along, levels)

    def near(self, system: RitzSystem, z: np.ndarray) -> Rung | None:
        """The minimum that whole Newton steps from ``z`` lead to; None where they lead to none."""
        outcome = minimise(system, z, np.zeros(0), Newton(NEAR))
        if outcome.reason or not outcome.direct:
            return None
        self.iterations += outcome.iterations
        return Rung(system, outcome.z, outcome.multipliers, outcome.value)

    def start(self, space: Space, guess: Sampled | None) -> Rung | str:
        """The lowest of the minima in ``space`` that the first starting curves lead to."""
        system = self.system(space)
        conditions = len(system.levels) + (0 if self.form.ends is None else int(self.form.ends.equations.numel()))
        best: Rung | None = None
        reasons: list[str] = []
        # a level is met by bending either way: both are tried, and the lower one taken
        bent, wanted = meeting_levels(system) if system.levels.size else ([], 1)
        wanted += guess is not None and wanted < COMPARED and len(bent) > 0
        found = 0
        for tried, z in enumerate(candidates(system, guess, bent), start=1):
            rung = self.optimise(system, z, np.zeros(conditions))
            if isinstance(rung, str):
                reasons.append(rung)
            else:
                found += 1
                best = rung if best is None or rung.value < best.value else best
            if found >= wanted or tried >= self.starts:
                break
        if best is not None:
            return best
        if all(reason == NO_NUMBER for reason in reasons):
            return NOWHERE
        return f"no starting curve led to a minimum: {max(set(reasons), key=reasons.count)}"

    def improve(
        self, system: RitzSystem, step: np.ndarray, fallback: np.ndarray, before: Evaluation, multipliers: np.ndarray
    ) -> Rung | str:
        """A minimum a ``step`` from ``fallback``, or near that itself when this fails or leads above it.

        ``before`` is the evaluation there; what is higher counts in an unconstrained problem only.
        """
        outcome = self.optimise(system, fallback + step, multipliers)
        if not step.any():
            return outcome
        higher = (
            not isinstance(outcome, str)
            and not len(before.conditions)
            and outcome.value > before.value + 1e-9 * before.scale
        )
        return self.optimise(system, fallback, multipliers) if isinstance(outcome, str) or higher else outcome

    # the curve of a rung

    def extremal(self, system: RitzSystem, z: np.ndarray) -> Extremal:
        """The curve of ``z`` without multipliers."""
        space, coefficients = system.space, system.coefficients(z)
        return Extremal(
            form=self.form,
            evaluate=space.curve(coefficients),
            unknowns=system.unknowns(z).copy(),
            vertices=space.vertices,
            lambdas=np.zeros(len(self.form.integrals)),
            path={},
            coefficients=coefficients if space.elements == 1 else None,
        )

    def extremal_of(self, rung: Rung, speed: np.ndarray, along: Along | None) -> Extremal:
        """The curve of a rung with its multipliers; those of an energy J^2 become those of J by the chain rule.

        ``speed`` is dx/ds at some points, ``along`` what was evaluated along the curve.
        """
        bare = self.extremal(rung.system, rung.z)
        equalities = iter(rung.multipliers[: len(rung.system.levels)])
        lambdas = [next(equalities) if c.equality else rung.levels.get(c.index, 0.0) for c in self.form.integrals]
        factor = 0.5 / math.sqrt(rung.value) if self.form.energetic and rung.value > 0 else 1.0
        path = {k: lambda s, mu=mu: factor * mu(s) for k, mu in rung.path.items()}
        return replace(
            bare, lambdas=np.array(lambdas), path=path, speed=speed if self.form.energetic else None, along=along
        )
