"""The least values of the misleading problems, held against a crude search that knows nothing of them."""

from itertools import pairwise

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import eigh_tridiagonal
from scipy.optimize import brentq, fsolve, minimize

import varcalc as vc
from campaigns.adversaries.catalogue import FAMILIES, adversary, statement
from campaigns.adversaries.layers import fermat
from campaigns.least import UNBOUNDED, Least, judged_by_least
from campaigns.statement import Disguise, disguised
from campaigns.truth import Answer, Outcome

NODES, HEIGHTS, ROUNDS, SHRINKING = 15, 13, 10, 0.6


def abscissae(problem):
    """An even mesh from end to end, with the points about which something happens."""
    (a, _), (b, _) = problem.start, problem.end
    inside = [x for x in problem.points if a < x < b]
    return np.unique([*np.linspace(a, b, NODES), *inside])


def polygon(problem, reach):
    """The least value among polygons on a mesh, by a dynamic programme in a band that narrows about its best one."""
    x, y, v = ca.SX.sym("x"), ca.SX.sym("y"), ca.SX.sym("v")
    kept = [bound.h(x, y, v) for bound in problem.constraints]
    price = 1e14 * sum(ca.fmax(0, -1e-9 - h) for h in kept)  # of what an obstacle forbids
    L = ca.Function("L", [x, y, v], [problem.L(x, y, v) + price])
    at = abscissae(problem)
    centre = np.interp(at, at[[0, -1]], [0.0 if h is None else h for h in (problem.start[1], problem.end[1])])
    nodes, weights = np.polynomial.legendre.leggauss(3)
    nodes, weights = (
        np.array([-1, *nodes, 1]),
        np.array([1e-6, *weights, 1e-6]),
    )  # obstacles are asked at vertices as well
    best, band = np.inf, reach
    for _ in range(ROUNDS):
        grid = centre[:, None] + band * np.linspace(-1, 1, HEIGHTS)
        for row, height in ((0, problem.start[1]), (-1, problem.end[1])):
            if height is not None:
                grid[row] = height
        cost, came = np.zeros(HEIGHTS), []
        for i, h in enumerate(np.diff(at)):
            low, high = grid[i][:, None, None], grid[i + 1][None, :, None]
            t = np.clip((1 + nodes) / 2, 1e-12, 1 - 1e-12)  # no singularity at an end
            height = low + t * (high - low)
            slope = np.broadcast_to((high - low) / h, height.shape)
            points = (np.broadcast_to(at[i] + h * t, height.shape), height, slope)
            value = L.map(height.size)(*(rows.reshape(1, -1) for rows in points))
            legs = np.asarray(value).reshape(height.shape) @ (h / 2 * weights)
            total = cost[:, None] + np.where(np.isfinite(legs), legs, np.inf)
            came.append(total.argmin(0))
            cost = total.min(0)
        last = int(cost.argmin())
        best = min(best, float(cost[last]))
        way = [last]
        for step in reversed(came):
            way.append(int(step[way[-1]]))
        centre, band = grid[np.arange(len(at)), way[::-1]], band * SHRINKING
    return best


SEARCHED = {
    "jumps": (1, 1.0, 1e-3), "stairs": (2, 1.0, 1e-3), "kinks": (0, 1.0, 1e-2), "loads": (1, 2.0, 1e-2),
    "friction": (1, 1.0, 1e-2), "crossings": (1, 1.0, 1e-2), "dead cores": (0, 1.5, 2e-2), "spots": (2, 0.3, 1e-2),
    "grains": (1, 0.5, 1e-2), "double wells": (3, 1.0, 5e-2), "heteroclinic": (2, 1.0, 1e-2),
    "sine-Gordon": (1, 2.0, 5e-2), "oscillators": (6, 2.0, 1e-1), "weights": (1, 1.0, 5e-2), "polar": (2, 1.0, 1e-2),
    "rims": (1, 1.0, 1e-2), "corners": (0, 2.0, 1e-2), "bumps": (3, 1.0, 3e-2), "tents": (1, 1.0, 1e-2),
    "posts": (1, 1.0, 1e-2), "hills": (5, 1.0, 1e-2), "tilted wells": (1, 1.5, 1e-2),
}  # fmt: skip
"""A draw, how far curves stray from the chord, and how near to the least value polygons come, relative to it."""


@pytest.mark.parametrize("family", SEARCHED)
def test_the_least_value_is_that_of_the_best_polygon(family):
    number, reach, near = SEARCHED[family]
    drawn = statement(family, number)
    size = abs(drawn.least.value)
    assert np.isfinite(size)
    above = polygon(drawn, reach) - drawn.least.value
    assert -1e-3 * size <= above <= near * size


