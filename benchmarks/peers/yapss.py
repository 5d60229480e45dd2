"""yapss: Legendre-Gauss-Radau pseudospectral collocation, CasADi's derivatives, IPOPT."""

from __future__ import annotations

from typing import Any

import numpy as np

from peers.adapter import Adapter, NotSolvedError, quiet
from peers.casadi_radau import first_guess
from tasks import GRAVITY, Descent, Task


def build(task: Task, setting: tuple[int, int]) -> Any:
    """The problem on ``elements`` of ``points`` collocation points."""
    from yapss import Problem
    from yapss import math as m

    elements, points = setting
    falling = isinstance(task, Descent)
    levelled = not falling and task.held is not None
    problem = Problem(name="task", nx=[3 if falling else 1], nu=[1], nq=[0 if falling else 1 + levelled])
    ends = np.array([0.0, 1.0])
    states, control = first_guess(task, ends)

    def objective(arg: Any) -> None:
        arg.objective = arg.phase[0].final_time if falling else arg.phase[0].integral[0]

    def continuous(arg: Any) -> None:
        phase = arg.phase[0]
        (u,) = phase.control
        if falling:
            phase.dynamics = phase.state[2] * m.sin(u), phase.state[2] * m.cos(u), GRAVITY * m.cos(u)
            return
        x, (y,) = phase.time, phase.state
        phase.dynamics = (u,)
        phase.integrand = (task.cost(m, x, y, u), *((task.held(m, x, y, u),) if levelled else ()))

    problem.functions.objective, problem.functions.continuous = objective, continuous
    bounds, guess = problem.bounds.phase[0], problem.guess.phase[0]
    if falling:
        bounds.initial_time.lower = bounds.initial_time.upper = 0
        bounds.final_time.lower, bounds.final_time.upper = 0.1, 10
        bounds.initial_state.lower[:] = bounds.initial_state.upper[:] = 0
        bounds.final_state.lower[:2] = bounds.final_state.upper[:2] = task.across, task.depth
        bounds.control.lower[:], bounds.control.upper[:] = 0, np.pi
        guess.time, guess.state, guess.control = [0, 1.0], states.tolist(), [control.tolist()]
    else:
        bounds.initial_time.lower = bounds.initial_time.upper = task.start[0]
        bounds.final_time.lower = bounds.final_time.upper = task.end[0]
        bounds.initial_state.lower[:] = bounds.initial_state.upper[:] = task.start[1]
        bounds.final_state.lower[:] = bounds.final_state.upper[:] = task.end[1]
        if levelled:
            bounds.integral.lower[1] = bounds.integral.upper[1] = task.level
        along = np.linspace(0, 1, 11)
        states, control = first_guess(task, along)
        guess.time = (task.start[0] + (task.end[0] - task.start[0]) * along).tolist()
        guess.state, guess.control = [states[0].tolist()], [control.tolist()]
        guess.integral = [task.exact, task.level][: 1 + levelled]
    problem.mesh.phase[0].collocation_points = elements * (points,)
    problem.mesh.phase[0].fraction = elements * (1 / elements,)
    problem.spectral_method, problem.derivatives.method, problem.derivatives.order = "lgr", "auto", "second"
    options = problem.ipopt_options
    options.print_level, options.sb, options.tol, options.mu_strategy = 0, "yes", 1e-13, "adaptive"
    return problem


def solve(problem: Any) -> float:
    """The objective, refused where IPOPT reports failure."""
    with quiet():
        found = problem.solve()
    message = str(found.nlp_info.ipopt_status_message)
    if "Optimal Solution Found" not in message:
        raise NotSolvedError(message)
    return float(found.objective)


ADAPTER = Adapter("yapss", "yapss", ((3, 3), (5, 5), (5, 8), (10, 8), (20, 8)), build, solve)
