"""Ends next to which the accessory equation is singular, and whether its solutions oscillate there for ever.

Beside an end variations eta of one function obey (P eta')' = Q eta, where P = L_y'y' and Q = L_yy - d/dx L_yy'. Where
P grows like the power s of the distance d, and d^2 Q / P tends to kappa, they grow like the powers of d that solve
e (e + s - 1) = kappa. Where ((1 - s) / 2)^2 + kappa is negative these are complex: every solution has infinitely many
zeros on any stretch that reaches the end, and the second variation is negative in infinitely many directions (Hardy's
inequality: Opic and Kufner, "Hardy-type Inequalities", ch. 1; Hartman, "Ordinary Differential Equations", ch. XI).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import casadi as ca
import numpy as np

from varcalc.formulation.singular.detection import PROBE
from varcalc.formulation.singular.indicial import SingularEnd, singular_end, singular_ends_of
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Problem
from varcalc.solution import Finding, Solution, Verdict
from varcalc.verify.along_curve import AlongCurve
from varcalc.verify.candidate import Candidate
from varcalc.verify.check import Check

SecondDerivatives = Callable[[np.ndarray], np.ndarray]
"""L_yy, L_yy' and L_y'y' at abscissae (m,): shape (3, m)."""


@dataclass(frozen=True)
class SingularEnds(Check[tuple[SingularEnd, ...]]):
    """What becomes of variations next to ends where L is singular."""

    name = "singular ends"

    def measure(self, candidate: Candidate) -> tuple[SingularEnd, ...]:
        """The singular ends of the curve, in the user's coordinates."""
        return singular_ends_along(candidate.along)

    def findings(self, candidate: Candidate) -> Iterator[Finding]:
        """That variations oscillate at an end, where they do."""
        for end in candidate.measured(self):
            if end.oscillates:
                yield _oscillating(end, candidate.problem)


def singular_ends_along(along: AlongCurve) -> tuple[SingularEnd, ...]:
    """The ends of a curve of one function of first order where its accessory equation is singular."""
    if along.n != 1 or along.order != 1:
        return ()
    s, H = along.symbols, along.whole.expression
    slope = ca.gradient(H, s.dy)
    found = along.function(ca.hessian(H, s.y)[0], ca.jacobian(slope, s.y), ca.jacobian(slope, s.dy))

    def second(places: np.ndarray) -> np.ndarray:
        return np.array([v[:, 0, 0] for v in found(places)])

    return _singular(second, along.span)


def oscillation(solution: Solution) -> Finding | None:
    """That no curve next to a solution is least, because variations oscillate at a singular end; None elsewhere."""
    problem, curve = solution.problem, solution.curve
    if not isinstance(problem, Problem) or problem.n > 1 or problem.order > 1 or curve is None:
        return None

    def second(x: np.ndarray) -> np.ndarray:
        hessian = problem.sign * problem.integrand_derivatives(x, curve(x, 0), curve(x, 1)).hessian
        return np.array([hessian[:, 1, 1], hessian[:, 1, 2], hessian[:, 2, 2]])

    ends = _singular(second, (float(solution.x.min()), float(solution.x.max())))
    return next((_oscillating(end, problem) for end in ends if end.oscillates), None)


def without_bound(problem: Functional) -> Finding | None:
    """That a functional of second degree has no bound, because variations oscillate at an end; None elsewhere.

    Along one of them it is a parabola that falls for ever, whatever the curve it is measured from.
    """
    if not isinstance(problem, Problem) or problem.n > 1 or problem.order > 1:
        return None
    end = next((end for end in singular_ends_of(problem) if end is not None and end.oscillates), None)
    if end is None:
        return None
    side = "above" if problem.maximise else "below"
    sentence = f"the functional is unbounded {side}: L is of second degree, and {_told(end, problem)}"
    return Finding(Verdict.UNBOUNDED, sentence, {"power": end.power, "share": end.share})


def _oscillating(end: SingularEnd, problem: Functional) -> Finding:
    least = "greatest" if problem.maximise else "least"
    sentence = f"{_told(end, problem)}: no curve near this one is {least}"
    return Finding(Verdict.SADDLE, sentence, {"power": end.power, "share": end.share})


def _told(end: SingularEnd, problem: Functional) -> str:
    return (
        f"variations oscillate infinitely often next to {problem.abscissa.at([end.place], 6)}, where L is singular "
        f"(Hardy's inequality: {-end.share:.4g} where {(0.5 * (1 - end.power)) ** 2:.4g} is the most)"
    )


def _singular(second: SecondDerivatives, span: tuple[float, float]) -> tuple[SingularEnd, ...]:
    """The ends of an interval that are singular by the second derivatives next to them."""
    low, high = span
    steps = np.array(PROBE) * (high - low)
    with np.errstate(all="ignore"):
        rows = second(np.concatenate([low + steps, high - steps])).reshape(3, 2, 2)
        ends = [
            singular_end(place, inward * steps, rows[:, k]) for k, (place, inward) in enumerate(((low, 1), (high, -1)))
        ]
    return tuple(end for end in ends if end is not None)
