"""Angles about a centre along legs of an orbit that comes from far away, as integrals of what is nowhere singular.

Of an orbit with the impact parameter b, (dr/dφ)² = r⁴ (F - b²/r²)/b² with F = 1 - U/E (Brizard, "An Introduction to
Lagrangian Mechanics", eq. 5.14). A leg is what lies outside its innermost radius r₁. With r = r₁/cos q the angle is the
integral over q of

    h = a/√(a² + D + Q/sin² q),   a = b/r₁,  D = (F(r) - F(r₁))/sin² q,  Q = F(r₁) - a².

At a turning point Q = 0 and a² = F(r₁); at an edge at which the orbit is thrown back or goes on, Q is what is left of
the radial motion. Of a free orbit h = 1, so that what the orbit is bent by is the integral of 1 - h, whose digits are
all good however small it is.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from varcalc.mechanics.scattering.pieces import FeltChange, PieceOfEnergy
from varcalc.numerics.one_coordinate.quadrature import integrals

LEGS_TOGETHER = 512
"""Legs that are integrated together; their arrays stay in the cache."""
DEEP = 2.0
"""F at the inner end beyond which q is counted from the outer end."""
FAR_OUT = 0.5
"""r₁/r below which a potential is told from its value and not from its change."""


@dataclass(frozen=True)
class Legs(ABC):
    """m legs in one piece outside the radii ``inner`` (m,), of orbits with ``impact`` parameters (m,).

    ``share`` and ``slope`` (m,) are F and r F' at the inner radius; integrals are resolved to ``agreed`` (m,).
    """

    medium: PieceOfEnergy
    inner: np.ndarray
    impact: np.ndarray
    share: np.ndarray
    slope: np.ndarray
    agreed: np.ndarray

    @property
    def stops(self) -> np.ndarray:
        """None: there are no edges inside a piece."""
        return np.zeros(0)

    @property
    def gentle(self) -> np.ndarray:
        """Radii between which F varies gently."""
        return self.medium.gentle

    def take(self, rows: np.ndarray | slice) -> Self:
        """The legs of ``rows``."""
        arrays = {f.name: getattr(self, f.name)[rows] for f in fields(self) if f.name != "medium"}
        return type(self)(medium=self.medium, **arrays)

    def height(self, u: np.ndarray) -> np.ndarray:
        """The parameter q (m, k) at radii ``u`` (k,)."""
        return self._counted(np.arccos(self.inner[:, None] / u))

    def _counted(self, q: np.ndarray) -> np.ndarray:
        """q (m, k) from the inner end, or from the outer one: deep in a well all that matters may lie far outside."""
        return np.where(self.share[:, None] > DEEP, np.pi / 2 - q, q)

    def integrands(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The radii (m, k) at ``q`` (m, k); 1 - h and the derivative of h by the impact parameter (2, m, k)."""
        outside = self.share > DEEP
        mixed = np.any(outside)
        if not mixed and np.all(q == q[:1]):
            q = q[:1]  # as many legs begin: one row of sines does for all
        sine, cosine = np.sin(q), np.cos(q)
        if mixed:
            sine[outside], cosine[outside] = cosine[outside], sine[outside]
        inner, squared = self.inner[:, None], sine**2
        r = inner / cosine
        # r - r₁ without cancellation
        felt = self.medium.changes(inner, squared * r / (1 + cosine))
        a = (self.impact / self.inner)[:, None]
        excess = (felt.change + self._left[:, None]) / squared
        # far out F is not told from its change since r₁, where it may have been large
        far = cosine < FAR_OUT
        total = np.where(far, (felt.share - (a * cosine) ** 2) / squared, a**2 + excess)
        root = np.sqrt(total)
        by_impact = self._by_impact(felt, far) / (squared * total * root)
        return r, np.stack([excess / (root * (root + a)), by_impact])

    @property
    @abstractmethod
    def _left(self) -> np.ndarray:
        """Q (m,)."""

    @abstractmethod
    def _by_impact(self, felt: FeltChange, far: np.ndarray) -> np.ndarray:
        """dh/db times (F - a² cos² q)^(3/2)/sin q; ``far`` says where changes tell less than values."""

    @abstractmethod
    def ends_by_impact(self, outer: float) -> np.ndarray:
        """The derivative (m,) by the impact parameter of the parameter q at an ``outer`` radius."""

    @abstractmethod
    def straight(self, free: np.ndarray, outer: float) -> BentAngles:
        """The angles where no force acts, ``free`` (m,) being q at the ``outer`` radius."""

    def angles(self, outer: float) -> BentAngles:
        """The angles about the centre out to the radius ``outer``, which may be infinite."""
        with np.errstate(all="ignore"):
            free = np.arccos(self.inner / outer)
            if self.medium.piece.constant:
                return self.straight(free, outer)
            bent, by_impact = self._integrated(free).T
            if np.isinf(outer):
                return BentAngles(free, bent, by_impact)
            h = 1 - self.integrands(self._counted(free[:, None]))[1][0, :, 0]
            return BentAngles(free, bent, by_impact + h * self.ends_by_impact(outer))

    def _integrated(self, free: np.ndarray) -> np.ndarray:
        """The integrals (m, 2) of what :meth:`integrands` gives."""
        ends = np.column_stack([self._counted(0 * free[:, None]), self._counted(free[:, None])])
        low, high = np.sort(ends, axis=1).T
        parts = [np.zeros((0, 2))]
        for k in range(0, len(free), LEGS_TOGETHER):
            part = slice(k, k + LEGS_TOGETHER)
            parts.append(integrals(self.take(part), low[part], high[part], agreed=self.agreed[part]))
        return np.concatenate(parts)


