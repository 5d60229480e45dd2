"""extremals against closed forms: how many there are, which, and what is said where there is none."""

import casadi as ca
import mpmath as mp
import numpy as np
import pytest

import varcalc as vc
from varcalc.search import end_map


def film(half):
    return vc.Problem(lambda x, y, dy: y * ca.sqrt(1 + dy**2), vc.Fixed(-half, 1.0), vc.Fixed(half, 1.0))


def necks(half):
    """c with c cosh(half / c) = 1: the shallow catenary, then the deep one."""
    fold = mp.findroot(lambda t: t * mp.tanh(t) - 1, 1.2)

    def miss(ratio):
        return mp.log(mp.cosh(ratio) * half / ratio)

    return [half / mp.findroot(miss, bounds, "illinois") for bounds in ((0.1, fold), (fold, 12))]


def film_value(half, c):
    return c * (half + c * mp.sinh(2 * half / c) / 2)


def bratu(strength, first=None, last=None, **options):
    ends = first or vc.Fixed(0.0, 0.0), last or vc.Fixed(1.0, 0.0)
    return vc.Problem(lambda x, y, dy: dy**2 / 2 - strength * ca.exp(y), *ends, **options)


def bratu_roots(strength):
    """t = sqrt(2 strength) cosh(t / 4) of both solutions y = 2 log(cosh(t / 4) / cosh(t (x - 1/2) / 2))."""
    return [mp.findroot(lambda t: t - mp.sqrt(2 * strength) * mp.cosh(t / 4), start) for start in (1.0, 10.0)]


def bratu_value(t):
    """y'^2 / 2 + strength e^y is t^2 / 2 all along, and y' = -t tanh(t (x - 1/2) / 2)."""
    return float(t**2 / 2 - 4 * t * mp.tanh(t / 4))


def oscillator(time, end=1.0):
    return vc.Problem(lambda t, q, v: (v**2 - q**2) / 2, vc.Fixed(0.0, 0.0), vc.Fixed(time, end))


@pytest.mark.parametrize("strength", [1.0, 3.0, 3.5])
def test_both_solutions_of_bratu(strength):
    heights = [float(2 * mp.log(mp.cosh(t / 4))) for t in bratu_roots(strength)]
    assert sorted(s.y(0.5) for s in vc.extremals(bratu(strength))) == pytest.approx(sorted(heights), abs=1e-9)


def test_none_of_bratu_beyond_the_fold():
    assert len(vc.extremals(bratu(3.6))) == 0


def test_the_oscillator_has_one_motion_none_or_a_continuum():
    [one] = vc.extremals(oscillator(4.0))
    assert one.value == pytest.approx(float(mp.cot(4) / 2), abs=1e-12)
    assert len(vc.extremals(oscillator(float(mp.pi)))) == 0
    conjugate = vc.extremals(oscillator(float(mp.pi), 0.0))
    assert [s.verdict for s in conjugate] == [vc.Verdict.DEGENERATE]
    assert conjugate[0].value == pytest.approx(0.0, abs=1e-12)
    assert "continuum" in conjugate.searched


def test_a_maximum_comes_first_where_one_is_sought():
    values = [s.value for s in vc.extremals(bratu(3.0, maximise=True))]
    assert values == pytest.approx(sorted(map(bratu_value, bratu_roots(3)), reverse=True), abs=1e-11)


def test_every_swing_of_a_pendulum():
    time, end = 10.0, 0.1
    problem = vc.Problem(lambda t, q, v: v**2 / 2 + ca.cos(q), vc.Fixed(0.0, 0.0), vc.Fixed(time, end))

    def miss(k):
        # sin(q/2) = k sn(t, k); a rotation would pass the end angle long before
        return k * mp.ellipfun("sn", time, m=k * k).real - mp.sin(end / 2)

    moduli = np.tanh(np.linspace(-7, 7, 1401))
    signs = np.sign([float(miss(mp.mpf(k))) for k in moduli])
    found = vc.extremals(problem)
    assert len(found) == np.count_nonzero(np.diff(signs))
    for s in found:
        k = mp.findroot(miss, s.dy(0.0) / 2)
        assert float(2 * k) == pytest.approx(s.dy(0.0), abs=1e-8)


