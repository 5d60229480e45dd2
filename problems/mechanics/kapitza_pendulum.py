"""A pendulum whose support is shaken fast: it can stand upside down, or hang askew.

Shaken up and down by a cos(wt) its mean motion has the potential -g l cos θ + (a w)² sin²θ/4, across
-g l cos θ + (a w)² cos²θ/4 (mass 1). Upright it stands with the frequency √((a w/l)²/2 - g/l), once (a w)² > 2 g l;
shaken across it hangs at cos θ = 2 g l/(a w)². The exact threshold is off by (a/l)², as the mean is.

Source: P. L. Kapitza, Sov. Phys. JETP 21 (1951) 588; L. D. Landau, E. M. Lifshitz, "Mechanics" (3rd ed., 1976), sect.
30.
"""

import casadi as ca
import numpy as np
from scipy.optimize import brentq
from scipy.special import mathieu_a

from varcalc import mechanics

G, LENGTH, SHAKE, DRIVE = 9.81, 0.7, 0.03, 260.0


def shaken(up, across):
    """The pendulum, with all that does not move it left out."""
    return mechanics.System(
        lambda t, q, v, p: (
            LENGTH**2 * v[0] ** 2 / 2 + G * LENGTH * ca.cos(q[0])
            + LENGTH * SHAKE * p.w**2 * ca.cos(p.w * t) * (across * ca.sin(q[0]) - up * ca.cos(q[0]))
        ),
        ("theta",), parameters={"w": DRIVE}, name="Kapitza's pendulum",
    )  # fmt: skip


vertical, horizontal = shaken(1, 0), shaken(0, 1)
upright, askew = (mechanics.averaged(system, lambda p: 2 * np.pi / p.w).system for system in (vertical, horizontal))
SQUARE = (SHAKE * DRIVE) ** 2


def potential():
    """How far the force of the mean motion is off, shaken either way."""
    angle = np.array([0.4, 1.3, 2.9])
    misses = []
    for mean, sign in ((upright, 1), (askew, -1)):
        force = -G * LENGTH * np.sin(angle) - sign * SQUARE / 4 * np.sin(2 * angle)
        found = [LENGTH**2 * mean.accelerations(0.0, [one], [0.0])[0] for one in angle]
        misses.append(np.abs(np.array(found) - force).max() / np.abs(force).max())
    return max(misses)


def rests():
    """How far the upright frequency and the place askew are off."""
    known = np.sqrt(SQUARE / (2 * LENGTH**2) - G / LENGTH)
    modes, places = upright.normal_modes([np.pi]), askew.equilibria([0.2], [3.0]).places
    side = np.arccos(2 * G * LENGTH / SQUARE)
    return max(abs(modes.frequencies[0] / known - 1), abs(places[0, 0] - side)) + float(not modes.stable)


def threshold():
    """How far the exact threshold is off: about the top it is Mathieu's equation, whose boundary is a0."""
    # in τ = wt/2: a = -4 g/(l w²), and q = 2 a/l
    exact = np.sqrt(-4 * G / LENGTH / mathieu_a(0, 2 * SHAKE / LENGTH))
    chart = mechanics.stability_chart(
        vertical, [np.pi], lambda p: 2 * np.pi / p.w, {"w": np.linspace(0.8, 1.2, 20) * exact}
    )
    return abs(chart.boundaries.places[0, 0] / exact - 1) + len(chart.boundaries.places) - 1


def order():
    """Whether the mean's threshold is off by the square of the shake: its order less 2, beyond a tenth."""

    def miss(shake):
        at = brentq(lambda w: mathieu_a(0, 2 * shake) + 4 / w**2, 1 / shake, 2 / shake, xtol=1e-13)
        return abs(at * shake / np.sqrt(2) - 1)

    return max(0.0, abs(np.log2(miss(0.1) / miss(0.05)) - 2) - 0.1)


experiment = mechanics.Examination(
    "Kapitza's pendulum",
    {"effective potential": potential, "places of rest": rests, "threshold": threshold, "order": order},
)
