"""How far rays may go in one step while they turn little."""

from __future__ import annotations

import numpy as np

from varcalc.optics.beam import Beam
from varcalc.optics.media import Field

TURN = 0.3
"""How far a ray turns over one step, in radians, by order of magnitude."""
LEAST, MOST = 0.1, 4.0
"""By how much less and more than it should a ray may go in order to keep step with the others."""
NEWTON = 6
"""Newton's steps."""


def stride(beam: Beam, field: Field, length: np.ndarray) -> np.ndarray:
    """σ (m,) over which the rays turn little and go no farther than about ``length`` (m,); zero where none is known.

    A ray whose momentum is all but spent turns quickly in space, not in momentum: there it is the pull that counts.
    """
    _, gradient, hessian = field(beam.position)
    momentum, pull = np.linalg.norm(beam.momentum, axis=1), np.linalg.norm(gradient, axis=1) / 2
    with np.errstate(all="ignore"):
        turning = TURN * np.fmax(momentum / pull, np.sqrt(length / pull))
        bending = TURN * 2 / np.sqrt(np.linalg.norm(hessian, axis=(1, 2)))
        step = np.fmin(np.fmin(turning, bending), length / momentum)
    return np.where(np.isfinite(step), step, 0.0)


def to_front(beam: Beam, field: Field, path: np.ndarray, usual: np.ndarray, slack: np.ndarray) -> np.ndarray:
    """σ (m,) over which ∫ (n² + slack) dσ grows by about ``path`` (m,), at least by a share of ``usual``.

    By the Taylor polynomial of the third degree; dS/dσ = n², the square of the momentum.
    """
    _, gradient, hessian = field(beam.position)
    p, pull = beam.momentum, gradient / 2
    path = np.clip(path, LEAST * usual, MOST * usual)
    first, second = np.sum(p**2, axis=1) + slack, np.sum(p * pull, axis=1)
    third = (np.sum(pull**2, axis=1) + np.einsum("mi,mij,mj->m", p, hessian, p) / 2) / 3
    with np.errstate(all="ignore"):
        sigma = path / first
        for _ in range(NEWTON):
            off = sigma * (first + sigma * (second + sigma * third)) - path
            slope = first + sigma * (2 * second + 3 * sigma * third)
            new = sigma - off / slope
            sigma = np.where((slope > 0) & (new > 0), new, sigma / 2)
    return np.where(np.isfinite(sigma), sigma, 0.0)
