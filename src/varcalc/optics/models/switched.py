"""Rays through kinks and jumps inside one medium, piece by piece of its index.

The index is read: on one side of each of its switches it is smooth, and their arguments are stops. A ray that comes
to one is refracted into the next piece by Snell's law, which at a kink leaves it as it is, or totally reflected; with
it go its neighbours, whom the surface bends otherwise. No step goes over a kink or a jump.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from threading import Lock

import casadi as ca
import numpy as np

from varcalc import integrators
from varcalc.integrators import Flow, Landing
from varcalc.integrators.protocol import NOT_FINITE, STOPPED, TOO_MANY_STEPS
from varcalc.optics.media.medium import Expression, Field, Medium
from varcalc.optics.models.equations import RayStops, force, ray_rates
from varcalc.optics.models.watch import UNWATCHED, Watch
from varcalc.optics.rays.beam import at_surface, packed, unpacked
from varcalc.optics.surfaces import Geometry, Surface
from varcalc.symbolic.shapes import shape
from varcalc.symbolic.sides import ExpressionOnSide, Sides

MOST_CROSSINGS, MOST_READ = 20_000, 6_000
"""Kinks and jumps that one ray comes to, and pieces behind them that are read anew, in some milliseconds each."""
AHEAD = 1e-12
"""Of the size of the scene: it is asked so far ahead on which side of its other switches a ray goes on."""
TOLD_APART = 1e-7
"""The same for switches on which a ray starts: half the digits, that how it turns counts as well."""
SAME_INDEX = 1e-12
"""Of n²: where it changes by less, there is no jump."""
MIXED, MOST_MIXED = 1_000_003.0, 2.0**31
"""How the numbers of jumps make one number."""
ON_END = 1e-13
"""Of its slope and the size of the scene: an argument so small is zero."""
_ONE_AT_A_TIME = Lock()
"""Threads that need the same piece wait for the one that compiles it."""


@dataclass(frozen=True)
class OnePiece(Medium):
    """The medium in which n² is the same smooth ``expression`` of ``position`` everywhere."""

    expression: Expression
    position: Expression

    def index(self, position: Expression) -> Expression:
        """n at ``position``."""
        return ca.sqrt(self.squared_index(position))

    def squared_index(self, position: Expression) -> Expression:
        """n² at ``position``."""
        return ca.substitute(self.expression, self.position, position)


@dataclass(frozen=True)
class EndOfPiece(Surface):
    """The surface on which a switch of the index is: ``argument`` of ``position`` is zero."""

    argument: Expression
    position: Expression

    def level(self, position: Expression) -> Expression:
        """The argument at ``position``."""
        return ca.substitute(self.argument, self.position, position)


@dataclass(frozen=True)
class Region:
    """One piece of a medium: its n² on arrays, its ends as surfaces, and its rays with the ends as their last stops.

    The ``flow`` takes ``numbers`` (k,) after the caller's constants.
    """

    piece: ExpressionOnSide
    field: Field
    ends: tuple[Geometry, ...]
    flow: Flow
    numbers: np.ndarray

    def of(self, piece: ExpressionOnSide, numbers: Sequence[float]) -> Region:
        """That of another piece which differs by ``numbers`` alone; nothing is compiled for it."""
        own = np.array(numbers)
        return replace(
            self, piece=piece, field=self.field.of(own), ends=tuple(end.of(own) for end in self.ends), numbers=own
        )

    def given(self, constants: np.ndarray) -> np.ndarray:
        """What the flow takes, from the caller's ``constants`` (..., c)."""
        return np.concatenate(
            [constants, np.broadcast_to(self.numbers, (*constants.shape[:-1], len(self.numbers)))], -1
        )


@dataclass(frozen=True)
class SmoothRuns:
    """The runs ``rows`` (k,) through one piece each, on its ``sides`` (k, switches): states (k, N) at either end.

    ``begun`` (k,) is σ at the ``first``. The ``last`` is that before anything happens to a ray at the end of the piece.
    """

    rows: np.ndarray
    sides: np.ndarray
    begun: np.ndarray
    first: np.ndarray
    last: np.ndarray


