"""Many solutions of a system of ordinary differential equations, each with a status of its own as rays have it."""

from __future__ import annotations

import casadi as ca
import numpy as np

from varcalc import integrators
from varcalc.optics.models.hamilton import STATUS_OF_OUTCOME


def flown(rates: ca.SX, state: ca.SX, states: np.ndarray, until: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Carry ``states`` (m, N) by dstate/ds = ``rates`` from s = 0 to ``until`` (m,); the ends and their status.

    Those that have not arrived keep the last state that is known.
    """
    system = ca.Function("rays", [ca.SX.sym("s"), state, ca.SX.sym("c", 0)], [ca.densify(rates)])
    landing = integrators.for_many().compile(system).ensemble(states, np.zeros((len(states), 0)), until=np.array(until))
    return landing.states, STATUS_OF_OUTCOME[landing.outcomes].astype(np.int8)