@dataclass(frozen=True)
class BentAngles:
    """Angles about the centre: what they were without a potential (m,), less what they are ``bent`` by (m,).

    ``by_impact`` (m,) is the derivative of the angle by the impact parameter.
    """

    free: np.ndarray
    bent: np.ndarray
    by_impact: np.ndarray


class TurningLegs(Legs):
    """Legs that begin at a turning point: b² = r₁² F(r₁)."""

    @property
    def _left(self) -> np.ndarray:
        return np.zeros_like(self.inner)

    def _by_impact(self, felt: FeltChange, far: np.ndarray) -> np.ndarray:
        # r₁ follows from b by dr₁/db = 2b/(r₁ (2F + r F'))
        steep, share, slope = (
            (self.inner * (2 * self.share + self.slope))[:, None],
            self.share[:, None],
            self.slope[:, None],
        )
        near = slope * felt.change - share * felt.bend
        return np.where(far, slope * felt.share - share * felt.slope, near) / steep

    def ends_by_impact(self, outer: float) -> np.ndarray:
        """See :meth:`Legs.ends_by_impact`."""
        moved = 2 * np.sqrt(self.share) / (2 * self.share + self.slope)
        return -moved / np.sqrt((outer - self.inner) * (outer + self.inner))

    def straight(self, free: np.ndarray, outer: float) -> BentAngles:
        """See :meth:`Legs.straight`."""
        return BentAngles(free, 0 * free, self.ends_by_impact(outer) if np.isfinite(outer) else 0 * free)


class EdgeLegs(Legs):
    """Legs that begin at an edge, where something is left of the radial motion."""

    @property
    def _left(self) -> np.ndarray:
        return self.share - (self.impact / self.inner) ** 2

    def _by_impact(self, felt: FeltChange, far: np.ndarray) -> np.ndarray:  # noqa: ARG002
        return felt.share / self.inner[:, None]

    def ends_by_impact(self, outer: float) -> np.ndarray:  # noqa: ARG002
        """See :meth:`Legs.ends_by_impact`."""
        return np.zeros_like(self.inner)

    def straight(self, free: np.ndarray, outer: float) -> BentAngles:
        """A straight line at the speed that the energy leaves: it meets both ends at sin = b/(r √F)."""
        speed = np.sqrt(self.share)
        at_inner, at_outer = self.impact / (speed * self.inner), self.impact / (speed * outer)
        angle = np.arcsin(at_inner) - np.arcsin(at_outer)
        slope = 1 / (speed * self.inner * np.sqrt(1 - at_inner**2)) - 1 / (speed * outer * np.sqrt(1 - at_outer**2))
        return BentAngles(free, free - angle, slope)
