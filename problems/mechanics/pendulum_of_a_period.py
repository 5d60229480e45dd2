"""The pendulum that swings in a given time: a closed orbit as a stationary point of the action.

L = v²/2 + cos θ. The amplitude is 2 arcsin k with the period 4 K(k). The swing is the least of all quarter swings of
this time, and a saddle among all closed curves: one way down, and one level way, along itself.

Source: L. D. Landau, E. M. Lifshitz, "Mechanics" (3rd ed., 1976), sect. 11, problem 1.
"""

import casadi as ca
import numpy as np
from scipy.optimize import brentq
from scipy.special import ellipj, ellipk

import varcalc as vc
from varcalc import mechanics

PERIOD = 8.0
MODULUS = brentq(lambda k: 4 * ellipk(k**2) - PERIOD, 1e-6, 1 - 1e-12, xtol=1e-16)
system = mechanics.System(lambda t, q, v: v[0] ** 2 / 2 + ca.cos(q[0]), ("theta",), name="pendulum of a period")
orbits = system.closed_orbits(PERIOD, [mechanics.Repeats([[-1]], 2), mechanics.Returns([[1]])])
solution = vc.solve(orbits.problem, guess=orbits.guess(lambda t: np.array([np.cos(2 * np.pi * t / PERIOD)])))
orbit = orbits.orbit(solution)


def exact(t):
    """θ from its amplitude."""
    return 2 * np.arcsin(MODULUS * ellipj(t + ellipk(MODULUS**2), MODULUS**2)[0])[None]


def told(_):
    """One off for each thing that is told wrongly."""
    least = vc.verify(solution).verdict is vc.Verdict.MINIMUM
    return float(not least) + float((orbit.index, orbit.nullity) != (1, 1))


experiment = mechanics.Experiment(
    system, orbit.q(0.0).tolist(), orbit.v(0.0).tolist(), (0.0, PERIOD), exact,
    {"closing": lambda _: orbit.closure, "told": told}, title="A pendulum that swings in 8 units of time",
)  # fmt: skip
