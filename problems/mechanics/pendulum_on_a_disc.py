"""A pendulum on the rim of a disc that turns with w, lying flat: it hangs outwards as others hang down.

L = b² θ'²/2 + a b w θ' sin(θ - w t) + g b cos θ, less the rate of (a² w²/2) t + (g a/w) cos wt: without it and with it
θ'' = (a/b) w² cos(θ - wt) - (g/b) sin θ. With g = 0, θ - wt - π/2 swings as a pendulum of the frequency w √(a/b).

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 2.4.3.
"""

import casadi as ca
import numpy as np
from scipy.special import ellipj, ellipk

from varcalc import mechanics

RIM, LENGTH, TURN, AMPLITUDE, GRAVITY = 0.5, 0.8, 3.0, 2.5, 9.81


def disc(g):
    """The disc that lies flat with g = 0, and one that stands upright in the pull g."""
    return mechanics.System(
        lambda t, q, v: (
            (LENGTH * v[0]) ** 2 / 2 + RIM * LENGTH * TURN * v[0] * ca.sin(q[0] - TURN * t) + g * LENGTH * ca.cos(q[0])
        ),
        ("theta",),
        units=("rad",),
        time_unit="s",
        name="pendulum on a disc",
    )


system = disc(0.0)
K = np.sin(AMPLITUDE / 2)


def exact(t):
    """θ."""
    sn = ellipj(TURN * np.sqrt(RIM / LENGTH) * t + ellipk(K**2), K**2)[0]
    return (TURN * t + np.pi / 2 + 2 * np.arcsin(K * sn))[None]


def upright(_):
    """How far the acceleration on an upright disc is off, with the rate that changes nothing and without."""
    t, q, v = 0.4, 1.1, -0.7
    known = (RIM * TURN**2 * np.cos(q - TURN * t) - GRAVITY * np.sin(q)) / LENGTH
    one = disc(GRAVITY)
    other = one.gauged(lambda t, q: (RIM * TURN) ** 2 / 2 * t + GRAVITY * RIM / TURN * ca.cos(TURN * t))
    return max(abs(float(s.accelerations(t, [q], [v])[0]) - known) for s in (one, other))


experiment = mechanics.Experiment(
    system, [np.pi / 2 + AMPLITUDE], [TURN], (0.0, 15.0), exact, {"upright disc": upright},
    title="A pendulum on a disc",
)  # fmt: skip
