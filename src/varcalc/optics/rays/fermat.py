"""One ray as a curve of Fermat's functional, and the proof that its optical path is least near it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np

from varcalc.certificates import Certificate, certify
from varcalc.methods.collocation.method import Collocation
from varcalc.optics.media.medium import Medium
from varcalc.optics.rays.leg import Leg
from varcalc.optics.surfaces import Surface
from varcalc.optics.validation import point
from varcalc.problem.conditions import At
from varcalc.problem.problem import Curve
from varcalc.solution import Status, VariationalError
from varcalc.solve.ladder import solve

SAME_PATH = 1e-6
"""Relative difference of the optical paths of a ray and of the extremal that it is polished to."""


def fermat(medium: Medium, start: Sequence[float], end: Sequence[float]) -> Curve:
    """The optical path between two points as a functional of curves."""

    def path(q: Any, dq: Any, *names: Any) -> Any:
        parameters = {name: getattr(p, name) for p in names for name in medium.parameters}
        return stated_index(medium, q, parameters) * ca.sqrt(ca.sumsqr(dq))

    parameters = dict(medium.parameters)
    return Curve(path, At(tuple(start)), At(tuple(end)), name="optical_path", parameters=parameters)


def stated_index(medium: Medium, position: Any, parameters: Mapping[str, Any]) -> Any:
    """The index as it is stated: ``parameters`` are symbols, so that no arithmetic among numbers is rounded."""
    if by_its_own(medium, "index", "parametric_index"):
        return medium.index(position)
    return medium.parametric_index(position, parameters)


def by_its_own(part: Medium | Surface, plain: str, stated: str) -> bool:
    """Whether a class has a method ``plain`` of its own, which what it inherits as ``stated`` knows nothing of."""
    order = type(part).__mro__
    own, inherited = (next(c for c in order if name in vars(c)) for name in (plain, stated))
    return not issubclass(inherited, own)


def certified_path(medium: Medium, leg: Leg, end: Sequence[float] | None) -> Certificate:
    """The certificate of a ray that is one leg, between its first point and ``end``, by default its last."""
    _, beam = leg.sampled()
    path = float(beam.optical_path[-1] - beam.optical_path[0])
    shares = (beam.optical_path - beam.optical_path[0]) / path

    def guess(t: Any) -> np.ndarray:
        return np.array([np.interp(t, shares, column) for column in beam.position.T])

    last = beam.position[-1].tolist() if end is None else point("end", end)
    problem = fermat(medium, beam.position[0].tolist(), last)
    solution = solve(problem, Collocation(), guess=guess)
    if not abs(solution.value - path) <= SAME_PATH * path:
        reason = f"no certificate: near the ray a path of {solution.value:.9g} was found, its own is {path:.9g}"
        raise VariationalError(replace(solution, status=Status.REFUSED, message=reason))
    return certify(solution)
