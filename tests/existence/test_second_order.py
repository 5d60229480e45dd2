"""Other valleys of functionals of second order, against the least of many polynomials: curves that are admitted."""

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import minimize

import varcalc as vc

DEGREE = 7
STARTS = 24


def least_polynomial(problem, ends):
    """The least of what polynomials sum that keep what ``ends`` (2, 2, n) give of y and y', no number where free."""
    a, b = problem.span
    nodes, weights = np.polynomial.legendre.leggauss(60)
    x, weights = a + (b - a) * (1 + nodes) / 2, (b - a) * weights / 2
    n = ends.shape[2]
    bases = [np.polynomial.Polynomial.basis(k, domain=[a, b]) for k in range(DEGREE + 1)]
    rows = [np.array([base.deriv(k)(x) if k else base(x) for base in bases]) for k in range(3)]
    given = [
        (i, x0, k, v) for i, x0 in enumerate((a, b)) for k in (0, 1) for v in [ends[i, k]] if not np.isnan(v).any()
    ]
    held = np.array([[base.deriv(k)(x0) if k else base(x0) for base in bases] for _, x0, k, _ in given])
    own = np.linalg.lstsq(held, np.array([v for *_, v in given]), rcond=None)[0]
    free = np.linalg.svd(held)[2][len(given) :]

    def value(numbers):
        coefficients = own + free.T @ numbers.reshape(len(free), n)
        y, v, w = (coefficients.T @ row for row in rows)
        return float(np.asarray(problem.integrand_values(x, y, v, ddy=w)) @ weights)

    random = np.random.default_rng(3)
    starts = [scale * random.normal(size=len(free) * n) for scale in np.linspace(0, 3, STARTS)]
    return min(minimize(value, start, method="BFGS").fun for start in starts)


def turned_by_its_load(x, y, v, w):
    """A strut that its thrust bends, up or down: the load, which changes with y, tells which is less."""
    return 0.15 * w**2 - (0.9 + 0.4 * ca.sin(y + x)) * v**2 / 2 + v**4 / 8 + 0.8 * ca.sin(2.2 * y) + y**2 / 2


def two_slopes(x, y, v, w):
    """Two slopes are cheapest, and the way down is."""
    return 0.15 * w**2 + (v**2 - 1) ** 2 / 4 + 0.8 * y + 0.6 * ca.exp(-((y / 0.4) ** 2))


def hill(x, y, v, w):
    """A hill beside the curve, beyond which it is lower and lower."""
    return w**2 / 20 + v**2 / 2 + 3 * ca.exp(-(((y - 0.7) / 0.3) ** 2)) - 1.2 * y


def stiff(x, y, v, w):
    """Waves of the load that a stiff rod just follows."""
    return 0.15 * w**2 - 0.7 * y - 2.7 * ca.sin(3.4 * y + 0.3 * x) + 0.5 * ca.tanh(4 * (y - 0.4))


def wells_of_two(x, y, v, w):
    """A well of two functions that lies along none of the directions of the axes alone."""
    return 0.05 * ca.sumsqr(w) + ca.sumsqr(v) / 2 - 6 * ca.exp(-((y[0] - 1.2) ** 2 + (y[1] + 0.9) ** 2) / 0.2)


CASES = {
    "a strut": (turned_by_its_load, 1.0, [0.24], [0.7], None),
    "slopes": (two_slopes, 2.0, [0.1], [0.6], None),
    "a hill": (hill, 3.0, [0.0], [0.0], None),
    "a stiff rod": (stiff, 1.0, [0.166], [-0.98], None),
    "two functions": (wells_of_two, 3.0, [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]),
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("mirrored", [False, True])
def test_no_polynomial_is_lower(name, mirrored):
    lagrangian, length, start, slope, end = CASES[name]
    sign = -1 if mirrored else 1
    n = len(start)
    plain = (lambda v: v) if n > 1 else (lambda v: v[0])
    ends = np.full((2, 2, n), np.nan)
    ends[0] = sign * np.array([start, slope])
    last = vc.Free(length)
    if end is not None:
        ends[1] = np.zeros((2, n))
        last = vc.Fixed(length, plain(end), dy=plain(end))
    problem = vc.Problem(
        lambda x, y, v, w: lagrangian(x, sign * y, sign * v, sign * w),
        vc.Fixed(0, plain(ends[0, 0].tolist()), dy=plain(ends[0, 1].tolist())), last, order=2,
    )  # fmt: skip
    found = vc.solve(problem)
    known = least_polynomial(problem, ends)
    assert found.value < known + 1e-6 * abs(known)
    assert not found.local
    assert "departures and slopes" in found.searched


def test_what_falls_for_ever_is_not_called_least():
    """The sine of 3 y^2 turns ever faster, and -y^2 v^2 pays for any bend: there is no least value."""
    problem = vc.Problem(
        lambda x, y, v, w: w**2 / 20 - y**2 * v**2 + 2 * y**2, vc.Fixed(0, 0.1, dy=0), vc.Free(1), order=2
    )
    found = vc.solve(problem, throw=False)
    assert not found.status.ok or found.local


@pytest.mark.parametrize("above", [1.01, 1.05, 1.5])
def test_a_strut_that_gives_way_far_out_has_no_least_value(above):
    """Beyond Euler's load, 0.3 (pi/2)^2 here, sines of a quarter turn lead down for ever; near rest a load holds it."""
    thrust = above * 0.3 * (np.pi / 2) ** 2
    problem = vc.Problem(
        lambda x, y, v, w: 0.15 * w**2 - thrust * v**2 / 2 + 3 * (1 - ca.cos(y)), vc.Fixed(0, 0, dy=0), vc.Free(1),
        order=2,
    )  # fmt: skip
    found = vc.solve(problem, throw=False)
    assert found.verdict is vc.Verdict.UNBOUNDED or found.lower == -np.inf


@pytest.mark.parametrize("rest", [lambda y, v: y**2, lambda y, v: y**2 + v**2])
def test_bends_that_alternate_are_not_ruled_out(rest):
    """Of (y''² - 1)² + y² finer and finer alternation comes to 0, which no curve attains."""
    problem = vc.Problem(lambda x, y, v, w: (w**2 - 1) ** 2 + rest(y, v), vc.Fixed(0, 0), vc.Fixed(1, 0), order=2)
    solution = vc.solve(problem, throw=False)
    assert not solution.status.ok or solution.local


def test_a_loose_tolerance_does_not_hide_what_is_narrow():
    """Of v² g / 2 with a dip of g the value is rise² / 2 by the integral of 1 / g; a tolerance of 0.01 hid the dip."""
    g = lambda x, exp: 1 - 0.999 * exp(-(((x - 1.7) / 0.001) ** 2))  # noqa: E731
    problem = vc.Problem(lambda x, y, v: v**2 / 2 * g(x, ca.exp), vc.Fixed(0, 0), vc.Fixed(4, 3))
    x = np.unique(np.concatenate([np.linspace(0, 4, 4001), 1.7 + 0.001 * np.linspace(-8, 8, 400001)]))
    middle, h = 0.5 * (x[1:] + x[:-1]), np.diff(x)
    value = 4.5 / float((h / g(middle, np.exp)).sum())
    solution = vc.solve(problem, tol=1e-2)
    assert solution.value == pytest.approx(value, rel=1e-6)
