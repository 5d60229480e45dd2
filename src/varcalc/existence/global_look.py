"""Whether another valley of a functional is lower: the polygons of a whole lattice at once.

Over a lattice of abscissae and departures from a known curve, the least polygon through each node is found by dynamic
programming (Bellman, "Dynamic Programming", 1957, ch. 9), forward and backward in a few operations on arrays. Where
the least polygons through the nodes of one abscissa have more than one minimum there is more than one valley. Each is
followed to its bottom by the direct method, and what that ends in counts by its own value, not by the lattice's.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import compress
from typing import TYPE_CHECKING, Protocol

import casadi as ca
import numpy as np

from varcalc.existence.broken_curve import with_rival
from varcalc.existence.falling import Fall
from varcalc.existence.landscape import Landscape
from varcalc.existence.polygons import (
    PIECES,
    PIECES_ACROSS,
    Graphs,
    Lattice,
    PolygonLattice,
    Valley,
    Valleys,
    across_the_landscape,
    at_ends,
)
from varcalc.formulation import Sampled, formulate
from varcalc.formulation.height import breadths
from varcalc.methods.ritz.method import Ritz
from varcalc.numerics.mesh import composite_gauss
from varcalc.problem.breaks import breakable, integrals
from varcalc.problem.conditions import Bound, Holonomic, Isoperimetric
from varcalc.problem.convexity import (
    IN_ANOTHER_ORDINATE,
    proved_in_another_ordinate,
    proved_jointly_convex,
    proved_quadratic,
    proved_with_levels,
)
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Problem
from varcalc.solution import PROVED, Solution, local_only, sought
from varcalc.symbolic.derived import derived
from varcalc.symbolic.variation import gentle_across
from varcalc.verify.between import keeps_bounds
from varcalc.verify.slopes import concave_beside, concave_in_bend

if TYPE_CHECKING:
    from varcalc.existence.along_directions import AlongDirection
    from varcalc.existence.levelled_polygons import LevelledPolygons
    from varcalc.existence.relaxation import Relaxed
    from varcalc.existence.together import Looked

FOLLOWED, FOLLOWED_ACROSS, FOLLOWED_IN_DIRECTIONS = 3, 4, 4
"""Valleys that are followed from one curve, across a landscape, and in all directions from one."""
DESCENTS = 8
"""Times that a lower curve is looked around in its turn."""
LOWER = 1e-9
"""Relative difference of two values that is one."""
SURELY_LOWER = 1e-3
"""The same for a polygon's value, of which no error is known."""
POLYGON_RULES, RULES_APART = (24, 16), 10.0
"""Gauss points a piece of two rules, the better first, by which a polygon's value is told; the error in differences."""
TOWARD_VERTICES = np.concatenate([[0.0], 0.25 ** np.arange(15, 0, -1), 1.0 - 0.25 ** np.arange(1, 16)])
"""Where pieces are cut for that, in shares of a piece."""

ROUGH, EXACT = Ritz(elements=8, degree=3, refine=False, starts=1), Ritz(starts=1)
"""The direct method, to see whether a valley may be lower, and to its bottom."""
STEP_PIECES, AT_REST = 4, 0.2
"""Pieces on which a curve makes its step, and the share of its rises that it makes on all others, at rest there."""
FINE = Ritz(elements=64, starts=1)
"""The same from a curve that is steep in one place."""
ACROSS = Ritz(elements=24, degree=3, refine=False, starts=1), Ritz(elements=24, starts=1)
"""The two ways from a polygon of a landscape, which has as many pieces."""
MESHES_MOVED, STEEP_PLACES = 8, 4001
"""Meshes that follow what is steep, and places at which that is looked for."""
IN_NARROW = Ritz(starts=1, degree=8)
"""The way into a narrow valley, on a mesh of its own."""
QUADRATIC = "L is proved to be of second degree in the curve and its slope"
ONE_CURVE, DEPARTURE_PLACES = 0.05, 33
"""Departure from the known curve, in units of the larger extent, of one in the same valley; places where it is told."""
PLACE = 1
"""The argument of L that is the place."""
MORE_PIECES, TELLS_VALUE = (20, 40), 0.05
"""Pieces of polygons where fewer do not tell the known curve's value to that part of what it sums."""
UNSURE = 2.0
"""How far polygons' values may be off, in units of what the one through the known curve is off by."""
LED_NOWHERE = "leads to no minimum that could be found"
WITHDRAWN = 0.9
"""Share of its departures that are left to a polygon that is too steep to start from."""
ROUGHLY = 0.05
"""How far above the known value a rough one may be, in units of what is summed, for the valley to be lower."""

TOLERANCE = 1e-10
"""To which curves about the corners of walls are found."""
NONE_LOWER = 1e-6
"""How much lower a polygon has to be, in units of what is summed, to be so."""
NEARLY = 1e-2
"""The same for a polygon of many pieces."""

_Found = tuple[float, Valleys, Valley, tuple[Ritz, Ritz]]
"""A valley that was seen: how high it lies over the known curve's polygon, on what, and how it is followed."""


class Polish(Protocol):
    """The answer of the direct method from a curve to start from, on a mesh with ``marks``."""

    def __call__(self, method: Ritz, start: Sampled, marks: tuple[float, ...] = ()) -> Solution:
        """A Solution, with a status that says why when there is none."""
        ...


