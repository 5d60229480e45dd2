"""A stationary value of a function of numbers under equations, enclosed, and what it is, in ball arithmetic.

With f(z) and phi(z) = 0, l(z, lambda) = f + lambda phi is stationary in all its variables. That there is one such
point in a box, and only one, is proved by Newton's interval operator (Moore, Kearfott and Cloud, "Introduction to
Interval Analysis", SIAM 2009, sect. 8.4). How many directions f falls in is the number of negative eigenvalues of l's
second derivatives, less one for each equation (Bertsekas, "Constrained Optimization and Lagrange Multiplier Methods",
1982, sect. 1.4); by Sylvester's law of inertia a congruence that leaves little beside the diagonal tells it
(Horn and Johnson, "Matrix Analysis", sect. 4.5 and 6.1).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from varcalc.certificates.balls import Ball, flint, solved
from varcalc.certificates.integrals import Unproved
from varcalc.certificates.jets import Jet, jets
from varcalc.certificates.smooth import Undecided
from varcalc.symbolic.instructions import Program

POLISHES = 8
"""Steps of Newton's method at most, each of which doubles the digits."""
RADII = tuple(2.0**-k for k in (80, 64, 48, 36, 28))
"""Half-widths, relative to the scales, of the boxes in which there is one stationary point."""
HALVINGS_OF_LEAST = 48
"""Of the box in which it is the least."""
STIFFNESSES = (3.0, 30.0, 300.0)
"""Weights of the equations that are tried, in units of f's second derivatives."""


