"""Where the nodes of lattices lie, through which polygons are looked at.

A lattice about a curve is fine near it and coarse far from it, or evenly as far as slopes lead that have bounds. Hills
and wells have places and widths of their own: along each of some vertical lines it is seen where L turns, and between
these places the levels of another lattice lie evenly, with the ones on which a resting curve is cheapest among them.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from varcalc.existence.polygons import Landscape, LandscapeWithUnit, Lattice, values_of

PIECES = 10
"""Pieces of the polygons."""
UNITS = 2.0 ** np.arange(-18, 7)
"""Shifts of the whole curve at which its functional is measured, in units of the larger of its extent and interval."""
LEAST_UNIT = 0.02
"""The least unit, in extents, where there are larger ones."""
TURN_NOISE = 1e-7
"""Change of that, relative to what is summed, that is none."""
NEAR = np.array([1 / 16, *np.arange(1, 9) / 4.0])
"""Departures of the nodes, either way, in the problem's own unit."""
SLOPE_DEPARTURES = 4.0 ** np.arange(-20, 21)
"""Departures of the slope, in units of the problem's, at which it is seen whether slopes have bounds."""
SLOPES_IN_REACH, MOST_IN_REACH = 6, 60
"""How many slopes lead on from a node, on the side on which there is most room, where they have; levels at most."""
OVERFLOWING = 1e50
"""Size of L that says that it is about to leave the range of numbers."""
FAR, OUTWARD, REACH = 9, 1.5, 1000.0
"""How many there are further out, by what factor the first of them, and how many extents the last at least."""
PIECES_ACROSS, LEVELS = 24, 64
"""Pieces of the polygons, and levels that lie evenly."""
DEPARTURES = 2.0 ** np.arange(-10, 6, 0.25)
"""Departures at which L is asked for its turns, either way, in units of the larger of the extent and the interval."""
NO_CHANGE = 1e-7
"""Change of L from one to the next, relative to its size there, that is none."""
NEAREST_TURNS = 8
"""Turns of a vertical line that are taken, the nearest ones: what is periodic has no end of them."""
LEAST_SWING = 1e-3
"""How much L changes from a turn to the next, of its greatest such change, for the levels to reach so far."""
LEVEL_MARGIN = 0.25
"""Share of their range by which the levels go beyond the turns."""
CLOSER = 3
"""Looks, each as much closer as there are levels, by which the edge of where curves may go is found."""
CLOSER_SLOPES = 1000
"""Slopes at which that is done for the last one that a curve may have."""
CLOSER_LEVELS = 8
"""Times as many levels at which the cheapest ones for a curve at rest are looked for."""


class PolygonLattice(Lattice):
    """Polygons about a curve: K pieces, and at each of the vertices J departures, the middle one 0."""

    def __init__(
        self, landscape: LandscapeWithUnit, ordinates: Callable[[np.ndarray], np.ndarray], unit: float | None = None,
        pieces: int = PIECES,
    ) -> None:  # fmt: skip
        self.pieces, (a, b) = pieces, landscape.span
        x = np.union1d(np.linspace(a, b, pieces + 1), landscape.waypoints)
        c = ordinates(x)
        extent = landscape.extent(c)
        unit = unit or _unit(landscape, x, c, extent)
        departures = _as_far_as_slopes_lead(landscape, x, c, unit, extent)
        self.bounded = departures is not None
        if departures is None:
            side = _ever_further(unit, extent)
            departures = np.concatenate([-side[::-1], side])
        self.levels, reach = 1 + len(departures), float(np.abs(departures).max())
        beside = _edges(landscape, x, c, c + reach * np.array([[-1.0], [1.0]]))
        beside += landscape.beside_jumps(x, c)
        nodes, own = _in_order(c, beside, c[:, None] + departures)
        super().__init__(landscape, x, nodes, own, reach, extent / (b - a))


def _ever_further(unit: float, extent: float) -> np.ndarray:
    """Departures to one side: even ones nearby, then each further out than the last by a factor, and that grows."""
    last = unit * NEAR[-1]
    far = math.log(max(REACH * extent / last, OUTWARD**FAR)) - FAR * math.log(OUTWARD)
    growing = np.exp(far / (FAR * (FAR - 1) / 2) * np.arange(FAR))
    return np.concatenate([unit * NEAR, last * np.cumprod(OUTWARD * growing)])


