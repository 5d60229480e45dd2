"""varcalc: variational optics and the calculus of variations, solved and verified."""

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
    Periodic,
    Through,
)
from varcalc.diagnose import Diagnosis, diagnose
from varcalc.lagrangian import Lagrangian
from varcalc.methods.collocation import Collocation
from varcalc.methods.direct.ipopt import Ipopt
from varcalc.methods.direct.newton import Newton
from varcalc.methods.first_integral import FirstIntegral
from varcalc.methods.ritz import Ritz
from varcalc.methods.scipy_bvp import SciPyBvp
from varcalc.methods.shooting import Shooting
from varcalc.problem import Curve, Problem
from varcalc.reading import euler_lagrange_latex, euler_lagrange_text, first_integrals_text
from varcalc.reference import Exact, Reference
from varcalc.search import Branch, Extremals, FoundExtremal, continue_branch, extremals
from varcalc.solution import InfeasibleError, Solution, Status, VariationalError, Verdict
from varcalc.solve import solve
from varcalc.verify import Finding, Verification, verify

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
    "Periodic",
    "Problem",
    "Reference",
    "Ritz",
    "SciPyBvp",
    "Shooting",
    "Solution",
    "Status",
    "Through",
    "VariationalError",
    "Verdict",
    "Verification",
    "compare",
    "continue_branch",
    "diagnose",
    "euler_lagrange_latex",
    "euler_lagrange_text",
    "extremals",
    "first_integrals_text",
    "solve",
    "verify",
]
