"""Extremals whose slope ends at the edge of the domain of L, against closed forms.

Of y^a sqrt(1 - y'^2) the first integral is y^a / sqrt(1 - y'^2) = h^a: where y is 0 the slope is 1, L_y'y' infinite.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import beta

import varcalc as vc
from varcalc.methods.ritz.system import RitzSystem

TOL = 1e-10


def arch(power: float) -> float:
    """The greatest integral of y^a sqrt(1 - y'^2) from y = 0 to y = 0 over a unit of arc length."""
    inverse = 1 / (2 * power)
    height = 1 / (2 * inverse * beta(inverse, 0.5))
    return 2 * height ** (power + 1) * inverse * beta(1 + inverse, 0.5)


def is_solved(problem, value):
    found = vc.solve(problem)
    assert found.status.ok
    assert not found.local
    assert abs(found.value - value) <= max(found.error.value, 1e-15 * max(1.0, abs(value)))
    assert found.error.value <= TOL * max(1.0, abs(value))
    return found


@pytest.mark.parametrize("power", [0.7, 1.0, 2.0, 3.0])
@pytest.mark.parametrize("free", [False, True])
def test_arch(power, free):
    # y = 0 is stationary too where the power is large, and curves above it do better
    # half of it, to a free end in the middle; of y^1 it is the area below a semicircle
    end = vc.Free(0.5) if free else vc.Fixed(1, 0)
    area = vc.Problem(lambda s, y, v: y**power * np.sqrt(1 - v**2), vc.Fixed(0, 0), end, maximise=True)
    is_solved(area, arch(power) / (2 if free else 1))


def test_arch_of_two_functions():
    area = vc.Problem(
        lambda s, y, v: -y[0] * np.sqrt(1 - v[0] ** 2 - v[1] ** 2), vc.Fixed(0, [0, 0]), vc.Fixed(1, [0, 0])
    )
    is_solved(area, -1 / (2 * math.pi))


def test_weight_of_the_abscissa():
    # x y' / sqrt(1 - y'^2) = p: the slope is p / sqrt(p^2 + x^2)
    rise = 0.5
    p = brentq(lambda p: p * math.asinh(1 / p) - rise, 1e-3, 10.0, xtol=1e-15)
    problem = vc.Problem(lambda x, y, v: x * np.sqrt(1 - v**2), vc.Fixed(0, 0), vc.Fixed(1, rise), maximise=True)
    is_solved(problem, (math.sqrt(1 + p * p) - p * p * math.asinh(1 / p)) / 2)


def barrier(power):
    """The rise over a unit of x, and the integral of x^n log(1 - y'^2), along x^n 2 y' / (1 - y'^2) = 2 p."""
    # with w = x^n / 2p the slope is sqrt(1 + w^2) - w, and 1 - y'^2 = 2 w y'
    p = 0.5
    nodes, weights = np.polynomial.legendre.leggauss(60)
    x = (1 + nodes) / 2
    w = x**power / (2 * p)
    slope = np.sqrt(1 + w**2) - w
    # the integral of x^n log(x^n) is -n / (n + 1)^2
    value = float(weights @ (x**power * np.log(slope / p))) / 2 - power / (power + 1) ** 2
    return float(weights @ slope) / 2, value


@pytest.mark.parametrize("power", [2, 3])
@pytest.mark.parametrize("at_start", [True, False])
def test_barriers(power, at_start):
    rise, value = barrier(power)

    def lagrangian(x, y, v):
        return (x if at_start else 1 - x) ** power * np.log(1 - v**2)

    found = is_solved(vc.Problem(lagrangian, vc.Fixed(0, 0), vc.Fixed(1, rise), maximise=True), value)
    assert found.stats.elements == 1


def test_barriers_of_two_functions():
    rise, value = barrier(3)
    problem = vc.Problem(
        lambda x, y, v: x**3 * np.log(1 - v[0] ** 2 - v[1] ** 2),
        vc.Fixed(0, [0, 0]), vc.Fixed(1, [0.6 * rise, 0.8 * rise]), maximise=True,
    )  # fmt: skip
    is_solved(problem, value)


@pytest.mark.parametrize(("power", "n"), [(0.5, 2), (0.63, 12), (0.77, 20)])
@pytest.mark.parametrize("at_start", [True, False])
def test_infinite_at_the_end_whatever_the_slope(power, n, at_start):
    # 1 / sqrt(1 - y'^2) - y^-a = E, with y = u^n and n so large that all is smooth
    E = 1.5
    nodes, weights = np.polynomial.legendre.leggauss(80)
    u = (1 + nodes) / 2
    y, dy = u**n, n * u ** (n - 1) * weights / 2
    inverse = 1 / (E + y**-power)
    slope = np.sqrt(1 - inverse**2)
    width, value = float((dy / slope).sum()), float((dy * (y**-power - inverse) / slope).sum())
    ends = vc.Fixed(0, 0), vc.Fixed(width, 1)
    problem = vc.Problem(
        lambda x, y, v: y**-power - np.sqrt(1 - v**2), *(ends if at_start else (vc.Fixed(0, 1), vc.Fixed(width, 0)))
    )
    is_solved(problem, value)


def test_edges_at_which_l_is_finite():
    # L_y' = asin y' falls by pi x: y' = cos(pi x)
    problem = vc.Problem(
        lambda x, y, v: v * np.arcsin(v) + np.sqrt(1 - v**2) - np.pi * y, vc.Fixed(0, 0), vc.Fixed(1, 0)
    )
    found = is_solved(problem, 2 / math.pi)
    assert found.y(0.25) == pytest.approx(math.sin(math.pi / 4) / math.pi, abs=1e-7)


@pytest.mark.parametrize("at_start", [True, False])
def test_edges_at_which_the_slope_of_l_is_finite_and_l_infinite(at_start):
    # y' L_y' - L = -sqrt((1 - y'^2) / y) is -2 sqrt(k): the parabola y = x - k x^2
    k = 0.3
    rise, slope = 1 - k, 1 - 2 * k

    def lagrangian(x, y, v):
        return (v * np.arcsin(v) + np.sqrt(1 - v**2)) / np.sqrt(y)

    ends = (0, rise) if at_start else (rise, 0)
    problem = vc.Problem(lagrangian, vc.Fixed(0, ends[0]), vc.Fixed(1, ends[1]))
    # by parts, as d asin y' = -sqrt(k / y) dx
    is_solved(problem, 4 * math.sqrt(k) + 2 * math.sqrt(rise) * math.asin(slope))


def test_narrow_loads_beside_an_edge_are_seen():
    # beside the edge at 0 only what L makes of the slope is left alone: a load there still moves the curve
    load = lambda x: 2e3 / (1 + ((x - 0.02) / 1e-5) ** 2)  # noqa: E731
    problem = vc.Problem(lambda x, y, v: np.sqrt(x) * v**2 / 2 - load(x) * y, vc.Fixed(0, 0), vc.Fixed(1, 0))
    found = vc.solve(problem, throw=False)
    # a point load P at c lifts y there to P g, with y' = P (1 - G(c)) / sqrt(x) to its left: G = sqrt(x)
    point, place = 2e3 * 1e-5 * math.pi, math.sqrt(0.02)
    assert not found.status.ok or found.value == pytest.approx(-(point**2) * place * (1 - place), rel=1e-2)


def test_a_descent_that_runs_into_an_edge_says_so_soon(monkeypatch):
    # the polygons of two discs begin next to y = 0, where y sqrt(1 + y'^2) loses Legendre's condition
    asked, evaluate = [], RitzSystem.evaluate
    monkeypatch.setattr(RitzSystem, "evaluate", lambda system, z: asked.append(z) or evaluate(system, z))
    film = vc.Problem(lambda x, y, dy: y * np.sqrt(1 + dy**2), vc.Fixed(-0.5, 1), vc.Fixed(0.5, 1))
    found = vc.solve(film)
    c = brentq(lambda c: c * math.cosh(0.5 / c) - 1, 0.7, 1.0, xtol=1e-15)
    assert found.value == pytest.approx(c / 2 + c * c / 2 * math.sinh(1 / c), rel=1e-12)
    assert len(asked) < 120
