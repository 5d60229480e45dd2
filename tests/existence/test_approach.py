"""Infima approached by concentration, and Lavrentiev gaps."""

from __future__ import annotations

import casadi as ca
import mpmath
import numpy as np
import pytest

import varcalc as vc
from varcalc.existence.approach import approached, gap

WEIERSTRASS = vc.Problem(lambda x, y, v: x**2 * v**2, vc.Fixed(-1, -1), vc.Fixed(1, 1))
MANIA = vc.Problem(lambda x, y, v: (y**3 - x) ** 2 * v**6, vc.Fixed(0, 0), vc.Fixed(1, 1))


def test_weierstrass_example_on_polygons():
    # on pieces of length h the flux is constant: J = 4 / sum of h^2 / int x^2
    found = approached(WEIERSTRASS)
    for elements, value in zip(found.elements, found.values, strict=True):
        cubes = np.linspace(-1, 1, elements + 1) ** 3
        assert value == pytest.approx(4 / ((2 / elements) ** 2 * (3 / np.diff(cubes)).sum()), rel=1e-10)
    # J_h / h tends to 2 / (3 sum of 1 / (3 j^2 + 3 j + 1))
    total = mpmath.nsum(lambda j: 1 / (3 * j**2 + 3 * j + 1), [0, mpmath.inf])
    assert found.values[-1] * found.elements[-1] / 2 == pytest.approx(float(2 / (3 * total)), rel=5e-3)
    assert found.concentrates
    assert found.where == pytest.approx(0, abs=2 / found.elements[-1])
    assert abs(found.limit) < 2e-2 * found.values[-1]
    assert gap(WEIERSTRASS, found) is None


def test_the_gap_of_manias_example():
    # 0 for x^(1/3), and at least 7^2 3^5 / (2^18 5^5) for every curve of bounded slope (Mania, 1934)
    found = approached(MANIA)
    assert found.limit > 7**2 * 3**5 / (2**18 * 5**5)
    between = gap(MANIA, found)
    assert between is not None
    assert between.value == pytest.approx(0, abs=1e-20)
    assert (between.power, between.at_start) == (3, True)


@pytest.mark.parametrize(
    "lagrangian",
    [
        lambda x, y, v: ca.sqrt(1 + v**2),
        lambda x, y, v: ca.sqrt(x) * v**2,  # y ~ sqrt(x): an infinite slope, approached by polygons
        lambda x, y, v: ca.sqrt((1 + v**2) / y),
        lambda x, y, v: v**2 + y**4,
    ],
)
def test_no_gap_and_no_concentration_where_a_curve_attains_the_minimum(lagrangian):
    problem = vc.Problem(lagrangian, vc.Fixed(0, 0), vc.Fixed(1, 1))
    found = approached(problem)
    assert not found.concentrates
    assert gap(problem, found) is None


@pytest.mark.parametrize("length", [1.5707, 1.58, 1.65])
def test_a_jump_lower_than_what_the_slope_rises_by_beside_it(length):
    # the greatest area on a chord of 1 under graphs of a length beyond pi / 2 is that of a half disc on two pillars
    problem = vc.Problem(
        lambda x, y, v: y, vc.Fixed(0, 0), vc.Fixed(1, 0),
        [vc.Isoperimetric(lambda x, y, v: ca.sqrt(1 + v**2), length)], maximise=True,
    )  # fmt: skip
    found = approached(problem, closely=True)
    assert found.concentrates == (length > np.pi / 2)
    if found.concentrates:
        supremum = np.pi / 8 + (length - np.pi / 2) / 2
        assert found.limit == pytest.approx(supremum, rel=2e-5)
        refusal = vc.solve(problem, throw=False)
        assert refusal.verdict is vc.Verdict.NOT_ATTAINED


@pytest.mark.parametrize(("problem", "verdict"), [(WEIERSTRASS, vc.Verdict.NOT_ATTAINED), (MANIA, vc.Verdict.GAP)])
def test_solve_says_why_there_is_no_minimum(problem, verdict):
    with pytest.raises(vc.VariationalError) as refusal:
        vc.solve(problem)
    assert refusal.value.verdict is verdict
    assert str(refusal.value)


@pytest.mark.parametrize("height", [1e-5, 1e-9, 1e-13])
def test_in_no_unit_is_weierstrass_infimum_attained(height):
    example = vc.Problem(lambda x, y, dy: (x * dy) ** 2, vc.Fixed(-1, -height), vc.Fixed(1, height))
    assert vc.solve(example, throw=False).verdict is vc.Verdict.NOT_ATTAINED
