"""A bead on a turning hoop near the critical turning: its angle is an order parameter, and its response diverges.

L = (θ'² + W² sin²θ)/2 + W_c² cos θ. Below W_c the bead rests at the bottom and gives way to a steady torque by
1/(W_c² - W²); beyond, it rests at cos θ = (W_c/W)², about √(4 (W - W_c)/W_c), and gives way by W²/(W⁴ - W_c⁴).

Source: A. Abanov, "Lectures on Classical Mechanics", lect. 10; A. J. Brizard, "An Introduction to Lagrangian Mechanics"
(2nd ed., 2015), sect. 8.1.1.
"""

import casadi as ca
import numpy as np

from varcalc import mechanics

CRITICAL = 3.5
hoop = mechanics.System(
    lambda t, q, v, p: (v[0] ** 2 + (p.w * ca.sin(q[0])) ** 2) / 2 + CRITICAL**2 * ca.cos(q[0]), ("theta",),
    parameters={"w": 1.0}, name="bead on a turning hoop",
)  # fmt: skip


def side(turn):
    """The angle of rest beyond the critical turning."""
    return np.arccos((CRITICAL / turn) ** 2)


def order_parameter():
    """How far the angle is off, and its exponent from 1/2, beyond a hundredth."""
    turns = CRITICAL * (1 + np.array([0.01, 0.001]))
    angles = [hoop.with_parameters({"w": turn}).equilibria([1e-3], [1.5]).places[0, 0] for turn in turns]
    exponent = np.log10(angles[0] / angles[1])
    # near the critical turning the angle is known as the square root of what rounds its cosine
    return np.abs(np.cos(angles) - np.cos(side(turns))).max() + max(0.0, abs(exponent - 0.5) - 0.01)


def response():
    """How far the response to a steady torque is off on either side, and from its divergence as 1/|W - W_c|."""
    misses = []
    for share in (0.5, 0.99, 1.01, 1.7):
        turn = share * CRITICAL
        angle = 0.0 if share < 1 else side(turn)
        known = 1 / (CRITICAL**2 - turn**2) if share < 1 else turn**2 / (turn**4 - CRITICAL**4)
        found = mechanics.Response(hoop.with_parameters({"w": turn}).linearised([angle]))(0.0)[0, 0]
        misses.append(abs(found / known - 1))
    return max(misses)


experiment = mechanics.Examination(
    "A bead on a hoop near the critical turning", {"order parameter": order_parameter, "response": response}
)
