"""Kinks that are none: where what switches is not felt."""

import casadi as ca
import pytest

from varcalc.symbolic.joins import joins_smoothly
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
        (ca.if_else(y > 0, y**2, 0), False),  # read as a jump, whatever it makes of it
    ],
)
def test_a_switch_joins_smoothly_where_its_size_is_not_felt(expression, smooth):
    found = switches([expression], [y, v])
    assert [joins_smoothly([expression], [y, v], switch) for switch in found] == [smooth] * len(found)
    assert found
