"""The heavy symmetric top: nutation against the cubic's roots and its motion; upright starts; regular precession."""

import math

import mpmath as mp
import numpy as np
import pytest

from varcalc.mechanics import EulerAngles, Inertia, NutationCase, Top

UPRIGHT = EulerAngles(0.0, 0.0, 0.0)
EPS = np.finfo(float).eps


def roots(top, start, rates):
    """Of (1 - u²)(e - A u) - (α - β u)² in fifty digits, ascending, from Euler angles and their rates."""
    with mp.workdps(50):
        theta, (phi_rate, theta_rate, psi_rate) = mp.mpf(start.theta), map(mp.mpf, rates)
        inertia, axial, pull = mp.mpf(top.I1), mp.mpf(top.I3), 2 * mp.mpf(top.Mgh) / mp.mpf(top.I1)
        u = mp.cos(theta)
        beta = axial / inertia * (psi_rate + phi_rate * u)
        alpha = (1 - u**2) * phi_rate + beta * u
        energy = theta_rate**2 + (1 - u**2) * phi_rate**2 + pull * u
        # Viète's trigonometric form, as all three are real
        b, c, d = (x / pull for x in (-energy - beta**2, 2 * alpha * beta - pull, energy - alpha**2))
        p, q = c - b**2 / 3, 2 * b**3 / 27 - b * c / 3 + d
        third = mp.acos(3 * q / (2 * p) * mp.sqrt(-3 / p)) / 3
        return sorted(2 * mp.sqrt(-p / 3) * mp.cos(third - 2 * mp.pi * k / 3) - b / 3 for k in range(3))


@pytest.mark.parametrize(
    ("Mgh", "theta", "rates", "case"),
    [
        (1.0, 1.0, (0.1, 0.0, 5.0), NutationCase.MONOTONE),
        (1.0, 1.0, (0.0, 0.0, 5.0), NutationCase.CUSP),
        (1.0, 1.0, (-0.1, 0.3, 5.0), NutationCase.LOOP),
        (1.0, 1.0, (0.0, 0.0, 5e4), NutationCase.CUSP),
        (1.0, 2.5, (0.3, -0.2, 0.4), NutationCase.MONOTONE),
        (1.0, 1e-3, (0.0, 0.0, 3.9), NutationCase.CUSP),
        (1.0, 3.0, (0.0, 0.0, 1e-3), NutationCase.CUSP),
        (-1.0, 1.0, (0.2, 0.3, 1.0), NutationCase.LOOP),
        (-1.0, 1.0, (0.7, 0.0, -0.7 * math.cos(1.0)), NutationCase.MONOTONE),  # a spherical pendulum
    ],
)
def test_limits_of_nutation_are_roots_of_the_cubic(Mgh, theta, rates, case):
    top, start = Top(1.0, 0.5, Mgh), EulerAngles(0.3, theta, -0.7)
    found = top.nutation(start, start.angular_velocity(rates))
    exact = roots(top, start, rates)
    low, high = exact[:2] if Mgh > 0 else exact[1:]
    assert found.case is case
    np.testing.assert_allclose(found.u, [float(low), float(high)], rtol=0, atol=2 * EPS)
    with mp.workdps(50):
        angles = [float(mp.acos(u)) for u in (high, low)]
    np.testing.assert_allclose(found.theta, angles, rtol=4e-15)


def test_the_width_of_a_fast_tops_nutation_keeps_its_digits():
    # the limits differ by 1e-9; their difference is known to more digits than either
    top, start = Top(1.0, 0.5, 1.0), EulerAngles(0.0, 1.0, 0.0)
    rates = (0.0, 0.0, 5e4)
    found = top.nutation(start, start.angular_velocity(rates))
    low, high, _ = roots(top, start, rates)
    assert found.theta[1] - found.theta[0] == pytest.approx(float(mp.acos(low) - mp.acos(high)), abs=2 * EPS)
    # to first order in 1/ω3 (Goldstein, eq. 5.74 and 5.77): the period is that of ω3 I3/I1, the mean rate M g h/(I3 ω3)
    assert found.period == pytest.approx(2 * math.pi / (0.5 * 5e4), rel=1e-8)
    assert found.precession / found.period == pytest.approx(1.0 / (0.5 * 5e4), rel=1e-8)


