"""Which way kinks point: no minimum follows one that points up."""

import casadi as ca
import numpy as np
import pytest

import varcalc as vc
from varcalc.existence.pointed import points_up
from varcalc.methods.crossings import Crossing, on_curve


def along(problem, level=0.0):
    """A curve along the first kink of the problem, near 1, and the crossing that says so."""

    def curve(x, k):
        return np.full((1, len(x)), 1.1) if k == 0 else np.zeros((1, len(x)))

    return curve, Crossing(x=0.5, switch=on_curve(problem)[0], level=level, until=1.5)


@pytest.mark.parametrize("unit", [1.0, 1e-6, 1e6])
@pytest.mark.parametrize(("factor", "up"), [(-3.0, True), (3.0, False), (0.0, False)])
def test_a_ridge_points_up_and_a_valley_does_not(factor, up, unit):
    """The factor 0 leaves a concave L beside a kink that is that of a level alone."""
    level = vc.Isoperimetric(lambda x, y, v: ca.fabs(y / unit - 1), 1.0)
    problem = vc.Problem(
        lambda x, y, v: v**2 / 2 + factor * ca.fabs(y / unit - 1) - (y / unit) ** 2, vc.Fixed(0, 0), vc.Fixed(2, 0),
        constraints=[] if factor else [level],
    )  # fmt: skip
    curve, crossing = along(problem)
    assert points_up(problem, lambda x, k: unit * curve(x, k), crossing) is up


def test_which_way_a_kink_points_that_a_level_weighs_is_not_known():
    both = vc.Problem(
        lambda x, y, v: v**2 / 2 - ca.fabs(y - 1), vc.Fixed(0, 0), vc.Fixed(2, 0),
        constraints=[vc.Isoperimetric(lambda x, y, v: ca.fabs(y - 1), 1.0)],
    )  # fmt: skip
    assert not points_up(both, *along(both))
