"""Other valleys where no lattice holds all curves: beside conditions, of several functions, of curves that bend."""

import math

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import minimize

import varcalc as vc
from varcalc.existence.together import AlongAxes

LENGTH = 20.0


def wells(y):
    """Two wells, of which the one about -1 is the deeper."""
    return (y**2 - 1) ** 2 + 0.3 * y


def action(x, y, v):
    return v**2 / 2 + wells(y)


def through_the_deeper_well(lagrangian, height, length=LENGTH):
    """The least value among curves that go from 1 to the deeper well, rest there, and come to ``height`` at the end."""
    x = (np.arange(20_000) + 0.5) * length / 20_000

    def value(width):
        first, last = 2 * np.exp(-x / width), (height + 1) * np.exp((x - length) / width)
        return lagrangian(x, first + last - 1, (last - first) / width, (first + last) / width**2).mean() * length

    return min(map(value, np.geomspace(0.2, 2, 20)))


ENDS = vc.Fixed(0, 1), vc.Fixed(LENGTH, 1)
LONE = {
    "a bound": lambda: vc.Problem(action, *ENDS, [vc.Bound(lambda x, y, v: y, upper=3)]),
    "a level": lambda: vc.Problem(action, *ENDS, [vc.Isoperimetric(lambda x, y, v: v**2, upper=30)]),
    "two functions": lambda: vc.Problem(
        lambda x, y, v: ca.sumsqr(v) / 2 + wells(y[0]) + y[1] ** 2 / 2, vc.Fixed(0, [1, 0]), vc.Fixed(LENGTH, [1, 0])
    ),
    "an end that slides": lambda: vc.Problem(
        action, ENDS[0], vc.OnCurve(lambda x, y: y - 1 + 1e3 * (x - LENGTH), x=LENGTH)
    ),
}


@pytest.mark.parametrize("name", LONE)
def test_a_deeper_well_is_followed_beside(name):
    found = vc.solve(LONE[name]())
    assert found.value < through_the_deeper_well(lambda x, y, v, w: action(x, y, v), 1) + 0.02
    assert not found.local
    assert "other valley" in found.searched


def test_a_deeper_well_is_followed_at_second_order():
    bent = vc.Problem(lambda x, y, v, w: w**2 / 2 + wells(y), vc.Fixed(0, 1, 0), vc.Fixed(LENGTH, 1, 0), order=2)
    x = (np.arange(20_000) + 0.5) * LENGTH / 20_000

    def value(width):
        """The curve that passes into the deeper well and back by cubics of a width."""
        s = np.minimum(np.minimum(x, LENGTH - x) / width, 1)
        return ((6 * (2 * s - 1) * 2 / width**2 * (s < 1)) ** 2 / 2 + wells(1 - 2 * s**2 * (3 - 2 * s))).mean() * LENGTH

    found = vc.solve(bent)
    assert found.value < min(map(value, np.linspace(1, 5, 40)))
    assert not found.local
    assert "curves of cubic pieces through a box of departures and slopes" in found.searched


def test_an_end_goes_where_its_cost_is_least():
    """Along straight lines to the end y the functional is y^2/2 + cost(y)."""
    priced = vc.Problem(
        lambda x, y, v: v**2 / 2, vc.Fixed(0, 0), vc.Free(1),
        end_cost=lambda x0, y0, x1, y1: -3 * ca.exp(-(((y1 - 2) / 0.3) ** 2)),
    )  # fmt: skip
    y = np.linspace(1.5, 2.5, 1_000_001)
    assert vc.solve(priced).value == pytest.approx((y**2 / 2 - 3 * np.exp(-(((y - 2) / 0.3) ** 2))).min(), rel=1e-9)


def test_a_waypoint_holds_the_curve_and_the_way_before_it_finds_its_well():
    passing = vc.Problem(action, vc.Fixed(0, 1), vc.Fixed(2 * LENGTH, 1), [vc.Through(LENGTH, 1)])
    found = vc.solve(passing)
    assert found.value < 2 * through_the_deeper_well(lambda x, y, v, w: action(x, y, v), 1)
    assert found.curve(np.array([LENGTH]), 0)[0, 0] == pytest.approx(1, abs=1e-9)


def test_waypoints_hold_several_functions_and_each_finds_its_well():
    passing = vc.Problem(
        lambda x, y, v: ca.sumsqr(v) / 2 + wells(y[0]) + wells(y[1]),
        vc.Fixed(0, [1, 1]), vc.Fixed(2 * LENGTH, [1, 1]), [vc.Through(LENGTH, [0, 1])],
    )  # fmt: skip
    found = vc.solve(passing)
    single = [through_the_deeper_well(lambda x, y, v, w: action(x, y, v), height) for height in (0, 1)]
    assert found.value < 2 * sum(single)  # to the waypoint, and the same way back
    assert not found.local


