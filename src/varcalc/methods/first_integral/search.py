"""Finding the curves of a family that reach the far end."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from varcalc.methods.first_integral.contract import Aim, CurveFamily, Joined
from varcalc.methods.first_integral.lines import CurveIntegrals
from varcalc.methods.first_integral.refinement import refined_panels
from varcalc.numerics.roots import EPSILON, scanned_root

ROUGH = 1e-9
"""Relative miss at which a curve counts as found; refinement follows."""
LOST_CURVE = 1e-9
"""Relative miss beyond which a refined curve counts as lost."""
NEWTON_STEPS = 60
SHORTENED = 0.5 ** np.array([0, 1, 2, 3, 4, 6, 8, 11, 14])
DIFFERENCE = 1e-7
"""Relative step of difference quotients: half the digits of double precision."""
SHRINKING = (1.0, 1e-3, 1e-6)
TINY = 1e-300
REFINEMENTS = 3
NEAR_FOLD = 0.02
"""A greatest or least reach within this share of the wanted one is followed to its exact place."""
FOLD_SCANS = 7
NEAR_EDGE, AT_ONCE = 16, 3
"""Samples from the edge of a family that are looked at again with a finer rule, and steps between them at a time."""


def joining(family: CurveFamily, sample: np.ndarray, aim: Aim) -> list[Joined]:
    """Every curve of a family that covers the target, one for each change of sign over the sample and each fold."""
    multipliers = np.zeros((0, len(sample)))
    assert aim.target is not None
    look = family.looked_at()
    reach = look.lines.measure(look.batch(sample, multipliers)).x - aim.target
    crossings = np.flatnonzero(reach[1:] * reach[:-1] <= 0)
    found = [j for k in crossings if (j := _between(family, sample, int(k), aim)) is not None]
    brackets: list[tuple[float, float]] = []
    for k in range(1, len(sample) - 1):
        around = reach[k - 1 : k + 2]
        if np.isfinite(around).all() and abs(around[1]) < NEAR_FOLD * aim.size:
            brackets += _fold(family, sample[k - 1 : k + 2], around, aim)
    found += [j for a, b in brackets if (j := joined(family, a, b, aim)) is not None]
    first = abs(sample[1] - sample[0])
    if abs(reach[0]) < NEAR_FOLD * aim.size and not any(abs(j.parameter - sample[0]) <= first for j in found):
        found += _at_edge(family, sample, aim)
    return found


def _between(family: CurveFamily, sample: np.ndarray, k: int, aim: Aim) -> Joined | None:
    """The curve between samples k and k + 1, or beside them where the coarse rule mistook the side of one."""
    for a, b in ((k, k + 1), (k - 1, k + 1), (k, k + 2)):
        if a >= 0 and b < len(sample):
            found = joined(family, float(sample[a]), float(sample[b]), aim)
            if found is not None:
                return found
    return None


def _at_edge(family: CurveFamily, sample: np.ndarray, aim: Aim) -> list[Joined]:
    """A curve at or near the edge of its family, where it turns at an end and the coarse rule may mistake its side."""
    none, target, edge = np.zeros(0), aim.target, float(sample[0])
    assert target is not None
    here = Joined.of(family, edge, none)
    panels = refined_panels(here)
    if panels is not None:
        family = family.ruled(panels)
        here = Joined.of(family, edge, none)
    miss = float(here.measured.x[0]) - target
    if abs(miss) <= LOST_CURVE * aim.size:
        return [here]
    beside = sample[:NEAR_EDGE]
    for first in range(0, len(beside) - 1, AT_ONCE):  # the rule may have hundreds of thousands of points
        near = beside[first : first + AT_ONCE + 1]
        reach = family.lines.measure(family.batch(near, np.zeros((0, len(near))))).x - target
        for k in np.flatnonzero(reach[1:] * reach[:-1] < 0)[:1]:
            there = joined(family, float(near[k]), float(near[k + 1]), aim)
            return [] if there is None else [there]
    return []


def _fold(family: CurveFamily, sample: np.ndarray, reach: np.ndarray, aim: Aim) -> list[tuple[float, float]]:
    """The two brackets either side of an extremum of the reach that passes the target between samples."""
    sign = np.sign(reach[1])
    assert aim.target is not None
    if not (np.all(np.sign(reach) == sign) and abs(reach[1]) <= min(abs(reach[0]), abs(reach[2]))):
        return []
    low, high = float(sample[0]), float(sample[2])
    best = float(sample[1])
    for _ in range(FOLD_SCANS):
        at = np.linspace(low, high, 17)
        values = sign * (family.lines.measure(family.batch(at, np.zeros((0, 17)))).x - aim.target)
        k = int(np.argmin(np.nan_to_num(values, nan=np.inf)))
        best, low, high = float(at[k]), float(at[max(k - 1, 0)]), float(at[min(k + 1, 16)])
        if values[k] <= 0:
            return [(float(sample[0]), best), (best, float(sample[2]))]
    return []


def joined(family: CurveFamily, low: float, high: float, aim: Aim) -> Joined | None:
    """The curve between two parameters whose reaches lie either side of the target; None where there is no such curve.

    Found to the precision of the family's rules only; :func:`refined` does the rest.
    """
    none, target = np.zeros(0), aim.target
    assert target is not None

    latest: list[tuple[np.ndarray, CurveIntegrals]] = []

    def miss(parameters: np.ndarray) -> np.ndarray:
        latest[:] = [(parameters, family.lines.measure(family.batch(parameters, np.zeros((0, len(parameters))))))]
        return latest[0][1].x - target

    parameter = scanned_root(miss, low, high, ROUGH * aim.size)
    if parameter is None:
        return None
    [(parameters, measured)] = latest
    return Joined(family, parameter, none, measured.take(int(np.argmin(np.abs(parameters - parameter)))))


def solved(family: CurveFamily, parameter: float, multipliers: np.ndarray, aim: Aim, close: float) -> Joined | None:
    """The curve near a start that covers the target and has the levels, by Newton's method with shortened steps.

    Derivatives are differences. None when the residual stays above ``close``, relative to the sizes.
    """
    unknowns = np.array([parameter, *multipliers])
    assert aim.target is not None
    sizes = np.array([aim.size, *np.maximum(np.abs(aim.levels), TINY)])
    steps = DIFFERENCE * np.array([family.unit, *(np.abs(multipliers) + (multipliers == 0))])

    def miss(columns: np.ndarray) -> tuple[np.ndarray, CurveIntegrals]:
        """How far the curves of some unknowns, a column each, are from target and levels, over their sizes."""
        measured = family.lines.measure(family.batch(columns[0], columns[1:]))
        rows = np.vstack([measured.x - aim.target, measured.levels - aim.levels[:, None]])
        return rows / sizes[:, None], measured

    best, norm = None, np.inf
    for _ in range(NEWTON_STEPS):
        here, slopes, measured = _differences(miss, unknowns, steps)
        now = float(np.abs(here).max())
        if not (np.isfinite(now) and np.isfinite(slopes).all()):
            break
        if now < norm:
            best, norm = Joined(family, float(unknowns[0]), unknowns[1:], measured.take(0)), now
        if now <= EPSILON:
            break
        step = np.linalg.lstsq(slopes, -here, rcond=None)[0]
        trials = unknowns[:, None] + step[:, None] * SHORTENED
        reached = np.nan_to_num(np.abs(miss(trials)[0]).max(axis=0), nan=np.inf)
        k = int(np.argmax(reached < (1 - 0.1 * SHORTENED) * now)) if np.any(reached < now) else int(np.argmin(reached))
        if not reached[k] < now:
            break
        unknowns = trials[:, k]
    return best if norm <= close else None


def _differences(
    miss: Callable[[np.ndarray], tuple[np.ndarray, CurveIntegrals]], unknowns: np.ndarray, steps: np.ndarray
) -> tuple[np.ndarray, np.ndarray, CurveIntegrals]:
    """The residual and its Jacobian by one-sided differences, on whichever side and scale they are numbers."""
    k = len(unknowns)
    *larger, smallest = SHRINKING

    def at(scale: float) -> tuple[np.ndarray, np.ndarray, CurveIntegrals]:
        """The residual, and its differences by steps that many times as large."""
        h = np.diag(scale * steps)
        rows, measured = miss(np.column_stack([unknowns, unknowns[:, None] + h, unknowns[:, None] - h]))
        forward, backward = rows[:, 1 : k + 1] - rows[:, :1], rows[:, :1] - rows[:, k + 1 :]
        return rows[:, 0], np.where(np.isfinite(forward).all(axis=0), forward, backward) / (scale * steps), measured

    for scale in larger:
        found = at(scale)
        if np.isfinite(found[1]).all():
            return found
    return at(smallest)


def refined(found: Joined, aim: Aim) -> Joined | None:
    """The same curve with rules that resolve it to round-off; None when it is lost on the way."""
    settled = False
    for _ in range(REFINEMENTS):
        panels = refined_panels(found)
        if settled and panels is None:
            break
        family = found.family if panels is None else found.family.ruled(panels)
        if aim.target is None:
            return Joined.of(family, found.parameter, found.multipliers)
        better = solved(family, found.parameter, found.multipliers, aim, LOST_CURVE)
        if better is None:
            return None
        found, settled = better, True
    return found
