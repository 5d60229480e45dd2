"""Random layers whose index saturates, switches, or grows without bound: drawn for :mod:`campaigns.layer_fans`."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np

from campaigns.layer_fans import Scenery
from varcalc import optics

FARTHEST = 300.0
"""Widths beyond which 1/cosh² is nothing."""


def hyperbolic_duct(rng: np.random.Generator) -> Scenery:
    """One to three ducts 1/cosh² of strengths from 1e-6 to 1e-1, which fall off more slowly than Gaussians."""
    k, size, width = rng.integers(1, 4), 10.0 ** rng.uniform(-6, -1), 10.0 ** rng.uniform(-1, 1)
    a, c, s = size * rng.uniform(-1, 1, k), width * rng.uniform(-2, 2, k), width * rng.uniform(0.3, 1.5, k)
    a[0] = size
    terms = list(zip(a.tolist(), c.tolist(), s.tolist(), strict=True))

    def bell(u: np.ndarray) -> np.ndarray:
        return 1 / np.cosh(np.clip(u, -FARTHEST, FARTHEST)) ** 2

    def g(y: np.ndarray) -> np.ndarray:
        return sum((2 * a * bell((y - c) / s) for a, c, s in terms), np.ones_like(y))

    def slope(y: np.ndarray) -> np.ndarray:
        return sum((-4 * a * bell((y - c) / s) * np.tanh((y - c) / s) / s for a, c, s in terms), np.zeros_like(y))

    medium = optics.Stratified(lambda y: ca.sqrt(1 + sum(2 * a / ca.cosh((y - c) / s) ** 2 for a, c, s in terms)))
    reach = 1.5 * width
    return Scenery(
        medium, g, slope, rng.uniform(-reach, reach), (-reach, reach), width / np.sqrt(2 * size), 3 * np.sqrt(2 * size)
    )


def saturated(rng: np.random.Generator) -> Scenery:
    """Two steps by tanh, one of them within a hundredth to all of the scene."""
    step, width = 10.0 ** rng.uniform(-3, -0.4) * rng.choice([-1, 1]), 10.0 ** rng.uniform(-2, 0)
    other = 10.0 ** rng.uniform(-3, -1)

    def n(y: np.ndarray) -> np.ndarray:
        return 1.4 + step * np.tanh(y / width) + other * np.tanh(2 * (y - 0.5))

    def slope(y: np.ndarray) -> np.ndarray:
        rate = step / width * (1 - np.tanh(y / width) ** 2) + 2 * other * (1 - np.tanh(2 * (y - 0.5)) ** 2)
        return 2 * n(y) * rate

    medium = optics.Stratified(lambda y: 1.4 + step * ca.tanh(y / width) + other * ca.tanh(2 * (y - 0.5)))
    turn = max(width, 0.1) / np.sqrt(abs(step))
    return Scenery(medium, lambda y: n(y) ** 2, slope, rng.uniform(-1, 1), (-1, 1), turn, 3.0, steps=400)


def switched(rng: np.random.Generator) -> Scenery:
    """n² linear in pieces, as written by ``if_else`` and ``fabs``: to where it is nothing, or to a second kink."""
    height, fall, depth = rng.uniform(0.5, 2), 10.0 ** rng.uniform(-1.5, 0), rng.uniform(0.2, 1)
    kind = int(rng.integers(3))
    if kind == 0:
        pieces = (np.array([-1e4, height, height + 2 / fall]), np.array([1.0, 1.0, -1.0]))
    elif kind == 1:
        pieces = (height / 4 + np.array([-3, 0, 3]) / fall, np.array([-1.5, 1.5, -1.5]))
    else:
        pieces = (np.array([-1e4, height, height + depth, 1e4]), np.array([1.0, 1.0, *[1 - fall * depth] * 2]))

    def squared(y: ca.SX) -> ca.SX:
        if kind == 1:
            return 1.5 - fall * ca.fabs(y - height / 4)
        above = 1 - fall * (y - height)
        return ca.if_else(y > height, ca.if_else(y > height + depth, 1 - fall * depth, above) if kind else above, 1.0)

    return Scenery(
        optics.Stratified(lambda y: ca.sqrt(squared(y))), lambda y: np.interp(y, *pieces), lambda y: 0.0 * y,
        rng.uniform(0, 0.4), (-0.4, 0.4), 4 / np.sqrt(fall), 3.0, pieces=pieces,
    )  # fmt: skip


def unbounded(rng: np.random.Generator) -> Scenery:
    """n = 1/√y written as a ``Graded`` index: rays are cycloids, and the index is infinite at y = 0."""

    def g(y: np.ndarray) -> np.ndarray:
        return np.where(y > 0, 1 / np.where(y > 0, y, 1), np.nan)

    return Scenery(
        optics.Graded(lambda x, y: 1 / ca.sqrt(y)), g, lambda y: -(g(y) ** 2), rng.uniform(0.3, 2), (0.2, 3), 2.0, 3.0,
        low=1e-6, steps=1000, turns=(0.3, 2),
    )  # fmt: skip


FAMILIES: dict[str, Callable[[np.random.Generator], Scenery]] = {
    "hyperbolic ducts": hyperbolic_duct, "saturated layers": saturated, "switched layers": switched,
    "unbounded indices": unbounded,
}  # fmt: skip
"""By name."""
