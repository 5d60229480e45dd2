"""What a verification says: the verdict, the numbers behind it, and a report for people."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np

from varcalc.axes import Axis
from varcalc.showing import Fact, Shown
from varcalc.solution import Finding, Verdict
from varcalc.tables import labelled

SHOWN = 8
"""Conjugate points printed before the rest are only counted."""
SLOPE_TURNS = np.concatenate([-np.geomspace(1e-2, 1e2, 25), [0.0], np.geomspace(1e-2, 1e2, 25)])
"""Slopes tried, in units of the larger of 1 and the extremal's own."""
SMALL = 0.1
"""Size of all slopes of a curve below which others are tried in its units as well."""
NULL = 1e-7
"""Relative size of an eigenvalue that is zero: that of a conjugate point this near to the end."""


class Excess(float):
    """Weierstrass's excess relative to its terms, where it is least: at abscissa ``at``, for the slope ``slope``.

    Not below zero (but for round-off) when the curve is a minimum also among
    curves of any slope near it. ``own`` is the curve's own slope there.
    """

    at: float
    slope: np.ndarray
    own: np.ndarray

    def __new__(cls, excess: float, at: float, slope: np.ndarray, own: np.ndarray) -> Self:
        """A float with the place where it was found."""
        self = super().__new__(cls, excess)
        self.at, self.slope, self.own = at, slope, own
        return self

    def __reduce__(self) -> tuple[type[Excess], tuple[float, float, np.ndarray, np.ndarray]]:
        return Excess, (float(self), self.at, self.slope, self.own)


def slope_turns(slopes: np.ndarray) -> np.ndarray:
    """The steps to other slopes than those of a curve, which they are in units of where it has none of size 1."""
    own = float(np.abs(slopes).max(initial=0.0))
    return np.union1d(SLOPE_TURNS, own * SLOPE_TURNS) if 0.0 < own < SMALL else SLOPE_TURNS


