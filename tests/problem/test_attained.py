"""Where a least curve is proved to exist, and where there is no such proof."""

import casadi as ca
import pytest

import varcalc as vc
from varcalc.problem.attained import proved_attained


def problem(L, **more):
    return vc.Problem(L, vc.Fixed(0, 0.5), vc.Fixed(1, 1), **more)


@pytest.mark.parametrize("L", [
    lambda x, y, v: 0.2 * v**2 + 200 * ca.cos(40 * x + 30 * y),
    lambda x, y, v: v**2 + (y**2 - 1) ** 2 * (1 - 0.9 * ca.exp(-((x - 0.3) ** 2))),
    lambda x, y, v: v**2 + ca.exp(y),
])  # fmt: skip
def test_what_is_coercive_has_a_least_curve(L):
    assert proved_attained(problem(L))


@pytest.mark.parametrize("L", [
    lambda x, y, v: v**2 - y**2,
    lambda x, y, v: ca.sqrt(1 + v**2),
    lambda x, y, v: y * v**2,
    lambda x, y, v: (v**2 - 1) ** 2,
    lambda x, y, v: v**2 + 3 * y * v,
    lambda x, y, v: v**2 / y,
])  # fmt: skip
def test_nothing_is_said_of_what_is_not_proved(L):
    assert not proved_attained(problem(L))


def test_a_greatest_value_is_proved_of_the_opposite():
    assert proved_attained(problem(lambda x, y, v: -(v**2) - y**4, maximise=True))
    assert not proved_attained(problem(lambda x, y, v: v**2 + y**4, maximise=True))
