"""The error that Ritz claims, where Newton's steps in the richer space tell little of it; quadratures in 30 digits."""

import casadi as ca
import pytest
from mpmath import exp, findroot, mp, mpf, quad, sqrt

import varcalc as vc

WALLS = [(293.854992984, 0.00337099, -0.0635172, 0.0625, 1.7326109), (57.5, 0.0032, -0.055, 0.0625, 1.05)]
"""Height, width and place of the wall, inertia and duration."""


def over_a_wall(height, width, at, inertia, duration):
    """int inertia y'^2/2 + height exp(-((y - at)/width)^2) from -1 to 1, and its least value: motion over the wall."""
    with mp.workdps(30):
        h, w, a, m, t = (mpf(v) for v in (height, width, at, inertia, duration))
        edges = [-1, *(a + k * w for k in (-10, -4, -1, 0, 1, 4, 10)), 1]

        def speed(y, energy):
            return sqrt(2 * (energy + h * exp(-(((y - a) / w) ** 2))) / m)

        energy = findroot(lambda e: quad(lambda y: 1 / speed(y, e), edges) - t, m * (2 / t) ** 2 / 2)
        value = quad(lambda y: m * speed(y, energy), edges) - energy * t
    problem = vc.Problem(
        lambda x, y, dy: inertia * dy**2 / 2 + height * ca.exp(-(((y - at) / width) ** 2)),
        vc.Fixed(0, -1), vc.Fixed(duration, 1),
    )  # fmt: skip
    return problem, float(value)


@pytest.mark.parametrize("wall", WALLS)
@pytest.mark.parametrize("method", [vc.Ritz(), vc.Ritz(elements=24)], ids=["one element", "many"])
def test_a_curve_through_a_wall_is_no_better_than_claimed(wall, method):
    problem, least = over_a_wall(*wall)
    solution = vc.solve(problem, method, throw=False)
    assert not solution.status.ok or abs(solution.value - least) <= solution.error.value + 1e-13 * abs(least)


@pytest.mark.parametrize("wall", WALLS)
def test_a_wall_is_crossed_on_a_mesh_that_holds_what_its_first_integral_gives(wall):
    problem, least = over_a_wall(*wall)
    solution = vc.solve(problem)
    assert abs(solution.value - least) <= solution.error.value + 1e-13 * abs(least)


@pytest.mark.parametrize("radius", [1.0, 3.0])
def test_a_curve_that_vanishes_is_settled_though_round_off_of_it_is_all_there_is(radius):
    # between two circles, both of which it meets where they stand upright
    left = vc.OnCurve(lambda x, y: x**2 + y**2 - 1, x=0.5)
    right = vc.OnCurve(lambda x, y: (x - 3 - radius) ** 2 + y**2 - radius**2, x=3.3)
    solution = vc.solve(vc.Problem(lambda x, y, dy: ca.sqrt(1 + dy**2), left, right), vc.Ritz())
    assert solution.value == pytest.approx(2.0, abs=1e-12)
    assert solution.stats.unknowns < 40
