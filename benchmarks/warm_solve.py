"""Re-solves of the brachistochrone with other values of g: in a sweep, and one after the other from a neighbour.

Milliseconds of processor time a value. The first sweep builds what the others
find built. Every answer is held against the cycloid.

Run: python benchmarks/warm_solve.py
"""

from __future__ import annotations

import statistics
import time

import casadi as ca
import numpy as np

import varcalc as vc
from varcalc.problems._curves import Cycloid

TOLERANCE = 1e-9
VALUES = np.linspace(5.0, 15.0, 200)


def main() -> None:
    """Print the cost of a value in three sweeps, and the median and least cost of a single call, with the errors."""
    problem = vc.Problem(
        lambda x, y, dy, p: ca.sqrt((1 + dy**2) / (2 * p.g * y)), vc.Fixed(0, 0), vc.Fixed(1, 1), parameters={"g": 9.81}
    )
    curve = Cycloid.through(1.0, 1.0)
    for number in range(3):
        began = time.process_time()
        found = vc.sweep(problem, {"g": VALUES}, tol=TOLERANCE)
        spent = time.process_time() - began
        error = max(abs(point.value - curve.descent_time(g)) for point, g in zip(found.points, VALUES, strict=True))
        print(f"sweep {number + 1} of {len(VALUES)} values: {1e3 * spent / len(VALUES):.2f} ms each, error {error:.1e}")
    solution, times, errors = vc.solve(problem, tol=TOLERANCE), [], []
    for g in VALUES:
        began = time.process_time()
        solution = vc.solve(problem.with_parameters({"g": float(g)}), tol=TOLERANCE, guess=solution)
        times.append(1e3 * (time.process_time() - began))
        errors.append(abs(solution.value - curve.descent_time(g)))
    late = times[len(times) // 4 :]  # what is built at the ninth value is behind them
    print(f"one value from its neighbour: median {statistics.median(late):.2f} ms, least {min(late):.2f}, ", end="")
    print(f"error {max(errors):.1e}")


if __name__ == "__main__":
    main()
