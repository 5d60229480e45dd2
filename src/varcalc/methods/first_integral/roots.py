"""One root between two signs."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from varcalc.methods.first_integral.panels import EPSILON

ROOT_STEPS = 100


def bracketed_root(function: Callable[[float], float], low: float, high: float, close: float) -> float | None:
    """A root by Chandrupatla's method (1997); None when the ends do not bracket one or it runs into no number."""
    a, b = low, high
    fa, fb = function(a), function(b)
    if not (np.isfinite(fa) and np.isfinite(fb)) or fa * fb > 0:
        return None
    c, fc, share, best = a, fa, 0.5, a
    for _ in range(ROOT_STEPS):
        at = a + share * (b - a)
        value = function(at)
        if not np.isfinite(value):
            return None
        if value * fa > 0:
            c, fc = a, fa
        else:
            c, b, fc, fb = b, a, fb, fa
        a, fa = at, value
        best, least = (a, fa) if abs(fa) < abs(fb) else (b, fb)
        tolerance = 2 * EPSILON * abs(best) + 1e-300
        if abs(least) <= close or abs(b - a) <= tolerance:
            return best
        share = _interpolated(a, b, c, fa, fb, fc, tolerance / abs(b - a))
    return best


def _interpolated(a: float, b: float, c: float, fa: float, fb: float, fc: float, edge: float) -> float:
    """Where to look next, as a share of the way from a to b: inverse quadratic interpolation if safe, else halfway."""
    with np.errstate(all="ignore"):
        xi, phi = (a - b) / (c - b), (fa - fb) / (fc - fb)
        if not (phi**2 < xi and (1 - phi) ** 2 < 1 - xi):
            return 0.5
        share = fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb)
    return min(1 - edge, max(edge, share))
