"""varcalc: variational optics and the calculus of variations, solved and verified."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from varcalc.compare import Comparison, compare
from varcalc.conditions import (
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
from varcalc.diagnose import Diagnosis, diagnose
from varcalc.grid import Paired
from varcalc.lagrangian import Lagrangian
from varcalc.methods.direct.ipopt import Ipopt
from varcalc.methods.direct.newton import Newton
from varcalc.methods.ritz import Ritz
from varcalc.problem import Curve, Problem
from varcalc.reference import Exact, Reference
from varcalc.solution import InfeasibleError, Solution, Status, VariationalError, Verdict
from varcalc.solve import solve
from varcalc.sweep import Sweep, SweepPoint, sweep
from varcalc.verify import Finding, Verification, verify
from varcalc.work_precision import Record, WorkPrecision, work_precision

if TYPE_CHECKING:
    from varcalc.methods.collocation import Collocation
    from varcalc.methods.first_integral import FirstIntegral
    from varcalc.methods.scipy_bvp import SciPyBvp
    from varcalc.methods.shooting import Shooting
    from varcalc.reading import euler_lagrange_latex, euler_lagrange_text, first_integrals_text
    from varcalc.search import Branch, Extremals, FoundExtremal, continue_branch, extremals

__all__ = [
    "At",
    "Bound",
    "Branch",
    "Collocation",
    "Comparison",
    "Curve",
    "Diagnosis",
    "Exact",
    "Extremals",
    "Finding",
    "FirstIntegral",
    "Fixed",
    "FoundExtremal",
    "Free",
    "Holonomic",
    "InfeasibleError",
    "Ipopt",
    "Isoperimetric",
    "Lagrangian",
    "Newton",
    "OnCurve",
    "OnSurface",
    "Paired",
    "Parameter",
    "Periodic",
    "Problem",
    "Record",
    "Reference",
    "Ritz",
    "SciPyBvp",
    "Shooting",
    "Solution",
    "Status",
    "Sweep",
    "SweepPoint",
    "Through",
    "VariationalError",
    "Verdict",
    "Verification",
    "WorkPrecision",
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
    "work_precision",
]

_LATER = {
    "Collocation": "varcalc.methods.collocation",
    "FirstIntegral": "varcalc.methods.first_integral",
    "Shooting": "varcalc.methods.shooting",
    "SciPyBvp": "varcalc.methods.scipy_bvp",
    "euler_lagrange_latex": "varcalc.reading",
    "euler_lagrange_text": "varcalc.reading",
    "first_integrals_text": "varcalc.reading",
    "Branch": "varcalc.search",
    "Extremals": "varcalc.search",
    "FoundExtremal": "varcalc.search",
    "continue_branch": "varcalc.search",
    "extremals": "varcalc.search",
}
"""Public names whose modules are imported when one of them is asked for: many solves need none of them."""


def __getattr__(name: str) -> Any:
    """A public name of a module that is not imported with the package."""
    if name in _LATER:
        return getattr(import_module(_LATER[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
