"""Minima with corners, singular starts, obstacles, and a line that a first integral admits though no extremal."""

import casadi as ca
import mpmath as mp
import numpy as np
import pytest

import varcalc as vc

# corners of the minimum itself

BROKEN = vc.Problem(lambda x, y, v: y**2 * (1 - v) ** 2, vc.Fixed(-1, 0), vc.Fixed(1, 1))
BENT = vc.Problem(lambda x, y, v: y**2 * (2 * x - v) ** 2, vc.Fixed(-1, 0), vc.Fixed(1, 1))
ANYWHERE = np.linspace(-1, 1, 41)


def broken(x):
    return np.maximum(0.0, x)


def bent(x):
    return np.where(x > 0, x**2, 0.0)


@pytest.mark.parametrize(("problem", "curve"), [(BROKEN, broken), (BENT, bent)], ids=["corner", "jump of curvature"])
@pytest.mark.parametrize("method", [None, vc.Ritz(elements=2), vc.Ritz(optimiser=vc.Ipopt())], ids=repr)
def test_a_minimum_of_zero_that_is_not_smooth(problem, curve, method):
    solution = vc.solve(problem, method)
    assert 0 <= solution.value <= 10 * solution.error.value <= 1e-12
    assert solution.y(ANYWHERE) == pytest.approx(curve(ANYWHERE), abs=1e-6)


@pytest.mark.parametrize("problem", [BROKEN, BENT], ids=["corner", "jump of curvature"])
@pytest.mark.parametrize("mesh", [(1, 4), (1, 5), (2, 4), (3, 4), (4, 4), (7, 3), (16, 1)])
def test_a_kept_mesh_claims_no_more_than_it_has(problem, mesh):
    solution = vc.solve(problem, vc.Ritz(elements=mesh[0], degree=mesh[1], refine=False), throw=False)
    if solution.status.ok:
        assert 0 <= solution.value <= 10 * solution.error.value


@pytest.mark.parametrize("problem", [BROKEN, BENT], ids=["corner", "jump of curvature"])
@pytest.mark.parametrize("method", [vc.Collocation(), vc.Shooting()], ids=repr)
def test_the_indirect_methods_claim_no_more_either(problem, method):
    solution = vc.solve(problem, method, throw=False)
    if solution.status.ok:
        assert 0 <= solution.value <= 10 * solution.error.value


@pytest.mark.parametrize("problem", [BROKEN, BENT], ids=["corner", "jump of curvature"])
def test_the_second_order_does_not_decide_where_the_slope_is_not_felt(problem):
    check = vc.verify(vc.solve(problem))
    assert check.verdict is vc.Verdict.DEGENERATE
    assert check.index == 0


# Newton's body of least resistance


def test_without_the_bound_zigzags_cost_nothing():
    # steep slopes of either sign make the drag as small as one likes
    body = vc.Problem(lambda x, y, v: 2 * x / (1 + v**2), vc.Fixed(0, 0), vc.Fixed(1, 1))
    for method in (vc.Ritz(elements=2, degree=6, refine=False), vc.Collocation(), vc.FirstIntegral()):
        assert not vc.solve(body, method, throw=False).status.ok, method


# the brachistochrone


def descent(across, depth):
    return vc.Problem(lambda x, y, v: ca.sqrt((1 + v**2) / (2 * y)), vc.Fixed(0, 0), vc.Fixed(across, depth))


def cycloid(across, depth):
    """Angle, radius and T sqrt g of the cycloid from rest: (t - sin t)/(1 - cos t) = across/depth."""
    if depth == 0:
        angle = 2 * mp.pi
        radius = across / angle
    else:
        angle = mp.findroot(
            lambda t: (t - mp.sin(t)) - mp.mpf(across) / depth * (1 - mp.cos(t)), (0.5, 6.0), "illinois"
        )
        radius = depth / (1 - mp.cos(angle))
    return float(angle), float(radius), float(angle * mp.sqrt(radius))


DESCENTS = [(1, 1), (5, 1), (1, 0)]


