"""Functionals that fall towards a limit as an unknown number or a free curve grows: nothing attains it."""

import casadi as ca
import pytest

import varcalc as vc


def numbered(lagrangian, guess=1.0):
    return vc.Problem(lagrangian, vc.Fixed(0, 0), vc.Fixed(1, 1), unknowns={"k": guess})


@pytest.mark.parametrize("method", [None, vc.Ritz(optimiser=vc.Ipopt())])
@pytest.mark.parametrize(
    "lagrangian",
    [
        lambda x, y, v, p: v**2 / p.k,
        lambda x, y, v, p: v**2 * ca.exp(p.k),
        lambda x, y, v, p: (v**2 + 1) / (1 + p.k**2),
        lambda x, y, v, p: (v**2 + y**2) * ca.exp(-p.k),
    ],
)
def test_an_infimum_at_an_infinite_number_is_no_minimum(lagrangian, method):
    assert not vc.solve(numbered(lagrangian), method, throw=False).status.ok


@pytest.mark.parametrize(
    ("lagrangian", "value", "number"),
    [
        (lambda x, y, v, p: v**2 / p.k + p.k, 2.0, 1.0),
        (lambda x, y, v, p: v**2 + (p.k - 1e4) ** 2, 1.0, 1e4),
        (lambda x, y, v, p: (v - 1) ** 2 + (p.k - 1e4) ** 2, 0.0, 1e4),  # nothing is left of it
        # 1/k falls on, but for a narrow valley at 2, and there is the answer
        (lambda x, y, v, p: v**2 + 1 / p.k - ca.exp(-((100 * (p.k - 2)) ** 2)), None, 2.0),
    ],
)
def test_a_number_that_is_attained_stays(lagrangian, value, number):
    solution = vc.solve(numbered(lagrangian, guess=2.001))
    assert solution.unknowns["k"] == pytest.approx(number, rel=1e-4, abs=1e-2)
    assert value is None or abs(solution.value - value) <= max(solution.error.value, 1e-14)


@pytest.mark.parametrize(
    ("lagrangian", "ends"),
    [
        (lambda x, y, v: v**2 + 1 / (1 + y**2), (vc.Free(0), vc.Free(1))),
        (lambda x, y, v: v**2 + ca.exp(-y), (vc.Free(0), vc.Free(1))),
    ],
)
def test_a_free_curve_that_rises_for_ever_is_no_minimum(lagrangian, ends):
    assert not vc.solve(vc.Problem(lagrangian, *ends), throw=False).status.ok


def test_a_free_curve_that_ends_on_the_way_stays():
    solution = vc.solve(vc.Problem(lambda x, y, v: (v**2 + (y - 1e4) ** 2) / 2, vc.Free(0), vc.Free(1)))
    assert abs(solution.y(0.5) - 1e4) < 1e-6
