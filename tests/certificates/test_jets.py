"""Every operation that CasADi traces has an enclosure that holds its values and derivatives, or is refused by name."""

import casadi as ca
import mpmath
import numpy as np
import pytest

from varcalc.certificates.balls import flint, working
from varcalc.certificates.jets import ABSCISSA, Jet, jets, switches_between, without_enclosure
from varcalc.certificates.smooth import Undecided, head
from varcalc.symbolic.instructions import Program

mpmath.mp.dps = 40

# each with its mpmath form and the intervals its arguments are drawn from
UNARY = {
    "sqrt": (ca.sqrt, mpmath.sqrt, (0.1, 5.0)), "exp": (ca.exp, mpmath.exp, (-3.0, 3.0)),
    "log": (ca.log, mpmath.log, (0.1, 5.0)), "sin": (ca.sin, mpmath.sin, (-9.0, 9.0)),
    "cos": (ca.cos, mpmath.cos, (-9.0, 9.0)), "tan": (ca.tan, mpmath.tan, (-1.4, 1.4)),
    "asin": (ca.asin, mpmath.asin, (-0.9, 0.9)), "acos": (ca.acos, mpmath.acos, (-0.9, 0.9)),
    "atan": (ca.atan, mpmath.atan, (-5.0, 5.0)), "sinh": (ca.sinh, mpmath.sinh, (-3.0, 3.0)),
    "cosh": (ca.cosh, mpmath.cosh, (-3.0, 3.0)), "tanh": (ca.tanh, mpmath.tanh, (-3.0, 3.0)),
    "asinh": (ca.asinh, mpmath.asinh, (-5.0, 5.0)), "acosh": (ca.acosh, mpmath.acosh, (1.1, 5.0)),
    "atanh": (ca.atanh, mpmath.atanh, (-0.9, 0.9)), "log1p": (ca.log1p, mpmath.log1p, (-0.9, 5.0)),
    "expm1": (ca.expm1, mpmath.expm1, (-3.0, 3.0)), "erf": (ca.erf, mpmath.erf, (-2.0, 2.0)),
    "fabs": (ca.fabs, abs, (-4.0, -0.2)), "sign": (ca.sign, mpmath.sign, (0.2, 4.0)),
    "square": (lambda u: u**2, lambda u: u * u, (-3.0, 3.0)), "inverse": (lambda u: 1 / u, lambda u: 1 / u, (0.2, 4.0)),
    "cube": (lambda u: u**3, lambda u: u**3, (-3.0, 3.0)),
    "minus": (lambda u: -u, lambda u: -u, (-3.0, 3.0)), "twice": (lambda u: 2 * u, lambda u: 2 * u, (-3.0, 3.0)),
    "power": (lambda u: u**0.3, lambda u: u ** mpmath.mpf(0.3), (0.2, 4.0)),
    "half": (lambda u: u**-1.5, lambda u: u ** mpmath.mpf(-1.5), (0.2, 4.0)),
    "exponent": (lambda u: 1.3**u, lambda u: mpmath.mpf(1.3) ** u, (-3.0, 3.0)),
}  # fmt: skip
BINARY = {
    "sum": (lambda u, v: u + v, lambda u, v: u + v), "difference": (lambda u, v: u - v, lambda u, v: u - v),
    "product": (lambda u, v: u * v, lambda u, v: u * v), "quotient": (lambda u, v: u / v, lambda u, v: u / v),
    "power": (lambda u, v: u**v, lambda u, v: u**v), "hypot": (ca.hypot, mpmath.hypot),
    "atan2": (ca.atan2, mpmath.atan2), "fmax": (lambda u, v: ca.fmax(u, v - 9), lambda u, v: max(u, v - 9)),
    "fmin": (lambda u, v: ca.fmin(u, v - 9), lambda u, v: min(u, v - 9)),
    "if_else": (lambda u, v: ca.if_else(u > v - 9, u * v, u), lambda u, v: u * v),
    "not": (lambda u, v: ca.if_else(ca.logic_not(u > v - 9), u, u * v), lambda u, v: u * v),
    "and": (lambda u, v: ca.if_else(ca.logic_and(u > v - 9, u >= v - 9), u * v, u), lambda u, v: u * v),
    "or": (lambda u, v: ca.if_else(ca.logic_or(u == v - 9, u != v - 9), u * v, u), lambda u, v: u * v),
}  # fmt: skip


