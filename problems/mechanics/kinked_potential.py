"""The potential F |x|: parabolas on either side of a kink, each side moved by itself, up to an event where x = 0.

On each side L = m v²/2 - F |x| is smooth, and x = c t - F t²/(2 m) from x = 0 with m c²/2 = E. The turning points are
±E/F, and the period 4 √(2 m E)/F.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), ch. 3, problem 1.
"""

import numpy as np

from varcalc import mechanics

MASS, FORCE, ENERGY = 0.8, 1.7, 2.1
SPEED = np.sqrt(2 * ENERGY / MASS)
kink = mechanics.Event(lambda t, q, v: q[0], "kink", terminal=True)
top = mechanics.Event(lambda t, q, v: v[0], "turning point")


def half(side):
    """The side where x is positive, or where it is negative."""
    return mechanics.System(lambda t, q, v: MASS * v[0] ** 2 / 2 - side * FORCE * q[0], ("x",), name="kinked potential")


system = half(1)


def exact(t):
    """x on the side where the motion begins."""
    return (SPEED * t - FORCE * t**2 / (2 * MASS))[None]


def period(motion):
    """How far the time is off in which the motion goes over both sides."""
    last = motion.events[-1]
    back = half(-1).motion(last.q, last.v, (last.t, last.t + motion.span[1] + 1), events=[kink])
    return abs(back.span[1] - 4 * np.sqrt(2 * MASS * ENERGY) / FORCE)


experiment = mechanics.Experiment(
    system, [0.0], [SPEED], (0.0, 5.0), exact,
    {"period": period, "turning point": lambda motion: abs(motion.events[0].q[0] - ENERGY / FORCE)}, (kink, top),
    title="A kinked potential",
)  # fmt: skip
