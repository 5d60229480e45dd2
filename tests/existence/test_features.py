"""What is narrow off the known curve: spots, gates in walls and walls one can go round; numbers in other valleys."""

from functools import cache
from itertools import pairwise

import casadi as ca
import numpy as np
import pytest

import varcalc as vc
from varcalc.existence.features import features
from varcalc.problem.breaks import uneven


def gaussian(u, width):
    return ca.exp(-((u / width) ** 2))


def polygon(L, points, cuts=()):
    """What a polygon sums, by Gauss's rule on many panels of every side."""
    nodes, weights = np.polynomial.legendre.leggauss(24)
    total = 0.0
    for (a, c), (b, d) in pairwise(points):
        edges = np.unique(np.concatenate([np.linspace(a, b, 65), [x for x in cuts if a < x < b]]))
        half = 0.5 * np.diff(edges)[:, None]
        x = (edges[:-1, None] + half * (1 + nodes)).ravel()
        slope = (d - c) / (b - a)
        values = L(x, c + slope * (x - a), slope)
        total += float(np.broadcast_to(values, x.shape) @ (half * weights).ravel())
    return total


@pytest.mark.parametrize(("place", "widths"), [((0.63, -0.31), (0.0054, 0.069)), ((0.4994, 0.142), (0.0035, 0.0056))])
def test_a_spot_off_the_curve_is_found(place, widths):
    (a, b), (w, h) = place, widths
    depth = 0.7 * (b**2 * (1 / a + 1 / (1 - a))) / (np.sqrt(np.pi) * w) + 100

    def L(x, y, v):
        return v**2 - depth * gaussian(x - a, w) * gaussian(y - b, h)

    through = polygon(
        lambda x, y, v: v**2 - depth * np.exp(-(((x - a) / w) ** 2) - ((y - b) / h) ** 2), [(0, 0), (a, b), (1, 0)],
        np.linspace(a - 6 * w, a + 6 * w, 40),
    )  # fmt: skip
    solution = vc.solve(vc.Problem(L, vc.Fixed(0, 0), vc.Fixed(1, 0)))
    assert through < 0
    assert solution.value < through
    assert not solution.local


@pytest.mark.parametrize(
    ("x0", "w", "y0", "g", "height"), [(0.5, 0.01, 0.6, 0.05, 400), (0.37, 0.003, -0.8, 0.02, 1200)]
)
def test_a_gate_in_a_wall_is_gone_through(x0, w, y0, g, height):
    def L(x, y, v):
        return v**2 + height * gaussian(x - x0, w) * (1 - gaussian(y - y0, g))

    d = 2.4 * w
    through = polygon(
        lambda x, y, v: v**2 + height * np.exp(-(((x - x0) / w) ** 2)) * (1 - np.exp(-(((y - y0) / g) ** 2))),
        [(0, 0), (x0 - d, y0), (x0 + d, y0), (1, 0)],
        np.linspace(x0 - 6 * w, x0 + 6 * w, 60),
    )
    solution = vc.solve(vc.Problem(L, vc.Fixed(0, 0), vc.Fixed(1, 0)))
    assert solution.value < through
    assert not solution.local


@cache
def round_a_wall(*, two_sided):
    """The least curve; the wall is a tenth of the interval wide, its height and its edge are parameters."""
    return vc.solve(
        vc.Problem(
            lambda x, y, v, p: v**2
            + 20 * p.s * ca.logic_and(ca.fabs(x - 0.5) < 0.05, (ca.fabs(y) if two_sided else y) < p.h),
            vc.Fixed(0, 0), vc.Fixed(1, 0), parameters={"h": 0.6, "s": 1.0},
        )
    )  # fmt: skip


@pytest.mark.parametrize("two_sided", [False, True])
def test_the_least_curve_goes_round_a_wall(two_sided):
    """Round it costs 1.6, through it 2."""
    solution = round_a_wall(two_sided=two_sided)
    assert solution.value == pytest.approx(2 * 0.6**2 / 0.45, rel=1e-10)
    assert not solution.local


@pytest.mark.parametrize("unit", [1e-8, 1e-4, 3.0, 10.0, 1e4, 1e8])
def test_a_wall_is_as_high_in_other_units(unit):
    wall = lambda x, y: ca.logic_and(ca.fabs(x - 0.5) < 0.05, y / unit < 0.6)  # noqa: E731
    solution = vc.solve(vc.Problem(lambda x, y, v: (v / unit) ** 2 + 20 * wall(x, y), vc.Fixed(0, 0), vc.Fixed(1, 0)))
    assert solution.value == pytest.approx(2 * 0.6**2 / 0.45, rel=1e-10)


