"""Pairs of heights in layers or about a centre: how far rays between them come, and where their passages are smooth.

The passages are functions of the angle at the end with the smaller g. Between the angles at which rays come to rest,
turn where g is less smooth or come so far that they are too long they are smooth.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from varcalc.numerics.one_coordinate.motions import OTHER_SIDE
from varcalc.numerics.one_coordinate.potential import PotentialNodes
from varcalc.optics.models.reduction import RayPotential

ROOM = 8
"""Parts of a range to which it is rounded outwards."""
SAME_MINIMUM = 1e-15
"""Of g: minima that differ by less are one."""
ALIKE = 256 * float(np.finfo(float).eps)
"""Of how much g varies: minima of so nearly one height are one, for g is not told much better over them all."""
DARK = 1e-6
"""Of g: where it is less, upright rays turn at an index that is all but nothing."""
STAYS_LEVEL = 1e-15
"""Of g: where it changes by less over the distance, a ray that starts level stays so."""
EPSILON = 2 * float(np.finfo(float).eps)
"""Round-off of g and of angles, relatively."""
ONE_NODE = 16 * EPSILON
"""Of their heights: nodes that differ by less are one place."""
LIMIT_STEP = 1e-3
"""Of the way to the farthest place to which rays come: over so much of it is told how the slope of g changes."""
TOLD_APART = 1e-4
"""Radians: over so many passages to those places change, at the least, where rays do not rest there."""
LEAST_BESIDE = 1e-6
"""Radians: passages that are less smooth so close to level rays are so at them: g is told to about the square."""
NODES_TOGETHER = 2**20
"""Of all pairs, looked at together; bounds the memory."""
LAYERS, COUNT = 3, 6
"""RayPassages S, U and D: how far they come along the layers, and together with their optical paths."""


def outwards(low: np.ndarray, high: np.ndarray, size: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ranges, rounded outwards to parts of a ``size``: those that are nearly the same are one, and share tables."""
    with np.errstate(all="ignore"):
        step = 2.0 ** np.ceil(np.log2(size)) / ROOM
        least, most = np.floor(low / step) * step, np.ceil(high / step) * step
    return np.where(np.isfinite(least), least, low), np.where(np.isfinite(most), most, high)


def _come_back(
    profile: RayPotential,
    nodes: PotentialNodes,
    ends: tuple[np.ndarray, np.ndarray],
    farthest: tuple[np.ndarray, np.ndarray],
    within: np.ndarray,
) -> tuple[PotentialNodes, np.ndarray, np.ndarray]:
    """The nodes to which rays come that go back to their heights, and how deep and how high those of each pair come.

    Beyond the lower and the upper of its ``ends`` (p,) a ray goes twice, on an optical path of no less than the
    integral of n. It is no longer than ``within`` (p,).
    """
    u = nodes.u
    g = np.minimum(nodes.g[1:], nodes.g[:-1])
    path = np.append(0.0, np.cumsum(np.sqrt(np.where(np.isfinite(g), np.maximum(g, 0.0), 0.0)) * np.diff(u)))
    lower, upper = (path[np.searchsorted(u, end)] for end in ends)
    below = np.searchsorted(path, lower - within / 2, side="left") - 1
    above = np.searchsorted(path, upper + within / 2, side="right")
    low, high = u[np.maximum(below, 0)], u[np.minimum(above, len(u) - 1)]
    low, high = outwards(low, low, ends[0] - low)[0], outwards(high, high, high - ends[1])[1]
    low, high = np.maximum(low, farthest[0]), np.minimum(high, farthest[1])
    kept = u[(u >= low.min()) & (u <= high.max())]
    limits = np.append(low, high)
    kept = np.union1d(kept, limits[(limits > u[0]) & (limits < u[-1])])
    low_edge, high_edge = nodes.low_edge and kept[0] == u[0], nodes.high_edge and kept[-1] == u[-1]
    return PotentialNodes(kept, profile.at(kept)[0], low_edge, high_edge), low, high


