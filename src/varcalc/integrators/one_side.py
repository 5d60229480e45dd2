"""One side of a system that switches: the system as it is there, smooth, and where the side ends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import casadi as ca
import numpy as np

from varcalc.integrators.protocol import Engine, Flow
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.sides import FunctionOnSide, Sides
from varcalc.symbolic.tracing import Expression

ALONG = 2
"""In place of a side: on the switch itself."""
ORDERS = 3
"""Derivatives of an argument along the rates that tell to which side they lead."""


@dataclass(frozen=True)
class SystemOnSide:
    """The system on one side: ``free``, and to its ends as ``stopping`` where the time is a state, the last one.

    ``series`` gives, of such a state and constants, the arguments of all switches, their derivatives along the rates,
    how large what they are made of is, the person's stops with their rates, and what must not jump. Where switches
    that are not ``live`` turn over it stays what it is; those that are ``still`` do so only with others.
    """

    free: Flow
    stopping: Flow
    series: PointEvaluator
    live: frozenset[int]
    still: frozenset[int]


@dataclass(frozen=True)
class OneSided:
    """The ``sides`` of a system, with its stops, each compiled by the ``engine`` when it is first entered.

    The third result of the function of ``sides`` must not jump where a switch depends on one of the first ``held``
    states.
    """

    engine: Engine
    sides: Sides
    held: int
    _pieces: dict[tuple[int, ...], SystemOnSide] = field(default_factory=dict, init=False, repr=False, compare=False)

    @property
    def stops(self) -> int:
        """How many stops the person has."""
        return self.sides.function.numel_out(1)

    @cached_property
    def with_coordinates(self) -> tuple[bool, ...]:
        """Whether each switch depends on one of the states across which something must not jump."""
        some = self.sides.symbols[1][: self.held]
        return tuple(self.held > 0 and bool(ca.depends_on(p.argument, some)) for p in self.sides.places)

    def piece(self, side: tuple[int, ...]) -> SystemOnSide:
        """The system on a side, compiled when it is first entered."""
        if side not in self._pieces:
            self._pieces[side] = self._made(side)
        return self._pieces[side]

    def _made(self, side: tuple[int, ...]) -> SystemOnSide:
        s, state, constants = self.sides.symbols
        numbers = ca.vertcat(constants, self.sides.counts)
        written, live, still = self._parts(side)
        parts = ca.Function("parts", [s, state, numbers], written)
        every = ca.SX.sym("Z", state.numel() + 1)
        way, direction = ca.SX.sym("way"), ca.SX.sym("direction")
        rates, stops, kept, arguments, levels = parts(every[-1], every[:-1], numbers)
        all_rates = direction * ca.vertcat(rates, 1)
        given = [way, every, ca.vertcat(numbers, direction)]
        terms = [arguments]
        for _ in range(ORDERS):
            terms.append(ca.jtimes(terms[-1], every, all_rates))
        size = ca.mtimes(ca.fabs(ca.jacobian(arguments, every)), ca.fabs(every))
        found = [*terms, size, stops, ca.jtimes(stops, every, all_rates), kept, all_rates]
        return SystemOnSide(
            self.engine.compile(ca.Function("free", [s, state, numbers], [parts(s, state, numbers)[0]])),
            self.engine.compile(
                ca.Function("piece", given, [ca.densify(all_rates)]),
                ca.Function("ends", given, [ca.densify(ca.vertcat(stops, levels))]),
            ),
            PointEvaluator(ca.Function("series", given[1:], [ca.densify(ca.vertcat(*found))])),
            live,
            still,
        )

    def _parts(self, side: tuple[int, ...]) -> tuple[list[Expression], frozenset[int], frozenset[int]]:
        """Rates, stops, what must not jump, arguments, what is positive on the side; what is live, still."""
        if ALONG not in side:
            one = self.sides.on(side)
            return [*one.results, one.arguments, self._levels(side, one)], one.live, one.still
        place = side.index(ALONG)
        above, below = (self.sides.on([*side[:place], way, *side[place + 1 :]]) for way in (1, -1))
        s, state, _ = self.sides.symbols
        argument = above.arguments[place]
        (up, first), (down, other) = (
            (ca.jtimes(argument, state, one.results[0]) + ca.jtimes(argument, s, 1), one.results[0])
            for one in (above, below)
        )
        rates = (other * up - first * down) / (up - down)
        levels = ca.vertcat(self._levels(side, above), -up, down)
        return [rates, *above.results[1:], above.arguments, levels], above.live | below.live, above.still

    def _levels(self, side: tuple[int, ...], one: FunctionOnSide) -> Expression:
        """Positive on the side: of what is stepped, above the whole number below and below the one above."""
        levels = []
        for k in sorted(one.live - one.still):
            if self.sides.places[k].stepped:
                below = self.sides.counts[2 * self.sides.stepped.index(k)]
                levels += [one.arguments[k] - below, below + 1 - one.arguments[k]]
            elif side[k] != ALONG:
                levels.append(side[k] * one.arguments[k])
        return ca.vertcat(ca.SX(0, 1), *levels)

    def ends(self, side: tuple[int, ...]) -> list[int]:
        """The number of the place whose end each of the levels of a side is, after the person's stops."""
        found: list[int] = []
        for k in sorted(self.piece(side).live - self.piece(side).still):
            found += [k] * (2 if self.sides.places[k].stepped else side[k] != ALONG)
        return found + [side.index(ALONG)] * 2 if ALONG in side else found

    def leaving(self, side: tuple[int, ...], on: Sequence[int], arguments: np.ndarray, counts: np.ndarray) -> list[int]:
        """The numbers of the levels that are zero where a run sets out, being ``on`` these places."""
        ends, found = self.ends(side), []
        for k in on:
            if side[k] == ALONG or k not in ends:
                continue
            first = self.stops + ends.index(k)
            if self.sides.places[k].stepped:
                below = counts[2 * self.sides.stepped.index(k)]
                first += int(round(float(arguments[k])) != below)
            found.append(first)
        return found
