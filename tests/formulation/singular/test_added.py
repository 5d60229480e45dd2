"""What is added to L and changes no extremal: the derivative of a function of x and y, beside singular ends."""

from __future__ import annotations

import math

import casadi as ca
import pytest

import varcalc as vc
from varcalc.formulation.singular.added import added_derivative


def fall(x, y, v):
    return ca.sqrt((1 + v**2) / y)


ADDED = {
    "of y": (lambda x, y, v: 0.75 * v, lambda x, y: 0.75 * y),
    "of its square": (lambda x, y, v: 0.4 * y * v - 2 * (y * v + v), lambda x, y: -0.8 * y**2 - 2 * y),
    "of a product": (lambda x, y, v: ca.sin(x) * v + ca.cos(x) * y, lambda x, y: math.sin(x) * y),
    "of a quotient": (lambda x, y, v: (v - x * v) / 3 - y / 3, lambda x, y: (1 - x) * y / 3),
}


@pytest.mark.parametrize("method", [vc.Ritz(), vc.Collocation(), vc.FirstIntegral()])
@pytest.mark.parametrize("added", [ADDED["of y"], ADDED["of its square"]], ids=["of y", "of its square"])
def test_between_two_singular_ends(added, method):
    # a cycloid from cusp to cusp: 2 sqrt(pi)
    problem = vc.Problem(lambda x, y, v: fall(x, y, v) + added[0](x, y, v), vc.Fixed(0, 0), vc.Fixed(1, 0))
    solution = vc.solve(problem, method)
    assert solution.value == pytest.approx(2 * math.sqrt(math.pi), abs=1e-9)
    assert solution.y(0.5) == pytest.approx(1 / math.pi, abs=1e-6)


@pytest.mark.parametrize("maximise", [False, True])
@pytest.mark.parametrize("added", ADDED.values(), ids=list(ADDED))
def test_beside_one_singular_end(added, maximise):
    # half a cycloid of radius R = 1/pi, from its cusp to its lowest point: pi sqrt(2 R)
    sign = -1 if maximise else 1
    problem = vc.Problem(
        lambda x, y, v: sign * fall(x, y, v) + added[0](x, y, v), vc.Fixed(0, 0), vc.Fixed(1, 2 / math.pi),
        maximise=maximise,
    )  # fmt: skip
    expected = sign * math.sqrt(2 * math.pi) + added[1](1, 2 / math.pi) - added[1](0, 0)
    solution = vc.solve(problem)
    assert solution.value == pytest.approx(expected, abs=1e-10)
    assert vc.verify(solution).verdict is (vc.Verdict.MAXIMUM if maximise else vc.Verdict.MINIMUM)


def test_what_is_no_derivative_stays():
    def of(lagrangian):
        return added_derivative(vc.Problem(lagrangian, vc.Fixed(0, 1), vc.Fixed(1, 1)))

    assert of(fall) is None
    assert of(lambda x, y, v: fall(x, y, v) + x * y * v) is None  # linear in the slope, and a force across it


def test_what_a_product_brings_with_it_is_taken_away():
    problem = vc.Problem(lambda x, y, v: v**2 + x * v, vc.Fixed(0, 1), vc.Fixed(1, 1))
    rest = ca.Function("rest", problem.symbols.all, [added_derivative(problem).rest])
    assert float(rest(2.0, 3.0, 5.0, [], [], [])) == 25 - 3  # less (x y)' it is v^2 - y
