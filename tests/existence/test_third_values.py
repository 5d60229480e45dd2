"""What L is where its argument is exactly zero, and neither of what it is beside that: a curve may rest there."""

import casadi as ca
import pytest

import varcalc as vc

OF_SLOPE = {
    "size of a sign": lambda x, y, v: v**2 + ca.fabs(ca.sign(v)),
    "square of a sign": lambda x, y, v: v**2 + ca.sign(v) ** 2,
    "two conditions": lambda x, y, v: v**2 + ca.if_else(ca.logic_and(v >= 0, v <= 0), 0, 1),
    "unequal": lambda x, y, v: v**2 + ca.if_else(v == 0, 0, 1),
}
"""At rest for 3 of 4, and at a slope of 1 for the rest, the value is 2; a straight line has 4.25."""
OF_PLACE = {
    "size of a sign": lambda x, y, v: v**2 + 4 * ca.fabs(ca.sign(y - 0.5)),
    "two conditions": lambda x, y, v: v**2 + 4 * ca.if_else(ca.logic_and(y >= 0.5, y <= 0.5), 0, 1),
    "unequal": lambda x, y, v: v**2 + 4 * ca.if_else(y == 0.5, 0, 1),
}
"""At a slope of 2 to y = 1/2, at rest there, and on: 4; a straight line has 16.25."""


@pytest.mark.parametrize(
    ("L", "least"), [*((L, 2.0) for L in OF_SLOPE.values()), *((L, 4.0) for L in OF_PLACE.values())]
)
def test_no_curve_that_never_rests_is_called_least(L, least):
    solution = vc.solve(vc.Problem(L, vc.Fixed(0, 0), vc.Fixed(4, 1)), throw=False)
    assert not solution.status.ok or solution.local or solution.value == pytest.approx(least, abs=1e-9)


SIZES = {
    "times its sign": lambda y: y * ca.sign(y),
    "chosen above": lambda y: ca.if_else(y > 0, y, -y),
    "chosen from there on": lambda y: ca.if_else(y >= 0, y, -y),
}


@pytest.mark.parametrize("size", SIZES.values(), ids=SIZES)
def test_what_its_sides_come_to_there_is_a_kink(size):
    """v^2/2 + |y| from -1 to 1 in 1: v' = sign y, and y = 0 half way."""
    # from y = 0 with the slope c: y = c x + x^2/2, c/2 + 1/8 = 1, and L = c^2/2 + 2 c x + x^2 along it
    c = 2 * (1 - 1 / 8)
    exact = 2 * (c**2 / 2 * 0.5 + c * 0.25 + 0.125 / 3)
    solution = vc.solve(vc.Problem(lambda x, y, v: v**2 / 2 + size(y), vc.Fixed(0, -1), vc.Fixed(1, 1)))
    assert solution.value == pytest.approx(exact, abs=1e-11)
