"""A pendulum on a cart that a spring holds: its two frequencies, and what is left where one coordinate is frozen.

L = (M + m) x'²/2 + m l x' θ' cos θ + m l² θ'²/2 - k x²/2 + m g l cos θ. The squares of the frequencies are the roots of
M l w⁴ - (k l + (M + m) g) w² + k g. With θ frozen the cart oscillates with √(k/(M + m)), with x frozen the pendulum
swings by itself.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 2.4.5; ch. 2, problem 3.
"""

import casadi as ca
import numpy as np

from varcalc import mechanics

G, CART, BOB, LENGTH, STIFF = 9.81, 1.6, 0.7, 0.9, 18.0


def cart(*constraints):
    return mechanics.System(
        lambda t, q, v: (
            (CART + BOB) * v[0] ** 2 / 2 + BOB * LENGTH * v[0] * v[1] * ca.cos(q[1]) + BOB * (LENGTH * v[1]) ** 2 / 2
            - STIFF * q[0] ** 2 / 2 + BOB * G * LENGTH * ca.cos(q[1])
        ),
        ("x", "theta"), constraints=constraints, units=("m", "rad"), time_unit="s", name="cart on a spring",
    )  # fmt: skip


system, PLACE, ANGLE = cart(), 0.3, 1.9


def frequencies(_):
    """How far the normal modes are off."""
    known = np.sqrt(np.roots([CART * LENGTH, -(STIFF * LENGTH + (CART + BOB) * G), STIFF * G]))
    return np.abs(system.normal_modes([0.0, 0.0]).frequencies / np.sort(known) - 1).max()


def equations(motion):
    """How far the accelerations are from m and M in the balance of forces along the rails, and across the rod."""
    t = 0.37 * motion.span[1]
    x, a = motion.q(t)
    along, across = system.accelerations(t, motion.q(t), motion.v(t))
    turned = BOB * LENGTH * (across * np.cos(a) - motion.v(t)[1] ** 2 * np.sin(a))
    balance = (CART + BOB) * along + turned + STIFF * x, LENGTH * across + along * np.cos(a) + G * np.sin(a)
    return np.abs(balance).max() / G


def frozen(_):
    """How far the accelerations are off where the angle, and where the cart, is held."""
    angle, place = mechanics.Holonomic(lambda t, q: q[1] - ANGLE), mechanics.Holonomic(lambda t, q: q[0] - PLACE)
    carts, bobs = (cart(one).accelerations(0.0, [PLACE, ANGLE], [0.0, 0.0]) for one in (angle, place))
    return max(abs(carts[0] + STIFF * PLACE / (CART + BOB)), abs(bobs[1] + G / LENGTH * np.sin(ANGLE)))


experiment = mechanics.Experiment(
    system, [PLACE, ANGLE], [0.0, 0.0], (0.0, 10.0), None,
    {"frequencies": frequencies, "equations": equations, "frozen": frozen,
     "energy": lambda motion: motion.drift["energy"] / (BOB * G)}, title="A pendulum on a sprung cart",
)  # fmt: skip
