"""Coordinates for a curve whose slope leaves an end at the edge of the slopes for which L is a number.

Where what L makes of the slope dies at an end, as in x^a sqrt(1 - y'^2), or L is infinite there whatever the slope, as
in y^-a - sqrt(1 - y'^2), the slope comes to the edge s like a power m of the distance. With x = x0 + t^b and
y = y0 + s (x - x0) + t^q z, q / b = 1 + m, the unknown z is smooth, free at that end and well inside the domain.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from varcalc.formulation import Conditions, Coordinates, Ends, Form, Sampled, Start, Stated, rewriter
from varcalc.formulation.singular.detection import GROWN, LARGEST_DENOMINATOR, PROBE, end_points
from varcalc.formulation.singular.indicial import MEASURED
from varcalc.formulation.singular.offsets import multiplied_out
from varcalc.formulation.singular.powers import scaling
from varcalc.numerics.mesh import gauss
from varcalc.problem.functional import Symbols
from varcalc.problem.problem import Problem

REACH = np.geomspace(1e-3, 1e3, 25)
"""Distances from the chord's slope, in units of it and 1, at which the domain of L is looked at."""
SECTIONS, ROUNDS = 64, 10
"""Parts in which the interval that holds an edge is cut at once, and times that it is."""
STANDS_STILL = 1e-12
"""Relative move of an edge between the distances of PROBE that is none."""
AGAIN = 1.0, 0.37
"""Shares of the distances of PROBE at which a power is measured."""
DEFICITS = np.geomspace(1.0, 1e-70, 701)
"""Distances from the edge, in units of the chord's, among which the slope of the extremal is looked for.

They come nearer: where parts of L_y' that are infinite at the edge cancel there is but round-off next to it.
"""
SUMMED = 1.1
"""Power of t, at least, that the integral of L from an end is to grow with where it is no whole one."""
LEAST_POWER, SMOOTH_SUM, MOST_POWER = 3, 3, 2 * LARGEST_DENOMINATOR
"""Powers of t: of the curve where no whole one makes it analytic, at least; of what L is summed to, that need not be
whole; and the most of x.
"""
WHOLE = 1e-3
"""Relative distance from a whole power of one that is whole."""
HALF_WAY = np.geomspace(1e-8, 1e8, 129)
"""Weights of a power of the distance by which a first curve turns from the edge to its other slope."""
NEXT_TO_END = 1e-6
"""Power of t beside an end where a curve given as a guess is not divided by less."""


