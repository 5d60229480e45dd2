"""Loads and coefficients that oscillate faster than any first mesh."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np

from campaigns.adversaries.momentum import pieces, quadratic
from campaigns.adversaries.switches import heights
from campaigns.least import Least
from campaigns.statement import Statement


def fast_loads(random: np.random.Generator) -> Statement:
    """v^2/2 - A cos(w x + phi) y on (0, 1): the impulse A (sin(w x + phi) - sin phi)/w is integrated in closed form.

    With B = A/w, the integral of the impulse is B ((cos phi - cos(w + phi))/w - sin phi), and that of its square
    B^2 (1/2 - (sin 2(w + phi) - sin 2 phi)/(4 w) - 2 sin phi (cos phi - cos(w + phi))/w + sin^2 phi).
    """
    w, phi = 10 ** random.uniform(1, 5), random.uniform(0, 2 * math.pi)
    A = random.choice([-1, 1]) * random.uniform(0.5, 5) * w ** random.uniform(0, 1)
    y0, y1 = heights(random)
    B, fall = A / w, (math.cos(phi) - math.cos(w + phi)) / w
    first = B * (fall - math.sin(phi))
    second = B**2 * (
        0.5 - (math.sin(2 * (w + phi)) - math.sin(2 * phi)) / (4 * w) - 2 * math.sin(phi) * fall + math.sin(phi) ** 2
    )
    value = quadratic((1.0, first, second), B * (math.sin(w + phi) - math.sin(phi)), y0, y1)
    # round-off of a phase of many turns is round-off of the problem
    least = Least(value, sole=True, within=1e-14 * w * B**2)
    return Statement(lambda x, y, v: v**2 / 2 - A * ca.cos(w * x + phi) * y, (0.0, y0), (1.0, y1), least)


def fast_coefficients(random: np.random.Generator) -> Statement:
    """(m + sin(w x)) v^2 on (0, 1), m > 1; the compliance of a period is 2 pi/(w sqrt(m^2 - 1)).

    Gradshteyn and Ryzhik, "Table of Integrals, Series, and Products", 2.551.3.
    """
    w, m = 10 ** random.uniform(1, 5), 1 + 10 ** random.uniform(-2, 0.5)
    turns = math.floor(w / (2 * math.pi))
    phase, weights = pieces(0.0, w - 2 * math.pi * turns, [], 200)
    compliance = (turns * 2 * math.pi / math.sqrt(m**2 - 1) + float(weights @ (1 / (m + np.sin(phase))))) / w
    rise = random.uniform(0.5, 2)
    return Statement(
        lambda x, y, v: (m + ca.sin(w * x)) * v**2, (0.0, 0.0), (1.0, rise), Least(rise**2 / compliance, sole=True)
    )
