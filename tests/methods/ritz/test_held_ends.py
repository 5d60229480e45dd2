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


def test_what_a_held_end_is_worth_is_told_and_where_a_curve_rests_it_is_not():
    # J = c^2/2 - k c where the end is held at c < k, and -k^2/2 where it is not
    def pressed(c, k):
        return vc.Problem(
            lambda x, y, v, p: v**2 / 2, vc.Fixed(0, 0), vc.Free(1), [vc.Bound(lambda x, y, v, p: y - p.c, upper=0)],
            end_cost=lambda x0, y0, x1, y1, p: -p.k * y1, parameters={"c": c, "k": k},
        )  # fmt: skip

    held, free = vc.solve(pressed(1.0, 3.0)), vc.solve(pressed(1.0, 0.5))
    assert dict(held.sensitivities) == pytest.approx({"c": -2.0, "k": -1.0}, abs=1e-12)
    assert dict(free.sensitivities) == pytest.approx({"c": 0.0, "k": -0.5}, abs=1e-12)
    rests = vc.Problem(
        lambda x, y, v, p: v**2 / 2 + p.g * y + 0.5 * ca.fabs(v), vc.Fixed(0, 1), vc.Free(2),
        [vc.Bound(lambda x, y, v, p: y - p.c, lower=0)], parameters={"c": 0.1, "g": 1.0},
    )  # fmt: skip
    told = vc.solve(rests).sensitivities
    # J = g c T + 1/2 h + sqrt(2 g) (2/3) h^(3/2), h = 1 - c
    assert told["g"] == pytest.approx(0.1 * 2 + 0.9**1.5 * 2 / 3 / np.sqrt(2), abs=1e-8)
    assert np.isnan(told["c"])


def test_the_momentum_at_a_held_end_is_that_of_the_levels_as_well():
    # y' = a - l x with a - l/2 = c = 1 and a/2 - l/3 = A = 0.7: l = 12 (c/2 - A), and the end is pressed as a < k = 1
    problem = vc.Problem(
        lambda x, y, v: v**2 / 2, vc.Fixed(0, 0), vc.Free(1),
        [vc.Isoperimetric(lambda x, y, v: x * v, 0.7), vc.Bound(lambda x, y, v: y, upper=1)],
        end_cost=lambda x0, y0, x1, y1: -y1,
    )  # fmt: skip
    found = vc.solve(problem)
    assert abs(found.value + 0.26) <= found.error.value + 1e-14
    assert found.stats.elements == 1  # no mesh had to be refined toward the end
