"""By how much a composite Gauss rule misses an integral, told from its own samples.

The samples at the points of a panel give the Legendre coefficients of the
integrand there; the rule of Q points integrates a polynomial of degree 2 Q - 1
exactly, so what the coefficients will have fallen to at 2 Q is what it misses
(Trefethen, "Is Gauss quadrature better than Clenshaw-Curtis?", SIAM Review 50,
2008, sect. 4). Only panels where that is more than round-off are bisected.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.polynomial import legendre

from varcalc.numerics.mesh import gauss

RESOLVED = 1e-14
"""Share of the integral of the absolute value that one panel may miss; samples carry round-off of a tenth of it."""
MOST_ROUNDS = 40
"""Bisections that bring a panel with a kink inside to round-off."""
MOST_PANELS = 4000
"""Panels bisected at once beyond which an integrand is noise."""


@lru_cache(maxsize=64)
def _transform(count: int) -> np.ndarray:
    """The matrix from samples at the Gauss points to Legendre coefficients, the upper half of them; (count, rows)."""
    nodes, weights = gauss(count)
    degrees = np.arange(count // 2, count)
    rows = legendre.legvander(nodes, count - 1)[:, count // 2 :] * weights[:, None] * (degrees + 0.5)
    rows.setflags(write=False)
    return rows


def missed(samples: np.ndarray) -> np.ndarray:
    """What the rule misses of the mean over each panel, from ``samples`` (panels, points); shape (panels,).

    The coefficients of the last quarter, taken on to twice the number of
    points at the rate at which they fell from the quarter before.
    """
    count = samples.shape[1]
    coefficients = np.abs(samples @ _transform(count))
    middle = coefficients.shape[1] // 2
    before, last = coefficients[:, :middle].max(1), coefficients[:, middle:].max(1)
    rate = np.minimum(last / np.maximum(before, 1e-300), 1.0)
    return last * rate**4


def shortfall(
    sampled: Callable[[np.ndarray], np.ndarray], vertices: np.ndarray, samples: np.ndarray, scale: float
) -> float:
    """The integral less its composite Gauss sum on ``vertices``.

    ``samples`` (elements, points) are the integrand's values in the sum,
    ``sampled`` gives others at abscissae (m,), and ``scale`` is the integral
    of its absolute value. Zero, and ``sampled`` is not called, where the rule
    was fine enough.
    """
    left, half = vertices[:-1], 0.5 * np.diff(vertices)
    nodes, weights = gauss(samples.shape[1])
    found = 0.0
    for _ in range(MOST_ROUNDS):
        poor = missed(samples) * half > RESOLVED * scale
        if not poor.any() or poor.sum() > MOST_PANELS:
            break
        found -= float(half[poor] @ (samples[poor] @ weights))
        half = np.repeat(0.5 * half[poor], 2)
        left = np.repeat(left[poor], 2)
        left[1::2] += 2 * half[1::2]
        samples = sampled((left[:, None] + half[:, None] * (1 + nodes)).ravel()).reshape(len(left), -1)
        found += float(half @ (samples @ weights))
    return found