def _ordinates(solution: Solution, x: np.ndarray) -> np.ndarray:
    """The curve at x (m,), straight between the points its method had, where x(s) would have to be inverted."""
    assert solution.curve is not None
    extremal = solution.extremal
    known = None if extremal is None else extremal.samples
    if extremal is None or known is None or not extremal.form.stated.is_lifted:
        return solution.curve(x, 0)[0]
    ends = [end.values(1)[0] for end in (solution.problem.start, solution.problem.end)]
    y = np.interp(x, known.x, known.y[0])
    for k, end in zip((0, -1), ends, strict=True):
        y[k] = y[k] if np.isnan(end) else end
    return y


def looked_around(solution: Solution, beside: Callable[[Solution], Polish], tol: float, *, followed: bool) -> Solution:
    """The solution, or a lower one; marked local where something lower is known of that is no solution.

    Where lower valleys are ``followed``, what is found in one, ``beside`` the curve it was seen from, is the answer;
    else it is only told of.
    """
    problem = solution.problem
    if sentence := _one_valley(solution, followed=followed) or _not_looked(problem):
        return replace(solution, searched=sentence)
    best, seen = solution, _LookedAt()
    for _ in range(DESCENTS):
        graph, polish = _is_graph(problem), beside(best)
        # whoever holds the method to one mesh has the answer on that
        one_mesh = isinstance(solution.method, Ritz) and not solution.method.refine
        way = polish if graph or (followed and not one_mesh) else None
        lower = _at_other_places(best, beside, way, seen)
        if problem.unknowns and (lower is None or lower.local):
            lower = _with_other_numbers(best, beside, way, seen) or lower
        if lower is None or lower.local:
            lower = _lower_in_breadths(best, seen, way) or lower
        if lower is None or lower.local:
            lower = _with_corners(best, tol, seen.alternating) or lower
        if lower is None or not lower.status.ok or lower.local or not followed:
            return _told(best, lower, seen.sentence)
        best = replace(lower, problem=problem, method=solution.method)
    return _perhaps_local(best, f"each of {DESCENTS} looks led to a lower curve, and there may be more", seen.sentence)


def _one_valley(solution: Solution, *, followed: bool) -> str:
    """Why there is no other valley than the solution's, where that is proved."""
    problem = solution.problem
    if proved_jointly_convex(problem):
        return f"{PROVED} in the curve and its slope: there is no other valley"
    if proved_in_another_ordinate(problem):
        return f"{PROVED} {IN_ANOTHER_ORDINATE}: there is no other valley"
    if proved_with_levels(problem, solution.multipliers):
        return f"{PROVED} in the curve and its slope, less its levels by their multipliers: there is no other valley"
    if followed and proved_quadratic(problem):
        return f"{QUADRATIC}: there is one valley"
    if not any(problem.of_type(Isoperimetric)):
        return ""
    from varcalc.existence.of_given_length import by_length  # few problems have levels

    return by_length(solution)


def _with_corners(best: Solution, tol: float, near: Relaxed | None) -> Solution | None:
    """A lower solution with corners, or the known one marked for many; None for neither, as where L is convex.

    Slopes that alternate may have been seen to be lower ``near`` a polygon.
    """
    if best.problem.n > 1 or (near is None and not concave_beside(best)):
        return None
    from varcalc.existence.corners import lower_with_corners  # few problems need them

    return lower_with_corners(best, tol, near)


@dataclass
class _LookedAt:
    """What was looked at: the lattices, in how many directions, and the ``number`` of other valleys."""

    number: int = 0
    reach: float = 0.0
    pieces: int = PIECES
    nodes: int = 0
    across: bool = False
    rows: bool = False
    walled: bool = False
    directions: int = 0
    together: bool = False
    bends: bool = False
    ends: bool = False
    numbers: bool = False
    places: str = ""
    narrow: bool = False
    instead: str = ""
    levelled: bool = False
    unfollowed: bool = False
    displaced: Solution | None = None
    alternating: Relaxed | None = None

    @property
    def sentence(self) -> str:
        """The lattices, as far as L is convex in the slope, and the other valleys."""
        if not (self.directions or self.reach):
            return "other valleys were not looked for: along the curve's own polygon L is no number"
        looked = f"all polygons on a lattice of {self.pieces} by {self.nodes}"
        if self.bends:
            looked = "the least curves of cubic pieces through a box of departures and slopes"
        elif self.directions:
            one = self.directions == 1
            looked += f" in {'the one direction' if one else f'{self.directions} directions'} from the curve"
        else:
            looked += f" within {self.reach:.4g} of the curve"
        across = f"across its hills and wells{', on rows where it is narrow too' if self.rows else ''}"
        looked += f", and those {across}," if self.across and not self.bends else ""
        looked += " and in all directions at once," if self.together and not self.bends else ""
        looked += " and those in a box that keep a level," if self.levelled else ""
        looked += " and what all other ends cost," if self.ends else ""
        looked += " and other values of the unknown numbers," if self.numbers else ""
        looked += f" and {self.places}," if self.places else ""
        looked += " and shifts into narrow valleys," if self.narrow else ""
        walled = self.walled and not self.bends
        looked += f"{'' if looked.endswith(',') else ','} as far as L is convex in the slope," if walled else ""
        looked += f"{'' if looked.endswith(',') else ','} {self.instead}," if self.instead else ""
        valleys = "1 other valley" if self.number == 1 else f"{self.number} other valleys"
        if self.number or not self.unfollowed:
            return f"{looked} were compared, and " + (
                f"{valleys} followed" if self.number else "showed no other valley"
            )
        return f"{looked} were compared, and other valleys not followed"


