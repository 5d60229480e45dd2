"""How far a curve moves when what it must cover is known to a given error only."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from varcalc.methods.first_integral.answers import ROUND_OFF
from varcalc.methods.first_integral.contract import Aim, Joined, measure_one
from varcalc.methods.first_integral.search import DIFFERENCE, TINY

BEND_STEP = 1e3
"""Steps for a second difference, in units of those for a first one."""
NUDGES = (1.0, -1.0, 1e-4, -1e-4)
"""Steps tried until the nudged curve exists."""


def sensitivity(found: Joined, aim: Aim, shape: Callable[[Joined], np.ndarray], miss: float) -> float | None:
    """The largest change of ``shape`` (0 for the curve itself) when reach and levels are off by ``miss``.

    None when the parameter moves nothing.
    """
    unknowns = np.array([found.parameter, *found.multipliers])
    sizes = np.array([aim.size, *np.maximum(np.abs(aim.levels), TINY)])
    units = DIFFERENCE * np.array([found.family.unit, *(np.abs(found.multipliers) + (found.multipliers == 0))])
    rates, spreads = np.empty((len(sizes), len(units))), np.empty(len(units))
    for j, unit in enumerate(units):
        for nudge in NUDGES:
            step = np.zeros(len(unknowns))
            step[j] = nudge * unit
            other = _nudged(found, unknowns + step)
            if np.isfinite(other.measured.x[0]):
                break
        else:
            return float("inf")
        rates[:, j] = (_covered(other) - _covered(found)) / sizes / step[j]
        spreads[j] = np.abs(shape(other)).max() / abs(step[j])
    if np.abs(rates[0, 0]) * units[0] <= ROUND_OFF:
        return None
    relative = miss / aim.size
    if len(unknowns) == 1:
        # close to a fold the reach is quadratic in the parameter
        bend = max(_bend(found, units[0]) / aim.size, TINY)
        return float(spreads[0] * min(relative / abs(rates[0, 0]), np.sqrt(2 * relative / bend)))
    return float(spreads @ (np.abs(np.linalg.pinv(rates)).sum(axis=1) * relative))


def _nudged(found: Joined, unknowns: np.ndarray) -> Joined:
    parameter, multipliers = float(unknowns[0]), unknowns[1:]
    return Joined(found.family, parameter, multipliers, measure_one(found.family, parameter, multipliers))


def _covered(one: Joined) -> np.ndarray:
    return np.concatenate([one.measured.x, one.measured.levels[:, 0]])


def _bend(found: Joined, step: float) -> float:
    """The size of the second derivative of the reach by the parameter."""
    large = BEND_STEP * step
    at = found.parameter + large * np.arange(-1, 2)
    reach = found.family.lines.measure(found.family.batch(at, np.repeat(found.multipliers[:, None], 3, axis=1))).x
    second = abs(float(reach[0] - 2 * reach[1] + reach[2])) / large**2
    return second if np.isfinite(second) else 0.0
