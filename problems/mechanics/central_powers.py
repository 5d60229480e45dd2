"""Central forces of homogeneous potentials: effective potential, turning points, virial theorem, small oscillations.

Of U = k rⁿ/n the averages of a bounded motion obey 2 <K> = n <U>. About the circle of radius (l²/m k)^(1/(n + 2))
radial oscillations are √(n + 2) times as fast as the motion around, and for n < -2 they part from it. The energy is
that of the effective potential l²/2 m r² + U at both turning points.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 4.1, 4.2, eq. 4.8 to 4.17.
"""

from functools import cache

import numpy as np

from varcalc import mechanics

MASS, K, MOMENTUM = 1.3, 0.7, 0.9
POWERS = (4.0, 1.0, -0.5, -1.5)


@cache
def reduced(n):
    """The radius in the potential k rⁿ/n."""
    system = mechanics.System(
        lambda t, q, v: MASS * (v[0] ** 2 + q[0] ** 2 * v[1] ** 2) / 2 - K * q[0] ** n / n, ("r", "phi")
    )
    return system.reduced({"phi": MOMENTUM})


def effective(n, r):
    """The effective potential."""
    return MOMENTUM**2 / (2 * MASS * r**2) + K * r**n / n


def circle(n):
    """The radius of the circular orbit, and both frequencies."""
    (rest,) = reduced(n).rests
    radius = (MOMENTUM**2 / (MASS * K)) ** (1 / (n + 2))
    around = MOMENTUM / (MASS * radius**2)
    wrong = 0.0 if rest.stable == (n > -2) else np.inf
    rate = rest.rate / (np.sqrt(abs(n + 2)) * around)
    return wrong + max(abs(rest.place / radius - 1), abs(rate - 1), abs(rest.angular_rates["phi"] / around - 1))


@cache
def orbit(n):
    """A motion whose energy lies between that of the circle and what lets it escape."""
    motion = reduced(n)
    bottom = motion.rests[0].energy
    (found,) = motion.orbits(bottom + 0.4 * abs(bottom))
    return found


def turning(n):
    """By how much the energy is missed at the turning points."""
    found = orbit(n)
    return max(abs(effective(n, r) / found.energy - 1) for r in (found.low, found.high))


def virial(n):
    """By how much the theorem is missed, in units of the kinetic energy."""
    found = orbit(n)
    potential = found.average(lambda q, v: K * q**n / n)
    return abs(n * potential / (2 * (found.energy - potential)) - 1)


experiment = mechanics.Examination(
    "Central forces of powers",
    {
        "circles": lambda: max(circle(n) for n in (*POWERS, -2.5)),
        "turning points": lambda: max(turning(n) for n in POWERS),
        "virial theorem": lambda: max(virial(n) for n in POWERS),
    },
)
