"""The index by both routes: of extremals manufactured for any curve, and where it is known in closed form."""

import math
from functools import lru_cache

import casadi as ca
import numpy as np
import pytest

import varcalc as vc
from varcalc.formulation import formulate
from varcalc.verify.ritz_hessian import RitzHessian, index_by_ritz
from varcalc.verify.verification import Index

CASES = range(20, 50)


def along(lagrangian, curve, order, n):
    """Symbolic derivatives of L along a chosen curve: (x, [L_y, L_v, ..], ordinates), each a column."""
    x = ca.SX.sym("x")
    symbols = [ca.SX.sym(f"y{k}", n) for k in range(order + 1)]
    tower = [curve(x)]
    for _ in range(order):
        tower.append(ca.jacobian(tower[-1], x))
    L = lagrangian(x, *symbols)
    return x, [ca.substitute(ca.gradient(L, v), ca.vertcat(*symbols), ca.vertcat(*tower)) for v in symbols], tower


def manufactured(lagrangian, curve, order, n):
    """L + s(x) . y with s such that ``curve`` is an extremal: s = d/dx L_v - L_y (- d^2/dx^2 L_w)."""
    x, gradients, _ = along(lagrangian, curve, order, n)
    s = ca.jacobian(gradients[1], x) - gradients[0]
    if order == 2:
        s -= ca.jacobian(ca.jacobian(gradients[2], x), x)
    force = ca.Function("force", [x], [s])
    return lambda x, y, *slopes: lagrangian(x, y, *slopes) + ca.dot(force(x), y)


class Case:
    """A random Lagrangian with a chosen extremal: one to three functions, order 1 or 2, any ends."""

    def __init__(self, number):
        rng = np.random.default_rng(number)
        self.order = 2 if number % 5 == 4 else 1
        self.n = 1 if self.order == 2 else int(rng.integers(1, 4))
        n = self.n
        stiffness = 1 + 3 * rng.random()
        frequencies = rng.uniform(1, 9, n) if self.order == 1 else rng.uniform(3, 11, n)
        mixing = rng.uniform(-1, 1, (n, n))
        mass = np.eye(n) + 0.2 * mixing @ mixing.T
        twist = rng.uniform(-1, 1, (n, n))
        phases, amplitudes = rng.uniform(0, 6, n), rng.uniform(0.2, 0.6, n)

        def first(x, y, v):
            kinetic = stiffness * (1 + 0.3 * ca.sin(x)) * (v.T @ mass @ v) / 2 + ca.sumsqr(v) ** 2 / 40
            return kinetic - ca.dot(stiffness * frequencies**2, 1 - ca.cos(y)) + y.T @ twist @ v * ca.cos(x)

        def second(x, y, v, w):
            return (1 + 0.2 * ca.cos(x)) * ca.sumsqr(w) / 2 - ca.dot(frequencies**2, v**2) / 2 + y[0] ** 4 / 4

        self.curve = lambda x: ca.vertcat(*(a * ca.sin(2 * x + p) for a, p in zip(amplitudes, phases, strict=True)))
        self.base = first if self.order == 1 else second
        self.isoperimetric = number % 3 == 1
        self.kind = ("fixed", "free end", "free start", "both free")[number % 4] if self.order == 1 else "fixed"

    def at(self, x, derivative=0):
        symbol = ca.SX.sym("x")
        y = self.curve(symbol)
        for _ in range(derivative):
            y = ca.jacobian(y, symbol)
        return np.asarray(ca.Function("y", [symbol], [y])(x)).ravel()

    def problem(self):
        x, gradients, _ = along(self.base, self.curve, self.order, self.n)
        momentum = ca.Function("p", [x], [gradients[1]])
        p0, p1 = (np.asarray(momentum(t)).ravel() for t in (0.0, 1.0))
        free_start, free_end = self.kind in ("free start", "both free"), self.kind in ("free end", "both free")
        slopes = {"dy": self.at(0, 1).tolist()} if self.order == 2 else {}
        start = vc.Free(0, self.n) if free_start else vc.Fixed(0, self.at(0).tolist(), **slopes)
        slopes = {"dy": self.at(1, 1).tolist()} if self.order == 2 else {}
        end = vc.Free(1, self.n) if free_end else vc.Fixed(1, self.at(1).tolist(), **slopes)
        constraints = []
        if self.isoperimetric:
            t = np.polynomial.legendre.leggauss(40)
            level = 0.5 * sum(w * math.cos(self.at(0.5 + 0.5 * s)[0]) for s, w in zip(*t, strict=True))
            constraints = [vc.Isoperimetric(lambda x, y, *slopes: ca.cos(y[0]), level)]

        def end_cost(x0, y0, x1, y1):
            cost = ca.dot(p0, y0) * free_start - ca.dot(p1, y1) * free_end
            # a curvature of the cost as well, that leaves the curve stationary
            return cost + free_start * ca.sumsqr(y0 - self.at(0)) - free_end * ca.sumsqr(y1 - self.at(1))

        lagrangian = manufactured(self.base, self.curve, self.order, self.n)
        costs = {"end_cost": end_cost} if free_start or free_end else {}
        if self.n == 1 and (free_start and free_end):
            start, end = vc.Free(0, 1), vc.Free(1, 1)
        return vc.Problem(lagrangian, start, end, constraints, order=self.order, **costs)


