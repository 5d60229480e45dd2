"""Periodic coefficients: multipliers with their signatures, stability charts and the boundaries on them."""

import math

import casadi as ca
import numpy as np
import pytest
from scipy.special import mathieu_a, mathieu_b

import varcalc as vc
from varcalc import mechanics


def mathieu(damping=0.0, **parameters):
    return mechanics.System(
        lambda t, q, v, p: (v[0] ** 2 - (p.a - 2 * p.q * ca.cos(2 * t)) * q[0] ** 2) / 2, ("x",),
        parameters={"a": 1.0, "q": 0.5} | parameters, forces=lambda t, q, v, p: [-2 * damping * v[0]],
    )  # fmt: skip


def meeting(coupling):
    """Two oscillators, one of which may have a negative energy, with frequencies 1 and 1.2 and a drive between them."""

    def system(sign):
        return mechanics.System(
            lambda t, q, v: (
                v[0] ** 2 - q[0] ** 2 + sign * (v[1] ** 2 - 1.44 * q[1] ** 2)
            ) / 2 - coupling * ca.cos(0.2 * t) * q[0] * q[1],
            ("x", "y"),
        )  # fmt: skip

    return [system(sign).floquet([0, 0], 2 * math.pi / 0.2) for sign in (1, -1)]


def test_multipliers_of_an_oscillator_are_known_and_have_the_sign_of_its_energy():
    w, d, period = 1.3, 0.2, 0.9
    still = mechanics.System(lambda t, q, v: (v[0] ** 2 - w**2 * q[0] ** 2) / 2, ("x",)).floquet([0], period)
    known = np.exp([1j * w * period, -1j * w * period])
    np.testing.assert_allclose(still.multipliers[np.argsort(-still.multipliers.imag)], known, rtol=1e-14)
    assert dict(zip(np.sign(still.multipliers.imag), still.signatures, strict=True)) == {1: 1, -1: -1}
    assert still.stable
    damped = mechanics.System(
        lambda t, q, v: (v[0] ** 2 - w**2 * q[0] ** 2) / 2, ("x",), forces=lambda t, q, v: [-2 * d * v[0]]
    ).floquet([0], period)
    assert damped.growth == pytest.approx(-d, rel=1e-13)
    assert not damped.symplectic
    assert not damped.signatures.any()
    free = mechanics.System(lambda t, q, v: v[0] ** 2 / 2, ("x",)).floquet([0], 1.0)
    assert not free.stable


def test_multipliers_that_meet_part_only_where_their_signatures_differ():
    like, unlike = meeting(0.05)
    assert like.stable
    assert like.growth == pytest.approx(0, abs=1e-12)
    assert sorted(like.signatures) == [-1, -1, 1, 1]
    assert not unlike.stable
    # of the averaged amplitudes: the rate is coupling/(4 sqrt(w1 w2)), to second order in the coupling
    rate = 0.05 / (4 * math.sqrt(1.2))
    assert unlike.growth == pytest.approx(rate, rel=0.02)


def test_the_multipliers_of_a_closed_orbit_have_signatures_too():
    tilted = mechanics.System(lambda t, q, v: ca.sumsqr(v) / 2 - (q[0] ** 2 + 2 * q[1] ** 2) / 2, ("x", "y"))
    orbit = tilted.orbit([0.4, 0], [0, 0], 2 * math.pi)
    beside = np.exp(2j * math.pi * math.sqrt(2))
    place = int(np.argmin(np.abs(orbit.multipliers - beside)))
    assert abs(orbit.multipliers[place] - beside) < 1e-12
    assert orbit.floquet.signatures[place] == 1


@pytest.mark.parametrize("q", [0.7, 1.3])
def test_boundaries_of_mathieus_equation_are_its_characteristic_values(q):
    chart = mechanics.stability_chart(mathieu(q=q), [0.0], np.pi, {"a": np.linspace(-2, 20, 111)})
    known = np.sort([mathieu_a(k, q) for k in range(5)] + [mathieu_b(k, q) for k in range(1, 5)])
    found, errors = chart.boundaries.places[:, 0], chart.boundaries.errors
    assert len(found) == len(known)
    assert np.abs(found - known)[:4].max() <= 1e-13  # the others are close pairs
    assert np.all(np.abs(found - known) <= errors + 4 * np.finfo(float).eps * np.abs(known))
    kinds = [1 if k % 2 == 0 else -1 for k in (0, 1, 1, 2, 2, 3, 3, 4, 4)]
    assert chart.boundaries.multipliers.tolist() == kinds


def test_a_chart_is_what_single_points_are():
    d = 0.05
    chart = mechanics.stability_chart(
        mathieu(d), [0.0], np.pi, {"a": np.linspace(-2, 10, 40), "q": np.linspace(0, 8, 30)}
    )
    assert chart.growth.shape == (40, 30)
    for i, j in [(3, 4), (20, 11), (39, 29), (25, 0)]:
        alone = mathieu(d, a=chart.first[i], q=chart.second[j]).floquet([0.0], np.pi)
        assert abs(alone.growth - chart.growth[i, j]) <= chart.error[i, j] + 1e-14
        assert alone.stable == chart.stable[i, j]
    # without a drive: ln(max |exp(-d ± sqrt(d² - a))|)
    np.testing.assert_allclose(chart.growth[:, 0], -d + np.sqrt(np.maximum(d**2 - chart.first, 0)), rtol=0, atol=1e-11)
    # at every boundary one multiplier is the one that is said
    for (a, q), multiplier in list(zip(chart.boundaries.places, chart.boundaries.multipliers, strict=True))[::17]:
        alone = mathieu(d, a=a, q=q).floquet([0.0], np.pi)
        assert np.abs(alone.multipliers - multiplier).min() < 1e-11


