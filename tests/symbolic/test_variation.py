"""How far an expression may vary over a box, read from its operations."""

import casadi as ca
import numpy as np
import pytest

from varcalc.symbolic.variation import LOCAL, SWITCHED, VARYING, Between, excess, gentle, gentle_across

U = ca.SX.sym("u")


def found(expression, low, high):
    function = ca.Function("f", [U], [expression])
    ends = np.array([low]), np.array([high])
    return float(excess(function, [[Between(ends, *ends)]], (1,), VARYING)[0])


def test_polynomials_are_gentle():
    assert gentle(ca.Function("f", [U], [U**3 - 2 * U + U**2 / 7]), VARYING)
    assert not gentle(ca.Function("f", [U], [ca.exp(-(U**2))]), LOCAL)


@pytest.mark.parametrize(
    ("narrow", "width"),
    [
        (lambda u, w: ca.exp(-((u / w) ** 2)), 1e-3),
        (lambda u, w: 1 / (w**2 + u**2), 1e-4),
        (lambda u, w: ca.sqrt(w**2 + u**2), 1e-4),
        (lambda u, w: ca.log(w**2 + u**2), 1e-4),
        (lambda u, w: ca.cos(u / w), 1e-3),
        (lambda u, w: ca.tanh((u / w) ** 2), 1e-3),
        (lambda u, w: (w**2 + u**2) ** -0.5, 1e-4),
        (lambda u, w: ca.atan(1 - (u / w) ** 2), 1e-4),
        (lambda u, w: ca.erf((u / w) ** 2), 1e-4),
        (lambda u, w: (1 - u**2) ** (1 / w**2), 1e-2),
        (ca.hypot, 1e-4),
    ],
)
def test_what_is_narrow_is_seen_wherever_it_lies_in_a_box(narrow, width):
    rng = np.random.default_rng(7)
    for place in rng.uniform(-0.45, 0.45, 20):
        expression = narrow(U - place, width)
        assert found(expression, -0.5, 0.5) > 2
        assert found(expression, place - 0.1 * width, place + 0.1 * width) <= 1


@pytest.mark.parametrize("far", [ca.exp(-((U / 1e-3) ** 2)), ca.tanh(U / 1e-3), ca.sqrt(1e-8 + U**2), 1 / U])
def test_beside_what_is_narrow_nothing_hides(far):
    assert found(far, 0.1, 0.5) <= 1


def test_steep_but_shown_by_its_ends_is_not_hidden():
    for expression in (ca.exp(6 * U), ca.sqrt(1 + 1e6 * U**2), ca.tanh(6 * U), 1 / (1e-6 + U)):
        assert found(expression, 0.0, 0.5) <= 1


@pytest.mark.parametrize("step", [ca.tanh, ca.erf, ca.atan, lambda u: 1 / (1 + ca.exp(-u))])
def test_a_step_between_samples_hides_its_form(step):
    for low, high in ((0.0, 0.5), (-0.5, 0.5), (-0.5, 0.0)):
        assert found(step(1e6 * U), low, high) > 1
    assert found(step(1e6 * U), 0.1, 0.5) <= 1
    assert found(step(1e6 * U), -1e-6, 1e-6) <= 1


@pytest.mark.parametrize(
    "switched",
    [
        ca.fabs(U - 0.3), ca.sign(U - 0.3), ca.fmax(U, 0.3), ca.fmin(0.3, U), ca.if_else(U < 0.3, 1, 0),
        ca.if_else(U <= 0.3, 1, 0), ca.floor(U + 0.7), ca.ceil(U - 0.3), ca.fmod(U, 0.3), ca.remainder(U, 0.6),
        ca.copysign(1, U - 0.3),
    ],
)  # fmt: skip
def test_what_switches_hides_what_lies_between_its_sides(switched):
    function = ca.Function("f", [U], [switched])
    for low, high, hides in ((0.1, 0.5, True), (0.31, 0.5, False), (0.02, 0.29, False)):
        box = [[Between((np.array([low]), np.array([high])), np.array([low]), np.array([high]))]]
        assert bool(excess(function, box, (1,), SWITCHED)[0] > 1) is hides


@pytest.mark.parametrize(
    ("written", "expected"),
    [
        (lambda x, y, v: y * ca.sqrt(1 + v**2), True),
        (lambda x, y, v: ca.sqrt((1 + v**2) / (2 * 9.81 * y)), True),
        (lambda x, y, v: ca.sqrt(1 + v**2) / (2 * y - x), True),
        (lambda x, y, v: ca.sqrt(1 + v**2) * ca.sqrt(1 - 2 * y), True),
        (lambda x, y, v: v**2 / 2 - ca.sin(y), True),
        (lambda x, y, v: v**2 / 2 + ca.exp(-(((x - 1) / 1e-3) ** 2)) * y, True),
        (lambda x, y, v: v**2 / 2 - ca.exp(y), False),
        (lambda x, y, v: v**2 / 2 - 1 / (1 + y**2), False),
        (lambda x, y, v: v**2 / 2 - 2**y, False),
        (lambda x, y, v: ca.sqrt(1 + y**2 + v**2), False),
        (lambda x, y, v: v**2 / 2 + ca.tanh(y / 1e-4), False),
        (lambda x, y, v: v**2 / 2 + ca.if_else(y > 1, 1, 0), False),
        (lambda x, y, v: v**2 / 2 + ca.fmax(y, 1), False),
        (lambda x, y, v: v**2 / 2 + ca.floor(y), False),
        (lambda x, y, v: v**2 / 2 + ca.if_else(x > 1, 1, 0) * y, True),
        (lambda x, y, v: ca.fabs(v) + y**2, True),
    ],
)
def test_whether_anything_narrow_can_come_of_the_place_alone(written, expected):
    x, y, v = (ca.SX.sym(name) for name in "xyv")
    assert gentle_across(ca.Function("L", [x, y, v], [written(x, y, v)]), 1) is expected