@dataclass
class SwitchedFlow:
    """A flow through the pieces of one ``medium``; ``stops`` are the caller's."""

    medium: Medium
    dimension: int
    neighbours: int
    stops: RayStops
    _regions: dict[tuple[int, ...], Region] = field(default_factory=dict, init=False, repr=False)
    _kinds: dict[tuple[Hashable, tuple[float, ...]], Region] = field(default_factory=dict, init=False, repr=False)
    _seen: set[Hashable] = field(default_factory=set, init=False, repr=False)

    @cached_property
    def _position(self) -> Expression:
        return ca.SX.sym("r", self.dimension)

    @cached_property
    def _pieces(self) -> Sides:
        return Sides.of(ca.SX(self.medium.squared_index(self._position)), self._position)

    @property
    def _size(self) -> int:
        return 2 * self.dimension + 1 + 2 * self.dimension * self.neighbours

    def ensemble(
        self, states: np.ndarray, constants: np.ndarray, *, until: np.ndarray | float = np.inf,
        leaving: tuple[int, ...] = (), watch: Watch = UNWATCHED,
    ) -> Landing:  # fmt: skip
        """See :meth:`varcalc.integrators.protocol.Flow.ensemble`."""
        return self.crossing(states, constants, until=until, leaving=leaving, watch=watch)[0]

    def crossing(
        self, states: np.ndarray, constants: np.ndarray, *, until: np.ndarray | float = np.inf,
        leaving: tuple[int, ...] = (), crossed: np.ndarray | None = None, watch: Watch = UNWATCHED,
    ) -> tuple[Landing, np.ndarray]:  # fmt: skip
        """The same, and what runs have come through (m,) after what they had ``crossed``: see :class:`Beam`."""
        ends = Landing.at(states, outcome=TOO_MANY_STEPS)
        way = np.zeros(len(states)) if crossed is None else np.array(crossed)
        with watch.stoppable():
            for _ in self._rounds(ends, constants, until, leaving, way, watch):
                pass
        return ends, way

    def runs(self, state: np.ndarray, constants: np.ndarray) -> list[tuple[float, Flow, np.ndarray, np.ndarray]]:
        """The pieces that one ray goes through: where each begins in σ, its flow with constants, the state there."""
        return [
            (float(piece.begun[0]), region.flow, region.given(constants), piece.first[0])
            for piece in self.pieces(state[None, :], constants[None, :])
            for region in [self._region(piece.sides[0])]
        ]

    def pieces(self, states: np.ndarray, constants: np.ndarray) -> Iterator[SmoothRuns]:
        """What runs go through piece by piece, so that none of these comes over a kink or a jump."""
        return self._rounds(Landing.at(states), constants, np.inf, (), np.zeros(len(states)))

    def _region(self, sides: np.ndarray) -> Region:
        """The piece on the ``sides`` (switches,), compiled when it is first needed."""
        key = tuple(int(side) for side in sides)
        with _ONE_AT_A_TIME:
            if key not in self._regions:
                self._regions[key] = self._made(key)
            return self._regions[key]

    def _made(self, key: tuple[int, ...]) -> Region:
        """The piece on the sides ``key``; what is compiled for those that differ by numbers alone is one.

        The first of them has its numbers written, as most are the only ones, but for whole ones of what is stepped.
        """
        piece = self._pieces.piece(key)
        counted = self._pieces.piece(key, counted=True) if self._pieces.stepped else piece
        # where a whole number is zero, less may hang on the position than where it is not
        piece = counted if counted.beyond == piece.beyond else piece
        counts = self._pieces.counts if piece.counts else ca.SX(0, 1)
        of = shape([piece.expression, *piece.ends], ca.vertcat(self._position, counts))
        if of is None:
            return self._compiled(piece, counts)
        kind, numbers = (of.key, len(piece.counts)), (*piece.counts, *of.values)
        if (kind, of.values) in self._kinds:
            return self._kinds[kind, of.values].of(piece, piece.counts)
        if kind not in self._seen:
            self._seen.add(kind)
            first = self._kinds[kind, of.values] = self._compiled(piece, counts)
            return first
        if (kind, ()) not in self._kinds:
            expression, *ends = of.expressions
            alike = ExpressionOnSide(expression, tuple(ends), piece.beyond, numbers)
            self._kinds[kind, ()] = self._compiled(alike, ca.vertcat(counts, of.numbers))
        return self._kinds[kind, ()].of(piece, numbers)

    def _compiled(self, piece: ExpressionOnSide, numbers: Expression) -> Region:
        """A piece in which ``numbers`` are symbols, with its rays to its ends."""
        d, position = self.dimension, self._position
        s, state, constants = ca.SX.sym("s"), ca.SX.sym("Y", self._size), ca.SX.sym("c", self.stops.constants)
        medium = OnePiece(piece.expression, position)
        here = force(medium.squared_index(state[:d]), state[:d])
        rates = ray_rates(here, state, d)
        levels = [EndOfPiece(end, position).level(state[:d]) for end in piece.ends]
        stops = ca.vertcat(self.stops.levels(state, constants, here.squared), *levels)
        given = [s, state, ca.vertcat(constants, numbers)]
        rays, ends = ca.Function("rays", given, [rates]), ca.Function("stops", given, [stops])
        surfaces = tuple(Geometry(EndOfPiece(end, position), d, numbers) for end in piece.ends)
        flow = integrators.for_many().compile(rays, ends)
        return Region(piece, Field(medium, d, numbers), surfaces, flow, np.zeros(0)).of(piece, piece.counts)

    def _rounds(
        self,
        ends: Landing,
        constants: np.ndarray,
        until: np.ndarray | float,
        leaving: tuple[int, ...],
        crossed: np.ndarray,
        watch: Watch = UNWATCHED,
    ) -> Iterator[SmoothRuns]:
        """Carry all rays through one piece after the other, in place; each is told before rays leave it."""
        m = len(ends.states)
        last = np.array(np.broadcast_to(np.asarray(until, dtype=float), (m,)))
        alive = np.arange(m)
        sides = self._sides(ends.states)
        most = len(self._regions) + MOST_READ
        for number in range(MOST_CROSSINGS):
            if len(self._regions) > most or not watch.lets_on(number, len(alive)):
                return
            with watch.going(ends, alive):
                begun, first = ends.reached[alive], ends.states[alive]
                alike = [(self._region(key), rows) for key, rows in _alike(sides[alive], alive)]
                self._to_ends(ends, alike, constants, last, leaving)
                yield SmoothRuns(alive, sides[alive], begun, first, ends.states[alive])
                following, going = sides.copy(), []
                for region, rows in alike:
                    here = rows[(ends.outcomes[rows] == STOPPED) & (ends.stopped_by[rows] >= self.stops.count)]
                    for end in np.unique(ends.stopped_by[here]) - self.stops.count:
                        going.append(here[ends.stopped_by[here] == end + self.stops.count])
                        self._cross(ends, following, region, int(end), going[-1], crossed)
                alive, leaving, sides = np.concatenate([alive[:0], *going]), (), following
                alive = alive[ends.outcomes[alive] != NOT_FINITE]
                if len(alive) == 0:
                    return
                ends.outcomes[alive] = TOO_MANY_STEPS

    def _to_ends(
        self, ends: Landing, alike: Sequence[tuple[Region, np.ndarray]], constants: np.ndarray, last: np.ndarray,
        leaving: tuple[int, ...],
    ) -> None:  # fmt: skip
        """Carry rays to the ends of their regions, in place: those of one flow and off the same stops together."""
        together: dict[tuple[int, tuple[int, ...]], list[tuple[Region, np.ndarray]]] = {}
        for region, rows in alike:
            for standing, some in _alike(self._on_ends(region, ends.states[rows]), rows):
                on = tuple(int(k) + self.stops.count for k in np.flatnonzero(standing))
                together.setdefault((id(region.flow), on), []).append((region, some))
        for (_, on), parts in together.items():
            some = np.concatenate([rows for _, rows in parts])
            landing = parts[0][0].flow.ensemble(
                ends.states[some], np.concatenate([region.given(constants[rows]) for region, rows in parts]),
                until=np.maximum(last[some] - ends.reached[some], 0.0), leaving=(*leaving, *on),
            )  # fmt: skip
            ends.carry_on(some, landing, last)

    def _sides(self, states: np.ndarray) -> np.ndarray:
        """On which sides (m, switches) rays start: of the ends on which they stand, on that to which they go.

        A ray that leaves one at grazing incidence is told from it later than round-off is, where it has turned, too.
        """
        d, sides = self.dimension, self._pieces.at(self._ahead(states))
        for key, rows in _alike(sides.copy(), np.arange(len(states))):
            region = self._region(key)
            standing = self._on_ends(region, states[rows])
            some = np.flatnonzero(np.any(standing, axis=1))
            if len(some) == 0:
                continue
            here = states[rows[some]]
            p, (_, gradient, _) = here[:, d : 2 * d], region.field(here[:, :d])
            with np.errstate(all="ignore"):
                sigma = (TOLD_APART * _size(here[:, :d]) / np.linalg.norm(p, axis=1))[:, None]
            later = self._pieces.at(np.nan_to_num(here[:, :d] + sigma * (p + sigma * gradient / 4)))
            for number, (place, _) in enumerate(region.piece.beyond):
                on = standing[some, number] == 1
                sides[rows[some[on]], place] = later[on, place]
        return sides

    def _ahead(self, states: np.ndarray) -> np.ndarray:
        """Places (m, d) a little ahead of rays."""
        d = self.dimension
        p = states[:, d : 2 * d]
        with np.errstate(all="ignore"):
            ahead = p / np.linalg.norm(p, axis=1)[:, None]
        return states[:, :d] + AHEAD * _size(states[:, :d])[:, None] * np.nan_to_num(ahead)

    def _on_ends(self, region: Region, states: np.ndarray) -> np.ndarray:
        """Which ends of the region rays stand on, 0 or 1 (m, ends)."""
        position = states[:, : self.dimension]
        on = np.zeros((len(states), len(region.ends)), dtype=int)
        for k, end in enumerate(region.ends):
            away = end.distance(position)
            on[:, k] = away <= ON_END * _size(position)
        return on

    def _cross(
        self, ends: Landing, sides: np.ndarray, region: Region, end: int, rows: np.ndarray, crossed: np.ndarray
    ) -> None:
        """Refract rays at one end of their region, or reflect them totally, in place; and on which sides they go on."""
        d, states = self.dimension, ends.states[rows]
        beam, (place, side) = unpacked(states, d), region.piece.beyond[end]
        beyond = self._pieces.at(self._ahead(states))
        beyond[:, place] = side
        for key, some in _alike(beyond, np.arange(len(rows))):
            here, part, there = rows[some], beam.take(some), self._region(key).field
            out, total = at_surface(part, region.ends[end], region.field, _levelled(region.field, there), mirror=False)
            total |= _dark(region.field, part.position) & _dark(there, part.position)
            ends.states[here] = packed(out)
            if np.any(total):
                back = np.flatnonzero(total)
                mirrored = at_surface(part.take(back), region.ends[end], region.field, region.field, mirror=True)[0]
                ends.states[here[back]] = packed(mirrored)
            ends.outcomes[here[~np.isfinite(there(part.position)[0])]] = NOT_FINITE
            sides[here[~total]] = key
            number = place + 1
            turned = np.abs(out.momentum - part.momentum).max(axis=1)
            passed = np.where(total, -number, number * (turned > SAME_INDEX * np.linalg.norm(part.momentum, axis=1)))
            told = np.flatnonzero(passed)
            crossed[here[told]] = np.mod(crossed[here[told]] * MIXED + passed[told], MOST_MIXED)