def excesses(own: np.ndarray, linear: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Weierstrass's excess of slopes tried, and the same relative to its terms; arrays of one shape.

    L is ``own`` at the curve's slope and ``other`` at the slope tried, ``linear`` is the step between them times
    L_y'. Where L is no number for a slope there is no curve with it, and the relative excess is zero.
    """
    excess = other - own - linear
    size = np.abs(other) + np.abs(own) + np.abs(linear)
    known = np.isfinite(excess) & (size > 0)
    return excess, np.divide(excess, size, out=np.zeros_like(excess), where=known)


@dataclass(frozen=True, eq=False, repr=False)
class Verification(Shown):
    """What kind of stationary curve a solution is, and the evidence.

    ``verdict``: the first in the order of :class:`varcalc.Verdict` of all that hold.
    ``index``: the number of independent variations that lower the functional
    to second order; infinite when Legendre's condition fails or variations oscillate at a singular end, NaN where no
    route tells.
    ``conjugate_points``: abscissae (t for a Curve) conjugate to the start, or
    focal to what it slides on, the start excluded, each as often as it counts; shape (k,).
    ``residual``: of the Euler-Lagrange equation, in du Bois-Reymond's integrated
    form, on the solution's own curve, relative to its terms.
    ``legendre``: the least eigenvalue of L_y'y' (L_y''y'' at second order) along
    the curve, with the sign of what is minimised; for a Curve across its direction.
    ``weierstrass``: the least excess (:class:`varcalc.verify.verification.Excess`).
    ``invariants``: for each first integral of L, by name, how far it drifts, relative.
    ``bound``: the functional on the solution's own curve by a finer rule: an
    upper bound of a minimum, a lower bound of a maximum.
    ``routes``: the index by Jacobi's equation and by the Ritz Hessian, None where a route is closed.
    ``findings``: every statement that holds.
    ``abscissa``, ``unit``: the name of the abscissa, and its unit where one is declared.
    ``evidence``: what each check measured, by the check's name.
    """

    name: str
    verdict: Verdict
    index: float
    conjugate_points: np.ndarray
    residual: float
    legendre: float
    weierstrass: Excess
    invariants: Mapping[str, float]
    bound: float
    routes: Mapping[str, int | None]
    findings: tuple[Finding, ...]
    maximise: bool = False
    abscissa: str = "x"
    unit: str = ""
    evidence: Mapping[str, Any] = field(default_factory=dict, repr=False)

    def __str__(self) -> str:
        findings = (f"- {finding.sentence}" for finding in self.findings)
        return "\n".join([f"{self.name}: {self._verdict()}", *labelled(self._rows()), "", *findings])

    def _facts(self) -> Iterator[Fact]:
        yield Fact("verdict", self._verdict())
        yield from (Fact(*row) for row in self._rows())
        yield from (Fact("" if k else "findings", finding.sentence) for k, finding in enumerate(self.findings))

    def _headline(self) -> str:
        return self.name

    def _verdict(self) -> str:
        if self.verdict is Verdict.WEAK_MINIMUM and self.maximise:
            return "a maximum among curves of nearby slope only (Weierstrass fails)"
        return self.verdict.value

    def _rows(self) -> Iterator[tuple[str, str]]:
        yield "Euler-Lagrange", f"residual {self.residual:.1e} of the terms"
        yield "Legendre", self.legendre_in_words()
        if math.isnan(self.weierstrass):
            yield "Weierstrass", "not tested"
        else:
            yield "Weierstrass", f"least excess {float(self.weierstrass):.1e} of its terms"
        yield "Jacobi", self.points_in_words(12)
        yield "index", self._index()
        for name, drift in self.invariants.items():
            yield name, f"constant to {drift:.1e}"
        yield "functional", f"{self.bound:.15g} on this curve"

    def legendre_in_words(self) -> str:
        """What Legendre's condition found."""
        if math.isnan(self.legendre):
            return "not tested"
        least, sign = ("greatest", -1.0) if self.maximise else ("least", 1.0)
        return f"{least} second derivative in the slope {sign * self.legendre:.6g}"

    def points_in_words(self, digits: int) -> str:
        """What Jacobi's condition found, the conjugate points with so many digits."""
        count = len(self.conjugate_points)
        if not count:
            return "no conjugate point found" if self.routes.get("Jacobi") is not None else "not carried out"
        more = f", and {count - SHOWN} more" if count > SHOWN else ""
        return f"conjugate or focal at {Axis(self.abscissa, self.unit).at(self.conjugate_points[:SHOWN], digits)}{more}"

    def _index(self) -> str:
        if not math.isfinite(self.index):
            return "infinite" if math.isinf(self.index) else "unknown"
        found = ", ".join(f"{name} {index}" for name, index in self.routes.items() if index is not None)
        return f"{self.index:.0f} ({found or 'by convexity'})"


def first_held(findings: Iterable[Finding]) -> Verdict | None:
    """The first verdict in their order of all that some findings decide; None where they decide none."""
    held = {finding.verdict for finding in findings}
    return next((verdict for verdict in Verdict if verdict in held), None)


@dataclass(frozen=True)
class Index:
    """An index, or None with the ``reason``; ``nullity`` counts directions in which the second variation vanishes."""

    index: int | None
    nullity: int
    reason: str

    def finding(self, route: str, sentence: str) -> Finding:
        """What a ``sentence`` tells of the index, or why the ``route`` to it was closed."""
        if self.index is None:
            return Finding(None, f"{route} was not used: {self.reason}")
        return Finding(None, sentence, {"index": float(self.index)})


def signs(form: np.ndarray) -> tuple[int, int]:
    """Numbers of negative and of zero eigenvalues of a symmetric matrix in balanced units."""
    if not form.size:
        return 0, 0
    values = np.linalg.eigvalsh(form)
    null = np.abs(values) <= NULL * max(1.0, float(np.abs(values).max()))
    return int((values[~null] < 0).sum()), int(null.sum())
