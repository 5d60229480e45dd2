"""The potential F |x|: parabolas on either side of a kink, each from x = 0 to the turning point and back.

L = m v²/2 - F |x|, and x = c t - F t²/(2 m) from x = 0 with m c²/2 = E. The turning points are ±E/F, and the period
4 √(2 m E)/F.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), ch. 3, problem 1.
"""

import casadi as ca
import numpy as np

from varcalc import mechanics

MASS, FORCE, ENERGY = 0.8, 1.7, 2.1
SPEED = np.sqrt(2 * ENERGY / MASS)
PERIOD = 4 * np.sqrt(2 * MASS * ENERGY) / FORCE
kink = mechanics.Event(lambda t, q, v: q[0], "kink")
top = mechanics.Event(lambda t, q, v: v[0], "turning point")
system = mechanics.System(lambda t, q, v: MASS * v[0] ** 2 / 2 - FORCE * ca.fabs(q[0]), ("x",), name="kinked potential")


def exact(t):
    """Half a period on one side, half on the other."""
    half, ahead = np.divmod(t, PERIOD / 2)
    return ((-1) ** half * (SPEED * ahead - FORCE * ahead**2 / (2 * MASS)))[None]


def happened(motion, name):
    """Times and places of an event."""
    return np.array([(h.t, h.q[0]) for h in motion.events if h.name == name]).T


def kinks(motion):
    """How far off the times are at which it comes through the kink."""
    times, _ = happened(motion, "kink")
    return np.abs(times - PERIOD / 2 * np.arange(1, len(times) + 1)).max()


def turning_points(motion):
    """How far off the places are at which it turns."""
    _, places = happened(motion, "turning point")
    return np.abs(np.abs(places) - ENERGY / FORCE).max()


experiment = mechanics.Experiment(
    system, [0.0], [SPEED], (0.0, 10 * PERIOD), exact,
    {"kinks": kinks, "turning points": turning_points},
    (kink, top), title="A kinked potential",
)  # fmt: skip
