"""Legendre's condition: L must not be concave in the slope anywhere along the curve.

For several functions the matrix L_y'y' must have no negative eigenvalue; under
pathwise conditions only slopes they allow count, and along a Curve, where F is
homogeneous, only directions across it (Gelfand and Fomin, "Calculus of
Variations", sect. 25 and 29; Bolza, "Lectures", sect. 30 for curves).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import casadi as ca
import numpy as np

from varcalc.problem.problem import Curve
from varcalc.solution import Finding, Verdict
from varcalc.verify.along_curve import TOUCHED_AT, AlongCurve, complement, inner_points, touched
from varcalc.verify.candidate import Candidate
from varcalc.verify.check import Check
from varcalc.verify.convexity import Convexity
from varcalc.verify.singular_ends import singular_ends_along

CURVATURE_POINTS = 16
"""Gauss points an element."""
ZERO_CURVATURE = 1e-13
"""Size of a second derivative that is zero, in units of H / (1 + slope^2)."""
CLEAR_OF_ZERO = 1e-3
"""Share of its size, by the power with which it vanishes at an end, that the second derivative keeps inside."""


@dataclass(frozen=True)
class Legendre:
    """The ``least`` eigenvalue and where; whether the condition ``holds`` at all, and strictly (``strengthened``).

    ``vanishes`` tells that there is no second derivative in the slope anywhere, ``at_end`` that it is an end alone
    at which there is none.
    """

    least: float
    at: float
    holds: bool
    strengthened: bool
    vanishes: bool
    at_end: bool = False

    @property
    def leaves_open(self) -> bool:
        """Whether the second variation has something to decide."""
        return self.holds and not self.vanishes


UNTESTED = Legendre(float("nan"), float("nan"), True, True, False)


@dataclass(frozen=True)
class LegendreCondition(Check[Legendre]):
    """Whether L is concave in the slope nowhere along the curve."""

    name = "Legendre"

    def measure(self, candidate: Candidate) -> Legendre:
        """The least second derivative along the solution's curve, in the user's coordinates."""
        return legendre(candidate.along)

    def findings(self, candidate: Candidate) -> Iterator[Finding]:
        """Whether the condition holds, and how strictly."""
        measured = candidate.measured(self)
        least, at, problem = measured.least, measured.at, candidate.problem
        numbers = {"least": least, "at": at}
        name = "L_y''y''" if problem.order == 2 else "L_y'y'"
        if math.isnan(least):
            yield Finding(None, "Legendre's condition was not tested: bounds are touched all along the curve")
        elif measured.vanishes:
            without = not ca.depends_on(problem.integrand, problem.symbols.slopes[-1])
            if without and candidate.measured(Convexity()):
                sentence = "L does not contain the slope, and is least at each abscissa by itself"
                yield Finding(None, sentence, numbers)
            else:
                sentence = f"{name} vanishes along the curve: nothing in L fixes a curve"
                yield Finding(Verdict.SINGULAR, sentence, numbers)
        elif not measured.holds:
            sentence = (
                f"Legendre's condition fails: {name} is {-least if problem.maximise else least:.6g} at {at:.6g}, so "
                "wiggles of short wave do better and the index is infinite"
            )
            yield Finding(Verdict.SADDLE, sentence, numbers)
        elif not measured.strengthened:
            what = f"Legendre's condition holds only weakly: {name} vanishes at {at:.6g}"
            if candidate.measured(Convexity()):
                yield Finding(None, f"{what}, where convexity decides", numbers)
            elif measured.at_end:
                yield Finding(None, f"{what}, an end, where the Hessian must decide", numbers)
            else:
                yield Finding(Verdict.DEGENERATE, f"{what}, and more than it must decide", numbers)
        else:
            sentence = f"Legendre's condition holds: {name} is nowhere nearer to zero than {abs(least):.6g}"
            yield Finding(None, sentence, numbers)


def legendre(along: AlongCurve) -> Legendre:
    """The least eigenvalue of the second derivatives in the highest slope along a curve, in the minimising sense."""
    s = inner_points(along, CURVATURE_POINTS)
    if along.form.lift is None or along.slides:  # else an end may be singular
        s = np.concatenate([[along.span[0]], s, [along.span[1]]])
    H, top = along.whole.expression, along.symbols.slopes[-1]
    s = s[~_held(along, s)]
    if not len(s):
        return UNTESTED
    with np.errstate(all="ignore"):
        matrices, values = along.function(ca.hessian(H, top)[0], H)(s)
    basis = crossing(along, s)
    finite = np.isfinite(matrices).all((1, 2)) & np.isfinite(basis).all((1, 2))
    s, matrices, basis, values = s[finite], matrices[finite], basis[finite], values[finite, 0, 0]
    matrices = basis.transpose(0, 2, 1) @ matrices @ basis
    if not matrices.size:
        return UNTESTED
    eigenvalues = np.linalg.eigvalsh(matrices)
    least, largest = eigenvalues[:, 0], np.abs(eigenvalues).max(1)
    slopes = np.abs(along.evaluate(s, along.order)).max(0)
    noise = ZERO_CURVATURE * np.maximum(np.where(np.isfinite(values), np.abs(values), 0.0) / (1 + slopes**2), largest)
    k = int(np.argmin(least))
    holds, strict = bool((least >= -noise).all()), least > noise
    at_end = not strict.all() and _at_ends_alone(along, s, least)
    return Legendre(float(least[k]), float(s[k]), holds, bool(strict.all()), bool((largest <= noise).all()), at_end)


def _at_ends_alone(along: AlongCurve, s: np.ndarray, least: np.ndarray) -> bool:
    """Whether the second derivative is as large inside as the powers with which it vanishes at ends leave it."""
    ends = [end for end in singular_ends_along(along) if end.power > 0]
    inside = (s > along.span[0]) & (s < along.span[1])
    left = np.prod([(np.abs(s - end.place) / along.length) ** end.power for end in ends], axis=0)
    return bool(ends) and bool((least[inside] > CLEAR_OF_ZERO * (left * least.max())[inside]).all())


def _held(along: AlongCurve, s: np.ndarray) -> np.ndarray:
    """Points of the elements where a bound is touched: there the slope is not free, or its corner is smeared."""
    element = np.clip(np.searchsorted(along.vertices, s, side="right") - 1, 0, len(along.vertices) - 2)
    near, on = touched(along, s), touched(along, s, TOUCHED_AT) & (s != along.span[0]) & (s != along.span[1])
    leaving = _leaving(near, on) | _leaving(near[::-1], on[::-1])[::-1]
    return np.isin(element, element[near & ~leaving])


def _leaving(near: np.ndarray, on: np.ndarray) -> np.ndarray:
    """Which of the first points are near a bound only because the curve begins on it, and leaves it at once."""
    first = np.logical_and.accumulate(near)
    return first & ~(first & on).any()


def crossing(along: AlongCurve, s: np.ndarray) -> np.ndarray:
    """Bases (m, n, k) of the slopes that count: as pathwise conditions allow, across a Curve's direction."""
    rows = along.forbidden_slopes(s)
    if isinstance(along.form.problem, Curve):
        rows = np.concatenate([rows, along.evaluate(s, 1).T[:, None, :]], axis=1)
    return complement(rows)
