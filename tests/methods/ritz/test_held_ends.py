"""Free ends that a bound holds, against closed forms: L = y'^2/2 + y cos(w x) between them, and costs of the ends."""

import casadi as ca
import numpy as np
import pytest
from mpmath import cos, mp, mpf, quad, sin

import varcalc as vc

mp.dps = 30


def loaded(length, frequency, start, end):
    """The value between given ends: y'' = cos(w x), so that y = a + c x - cos(w x) / w^2."""
    T, w = mpf(length), mpf(frequency)
    a = mpf(start) + 1 / w**2
    c = (mpf(end) - a + cos(w * T) / w**2) / T

    def along(x):
        return (c + sin(w * x) / w) ** 2 / 2 + (a + c * x - cos(w * x) / w**2) * cos(w * x)

    return float(quad(along, [0, T]))


@pytest.mark.parametrize("sign", [1, -1], ids=["upper", "lower"])
@pytest.mark.parametrize("maximise", [False, True], ids=["least", "most"])
def test_a_cost_presses_the_end_against_a_bound(sign, maximise):
    turn = -1 if maximise else 1
    problem = vc.Problem(
        lambda x, y, v: turn * (v**2 / 2 + y * ca.cos(3 * x)), vc.Fixed(0, 0), vc.Free(1.5),
        [vc.Bound(lambda x, y, v: sign * y, upper=1.0)], end_cost=lambda x0, y0, x1, y1: -turn * sign * 5 * y1,
        maximise=maximise,
    )  # fmt: skip
    exact = turn * (loaded(1.5, 3, 0, sign) - 5)
    for method in (None, vc.Ritz()):
        found = vc.solve(problem, method)
        assert abs(found.value - exact) <= found.error.value + 1e-14 * abs(exact)
        assert not found.local
    wanted = vc.Verdict.MAXIMUM if maximise else vc.Verdict.MINIMUM
    assert vc.verify(found).verdict is wanted


def test_both_ends_are_held_one_by_a_bound_that_slants():
    problem = vc.Problem(
        lambda x, y, v: v**2 / 2 + y * ca.cos(3 * x), vc.Free(0), vc.Free(1),
        [vc.Bound(lambda x, y, v: 2 * y - x, upper=1.0), vc.Bound(lambda x, y, v: y, lower=-0.5)],
        end_cost=lambda x0, y0, x1, y1: 4 * y0 - 4 * y1,
    )  # fmt: skip
    exact = loaded(1, 3, -0.5, 1) + 4 * -0.5 - 4 * 1
    found = vc.solve(problem)
    assert abs(found.value - exact) <= found.error.value + 1e-14 * abs(exact)


def test_an_end_that_would_leave_its_bound_is_free():
    # unbound the end is at 2, beyond the bound; a hill of the cost there turns it back to where it costs nothing
    problem = vc.Problem(
        lambda x, y, v: v**2 / 2, vc.Fixed(0, 0), vc.Free(1), [vc.Bound(lambda x, y, v: y, upper=1.0)],
        end_cost=lambda x0, y0, x1, y1: -3 * y1 + 6 * ca.exp(-(((y1 - 1) / 0.2) ** 2)),
    )  # fmt: skip
    y = np.linspace(-1, 1, 200001)
    costs = y**2 / 2 - 3 * y + 6 * np.exp(-(((y - 1) / 0.2) ** 2))
    found = vc.solve(problem)
    assert y[np.argmin(costs)] < 0.9
    assert abs(found.value - costs.min()) < 1e-8
    assert abs(float(found.curve(np.array([1.0]), 0)[0, 0]) - y[np.argmin(costs)]) < 1e-4
