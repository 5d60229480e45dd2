"""Cold build + solve of the brachistochrone from rest at 1e-12, in milliseconds.

Cold means a new function object and a new end point every time: no solution,
function or form is reused; only loaded plug-ins, tables of basis functions and
Gauss rules may help. Each row is the median, with the least and the greatest, of
the solves of one route; all routes take turns in one run. The error is the
largest over the end points, against the cycloid.

Run: python benchmarks/cold_solve.py [REPEATS]
"""

from __future__ import annotations

import statistics
import sys
import time

import casadi as ca

import varcalc as vc
from varcalc.problems._curves import Cycloid

GRAVITY = 9.81
TOLERANCE = 1e-12
ROUTES = {
    "Ritz (Newton)": vc.Ritz(),
    "Ritz (IPOPT)": vc.Ritz(optimiser=vc.Ipopt()),
    "the ladder": None,
}


def cold(across: float, depth: float, method: vc.Ritz | None) -> tuple[float, vc.Solution]:
    """Seconds from the functional to the answer, and the answer."""
    started = time.perf_counter()
    problem = vc.Problem(
        lambda x, y, dy, p: ca.sqrt((1 + dy**2) / (2 * p.g * y)),
        vc.Fixed(0, 0),
        vc.Fixed(across, depth),
        parameters={"g": GRAVITY},
    )
    solution = vc.solve(problem, method, tol=TOLERANCE)
    return time.perf_counter() - started, solution


def main(repeats: int) -> None:
    """Print one row a route for an end point near (1, 1) and one near (5, 1)."""
    print(f"{'end':8s}{'route':16s}{'median ms':>10s}{'least':>8s}{'greatest':>10s}{'error':>10s}")
    for across in (1.0, 5.0):
        times: dict[str, list[float]] = {name: [] for name in ROUTES}
        errors = dict.fromkeys(ROUTES, 0.0)
        for repeat in range(repeats + 3):
            end = across * (1 + 1e-3 * repeat)
            for name, method in ROUTES.items():
                seconds, solution = cold(end, 1.0, method)
                if repeat >= 3:  # the first solves fill the tables and load IPOPT
                    times[name].append(1e3 * seconds)
                exact = Cycloid.through(end, 1.0).descent_time(GRAVITY)
                errors[name] = max(errors[name], abs(solution.value - exact))
        for name, spent in times.items():
            row = f"{statistics.median(spent):10.2f}{min(spent):8.2f}{max(spent):10.2f}{errors[name]:10.1e}"
            print(f"({across:g}, 1)  {name:16s}{row}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 50)
