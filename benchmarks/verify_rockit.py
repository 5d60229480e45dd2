"""rockit (rockit-meco) over the reference problems: what is right, refused, and falsely right.

An adapter of a package of optimal control, as :func:`varcalc.verify_solver` takes one: the slope is the control, the
functional a state of its own. It begins from the straight line, as a person would.

Run: python benchmarks/verify_rockit.py [NAME...]; over the whole catalogue it writes records/verify_rockit.json.
"""

from __future__ import annotations

import json
import math
import sys
from importlib.metadata import version
from pathlib import Path

import casadi as ca
import numpy as np

import varcalc as vc
from peers.adapter import IPOPT, quiet
from varcalc.study.records import about

RECORD = Path(__file__).parent / "records" / "verify_rockit.json"
INTERVALS = 20
"""Intervals of a collocation of degree four."""


def by_rockit(problem: vc.PlainProblem) -> vc.SolverAnswer | None:
    """Graphs of first order between ends that are given or free, nothing held and nothing bounded."""
    limited = problem.levels or problem.bounds or problem.held or problem.waypoints
    if problem.is_curve or problem.order != 1 or problem.unknowns or problem.end_cost or limited:
        return None
    if any(end.on is not None or end.periodic for end in (problem.start, problem.end)):
        return None
    from rockit import DirectCollocation, Ocp

    first, last = problem.interval
    ocp = Ocp(t0=first, T=last - first)
    x, value = ocp.state(), ocp.state()  # rockit's own time may not stand in a function that is called
    y, slope = ocp.state(problem.n), ocp.control(problem.n, order=1)
    ocp.set_der(x, 1)
    ocp.subject_to(ocp.at_t0(x) == first)
    ocp.set_der(y, slope)
    ocp.set_der(value, problem.expression(x, y, slope))
    ocp.subject_to(ocp.at_t0(value) == 0)
    for at, end in ((ocp.at_t0, problem.start), (ocp.at_tf, problem.end)):
        for k in np.flatnonzero(np.isfinite(end.y)).tolist():
            ocp.subject_to(at(y)[k] == end.y[k])
    ocp.add_objective((-1 if problem.maximise else 1) * ocp.at_tf(value))
    begin, stop = (np.nan_to_num(end.y) for end in (problem.start, problem.end))
    ocp.set_initial(x, ocp.t)
    ocp.set_initial(y, ca.DM(begin) + ca.DM(stop - begin) * (ocp.t - first) / (last - first))
    ocp.set_initial(slope, ca.DM(stop - begin) / (last - first))
    ocp.solver("ipopt", IPOPT | {"expand": True})
    ocp.method(DirectCollocation(N=INTERVALS, M=1))
    try:
        with quiet():
            found = ocp.solve()
    except RuntimeError as error:
        return vc.SolverAnswer(math.nan, success=False, message=str(error).strip().splitlines()[-1])
    return vc.SolverAnswer(float(found.value(ocp.at_tf(value))))


def main() -> None:
    """Print the table; over the whole catalogue write the record."""
    names = sys.argv[1:]
    report = vc.verify_solver(by_rockit, problems=names or None, tolerance=1e-6)
    print(report)
    if not names:
        record = {"about": about() | {"rockit-meco": version("rockit-meco")}} | report.document()
        RECORD.write_text(json.dumps(record, indent=1, default=str) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
