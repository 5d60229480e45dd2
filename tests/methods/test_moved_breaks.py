"""Parameters that move an abscissa at which L jumps, whatever the curve: the meshes and the rates go with them."""

import casadi as ca
import numpy as np
import pytest

import varcalc as vc

METHODS = [None, vc.Collocation(), vc.Shooting(), vc.FirstIntegral()]


def two_media(k):
    """Through a medium of stiffness 1 up to k and of 3/2 from there on: 1 / (k + 2 (1 - k) / 3)."""
    return vc.Problem(
        lambda x, y, v, p: ca.if_else(x > p.k, 1.5, 1) * v**2, vc.Fixed(0, 0), vc.Fixed(1, 1), parameters={"k": k}
    )


@pytest.mark.parametrize("method", METHODS, ids=str)
@pytest.mark.parametrize("k", [0.4001, 0.399])
def test_a_jump_is_where_the_parameter_puts_it(method, k):
    problem = two_media(0.4)
    vc.solve(problem)
    solution = vc.solve(problem.with_parameters({"k": k}), method)
    value = 1 / (k + (1 - k) / 1.5)
    assert solution.value == pytest.approx(value, rel=1e-11)
    assert solution.sensitivities["k"] == pytest.approx(-(value**2) / 3, rel=1e-9)


def test_a_sweep_moves_a_jump():
    ks = [0.4, 0.4001, 0.4003]
    swept = vc.sweep(two_media(0.4), {"k": ks})
    assert swept.values == pytest.approx([1 / (k + (1 - k) / 1.5) for k in ks], rel=1e-12)


def test_a_load_that_begins_later_does_less():
    """Of y'²/2 + 3 y from k on the rate is -3 y(k)."""
    problem = vc.Problem(
        lambda x, y, v, p: v**2 / 2 + ca.if_else(x > p.k, 3, 0) * y, vc.Fixed(0, 0), vc.Fixed(1, 1),
        parameters={"k": 0.4},
    )  # fmt: skip
    solution = vc.solve(problem)
    k = 0.4
    # y'' is 0 before k and 3 behind it
    slope = 1 - 1.5 * (1 - k) ** 2
    assert solution.sensitivities["k"] == pytest.approx(-3 * slope * k, rel=1e-10)


def test_a_level_moves_with_its_multiplier():
    """∫ y'² where ∫ of y from k on is 1: what the level loses by a later k the curve has to make up for."""

    def problem(k):
        return vc.Problem(
            lambda x, y, v, p: v**2, vc.Fixed(0, 0), vc.Fixed(1, 0),
            [vc.Isoperimetric(lambda x, y, v, p: ca.if_else(x > p.k, y, 0), 1)], parameters={"k": k},
        )  # fmt: skip

    def least(k):
        # -2 y'' = m from k on: y = a x up to k, of which the integral of the Green's function is the square
        return 1 / ((1 - k) ** 3 / 3 - (1 - k) ** 4 / 4)

    k, h = 0.3, 1e-5
    solution = vc.solve(problem(k))
    assert solution.value == pytest.approx(least(k), rel=1e-11)
    assert solution.sensitivities["k"] == pytest.approx((least(k + h) - least(k - h)) / (2 * h), rel=1e-7)


def test_what_moves_an_end_that_a_kink_holds_has_no_known_rate():
    problem = vc.Problem(
        lambda x, y, v, p: v**2, vc.Fixed(0, 0), vc.Free(1), end_cost=lambda x0, y0, x1, y1, p: 3 * ca.fabs(y1 - p.k),
        parameters={"k": 1.0},
    )  # fmt: skip
    solution = vc.solve(problem)
    assert solution.value == pytest.approx(1.0, rel=1e-12)
    assert solution.sensitivities["k"] != solution.sensitivities["k"]


@pytest.mark.parametrize("method", METHODS, ids=str)
def test_a_moved_end_has_the_momentum_for_a_rate(method):
    """Of y'² + y² from 0 to b the least is b² coth 1."""
    problem = vc.Problem(
        lambda x, y, v, p: v**2 + y**2, vc.Fixed(0, 0), vc.Fixed(1, vc.Parameter("b")), parameters={"b": 2.0}
    )
    solution = vc.solve(problem, method)
    assert solution.sensitivities["b"] == pytest.approx(4 / np.tanh(1), rel=1e-5)