@dataclass(frozen=True)
class HeightPairs:
    """p pairs of heights ``start`` (p,) and ``end`` (p,) of ``profile``, g smaller at the start.

    Rays between them go no higher than ``high`` (p,) and no deeper than ``low`` (p,).
    """

    profile: RayPotential
    nodes: PotentialNodes
    start: np.ndarray
    end: np.ndarray
    low: np.ndarray
    high: np.ndarray

    @classmethod
    def between(cls, profile: RayPotential, ends: np.ndarray, within: np.ndarray) -> tuple[Self, np.ndarray]:
        """The rays between heights (p, 2) up to optical paths (p,), and which pairs (p,) start from the second."""
        g = profile.at(ends)[0]
        swapped = g[:, 1] < g[:, 0]
        start, end = np.where(swapped, *ends.T[::-1]), np.where(swapped, *ends.T)
        lower, upper = ends.min(axis=1), ends.max(axis=1)
        with np.errstate(all="ignore"):
            size = within / np.sqrt(g.max(axis=1))
        reach = profile.distances(lower, upper, size)[:, -1]
        free = np.full(len(ends), np.inf)
        low = np.maximum(profile.farthest(lower, -1, within, free), lower - reach)
        high = np.minimum(profile.farthest(upper, 1, within, free), upper + reach)
        low, high = outwards(low, low, lower - low)[0], outwards(high, high, high - upper)[1]
        nodes = profile.nodes(lower, upper, low, high, size)
        nodes, low, high = _come_back(profile, nodes, (lower, upper), (low, high), within)
        return cls(profile, nodes, start, end, low, high), swapped

    @cached_property
    def way(self) -> np.ndarray:
        """1.0 (p,) where the end is above the start, or as high, -1.0 where it is below."""
        return np.where(self.end >= self.start, 1.0, -1.0)

    @cached_property
    def g(self) -> np.ndarray:
        """g (p,) at the start."""
        return self.profile.at(self.start)[0]

    @cached_property
    def higher(self) -> np.ndarray:
        """How much larger g is at the end (p,)."""
        return np.maximum(self.profile(self.start, self.end - self.start).gain, 0.0)

    @cached_property
    def rounded(self) -> np.ndarray:
        """How well the angles of the breaks are known in comparison with others (p, b), 0 where nothing is lost.

        What is known to round-off is the largest change of g that adds up to that at a break.
        """
        with np.errstate(all="ignore"):
            known = EPSILON * np.maximum(self.breaks**2, np.minimum(self._variation[0], 1.0)[:, None]) / self.breaks
        return np.where(self._inner.any(axis=2), known, 0.0)

    @cached_property
    def _variation(self) -> tuple[np.ndarray, np.ndarray]:
        """How much g varies (p,), and its least value (p,), in units of that at the start."""
        sides = np.column_stack([self.low, np.nextafter(self.high, np.inf)])
        slices, finite = np.searchsorted(self.nodes.u, sides).ravel(), np.abs(self.nodes.g) < np.inf
        own = [np.append(np.where(finite, self.nodes.g, none), none) for none in (np.inf, -np.inf)]
        least, most = (f.reduceat(g, slices)[::2] for f, g in zip((np.minimum, np.maximum), own, strict=True))
        varies = most - least
        return varies / self.g, least / self.g

    @cached_property
    def _inner(self) -> np.ndarray:
        """At which of the breaks which of S, U and D (p, b, 3) lose digits.

        Those do at whose end rays come to rest, and all of upright ones at an index of 0.
        """
        number, last = np.arange(self.breaks.shape[1]), self.count[:, None] - 1
        dark = (number == last) & (self._variation[1] <= DARK)[:, None]
        rests = (number > 0) & (number < last) & ~self.mild
        return (rests[..., None] & self._broken[2][..., :LAYERS]) | dark[..., None]

    def noise(self, pair: np.ndarray, angles: np.ndarray, plain: np.ndarray | None = None) -> np.ndarray:
        """What round-off makes of S, U and D and their optical paths (m, 6) of pairs (m,) at angles (m,), relatively.

        It is much beside a break at which they come to rest; not so beside upright rays of those that are ``plain``
        (m,) there.
        """
        if not np.any(self._inner):
            return np.zeros((len(angles), COUNT))
        worst = np.zeros((len(angles), LAYERS))
        for k in np.flatnonzero(self._inner.any(axis=(0, 2))):
            lost = self._inner[pair, k]
            if plain is not None:
                lost &= ~(plain & (k == self.count[pair] - 1))[:, None]
            with np.errstate(all="ignore"):
                beside = self.rounded[pair, k] / np.abs(angles - self.breaks[pair, k])
            worst = np.maximum(worst, np.where(lost, beside[:, None], 0.0))
        return np.tile(np.minimum(worst, 1.0), 2)

    @property
    def count(self) -> np.ndarray:
        """How many breaks there are (p,)."""
        return np.count_nonzero(np.isfinite(self.breaks), axis=1)

    @property
    def breaks(self) -> np.ndarray:
        """The angles, ascending from 0 to π/2, between which the passages are smooth: (p, b), infinite after these."""
        return self._broken[0]

    @property
    def mild(self) -> np.ndarray:
        """At which breaks (p, b) the passages are smooth in the root of the angle from there: rays turn at stops."""
        return self._broken[1]

    @property
    def endless(self) -> np.ndarray:
        """Which of S, U and D grow for ever towards breaks (p, b, 3): g has a smooth minimum where rays rest there."""
        return self._broken[2][..., LAYERS:]

    @cached_property
    def _broken(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The breaks (p, b), whether they are mild, and which of S, U and D come to rest there.

        Last come, for each of these once more, those that do so for ever (p, b, 6).
        """
        upper, lower = np.maximum(self.start, self.end), np.minimum(self.start, self.end)
        pair, node = self._rests()
        u = self.nodes.u[node]
        above, below, up = u >= upper[pair], u <= lower[pair], self.way[pair] > 0
        at_rest = np.stack([~above & ~below, np.where(up, above, below), np.where(up, below, above)], axis=1)
        at_rest = np.column_stack([at_rest, at_rest & self._lowest[node, None]])
        # the change of g is known to its own round-off, however small
        base = self.start[pair]
        gain, told = self.profile(base, self.nodes.u[node] - base).gain, self.nodes.g[node] - self.g[pair]
        # beside a jump round-off puts the place on either side
        torn = np.abs(gain - told) > OTHER_SIDE * np.maximum(self.g[pair], np.abs(self.nodes.g[node]))
        fallen = -np.where(torn, told, gain) / self.g[pair]
        mild = self._stops[node] & ~np.isin(node, self.nodes.upwards.turns)
        # at a jump g is steep on either side, and motions do not rest there
        mild |= np.isin(self.nodes.u[node], self.profile.jumps) & (self.profile.at(self.nodes.u[node])[1] != 0)
        mild |= self._limits(pair, node, fallen)
        # a window between two places of one kind, of heights alike but for what g is told to, is none
        alike = ALIKE * np.minimum(self._variation[0], 1.0)
        with np.errstate(all="ignore"):  # where changes overflow g is told to its own round-off
            lost = ~np.isfinite(self.profile.changes(base, self.nodes.u[node] - base)[0])
        alike[pair[lost]] = np.maximum(alike[pair[lost]], 4 * EPSILON)
        return _padded(pair, fallen, mild, at_rest, alike)

    def _limits(self, pair: np.ndarray, node: np.ndarray, fallen: np.ndarray) -> np.ndarray:
        """At which nodes (n,) passages end since they are too long, where g goes on and rays do not rest.

        Those do not where angles are told apart, over the range over which the slope of g changes.
        """
        u, edges = self.nodes.u[node], (self.nodes.low_edge, self.nodes.high_edge)
        below = u <= self.start[pair]
        ends = np.where(below, np.minimum(self.start, self.end)[pair], np.maximum(self.start, self.end)[pair])
        limit = u == np.where(below, self.low[pair], self.high[pair])
        limit &= ~np.where(below, edges[0] & (node == 0), edges[1] & (node == len(self.nodes.u) - 1))
        step = LIMIT_STEP * (ends - u)
        with np.errstate(all="ignore"):
            (_, slope), (_, inside) = self.profile.at(u), self.profile.at(u + step)
            changes = np.fmin(np.abs(step / np.log(inside / slope)), np.abs(ends - u))
            before = np.maximum(fallen - np.abs(slope) * changes / self.g[pair], 0.0)
            return limit & (np.arcsin(np.sqrt(fallen)) - np.arcsin(np.sqrt(before)) > TOLD_APART)

    def _rests(self) -> tuple[np.ndarray, np.ndarray]:
        """The pairs (n,) and the nodes (n,) at which their rays come to rest, or turn where g is less smooth."""
        u, g = self.nodes.u, self.nodes.g
        lower, upper = np.minimum(self.start, self.end), np.maximum(self.start, self.end)
        first, bottom = np.searchsorted(u, lower), np.searchsorted(u, self.low)
        last, top = (np.searchsorted(u, place, side="right") - 1 for place in (upper, self.high))
        between = [a + int(np.argmin(g[a : b + 1])) for a, b in zip(first.tolist(), last.tolist(), strict=True)]
        above = self._held(last, top, self._own)
        below = self._held(first, bottom, self._own[::-1])
        pairs, nodes = zip((np.arange(len(between)), np.array(between)), above, below, strict=True)
        return np.concatenate(pairs), np.concatenate(nodes)

    def _held(self, begin: np.ndarray, end: np.ndarray, own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The pairs (n,) and the nodes (n,) of minima of g lower than all before, where motions come to rest.

        They are asked for from the nodes ``begin`` (p,) to ``end`` (p,), the last included, among ``own`` in the same
        order. So are stops that are lower: beyond them motions turn back where g is less smooth than elsewhere.
        """
        up, parts = len(own) < 2 or own[1] > own[0], []
        size = max(1, NODES_TOGETHER // (len(own) + 2))
        for pairs in np.split(np.arange(len(begin)), range(size, len(begin), size)):
            near, far = begin[pairs, None], end[pairs, None]
            node = np.clip(own, *((near, far) if up else (far, near)))
            node = np.column_stack([near, node, far])
            g, stop = self.nodes.g[node], self._stops[node] & (np.diff(node, axis=1, append=-1) != 0)
            before = np.minimum.accumulate(g, axis=1)
            rests = (g[:, :-1] <= before[:, :-1]) & ((g[:, :-1] < g[:, 1:]) | stop[:, :-1])
            rests = np.column_stack([rests, g[:, -1] <= before[:, -1]])
            pair, number = np.nonzero(rests)
            parts.append((pairs[pair], node[pair, number]))
        every, nodes = zip(*parts, strict=True)
        return np.concatenate(every), np.concatenate(nodes)

    @cached_property
    def _stops(self) -> np.ndarray:
        """Which nodes are stops, or at a jump."""
        return np.isin(self.nodes.u, np.append(self.profile.stops, self.profile.jumps))

    @cached_property
    def _lowest(self) -> np.ndarray:
        """Which nodes are minima of g between nodes told apart from them, with no stop or jump between these."""
        u, g = self.nodes.u, self.nodes.g
        room = ONE_NODE * np.abs(u)
        before, after = np.searchsorted(u, u - room) - 1, np.searchsorted(u, u + room, side="right")
        inner, before, after = (before >= 0) & (after < len(u)), np.maximum(before, 0), np.minimum(after, len(u) - 1)
        stops = np.unique(np.append(self.profile.stops, self.profile.jumps))
        within = np.searchsorted(stops, u[after]) - np.searchsorted(stops, u[before], side="right")
        return inner & (g[before] > g) & (g[after] > g) & (within <= 0)

    @cached_property
    def _own(self) -> np.ndarray:
        """The nodes, ascending, at which g turns or is less smooth."""
        return np.union1d(self.nodes.upwards.turns, np.flatnonzero(self._stops))

    @cached_property
    def level(self) -> np.ndarray:
        """How far (p,) from level rays, in radians along the imaginary axis, passages are first less smooth.

        It is 0 where they are so at once: rays rest there, or may.
        """
        own = np.unique(self.nodes.g[self._own])
        after = np.searchsorted(own, self.g)
        away = [np.abs(own[np.clip(after + k, 0, len(own) - 1)] - self.g) for k in (-1, 0)]
        ends = np.where(self.higher > SAME_MINIMUM * self.g, self.higher, np.inf)
        scale = np.sqrt(np.min([*away, ends], axis=0) / self.g)
        return np.where(scale > LEAST_BESIDE, scale, 0.0)

    def stays_level(self, pair: np.ndarray, distance: np.ndarray) -> np.ndarray:
        """True (n,) where the points of pairs (n,) lie on a layer along which a ray stays that starts so, so far."""
        g, slope = (values[pair] for values in self.profile.at(self.start))
        room = STAYS_LEVEL * g / (1.0 if self.profile.about_centre else np.maximum(distance, 1e-300))
        return (self.start == self.end)[pair] & (np.abs(slope) <= room)


def _padded(
    pair: np.ndarray, fallen: np.ndarray, mild: np.ndarray, at_rest: np.ndarray, alike: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The breaks of pairs in rows, ascending from 0 to π/2, whether they are mild, and what comes to rest there.

    They lie where g is ``fallen`` (n,) so far from that of the ``pair`` (n,); those alike are one, and so are those at
    which rays rest, or those at which they turn where g is less smooth, that differ by no more than is ``alike`` (p,).
    """
    order = np.lexsort((fallen, pair))
    order = order[(fallen[order] > SAME_MINIMUM) & (fallen[order] < 1.0)]
    place, row = fallen[order], pair[order]
    before = np.where(np.diff(row, prepend=-1) == 0, np.roll(place, 1), 0.0)
    both_so = (before > 0) & (mild[order] == np.roll(mild[order], 1))
    same = np.maximum(SAME_MINIMUM * place, np.where(both_so, alike[row], 0.0))
    first = np.flatnonzero(place - before > same)
    row = row[first]
    number, count = 1 + np.arange(len(row)) - np.searchsorted(row, row), np.bincount(row, minlength=int(pair.max()) + 1)
    shape = len(count), int(count.max()) + 2
    places, gentle, resting = np.full(shape, np.inf), np.zeros(shape, bool), np.zeros((*shape, at_rest.shape[1]), bool)
    places[:, 0], places[np.arange(len(count)), count + 1] = 0.0, np.pi / 2
    places[row, number] = np.arcsin(np.sqrt(place[first]))
    gentle[row, number] = np.logical_and.reduceat(mild[order], first)
    resting[row, number] = np.logical_or.reduceat(at_rest[order], first)
    return places, gentle, resting