def _as_far_as_slopes_lead(
    landscape: Landscape, x: np.ndarray, c: np.ndarray, unit: float, extent: float
) -> np.ndarray | None:
    """Even departures, as far as a curve comes where slopes have bounds, or L is no number beyond some; None elsewhere.

    From node to node some slopes have to lead. Where those nearby are nearer together they are among them.
    """
    steps, span = np.diff(x), float(x[-1] - x[0])
    middle, centre, slope = 0.5 * (x[1:] + x[:-1]), 0.5 * (c[1:] + c[:-1]), np.diff(c) / steps

    def sizes(turns: np.ndarray) -> np.ndarray:
        return np.abs(values_of(landscape, middle[:, None], centre[:, None], slope[:, None] + turns))

    turns = extent / span * SLOPE_DEPARTURES
    down, up = _room(lambda some: sizes(-some), turns), _room(sizes, turns)
    if down is None or up is None or not (most := max(down, up)) > 0.0:
        return None
    level = most * float(steps.min()) / SLOPES_IN_REACH
    # with both ends given what goes up has to come down again
    share = down * up / (down + up) if all(landscape.held) else most
    count = min(math.ceil(share * span / level), MOST_IN_REACH)
    side = level * np.arange(1, count + 1)
    if unit * NEAR[1] <= level:
        side = np.union1d(side, unit * NEAR)
    return np.concatenate([-side[::-1], side])


def _room(sizes: Callable[[np.ndarray], np.ndarray], turns: np.ndarray) -> float | None:
    """The largest of ascending ``turns`` at which L is a number at some place, nearly; None where it is at the last.

    None as well where L has grown out of all numbers by then: no curve goes as far as that.
    """
    beyond = ~np.isfinite(sizes(turns))
    if not beyond[:, -1].all():
        return None
    # a curve may have to be as steep as it can be
    last = int(np.max(np.where(beyond, 0, np.arange(1, len(turns) + 1))))
    if last == 0:
        return 0.0
    low, high = turns[last - 1], turns[last]
    for _ in range(CLOSER):
        tried = np.linspace(low, high, CLOSER_SLOPES)
        within = int(np.flatnonzero(np.isfinite(sizes(tried)).any(axis=0))[-1])
        low, high = tried[within], tried[min(within + 1, CLOSER_SLOPES - 1)]
    return None if np.nanmin(sizes(np.array([low]))) > OVERFLOWING else float(low)


def _unit(landscape: Landscape, x: np.ndarray, c: np.ndarray, extent: float) -> float:
    """A shift of the whole curve beyond which its functional turns; the ``extent`` where it does not."""
    middle, centre, slope = 0.5 * (x[1:] + x[:-1]), 0.5 * (c[1:] + c[:-1]), np.diff(c) / np.diff(x)
    shifts = extent * np.concatenate([-UNITS[::-1], [0.0], UNITS])
    values = values_of(landscape, middle[:, None], centre[:, None] + shifts, slope[:, None])
    sums = np.where(np.isfinite(values), values, np.inf).sum(0)
    noise = TURN_NOISE * float(np.abs(values[:, len(UNITS)]).sum())
    found: list[float] = []
    for side in (sums[len(UNITS) :], sums[len(UNITS) :: -1]):
        change = np.diff(side)
        told = np.flatnonzero(np.isfinite(change) & (np.abs(change) > noise))
        turns = told[1:][np.sign(change[told[1:]]) != np.sign(change[told[:-1]])]
        found += (extent * UNITS[turns - 1]).tolist()
    about = [unit for unit in found if unit >= LEAST_UNIT * extent]
    # turns at far smaller shifts alone are those of a problem whose ordinates have another unit than its abscissa
    return min(about) if about else max(found, default=extent)


def across_the_landscape(landscape: LandscapeWithUnit, ordinates: Callable[[np.ndarray], np.ndarray]) -> Lattice | None:
    """The lattice of levels, with the curve's own ordinates among them; None where L has no two minima in y."""
    x = np.union1d(np.linspace(*landscape.span, PIECES_ACROSS + 1), landscape.waypoints)
    c = ordinates(x)
    extent = landscape.extent(c)
    turns = _turns(landscape, x, c, extent)
    if turns is None:
        return None
    low, high = min(turns.min(), c.min()), max(turns.max(), c.max())
    room = LEVEL_MARGIN * (high - low)
    levels = np.linspace(low - room, high + room, LEVELS)
    levels = np.union1d(levels, _rests(landscape, x, levels))
    beside = _edges(landscape, x, c, levels[[0, -1], None] + np.zeros(len(x)))
    beside += landscape.beside_jumps(x, c)
    nodes, own = _in_order(c, beside, np.broadcast_to(levels, (len(x), len(levels))))
    return Lattice(landscape, x, nodes, own, float(high - low), extent / float(np.ptp(x)))