@pytest.mark.parametrize(("count", "length"), [(9, 12.0), (10, 16.0)])
def test_each_of_many_functions_finds_its_well(count, length):
    """So short a way that one alone would rather stay with the others: together all go over."""
    chain = vc.Problem(
        lambda x, y, v: ca.sumsqr(v) / 2 + sum(wells(y[k]) for k in range(count)) + ca.sumsqr(y[1:] - y[:-1]) / 10,
        vc.Fixed(0, [1] * count), vc.Fixed(length, [1] * count),
    )  # fmt: skip
    found = vc.solve(chain)
    assert found.value < count * through_the_deeper_well(lambda x, y, v, w: action(x, y, v), 1, length)
    assert not found.local


@pytest.mark.parametrize("tilt", [0.3, -0.1])
def test_a_closed_curve_rests_in_the_deepest_well(tilt):
    closed = vc.Problem(
        lambda x, y, v: v**2 / 2 + (y**2 - 1) ** 2 + tilt * y, vc.Periodic(0, LENGTH), vc.Periodic(0, LENGTH)
    )
    roots = np.roots([4, 0, -4, tilt])
    assert vc.solve(closed).value == pytest.approx(LENGTH * min(((roots**2 - 1) ** 2 + tilt * roots).real), rel=1e-9)


def hills(seed, dimension):
    rng = np.random.default_rng(seed)
    return [
        (rng.uniform(0.5, 3.5), rng.uniform(-1, 1, dimension), rng.uniform(-3, 3), rng.uniform(0.3, 0.8))
        for _ in range(6)
    ]


def least_by_many_starts(landscape, dimension, bound, pieces=64, starts=24):
    """The least of polygons that are descended to from random curves, by the midpoint rule."""
    x = np.linspace(0, 4, pieces + 1)
    step, middle, rng = x[1], 0.5 * (x[1:] + x[:-1]), np.random.default_rng(1)

    def value(free):
        y = np.vstack([np.zeros(dimension), free.reshape(-1, dimension), np.zeros(dimension)])
        slopes, centres = np.diff(y, axis=0) / step, 0.5 * (y[1:] + y[:-1])
        total, gradient = 0.5 * step * (slopes**2).sum(), np.diff(-slopes, axis=0)
        for a, b, height, width in landscape:
            hill = height * np.exp(-((middle - a) ** 2 + ((centres - b) ** 2).sum(1)) / width**2)
            total += step * hill.sum()
            pull = -step / width**2 * (centres - b) * hill[:, None]
            gradient = gradient + pull[1:] + pull[:-1]
        return total, gradient.ravel()

    best = math.inf
    for _ in range(starts):
        waves = sum(rng.normal(0, 1.2 / k, dimension) * np.sin(math.pi * k * x[1:-1, None] / 4) for k in range(1, 5))
        first = np.clip(waves, -bound, bound).ravel()
        found = minimize(value, first, jac=True, method="L-BFGS-B", bounds=[(-bound, bound)] * len(first))
        best = min(best, found.fun)
    return best


@pytest.mark.parametrize(("count", "seed"), [(2, 1), (2, 4), (2, 106), (3, 103), (3, 111)])
def test_random_landscapes_of_several_functions(count, seed):
    """Of the last ones the valley lies between the axes, their sums and differences."""
    landscape = hills(seed, count)

    def lagrangian(x, y, v):
        heights = [h * ca.exp(-((x - a) ** 2 + ca.sumsqr(y - b)) / w**2) for a, b, h, w in landscape]
        return ca.sumsqr(v) / 2 + sum(heights)

    found = vc.solve(vc.Problem(lagrangian, vc.Fixed(0, [0] * count), vc.Fixed(4, [0] * count)))
    assert found.value <= least_by_many_starts(landscape, count, 10.0) + 0.02
    assert not found.local


@pytest.mark.parametrize("seed", [2, 3, 5])
def test_random_landscapes_between_bounds(seed):
    landscape = hills(seed, 1)

    def lagrangian(x, y, v):
        return v**2 / 2 + sum(h * ca.exp(-((x - a) ** 2 + (y - b[0]) ** 2) / w**2) for a, b, h, w in landscape)

    corridor = vc.Bound(lambda x, y, v: y, lower=-0.6, upper=0.6)
    found = vc.solve(vc.Problem(lagrangian, vc.Fixed(0, 0), vc.Fixed(4, 0), [corridor]))
    assert found.local or found.value <= least_by_many_starts(landscape, 1, 0.6) + 0.02


