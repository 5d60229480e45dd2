"""A pendulum on a rubber string: how it hangs, and its two frequencies.

L = m (r'² + r² θ'²)/2 + m g r cos θ - k (r - l)²/2. It hangs at r = l + m g/k, and swings with √(g/r) and √(k/m).

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), ch. 2, problem 7.
"""

import casadi as ca
import numpy as np

from varcalc import mechanics

G, MASS, STIFF, LENGTH = 9.81, 0.4, 30.0, 0.8
HANGS = LENGTH + MASS * G / STIFF
system = mechanics.System(
    lambda t, q, v: (
        MASS * (v[0] ** 2 + q[0] ** 2 * v[1] ** 2) / 2 + MASS * G * q[0] * ca.cos(q[1])
        - STIFF * (q[0] - LENGTH) ** 2 / 2
    ),
    ("r", "theta"),
    units=("m", "rad"), time_unit="s", name="elastic pendulum",
)  # fmt: skip


def frequencies(_):
    """How far the normal modes are off."""
    found = system.normal_modes([HANGS, 0.0]).frequencies
    return np.abs(found / np.sort([np.sqrt(G / HANGS), np.sqrt(STIFF / MASS)]) - 1).max()


def equations(motion):
    """How far r'' - r θ'² = g cos θ - (k/m)(r - l) and (r² θ')' = -g r sin θ are from being kept, in units of g."""
    t = 0.37 * motion.span[1]
    (r, a), (u, w) = motion.q(t), motion.v(t)
    out, round_ = system.accelerations(t, [r, a], [u, w])
    along = out - r * w**2 - G * np.cos(a) + STIFF / MASS * (r - LENGTH)
    return max(abs(along), abs(r * round_ + 2 * u * w + G * np.sin(a))) / G


def rest(_):
    """How far the stretch at rest is off."""
    found = system.equilibria([LENGTH / 2, -0.3], [2 * LENGTH, 0.4])
    return np.abs(found.places - [HANGS, 0.0]).max() + found.unresolved + len(found.places) - 1


experiment = mechanics.Experiment(
    system, [HANGS + 0.1, 0.4], [0.0, 0.0], (0.0, 10.0), None,
    {"frequencies": frequencies, "equations": equations, "rest": rest,
     "energy": lambda motion: motion.drift["energy"] / (MASS * G)},
    title="A pendulum on a rubber string",
)  # fmt: skip
