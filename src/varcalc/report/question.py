"""What is asked, in formulas: the functional of a problem, the index of a scene, the Lagrangian of a system."""

from __future__ import annotations

from collections.abc import Iterator

import casadi as ca

from varcalc.mechanics.system import System
from varcalc.optics.results.study import Study
from varcalc.problem.functional import Functional
from varcalc.problem.reading import latex
from varcalc.problem.reading.statement import statement
from varcalc.report.words import capital
from varcalc.showing import Fact

LONGEST = 1500
"""Characters of LaTeX beyond which a formula is no help to a reader."""
NO_FORMULA = "given by a table or a function that has no formula"
TOO_LONG = "too long to be read"


def asked_of_problem(problem: Functional) -> Iterator[Fact]:
    """The functional, its ends and conditions, parameters, and the Euler-Lagrange equation."""
    aim = "greatest" if problem.maximise else "least"
    for number, fact in enumerate(statement(problem)):
        label = capital(fact.label) if number else f"To be made {aim}"
        yield Fact(label, fact.text, fact.formula)


def asked_of_scene(study: Study) -> Iterator[Fact]:
    """Fermat's functional, the index of each medium, and the surfaces between them."""
    yield Fact("Stationary", "", r"\int n \, \mathrm{d}s")
    place = ca.SX.sym("r", study.source.dimension)
    axes = ["x", "y", "z"][: study.source.dimension]
    several = len(study.scene.media) > 1
    for number, medium in enumerate(study.scene.media, start=1):
        index = medium.index(place)
        label = f"Index of medium {number}" if several else "Index"
        formula = latex(index, [(place, axes)]) if isinstance(index, ca.SX) else ""
        yield _fact(label, f"n = {formula}" if formula else "")
    for number, surface in enumerate(study.scene.surfaces, start=1):
        yield Fact(f"Surface {number}", f"{surface}")
    yield Fact("Source", f"{study.source}")
    if study.receiver is not None:
        yield Fact("Receiver", f"({', '.join(f'{x:g}' for x in study.receiver)})")


def asked_of_system(system: System) -> Iterator[Fact]:
    """The Lagrangian, its coordinates and parameters, and the equations of motion."""
    yield _fact("Lagrangian", f"L = {system.lagrangian_latex()}")
    named = zip(system.coordinates, system.units or [""] * system.n, strict=True)
    yield Fact("Coordinates", ", ".join(f"{name} ({unit})" if unit else name for name, unit in named))
    if system.parameters:
        yield Fact("Parameters", ", ".join(f"{name} = {value:.9g}" for name, value in system.parameters.items()))
    if system.constraints:
        kinds = ", ".join(type(constraint).__name__ for constraint in system.constraints)
        yield Fact("Constraints", f"{kinds}; their multipliers are λ₁, ...")
    for equation in system.equations_latex().splitlines():
        yield _fact("Equation of motion", equation)
    if system.ignorable:
        yield Fact("Ignorable", ", ".join(system.ignorable))


def _fact(label: str, formula: str) -> Fact:
    """A formula under its label; words where there is none, or one that nobody could read."""
    if not formula:
        return Fact(label, NO_FORMULA)
    return Fact(label, "", formula) if len(formula) <= LONGEST else Fact(label, TOO_LONG)
