"""A particle that goes from one well to the other and back: the quartic potential -x²/2 + x⁴/4.

x = a cn(κt) with κ² = a² - 1 and m = a²/(2 κ²), over the hill while a > √2; the period is 4 K/κ. In one well, while
1 < a < √2, x = a dn(a t/√2) with m = 2 - 2/a².

Source: A. H. Nayfeh, D. T. Mook, "Nonlinear Oscillations" (1979), sect. 2.1; National Institute of Standards and
Technology, "Digital Library of Mathematical Functions", 22.19(ii).
"""

import numpy as np
from scipy.special import ellipj, ellipk

from varcalc import mechanics

OVER, WITHIN = 1.45, 1.35
KAPPA = np.sqrt(OVER**2 - 1)
M = OVER**2 / (2 * KAPPA**2)
system = mechanics.System(
    lambda t, q, v: v[0] ** 2 / 2 + q[0] ** 2 / 2 - q[0] ** 4 / 4, ("x",), name="double well"
)  # fmt: skip


def exact(t):
    """x over the hill."""
    return OVER * ellipj(KAPPA * t, M)[1][None]


def within(motion):
    """How far a motion in one of the wells is off."""
    t = np.linspace(motion.span[0], motion.span[1], 400)
    known = WITHIN * ellipj(WITHIN * t / np.sqrt(2), 2 - 2 / WITHIN**2)[2]
    return np.abs(system.motion([WITHIN], [0.0], motion.span).q(t)[0] - known).max()


experiment = mechanics.Experiment(
    system, [OVER], [0.0], (0.0, 20.0), exact,
    {"period": lambda motion: abs(motion.events[1].t - 4 * ellipk(M) / KAPPA), "one well": within},
    (mechanics.Event(lambda t, q, v: v[0], "turning point"),), title="A double well",
)  # fmt: skip
