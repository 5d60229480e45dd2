"""Features far narrower than any first mesh: soft spots of a string, loads on a few grains of it, slots beside it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import casadi as ca
import numpy as np
from scipy.integrate import quad
from scipy.special import erf

from campaigns.adversaries.momentum import about, pieces, quadratic, weighted
from campaigns.adversaries.switches import heights
from campaigns.least import Least
from campaigns.statement import Statement

Form = Callable[[ca.SX], ca.SX]
"""The form of a slot, in units of its width from the middle."""


def width_of(random: np.random.Generator, least: float = -6, most: float = -1) -> float:
    """A width of any order of magnitude."""
    return float(10 ** random.uniform(least, most))


def spots(random: np.random.Generator) -> Statement:
    """(1 - s exp(-((x - c)/w)^2)) v^2: the string is softer, or much stiffer, over a width w about c.

    The least value is the square of the rise over the integral of the compliance.
    """
    w, c = width_of(random), random.uniform(0.05, 0.95)
    s = 1 - 10 ** random.uniform(-4, -0.3) if random.uniform() < 0.7 else -(10 ** random.uniform(0, 3))
    # a compliance near its pole in the complex plane needs many panels
    x, weights = pieces(0.0, 1.0, about(c, w), 60)
    compliance = float(weights @ (1 / (1 - s * np.exp(-(((x - c) / w) ** 2)))))
    rise = random.uniform(0.5, 2)
    least = Least(rise**2 / compliance, sole=True)
    return Statement(
        lambda x, y, v: (1 - s * ca.exp(-(((x - c) / w) ** 2))) * v**2, (0.0, 0.0), (1.0, rise), least,
        points=about(c, w),
    )  # fmt: skip


def grains(random: np.random.Generator) -> Statement:
    """v^2/2 - A exp(-((x - c)/w)^2)/(w sqrt(pi)) y: a load A on a width w about c; its impulse is an error function."""
    w, c, A = width_of(random), random.uniform(0.05, 0.95), random.uniform(0.5, 4) * random.choice([-1, 1])
    y0, y1 = heights(random) if random.uniform() < 0.5 else (0.0, 0.0)
    x, weights = pieces(0.0, 1.0, about(c, w), 4)

    def impulse(x: np.ndarray) -> np.ndarray:
        return A / 2 * (erf((x - c) / w) + erf(c / w))

    value = quadratic(weighted(np.ones_like, impulse, x, weights), float(impulse(np.array([1.0]))[0]), y0, y1)
    return Statement(
        lambda x, y, v: v**2 / 2 - A * ca.exp(-(((x - c) / w) ** 2)) / (w * np.sqrt(np.pi)) * y, (0.0, y0), (1.0, y1),
        Least(value, sole=True), points=about(c, w),
    )  # fmt: skip


def slots(random: np.random.Generator) -> Statement:
    """v^2/2 - D f((y - c)/w), f one of exp(-u^2) and 1/(1 + u^2)."""
    slot = _Slot.drawn(random)
    tailed = random.uniform() < 0.5
    form: Form = (lambda u: 1 / (1 + u**2)) if tailed else (lambda u: ca.exp(-(u**2)))

    def speed(u: float) -> float:
        return float(np.sqrt(u**2 / (1 + u**2) if tailed else -np.expm1(-(u**2))))

    def way(far: float) -> float:
        edges = [0.0, *(e for e in (3.0, 30.0, 3e3, 3e5) if e < far), far]
        return sum(quad(speed, a, b, limit=200, epsrel=1e-13)[0] for a, b in pairwise(edges))

    return slot.statement(form, way)


def switched_slots(random: np.random.Generator) -> Statement:
    """The same where f is nothing beyond u = 1: a box, a tent, a parabola, its square, or two steps.

    A motion along the bottom of a box, or between two steps, keeps to the edge; the integrals over the others are
    elementary.
    """
    forms: list[tuple[Form, float]] = [
        (lambda u: ca.if_else(ca.fabs(u) < 1, 1, 0), 0.0),
        (lambda u: ca.if_else(u > -1, 1, 0) - ca.if_else(u > 1, 1, 0), 0.0),
        (lambda u: ca.fmax(0, 1 - ca.fabs(u)), 2 / 3),
        (lambda u: ca.fmax(0, 1 - u**2), 1 / 2),
        (lambda u: ca.fmax(0, 1 - u**2) ** 2, (2 * np.sqrt(2) - 1) / 3),
    ]
    slot = _Slot.drawn(random)
    form, inside = forms[random.integers(len(forms))]
    return slot.statement(form, lambda far: far - 1 + inside)


@dataclass(frozen=True)
class _Slot:
    """A slot far from both ends, and how deep it is for a motion to stay in it."""

    width: float
    place: float
    length: float
    rise: float
    depth: float

    @classmethod
    def drawn(cls, random: np.random.Generator) -> _Slot:
        """One of any width."""
        w, c = width_of(random), random.choice([-1, 1]) * random.uniform(0.4, 1.5)
        length, rise = random.uniform(2, 12), random.uniform(-0.3, 0.3)
        D = max(3.0, 32 * ((abs(c) + abs(c - rise)) / length) ** 2) * 10 ** random.uniform(0, 1.5)
        return cls(w, c, length, rise, D)

    def statement(self, form: Form, way: Callable[[float], float]) -> Statement:
        """v^2/2 - D f((y - c)/w): without energy beyond that at the bottom v^2/2 = D (1 - f), up to exp(-length/w).

        ``way`` is the integral of the root of 1 - f from the bottom to some u.
        """
        w, c, D = self.width, self.place, self.depth
        far = abs(c), abs(c - self.rise)
        least = Least(-D * self.length + np.sqrt(2 * D) * w * sum(way(distance / w) for distance in far))
        turns = far[0] / np.sqrt(2 * D), self.length - far[1] / np.sqrt(2 * D)

        def L(x: ca.SX, y: ca.SX, v: ca.SX) -> ca.SX:
            return v**2 / 2 - D * form((y - c) / w)

        return Statement(L, (0.0, 0.0), (self.length, self.rise), least, points=turns)
