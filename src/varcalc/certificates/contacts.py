"""Where a curve comes to its bounds and leaves them, to round-off: a solver may know it to its mesh alone.

Between these places the curve is free or touches the same bounds throughout, and is smooth: there L_y + mu h_y = p',
p = L_v, and h = limit where it touches. At them the curve and p are continuous. All of it is solved by Newton's method
at Chebyshev's points, with the places among the unknowns (Ascher, Mattheij and Russell, "Numerical Solution of
Boundary Value Problems", 1995, sect. 11.4 on free boundaries).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from varcalc.certificates.balls import differentiation, nodes, transform
from varcalc.certificates.curve import CURVE_DEGREE, through
from varcalc.symbolic.tracing import Expression
from varcalc.verify.along_curve import AlongCurve

CONTACT_STEPS = 12
"""Steps of Newton's method at most."""
SETTLED, ALL_STEPS = 1e-12, 1e-3
"""Length of the last step, and of all of them together, relative to the curve, at most."""
UNRESOLVED = 1e-11
"""Last coefficients of a curve, relative to the largest, from which on an arc takes more than one polynomial."""


@dataclass(frozen=True)
class TouchedArc:
    """What a curve touches between two places: what vanishes there, expressions in the curve's own symbols."""

    start: float
    end: float
    touched: tuple[Expression, ...]


@dataclass(frozen=True)
class FreeBoundaries:
    """The equations of a curve without its bounds, ``along``, on arcs; ``integrand`` is what is minimised."""

    along: AlongCurve
    integrand: Expression
    arcs: Sequence[TouchedArc]

    def _point(self, arc: TouchedArc) -> ca.Function:
        """L_y + mu h_y, L_v and h of x, y, v and mu."""
        along, s = self.along, self.along.symbols
        mu = s.kind.sym("mu", len(arc.touched))
        rows = ca.vertcat(*arc.touched) if arc.touched else s.kind(0, 1)
        force = ca.gradient(self.integrand, s.y) + (ca.jacobian(rows, s.y).T @ mu if arc.touched else 0)
        known = [along.form.problem.parameter_values, along.numbers, along.lambdas]
        symbols = [s.parameters, s.unknowns, along.multiplier_symbols[0]]
        results = ca.substitute([force, ca.gradient(self.integrand, s.dy), rows], symbols, list(map(ca.DM, known)))
        return ca.Function("point", [s.x, s.y, s.dy, mu], list(map(ca.densify, results)))

    @cached_property
    def _system(self) -> tuple[ca.Function, np.ndarray]:
        """Residuals and their slopes in all unknowns: curve and multipliers of each arc, and places; a guess."""
        n, D = self.along.n, ca.DM(differentiation(CURVE_DEGREE).T)
        places = ca.MX.sym("places", len(self.arcs) - 1)
        edges = [self.arcs[0].start, *ca.vertsplit(places), self.arcs[-1].end]
        unknowns, residuals, guesses, before = [], [], [], None
        for k, arc in enumerate(self.arcs):
            half, middle = (edges[k + 1] - edges[k]) / 2, (edges[k + 1] + edges[k]) / 2
            y, mu = ca.MX.sym("y", n, CURVE_DEGREE + 1), ca.MX.sym("mu", len(arc.touched), CURVE_DEGREE - 1)
            v, x = (y @ D) / half, middle + half * ca.DM(nodes(CURVE_DEGREE)).T
            padded = ca.horzcat(mu[:, 0], mu, mu[:, -1])
            force, p, h = self._point(arc).map(CURVE_DEGREE + 1)(x, y, v, padded)
            missed = (p @ D) / half - force
            residuals += [ca.vec(missed[:, 1:-1]), ca.vec(h)]
            if before is None:
                residuals.append(y[:, 0] - self._held(0))
            else:
                residuals += [y[:, 0] - before[0], p[:, 0] - before[1]]
            before = y[:, -1], p[:, -1]
            unknowns += [ca.vec(y), ca.vec(mu)]
            at = 0.5 * (arc.start + arc.end) + 0.5 * (arc.end - arc.start) * nodes(CURVE_DEGREE)
            guesses += [self.along.evaluate(at, 0).T.ravel(), np.zeros(len(arc.touched) * (CURVE_DEGREE - 1))]
        assert before is not None
        residuals.append(before[0] - self._held(1))
        z, total = ca.vertcat(*unknowns, places), ca.vertcat(*residuals)
        guess = np.r_[*guesses, [arc.end for arc in self.arcs[:-1]]]
        return ca.Function("arcs", [z], [total, ca.densify(ca.jacobian(total, z))]), guess

    def _held(self, end: int) -> ca.DM:
        return ca.DM(np.asarray((self.along.form.ends.start, self.along.form.ends.end)[end])[0])

    def solved(self) -> AlongCurve | None:
        """The curve with its places of contact for vertices; None where none is found near."""
        function, z = self._system
        curve = self._of_curve()
        size, moved = float(np.ptp(z[curve])) or 1.0, 0.0
        for _ in range(CONTACT_STEPS):
            residual, slope = (np.asarray(v) for v in function(z))
            if not (np.isfinite(residual).all() and np.isfinite(slope).all()):
                return None
            step = _step(slope, residual.ravel())
            z = z + step
            length = float(np.abs(step[curve]).max()) / size
            moved += length
            if (
                not moved <= ALL_STEPS
                or not (np.diff([self.arcs[0].start, *self._places(z), self.arcs[-1].end]) > 0).all()
            ):
                return None
            if length <= SETTLED:
                return self._found(z)
        return None

    def _places(self, z: np.ndarray) -> np.ndarray:
        return z[len(z) - len(self.arcs) + 1 :]

    def _of_curve(self) -> np.ndarray:
        """Which unknowns are the curve, and places."""
        count = self.along.n * (CURVE_DEGREE + 1)
        flags = [[True] * count + [False] * len(arc.touched) * (CURVE_DEGREE - 1) for arc in self.arcs]
        return np.r_[*flags, [True] * (len(self.arcs) - 1)]

    def _found(self, z: np.ndarray) -> AlongCurve | None:
        count, first, parts = self.along.n * (CURVE_DEGREE + 1), 0, []
        edges = [self.arcs[0].start, *self._places(z).tolist(), self.arcs[-1].end]
        for k, arc in enumerate(self.arcs):
            y = z[first : first + count].reshape(CURVE_DEGREE + 1, self.along.n).T
            coefficients = np.abs(y @ transform(CURVE_DEGREE).T)
            if coefficients[:, -3:].max() > UNRESOLVED * coefficients.max():
                return None
            parts.append((edges[k], edges[k + 1], y))
            first += count + len(arc.touched) * (CURVE_DEGREE - 1)
        return replace(self.along, evaluate=through(parts), vertices=np.array(edges))


