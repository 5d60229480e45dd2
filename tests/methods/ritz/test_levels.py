"""Prescribed integrals in the direct method: what it finds, what it claims, and what it leaves alone."""

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import brentq

import varcalc as vc
from varcalc.formulation.singular import forms
from varcalc.methods.ritz import family
from varcalc.methods.ritz import method as ritz
from varcalc.methods.ritz.newton import minimise
from varcalc.methods.ritz.starts import bends, meeting_levels
from varcalc.methods.ritz.system import Places, RitzSystem
from varcalc.numerics.mesh import Space
from varcalc.problems._curves import Catenary


def length(x, y, dy):
    return ca.sqrt(1 + dy**2)


def weight(x, y, dy):
    return y * length(x, y, dy)


def graph(lagrangian, levels, start=(0, 0), end=(1, 0), **options):
    return vc.Problem(lagrangian, vc.Fixed(*start), vc.Fixed(*end), levels, **options)


def chain(size=1.5, drop=0.0):
    return graph(weight, [vc.Isoperimetric(length, size)], end=(1, drop))


def shore(size=1.3, sign=-1.0):
    return graph(lambda x, y, dy: sign * y, [vc.Isoperimetric(length, size)])


def loaded():
    """A chain whose first moment is prescribed beside its length."""
    return graph(weight, [vc.Isoperimetric(length, 1.5), vc.Isoperimetric(lambda x, y, dy: x * y, -0.15)])


def sphere(pull):
    """The integral of y'^2 + pull y least where that of y^2 is one: close to +-sqrt2 sin(pi x)."""
    return graph(lambda x, y, dy: dy**2 + pull * y, [vc.Isoperimetric(lambda x, y, dy: y**2, 1.0)])


def sphere_exact(pull):
    """The value of the lower of the two, y = h (1 - cos w(x - 1/2) / cos(w/2)) with h = pull / 2 w^2 and w < pi.

    y'' + w^2 y = pull / 2, and by parts J = w^2 + pull/2 times the integral of y.
    """
    if pull == 0:
        return np.pi**2

    def mean(w):  # of y and of y^2 in units of h and h^2
        t = np.tan(w / 2) / w
        return 1 - 2 * t, 1 - 4 * t + (0.5 + np.sin(w) / (2 * w)) / np.cos(w / 2) ** 2

    def height(w):
        return abs(pull) / (2 * w**2)

    w = brentq(lambda w: height(w) ** 2 * mean(w)[1] - 1, 1.0, np.pi - 1e-9, xtol=1e-15)
    return w**2 + 0.5 * abs(pull) * height(w) * mean(w)[0]


