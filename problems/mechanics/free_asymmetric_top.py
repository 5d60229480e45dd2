"""A free asymmetric top over ten periods, by Jacobi's elliptic functions, about its axes of least and greatest moment.

Where L² > 2 E I2: ω1 ~ cn, ω2 ~ sn, ω3 ~ dn of n t, with n² = (I3 - I2)(L² - 2 E I1)/(I1 I2 I3) and
m = (I2 - I1)(2 E I3 - L²)/((I3 - I2)(L² - 2 E I1)); else I1 and I3 change places.

Source: L. D. Landau, E. M. Lifshitz, "Mechanics" (3rd ed., 1976), sect. 37; A. J. Brizard, "An Introduction to
Lagrangian Mechanics" (2nd ed., 2015), sect. 7.2.3.
"""

import numpy as np
from scipy.special import ellipj, ellipk

from varcalc import mechanics

MOMENTS = np.array([1.0, 1.5, 2.2])
GREATEST, LEAST = np.array([0.9, 0.0, 1.3]), np.array([1.9, 0.0, 0.7])
body = mechanics.RigidBody(MOMENTS)


def known(start):
    """ω (3, m) of times as shares of the period, and the period, from ω2 = 0."""
    energy, momentum = MOMENTS @ start**2, (MOMENTS * start) @ (MOMENTS * start)  # twice, and squared
    (a, b, c), swapped = MOMENTS, momentum < energy * MOMENTS[1]
    a, c = (c, a) if swapped else (a, c)
    n = np.sqrt((c - b) * (momentum - energy * a) / (a * b * c))
    m = (b - a) * (energy * c - momentum) / ((c - b) * (momentum - energy * a))
    middle = np.sqrt((energy * c - momentum) / (b * (c - b)))

    def omega(shares):
        sn, cn, dn, _ = ellipj(4 * ellipk(m) * (shares % 1), m)
        first, third = (dn, cn) if swapped else (cn, dn)
        return np.array([start[0] * first, middle * sn, start[2] * third])

    return omega, 4 * ellipk(m) / n


def missed(start):
    """By how much ω misses the closed form over ten periods."""
    omega, period = known(start)
    shares = np.linspace(0, 10, 401)
    motion = body.motion((1, 0, 0, 0), start, (0.0, 10 * period))
    return np.abs(motion.angular_velocity(motion.span[1] / 10 * shares) - omega(shares)).max()


def periods():
    """The periods by the library's quadrature in closed form against Jacobi's."""
    return max(abs(body.polhode(start).period / known(start)[1] - 1) for start in (GREATEST, LEAST))


experiment = mechanics.Examination(
    "A free asymmetric top",
    {"about the greatest": lambda: missed(GREATEST), "about the least": lambda: missed(LEAST), "periods": periods},
)
