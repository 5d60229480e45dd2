"""Neighbouring parameter values: as right as solves of their own, and what is in doubt is left to those."""

import math
import sys

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

import varcalc as vc
from varcalc.problems._curves import Cycloid
from varcalc.solve.warm_start import Neighbours


def descent():
    return vc.Problem(
        lambda x, y, dy, p: ca.sqrt((1 + dy**2) / (2 * p.g * y)),
        vc.Fixed(0, 0),
        vc.Fixed(vc.Parameter("across"), vc.Parameter("depth")),
        parameters={"g": 9.81, "across": 1.0, "depth": 1.0},
    )


def film():
    return vc.Problem(
        lambda x, y, dy, p: y * ca.sqrt(1 + dy**2),
        vc.Fixed(-0.5, 1),
        vc.Fixed(vc.Parameter("to"), vc.Parameter("height")),
        parameters={"to": 0.5, "height": 1.0},
    )


def spring():
    return vc.Problem(
        lambda x, y, dy, p: dy**2 + p.k * y**2, vc.Fixed(0, 0), vc.Fixed(1, 1), parameters={"k": 1.0}, name="spring"
    )


def almost():
    """Infinite at the start for h = 0 only, and just beyond it for small h."""
    return vc.Problem(
        lambda x, y, dy, p: ca.sqrt((1 + dy**2) / (y + p.h)), vc.Fixed(0, 0), vc.Fixed(1, 1), parameters={"h": 1.0}
    )


def power():
    """Infinite at the start with a power that is the parameter."""
    return vc.Problem(
        lambda x, y, dy, p: ca.sqrt(1 + dy**2) * y**-p.k, vc.Fixed(0, 0), vc.Fixed(1, 1), parameters={"k": 0.5}
    )


def several():
    return vc.Problem(
        lambda x, y, dy, p: ca.sumsqr(dy) + p.k * y[0] * y[1],
        vc.Fixed(0, [0, 1]),
        vc.Fixed(1, [vc.Parameter("to"), None]),
        parameters={"k": 1.0, "to": 2.0},
    )


def weak():
    """Convex in the slope next to zero only: beyond a rise of 0.41 Legendre's condition fails, before it another."""
    return vc.Problem(
        lambda x, y, dy, p: dy**2 - dy**4 + p.k * dy**6,
        vc.Fixed(0, 0),
        vc.Fixed(1, vc.Parameter("rise")),
        parameters={"k": 1.0, "rise": 0.1},
    )


def steep():
    """Cheapest at the start: what rises by more than a tenth of arcosh(11) jumps there, and is no graph."""
    return vc.Problem(
        lambda x, y, dy, p: (1 + 10 * x) * ca.sqrt(1 + dy**2),
        vc.Fixed(0, 0),
        vc.Fixed(1, vc.Parameter("rise")),
        parameters={"rise": 0.1},
    )


def film_as_a_curve():
    """A length where q1 > -k: at k = -0.7 it vanishes at one of the ends."""
    return vc.Curve(
        lambda q, dq, p: (q[1] + p.k) * ca.sqrt(ca.sumsqr(dq)),
        vc.At([0, 1]),
        vc.At([1, vc.Parameter("height")]),
        parameters={"k": 1.0, "height": 1.0},
    )


def in_space():
    return vc.Curve(
        lambda q, dq, p: ca.sqrt(ca.sumsqr(dq)) * (1 + p.k * ca.sumsqr(q)),
        vc.At([0, vc.Parameter("y"), 1]),
        vc.At([1, 0, None]),
        parameters={"k": 1.0, "y": 0.5},
    )


def counted(monkeypatch):
    solves = []
    original = vc.solve

    def watched(problem, method, **options):
        solves.append(problem.parameters)
        return original(problem, method, **options)

    monkeypatch.setattr(sys.modules["varcalc.solve.row"], "solve", watched)
    return solves


def test_end_points_of_the_brachistochrone(monkeypatch):
    solves = counted(monkeypatch)
    across, depth = np.linspace(0.2, 5, 12), np.linspace(0.2, 2, 12)
    found = vc.sweep(descent(), {"across": across, "depth": depth}, vc.Ritz())
    exact = np.array([[Cycloid.through(a, d).descent_time(9.81) for d in depth] for a in across])
    claimed = np.array([p.claimed_error for p in found.points]).reshape(exact.shape)
    assert np.all(np.abs(found.values - exact) <= claimed + 4e-16 * exact)
    assert claimed.max() <= 1e-10
    assert len(solves) <= 5


