"""The sleeping top: upright it is stable from (I3 ω3)² = 4 M g h I1 on, and starts there without trouble.

Pushed a little, its axis goes out to where (1 + u)(e - A u) = β² (1 - u), with u = cos θ, A = 2 M g h/I1, β = I3 ω3/I1
and e = A + θ'²; below the threshold that is far from upright however small the push.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 7.3.5; L. D. Landau,
E. M. Lifshitz, "Mechanics" (3rd ed., 1976), sect. 35, problem 2.
"""

import numpy as np

from varcalc import mechanics

top = mechanics.Top(I1=1.3, I3=0.4, Mgh=2.1)
UPRIGHT, PUSH = mechanics.EulerAngles(0.0, 0.0, 0.0), 1e-3


def threshold():
    """The critical spin, and that small departures are said to grow below it, and to swing above."""
    critical = np.sqrt(4 * top.Mgh * top.I1) / top.I3
    found = [top.nutation(UPRIGHT, [0, 0, critical * share]).stable for share in (0.999999, 1.000001)]
    return abs(top.critical_spin / critical - 1) + (found != [False, True])


def asleep():
    """Left alone it stays upright, and turns evenly, fast or slow."""
    wrong = 0.0
    for share in (0.5, 1.5):
        omega, times = share * top.critical_spin, np.linspace(0, 20, 101)
        angles = top.motion(UPRIGHT, [0, 0, omega], (0.0, 20.0)).euler_angles(times)
        wrong = max(
            wrong, np.abs(angles.theta).max(), np.abs(np.exp(1j * angles.psi) - np.exp(1j * omega * times)).max()
        )
    return wrong


def reach(share):
    """cos θ at the far end after a push from upright: the root of a quadratic."""
    pull, beta = 2 * top.Mgh / top.I1, top.I3 * share * top.critical_spin / top.I1
    # A u² + (A - e - β²) u + β² - e = 0, with e = A + θ'²
    half, rest = (PUSH**2 + beta**2) / (2 * pull), (beta**2 - pull - PUSH**2) / pull
    return half - np.sqrt(half**2 - rest)


def pushed(share):
    """By how much the limit of nutation, and that of the motion, miss the far end."""
    omega = [PUSH, 0.0, share * top.critical_spin]
    found = top.nutation(UPRIGHT, omega)
    motion = top.motion(UPRIGHT, omega, (0.0, found.period))
    turned = motion.rotation(found.period / 2)[2, 2]
    return max(abs(found.u[0] - reach(share)), abs(turned - reach(share)))


experiment = mechanics.Examination(
    "The sleeping top",
    {"threshold": threshold, "asleep": asleep, "fast": lambda: pushed(1.2), "slow": lambda: pushed(0.8)},
)