def _lower_in_breadths(best: Solution, seen: _LookedAt, polish: Polish | None) -> Solution | None:
    """A lower solution, the known one marked or refused for what is lower; None for neither.

    The landscape is looked at in each of its breadths, until a solution is lower.
    """
    marked: Solution | None = None
    for breadth in breadths(formulate(best.problem)):
        # where a lattice shows a valley that is narrower than its meshes it does not lead into it
        lower = _in_narrow_valleys(best, seen, polish, breadth)
        if lower is None or lower.local:
            look = _lower if _is_graph(best.problem) else _lower_in_directions
            lower = look(best, seen, polish, breadth) or lower
        if lower is not None and not lower.local:
            return lower
        marked = marked or lower
    return marked


def _lower(best: Solution, seen: _LookedAt, polish: Polish | None, breadth: float) -> Solution | None:
    """The same of graphs that one lattice holds, where valleys are always followed."""
    problem = best.problem
    assert isinstance(problem, Problem)
    assert polish is not None
    landscape, ordinates = Graphs(problem, breadth), partial(_ordinates, best)
    lattices = _about(best, lambda k: PolygonLattice(landscape, ordinates, pieces=k))
    marked, known = None, None
    while True:
        with np.errstate(all="ignore"):
            about = next(lattices, None)
            if about is None:
                break
            known = about
            valleys = _lowest(best, about, _worth_following(best, about), FOLLOWED)
            seen.walled = seen.walled or about.walled
        seen.pieces, seen.nodes = max(seen.pieces, about.pieces), max(seen.nodes, about.levels)
        seen.reach, seen.number = max(seen.reach, about.reach), seen.number + len(valleys)
        lower = _lower_about(best, about, valleys, polish) or _with_step_elsewhere(best, about, seen, polish)
        if lower is not None and not lower.local:
            return lower
        marked = marked or lower
    if marked is not None:
        return marked
    with np.errstate(all="ignore"):
        lattice = across_the_landscape(landscape, ordinates, known)
        valleys = [] if lattice is None else _lowest(best, lattice, _distinct(lattice), FOLLOWED_ACROSS)
    seen.across, seen.number = lattice is not None, seen.number + len(valleys)
    if lattice is None:
        return None
    seen.rows = seen.rows or bool(lattice.marks)
    if lattice.marks and (fallen := _fallen(best, lattice, valleys)) is not None:
        return fallen
    lower = _followed(best, lattice, valleys, ACROSS, polish)
    return _by_quick_ways(best, seen, lattice, ordinates, polish) or lower if lower is None or lower.local else lower


def _by_quick_ways(
    best: Solution, seen: _LookedAt, across: Lattice, ordinates: Callable[[np.ndarray], np.ndarray], polish: Polish
) -> Solution | None:
    """A lower solution that rests elsewhere most of the time, or the known one marked for that; None for neither."""
    from varcalc.existence.quick_ways import quick_ways, settled  # few landscapes have wells

    with np.errstate(all="ignore"):
        quick = quick_ways(across, ordinates)
        valleys = [] if quick is None else [settled(quick.landscape, v) for v in quick.distinct()[:FOLLOWED]]
    seen.number += len(valleys)
    marked: Solution | None = None
    for valley in valleys:
        assert quick is not None
        found = _kept_in_view(quick.landscape.along(valley), valley.x, polish)
        if found.status.ok and _is_lower(found.value, best, found.error.value, LOWER):
            return found
        marked = marked or _by_polygon(best, quick, valley, followed=True)
    return marked


def _kept_in_view(start: Sampled, x: np.ndarray, polish: Polish) -> Solution:
    """The answer from a curve that is steep in few places: it may move along, and the mesh is then made anew there."""
    from varcalc.existence.quick_ways import mesh_for

    found = polish(IN_NARROW, start, mesh_for(x, start(x)))
    for _ in range(MESHES_MOVED):
        if found.status.ok or found.curve is None or not math.isfinite(found.value):
            break
        start, x = _samples(found), np.unique(np.concatenate([found.x, np.linspace(x[0], x[-1], STEEP_PLACES)]))
        found = polish(IN_NARROW, start, mesh_for(x, start(x)))
    return found


def _about(best: Solution, lattice_of: Callable[[int], PolygonLattice]) -> Iterator[PolygonLattice]:
    """Lattices on ever more pieces, until the known curve's own polygon tells its value, or nothing is lower than that.

    The more pieces there are, the fewer slopes lead from node to node.
    """
    for pieces in (PIECES, *MORE_PIECES):
        lattice = lattice_of(pieces)
        yield lattice
        told = abs(lattice.own_value - best.problem.sign * best.value) <= TELLS_VALUE * lattice.summed
        exact = lattice.summable and not lattice.landscape.approximate
        if told or not exact or not any(valley.value < lattice.own_value for valley in lattice.valleys()):
            return


def _lowest(best: Solution, lattice: Lattice, valleys: list[Valley], most: int) -> list[Valley]:
    """The lowest of the valleys of one function, as many as are followed.

    Where polygons tell no more of their values than others differ by they are moved first.
    """
    unsure = UNSURE * abs(lattice.own_value - best.problem.sign * best.value)
    falling = any(valley.edge for valley in valleys[:most])  # what leaves the lattice is as low as that reaches far
    if len(valleys) <= most or falling or valleys[most].value > valleys[most - 1].value + unsure:
        return valleys[:most]
    valleys = lattice.distinct([valley for valley in valleys if valley.value <= valleys[most - 1].value + unsure])
    if len(valleys) <= most:
        return valleys
    from varcalc.existence.moved_polygons import ranked  # few curves come to this

    order = np.argsort(ranked(lattice.landscape, valleys), kind="stable")
    return [valleys[k] for k in order[:most].tolist()]


