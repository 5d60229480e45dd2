"""Kepler's ellipse in space, eccentricity 0.6, with the vector that keeps its axis, and their Poisson brackets.

With l = r × p and A = p × l - r/r: {l_i, l_j} = ε l_k, {l_i, A_j} = ε A_k, {A_i, A_j} = -2 H ε l_k and {H, A} = 0.

Source: H. Goldstein, C. Poole, J. Safko, "Classical Mechanics" (3rd ed., 2002), sect. 3.9, 9.7.
"""

import casadi as ca
import numpy as np

from varcalc import mechanics
from varcalc.problems._roots import increasing_root

E, TILT, NODE = 0.6, 0.9, 0.4
system = mechanics.System(
    lambda t, q, v: ca.sumsqr(v) / 2 + 1 / ca.norm_2(q), ("x", "y", "z"), name="Kepler's problem in space"
)
AXIS = np.array([np.cos(NODE), np.sin(NODE), 0.0])
ACROSS = np.array([-np.cos(TILT) * np.sin(NODE), np.cos(TILT) * np.cos(NODE), np.sin(TILT)])
SHORT = np.sqrt(1 - E**2)


def exact(t):
    """x, y and z from the perihelion, by the eccentric anomaly."""
    a = increasing_root(lambda a: (a - E * np.sin(a), 1 - E * np.cos(a)), t - 1, t + 1, t)
    return np.outer(AXIS, np.cos(a) - E) + np.outer(ACROSS, SHORT * np.sin(a))


def energy(q, p):
    return ca.sumsqr(p) / 2 - 1 / ca.norm_2(q)


def turned(q, p):
    return ca.cross(q, p)


def runge_lenz(q, p):
    return ca.cross(p, ca.cross(q, p)) - q / ca.norm_2(q)


def brackets(_):
    """How far the brackets are from what they are known to be, at a place."""
    q, p = ca.DM([0.7, -0.4, 0.5]), ca.DM([0.3, 0.8, -0.6])
    off = []
    for (f, g, h), size in (
        ((turned, turned, turned), 1), ((turned, runge_lenz, runge_lenz), 1),
        ((runge_lenz, runge_lenz, turned), -2 * energy(q, p)),
    ):  # fmt: skip
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            bracket = mechanics.poisson(lambda q, p, f=f, i=i: f(q, p)[i], lambda q, p, g=g, j=j: g(q, p)[j])
            off.append(abs(float(bracket(q, p) - size * h(q, p)[k])))
    off += [abs(float(mechanics.poisson(energy, lambda q, p, i=i: runge_lenz(q, p)[i])(q, p))) for i in range(3)]
    return max(off)


experiment = mechanics.Experiment(
    system, ((1 - E) * AXIS).tolist(), (SHORT / (1 - E) * ACROSS).tolist(), (0.0, 18.0), exact, {"brackets": brackets},
    title="Kepler's ellipse in space",
)  # fmt: skip
