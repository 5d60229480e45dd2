"""How closely rays of the plane pass surfaces, which says whether one between two neighbours meets them.

Straight rays pass planes and conics as polynomials of second degree tell, and those of the linear ray equation as the
like of these. Other surfaces, and other rays, are followed step by step to where the level is least, and where that is
close to zero they are carried there anew, by their model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from varcalc.numerics.hermite import quintic
from varcalc.numerics.roots import bracketed_newton
from varcalc.optics.media.medium import Field
from varcalc.optics.models.linear import LinearRays
from varcalc.optics.models.model import Carrier
from varcalc.optics.models.straight import StraightRays
from varcalc.optics.rays.beam import Beam, Rows, moved_on, paced
from varcalc.optics.surfaces import Geometry

STEP_SHARE = 0.25
"""How far a ray goes in one step: of the distance of the farthest surface from its start; beyond that, farther."""
MOST_STEPS_PAST = 200
"""Steps of one ray."""
ALL_THE_WAY = 1e-6
"""Of an optical path: a ray so close to its end has come there."""
PARTS_OF_STEP, PARTS_OF_STEP_ELSE = 1, 4
"""Parts of a step in which the level of a conic may be least, and of other surfaces, which bend on their own."""
CLOSE = 0.02
"""Of the way from the start: rays that pass so closely are carried to where they do by their model."""
LEAST_WITHIN = 1e-6
"""Of a step: so well is it told where on it the level is least, which changes the level by the square of it."""
PASSES = 3
"""What is told of each surface: how close rays come at first, how far they go through, how close they come later."""
AT_FIRST, THROUGH, LATER = range(PASSES)


def passing(
    model: Carrier,
    field: Field,
    surfaces: Sequence[Geometry],
    beam: Beam,
    leaving: int,
    limit: np.ndarray,
    met: Encounter,
) -> np.ndarray:
    """By how much rays of the plane pass the surfaces (m, surfaces, PASSES, 2), and its derivative by launching angles.

    In units of the level, seen from the side of the rays, up to the optical path ``limit`` (m,): where it is least for
    the first time, and the least later on, before they go through, and the least on the other side, for rays that go
    on as if there were no surface. One number tells all of straight rays, where all levels are of second degree, and
    one or two of those of the linear ray equation. Not numbers where there is none. ``leaving`` is the surface all
    start from.

    Of rays that are followed only that is told which may let others through between two: of those that come to the
    surface which stands next in the scene, how they pass all on their way there, of others how they pass that one, and
    what they have ``met`` instead.
    """
    out = np.full((len(beam), len(surfaces), PASSES, 2), np.nan)
    if followed_past(model, surfaces):
        if len(beam):
            past = _Followed.begun(field, surfaces, beam, leaving, met)
            past.go(np.where(met.comes, met.path, limit))
            past.carry_close(model, beam)
            return past.told
    elif isinstance(model, LinearRays):
        for number in range(len(surfaces)):
            least, at_last = model.least(beam, number, leaving=number == leaving)
            out[:, number, AT_FIRST], out[:, number, LATER] = least, at_last
    elif isinstance(model, StraightRays):
        for number, geometry in enumerate(surfaces):
            if number != leaving:
                out[:, number, AT_FIRST] = _least_of_quadratic(beam, geometry)
    return out


def followed_past(model: Carrier, surfaces: Sequence[Geometry]) -> bool:
    """Whether rays are followed past surfaces, since no formula tells how closely they pass these."""
    if isinstance(model, StraightRays):
        return not all(geometry.quadric for geometry in surfaces)
    return not isinstance(model, LinearRays) and bool(surfaces)


@dataclass(frozen=True)
class Encounter:
    """What m rays come to first: the number of a surface (m,), negative for none, and the optical path (m,) there.

    The surface that stands next in the scene has the number ``following``.
    """

    number: np.ndarray
    path: np.ndarray
    following: int

    @property
    def comes(self) -> np.ndarray:
        """True (m,) for rays that come to the surface which stands next."""
        return self.number == self.following

    def asked(self, surfaces: int) -> np.ndarray:
        """For each ray and pass, how it passes which surfaces is to be told: true (m, surfaces, PASSES)."""
        every = np.arange(surfaces)
        before = self.comes[:, None] | (every == self.following)
        return np.stack([before, ~self.comes[:, None] & (every == self.number[:, None]), before], axis=2)


@dataclass
class _Followed:
    """m rays followed step by step past n ``surfaces``, from the ``side`` (m, n) of each on which they are.

    What is ``told`` (m, n, PASSES, 2) where it is ``asked`` (m, n, PASSES), is so ``after`` as much σ and at the
    optical path (m, n, PASSES, 2). Those ``inside`` (m, n) have gone through a surface and are not as far behind it as
    they come.
    """

    field: Field
    surfaces: Sequence[Geometry]
    steps: _Steps
    side: np.ndarray
    asked: np.ndarray
    told: np.ndarray
    after: np.ndarray
    inside: np.ndarray

    @classmethod
    def begun(cls, field: Field, surfaces: Sequence[Geometry], beam: Beam, leaving: int, met: Encounter) -> _Followed:
        """The rays of ``beam``, on the surface that they are ``leaving``."""
        m, n = len(beam), len(surfaces)
        told, side = np.full((m, n, PASSES, 2), np.nan), np.empty((m, n))
        for k, geometry in enumerate(surfaces):
            level, slope, _ = geometry.along(beam.position, beam.momentum)
            side[:, k] = np.where((slope if k == leaving else level) < 0, -1.0, 1.0)
        nowhere = np.zeros((m, n), dtype=bool)
        return cls(field, surfaces, _Steps.begun(field, beam), side, met.asked(n), told, np.zeros_like(told), nowhere)

    def go(self, limit: np.ndarray) -> None:
        """Follow the rays until they have gone through a surface, or to the optical path ``limit`` (m,)."""
        rows, steps, start = np.arange(len(limit)), self.steps, self.steps.place[:, :2]
        with np.errstate(all="ignore"):
            scene = np.fmax.reduce([geometry.distance(start) for geometry in self.surfaces])
            for _ in range(MOST_STEPS_PAST):
                away, scale = np.linalg.norm(steps.place[:, :2] - start[rows], axis=1), scene[rows]
                left = (limit[rows] - steps.path) / np.linalg.norm(steps.speed[:, :2], axis=1)
                length = np.fmin(STEP_SHARE * scale + np.fmax(away - scale, 0.0), left)
                now = _NystromStep.of(self.field, steps, length)
                going = ~self._looked(now, rows) & (now.end.path < (1 - ALL_THE_WAY) * limit[rows]) & (now.size > 0)
                steps = now.end
                going &= np.all(np.isfinite(steps.place), axis=1)
                if not np.all(going):
                    self._ended(rows[~going], steps.take(np.flatnonzero(~going)))
                    rows, steps = rows[going], steps.take(np.flatnonzero(going))
                if len(rows) == 0:
                    break

    def _looked(self, now: _NystromStep, rows: np.ndarray) -> np.ndarray:
        """Take in where levels are least on a step; True (k,) for rays that have gone through a surface."""
        through = np.zeros(len(rows), dtype=bool)
        for number, geometry in enumerate(self.surfaces):
            some = np.flatnonzero(self.asked[rows, number].any(axis=1))
            if len(some) == 0:
                continue
            shares, places, momenta = now.looks(PARTS_OF_STEP if geometry.quadric else PARTS_OF_STEP_ELSE)
            own, step = rows[some], (places[some].reshape(-1, 2), momenta[some].reshape(-1, 2))
            side = self.side[own, [number]][:, None]
            level, slope, _ = (side * values.reshape(-1, len(shares)) for values in geometry.along(*step))
            turns = (slope[:, :-1] < 0) & (slope[:, 1:] >= 0)
            for j in np.flatnonzero(turns.any(axis=0)):
                least = some[turns[:, j] & ~through[some]]
                part = shares[j], shares[j + 1]
                through[least] |= self._take_in(number, geometry, now.take(least), rows[least], part)
            within = self.inside[own, number] | (level[:, 1:] < 0).any(axis=1)
            self.inside[own, number] = within & ~through[some]
        return through

    def _take_in(
        self, number: int, geometry: Geometry, now: _NystromStep, rows: np.ndarray, shares: tuple[float, float]
    ) -> np.ndarray:
        """Tell of the least levels between two ``shares`` of a step; True (k,) where they are behind the surface."""
        side = self.side[rows, number]

        def falling(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            """The slope of the level at shares u of the step, falling, and its derivative."""
            position, momentum, pull = now.at(u)[:3]
            _, slope, bend = geometry.along(position, momentum)
            bend = bend + np.sum(geometry.gradient(position) * pull, axis=1)
            return -side * slope, -side * bend * now.size

        low, high = (np.full(len(rows), share) for share in shares)
        u = bracketed_newton(falling, low, high, (low + high) / 2, absolute=LEAST_WITHIN)[0]
        position, _, _, moved = now.at(u)
        level = side * geometry.level(position)
        rate = side * np.sum(geometry.gradient(position) * moved, axis=1)
        behind = level <= 0
        slot = np.where(behind, THROUGH, np.where(np.isnan(self.told[rows, number, AT_FIRST, 0]), AT_FIRST, LATER))
        some = self.asked[rows, number, slot] & ~(self.told[rows, number, slot, 0] <= level)
        own, slot = rows[some], slot[some]
        self.told[own, number, slot] = np.stack([level, rate], axis=1)[some]
        self.after[own, number, slot] = now.gone(u)[some]
        return behind

    def _ended(self, rows: np.ndarray, steps: _Steps) -> None:
        """Of rays that end on the other side of a surface, this is how far they come there."""
        for k, geometry in enumerate(self.surfaces):
            some = np.flatnonzero(
                self.inside[rows, k] & self.asked[rows, k, THROUGH] & np.isnan(self.told[rows, k, THROUGH, 0])
            )
            if len(some) == 0:
                continue
            place, own = steps.place[some], rows[some]
            level = geometry.level(place[:, :2])
            rate = np.sum(geometry.gradient(place[:, :2]) * place[:, 2:], axis=1)
            self.told[own, k, THROUGH] = self.side[own, [k]][:, None] * np.stack([level, rate], axis=1)

    def carry_close(self, model: Carrier, beam: Beam) -> None:
        """Tell anew, by the model, of rays that pass a surface closely: the steps are right to a few digits only."""
        for k, geometry in enumerate(self.surfaces):
            for slot in range(PASSES):
                with np.errstate(all="ignore"):
                    scale = np.abs(self.told[:, k, slot, 0]) <= CLOSE * (self.after[:, k, slot, 1] - beam.optical_path)
                rows = np.flatnonzero(scale & (self.after[:, k, slot, 0] > 0))
                if len(rows) == 0:
                    continue
                (sigma, path), side = self.after[rows, k, slot].T, self.side[rows, k]
                there = model.onward(beam.take(rows), sigma, path)[0]
                with np.errstate(all="ignore"):
                    level, slope, bend = geometry.along(there.position, there.momentum)
                    gradient = geometry.gradient(there.position)
                    bend = bend + np.sum(gradient * self.field(there.position)[1], axis=1) / 2
                    least = level - slope**2 / (2 * bend)
                    rate = np.sum(gradient * (there.moved[:, 0] - (slope / bend)[:, None] * there.turned[:, 0]), axis=1)
                known = np.isfinite(least) & np.isfinite(rate) & (side * bend > 0)
                self.told[rows[known], k, slot] = (side[:, None] * np.stack([least, rate], axis=1))[known]


@dataclass(frozen=True)
class _Steps(Rows):
    """m rays between steps: ``place`` and ``speed`` (m, 4) by σ of each and its neighbour, ``pull`` (m, 4) that of it.

    So large is the Hessian matrix of n² that it ``bends`` (m,). σ (m,) counts from the start.
    """

    place: np.ndarray
    speed: np.ndarray
    pull: np.ndarray
    bends: np.ndarray
    sigma: np.ndarray
    path: np.ndarray

    @classmethod
    def begun(cls, field: Field, beam: Beam) -> _Steps:
        """The rays of a ``beam``, and their neighbours, where σ is 0."""
        place = np.concatenate([beam.position, beam.moved[:, 0]], axis=1)
        speed = np.concatenate([beam.momentum, beam.turned[:, 0]], axis=1)
        with np.errstate(all="ignore"):
            return cls(place, speed, *_pulled(field, place), np.zeros(len(beam)), beam.optical_path)


@dataclass(frozen=True)
class _NystromStep(Rows):
    """One step of m rays, as much of σ as its ``size`` (m,); between the ends they are polynomials of fifth degree."""

    start: _Steps
    end: _Steps
    size: np.ndarray

    @classmethod
    def of(cls, field: Field, start: _Steps, length: np.ndarray) -> _NystromStep:
        """A step of Nyström's of fourth order (Hairer, Nørsett and Wanner, sect. II.14), no longer than ``length``."""
        h = paced(start.speed[:, :2], start.pull[:, :2], start.bends, length)
        y, v, k1, step = start.place, start.speed, start.pull, h[:, None]
        k2, _ = _pulled(field, y + step / 2 * v + step**2 / 8 * k1)
        k3, _ = _pulled(field, y + step * v + step**2 / 2 * k2)
        place, speed = y + step * (v + step / 6 * (k1 + 2 * k2)), v + step / 6 * (k1 + 4 * k2 + k3)
        grown = h * (np.sum(v[:, :2] ** 2, axis=1) + np.sum(speed[:, :2] ** 2, axis=1)) / 2
        end = _Steps(place, speed, *_pulled(field, place), start.sigma + h, start.path + grown)
        return cls(start, end, h)

    def looks(self, parts: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Shares (parts + 1,) of the step that cut it into so many ``parts``; places and momenta (m, parts + 1, 2)."""
        shares, first, last = np.linspace(0.0, 1.0, parts + 1), self.start, self.end
        if parts == 1:
            places = np.stack([first.place[:, :2], last.place[:, :2]], axis=1)
            return shares, places, np.stack([first.speed[:, :2], last.speed[:, :2]], axis=1)
        places, momenta, *_ = self.at(np.broadcast_to(shares, (len(self), parts + 1)))
        return shares, places, momenta

    @cached_property
    def _terms(self) -> list[np.ndarray]:
        """The coefficients (m, 4) of ascending powers of the share of the step."""
        h = self.size[:, None]
        return quintic(*((end.place, h * end.speed, h**2 * end.pull) for end in (self.start, self.end)))

    def at(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Positions, momenta and pulls (m, ..., 2) after shares ``u`` (m, ...) of a step; how far neighbours are."""
        aside = tuple(range(1, u.ndim))
        h, (c0, c1, c2, c3, c4, c5) = self.size, (np.expand_dims(term, aside) for term in self._terms)
        h, u = np.expand_dims(h, (*aside, u.ndim)), u[..., None]
        place = c0 + u * (c1 + u * (c2 + u * (c3 + u * (c4 + u * c5))))
        own = slice(0, 2)
        c1, c2, c3, c4, c5 = (c[..., own] for c in (c1, c2, c3, c4, c5))
        going = c1 + u * (2 * c2 + u * (3 * c3 + u * (4 * c4 + u * 5 * c5)))
        pull = 2 * c2 + u * (6 * c3 + u * (12 * c4 + u * 20 * c5))
        return place[..., own], going / h, pull / h**2, place[..., 2:]

    def gone(self, u: np.ndarray) -> np.ndarray:
        """σ since the start and the optical path (m, 2) after the share ``u`` (m,) of the step."""
        sigma, path = (
            low + u * (high - low)
            for low, high in ((self.start.sigma, self.end.sigma), (self.start.path, self.end.path))
        )
        return np.stack([sigma, path], axis=1)


def _pulled(field: Field, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What pulls rays (m, 2) and their neighbours beside them (m, 2) at places (m, 4), and how much it bends (m,)."""
    _, gradient, hessian = field(place[:, :2])
    aside = (hessian @ place[:, 2:, None])[:, :, 0]
    return np.concatenate([gradient, aside], axis=1) / 2, np.sqrt(np.sum(hessian**2, axis=(1, 2)))


def _least_of_quadratic(beam: Beam, geometry: Geometry) -> np.ndarray:
    """The level (m, 2) where it is least ahead of straight rays, seen from their side, and its derivative.

    Where it has no least value because it is linear its slope tells whether it is met, and where it falls for ever it
    is.
    """
    level, slope, bend = geometry.along(beam.position, beam.momentum)
    side = np.where(level < 0, -1.0, 1.0)
    linear = bend == 0
    with np.errstate(all="ignore"):
        ahead = np.where(linear | (side * bend < 0), 0.0, np.maximum(-slope / bend, 0.0))
    closest = moved_on(beam, ahead, 1.0)
    shift = np.where(linear[:, None], beam.turned[:, 0], closest.moved[:, 0])
    least = np.where(linear, slope, geometry.level(closest.position))
    out = side[:, None] * np.stack([least, np.sum(geometry.gradient(closest.position) * shift, axis=1)], axis=1)
    return np.where((~linear & (side * bend < 0))[:, None], [-1.0, 0.0], out)
