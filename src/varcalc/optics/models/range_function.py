"""All rays between points of layers or about a centre, by the range function: the questions and their answers."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from functools import cached_property

import numpy as np

from varcalc.numerics.one_coordinate.quadrature import AGREED
from varcalc.optics.media.medium import Medium, Radial, Stratified
from varcalc.optics.media.tabulated import Tabulated
from varcalc.optics.models.aimed import Aimed, Carry, Tell, Told, met
from varcalc.optics.models.jumps import jumps_of
from varcalc.optics.models.launches import Launch, Launches, launches, rounded_up
from varcalc.optics.models.passage_tables import PassageTables
from varcalc.optics.models.reduction import Profile, RayPotential
from varcalc.optics.models.tables import TableProfile
from varcalc.optics.rays.beam import Rows, frames
from varcalc.optics.rays.ray import SHADOW, Ray, Rays, no_rays

UPRIGHT = 1e-13
"""Of the distance of two points: what they lie apart along layers is none."""
HEIGHT_ROUND_OFF = 2 * float(np.finfo(float).eps)
"""Of the terms that a height is the sum of: two heights that differ by less are one."""
HALF_TURN = 1e-4
"""So close to half a turn about a centre, of one, rays in space are near a conjugate point."""
ALONE = AGREED
"""Of an optical path: what it is claimed to where the passages that it is made of are all that tells it."""
ON_JUMP = 1e-12
"""Of a height or radius at which the index jumps: points so close to it are on neither side."""
UNITS = 16.0
"""Units of length are its powers: questions near one share what stands for their rays."""
FARTHEST_PATH = 1e13
"""Of the distance of two points: beside optical paths that are longer, those of short rays have no digits."""
TOGETHER = 1024
"""Questions asked together; bounds the memory."""
ACROSS = 1000
"""Heights at which it is asked whether there is an index all the way."""


@dataclass
class RangeFunction:
    """All rays between points in one medium of layers or about a centre, without surfaces; what is compiled is kept.

    ``up`` (d,) is the unit vector across layers, along which heights are measured.
    """

    medium: Stratified | Radial | Tabulated
    up: np.ndarray
    _profiles: dict[float, tuple[RayPotential, PassageTables]] = field(default_factory=dict, init=False, repr=False)

    def applies(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """True (q,) for points (q, d) that are not the centre, about which all turns, and at no jump of the index."""
        return self._off(a) & self._off(b)

    def _off(self, points: np.ndarray) -> np.ndarray:
        if isinstance(self.medium, Radial):
            radii = np.linalg.norm(points - self.medium.middle(points.shape[1]), axis=1)
            with np.errstate(divide="ignore"):
                return (radii > 0) & self._beside_jumps(np.log(radii))
        return self._beside_jumps(points @ self.up)

    def _beside_jumps(self, heights: np.ndarray) -> np.ndarray:
        """True (q,) for heights (q,) at no jump."""
        size = np.ones(len(self.jumps)) if isinstance(self.medium, Radial) else np.abs(self.jumps)
        return np.all(np.abs(heights[:, None] - self.jumps) > ON_JUMP * size, axis=1)

    @cached_property
    def jumps(self) -> np.ndarray:
        """Where the index jumps (k,), in heights or logarithms of radii."""
        found = None if isinstance(self.medium, Tabulated) else jumps_of(self.medium)
        return np.zeros(0) if found is None else found

    def rays(
        self, a: np.ndarray, b: np.ndarray, within: np.ndarray, carry: Carry, careful: Carry | None = None,
        tell: Tell | None = None,
    ) -> list[Rays]:  # fmt: skip
        """The rays from each point ``a`` (q, d) to ``b`` (q, d) up to an optical path ``within`` (q,).

        A ray that misses the point as ``carry`` takes it, since it went far out where digits are lost, is taken
        there the ``careful`` way, if there is one. Those of which enough is known are not carried where ``tell`` makes
        rays of them.
        """
        frames_ = Frames.of(self.medium, a, b, self.up)
        within = np.minimum(within, FARTHEST_PATH * np.linalg.norm(b - a, axis=1))
        found: list[Launches | None] = [None] * len(a)
        for unit in np.unique(frames_.unit):
            rows = np.flatnonzero(frames_.unit == unit)
            for first in range(0, len(rows), TOGETHER):
                some = rows[first : first + TOGETHER]
                for row, own in zip(some, self._launches(float(unit), frames_.take(some), within[some]), strict=True):
                    found[row] = own
        known = [own for own in found if own is not None]
        aimed, told = _aimed(frames_, known, isinstance(self.medium, Radial))
        rays = met(len(a), aimed, told, carry, careful, tell)
        return [_answer(*own) for own in zip(known, rays, within, strict=True)]

    def _launches(self, unit: float, frames_: Frames, within: np.ndarray) -> list[Launches]:
        """Questions about the same two heights, of about the same size, share what stands for their rays."""
        profile, tables = self._profile(unit, float(frames_.heights[0, 0]))
        sizes = np.column_stack([frames_.heights, rounded_up(frames_.distance), rounded_up(within)])
        pairs, pair = np.unique(sizes, axis=0, return_inverse=True)
        pair = pair.ravel()
        with np.errstate(invalid="ignore"):  # passages that do not exist, or are not known, are no numbers
            lowest, highest = pairs[:, :2].min(), pairs[:, :2].max()
            if np.all(profile.sound(np.linspace(lowest, highest, ACROSS))):
                return launches(profile, tables, pairs[:, :2], pair, frames_.distance, within)
            # where there is no index rays end, whoever is asked about
            first = np.zeros(1, dtype=int)
            alone = (
                launches(profile, tables, pairs[[k], :2], first, frames_.distance[[q]], within[[q]])
                for q, k in enumerate(pair)
            )  # fmt: skip
            return [own for one in alone for own in one]

    def _profile(self, unit: float, probe: float) -> tuple[RayPotential, PassageTables]:
        """g, with a unit of length near the radii of the points, for a centre; and its tables."""
        if unit not in self._profiles:
            medium = self.medium
            known = TableProfile(medium) if isinstance(medium, Tabulated) else Profile(medium, unit, probe)
            self._profiles[unit] = known, PassageTables()
        return self._profiles[unit]


def _aimed(frames_: Frames, launched: list[Launches], about_centre: bool) -> tuple[Aimed, Told]:
    """The launches as rays that leave the first point, and what is known of them."""
    question = np.repeat(np.arange(len(launched)), [len(own.found) for own in launched])
    rows = [tuple(vars(launch).values()) for own in launched for launch in own.found]
    columns = np.array(rows, dtype=float).reshape(-1, len(fields(Launch))).T
    c, speed, last, paths, way, touching, noise, distance, index, off, well, rate = columns
    headings = frames_.headings(question, c * way, speed)
    turn = frames_.distance[question] if about_centre else 0.0
    arriving = frames_.headings(question, c * way, last, turn)
    counts = index
    if about_centre and headings.shape[1] == 3:
        # half a turn on, neighbours in other planes through the centre meet
        halves = distance / np.pi
        apart = np.abs(halves - np.round(halves)) > HALF_TURN
        counts = np.where(apart & (index >= 0), index + np.floor(halves), -1)
    counts = counts.astype(int)
    off = np.where(counts >= 0, off, np.inf)
    least = c / np.hypot(c, speed)
    # neighbours in the plane of the ray come apart as distances change, and those beside it turn about an axis
    with np.errstate(all="ignore"):
        radius = frames_.radius(question) if about_centre else 1.0
        spreads = rate * np.abs(speed * last) / np.hypot(c, last) * radius
        if headings.shape[1] == 3:
            spreads *= (radius * np.abs(np.sin(distance)) if about_centre else distance) / least
    well = (well > 0) & np.isfinite(off)
    told = Told(question, headings, arriving, paths, off + ALONE * paths, counts, least, spreads, well)
    return Aimed(question, headings, paths, touching.astype(bool), noise, counts), told


def _answer(found: Launches, rays: list[Ray], within: float) -> Rays:
    """What is said of one question."""
    unresolved = found.unresolved + found.resting + found.endless + len(found.found) - len(rays)
    resting = f"; {found.resting} rays that all but come to rest along a layer" if found.resting else ""
    resting += "; not all of the rays of ever more and smaller turns, of which there is no end" if found.endless else ""
    searched = (
        f"all launching angles by the range function ({found.looked_at} looked at, {unresolved} narrow "
        f"intervals left unresolved{resting}), optical paths up to {within:.6g}"
    )
    if not rays:
        return no_rays(SHADOW, searched, unresolved)
    return Rays(tuple(rays), "", searched, found.continuum, unresolved)


@dataclass(frozen=True)
class Frames(Rows):
    """Pairs of points as ``heights`` (q, 2) in a profile, and the ``distance`` (q,) between them along the layers.

    ``up`` and ``ahead`` (q, d) are the directions of these at the first point, ``unit`` (q,) that of length.
    """

    up: np.ndarray
    ahead: np.ndarray
    heights: np.ndarray
    distance: np.ndarray
    unit: np.ndarray

    @classmethod
    def of(cls, medium: Medium, a: np.ndarray, b: np.ndarray, across_layers: np.ndarray) -> Frames:
        """The frames of points ``a`` and ``b`` (q, d); heights are those along a unit vector ``across_layers`` (d,)."""
        d = a.shape[1]
        if isinstance(medium, Radial):
            start, end = a - medium.middle(d), b - medium.middle(d)
            radii = np.stack([np.linalg.norm(start, axis=1), np.linalg.norm(end, axis=1)], axis=1)
            up = start / radii[:, :1]
            unit = UNITS ** np.round(np.log(radii[:, 0]) / np.log(UNITS))
            heights = np.log(radii / unit[:, None])
            along = np.sum(end * up, axis=1)
            across = end - along[:, None] * up
            length = np.linalg.norm(across, axis=1)
            distance = np.arctan2(length, along)
        else:
            up, unit = np.tile(across_layers, (len(a), 1)), np.ones(len(a))
            heights = np.stack([a @ across_layers, b @ across_layers], axis=1)
            room = HEIGHT_ROUND_OFF * (np.abs(a) + np.abs(b)) @ np.abs(across_layers)
            level = np.abs(heights[:, 1] - heights[:, 0]) <= room
            heights[level, 1] = heights[level, 0]
            across = (b - a) - ((b - a) @ across_layers)[:, None] * across_layers
            length = distance = np.linalg.norm(across, axis=1)
        upright = length <= UPRIGHT * np.linalg.norm(b - a, axis=1)  # what is left of it has no direction
        with np.errstate(all="ignore"):
            ahead = np.where(upright[:, None], frames(up)[:, 0], across / length[:, None])
        return cls(up, ahead, heights, distance, unit)

    def radius(self, pair: np.ndarray) -> np.ndarray:
        """How far from the centre the second points of pairs (k,) are."""
        return self.unit[pair] * np.exp(self.heights[pair, 1])

    def headings(
        self, pair: np.ndarray, along: np.ndarray, climb: np.ndarray, turn: np.ndarray | float = 0.0
    ) -> np.ndarray:
        """The unit vectors (k, d) of rays of pairs (k,) with momenta ``along`` the layers and ``climb`` (k,).

        They are those at the angle ``turn`` (k,) about a centre from the first point.
        """
        cos, sin = (np.broadcast_to(part, along.shape)[:, None] for part in (np.cos(turn), np.sin(turn)))
        up, ahead = self.up[pair], self.ahead[pair]
        heading = climb[:, None] * (cos * up + sin * ahead) + along[:, None] * (cos * ahead - sin * up)
        return heading / np.linalg.norm(heading, axis=1, keepdims=True)