@lru_cache
def verified(number):
    case = Case(number)
    solution = vc.solve(case.problem(), vc.Collocation(), guess=case.at)
    assert np.abs(solution.y(0.37) - case.at(0.37)).max() < 1e-6
    return vc.verify(solution)


@pytest.mark.parametrize("number", CASES)
def test_both_routes_agree_on_a_manufactured_extremal(number):
    check = verified(number)
    assert check.routes["Jacobi"] is not None
    assert check.routes["Jacobi"] == check.routes["Ritz"] == check.index
    assert check.verdict is (vc.Verdict.SADDLE if check.index else vc.Verdict.MINIMUM)


def extremal(number):
    case = Case(number)
    form = formulate(case.problem())
    solution = vc.Collocation().solve(form, tol=1e-10, guess=lambda x: np.transpose([*map(case.at, x)]))
    assert np.abs(solution.y(0.37) - case.at(0.37)).max() < 1e-6
    return solution.extremal


def test_the_manufactured_extremals_are_of_many_kinds():
    # by the cheaper of the two routes, and without the search for lower curves: above they agree
    indices = [index_by_ritz(extremal(number)).index for number in CASES]
    assert set(indices) >= set(range(6))
    assert indices.count(0) >= 5


def stationary(problem, guess=None):
    return vc.verify(vc.solve(problem, vc.Collocation(), guess=guess))


def both(check):
    assert check.routes["Jacobi"] == check.routes["Ritz"] == check.index
    return check.index


def swing(x, y, dy):
    return (dy**2 - y**2) / 2


@pytest.mark.parametrize("period", [2.0, 4.0, 7.0, 10.0, 20.0])
def test_periodic_ends(period):
    # the variations cos and sin of 2 pi k x/T lower the action as long as 2 pi k < T
    ends = vc.Periodic(0, period)
    problem = vc.Problem(lambda x, y, dy: swing(x, y, dy) + y * ca.cos(2 * math.pi * x / period), ends, ends)
    check = stationary(problem)
    assert both(check) == 1 + 2 * (math.ceil(period / (2 * math.pi)) - 1)
    assert any("concavity form" in finding.sentence for finding in check.findings)


def test_a_period_at_resonance_is_degenerate():
    ends = vc.Periodic(0, 2 * math.pi)
    assert stationary(vc.Problem(swing, ends, ends)).verdict is vc.Verdict.DEGENERATE


@pytest.mark.parametrize(("weight", "index"), [(0.1, 0), (1.0, 1)])
def test_unknown_numbers_vary_along(weight, index):
    # the best eta for a variation kappa of k is kappa (x - sinh x/sinh 1), which leaves 2 kappa^2 (c - weight) with
    # c the minimum of the integral of e'^2 + (e - x)^2, e(0) = e(1) = 0: coth 1 - 1 = 0.31 lies between the weights
    problem = vc.Problem(
        lambda x, y, dy, p: dy**2 + (y - p.k * x) ** 2 - weight * p.k**2,
        vc.Fixed(0, 0),
        vc.Fixed(1, 1),
        unknowns={"k": 0.3},
    )
    assert both(stationary(problem)) == index


