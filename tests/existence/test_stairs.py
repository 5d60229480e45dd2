"""Lagrangians that jump at every whole number of an argument, of which no one names the places."""

import math
from itertools import pairwise

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import brentq

import varcalc as vc

CUTS = np.arange(-40, 41) / 24.0
"""Between these nothing jumps in what follows."""


def between(low, high, rate):
    """int of rate(y) dy, of what is linear between the cuts: by its middles."""
    cuts = np.unique(np.concatenate([[low, high], CUTS[(low < CUTS) & (high > CUTS)]]))
    return math.fsum((b - a) * rate((a + b) / 2) for a, b in pairwise(cuts))


STAIRS = {
    "floor": (lambda y, lib: 3 + lib.floor(2 * y), 0.1),
    "floor, begun on a step": (lambda y, lib: 3 + lib.floor(2 * y), 0.0),
    "four steps, with a flat place beside the way": (lambda y, lib: 1 + lib.floor(4 * y), 0.05),
    "ceiling": (lambda y, lib: 3 + lib.ceil(3 * y), 0.1),
    "teeth": (lambda y, lib: 3 + lib.fmod(3 * y, 1), 0.1),
    "teeth on both sides of zero": (lambda y, lib: 3 + lib.fmod(3 * y, 1), -0.6),
    "nearest": (lambda y, lib: 3 + lib.remainder(2 * y, 1), 0.1),
    "sign of another": (lambda y, lib: 3 + lib.copysign(1, y - 0.5), 0.1),
}


@pytest.mark.parametrize("name", STAIRS)
def test_a_weight_that_is_stairs_is_crossed_at_all_of_them(name):
    """By Cauchy and Schwarz int w² y'² dx over [0, 1] is no less than (int w dy)², and is that where w y' is still."""
    weight, low = STAIRS[name]
    solution = vc.solve(vc.Problem(lambda x, y, v: weight(y, ca) ** 2 * v**2, vc.Fixed(0, low), vc.Fixed(1, 0.9)))
    exact = between(low, 0.9, lambda y: weight(y, math)) ** 2
    assert abs(solution.value - exact) <= max(10 * solution.error.value, 1e-12 * exact)
    assert not solution.local


@pytest.mark.parametrize("drop", [0.5, -0.5])
def test_a_motion_down_stairs_keeps_its_energy(drop):
    """int v²/2 + drop floor(3 y): v²/2 - drop floor(3 y) = E on every step, whose sum of times is 1."""
    cuts = [0.1, 1 / 3, 2 / 3, 0.9]
    steps = [(b - a, drop * k) for k, (a, b) in enumerate(pairwise(cuts))]
    least = max(-height for _, height in steps)
    energy = brentq(lambda e: sum(d / math.sqrt(2 * (e + h)) for d, h in steps) - 1, least + 1e-9, 1e3, xtol=1e-15)
    exact = sum(d * math.sqrt(2 * (energy + h)) for d, h in steps) - energy
    stairs = vc.Problem(lambda x, y, v: v**2 / 2 + drop * ca.floor(3 * y), vc.Fixed(0, 0.1), vc.Fixed(1, 0.9))
    solution = vc.solve(stairs)
    assert abs(solution.value - exact) <= max(10 * solution.error.value, 1e-13)


def test_one_of_two_functions_crosses_stairs():
    def weighted(x, y, v):
        return (3 + ca.floor(2 * y[0])) ** 2 * v[0] ** 2 + v[1] ** 2

    solution = vc.solve(vc.Problem(weighted, vc.Fixed(0, (0.1, 0)), vc.Fixed(1, (0.9, 1))))
    assert solution.value == pytest.approx((3 * 0.4 + 4 * 0.4) ** 2 + 1, rel=1e-13)
