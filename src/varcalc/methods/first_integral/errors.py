"""How far a curve moves when what it must cover is known to a given error only."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from varcalc.methods.first_integral.answers import ROUND_OFF
from varcalc.methods.first_integral.contract import Aim, Joined
from varcalc.methods.first_integral.search import DIFFERENCE, TINY

BEND_STEP = 1e3
"""Steps for a second difference, in units of those for a first one."""
NUDGES = np.array([1.0, -1.0, 1e-4, -1e-4])
"""Steps of which the first counts with which there is a curve."""


def sensitivity(found: Joined, aim: Aim, shape: Callable[[Joined], np.ndarray], miss: float) -> float | None:
    """The largest change of ``shape`` (0 for the curve itself) when reach and levels are off by ``miss``.

    None when the parameter moves nothing.
    """
    unknowns = np.array([found.parameter, *found.multipliers])
    sizes = np.array([aim.size, *np.maximum(np.abs(aim.levels), TINY)])
    units = DIFFERENCE * np.array([found.family.unit, *(np.abs(found.multipliers) + (found.multipliers == 0))])
    count = len(unknowns)
    far = BEND_STEP * units[0] * np.outer(np.eye(count)[0], [1, -1])
    steps = np.concatenate([np.kron(np.diag(units), NUDGES), far], axis=1)
    columns = unknowns[:, None] + steps
    measured = found.family.lines.measure(found.family.batch(columns[0], columns[1:]))
    covered = np.vstack([measured.x, measured.levels])
    here = np.append(found.measured.x, found.measured.levels[:, 0])
    rates, spreads = np.empty((len(sizes), count)), np.empty(count)
    for j in range(count):
        known = np.flatnonzero(np.isfinite(covered[0, j * len(NUDGES) : (j + 1) * len(NUDGES)]))
        if len(known) == 0:
            return float("inf")
        k = j * len(NUDGES) + int(known[0])
        rates[:, j] = (covered[:, k] - here) / sizes / steps[j, k]
        other = Joined(found.family, float(columns[0, k]), columns[1:, k], measured.take(k))
        spreads[j] = np.abs(shape(other)).max() / abs(steps[j, k])
    if np.abs(rates[0, 0]) * units[0] <= ROUND_OFF:
        return None
    relative = miss / aim.size
    if count == 1:
        # close to a fold the reach is quadratic in the parameter
        second = abs(float(covered[0, -2] - 2 * here[0] + covered[0, -1])) / (BEND_STEP * units[0]) ** 2
        bend = max(second / aim.size if np.isfinite(second) else 0.0, TINY)
        return float(spreads[0] * min(relative / abs(rates[0, 0]), np.sqrt(2 * relative / bend)))
    return float(spreads @ (np.abs(np.linalg.pinv(rates)).sum(axis=1) * relative))
