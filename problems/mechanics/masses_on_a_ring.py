"""Masses on a ring with springs between neighbours: a motion round it that nothing brings back, and pairs of modes.

w = 2 √(k/m) sin(πj/N), j = 0 ... N - 1: 0 once, all others in pairs, but for the one of an even N in which
neighbours go against each other. With two masses w = 2 √(k/m), of three 0 and √(3 k/m) twice.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), ch. 8, problem 6; N. W. Ashcroft,
N. D. Mermin, "Solid State Physics" (1976), ch. 22.
"""

import numpy as np

from varcalc import mechanics

MASS, SPRING = 0.7, 1.9


def ring(count):
    return mechanics.System(
        lambda t, q, v: (
            sum(MASS * v[j] ** 2 - SPRING * (q[(j + 1) % count] - q[j]) ** 2 for j in range(count)) / 2
        ),
        [f"x{j}" for j in range(count)],
    )  # fmt: skip


def frequencies():
    """How far they are off."""
    misses = []
    for count in (2, 3, 12):
        modes = ring(count).normal_modes(np.zeros(count))
        known = np.sort(2 * np.sqrt(SPRING / MASS) * np.sin(np.pi * np.arange(count) / count))
        misses.append(np.abs(modes.frequencies - known).max() + float(modes.zero_modes != 1) + float(modes.stable))
    return max(misses)


def zero_mode():
    """How far the mode of frequency 0 is from turning all masses alike."""
    shape = ring(3).normal_modes([0.1, 0.1, 0.1]).shapes[:, 0]
    return np.abs(shape / shape[0] - 1).max()


experiment = mechanics.Examination("Masses on a ring", {"frequencies": frequencies, "zero mode": zero_mode})
