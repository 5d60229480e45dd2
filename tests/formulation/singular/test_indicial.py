"""Ends at which L is singular in x beside its dependence on the slope."""

import casadi as ca
import numpy as np
import pytest
from mpmath import besseli, diff, gamma, mp, mpf, sqrt
from scipy.integrate import solve_bvp

import varcalc as vc
from varcalc.formulation.singular.indicial import Growth, SingularEnd, growth_of, infinite_at


def value_of(load, power, start):
    """y y' from end to end of y'' = load y / x^power, y(0) = start, y(1) = 1: DLMF 10.13.1 with modified functions."""
    nu = 1 / (2 - mpf(power))
    growing, falling = (
        lambda x, order=order: sqrt(x) * besseli(order, 2 * nu * sqrt(load) * x ** (1 / (2 * nu)))
        for order in (nu, -nu)
    )
    slope = (nu * sqrt(load)) ** nu / gamma(1 + nu)
    b = start * (nu * sqrt(load)) ** nu * gamma(1 - nu) if start else 0
    a = (1 - (b * falling(1) if start else 0)) / growing(1)
    return float(a * diff(growing, 1) + (b * diff(falling, 1) - a * slope if start else 0))


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize(("power", "start"), [(0.5, 1), (0.8, 1), (1 / 3, 1), (0.37, 1), (0.8, 0), (1.5, 0)])
def test_a_load_that_is_infinite_at_an_end(power, start, mirrored):
    ends = [vc.Fixed(0.7, start), vc.Fixed(1.7, 1)]
    low, sign = 0.7, 1
    if mirrored:
        ends, low, sign = [vc.Fixed(0.7, 1), vc.Fixed(1.7, start)], 1.7, -1
    solution = vc.solve(vc.Problem(lambda x, y, v: v**2 + 3 * y**2 / (sign * (x - low)) ** power, *ends))
    with mp.workdps(30):
        exact = value_of(3, power, start)
    assert abs(solution.value - exact) <= max(3 * solution.error.value, 1e-12)
    assert vc.verify(solution).verdict is vc.Verdict.MINIMUM


@pytest.mark.parametrize("share", [12.0, 2.0, 0.7, -0.1, -0.24])
def test_an_inverse_square(share):
    # y = x^e with e (e - 1) = share: the value is e
    problem = vc.Problem(lambda x, y, v: v**2 + share * y**2 / x**2, vc.Fixed(0, 0), vc.Fixed(1, 1))
    solution = vc.solve(problem)
    assert solution.value == pytest.approx(0.5 + np.sqrt(0.25 + share), abs=2e-10)
    assert vc.verify(solution).verdict is vc.Verdict.MINIMUM


@pytest.mark.parametrize("order", [0.3, 1, 2, 3.5])
def test_laplaces_equation_about_an_axis(order):
    problem = vc.Problem(lambda r, y, v: r * v**2 + order**2 * y**2 / r, vc.Fixed(0, 0), vc.Fixed(1, 1))
    solution = vc.solve(problem)
    assert solution.value == pytest.approx(order, abs=1e-12)
    check = vc.verify(solution)
    assert (check.verdict, check.index) == (vc.Verdict.MINIMUM, 0)


@pytest.mark.parametrize("share", [-0.26, -0.3, -1.0, -5.0])
@pytest.mark.parametrize("end", [0, 1])
def test_hardys_inequality_fails(share, end):
    problem = vc.Problem(lambda x, y, v: v**2 + share * y**2 / x**2, vc.Fixed(0, 0), vc.Fixed(1, end))
    refused = vc.solve(problem, throw=False)
    assert refused.verdict is vc.Verdict.UNBOUNDED
    assert "oscillate infinitely often next to x = 0" in refused.message