def _at_other_places(
    best: Solution, beside: Callable[[Solution], Polish], polish: Polish | None, seen: _LookedAt
) -> Solution | None:
    """A lower solution whose end slides elsewhere, or the known one marked for a lower curve; None for neither."""
    problem = best.problem
    if not any(problem.slides):
        return None
    from varcalc.existence.other_places import begun_at, looked_for, other_places  # few ends slide

    places, reach = other_places(best)
    seen.places = f"{looked} up to {reach:.3g} away" if (looked := looked_for(best)) else ""
    seen.number += len(places)
    marked: Solution | None = None
    for place in places:
        if polish is not None:
            there = replace(best, problem=begun_at(problem, place), x=np.array(place.span))
            found = beside(there)(EXACT, place.start)
            if found.status.ok and _is_lower(found.value, best, found.error.value, LOWER):
                return replace(found, problem=problem)
        lower = _is_lower(problem.sign * place.value, best, 0.0, SURELY_LOWER)
        if marked is None and lower and place.sure:
            tried = LED_NOWHERE if polish is not None else "was not followed: solve by Ritz()"
            curve = f"a curve to another place of its {place.label} has the value {problem.sign * place.value:.6g}"
            marked = local_only(best, f"{curve}, and {tried}")
    return marked


def _with_other_numbers(
    best: Solution, beside: Callable[[Solution], Polish], polish: Polish | None, seen: _LookedAt
) -> Solution | None:
    """A lower solution with another value of an unknown number, or the known one marked for one; None for neither."""
    from varcalc.existence.other_numbers import other_numbers  # few problems have unknown numbers

    problem, curve = best.problem, best.curve
    assert curve is not None
    seen.numbers, marked = True, None
    for other in other_numbers(best):
        seen.number += 1
        if polish is not None:
            found = beside(replace(best, problem=other.problem))(EXACT, lambda x: curve(np.atleast_1d(x), 0))
            if found.status.ok and _is_lower(found.value, best, found.error.value, LOWER):
                return replace(found, problem=problem)
        value = problem.sign * other.value
        if marked is None and other.surely and _is_lower(value, best, 0.0, SURELY_LOWER):
            tried = LED_NOWHERE if polish is not None else "was not followed: solve by Ritz()"
            known = f"with {other.name} = {other.number:.6g} the same curve has the value {value:.6g}"
            marked = local_only(best, f"{known}, and {tried}")
    return marked


def _in_narrow_valleys(best: Solution, seen: _LookedAt, polish: Polish | None, breadth: float) -> Solution | None:
    """A lower solution in a valley that no lattice shows, or the known one marked for that; None for neither."""
    if not _may_be_narrow(best.problem):
        return None
    from varcalc.existence.narrow_valleys import narrow_valleys  # few solves need them

    ordinates: Sampled | None = (lambda x: _ordinates(best, x)[None]) if _is_graph(best.problem) else None
    with np.errstate(all="ignore"):
        narrow = narrow_valleys(best, ordinates, breadth)
        valleys = [] if narrow is None else narrow.distinct()
    seen.narrow, seen.number = seen.narrow or narrow is not None, seen.number + len(valleys)
    marked: Solution | None = None
    for valley in valleys:
        assert narrow is not None
        if polish is not None:
            found = polish(IN_NARROW, narrow.landscape.along(valley), valley.marks)
            if found.status.ok and _is_lower(found.value, best, found.error.value, LOWER):
                return found
        marked = marked or _by_polygon(best, narrow, valley, followed=polish is not None)
    return marked


@derived
def _may_be_narrow(problem: Functional) -> bool:
    return problem.symbols.kind is ca.SX and not gentle_across(integrals(problem), PLACE)


