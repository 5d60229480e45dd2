"""From the evidence to one verdict, and the sentences behind it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from varcalc.problem.conditions import Isoperimetric
from varcalc.problem.functional import Functional
from varcalc.solution import Solution, Verdict
from varcalc.verify.corners import Corner
from varcalc.verify.legendre import Legendre
from varcalc.verify.morse import JacobiIndex
from varcalc.verify.verification import Excess, Finding, Index
from varcalc.verify.weierstrass import NOISE

STATIONARY = 1e-3
"""Residual of the Euler-Lagrange equation beyond which a curve that cannot be polished is no extremal."""
UNBROKEN = 1e-4
"""Relative jump of momentum or energy across a corner that is the error of the curve."""
MISSED = 1e-6
"""Relative distance from a prescribed integral's level that is worth a word."""
ORDER = list(Verdict)


@dataclass(frozen=True)
class Evidence:
    """What every check has found of one solution."""

    solution: Solution
    residual: float
    legendre: Legendre
    excess: Excess
    jacobi: JacobiIndex
    ritz: Index
    points: np.ndarray
    corners: list[Corner]
    invariants: Mapping[str, float]
    bound: float
    misses: Mapping[int, float]
    unpolished: str
    touched: bool

    @property
    def problem(self) -> Functional:
        """The problem the solution is of."""
        return self.solution.problem

    @property
    def index(self) -> float:
        """The Morse index: infinite when Legendre's condition fails, NaN where no route tells."""
        if not self.legendre.holds:
            return math.inf
        found = [route.index for route in (self.jacobi, self.ritz) if route.index is not None]
        return found[0] if found else math.nan

    @property
    def nullity(self) -> int:
        """Directions in which the second variation vanishes, by the first route that tells."""
        return self.jacobi.nullity if self.jacobi.index is not None else self.ritz.nullity


def judged(evidence: Evidence) -> tuple[Verdict, tuple[Finding, ...]]:
    """The first verdict of all that hold, and every finding."""
    findings = [
        *_stationary(evidence), *_corners(evidence), *_legendre(evidence), *_second_variation(evidence),
        *_weierstrass(evidence), *_value(evidence),
    ]  # fmt: skip
    held = [f.verdict for f in findings if f.verdict is not None]
    best = Verdict.MAXIMUM if evidence.problem.maximise else Verdict.MINIMUM
    verdict = min(held, key=ORDER.index) if held else best
    if not held:
        findings.append(_extreme(evidence, best))
    return verdict, tuple(findings)


def _extreme(e: Evidence, best: Verdict) -> Finding:
    kind = "maximum" if best is Verdict.MAXIMUM else "minimum"
    if e.solution.local:
        better = e.solution.lower
        known = "better curves are known further away" if better is None else f"a better value is known, {better:.12g}"
        return Finding(best, f"a {kind} among curves near it; {known}")
    return Finding(best, f"a {kind} among all curves near it, of whatever slope: no nearby curve does better")


def _stationary(e: Evidence) -> Iterator[Finding]:
    numbers = {"residual": e.residual}
    if e.residual > STATIONARY and e.unpolished and not e.touched:
        sentence = (
            f"the curve is not stationary: it misses the Euler-Lagrange equation by {e.residual:.2g} of its terms "
            f"({e.unpolished})"
        )
        yield Finding(Verdict.NO_EXTREMAL, sentence, numbers)
        return
    if e.touched:
        sentence = f"with the multipliers of the bounds, which are known only roughly, it leaves {e.residual:.2g}"
        yield Finding(None, f"the Euler-Lagrange equation is not tested closely: {sentence} of its terms", numbers)
    else:
        yield Finding(None, f"the Euler-Lagrange equation holds to {e.residual:.2g} of its terms", numbers)
    if e.unpolished:
        yield Finding(None, f"what follows is for the curve as it was solved, which was not polished: {e.unpolished}")
    for name, drift in e.invariants.items():
        yield Finding(None, f"the first integral '{name}' is constant to {drift:.2g} of its terms", {"drift": drift})


def _corners(e: Evidence) -> Iterator[Finding]:
    for corner in e.corners:
        numbers = {"at": corner.at, "slope": corner.slope, "momentum": corner.momentum, "energy": corner.energy}
        jump = max(corner.momentum, 0.0 if math.isnan(corner.energy) else corner.energy)
        place = f"at the corner at {corner.at:.8g}, where the slope jumps by {corner.slope:.4g},"
        if corner.held:
            yield Finding(None, f"{place} the curve is held, so its momentum may jump", numbers)
        elif jump <= UNBROKEN:
            yield Finding(None, f"{place} Weierstrass's and Erdmann's conditions hold to {jump:.2g}", numbers)
        else:
            sentence = (
                f"{place} Weierstrass's and Erdmann's conditions fail by {jump:.2g}: moving the corner does better"
            )
            yield Finding(Verdict.NO_EXTREMAL, sentence, numbers)