def test_variations_that_oscillate_at_an_end_leave_no_minimum():
    # y = 0 is stationary; beside it the fourth powers are nothing
    problem = vc.Problem(lambda x, y, v: v**2 - 0.3 * y**2 / x**2 + y**4, vc.Fixed(0, 0), vc.Fixed(1, 0))
    refused = vc.solve(problem, throw=False)
    assert not refused.status.ok
    assert vc.verify(refused).verdict is vc.Verdict.SADDLE


def test_thomas_and_fermis_atom():
    # the neutral atom: y'(0) = -1.58807102261137531 (Boyd, J. Comput. Appl. Math. 244, 2013); the end at 60
    # moves it by 3e-5
    atom = vc.Problem(lambda x, y, v: v**2 / 2 + 0.4 * y**2.5 / ca.sqrt(x), vc.Fixed(0, 1), vc.Fixed(60, 0))
    assert vc.solve(atom).dy(0.0) == pytest.approx(-1.588071, abs=1e-4)


def test_powers_of_what_a_curve_grows_with():
    def beside(*steps):
        return SingularEnd(0.0, 0.0, 0.0, steps)

    assert growth_of(1.0, beside(1.5)) == Growth(2, 2, fractional=2)
    assert growth_of(1.0, beside(1.7, 2.0)) == Growth(10, 10, fractional=10)
    assert growth_of(1.0, beside(1.2)) == Growth(5, 5, fractional=5)
    assert growth_of(1.0, beside(2.0)).plain
    leaves = growth_of(0.8872983346)
    assert leaves.layers > 0
    assert leaves.fractional * 0.8872983346 == pytest.approx(leaves.ordinate, rel=1e-15)


def growing(weight, load, power, tilt):
    """2 v' x^s at 1 and y(1) of the solution of (x^s y')' = c x^w y that begins with y = 1, or y = 0 where ``tilt``."""
    gap = mpf(power) + 2 - weight
    exponent = 1 - mpf(weight) if tilt else mpf(0)
    term, y, momentum = mpf(1), mpf(0), mpf(0)
    for _ in range(60):
        y, momentum = y + term, momentum + exponent * term
        exponent += gap
        term *= load / (exponent * (exponent + weight - 1))
    return y, momentum


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize(
    ("weight", "load", "power", "start"),
    [(-0.4424, 1.7, -0.9086, -0.77), (0.9731, 2.5, -0.4035, 0), (0.6696, 1.2, -0.8458, 0.7), (-0.7345, 2, -2.2346, 0)],
)
def test_powers_that_are_no_fractions(weight, load, power, start, mirrored):
    at, sign = (1.0, -1) if mirrored else (0.0, 1)
    ends = [vc.Fixed(0.0, start), vc.Fixed(1.0, 1)] if not mirrored else [vc.Fixed(0.0, 1), vc.Fixed(1.0, start)]

    def lagrangian(x, y, v):
        from_end = sign * (x - at)
        return from_end**weight * v**2 + load * from_end**power * y**2

    solution = vc.solve(vc.Problem(lagrangian, *ends))
    with mp.workdps(30):
        (y, steep), (level, rises) = (growing(weight, load, power, tilt) for tilt in (True, False)) if start else (
            growing(weight, load, power, True), (0, 0))  # fmt: skip
        share = (1 - start * level) / y
        exact = float(share * steep + start * rises - start * share * (1 - mpf(weight)))
    assert solution.value == pytest.approx(exact, rel=1e-10)


@pytest.mark.parametrize(
    ("weight", "load", "power"), [(-0.4315, 2.4, -0.8565), (0.0155, 2.9, -0.6156), (0.4, 1.2, 0.7)]
)
def test_a_free_end_where_powers_are_no_fractions(weight, load, power):
    problem = vc.Problem(lambda x, y, v: x**weight * v**2 + load * x**power * y**2, vc.Free(0), vc.Fixed(1, 1))
    with mp.workdps(30):
        y, steep = growing(weight, load, power, False)
    assert vc.solve(problem).value == pytest.approx(float(steep / y), rel=1e-10)


