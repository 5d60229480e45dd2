"""Rays in layered media as graphs: two, one or none, and where they touch their envelope."""

import casadi as ca
import mpmath as mp
import pytest

import varcalc as vc

# n^2 = 1 - 2 y: a projectile of unit speed


def throw(reach):
    return vc.Problem(
        lambda x, y, v: ca.sqrt(1 - 2 * y) * ca.sqrt(1 + v**2), vc.Fixed(0.0, 0.0), vc.Fixed(float(reach), 0.0)
    )


def optical_length(degrees, reach):
    """Along y = x t - x^2 (1 + t^2)/2, t = tan(angle), n ds = (1 - 2 y) sqrt(1 + t^2) dx."""
    t = mp.tan(mp.radians(degrees))
    return float(mp.quad(lambda x: (1 - 2 * x * t + x**2 * (1 + t**2)) * mp.sqrt(1 + t**2), [0, reach]))


@pytest.fixture(scope="module")
def low_and_high():
    return vc.extremals(throw(0.5))


def test_the_low_and_the_high_ray(low_and_high):
    # sin(2 angle) = reach
    angles = [mp.degrees(mp.asin(mp.mpf(1) / 2)) / 2, 90 - mp.degrees(mp.asin(mp.mpf(1) / 2)) / 2]
    assert [s.dy(0.0) for s in low_and_high] == pytest.approx([float(mp.tan(mp.radians(d))) for d in angles], abs=1e-9)
    assert [s.value for s in low_and_high] == pytest.approx([optical_length(d, 0.5) for d in angles], abs=1e-13)
    assert [s.index for s in low_and_high] == [0, 1]
    assert [vc.verify(s).verdict for s in low_and_high] == [vc.Verdict.MINIMUM, vc.Verdict.SADDLE]


def test_the_high_ray_touches_the_parabola_of_safety(low_and_high):
    # where the derivative of the height by t vanishes: x = 1/t
    assert low_and_high[1].conjugate_points == pytest.approx([float(mp.cot(mp.radians(75)))], abs=1e-10)


def test_at_full_reach_one_ray_ends_on_the_caustic():
    [one] = vc.extremals(throw(1.0))
    assert one.verdict is vc.Verdict.DEGENERATE
    assert one.value == pytest.approx(optical_length(45, 1), abs=1e-12)
    assert one.value == pytest.approx(float(2 * mp.sqrt(2) / 3), abs=1e-12)


@pytest.mark.parametrize("reach", [1 + 1e-6, 1.5])
def test_shadow_beyond(reach):
    assert len(vc.extremals(throw(reach))) == 0
    for method in (vc.Ritz(), vc.Collocation(), vc.FirstIntegral()):
        assert not vc.solve(throw(reach), method, throw=False).status.ok, method


# c = 1 + z: circles


@pytest.mark.parametrize("method", [None, vc.Collocation(), vc.Shooting(), vc.FirstIntegral()], ids=repr)
def test_a_ray_where_the_speed_grows_with_height(method):
    ray = vc.Problem(lambda x, z, v: ca.sqrt(1 + v**2) / (1 + z), vc.Fixed(0, 0), vc.Fixed(1, 0))
    time = mp.acosh(1 + mp.mpf(1) / 2)
    solution = vc.solve(ray, method)
    assert abs(solution.value - float(time)) <= 10 * solution.error.value <= 1e-8
    # a circle about (1/2, -1) through both ends
    assert solution.y(0.5) == pytest.approx(float(mp.sqrt(1 + mp.mpf(1) / 4) - 1), abs=1e-5)
    assert vc.verify(solution).verdict is vc.Verdict.MINIMUM


def test_it_is_the_only_one():
    found = vc.extremals(vc.Problem(lambda x, z, v: ca.sqrt(1 + v**2) / (1 + z), vc.Fixed(0, 0), vc.Fixed(1, 0)))
    assert [s.index for s in found] == [0]


def test_the_last_ray_of_a_sound_channel_grazes_the_surface():
    # circles about the depth at which c = 0: radius c(0)/|c'|
    surface, gradient, depth = 1500, mp.mpf("0.016"), 100
    radius = surface / gradient
    reach = 2 * mp.sqrt(radius**2 - (radius - depth) ** 2)
    ray = vc.Problem(
        lambda x, z, v: ca.sqrt(1 + v**2) / (1500 - 0.016 * z), vc.Fixed(0, 100), vc.Fixed(float(reach), 100)
    )
    solution = vc.solve(ray)
    assert solution.y(float(reach / 2)) == pytest.approx(0.0, abs=1e-5)
    time = mp.acosh(1 + reach**2 / (2 * (radius - depth) ** 2)) / gradient
    assert solution.value == pytest.approx(float(time), rel=1e-12)
