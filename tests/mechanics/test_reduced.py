"""Motion in one coordinate by quadrature: wells, barriers, separatrices, circles, falls, escapes, inverse problems."""

import math

import casadi as ca
import mpmath as mp
import numpy as np
import pytest
from scipy.special import ellipk, gamma

from varcalc import mechanics
from varcalc.mechanics import End
from varcalc.symbolic.poles import poles

PENDULUM = mechanics.System(lambda t, q, v: v[0] ** 2 / 2 + ca.cos(q[0]), ("theta",)).reduced()
DOUBLE_WELL = mechanics.System(lambda t, q, v: v[0] ** 2 / 2 + q[0] ** 2 / 2 - q[0] ** 4 / 4, ("x",)).reduced()


def central(potential):
    """The plane motion of a unit mass."""
    return mechanics.System(lambda t, q, v: (v[0] ** 2 + (q[0] * v[1]) ** 2) / 2 - potential(q[0]), ("r", "phi"))


@pytest.mark.parametrize("energy", [-1 + 1e-6, -0.3, 0.99, 1.01, 7.0])
def test_a_pendulum_to_and_fro_and_over_the_top(energy):
    (orbit,) = PENDULUM.orbits(energy)
    m = (energy + 1) / 2
    exact = 4 * ellipk(m) if m < 1 else 2 / math.sqrt(m) * ellipk(1 / m)
    assert orbit.period == pytest.approx(exact, rel=1e-9 if energy < -0.99 else 1e-13)  # of m no more is known there
    assert orbit.ends == ((End.TURNING, End.TURNING) if m < 1 else (End.ROUND, End.ROUND))


@pytest.mark.parametrize("beside", [-1e-5, -1e-8, -1e-11, 1e-7, 1e-8, 1e-9, 1e-11])
def test_a_pendulum_next_to_its_separatrix(beside):
    """By as many digits as its energy tells of the distance from there."""
    energy = 1.0 + beside
    (orbit,) = PENDULUM.orbits(energy)
    with mp.workdps(30):
        m = (1 + mp.mpf(energy)) / 2
        exact = 4 * mp.ellipk(m) if m < 1 else 2 / mp.sqrt(m) * mp.ellipk(1 / m)
        assert abs(orbit.period - exact) <= 1e-13 * exact + 8 * mp.mpf(np.finfo(float).eps) / abs(beside)


def test_the_separatrix_of_a_pendulum_and_its_logarithm():
    (upright,) = PENDULUM.separatrices
    assert abs(math.cos(upright.place) + 1) < 1e-15
    (orbit,) = PENDULUM.orbits(upright.energy)
    assert orbit.ends == (End.RESTING, End.RESTING)
    assert orbit.period == math.inf
    assert orbit.rest == upright
    # the middle is where it is fastest: θ(t) = 4 arctan(exp t) - π
    angles = np.array([-2.0, 0.5, 3.0])
    np.testing.assert_allclose(orbit.time(angles), np.log(np.tan((angles + np.pi) / 4)), rtol=0, atol=1e-11)
    # it passes the top twice in each swing
    periods = [PENDULUM.orbits(upright.energy - off)[0].period for off in (1e-7, 1e-9)]
    assert np.diff(periods)[0] == pytest.approx(2 * upright.logarithm * math.log(100), rel=1e-5)


def test_two_wells_and_what_goes_over_the_barrier():
    assert [rest.place for rest in DOUBLE_WELL.rests] == pytest.approx([-1, 0, 1], abs=1e-15)
    assert [rest.stable for rest in DOUBLE_WELL.rests] == [True, False, True]
    left, right = DOUBLE_WELL.orbits(-0.1)
    assert left.period == pytest.approx(right.period, rel=1e-14)
    assert (left.high, right.low) == pytest.approx((-math.sqrt(1 - math.sqrt(0.6)), math.sqrt(1 - math.sqrt(0.6))))
    (over,) = DOUBLE_WELL.orbits(0.1)
    assert over.high == pytest.approx(math.sqrt(1 + math.sqrt(1.4)), rel=1e-15)
    asymptotic = DOUBLE_WELL.orbits(0.0)
    assert [one.ends for one in asymptotic] == [(End.TURNING, End.RESTING), (End.RESTING, End.TURNING)]
    assert DOUBLE_WELL.orbits(-0.3) == ()


