"""From deflection angles back to the potential."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from varcalc.mechanics.arguments import sampled
from varcalc.numerics.mesh import composite_gauss
from varcalc.problem.conditions import positive, reals
from varcalc.spelling import spelled

GAUSS_POINTS = 16
FARTHEST_LOGARITHM = 80.0
"""Of ln(2b/w): beyond it next to nothing is left of an angle that falls off as 1/b."""
FIRST, PANEL_DOUBLINGS = 10, 7
"""Panels to begin with, and times their number is doubled."""
AGREED = 1e-12
"""Of the exponent: how well two rules must agree, of which the finer is better still."""


@spelled
def firsov(deflection: Callable[[np.ndarray], np.ndarray], energy: float, w: Any) -> tuple[np.ndarray, np.ndarray]:
    """The potential that deflects by the angles ``deflection(b)``, by Firsov's inversion.

    With w = r √(1 - U/E), which falls with r where no orbit goes round for ever,
    r = w exp((1/π) ∫ χ(b)/√(b² - w²) db from w to infinity) (O. B. Firsov 1953; Landau and Lifshitz, "Mechanics",
    sect. 18, problem 7); with b = w cosh t nothing in it is singular.

    Raises ValueError for an energy or a ``w`` that is not positive, and where the integral is not resolved, as when an
    orbit goes round for ever at some b > w, or angles jump.

    Parameters
    ----------
    deflection : callable
        Angles in radians of impact parameters (m,); smooth.
    energy : float
        Of the orbits, in the units of the potential.
    w : array
        Positive numbers, of any shape: the impact parameters whose closest approach is looked for.

    Returns
    -------
    r, potential : arrays of the shape of ``w``

    Examples
    --------
    >>> import numpy as np
    >>> r, potential = firsov(lambda b: 2 * np.arctan(1 / (2 * b)), 1.0, [0.5, 2.0])
    >>> bool(np.max(np.abs(potential * r - 1)) < 1e-12)
    True
    """
    energy = positive("energy", energy)
    start = reals("w", w)
    if not np.all((start > 0) & np.isfinite(start)):
        raise ValueError(f"w must be positive numbers, not {w!r}")
    flat, panels = start.ravel(), FIRST
    last = _exponent(deflection, flat, panels)
    for _ in range(PANEL_DOUBLINGS):
        panels *= 2
        before, last = last, _exponent(deflection, flat, panels)
        if np.all(np.abs(last - before) <= AGREED):
            break
    else:
        raise ValueError("deflection is not smooth, or not finite, beyond w: its integral is not resolved")
    r = (flat * np.exp(last)).reshape(start.shape)
    return r[()], (-energy * np.expm1(-2 * last)).reshape(start.shape)[()]


def _exponent(deflection: Callable[[np.ndarray], np.ndarray], w: np.ndarray, panels: int) -> np.ndarray:
    """ln(r/w) (m,) by so many panels of Gauss's rule."""
    edges = FARTHEST_LOGARITHM * np.linspace(0.0, 1.0, panels + 1) ** 2  # narrow where the orbit comes close
    t, weights = composite_gauss(edges, GAUSS_POINTS)
    angles = sampled("deflection", deflection, (w[:, None] * np.cosh(t)).ravel()).reshape(len(w), len(t))
    return angles @ weights / np.pi
