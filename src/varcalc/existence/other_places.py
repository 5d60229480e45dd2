"""Where else on phi = 0 an end that slides may be best: where curves drawn there are low, or polygons slide to.

Where bounds or levels are asked a drawn curve keeps neither. What is least among polygons that do, begun at a few of
the points, slides to the places (:mod:`varcalc.existence.kept_polygons`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import cycle

import numpy as np

from varcalc.existence.drawn_to_places import MOST_PLACES, PLACES_ON_GRID, DrawnToPlaces, PlaceOfEnds
from varcalc.existence.kept_polygons import NEAREST_ENDS, PIECES_KEPT, KeptPolygon, KeptPolygons
from varcalc.problem.conditions import Bound, Isoperimetric, Through
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Problem
from varcalc.solution import Solution

BENT_AS_WELL, HALF_WAVES = 3, (2, -1, -2, 1)
"""At which of the places, one in so many, polygons begin from a bent curve too, and by what, in turn: at another place
another shape may be the best.
"""
LEADS_LOWER = 1e-3
"""How far above the known value, in units of what is summed, a polygon may be that leads lower."""


def looked_for(best: Solution) -> str:
    """What tells where else an end may be best, in words; empty where nothing does.

    Graphs of one function or two are looked at, and curves of the plane or of space, without waypoints.
    """
    problem = best.problem
    coordinates = problem.n + isinstance(problem, Problem)
    asked = any(isinstance(c, Through) for c in problem.constraints)
    known = problem.order == 1 and coordinates in PLACES_ON_GRID and not (problem.unknowns or asked)
    if not (known and best.curve is not None):
        return ""
    begun = "polygons that keep what is asked begun at some" if _conditioned(problem) else "curves drawn to"
    return f"{begun} other places of the ends that slide"


def _conditioned(problem: Functional) -> bool:
    """Whether a curve that is drawn elsewhere may keep less than the known one."""
    return any(problem.of_type(Bound)) or any(problem.of_type(Isoperimetric))


def other_places(best: Solution) -> tuple[list[PlaceOfEnds], float]:
    """Where else the ends that slide may be best, the lowest first, and how far away they were looked for.

    None, and not away, where that is not :func:`looked_for`.

    Where both slide they are moved together as well: a curve may have drawn to nothing between them.
    """
    problem = best.problem
    if not looked_for(best):
        return [], 0.0
    sliding = [side for side in (0, 1) if problem.slides[side]]
    moved = [(side,) for side in sliding] + ([(0, 1)] if len(sliding) == 2 else [])
    drawn = [DrawnToPlaces(best, sides) for sides in moved]
    conditioned = _conditioned(problem)
    found = _kept_places(best, drawn) if conditioned else []
    if not conditioned or any(_narrow(problem, place) for place in found):
        # polygons say little of what draws to nothing: curves of some length may lead there
        found += [replace(place, sure=not conditioned) for some in drawn for place in some.places()]
    return sorted(found, key=lambda place: place.value), max(some.reach for some in drawn)


def _narrow(problem: Functional, place: PlaceOfEnds) -> bool:
    """Whether the ends of a graph came as near to each other as those of polygons may."""
    return isinstance(problem, Problem) and np.ptp(place.span) <= 2 * NEAREST_ENDS * np.ptp(problem.span)


def _kept_places(best: Solution, drawn: Sequence[DrawnToPlaces]) -> list[PlaceOfEnds]:
    """Where the least polygons slide to that keep bounds and levels, begun where curves are ``drawn`` to."""
    assert best.curve is not None
    first = drawn[0]
    x = np.linspace(*first.span, PIECES_KEPT + 1)
    polygons = KeptPolygons(best.problem, x, best.curve(x, 0))
    with np.errstate(all="ignore"):
        known = polygons.stated(x, best.curve(x, 0))
        ends = [two for some in drawn for two in some.spread()]
        bent = zip(ends[::BENT_AS_WELL], cycle(HALF_WAVES), strict=False)
        begun = [polygons.least(*first.vertices(*pair)) for pair in (*((two, 0) for two in ends), *bent)]
    found = sorted((p for p in begun if p is not None), key=lambda polygon: polygon.value)
    value = best.problem.sign * best.value
    # as much as straight pieces add to the known curve they may add to others
    added = 0.0 if known is None else max(known.value - value, 0.0)
    chosen: list[KeptPolygon] = []
    places: list[PlaceOfEnds] = []
    for polygon in found:
        room = LEADS_LOWER * polygon.size
        lower, beside = polygon.value < value - room, first.same_place(polygon, known)
        low = lower or (polygon.value < value + max(added, room) and not beside)
        if low and not any(first.same_place(polygon, other) for other in chosen):
            chosen.append(polygon)
            places.append(first.kept_place(polygon, lower))
    return places[:MOST_PLACES]


def begun_at(problem: Functional, place: PlaceOfEnds) -> Functional:
    """The problem with the ends that slide to begin at a place; a Curve begins where what it starts from does."""
    return problem.restated(*place.ends) if isinstance(problem, Problem) else problem