@pytest.mark.parametrize("number", range(1, 8))  # the first one is too narrow for these samples
def test_a_slot_is_left_and_entered_along_lines(number):
    """A polygon into the slot, along its bottom and back comes near to the least value, and never below it."""
    drawn = statement("slots", number)
    x, y, v = (ca.SX.sym(name) for name in "xyv")
    L = ca.Function("L", [x, y, v], [drawn.L(x, y, v)])
    (a, ya), (b, yb) = drawn.start, drawn.end
    ordinates = np.linspace(-2, 2, 40_001)
    values = np.asarray(L(0, ordinates[None], 0))[0]
    bottom = float(ordinates[values.argmin()])
    turns = drawn.points
    t = (np.arange(20_000) + 0.5) / 20_000

    def along(x0, y0, x1, y1):
        slope = (y1 - y0) / (x1 - x0)
        return np.asarray(L((x0 + (x1 - x0) * t)[None], (y0 + (y1 - y0) * t)[None], slope)).mean() * (x1 - x0)

    corners = [(a, ya), (turns[0], bottom), (turns[1], bottom), (b, yb)]
    polygon = sum(along(*first, *last) for first, last in pairwise(corners))
    assert -1e-6 <= polygon / abs(drawn.least.value) - np.sign(drawn.least.value) <= 5e-2


@pytest.mark.parametrize("family", ["beams", "steep beams", "bent"])
@pytest.mark.parametrize("number", range(4))
def test_the_least_value_of_a_beam_is_that_of_finite_differences(family, number):
    """With kinks as bounds of ordinates of their own, a quadratic programme."""
    drawn = statement(family, number)
    cells = 400
    h, x = 1 / cells, np.linspace(0, 1, cells + 1)
    y, top = ca.MX.sym("y", cells + 1), ca.MX.sym("top", cells + 1)
    (_, y0, v0), (_, y1, v1) = drawn.start, drawn.end
    beyond = ca.vertcat(y[1] - 2 * h * v0, y, y[-2] + 2 * h * v1)
    slopes, bends = (beyond[2:] - beyond[:-2]) / (2 * h), (beyond[2:] - 2 * y + beyond[:-2]) / h**2
    symbols = [ca.SX.sym(name) for name in "xyvu"]
    # L = u^2/2 + a y + b |y| + c |v|, which the values at four points tell
    told = ca.Function("L", symbols, [drawn.L(*symbols)])
    at = [float(told(0.0, *point)) for point in [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)]]
    straight, kink, friction = (at[0] - at[1]) / 2, (at[0] + at[1]) / 2, (at[2] + at[3]) / 2
    weights = h * np.ones(cells + 1)
    weights[[0, -1]] = h / 2
    cost = ca.dot(weights, bends**2 / 2 + straight * y + top)
    turned = kink * y + friction * slopes
    rows = [top - turned, top + turned]
    rows += [ca.densify(bound.upper - bound.h(x, y, slopes)) for bound in drawn.constraints]
    solver = ca.nlpsol("qp", "ipopt", {"x": ca.vertcat(y, top), "f": cost, "g": ca.vertcat(*rows)},
                       {"ipopt.print_level": 0, "print_time": False, "ipopt.sb": "yes"})  # fmt: skip
    low, high = np.full(2 * cells + 2, -np.inf), np.full(2 * cells + 2, np.inf)
    low[[0, cells]] = high[[0, cells]] = y0, y1
    start = np.concatenate([y0 + (y1 - y0) * x, np.full(cells + 1, abs(kink) + abs(friction))])
    found = solver(x0=start, lbx=low, ubx=high, lbg=-1e-9, ubg=np.inf)
    assert float(found["f"]) == pytest.approx(drawn.least.value, rel=5e-2)