@pytest.mark.parametrize("theta", [1e-8, 1e-4, 0.18, math.pi - 0.18, math.pi - 1e-4, math.pi - 1e-8])
def test_an_axis_that_all_but_passes_through_the_vertical(theta):
    # let go beside it: by Legendre's third integrals, with the distances from the poles in fifty digits
    for Mgh in (1.0, -1.0):
        top, rates = Top(1.0, 0.5, Mgh), (0.0, 0.0 if (theta < 1) == (Mgh > 0) else 0.7, 1.3)
        start = EulerAngles(0.0, theta, 0.0)
        found = top.nutation(start, start.angular_velocity(rates))
        with mp.workdps(50):
            first, second, third = roots(top, start, rates)
            low, high, far = (first, second, third) if Mgh > 0 else (third, second, first)
            pull, u = 2 * mp.mpf(Mgh), mp.cos(mp.mpf(theta))
            beta = mp.mpf(0.5) * mp.mpf(1.3)
            alpha = beta * u
            m, n = (high - low) / (far - low), mp.sqrt(pull * (far - low)) / 2
            period = 2 * mp.ellipk(m) / n
            up, down = (alpha - beta) / (1 - low), (alpha + beta) / (1 + low)
            turned = up * mp.ellippi((high - low) / (1 - low), m) + down * mp.ellippi(-(high - low) / (1 + low), m)
            ends = sorted([float(mp.acos(low)), float(mp.acos(high))])
        assert found.period == pytest.approx(float(period), rel=1e-12)
        assert found.precession == pytest.approx(float(turned / n), rel=1e-12)
        np.testing.assert_allclose(found.theta, ends, rtol=1e-12)


@pytest.mark.parametrize("rates", [(0.1, 0.0, 5.0), (0.0, 0.0, 5.0), (-0.1, 0.3, 5.0), (2.0, 0.0, 1.0)])
def test_the_motion_goes_as_its_nutation_says(rates):
    top, start = Top(1.0, 0.5, 1.0), EulerAngles(0.3, 1.0, -0.7)
    omega = start.angular_velocity(rates)
    found = top.nutation(start, omega)
    motion = top.motion(start, omega, (0, 10 * found.period))
    t = np.linspace(0, 10 * found.period, 2001)
    angles = motion.euler_angles(t)
    assert np.unwrap(angles.phi)[-1] - 0.3 == pytest.approx(10 * found.precession, abs=1e-12)
    assert np.unwrap(angles.psi)[-1] + 0.7 == pytest.approx(10 * found.spin, abs=2e-12)
    assert angles.theta[-1] == pytest.approx(1.0, abs=1e-12)
    assert angles.theta.min() >= found.theta[0] - 1e-12
    assert angles.theta.max() <= found.theta[1] + 1e-12
    np.testing.assert_allclose(motion.energy(t), found.energy, rtol=1e-13)
    momentum = motion.momentum(t)
    assert set(motion.drift) == {"energy", "L_z", "L_3"}
    np.testing.assert_array_equal(momentum[2], momentum[2, 0])
    assert momentum[2, 0] == pytest.approx(found.p_phi, abs=1e-14)
    assert motion.drift["L_3"] <= 1e-13


def test_in_quaternions_and_in_euler_angles_it_is_one_motion():
    top, start, rates = Top(1.0, 0.5, 1.0), EulerAngles(0.3, 1.0, -0.7), (0.4, 0.2, 3.0)
    motion = top.motion(start, start.angular_velocity(rates), (0, 20))
    charted = top.system.motion([0.3, 1.0, -0.7], rates, (0, 20))
    t = np.linspace(0, 20, 301)
    angles = motion.euler_angles(t)
    found = [np.unwrap(angles.phi), angles.theta, np.unwrap(angles.psi)]
    np.testing.assert_allclose(found, charted.q(t), atol=2e-12)
    np.testing.assert_allclose(angles.rates(motion.angular_velocity(t)), charted.v(t), atol=4e-12)


