"""Where many motions come through an event: Poincaré's sections, and times of flight."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from varcalc.integrators.protocol import COMPLETED, OUTCOMES, STOPPED, Flow, RunOutcome
from varcalc.showing import Shown
from varcalc.symbolic.evaluation import PointEvaluator


@dataclass(frozen=True, repr=False, eq=False)
class Passages(Shown):
    """The first k passages of m motions through an event: ``times`` (m, k), and ``q``, ``v`` (m, n, k) there.

    They are no numbers where there are fewer; ``outcomes`` (m,) say how each motion ended: STOPPED at its k-th passage,
    COMPLETED at the last time, or else why it could not go on.
    """

    times: np.ndarray
    q: np.ndarray
    v: np.ndarray
    outcomes: tuple[RunOutcome, ...]

    @property
    def counts(self) -> np.ndarray:
        """How often each motion passed (m,)."""
        return np.count_nonzero(np.isfinite(self.times), axis=1)


def passages(
    flow: Flow, states: np.ndarray, numbers: np.ndarray, span: tuple[float, float], rates: PointEvaluator,
    direction: int, most: int,
) -> Passages:  # fmt: skip
    """Of motions from ``states`` (m, 2n) at ``span[0]``; those of ``flow`` end with the time.

    ``rates`` gives the function of the event, and how fast it changes.
    """
    (m, size), n = states.shape, states.shape[1] // 2
    here = np.column_stack([states, np.full(m, span[0])])
    found, count = np.full((m, size + 1, most), np.nan), np.zeros(m, dtype=int)
    constants, codes = np.broadcast_to(numbers, (m, len(numbers))), np.full(m, COMPLETED)
    on_it = rates(m, here, numbers[None, :])[:, 0] == 0
    going = np.arange(m)
    while len(going):
        left = np.zeros(0, dtype=int)
        for rows, leaving in ((going[on_it[going]], (0,)), (going[~on_it[going]], ())):
            if len(rows) == 0:
                continue
            landing = flow.ensemble(
                here[rows], constants[rows], start=here[rows, -1], until=np.full(len(rows), span[1]), leaving=leaving
            )
            here[rows], codes[rows] = landing.states, landing.outcomes
            stopped = rows[landing.outcomes == STOPPED]
            slope = rates(len(stopped), here[stopped], numbers[None, :])[:, 1]
            counted = stopped[direction * slope >= 0]
            found[counted, :, count[counted]] = here[counted]
            count[counted] += 1
            left = np.append(left, stopped[count[stopped] < most])
        on_it[:] = True
        going = np.sort(left)
    return Passages(found[:, -1], found[:, :n], found[:, n : 2 * n], tuple(OUTCOMES[code] for code in codes))
