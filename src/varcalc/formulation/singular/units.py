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
from varcalc.problem.problem import Problem


def restated(problem: Problem, unit: float) -> Problem:
    """The same problem of one function, without conditions, in Y = y / ``unit``."""

    def lagrangian(x: Any, y: Any, dy: Any, *rest: Any) -> Any:
        return problem.lagrangian(x, unit * y, unit * dy, *rest)

    return Problem(
        lagrangian, problem.start.in_unit(unit), problem.end.in_unit(unit), parameters=dict(problem.parameters),
        unknowns=problem.unknowns, maximise=problem.maximise, name=problem.name,
    )  # fmt: skip


def in_unit(problem: Problem, unit: float, make: Callable[[], Form | None]) -> Form | None:
    """The form that ``make`` states of the :func:`restated` problem, as a form of the problem itself."""
    form = make()
    if form is None:
        return None
    inner = form.lifted or (form.symbols.x, form.symbols.y, form.symbols.kind(1), form.symbols.dy)
    lifted = inner[0], unit * inner[1], inner[2], unit * inner[3]

    def pull(curve: Sampled) -> Sampled:
        return form.coordinates.pull(lambda x: curve(x) / unit)

    stated = Stated(form.symbols, form.integrand, form.functional, lifted)
    coordinates = replace(form.coordinates, stated=stated, pull=pull, numbers=None)
    return replace(form, problem=problem, coordinates=coordinates, elsewhere=None)