def _legendre(e: Evidence) -> Iterator[Finding]:
    least, at = e.legendre.least, e.legendre.at
    sign = e.problem.sign
    numbers = {"least": least, "at": at}
    name = "L_y''y''" if e.problem.order == 2 else "L_y'y'"
    if math.isnan(least):
        yield Finding(None, "Legendre's condition has nothing to say: the slope is free nowhere")
    elif e.legendre.vanishes:
        yield Finding(Verdict.SINGULAR, f"{name} vanishes along the curve: nothing in L fixes a curve", numbers)
    elif not e.legendre.holds:
        sentence = (
            f"Legendre's condition fails: {name} is {sign * least:.6g} at {at:.6g}, so wiggles of short wave do better "
            "and the index is infinite"
        )
        yield Finding(Verdict.SADDLE, sentence, numbers)
    elif not e.legendre.strengthened:
        sentence = f"Legendre's condition holds only weakly: {name} vanishes at {at:.6g}, and more than it must decide"
        yield Finding(Verdict.DEGENERATE, sentence, numbers)
    else:
        yield Finding(
            None, f"Legendre's condition holds: {name} is nowhere nearer to zero than {abs(least):.6g}", numbers
        )


def _second_variation(e: Evidence) -> Iterator[Finding]:
    if not e.legendre.holds or e.legendre.vanishes:
        return
    yield from _routes(e)
    if e.nullity:
        if len(e.points) and not e.jacobi.reason:
            place = f"beyond the points listed, {e.nullity} more at the end itself"
        else:
            place = f"the second variation vanishes in {e.nullity} direction{'s' if e.nullity > 1 else ''}"
        sentence = (
            f"{place}: the end is conjugate, or the curve is one of a continuum, and the second order does not decide"
        )
        yield Finding(Verdict.DEGENERATE, sentence, {"nullity": float(e.nullity)})
    if e.index > 0:
        better = "raise" if e.problem.maximise else "lower"
        count = "one variation" if e.index == 1 else f"{e.index:.0f} independent variations"
        sentence = f"{count} of the curve {better}{'s' if e.index == 1 else ''} the functional: a saddle"
        yield Finding(Verdict.SADDLE, sentence, {"index": float(e.index)})
    elif math.isnan(e.index):
        sentence = f"the index could not be found: {e.jacobi.reason}; {e.ritz.reason}"
        yield Finding(Verdict.DEGENERATE, sentence)


def _routes(e: Evidence) -> Iterator[Finding]:
    jacobi, ritz = e.jacobi, e.ritz
    if jacobi.index is not None:
        sentence = f"Jacobi's equation gives the index {jacobi.index}: {jacobi.account}"
        yield Finding(None, sentence, {"index": float(jacobi.index)})
    else:
        yield Finding(None, f"Jacobi's equation was not used: {jacobi.reason}")
    if ritz.index is not None:
        sentence = f"the Hessian of the discretised functional has {ritz.index} negative eigenvalues"
        yield Finding(None, sentence, {"index": float(ritz.index)})
    else:
        yield Finding(None, f"the Hessian of the discretised functional was not used: {ritz.reason}")
    if jacobi.index is not None and ritz.index is not None and jacobi.index != ritz.index:
        sentence = (
            f"the two routes to the index disagree, {jacobi.index} against {ritz.index}: neither can be relied on"
        )
        numbers = {"jacobi": float(jacobi.index), "ritz": float(ritz.index)}
        yield Finding(Verdict.DEGENERATE, sentence, numbers)


def _weierstrass(e: Evidence) -> Iterator[Finding]:
    if math.isnan(e.excess):
        yield Finding(None, "Weierstrass's condition was not tested: pathwise conditions and bounds restrict the slope")
        return
    slope, own = (np.array2string(v, precision=5) for v in (e.excess.slope, e.excess.own))
    numbers = {"excess": float(e.excess), "at": e.excess.at}
    if e.excess < -NOISE:
        sentence = (
            f"Weierstrass's condition fails: at {e.excess.at:.6g} the excess is {float(e.excess):.3g} of its terms for "
            f"the slope {slope} instead of {own}, so curves with corners do better"
        )
        yield Finding(Verdict.WEAK_MINIMUM, sentence, numbers)
    else:
        yield Finding(None, "Weierstrass's condition holds for every slope tried", numbers)


def _value(e: Evidence) -> Iterator[Finding]:
    side = "lower" if e.problem.maximise else "upper"
    kind = "maximum" if e.problem.maximise else "minimum"
    sentence = (
        f"the functional is {e.bound:.15g} on this curve, {'an' if side == 'upper' else 'a'} {side} bound of the {kind}"
    )
    yield Finding(None, sentence, {"bound": e.bound})
    for number, miss in e.misses.items():
        if miss > MISSED and isinstance(e.problem.constraints[number], Isoperimetric):
            sentence = f"constraints[{number}] is missed by {miss:.2g} of its level, so the bound is none"
            yield Finding(None, sentence, {"miss": miss})