@pytest.mark.parametrize("family", ["walls"])
@pytest.mark.parametrize("number", [2])
def test_the_least_value_is_that_of_the_motion_that_arrives(family, number):
    drawn = statement(family, number)
    x, y, v = ca.SX.sym("x"), ca.SX.sym("y"), ca.SX.sym("v")
    L = drawn.L(x, y, v)
    both = ca.Function("both", [y, v], [ca.gradient(L, y), L])
    (a, ya), (b, yb) = drawn.start, drawn.end

    def motion(_, state):
        force, action = both(state[0], state[1])
        return [state[1], float(force), float(action)]

    def arrival(slope):
        return solve_ivp(motion, (a, b), [ya, slope, 0.0], rtol=1e-9, atol=1e-11, max_step=(b - a) / 200).y[:, -1]

    chord = (yb - ya) / (b - a)
    slopes = chord * np.array([1e-3, 0.1, 0.5, 0.9, 1, 1.1, 2, 4, 10])
    ends = [arrival(slope)[0] - yb for slope in slopes]
    first = next(i for i in range(len(slopes) - 1) if ends[i] < 0 <= ends[i + 1])
    slope = brentq(lambda s: arrival(s)[0] - yb, slopes[first], slopes[first + 1], xtol=1e-10)
    assert abs(arrival(slope)[2] - drawn.least.value) < 1e-5 * abs(drawn.least.value)


@pytest.mark.parametrize("number", range(3))
def test_a_guarded_descent_is_as_short_as_powers_of_x_make_it(number):
    drawn = statement("descents", number)
    (_, _), (X, Y) = drawn.start, drawn.end
    x, y, v = ca.SX.sym("x"), ca.SX.sym("y"), ca.SX.sym("v")
    L = ca.Function("L", [x, y, v], [drawn.L(x, y, v)])
    nodes, weights = np.polynomial.legendre.leggauss(60)
    t = (1 + nodes) / 2  # x = X t^3 turns the powers of x^(1/3) into polynomials

    def time(coefficients):
        bend = np.polynomial.Polynomial(coefficients)
        height = Y * t**2 * (1 + (1 - t) * bend(t))
        rate = Y * (2 * t * (1 + (1 - t) * bend(t)) + t**2 * ((1 - t) * bend.deriv()(t) - bend(t)))
        value = L((X * t**3)[None], height[None], (rate / (3 * X * t**2))[None])
        return float(np.asarray(value)[0] @ (weights / 2 * 3 * X * t**2))

    best = minimize(time, np.zeros(4), method="Nelder-Mead", options={"maxiter": 600, "maxfev": 600}).fun
    assert -1e-3 <= best / drawn.least.value - 1 < 2e-2


@pytest.mark.parametrize("number", range(6))
def test_a_film_is_the_least_among_polygons_near_it(number):
    drawn = statement("films", number)
    (a, ya), (b, yb) = drawn.start, drawn.end
    x = np.linspace(a, b, 60)
    h = x[1] - x[0]

    def area(inside):
        y = np.array([ya, *inside, yb])
        length = np.hypot(h, np.diff(y))
        middle = (y[1:] + y[:-1]) / 2
        by_length = middle * np.diff(y) / length
        return middle @ length, length[1:] / 2 + length[:-1] / 2 + by_length[:-1] - by_length[1:]

    # c cosh((x - d)/c) through both ends, which the least curve is; a polygon has to stay beside it
    c, d = fsolve(lambda p: [p[0] * np.cosh((a - p[1]) / p[0]) - ya, p[0] * np.cosh((b - p[1]) / p[0]) - yb],
                  [-a / 1.1, 0.0])  # fmt: skip
    found = minimize(area, c * np.cosh((x[1:-1] - d) / c), jac=True, method="L-BFGS-B")
    assert abs(found.fun / drawn.least.value - 1) < 1e-3


@pytest.mark.parametrize("family", ["oscillating", "wells"])
@pytest.mark.parametrize("number", range(3))
def test_an_eigenvalue_is_that_of_differences(family, number):
    drawn = statement(family, number)
    x = ca.SX.sym("x")
    V = ca.Function("V", [x], [drawn.L(x, 1, 0)])
    at = np.linspace(drawn.start[0], drawn.end[0], 1001)
    h = at[1] - at[0]
    diagonal = 2 / h**2 + np.asarray(V(at[1:-1][None]))[0]
    least = eigh_tridiagonal(diagonal, np.full(len(at) - 3, -1 / h**2), select="i", select_range=(0, 0))[0][0]
    assert abs(drawn.constraints[0].value * least - drawn.least.value) < 1e-3 * max(1.0, abs(drawn.least.value))


@pytest.mark.parametrize(("family", "size"), [("superquadratic", 1e3), ("oscillators", 1e6)])
def test_what_has_no_bound_falls(family, size):
    drawn = next(d for d in (statement(family, n) for n in range(5)) if not np.isfinite(d.least.value))
    (a, ya), (b, yb) = drawn.start, drawn.end
    x, y, v = ca.SX.sym("x"), ca.SX.sym("y"), ca.SX.sym("v")
    L = ca.Function("L", [x, y, v], [drawn.L(x, y, v)])
    at, k = np.linspace(a, b, 2001), np.pi / (b - a)
    values = []
    for height in (1e2 * size, -1e2 * size):
        curve = ya + (yb - ya) * (at - a) / (b - a) + height * np.sin(k * (at - a))
        slope = (yb - ya) / (b - a) + height * k * np.cos(k * (at - a))
        values.append(np.trapezoid(np.asarray(L(at[None], curve[None], slope[None]))[0], at))
    assert min(values) < -size


