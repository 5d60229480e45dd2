"""Round obstacles as bounds: below one and above the next, the way that no curve beside another leads to."""

from functools import reduce

import casadi as ca
import numpy as np
import pytest

import varcalc as vc


def taut(x, y, radius):
    """The length of a string from (0, 0) to (2, 0), below a disc at (x, y) and above its image at (2 - x, -y).

    Two tangents and an arc to (1, 0), and the same on: half of it is sqrt(d^2 - r^2) + r theta + sqrt(D^2 - r^2).
    """
    first, second = np.hypot(x, y), np.hypot(1 - x, y)
    beneath = np.pi - np.arctan2(y, x) - np.arctan2(y, 1 - x)
    arc = beneath - np.arccos(radius / first) - np.arccos(radius / second)
    return 2 * (np.sqrt(first**2 - radius**2) + radius * arc + np.sqrt(second**2 - radius**2))


DISCS = [(0.5, 0.1, 0.25), (0.6, 0.1, 0.3)]


@pytest.mark.parametrize("disc", DISCS)
@pytest.mark.parametrize("together", [False, True])
def test_a_string_goes_below_one_disc_and_above_the_next(disc, together):
    x0, y0, radius = disc
    away = [lambda x, y, v, a=a, b=b: (x - a) ** 2 + (y - b) ** 2 - radius**2 for a, b in ((x0, y0), (2 - x0, -y0))]
    one = [lambda x, y, v: reduce(ca.fmin, [f(x, y, v) for f in away])]
    bounds = [vc.Bound(f, lower=0) for f in (one if together else away)]
    solution = vc.solve(vc.Problem(lambda x, y, v: ca.sqrt(1 + v**2), vc.Fixed(0, 0), vc.Fixed(2, 0), bounds))
    assert solution.value == pytest.approx(taut(*disc), abs=1e-9)
    assert not solution.local
