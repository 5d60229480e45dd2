"""The bifurcation of a bead on a turning hoop: where it rests, over ν = g/(r ω²).

θ = 0 is stable for ν > 1, θ = ±arccos ν for ν < 1: all equilibria that there are, each stable one by its frequency.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), figure 8.1.
"""

import casadi as ca
import numpy as np

from varcalc import mechanics
from varcalc.study.drawing import Drawing, Line, Panel, Points

RATIOS = np.linspace(0.1, 1.9, 10)


def hoop(ratio):
    """In units of the radius and of the turning."""
    return mechanics.System(
        lambda t, q, v: (v[0] ** 2 + ca.sin(q[0]) ** 2) / 2 + ratio * ca.cos(q[0]), ("theta",), name="bead on a hoop"
    )


def panels():
    """θ over ν: dots for what is stable, lines for what is not."""
    rests = []
    for ratio in RATIOS:
        system = hoop(ratio)
        places = system.equilibria([-2.0], [2.0]).places[:, 0].tolist()
        rests += [(ratio, theta, float(system.normal_modes([theta]).stable)) for theta in places]
    ratio, theta, stable = np.array(rests).T
    held = stable > 0
    branch = np.linspace(0, 1, 201)
    parts = [
        Line(branch, np.arccos(branch), colour=0), Line(branch, -np.arccos(branch), colour=0),
        Line([1.0, 2.0], [0.0, 0.0], colour=0), Line([0.0, 1.0], [0.0, 0.0], dashed=True, colour=1),
        Points(ratio[held], theta[held], label="stable", colour=0),
        Points(ratio[~held], theta[~held], label="unstable", colour=1),
    ]  # fmt: skip
    return [[Panel(parts, "ν = g/(r ω²)", "θ", within=(0, 2, -2, 2))]]


figure = Drawing("Equilibria of a bead on a turning hoop", panels)
