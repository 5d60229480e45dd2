"""A sweep of the brachistochrone's end points: seconds, and how far every answer is from the cycloid.

The end points are parameters of one problem, which every core makes for itself.

Run: python benchmarks/sweep_ends.py [POINTS] [CORES]
"""

from __future__ import annotations

import math
import resource
import sys
import time

import casadi as ca
import numpy as np

import varcalc as vc
from varcalc.problems._curves import Cycloid

GRAVITY = 9.81


def descent() -> vc.Problem:
    """The quickest descent from rest at the origin to a point that may be moved."""
    return vc.Problem(
        lambda x, y, dy, p: ca.sqrt((1 + dy**2) / (2 * GRAVITY * y)),
        vc.Fixed(0, 0),
        vc.Fixed(vc.Parameter("across"), vc.Parameter("depth")),
        parameters={"across": 1.0, "depth": 1.0},
    )


def processor_time() -> float:
    """Seconds that this process and those it has started and waited for have computed."""
    return sum(
        u.ru_utime + u.ru_stime for u in map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    )


def main(points: int, cores: int) -> None:
    """Print one line."""
    side = max(2, math.isqrt(points))
    across, depth = np.linspace(0.2, 5.0, side).tolist(), np.linspace(0.2, 2.0, side).tolist()
    began, busy = time.perf_counter(), processor_time()
    found = vc.sweep(descent, {"across": across, "depth": depth}, vc.Ritz(), cores=cores)
    spent, busy = time.perf_counter() - began, processor_time() - busy
    exact = np.array([[Cycloid.through(a, d).descent_time(GRAVITY) for d in depth] for a in across])
    error = np.nanmax(np.abs(found.values - exact))
    count = len(found.points)
    print(
        f"{count} ends on {cores} cores: {spent:.1f} s, {busy:.1f} s of processor time, {1e3 * busy / count:.2f} ms "
        f"each; "
        f"{len(found.failures)} without an answer; largest error {error:.1e}"
    )


if __name__ == "__main__":
    main(*(int(text) for text in (sys.argv[1:] + ["10000", "2"][len(sys.argv) - 1 :])))
