"""N masses on springs between two walls: the phonons of a row of atoms, and a rope's as its limit.

w_n = 2 √(k/m) sin(πn/(2 (N + 1))), shaped as sin(πnj/(N + 1)). A rope of tension T and density ρ cut into N + 1 parts a
has k = T/a, m = ρ a, and w_n goes to πn √(T/ρ)/L as a² does.

Source: A. L. Fetter, J. D. Walecka, "Theoretical Mechanics of Particles and Continua" (1980), sect. 24, 25; A. Abanov,
"Lectures on Classical Mechanics", lect. 21.
"""

import casadi as ca
import numpy as np

from varcalc import mechanics

MASS, SPRING, COUNT = 0.7, 1.9, 40
TENSION, DENSITY, LENGTH = 3.0, 0.2, 1.6


def chain(count, mass, spring):
    return mechanics.System(
        lambda t, q, v: (
            mass * ca.sumsqr(v) - spring * (q[0] ** 2 + q[count - 1] ** 2 + ca.sumsqr(q[1:] - q[:-1]))
        ) / 2,
        [f"x{j}" for j in range(count)],
    )  # fmt: skip


def frequencies():
    """How far they are off, and their shapes."""
    modes = chain(COUNT, MASS, SPRING).normal_modes(np.zeros(COUNT))
    n = np.arange(1, COUNT + 1)
    known = 2 * np.sqrt(SPRING / MASS) * np.sin(np.pi * n / (2 * (COUNT + 1)))
    waves = np.sin(np.pi * np.outer(n, n) / (COUNT + 1))
    overlap = np.abs(np.sum(waves * modes.shapes, axis=0)) / np.linalg.norm(waves, axis=0)
    misses = np.abs(modes.frequencies / known - 1).max(), np.abs(overlap * np.sqrt(MASS) - 1).max()
    return max(misses) + float(not modes.stable)


def rope():
    """How far the lowest frequencies of a rope are from falling short by the square of its parts; 1 counts as none."""
    misses = []
    for parts in (20, 40):
        part = LENGTH / parts
        modes = chain(parts - 1, DENSITY * part, TENSION / part).normal_modes(np.zeros(parts - 1))
        # of a finite rope w/(its limit) = sin(x)/x with x = πn/(2 parts)
        x = np.pi * np.arange(1, 4) / (2 * parts)
        limit = np.pi * np.arange(1, 4) * np.sqrt(TENSION / DENSITY) / LENGTH
        misses.append(np.abs(modes.frequencies[:3] / limit - np.sin(x) / x).max())
    return max(misses)


experiment = mechanics.Examination("A chain of masses and springs", {"frequencies": frequencies, "rope": rope})