def test_upright_starts_and_the_threshold_of_sleep():
    top = Top(1.0, 0.5, 1.0)
    assert top.critical_spin == 4.0
    assert [top.sleeps(spin) for spin in (3.9, 4.0, -4.1)] == [False, True, True]
    for spin, stable in ((3.999, False), (4.0, True), (4.001, True)):
        found = top.nutation(UPRIGHT, [0, 0, spin])
        assert found.case is NutationCase.SLEEPING
        assert found.stable is stable
    # θ swings about upright with the frequency √(β²/4 - A/2), cos θ with twice that
    swing = math.sqrt((0.5 * 5.0) ** 2 / 4 - 1.0)
    assert top.nutation(UPRIGHT, [0, 0, 5.0]).period == pytest.approx(math.pi / swing, rel=1e-14)
    assert top.nutation(UPRIGHT, [1e-6, 0, 5.0]).period == pytest.approx(math.pi / swing, rel=1e-10)
    hanging = EulerAngles(0.0, math.pi, 0.0)
    assert Top(1.0, 0.5, 1.0).nutation((0, 1, 0, 0), [0, 0, 0.1]).stable
    assert not Top(1.0, 0.5, -1.0).nutation((0, 1, 0, 0), [0, 0, 0.1]).stable
    assert Top(1.0, 0.5, 1.0).nutation(hanging, [0, 0, 0.1]).theta[0] == pytest.approx(math.pi, abs=1e-15)


def test_what_comes_to_the_vertical_and_takes_for_ever():
    # p_φ = p_ψ with just the energy of the sleeping top that is too slow: 2 E' = 2 M g h
    top = Top(1.0, 0.5, 1.0)
    beta, pull = 0.5, 2.0
    far = beta**2 / pull - 1
    start = EulerAngles(0.0, math.acos(far), 0.0)
    rate = beta * (1 - math.cos(start.theta)) / math.sin(start.theta) ** 2
    found = top.nutation(start, [0.0, rate * math.sin(start.theta), 1.0])
    assert found.case is NutationCase.ASYMPTOTIC
    assert found.period == math.inf
    assert found.u[0] == pytest.approx(far, abs=4 * EPS)
    assert found.u[1] == pytest.approx(1.0, abs=1e-7)


def test_swings_in_a_plane_and_through_the_vertical():
    top = Top(1.0, 0.5, -1.0)
    plane = top.nutation(EulerAngles(0.0, 1.2, 0.0), [0.0, 0.0, 0.0])
    assert plane.case is NutationCase.PLANE
    assert plane.theta == pytest.approx((0.0, 1.2), abs=1e-15)
    assert plane.precession == 0
    # from the lowest point to the turn and back: half the period of a pendulum
    assert plane.period == pytest.approx(float(2 * mp.ellipk(mp.sin(0.6) ** 2)), rel=1e-13)
    through = top.nutation(UPRIGHT, [0.3, 0.0, 2.0])
    assert through.theta[0] == 0.0
    assert through.case is NutationCase.MONOTONE


@pytest.mark.parametrize("seed", range(3))
def test_limits_and_periods_whatever_the_units_and_the_start(seed):
    rng = np.random.default_rng(seed)
    for _ in range(12):
        inertia, scale = 10 ** rng.uniform(-3, 3), 10 ** rng.uniform(-1.5, 1.5)
        top = Top(inertia, inertia * rng.uniform(0.01, 2), inertia * scale**2 * rng.choice([-1.0, 1.0]))
        theta = rng.choice([rng.uniform(0, math.pi), 10 ** rng.uniform(-9, 0), math.pi - 10 ** rng.uniform(-9, 0)])
        rates = scale * rng.choice([0.0, 1.0, -1.0], 3) * 10 ** rng.uniform(-4, 2, 3)
        start = EulerAngles(rng.uniform(-3, 3), theta, rng.uniform(-3, 3))
        found = top.nutation(start, start.angular_velocity(rates))
        first, second, third = roots(top, start, rates.tolist())
        low, high, far = (first, second, third) if top.Mgh > 0 else (third, second, first)
        with mp.workdps(50):
            m, n = (high - low) / (far - low), mp.sqrt(2 * mp.mpf(top.Mgh) / mp.mpf(top.I1) * (far - low)) / 2
            period = float(2 * mp.ellipk(m) / n)
        np.testing.assert_allclose(found.u, sorted([float(low), float(high)]), rtol=0, atol=1e-14)
        assert found.period == pytest.approx(period, rel=1e-13 + 4 * EPS / float(1 - m))


