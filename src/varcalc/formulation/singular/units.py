"""A graph whose ordinate is measured in another unit than its abscissa, stated in the one that is natural to it.

Distances and directions in the plane, by which singular ends are found and their
coordinates are chosen, mean nothing where y is in other units than x. A metric
tells what one unit of y is worth.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from varcalc.formulation import Form, Sampled, Stated
from varcalc.problem.conditions import Fixed, OnCurve, components
from varcalc.problem.problem import Problem


def restated(problem: Problem, unit: float) -> Problem:
    """The same problem of one function, without conditions, in Y = y / ``unit``."""

    def lagrangian(x: Any, y: Any, dy: Any, *rest: Any) -> Any:
        return problem.lagrangian(x, unit * y, unit * dy, *rest)

    return Problem(
        lagrangian, _end(problem.start, unit), _end(problem.end, unit), parameters=dict(problem.parameters),
        unknowns=problem.unknowns, maximise=problem.maximise, name=problem.name,
    )  # fmt: skip


def _end(end: Any, unit: float) -> Any:
    if isinstance(end, Fixed):
        known, slope = (components(name, v)[0] if v is not None else None for name, v in (("y", end.y), ("dy", end.dy)))
        return Fixed(end.x, None if known is None else known / unit, None if slope is None else slope / unit)
    if isinstance(end, OnCurve):
        return replace(end, phi=lambda x, y, *rest: end.phi(x, unit * y, *rest))
    return end


def in_unit(problem: Problem, unit: float, make: Callable[[], Form | None]) -> Form | None:
    """The form that ``make`` states of the :func:`restated` problem, as a form of the problem itself."""
    form = make()
    if form is None:
        return None
    inner = form.lifted or (form.symbols.x, form.symbols.y, form.symbols.kind(1), form.symbols.dy)
    lifted = inner[0], unit * inner[1], inner[2], unit * inner[3]

    def pull(curve: Sampled) -> Sampled:
        return form.pull(lambda x: curve(x) / unit)

    stated = Stated(form.symbols, form.integrand, form.functional, lifted)
    return replace(form, problem=problem, stated=stated, pull=pull, numbers=None, elsewhere=None)
