"""What the figures of two coupled blocks share: x'' = -(k + K) x + K y and y'' = -(k + K) y + K x."""

import numpy as np

from varcalc import mechanics
from varcalc.study.drawing import Line, Panel

TIME = 60.0


def blocks(ratio):
    """With K/k = ``ratio``, in units of √(k/m)."""
    return mechanics.System(
        lambda t, q, v, p: (
            (v[0] ** 2 + v[1] ** 2 - q[0] ** 2 - q[1] ** 2) / 2 - p.ratio * (q[0] - q[1]) ** 2 / 2
        ),
        ("x", "y"), parameters={"ratio": ratio}, name="two coupled blocks",
    )  # fmt: skip


def moved(ratio):
    """Times (m,), x and y (2, m), from x = 1 and y = 0 at rest."""
    times = np.linspace(0.0, TIME, 2001)
    return times, blocks(ratio).motion([1.0, 0.0], [0.0, 0.0], (0.0, TIME)).q(times)


def row(ratio):
    """x and y over time, and over each other."""
    times, (x, y) = moved(ratio)
    return [
        Panel([Line(times, x, label="x"), Line(times, y, label="y")], "t √(k/m)", "x, y", title=f"K/k = {ratio:g}"),
        Panel([Line(x, y)], "x", "y", equal=True),
    ]