@pytest.mark.parametrize("turn", [0.0, 0.7, 2.2])
def test_a_curve_finds_the_way_that_a_graph_finds(turn):
    """A valley of the index beside the chord, whichever way that lies."""
    graph = vc.Problem(
        lambda x, y, v: (1 - 0.9 * ca.exp(-((y - 1) ** 2) / 0.1)) * ca.sqrt(1 + v**2), vc.Fixed(0, 0), vc.Fixed(8, 0)
    )
    c, s = math.cos(turn), math.sin(turn)

    def along(q, dq):
        return (1 - 0.9 * ca.exp(-((c * q[1] - s * q[0] - 1) ** 2) / 0.1)) * ca.norm_2(dq)

    curve = vc.solve(vc.Curve(along, vc.At([0, 0]), vc.At([8 * c, 8 * s])))
    least = vc.solve(graph)
    # along the middle of the valley, which is reached and left straight across
    assert curve.value < 8 * 0.1 + 2 * (1 - 0.9 * math.sqrt(0.1 * math.pi) / 2 * math.erf(1 / math.sqrt(0.1)))
    assert curve.value <= least.value + 1e-8
    assert not curve.local


def test_of_second_degree_there_is_one_valley():
    swing = vc.Problem(lambda x, y, v: ca.sumsqr(v) / 2 - ca.sumsqr(y) / 2, vc.Fixed(0, [0, 1]), vc.Fixed(3, [1, 0]))
    assert "second degree" in vc.solve(swing).searched


def test_what_falls_for_ever_in_one_of_two_functions_is_told():
    falling = vc.Problem(
        lambda x, y, v: ca.sumsqr(v) / 2 + y[0] ** 2 - y[1] ** 4, vc.Fixed(0, [0, 0]), vc.Fixed(1, [0, 0])
    )
    found = vc.solve(falling, throw=False)
    assert found.verdict is vc.Verdict.UNBOUNDED or (found.local and found.lower == -math.inf)


def test_where_a_fall_is_seen_it_is_said_what_was_looked_at():
    falling = vc.Problem(
        lambda x, y, v: ca.sumsqr(v) / 2 - y[0] ** 2 * y[1] ** 2, vc.Fixed(0, [0, 0]), vc.Fixed(1, [0, 0])
    )
    found = vc.solve(falling, throw=False)
    assert found.lower == -math.inf  # at rest in 0 the functional is 0, and along y0 = y1 it falls as a fourth power
    assert "directions from the curve" in found.searched


def test_a_well_beside_a_curve_along_which_nothing_is_summed():
    """From rest at zero into a well of depth 18 about (3, 0), on a way long enough."""
    resting = vc.Problem(
        lambda x, y, v: ca.sumsqr(v) / 2 + y[0] ** 2 * ((y[0] - 3) ** 2 - 2) + y[1] ** 2,
        vc.Fixed(0, [0, 0]), vc.Fixed(9, [0, 0]),
    )  # fmt: skip
    found = vc.solve(resting)
    assert not found.local
    x = (np.arange(20_000) + 0.5) * 9 / 20_000
    y = 3.3 * np.tanh(np.minimum(x, 9 - x) / 0.4)
    polygon = (np.gradient(y, x) ** 2 / 2 + y**2 * ((y - 3) ** 2 - 2)).mean() * 9
    assert found.value < polygon


def test_a_valley_that_is_not_followed_is_told():
    """Shooting rests where it is no lowest place: no descent was tried, and none is said to have failed."""
    found = vc.solve(vc.Problem(action, vc.Periodic(0, 3), vc.Periodic(0, 3)), vc.Shooting())
    rests = 3 * wells(np.roots([4, 0, -4, 0.3]).real)
    assert np.abs(rests - found.value).min() < 1e-9
    assert found.local
    assert f"{rests.min():.6g}, and was not followed" in found.message


def test_where_no_polygon_of_a_box_is_admitted_none_is_halved():
    landscape = AlongAxes.__new__(AlongAxes)
    coarse, fine = np.linspace(0, 1, 5), np.linspace(0, 1, 9)
    assert landscape.halved(coarse, np.zeros((0, 5, 2)), fine).shape == (0, 9, 2)
    polygons = np.random.default_rng(1).normal(size=(3, 5, 2))
    assert landscape.halved(coarse, polygons, fine)[:, ::2] == pytest.approx(polygons)
