"""The parts of a line on which a motion is defined, each with a coordinate in which its ends are far away."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import casadi as ca
import numpy as np

from varcalc.symbolic.instructions import instructions
from varcalc.symbolic.places import places
from varcalc.symbolic.poles import poles
from varcalc.symbolic.tracing import Expression
from varcalc.symbolic.variation import SEEN_FROM_AFAR

LOG_LIMIT = 100.0
"""Of |u| where u is a logarithm: r⁶ is a number still."""
OSCILLATION_RANGE = 6.0
"""The same where W oscillates on and on: coordinates from -200 to 200, or a radius up to 400."""
LINE_LIMIT = 60.0
"""Of |arsinh q| where singular places are looked for: q up to 6e25."""
TURN = 2 * np.pi
AT_ZERO = 1e-15
"""A singular place so near to 0 is there."""
TURN_SHIFT = 0.3
"""By how much a turn that is looked at is shifted, so that it does not end at π."""
SINGULAR_OFFSET = 1e-6
"""From a singular place: where the two sides of it are compared."""
PERIODIC = 1e-9
"""Of the size of a function: by how much it may differ a turn farther on, if it is one of an angle."""
ANGLES = np.array([-2.61, -1.37, -0.73, 0.29, 0.91, 1.83, 2.77])
"""Angles at which that is asked; no two of them are symmetric."""


@dataclass(frozen=True)
class OpenChart:
    """The coordinates q between ``low`` and ``high``, by a coordinate u in which finite ends are infinitely far.

    ``turning`` says that q is an angle, and one turn of it is meant; ``oscillating`` that there is no end of what
    happens far away, so that no more than a part is looked at.
    """

    low: float
    high: float
    turning: bool = False
    oscillating: bool = False

    @property
    def limits(self) -> tuple[float, float]:
        """How far u goes."""
        if self.turning:
            return self.low, self.high
        limit = OSCILLATION_RANGE if self.oscillating else LOG_LIMIT
        return -limit, limit

    def place(self, u: Expression) -> Expression:
        """q at u."""
        if self.turning:
            return u
        if np.isinf(self.low) and np.isinf(self.high):
            return ca.sinh(u)
        if np.isinf(self.high):
            return self.low + ca.exp(u)
        if np.isinf(self.low):
            return self.high - ca.exp(-u)
        return self.low + (self.high - self.low) / (1 + ca.exp(-u))

    def coordinate(self, q: np.ndarray) -> np.ndarray:
        """u at q; not a number where q lies outside."""
        with np.errstate(all="ignore"):
            if self.turning:
                return self.low + np.mod(q - self.low, TURN)
            if np.isinf(self.low) and np.isinf(self.high):
                return np.arcsinh(q)
            if np.isinf(self.high):
                return np.log(q - self.low)
            if np.isinf(self.low):
                return -np.log(self.high - q)
            return np.log((q - self.low) / (self.high - q))


def is_angle(functions: Sequence[Expression], q: Expression) -> bool:
    """Whether functions of q, of its sine or cosine, are the same a turn farther on: told at random angles."""
    whole = ca.Function("whole", [q], [ca.densify(ca.vertcat(*functions))])
    if not _oscillates(functions, q):
        return False
    here, there = (np.array(whole(ANGLES[None, :] + turn)) for turn in (0.0, TURN))
    size = np.abs(here).max(axis=1, keepdims=True)
    with np.errstate(invalid="ignore"):
        return bool(np.all(np.isfinite(here)) and np.all(np.abs(here - there) <= PERIODIC * size))


def charts(functions: Sequence[Expression], q: Expression, covering: Expression) -> tuple[OpenChart, ...]:
    """The parts of the line on which all ``functions`` of q are numbers, cut at their singularities.

    Where ``covering``, the inertia of the coordinates that are gone, vanishes and is the same on both sides, as r² is,
    both sides are the same points of space (a radius, an angle from a pole), and the upper one is taken. Raises
    ValueError where the functions are singular at more places than can be told apart.
    """
    angle = is_angle(functions, q)
    z = ca.SX.sym("z")
    span = (-np.pi - TURN_SHIFT, np.pi - TURN_SHIFT) if angle else (-LINE_LIMIT, LINE_LIMIT)
    cuts: list[float] = []
    for pole in poles([ca.substitute(ca.vertcat(*functions), q, z if angle else ca.sinh(z))], [z]):
        here = places(pole, z, span)
        if here is None:
            raise ValueError("L is singular at more places than can be told apart")
        cuts += here
    found = np.unique([0.0 if abs(cut) < AT_ZERO else cut for cut in cuts])
    if angle and len(found) == 0:
        return (OpenChart(-np.pi, np.pi, turning=True),)
    ends = [*found, found[0] + TURN] if angle else [-np.inf, *np.sinh(found), np.inf]
    mirrors = {float(end) for end in ends if np.isfinite(end) and _mirror(covering, q, float(end))}
    endless = _oscillates(functions, q)
    parts = [
        OpenChart(float(a), float(b), oscillating=endless and bool(np.isinf([a, b]).any())) for a, b in pairwise(ends)
    ]
    return _once([part for part in parts if _defined(functions, q, part)], mirrors)


def _oscillates(functions: Sequence[Expression], q: Expression) -> bool:
    function = ca.Function("read", [q], [ca.densify(ca.vertcat(*functions))])
    return any(i.operation in SEEN_FROM_AFAR for i in instructions(function))


def _mirror(covering: Expression, q: Expression, cut: float) -> bool:
    """Whether ``covering`` vanishes at the ``cut`` and is the same on both sides."""
    function = ca.Function("covering", [q], [covering])
    away = np.array([SINGULAR_OFFSET, 0.1, 0.37, 0.7])
    above, below = (np.array(function((cut + way * away)[None, :])).ravel() for way in (1, -1))
    return bool(np.allclose(above, below, rtol=1e-6) and 0 < above[0] <= 1e-6 * above[-1])


def _once(parts: list[OpenChart], mirrors: set[float]) -> tuple[OpenChart, ...]:
    """The parts without those that are the same as one kept, through a mirror; those of positive q are kept first."""
    kept: list[OpenChart] = []
    for part in sorted(parts, key=lambda one: (one.high <= 0, one.low)):
        shared = {end for one in kept for end in (one.low, one.high)}
        if not any(end in shared for end in (part.low, part.high) if end in mirrors):
            kept.append(part)
    return tuple(sorted(kept, key=lambda one: one.low))


def _defined(functions: Sequence[Expression], q: Expression, chart: OpenChart) -> bool:
    u = ca.SX.sym("u")
    whole = ca.Function("whole", [u], [ca.densify(ca.substitute(ca.vertcat(*functions), q, chart.place(u)))])
    return bool(np.any(np.all(np.isfinite(np.array(whole(np.linspace(-3.1, 3.2, 9)[None, :]))), axis=0)))