@pytest.mark.parametrize(("across", "depth"), DESCENTS)
@pytest.mark.parametrize(
    "method", [None, vc.Ritz(optimiser=vc.Ipopt()), vc.Collocation(), vc.FirstIntegral()], ids=repr
)
def test_quickest_descent_with_a_vertical_start(across, depth, method):
    angle, radius, time = cycloid(across, depth)
    solution = vc.solve(descent(across, depth), method)
    assert abs(solution.value - time) <= 10 * solution.error.value <= 1e-8
    assert solution.value >= time - 1e-14
    t = np.linspace(0, angle, 9)[1:-1]
    x, y = radius * (t - np.sin(t)), radius * (1 - np.cos(t))
    assert solution.y(x) == pytest.approx(y, abs=1e-4)


@pytest.mark.parametrize(("across", "depth"), DESCENTS)
def test_the_cycloid_is_a_minimum(across, depth):
    check = vc.verify(vc.solve(descent(across, depth)))
    assert (check.verdict, check.index) == (vc.Verdict.MINIMUM, 0)


@pytest.mark.parametrize(("across", "depth"), DESCENTS)
def test_the_search_for_extremals_finds_the_cycloid_alone(across, depth):
    [one] = vc.extremals(descent(across, depth))
    assert one.value == pytest.approx(cycloid(across, depth)[2], abs=1e-9)


def test_the_straight_line_is_slower():
    assert cycloid(1, 1)[2] < 2.0  # along y = x: int dx/sqrt x


# a first integral's constant line


LEVEL = vc.Problem(lambda x, y, v: ca.sqrt((1 + v**2) / (2 * y)), vc.Fixed(0, 1), vc.Fixed(1, 1))


def dip():
    """T sqrt g and depth of the cycloid between points of depth 1: r (1 + cos p) = 1, r (p + sin p) = 1/2."""
    p = mp.findroot(lambda p: 2 * (p + mp.sin(p)) - (1 + mp.cos(p)), 0.2)
    r = 1 / (1 + mp.cos(p))
    return float(2 * p * mp.sqrt(r)), float(2 * r)


@pytest.mark.parametrize("method", [None, vc.Collocation(), vc.Shooting(), vc.FirstIntegral()], ids=repr)
def test_the_level_line_keeps_the_energy_and_is_no_extremal(method):
    time, depth = dip()
    guess = None if method is None or isinstance(method, vc.FirstIntegral) else lambda x: 1.0
    solution = vc.solve(LEVEL, method, guess=guess)
    assert solution.value == pytest.approx(time, abs=1e-11)
    assert solution.y(0.5) == pytest.approx(depth, abs=1e-5)
    assert solution.value < float(mp.sqrt(mp.mpf(1) / 2)) - 1e-3  # the line's


def test_it_is_not_among_the_extremals():
    [one] = vc.extremals(LEVEL)
    assert one.value == pytest.approx(dip()[0], abs=1e-12)


# round a disc


@pytest.fixture(scope="module")
def disc():
    return vc.Curve(
        lambda q, dq: ca.norm_2(dq), vc.At([-2, 0]), vc.At([2, 0]),
        [vc.Bound(lambda q, dq: ca.sumsqr(q), lower=1)],
    )  # fmt: skip


@pytest.mark.parametrize("side", [1, -1])
def test_both_ways_round_a_disc(disc, side):
    # two tangents from distance 2, and the arc between where they touch
    length = float(2 * mp.sqrt(3) + mp.pi - 2 * mp.acos(mp.mpf(1) / 2))
    assert length == pytest.approx(float(2 * mp.sqrt(3) + mp.pi / 3), abs=1e-14)
    solution = vc.solve(disc, tol=1e-8, guess=lambda t: [4 * t - 2, side * 1.5 * np.sin(np.pi * t)])
    assert abs(solution.value - length) <= 10 * solution.error.value <= 1e-6
    assert solution.q(0.5) == pytest.approx([0, side], abs=1e-4)
    assert vc.verify(solution).verdict is vc.Verdict.MINIMUM


def test_the_straight_line_through_the_disc_is_left(disc):
    solution = vc.solve(disc, tol=1e-8, guess=lambda t: [4 * t - 2, 0.0])
    assert solution.value == pytest.approx(float(2 * mp.sqrt(3) + mp.pi / 3), abs=1e-7)
    assert abs(solution.q(0.5)[1]) == pytest.approx(1.0, abs=1e-4)
