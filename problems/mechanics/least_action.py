"""A stone thrown from one place to be at another in a given time: of all ways, its own has the least action.

L = v²/2 - g z. From (0, 0) to (X, Z) in the time T the action is (X² + Z²)/(2 T) - g Z T/2 - g² T³/24.

Source: R. P. Feynman, R. B. Leighton, M. Sands, "The Feynman Lectures on Physics", vol. II (1964), ch. 19; R. P.
Feynman, A. R. Hibbs, "Quantum Mechanics and Path Integrals" (1965), problem 2-3.
"""

import casadi as ca
import numpy as np

import varcalc as vc
from varcalc import mechanics

G, TIME, GOAL = 9.81, 1.7, (6.0, 2.5)
system = mechanics.System(
    lambda t, q, v: ca.sumsqr(v) / 2 - G * q[1], ("x", "z"), units=("m", "m"), time_unit="s", name="thrown stone"
)
RATES = GOAL[0] / TIME, GOAL[1] / TIME + G * TIME / 2


def exact(t):
    """x and z."""
    return np.stack([RATES[0] * t, RATES[1] * t - G * t**2 / 2])


def action(motion):
    """How far the least action, and the way that has it, are off; a way that is not told the least is off by one."""
    least = vc.solve(system.between([0.0, 0.0], GOAL, TIME))
    t = np.linspace(0, TIME, 100)
    known = (GOAL[0] ** 2 + GOAL[1] ** 2) / (2 * TIME) - G * GOAL[1] * TIME / 2 - G**2 * TIME**3 / 24
    if least.curve is None or vc.verify(least).verdict is not vc.Verdict.MINIMUM:
        return 1.0
    return max(abs(least.value / known - 1), np.abs(least.curve(t, 0) - motion.q(t)).max() / GOAL[0])


experiment = mechanics.Experiment(
    system, [0.0, 0.0], RATES, (0.0, TIME), exact, {"least action": action}, title="A thrown stone"
)  # fmt: skip
