"""Many solutions of a system of ordinary differential equations, each with a status of its own as rays have it."""

from __future__ import annotations

import casadi as ca
import numpy as np

from varcalc import integrators
from varcalc.integrators import OUTCOMES, Outcome
from varcalc.optics.beam import RayStatus

ENDED = {
    Outcome.COMPLETED: RayStatus.ARRIVED,
    Outcome.NOT_FINITE: RayStatus.SINGULAR,
    Outcome.BLOW_UP: RayStatus.SINGULAR,
    Outcome.TOO_MANY_STEPS: RayStatus.TOO_MANY_STEPS,
}


def flown(rates: ca.SX, state: ca.SX, states: np.ndarray, until: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Carry ``states`` (m, N) by dstate/ds = ``rates`` from s = 0 to ``until`` (m,); the ends and their status.

    Those that have not arrived keep the last state that is known.
    """
    system = ca.Function("rays", [ca.SX.sym("s"), state, ca.SX.sym("c", 0)], [ca.densify(rates)])
    landing = integrators.for_many().compile(system).ensemble(states, np.zeros((len(states), 0)), until=np.array(until))
    status = np.array([int(ENDED[OUTCOMES[code]]) for code in landing.outcomes], dtype=np.int8)
    return landing.states, status
