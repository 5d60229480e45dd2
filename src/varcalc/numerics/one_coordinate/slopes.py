"""Motions in one coordinate by the slopes of g on which they turn back: those that are smooth in C together."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from varcalc.numerics.one_coordinate.motions import CoordinateMotion, NoTurn, OneTurn, TwoTurns, both_bounds, ways
from varcalc.numerics.one_coordinate.potential import Potential, PotentialNodes

ROUNDED = 8 * float(np.finfo(float).eps)
"""Of the integrals of a motion that has all it can have above C: what round-off of g makes of them."""


@dataclass(frozen=True)
class SameSlopes:
    """Motions that turn back on the same slopes of g, for C between the values of g at two nodes.

    ``below`` and ``above`` are the nodes, numbers in ``nodes``, by which motions have turned back, -1 where they come
    to the edges of the ``box``. The ``floor`` is the place with the larger g of these, the ``ceiling`` that with the
    least g at a turn between them; there is no ``floor`` without a turn. g is larger than its ceiling at ``reference``.
    """

    potential: Potential
    nodes: PotentialNodes
    below: int
    above: int
    floor: float | None
    ceiling: float
    reference: float
    box: tuple[float, float]

    @cached_property
    def _levels(self) -> tuple[float, float, float, float]:
        """g at the floor and at the ceiling, how much more it is there, and how much more than that at the reference.

        Without a floor it is as much below 0.
        """
        places = np.array([self.ceiling if self.floor is None else self.floor, self.ceiling, self.reference])
        bottom, top, _ = (float(g) for g in self.potential.at(places)[0])
        if self.floor is None:
            bottom = -top
        fallen, _, more = (float(gain) for gain in self.potential(np.full(3, self.ceiling), places - self.ceiling).gain)
        return bottom, top, top - bottom if self.floor is None else -fallen, more

    @property
    def between(self) -> float:
        """How much larger g is at the ceiling than at the floor, to round-off; without a floor, than -g."""
        return self._levels[2]

    def rounded(self, logarithm: np.ndarray) -> np.ndarray:
        """What round-off makes of the integrals at a logarithm (k,): g is told from itself or from its change."""
        bottom, _, between, _ = self._levels
        return ROUNDED * np.minimum(np.exp(-logarithm), 1 + np.abs(bottom) / between * (1 + np.exp(-logarithm)))

    def motions(self, logarithm: np.ndarray) -> tuple[np.ndarray, CoordinateMotion, np.ndarray, np.ndarray] | None:
        """The rows (k,) of motions that turn back on the slopes, these, and more; None where there are none.

        Last come the largest parameters (k,) on them, and their ends from the reference (k, 2).
        """
        bottom, top, between, more = self._levels
        rise, fall = between / (1 + np.exp(-logarithm)), between / (1 + np.exp(logarithm))
        C = np.where(logarithm < 0, bottom + rise, top - fall)
        u0 = np.full(len(C), self.reference)
        # motions that turn back beyond the box do not turn, as far as it goes
        sides = zip((self.below, self.above), self.box, strict=True)
        walls = [np.full(len(C), np.inf if k >= 0 else abs(side - self.reference)) for k, side in sides]
        squared = more + fall
        below, above = both_bounds(self.potential, self.nodes, u0, squared, C, walls)
        ends = np.stack([below.x, above.x], axis=1)
        for every, found, _ in ways(self.potential, u0, np.sqrt(squared), below, above):
            own = np.flatnonzero(found.sign == self.sign) if isinstance(found, OneTurn) else np.arange(len(every))
            rows, way = every[own], found.take(own)
            if not isinstance(way, self.kind):
                continue
            if isinstance(way, OneTurn):
                most = way.reaching(np.full(len(own), self.box[int(self.sign > 0)] - self.reference))
            else:
                most = np.full(len(rows), np.pi if isinstance(way, TwoTurns) else self.box[1] - self.box[0])
            return rows, way, most, ends[rows]
        return None

    @property
    def kind(self) -> type[CoordinateMotion]:
        """Of the motions."""
        return [TwoTurns, OneTurn, NoTurn][(self.below < 0) + (self.above < 0)]

    @property
    def sign(self) -> float:
        """1.0 where motions that turn once do so below, -1.0 where above."""
        return 1.0 if self.above < 0 else -1.0
