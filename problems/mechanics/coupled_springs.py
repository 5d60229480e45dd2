"""Two blocks on springs: with three springs and unlike masses, and hung in a row.

w² of m1 x1'' = -(k1 + K) x1 + K x2, m2 x2'' = -(k2 + K) x2 + K x1 solve a quadratic equation; with like ones they are
k/m and (k + 2 K)/m. Of two like blocks in a row, one spring each, w² = (k/(2 m)) (3 ± √5) and y/x = (1 ∓ √5)/2.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 8.3.1, problems 2 and 4.
"""

import numpy as np

from varcalc import mechanics

FIRST, SECOND, LEFT, RIGHT, BETWEEN = 1.3, 0.6, 2.0, 3.1, 0.9


def coupled(m1, m2, k1, k2, k):
    return mechanics.System(
        lambda t, q, v: (
            m1 * v[0] ** 2 + m2 * v[1] ** 2 - k1 * q[0] ** 2 - k2 * q[1] ** 2 - k * (q[0] - q[1]) ** 2
        ) / 2,
        ("x1", "x2"), name="coupled springs",
    )  # fmt: skip


def unlike():
    """How far the frequencies of unlike masses are off."""
    a, b = (LEFT + BETWEEN) / FIRST, (RIGHT + BETWEEN) / SECOND
    root = np.sqrt(((a - b) / 2) ** 2 + BETWEEN**2 / (FIRST * SECOND))
    found = coupled(FIRST, SECOND, LEFT, RIGHT, BETWEEN).normal_modes([0, 0])
    known = np.sqrt((a + b) / 2 + np.array([-root, root]))
    return np.abs(found.frequencies / known - 1).max() + float(not found.stable)


def alike():
    """How far those of like ones are, and their shapes: together, and against each other."""
    found = coupled(FIRST, FIRST, LEFT, LEFT, BETWEEN).normal_modes([0, 0])
    known = np.sqrt(np.array([LEFT, LEFT + 2 * BETWEEN]) / FIRST)
    ratios = found.shapes[1] / found.shapes[0]
    return max(np.abs(found.frequencies / known - 1).max(), np.abs(ratios - [1, -1]).max())


def row():
    """How far two blocks in a row are off, with their shapes."""
    found = coupled(FIRST, FIRST, LEFT, 0.0, LEFT).normal_modes([0, 0])
    signs = np.array([-1, 1])
    known = np.sqrt(LEFT / (2 * FIRST) * (3 + signs * np.sqrt(5)))
    ratios = found.shapes[1] / found.shapes[0]
    return max(np.abs(found.frequencies / known - 1).max(), np.abs(ratios - (1 - signs * np.sqrt(5)) / 2).max())


experiment = mechanics.Examination("Coupled springs", {"unlike": unlike, "alike": alike, "in a row": row})
