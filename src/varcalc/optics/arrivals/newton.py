"""Rays that nearly meet a point made to meet it, by Newton's iteration on the rays themselves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from varcalc.optics.arrivals.cells import CROSSED, MOVED, PATH, P, R
from varcalc.optics.arrivals.fan import Fan
from varcalc.optics.rays.beam import Rows, packed

MEETS = 4e-14
"""A ray that comes this close to the point, relative to the scene, meets it."""
STRAIGHT_STRETCH = 1e-9
"""Of the scene: over so short a stretch a ray is straight."""
ANGLE_ROUND_OFF = 4 * float(np.spacing(2 * np.pi))
"""Launching angles are known no better."""
KNOWN = 1e-8
"""Of the scene: where round-off of the angle makes more, as of rays that graze a surface, nobody says where they go."""
KNOWN_ALIKE, ALIKE = 1e-6, 0.1
"""The same where rays on either side spread alike, to that share: what meets the point is between two angles."""
TOUCHES_CAUSTIC = 4e-14
"""A caustic that comes this close to the point touches it: the ray where it does is polished by no more than that."""
NEWTON_STEPS = 16
"""Newton's steps."""
MISS_ROUND_OFF = 4 * float(np.finfo(float).eps)
"""A miss so small, relative to the scene, is not worth another step."""
LEAST_GAIN = 0.5
"""A step that does not shorten the miss to this share says that round-off has been reached."""
SECANT_START = 1e-2
"""Of the width of a cell: how far the second ray is from the first with which the secant method begins."""
LONGEST_STEP_BACK = 0.9
"""Of σ: the longest step back."""
APPROACH_STEPS = 2
"""Newton's steps along a ray, when the place closest to the target is foretold."""


@dataclass(frozen=True)
class Aims(Rows):
    """k rays that nearly meet their ``target`` (k, 2).

    Attributes
    ----------
    source, pair : ndarray of int, shape (k,)
        The numbers of the source and of the pair of points.
    angle, sigma, path : ndarray, shape (k,)
        The launching angle, σ behind the last surface, and the optical path.
    width : ndarray, shape (k,)
        How far the angle may be off.
    size : ndarray, shape (k,)
        That of the scene.
    """

    source: np.ndarray
    pair: np.ndarray
    target: np.ndarray
    angle: np.ndarray
    sigma: np.ndarray
    path: np.ndarray
    width: np.ndarray
    size: np.ndarray

    def at(self, angle: np.ndarray, sigma: np.ndarray, path: np.ndarray) -> Aims:
        """The same with other angles, σ and optical paths."""
        return Aims(self.source, self.pair, self.target, angle, sigma, path, self.width, self.size)


@dataclass(frozen=True)
class ClosestApproach(Rows):
    """Rays (k) with the states (k, 9) in which they come closest to their targets, and how far they are off across."""

    aims: Aims
    state: np.ndarray
    miss: np.ndarray

    @classmethod
    def none(cls) -> ClosestApproach:
        """No rays."""
        nothing, nobody = np.zeros(0), np.zeros(0, dtype=int)
        aims = Aims(nobody, nobody, np.zeros((0, 2)), nothing, nothing, nothing, nothing, nothing)
        return cls(aims, np.zeros((0, CROSSED + 1)), nothing)


@dataclass(frozen=True)
class _Look(Rows):
    """One look at aims: the states there, the misses across and along the rays, and the neighbours' distances."""

    aims: Aims
    state: np.ndarray
    miss: np.ndarray
    along: np.ndarray
    spread: np.ndarray

    @property
    def distance(self) -> np.ndarray:
        """How far the rays pass from the targets (k,); infinite where a ray does not come so far.

        How far along the ray the place looked at is from the target does not count while it is small: σ is known to
        the round-off of the whole way only, and the optical path is corrected for it.
        """
        with np.errstate(invalid="ignore"):
            away = np.hypot(self.miss, np.maximum(np.abs(self.along) - STRAIGHT_STRETCH * self.aims.size, 0.0))
        return np.where(np.isfinite(away), away, np.inf)

    @property
    def met(self) -> np.ndarray:
        """True (k,) where the target is met as closely as round-off of its place and of the angle allows."""
        known = np.fmin(ANGLE_ROUND_OFF * np.abs(self.spread), KNOWN * self.aims.size)
        return self.distance <= MEETS * self.aims.size + known

    def stepped(self, turn: np.ndarray) -> Aims:
        """The aims after a ``turn`` (k,) of the launching angle, at the places closest to the targets, about."""
        state, aims = self.state, self.aims
        momentum = np.linalg.norm(state[:, P], axis=1)
        late = turn * np.sum(state[:, P] * state[:, MOVED], axis=1)
        shift = np.maximum(-(self.along + late / momentum) / momentum, -LONGEST_STEP_BACK * aims.sigma)
        return aims.at(aims.angle + turn, aims.sigma + shift, state[:, PATH] + late + shift * momentum**2)

    def meeting(self) -> ClosestApproach:
        """The closest approaches of the k rays."""
        return ClosestApproach(self.aims, self.state, self.miss)


