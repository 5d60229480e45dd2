"""A pendulum on a rod's end that turns about a vertical axis: two places of rest, one of them stable.

At the distance R > l from the axis, with θ from the upward vertical, towards the axis: (R - l sin θ) W² cos θ is
g sin θ. Squared this is of the fourth degree in sin θ.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), ch. 8, problem 7.
"""

import casadi as ca
import numpy as np

from varcalc import mechanics

G, LENGTH, RADIUS, TURN = 9.81, 0.5, 0.9, 2.8
system = mechanics.System(
    lambda t, q, v: (
        LENGTH**2 * v[0] ** 2 / 2 + (TURN * (RADIUS - LENGTH * ca.sin(q[0]))) ** 2 / 2 - G * LENGTH * ca.cos(q[0])
    ),
    ("theta",), name="pendulum off the axis",
)  # fmt: skip


def known():
    """The places of rest: the roots of the quartic that solve the equation itself."""
    square = np.polymul(np.polymul([-LENGTH, RADIUS], [-LENGTH, RADIUS]), [-1, 0, 1])
    quartic = TURN**4 * square
    quartic[-3] -= G**2
    sines = [x.real for x in np.roots(quartic) if abs(x.imag) < 1e-9 and abs(x) <= 1]
    angles = [np.arctan2(s, G * s / (TURN**2 * (RADIUS - LENGTH * s))) for s in sines]
    return np.sort(angles)


found = system.equilibria([-3.1], [3.15])


def places():
    """How far the places of rest are off: two, and no part of the turn in doubt."""
    return np.abs(found.places[:, 0] - known()).max() + found.unresolved + abs(len(found.places) - 2)


def stability():
    """How far the frequency of the lower one is off, and the rate at which the upper one is left."""
    misses = []
    for angle in known():
        bend = LENGTH * TURN**2 * (LENGTH * np.cos(2 * angle) + RADIUS * np.sin(angle)) + G * LENGTH * np.cos(angle)
        modes = system.normal_modes([angle])
        value = modes.rates[0] if bend > 0 else modes.frequencies[0]
        misses.append(abs(value * LENGTH / np.sqrt(abs(bend)) - 1) + float(modes.stable != (bend < 0)))
    return max(misses) + float(sum(system.normal_modes([angle]).stable for angle in known()) != 1)


experiment = mechanics.Examination("A pendulum off its axis", {"places of rest": places, "stability": stability})
