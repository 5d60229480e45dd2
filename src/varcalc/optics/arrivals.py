"""All zeros of the miss: which launching angles lead a ray of the plane to a point.

The miss of neighbouring rays is followed from angle to angle as branches,
told apart by their optical paths and the rates of these. Angles are added
until the cubic through misses and rates at the ends of an interval foretells
what is found in its middle. A branch then changes its sign, which brackets a
zero, or comes close to zero and turns round, a fold: there the turning point
is located first and says whether there are two zeros, one or none.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from varcalc.optics.passes import Passes

FIRST_ANGLES = 64
"""Angles looked at to begin with."""
NARROWEST = 2.0**-22
"""Of the circle: intervals no branch is followed into."""
FORETOLD = 0.05
"""Of the change over an interval: how well the middle must be foretold for a branch to be trusted."""
SAFETY = 4.0
"""How much faster than at the ends of an interval the miss is taken to change inside it."""
TOUCHING = 4e-13
"""A fold that comes this close to the point, relative to the scene, touches it."""
ROUNDS = 60
"""Steps of a bracketed search."""


@dataclass(frozen=True)
class Branch:
    """One pass of one ray: the launching ``angle`` and what :class:`Passes` knows of it."""

    angle: float
    path: float
    miss: float
    miss_rate: float
    path_rate: float


@dataclass(frozen=True)
class Arrivals:
    """The angles found, each with its optical path; ``touching`` says which of them lie on a fold.

    ``continuum`` is True where every ray looked at meets the point; ``looked_at`` counts them,
    ``unresolved`` the intervals that were given up: branches come and go in them, at the limits of the search.
    """

    angles: list[float]
    paths: list[float]
    touching: list[bool]
    continuum: bool
    looked_at: int
    unresolved: int


class Search:
    """One search; ``fan`` takes angles (m,) and a limit of the optical path to the passes of their rays.

    ``size`` is that of the scene.
    """

    def __init__(self, fan: Callable[[np.ndarray, float], Passes], size: float) -> None:
        self.fan, self.size = fan, size
        self.looked_at = 0
        self.unresolved = 0

    def run(self) -> Arrivals:
        """All arrivals, in no order."""
        angles = np.linspace(0.0, 2 * np.pi, FIRST_ANGLES, endpoint=False) + 1e-3  # off the axes of the scene
        known = self._look(angles)
        reached = [b for branches in known for b in branches if abs(b.miss) <= TOUCHING * self.size]
        if len(reached) > FIRST_ANGLES // 4:
            best = min(reached, key=lambda b: b.path)
            return Arrivals([best.angle], [best.path], [True], True, self.looked_at, 0)
        ends = [*zip(angles, known, strict=True), (angles[0] + 2 * np.pi, _turned(known[0]))]
        intervals = list(pairwise(ends))
        found: list[tuple[Branch, bool]] = []
        while intervals:
            middles = self._look(np.array([(left[0] + right[0]) / 2 for left, right in intervals]))
            again = []
            for (left, right), branches in zip(intervals, middles, strict=True):
                middle = ((left[0] + right[0]) / 2, branches)
                if self._settled(left, middle, right):
                    found += self._zeros(left[1], branches) + self._zeros(branches, right[1])
                elif right[0] - left[0] > 2 * np.pi * NARROWEST:
                    again += [(left, middle), (middle, right)]
                else:
                    self.unresolved += 1
            intervals = again
        return self._told(found)

    def _look(self, angles: np.ndarray, limit: float = np.inf) -> list[list[Branch]]:
        """The branches at each of the angles, by their optical paths, up to ``limit``."""
        self.looked_at += len(angles)
        seen = self.fan(angles, limit)
        out: list[list[Branch]] = [[] for _ in angles]
        columns = (seen.beam.optical_path, seen.miss, seen.miss_rate, seen.path_rate)
        for row, *values in zip(seen.rows, *columns, strict=True):
            out[row].append(Branch(float(angles[row]), *(float(v) for v in values)))
        return [sorted(branches, key=lambda b: b.path) for branches in out]

    def _settled(
        self, left: tuple[float, list[Branch]], middle: tuple[float, list[Branch]], right: tuple[float, list[Branch]]
    ) -> bool:
        """Whether every branch that may have a zero between the ends is followed from end to end as foretold."""
        width = right[0] - left[0]
        for at, others in ((left, (middle, right)), (middle, (left, right)), (right, (middle, left))):
            for branch in at[1]:
                if not self._may_vanish(branch, width):
                    continue
                if any(_partner(branch, other[1]) is None for other in others):
                    return False
        return all(
            _foretold(branch, _partner(branch, middle[1]), _partner(branch, right[1]))
            for branch in left[1]
            if self._may_vanish(branch, width)
        )

    def _may_vanish(self, branch: Branch, width: float) -> bool:
        return abs(branch.miss) <= SAFETY * width * max(abs(branch.miss_rate), 1e-3 * self.size)

    def _zeros(self, left: list[Branch], right: list[Branch]) -> list[tuple[Branch, bool]]:
        """The zeros of all branches between two neighbouring angles; True marks those on a fold."""
        found = []
        for a in left:
            b = _partner(a, right)
            if b is None:
                continue
            if a.miss * b.miss <= 0:
                found += self._crossing(a, b)
            elif a.miss_rate * b.miss_rate < 0 and a.miss * a.miss_rate < 0:
                found += self._fold(a, b)
        return found

    def _crossing(self, a: Branch, b: Branch) -> list[tuple[Branch, bool]]:
        """The zero between branches of opposite signs: Newton's steps, kept inside the bracket."""
        best = new = min(a, b, key=lambda branch: abs(branch.miss))
        shrunk = True
        for _ in range(ROUNDS):
            step = new.angle - new.miss / new.miss_rate if new.miss_rate else np.nan
            inside = min(a.angle, b.angle) < step < max(a.angle, b.angle)
            new = self._follow(step if inside and shrunk else (a.angle + b.angle) / 2, a, b)
            if new is None:
                return []
            a, b = (new, b) if new.miss * a.miss > 0 else (a, new)
            shrunk = abs(new.miss) < abs(best.miss) / 2
            if not shrunk and abs(best.miss) <= TOUCHING * self.size:
                break
            best = min(best, new, key=lambda branch: abs(branch.miss))
        return [(best, False)]

    def _fold(self, a: Branch, b: Branch) -> list[tuple[Branch, bool]]:
        """The zeros on both sides of the angle at which the miss is stationary."""
        low, high = a, b
        for _ in range(ROUNDS):
            share = low.miss_rate / (low.miss_rate - high.miss_rate)
            share = min(max(share, 0.02), 0.98)
            new = self._follow(low.angle + share * (high.angle - low.angle), low, high)
            if new is None:
                return []
            if new.miss * a.miss < 0 and abs(new.miss) > TOUCHING * self.size:
                return self._crossing(a, new) + self._crossing(new, b)
            low, high = (new, high) if new.miss_rate * low.miss_rate > 0 else (low, new)
            flat = min(low, high, key=lambda branch: abs(branch.miss))
            gain = abs(flat.miss_rate) * abs(high.angle - low.angle)
            if gain <= TOUCHING * self.size / 4 or abs(flat.miss) > SAFETY * gain + TOUCHING * self.size:
                break
        flat = min(low, high, key=lambda branch: abs(branch.miss))
        return [(flat, True)] if abs(flat.miss) <= TOUCHING * self.size else []

    def _follow(self, angle: float, a: Branch, b: Branch) -> Branch | None:
        """The branch between ``a`` and ``b`` at ``angle``."""
        [branches] = self._look(np.array([angle]), 1.5 * max(a.path, b.path))
        near = [c for c in branches if _continues(a, c) or _continues(c, b)]
        return min(near, key=lambda c: abs(c.path - _foreseen(a, c)), default=None)

    def _told(self, found: list[tuple[Branch, bool]]) -> Arrivals:
        """What was found, none twice."""
        kept: list[tuple[Branch, bool]] = []
        for branch, touching in sorted(found, key=lambda f: f[0].path):
            if abs(branch.miss) > 1e3 * TOUCHING * self.size:
                continue
            if not any(_same(branch, other) for other, _ in kept):
                kept.append((branch, touching))
        return Arrivals(
            [b.angle for b, _ in kept], [b.path for b, _ in kept], [t for _, t in kept], False, self.looked_at,
            self.unresolved,
        )  # fmt: skip


