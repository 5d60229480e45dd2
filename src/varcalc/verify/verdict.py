"""From what the checks find of one curve to one verdict."""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from varcalc.extensions import offered
from varcalc.methods.answer import of_energy
from varcalc.solution import Finding, Solution, Verdict
from varcalc.verify.candidate import candidate
from varcalc.verify.check import CHECKS_GROUP, Check
from varcalc.verify.convexity import Convexity
from varcalc.verify.corners import Corners
from varcalc.verify.held_by_kinks import HeldByKinks
from varcalc.verify.invariants import FirstIntegrals
from varcalc.verify.legendre import LegendreCondition
from varcalc.verify.morse import JacobiEquation
from varcalc.verify.residual import EulerLagrange
from varcalc.verify.ritz_hessian import RitzHessian
from varcalc.verify.second_variation import SecondVariation
from varcalc.verify.singular_ends import SingularEnds
from varcalc.verify.value import Value
from varcalc.verify.verification import Verification, first_held
from varcalc.verify.weierstrass import WeierstrassCondition

CHECKS = (
    EulerLagrange(), FirstIntegrals(), Corners(), HeldByKinks(), Convexity(), SingularEnds(), LegendreCondition(),
    JacobiEquation(), RitzHessian(), SecondVariation(), WeierstrassCondition(), Value(),
)  # fmt: skip
"""The checks of this package, in the order of their findings. A new one is added here, and nowhere else."""


def verified(solution: Solution) -> Verification:
    """What every check finds of a solution that holds a curve."""
    if (energy := _by_energy(solution)) is not None:
        return _of_curve(verified(energy), solution.problem.name)
    curve, asked = candidate(solution), (*CHECKS, *_offered(tuple(sys.path)))
    with np.errstate(all="ignore"):  # what is no number at a singular end is left out where it arises
        evidence = {check.name: curve.measured(check) for check in asked}
    findings = [finding for check in asked for finding in check.findings(curve)]
    verdict = first_held(findings)
    if verdict is None:
        verdict, sentence = _extreme(solution, curve.measured(Convexity()))
        findings.append(Finding(verdict, sentence))
    jacobi, ritz = curve.measured(JacobiEquation()), curve.measured(RitzHessian())
    return Verification(
        name=solution.problem.name,
        verdict=verdict,
        index=curve.measured(SecondVariation()).index,
        conjugate_points=jacobi.points,
        residual=curve.measured(EulerLagrange()),
        legendre=curve.measured(LegendreCondition()).least,
        weierstrass=curve.measured(WeierstrassCondition()),
        invariants=curve.measured(FirstIntegrals()),
        bound=curve.measured(Value()).value,
        routes={"Jacobi": jacobi.index, "Ritz": ritz.index},
        findings=tuple(findings),
        maximise=solution.problem.maximise,
        abscissa=solution.problem.abscissa.name,
        unit=solution.problem.abscissa.unit,
        evidence=evidence,
    )


def _by_energy(solution: Solution) -> Solution | None:
    """The solution of a curve's energy, where that was found for it; None for others."""
    extremal = solution.extremal
    if extremal is None or not of_energy(solution):
        return None
    error = replace(solution.error, value=2 * abs(solution.value) * solution.error.value)
    return replace(solution, problem=extremal.form.problem, value=solution.value**2, error=error)


def _of_curve(energy: Verification, name: str) -> Verification:
    """What is found of a curve's energy, told of the curve: the bound is that of its functional."""
    bound = math.sqrt(energy.bound)
    told = Finding(
        None, "what is told is that of the square of the functional, which a curve of constant speed makes least"
    )
    value = Finding(
        None, f"the functional is {bound:.15g} on this curve, an upper bound of the minimum", {"bound": bound}
    )
    findings = (value if "bound" in (f.numbers or {}) else f for f in energy.findings)
    return replace(energy, name=name, bound=bound, findings=(told, *findings))


@lru_cache(maxsize=1)
def _offered(_path: tuple[str, ...]) -> tuple[Check[Any], ...]:
    """The checks of other packages, kept for a search path: to look for them takes as long as a solve."""
    return offered(CHECKS_GROUP, Check)


def _extreme(solution: Solution, convex: bool) -> tuple[Verdict, str]:
    """What an extremal is to which no check objects."""
    best, kind = (Verdict.MAXIMUM, "maximum") if solution.problem.maximise else (Verdict.MINIMUM, "minimum")
    if convex and not solution.local:
        return best, f"a {kind} among all curves"
    if not solution.local:
        return best, f"a {kind} among all curves near it, of whatever slope: no nearby curve does better"
    better = solution.lower
    known = "better curves are known further away" if better is None else f"a better value is known, {better:.12g}"
    return best, f"a {kind} among curves near it; {known}"