def program(formula, count):
    arguments = [ca.SX.sym(f"u{i}") for i in range(count)]
    return Program(ca.Function("f", arguments, [formula(*arguments)]))


def boxed(formula, points, radii):
    """The jet of a formula on a box, its arguments series of one term."""
    variables = [
        Jet(flint().arb_series([flint().arb(float(p), float(r))], 1), {i: flint().arb(1)})
        for i, (p, r) in enumerate(zip(points, radii, strict=True))
    ]
    return jets(program(formula, len(points)), [[v] for v in variables], 2)[0][0]


def holds(ball, value):
    """Whether a ball holds a number known to 30 digits."""
    exact = flint().arb(mpmath.nstr(value, 40))
    return (ball - exact + flint().arb(0, 1e-28) * (1 + abs(exact))).contains(0)


def all_hold(jet, exact, inside):
    """The value and all derivatives of first and second order at a point of the box."""
    count = len(inside)
    absent = flint().arb(0)
    at = [mpmath.mpf(float(v)) for v in inside]
    assert holds(head(jet.value), exact(*at))
    for i in range(count):
        orders = tuple(int(k == i) for k in range(count))
        assert holds(head(jet.first.get(i, absent)), mpmath.diff(exact, tuple(at), orders))
        for j in range(i, count):
            orders = tuple(int(k == i) + int(k == j) for k in range(count))
            assert holds(head(jet.second.get((i, j), absent)), mpmath.diff(exact, tuple(at), orders))


@pytest.mark.parametrize("name", UNARY)
def test_functions_of_one_argument(name):
    traced, exact, (low, high) = UNARY[name]
    random = np.random.default_rng(len(name))
    with working(128, 4), mpmath.workdps(50):
        for _ in range(3):
            radius = 10 ** random.uniform(-6, -1)
            point = random.uniform(low + 0.2 * (high - low), high - 0.2 * (high - low))
            radius = min(radius, 0.15 * (high - low))
            jet = boxed(traced, [point], [radius])
            for share in random.uniform(-1, 1, 3):
                all_hold(jet, exact, [point + share * radius])


@pytest.mark.parametrize("name", BINARY)
def test_functions_of_two_arguments(name):
    traced, exact = BINARY[name]
    random = np.random.default_rng(len(name))
    with working(128, 4), mpmath.workdps(50):
        for _ in range(2):
            points, radii = random.uniform(1.0, 3.0, 2), 10 ** random.uniform(-6, -1, 2)
            jet = boxed(traced, points, radii)
            all_hold(jet, exact, points + random.uniform(-1, 1, 2) * radii)


@pytest.mark.parametrize("power", [0, 1, 2, 3, 7, -2])
def test_a_whole_power_of_a_ball_about_zero_is_a_number(power):
    """Of a number, not a series, as what ends cost is; python-flint's own power of [-1, 1] is none."""
    middle = 3 if power < 0 else 0
    with working(128, 4), mpmath.workdps(50):
        symbols, ball = [ca.SX.sym(name) for name in "uc"], flint().arb(middle, 1)
        arguments = [[Jet(ball, {0: flint().arb(1)})], [Jet(flint().arb(power))]]
        jet = jets(Program(ca.Function("f", symbols, [symbols[0] ** symbols[1]])), arguments, 2)[0][0]
        for inside in (-0.9, 0.1, 0.3):
            all_hold(jet, lambda u: u**power, [middle + inside])


def test_series_hold_the_taylor_coefficients():
    """exp(sin(x)) about 0.5, against mpmath's Taylor series."""
    with working(200, 8):
        x = flint().arb_series([0.5, 1], 8)
        found = jets(program(lambda u: ca.exp(ca.sin(u)), 1), [[Jet(x)]], 0)[0][0].value
        exact = mpmath.taylor(lambda t: mpmath.exp(mpmath.sin(t)), mpmath.mpf(0.5), 7)
        assert all(abs(found[k] - flint().arb(mpmath.nstr(c, 30))) < 1e-25 for k, c in enumerate(exact))