def test_the_period_may_follow_a_parameter_and_two_coordinates_have_boundaries():
    pair = mechanics.System(
        lambda t, q, v, p: (
            ca.sumsqr(v) - (1 + p.h * ca.cos(p.w * t)) * ca.sumsqr(q) - 0.3 * (q[0] - q[1]) ** 2
        ) / 2,
        ("x", "y"), parameters={"h": 0.2, "w": 2.0},
    )  # fmt: skip
    chart = mechanics.stability_chart(pair, [0, 0], lambda p: 2 * np.pi / p.w, {"w": np.linspace(1.6, 2.9, 60)})
    # normal coordinates are two of Mathieu's equations, a = 4 k/w², q = -2 h/w², k = 1 and 1.6: at a = b1(q), a1(q)
    minus = chart.boundaries.places[chart.boundaries.multipliers == -1, 0]
    misses = [
        min(abs(4 * k / w**2 - mathieu_b(1, 0.4 / w**2)), abs(4 * k / w**2 - mathieu_a(1, 0.4 / w**2)))
        for w in minus for k in (1, 1.6)
    ]  # fmt: skip
    assert len(minus) == 4
    assert np.sort(misses)[:4].max() < 1e-12


def test_multipliers_that_leave_the_circle_elsewhere_are_boundaries_too():
    # two oscillators, one of negative energy: unstable where the drive is near the difference of their frequencies
    pair = mechanics.System(
        lambda t, q, v, p: (
            v[0] ** 2 - q[0] ** 2 - v[1] ** 2 + 1.44 * q[1] ** 2
        ) / 2 - 0.05 * ca.cos(p.w * t) * q[0] * q[1],
        ("x", "y"), parameters={"w": 0.2},
    )  # fmt: skip
    chart = mechanics.stability_chart(pair, [0, 0], lambda p: 2 * np.pi / p.w, {"w": np.linspace(0.16, 0.24, 41)})
    found = chart.boundaries
    off_axis = found.places[np.abs(np.imag(found.multipliers)) > 1e-3, 0]
    low, high = off_axis[off_axis < 0.2].max(), off_axis[off_axis > 0.2].min()

    def stable(w):
        return pair.with_parameters({"w": w}).floquet([0, 0], 2 * math.pi / w).stable

    assert [stable(w) for w in (low - 1e-5, low + 1e-5, high - 1e-5, high + 1e-5)] == [True, False, False, True]


def test_damping_that_changes_its_sign_is_a_boundary():
    brake = mechanics.System(
        lambda t, q, v, p: v[0] ** 2 / 2 - (1.7 + 0.2 * ca.cos(2 * t)) * q[0] ** 2 / 2, ("x",), parameters={"d": 0.1},
        forces=lambda t, q, v, p: [-(p.d - 0.03) * v[0]],
    )  # fmt: skip
    found = mechanics.stability_chart(brake, [0.0], np.pi, {"d": np.linspace(-0.1, 0.1, 20)}).boundaries
    assert found.places[:, 0] == pytest.approx([0.03], abs=1e-14)
    alone = brake.with_parameters({"d": 0.03}).floquet([0.0], np.pi)
    assert np.abs(alone.multipliers - found.multipliers[0]).min() < 1e-12


def test_parametric_resonance_grows_as_first_order_theory_says_to_second_order():
    # Landau and Lifshitz, "Mechanics", sect. 27: ((h w/2)² - eps²)^(1/2)/2, here with eps = share h w/2
    shaken = mechanics.System(
        lambda t, q, v, p: (v[0] ** 2 - (1 + p.h * ca.cos((2 + p.share * p.h / 2) * t)) * q[0] ** 2) / 2, ("x",),
        parameters={"h": 0.0, "share": 0.0},
    )  # fmt: skip
    h, share = np.array([0.01, 0.02, 0.04]), np.array([0.0, 0.6])
    chart = mechanics.stability_chart(
        shaken, [0.0], lambda p: 2 * np.pi / (2 + p.share * p.h / 2), {"h": h, "share": share}
    )
    errors = np.abs(chart.growth - h[:, None] / 4 * np.sqrt(1 - share**2)) / h[:, None]
    assert np.all(np.log2(errors[1:] / errors[:-1]) > 0.9)


def test_what_is_refused():
    with pytest.raises(ValueError, match="others after"):
        mathieu().floquet([0.0], 3.0)
    with pytest.raises(ValueError, match="stand still"):
        mechanics.System(lambda t, q, v: v[0] ** 2 / 2 + q[0] * ca.cos(t), ("x",)).floquet([0], 2 * math.pi)
    with pytest.raises(ValueError, match="name one or two"):
        mechanics.stability_chart(mathieu(), [0.0], np.pi, {"b": [0, 1]})
    with pytest.raises(ValueError, match="ascending"):
        mechanics.stability_chart(mathieu(), [0.0], np.pi, {"a": [1, 0]})
    with pytest.raises(ValueError, match="period must be positive"):
        mathieu().floquet([0.0], -1.0)


def test_a_chart_that_is_stopped_has_numbers_where_they_are_known():
    def stopping(done, total, what):
        if done:
            raise KeyboardInterrupt

    a, q = np.linspace(-40, 40, 61), np.linspace(0, 20, 5)
    with pytest.raises(vc.Interrupted) as stopped:
        mechanics.stability_chart(mathieu(), [0.0], np.pi, {"a": a, "q": q}, progress=stopping)
    growth = stopped.value.known.growth
    known = np.isfinite(growth[:, 0])  # of q = 0, where x'' + a x = 0
    assert 0 < known.sum() < len(a)
    assert np.abs(growth[known, 0] - np.sqrt(np.maximum(-a[known], 0))).max() < 1e-7
