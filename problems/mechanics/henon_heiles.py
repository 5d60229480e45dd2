"""Hénon and Heiles: straight orbits along an axis, followed in their period up to where others branch off.

L = (x'² + y'²)/2 - (x² + y²)/2 - x² y + y³/3. With x = 0 the energy is that of a cubic: at a share e of 1/6 it turns
back at the roots of y²/2 - y³/3 = e/6. At e = 0.969309 the motions beside it begin to leave it (Brack's orbit R5), and
the index of its action changes.

Source: M. Hénon, C. Heiles, Astron. J. 69 (1964), 73; M. Brack, Found. Phys. 31 (2001), 209.
"""

import casadi as ca
import numpy as np
from scipy.optimize import brentq
from scipy.special import ellipk

import varcalc as vc
from varcalc import mechanics

BRANCHES = 0.969309
system = mechanics.System(
    lambda t, q, v, p: ca.sumsqr(v) / 2 - ca.sumsqr(q) / 2 - q[0] ** 2 * q[1] + q[1] ** 3 / 3,
    ("x", "y"), parameters={"T": 7.0}, name="Hénon and Heiles",
)  # fmt: skip


def start(share):
    """The upper turning point and the period, by the roots of the cubic."""
    low, high, beyond = np.sort(np.roots([-1 / 3, 1 / 2, 0, -share / 6]).real)
    return high, 4 * np.sqrt(1.5 / (beyond - low)) * ellipk((high - low) / (beyond - low))


def orbit(share):
    high, period = start(share)
    return system.orbit([0.0, high], [0.0, 0.0], period)


def across(share):
    """The trace of the multipliers across the orbit less 2: where it is zero others branch off."""
    return float(np.sum(orbit(share).multipliers).real) - 4


def followed(_):
    """One off where the family followed in its period does not change its index between the two energies."""
    orbits = system.closed_orbits("T", [mechanics.Returns(np.eye(2))])
    first = vc.solve(
        orbits.problem,
        vc.Collocation(),
        guess=orbits.guess(lambda t: np.array([0 * t, 0.5 * np.cos(2 * np.pi * t / 7)])),
    )
    branch = vc.continue_branch(first, "T", until=start(0.98)[1])
    last = orbits.orbit(branch.solutions[-1])
    return float(last.index == orbit(0.95).index) + float(abs(last.q(0.0)[1] - start(0.98)[0]) > 1e-11)


def section():
    """Motions of the energy 1/8 that come through x = 0, from a line of places and one of rates."""
    y = np.append(np.linspace(-0.25, 0.55, 13), np.zeros(8))
    rate = np.append(np.zeros(13), np.linspace(-0.42, 0.42, 8))
    along = np.sqrt(1 / 4 - rate**2 - y**2 + 2 * y**3 / 3)
    event = mechanics.Event(lambda t, q, v, p: q[0], "x = 0", direction=1)
    zero = np.zeros_like(y)
    return mechanics.Section(event, np.column_stack([zero, y]), np.column_stack([along, rate]), (0.0, 3000.0), 300)


experiment = mechanics.Experiment(
    system, [0.0, 0.1], [0.4, 0.27], (0.0, 100.0), None,
    {"branching": lambda _: max(abs(brentq(across, 0.965, 0.973, xtol=1e-12) - BRANCHES) - 5e-7, 0.0),
     "followed": followed},
    title="Hénon and Heiles", beside=section(),
)  # fmt: skip
