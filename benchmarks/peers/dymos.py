"""dymos on OpenMDAO with SciPy's SLSQP: the brachistochrone that comes with it.

Other tasks would need components written by hand, with their derivatives;
IPOPT would need pyoptsparse, which is not on the package index.
"""

from __future__ import annotations

import contextlib
import io
import os
import tempfile
import warnings
from typing import Any

import numpy as np

from peers.adapter import Adapter, NotSolvedError, quiet
from tasks import GRAVITY, Descent, Task


def build(task: Task, setting: tuple[int, int]) -> Any:
    """The phase by Radau's points, set up."""
    os.environ["OPENMDAO_REPORTS"] = "0"
    os.environ["OPENMDAO_WORKDIR"] = tempfile.gettempdir()  # where it leaves its folders
    import dymos
    import openmdao.api as om
    from dymos.examples.brachistochrone.brachistochrone_ode import BrachistochroneODE

    assert isinstance(task, Descent)
    segments, order = setting
    problem = om.Problem(model=om.Group())
    problem.driver = om.ScipyOptimizeDriver(optimizer="SLSQP", tol=1e-9, disp=False, maxiter=500)
    problem.driver.declare_coloring(show_summary=False, show_sparsity=False)
    phase = dymos.Phase(ode_class=BrachistochroneODE, transcription=dymos.Radau(num_segments=segments, order=order))
    path = dymos.Trajectory()
    path.add_phase("phase0", phase)
    problem.model.add_subsystem("traj", path)
    phase.set_time_options(fix_initial=True, duration_bounds=(0.1, 10))
    for state in "xyv":
        phase.add_state(state, fix_initial=True)
    phase.add_control("theta", units="deg", lower=0.01, upper=179.9, continuity=True, rate_continuity=True)
    phase.add_parameter("g", units="m/s**2", val=GRAVITY)
    phase.add_boundary_constraint("x", loc="final", equals=task.across)
    phase.add_boundary_constraint("y", loc="final", equals=0.0)
    phase.add_objective("time", loc="final")
    with setting_up():
        problem.setup()
    phase.set_time_val(initial=0.0, duration=1.0)
    phase.set_state_val("x", [0, task.across])
    phase.set_state_val("y", [task.depth, 0.0])
    phase.set_state_val("v", [0, np.sqrt(2 * GRAVITY * task.depth)])
    phase.set_control_val("theta", [5, 100.0])
    return problem


@contextlib.contextmanager
def setting_up() -> Any:
    """Away from this folder, where OpenMDAO would leave files, and without its words."""
    with (
        tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder), contextlib.redirect_stdout(io.StringIO()),
        warnings.catch_warnings(), quiet(),
    ):  # fmt: skip
        warnings.simplefilter("ignore")
        yield


def solve(problem: Any) -> float:
    """The time, refused where SLSQP reports failure."""
    import dymos

    with setting_up():
        dymos.run_problem(problem, run_driver=True, simulate=False, make_plots=False)
    if not problem.driver.result.success:
        raise NotSolvedError("SLSQP reports failure")
    return float(problem.get_val("traj.phase0.timeseries.time")[-1, 0])


TASKS = ("brachistochrone (1,1)", "brachistochrone (5,1)")
ADAPTER = Adapter("dymos", "dymos", ((5, 3),), build, solve, TASKS)