def _in_order(c: np.ndarray, beside: list[np.ndarray], levels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The nodes (m, J) of a lattice, ordered, and the numbers (m,) of those on the curve with ordinates c (m,)."""
    nodes = np.column_stack([c, *beside, levels])
    order = np.argsort(nodes, axis=1, kind="stable")
    return np.take_along_axis(nodes, order, 1), np.argmin(order, axis=1)


def _edges(landscape: Landscape, x: np.ndarray, c: np.ndarray, ends: np.ndarray) -> list[np.ndarray]:
    """The ordinates (m,) nearest the curve's, on either side of it, beyond which no curve may go; none, none.

    Where there is none at an abscissa it is the one where that side's levels end, of ``ends`` (2, m).
    """
    found, rows = [], np.arange(len(c))
    for end in ends:
        tried = c + np.linspace(0, 1, LEVELS)[:, None] * (end - c)
        barred = ~np.isfinite(values_of(landscape, x, tried, np.zeros(1)))
        if not barred.any():
            continue
        first, closed = np.maximum(np.argmax(barred, axis=0), 1), barred.any(0)
        kept, beyond = (np.where(closed, tried[k, rows], end) for k in (first - 1, first))
        for _ in range(CLOSER):
            tried = kept + np.linspace(0, 1, LEVELS)[:, None] * (beyond - kept)
            barred = ~np.isfinite(values_of(landscape, x, tried, np.zeros(1)))
            first = np.maximum(np.argmax(barred, axis=0), 1)
            kept, beyond = (np.where(closed, tried[k, rows], end) for k in (first - 1, first))
        found.append(kept)
    return found


def _turns(landscape: Landscape, x: np.ndarray, c: np.ndarray, unit: float) -> np.ndarray | None:
    """The ordinates at which L turns as y goes either way from the curve; None where no line has two minima."""
    middle, centre, slope = 0.5 * (x[1:] + x[:-1]), 0.5 * (c[1:] + c[:-1]), np.diff(c) / np.diff(x)
    y = centre[:, None] + unit * np.concatenate([-DEPARTURES[::-1], [0.0], DEPARTURES])
    values = values_of(landscape, middle[:, None], y, slope[:, None])
    change = np.diff(values)
    told = np.isfinite(change) & (np.abs(change) > NO_CHANGE * (np.abs(values[:, 1:]) + np.abs(values[:, :-1])))
    found: list[np.ndarray] = []
    swings: list[np.ndarray] = []
    several = False
    for row, at, rates, own in zip(told, y, change, values, strict=True):
        steps = np.flatnonzero(row)
        signs = np.sign(rates[steps])
        turning = np.flatnonzero(signs[1:] != signs[:-1])
        if not len(steps):
            continue
        # where a hill's foot is flat there is no turn, but it is as low as a minimum
        feet = (steps[0] > 0 and signs[0] > 0, steps[-1] < len(row) - 1 and signs[-1] < 0)
        several = several or int((signs[turning] < 0).sum()) + sum(feet) > 1
        turning = np.sort(turning[np.argsort(np.abs(steps[turning] - len(DEPARTURES)), kind="stable")[:NEAREST_TURNS]])
        places = steps[turning] + 1
        found.append(at[places])
        swings.append(_swings(own, places, (steps[0], steps[-1] + 1)))
        # what descends to where curves may not go is lowest there
        last = [(steps[0], steps[0] - 1, feet[0]), (steps[-1] + 1, steps[-1] + 2, feet[1])]
        edges = [k for k, beyond, foot in last if foot and beyond in range(len(own)) and own[beyond] == np.inf]
        found.append(at[edges])
        swings.append(np.full(len(edges), np.inf))
    if not several:
        return None
    turns, swing = np.concatenate(found), np.concatenate(swings)
    return turns[swing >= LEAST_SWING * swing[np.isfinite(swing)].max(initial=0.0)]


def _swings(values: np.ndarray, turns: np.ndarray, ends: tuple[int, int]) -> np.ndarray:
    """By how much a row of values changes from each of its turns to the next, the larger of both sides."""
    steps = np.abs(np.diff(values[[ends[0], *turns, ends[1]]]))
    return np.maximum(steps[1:], steps[:-1])


def _rests(landscape: Landscape, x: np.ndarray, levels: np.ndarray) -> np.ndarray:
    """The levels on which a curve at rest costs least among its neighbours, by a parabola through three."""
    y = np.linspace(levels[0], levels[-1], CLOSER_LEVELS * len(levels))
    values = values_of(landscape, 0.5 * (x[1:] + x[:-1])[:, None], y, np.zeros(1)).sum(0)
    inner = values[1:-1]
    k = 1 + np.flatnonzero((inner < values[:-2]) & (inner <= values[2:]))
    before, here, after = values[k - 1], values[k], values[k + 1]
    aside = 0.5 * (y[1] - y[0]) * (before - after) / (before - 2 * here + after)
    return y[k] + np.where(np.isfinite(aside), aside, 0.0)  # beside a place where curves may not go
