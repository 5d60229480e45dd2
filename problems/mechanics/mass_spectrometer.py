"""A mass spectrometer: ions are accelerated, the fast and the slow taken out, and the rest bent onto a plate.

A voltage V gives v = √(2 V e/m); crossed fields let v = E/B straight through; a field B then bends the way into half a
circle of radius r = m v/(e B) = √(2 m V/e)/B, which ends on the plate 2 r away.

Source: F. W. Aston, "Mass Spectra and Isotopes" (2nd ed., 1942); L. D. Landau, E. M. Lifshitz, "The Classical Theory of
Fields" (4th ed., 1975), sect. 20 - 22.
"""

import numpy as np

from varcalc import mechanics

UNIT, CHARGE = 1.66053906660e-27, 1.602176634e-19
VOLTAGE, GAP, SELECTS, FIELD = 2000.0, 0.05, 0.15, 0.2
LIGHT = CHARGE / (34.968853 * UNIT)  # charge of an ion of chlorine 35, by its mass


def ion(specific, magnetic, electric=0.0):
    """An ion in a magnetic field across the plane, and an electric one (along x) of this strength."""
    return mechanics.charged(
        1.0, specific, lambda t, q: [-magnetic * q[1] / 2, magnetic * q[0] / 2], lambda t, q: -electric * q[0]
    )


system = mechanics.System(ion(LIGHT, FIELD), ("x", "y"), name="mass spectrometer")
SPEED, OMEGA = np.sqrt(2 * VOLTAGE * LIGHT), LIGHT * FIELD
RADIUS = SPEED / OMEGA
plate = mechanics.Event(lambda t, q, v: q[1], "plate", direction=-1, terminal=True)


def exact(t):
    """x and y from the slit, which the ion leaves along y."""
    return RADIUS * np.stack([1 - np.cos(OMEGA * t), np.sin(OMEGA * t)])


def speed(_):
    """How far the speed behind the voltage is off."""
    gap = mechanics.System(ion(LIGHT, 0.0, VOLTAGE / GAP), ("x", "y"))
    across = mechanics.Event(lambda t, q, v: q[0], "slit", terminal=True)
    return abs(gap.motion([-GAP, 0], [0, 0], (0, 3 * GAP / SPEED), events=[across]).events[0].v[0] / SPEED - 1)


def selector(_):
    """How far an ion of the right speed is led astray by the crossed fields."""
    crossed = mechanics.System(ion(LIGHT, SELECTS, -SPEED * SELECTS), ("x", "y"))
    return abs(crossed.motion([0, 0], [0, SPEED], (0, 0.3 / SPEED)).q(0.3 / SPEED)[0])


experiment = mechanics.Experiment(
    system, [0.0, 0.0], [0.0, SPEED], (0.0, 4 / OMEGA), exact,
    {
        "speed": speed, "selector": selector,
        "spot": lambda motion: abs(motion.events[0].q[0] - 2 * np.sqrt(2 * VOLTAGE / LIGHT) / FIELD),
    },
    (plate,), title="A mass spectrometer",
)  # fmt: skip
