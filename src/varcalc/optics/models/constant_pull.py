"""All rays between two points where ∇n² is constant: parabolas, at most two, by a quadratic equation; or one line.

With g = ∇n²/2 the ray equation r'' = g has r = a + p σ + g σ²/2, and |p|² = n²(a) makes

    |g|² s²/4 - (n²(a) + g·(b - a)) s + |b - a|² = 0

of the ends, with s = σ² (the trajectories of a thrown stone; Goldstein, Poole and Safko, "Classical Mechanics", 3rd
ed., ch. 1). The optical path is n²(a) σ + g·p σ² + |g|² σ³/3. Where g is nothing the other parabola is infinitely far.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from varcalc.optics.media.medium import Medium
from varcalc.optics.models.aimed import Aimed, Carry, Tell, met
from varcalc.optics.models.linear import is_linear
from varcalc.optics.rays.ray import SHADOW, Ray, Rays, no_rays
from varcalc.symbolic.evaluation import PointEvaluator

TOUCHES = 2e-13
"""Of the distance of two points: a caustic so close to the second touches it."""


@dataclass(frozen=True)
class ConstantPull:
    """The rays of a medium whose ∇n²/2 is ``pull`` (d,) everywhere; ``squared`` gives n² at points."""

    pull: np.ndarray
    squared: PointEvaluator

    @classmethod
    def of(cls, medium: Medium, dimension: int) -> ConstantPull | None:
        """The medium's; None where ∇n² is not constant."""
        if not is_linear(medium, dimension):
            return None
        position = ca.SX.sym("r", dimension)
        squared = ca.SX(medium.squared_index(position))
        slope = ca.densify(ca.gradient(squared, position))
        if ca.depends_on(slope, position):
            return None
        return cls(np.array(ca.evalf(slope / 2)).ravel(), PointEvaluator(ca.Function("squared", [position], [squared])))

    def applies(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:  # noqa: ARG002
        """True (q,): for all points."""
        return np.ones(len(a), dtype=bool)

    def rays(
        self, a: np.ndarray, b: np.ndarray, within: np.ndarray, carry: Carry, careful: Carry | None = None,
        tell: Tell | None = None,  # noqa: ARG002  to carry these rays is as cheap
    ) -> list[Rays]:  # fmt: skip
        """The rays from each point ``a`` (q, d) to ``b`` (q, d) up to an optical path ``within`` (q,)."""
        carried = met(len(a), self._aimed(a, b, within), None, carry, careful, None)
        known = "the two parabolas through both points, of a constant gradient of n²"
        known = known if np.any(self.pull) else "the straight line through both points, of a constant index"
        return [_answer(*own, known) for own in zip(carried, within, strict=True)]

    def _aimed(self, a: np.ndarray, b: np.ndarray, within: np.ndarray) -> Aimed:
        squared = self.squared(len(a), a)[:, 0]
        way, pull = b - a, float(np.linalg.norm(self.pull))
        far, climb = np.linalg.norm(way, axis=1), way @ self.pull
        middle = squared + climb  # half the sum of the two σ², in units of 2 / |g|²
        inside = middle - pull * far  # positive where the point is not in the shadow
        touching = (middle > 0) & (np.abs(inside) <= TOUCHES * pull * far)
        root = np.sqrt(np.where(touching, 0.0, np.maximum(inside * (middle + pull * far), 0.0)))
        lit = touching | ((middle > 0) & (inside > 0))
        with np.errstate(all="ignore"):
            sigma = np.sqrt(np.stack([2 * far**2 / (middle + root), 2 * (middle + root) / pull**2], axis=1))
            start = way[:, None, :] / sigma[..., None] - sigma[..., None] * self.pull / 2
            path = (squared[:, None] + pull**2 * sigma**2 / 3) * sigma + (start @ self.pull) * sigma**2
        wanted = lit[:, None] & (path <= within[:, None]) & ~(touching[:, None] & [False, True])
        question, which = np.nonzero(wanted)
        start = start[question, which]
        headings = start / np.linalg.norm(start, axis=1, keepdims=True)
        nothing = np.zeros(len(question))
        unknown = np.full(len(question), -1)
        return Aimed(question, headings, path[question, which], touching[question], nothing, unknown)


def _answer(rays: list[Ray], within: float, known: str) -> Rays:
    searched = f"{known}, optical paths up to {within:.6g}"
    return Rays(tuple(rays), "", searched) if rays else no_rays(SHADOW, searched)
