"""A sweep of the brachistochrone's end points: seconds, and how far every answer is from the cycloid.

Every end makes a problem of its own, solved cold; the points are shared out among processes.

Run: python benchmarks/sweep_ends.py [POINTS] [CORES]
"""

from __future__ import annotations

import math
import sys
import time

import casadi as ca
import numpy as np

import varcalc as vc
from varcalc.problems._curves import Cycloid

GRAVITY = 9.81


def descent(across: float, depth: float) -> vc.Problem:
    """The quickest descent from rest at the origin to a point."""
    return vc.Problem(
        lambda x, y, dy: ca.sqrt((1 + dy**2) / (2 * GRAVITY * y)), vc.Fixed(0, 0), vc.Fixed(across, depth)
    )


def main(points: int, cores: int) -> None:
    """Print one line."""
    side = max(2, math.isqrt(points))
    across, depth = np.linspace(0.2, 5.0, side).tolist(), np.linspace(0.2, 2.0, side).tolist()
    began = time.perf_counter()
    found = vc.sweep(descent, {"across": across, "depth": depth}, vc.Ritz(), cores=cores)
    spent = time.perf_counter() - began
    exact = np.array([[Cycloid.through(a, d).descent_time(GRAVITY) for d in depth] for a in across])
    error = np.nanmax(np.abs(found.values - exact))
    count = len(found.points)
    print(
        f"{count} ends on {cores} cores: {spent:.1f} s, {1e3 * spent / count:.2f} ms each; "
        f"{len(found.failures)} without an answer; largest error {error:.1e}"
    )


if __name__ == "__main__":
    main(*(int(text) for text in (sys.argv[1:] + ["10000", "2"][len(sys.argv) - 1 :])))
