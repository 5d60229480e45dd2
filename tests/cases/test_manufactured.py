"""Extremals of one's own choosing: L + s(x) y with s = d/dx L_v - L_y along y* has y*, and the index stays."""

import math

import casadi as ca
import mpmath as mp
import numpy as np
import pytest
import scipy.integrate

import varcalc as vc

SPAN = (0.0, 1.0)


def derivatives(curve, order):
    x = ca.SX.sym("x")
    along = [curve(x)]
    for _ in range(order):
        along.append(ca.jacobian(along[-1], x))
    return x, along


def source(lagrangian, curve, order=1):
    """s(x) = d/dx L_v - L_y, at second order less d^2/dx^2 L_w."""
    x, along = derivatives(curve, order)
    symbols = [ca.SX.sym(name) for name in "yvw"[: order + 1]]
    L = lagrangian(x, *symbols)
    y, v, *w = [ca.substitute([ca.gradient(L, s)], symbols, along)[0] for s in symbols]
    s = ca.jacobian(v, x) - y - sum(ca.jacobian(ca.jacobian(bend, x), x) for bend in w)
    return ca.Function("s", [x], [s])


def manufactured(lagrangian, curve, order=1, span=SPAN, slopes=False):
    """The problem that has the extremal, and its value by Gauss's rule."""
    s = source(lagrangian, curve, order)
    x, along = derivatives(curve, order)
    at = ca.Function("y", [x], along)
    ends = [[float(v) for v in at(end)[: 2 if slopes else 1]] for end in span]
    problem = vc.Problem(
        lambda x, y, *rest: lagrangian(x, y, *rest) + s(x) * y,
        *(vc.Fixed(x, *end) for x, end in zip(span, ends, strict=True)), order=order,
    )  # fmt: skip
    nodes, weights = np.polynomial.legendre.leggauss(80)
    half = (span[1] - span[0]) / 2
    integrand = ca.Function("F", [x], [lagrangian(x, *along) + s(x) * along[0]])
    value = half * float(weights @ np.array([float(integrand(span[0] + half * (1 + t))) for t in nodes]))
    return problem, value, lambda x: np.array([float(at(t)[0]) for t in np.ravel(x)])


def optical(x, y, v):
    return ca.sqrt(1 + v**2) * (2 + ca.sin(3 * y))


def wavy(x):
    return x / 2 + 0.2 * ca.sin(3 * x) + 0.1 * ca.exp(x)


@pytest.fixture(scope="module")
def ray():
    return manufactured(optical, wavy)


@pytest.mark.parametrize("method", [None, vc.Ritz(optimiser=vc.Ipopt()), vc.Collocation(), vc.Shooting()], ids=repr)
def test_the_chosen_curve_is_found(ray, method):
    problem, value, curve = ray
    solution = vc.solve(problem, method)
    assert abs(solution.value - value) <= 10 * solution.error.value + 1e-15 <= 1e-9
    x = np.linspace(*SPAN, 21)
    assert solution.y(x) == pytest.approx(curve(x), abs=1e-5)
    assert vc.verify(solution).verdict is vc.Verdict.MINIMUM


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_the_value_of_a_kept_mesh_is_of_twice_the_degrees_order(ray, degree):
    problem, value, _ = ray
    solved = [vc.solve(problem, vc.Ritz(elements=n, degree=degree, refine=False)) for n in (4, 8, 16)]
    misses = np.array([s.value - value for s in solved])
    assert np.all(misses > 0)  # an upper bound
    assert np.log2(misses[:-1] / misses[1:]) == pytest.approx(2 * degree, abs=0.5)
    claims = np.array([s.error.value for s in solved])
    assert np.all(misses <= claims)
    assert np.all(claims <= 100 * misses)


def test_the_curve_of_a_kept_mesh_is_of_the_degree_and_one(ray):
    problem, _, curve = ray
    x = np.linspace(*SPAN, 201)
    misses = [
        np.abs(vc.solve(problem, vc.Ritz(elements=n, degree=2, refine=False)).y(x) - curve(x)).max() for n in (4, 8, 16)
    ]
    assert np.log2(np.array(misses[:-1]) / misses[1:]) == pytest.approx(3, abs=0.5)


@pytest.mark.parametrize(("stiffness", "index"), [(2.0, 0), (3.0, 0), (4.0, 1), (7.0, 2), (10.0, 3)])
def test_the_index_is_that_of_the_lagrangian_without_source(stiffness, index):
    # u'' + k^2 u = 0: conjugate at m pi/k
    problem, value, curve = manufactured(lambda x, y, v: (v**2 - stiffness**2 * y**2) / 2, wavy)
    solution = vc.solve(problem, vc.Collocation(), throw=False)
    assert abs(solution.value - value) <= 10 * solution.error.value <= 1e-8
    x = np.linspace(*SPAN, 21)
    # an end near a conjugate point magnifies what the equation leaves: the curve is as good as it claims
    assert np.abs(solution.y(x) - curve(x)).max() <= 10 * solution.error.curve <= 1e-3
    check = vc.verify(solution)
    assert check.index == index
    assert check.verdict is (vc.Verdict.SADDLE if index else vc.Verdict.MINIMUM)
    places = [float(m * mp.pi / stiffness) for m in range(1, index + 1)]
    assert check.conjugate_points == pytest.approx(places, abs=1e-9)
    if index:
        assert vc.solve(problem, throw=False).verdict is vc.Verdict.UNBOUNDED


@pytest.mark.parametrize("strength", [5.0, 15.0])
def test_conjugate_points_of_a_curve_on_which_nothing_is_constant(strength):
    problem, value, curve = manufactured(lambda x, y, v: v**2 / 2 - strength * ca.exp(y), wavy)
    solution = vc.solve(problem, vc.Collocation(), guess=lambda x: float(curve(x)[0]), throw=False)
    assert solution.value == pytest.approx(value, abs=1e-9)

    # Jacobi: u'' + strength exp(y*) u = 0, u(0) = 0
    def jacobi(x, u):
        return [u[1], -strength * math.exp(curve(x)[0]) * u[0]]

    def crossing(x, u):
        return u[0] if x > 1e-6 else 1.0

    flow = scipy.integrate.solve_ivp(jacobi, SPAN, [0.0, 1.0], events=crossing, rtol=1e-11, atol=1e-13, method="DOP853")
    places = flow.t_events[0]
    check = vc.verify(solution)
    assert check.index == len(places)
    assert check.conjugate_points == pytest.approx(places, abs=1e-8)


@pytest.mark.parametrize(("share", "index"), [(3.9, 0), (4.1, 1), (8.3, 2)])
def test_second_order(share, index):
    # a clamped rod: 4 pi^2 is the first load, tan(k/2) = k/2 the second, at 8.18 pi^2
    load = share * float(mp.pi**2)
    problem, value, curve = manufactured(lambda x, y, v, w: (w**2 - load * v**2) / 2, wavy, order=2, slopes=True)
    solution = vc.solve(problem, vc.Collocation(), throw=False)
    assert solution.value == pytest.approx(value, abs=1e-8)
    x = np.linspace(*SPAN, 21)
    assert solution.y(x) == pytest.approx(curve(x), abs=1e-6)
    assert vc.verify(solution).index == index
    if not index:
        assert abs(vc.solve(problem).value - value) <= 1e-9


def test_extremals_finds_the_chosen_curve(ray):
    problem, value, _ = ray
    found = vc.extremals(problem)
    assert min(abs(s.value - value) for s in found) < 1e-12
