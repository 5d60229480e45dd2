"""rockit: its direct collocation of degree four on CasADi and IPOPT, the control linear on each interval."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from peers.adapter import IPOPT, Adapter, NotSolvedError, quiet
from tasks import GRAVITY, Descent, Task


def build(task: Task, intervals: int) -> Any:
    """The stage, transcribed."""
    from rockit import DirectCollocation, FreeTime, Ocp

    falling = isinstance(task, Descent)
    ocp = Ocp(t0=0, T=FreeTime(1.0)) if falling else Ocp(t0=task.start[0], T=task.end[0] - task.start[0])
    u = ocp.control(order=1)
    if falling:
        states = x, y, v = ocp.state(), ocp.state(), ocp.state()
        for state, rate in zip(states, (v * ca.sin(u), v * ca.cos(u), GRAVITY * ca.cos(u)), strict=True):
            ocp.set_der(state, rate)
            ocp.subject_to(ocp.at_t0(state) == 0)
        ocp.subject_to(ocp.at_tf(x) == task.across)
        ocp.subject_to(ocp.at_tf(y) == task.depth)
        ocp.subject_to((u <= np.pi) >= 0)
        ocp.add_objective(ocp.T)
        ocp.set_initial(x, task.across * ocp.t)
        ocp.set_initial(y, task.depth * ocp.t)
        ocp.set_initial(v, np.sqrt(2 * GRAVITY * task.depth) * ocp.t)
        ocp.set_initial(u, np.arctan2(task.across, task.depth))
    else:
        y, z = ocp.state(), ocp.state()
        ocp.set_der(y, u)
        ocp.set_der(z, task.cost(ca, ocp.t, y, u))
        ocp.subject_to(ocp.at_t0(y) == task.start[1])
        ocp.subject_to(ocp.at_t0(z) == 0)
        ocp.subject_to(ocp.at_tf(y) == task.end[1])
        if task.held is not None:
            w = ocp.state()
            ocp.set_der(w, task.held(ca, ocp.t, y, u))
            ocp.subject_to(ocp.at_t0(w) == 0)
            ocp.subject_to(ocp.at_tf(w) == task.level)
        ocp.add_objective(ocp.at_tf(z))
        ocp.set_initial(y, task.line(ocp.t))
    ocp.solver("ipopt", IPOPT | {"expand": True})
    ocp.method(DirectCollocation(N=intervals, M=1))
    return ocp, ocp.T if falling else ocp.at_tf(z)


def solve(built: Any) -> float:
    """The objective; rockit raises where IPOPT fails."""
    ocp, goal = built
    try:
        with quiet():
            found = ocp.solve()
    except RuntimeError as error:
        raise NotSolvedError(str(error).splitlines()[0]) from error
    return float(found.value(goal))


ADAPTER = Adapter("rockit", "rockit", (5, 10), build, solve)