@pytest.mark.parametrize(
    ("formula", "point", "radius"),
    [
        (ca.fabs, 0.1, 0.2), (ca.sqrt, 0.1, 0.2), (ca.log, 0.1, 0.2), (lambda u: 1 / u, 0.1, 0.2),
        (lambda u: ca.if_else(u > 0, u, 2 * u), 0.1, 0.2), (ca.tan, 1.5, 0.2), (ca.sign, 0.0, 0.1),
    ],
)  # fmt: skip
def test_what_switches_or_ends_inside_a_box_is_not_decided(formula, point, radius):
    with working(128, 4), pytest.raises(Undecided):
        boxed(formula, [point], [radius])


@pytest.mark.parametrize(
    ("formula", "point", "expected"),
    [
        (ca.floor, 2.7, 2), (ca.floor, -2.7, -3), (ca.ceil, 2.3, 3), (ca.ceil, -2.3, -2),
        (lambda u: ca.fmod(u, 2), 7.3, 1.3), (lambda u: ca.fmod(u, 2), -7.3, -1.3), (lambda u: ca.fmod(u, 2), 0.0, 0.0),
    ],
)  # fmt: skip
def test_stairs_are_enclosed_where_a_box_lies_on_one(formula, point, expected):
    with working(128, 4):
        jet = boxed(formula, [point], [0.1])
        assert abs(float(head(jet.value).mid()) - expected) < 1e-12


@pytest.mark.parametrize(
    ("formula", "point"), [(ca.floor, 2.95), (ca.ceil, -0.05), (lambda u: ca.fmod(u, 2), 4.05), (ca.floor, 1e40)]
)
def test_stairs_are_not_decided_where_a_box_may_lie_on_two(formula, point):
    with working(128, 4), pytest.raises(Undecided):
        boxed(formula, [point], [0.1])


def test_other_operations_are_refused_by_name():
    def formula(u):
        return ca.remainder(u, 2)

    u = ca.SX.sym("u")
    function = ca.Function("f", [u], [formula(u)])
    assert without_enclosure(function)
    with working(128, 4), pytest.raises(Undecided, match="has no enclosure"):
        boxed(formula, [0.3], [0.01])


def test_a_derivative_is_that_of_the_expression_not_of_rounded_constants():
    """d/du u^1.3 = 1.3 u^0.3 with 0.3 = 1.3 - 1 exact; 1.3 - 1 in doubles is off by 4e-17."""
    with working(128, 4), mpmath.workdps(50):
        jet = boxed(lambda u: u**1.3, [1e9], [0.0])
        assert holds(head(jet.first[0]), mpmath.mpf(1.3) * mpmath.mpf(10) ** (9 * (mpmath.mpf(1.3) - 1)))


@pytest.mark.parametrize(
    "condition",
    [
        lambda x, y: x < 0.5 + y**2,
        lambda x, y: ca.if_else(y < 0.5, x - 0.3, x + 5) < 0,
        lambda x, y: ca.sin(x) < 0.5,
        lambda x, y: 0.5 + (x - 0.25) - 1000 * (x - 0.25) ** 4 > 0,
    ],
)
def test_what_is_not_of_first_degree_in_x_alone_is_not_decided_for_a_whole_piece(condition):
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    switching = Program(ca.Function("f", [x, y], [ca.if_else(condition(x, y), 1.0, y)]))
    with working(128, 6):
        places = (
            [Jet(flint().arb_series([0.25, 0.25], 4), {ABSCISSA: flint().arb(1)})],
            [Jet(flint().arb_series([1], 4), {0: flint().arb(1)})],
        )
        assert set(switches_between(switching, places)) <= {None}


def test_a_switch_at_the_end_of_a_piece_is_decided_for_it():
    x = ca.SX.sym("x")
    switching = Program(ca.Function("f", [x], [ca.if_else(x < 0.5, 1.0, 2.0)]))
    with working(128, 6):
        places = [Jet(flint().arb_series([c, 0.25], 4), {ABSCISSA: flint().arb(1)}) for c in (0.25, 0.75, 0.5)]
        signs = [switches_between(switching, [[place]]) for place in places]
    assert [s[0] for s in signs] == [-1, 1, None]
