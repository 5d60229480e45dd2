"""Curves in space that meet what switches: by the energy of a curve at constant speed, a problem in the parameter.

The square of a functional that is homogeneous of degree one in dq has its least curves, each at constant speed (Jost,
"Riemannian Geometry and Geometric Analysis", sect. 1.4), and as functions of the parameter these are graphs, which can
be broken where they meet a kink or a jump.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Protocol

import casadi as ca
import numpy as np

from varcalc.formulation import Sampled, formulate
from varcalc.methods.crossings import described, met_by
from varcalc.numerics.resampled import resampled
from varcalc.problem.breaks import on_curve
from varcalc.problem.conditions import Fixed
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Curve, Problem
from varcalc.solution import ErrorEstimate, Solution, local_only
from varcalc.symbolic.tracing import Expression

AS_LOW, SPEED_PLACES = 1e-9, 2001
"""Relative difference of two values that is one, and places by which the speed along a graph is told."""


class Solved(Protocol):
    """The answer of a problem, begun from a guess where one is given."""

    def __call__(self, given: Problem, start: Sampled | None = None) -> Solution:
        """A Solution, with a status that says why when there is none."""
        ...


def by_energy(problem: Functional, solved: Solved, *, guided: bool) -> Solution | None:
    """The least curve between two points that meets what switches in its place, by the problem in its parameter.

    None for what is no such problem, and where its curve meets nothing. Of two functions few valleys are looked at: in
    the plane the graph over the chord, of which many are, may show a lower one. Who is ``guided`` asks for the curve
    near a guess.
    """
    if not (isinstance(problem, Curve) and _meets_switches(problem)):
        return None
    found = solved(_energy(problem))
    if found.status.ok and all(c.switch.smooth for c in met_by(found)):
        return None  # it is smooth, and has coordinates of its own
    chord = np.subtract(problem.end.values(problem.n), problem.start.values(problem.n))
    graph = solved(_over_chord(problem, chord)) if problem.n == 2 and chord.any() and not guided else None
    if graph is None or not graph.status.ok:
        return _of_curve(problem, found)
    if not _as_low(found, graph):
        again = solved(_energy(problem), _at_constant_speed(problem, graph, chord))
        found = again if again.status.ok and not (found.status.ok and again.value > found.value) else found
    answer = _of_curve(problem, found)
    if not answer.status.ok or (_as_low(found, graph) and not graph.local):
        return answer
    lower = graph.lower if _as_low(found, graph) else graph.value
    if graph.local:
        return replace(answer, local=True, lower=lower, message=graph.message)
    return local_only(answer, f"a graph over the chord has the value {graph.value:.12g}", lower)


def _as_low(found: Solution, graph: Solution) -> bool:
    """Whether a curve is as low as a graph, by its energy."""
    if not found.status.ok or not found.value > 0.0:
        return False
    value = math.sqrt(found.value)
    return value <= graph.value + graph.error.value + 0.5 * found.error.value / value + AS_LOW * value


def _of_curve(problem: Curve, found: Solution) -> Solution:
    """What was found of a curve's energy, told of the curve."""
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
    first, last = (Fixed(x, end.values(problem.n)) for x, end in ((0.0, problem.start), (1.0, problem.end)))

    def energy(_: Expression, q: Expression, dq: Expression, *numbers: Any) -> Expression:
        """The square of the curve's own functional."""
        return _functional(problem, q, dq, numbers) ** 2

    return Problem(energy, first, last, parameters=problem.parameters, name=problem.name)


def _over_chord(problem: Curve, chord: np.ndarray) -> Problem:
    """The graphs over the chord of a plane problem."""
    start, (along, across), length = problem.start.values(2), _axes(chord), float(np.linalg.norm(chord))

    def graph(x: Expression, y: Expression, v: Expression, *numbers: Any) -> Expression:
        """The functional of the curve that a graph is."""
        place = ca.vertcat(*(start[k] + x * along[k] + y * across[k] for k in (0, 1)))
        return _functional(problem, place, ca.vertcat(*(along[k] + v * across[k] for k in (0, 1))), numbers)

    return Problem(graph, Fixed(0.0, 0.0), Fixed(length, 0.0), parameters=problem.parameters, name=problem.name)


def _axes(chord: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors along the chord and across it."""
    along = chord / np.linalg.norm(chord)
    return along, np.array([-along[1], along[0]])


def _functional(problem: Curve, q: Expression, dq: Expression, numbers: Sequence[Any]) -> Expression:
    """F of a curve at other symbols, and those of the parameters where there are any."""
    s = problem.symbols
    at = ca.substitute([problem.integrand], [s.y, s.dy], [q, dq])[0]
    named = [getattr(numbers[0], name) for name in problem.parameters] if numbers else []
    return ca.substitute([at], [s.parameters], [ca.vertcat(*named)])[0] if named else at


def _at_constant_speed(problem: Curve, graph: Solution, chord: np.ndarray) -> Sampled:
    """The curve of a graph over the chord, as a function of how much of the functional it has gone through."""
    curve, (along, across) = graph.curve, _axes(chord)
    assert curve is not None
    x = np.union1d(np.linspace(graph.x[0], graph.x[-1], SPEED_PLACES), graph.x)
    places = problem.start.values(2)[:, None] + np.outer(along, x) + np.outer(across, curve(x, 0)[0])
    middles, steps = 0.5 * (places[:, 1:] + places[:, :-1]), np.diff(places)
    gone = np.append(0.0, np.cumsum(np.abs(problem.integrand_values(middles, steps))))
    return lambda t: np.array([np.interp(t * gone[-1], gone, row) for row in places])