def test_places_are_those_of_the_motion():
    system = central(lambda r: -1 / r + 0.1 / r**3)
    momentum, energy = 0.9, -0.35
    (orbit,) = system.reduced({"phi": momentum}).orbits(energy)
    span = (0.0, 3.3 * orbit.period)
    motion = system.motion([orbit.low, 0.0], [0.0, momentum / orbit.low**2], span)
    t = np.linspace(*span, 20)
    q, angles = orbit.place(t)
    np.testing.assert_allclose(q, motion.q(t)[0], rtol=0, atol=max(motion.error, 1e-12))
    np.testing.assert_allclose(angles["phi"], motion.q(t)[1], rtol=0, atol=max(10 * motion.error, 1e-11))
    middle = (orbit.low + orbit.high) / 2
    assert orbit.place(orbit.time(middle))[0] == pytest.approx(middle, rel=1e-13)


def test_an_orbit_that_escapes_turns_by_what_scattering_says():
    def potential(r):
        return 0.7 * ca.exp(-r) / r

    energy, impact = 0.6, 0.8
    momentum = impact * math.sqrt(2 * energy)
    (orbit,) = central(potential).reduced({"phi": momentum}).orbits(energy)
    assert orbit.ends == (End.TURNING, End.FAR)
    angle = mechanics.Scattering(potential, energy).deflection(impact).angle
    assert math.pi - orbit.angles["phi"] == pytest.approx(angle, abs=1e-13)


def test_a_fall_into_the_centre_takes_a_finite_time():
    (fall,) = central(lambda r: -1 / r).reduced({"phi": 0.0}).orbits(-0.5)
    assert fall.ends == (End.SINGULAR, End.TURNING)
    assert fall.high == pytest.approx(2, rel=1e-15)
    assert fall.duration == pytest.approx(2 * math.pi, rel=1e-12)  # there and back: the period of the flat ellipse


def test_infinity_in_finite_time():
    # from infinity to rest at 1, and back: twice ∫ dx/√(2 (x³ - 1))
    (orbit,) = mechanics.System(lambda t, q, v: v[0] ** 2 / 2 + q[0] ** 3, ("x",)).reduced().orbits(-1.0)
    exact = 2 * math.sqrt(math.pi / 2) * gamma(1 / 6) / (3 * gamma(2 / 3))
    assert orbit.ends == (End.TURNING, End.FAR)
    assert orbit.duration == pytest.approx(exact, rel=1e-12)