def _same(a: Branch, b: Branch) -> bool:
    turn = abs(np.remainder(a.angle - b.angle + np.pi, 2 * np.pi) - np.pi)
    return turn <= 1e-9 and abs(a.path - b.path) <= 1e-9 * max(a.path, b.path)


def _turned(branches: list[Branch]) -> list[Branch]:
    """The same branches one turn further."""
    return [Branch(b.angle + 2 * np.pi, b.path, b.miss, b.miss_rate, b.path_rate) for b in branches]


def _foreseen(a: Branch, b: Branch) -> float:
    """The optical path at the angle of ``b`` that the rates at both make likely, starting from ``a``."""
    return a.path + (b.angle - a.angle) * (a.path_rate + b.path_rate) / 2


def _continues(a: Branch, b: Branch) -> bool:
    """Whether two passes may be of one branch: the rates explain the difference of the paths."""
    width = abs(b.angle - a.angle)
    change = width * (abs(a.path_rate) + abs(b.path_rate)) / 2
    curved = width * abs(b.path_rate - a.path_rate) / 4
    slack = FORETOLD * change + curved + 1e-9 * max(a.path, b.path)
    return abs(b.path - _foreseen(a, b)) <= slack


def _partner(branch: Branch, others: list[Branch]) -> Branch | None:
    """The continuation of ``branch`` among ``others``, where there is exactly one."""
    fitting = [other for other in others if _continues(branch, other)]
    return fitting[0] if len(fitting) == 1 else None


def _foretold(a: Branch, middle: Branch | None, b: Branch | None) -> bool:
    """Whether the cubic through the ends foretells miss and rate in the middle."""
    if middle is None or b is None:
        return False
    width = b.angle - a.angle
    miss = (a.miss + b.miss) / 2 + width * (a.miss_rate - b.miss_rate) / 8
    rate = 1.5 * (b.miss - a.miss) / width - (a.miss_rate + b.miss_rate) / 4
    usual = max(abs(a.miss_rate), abs(b.miss_rate), abs(middle.miss_rate))
    return bool(
        abs(miss - middle.miss) <= FORETOLD * width * usual and abs(rate - middle.miss_rate) <= 4 * FORETOLD * usual
    )
