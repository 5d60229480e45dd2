"""Closed orbits: symmetries as coordinates, closure, action, Floquet's multipliers and Morse's index."""

import casadi as ca
import numpy as np
import pytest
from scipy.special import ellipj, ellipk

import varcalc as vc
from varcalc import mechanics

oscillator = mechanics.System(lambda t, q, v: ca.sumsqr(v) / 2 - (q[0] ** 2 + 4 * q[1] ** 2) / 2, ("x", "y"))
pendulum = mechanics.System(lambda t, q, v: v[0] ** 2 / 2 + ca.cos(q[0]), ("theta",))
kepler = mechanics.System(lambda t, q, v: ca.sumsqr(v) / 2 + 1 / ca.norm_2(q), ("x", "y"))
TURN = np.array([[0.0, -1.0], [1.0, 0.0]])


@pytest.mark.parametrize("amplitude", [0.3, 2.0, 3.0])
def test_a_swing_of_given_period_and_its_index(amplitude):
    k = np.sin(amplitude / 2)
    period = 4 * ellipk(k**2)
    orbits = pendulum.closed_orbits(period, [mechanics.Repeats([[-1]], 2), mechanics.Returns([[1]])])
    solution = vc.solve(orbits.problem, guess=orbits.guess(lambda t: amplitude * np.cos(2 * np.pi * t / period)[None]))
    orbit = orbits.orbit(solution)
    t = np.linspace(-period, 2 * period, 50)  # known at all times
    exact = 2 * np.arcsin(k * ellipj(t + ellipk(k**2), k**2)[0])
    np.testing.assert_allclose(orbit.q(t)[0], exact, atol=1e-9)
    assert orbit.closure < 1e-11
    # one way down, and one level way: along itself; q' has two zeros in a period, so one mode lies below it or two
    assert (orbit.index, orbit.nullity) == (1, 1)
    assert 4 * solution.value == pytest.approx(orbit.action, abs=1e-12 + 4 * solution.error.value)


@pytest.mark.parametrize(("period", "index"), [(6.0, 1), (6.5, 3), (12.0, 3), (12.7, 5), (20.0, 7)])
def test_rest_is_a_closed_orbit_of_any_period_with_the_index_of_its_waves(period, index):
    # of the waves cos and sin(2 pi k t/T) those with 2 pi k < T go down, and the constant
    orbit = pendulum.orbit([0.0], [0.0], period)
    assert (orbit.index, orbit.nullity) == (index, 0)
    angles = np.sort(np.angle(orbit.multipliers) % (2 * np.pi))
    np.testing.assert_allclose(angles, np.sort([period % (2 * np.pi), -period % (2 * np.pi)]), atol=1e-12)


def test_upright_rest_is_a_closed_orbit_of_the_index_zero():
    upright = pendulum.orbit([np.pi], [0.0], 6.5)
    np.testing.assert_allclose(np.abs(upright.multipliers), np.exp([6.5, -6.5]), rtol=1e-9)
    assert not upright.stable
    assert (upright.index, upright.nullity) == (0, 0)


def test_ellipses_of_one_period_tie():
    for eccentricity in (0.0, 0.7):
        near = 1 - eccentricity
        orbit = kepler.orbit([near, 0.0], [0.0, np.sqrt((1 + eccentricity) / near)], 2 * np.pi)
        assert orbit.action == pytest.approx(3 * np.pi, abs=1e-12)  # Gordon's theorem
        assert (orbit.index, orbit.nullity) == (0, 3)


@pytest.mark.parametrize(
    "symmetry",
    [
        [mechanics.Repeats(TURN, 4)],
        [mechanics.Repeats(-np.eye(2), 2)],
        [mechanics.Returns(np.diag([1.0, -1.0]))],
        [mechanics.Repeats(TURN, 4), mechanics.Returns(np.diag([1.0, -1.0]))],
        [mechanics.Repeats(np.linalg.matrix_power(TURN, 3), 4), mechanics.Returns(np.diag([1.0, -1.0]))],
    ],
)
def test_a_circle_in_every_class_that_it_belongs_to(symmetry):
    # r'' = -r^(-3) r + ...: L = v²/2 + 1/r on a circle of radius 1
    way = -1 if np.allclose(symmetry[0].matrix, np.linalg.matrix_power(TURN, 3)) else 1
    orbits = kepler.closed_orbits(2 * np.pi, symmetry)
    solution = vc.solve(
        orbits.problem, vc.Ritz(), guess=orbits.guess(lambda t: np.array([np.cos(t), way * np.sin(t)])), throw=False
    )
    assert solution.value * round(2 * np.pi / solution.x[-1]) == pytest.approx(3 * np.pi, abs=1e-10)
    orbit = orbits.orbit(solution)
    assert orbit.action == pytest.approx(3 * np.pi, abs=1e-12)
    t = np.linspace(0, 2 * np.pi, 9)
    np.testing.assert_allclose((orbit.q(t) ** 2).sum(0), 1.0, atol=1e-6)


def test_symmetries_in_coordinates_at_an_angle():
    # the circle seen in coordinates that are not at right angles: its symmetries are no orthogonal matrices there
    skew = np.array([[1.0, 0.4], [0.0, 0.8]])
    seen = mechanics.System(
        lambda t, q, v: ca.sumsqr(ca.mtimes(skew, v)) / 2 + 1 / ca.norm_2(ca.mtimes(skew, q)), ("a", "b")
    )
    back = np.linalg.inv(skew)
    symmetry = [mechanics.Repeats(back @ TURN @ skew, 4), mechanics.Returns(back @ np.diag([1.0, -1.0]) @ skew)]
    orbits = seen.closed_orbits(2 * np.pi, symmetry)
    guess = orbits.guess(lambda t: back @ np.array([np.cos(t), np.sin(t)]).reshape(2, -1))
    solution = vc.solve(orbits.problem, vc.Ritz(), guess=guess, throw=False)
    assert 8 * solution.value == pytest.approx(3 * np.pi, abs=1e-10)


@pytest.mark.parametrize(
    ("symmetry", "said"),
    [
        ([mechanics.Repeats(TURN, 4)], "no symmetry of L"),
        ([mechanics.Returns([[1.0]])], r"shape \(2, 2\)"),
        ([mechanics.Repeats(np.diag([-1.0, 1.0]), 2)], "odd number of directions"),
        ([mechanics.Returns(np.eye(2)), mechanics.Returns(-np.eye(2))], "one of each"),
    ],
)
def test_symmetries_that_are_none_are_refused(symmetry, said):
    with pytest.raises((ValueError, TypeError), match=said):
        oscillator.periodic(5.0, symmetry)


def test_arguments_are_named():
    with pytest.raises(ValueError, match="identity"):
        mechanics.Repeats(TURN, 3)
    with pytest.raises(ValueError, match="whole number from 2"):
        mechanics.Repeats(TURN, 1)
    with pytest.raises(ValueError, match="identity"):
        mechanics.Returns(TURN)
    with pytest.raises(ValueError, match="period must be"):
        oscillator.periodic("T")
    with pytest.raises(ValueError, match="period must be a positive number"):
        oscillator.periodic(-1.0)
    with pytest.raises(ValueError, match="no closed orbit is next to"):
        pendulum.orbit([1.0], [3.0], 2.0)
