"""Rules that resolve a curve to round-off, and what is left unresolved."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from varcalc.methods.quadrature.contract import Joined, measure_one
from varcalc.methods.quadrature.energy import Measured
from varcalc.methods.quadrature.panels import EPSILON, GRADED, Map, Panels, tails

ROUNDS = 14
MOST_PANELS = 120
WORTHWHILE = 0.8
"""A round that leaves more than this share of the error counts as stale: what is left is noise."""
SMALLEST_FIRST = 2e-3
"""A first panel bisected below this shows an end that is no half-integer power."""
ALLOWED = 8 * EPSILON
"""Quadrature error of a panel, relative to the whole, that is left alone."""


def refined_panels(joined: Joined) -> tuple[Panels, ...] | None:
    """Rules that resolve the curve to round-off, or as well as its noise allows; None when those it has do already."""
    panels = [leg.panels for leg in joined.batch.legs]
    measured, best, least, stale = joined.measured, None, np.inf, 0
    for _ in range(ROUNDS):
        errors = _leg_errors(measured)
        marks = [e > ALLOWED for e in errors]
        total = sum(float(e.sum()) for e in errors)
        stale = stale + 1 if total > WORTHWHILE * least else 0
        if total < least:
            best, least = tuple(panels), total
        if not any(m.any() for m in marks) or stale > 1 or sum(p.count for p in panels) > MOST_PANELS:
            break
        panels = [_improved(p, m) for p, m in zip(panels, marks, strict=True)]
        measured = measure_one(joined.family.ruled(tuple(panels)), joined.parameter, joined.multipliers)
        if not np.isfinite(measured.x[0]):
            break
    return None if best == tuple(leg.panels for leg in joined.batch.legs) else best


def _leg_errors(measured: Measured) -> list[np.ndarray]:
    """The larger relative quadrature error, of the reach and of the functional, of each panel of each leg."""
    x = sum(float(np.abs(d).sum()) for d in measured.dx)
    value = sum(float(np.abs(d).sum()) for d in measured.dl)
    return [
        np.maximum(tails(dx[0]) / max(x, 1e-300), tails(dl[0]) / max(value, 1e-300))
        for dx, dl in zip(measured.dx, measured.dl, strict=True)
    ]


def _improved(panels: Panels, marked: np.ndarray) -> Panels:
    if panels.kind is Map.SQUARE and marked[0] and panels.edges[1] < SMALLEST_FIRST:
        return GRADED
    return panels.split(marked) if marked.any() else panels


def quadrature_errors(measured: Measured) -> tuple[float, float]:
    """Estimated absolute quadrature errors of the abscissa covered and of the Lagrangian function's integral."""
    return tuple(sum(float(tails(d[0]).sum()) for d in part) for part in (measured.dx, measured.dl))  # type: ignore[return-value]


def truncation(panels: Sequence[Panels], measured: Measured) -> tuple[float, float]:
    """What the exponential map leaves out next to its ends, from the power found at its first two nodes."""
    out = [0.0, 0.0]
    for rule, parts in zip(panels, zip(measured.dx, measured.dl, strict=True), strict=True):
        if rule.kind is not Map.EXPONENTIAL:
            continue
        share, weights = rule.distances
        for k, part in enumerate(parts):
            density = np.abs(part[0][:2] / weights[:2]) * share[:2]
            if density[0] > 0:
                power = np.log(density[1] / density[0]) / np.log(share[1] / share[0])
                out[k] += float(density[0] / power) if power > 0 else np.inf
    return out[0], out[1]