def _look(fan: Fan, aims: Aims) -> _Look:
    state = packed(fan.at(aims.source, aims.angle, aims.sigma, aims.path))
    ahead = state[:, P] / np.linalg.norm(state[:, P], axis=1)[:, None]
    offset = state[:, R] - aims.target
    return _Look(aims, state, _cross(ahead, offset), np.sum(ahead * offset, axis=1), _cross(ahead, state[:, MOVED]))


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def _nearest(fan: Fan, aims: Aims) -> _Look:
    """The rays of ``aims`` where they come closest to their targets, without a change of direction."""
    look = _look(fan, aims)
    for _ in range(APPROACH_STEPS):
        look = _look(fan, look.stepped(np.zeros(len(aims))))
    return look


def met(fan: Fan, aims: Aims) -> tuple[ClosestApproach, np.ndarray]:
    """Those of the ``aims`` that meet their targets, polished to round-off, and the pairs of those that do not."""
    done: list[_Look] = []
    look = best = _look(fan, aims)
    begun, share = aims.angle, np.ones(len(aims))
    for _ in range(NEWTON_STEPS):
        if len(begun) == 0:
            break
        with np.errstate(all="ignore"):
            turn = -share * look.miss / look.spread
        width = look.aims.width
        new = _look(fan, look.stepped(np.clip(np.where(np.isfinite(turn), turn, 0.0), -width, width)))
        there = np.isfinite(new.distance)  # a step too far may lead where no ray gets through
        best = _either(new.distance < best.distance, new, best)
        stuck = there & (new.distance > LEAST_GAIN * look.distance) & (new.met | best.met)
        strayed = np.abs(new.aims.angle - begun) > 2 * width
        finished = stuck | strayed | (best.distance <= MISS_ROUND_OFF * best.aims.size)
        done.append(best.take(np.flatnonzero(finished)))
        look = _either(there, new, look)
        left = np.flatnonzero(~finished)
        look, best, begun, share = look.take(left), best.take(left), begun[left], np.where(there, 1.0, share / 4)[left]
    looks = _Look.joined([*done, best])
    there = looks.met
    there[~there] = _between_angles(fan, looks.take(np.flatnonzero(~there)))
    return looks.take(np.flatnonzero(there)).meeting(), looks.aims.pair[~there]


def _between_angles(fan: Fan, looks: _Look) -> np.ndarray:
    """True (k,) where targets lie between rays as close as angles are told, which spread alike.

    Small mirrors one after the other spread rays so much that none of these angles meets a point as closely as
    elsewhere. Beside grazing incidence they spread otherwise from each angle to the next.
    """
    between = looks.distance <= KNOWN_ALIKE * looks.aims.size
    rows = np.flatnonzero(between)
    if len(rows):
        some = looks.take(rows)
        before, after = (_look(fan, some.stepped(np.full(len(rows), sign * ANGLE_ROUND_OFF))) for sign in (-1, 1))
        with np.errstate(all="ignore"):
            alike = [np.abs(side.spread / some.spread - 1) <= ALIKE for side in (before, after)]
            between[rows] = (before.miss * after.miss < 0) & alike[0] & alike[1]
    return between


def _either(first: np.ndarray, one: _Look, other: _Look) -> _Look:
    """The looks of ``one`` where ``first`` (k,) is true, otherwise those of the ``other``."""
    order = np.where(first, np.arange(len(first)), len(first) + np.arange(len(first)))
    return _Look.joined([one, other]).take(order)


def as_they_are(fan: Fan, aims: Aims, close: float) -> tuple[ClosestApproach, np.ndarray]:
    """Those of the ``aims`` that meet their targets without a change of direction, and their numbers.

    They come as ``close`` as that, relative to the scene, or as the angle allows.
    """
    look = _nearest(fan, aims)
    there = np.flatnonzero(look.distance <= close * aims.size + ANGLE_ROUND_OFF * np.abs(look.spread))
    return look.take(there).meeting(), there


def flattest(fan: Fan, aims: Aims) -> tuple[ClosestApproach, np.ndarray]:
    """The rays whose misses are stationary in the angle near the ``aims``, and the second derivatives (k,).

    The secant method on the first derivative, which the neighbours tell; half the digits of the angle are all that
    the miss asks for.
    """
    before = _nearest(fan, aims)
    now = _nearest(fan, aims.at(aims.angle + SECANT_START * aims.width, aims.sigma, aims.path))
    bend, done = np.zeros(len(aims)), np.zeros(len(aims), dtype=bool)
    for _ in range(NEWTON_STEPS // 2):
        with np.errstate(all="ignore"):
            slope = (now.spread - before.spread) / (now.aims.angle - before.aims.angle)
            turn = -now.spread / slope
        bend = np.where(np.isfinite(slope) & ~done, slope, bend)
        turn = np.clip(np.where(np.isfinite(turn) & ~done, turn, 0.0), -aims.width, aims.width)
        done |= turn**2 * np.abs(bend) <= MISS_ROUND_OFF / 100 * aims.size  # a step more would be led by round-off
        before, now = now, _look(fan, now.stepped(turn))
        if np.all(done):
            break
    return _look(fan, now.stepped(np.zeros(len(aims)))).meeting(), bend