def _lower_in_directions(best: Solution, seen: _LookedAt, polish: Polish | None, breadth: float) -> Solution | None:
    """The same where no lattice holds all curves: in each direction from the known one.

    Without ``polish`` polygons are compared, and no valley is followed.
    """
    from varcalc.existence.cheaper_ends import cheaper_ends  # few solves need them
    from varcalc.existence.together import together

    found: list[_Found] = []
    bends = best.problem.order > 1
    with np.errstate(all="ignore"):
        looked, acrosses = _in_directions(best, breadth)
        seen.bends = bends
        seen.directions = len({tuple(direction.shares.tolist()) for direction, _ in looked})
        seen.instead = _instead(best.problem)
        seen.pieces = max([seen.pieces, *(about.pieces for _, about in looked)])
        seen.nodes = max([seen.nodes, *(about.levels for _, about in looked)])
        seen.walled = seen.walled or any(about.walled for _, about in looked)
        seen.across = seen.across or any(across is not None for across in acrosses)
        seen.rows = seen.rows or any(across is not None and bool(across.marks) for across in acrosses)
        pairs = [(*pair, across) for pair, across in zip(looked, acrosses, strict=True)]
        for (direction, about), across in zip(looked, acrosses, strict=True):
            if bends:  # polygons show how far out there are hills and wells, no more
                continue
            valleys = _worth_following(best, about)
            valleys = valleys if best.problem.n == 1 else valleys[:FOLLOWED]
            if not direction.approximate and (fallen := _fallen(best, about, valleys)) is not None:
                return fallen
            found += [(v.value - about.own_value, about, v, (ROUGH, EXACT)) for v in valleys]
            found += _across(across)
        boxes: Sequence[Valleys] = [] if bends else together(pairs)
        if bends:
            bent, fall = _least_bent(pairs)
            if fall is not None:
                return _on_fall(best, fall)
            boxes = [] if bent is None else [bent]
        levelled = _keeping_levels(best, pairs)
        seen.alternating = _lowest_alternating(best, levelled, seen.alternating)
        ends = cheaper_ends(best)
        found += [valley for lattice in (*boxes, ends) for valley in _across(lattice)]
    if len(found) > FOLLOWED_IN_DIRECTIONS:
        found = list(_closer(best, found))
    found = sorted(found, key=lambda f: f[0])[:FOLLOWED_IN_DIRECTIONS]
    # how low a coarse polygon lies that keeps a level tells less than that it does
    found += [valley for lattice in levelled for valley in _across(lattice)]
    seen.together, seen.ends = seen.together or bool(boxes), seen.ends or ends is not None
    seen.levelled = seen.levelled or bool(levelled)
    if polish is None:
        seen.unfollowed = bool(found)
        polygons = (_by_polygon(best, lattice, valley, followed=False) for _, lattice, valley, _ in found)
        return next((lower for lower in polygons if lower is not None), None)
    seen.number += len(found)
    followed = (_followed(best, lattice, [valley], way, polish) for _, lattice, valley, way in found)
    lower = next((lower for lower in followed if lower is not None), None)
    if (lower is not None and not lower.local) or bends or not isinstance(best.problem, Problem):
        return lower
    quick = (_by_quick_ways(best, seen, across, np.zeros_like, polish) for across in acrosses if across is not None)
    return next((other for other in quick if other is not None), lower)


def _lowest_alternating(best: Solution, levelled: Sequence[LevelledPolygons], known: Relaxed | None) -> Relaxed | None:
    """The lowest polygon of two slopes a piece that was seen about this curve, or is ``known`` from one before it."""
    seen = [t.alternating for t in levelled if t.alternating is not None and t.may_be_lower(best)]
    near = min(seen, key=lambda found: found.value, default=None)
    if near is None or (known is not None and known.value <= near.value):
        return known
    from varcalc.existence.corners import alternating_about  # few problems need them

    return alternating_about(best, near)


def _keeping_levels(best: Solution, looked: Sequence[Looked]) -> list[LevelledPolygons]:
    """The least polygons that keep a level each.

    Where of all polygons none is lower that need not keep it, with the level by its multiplier, none is that does (weak
    duality: Luenberger, "Optimization by Vector Space Methods", ch. 8).
    """
    if not (looked and any(best.problem.of_type(Isoperimetric))):
        return []
    lattices = [lattice for _, *both in looked for lattice in both if lattice is not None]
    lower = any(v.value < t.own_value - NONE_LOWER * t.summed for t in lattices for v in t.valleys())
    departures = looked[0][0].departures
    # of several functions lattices along directions hold few, and none holds what alternates between two slopes
    few = len(departures.axes) > 1 or any(map(departures.mixed_by_level, range(len(departures.levels))))
    if not (lower or few):
        return []
    from varcalc.existence.levelled_polygons import keeping_levels  # few problems come to this

    return keeping_levels(looked)


def _least_bent(
    looked: list[tuple[AlongDirection, PolygonLattice, Lattice | None]],
) -> tuple[Valleys | None, Fall | None]:
    """The least curves of second order, and a line of them that leads down for ever."""
    from varcalc.existence.bent_curves import least_bent  # few problems are of second order

    box = least_bent(looked) if looked else None
    return box, None if box is None else box.fall()


def _in_directions(
    best: Solution, breadth: float
) -> tuple[list[tuple[AlongDirection, PolygonLattice]], list[Lattice | None]]:
    """The lattices in each direction from the known curve, and those across the hills and wells there.

    From the polygon through it, where that is admitted: from a curve no polygon departs that is one itself.
    """
    from varcalc.existence.along_directions import from_polygon, in_directions, is_polygonal

    if is_polygonal(best.problem):
        directions: list[AlongDirection] = []

        def lattice_of(pieces: int) -> PolygonLattice:
            directions.append(from_polygon(best, pieces, breadth))
            return PolygonLattice(directions[-1], np.zeros_like, pieces=pieces)

        about = list(_about(best, lattice_of))
        across = across_the_landscape(from_polygon(best, PIECES_ACROSS, breadth), np.zeros_like, about[-1])
        if math.isfinite(about[-1].own_value) and (across is None or math.isfinite(across.own_value)):
            return list(zip(directions, about, strict=True)), [across, *(None for _ in about[1:])]
    looked = [(d, PolygonLattice(d, np.zeros_like)) for d in in_directions(best, breadth)]
    looked = [(direction, about) for direction, about in looked if math.isfinite(about.own_value)]
    # in several directions at once a way may be cheaper
    return looked, [across_the_landscape(d, np.zeros_like, about if len(looked) == 1 else None) for d, about in looked]


def _closer(best: Solution, found: list[_Found]) -> Iterator[_Found]:
    """What was found, those of one function with how high their polygons lie over the known curve once moved."""
    from varcalc.existence.moved_polygons import ranked  # few curves come to this

    of_one = [f for f in found if f[2].y.ndim == 1]
    for lattice in dict.fromkeys(f[1] for f in of_one):
        mine = [f for f in of_one if f[1] is lattice]
        values = ranked(lattice.landscape, [valley for _, _, valley, _ in mine])
        yield from ((value - best.problem.sign * best.value, *f[1:]) for value, f in zip(values, mine, strict=True))
    yield from (f for f in found if f[2].y.ndim > 1)


