"""What the figures of the charged spherical pendulum share: motions in its wells, above the threshold Ω = 1.94204."""

import numpy as np

from varcalc.problems.mechanics.charged_spherical_pendulum import pendulum
from varcalc.study.drawing import Line, Panel

LARMOR, MOMENTUM, TIME, PLACES = 2.5, 1.0, 40.0, 3001
NAMES = ("lower well", "separatrix", "upper well")


def reduced(larmor, momentum):
    """The motion of θ alone, by the Routhian."""
    return pendulum(larmor).routhian({"phi": momentum})


def potential(larmor, momentum, theta):
    """The effective potential, zero for a pendulum that hangs."""
    return reduced(larmor, momentum).energies(theta[None], np.zeros((1, len(theta)))) + 1


def starts(momentum):
    """θ from which motions at rest in θ stay in the lower well, come to the crest, and stay in the upper well.

    Wells and crest are those of p_φ, whatever its sign, to which sin²θ φ'² alone is blind but for a constant.
    """
    lower, crest, upper = np.sort(reduced(LARMOR, momentum).equilibria([0.1], [3.0]).places[:, 0])
    return lower + 0.6 * (crest - lower), crest - 1e-4, upper - 0.6 * (upper - crest)


def orbit(momentum, theta):
    """θ and φ (2, m)."""
    rate = momentum / np.sin(theta) ** 2 + LARMOR
    motion = pendulum(LARMOR).motion([theta, 0.0], [0.0, rate], (0.0, TIME))
    return motion.q(np.linspace(0.0, TIME, PLACES))


def orbits(momentum):
    """θ, φ and the places (3, m), in each of the three."""
    found = {}
    for name, theta in zip(NAMES, starts(momentum), strict=True):
        theta_phi = orbit(momentum, theta)
        found[name] = (*theta_phi, place(*theta_phi))
    return found


def place(theta, phi):
    """x, y and z of the bob, which hangs at z = -1."""
    return np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), -np.cos(theta)])


def flat(places, first, second, title=""):
    """A projection with the circle in which the sphere is seen."""
    around = np.linspace(0, 2 * np.pi, 201)
    rim = Line(np.cos(around), np.sin(around), dashed=True, colour=5)
    names = ("x", "y", "z")
    return Panel(
        [Line(places[first], places[second], colour=0), rim], names[first], names[second], title=title, equal=True
    )