@pytest.mark.parametrize("tol", [1e-4, 1e-8, 1e-12])
def test_every_tolerance(tol):
    across = np.linspace(0.3, 4, 30)
    found = vc.sweep(descent(), {"across": across}, vc.Ritz(), tol=tol)
    exact = np.array([Cycloid.through(a, 1.0).descent_time(9.81) for a in across])
    assert np.abs(found.values - exact).max() <= tol
    assert all(p.claimed_error <= tol for p in found.points)


@pytest.mark.parametrize(
    ("problem", "grid"),
    [
        (film, {"to": [0.2, 0.5, 0.75, 0.8, 0.83, 1.0], "height": [0.9, 1.3]}),
        (spring, {"k": np.concatenate([np.linspace(5, -9, 15), [-9.8, -9.8696, -(math.pi**2), -9.87, -10, -30]])}),
        (almost, {"h": [1.0, 0.9, 0.5, 0.2, 0.1, 0.03, 0.01, 1e-3, 1e-6, 0.0]}),
        (power, {"k": [0.5, 0.5, 1 / 3, 0.4, 0.49, 0.0, 0.75, 1.0, 1.2]}),
        (weak, {"k": [1.0, 0.2, 0.1], "rise": [0.1, 0.0, 0.2, 0.3, 0.5]}),
        (steep, {"rise": [0.1, 0.05, 0.2, 0.305, 0.309, 0.32]}),
        (film_as_a_curve, {"k": [1.0, 0.5, -0.2, -0.5, -0.6, -0.7], "height": [1.0, 0.7]}),
        (in_space, {"k": [1.0, 0.0, -0.3], "y": [0.5, 0.0, -1.0]}),
        (several, {"k": [1.0, 0.5, -1.0, -4.0], "to": [0.0, 1.0, 5.0]}),
    ],
)
def test_the_same_answers_and_refusals_as_solves_of_their_own(problem, grid):
    """Folds, conjugate ends, ends that become singular, powers that change: a value in doubt is solved for itself."""
    found = vc.sweep(problem(), grid, vc.Ritz())
    for point in found.points:
        alone = vc.solve(
            problem().with_parameters(dict(zip(grid, map(float, point.values), strict=True))), vc.Ritz(), throw=False
        )
        assert point.ok == alone.status.ok, point
        if point.ok:
            assert abs(point.value - alone.value) <= 1.5 * (point.claimed_error + alone.error.value) + 1e-15, point


def test_what_is_convex_in_the_slope_needs_no_solve_of_its_own(monkeypatch):
    """Graphs at regular ends are put to Weierstrass's test and that for jumps many at a time."""
    examined = []
    original = Neighbours.solution
    monkeypatch.setattr(Neighbours, "solution", lambda self, *given: examined.append(given) or original(self, *given))
    solves = counted(monkeypatch)
    rises = np.linspace(0.0, 0.11, 40)
    found = vc.sweep(steep(), {"rise": rises}, vc.Ritz())
    assert len(solves) == 1
    assert not examined
    exact = [climbing(brentq(lambda p, r=r: risen(p) - r, 0, 1, xtol=1e-15)) for r in rises]
    np.testing.assert_allclose(found.values, exact, rtol=1e-10)


def climbing(p):
    """The value of an extremal of momentum p: n^2 / sqrt(n^2 - p^2) integrated over x, with n = 1 + 10 x."""
    return quad(lambda x: (1 + 10 * x) ** 2 / math.sqrt((1 + 10 * x) ** 2 - p * p), 0, 1, epsabs=1e-14)[0]


def risen(p):
    """By how much an extremal of momentum p rises: p / sqrt(n^2 - p^2) integrated over x, with n = 1 + 10 x."""
    return 0.1 * p * (math.acosh(11 / p) - math.acosh(1 / p)) if p > 0 else 0.0


def test_curves_between_points_that_move(monkeypatch):
    """In the half-plane of Poincare the distance has a closed form."""
    curve = vc.Curve(
        lambda q, dq, p: ca.sqrt(ca.sumsqr(dq)) / q[1],
        vc.At([vc.Parameter("left"), vc.Parameter("low")]),
        vc.At([1, vc.Parameter("high")]),
        parameters={"left": 0.0, "low": 1.0, "high": 1.0},
    )
    solves = counted(monkeypatch)
    rng = np.random.default_rng(1882)
    left, low, high = rng.uniform(-1, 0, 60), rng.uniform(0.8, 2, 60), rng.uniform(0.8, 2, 60)
    found = vc.sweep(curve, vc.Paired({"left": left, "low": low, "high": high}), vc.Ritz(), tol=1e-12)
    exact = np.arccosh(1 + ((1 - left) ** 2 + (high - low) ** 2) / (2 * low * high))
    assert len(solves) == 1
    assert np.all(np.abs(found.values - exact) <= found.claimed_errors + 1e-15)
    assert found.claimed_errors.max() <= 1e-12 * max(1.0, exact.max())