def _step(slope: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """Newton's step, of rows and columns of one size; of a curve held on a bound one equation is said twice."""
    rows = 1.0 / np.abs(slope).max(axis=1)
    columns = 1.0 / np.linalg.norm(slope * rows[:, None], axis=0)
    return columns * np.linalg.lstsq(slope * rows[:, None] * columns, -residual * rows, rcond=None)[0]


def at_contacts(along: AlongCurve, integrand: Expression, pieces: Sequence[TouchedArc]) -> AlongCurve | None:
    """The curve on as few arcs as what it touches has, its places of contact known to round-off.

    None where it is known so already, or not found, or held by more than its ends and its bounds.
    """
    form, joined = along.form, []
    for piece in pieces:
        same = joined and len(joined[-1].touched) == len(piece.touched) and all(
            map(_equal, joined[-1].touched, piece.touched)
        )  # fmt: skip
        joined.append(replace(joined.pop(), end=piece.end) if same else piece)
    ends: Any = np.r_[np.asarray(form.ends.start)[0], np.asarray(form.ends.end)[0]]
    plain = form.ends.separate and not (along.integrals or len(along.numbers) or form.conditions.waypoints)
    if len(joined) == 1 or len(joined) == len(pieces) or not plain or np.isnan(ends).any():
        return None
    return FreeBoundaries(along, integrand, joined).solved()


def _equal(a: Expression, b: Expression) -> bool:
    return bool(ca.is_equal(a, b, 2))
