"""Random functionals of other kinds: two functions, levels, waypoints, closed curves, second order.

None has a value that is known beforehand (see ``campaigns/least_seen.py``).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

import varcalc as vc


@dataclass(frozen=True)
class Kind:
    """How many functions, of what order, and what is asked of them; an end may be free where that is not settled."""

    functions: int = 1
    order: int = 1
    levelled: bool = False
    closed: bool = False
    through: bool = False
    free: bool | None = False


KINDS = {
    "pair": Kind(functions=2), "free-pair": Kind(functions=2, free=True), "level": Kind(levelled=True, free=None),
    "levelled-pair": Kind(functions=2, levelled=True), "closed": Kind(closed=True),
    "waypoint": Kind(through=True, free=None), "bent": Kind(order=2, free=None),
    "bent-pair": Kind(functions=2, order=2),
}  # fmt: skip


class Switches:
    """What switches: as it is stated, or rounded off."""

    def __init__(self, rounded: float = 0.0) -> None:
        self._rounded = rounded

    def size(self, u: Any) -> Any:
        """|u|."""
        return ca.sqrt(u * u + self._rounded**2) if self._rounded else ca.fabs(u)

    def step(self, u: Any) -> Any:
        """1 where u is positive, else 0."""
        return 0.5 * (1 + ca.tanh(u / (5 * self._rounded))) if self._rounded else ca.if_else(u > 0, 1, 0)

    def positive(self, u: Any) -> Any:
        """The larger of u and 0."""
        return 0.5 * (u + self.size(u))


Term = Callable[[Any, Any, Any, Switches], Any]
"""Of the square of the distance from a centre, of a sum of the functions, of x in units of the interval."""


def _terms(rng: np.random.Generator) -> list[Term]:
    """One of each class, with numbers of its own."""
    size, rate, width, phase = rng.uniform(-3, 3), rng.uniform(0.5, 5), rng.uniform(0.1, 0.6), rng.uniform(0, 6)
    first, second = rng.uniform(-1, 1, 2)
    return [
        lambda d, u, x, s: size * u,
        lambda d, u, x, s: abs(size) * d / 2,
        lambda d, u, x, s: abs(size) * (d - 0.5) ** 2 / 2,
        lambda d, u, x, s: size * ca.sin(rate * u + phase * x),
        lambda d, u, x, s: size * ca.exp(-d / width**2),
        lambda d, u, x, s: size * ca.tanh((u - first) / width),
        lambda d, u, x, s: size * s.size(u - first),
        lambda d, u, x, s: size * s.step(u - first - 0.3 * second * x),
        lambda d, u, x, s: abs(size) * (2 * s.positive(d - 0.5) - s.positive(0.3 - d)),
    ]


class Drawn:
    """The functional of a number and a kind, the same in every process."""

    def __init__(self, name: str, number: int) -> None:
        self.kind = kind = KINDS[name]
        rng = np.random.default_rng([93, list(KINDS).index(name), number])
        self.span = float(rng.choice([1.0, 2.0, 4.0]))
        self.free = bool(rng.integers(2)) if kind.free is None else kind.free
        self._form, self._masses = int(rng.integers(5)), np.round(rng.uniform([0.5, -0.6, 0.1], [2, 0.6, 1]), 3)
        self._terms = [
            (_terms(rng)[int(rng.integers(9))], rng.uniform(-1, 1, kind.functions), rng.uniform(-1, 1, kind.functions))
            for _ in range(rng.integers(1, 4))
        ]
        self.start, self.end = (np.round(rng.uniform(-1, 1, kind.functions), 3) for _ in range(2))
        self.slopes = np.round(rng.uniform(-1, 1, 2), 3)
        self.waypoint = round(self.span * rng.uniform(0.3, 0.7), 3), round(rng.uniform(-1, 1), 3)
        self._levelled, share = int(rng.integers(3)), rng.uniform(-0.8, 0.8)
        self.level = self._level_of_line() + (0.3 + 0.3 * share if self._levelled == 2 else share) * self.span

    def _level_of_line(self) -> float:
        rise = self.end - self.start
        mean = float((self.start + self.end).mean()) / 2
        square = float((self.start**2 + self.start * self.end + self.end**2).sum()) / 3
        return [mean * self.span, square * self.span, float(np.hypot(self.span, np.linalg.norm(rise)))][self._levelled]

    def potential(self, x: Any, y: Any, switches: Switches) -> Any:
        """The terms of a column y."""
        found: Any = 0.0
        for term, centre, shares in self._terms:
            distance = ca.sumsqr(y - ca.DM(centre))
            along = y[0] if self.kind.functions == 1 else ca.dot(ca.DM(shares), y)
            found = found + term(distance, along, x / self.span, switches)
        return found

    def lagrangian(self, x: Any, y: Any, v: Any, bends: Any, switches: Switches) -> Any:
        """L of columns."""
        mass, coupling, friction = self._masses.tolist()
        energy = mass * v[0] ** 2 / 2 + sum(v[k] ** 2 / 2 + 0.6 * coupling * v[0] * v[k] for k in range(1, v.numel()))
        potential = self.potential(x, y, switches)
        if self.kind.order == 2:
            others = 0.0, energy, -energy, friction * switches.size(v[0]), (ca.sumsqr(v) - 1) ** 2 / 4
            return 0.15 * ca.sumsqr(bends) + others[self._form] + potential
        return [
            energy + potential,
            (3.5 + ca.tanh(potential)) * ca.sqrt(1 + 2 * energy),
            energy * (1.5 + ca.sin(ca.sum1(y) + x)) + potential,
            energy + friction * switches.size(v[0]) + potential,
            energy + energy**2 / 2 + potential,
        ][self._form]

    def levelled(self, y: Any, v: Any) -> Any:
        """What is levelled, of columns."""
        return [ca.sum1(y) / y.numel(), ca.sumsqr(y), ca.sqrt(1 + ca.sumsqr(v))][self._levelled]

    @property
    def problem(self) -> vc.Problem:
        """As varcalc is asked."""
        kind, stated = self.kind, Switches()
        single = kind.functions == 1

        def column(y: Any) -> Any:
            return ca.vertcat(y) if single else y

        def whole(x: Any, y: Any, v: Any, bends: Any = None) -> Any:
            return self.lagrangian(x, column(y), column(v), None if bends is None else column(bends), stated)

        first, last = ((float(p[0]) if single else p.tolist()) for p in (self.start, self.end))
        slopes = [float(v) if single else [float(v)] * kind.functions for v in self.slopes]
        conditions: list[Any] = []
        if kind.levelled:
            conditions.append(vc.Isoperimetric(lambda x, y, v: self.levelled(column(y), column(v)), self.level))
        if kind.through:
            conditions.append(vc.Through(*self.waypoint))
        if kind.closed:
            return vc.Problem(whole, vc.Periodic(0.0, self.span), vc.Periodic(0.0, self.span), conditions)
        if kind.order == 1:
            end = vc.Free(self.span, n=kind.functions) if self.free else vc.Fixed(self.span, last)
            return vc.Problem(whole, vc.Fixed(0.0, first), end, conditions)
        end = vc.Free(self.span, n=kind.functions) if self.free else vc.Fixed(self.span, last, slopes[1])
        return vc.Problem(whole, vc.Fixed(0.0, first, slopes[0]), end, conditions, order=2)
