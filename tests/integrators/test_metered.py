"""What a metered flow counts."""

import casadi as ca
import numpy as np

from varcalc.integrators import Dop853, Metered


def test_runs_and_steps_are_counted_and_results_passed_on():
    s, y, c = ca.SX.sym("s"), ca.SX.sym("y"), ca.SX.sym("c")
    flow = Dop853().compile(ca.Function("decay", [s, y, c], [-c * y]))
    metered = Metered(flow)
    ends, start, rate = np.array([0.0, 1.0]), np.ones(1), np.ones(1)
    runs = [metered.run(ends, start, rate) for _ in range(3)]
    assert runs[0].states[-1, 0] == flow.run(ends, start, rate).states[-1, 0]
    assert metered.runs == 3
    assert metered.steps == sum(run.steps for run in runs)
    before = metered.work
    metered.charge(5)
    assert metered.work == before + 5
