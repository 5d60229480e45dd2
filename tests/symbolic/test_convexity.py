"""Proofs of convexity: what is proved, what must not be, and that what is proved is so."""

import casadi as ca
import numpy as np
import pytest

from varcalc.symbolic.convexity import LONGEST, proved_convex, shapes

X, Y, V, W, P = (ca.SX.sym(name) for name in "xyvwp")
SPAN = (0.0, 4.0)


def proved(expression, span=SPAN, parameter=0.5):
    function = ca.Function("L", [X, ca.vertcat(Y, V), W, P], [expression])
    return proved_convex(function, [[span], [None, None], [None], [parameter]])


def numbers(expression):
    """The expression of points (x, y, v, w), with the parameter that ``proved`` has."""
    function = ca.Function("L", [X, Y, V, W, P], [expression])
    return lambda points: np.asarray(function.map(points.shape[1])(*points[:, None], 0.5)).ravel()


CONVEX = {
    "kinetic energy": V**2 / 2,
    "length": ca.sqrt(1 + V**2),
    "refractive index of x": (1 + X**2) * ca.sqrt(1 + V**2),
    "periodic index": (2 + ca.sin(X)) * ca.sqrt(1 + V**2),
    "index of a parameter": (P + X) * ca.sqrt(1 + V**2),
    "index in layers": ca.if_else(X > 0.3, 1, 2) * ca.sqrt(1 + V**2),
    "oscillator on its side": V**2 / 2 + Y**2 / 2,
    "cross term": V**2 + Y * V + Y**2,
    "cross term of x": V**2 + ca.cos(X) * Y * V + Y**2,
    "three entries": Y**2 + V**2 + W**2 + Y * V + V * W,
    "three entries of x": (1 + X) * Y**2 + 2 * V**2 + W**2 + ca.sin(X) * (Y * V + V * W),
    "not convex term by term": 5 * V**2 + (X - 2) * V**2,
    "exponential": ca.exp(Y) + V**2,
    "friction": V**2 / 2 + ca.fabs(V) - 12 * Y,
    "length in phase space": ca.sqrt(Y**2 + V**2 + 1),
    "length with weights": ca.sqrt(1 + X**2 + 3 * V**2),
    "length with a cross term": ca.sqrt(V**2 + Y * V + Y**2 + Y + 1),
    "one-sided": ca.fmax(Y, 0) ** 2 + V**2,
    "weight that vanishes": X**2 * V**2,
    "weight of a square root": ca.sqrt(X) * V**2 + V**2 / X,
    "fourth powers": V**4 + Y**4,
    "sixth power": V**6,
    "p-Laplacian": ca.fabs(V) ** 3 / 3 + ca.fabs(2 * V) ** 1.5,
    "powers of a length": ca.sqrt(1 + V**2) ** 3 + (1 + V**2) ** 0.75,
    "catenary energy": ca.cosh(Y),
    "barrier": -ca.log(Y) + V**2,
    "entropy": Y * ca.log(Y) + V**2 / 2,
    "beam": W**2 - X * Y,
    "layers": ca.if_else(X > 0.3, 1, 2) * V**2,
    "either of two": ca.if_else(X > 0.3, V**4, ca.exp(Y)),
    "difference": (V - Y) ** 2,
    "rounded coefficients": (0.1 * V - 0.3 * Y) ** 2,
    "hypotenuse": ca.hypot(1, V),
    "greatest": ca.fmax(ca.fmax(Y, V), X),
    "logarithm of exponentials": ca.log(ca.exp(Y) + ca.exp(V - 1) + 2) + ca.log1p(ca.exp(W)),
    "product of exponentials": ca.exp(Y) * ca.exp(V**2),
    "inverse root": 1 / ca.sqrt(Y) + Y**-1.5 + Y**1.5,
    "square over a root": V**2 / ca.sqrt(Y),
    "hyperbolic": ca.sinh(ca.exp(Y)) - ca.atan(ca.sqrt(V)) + ca.expm1(Y),
    "affine": 3 * Y - X * V + ca.sin(X),
}

NOT_PROVED = {
    "surface of revolution": Y * ca.sqrt(1 + V**2),
    "oscillator": V**2 / 2 - Y**2 / 2,
    "pendulum": V**2 / 2 - ca.cos(Y),
    "double well": (V**2 - 1) ** 2,
    "weight of y": Y * V**2,
    "weight that changes sign": ca.sin(X) * V**2,
    "concave": -ca.sqrt(1 + V**2),
    "square over y": V**2 / Y,
    "descent": ca.sqrt((1 + V**2) / Y),
    "lesser": ca.fmin(V**2, Y),
    "weight in layers of y": ca.if_else(Y > 0, 1, 2) * V**2,
    "strong cross term": V**2 + 3 * Y * V + Y**2,
    "strong cross term of x": V**2 + (1 + X) * Y * V + Y**2,
    "three entries": Y**2 + V**2 + W**2 + 2 * (Y * V + V * W + 0.1 * Y * W),
    "product": Y * V,
    "inverse": 1 / Y,
    "inverse square": Y**-2,
    "cube": V**3,
    "cube of a convex function": ca.exp(Y) - ca.fmax(-V, Y) ** 3,
    "root": ca.sqrt(Y),
    "root of what is negative": ca.sqrt(V**2 - 1),
    "logarithm": ca.log(Y),
    "logarithm of a square": -ca.log(1 + V**2),
    "domain in two pieces": ca.log(V**2 - 1),
    "domain forgotten": ca.fmax(-ca.log(Y), 0),
    "number forgotten": ca.fmax(Y, ca.sqrt(X - 2)) ** 3,
    "choice forgotten": ca.fmax(ca.sqrt(X - 2) + 1, -1) * V**2,
    "undivided": (X - X + Y) ** 3,
    "square root of an absolute value": ca.sqrt(ca.fabs(Y)),
    "sine": ca.sin(Y),
    "power of two entries": Y**V,
    "no number": ca.SX(np.nan) * V**2,
    "infinite weight": V**2 / (X - 2),
    "norm of one that dips": ca.hypot(ca.exp(Y) - 1, V),
    "steps": ca.floor(Y),
}


