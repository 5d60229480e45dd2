"""Random functionals under bounds, levels, waypoints, sliding ends and costs of ends, all at once.

Everything asked is met by one curve that is drawn first, so that something admitted is known of each. No least value is
known beforehand (see ``campaigns/conditioned_least.py``).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

import varcalc as vc
from campaigns.kinds import Switches

SAMPLES = 2001
"""Places at which the curve that is drawn first is looked at."""

Density = Callable[[Any, Any, Any], Any]
"""Of x and columns of ordinates and slopes."""


@dataclass(frozen=True)
class Range:
    """What lies between two numbers: along the curve (a bound), or its integral (a level)."""

    name: str
    of: Density
    lower: float
    upper: float


@dataclass(frozen=True)
class End:
    """An end at ``x``, where the ordinates ``y``, and slopes, are given or free, or which slides on phi(x, y) = 0."""

    x: float
    y: np.ndarray
    slopes: np.ndarray
    free: bool = False
    phi: Callable[[Any, Any], Any] | None = None


class Witness:
    """A smooth curve, which meets all that is asked: what its ordinates and slopes are at x."""

    def __init__(self, rng: np.random.Generator, span: float, functions: int, closed: bool) -> None:
        self.span, self._functions = span, functions
        ends = np.round(rng.uniform(-1, 1, (2, functions)), 3)
        self._start, self._rise = ends[0], 0 * ends[1] if closed else ends[1] - ends[0]
        turns = np.arange(1, 4) * (2 if closed else 1) * np.pi / span
        self._waves = np.round(rng.normal(size=(functions, 3)) / np.arange(1, 4) ** 2 * rng.choice([0.0, 0.3]), 3)
        self._turns = turns

    def y(self, x: Any) -> np.ndarray:
        """The ordinates, (functions, m)."""
        x = np.atleast_1d(x)
        straight = self._start[:, None] + self._rise[:, None] * x / self.span
        return straight + self._waves @ np.sin(np.outer(self._turns, x))

    def slopes(self, x: Any) -> np.ndarray:
        """Their derivatives, (functions, m)."""
        x = np.atleast_1d(x)
        return self._rise[:, None] / self.span + (self._waves * self._turns) @ np.cos(np.outer(self._turns, x))


class Conditioned:
    """The functional of a number, the same in every process: of a graph, or of what is ``other`` than one graph."""

    def __init__(self, other: bool, number: int) -> None:
        rng = np.random.default_rng([4711, int(other), number])
        self.span = float(rng.choice([1.0, 2.0, 4.0]))
        self.functions = int(rng.choice([1, 2])) if other else 1
        self.order = int(rng.choice([1, 1, 2])) if other else 1
        self.closed = other and rng.uniform() < 0.4
        self.maximise = other and rng.uniform() < 0.25
        witness = self.witness = Witness(rng, self.span, self.functions, self.closed)
        self._form, self._numbers = int(rng.integers(7)), np.round(rng.uniform([0.1, -1, 0.3], [1, 1, 1.5]), 3)
        self._terms = [_term(rng) for _ in range(rng.integers(1, 4))]
        # where ends slide far, or curves are free, little else keeps most functionals above some number
        self._floor = float(rng.choice([0.0, 1.0], p=[0.25, 0.75]))
        shares = (0.6, 0.25, 0.15) if other else (0.4, 0.25, 0.35)
        self.ends = [self._end(rng, x, shares) for x in (0.0, self.span)]
        self.bounds = [_bound(rng, witness) for _ in range(rng.choice([0, 1, 2], p=[0.3, 0.55, 0.15]))]
        levelled = rng.permutation(5)[: rng.choice([0, 1, 2], p=[0.5, 0.4, 0.1])].tolist()
        self.levels = [_level(rng, witness, which) for which in levelled]
        place = round(self.span * rng.uniform(0.3, 0.7), 3)
        slides = any(end.phi for end in self.ends)  # where places inside are none
        self.waypoint = place if other and not slides and rng.uniform() < 0.25 else None
        self._cost = _cost(rng, witness) if rng.uniform() < 0.4 and self._moves else None

    def _end(self, rng: np.random.Generator, x: float, shares: tuple[float, ...]) -> End:
        y, slopes = (value(x)[:, 0] for value in (self.witness.y, self.witness.slopes))
        which = rng.choice(3, p=shares)
        steep, bent, radius = np.round(rng.uniform([-1.5, -1, 0.3], [1.5, 1, 1]), 3).tolist()
        curves: list[Callable[[Any, Any], Any]] = [
            lambda at, to: (to - y[0]) - steep * (at - x),
            lambda at, to: (to - y[0]) - steep * (at - x) - bent * (at - x) ** 2,
            lambda at, to: (at - x) - bent * (to - y[0]),
            lambda at, to: (at - x) ** 2 + (to - y[0] + radius) ** 2 - radius**2,
        ]
        phi = curves[rng.integers(4)]
        slides = which == 2 and self.functions == self.order == 1 and not self.closed
        return End(x, y, slopes, which == 1, phi if slides else None)

    @property
    def _moves(self) -> bool:
        return not self.closed and any(end.free or end.phi for end in self.ends)

    @property
    def sign(self) -> float:
        """-1 where the greatest value is asked for."""
        return -1.0 if self.maximise else 1.0

    @property
    def name(self) -> str:
        """What it is made of, in a few words."""
        ends = ["closed"] if self.closed else ["slides" if e.phi else "free" if e.free else "fixed" for e in self.ends]
        parts = [f"{self.functions} of order {self.order}", *ends]
        parts += [f"bound {r.name}" for r in self.bounds] + [f"level {r.name}" for r in self.levels]
        parts += ["waypoint"] * (self.waypoint is not None) + ["cost"] * (self._cost is not None)
        return f"form {self._form}, " + ", ".join([*parts, *["maximum"] * self.maximise])

    def lagrangian(self, x: Any, y: Any, v: Any, bends: Any, switches: Switches) -> Any:
        """L of columns, in the sense that is minimised."""
        friction, slope, mass = self._numbers.tolist()
        potential = sum(term(x / self.span, y, switches) for term in self._terms)
        potential = potential + self._floor * (1 + ca.sumsqr(y) / 2)
        first = v[0]
        energy = ca.sumsqr(v) / 2 + (mass - 1) * first**2 / 4
        if self.order == 2:
            potential = potential + 0.1 * ca.sumsqr(bends)
        return [
            energy + potential,
            mass * energy + potential,
            energy + ca.sumsqr(v) ** 2 / 4 + potential,
            (ca.sumsqr(v) - mass) ** 2 / 4 + potential,
            (4 + ca.tanh(potential)) * ca.sqrt(1 + ca.sumsqr(v)) + (0.1 * ca.sumsqr(bends) if self.order == 2 else 0),
            energy + friction * switches.size(first) + potential,
            energy + friction * switches.size(first - slope) + potential,
        ][self._form]

    def cost(self, x0: Any, y0: Any, x1: Any, y1: Any, switches: Switches) -> Any:
        """What the ends cost, in the same sense."""
        return 0.0 if self._cost is None else self._cost(x0, y0, x1, y1, switches)

    @cached_property
    def problem(self) -> vc.Problem:
        """As varcalc is asked."""
        single, stated, sign = self.functions == 1, Switches(), self.sign

        def column(y: Any) -> Any:
            return None if y is None else ca.vertcat(y)

        def whole(x: Any, y: Any, v: Any, bends: Any = None) -> Any:
            return sign * self.lagrangian(x, column(y), column(v), column(bends), stated)

        def of(density: Density) -> Callable[..., Any]:
            return lambda x, y, v, bends=None: density(x, column(y), column(v))

        def edges(given: Range) -> dict[str, float]:
            return {k: v for k, v in (("lower", given.lower), ("upper", given.upper)) if np.isfinite(v)}

        def end_cost(x0: Any, y0: Any, x1: Any, y1: Any) -> Any:
            return sign * self.cost(x0, column(y0), x1, column(y1), stated)

        conditions: list[Any] = [vc.Bound(of(b.of), **edges(b)) for b in self.bounds]
        conditions += [vc.Isoperimetric(of(g.of), **edges(g)) for g in self.levels]
        if self.waypoint is not None:
            there = self.witness.y(self.waypoint)[:, 0]
            conditions.append(vc.Through(self.waypoint, float(there[0]) if single else there.tolist()))
        start, end = (vc.Periodic(0.0, self.span, self.functions),) * 2 if self.closed else map(self._asked, self.ends)
        return vc.Problem(
            whole, start, end, conditions, order=self.order, maximise=self.maximise,
            end_cost=None if self._cost is None else end_cost,
        )  # fmt: skip

    def _asked(self, end: End) -> Any:
        if end.phi is not None:
            return vc.OnCurve(end.phi, end.x)
        if end.free:
            return vc.Free(end.x, n=self.functions)
        y, slopes = ((float(v[0]) if self.functions == 1 else v.tolist()) for v in (end.y, end.slopes))
        return vc.Fixed(end.x, y, slopes if self.order == 2 else None)


Term = Callable[[Any, Any, Switches], Any]
"""Of x in units of the interval, and a column of ordinates."""


def _term(rng: np.random.Generator) -> Term:
    size, rate, level, width, phase = np.round(rng.uniform([-2.5, 0.5, -1, 0.2, -4], [2.5, 5, 1, 0.6, 4]), 3).tolist()
    part = float(np.round(rng.uniform(-1, 1), 3))

    def along(y: Any) -> Any:
        return y[0] if y.numel() == 1 else y[0] + part * y[1]

    def far(y: Any) -> Any:
        return ca.sumsqr(y - level)

    terms: list[Term] = [
        lambda x, y, s: size * along(y),
        lambda x, y, s: size * ca.cos(phase * x) * along(y),
        lambda x, y, s: abs(size) * far(y) / 2,
        lambda x, y, s: abs(size) * (far(y) - 0.5) ** 2 / 2,
        lambda x, y, s: size * ca.sin(rate * along(y) + phase * x),
        lambda x, y, s: size * ca.exp(-far(y) / width**2),
        lambda x, y, s: size * ca.tanh((along(y) - level) / width),
        lambda x, y, s: size * s.size(along(y) - level),
        lambda x, y, s: size * s.step(along(y) - level - 0.3 * part * x),
    ]
    return terms[rng.integers(len(terms))]


def _bound(rng: np.random.Generator, witness: Witness) -> Range:
    """Of the ordinate, of that less a function of x, or of the slope, on one side or on both."""
    size, rate, phase = np.round(rng.uniform([0.1, 0.5, 0], [1, 4, 6]), 3).tolist()
    below, above = np.round(10 ** rng.uniform(-1.7, -0.2, 2), 3).tolist()
    which, sides, component = int(rng.integers(4)), int(rng.integers(3)), int(rng.integers(witness.y(0.0).size))
    names = "y", "y less a wave", "y less a parabola", "v"
    densities: list[Density] = [
        lambda x, y, v: y[component],
        lambda x, y, v: y[component] - size * ca.sin(rate * x + phase),
        lambda x, y, v: y[component] - size * (x / witness.span - 0.5) ** 2,
        lambda x, y, v: v[component],
    ]
    values = _along(witness, densities[which])
    lower = float(values.min()) - below if sides != 1 else -np.inf
    upper = float(values.max()) + above if sides != 0 else np.inf
    return Range(names[which] + (" below", " above", " both ways")[sides], densities[which], lower, upper)


def _level(rng: np.random.Generator, witness: Witness, which: int) -> Range:
    """The integral of one density, by its number: what the first curve has, or no more or no less than nearly that."""
    names = "y", "y squared", "length", "v squared", "x y"
    densities: list[Density] = [
        lambda x, y, v: ca.sum1(y),
        lambda x, y, v: ca.sumsqr(y),
        lambda x, y, v: ca.sqrt(1 + ca.sumsqr(v)),
        lambda x, y, v: ca.sumsqr(v),
        lambda x, y, v: x * y[0],
    ]
    sort, room = int(rng.integers(4)), float(np.round(10 ** rng.uniform(-2, -0.3), 3))
    values = _along(witness, densities[which])
    value = float(np.trapezoid(values, dx=witness.span / (SAMPLES - 1)))
    # a stretched string has one curve, or none: the first curve is no shortest one where there is room
    least = value + room if names[which] in ("length", "v squared") else value
    # at least so long, or so steep, are curves that alternate ever faster: nothing attains their infimum
    if sort == 0 or (sort == 1 and names[which] in ("length", "v squared")):
        return Range(names[which] + " at most", densities[which], -np.inf, value + room)
    if sort == 1:
        return Range(names[which] + " at least", densities[which], value - room, np.inf)
    return Range(names[which], densities[which], least, least)


def _along(witness: Witness, density: Density) -> np.ndarray:
    x = np.linspace(0.0, witness.span, SAMPLES)
    at, y, v = ca.SX.sym("x"), *(ca.SX.sym(name, witness.y(0.0).size) for name in "yv")
    function = ca.Function("density", [at, y, v], [density(at, y, v)])
    return np.asarray(function(x[None], witness.y(x), witness.slopes(x))).ravel()


def _cost(rng: np.random.Generator, witness: Witness) -> Callable[..., Any]:
    size, level = np.round(rng.uniform([0.2, -1], [2, 1]), 3).tolist()
    costs: list[Callable[..., Any]] = [
        lambda x0, y0, x1, y1, s: size * ca.sumsqr(y1 - level) + 0.3 * size * ca.sumsqr(y0),
        lambda x0, y0, x1, y1, s: size * s.size(y1[0] - level),
        lambda x0, y0, x1, y1, s: size * (ca.sum1(y0) - ca.sum1(y1)) + 0.2 * ca.sumsqr(y1),
        lambda x0, y0, x1, y1, s: size * (x1 - x0 - witness.span) ** 2 + 0.5 * ca.sumsqr(y1 - y0),
    ]
    return costs[rng.integers(len(costs))]