@pytest.mark.parametrize("tol", [1e-4, 1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize(("size", "drop"), [(1.5, 0.0), (1.05, 0.0), (1.7, 0.6), (1.8, -1.0), (3.0, 0.0)])
def test_a_chain_hangs_in_a_catenary(tol, size, drop):
    exact = Catenary.of_length(0, 1, drop, size) if drop else Catenary.of_length(0, 1, 0, size)
    found = vc.solve(chain(size, drop), vc.Ritz(), tol=tol)
    assert abs(found.value - exact.moment_about_start) <= found.error.value + 1e-15
    assert found.error.value <= tol


@pytest.mark.parametrize("tol", [1e-4, 1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_most_land_lies_under_an_arc_whose_multiplier_is_the_radius(tol, sign):
    half = brentq(lambda a: a / np.sin(a) - 1.3, 1e-3, 3.0, xtol=1e-15)
    radius = 0.5 / np.sin(half)
    area = radius**2 * (half - np.sin(half) * np.cos(half))
    found = vc.solve(shore(1.3, sign), vc.Ritz(), tol=tol)
    assert abs(found.value + area) <= found.error.value + 1e-15
    assert found.error.value <= tol
    # d(area)/d(length) is the radius of the arc
    assert found.multipliers[0] == pytest.approx(-radius, rel=10 * tol**0.5)
    assert np.sign(found.curve(np.array([0.5]), 0)[0, 0]) == -sign


@pytest.mark.parametrize("pull", [0.0, 0.1, -1.0, 5.0])
def test_the_lower_of_two_minima_is_found(pull):
    found = vc.solve(sphere(pull), vc.Ritz(), tol=1e-11)
    assert abs(found.value - sphere_exact(pull)) <= found.error.value + 1e-13
    assert pull == 0 or np.sign(found.curve(np.array([0.5]), 0)[0, 0]) == -np.sign(pull)


def test_both_minima_are_minima_and_the_multiplier_of_the_higher_is_its_own():
    upper = vc.solve(sphere(0.5), vc.Ritz(starts=1), tol=1e-11, guess=lambda x: 1.4 * np.sin(np.pi * x))
    assert upper.value > sphere_exact(0.5) + 0.5
    assert upper.multipliers[0] > np.pi**2 > vc.solve(sphere(0.5), vc.Ritz()).multipliers[0]


def test_several_levels_at_once():
    # y'' is linear in x: a cubic that vanishes at both ends, with the mean 1 and the first moment 0.2
    levels = [vc.Isoperimetric(lambda x, y, dy: y, 1.0), vc.Isoperimetric(lambda x, y, dy: x * y, 0.2)]
    found = vc.solve(graph(lambda x, y, dy: dy**2, levels), vc.Ritz(), tol=1e-12)
    # y = a x (1 - x) + b x (1 - x)(1 - 2 x): a / 6 = 1, a / 12 - b / 60 = 0.2; the value a^2 / 3 + b^2 / 5
    assert found.value == pytest.approx(12 + 18.0**2 / 5, abs=1e-11)
    # d/dm of the value, with a = 6 m0 and b = 30 m0 - 60 m1
    np.testing.assert_allclose(found.multipliers, [24 + 2 * 18 * 30 / 5, -2 * 18 * 60 / 5], rtol=1e-9)


@pytest.mark.parametrize(
    "problem",
    [chain(1.6, 0.3), shore(1.2), sphere(2.0), chain(1.0001), chain(2.2362, 2.0), loaded()],
    ids=["chain", "shore", "sphere", "taut", "taut and steep", "two levels"],
)
@pytest.mark.parametrize("tol", [1e-6, 1e-11])
def test_many_values_at_once_give_the_answer_of_one(problem, tol):
    alone, form = vc.solve(problem, vc.Ritz(), tol=tol), forms(problem)[0]
    places = Places(np.array([form.span]), form.ends.start, form.ends.end, problem.parameter_values[None])
    start = Space(np.array(form.span), 6, form.n).fit(lambda s: alone.extremal.evaluate(s, 0))
    with np.errstate(all="ignore"):
        found = family.solved(form, places, np.array([6]), [start], tol, near=True)
    assert found.stands[0]
    assert abs(form.sign * found.value[0] - alone.value) <= found.error[0] + alone.error.value
    np.testing.assert_allclose(found.multipliers[0], alone.extremal.lambdas, rtol=1e-3)


@pytest.mark.parametrize(
    ("size", "verdict"),
    [(0.9, vc.Verdict.INFEASIBLE), (1.0, vc.Verdict.DEGENERATE), (1 + 1e-15, vc.Verdict.DEGENERATE)],
)
def test_a_length_that_no_other_curve_has(size, verdict):
    found = vc.solve(shore(size), vc.Ritz(), throw=False)
    assert not found.status.ok
    assert found.verdict is verdict


def test_a_level_that_nothing_changes_is_not_met_by_bending():
    total = vc.Isoperimetric(lambda x, y, dy: y * dy, 0.5)
    assert not vc.solve(graph(lambda x, y, dy: dy**2, [total], end=(1, 1)), vc.Ritz(), throw=False).status.ok


def test_no_saddle_is_an_answer():
    # beyond the second eigenvalue, 4 pi^2, some ripple keeps the level and comes lower
    level = [vc.Isoperimetric(lambda x, y, dy: y, 1.0)]
    for strength, ok in ((39.0, True), (40.0, False)):
        found = vc.solve(graph(lambda x, y, dy, by=strength: dy**2 - by * y**2, level), vc.Ritz(), throw=False)
        assert found.status.ok is ok


# the bends


def on_one_element(problem, degree=6):
    form = forms(problem)[0]
    system = RitzSystem(form, Space(np.array(form.span), degree, form.n))
    return system, system.fitted(form.start.curve)


@pytest.mark.parametrize("problem", [chain(), chain(1.3, 0.8), sphere(1.0)])
def test_bends_meet_the_level_both_ways(problem):
    system, line = on_one_element(problem)
    found = bends(system, line[None])
    assert found.values.shape == (1, 2)
    assert found.values[0, 0] <= found.values[0, 1]
    values, misses = system.measured(found.unknowns[0])
    assert np.all(np.abs(misses) <= 0.05)
    np.testing.assert_allclose(found.values[0], values, atol=0.05 * np.abs(values).max())


def test_a_bend_that_leads_down_to_the_other_need_not_be_compared():
    assert meeting_levels(on_one_element(chain())[0])[1] == 1
    assert meeting_levels(on_one_element(shore())[0])[1] == 1
    assert meeting_levels(on_one_element(sphere(0.1))[0])[1] == 2


def test_bends_of_several_functions():
    def speed(x, y, dy):
        return ca.sqrt(1 + ca.sumsqr(dy))

    problem = vc.Problem(
        lambda x, y, dy: y[0] * speed(x, y, dy), vc.Fixed(0, [0, 0]), vc.Fixed(1, [0, 0]),
        [vc.Isoperimetric(speed, 1.5)],
    )  # fmt: skip
    assert meeting_levels(on_one_element(problem)[0])[1] == 1
    found = vc.solve(problem, vc.Ritz(), tol=1e-10)
    assert abs(found.value - Catenary.of_length(0, 1, 0, 1.5).moment_about_start) <= found.error.value


def test_bends_that_meet_several_levels():
    system, line = on_one_element(loaded())
    found = bends(system, line[None])
    met = np.isfinite(found.values[0])
    assert met.any()
    assert np.all(np.abs(system.evaluate(found.unknowns[0][met][0]).conditions) <= 2e-3)


def test_multipliers_that_are_far_too_large_make_no_end():
    # as those of a curve that no level feels are: next to what they cost every step is a short one
    system, _ = on_one_element(chain())
    bend = meeting_levels(system)[0][0]
    found, expected = (minimise(system, bend, np.array([start]), vc.Newton(60)) for start in (1e28, 0.0))
    assert not found.reason
    assert found.value == pytest.approx(expected.value, rel=1e-12)
    assert found.multipliers[0] == pytest.approx(expected.multipliers[0], rel=1e-6)


def test_units_of_the_axes_that_are_as_unlike_as_may_be():
    # bends as high as the interval is long change no level
    ratio = 1e12
    problem = graph(
        lambda x, y, dy: y / ratio * ca.sqrt(1 + (dy / ratio) ** 2),
        [vc.Isoperimetric(lambda x, y, dy: ca.sqrt(1 + (dy / ratio) ** 2), 1.01)],
    )
    found = vc.solve(problem)
    assert abs(found.value - Catenary.of_length(0, 1, 0, 1.01).moment_about_start) <= 2 * found.error.value + 1e-15


# many values


def of_length(lagrangian):
    """A level whose value is a parameter: the integral of the length less it."""
    level = vc.Isoperimetric(lambda x, y, dy, p: length(x, y, dy) - p.size, 0.0)
    return graph(lagrangian, [level], parameters={"size": 1.5})


def test_lengths_of_a_chain_many_at_once(monkeypatch):
    alone = []

    def counted(method, form, *, tol, guess, solve=ritz.Ritz.solve):
        if guess is None:  # what is begun from a curve follows another valley
            alone.append(form)
        return solve(method, form, tol=tol, guess=guess)

    monkeypatch.setattr(ritz.Ritz, "solve", counted)
    sizes = np.linspace(1.1, 2.5, 60)
    found = vc.sweep(of_length(lambda x, y, dy, p: weight(x, y, dy)), {"size": sizes.tolist()}, vc.Ritz(), tol=1e-9)
    assert (
        len(alone) == 1 + 3
    )  # one from nothing, and one held against other valleys of each of the groups of 4, 16, 39
    for point in found.points:
        exact = Catenary.of_length(0, 1, 0, point.values[0]).moment_about_start
        assert abs(point.value - exact) <= point.claimed_error + 1e-15
        assert point.claimed_error <= 1e-9


def test_the_branch_that_is_lower_changes_within_a_sweep():
    level = vc.Isoperimetric(lambda x, y, dy, p: y**2, 1.0)
    problem = graph(lambda x, y, dy, p: dy**2 + p.pull * y, [level], parameters={"pull": -2.0})
    pulls = np.linspace(-2.0, 2.1, 24)
    found = vc.sweep(problem, {"pull": pulls.tolist()}, vc.Ritz(), tol=1e-9)
    for point in found.points:
        assert abs(point.value - sphere_exact(point.values[0])) <= point.claimed_error + 1e-13


def test_from_a_solution_to_another_length():
    problem = of_length(lambda x, y, dy, p: weight(x, y, dy))
    first = vc.solve(problem, vc.Ritz(), tol=1e-9)
    found = vc.solve(problem.with_parameters({"size": 1.6}), vc.Ritz(), tol=1e-9, guess=first)
    exact = Catenary.of_length(0, 1, 0, 1.6)
    assert abs(found.value - exact.moment_about_start) <= found.error.value
    # the level is what the parameter takes off: the value changes by the multiplier times the length
    assert found.sensitivities["size"] == pytest.approx(found.multipliers[0], rel=1e-6)


def test_values_of_different_degrees_stay_apart():
    # one starts where it ends, one has to climb: what is built for all must not serve some
    form = forms(of_length(lambda x, y, dy, p: weight(x, y, dy)))[0]
    places = Places(
        np.array([form.span] * 3), np.zeros((3, 1)), np.zeros((3, 1)), np.array([[1.2], [2.4], [1.5]])
    )  # fmt: skip
    degrees = np.array([6, 10, 6])
    starts = [Space(np.array(form.span), int(d)).fit(lambda s: -2.0 * s[None] * (1 - s[None])) for d in degrees]
    found = family.solved(form, places, degrees, starts, 1e-9, near=False)
    assert found.stands.all()
    for value, error, size in zip(found.value, found.error, (1.2, 2.4, 1.5), strict=True):
        assert abs(value - Catenary.of_length(0, 1, 0, size).moment_about_start) <= error + 1e-15
