"""Whether anything of the integrands hides between the points of a rule: they are enclosed from one to the next.

The running variable is monotone along a leg, so what it does between two points is known exactly; of the slope it is
known at the points, and that little more of it lies between.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from varcalc.methods.first_integral.contract import Joined
from varcalc.methods.first_integral.lines import Arc, Lines
from varcalc.numerics.one_coordinate.panels import distance
from varcalc.symbolic.variation import NARROWEST, VARYING, Between, excess, gentle

SLOPE_MARGIN = 0.1
"""By what share of their difference, or of its power, slopes may leave the range of those at two points."""


def hiding(joined: Joined) -> list[np.ndarray]:
    """The panels (panels,) of each leg between whose points, or on whose edges, something may hide."""
    legs = joined.batch.legs
    if gentle(joined.family.lines.integrands.read, VARYING):
        return [np.zeros(leg.panels.count, bool) for leg in legs]
    return [_hiding(joined.family.lines, leg, d[0]) for leg, d in zip(legs, joined.measured.dx, strict=True)]


def doubt(joined: Joined) -> str:
    """Where something may hide between the points of a curve's rules, in words; empty where nothing does."""
    lines = joined.family.lines
    for leg, marked in zip(joined.batch.legs, hiding(joined), strict=True):
        if marked.any():
            edges = np.array(leg.panels.edges)
            share = distance(leg.panels.kind, 0.5 * (edges[1:] + edges[:-1])[marked][:1])[0]
            place = float(leg.anchor[0] + leg.length[0] * share[0])
            return (
                f"near {'xy'[lines.running]} = {place:.9g} L varies faster than the points of the quadrature can tell"
            )
    return ""


def _hiding(lines: Lines[Any], leg: Arc, covered: np.ndarray) -> np.ndarray:
    """The same of one leg, along which so much of the other variable is ``covered`` (points,)."""
    share, weights = leg.panels.distances
    anchor, length = float(leg.anchor[0]), float(leg.length[0])
    marked = np.zeros(leg.panels.count, bool)
    if length == 0.0:
        return marked
    runs = np.concatenate([[anchor], anchor + length * share, [anchor + length]])
    with np.errstate(all="ignore"):
        rate = covered / (abs(length) * weights)
        slope = leg.direction / rate if lines.running else rate
    slope = np.concatenate([slope[:1], slope, slope[-1:]])
    points = np.zeros((3, len(runs)))
    points[2], points[lines.running] = slope, runs
    # the ends of a leg are no points of its rule; one where L is infinite is what its coordinates are made for
    samples = points.copy()
    samples[:, -1] = points[:, -2]
    if leg.end is None:
        samples[:, 0] = points[:, 1]
    over = _excess(lines, points, samples) > 1.0
    panel = np.repeat(np.arange(leg.panels.count), leg.panels.points)
    marked[np.append(panel, panel[-1])[over]] = True
    marked[np.append(panel[0], panel)[over]] = True
    return marked


def _excess(lines: Lines[Any], points: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """By what factor something may go too far from each of the points (3, m) to the next, beyond what the samples show.

    Rows are x, y and y'.
    """
    low, high = np.minimum(points[:, :-1], points[:, 1:]), np.maximum(points[:, :-1], points[:, 1:])
    runs = low[lines.running], high[lines.running]
    low[2], high[2] = _widened(low[2], high[2])
    boxes = [[Between((low[k], high[k]), samples[k, :-1], samples[k, 1:])] for k in range(3)]
    over = excess(lines.integrands.read, boxes, low.shape[1:], VARYING)
    known = np.isfinite(points[2])
    apart = runs[1] - runs[0] > NARROWEST * np.maximum(np.abs(runs[0]), np.abs(runs[1]))
    return np.where(known[1:] & known[:-1] & apart, over, 0.0)


def _widened(low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A range of slopes with some room; one that does not come to zero does not with the room."""
    with np.errstate(all="ignore"):
        room = SLOPE_MARGIN * (high - low)
        below = np.where(low > 0, np.maximum(low - room, low * (low / high) ** SLOPE_MARGIN), low - room)
        above = np.where(high < 0, np.minimum(high + room, high * (high / low) ** SLOPE_MARGIN), high + room)
    return below, above
