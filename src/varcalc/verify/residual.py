"""How far a curve is from satisfying the Euler-Lagrange equation.

In du Bois-Reymond's integrated form no more derivatives are asked of the curve
than the functional has: L_y' - integral of L_y is constant along an extremal,
at second order L_y'' - integral of (L_y' - integral of L_y) is a linear function
(Gelfand and Fomin, "Calculus of Variations", sect. 3 and 11).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from varcalc.numerics.mesh import antiderivative, gauss
from varcalc.solution import Finding, Verdict
from varcalc.symbolic.tracing import Expression
from varcalc.verify.along_curve import AlongCurve
from varcalc.verify.candidate import Candidate
from varcalc.verify.check import Check

STATIONARY_RESIDUAL = 1e-3
"""Residual of the Euler-Lagrange equation beyond which a curve that cannot be polished is no extremal."""
RESIDUAL_RULE = 24
"""Gauss points an element."""
FAINT = 1e-8
"""Momentum in units of H / slope, the slope that of the curve's chords, below which it is as good as zero."""
BESIDE_HELD = 0.02
"""Share of a stretch that is held, beside it, which counts to it: its ends are known as closely as a mesh shows."""
SAME_VERTEX = 1e-9
"""Distance of a vertex from where a part begins or ends, in units of its length, that is none."""
SINGULAR_SHARE = 0.1
"""Part of the interval beside each singular end that is left out in coordinates that are singular there."""


@dataclass(frozen=True)
class EulerLagrange(Check[float]):
    """How far the curve is from satisfying the Euler-Lagrange equation."""

    name = "Euler-Lagrange"

    def measure(self, candidate: Candidate) -> float:
        """The residual along the solution's own curve."""
        own = candidate.along_own
        if own is None:
            return residual(candidate.along, True)
        return max((residual(_between(own, *span)) for span in _free(own, candidate.held)), default=0.0)

    def stationary(self, candidate: Candidate) -> bool:
        """Whether the curve may be an extremal."""
        return candidate.measured(self) <= STATIONARY_RESIDUAL or not candidate.reason or candidate.touched

    def findings(self, candidate: Candidate) -> Iterator[Finding]:
        """Whether the curve is stationary, and which curve the other checks look at."""
        measured = candidate.measured(self)
        numbers = {"residual": measured}
        if not self.stationary(candidate):
            sentence = (
                f"the curve is not stationary: it misses the Euler-Lagrange equation by {measured:.2g} of its terms "
                f"({candidate.reason})"
            )
            yield Finding(Verdict.NO_EXTREMAL, sentence, numbers)
            return
        if candidate.touched:
            left = f"with the multipliers of the bounds, which are known only roughly, it leaves {measured:.2g}"
            yield Finding(None, f"the Euler-Lagrange equation is not tested closely: {left} of its terms", numbers)
        else:
            yield Finding(None, f"the Euler-Lagrange equation holds to {measured:.2g} of its terms", numbers)
        if candidate.reason:
            sentence = f"what follows is for the curve as it was solved, which was not polished: {candidate.reason}"
            yield Finding(None, sentence)


def residual(along: AlongCurve, singular: bool = False) -> float:
    """The largest departure of the integrated equation from a constant (a linear function), relative to its terms.

    ``singular`` tells that the coordinates may be so at the ends, which are then left out.
    """
    s = along.symbols
    H = along.whole.expression
    if singular:
        along = _inside(along)
    gradients = [ca.gradient(H, v) for v in (s.y, *s.slopes)]
    nodes, weights = along.rule(RESIDUAL_RULE)
    whole, *values = (v[:, :, 0] for v in along.function(H, *gradients)(nodes))
    total, size = values[0], np.zeros(1)
    for term in values[1:]:
        integral = _running(total, along.vertices)
        size = size + np.abs(integral).max(0) + np.abs(term).max(0)
        total = term - integral
    worst = 0.0
    for left, right in along.parts():
        inside = (nodes > left) & (nodes < right)
        powers = (nodes[inside, None] - left) ** np.arange(along.order) / along.length ** np.arange(along.order)
        root = np.sqrt(weights[inside, None])
        fitted = powers @ np.linalg.lstsq(powers * root, total[inside] * root, rcond=None)[0]
        worst = max(worst, float(np.abs(total[inside] - fitted).max()))
    # terms that are what is left when larger ones cancel say nothing, however they compare with one another
    momentum, pull = along.function(felt(along), felt(along, s.y))(nodes)
    # without the slope L_y = 0 is all of the equation, and what cancels in it are its terms
    share = FAINT if ca.depends_on(H, ca.vertcat(*s.slopes)) else 1.0
    cancelled = max(FAINT * float(momentum.max()), share * along.length * float(pull.max()))
    # a function the Lagrangian hardly feels is measured by those it does feel
    extent = float(np.abs(along.evaluate(nodes, 0)).max()) or along.length
    faint = FAINT * float(np.abs(whole).max()) * along.length**along.order / extent
    return worst / max(float(size.max()), faint, cancelled, 1e-300)


def felt(along: AlongCurve, variable: Expression | None = None) -> Expression:
    """What the momentum would be made of if nothing cancelled: the sum of abs(H_y'y y) and abs(H_y'y' y'), (n,).

    With a ``variable``, such as y, the same of the derivative by that.
    """
    s = along.symbols
    variables = ca.vertcat(s.y, *s.slopes)
    derivative = ca.gradient(along.whole.expression, s.slopes[-1] if variable is None else variable)
    return ca.mtimes(ca.fabs(ca.jacobian(derivative, variables)), ca.fabs(variables))


def _free(along: AlongCurve, held: tuple[tuple[float, float], ...]) -> list[tuple[float, float]]:
    """The stretches along which nothing holds the curve."""
    if not held:
        return [along.span]
    wider = [(low - BESIDE_HELD * (high - low), high + BESIDE_HELD * (high - low)) for low, high in held]
    first, last = along.span
    starts, ends = [first, *(high for _, high in wider)], [*(low for low, _ in wider), last]
    return [(low, high) for low, high in zip(starts, ends, strict=True) if low < high]


def _inside(along: AlongCurve) -> AlongCurve:
    """The same functional away from the ends of its interval."""
    a, b = along.span
    return _between(along, a + SINGULAR_SHARE * (b - a), b - SINGULAR_SHARE * (b - a))


def _between(along: AlongCurve, low: float, high: float) -> AlongCurve:
    """The same functional on part of its interval."""
    if (low, high) == along.span:
        return along
    room = SAME_VERTEX * (high - low)
    inner = along.vertices[(along.vertices > low + room) & (along.vertices < high - room)]
    return replace(along, span=(low, high), vertices=np.concatenate([[low], inner, [high]]))


def _running(values: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """Integrals from the first vertex to the Gauss points of values there, both (points, n)."""
    nodes, weights = gauss(RESIDUAL_RULE)
    inner = np.polynomial.legendre.legvander(nodes, RESIDUAL_RULE) @ antiderivative(RESIDUAL_RULE)
    half = 0.5 * np.diff(vertices)[:, None, None]
    shaped = values.reshape(len(vertices) - 1, RESIDUAL_RULE, -1)
    whole = half[:, 0] * np.einsum("q,eqa->ea", weights, shaped)
    before = np.concatenate([np.zeros((1, whole.shape[1])), np.cumsum(whole, axis=0)[:-1]])
    return (before[:, None] + half * (inner @ shaped)).reshape(values.shape)