@dataclass(frozen=True)
class LagrangeFunction:
    """l(z, lambda; parameters), one number, of ``count`` unknowns z, with the equations' multipliers last.

    ``scales`` are the sizes of all variables, by which boxes are measured.
    """

    program: Program
    count: int
    parameters: Sequence[Ball]
    scales: np.ndarray

    @property
    def equations(self) -> int:
        """How many there are."""
        return len(self.scales) - self.count

    def jet(self, at: Sequence[Ball], order: int) -> Jet:
        """l about a point, or a box."""
        variables = [Jet(ball, {i: flint().arb(1)} if order else None) for i, ball in enumerate(at)]
        return jets(self.program, [variables, [Jet(p) for p in self.parameters]], order)[0][0]

    def gradient(self, at: Sequence[Ball]) -> list[Ball]:
        """Its first derivatives."""
        return self._firsts(self.jet(at, 1))

    def _firsts(self, jet: Jet) -> list[Ball]:
        return [flint().arb(0) + jet.first.get(i, 0) for i in range(len(self.scales))]

    def hessian(self, at: Sequence[Ball]) -> list[list[Ball]]:
        """Its second derivatives."""
        second, found, n = self.jet(at, 2).second, flint(), len(self.scales)
        return [[found.arb(0) + second.get((min(i, j), max(i, j)), 0) for j in range(n)] for i in range(n)]

    def _step(self, matrix: list[list[Ball]], gradient: list[Ball]) -> list[Ball]:
        try:
            return solved(matrix, gradient)
        except ZeroDivisionError:
            raise Unproved("the stationary point is not proved to be one alone: it is on a caustic, or near") from None

    def enclosed(self, guess: Sequence[float]) -> list[Ball]:
        """The stationary point near a guess; Unproved where none is proved, or it may not be one alone."""
        found = flint()
        at = [found.arb(float(v)) for v in guess]
        for _ in range(POLISHES):
            step = self._step(self.hessian(at), self.gradient(at))
            at = [(a - s).mid() for a, s in zip(at, step, strict=True)]
            if not all(a.is_finite() for a in at):
                raise Unproved("Newton's method leads away from the ray")
        gradient = self.gradient(at)
        for radius in RADII:
            widths = [radius * scale for scale in self.scales.tolist()]
            room = [found.arb(0, width) for width in widths]
            try:
                step = self._step(self.hessian([a + r for a, r in zip(at, room, strict=True)]), gradient)
            except (Unproved, Undecided):
                continue
            if all(bool(abs(s) < width) for s, width in zip(step, widths, strict=True)):
                return [a - s for a, s in zip(at, step, strict=True)]
        raise Unproved("no stationary point is proved to lie near the ray: it ends on a caustic, or near")

    def falling(self, at: Sequence[Ball]) -> int:
        """In how many directions that the equations admit f falls from the stationary point; Unproved if unknown."""
        signs = inertia(_scaled(self.hessian(at), self._units(at)))
        if signs is None:
            raise Unproved("the signs of the second derivatives are not proved: the ray ends on a caustic, or near")
        return signs.count(-1) - self.equations

    def _units(self, at: Sequence[Ball]) -> np.ndarray:
        """What rows and columns are multiplied by so that all are of one size."""
        matrix = np.array([[float(v.mid()) for v in row] for row in self.hessian(at)])
        z = slice(0, self.count)
        curved = np.abs(matrix[z, z]).max() or 1.0
        slopes = np.abs(matrix[z, self.count :]).max(axis=0, initial=0.0)
        own = np.full(self.count, curved**-0.5)
        return np.r_[own, curved**0.5 / np.where(slopes > 0, slopes, 1.0)]

    def room(self, at: Sequence[Ball]) -> float:
        """How far, relative to the scales, z may lie from a stationary point, f being least there of all admissible z.

        f + lambda phi + c phi^2/2 is f where phi = 0, and where its second derivatives are positive definite, in a
        whole box, it is nowhere less than at its stationary point. Raises Unproved if there is no such box.
        """
        best = 0.0
        for stiffness in STIFFNESSES:
            for k in range(1, HALVINGS_OF_LEAST):
                if 2.0**-k <= best:
                    break
                if self._convex(at, 2.0**-k, stiffness):
                    best = 2.0**-k
                    break
        if not best:
            raise Unproved("the ray is not proved to be the least of any near it")
        return best

    def _convex(self, at: Sequence[Ball], radius: float, stiffness: float) -> bool:
        """Whether f + lambda phi + c phi^2/2 has positive second derivatives for all z in a box."""
        found, n = flint(), self.count
        z = [a + found.arb(0, radius * float(s)) for a, s in zip(at[:n], self.scales[:n], strict=True)]
        units = self._units(at)
        weights = [found.arb(stiffness * float(u) ** 2) for u in units[n:]]
        try:
            # c phi + lambda takes the place of lambda
            missed = self.gradient([*z, *at[n:]])[n:]
            moved = [v + c * m for v, c, m in zip(at[n:], weights, missed, strict=True)]
            matrix = self.hessian([*z, *moved])
        except Undecided:
            return False
        bent = [row[:n] for row in matrix[:n]]
        for i, j in np.ndindex(n, n):
            bent[i][j] += sum(c * matrix[i][n + k] * matrix[j][n + k] for k, c in enumerate(weights))
        signs = inertia(_scaled(bent, units[:n]))
        return signs is not None and -1 not in signs


def _scaled(matrix: list[list[Ball]], units: np.ndarray) -> list[list[Ball]]:
    scale = np.outer(units, units).tolist()
    return [[v * s for v, s in zip(row, factors, strict=True)] for row, factors in zip(matrix, scale, strict=True)]


def inertia(matrix: list[list[Ball]]) -> list[int] | None:
    """The signs of the eigenvalues of all symmetric matrices in balls, one for each; None where they are not proved.

    A congruence by the eigenvectors in doubles, divided by the roots of the eigenvalues, leaves signs on the diagonal
    and little beside it. Where each row's diagonal exceeds the rest the matrix has these signs (Gershgorin), it is
    not singular, and so neither is what it was multiplied by.
    """
    if not matrix:
        return []
    middle = np.array([[float(v.mid()) for v in row] for row in matrix])
    if not np.isfinite(middle).all():
        return None
    values, vectors = np.linalg.eigh(0.5 * (middle + middle.T))
    if not np.abs(values).min() > 0:
        return None
    found = flint()
    factor = found.arb_mat((vectors / np.sqrt(np.abs(values))).tolist())
    turned = factor.transpose() * found.arb_mat(matrix) * factor
    signs = []
    for i in range(len(matrix)):
        head = turned[i, i]
        rest = sum((abs(turned[i, j]).upper() for j in range(len(matrix)) if j != i), found.arb(0))
        if not abs(head) > rest:
            return None
        signs.append(1 if head > 0 else -1)
    return signs