def _across(lattice: Valleys | None) -> list[_Found]:
    """The valleys that are seen across hills and wells."""
    if lattice is None:
        return []
    valleys = _distinct(lattice) if isinstance(lattice, Lattice) else lattice.distinct()[:FOLLOWED_ACROSS]
    return [(v.value - lattice.own_value, lattice, v, ACROSS) for v in valleys]


def _distinct(lattice: Lattice) -> list[Valley]:
    """The distinct valleys of one function, those that lie high where they are low once moved."""
    valleys = lattice.distinct()
    low = [valley for valley in valleys if valley.value < lattice.low]
    return [*low, *_low_once_moved(lattice, valleys[len(low) :])]


def _worth_following(best: Solution, lattice: Lattice) -> list[Valley]:
    """The valleys beyond a ridge, and those whose polygon, which is a curve as others are, is surely lower.

    A curve may rest on what is as narrow as a floor against division by zero: no ridge is seen about it.
    """
    valleys = lattice.valleys()
    told = zip(valleys, lattice.apart(valleys), strict=True)
    sure = [(v.value < lattice.low and apart) or _surely_lower(best, lattice, v) for v, apart in told]
    doubtful = [*compress(valleys, np.logical_not(sure))]
    # on its coarse pieces a polygon may lie far above the valley, and above the ridge before it
    moved = _low_once_moved(lattice, [*compress(doubtful, lattice.bends_down(doubtful))])
    left = sorted([*compress(valleys, sure), *compress(moved, lattice.apart(moved))], key=lambda valley: valley.value)
    kept: list[Valley] = []
    while left:
        kept, left = [*kept, left[0]], [*compress(left[1:], lattice.parted(left[0], left[1:]))]
    return kept


def _low_once_moved(lattice: Lattice, valleys: Sequence[Valley]) -> list[Valley]:
    """The valleys, moved, that are next to as low as the known curve then, or lower."""
    if not valleys:
        return []
    from varcalc.existence.moved_polygons import moved_a_little  # few curves come to this

    moved = moved_a_little(lattice.landscape, valleys)
    return [v for v in moved if v.value < lattice.own_value + ROUGHLY * _size(lattice, v)]


def _surely_lower(best: Solution, lattice: Lattice, valley: Valley) -> bool:
    low = valley.value < best.problem.sign * best.value - SURELY_LOWER * _size(lattice, valley)
    return low and _is_lower(_along(lattice.landscape, valley, best), best, 0.0, SURELY_LOWER)


def _told(best: Solution, lower: Solution | None, looked: str) -> Solution:
    """The solution with what was looked at, and marked local where something ``lower`` is known."""
    if lower is None and concave_in_bend(best):
        rest = "L is not convex in the second derivative, and curves that bend to and fro more often were not compared"
        return _perhaps_local(best, rest, looked)
    if lower is None:
        return replace(best, searched=looked)
    if lower.status.ok and not lower.local:  # another solution, which is told of
        lower = local_only(best, f"{lower.value:.12g} is reached in another valley", lower.value)
    return replace(lower, searched=looked)


def _perhaps_local(best: Solution, doubt: str, looked: str) -> Solution:
    return replace(best, local=True, message=f"perhaps a local {sought(best.problem)} only: {doubt}", searched=looked)


def _instead(problem: Functional) -> str:
    """What stands for the functional itself along such polygons; empty where it does itself."""
    return "a level by its multiplier" if any(problem.of_type(Isoperimetric)) else ""


def _lower_about(best: Solution, lattice: Lattice, valleys: list[Valley], polish: Polish) -> Solution | None:
    """A solution in a valley that is lower, the known one marked or refused for what is lower; None for neither."""
    if (rivalled := with_rival(best)) is not best:  # a jump is no polygon, and its cost is known exactly
        return rivalled
    if (fallen := _fallen(best, lattice, valleys)) is not None:
        return fallen
    return _followed(best, lattice, valleys, (ROUGH, EXACT), polish)


def _fallen(best: Solution, lattice: Lattice, valleys: list[Valley]) -> Solution | None:
    """The solution marked for a line of curves that leads down for ever; None where none was seen."""
    with np.errstate(all="ignore"):
        fall = next(filter(None, map(lattice.fall, valleys)), None) or lattice.fall_far_out()
    return None if fall is None else _on_fall(best, fall)


def _on_fall(best: Solution, fall: Fall) -> Solution:
    """The solution marked for a line of curves that leads down for ever."""
    return local_only(best, fall.finding.sentence, -best.problem.sign * math.inf)


def _followed(
    best: Solution, lattice: Valleys, valleys: list[Valley], ways: tuple[Ritz, Ritz], polish: Polish
) -> Solution | None:
    """The first solution in a valley that is lower, or the known one marked for a polygon that is; None for neither."""
    seen_first = any(best.problem.of_type(Bound)) or breakable(best.problem)
    for valley in valleys:
        if seen_first and valley.y.ndim == 1:
            # an interior-point method may leave a valley, and takes long: what lies in it is first seen by polygons
            if (found := _by_moved_polygon(best, lattice, valley, polish)) is not None:
                return found
            continue
        if (found := _by_meshes(best, lattice, valley, ways, polish)) is not None:
            return found
        if seen_first and (found := _as_it_meets(best, lattice, valley, polish)) is not None:
            return found
        if (marked := _by_polygon(best, lattice, valley, followed=True)) is not None:
            return marked
    return None