def test_a_growth_of_thirteen_digits_hides_no_extremal():
    troesch = vc.Problem(lambda x, y, dy: dy**2 / 2 + ca.cosh(30 * y), vc.Fixed(0.0, 0.0), vc.Fixed(1.0, 1.0))
    [one] = vc.extremals(troesch)
    with mp.workdps(60):
        # y'(0) = 2 q with sinh(mu / 2) / q = sc(mu | 1 - q^2) (Roberts and Shipman, J. Comput. Phys. 10 (1972))
        def miss(q):
            sn, cn = (mp.ellipfun(kind, 30, m=1 - q * q) for kind in ("sn", "cn"))
            return (cn / sn).real - q / mp.sinh(15)

        exact = 2 * mp.findroot(miss, (mp.mpf("3.743e-13"), mp.mpf("3.744e-13")), "secant", tol=1e-60)
    assert one.dy(0.0) == pytest.approx(float(exact), rel=1e-6)


def test_a_free_end_is_met_by_its_natural_condition():
    # half of both solutions: horizontal at the free end
    exact = sorted(bratu_value(t) / 2 for t in bratu_roots(3))
    for ends in ({"last": vc.Free(0.5)}, {"first": vc.Free(0.5)}):
        assert [s.value for s in vc.extremals(bratu(3.0, **ends))] == pytest.approx(exact, abs=1e-12)


def test_a_curve_that_misses_its_end_is_none():
    # y = x^-2 is an extremal with a finite value, but runs from infinity
    found = vc.extremals(vc.Problem(lambda x, y, dy: dy**2 / y**3, vc.Fixed(0.0, 0.0), vc.Fixed(1.0, 1.0)))
    assert len(found) == 0
    assert found.searched


