"""Stability charts: the damped Mathieu equation over 400 x 300 points, and each point by itself."""

from __future__ import annotations

import time

import casadi as ca
import numpy as np

from varcalc import mechanics

ALONE = 20
"""Points of the chart that are made by themselves, compilation included once."""


def main() -> None:
    """Print processor times."""
    mathieu = mechanics.System(
        lambda t, q, v, p: (v[0] ** 2 - (p.a - 2 * p.q * ca.cos(2 * t)) * q[0] ** 2) / 2,
        ("x",),
        parameters={"a": 1.0, "q": 0.5},
        forces=lambda t, q, v, p: [-0.1 * v[0]],
    )
    ranges = {"a": np.linspace(-2, 10, 400), "q": np.linspace(0, 8, 300)}
    for what in ("with compilation", "again"):
        began = time.process_time()
        chart = mechanics.stability_chart(mathieu, [0.0], np.pi, ranges)
        print(f"400 x 300 points, {what}: {time.process_time() - began:.2f} s, growth to {np.median(chart.error):.1g}")
    began = time.process_time()
    boundaries = chart.boundaries
    print(f"its {len(boundaries.places)} boundaries: {time.process_time() - began:.2f} s")
    began = time.process_time()
    for a in np.linspace(-2, 10, ALONE):
        mathieu.with_parameters({"a": float(a)}).floquet([0.0], np.pi)
    print(f"a point by itself: {(time.process_time() - began) / ALONE * 1e3:.0f} ms")


if __name__ == "__main__":
    main()