@pytest.mark.parametrize("load", [9.8, 9.95, 39.4, 39.6])
def test_a_pinned_column_buckles_at_multiples_of_pi_squared(load):
    column = vc.Problem(lambda x, y, dy, ddy: (ddy**2 - load * dy**2) / 2, vc.Fixed(0, 0), vc.Fixed(1, 0), order=2)
    assert both(stationary(column)) == int(math.sqrt(load) / math.pi)


@pytest.mark.parametrize("load", [39.4, 39.6])
def test_a_clamped_column_buckles_at_4_pi_squared(load):
    column = vc.Problem(
        lambda x, y, dy, ddy: (ddy**2 - load * dy**2) / 2, vc.Fixed(0, 0, 0), vc.Fixed(1, 0, 0), order=2
    )
    assert both(stationary(column)) == int(load > 4 * math.pi**2)


def test_an_arc_of_more_than_a_circle_encloses_no_greatest_area():
    angle = 2.6 * math.pi

    def point(t):
        return [math.cos(angle * t), math.sin(angle * t)]

    arc = vc.Curve(
        lambda q, dq: (q[0] * dq[1] - q[1] * dq[0]) / 2,
        vc.At(point(0)),
        vc.At(point(1)),
        [vc.Isoperimetric(lambda q, dq: ca.norm_2(dq), angle)],
        maximise=True,
    )
    check = stationary(arc, point)
    # eta'' + eta = c with the integral of eta zero: the first conjugate point is after the full turn
    assert check.conjugate_points == pytest.approx([2 * math.pi / angle], abs=1e-10)
    assert both(check) == 1


def test_a_closed_circle_encloses_most_though_it_may_be_moved_about():
    circle = vc.Curve(
        lambda q, dq: (q[0] * dq[1] - q[1] * dq[0]) / 2,
        vc.Periodic(),
        vc.Periodic(),
        [vc.Isoperimetric(lambda q, dq: ca.norm_2(dq), 2 * math.pi)],
        maximise=True,
    )
    check = vc.verify(vc.solve(circle))
    assert (check.verdict, check.routes) == (vc.Verdict.MAXIMUM, {"Jacobi": 0, "Ritz": 0})


def test_waypoints_hold_the_curve():
    through = vc.Problem(swing, vc.Fixed(0, 0), vc.Fixed(5, 1), [vc.Through(2.5, 0.5)])
    assert both(stationary(through)) == 0
    late = vc.Problem(swing, vc.Fixed(0, 0), vc.Fixed(5, 1), [vc.Through(1.0, 0.5)])
    check = stationary(late)
    assert both(check) == 1
    assert check.conjugate_points == pytest.approx([1 + math.pi], abs=1e-10)


def test_an_end_on_a_circle_is_farthest_on_the_other_side():
    away = vc.Problem(
        lambda x, y, dy: ca.sqrt(1 + dy**2), vc.Fixed(-2, -0.6), vc.OnCurve(lambda x, y: x**2 + y**2 - 1, x=0.9)
    )
    check = stationary(away, lambda x: 0.3 * x)
    assert check.bound == pytest.approx(math.hypot(2, 0.6) + 1, abs=1e-9)
    assert both(check) == 1


def test_routes_that_disagree_are_no_minimum(monkeypatch):
    solution = vc.solve(vc.Problem(swing, vc.Fixed(0, 0), vc.Fixed(2, 1)))
    assert vc.verify(solution).verdict is vc.Verdict.MINIMUM
    monkeypatch.setattr(RitzHessian, "measure", lambda check, candidate: Index(1, 0, ""))
    check = vc.verify(solution)
    assert check.verdict is not vc.Verdict.MINIMUM
    assert any("disagree" in finding.sentence for finding in check.findings)
