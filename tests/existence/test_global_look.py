"""Other valleys: lower ones are followed, falls for ever are told of, and where was looked."""

import copy
import math
import pickle
from importlib import import_module

import casadi as ca
import numpy as np
import pytest

import varcalc as vc

ENDS = vc.Fixed(0, 0), vc.Fixed(4, 0)


def landscape(seed):
    """Four hills on the way, as an expression and in NumPy."""
    rng = np.random.default_rng(seed)
    hills = np.column_stack(
        [rng.uniform(0.5, 3.5, 4), rng.uniform(-0.8, 0.8, 4), rng.uniform(0.3, 3, 4), rng.uniform(0.15, 0.6, 4)]
    )

    def lagrangian(x, y, v, exp):
        return v**2 / 2 + sum(h * exp(-((x - a) ** 2 + (y - b) ** 2) / w**2) for a, b, h, w in hills)

    return lagrangian


def least_polygon(lagrangian, pieces=80, nodes=301, reach=2.5):
    """The least of all polygons on a grid, by the midpoint rule: within a hundredth of the least value."""
    x, y = np.linspace(0, 4, pieces + 1), np.linspace(-reach, reach, nodes)
    step = x[1]
    slopes, middles = (y - y[:, None]) / step, 0.5 * (y + y[:, None])
    least = np.where(np.arange(nodes) == nodes // 2, 0.0, np.inf)
    for left in x[:-1]:
        least = (least[:, None] + step * lagrangian(left + step / 2, middles, slopes, np.exp)).min(0)
    return least[nodes // 2]


@pytest.mark.parametrize("seed", range(7000, 7012))
def test_random_landscapes(seed):
    lagrangian = landscape(seed)
    found = vc.solve(vc.Problem(lambda x, y, v: lagrangian(x, y, v, ca.exp), *ENDS))
    assert found.value <= least_polygon(lagrangian) + 0.02
    assert not found.local


@pytest.mark.parametrize(("seed", "extent"), [(seed, extent) for seed in (12, 20) for extent in (0.02, 1, 40)])
def test_narrow_hills_in_any_unit_of_the_abscissa(seed, extent):
    rng = np.random.default_rng(seed)
    hills = np.column_stack(
        [rng.uniform(0.4, 3.6, 8), rng.uniform(-0.7, 0.7, 8), rng.uniform(-0.5, 3, 8), rng.uniform(0.2, 0.6, 8)]
    )

    def lagrangian(x, y, v, exp):
        return v**2 / 2 + sum(h * exp(-((x - a) ** 2 + (y - b) ** 2) / w**2) for a, b, h, w in hills)

    def stretched(x, y, v):
        return lagrangian(x / extent, y, v * extent, ca.exp) / extent

    found = vc.solve(vc.Problem(stretched, vc.Fixed(0, 0), vc.Fixed(4 * extent, 0)))
    assert found.value <= least_polygon(lagrangian) + 0.02
    assert not found.local


@pytest.mark.parametrize(("depth", "tilt", "length"), [(4.5, 0.19, 33.73), (3.9, 0.15, 31.0), (1.0, 0.1, 60.0)])
def test_a_deeper_well_is_reached_however_long_the_way(depth, tilt, length):
    def lagrangian(x, y, v):
        return v**2 / 2 + depth * (y**2 - 1) ** 2 + tilt * y

    def through_the_deeper_well(width):
        x = (np.arange(10_000) + 0.5) * length / 10_000
        first, last = 2.1 * np.exp(-x / width), 1.8 * np.exp((x - length) / width)
        return lagrangian(x, first + last - 1, (last - first) / width).mean() * length

    found = vc.solve(vc.Problem(lagrangian, vc.Fixed(0, 1.1), vc.Fixed(length, 0.8)))
    assert found.value < min(map(through_the_deeper_well, np.geomspace(0.1, 2, 20)))
    assert not found.local


@pytest.mark.parametrize("shift", [0.0, 300.0])
def test_a_lower_well_is_followed_whatever_the_origin(shift):
    # the wells of (u^2 - 1)^2 + 0.3 u; the lower one is worth crossing the ridge twice on so long a way
    def lagrangian(x, y, v):
        u = y - shift
        return v**2 / 2 + (u**2 - 1) ** 2 + 0.3 * u

    found = vc.solve(vc.Problem(lagrangian, vc.Fixed(0, 1 + shift), vc.Fixed(20, 1 + shift)))
    assert found.y(10) - shift < -1
    # 20 times the depth of the lower well, and the ridge crossed twice: between the two bounds
    bottom = min(np.roots([4, 0, -4, 0.3]).real)
    depth = (bottom**2 - 1) ** 2 + 0.3 * bottom
    assert 20 * depth < found.value < 20 * depth + 2 * (4 * math.sqrt(2) / 3 + 1)
    assert "other valley" in found.searched


def test_a_named_indirect_method_tells_of_a_lower_valley_and_keeps_its_own():
    problem = vc.Problem(lambda x, y, v: v**2 / 2 + (y**2 - 1) ** 2 + 0.3 * y, vc.Fixed(0, 1), vc.Fixed(20, 1))
    lower = vc.solve(problem)
    found = vc.solve(problem, vc.Collocation())
    if found.value > lower.value + 1e-6:
        assert found.local
        assert found.lower == pytest.approx(lower.value, rel=1e-9)


def test_a_guess_asks_for_its_own_valley():
    problem = vc.Problem(lambda x, y, v: v**2 / 2 + (y**2 - 1) ** 2 + 0.3 * y, vc.Fixed(0, 1), vc.Fixed(20, 1))
    upper = vc.solve(problem, guess=lambda x: 1.0)
    assert upper.y(10) > 0
    assert upper.local
    assert upper.lower == pytest.approx(vc.solve(problem).value, rel=1e-9)


@pytest.mark.parametrize(
    "L",
    [
        lambda x, y, v: v**2 - y**4,
        lambda x, y, v: v**2 / 2 - y**3 / 10,
        lambda x, y, v: v**2 / 2 - 1e-6 * y**3,
        lambda x, y, v: 50 * v**2 - 1e-9 * y**4,
        lambda x, y, v: v**2 / 2 - ca.exp(y) / 2,
        lambda x, y, v: v**2 / 2 + y**2 - ca.cosh(y),
    ],
)
def test_a_functional_that_falls_for_ever_has_no_more_than_a_local_minimum(L):
    found = vc.solve(vc.Problem(L, vc.Fixed(0, 0), vc.Fixed(1, 0.1)))
    assert found.local
    assert found.lower == -math.inf
    assert "unbounded below" in found.message


def test_where_convexity_is_proved_nothing_is_looked_for():
    found = vc.solve(vc.Problem(lambda x, y, v: v**2 / 2 + ca.cosh(y), vc.Fixed(0, 0), vc.Fixed(1, 1)))
    assert "proved convex" in found.searched
    assert "the least of all curves" in str(found)


def test_what_is_not_looked_for_is_said():
    sphere = vc.Holonomic(lambda q: ca.sumsqr(q) - 1)
    arc = vc.Curve(lambda q, dq: ca.norm_2(dq), vc.At((1, 0, 0)), vc.At((0, 1, 0)), [sphere])
    assert "not looked for: the curve is held to a surface" in vc.solve(arc).searched


def test_printed_answers_are_five_lines():
    for L in (lambda x, y, v: y * ca.sqrt(1 + v**2), lambda x, y, v: v**2 - 20 * y**2):
        lines = str(vc.solve(vc.Problem(L, vc.Fixed(0, 1), vc.Fixed(1, 1)), throw=False)).splitlines()
        assert [line.split(":")[0] for line in lines] == ["value", "kind", "evidence", "route", "searched"]


@pytest.mark.parametrize(("first", "last", "length"), [(-1, 1, 12), (-1, 1, 25)])
def test_a_kink_that_is_hardly_held_is_a_minimum(first, last, length):
    # of v^2/2 + (1 - y^2)^2/4 a whole kink costs 2 sqrt(2) / 3, and on a finite way less than exp(-sqrt(2) T) more
    kink = vc.solve(
        vc.Problem(lambda x, y, v: v**2 / 2 + (1 - y**2) ** 2 / 4, vc.Fixed(0, first), vc.Fixed(length, last))
    )
    assert kink.value == pytest.approx(2 * math.sqrt(2) / 3, abs=20 * math.exp(-math.sqrt(2) * length) + 1e-10)


def test_half_a_swing_is_one_of_a_continuum_however_it_rises():
    with pytest.raises(vc.VariationalError) as refusal:
        vc.solve(vc.Problem(lambda x, y, v: v**2 / 2 - y**2 / 2, vc.Fixed(0, -1), vc.Fixed(math.pi, 1)))
    assert refusal.value.verdict is vc.Verdict.DEGENERATE


@pytest.mark.parametrize("reach", [6, 8])
def test_ground_states_are_minima(reach):
    ground = vc.Problem(
        lambda x, y, v: v**2 + x**2 * y**2, vc.Fixed(-reach, 0), vc.Fixed(reach, 0),
        [vc.Isoperimetric(lambda x, y, v: y**2, 1)],
    )  # fmt: skip
    found = vc.solve(ground)
    assert found.value == pytest.approx(1, abs=1e-8)
    assert vc.verify(found).verdict is vc.Verdict.MINIMUM


@pytest.mark.parametrize("share", [0.2, 0.25, 0.75, 0.8])
def test_a_kink_that_starts_off_its_well_is_found_near_the_end_that_draws_it(share):
    # between heights of tanh((x - x0)/sqrt 2) that curve is the least; far from both ends a kink is held by nothing,
    # and one in the middle costs some 1e-6 more
    length, root = 30.0, math.sqrt(2)
    x0 = share * length
    y0, y1 = math.tanh(-x0 / root), math.tanh((length - x0) / root)
    kink = vc.solve(vc.Problem(lambda x, y, v: v**2 / 2 + (1 - y**2) ** 2 / 4, vc.Fixed(0, y0), vc.Fixed(length, y1)))
    assert kink.value == pytest.approx(((y1 - y1**3 / 3) - (y0 - y0**3 / 3)) / root, abs=1e-10)


@pytest.mark.parametrize(("stiffness", "length"), [(1.40223, 22.527433045361153), (1.0, 40.0), (2.0, 60.0)])
def test_a_soliton_on_a_long_way_is_found_from_the_least_polygons(stiffness, length):
    # of v^2/2 + k (1 - cos y) a whole turn costs 8 sqrt(k), and on a finite way less than exp(-sqrt(k) T) more
    turn = vc.Problem(
        lambda x, y, v: v**2 / 2 + stiffness * (1 - ca.cos(y)), vc.Fixed(0, 0), vc.Fixed(length, 2 * math.pi)
    )
    cost = 8 * math.sqrt(stiffness)
    assert vc.solve(turn).value == pytest.approx(cost, abs=50 * math.exp(-math.sqrt(stiffness) * length) + 1e-9)


@pytest.mark.parametrize("c", [1e-3, 1e-6])
@pytest.mark.parametrize("where", ["along the way", "at the end", "at the end of two"])
def test_a_free_end_beyond_which_it_falls_for_ever_is_no_end(c, where):
    """y^2/2 - c y^3 of the end y falls beyond 1/(2 c), far from the rest at 0."""
    zero = [0, 0] if where == "at the end of two" else 0
    first = (lambda y: y[0]) if where == "at the end of two" else (lambda y: y)
    falls = where == "along the way"
    found = vc.solve(
        vc.Problem(
            lambda x, y, v: ca.sumsqr(v) / 2 - (c * y**3 if falls else 0), vc.Fixed(0, zero), vc.Free(1),
            end_cost=None if falls else lambda x0, y0, x1, y1: -c * first(y1) ** 3,
        ),
        throw=False,
    )  # fmt: skip
    assert not found.status.ok or (found.local and found.lower == -np.inf)


def uneven(depth=1.0):
    """A well on either side of the axis, the deeper one above it."""
    return vc.Problem(
        lambda x, y, v, p: v**2 / 2 - p.depth * (ca.exp(-4 * (y - 1) ** 2) + 0.9 * ca.exp(-4 * (y + 1) ** 2)),
        vc.Fixed(0, 0), vc.Fixed(9, 0), parameters={"depth": depth},
    )  # fmt: skip


def told(solution):
    return solution.value, solution.lower, solution.message, solution.searched


@pytest.mark.parametrize("method", [vc.Collocation(), vc.Shooting()])
def test_valleys_beside_one_curve_are_followed_once_by_whatever_method_it_was_found(monkeypatch, method):
    ladder, problem, followed = import_module("varcalc.solve.ladder"), uneven(), []
    plainly = ladder._next_to
    monkeypatch.setattr(ladder, "_next_to", lambda *way: followed.append(way) or plainly(*way))
    first = vc.solve(problem)
    assert followed
    followed.clear()
    second = vc.solve(problem, method, guess=first)
    assert not followed
    assert second.problem is problem
    assert told(second) == told(vc.solve(uneven(), method, guess=first))
    assert followed


def test_what_was_found_of_a_problem_is_told_of_no_other():
    problem = uneven()
    vc.solve(problem)
    assert problem.answers.products
    deeper = problem.with_parameters({"depth": 2.0})
    others = deeper, copy.copy(problem), copy.deepcopy(problem), pickle.loads(pickle.dumps(problem))
    assert [len(other.answers.products) for other in others] == [0] * 4
    assert told(vc.solve(deeper)) == told(vc.solve(uneven(2.0)))


@pytest.mark.parametrize("bounded", [False, True], ids=["free", "above a floor"])
@pytest.mark.parametrize("seed", [8, 12, 16])
def test_waves_that_travel_leave_many_valleys_and_the_lowest_is_found(seed, bounded):
    # a curve rides on one wave after another: which of them, and where it changes, makes valley beside valley
    draws = np.random.default_rng(3).uniform(size=(1 + seed, 5))
    height, number, pace, *ends = (draws * [1.5, 3, 2, 2.4, 2.4] + [1, 3, 1.5, -1.2, -1.2])[seed]

    def lagrangian(x, y, v, m):
        return v**2 / 2 + height * m.sin(number * y + pace * x) + 0.35 * y * m.cos(2.9 * x)

    floor = -1.4 if bounded else -2.5
    x, y = np.linspace(0, 8, 161), np.linspace(floor, 2.5, 401)
    least = np.full(len(y), np.inf)
    least[np.argmin(np.abs(y - ends[0]))] = 0.0
    begin, end = y[np.argmin(np.abs(y - ends[0]))], y[np.argmin(np.abs(y - ends[1]))]
    steepest = int(12 * x[1] / (y[1] - y[0]))
    back = np.arange(len(y)) - np.arange(-steepest, 1 + steepest)[:, None]
    kept, before = (back >= 0) & (back < len(y)), np.clip(back, 0, len(y) - 1)
    slope = (y - y[before]) / x[1]
    for left in x[:-1]:
        terms = [
            lagrangian(left + share * x[1], y[before] + share * x[1] * slope, slope, np)
            for share in (0.5 - np.sqrt(1 / 12), 0.5 + np.sqrt(1 / 12))
        ]
        least = np.where(kept, least[before] + x[1] * np.mean(terms, axis=0), np.inf).min(0)
    bounds = [vc.Bound(lambda x, y, v: y, lower=floor)] if bounded else []
    problem = vc.Problem(lambda x, y, v: lagrangian(x, y, v, ca), vc.Fixed(0, begin), vc.Fixed(8, end), bounds)
    found = vc.solve(problem)
    assert found.value < least[np.argmin(np.abs(y - end))]
    assert not found.local


def test_a_narrow_strip_between_a_jump_and_a_bound_is_followed():
    # what departs from a curve that turns has turns of its own, and leaves a strip so narrow
    def lagrangian(x, y, v, m, above):
        push = 2.59712 * y * m.exp(-(((x - 3.44) / 0.210902) ** 2))
        return (1 + 0.5 * m.cos(1.89038 * x)) * v**2 / 2 - push - 1.19735 * above

    def cost(y1, m):
        return 2 * m.sin(2 * y1 - 1.645) + y1**2 / 2

    problem = vc.Problem(
        lambda x, y, v: lagrangian(x, y, v, ca, y > 1.02933), vc.Fixed(0, 0.916521), vc.Free(8),
        [vc.Bound(lambda x, y, v: y, upper=1.036631)], end_cost=lambda x0, y0, x1, y1: cost(y1, ca),
    )  # fmt: skip
    x = np.linspace(0, 8, 80001)
    along, turns = np.array([0, 0.1, 7.9, 8]), np.array([0.916521, 1.034, 1.034, 0.2])
    y, v = np.interp(x, along, turns), (np.diff(turns) / np.diff(along))[np.searchsorted(along[1:-1], x)]
    in_strip = np.trapezoid(lagrangian(x, y, v, np, y > 1.02933), x) + cost(0.2, np)
    found = vc.solve(problem)
    assert found.value < in_strip
    assert not found.local
    assert (found.curve(np.linspace(0.5, 7, 50), 0)[0] > 1.0293).all()


def bounded(kinetic, well, span, end=None):
    """The answer from zero on, under slopes of one at most."""
    problem = vc.Problem(
        lambda x, y, v: kinetic(v) + well(y),
        vc.Fixed(0, 0),
        vc.Free(span) if end is None else vc.Fixed(span, end),
        [] if kinetic is relativistic else [vc.Bound(lambda x, y, v: v, lower=-1, upper=1)],
    )
    return vc.solve(problem)


def plain(v):
    return v**2 / 2


def relativistic(v):
    return -ca.sqrt(1 - v**2)


@pytest.mark.parametrize(("depth", "place"), [(2.0, 0.5), (3.0, 0.3), (4.0, 0.8)])
def test_a_well_that_bounded_slopes_just_lead_to(depth, place):
    # as fast as may be up to the jump, at rest from there on
    solution = bounded(plain, lambda y: ca.if_else(y < place, 0, -depth), 1.0)
    assert abs(solution.value - (place / 2 - depth * (1 - place))) <= 10 * solution.error.value + 1e-11


@pytest.mark.parametrize(("depth", "place"), [(2.0, 0.5), (3.0, 0.3), (4.0, 0.8)])
def test_a_smooth_well_that_a_light_cone_just_leads_to(depth, place):
    # lower than the same wall moved away by three of its widths, where it is within exp(-6) of its depth
    width = 0.02
    solution = bounded(relativistic, lambda y: -depth / 2 * (1 + ca.tanh((y - place) / width)), 1.0)
    within, pace = depth * (1 - 2.5e-3), math.sqrt(1 - 1 / (1 + depth) ** 2)
    away = place + 3 * width
    assert solution.value < min(-1.0, -math.sqrt(1 - pace**2) * away / pace - (1 + within) * (1 - away / pace))


# each unit by itself, and both at either extreme of a slope
@pytest.mark.parametrize(
    ("width", "height"), [(1.0, 1.0), (1.0, 1e-3), (1.0, 1e6), (1e-3, 1.0), (1e3, 1.0), (1e3, 1e-3), (1e-3, 1e6)]
)
def test_a_well_that_bounded_slopes_lead_to_in_any_unit(height, width):
    # as fast as may be up to the jump at half the height, at rest from there on
    steep = height / width
    problem = vc.Problem(
        lambda x, y, v: (v / steep) ** 2 / 2 + ca.if_else(y < 0.5 * height, 0, -2),
        vc.Fixed(0, 0),
        vc.Free(width),
        [vc.Bound(lambda x, y, v: v, lower=-steep, upper=steep)],
    )
    solution = vc.solve(problem)
    assert abs(solution.value - width * (0.25 - 1)) <= 10 * solution.error.value + 1e-11 * width


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("steep", [1.0, 1.3])
def test_what_falls_on_on_both_sides_of_a_hill_is_two_valleys(side, steep):
    """About the one no slope of a lattice leads into the other: what is steep costs too much."""

    def action(x, y, v, library):
        turned = side * y
        hill = 1.352 / (1 + ((turned - 0.534) / 0.38) ** 2) * (1 + 0.03 * library.sin(0.672 * x))
        return steep * v**6 / 6 + v**2 / 2 + hill - 0.407 * library.sqrt(1 + y**2) * (1 + 0.03 * library.cos(0.672 * x))

    problem = vc.Problem(
        lambda x, y, v: action(x, y, v, ca), vc.Fixed(0, 0), vc.Free(3),
        end_cost=lambda x0, y0, x1, y1: -0.701 * side * y1,
    )  # fmt: skip
    found = vc.solve(problem)
    x, weights = np.polynomial.legendre.leggauss(200)
    x, weights = 1.5 * (1 + x), 1.5 * weights
    slopes = np.linspace(-1.5, 1.5, 61)
    straight = min(float(action(x, v * x, v + 0 * x, np) @ weights) - 0.701 * side * 3 * v for v in slopes)
    assert found.value < straight
    assert not found.local


def summed(lagrangian, x, y):
    """The functional along the polygon with vertices y (K + 1, ...) at x, by a rule in NumPy."""
    nodes, weights = np.polynomial.legendre.leggauss(12)
    total = 0.0
    for a, b, p, q in zip(x[:-1], x[1:], y[:-1], y[1:], strict=True):
        slope = (q - p) / (b - a)
        for share, weight in zip(0.5 + 0.5 * nodes, weights, strict=True):
            total += 0.5 * (b - a) * weight * lagrangian(a + share * (b - a), p + share * (q - p), slope, np)
    return float(total)


def test_a_valley_under_a_ceiling_is_seen_where_waves_have_others_far_away():
    # the sine has wells without number: a lattice over them has few levels beside the curve
    def lagrangian(x, y, v, m):
        return v**4 / 4 + v**2 / 4 + 1.118 * x * y - 2.77 * y + 1.132 * m.sin(3.046 * y)

    ceiling = vc.Bound(lambda x, y, v: y, upper=0.787)
    found = vc.solve(
        vc.Problem(lambda x, y, v: lagrangian(x, y, v, ca), vc.Fixed(0, 0.687), vc.Fixed(2, -0.621), [ceiling])
    )
    x = np.array([0, 0.125, 0.19, 0.25, 0.375, 0.5, 0.625, 0.75, 1, 1.25, 1.5, 1.75, 2])
    y = np.array([0.687, 0.77, 0.787, 0.786, 0.727, 0.627, 0.508, 0.38, 0.122, -0.11, -0.298, -0.447, -0.621])
    assert found.value <= summed(lagrangian, x, y)
    assert not found.local


def test_a_narrow_well_off_both_axes_is_seen_where_waves_have_others_far_away():
    def lagrangian(x, y, v, m):
        well = m.exp(-((y[0] + 0.376) ** 2 + (y[1] - 0.895) ** 2) / 0.119)
        wave = m.sin(3.352 * (0.973 * y[1] - 0.419 * y[0]) + x / 2)
        return 0.65 * v[0] ** 2 + 0.5 * v[1] ** 2 + 0.334 * v[0] * v[1] + 1.042 * wave - 2.63 * well

    ends = vc.Fixed(0, [1, 0.408]), vc.Fixed(2, [-0.532, -0.105])
    found = vc.solve(vc.Problem(lambda x, y, v: lagrangian(x, y, v, ca), *ends))
    x = np.array([0, 0.25, 0.5, 0.75, 1, 1.5, 1.75, 2])
    rows = (
        [1, 0.371, -0.16, -0.342, -0.386, -0.442, -0.518, -0.532],
        [0.408, 0.722, 0.948, 0.958, 0.941, 0.861, 0.589, -0.105],
    )
    assert found.value <= summed(lagrangian, x, np.array(rows).T)
    assert not found.local


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("unit", [1.0, 1e6])
def test_what_a_steep_polygon_costs_next_to_an_end_is_seen(side, unit):
    # exp(-y) ds is the length of straight lines in a plane, 2 sin(5/4) between these points; a polygon that leaps up,
    # where all costs next to nothing, pays for it in a part of its first piece that no rule of a few points sees
    problem = vc.Problem(
        lambda x, y, v: ca.exp(-side * y / unit) * ca.sqrt(1 + v**2) / unit, vc.Fixed(0, 0), vc.Fixed(2.5 * unit, 0)
    )
    solution = vc.solve(problem)
    assert solution.value == pytest.approx(2 * math.sin(1.25), abs=1e-10)
    assert not solution.local
