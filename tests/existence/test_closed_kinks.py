"""Closed curves whose Lagrangian has kinks and jumps: they rest on them for a part of the way, or go through them."""

import casadi as ca
import mpmath
import numpy as np
import pytest
from mpmath import mpf

import varcalc as vc
from varcalc.existence.held_throughout import let_go
from varcalc.methods.crossings import Crossing, on_curve

ROUND = vc.Periodic(0, 1), vc.Periodic(0, 1)
MEAN = vc.Isoperimetric(lambda x, y, v: y, 0)


def along_a_kink(push):
    """The curve leaves |y| at x1, level, and is level again at 1/4: its slope there is the sum of 1 - push sin."""
    leaves = mpmath.findroot(
        lambda x: (mpf(1) / 4 - x) - push * mpmath.cos(2 * mpmath.pi * x) / (2 * mpmath.pi), (mpf(0), mpf("0.2")),
        solver="anderson",
    )  # fmt: skip

    def slope(x):
        turned = mpmath.cos(2 * mpmath.pi * x) - mpmath.cos(2 * mpmath.pi * leaves)
        return (x - leaves) + push * turned / (2 * mpmath.pi)

    return float(-2 * mpmath.quad(lambda x: slope(x) ** 2, [leaves, mpf(1) / 4]))  # by parts, J = -1/2 of all y'^2


def through_a_jump(stiff, level, jump):
    """Between crossings at a and 1/2 - a the curve is a cosh of the distance from 1/4, or 3/4, and the driven wave."""
    root, share = mpmath.sqrt(stiff), 1 + 4 * mpmath.pi**2 / stiff

    def pieces(a):
        height = level - mpmath.sin(2 * mpmath.pi * a) / share
        for middle, away in ((mpf(1) / 4, mpf(1) / 4 - a), (mpf(3) / 4, mpf(1) / 4 + a)):
            size = height / mpmath.cosh(root * away)
            yield (
                lambda x, size=size, middle=middle: (
                    size * mpmath.cosh(root * (x - middle)) + mpmath.sin(2 * mpmath.pi * x) / share
                ),
                lambda x, size=size, middle=middle: (
                    size * root * mpmath.sinh(root * (x - middle))
                    + 2 * mpmath.pi * mpmath.cos(2 * mpmath.pi * x) / share
                ),
            )

    def refracted(a):  # v^2/2 less L's jump is the same on both sides
        (_, above), (_, below) = pieces(a)
        return above(a) ** 2 / 2 - below(1 + a) ** 2 / 2 - jump

    a, total = mpmath.findroot(refracted, (mpf(0), mpf("0.1")), solver="anderson"), mpf(0)
    for (y, v), way in zip(pieces(a), ((a, mpf(1) / 2 - a), (mpf(1) / 2 - a, 1 + a)), strict=True):
        total += mpmath.quad(
            lambda x, y=y, v=v: v(x) ** 2 / 2 + stiff / 2 * (y(x) - mpmath.sin(2 * mpmath.pi * x)) ** 2, way
        )
    return float(total + jump * (mpf(1) / 2 - 2 * a))


def where_friction_lets_go(stiff, friction):
    """It rises over |x| < e from rest to rest, where the momentum goes from friction to its opposite."""
    root, share, turn = mpmath.sqrt(stiff), 1 + 4 * mpmath.pi**2 / stiff, 2 * mpmath.pi

    def moved(e):
        size = -turn * mpmath.cos(turn * e) / (share * root * mpmath.cosh(root * e))
        return (
            lambda x: size * mpmath.sinh(root * x) + mpmath.sin(turn * x) / share,
            lambda x: size * root * mpmath.cosh(root * x) + turn * mpmath.cos(turn * x) / share,
        )

    def left(e):
        return stiff * (moved(e)[0](e) * (mpf(1) / 2 - 2 * e) - 2 * mpmath.cos(turn * e) / turn) + 2 * friction

    e = mpmath.findroot(left, (mpf("0.01"), mpf("0.24")), solver="anderson")
    y, v = moved(e)
    moving = mpmath.quad(
        lambda x: v(x) ** 2 / 2 + friction * v(x) + stiff / 2 * (y(x) - mpmath.sin(turn * x)) ** 2, [-e, 0, e]
    )
    resting = mpmath.quad(lambda x: stiff / 2 * (y(e) - mpmath.sin(turn * x)) ** 2, [e, mpf(1) / 2 - e])
    return float(2 * (moving + resting))


