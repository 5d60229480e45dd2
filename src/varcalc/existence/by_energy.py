"""Curves in space that meet what switches: by the energy of a curve at constant speed, a problem in the parameter.

The square of a functional that is homogeneous of degree one in dq has its least curves, each at constant speed (Jost,
"Riemannian Geometry and Geometric Analysis", sect. 1.4), and as functions of the parameter these are graphs, which can
be broken where they meet a kink or a jump.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import casadi as ca

from varcalc.formulation import formulate
from varcalc.methods.crossings import described
from varcalc.numerics.resampled import resampled
from varcalc.problem.breaks import on_curve
from varcalc.problem.conditions import Fixed
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Curve, Problem
from varcalc.solution import ErrorEstimate, Solution
from varcalc.symbolic.tracing import Expression


def by_energy(problem: Functional, solved: Callable[[Problem], Solution]) -> Solution | None:
    """The least curve between two points that meets what switches in its place, by the problem in its parameter.

    None for what is no such problem.
    """
    if not (isinstance(problem, Curve) and _meets_switches(problem)):
        return None
    found = solved(_energy(problem))
    if not found.status.ok or found.curve is None or not found.value > 0.0:
        switch = next(s for s in on_curve(problem) if not s.smooth)
        message = f"the problem has {described(problem, switch)}, and of the curve's energy: {found.message}"
        return replace(found, problem=problem, curve=None, extremal=None, message=message, local=False, lower=None)
    value = math.sqrt(found.value)
    share = 0.5 / value  # of what the energy is off by
    return replace(
        found,
        problem=problem,
        value=value,
        error=ErrorEstimate(share * found.error.value, found.error.curve),
        lower=None if found.lower is None else math.sqrt(max(found.lower, 0.0)),
        curve=resampled(found.curve, found.x, 2),
        sensitivities={name: share * rate for name, rate in found.sensitivities.items()},
    )


def _meets_switches(problem: Curve) -> bool:
    """Whether a curve between two given points may meet a kink or a jump of the place, and has an energy."""
    switches, s = [switch for switch in on_curve(problem) if not switch.smooth], problem.symbols
    of_place = [switch for switch in switches if not switch.depends_on(s.dy)]
    plain = not (problem.constraints or problem.unknowns or problem.end_cost or problem.maximise)
    given = problem.start.fixed and problem.end.fixed
    return bool(of_place) and plain and given and formulate(problem).coordinates.energetic


def _energy(problem: Curve) -> Problem:
    """The problem in the parameter, between 0 and 1."""
    ends = [Fixed(x, end.values(problem.n)) for x, end in zip((0.0, 1.0), (problem.start, problem.end), strict=True)]
    s = problem.symbols

    def energy(_: Expression, q: Expression, dq: Expression, *numbers: Any) -> Expression:
        """The square of the curve's own functional."""
        at = ca.substitute([problem.integrand], [s.y, s.dy], [q, dq])[0]
        if numbers:
            named = [getattr(numbers[0], name) for name in problem.parameters]
            at = ca.substitute([at], [s.parameters], [ca.vertcat(*named)])[0]
        return at**2

    return Problem(energy, *ends, parameters=problem.parameters, name=problem.name)
