"""Weights |x - c|^a inside the interval: L_y' = const gives the curve and the value."""

import casadi as ca
import numpy as np
import pytest
from mpmath import beta, hyp2f1, mpf

import varcalc as vc


def power(n, x):
    return mpf(x) ** (n + 1) / (n + 1)


def weighted(a, c, load):
    """|x - c|^a v^2/2 + load y from (0, 0) to (1, 1), and its least value: the momentum is p + load (x - c)."""
    problem = vc.Problem(lambda x, y, dy: ca.fabs(x - c) ** a * dy**2 / 2 + load * y, vc.Fixed(0, 0), vc.Fixed(1, 1))
    before, after = mpf(c), 1 - mpf(c)
    moments = [power(k - a, after) + (-1) ** k * power(k - a, before) for k in range(3)]
    p = (1 - load * moments[1]) / moments[0]
    kinetic = (p**2 * moments[0] + 2 * p * load * moments[1] + load**2 * moments[2]) / 2
    return problem, kinetic + load * (after - p * moments[1] - load * moments[2])


@pytest.mark.parametrize("place", [0.5, 0.3, 1 / 3])
@pytest.mark.parametrize(("a", "load"), [
    (-2.3, 0), (-0.9, 0), (-0.5, 3), (0.2, 0), (0.3, 3), (0.5, -2), (0.8, 3), (0.93, 0), (0.93, 3),
])  # fmt: skip
def test_a_weight_that_is_a_power_inside(a, load, place):
    problem, value = weighted(a, place, load)
    solution = vc.solve(problem)
    assert abs(solution.value - value) <= max(solution.error.value, 1e-13)
    assert solution.error.value <= 1e-10 * max(1, abs(solution.value))


@pytest.mark.parametrize("a", [-0.9, 0.4, 0.8])
def test_the_curve_at_the_place_and_beside_it(a):
    """Also at c itself, where many points of the new coordinate have the same x but for round-off."""
    place = 0.3
    problem, _ = weighted(a, place, 0)
    x = np.array([0.1, 0.2999, place, 0.3001, 0.7])
    way = [power(-a, place) + np.sign(at - place) * power(-a, abs(at - place)) for at in x]
    exact = np.array([float(part / (power(-a, place) + power(-a, 1 - place))) for part in way])
    assert vc.solve(problem).curve(x, 0)[0] == pytest.approx(exact, abs=1e-10)


def test_two_places_that_are_singular_toward_one_another():
    """|x|^a |1 - x|^a v^2 from -1 to 2: one over the integral of the weight's inverse (beta and hypergeometric)."""
    a = 0.4
    problem = vc.Problem(lambda x, y, dy: (ca.fabs(x) * ca.fabs(1 - x)) ** a * dy**2, vc.Fixed(-1, 0), vc.Fixed(2, 1))
    between, beyond = beta(1 - a, 1 - a), hyp2f1(a, 1 - a, 2 - a, -1) / (1 - a)
    assert vc.solve(problem).value == pytest.approx(float(1 / (between + 2 * beyond)), rel=1e-10)


def test_another_power_on_either_side():
    """A weight that switches at the place itself: round-off of x must not decide the side (value by L_y' = const)."""
    problem = vc.Problem(
        lambda x, y, dy: ca.if_else(x < 0.4, ca.fabs(x - 0.4) ** 0.5, ca.fabs(x - 0.4) ** 0.25) * dy**2,
        vc.Fixed(0, 0), vc.Fixed(1, 1),
    )  # fmt: skip
    exact = 1 / (power(-0.5, mpf(0.4)) + power(-0.25, 1 - mpf(0.4)))
    assert vc.solve(problem).value == pytest.approx(float(exact), rel=1e-12)
