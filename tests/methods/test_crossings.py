"""Where a curve meets a kink: against zeros in closed form."""

import casadi as ca
import numpy as np
import pytest

import varcalc as vc
from varcalc.methods.crossings import crossings


def test_many_crossings_are_made_out_by_few_places_each():
    problem = vc.Problem(lambda x, y, v: v**2 + ca.fabs(ca.sin(1000 * y)), vc.Fixed(0, 0), vc.Fixed(1, 1))
    asked = []

    def straight(x, derivative):
        asked.append(len(x))
        return x[None, :] if derivative == 0 else np.ones((1, len(x)))

    found = crossings(problem, straight, np.linspace(0, 1, 101), np.zeros(0))
    zeros = np.arange(1, 319) * np.pi / 1000
    assert [c.x for c in found] == pytest.approx(zeros, abs=1e-14)
    assert sum(asked) < 400 * len(zeros)
