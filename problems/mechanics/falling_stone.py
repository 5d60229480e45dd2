"""A stone thrown upwards on the turning Earth comes down to the west, and one that is dropped, to the east.

L = v²/2 + v·(W × r) - g z, with x to the south and y to the east; squares of W are left out, as is usual. The rest is
known in full: what of the velocity is across the axis turns with w = 2 W. To first order in w, a fall of the time t
goes W g t³ cos λ/3 to the east, and a throw to the height h comes down 4 W cos λ √(8 h³/g)/3 to the west. Of these
shifts (wt)²/20 and 3 (wt)²/20 at most are missing.

Source: L. D. Landau, E. M. Lifshitz, "Mechanics" (3rd ed., 1976), sect. 39, problem 1; A. J. Brizard, "An Introduction
to Lagrangian Mechanics" (2nd ed., 2015), sect. 6.4; ch. 6, problem 2.
"""

import casadi as ca
import numpy as np

from varcalc import mechanics
from varcalc.problems._functions import sine_deficit

G, LATITUDE, HEIGHT, TURN = 9.81, 0.8, 200.0, 7.2921159e-5
AXIS, UP = np.array([-np.cos(LATITUDE), 0.0, np.sin(LATITUDE)]), np.array([0.0, 0.0, 1.0])
system = mechanics.System(
    lambda t, q, v: ca.sumsqr(v) / 2 + TURN * ca.dot(v, ca.cross(ca.DM(AXIS), q)) - G * q[2], ("x", "y", "z"),
    units=("m", "m", "m"), time_unit="s", name="stone on the turning Earth",
)  # fmt: skip
SPEED, FALL, W = np.sqrt(2 * G * HEIGHT), np.sqrt(2 * HEIGHT / G), 2 * TURN


def exact(t):
    """x, y and z: the part along the axis, the part across it, and what turns out of both."""
    along, turned = AXIS * AXIS[2], np.cross(AXIS, UP)
    versed = 2 * np.sin(W * t / 2) ** 2
    out = SPEED * versed / W - G * sine_deficit(W * t) / W**2
    straight = np.outer(along, SPEED * t - G * t**2 / 2)
    return straight + np.outer(UP - along, SPEED * np.sin(W * t) / W - G * versed / W**2) - np.outer(turned, out)


def beyond(shift, known, missing):
    """By how much of the height a shift is off by more than the order of its formula."""
    return max(0.0, abs(shift - known) - missing * abs(known)) / HEIGHT


def east(_):
    """Of a stone that is dropped."""
    shift = system.motion([0, 0, HEIGHT], [0, 0, 0], (0, FALL)).q(FALL)[1]
    return beyond(shift, TURN * G * FALL**3 * np.cos(LATITUDE) / 3, (W * FALL) ** 2 / 20)


def west(motion):
    """Of the stone that is thrown."""
    known = -4 * TURN * np.cos(LATITUDE) * np.sqrt(8 * HEIGHT**3 / G) / 3
    return beyond(motion.q(2 * FALL)[1], known, 3 * (2 * W * FALL) ** 2 / 20)


experiment = mechanics.Experiment(
    system, [0.0, 0.0, 0.0], [0.0, 0.0, SPEED], (0.0, 2 * FALL), exact, {"to the east": east, "to the west": west},
    title="A stone on the turning Earth",
)  # fmt: skip