@pytest.mark.parametrize("pull", [0.0, -1.5])
def test_a_free_end_that_an_inverse_square_holds(pull):
    # x^s (y'^2 + c y^2 / x^2) + k y x^q: y = a x^m + b x^e
    s, c, q = 0.142, 1.246, -0.771
    problem = vc.Problem(lambda x, y, v: x**s * (v**2 + c * y**2 / x**2) + pull * y * x**q, vc.Free(0), vc.Fixed(1, 1))
    m, e = q + 2 - s, 0.5 * (1 - s) + np.sqrt(0.25 * (1 - s) ** 2 + c)
    a = 0.5 * pull / (m * (m + s - 1) - c)
    b = 1 - a
    exact = m * a + e * b + 0.5 * pull * (a / (m + q + 1) + b / (e + q + 1))
    assert vc.solve(problem).value == pytest.approx(exact, abs=2e-10)


@pytest.mark.parametrize("lagrangian", [
    lambda x, y, v: v**2 + 2 * y**2 / x**2,
    lambda x, y, v: x**0.3 * v**2 + y**2 / x,
    lambda x, y, v: v**2 + (y - 1) ** 2 / x**1.3,
])  # fmt: skip
def test_an_ordinate_at_which_every_curve_has_an_infinite_value(lagrangian):
    solution = vc.solve(vc.Problem(lagrangian, vc.Fixed(0, 0.5), vc.Fixed(1, 1)), throw=False)
    assert solution.verdict is vc.Verdict.INFEASIBLE
    assert "infinite for every curve" in solution.message


def test_a_curve_that_follows_what_l_holds_has_a_finite_value():
    # along y = 1 + sqrt(x) L is 1 / (4 x^0.7) alone; at y = 1 it is like 1 / x^1.2
    def lagrangian(x, y, v):
        return x**0.3 * v**2 + (y - 1 - ca.sqrt(x)) ** 2 / x**2.2

    assert infinite_at(vc.Problem(lagrangian, vc.Fixed(0, 1), vc.Fixed(1, 2))) is None
    assert infinite_at(vc.Problem(lagrangian, vc.Fixed(0, 0.5), vc.Fixed(1, 2))) == "start"


def in_root(right, ends, unknowns=()):
    """The value by collocation in t = sqrt(x), in which y'' = 3 y / sqrt(x) + ... is regular: states y, y', area, J."""
    t = np.linspace(0, 1, 100)
    start = np.array([1 + 0 * t, 0 * t, t**2 / 2, t])
    return solve_bvp(right, ends, t, start, p=unknowns or None, tol=1e-11, max_nodes=100000).y[3, -1]


def test_such_a_load_where_the_area_is_prescribed_or_the_other_end_free():
    def right(t, u, p=(0.0,)):
        y, v = u[:2]
        return np.array([2 * t * v, 6 * y + p[0] * t, 2 * t * y, 2 * t * v**2 + 6 * y**2])

    def loaded(end, *conditions):
        return vc.solve(vc.Problem(lambda x, y, v: v**2 + 3 * y**2 / ca.sqrt(x), vc.Fixed(0, 1), end, conditions))

    level = in_root(right, lambda a, b, _: np.array([a[0] - 1, b[0] - 1, a[2], b[2] - 0.5, a[3]]), [0.0])
    area = vc.Isoperimetric(lambda x, y, v: y, 0.5)
    assert loaded(vc.Fixed(1, 1), area).value == pytest.approx(level, abs=1e-11)
    free = in_root(right, lambda a, b: np.array([a[0] - 1, b[1], a[2], a[3]]))
    assert loaded(vc.Free(1)).value == pytest.approx(free, abs=1e-11)
    bounded = loaded(vc.Fixed(1, 1), vc.Bound(lambda x, y, v: y, lower=0.75))
    assert bounded.status.ok
    assert float(bounded.y(np.linspace(0, 1, 201)).min()) >= 0.75 - 1e-8