@pytest.mark.parametrize(
    ("lagrangian", "conditions", "value"),
    [
        (lambda x, y, v: v**2 / 2 + ca.fabs(y) - 1.3 * ca.sin(2 * np.pi * x) * y, [], along_a_kink(mpf("1.3"))),
        (lambda x, y, v: v**2 / 2 + ca.fabs(y) - 1.3 * ca.sin(2 * np.pi * x) * y, [MEAN], along_a_kink(mpf("1.3"))),
        (lambda x, y, v: v**2 / 2 + ca.fabs(y) - ca.sin(2 * np.pi * x) * y / 2, [], 0.0),
        (
            lambda x, y, v: v**2 / 2 + 30 * (y - ca.sin(2 * np.pi * x)) ** 2 + ca.if_else(y > 0.2, 1, 0), [],
            through_a_jump(mpf(60), mpf("0.2"), mpf(1)),
        ),
        (
            # the interval ends, and begins, where the curve rests, on its way there and back
            lambda x, y, v: v**2 / 2 + ca.fabs(v) + 20 * (y - ca.sin(2 * np.pi * (x + 0.235))) ** 2, [],
            where_friction_lets_go(mpf(40), mpf(1)),
        ),
    ],
    ids=["along a kink", "along a kink with a level", "held by a kink", "through a jump", "friction"],
)  # fmt: skip
def test_a_closed_curve_that_meets_what_switches(lagrangian, conditions, value):
    found = vc.solve(vc.Problem(lagrangian, *ROUND, conditions))
    assert abs(found.value - value) <= found.error.value + 1e-14
    assert found.error.value < 1e-9
    assert not found.local


@pytest.mark.parametrize(
    ("turns", "stiff", "phase"), [(2, 13.446, 0.4171), (3, 22.62, 0.0)], ids=["through the seam", "beside rests"]
)
def test_friction_that_lets_go_for_a_short_while(turns, stiff, phase):
    # in units of a turn v is so many times as large; at rest throughout, the value is stiff / 4, which is more
    value = turns**2 * where_friction_lets_go(mpf(stiff) / turns**2, mpf(1) / turns)
    found = vc.solve(
        vc.Problem(
            lambda x, y, v: v**2 / 2 + ca.fabs(v) + stiff / 2 * (y - ca.sin(2 * np.pi * turns * (x + phase))) ** 2,
            *ROUND,
        )
    )
    assert value < stiff / 4 - 1e-4
    assert abs(found.value - value) <= found.error.value + 1e-14
    assert found.error.value < 1e-9


@pytest.mark.parametrize(("friction", "freed"), [(0.99, True), (1.01, False)])
def test_what_pulls_more_than_friction_holds_lets_go_of_a_curve_at_rest(friction, freed):
    # the momentum goes up and down by the sum of 2 pi sin(2 pi x) over half a turn, which is 2
    problem = vc.Problem(
        lambda x, y, v: v**2 / 2 + friction * ca.fabs(v) + np.pi * (y - ca.sin(2 * np.pi * x)) ** 2, *ROUND
    )
    (kink,) = on_curve(problem)
    assert let_go(problem, lambda x, _: np.zeros((1, len(x))), [Crossing(kink, 0.0, until=1.0)]) is freed


def test_friction_holds_no_closed_curve_that_is_lower_further_down() -> None:
    # at rest at y it is y / 2, without a bound, however much friction there is
    problem = vc.Problem(lambda x, y, v: (1 + y**2) * ca.fabs(v) + x * y, vc.Periodic(0, 1), vc.Periodic(0, 1))
    assert not vc.solve(problem, throw=False).status.ok


def test_friction_alone_holds_a_closed_curve_on_its_level() -> None:
    level = vc.Isoperimetric(lambda x, y, v: y, 0.2)
    solution = vc.solve(vc.Problem(lambda x, y, v: v**2 / 2 + 2 * ca.fabs(v), *ROUND, [level]))
    assert solution.value == pytest.approx(0.0, abs=1e-12)
    assert solution.y(np.array([0.0, 0.7])) == pytest.approx(0.2, abs=1e-11)


def test_friction_holds_a_closed_curve_between_two_wells_on_its_level() -> None:
    # what pulls at it, 4 y (y^2 - 1), is the multiplier
    level = vc.Isoperimetric(lambda x, y, v: y, 0.2)
    problem = vc.Problem(
        lambda x, y, v: v**2 / 2 + (3 + ca.cos(2 * np.pi * x)) * ca.fabs(v) + (y**2 - 1) ** 2, *ROUND, [level]
    )
    solution = vc.solve(problem)
    assert solution.value == pytest.approx(0.96**2, abs=1e-12)
    assert solution.multipliers[0] == pytest.approx(-0.8 * 0.96, abs=1e-9)
