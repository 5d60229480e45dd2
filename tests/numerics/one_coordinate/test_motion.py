"""Motion in one coordinate against elliptic and elementary functions."""

import mpmath as mp
import numpy as np
import pytest

from varcalc.numerics.one_coordinate.motions import (
    CoordinateMotion,
    MotionPoint,
    NoTurn,
    OneTurn,
    TwoTurns,
    bounds,
    ways,
)
from varcalc.numerics.one_coordinate.potential import Potential, PotentialNodes
from varcalc.numerics.one_coordinate.quadrature import BY_C, TAU, half_periods, integrals, reached


class Pendulum(Potential):
    """u'' = -sin u: (du/dτ)² = 2 cos u - C, C being -2 times the energy; the action is integrated as well."""

    def at(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return 2 * np.cos(u), -2 * np.sin(u)

    def changes(self, base: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        half = 4 * np.sin(x / 2)
        return -half * np.sin(base + x / 2), -half * np.cos(base + x / 2)

    def weighted(self, point: MotionPoint) -> tuple[np.ndarray, ...]:
        return (point.w**2,)


class Kepler(Potential):
    """The radius in the potential -1/r with angular momentum 1: (dr/dτ)² = 2/r - 1/r² - C; the angle as well."""

    def at(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        with np.errstate(all="ignore"):
            return np.where(u > 0, (2 - 1 / u) / u, np.nan), (2 / u - 2) / u**2

    def changes(self, base: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        inverse = -x / (base * (base + x))  # of 1/r
        a, b = 1 / (base + x), 1 / base
        slope = inverse * (2 * (a**2 + a * b + b**2) - 2 * (a + b))
        return inverse * (2 - a - b), slope

    def weighted(self, point: MotionPoint) -> tuple[np.ndarray, ...]:
        return (1 / point.u**2,)


def motion(potential: Potential, u0: np.ndarray, w0: np.ndarray, nodes: PotentialNodes) -> list[CoordinateMotion]:
    """The motions from u0 with speeds w0, sorted by kind."""
    C = potential.at(u0)[0] - w0**2
    free = np.full(len(u0), np.inf)
    below, above = (bounds(potential, nodes, u0, w0**2, C, free, sign) for sign in (-1, 1))
    return [way for _, way, _ in ways(potential, u0, w0, below, above)]


PENDULUM = Pendulum()
NODES = PENDULUM.nodes(-0.1, 0.1, -10.0, 10.0)


def test_the_period_of_a_pendulum_at_many_energies_at_once() -> None:
    speed = np.array([1e-9, 1e-3, 0.5, 1.0, 1.9, 1.999999])
    [way] = motion(PENDULUM, np.zeros(6), speed, NODES)
    assert isinstance(way, TwoTurns)
    half = half_periods(way)
    np.testing.assert_allclose(
        half[:, TAU], [float(2 * mp.ellipk((v / 2) ** 2)) for v in map(mp.mpf, speed)], rtol=1e-9
    )
    np.testing.assert_allclose(
        half[:5, TAU], [float(2 * mp.ellipk((v / 2) ** 2)) for v in map(mp.mpf, speed[:5])], rtol=2e-14
    )
    with mp.workdps(30):
        m = [(mp.mpf(v) / 2) ** 2 for v in speed]
        action = [float(8 * (mp.ellipe(k) - (1 - k) * mp.ellipk(k))) for k in m]
    np.testing.assert_allclose(half[1:5, 1], action[1:5], rtol=1e-13)


def test_the_derivative_by_the_constant_is_that_of_the_period() -> None:
    [way] = motion(PENDULUM, np.zeros(1), np.array([1.0]), NODES)
    exact = float(mp.diff(lambda C: 2 * mp.ellipk((2 - C) / 4), 1))
    assert half_periods(way)[0, BY_C] == pytest.approx(exact, rel=1e-12)


def test_where_a_pendulum_is_after_a_time() -> None:
    speed, times = np.array([0.5, 1.5]), np.array([0.3, 50.0])
    [way] = motion(PENDULUM, np.zeros(2), speed, NODES)
    there = reached(way, np.full(2, np.inf), np.column_stack([times, np.full(2, np.inf)]))
    u = way.at(there.q[:, None]).u[:, 0]
    exact = [2 * mp.asin(v / 2 * mp.ellipfun("sn", t, m=v**2 / 4)) for v, t in zip(speed, times, strict=True)]
    np.testing.assert_allclose(u, [float(e) for e in exact], rtol=1e-12)


def test_a_pendulum_that_goes_over_the_top() -> None:
    [way] = motion(PENDULUM, np.zeros(1), np.array([2.5]), NODES)
    assert isinstance(way, NoTurn)
    time = integrals(way, way.start, np.array([np.pi]))[0, TAU]
    assert time == pytest.approx(float(2 / 2.5 * mp.ellipk((2 / mp.mpf("2.5")) ** 2)), rel=1e-14)


def test_the_separatrix_of_a_pendulum() -> None:
    nodes = PENDULUM.nodes(-4.0, 4.0, -10.0, 10.0)
    np.testing.assert_allclose(nodes.separatrices, -2.0, rtol=1e-15)


@pytest.mark.parametrize("energy", [-0.4999, -0.3, 0.2, 3.0])
def test_kepler_ellipses_and_hyperbolas(energy: float) -> None:
    """The angle from the pericentre to the apocentre is π, that to infinity arccos(-1/e)."""
    kepler, e = Kepler(), np.sqrt(1 + 2 * energy)
    nodes = kepler.nodes(0.5, 1.5, 1e-3, 1e9)
    pericentre = 1 / (1 + e)
    start = np.array([1.0])
    [way] = motion(kepler, start, np.sqrt(1 + 2 * energy) * np.ones(1), nodes)
    if energy < 0:
        assert isinstance(way, TwoTurns)
        half = half_periods(way)[0]
        assert half[1] == pytest.approx(np.pi, rel=1e-12)
        assert half[TAU] == pytest.approx(np.pi * (-2 * energy) ** -1.5, rel=1e-11)
        assert way.low[0] == pytest.approx(pericentre, rel=1e-13)
    else:
        assert isinstance(way, OneTurn)
        assert way.turn[0] == pytest.approx(pericentre, rel=1e-13)
        far = way.reaching(np.array([1e6]) - 1)
        angle = integrals(way, np.zeros(1), far)[0, 1]
        at = np.arccos((1 / 1e6 - 1) / e)
        assert angle == pytest.approx(at, rel=1e-11)


def test_intervals_alike_share_their_places_and_each_has_as_many_as_it_needs():
    class Plain(Potential):
        def at(self, u):
            return 1 + u**2, 2 * u

        def changes(self, base, x):
            return x * (2 * base + x), 2 * x

    rng = np.random.default_rng(5)
    first = rng.uniform(-1, 1, 300)
    last = first + 10 ** rng.uniform(-6, 0, 300)
    free = np.full(300, np.inf)
    nodes, alone = Plain().nodes(first, last, -free, free), Plain().nodes(first[:1], last[:1], -free[:1], free[:1])
    assert len(nodes.u) < 200 * len(alone.u)
    assert np.all(np.isin(np.append(first, last), nodes.u))
    for low, high in zip(first, last, strict=True):
        own = nodes.u[(nodes.u >= low) & (nodes.u <= high)]
        assert np.diff(own).max() <= (high - low) / 200
