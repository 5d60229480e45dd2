"""What is narrower than the points of a quadrature tell, in the variable it runs in: dips and bumps of any width."""

import casadi as ca
import mpmath as mp
import numpy as np
import pytest
from scipy.optimize import brentq

import varcalc as vc
from varcalc.formulation import formulate


def solved(L):
    form = formulate(vc.Problem(L, vc.Fixed(0, 0), vc.Fixed(1, 1)))
    return vc.FirstIntegral().solve(form, tol=1e-12, guess=None)


def time_of_fall(index, place, width):
    """The least integral of n(y) sqrt(1 + y'^2) by n / sqrt(1 + y'^2) = c, on panels in y^1/2."""
    nodes, weights = np.polynomial.legendre.leggauss(24)
    inner = [place + side * width * 2**k for side in (-1, 0, 1) for k in range(-3, 30)]
    edges = np.sqrt(sorted({0.0, 1.0, *(2.0**-k for k in range(1, 20)), *(y for y in inner if 0 < y < 1)}))
    half = np.diff(edges)[:, None] / 2
    t = edges[:-1, None] + half * (1 + nodes)
    n, dy = index(t * t), 2 * t * half * weights

    def missed(c):
        return np.sum(dy * c / np.sqrt(n * n - c * c)) - 1

    c = brentq(missed, 0.1, 0.99, xtol=1e-16, rtol=1e-15)
    return np.sum(dy * np.sqrt(n * n - c * c)) + c


@pytest.mark.parametrize(("place", "width"), [(0.5, 1e-6), (0.371, 1e-3)])
def test_a_narrow_bump_on_a_brachistochrone(place, width):
    found = solved(lambda x, y, v: ca.sqrt((1 + v**2) / y) * (1 + 0.3 / (1 + ((y - place) / width) ** 2)))
    exact = time_of_fall(lambda y: (1 + 0.3 / (1 + ((y - place) / width) ** 2)) / np.sqrt(y), place, width)
    assert found.status.ok
    assert abs(found.value - exact) <= 10 * found.error.value + 1e-13


@pytest.mark.parametrize(
    ("height", "place", "width"),
    [
        (0.3, 0.5, 1e-7),
        (-0.9, 0.5, 1e-4),
        (0.3, 0.02, 1e-4),
        (-0.9, 0.02, 1e-2),
        (-0.9, 0.731, 1e-7),
        (3.0, 0.731, 1e-2),
    ],
)
def test_narrow_dips_and_bumps_of_a_metric_that_is_infinite_at_the_start(height, place, width):
    # the value is the square of the length, the integral of (1 + h / (1 + u^2)) / sqrt(y); with y = t^2 and
    # z = place + i width the bump's share is 2 h width Im of the integral of 1 / (t^2 - z)
    found = solved(lambda x, y, v: (1 + height / (1 + ((y - place) / width) ** 2)) ** 2 * v**2 / y)
    with mp.workdps(30):
        root = mp.sqrt(mp.mpc(place, width))
        share = (mp.log((1 - root) / (1 + root)) + mp.pi * 1j) / (2 * root)
        exact = (2 + 2 * mp.mpf(height) * mp.mpf(width) * share.imag) ** 2
    assert found.status.ok
    assert abs(found.value - float(exact)) <= 10 * found.error.value + 1e-14


def test_a_stiffness_of_hundreds_of_turns():
    """1 / (m + sin) is 1 / sqrt(m^2 - 1) on average over turns."""
    answer = solved(lambda x, y, dy: (1.015 + ca.sin(2 * np.pi * 120 * x)) * dy**2)
    assert abs(answer.value - (1.015**2 - 1) ** 0.5) <= answer.error.value < 1e-10