def test_a_free_top_goes_round_its_momentum():
    top, start = Top(1.0, 0.5, 0.0), EulerAngles(0.0, 1.0, 0.4)
    omega = start.angular_velocity([0.2, 0.3, 1.0])
    found = top.nutation(start, omega)
    momentum = start.rotation @ ([1, 1, 0.5] * omega)
    size = np.linalg.norm(momentum)
    tilt, own = math.acos(momentum[2] / size), math.acos(0.5 * omega[2] / size)
    assert found.theta == pytest.approx((abs(tilt - own), tilt + own), rel=1e-13)
    assert found.period == pytest.approx(2 * math.pi / size, rel=1e-13)
    assert found.precession == pytest.approx(0.0, abs=1e-13)  # the vertical lies outside the cone


@pytest.mark.parametrize(("theta", "count"), [(0.6, 2), (2.0, 2), (math.pi / 2, 1)])
def test_regular_precession(theta, count):
    top, spin = Top(1.0, 0.5, 1.0), 5.0
    found = top.steady_precessions(theta, spin)
    assert len(found) == count
    for rate in found:
        assert math.cos(theta) * rate**2 - 0.5 * spin * rate + 1.0 == pytest.approx(0, abs=1e-14 * max(1, rate**2))
        start = EulerAngles(1.9, theta, 0.7)
        omega = start.angular_velocity([rate, 0.0, spin - rate * math.cos(theta)])
        nutation = top.nutation(start, omega)
        assert nutation.case is NutationCase.STEADY
        assert nutation.stable
        assert nutation.precession == pytest.approx(rate * nutation.period, rel=1e-14)
        tipped = EulerAngles(0.0, theta + 1e-5, 0.0)
        other = top.nutation(tipped, tipped.angular_velocity([rate, 0.0, spin - rate * math.cos(theta)]))
        assert other.period == pytest.approx(nutation.period, rel=1e-3)
    assert top.steady_precessions(0.6, 3.0) == ()
    slow = top.steady_precessions(0.6, 1e9)[0]
    assert slow == pytest.approx(1 / (0.5 * 1e9), rel=1e-15)
    assert Top(1.0, 0.5, 0.0).steady_precessions(0.6, 3.0)[0] == 0.0


def test_a_top_of_a_body_and_what_is_none():
    cone = Inertia.cone(2.0, 0.3, 0.7)
    top = Top.of(cone, (0, 0, 0), gravity=9.81)
    moments = [top.I1, top.I3]
    assert moments == pytest.approx([3 / 5 * 2 * (0.49 + 0.09 / 4), 3 / 10 * 2 * 0.09], rel=1e-14)
    assert top.Mgh == pytest.approx(2 * 9.81 * 0.525, rel=1e-15)
    for make, said in (
        (lambda: Top.of(Inertia.box(1, 1, 2, 3), (0, 0, -1)), "symmetric about z"),
        (lambda: Top.of(cone, (0.1, 0, 0)), "pivot on that axis"),
        (lambda: Top(1.0, 2.5, 1.0), "of no body"),
        (lambda: Top(1.0, 0.0, 1.0), "of no body"),
        (lambda: Top(1.0, 0.5, math.inf), "Mgh must be finite"),
        (lambda: Top(1.0, 0.5, 1.0).nutation(UPRIGHT, [0, 1]), "three finite numbers"),
    ):
        with pytest.raises(ValueError, match=said):
            make()
