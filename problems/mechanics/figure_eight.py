"""Three bodies of mass 1 that chase each other along a figure eight: the action is least in its symmetry class.

q(t + T/6) exchanges the bodies and reflects them, q(-t) turns them about the middle one. The reference figures are
those of the sources to the digits that these print, the last of the action by Fourier series of 60 terms.

Source: A. Chenciner, R. Montgomery, Ann. Math. 152 (2000), 881; C. Simó, "Dynamical properties of the figure eight
solution of the three-body problem", Contemp. Math. 292 (2002), 209.
"""

import casadi as ca
import numpy as np

import varcalc as vc
from varcalc import mechanics

PERIOD, ACTION, ANGLES = 2 * np.pi, 8.123975492080937, (0.00842272, 0.29809253)
PAIRS = ((0, 2), (2, 4), (4, 0))
system = mechanics.System(
    lambda t, q, v: ca.sumsqr(v) / 2 + sum(1 / ca.norm_2(q[a : a + 2] - q[b : b + 2]) for a, b in PAIRS),
    ("x1", "y1", "x2", "y2", "x3", "y3"), name="three bodies",
)  # fmt: skip
following = np.kron([[0, 0, 1], [1, 0, 0], [0, 1, 0]], np.diag([-1.0, 1.0]))
turned = -np.kron([[1, 0, 0], [0, 0, 1], [0, 1, 0]], np.eye(2))
orbits = system.closed_orbits(PERIOD, [mechanics.Repeats(following, 6), mechanics.Returns(turned)])


def guess(t):
    """A rough eight."""
    return np.concatenate([
        [1.08 * np.sin(t + k * PERIOD / 3), 0.35 * np.sin(2 * (t + k * PERIOD / 3))] for k in range(3)
    ])  # fmt: skip


solution = vc.solve(orbits.problem, guess=orbits.guess(guess))
orbit = orbits.orbit(solution)


def told(_):
    """One off for each thing that is told wrongly: least in its class, two ways down and four level ones outside."""
    least = vc.verify(solution).verdict is vc.Verdict.MINIMUM
    return float(not least) + float((orbit.index, orbit.nullity, orbit.stable) != (2, 4, True))


def angles(_):
    """How far Floquet's angles are from those of the source, beyond its digits."""
    found = np.angle(orbit.multipliers) / PERIOD
    return max(max(np.abs(found - angle).min() - 5e-9, 0.0) for angle in ANGLES)


experiment = mechanics.Experiment(
    system, orbit.q(0.0).tolist(), orbit.v(0.0).tolist(), (0.0, PERIOD), None,
    {"action of a body": lambda _: abs(orbit.action / 3 - ACTION), "closing": lambda _: orbit.closure,
     "angles": angles, "told": told},
    title="The figure eight of three bodies",
)  # fmt: skip