def test_wells_without_number_are_looked_at_as_far_as_is_said():
    reduced = mechanics.System(lambda t, q, v: v[0] ** 2 / 2 - ca.cos(1.1 * q[0]), ("x",)).reduced()
    wells = reduced.orbits(0.5)
    assert 65 < len(wells) < 75
    middle = wells[len(wells) // 2]
    assert middle.period == pytest.approx(4 * ellipk(0.75) / 1.1, rel=1e-12)
    (beyond,) = reduced.orbits(1.5)
    assert beyond.ends == (End.BEYOND, End.BEYOND)
    assert math.isnan(beyond.duration)


def test_a_spherical_pendulum_has_one_well_between_its_poles():
    system = mechanics.System(
        lambda t, q, v: (v[0] ** 2 + (ca.sin(q[0]) * v[1]) ** 2) / 2 + ca.cos(q[0]), ("theta", "phi")
    )
    reduced = system.reduced({"phi": 0.4})
    (circle,) = reduced.rests
    assert 0 < circle.place < math.pi
    # on a circle w² cos θ = 1, and small oscillations have w² (1 + 3 cos² θ)
    turning = circle.angular_rates["phi"]
    assert turning**2 * math.cos(circle.place) == pytest.approx(1, rel=1e-13)
    assert circle.rate == pytest.approx(turning * math.sqrt(1 + 3 * math.cos(circle.place) ** 2), rel=1e-13)
    (small,) = reduced.orbits(circle.energy + 1e-9)
    assert small.period == pytest.approx(2 * math.pi / circle.rate, rel=1e-6)


def test_a_charge_in_a_magnetic_field_has_an_angle_that_goes_with_its_rate():
    # gauge A = -B y: p_x = x' - B y is kept, and y oscillates about where the drift is
    system = mechanics.System(lambda t, q, v: (v[0] ** 2 + v[1] ** 2) / 2 - 1.5 * q[1] * v[0] + 0.3 * q[1], ("x", "y"))
    (orbit,) = system.reduced({"x": 0.2}).orbits(1.0)
    assert orbit.period == pytest.approx(2 * math.pi / 1.5, rel=1e-14)
    assert orbit.angles["x"] / orbit.period == pytest.approx(0.3 / 1.5, rel=1e-13)


def test_at_the_bottom_of_a_well_nothing_moves():
    reduced = central(lambda r: -1 / r).reduced({"phi": 1.0})
    (circle,) = reduced.rests
    assert circle.angular_rates["phi"] == pytest.approx(1, rel=1e-14)
    assert reduced.orbits(circle.energy) == ()
    (flat,) = mechanics.System(lambda t, q, v: v[0] ** 2 / 2 - q[0] ** 4, ("x",)).reduced().rests
    assert flat.stable
    assert flat.rate == 0


def test_averages():
    (orbit,) = DOUBLE_WELL.orbits(0.5)
    virial = orbit.average(lambda q, v: v**2 - q * (q**3 - q))
    assert abs(virial) < 1e-14
    assert abs(orbit.average(lambda q, v: v)) < 1e-15


def test_a_width_from_periods_that_are_found():
    def period(energies):
        return np.array([PENDULUM.orbits(energy - 1)[0].period for energy in energies.ravel()])

    known = mechanics.well_width(lambda energy: 4 * ellipk(energy / 2), np.array([0.5, 1.0]))
    np.testing.assert_allclose(known, 2 * np.arccos(1 - np.array([0.5, 1.0])), rtol=1e-13)
    assert period(np.array([0.5]))[0] == pytest.approx(4 * ellipk(0.25), rel=1e-14)


def test_what_cannot_be_reduced_is_refused_with_its_reason():
    kepler = central(lambda r: -1 / r)
    with pytest.raises(ValueError, match="leave one coordinate"):
        kepler.reduced()
    with pytest.raises(ValueError, match="ignorable"):
        kepler.reduced({"r": 1.0})
    with pytest.raises(ValueError, match="keep its energy"):
        mechanics.System(lambda t, q, v: v[0] ** 2 / 2 + t * q[0], ("x",)).reduced()
    with pytest.raises(ValueError, match="second degree"):
        mechanics.System(lambda t, q, v: -ca.sqrt(1 - v[0] ** 2) - q[0] ** 2, ("x",)).reduced()
    with pytest.raises(ValueError, match="jump"):
        _ = mechanics.System(lambda t, q, v: v[0] ** 2 / 2 - ca.if_else(q[0] > 0, 1.0, 0.0), ("x",)).reduced().rests
    with pytest.raises(ValueError, match="t must not be negative"):
        PENDULUM.orbits(0.0)[0].place(-1.0)
    with pytest.raises(ValueError, match="energy must be finite"):
        PENDULUM.orbits(math.nan)
    with pytest.raises(ValueError, match="positive radius"):
        mechanics.force_of_orbit(lambda theta: -1 - theta**2, 1.0)
    with pytest.raises(ValueError, match="no average"):
        central(lambda r: 1 / r).reduced({"phi": 1.0}).orbits(1.0)[0].average(lambda q, v: v)


def test_poles_are_zeros_of_factors():
    x = ca.SX.sym("x")
    found = poles([1 / (x**2 * (x - 1)) + ca.sqrt(2 - x) + x**-3], [x])
    zero = {
        round(float(ca.Function("at", [x], [one.argument])(value)), 12) for one in found for value in (0.0, 1.0, 2.0)
    }
    assert len(found) == 3
    assert 0.0 in zero