@dataclass(frozen=True)
class _Edge:
    """The slope ``s`` at one end beyond which L is no number; ``side`` is +1 for the greatest slope, -1 for the least.

    ``other`` is the edge on the other side of the ``chord``'s slope, or as far from that as ``s`` where there is none.
    """

    problem: Problem
    at_start: bool
    s: float
    other: float
    chord: float

    @property
    def side(self) -> float:
        """+1 where L is a number below the edge, -1 where above it."""
        return math.copysign(1.0, self.s - self.chord)

    @cached_property
    def corner(self) -> np.ndarray:
        """The end (x0, y0)."""
        return end_points(self.problem)[0 if self.at_start else 1]

    @property
    def inward(self) -> float:
        """The length of the interval, negative at its end."""
        first, last = self.problem.span
        return last - first if self.at_start else first - last

    @cached_property
    def _near(self) -> ca.Function:
        """(L, L_x, L_y, L_y', y' L_y' - L) as functions of the distance and of how much the slope is short of s."""
        problem, symbols = self.problem, _symbols(self.problem)
        step, slope = math.copysign(1.0, self.inward) * symbols.x, self.s - self.side * symbols.y
        x, y = self.corner[0] + step, self.corner[1] + self.s * step
        rewrite = rewriter(problem, symbols, x, y, [slope], symbols.kind(1))
        old = problem.symbols
        slopes = ca.gradient(problem.integrand, ca.vertcat(old.x, old.y, old.dy))
        parts = [problem.integrand, *ca.vertsplit(slopes)]
        value, along, across, momentum = (multiplied_out(rewrite(part, False), symbols) for part in parts)
        rows = ca.vertcat(value, along, across, momentum, slope * momentum - value)
        return ca.Function("near", [symbols.x, symbols.y, symbols.parameters, symbols.unknowns], [ca.densify(rows)])

    def beside(self, distances: np.ndarray, short: np.ndarray) -> np.ndarray:
        """What :meth:`_near` tells (5, m) at ``distances`` from the end, the slope ``short`` of the edge by so much."""
        numbers = self.problem.parameter_values, self.problem.unknown_guesses
        return np.asarray(self._near(distances[None], short[None], *numbers))

    @cached_property
    def powers(self) -> tuple[float, float] | None:
        """m and k: the slope is short of the edge by d^m at a distance d, and L is d^k along the curve; None for none.

        Both are told from two pairs of distances: of round-off each makes another power.
        """
        told = ([self._power(share, summed=summed) for share in AGAIN] for summed in (True, False))
        m = next((m for m, again in told if m > MEASURED and abs(again - m) <= WHOLE * m), None)
        if m is None:
            return None
        unit, probes = abs(self.s - self.chord), abs(self.inward) * np.array(PROBE)
        values = np.abs(self.beside(probes, unit * (probes / probes[0]) ** m * 1e-3)[0])
        if not (np.isfinite(values).all() and (values > 0).all()):
            return None
        return m, math.log(values[0] / values[1]) / math.log(PROBE[0] / PROBE[1])

    def _power(self, share: float, *, summed: bool) -> float:
        """The power of the distance by which the slope is short of the edge, at PROBE times ``share``; NaN for none.

        The momentum L_y' is that of the chord half way where it changes little from there. Where it grows without end
        it is what L_y is ``summed`` to, or else the energy is that of the chord.
        """
        unit, probes = abs(self.s - self.chord), share * abs(self.inward) * np.array(PROBE)
        short, count = unit * DEFICITS, len(DEFICITS)
        near = self.beside(probes.repeat(count), np.tile(short, 2))[3:].reshape(2, 2, count)
        changes = probes * self.beside(probes, np.full(2, 0.5 * unit))[1:3]
        with np.errstate(divide="ignore", invalid="ignore"):
            grow = (np.abs(changes[:, 1]) > GROWN * np.abs(changes[:, 0])).tolist()
        middle = end_points(self.problem)[0] + end_points(self.problem)[1]
        at = self.problem.integrand_derivatives(0.5 * middle[:1], 0.5 * middle[1:, None], np.array([[self.chord]]))
        momentum = float(at.gradient[0, 2])
        if not grow[1]:
            rows, levels = near[0], np.full(2, momentum)
        elif summed:  # L_y' = C - the integral of L_y from here inward
            rows, levels = near[0], -math.copysign(1.0, self.inward) * changes[1]
        else:
            rows, levels = near[1], np.full(2, math.nan if grow[0] else self.chord * momentum - float(at.rows[0, 0]))
        if not (np.isfinite(levels).all() and (levels * levels[0] > 0).all()):
            return math.nan
        m = scaling(short, list(rows / levels[:, None]), 1.0)
        return math.nan if m is None else m

    @property
    def whole(self) -> tuple[int, int] | None:
        """(b, q) of x ~ t^b and y - y0 - s (x - x0) ~ t^q; None where no power serves, or L has no finite integral."""
        if self.powers is None or not self.powers[1] > -1.0:
            return None
        e, k = 1 + self.powers[0], 1 + self.powers[1]
        for b in range(1, math.floor(MOST_POWER / e) + 1):
            if _is_whole(b * e) and (_is_whole(b * k) or b * k >= SMOOTH_SUM):
                return b, round(b * e)
        b = max(math.ceil(LEAST_POWER / e), math.ceil(SUMMED / k))
        return None if b > MOST_POWER else (b, math.floor(b * e + MEASURED))

    def turning(self) -> Callable[[np.ndarray], np.ndarray]:
        """How far a curve falls behind the line along the edge, as shares of the interval from the end in its length.

        Its slope turns from the edge toward the other one; at the other end it has risen by as much as the chord.
        """
        assert self.powers is not None
        m, (nodes, weights) = self.powers[0], gauss(32)
        most = self.s - 0.5 * (self.chord + self.other)

        def behind(shares: np.ndarray, weight: float) -> np.ndarray:
            grown = weight * (0.5 * shares[:, None] * (1 + nodes)) ** m
            return most * 0.5 * shares * ((grown / (1 + grown)) @ weights)

        at_end = np.array([behind(np.ones(1), float(weight))[0] for weight in HALF_WAY])
        weight = math.exp(float(np.interp(abs(self.s - self.chord), np.abs(at_end), np.log(HALF_WAY))))
        return lambda shares: behind(shares, weight)


def edge_form(problem: Problem) -> Form | None:
    """The problem in t and z where the extremal leaves just one of its ends along an edge; None where it does not."""
    if problem.symbols.kind is not ca.SX:
        return None
    # of two that one end may be left along that is taken from which the curve has to turn the least
    edges = sorted(_edges(problem), key=lambda edge: abs(edge.s - edge.chord))
    found = [edge for edge in edges if edge.whole is not None]
    return _along(found[0]) if len({edge.at_start for edge in found}) == 1 else None


def _is_whole(power: float) -> bool:
    return abs(power - round(power)) <= WHOLE * power


def _symbols(problem: Problem) -> Symbols:
    s = problem.symbols
    return replace(Symbols.make(s.kind, 1, 1, 0, len(problem.unknowns)), parameters=s.parameters)


