"""Directions in which what is narrow in a medium is met: read from the index, and aimed at.

A fan that is as fine as can be paid for passes by what is narrower than the distance of its rays. Where that may
be is read from the expression of n² (:mod:`varcalc.symbolic.narrow`). Which rays meet a spot is a search like that for
any other point, and rays close to them are added to the fan; what is behind a spot may be met through it, so
that the search is made again with what was added. What is narrow but long, a wall or a ring, is met by many rays: more
directions are looked at, but those that go along it, from intervals of directions that shrink exponentially with their
way there, are not looked for, which is counted and said.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import casadi as ca
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from varcalc.optics.arrivals.cells import MOVED, P
from varcalc.optics.arrivals.fan import AXES_OFF, FIRST_ANGLES, LEAST_ANGLE, LOOKS, AimedDirections, Fan, FanReach
from varcalc.optics.arrivals.wavefront_construction import PlanePairs, WavefrontConstruction
from varcalc.optics.media.tabulated import Layers
from varcalc.optics.models.hamilton import HamiltonRays
from varcalc.optics.propagation.sequential import Propagator
from varcalc.optics.rays.beam import Rows
from varcalc.progress import Stage
from varcalc.symbolic.narrow import NarrowPlaces, narrow_places

SEEN = 0.03
"""What is seen under a larger angle is met by several of the directions that are looked at."""
TOUCHING = 1.5
"""Boxes no farther apart than so many times their widths belong together."""
GRADED = 4.0
"""Boxes about something narrow are wider than it by no more, and than their distance from it, for each of them."""
COMPACT = 24
"""A spot reaches no farther than so many widths of its narrowest part."""
RAYS_ACROSS = 8
"""Rays for each width across what is narrow."""
MOST_ACROSS = 256
"""Rays across it."""
FARTHEST = 16.0
"""Of the scene: how far off the points it is looked for what is narrow."""
ROUNDS = 4
"""How often what is met through something else that is narrow is aimed at."""
MOST_SPOTS = 64
"""Places that are aimed at."""
MOST_LOOKS = 256
"""By how many times more directions than the first it is looked for what is narrow and long."""
NEAR = 2.0
"""Of the scene: how far from a source what is narrow and long is near."""
LOOKS_ACROSS = 2
"""Directions for each width of it."""


@dataclass(frozen=True)
class Spots(Rows):
    """k places that are narrow as a whole: ``middle`` (k, 2), ``reach`` (k,) from there, and the ``width`` of parts."""

    middle: np.ndarray
    reach: np.ndarray
    width: np.ndarray


@dataclass
class NarrowSearch:
    """What is narrow in the last medium of a scene in the plane; what was read is kept."""

    propagator: Propagator
    _read: dict[tuple[int, int, int], NarrowPlaces] = field(default_factory=dict, init=False, repr=False)

    def aimed(self, sources: np.ndarray, bounds: FanReach, stage: Stage) -> tuple[AimedDirections, np.ndarray, str]:
        """The directions of the ``sources`` (n, 2) to be looked at, how much (n,) is given up, and what is said.

        Rays are followed as far as ``bounds`` say.
        """
        places = NarrowPlaces.none() if self._squared is None else self._places(self._squared, bounds)
        if len(places.width) == 0:
            return AimedDirections.nowhere(), np.zeros(len(sources), dtype=int), ""
        return _Aiming(self.propagator, sources, bounds, places, stage).run()

    @cached_property
    def _squared(self) -> ca.Function | None:
        """n² of a point, where rays are bent by it and it can be read."""
        last = self.propagator.models[-1]
        if not isinstance(last, HamiltonRays) or isinstance(last.medium, Layers):
            return None
        place = ca.SX.sym("r", 2)
        try:
            return ca.Function("squared", [place], [ca.SX(last.medium.squared_index(place))])
        except (TypeError, NotImplementedError):  # an index that is no expression of SX symbols cannot be read
            return None

    def _places(self, function: ca.Function, bounds: FanReach) -> NarrowPlaces:
        """What is narrow where rays may come: in a square around all that is read once for scenes of about one size."""
        far = np.minimum(bounds.far, FARTHEST * bounds.size)[:, None]
        low, high = (bounds.middle - far).min(axis=0), (bounds.middle + far).max(axis=0)
        width = 2.0 ** np.ceil(np.log2((high - low).max()))
        corner = np.floor(low / (width / 4))
        key = (int(corner[0]), int(corner[1]), int(np.log2(width)))
        if key not in self._read:
            # off the axes, on which many an index has its centres
            middle = (corner + 3.0 + AXES_OFF) * width / 4
            self._read[key] = narrow_places(function, middle, 1.5 * width)
        return self._read[key]


@dataclass(frozen=True)
class _Seen:
    """What one source sees under small angles: ``spots``, and somewhere a place ``along`` (2,) what is long.

    ``looks`` is by how many times more directions to look, ``left`` how much is given up.
    """

    spots: Spots
    looks: int
    left: int
    along: np.ndarray | None


@dataclass
class _Aiming:
    """One search for the directions that lead to narrow ``places``."""

    propagator: Propagator
    sources: np.ndarray
    bounds: FanReach
    places: NarrowPlaces
    stage: Stage

    def run(self) -> tuple[AimedDirections, np.ndarray, str]:
        """See :meth:`NarrowSearch.aimed`."""
        seen = [self._seen(number) for number in range(len(self.sources))]
        spots = Spots.joined([one.spots for one in seen])
        given_up = np.array([one.left for one in seen])
        source = np.repeat(np.arange(len(seen)), [len(one.spots) for one in seen])
        aimed = AimedDirections(np.zeros(0, dtype=int), np.zeros(0), max(one.looks for one in seen))
        said = ""
        if len(source):
            said += f", something narrow near {_point(spots.middle[0])} aimed at"
            aimed, lost = self._met(source, spots, aimed)
            np.add.at(given_up, lost, 1)
        along = [one.along for one in seen if one.along is not None]
        if along:
            said += f", rays along what is narrow near {_point(along[0])} not looked for"
        return aimed, given_up, said

    def _seen(self, number: int) -> _Seen:
        """What one source sees under small angles."""
        source, places = self.sources[number], self.places
        away = np.linalg.norm(places.middle - source, axis=1)
        inside = np.linalg.norm(places.middle - self.bounds.middle[number], axis=1) < self.bounds.far[number]
        small = np.flatnonzero((places.width < SEEN * away) & inside)
        away, middle, width, settled = (v[small] for v in (away, places.middle, places.width, places.settled))
        near = away < NEAR * self.bounds.size[number]
        spots, angle, along = [], np.inf, None
        for of in _clusters(middle, width):
            centre = np.average(middle[of], axis=0, weights=1 / width[of])
            reach = float((np.linalg.norm(middle[of] - centre, axis=1) + width[of]).max())
            long = of[near[of]]
            if reach < COMPACT * width[of].min():
                spots.append((*centre, reach, width[of].min()))
            elif len(long):
                along = middle[long[0]]
                known = long[settled[long]]
                angle = min(angle, float((width[known] / away[known]).min(initial=np.inf)))
        looks = int(np.clip(LOOKS_ACROSS * 2 * np.pi / angle / FIRST_ANGLES, LOOKS, MOST_LOOKS))
        left = int(along is not None) + int(len(spots) > MOST_SPOTS)
        columns = np.array(spots[:MOST_SPOTS]).reshape(-1, 4)
        return _Seen(Spots(columns[:, :2], columns[:, 2], columns[:, 3]), looks, left, along)

    def _met(self, source: np.ndarray, spots: Spots, aimed: AimedDirections) -> tuple[AimedDirections, np.ndarray]:
        """Directions to ``spots`` (k,), each of one source, also through each other; the sources that have more."""
        bounds = self._widened(source, spots)
        distance = np.linalg.norm(spots.middle - self.sources[source], axis=1)
        pairs = PlanePairs(source, spots.middle, self.bounds.path[source], distance)
        known: list[tuple[int, float, float]] = []
        lost = source[:0]
        for _ in range(ROUNDS):
            fan = Fan(self.propagator, self.sources, bounds, aimed, self.stage)
            met = WavefrontConstruction(fan, pairs).run(self.stage).meeting
            pair, angle, p, moved = met.aims.pair, met.aims.angle, met.state[:, P], met.state[:, MOVED]
            with np.errstate(divide="ignore"):
                scale = np.linalg.norm(p, axis=1) / np.abs(p[:, 0] * moved[:, 1] - p[:, 1] * moved[:, 0])
            half, step = np.minimum(spots.reach[pair] * scale, SEEN), spots.width[pair] * scale
            new = [
                k for k in range(len(pair))
                if not any(pair[k] == other and abs(angle[k] - a) <= h for other, a, h in known)
            ]  # fmt: skip
            if not new:
                return aimed, source[:0]
            lost = source[pair[new]]
            known += [(int(pair[k]), float(angle[k]), float(half[k])) for k in new]
            around = [_around(float(angle[k]), float(half[k]), float(step[k])) for k in new]
            of = np.repeat(source[pair[new]], [len(angles) for angles in around])
            aimed = replace(aimed, source=np.append(aimed.source, of), angles=np.concatenate([aimed.angles, *around]))
        return aimed, lost

    def _widened(self, source: np.ndarray, spots: Spots) -> FanReach:
        """The bounds of rays that are to come to the spots."""
        away = np.linalg.norm(spots.middle - self.bounds.middle[source], axis=1)
        reach = self.bounds.reach.copy()
        np.maximum.at(reach, source, away)
        return replace(self.bounds, reach=reach)


def _point(place: np.ndarray) -> str:
    return f"({place[0]:.6g}, {place[1]:.6g})"


def _around(angle: float, half: float, step: float) -> np.ndarray:
    """Directions across what is seen from ``angle`` - ``half`` to + ``half``, parts of which are ``step`` wide."""
    least = LEAST_ANGLE * RAYS_ACROSS
    half, step = max(half, least), min(max(step, least), SEEN)
    even = half * np.linspace(-1, 1, int(np.clip(2 * half / step * RAYS_ACROSS, 2 * RAYS_ACROSS, MOST_ACROSS)))
    beyond = step / RAYS_ACROSS * 2.0 ** np.arange(np.ceil(np.log2(SEEN * RAYS_ACROSS / step)))
    found = np.unique(np.concatenate([even, beyond, -beyond]))
    turned = angle + found[np.append(True, np.diff(found) > LEAST_ANGLE)]
    return AXES_OFF + np.mod(turned - AXES_OFF, 2 * np.pi)


def _clusters(middle: np.ndarray, width: np.ndarray) -> list[np.ndarray]:
    """Which of the boxes (k,) are of each thing that is narrow, from the narrowest on.

    Boxes grow with their distance from a spot: those about one that is found are of it.
    """
    found, left = [], np.arange(len(width))
    while len(left) and len(found) <= MOST_SPOTS:
        alike = left[width[left] <= GRADED * width[left].min()]
        label = _together(middle[alike], width[alike])
        for k in range(label.max() + 1):
            of = alike[label == k]
            away, _ = cKDTree(middle[of[: COMPACT**2]]).query(middle[left], p=np.inf)
            found.append(of)
            left = left[away > GRADED * width[left]]
        left = np.setdiff1d(left, alike)
    return found


def _together(middle: np.ndarray, width: np.ndarray) -> np.ndarray:
    """A number for each of the boxes (k,), the same for those that touch or nearly."""
    label, largest = np.arange(len(width)), width.max()
    near = cKDTree(middle).query_pairs(2 * TOUCHING * largest, output_type="ndarray")
    apart = np.abs(middle[near[:, 0]] - middle[near[:, 1]]).max(axis=1)
    near = near[apart <= TOUCHING * (width[near[:, 0]] + width[near[:, 1]]) / 2 * 1.5]
    graph = coo_array((np.ones(len(near)), (near[:, 0], near[:, 1])), shape=(len(label), len(label)))
    return connected_components(graph, directed=False)[1]
