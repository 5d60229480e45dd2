"""A particle that slides inside a cone, far from its circle: Weierstrass's cubic.

L = (s'² + s² φ'² sin²a)/2 - g s cos a. With dt = s du, s'(u)² is a cubic in s with the roots s0 < 0 < s1 < s2, where
s0 = -s1 s2/(s1 + s2): s = s2 - (s2 - s1) sn²(κu), κ² = g cos a (s2 - s0)/2, m = (s2 - s1)/(s2 - s0). Time and angle
are integrals of the second and of the third kind.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 2.5.4, 3.5.3; P. F. Byrd,
M. D. Friedman, "Handbook of Elliptic Integrals" (2nd ed., 1971), no. 236.
"""

import numpy as np
from scipy.special import ellipe, ellipeinc, ellipj, ellipk

from varcalc import mechanics
from varcalc.problems._roots import increasing_root
from varcalc.problems.mechanics._elliptic import third_kind

G, OPENING, LOW, HIGH = 9.81, 0.6, 0.3, 2.0
SINE, PULL = np.sin(OPENING), G * np.cos(OPENING)
system = mechanics.System(
    lambda t, q, v: (v[0] ** 2 + (q[0] * SINE * v[1]) ** 2) / 2 - PULL * q[0],
    ("s", "phi"),
    units=("m", "rad"),
    time_unit="s",
    name="particle in a cone",
)
BELOW = -LOW * HIGH / (LOW + HIGH)
MOMENTUM = SINE * np.sqrt(-2 * PULL * BELOW * LOW * HIGH)
KAPPA, M = np.sqrt(PULL * (HIGH - BELOW) / 2), (HIGH - LOW) / (HIGH - BELOW)
PERIOD = 2 * (BELOW * ellipk(M) + (HIGH - BELOW) * ellipe(M)) / KAPPA


def exact(t):
    """s and φ from the upper turning point, by the u of each time."""

    def time(u):
        sn, _, _, angle = ellipj(KAPPA * u, M)
        return BELOW * u + (HIGH - BELOW) * ellipeinc(angle, M) / KAPPA, HIGH - (HIGH - LOW) * sn**2

    u = increasing_root(time, 0.0, t / LOW, t)
    sn, _, _, angle = ellipj(KAPPA * u, M)
    turned = MOMENTUM / (SINE**2 * HIGH * KAPPA) * third_kind((HIGH - LOW) / HIGH, angle, M)
    return np.stack([HIGH - (HIGH - LOW) * sn**2, turned])


def reduced(motion):
    """How far the motion of Routh's reduced system is from this one."""
    alone = system.routhian({"phi": MOMENTUM}).motion([HIGH], [0.0], motion.span)
    t = np.linspace(motion.span[0], motion.span[1], 300)
    return np.abs(alone.q(t)[0] - motion.q(t)[0]).max()


experiment = mechanics.Experiment(
    system, [HIGH, 0.0], [0.0, MOMENTUM / (SINE * HIGH) ** 2], (0.0, 10 * PERIOD), exact,
    {"period": lambda motion: abs(motion.events[0].t - PERIOD), "Routhian": reduced},
    (mechanics.Event(lambda t, q, v: v[0], "upper turning point", direction=-1),), title="A particle in a cone",
)  # fmt: skip