def test_what_moves_a_wall_has_no_known_rate():
    rates = round_a_wall(two_sided=False).sensitivities
    assert np.isnan(rates["h"])
    assert rates["s"] == pytest.approx(0.0, abs=1e-12)


def test_the_shortest_way_goes_round_what_is_hardly_passed():
    """Index 201 where |x - 1/2| < 1/100 and y < 9/10: two lines to the corners, and one along the top."""
    dense = lambda x, y: ca.logic_and(ca.fabs(x - 0.5) < 0.01, y < 0.9)  # noqa: E731
    problem = vc.Problem(lambda x, y, v: (1 + 200 * dense(x, y)) * ca.sqrt(1 + v**2), vc.Fixed(0, 0), vc.Fixed(1, 0))
    solution = vc.solve(problem)
    assert solution.value == pytest.approx(2 * np.hypot(0.49, 0.9) + 0.02, rel=1e-10)
    assert not solution.local


def test_a_closed_curve_is_shifted_into_a_narrow_well():
    problem = vc.Problem(
        lambda x, y, v: v**2 - 2 * gaussian(y - 3.3, 0.01) + 0.01 * y**2, vc.Periodic(0, 1), vc.Periodic(0, 1)
    )
    # a little below 3.3 the well has its bottom: the line there is the least of all
    y = 3.3 - np.linspace(0, 1e-4, 200001)
    least = float(np.min(-2 * np.exp(-(((y - 3.3) / 0.01) ** 2)) + 0.01 * y**2))
    assert vc.solve(problem).value == pytest.approx(least, rel=1e-11)


def test_what_is_smooth_has_no_features():
    for L in (lambda x, y, v: v**2 + ca.sin(3 * x) * y, lambda x, y, v: ca.sqrt((1 + v**2) / (y + 2))):
        problem = vc.Problem(L, vc.Fixed(0, 0), vc.Fixed(1, 1))
        assert not uneven(problem) or not len(features(problem).rows)


@pytest.mark.parametrize(("L", "guess", "value"), [
    # (k² - 1)² + k/10 has its other minimum at -1.0124
    (lambda x, y, v, p: v**2 + (p.k**2 - 1) ** 2 + 0.1 * p.k, 0.8, None),
    (lambda x, y, v, p: 0.01 * v**2 + (ca.sin(7 * x) - ca.sin(p.k * x)) ** 2 + y**2, 2.0, 0.0),
], ids=["wells", "frequency"])  # fmt: skip
def test_other_values_of_a_number_are_looked_at(L, guess, value):
    end = 1.0 if value is None else 0.0
    if value is None:
        roots = np.roots([4, 0, -4, 0.1])
        value = 1 + min((k**2 - 1) ** 2 + 0.1 * k for k in roots.real)
    solution = vc.solve(vc.Problem(L, vc.Fixed(0, 0), vc.Fixed(1, end), unknowns={"k": guess}))
    assert solution.value == pytest.approx(value, abs=1e-12)
    assert "unknown numbers" in solution.searched


def test_a_curve_that_goes_along_with_its_number_is_found():
    """y'²/2 + (y - k)²/2 - k²/2 + k⁴/10 + k/20: with the curve at rest k has one valley, and with it two."""
    problem = vc.Problem(
        lambda x, y, v, p: v**2 / 2 + (y - p.k) ** 2 / 2 - p.k**2 / 2 + 0.1 * p.k**4 + 0.05 * p.k,
        vc.Fixed(0, 0), vc.Fixed(2, 0), unknowns={"k": 1.0},
    )  # fmt: skip
    # of the curve k (1 - cosh(x - 1) / cosh 1) the spring keeps k²/2 times the integral of cosh(x - 1) / cosh 1
    k = np.linspace(-3, 3, 2000001)
    least = np.min(k**2 * np.tanh(1) - k**2 + 0.2 * k**4 + 0.1 * k)
    assert vc.solve(problem).value == pytest.approx(float(least), rel=1e-9)


def test_a_functional_that_falls_by_an_exponential_is_told_to():
    solution = vc.solve(vc.Problem(lambda x, y, v: v**2 - ca.exp(0.01 * y), vc.Fixed(0, 0), vc.Fixed(1, 0)))
    assert solution.local
    assert "unbounded" in solution.message
