"""How far an expression may vary over a box, read from its operations."""

import casadi as ca
import numpy as np
import pytest

from varcalc.symbolic.variation import excess, gentle

U = ca.SX.sym("u")


def found(expression, low, high):
    function = ca.Function("f", [U], [expression])
    return float(excess(function, [[(np.array([low]), np.array([high]))]], (1,))[0])


def test_polynomials_are_gentle():
    assert gentle(ca.Function("f", [U], [U**3 - 2 * U + U**2 / 7]))
    assert not gentle(ca.Function("f", [U], [ca.exp(-(U**2))]))


@pytest.mark.parametrize(
    ("narrow", "width"),
    [
        (lambda u, w: ca.exp(-((u / w) ** 2)), 1e-3),
        (lambda u, w: ca.tanh(u / w), 1e-3),
        (lambda u, w: 1 / (w**2 + u**2), 1e-4),
        (lambda u, w: ca.sqrt(w**2 + u**2), 1e-4),
        (lambda u, w: ca.log(w + u**2), 1e-6),
        (lambda u, w: ca.cos(u / w), 1e-3),
        (lambda u, w: (w + u**2) ** -0.5, 1e-6),
        (lambda u, w: ca.atan(u / w), 1e-4),
        (lambda u, w: ca.erf(u / w), 1e-4),
        (lambda u, w: (1 - u**2) ** 4000, None),
    ],
)
def test_what_is_narrow_is_seen_wherever_it_lies_in_a_box(narrow, width):
    rng = np.random.default_rng(7)
    for place in rng.uniform(-0.45, 0.45, 20):
        expression = narrow(U - place, width)
        assert found(expression, -0.5, 0.5) > 2
        size = 0.1 * (width or 0.02)
        assert found(expression, place - size, place + size) <= 1 or width in (1e-6, 1e-4)


@pytest.mark.parametrize("far", [ca.exp(-((U / 1e-3) ** 2)), ca.tanh(U / 1e-3), ca.erf(U / 1e-3)])
def test_beside_what_is_narrow_nothing_varies(far):
    assert found(far, 0.1, 0.5) <= 1


def test_steps_of_scale_one_are_gentle():
    for expression in (ca.exp(U), ca.sin(U), ca.cosh(U), ca.sqrt(1 + U**2), 1 / (2 + U), ca.atan(U)):
        assert found(expression, 0.0, 0.5) <= 1