def _edges(problem: Problem) -> list[_Edge]:
    """The edges of the domain of L next to both ends that stand still, on either side of the chord's slope."""
    (x0, y0), (x1, y1) = (p.tolist() for p in end_points(problem))
    width = x1 - x0
    chord = (y1 - y0) / width
    corner = np.array([[x0, y0], [x1, y1]]).repeat(4, axis=0)
    steps = np.concatenate([width * np.array(PROBE).repeat(2), -width * np.array(PROBE).repeat(2)])
    sides = np.tile([1.0, -1.0], 4)

    def inside(slopes: np.ndarray) -> np.ndarray:
        """Whether L is a number next to the ends along lines of ``slopes`` (8, m)."""
        y = corner[:, 1:] + steps[:, None] * slopes
        x = np.broadcast_to((corner[:, 0] + steps)[:, None], y.shape)
        values = problem.integrand_values(x.ravel(), y.reshape(1, -1), slopes.reshape(1, -1))
        return np.isfinite(values).reshape(slopes.shape)

    low = np.full(8, chord)
    ladder = chord + sides[:, None] * (1 + abs(chord)) * REACH
    within = inside(ladder)
    ends = ~within.all(1) & inside(low[:, None])[:, 0]
    if not ends.any():
        return []
    high = ladder[np.arange(8), (~within).argmax(1)]
    for _ in range(ROUNDS):
        grid = low[:, None] + (high - low)[:, None] * np.linspace(0.0, 1.0, SECTIONS + 1)
        outside = ~inside(grid[:, 1:])
        first = np.where(outside.any(1), outside.argmax(1), SECTIONS - 1)
        low, high = (np.take_along_axis(grid, (first + k)[:, None], 1)[:, 0] for k in (0, 1))
    s = low.reshape(2, 2, 2)  # ends, distances, sides
    still = ends.reshape(2, 2, 2).all(1) & (np.abs(np.diff(s, axis=1))[:, 0] <= STANDS_STILL * (1 + np.abs(s[:, 0])))
    found = []
    for end, side in np.argwhere(still):
        own = float(s[end, 1, side])
        other = float(s[end, 1, 1 - side]) if still[end, 1 - side] else 2 * chord - own
        found.append(_Edge(problem, end == 0, own, other, chord))
    return found


def _along(edge: _Edge) -> Form:
    """The form of a problem whose extremal leaves one end along an edge."""
    assert edge.whole is not None
    problem, symbols, inward, (b, q) = edge.problem, _symbols(edge.problem), edge.inward, edge.whole
    near, z, backward = symbols.x, symbols.y, 1.0 if edge.at_start else -1.0
    step = inward * near**b
    # what is added to the slope of the edge, with the powers that cancel taken out beforehand
    turn = (q * near ** (q - b) * z + backward * near ** (q - b + 1) * symbols.dy) / b
    x, y = edge.corner[0] + step, edge.corner[1] + edge.s * step + inward * near**q * z
    speed, slope = abs(inward) * b * near ** (b - 1), edge.s + turn
    stated = rewriter(problem, symbols, x, y, [slope], speed)(problem.integrand, True)
    expressions = [multiplied_out(problem.sign * stated, symbols), x, y, speed, slope * speed]
    if not edge.at_start:
        expressions = ca.substitute(expressions, [near], [1 - near])
    integrand, *lifted = expressions
    behind, other = edge.turning(), end_points(problem)[1 if edge.at_start else 0]
    far = float((other - edge.corner)[1] / inward - edge.s)

    def distance(at: np.ndarray) -> np.ndarray:
        return np.maximum(at if edge.at_start else 1 - at, NEXT_TO_END ** (1 / q))

    def first(at: np.ndarray) -> np.ndarray:
        from_end = distance(at)
        return (-behind(np.ravel(from_end) ** b) / from_end**q)[None]

    def pull(curve: Sampled) -> Sampled:
        """The unknown z of a curve in x."""

        def pulled(at: np.ndarray) -> np.ndarray:
            """z at t (m,)."""
            from_end = distance(at)
            run = inward * from_end**b
            return (curve(edge.corner[0] + run) - edge.corner[1] - edge.s * run) / (inward * from_end**q)

        return pulled

    ends = np.array([[np.nan], [far]]) if edge.at_start else np.array([[far], [np.nan]])
    return Form(
        problem,
        Coordinates(
            Stated(symbols, integrand, integrand, tuple(lifted)), pull=pull,
            note=f"y' ~ {edge.s:.4g}, x ~ t^{b}, t^{q}", singular=(edge.at_start, not edge.at_start), weak_only=True,
        ),
        Ends(ends[:1], ends[1:]),
        Conditions(),
        Start(first, problem.unknown_guesses, np.eye(1)),
    )  # fmt: skip