@pytest.mark.parametrize("name", CONVEX)
def test_what_the_rules_cover_is_proved(name):
    assert proved(CONVEX[name])


@pytest.mark.parametrize("name", NOT_PROVED)
def test_what_is_not_convex_or_not_covered_is_not_proved(name):
    assert not proved(NOT_PROVED[name])


@pytest.mark.parametrize("name", CONVEX)
def test_what_is_minus_a_convex_function_is_concave(name):
    function = ca.Function("L", [X, Y, V, W, P], [-CONVEX[name], CONVEX[name]])
    (minus,), (plus,) = shapes(function, [[SPAN], [None], [None], [None], [0.5]])
    assert minus.concave
    assert minus.convex == plus.concave == (name == "affine")


def test_the_sign_of_a_coefficient_is_that_over_the_interval_and_at_the_parameters():
    assert proved(ca.sin(X) * V**2, span=(0.0, np.pi))
    assert not proved(ca.sin(X) * V**2, span=(0.0, 3.3))
    assert proved(P * V**2, parameter=2.0)
    assert not proved(P * V**2, parameter=-2.0)


def test_a_number_that_is_not_watched_does_not_count():
    function = ca.Function("L", [Y, V], [Y * V**2])
    assert proved_convex(function, [[3.0], [None]])
    assert not proved_convex(function, [[-3.0], [None]])
    assert not proved_convex(function, [[None], [None]])


def test_other_functions_than_those_of_sx_and_long_ones_are_not_looked_into():
    y = ca.MX.sym("y")
    assert not proved_convex(ca.Function("L", [y], [y**2]), [[None]])
    for times, expected in ((LONGEST // 5, True), (LONGEST // 3, False)):
        total, weight = V, X
        for _ in range(times):
            total, weight = ca.log1p(ca.exp(total)), ca.sin(weight) + 2
        assert proved(weight * total**2) == expected


def midpoints_lie_below(values, rng, scale):
    """Whether the value midway between two points is at most the mean, wherever both are numbers."""
    count = 400
    x = rng.uniform(*SPAN, count)
    ends = scale * rng.normal(size=(2, 3, count)) * rng.choice([1e-2, 1.0], (2, 3, count))
    a, b, middle = (values(np.vstack([x, point])) for point in (*ends, ends.mean(0)))
    known = np.isfinite(a) & np.isfinite(b)
    size = 1 + np.abs(a) + np.abs(b)
    with np.errstate(invalid="ignore"):
        below = middle <= 0.5 * (a + b) + 1e-9 * size
    return bool(below[known].all()), known.sum()


@pytest.mark.parametrize("name", CONVEX)
def test_what_is_proved_is_convex_between_points(name):
    below, known = midpoints_lie_below(numbers(CONVEX[name]), np.random.default_rng(3), 2.0)
    assert below
    assert known > 20


def random_expression(rng, depth):
    if depth == 0:
        leaves = [Y, V, W, Y, V, ca.SX(float(rng.choice([-1.0, 0.5, 1.0, 2.0]))), X, ca.sin(X), V - Y]
        return leaves[rng.integers(len(leaves))]
    one = [
        lambda a: a**2, ca.sqrt, ca.exp, ca.log, ca.fabs, lambda a: -a, lambda a: 1 / a, lambda a: a**1.5,
        lambda a: a**3, ca.cosh, ca.sinh, ca.tanh, lambda a: a**-0.5, lambda a: 1 + a**2, lambda a: a**0.75,
        lambda a: ca.if_else(X > 1, a, 0), ca.log1p, lambda a: a**4, lambda a: 2 - a,
    ]  # fmt: skip
    two = [
        lambda a, b: a + b, lambda a, b: a - b, lambda a, b: a * b, lambda a, b: a / b, ca.fmax, ca.fmin, ca.hypot,
        lambda a, b: a + b, lambda a, b: a + b, lambda a, b: a * b, lambda a, b: a**2 / b,
    ]  # fmt: skip
    a = random_expression(rng, depth - 1)
    if rng.random() < 0.5:
        return one[rng.integers(len(one))](a)
    return two[rng.integers(len(two))](a, random_expression(rng, depth - int(rng.integers(1, depth + 1))))


def test_random_expressions_that_are_proved_are_convex_between_points():
    rng = np.random.default_rng(4)
    found = 0
    for _ in range(1500):
        expression = random_expression(rng, int(rng.integers(1, 5)))
        if not any(ca.depends_on(expression, s) for s in (Y, V, W)) or not proved(expression):
            continue
        below, known = midpoints_lie_below(numbers(expression), rng, 1.5)
        assert below, expression
        found += known > 20
    assert found > 240


def test_the_check_between_points_finds_what_is_not_convex():
    rng = np.random.default_rng(5)
    failing = [n for n, e in NOT_PROVED.items() if not midpoints_lie_below(numbers(e), rng, 3.0)[0]]
    assert {"oscillator", "surface of revolution", "cube", "strong cross term", "lesser", "double well"} <= {*failing}
