"""Rules that resolve a curve to round-off, and what is left unresolved."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from varcalc.methods.first_integral.contract import Joined
from varcalc.methods.first_integral.hidden import hiding
from varcalc.methods.first_integral.lines import CurveIntegrals
from varcalc.numerics.one_coordinate.panels import GRADED, DistanceMap, Panels, tails
from varcalc.numerics.roots import EPSILON

MOST_REFINEMENTS, LOOKS = 14, 60
"""Bisections that lower an error, and with which what is narrow is looked for: the narrowest that is a number."""
WORTHWHILE = 0.8
"""A round that leaves more than this share of the error counts as stale: what is left is noise."""
SMALLEST_FIRST = 2e-3
"""A first panel bisected below this shows an end that is no half-integer power."""
TELLS_NOTHING = 1e-6
"""Relative error from which on rules tell nothing that an answer could be made of."""
ALLOWED = 8 * EPSILON
"""Quadrature error of a panel, relative to the whole, that is left alone."""
DECADES = tuple(10.0**-k for k in range(15, 0, -1))
"""Edges, in units of the first panel, that show what a rule misses next to an end: L may be infinite just beyond it."""
MISSED = 64 * EPSILON
"""Relative change by such a rule that is more than round-off."""


def refined_panels(joined: Joined) -> tuple[Panels, ...] | None:
    """Rules that resolve the curve to round-off, or as well as its noise allows; None when those it has do already."""
    given = _panels(joined)
    best = _bisected(joined)
    toward = _toward_ends(_panels(best))
    closer = joined.ruled(toward)
    if np.isfinite(closer.measured.x[0]) and (
        max(_changes(best.measured, closer.measured)) > MISSED
        or any(e[0] > ALLOWED for e in _leg_errors(best.measured))
    ):
        graded = _bisected(closer)
        missed = max(_changes(best.measured, graded.measured)) > MISSED
        best = graded if missed or _total(graded.measured) < _total(best.measured) else best
    return None if _panels(best) == given else _panels(best)


def _panels(joined: Joined) -> tuple[Panels, ...]:
    return tuple(leg.panels for leg in joined.batch.legs)


def _total(measured: CurveIntegrals) -> float:
    """The relative quadrature error that the coefficients of the integrands tell."""
    return sum(float(e.sum()) for e in _leg_errors(measured))


def unseen(joined: Joined) -> tuple[float, float]:
    """By how much reach and functional change, in absolute terms, when every leg's rule is graded toward its anchor.

    A rule cannot tell from its own points that the integrand changes between the anchor and the first of them, as it
    does where L is infinite just beyond an end.
    """
    closer = joined.ruled(_toward_ends(_panels(joined))).measured
    changes = _changes(joined.measured, closer)
    if max(changes) <= MISSED:
        return 0.0, 0.0
    reach, value = (change * size for change, size in zip(changes, _sizes(joined.measured), strict=True))
    return reach, value


def _toward_ends(panels: Sequence[Panels]) -> tuple[Panels, ...]:
    """The same rules with the first panel of each graded toward the leg's anchor."""
    return tuple(
        Panels(p.kind, (0.0, *(p.edges[1] * d for d in DECADES), *p.edges[1:])) if p.kind is DistanceMap.SQUARE else p
        for p in panels
    )


def _changes(before: CurveIntegrals, after: CurveIntegrals) -> tuple[float, float]:
    """The differences between two rules, of each leg's reach and functional, relative to the whole of each."""
    pairs = ((before.dx, after.dx), (before.dl, after.dl))
    reach, value = (
        sum(abs(float(a.sum() - b.sum())) for a, b in zip(first, second, strict=True)) / size
        for (first, second), size in zip(pairs, _sizes(before), strict=True)
    )
    return reach, value


def _sizes(measured: CurveIntegrals) -> tuple[float, float]:
    """The integrals of the absolute values of the reach's and the functional's integrand."""
    reach, value = (max(sum(float(np.abs(d).sum()) for d in part), 1e-300) for part in (measured.dx, measured.dl))
    return reach, value


def _bisected(joined: Joined) -> Joined:
    """The curve by rules with panels bisected as far as that lowers the error their coefficients tell.

    By those it was given where as many as there may be tell nothing: each costs as much as one that tells all.
    """
    given, best, least, stale = joined, joined, np.inf, 0
    for _ in range(MOST_REFINEMENTS):
        seeing = _seeing(joined)
        if seeing is None:
            return given
        joined, panels = seeing, _panels(seeing)
        marks, total = [e > ALLOWED for e in _leg_errors(joined.measured)], _total(joined.measured)
        stale = stale + 1 if total > WORTHWHILE * least else 0
        if total < least:
            best, least = joined, total
        too_many = sum(p.count for p in panels) > joined.family.lines.most_panels
        if too_many and least > TELLS_NOTHING:
            return given
        if not any(m.any() for m in marks) or stale > 1 or too_many:
            break
        joined = joined.ruled([_improved(p, m) for p, m in zip(panels, marks, strict=True)])
        if not np.isfinite(joined.measured.x[0]):
            break
    return best


def _seeing(joined: Joined) -> Joined | None:
    """The curve by rules with panels bisected until nothing of the integrands hides between their points.

    None where that takes too many.
    """
    for _ in range(LOOKS):
        marks = hiding(joined)
        if not any(m.any() for m in marks) or not np.isfinite(joined.measured.x[0]):
            break
        panels = [p.split(m) if m.any() else p for p, m in zip(_panels(joined), marks, strict=True)]
        if sum(p.count for p in panels) > joined.family.lines.most_panels:
            return None
        joined = joined.ruled(panels)
    return joined


def _leg_errors(measured: CurveIntegrals) -> list[np.ndarray]:
    """The larger relative quadrature error, of the reach and of the functional, of each panel of each leg."""
    x, value = _sizes(measured)
    return [np.maximum(tails(dx[0]) / x, tails(dl[0]) / value) for dx, dl in zip(measured.dx, measured.dl, strict=True)]


def _improved(panels: Panels, marked: np.ndarray) -> Panels:
    if panels.kind is DistanceMap.SQUARE and marked[0] and panels.edges[1] < SMALLEST_FIRST:
        return GRADED
    return panels.split(marked) if marked.any() else panels


def quadrature_errors(measured: CurveIntegrals) -> tuple[float, float]:
    """Estimated absolute quadrature errors of the abscissa covered and of the Lagrangian function's integral."""
    return tuple(sum(float(tails(d[0]).sum()) for d in part) for part in (measured.dx, measured.dl))  # type: ignore[return-value]


def truncation(panels: Sequence[Panels], measured: CurveIntegrals) -> tuple[float, float]:
    """What the exponential map leaves out next to its ends, from the power found at its first two nodes."""
    out = [0.0, 0.0]
    for rule, parts in zip(panels, zip(measured.dx, measured.dl, strict=True), strict=True):
        if rule.kind is not DistanceMap.EXPONENTIAL:
            continue
        share, weights = rule.distances
        for k, part in enumerate(parts):
            density = np.abs(part[0][:2] / weights[:2]) * share[:2]
            if density[0] > 0:
                power = np.log(density[1] / density[0]) / np.log(share[1] / share[0])
                out[k] += float(density[0] / power) if power > 0 else np.inf
    return out[0], out[1]
