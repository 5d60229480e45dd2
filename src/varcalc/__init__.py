"""varcalc: variational optics and the calculus of variations, solved and verified."""

import sys

# ``python -m varcalc`` reads this before varcalc.__main__: the word before the arguments tells it from any other start
if sys.argv[:1] == ["-m"] and sys.orig_argv[-len(sys.argv)] in {"varcalc", "-mvarcalc"}:
    import varcalc_command

    varcalc_command.hear()

from importlib import import_module
from typing import TYPE_CHECKING, Any

from varcalc.methods.ritz.ipopt import Ipopt
from varcalc.methods.ritz.method import Ritz
from varcalc.methods.ritz.newton import Newton
from varcalc.problem.conditions import (
    At,
    Bound,
    Fixed,
    Free,
    Holonomic,
    Isoperimetric,
    OnCurve,
    OnSurface,
    Parameter,
    Periodic,
    Through,
)
from varcalc.problem.lagrangian import Lagrangian
from varcalc.problem.problem import Curve, Problem
from varcalc.progress import Interrupted
from varcalc.solution import InfeasibleError, Solution, Status, VariationalError, Verdict
from varcalc.solve.diagnose import Diagnosis, diagnose
from varcalc.solve.grid import Paired
from varcalc.solve.ladder import solve
from varcalc.solve.point import Measured, SweepPoint
from varcalc.solve.sweep import Sweep, sweep
from varcalc.spelling import NoAttribute
from varcalc.study.compare import Comparison, compare
from varcalc.study.records import Record, WorkPrecision
from varcalc.study.reference import Exact, Reference
from varcalc.study.work_precision import work_precision
from varcalc.verify import Finding, Verification, verify

if TYPE_CHECKING:
    from varcalc import mechanics as mechanics
    from varcalc import optics as optics
    from varcalc import problems as problems
    from varcalc.certificates import Certificate, Eigenvalue, certify, certify_eigenvalues
    from varcalc.methods.collocation.method import Collocation
    from varcalc.methods.collocation.scipy_bvp import SciPyBvp
    from varcalc.methods.first_integral.method import FirstIntegral
    from varcalc.methods.shooting.method import Shooting
    from varcalc.problem.reading import euler_lagrange_latex, euler_lagrange_text, first_integrals_text
    from varcalc.search import Branch, Extremals, FoundExtremal, continue_branch, extremals
    from varcalc.study.plain import PlainProblem
    from varcalc.study.verify_solver import SolverAnswer, SolverReport, verify_solver

__all__ = [
    "At",
    "Bound",
    "Branch",
    "Certificate",
    "Collocation",
    "Comparison",
    "Curve",
    "Diagnosis",
    "Eigenvalue",
    "Exact",
    "Extremals",
    "Finding",
    "FirstIntegral",
    "Fixed",
    "FoundExtremal",
    "Free",
    "Holonomic",
    "InfeasibleError",
    "Interrupted",
    "Ipopt",
    "Isoperimetric",
    "Lagrangian",
    "Measured",
    "Newton",
    "OnCurve",
    "OnSurface",
    "Paired",
    "Parameter",
    "Periodic",
    "PlainProblem",
    "Problem",
    "Record",
    "Reference",
    "Ritz",
    "SciPyBvp",
    "Shooting",
    "Solution",
    "SolverAnswer",
    "SolverReport",
    "Status",
    "Sweep",
    "SweepPoint",
    "Through",
    "VariationalError",
    "Verdict",
    "Verification",
    "WorkPrecision",
    "certify",
    "certify_eigenvalues",
    "compare",
    "continue_branch",
    "diagnose",
    "euler_lagrange_latex",
    "euler_lagrange_text",
    "extremals",
    "first_integrals_text",
    "solve",
    "sweep",
    "verify",
    "verify_solver",
    "work_precision",
]

_LATER = {
    "Collocation": "varcalc.methods.collocation.method",
    "FirstIntegral": "varcalc.methods.first_integral.method",
    "Shooting": "varcalc.methods.shooting.method",
    "SciPyBvp": "varcalc.methods.collocation.scipy_bvp",
    "euler_lagrange_latex": "varcalc.problem.reading",
    "euler_lagrange_text": "varcalc.problem.reading",
    "first_integrals_text": "varcalc.problem.reading",
    "Branch": "varcalc.search",
    "Certificate": "varcalc.certificates",
    "certify": "varcalc.certificates",
    "Eigenvalue": "varcalc.certificates",
    "certify_eigenvalues": "varcalc.certificates",
    "Extremals": "varcalc.search",
    "FoundExtremal": "varcalc.search",
    "continue_branch": "varcalc.search",
    "extremals": "varcalc.search",
    "PlainProblem": "varcalc.study.plain",
    "SolverAnswer": "varcalc.study.verify_solver",
    "SolverReport": "varcalc.study.verify_solver",
    "verify_solver": "varcalc.study.verify_solver",
}
"""Public names whose modules are imported when one of them is asked for: many solves need none of them."""


_PACKAGES = ("mechanics", "optics", "problems")
"""Packages that need no import of their own: ``vc.optics`` is one."""

__version__: str


def __getattr__(name: str) -> Any:
    """A public name of a module that is not imported with the package."""
    if name in _LATER:
        return getattr(import_module(_LATER[name]), name)
    if name in _PACKAGES:
        return import_module(f"{__name__}.{name}")
    if name == "__version__":
        from importlib.metadata import version

        return version(__name__)
    raise NoAttribute(__name__, name, [*__all__, "optics", "mechanics"])


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, *_PACKAGES, "__version__"})
