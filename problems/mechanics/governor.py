"""Watt's governor: two balls on arms that turn, and a sleeve that they lift.

L = l² θ'² (m + 2 M sin²θ) + m l² W² sin²θ + 2 (m + M) g l cos θ. It hangs straight while W² < (m + M) g/(m l),
beyond at cos θ = (m + M) g/(m l W²), and sways there with w² = m W² sin²θ/(m + 2 M sin²θ).

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 2.4, ch. 8, problem 1; J. C.
Maxwell, "On Governors", Proc. R. Soc. 16 (1868) 270.
"""

import casadi as ca
import numpy as np

from varcalc import mechanics

G, ARM, BALL, SLEEVE = 9.81, 0.4, 0.8, 1.5
CRITICAL = np.sqrt((BALL + SLEEVE) * G / (BALL * ARM))


def governor(turn):
    return mechanics.System(
        lambda t, q, v: (
            ARM**2 * v[0] ** 2 * (BALL + 2 * SLEEVE * ca.sin(q[0]) ** 2) + BALL * (ARM * turn * ca.sin(q[0])) ** 2
            + 2 * (BALL + SLEEVE) * G * ARM * ca.cos(q[0])
        ),
        ("theta",), name="governor",
    )  # fmt: skip


SLOW, FAST = 0.8 * CRITICAL, 1.4 * CRITICAL
OPEN = np.arccos((CRITICAL / FAST) ** 2)


def places():
    """How far the places of rest are off, on either side of the critical turning."""
    slow, fast = (governor(turn).equilibria([-0.3], [1.5]) for turn in (SLOW, FAST))
    return max(np.abs(slow.places[:, 0]).max(), np.abs(fast.places[:, 0] - [0, OPEN]).max()) + slow.unresolved


def frequencies():
    """How far the frequencies are, and the rate at which it opens; what is told wrongly stable counts as 1."""
    hangs, opened, falls = (governor(turn).normal_modes([at]) for turn, at in ((SLOW, 0), (FAST, OPEN), (FAST, 0)))
    share = BALL * np.sin(OPEN) ** 2 / (BALL + 2 * SLEEVE * np.sin(OPEN) ** 2)
    misses = (
        hangs.frequencies[0] / np.sqrt(CRITICAL**2 - SLOW**2),
        opened.frequencies[0] / (FAST * np.sqrt(share)),
        falls.rates[0] / np.sqrt(FAST**2 - CRITICAL**2),
    )
    return np.abs(np.array(misses) - 1).max() + float(
        (hangs.stable, opened.stable, falls.stable) != (True, True, False)
    )


experiment = mechanics.Examination("Watt's governor", {"places of rest": places, "frequencies": frequencies})