@pytest.mark.parametrize("across", [0.5, 2.0, 6.0])
def test_a_ray_through_layers_takes_the_least_of_all_crossings(across):
    levels, n = [0.0, 0.4, 1.0], np.array([1.4, 2.0, 1.7, 1.1])

    def path(order, along):
        # the layers passed one after the other, and what remains across at the index of a boundary
        heights, indices = np.array([h for h, _ in order]), np.array([n[i] for _, i in order])

        def cost(dx):
            rest = across - dx.sum()
            return np.hypot(heights, dx) @ indices + (abs(rest) * along if rest >= 0 else 100 * abs(rest))

        return min(
            minimize(cost, np.full(len(order), share * across / len(order)), method="Nelder-Mead",
                     options={"xatol": 1e-10, "fatol": 1e-12, "maxiter": 20000, "maxfev": 20000}).fun
            for share in (0.1, 0.5, 0.9)
        )  # fmt: skip

    straight = path([(0.2, 1), (0.3, 2)], 2.0)
    below = path([(0.2, 1), (0.4, 1), (0.3, 2)], 1.4)
    above = path([(0.2, 1), (0.6, 2), (0.3, 2)], 1.1)
    assert abs(min(fermat(levels, n, 0.2, 0.7, across)) - min(straight, below, above)) < 1e-6


@pytest.mark.parametrize("family", list(FAMILIES)[::5])
def test_a_problem_is_the_same_for_the_same_number(family):
    one = adversary(family, 3)
    adversary.cache_clear()
    other = adversary(family, 3)
    assert str(one.problem.integrand) == str(other.problem.integrand)
    assert one.least == other.least


def test_a_disguise_changes_the_value_as_it_says():
    plain = statement("loads", 1)
    for factor in (2.0, -3.0):
        case = disguised(plain, Disguise(0.5, -2.0, 0.25, 4.0, factor))
        solution = vc.solve(case.problem)
        assert abs(case.sign * solution.value - abs(factor) / 2 * plain.least.value) < 1e-9
        assert abs(case.least.value - abs(factor) / 2 * plain.least.value) < 1e-14


@pytest.mark.parametrize(
    ("answer", "local", "least", "minimises", "outcome"),
    [
        (Answer(True, 1.0, 1e-12), False, Least(1.0), True, Outcome.RIGHT),
        (Answer(True, 1.1, 1e-12), False, Least(1.0), True, Outcome.FALSE),
        (Answer(True, 1.1, 1e-12), True, Least(1.0), True, Outcome.OTHER),
        (Answer(True, 0.9, 1e-12), True, Least(1.0), True, Outcome.FALSE),
        (Answer(True, 1.1, 1e-12), False, Least(1.0), False, Outcome.OTHER),
        (Answer(True, 1.1, 1e-12), False, Least(1.0, sole=True), False, Outcome.FALSE),
        (Answer(True, 0.9, 1e-12), False, Least(1.0), False, Outcome.FALSE),
        (Answer(True, float("nan"), 1e-12), True, Least(1.0), True, Outcome.FALSE),
        (Answer(True, 0.0, 1e-12), False, UNBOUNDED, True, Outcome.FALSE),
        (Answer(True, 0.0, 1e-12), True, UNBOUNDED, True, Outcome.OTHER),
        (Answer(True, 1.0, 1e-12), False, Least(1.0, attained=False), True, Outcome.FALSE),
        (Answer(False, applies=False), False, Least(1.0), True, Outcome.MISSED),
        (Answer(False, applies=False), False, Least(1.0), False, Outcome.INAPPLICABLE),
        (Answer(False, verdict=vc.Verdict.UNBOUNDED), False, UNBOUNDED, True, Outcome.REFUSED),
        (Answer(False, verdict=vc.Verdict.GAP), False, UNBOUNDED, True, Outcome.MISREASONED),
    ],
)  # fmt: skip
def test_an_answer_is_judged_by_the_least_value(answer, local, least, minimises, outcome):
    assert judged_by_least(answer, local, least, minimises)[0] is outcome