def test_a_film_that_is_only_local_says_so():
    # beyond a span of 1.05 Goldschmidt's two discs are less, and the catenary is still a local minimum
    known = vc.solve(film(), vc.Ritz())
    wide = vc.solve(film().with_parameters({"to": 0.6}), vc.Ritz())
    moved = vc.solve(known.problem.with_parameters({"to": 0.6}), vc.Ritz(), guess=known)
    assert wide.local
    assert moved.local
    assert wide.lower == pytest.approx(moved.lower, rel=1e-9)
    assert moved.value == pytest.approx(wide.value, rel=1e-12)


def test_one_value_from_a_solution():
    known = vc.solve(descent(), vc.Ritz())
    moved = vc.solve(known.problem.with_parameters({"across": 1.7, "g": 1.62}), vc.Ritz(), guess=known)
    cycloid = Cycloid.through(1.7, 1.0)
    assert moved.value == pytest.approx(cycloid.descent_time(1.62), rel=1e-11)
    assert moved.interval == (0.0, 1.7)
    assert moved.y(1.7) == pytest.approx(1.0, abs=1e-12)
    cold = vc.solve(descent().with_parameters({"across": 1.7, "g": 1.62}), vc.Ritz(), tol=1e-13)
    x = np.linspace(0.01, 1.69, 50)
    assert np.abs(moved.y(x) - cold.y(x)).max() <= moved.error.curve + cold.error.curve
    assert moved.sensitivities["g"] == pytest.approx(-moved.value / (2 * 1.62), rel=1e-9)
    assert vc.verify(moved).verdict is vc.Verdict.MINIMUM


def test_from_one_value_to_the_next_and_on():
    solution = vc.solve(descent(), vc.Ritz())
    for depth in (1.1, 1.3, 1.6, 0.7):
        solution = vc.solve(solution.problem.with_parameters({"depth": depth}), vc.Ritz(), guess=solution)
        assert solution.value == pytest.approx(Cycloid.through(1.0, depth).descent_time(9.81), rel=1e-10)


@pytest.mark.parametrize("method", [vc.Ritz(elements=4), vc.Ritz(optimiser=vc.Ipopt()), vc.Collocation(elements=4)])
def test_other_methods_are_left_to_themselves(method):
    solution = vc.solve(spring(), method)
    assert Neighbours.of(solution, 1e-10, 100) is None
    again = vc.solve(solution.problem.with_parameters({"k": 2.0}), method, guess=solution)
    assert again.value == pytest.approx(math.sqrt(2) / math.tanh(math.sqrt(2)), rel=1e-10)
    assert type(again.method) is type(method)


def test_a_cold_solve_tells_what_building_took_apart():
    cold = vc.solve(descent(), vc.Ritz())
    assert cold.stats.build > 0
    warm = vc.solve(cold.problem.with_parameters({"across": 1.1}), vc.Ritz(), guess=cold)
    assert warm.stats.build == 0


def test_how_forms_are_compared_depends_on_what_is_asked_and_not_on_what_was_asked_before(monkeypatch):
    alone = []
    original = Neighbours._stated_alike
    monkeypatch.setattr(Neighbours, "_stated_alike", lambda self, v: alone.append(v) or original(self, v))
    problem = spring()
    first = vc.solve(problem, vc.Ritz())
    values = [1.0 + 0.1 * k for k in range(12)]
    for k in values:  # from one solution, each for itself
        vc.solve(problem.with_parameters({"k": k}), vc.Ritz(), guess=first)
    assert {float(v[0]) for v in alone} == set(values)
    alone.clear()
    last = first
    for k in values:  # each from the one before: after some it pays to build what compares them
        last = vc.solve(problem.with_parameters({"k": k}), vc.Ritz(), guess=last)
    assert 0 < len(alone) < len(values)
    assert last.value == pytest.approx(math.sqrt(2.1) / math.tanh(math.sqrt(2.1)), rel=1e-10)
    alone.clear()
    vc.sweep(problem, {"k": values}, vc.Ritz())
    assert not alone
