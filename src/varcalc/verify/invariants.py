"""First integrals: how far what must stay constant along an extremal drifts along a curve.

Without x in L the energy is constant (Euler's second equation), without a
function the momentum that belongs to it (Gelfand and Fomin, "Calculus of
Variations", sect. 4 and 17). A Curve is run through at constant speed, which
its parametrisation was chosen for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import casadi as ca
import numpy as np

from varcalc.methods.answer import Extremal
from varcalc.problem.problem import Curve
from varcalc.solution import Finding
from varcalc.symbolic.tracing import Expression
from varcalc.verify.along_curve import AlongCurve, inner_points
from varcalc.verify.candidate import Candidate
from varcalc.verify.check import Check
from varcalc.verify.residual import FAINT, EulerLagrange, felt

DRIFT_POINTS = 12
"""Gauss points an element."""


@dataclass(frozen=True)
class FirstIntegrals(Check[dict[str, float]]):
    """Whether what must stay constant along an extremal does."""

    name = "first integrals"

    def measure(self, candidate: Candidate) -> dict[str, float]:
        """Name and relative drift of every first integral; none where bounds push, or nothing smooth is at hand."""
        second, polished = candidate.problem.order == 2, candidate.along_best is not None and not candidate.reason
        if candidate.touched or (second and not polished):
            return {}
        # third derivatives are to be had of the polished curve only
        return invariants(candidate.along_best if second and candidate.along_best else candidate.along, candidate.own)

    def findings(self, candidate: Candidate) -> Iterator[Finding]:
        """The drift of each, along a curve that may be an extremal."""
        measured = candidate.measured(self)
        for name, drift in measured.items() if EulerLagrange().stationary(candidate) else ():
            yield Finding(
                None, f"the first integral '{name}' is constant to {drift:.2g} of its terms", {"drift": drift}
            )


def invariants(along: AlongCurve, curve: Extremal | None) -> dict[str, float]:
    """Name and relative drift of every first integral; ``curve`` is in the coordinates a Curve was solved in.

    What is left where larger terms cancel is measured by a share of those.
    """
    H = along.whole
    homogeneous = isinstance(along.form.problem, Curve)
    found: dict[str, float] = {}
    s = inner_points(along, DRIFT_POINTS)
    evaluate = _tower_function(along)
    if H.ignorable_abscissa and not homogeneous:
        tower = H.derivatives_of_y
        size = sum(ca.fabs(ca.dot(tower[k + 1], m)) for k, m in enumerate(H.momenta)) + ca.fabs(H.expression)
        slope, uncancelled = ca.fabs(tower[along.order]), felt(along)
        values, sizes, left = evaluate(s, H.energy, size, FAINT * ca.dot(slope, uncancelled))
        found["energy"] = _drift(along, s, values, np.maximum(sizes, left))
    for i in H.ignorable:
        values, whole, left = evaluate(s, H.momenta[0][i], H.expression, FAINT * felt(along)[i])
        extent = float(np.ptp(along.evaluate(s, 0)[i])) or along.length
        sizes = np.maximum(np.abs(values) + np.abs(whole) * along.length / extent, left)
        found["momentum" if along.form.problem.scalar else f"momentum[{i}]"] = _drift(along, s, values, sizes)
    if homogeneous and curve is not None and curve.form.lift is None:
        velocity = curve.evaluate(s, 1)
        speed = evaluate(s, H.expression)[0] if curve.form.coordinates.energetic else np.linalg.norm(velocity, axis=0)
        found["speed"] = _drift(along, s, speed, np.abs(speed))
    return found


def _tower_function(along: AlongCurve) -> Callable[..., list[np.ndarray]]:
    """Expressions in the derivatives of y up to twice the order, less one, as functions of s (m,)."""
    H, symbols = along.whole, along.symbols
    tower = H.derivatives_of_y[: 2 * along.order]

    def evaluate(s: np.ndarray, *expressions: Expression) -> list[np.ndarray]:
        """The values (m,) of each of the expressions at s (m,)."""
        arguments = along.arguments(s)
        curve = [along.evaluate(s, k) for k in range(2 * along.order)]
        inputs = [symbols.x, *tower, symbols.parameters, symbols.unknowns, *along.multiplier_symbols]
        function = ca.Function("tower", inputs, [ca.densify(e) for e in expressions])
        with np.errstate(all="ignore"):
            return [np.asarray(v).ravel() for v in function.call([arguments[0], *curve, *arguments[4:]])]

    return evaluate


def _drift(along: AlongCurve, s: np.ndarray, values: np.ndarray, sizes: np.ndarray) -> float:
    """The largest departure from the median between waypoints, relative to the terms there or to their mean."""
    good = np.isfinite(values) & np.isfinite(sizes)
    measure = np.maximum(sizes, sizes[good].mean() if good.any() else 0.0)
    good &= measure > 0
    worst = 0.0
    for left, right in along.parts():
        here = good & (s >= left) & (s <= right)
        if here.any():
            worst = max(worst, float((np.abs(values - np.median(values[here]))[here] / measure[here]).max()))
    return worst
