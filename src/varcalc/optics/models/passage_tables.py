"""The passages of rays between many pairs of heights in one medium, from tables that all of them share.

The tables belong to the medium; what belongs to a pair is where its heights lie on the motions. What the tables do not
tell, next to where rays come to rest, is integrated.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from varcalc.numerics.one_coordinate.integral_leaves import COLUMNS
from varcalc.numerics.one_coordinate.integral_tables import SlopesTable
from varcalc.numerics.one_coordinate.motions import OneTurn, TwoTurns
from varcalc.numerics.one_coordinate.quadrature import AGREED
from varcalc.numerics.one_coordinate.slopes import SameSlopes
from varcalc.numerics.proxies import reduced
from varcalc.optics.models.height_pairs import COUNT, LAYERS, ROOM, outwards
from varcalc.optics.models.passages import RayPassages, past_centre

MOST_TURNS = 32
"""Turns of g, with more of which no table is made."""
MOST_TABLES = 16
"""Kept of a medium, and ranges of heights that they are made for."""
AS_WELL = 4.0
"""By how many times what is read may be farther off than panels of integrals that agree."""


@dataclass
class PassageTables:
    """The tables of one medium."""

    made: dict[tuple[float, ...], SlopesTable] = field(default_factory=dict)
    boxes: list[tuple[float, float]] = field(default_factory=list)

    def box(self, low: float, high: float, deepest: float, highest: float) -> tuple[float, float]:
        """A range about that from ``low`` to ``high``, one that others have where it is not much wider.

        It goes no deeper than the ``deepest`` place and no higher than the ``highest``.
        """
        size = high - low if high > low else max(abs(high), 1.0) / ROOM
        for one in self.boxes:
            if deepest <= one[0] <= low and high <= one[1] <= highest and one[1] - one[0] <= ROOM * size:
                return one
        if len(self.boxes) >= MOST_TABLES:
            self.boxes.clear()
        least, most = outwards(np.array(low), np.array(high), np.array(size))
        self.boxes.append((max(float(least), deepest), min(float(most), highest)))
        return self.boxes[-1]

    def table(self, slopes: SameSlopes) -> SlopesTable:
        """That of some slopes, which are known by where they are."""
        u, ends = slopes.nodes.u, [slopes.below, slopes.above]
        where = [float(u[k]) if k >= 0 else np.inf for k in ends]
        box = [side if k < 0 else np.inf for k, side in zip(ends, slopes.box, strict=True)]
        key = (*where, *box, slopes.ceiling, slopes.reference)
        if key not in self.made:
            if len(self.made) >= MOST_TABLES:
                self.made.clear()
            self.made[key] = SlopesTable(slopes)
        return self.made[key]


@dataclass(frozen=True)
class TabledPassages:
    """The passages of rays, read from tables.

    These are made ``at_once``, or where they are asked often enough.
    """

    passages: RayPassages
    tables: PassageTables
    at_once: bool = False

    @cached_property
    def applies(self) -> bool:
        """Whether there are tables: g is smooth and does not turn often."""
        finite = bool(np.all(np.isfinite(self.passages.nodes.g)))
        return finite and len(self.passages.profile.stops) == 0 and len(self._turns) <= MOST_TURNS

    @cached_property
    def _turns(self) -> np.ndarray:
        """The nodes at which g turns, and the first and the last."""
        return np.union1d(0, self.passages.nodes.upwards.turns)

    @cached_property
    def _levels(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The turns and the edges of the box (t + 2,), g there, and its gain from the starts (p, t + 2)."""
        start, u = self.passages.start[:, None], np.append(self.passages.nodes.u[self._turns], self._box)
        return u, self.passages.profile.at(u)[0], self.passages.profile(start, u - start).gain

    @cached_property
    def _beyond(self) -> np.ndarray:
        """The gain of g from the starts to as deep and as high as rays go (p, 2)."""
        start = self.passages.start[:, None]
        return self.passages.profile(start, self._sides - start).gain

    @cached_property
    def _sides(self) -> np.ndarray:
        low, high = self._box
        return np.stack([np.minimum(self.passages.low, low), np.maximum(self.passages.high, high)], axis=1)

    @cached_property
    def _box(self) -> tuple[float, float]:
        """A range of all the heights, which those of nearly the same have in common."""
        ends = np.append(self.passages.start, self.passages.end)
        u = self.passages.nodes.u
        return self.tables.box(float(ends.min()), float(ends.max()), float(u[0]), float(u[-1]))

    def at(self, pair: np.ndarray, angles: np.ndarray, scale: np.ndarray, enough: float = 0.0) -> np.ndarray:
        """See :meth:`RayPassages.at`: read from tables where these know as much, beside a ``scale`` (m, COUNT).

        It may be ``enough`` to know them so well, relatively.
        """
        out, told, _ = self.tabled(pair, angles, scale, enough)
        self.complete(out, told, pair, angles, scale, enough)
        return out

    def complete(
        self, out: np.ndarray, told: np.ndarray, pair: np.ndarray, angles: np.ndarray, scale: np.ndarray, enough: float
    ) -> None:
        """Write down what the tables did not tell; ``told`` says what they did."""
        aimed = self.passages.aimed(angles)
        aimed = aimed[~np.all(told[aimed], axis=1)]
        if len(aimed):
            beside = past_centre(pair[aimed], angles[aimed])
            three, known, _ = self.tabled(*beside, np.repeat(scale[aimed], 3, axis=0), enough)
            self._integrate(three, known, *beside)
            out[aimed], told[aimed] = self.passages.of_past_centre(pair[aimed], angles[aimed], three), True
        self._integrate(out, told, pair, angles)

    def _integrate(self, out: np.ndarray, told: np.ndarray, pair: np.ndarray, angles: np.ndarray) -> None:
        """Write down what was not ``told``."""
        rows = np.flatnonzero(~reduced(np.logical_and, told, 1))
        if len(rows):
            rest = self.passages.integrated(pair[rows], angles[rows], ~told[rows])
            out[rows] = np.where(np.tile(told[rows], 2), out[rows], rest)

    def tabled(
        self, pair: np.ndarray, angles: np.ndarray, scale: np.ndarray, enough: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """See :meth:`at`: what the tables tell (m, COUNT), and whether it is S, U and D (m, LAYERS).

        And what S, U and D may be off (m, LAYERS), of their sizes or the scale; infinite where nothing is known.
        """
        out, off = np.full((len(angles), COUNT), np.nan), np.full((len(angles), LAYERS), np.inf)
        if not self.applies:
            return out, np.zeros(off.shape, dtype=bool), off
        g = self.passages.g[pair]
        agreed = np.maximum(AS_WELL * np.maximum(self.passages.noise(pair, angles), AGREED), enough)
        c, squared = np.sqrt(g) * np.cos(angles), g * np.sin(angles) ** 2
        u, levels, deeper = self._levels
        here, t = self.passages.start[pair], len(self._turns)
        left = np.where((c**2 < g / 2)[:, None], levels - c[:, None] ** 2, deeper[pair] + squared[:, None])
        upper, lower = np.full((2, len(angles)), -1)
        ends = self._sides[pair]
        sides = self._beyond[pair] + squared[:, None] <= 0
        for k in range(t):
            stopped = left[:, k] <= 0
            lower[stopped & (u[k] < here) & (sides[:, 0] | (u[k] > ends[:, 0]))] = k
            upper[stopped & (u[k] > here) & (sides[:, 1] | (u[k] < ends[:, 1])) & (upper < 0)] = k
        for key in np.unique((lower + 1) * (t + 1) + upper + 1):
            low, high = int(key) // (t + 1) - 1, int(key) % (t + 1) - 1
            if low >= 0 and high == low + 1:  # level to round-off, where g turns: there is nothing between
                continue
            rows = np.flatnonzero((lower == low) & (upper == high))
            own = pair[rows], c[rows], squared[rows], left[rows], scale[rows]
            self._read(low, high, rows, own, out, off)
        # rays aimed at a centre, but not through it, turn closer to it than g is looked at, and are told by others
        aimed = self.passages.aimed(angles)
        off[aimed[(lower[aimed] < 0) & (angles[aimed] < np.pi / 2)]] = np.inf
        return out, off <= agreed[:, :LAYERS], off

    def _slopes(self, low: int, high: int) -> tuple[SameSlopes, int, int]:
        """The slopes between two turns, and the levels that are their floor (-1 for none) and their ceiling."""
        nodes, turns, box, (u, g, _) = self.passages.nodes, self._turns, self._box, self._levels
        t = len(turns)
        inner = list(range(low + 1, high if high >= 0 else t))
        sides = ([t] if low < 0 else []) + ([t + 1] if high < 0 else [])
        inside = [k for k in inner if (low >= 0 or u[k] > box[0]) and (high >= 0 or u[k] < box[1])]
        ends = [k for k in (low, high) if k >= 0]
        floor = max(ends, key=lambda k: g[k]) if ends else -1
        highest = max(inside + sides, key=lambda k: g[k])
        # between two turns by which motions turn back g rises to one maximum, or has minima between several
        others = [k for k in inside if k in (0, t - 1) or g[k] <= min(g[k - 1], g[k + 1])] + sides
        ceiling = min(others, key=lambda k: g[k]) if others else highest
        node = [int(turns[k]) if k >= 0 else -1 for k in (low, high)]
        lowest, reference = (float(u[floor]), float(u[highest])) if ends else (None, box[0])
        slopes = SameSlopes(self.passages.profile, nodes, node[0], node[1], lowest, float(u[ceiling]), reference, box)
        return slopes, floor, ceiling

    def _read(
        self, low: int, high: int, rows: np.ndarray, own: tuple[np.ndarray, ...], out: np.ndarray, rough: np.ndarray
    ) -> None:
        """Write down the passages of ``rows``, which turn back before the turns ``low`` and ``high``."""
        pair, c, squared, left, scale = own
        slopes, floor, ceiling = self._slopes(low, high)
        table = self.tables.table(slopes)
        fall = left[:, ceiling]
        rise = -left[:, floor] if floor >= 0 else slopes.between - fall
        with np.errstate(all="ignore"):
            logarithm = np.log(rise / fall)
        u = self.passages.nodes.u
        start, end = self.passages.start[pair], self.passages.end[pair]
        reaches = (slopes.below < 0) | (end > u[slopes.below])
        reaches &= (slopes.above < 0) | (end < u[slopes.above])
        leaf = table.leaf(logarithm, self.at_once)
        known = np.flatnonzero((leaf >= 0) & np.isfinite(logarithm) & reaches)
        pair, rows, squared = pair[known], rows[known], squared[known]
        x = np.stack([start[known], end[known]]) - slopes.reference
        speed = np.sqrt([squared, self.passages.higher[pair] + squared])
        values, off = table.at(leaf[known], logarithm[known], x, speed)
        values[:, 0] *= c[known]
        off[:, 0] *= c[known]
        up = self.passages.way[pair] > 0
        passages, away = (_assembled(slopes, part, up, way) for part, way in ((values, -1.0), (off, 1.0)))
        out[rows] = passages.T
        with np.errstate(all="ignore"):  # where nothing is asked to what is nothing, that is known or it is not
            away /= np.fmax(scale[known].T, np.abs(passages))
        # what does not exist, where motions do not turn, is known not to
        away[np.isnan(away)] = 0.0
        rough[rows] = np.maximum(away[:LAYERS], away[LAYERS:]).T


def _assembled(slopes: SameSlopes, values: np.ndarray, up: np.ndarray, minus: float) -> np.ndarray:
    """S, U and D with their optical paths (6, m) from the integrals (4, COLUMNS, m) to start, end, and both ends.

    ``minus`` is -1.0, but 1.0 to add up what these are off.
    """
    start, end, first, last = values
    none = np.full_like(first, np.nan)
    parts = [np.abs(end + minus * start)]
    for place, higher in ((end, up), (start, ~up)):
        if slopes.kind is TwoTurns:
            under, over = place + minus * first, last + minus * place
        elif slopes.kind is OneTurn:
            under, over = (place + minus * first, none) if slopes.sign > 0 else (none, place + minus * first)
        else:
            under = over = none
        parts.append(np.where(higher, over, under))
    return np.stack(parts, axis=1).reshape(COLUMNS * LAYERS, -1)
