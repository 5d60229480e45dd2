"""What tells one problem from another: its statement, and what its functions give at a few places.

Expressions are written in more than one way and functions have no name that lasts, so a problem is known by numbers:
two that agree at every place looked at are one.
"""

from __future__ import annotations

import math
from typing import Any

import casadi as ca
import numpy as np

from varcalc.problem.conditions import OfFunction
from varcalc.problem.functional import Functional

PLACES = 6
"""Places at which functions are evaluated."""
SAME_NUMBER = 1e-9
"""Relative difference of two numbers up to which they are one: releases of CasADi round differently."""


def identity(problem: Functional) -> dict[str, Any]:
    """A problem as plain numbers, words and lists, ready for JSON."""
    s = problem.symbols
    slides = [(label, problem.traced_slide(label, s.x, s.y, s.kind)) for label in ("start", "end")]
    written = [problem.integrand, *(t.expression for t in problem.traced)]
    written += [phi for _, phi in slides if phi is not None]
    numbers = _at_places(ca.Function("written", s.all, written), problem)
    if problem.end_cost_expression is not None:
        given, cost = problem.end_cost_expression
        inputs = [*given, s.parameters, s.unknowns]
        numbers += _at_places(ca.Function("cost", inputs, [cost]), problem)
    return {
        "name": problem.name,
        "kind": type(problem).__name__,
        "order": problem.order,
        "maximise": problem.maximise,
        "ends": [_stated(end) for end in (problem.start, problem.end)],
        "constraints": [_stated(c) for c in problem.constraints],
        "parameters": list(problem.parameters),
        "breakpoints": list(problem.breakpoints),
        "numbers": numbers,
    }


def same(one: Any, other: Any) -> bool:
    """Whether two identities are one, numbers within round-off."""
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(same(one[k], other[k]) for k in one)
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, float) and isinstance(other, float | int):
        return math.isclose(one, other, rel_tol=SAME_NUMBER, abs_tol=SAME_NUMBER * SAME_NUMBER)
    return one == other


def _stated(condition: Any) -> list[Any]:
    """An end or a constraint without its function, whose address is another in every process."""
    skipped = condition.written if isinstance(condition, OfFunction) else ""
    fields = {k: v for k, v in vars(condition).items() if k != skipped and not k.startswith("_")}
    return [type(condition).__name__, {k: _plain(v) for k, v in fields.items()}]


def _plain(value: Any) -> Any:
    if value is None or isinstance(value, bool | str):
        return value
    if isinstance(value, tuple | list | np.ndarray):
        return [_plain(v) for v in value]
    number = float(value)
    return number if math.isfinite(number) else str(number)


def _at_places(function: ca.Function, problem: Functional) -> list[float | None]:
    """The outputs of a function at scattered places, at the parameters' values; None for what is no number."""
    found: list[float | None] = []
    first, last = problem.span
    sizes = [function.size1_in(k) for k in range(function.n_in() - 2)]
    for place in range(1, PLACES + 1):
        # fractions of roots of two: the same in every process, and in no place that a formula favours
        spread = np.modf(place * math.sqrt(2) * (1 + np.arange(sum(sizes))) ** 0.5)[0]
        inputs = np.split(0.2 + 2.0 * spread - 1.2 * (place % 2), np.cumsum(sizes)[:-1])
        if function.name() == "written":
            inputs[0] = first + (last - first) * spread[:1]
        outputs = function.call([*inputs, problem.parameter_values, problem.unknown_guesses])
        found += [
            v if math.isfinite(v) else None for o in outputs for v in np.asarray(o.full(), float).ravel().tolist()
        ]
    return found