def _by_meshes(
    best: Solution, lattice: Valleys, valley: Valley, ways: tuple[Ritz, Ritz], polish: Polish
) -> Solution | None:
    """The solution in a valley, or the known one marked where a rough mesh alone held it; None where it is no lower."""
    sign, (rough_way, exact_way) = best.problem.sign, ways
    start = lattice.landscape.along(valley.start)
    rough = polish(rough_way, start)
    if valley.steep and not rough.status.ok and math.isnan(rough.value):
        # a polygon as steep as a curve may be leads nowhere, nor is a coarse mesh beside it less steep
        start = _withdrawn(best, start)
        rough = polish(ACROSS[0], start)
    # a coarse mesh may say of a steep curve no more than that it is far lower
    low = sign * (rough.value - best.value) < ROUGHLY * _size(lattice, valley)
    if not low or _departure(rough, best) < ONE_CURVE:
        return None
    # what a coarse mesh does not hold asks for many elements
    many = exact_way if rough.status.ok else ACROSS[1]
    found = polish(many, start)
    if not found.status.ok and many != exact_way:
        found = polish(exact_way, start)
    surely = rough.status.ok and _is_lower(rough.value, best, rough.error.value, SURELY_LOWER)
    if surely and not (found.status.ok and _is_lower(found.value, best, found.error.value, LOWER)):
        # the finer mesh left the valley; or the polygon left the domain of L, which the rough curve on its mesh did not
        found = polish(many if found.status.ok else ACROSS[1], _samples(rough))
    if found.status.ok and _is_lower(found.value, best, found.error.value, LOWER):
        return found
    if surely:
        return local_only(best, f"a rough curve has the value {rough.value:.6g}, and {LED_NOWHERE}")
    return None


def _size(lattice: Valleys, valley: Valley) -> float:
    """The size of what is summed along the known curve, or in a valley: values are known to shares of that."""
    return max(lattice.summed, valley.size)


def _as_it_meets(best: Solution, lattice: Valleys, valley: Valley, polish: Polish) -> Solution | None:
    """The lower solution that meets what switches as the curve in a valley does; None where there is none.

    With all of that rounded off the ridge before a valley may be gone.
    """
    from varcalc.existence.moved_polygons import marked

    if not valley.value < best.problem.sign * best.value + NEARLY * _size(lattice, valley):
        return None
    found = polish(IN_NARROW, lattice.landscape.along(valley), marked(valley).marks)
    return found if found.status.ok and _is_lower(found.value, best, found.error.value, LOWER) else None


def _samples(solution: Solution) -> Sampled:
    """The curve of a solution, to start from."""
    curve = solution.curve
    assert curve is not None
    return lambda x: curve(np.atleast_1d(x), 0)


def _withdrawn(best: Solution, start: Sampled) -> Sampled:
    """What is started from nearer to the known curve, whose slopes are less than the steepest."""
    curve = best.curve
    assert curve is not None

    def nearer(x: np.ndarray) -> np.ndarray:
        known = curve(np.atleast_1d(x), 0)
        return known + WITHDRAWN * (start(np.atleast_1d(x)) - known)

    return nearer


def _by_moved_polygon(best: Solution, lattice: Valleys, valley: Valley, polish: Polish) -> Solution | None:
    """The solution in a valley, or the known one marked for its polygon; None where even that is no lower."""
    from varcalc.existence.moved_polygons import moved_on

    sign = best.problem.sign
    with np.errstate(all="ignore"):
        polygon = moved_on(lattice.landscape, valley)
    start = lattice.landscape.along(polygon)
    # next to the known curve, which its pieces draw from above, only what is lower says that there is another
    nearly = NEARLY if _away(start, best, best.x) >= ONE_CURVE else 0.0
    if not polygon.value < sign * best.value + nearly * _size(lattice, valley):
        return None
    if valley.marks and (found := _about_corners(best, valley)) is not None:
        return found
    found = polish(IN_NARROW, start, polygon.marks)
    if found.status.ok:
        return found if _is_lower(found.value, best, found.error.value, LOWER) else None
    return _by_polygon(best, lattice, polygon, followed=True)


def _about_corners(best: Solution, valley: Valley) -> Solution | None:
    """The lower solution that goes about corners of walls as the polygon in a valley does; None where there is none."""
    from varcalc.existence.wall_corners import about_corners_of_walls  # few landscapes have walls

    problem, curve = best.problem, best.curve
    if not isinstance(problem, Problem) or curve is None:
        return None
    found = about_corners_of_walls(problem, valley, curve, TOLERANCE)
    return found if found is not None and _is_lower(found.value, best, found.error.value, LOWER) else None


def _by_polygon(best: Solution, lattice: Valleys, valley: Valley, *, followed: bool) -> Solution | None:
    """The known solution marked where a polygon is lower, whose value says nothing of what is lowest there."""
    if not valley.value < best.problem.sign * best.value + NEARLY * _size(lattice, valley):
        return None  # its sum to all digits takes far longer
    value, known = _along(lattice.landscape, valley, best), not math.isnan(valley.summed)
    if not _is_lower(value, best, 0.0, LOWER if known else SURELY_LOWER) or _goes_through_bounds(best, lattice, valley):
        return None
    tried = LED_NOWHERE if followed else "was not followed: solve by Ritz()"
    kind = "curve of cubic pieces" if known else "polygon"
    return local_only(best, f"a {kind} has the value {value:.6g}, and {tried}")


