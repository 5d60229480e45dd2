"""The heavy symmetric top: nutation between roots of a cubic in cos θ, in its cases I, II and III, and where it goes.

u = cos θ, u'² = (1 - u²)(2 E' - 2 M g h u)/I1 - (p_φ - p_ψ u)²/I1², of whose roots two bound the motion:
u = u1 + (u2 - u1) sn²(n t + K), n² = M g h (u3 - u1)/(2 I1). φ' = (p_φ - p_ψ u)/(I1 (1 - u²)) has one sign (case I),
vanishes where θ turns (II), or changes its sign (III), as p_φ/p_ψ is more than, is, or is less than cos θ there.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 7.3; H. Goldstein, C. Poole,
J. Safko, "Classical Mechanics" (3rd ed., 2002), sect. 5.7.
"""

import numpy as np
from scipy.special import ellipj, ellipk

from varcalc import mechanics

top = mechanics.Top(I1=1.0, I3=0.8, Mgh=0.1)
P_PSI, TILT = 1.0, 1.0
CASES = {"MONOTONE": 0.6, "CUSP": np.cos(TILT), "LOOP": 0.5}
"""p_φ/p_ψ of each case, let go with θ = 1 and θ' = 0."""


def begun(ratio):
    """Euler angles and angular velocity."""
    rate = (ratio - np.cos(TILT)) * P_PSI / (top.I1 * np.sin(TILT) ** 2)
    start = mechanics.EulerAngles(0.0, TILT, 0.0)
    return start, np.array([0.0, rate * np.sin(TILT), P_PSI / top.I3])


def cubic(ratio):
    """The roots, ascending: the start is the middle one, the others are those of a quadratic that is left."""
    u, pull = np.cos(TILT), 2 * top.Mgh
    energy = (ratio - u) ** 2 / (1 - u**2) + pull * u
    half = (energy + P_PSI**2 - pull * u) / (2 * pull)
    rest = (2 * ratio * P_PSI - pull - u * (energy + P_PSI**2 - pull * u)) / pull
    larger = half + np.sqrt(half**2 - rest)
    return rest / larger, u, larger


def limits():
    """cos θ where it turns, against the roots of the cubic, in all cases."""
    return max(np.abs(np.subtract(top.nutation(*begun(ratio)).u, cubic(ratio)[:2])).max() for ratio in CASES.values())


def told():
    """One off for each case that is called by another name."""
    return sum(top.nutation(*begun(ratio)).case.name != name for name, ratio in CASES.items())


def moved(ratio):
    """By how much the motion over ten nutations misses Jacobi's sn, the advance of φ, and the kept momenta."""
    first, second, third = cubic(ratio)
    m, n = (second - first) / (third - first), np.sqrt(top.Mgh * (third - first) / (2 * top.I1))
    found = top.nutation(*begun(ratio))
    period = 2 * ellipk(m) / n
    motion, times = top.motion(*begun(ratio), (0.0, 10 * period)), np.linspace(0, 10 * period, 401)
    known = first + (second - first) * ellipj(ellipk(m) * (1 + 2 * (times / period % 1)), m)[0] ** 2
    angles = motion.euler_angles(times)
    turned = np.unwrap(angles.phi)[-1] - 10 * found.precession
    off = np.abs(np.cos(angles.theta) - known).max()
    return max(off, abs(found.period / period - 1), abs(turned), *motion.drift.values())


experiment = mechanics.Examination(
    "A heavy top", {"limits": limits, "told": told} | {name.lower(): lambda r=r: moved(r) for name, r in CASES.items()}
)
