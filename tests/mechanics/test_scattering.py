"""Scattering: angles against quadrature in many digits, cross-sections, rainbows, glories, orbiting, refusals."""

import casadi as ca
import mpmath as mp
import numpy as np
import pytest

from varcalc import mechanics
from varcalc.mechanics import ScatteringOutcome


def lennard_jones(r):
    return 4 * (r**-12 - r**-6)


def exact_angle(potential, energy, impact, near):
    """The deflection angle in 30 digits, with its closest approach next to ``near``."""
    b = mp.mpf(impact)
    closest = mp.findroot(lambda r: 1 - potential(r) / energy - (b / r) ** 2, near)

    def share(x):  # r = closest/(1 - x²)
        r = closest / (1 - x**2)
        left = 1 - potential(r) / energy - (b / r) ** 2
        return 2 * x * b / (closest * mp.sqrt(left))

    return mp.pi - 2 * mp.quad(share, [0, 0.4, 0.75, 1], method="gauss-legendre", maxdegree=6)


@pytest.mark.parametrize(("energy", "impact"), [(0.9, 0.2), (0.9, 1.8), (5.0, 0.9), (5.0, 4.0)])
def test_lennard_jones_angles(energy, impact):
    found = mechanics.Scattering(lennard_jones, energy).deflection(impact)
    with mp.workdps(25):
        exact = exact_angle(lennard_jones, energy, impact, float(found.closest))
    assert abs(found.angle - exact) <= 1e-13 * max(1, abs(exact))


def test_the_derivative_by_the_impact_parameter():
    found, step = mechanics.Scattering(lennard_jones, 0.9).deflection(1.1), mp.mpf("1e-9")
    with mp.workdps(30):
        above, below = (exact_angle(lennard_jones, 0.9, 1.1 + way * step, float(found.closest)) for way in (1, -1))
    assert found.slope == pytest.approx(float((above - below) / (2 * step)), rel=1e-12)


@pytest.mark.parametrize("beside", [-1e-12, -1e-9, 1e-9, 1e-12])
def test_next_to_an_orbit_that_goes_round_no_digits_are_lost(beside):
    """Quadrature in many digits, cut at the circle that it all but stays on."""
    energy = mp.mpf("0.5")
    with mp.workdps(40):
        circle = mp.findroot(lambda r: mp.diff(lambda u: u**2 * (1 - lennard_jones(u) / energy), r), 1.53)
        round_for_ever = circle * mp.sqrt(1 - lennard_jones(circle) / energy)
        impact = float(round_for_ever * (1 + mp.mpf(beside)))
        b, near = mp.mpf(impact), circle * (1 + 3 * mp.sqrt(abs(beside))) if beside > 0 else mp.mpf("1.1103")
        closest = mp.findroot(lambda r: r**2 * (1 - lennard_jones(r) / energy) - b**2, near)

        def left(r):
            return 1 - lennard_jones(r) / energy - (b / r) ** 2

        steep = mp.diff(left, closest)

        def share(x):  # r = closest/(1 - x^2)
            squared = left(closest / (1 - x**2)) / x**2 if x > 1e-12 else closest * steep
            return 2 * b / (closest * mp.sqrt(squared))

        at = mp.sqrt(1 - closest / circle) if circle > closest else mp.mpf(0)
        cuts = sorted({mp.mpf(0), at, mp.mpf("0.75"), mp.mpf(1)})
        exact = mp.pi - 2 * mp.quad(share, cuts, maxdegree=12)
    found = mechanics.Scattering(lennard_jones, 0.5).deflection(impact)
    # where it goes round for ever is known to round-off, and by that the angle next to it
    room = 4 * np.finfo(float).eps / abs(beside) + 1e-6
    assert abs(found.angle - float(exact)) <= room


def test_the_cross_section_at_an_angle_does_not_depend_on_what_else_is_asked():
    scattering = mechanics.Scattering(lennard_jones, 0.5)
    several = scattering.cross_section(np.linspace(0.1, 3.0, 9))
    assert several[0] == pytest.approx(float(scattering.cross_section(0.1)), rel=1e-14)


def test_the_rainbow_of_lennard_jones_is_that_of_an_independent_root():
    energy = 2.0
    (rainbow,) = mechanics.Scattering(lennard_jones, energy).rainbows
    with mp.workdps(25):
        nearby = float(mechanics.Scattering(lennard_jones, energy).deflection(rainbow.impact).closest)

        def angle(b):
            return exact_angle(lennard_jones, energy, b, nearby)

        root = mp.findroot(
            lambda b: (angle(b + mp.mpf("1e-6")) - angle(b - mp.mpf("1e-6"))) / 2e-6, (1.4, 1.5), tol=1e-18
        )
        exact = angle(root)
    assert abs(rainbow.angle - exact) <= 1e-12
    assert rainbow.impact == pytest.approx(float(root), abs=1e-7)  # the differences are of second order in 1e-6


def test_the_glory_of_lennard_jones_and_none_head_on():
    scattering = mechanics.Scattering(lennard_jones, 2.0)
    (glory,) = scattering.glories
    assert not glory.backward
    assert abs(scattering.deflection(glory.impact).angle) < 1e-14


