"""asset-asrl: collocation at Lobatto points, its own interior-point solver in C++, one thread."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from peers.adapter import Adapter, NotSolvedError, quiet
from peers.casadi_radau import first_guess
from tasks import GRAVITY, Descent, Task

POINTS = 50
"""Points of the first guess."""


def build(task: Task, setting: tuple[str, int, float]) -> Any:
    """A phase with its bounds, objective and tolerances."""
    import asset_asrl

    functions, control = asset_asrl.VectorFunctions, asset_asrl.OptimalControl
    scheme, segments, tolerance = setting
    falling = isinstance(task, Descent)
    levelled = not falling and task.held is not None
    n = 3 if falling or levelled else 2
    m = SimpleNamespace(sqrt=functions.sqrt, sin=functions.sin, cos=functions.cos)

    class Motion(control.ODEBase):
        """The right-hand side."""

        def __init__(self) -> None:
            args = control.ODEArguments(n, 1)
            u = args.UVar(0)
            if falling:
                v = args.XVar(2)
                rates = [m.sin(u) * v, m.cos(u) * v, GRAVITY * m.cos(u)]
            else:
                x, y = args.TVar(), args.XVar(0)
                rates = [u, task.cost(m, x, y, u)] + ([task.held(m, x, y, u)] if levelled else [])
            super().__init__(functions.stack(rates), n, 1)

    along = np.linspace(0, 1, POINTS)
    states, slope = first_guess(task, along)
    time = along if falling else task.start[0] + (task.end[0] - task.start[0]) * along
    phase = Motion().phase(scheme, list(np.vstack([states, time, slope]).T), segments)
    if falling:
        phase.addBoundaryValue("Front", range(4), [0, 0, 0, 0])
        phase.addLUVarBound("Path", 4, -0.1, np.pi)
        phase.addBoundaryValue("Back", [0, 1], [task.across, task.depth])
        phase.addDeltaTimeObjective(1.0)
    else:
        phase.addBoundaryValue("Front", range(n + 1), [task.start[1], *[0.0] * (n - 1), task.start[0]])
        held = [(2, task.level)] if levelled else []
        fixed = [(0, task.end[1]), *held, (n, task.end[0])]
        phase.addBoundaryValue("Back", [i for i, _ in fixed], [v for _, v in fixed])
        phase.addValueObjective("Back", 1, 1.0)
    phase.setThreads(1, 1)
    phase.optimizer.set_PrintLevel(3)
    phase.optimizer.set_tols(tolerance, tolerance, tolerance)
    return phase, n if falling else 1


def solve(built: Any) -> float:
    """The last time, or the last value of the integral."""
    phase, place = built
    with quiet():
        flag = phase.optimize()
    if not str(flag).endswith("CONVERGED") or "NOT" in str(flag):
        raise NotSolvedError(str(flag))
    return float(phase.returnTraj()[-1][place])


SETTINGS = (("LGL3", 10, 1e-6), ("LGL5", 5, 1e-8), ("LGL5", 20, 1e-10), ("LGL7", 5, 1e-10), ("LGL7", 10, 1e-12),
            ("LGL7", 20, 1e-12), ("LGL7", 40, 1e-13))  # fmt: skip
ADAPTER = Adapter("asset-asrl", "asset_asrl", SETTINGS, build, solve)
