"""A particle that goes through a round hole in a heavy sheet.

On the axis the sheet with the hole pulls with -2 π G σ z/√(R² + z²), the sheet's own pull less the disc's. In the hole
w² = 2 π G σ/R; let go at z0, the particle takes the period 4 ∫ dz/√(2 a (√(R² + z0²) - √(R² + z²))), a = 2 π G σ.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), ch. 8, problem 5.
"""

import casadi as ca
import mpmath

from varcalc import mechanics

PULL, RADIUS, START = 1.7, 0.6, 0.9
system = mechanics.System(
    lambda t, q, v: v[0] ** 2 / 2 - PULL * ca.sqrt(RADIUS**2 + q[0] ** 2), ("z",), name="hole in a sheet"
)


def frequency(_):
    """How far the small oscillation is off."""
    return abs(float(system.normal_modes([0.0]).frequencies[0]) / float(mpmath.sqrt(PULL / RADIUS)) - 1)


def rest(_):
    """How far the one place of rest is off."""
    found = system.equilibria([-2.0], [1.9])
    return abs(float(found.places[0, 0])) + len(found.places) - 1 + found.unresolved


def period(motion):
    """How far the crossings of the hole are from the quarters of the period: with z = z0 sin x it has no ends."""
    with mpmath.workdps(25):
        top = mpmath.sqrt(RADIUS**2 + mpmath.mpf(START) ** 2)

        def rate(x):
            z = START * mpmath.sin(x)
            # √(R² + z0²) - √(R² + z²) = z0² cos²x/(sum of the roots)
            return mpmath.sqrt((top + mpmath.sqrt(RADIUS**2 + z**2)) / (2 * mpmath.mpf(PULL)))

        quarter = mpmath.quad(rate, [0, mpmath.pi / 2])
        return max(
            float(abs(one.t / ((2 * k + 1) * quarter) - 1)) for k, one in enumerate(motion.events)
        )  # fmt: skip


through = mechanics.Event(lambda t, q, v: q[0], "through the hole")
experiment = mechanics.Experiment(
    system, [START], [0.0], (0.0, 20.0), None, {"frequency": frequency, "rest": rest, "period": period}, (through,),
    title="A particle and a hole in a sheet",
)  # fmt: skip