def test_next_to_an_orbit_that_goes_round_the_angle_goes_by_the_logarithm_that_is_named():
    scattering = mechanics.Scattering(lennard_jones, 0.5)
    (orbiting,) = scattering.orbiting
    beside = np.array([1e-7, 1e-9])
    outside = scattering.deflection(orbiting.impact * (1 + beside)).angle
    inside = scattering.deflection(orbiting.impact * (1 - beside)).angle
    assert np.diff(outside)[0] == pytest.approx(orbiting.logarithm * np.log(1e-2), rel=1e-5)
    assert np.diff(inside)[0] == pytest.approx(2 * orbiting.logarithm * np.log(1e-2), rel=1e-5)
    there = scattering.deflection(orbiting.impact)
    assert there.outcomes is ScatteringOutcome.ORBITING
    assert np.isnan(there.angle)


def test_attraction_by_the_inverse_fourth_power_captures_and_says_so():
    scattering = mechanics.Scattering(lambda r: -(r**-4), 1.0)
    found = scattering.deflection([1.0, 2.0])
    assert list(found.outcomes) == [ScatteringOutcome.CAPTURED, ScatteringOutcome.DEFLECTED]
    assert found.closest[0] == 0


def test_the_cross_section_sums_over_all_branches():
    # a well that refracts and a repelling shell outside: all impact parameters of an angle, found by brute force
    scattering = mechanics.Scattering(lambda r: 3 * np.exp(-(r**2)) - 1.5 * np.exp(-(r**2) / 4), 1.0)
    b = np.linspace(1e-3, 12, 6001)
    found = scattering.deflection(b)
    assert len(scattering.rainbows) >= 1
    for angle in (0.05, 0.3, 1.0):
        total = 0.0
        for sign in (1, -1):
            off = found.angle - sign * angle
            change = np.flatnonzero(np.sign(off[1:]) != np.sign(off[:-1]))
            total += float(np.sum(b[change] / np.abs(found.slope[change])))
        assert scattering.cross_section(angle) == pytest.approx(total / np.sin(angle), rel=5e-3)


def test_a_thin_shell_is_seen():
    thin = mechanics.Scattering(lambda r: 2 * np.exp(-(((r - 3) / 1e-4) ** 2)), 1.0)
    found = thin.deflection(np.array([0.5, 2.9]))
    # it throws back like a hard sphere of its height: where U = E (1 - b²/r²), within 1e-3 of r = 3
    np.testing.assert_allclose(found.angle, 2 * np.arccos(np.array([0.5, 2.9]) / 3), atol=2e-3)


def test_head_on_and_far_away():
    scattering = mechanics.Scattering(lennard_jones, 2.0)
    found = scattering.deflection([0.0, 1e60])
    assert found.angle[0] == pytest.approx(np.pi, abs=4e-15)
    assert found.angle[1] == 0
    well = mechanics.Scattering(lambda r: -np.exp(-(r**2)), 1.0).deflection(0.0)
    assert well.angle == 0


def test_a_jump_between_two_forces_refracts():
    inner, outer, energy, impact = (lambda r: -2 + 0.3 * r), (lambda r: np.exp(-r) / r), 1.5, 0.8
    found = mechanics.Scattering(lambda r: ca.if_else(r < 1, inner(r), outer(r)), energy).deflection(impact)
    with mp.workdps(25):
        b = mp.mpf(impact)

        def left(r, value):
            return 1 - value / energy - (b / r) ** 2

        outside = mp.quad(lambda s: b / mp.sqrt(left(1 / s, mp.exp(-1 / s) * s)), [0, 0.5, 1])
        closest = mp.findroot(lambda r: left(r, inner(r)), 0.5)

        def inside(x):  # r = closest/(1 - x²)
            r = closest / (1 - x**2)
            return 2 * x * b / (closest * mp.sqrt(left(r, inner(r))))

        last = mp.sqrt(1 - closest)
        whole = outside + mp.quad(inside, [0, last / 2, last], method="gauss-legendre")
        assert abs(found.angle - (mp.pi - 2 * whole)) < 1e-14


def test_where_the_potential_is_no_number_nothing_is_claimed():
    found = mechanics.Scattering(lambda r: np.sqrt(r - 1) * np.exp(-r), 1.0).deflection([0.1, 2.0])
    assert list(found.outcomes) == [ScatteringOutcome.UNDEFINED, ScatteringOutcome.DEFLECTED]


def test_what_is_no_potential_is_refused():
    with pytest.raises(ValueError, match="vanish far away"):
        mechanics.Scattering(lambda r: r**2, 1.0)
    with pytest.raises(ValueError, match="energy must be a positive number"):
        mechanics.Scattering(lambda r: 1 / r, 0.0)
    with pytest.raises(ValueError, match="hard_core"):
        mechanics.Scattering(lambda r: 1 / r, 1.0, hard_core=-1.0)
    with pytest.raises(ValueError, match="impact"):
        mechanics.Scattering(lambda r: 1 / r, 1.0).deflection(-1.0)
    with pytest.raises(ValueError, match="angle must lie"):
        mechanics.Scattering(lambda r: 1 / r, 1.0).cross_section(4.0)
    with pytest.raises(ValueError, match="not resolved"):
        mechanics.firsov(lambda b: np.where(b < 1, 1.0, 0.0), 1.0, 0.5)
    with pytest.raises(ValueError, match="target"):
        mechanics.Collision(1.0, 0.0)
