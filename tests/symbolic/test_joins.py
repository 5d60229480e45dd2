"""Kinks that are none: where what switches is not felt, and where branches agree."""

import casadi as ca
import pytest

from varcalc.symbolic.joins import joined
from varcalc.symbolic.switches import switches

y, v = ca.SX.sym("y"), ca.SX.sym("v")


@pytest.mark.parametrize(
    ("expression", "smooth"),
    [
        (ca.fabs(v) ** 1.5, True),
        (ca.fabs(v) ** 3 + y, True),
        (y * ca.fabs(y), True),
        (ca.fmax(y - 0.3 * v, 0) ** 2, True),
        (ca.fmin(y**2, 1) ** 2, False),
        (ca.fabs(v) ** 1.5 + ca.fabs(v), False),
        (ca.fabs(v), False),
        (ca.sqrt(ca.fabs(v)), False),
        (ca.fmax(y, 2 * y), False),
        (ca.if_else(y > 0, y**2, 0), True),
        (ca.if_else(ca.fabs(v) < 0.7, v**2 / 2, 0.7 * ca.fabs(v) - 0.245), True),  # Huber's loss
        (ca.if_else(y > v, ca.exp(y - v) - 1, ca.sin(y - v)), True),
        (ca.sign(y - 2) * (y - 2) ** 2, True),
        (ca.if_else(ca.logic_and(y > 1, y < 2), ((y - 1) * (y - 2)) ** 2, 0), True),
    ],
)
def test_a_switch_joins_smoothly_where_both_sides_have_one_gradient(expression, smooth):
    found = joined([expression], [y, v], switches([expression], [y, v]))
    assert [switch.smooth for switch in found] == [smooth] * len(found)
    assert found
    assert not any(switch.jumps for switch in found)


def test_branches_that_agree_in_value_alone_are_not_smooth():
    expression = ca.if_else(y > 0, y, -2 * y)
    (switch,) = joined([expression], [y, v], switches([expression], [y, v]))
    assert not switch.smooth


@pytest.mark.parametrize(
    "expression",
    [
        ca.if_else(y > 1, y**2, 1 + 1e-8),
        ca.if_else(ca.fabs(v) < 1, v**2 / 2, v - 0.5),  # at v = 1 they agree, at -1 they do not
        ca.if_else(y * (y - 50) > 0, y, 0),  # at 0 they agree, at 50 they do not
        ca.if_else(y > 1, ca.if_else(ca.fabs(v - 0.37) < 1e-3, 2 * y, 2 * y - 1), y**2),  # but for narrow ranges of v
        ca.if_else(y > 1, ca.if_else(y > 2, 4 * y - 3, y**2), 1),
    ],
)
def test_branches_that_agree_in_parts_of_the_switch_alone_jump(expression):
    found = joined([expression], [y, v], switches([expression], [y, v]))
    assert any(switch.jumps for switch in found)
    assert not any(switch.jumps and switch.smooth for switch in found)


@pytest.mark.parametrize("width", [1e-1, 1e-2, 1e-3])
def test_branches_agree_beside_what_is_narrow(width):
    # far from the narrow load its derivatives are as small as one likes, and differ by their round-off
    x, y, v = (ca.SX.sym(name) for name in "xyv")
    stiffer = ca.if_else(v > 0.148, 0.167 * (v - 0.148) ** 2, 0)
    written = v**2 / 2 + stiffer + (5.604 * ca.exp(-(((x - 0.399) / width) ** 2)) * y + 2.761 * y)
    (found,) = joined([written], [x, y, v], switches([written], [x, y, v]))
    assert found.smooth
    assert not found.jumps