def _goes_through_bounds(best: Solution, lattice: Valleys, valley: Valley) -> bool:
    """Whether the polygon of a graph of one function breaks a bound between the points of the rules that sum it."""
    if not any(best.problem.of_type(Bound)) or valley.y.ndim > 1 or best.problem.n > 1 or best.problem.order > 1:
        return False
    from varcalc.existence.directions import polygonal

    curve = polygonal(valley.x, lattice.landscape.along(valley)(valley.x))
    return not keeps_bounds(replace(best, curve=curve, x=valley.x, extremal=None))


def _departure(solution: Solution, best: Solution) -> float:
    """How far a curve goes from the known one, in units of the larger extent; at rest, of the known ordinates."""
    return math.inf if solution.curve is None else _away(_samples(solution), best, solution.x)


def _away(other_curve: Sampled, best: Solution, x: np.ndarray) -> float:
    """The same of a curve at abscissae from the least to the largest of ``x``."""
    if best.curve is None:
        return math.inf
    places = [np.linspace(abscissae.min(), abscissae.max(), DEPARTURE_PLACES) for abscissae in (best.x, x)]
    own, other = best.curve(places[0], 0), other_curve(places[1])
    extent = max(float(np.ptp(rows, axis=1).max()) for rows in (own, other)) or float(np.abs(own).max())
    return float(np.abs(other - own).max()) / extent if extent > 0 else 0.0


def _with_step_elsewhere(best: Solution, lattice: Lattice, seen: _LookedAt, polish: Polish) -> Solution | None:
    """A lower solution with its step elsewhere, where most of the way the curve rests; None for none."""
    rises = np.sort(np.abs(np.diff(lattice.c)))
    if seen.displaced is best or rises[:-STEP_PIECES].sum() > AT_REST * rises.sum():
        return None
    from varcalc.existence.displaced import displaced  # few curves come to this

    seen.displaced = best  # no other lattice shows more of it
    for start in displaced(best):
        found = polish(FINE, start)
        if found.status.ok and _is_lower(found.value, best, found.error.value, 0.0):
            return found
    return None


def _is_lower(value: float, best: Solution, error: float, share: float) -> bool:
    sign = best.problem.sign
    margin = error + best.error.value + share * max(abs(best.value), abs(value))
    return sign * value < sign * best.value - margin


def _along(landscape: Landscape, valley: Valley, best: Solution) -> float:
    """The functional along a polygon, made worse by what is not known of it; infinite where it keeps no level.

    That is what two rules differ by, and what it costs next to the vertices, in panels that no rule may have resolved.
    Infinite as well where it is not below the value of the known solution without all that.
    """
    if not math.isnan(valley.summed):
        return landscape.sign * valley.summed
    steps, shape, sums = np.diff(valley.x), valley.y.shape[1:], []
    slopes, ends = (np.diff(valley.y, axis=0).T / steps).T, at_ends(landscape, valley.y)
    # a steep piece may cost next to a vertex what it costs
    panels = np.append((valley.x[:-1, None] + steps[:, None] * TOWARD_VERTICES).ravel(), valley.x[-1])
    for count in POLYGON_RULES:
        x, weights = composite_gauss(panels, count)
        slope = np.repeat(slopes, count * len(TOWARD_VERTICES), axis=0)
        ordinates = valley(x).T.reshape(-1, *shape)
        if not landscape.own_values(x, weights, ordinates, slope):
            return landscape.sign * math.inf
        sums.append(float(landscape.values(x, ordinates, slope) @ weights))
        if sums[0] + ends >= landscape.sign * best.value:
            return landscape.sign * math.inf
    apart = RULES_APART * abs(sums[0] - sums[1]) + _beside_vertices(landscape, valley, slopes)
    return landscape.sign * (sums[0] + ends + apart)


def _beside_vertices(landscape: Landscape, valley: Valley, slopes: np.ndarray) -> float:
    """What a polygon costs in the panels next to its vertices if all of them cost what the vertex does."""
    sides = [landscape.values(valley.x[k], valley.y[k], slopes) for k in (slice(None, -1), slice(1, None))]
    costs = np.abs(sides) * np.diff(valley.x) * TOWARD_VERTICES[1]
    return float(np.sum(costs, where=np.isfinite(costs)))  # where L is infinite at an end rules alone tell


def has_lattice(problem: Functional) -> bool:
    """Whether one lattice of polygons holds all curves about a solution."""
    return not _not_looked(problem) and _is_graph(problem)


def _is_graph(problem: Functional) -> bool:
    """Whether curves are graphs of one function between two given abscissae, under no condition."""
    ends = (problem.start, problem.end)
    plain = isinstance(problem, Problem) and problem.n == problem.order == 1
    plain = plain and not (problem.constraints or problem.unknowns)
    return plain and problem.end_cost is None and not any(e.slides or e.periodic for e in ends)


def _not_looked(problem: Functional) -> str:
    """That other valleys were not looked for, and why there is no lattice; empty where there is one."""
    if any(isinstance(c, Holonomic) for c in problem.constraints):
        return "other valleys were not looked for: the curve is held to a surface"
    lacking = "other valleys were not looked for: what is stated holds an operation that NumPy has no form of"
    return "" if _takes_columns(problem) else lacking


def _takes_columns(problem: Functional) -> bool:
    """Whether what is stated is a function of columns."""
    if isinstance(problem, Problem) and _is_graph(problem):
        return problem.vectorised
    from varcalc.existence.directions import stated_at_points

    return stated_at_points(problem).vectorised