def _levelled(before: Field, after: Field) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """n² and its derivatives ``after`` an end, n² as ``before`` it where there is no more than a kink."""

    def squared(points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        (old, _, _), (new, gradient, hessian) = before(points), after(points)
        return np.where(np.abs(new - old) <= SAME_INDEX * np.abs(old), old, new), gradient, hessian

    return squared


def _dark(field: Field, position: np.ndarray) -> np.ndarray:
    """True (m,) where n² on one side of an end is zero, to what is known of the place: no ray passes, all turn back."""
    squared, slope, _ = field(position)
    return squared <= ON_END * _size(position) * np.linalg.norm(slope, axis=1)


def _size(position: np.ndarray) -> np.ndarray:
    """How large coordinates (m, d) are (m,); one where they are zero."""
    size = np.abs(position).max(axis=1, initial=0.0)
    return np.where(size > 0, size, 1.0)


def _alike(keys: np.ndarray, rows: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """The different ``keys`` (k, ...) of the ``rows`` (k,), each with the rows that have it."""
    if len(rows) == 0 or np.all(keys == keys[0]):
        return [(keys[0], rows)] if len(rows) else []
    names, number = np.unique(keys, axis=0, return_inverse=True)
    return [(name, rows[number.ravel() == k]) for k, name in enumerate(names)]