def test_interpolated_data_is_searched_as_formulas_are(monkeypatch):
    monkeypatch.setattr(end_map, "INTERPRETED_STEPS", end_map.INTERPRETED_STEPS // 4)  # a few seconds of them
    heights = np.linspace(-1, 2, 7)
    index = ca.interpolant("n", "bspline", [heights.tolist()], (1 + heights**2).tolist())
    tabulated = vc.Problem(lambda x, y, dy: index(y) * ca.sqrt(1 + dy**2), vc.Fixed(0, 0.5), vc.Fixed(1, 0.5))
    formula = vc.Problem(lambda x, y, dy: (1 + y**2) * ca.sqrt(1 + dy**2), vc.Fixed(0, 0.5), vc.Fixed(1, 0.5))
    found, exact = vc.extremals(tabulated), vc.extremals(formula)
    assert found[0].value == pytest.approx(exact[0].value, abs=1e-10)  # a cubic spline of a parabola is exact
    # what is called from Python is slow, so the range is smaller, and stated
    farthest = [float(s.searched.partition("slope in [")[2].partition(",")[0]) for s in (found, exact)]
    assert farthest[1] == -1e6 < farthest[0] < -10


@pytest.mark.parametrize("unit", [1e-7, 1e7])
def test_units_change_nothing(unit):
    scaled = vc.Problem(
        lambda x, y, dy: y * ca.sqrt(1 + dy**2), vc.Fixed(-0.5 * unit, unit), vc.Fixed(0.5 * unit, unit)
    )
    exact = [float(film_value(0.5, c)) for c in necks(0.5)]
    assert [s.value / unit**2 for s in vc.extremals(scaled)] == pytest.approx(exact, rel=1e-12)


def test_what_cannot_be_searched_is_said():
    wall = vc.Problem(lambda x, y, dy: dy**2, vc.Fixed(0, 0), vc.Fixed(1, 1), [vc.Bound(lambda x, y, dy: dy, upper=2)])
    found = vc.extremals(wall)
    assert len(found) == 0
    assert "not searched by collocation: constraints[0] is an inequality" in found.searched


def test_a_lagrangian_without_a_hold_on_the_slope_has_none():
    for lagrangian in (lambda x, y, dy: y * dy, lambda x, y, dy: x * dy + y**2, lambda x, y, dy: x**2 * dy**2):
        assert len(vc.extremals(vc.Problem(lagrangian, vc.Fixed(-1, 0), vc.Fixed(1, 1)))) == 0


def test_unusable_arguments_are_named():
    with pytest.raises(TypeError, match="problem must be"):
        vc.extremals(lambda x, y, dy: dy**2)
    with pytest.raises(ValueError, match="tol must be"):
        vc.extremals(film(0.5), tol=0.0)


def test_windings_of_a_cylinder_are_told_apart():
    graph = vc.Problem(lambda z, angle, slope: ca.sqrt(1 + slope**2), vc.Fixed(0, 0), vc.Fixed(1, 2))
    chart = vc.Curve(lambda q, dq: ca.sqrt(ca.sumsqr(dq)), vc.At([0, 0]), vc.At([2, 1]))
    exact = {k: float(mp.hypot(1, 2 + 2 * mp.pi * k)) for k in (-1, 0, 1)}
    for found in (
        vc.extremals(graph, period=2 * np.pi, windings=1),
        vc.extremals(chart, period=(2 * np.pi, None), windings=1),
    ):
        assert list(found.windings) == sorted(exact, key=exact.get)
        assert [s.value for s in found] == pytest.approx([exact[k] for k in found.windings], abs=1e-12)
        assert [s.problem.name.rpartition("winding ")[2] for s in found][1:] == ["-1", "+1"]
    ring = vc.extremals(chart, period=(2 * np.pi, 3.0), windings=0)
    assert list(ring.windings) == [(0, 0)]


def test_a_period_that_the_lagrangian_lacks_is_refused():
    with pytest.raises(ValueError, match="changes when component 0 grows by 1"):
        vc.extremals(film(0.5), period=1.0)
    angle = vc.Problem(lambda x, y, dy: dy**2, vc.Fixed(0, 0), vc.Free(1))
    with pytest.raises(ValueError, match="free at the end"):
        vc.extremals(angle, period=1.0)
    with pytest.raises(ValueError, match="windings must be"):
        vc.extremals(film(0.5), windings=-1)
    with pytest.raises(ValueError, match="one for each"):
        vc.extremals(film(0.5), period=(1.0, 2.0))


def test_antipodes_are_joined_by_a_continuum():
    sphere = vc.Curve(
        lambda q, dq: ca.sqrt(ca.sumsqr(dq)), vc.At([1, 0, 0]), vc.At([-1, 0, 0]),
        [vc.Holonomic(lambda q: ca.sumsqr(q) - 1)],
    )  # fmt: skip
    found = vc.extremals(sphere)
    assert {s.verdict for s in found} == {vc.Verdict.DEGENERATE}
    assert found[0].value == pytest.approx(np.pi, abs=1e-11)


def test_both_chains_of_a_given_length():
    chain = vc.Problem(
        lambda x, y, dy: y * ca.sqrt(1 + dy**2), vc.Fixed(0, 0), vc.Fixed(1, 0),
        [vc.Isoperimetric(lambda x, y, dy: ca.sqrt(1 + dy**2), 1.5)],
    )  # fmt: skip
    # y = c cosh((x - 1/2) / c) - c cosh(1 / (2 c)), with 2 c sinh(1 / (2 c)) = 3/2; and the same turned over
    r = mp.findroot(lambda r: mp.sinh(r) / r - 1.5, 1.6)
    c = 1 / (2 * r)
    weight = c * (mp.mpf(1) / 2 + c * mp.sinh(2 * r) / 2) - c * mp.cosh(r) * mp.mpf(3) / 2
    assert [s.value for s in vc.extremals(chain)] == pytest.approx([float(weight), float(-weight)], abs=1e-12)


def test_both_rays_as_a_curve_in_the_plane():
    ray = vc.Curve(lambda q, dq: ca.sqrt((1 - 2 * q[1]) * ca.sumsqr(dq)), vc.At([0, 0]), vc.At([0.5, 0]))
    found = vc.extremals(ray)
    slopes = [float(np.divide(*s.dq(0.0)[::-1])) for s in found]
    assert slopes == pytest.approx([float(mp.tan(mp.radians(d))) for d in (15, 75)], abs=1e-8)
    assert "145 initial slopes" in found.searched


def test_two_functions_that_do_not_meet_have_every_pair_of_solutions():
    pair = vc.Problem(
        lambda t, q, v: ca.sumsqr(v) / 2 - 3 * ca.exp(q[0]) - q[1] ** 4 / 4 + 10 * q[1] ** 2,
        vc.Fixed(0, [0, 0]), vc.Fixed(1, [0, 0]),
    )  # fmt: skip
    heights = [float(2 * mp.log(mp.cosh(t / 4))) for t in bratu_roots(3)]
    found = vc.extremals(pair)
    middles = {tuple(np.round(s.y(0.5), 6)) for s in found}
    first = {round(h, 6) for h in heights}
    assert {m[0] for m in middles} == first
    # q2 = 0, and one arch of q2'' = 20 q2 - q2^3 either way, with each of the two
    assert len(middles) == 6


def test_both_ends_on_a_circle():
    near_and_far = vc.extremals(
        vc.Problem(
            lambda x, y, dy: ca.sqrt(1 + dy**2), vc.Fixed(0, 0),
            vc.OnCurve(lambda x, y: (x - 3) ** 2 + y**2 - 1, x=2.2),
        )
    )  # fmt: skip
    assert [s.value for s in near_and_far] == pytest.approx([2.0, 4.0], abs=1e-12)
