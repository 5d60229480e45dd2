"""mpopt: Legendre-Gauss-Radau pseudospectral collocation on CasADi and IPOPT."""

from __future__ import annotations

import contextlib
import io
from typing import Any

import casadi as ca
import numpy as np

from peers.adapter import IPOPT, Adapter, NotSolvedError, quiet
from peers.casadi_radau import first_guess
from tasks import GRAVITY, Descent, Task


def build(task: Task, setting: tuple[int, int]) -> Any:
    """The problem on ``elements`` of a ``degree``; a graph's abscissa is the time."""
    from mpopt import mp

    falling = isinstance(task, Descent)
    levelled = not falling and task.held is not None
    problem = mp.OCP(n_states=3 if falling or levelled else 2, n_controls=1)
    states, control = first_guess(task, np.array([0.0, 1.0]))
    if falling:
        problem.dynamics[0] = lambda s, u, t: [s[2] * ca.sin(u[0]), s[2] * ca.cos(u[0]), GRAVITY * ca.cos(u[0])]
        problem.terminal_costs[0] = lambda s, t, s0, t0: t
        problem.terminal_constraints[0] = lambda s, t, s0, t0: [s[0] - task.across, s[1] - task.depth]
        problem.tf0[0] = 1.0
        problem.lbu[0], problem.ubu[0], problem.lbtf[0], problem.ubtf[0] = 0, np.pi, 0.1, 10
    else:
        problem.dynamics[0] = lambda s, u, t: [
            u[0], task.cost(ca, t, s[0], u[0]), *([task.held(ca, t, s[0], u[0])] if levelled else []),
        ]  # fmt: skip
        problem.terminal_costs[0] = lambda s, t, s0, t0: s[1]
        problem.terminal_constraints[0] = lambda s, t, s0, t0: [
            s[0] - task.end[1], *([s[2] - task.level] if levelled else []),
        ]  # fmt: skip
        problem.t00[0], problem.tf0[0] = task.start[0], task.end[0]
        problem.lbt0[0] = problem.ubt0[0] = task.start[0]
        problem.lbtf[0] = problem.ubtf[0] = task.end[0]
    problem.x00[0], problem.xf0[0] = states[:, 0], states[:, 1]
    problem.u00[0], problem.uf0[0] = control[0], control[1]
    with contextlib.redirect_stdout(io.StringIO()):
        problem.validate()
        return mp.mpopt(problem, setting[0], setting[1], "LGR")


def solve(built: Any) -> float:
    """The objective, refused where IPOPT reports failure."""
    with quiet(), contextlib.redirect_stdout(io.StringIO()):
        found = built.solve(nlp_solver_options=dict(IPOPT))
    status = built.nlp_solver.stats() if hasattr(built, "nlp_solver") else {"success": True}
    if not status["success"]:
        raise NotSolvedError(status["return_status"])
    return float(found["f"])


ADAPTER = Adapter("mpopt", "mpopt", ((3, 3), (5, 5), (10, 5), (20, 5)), build, solve)
