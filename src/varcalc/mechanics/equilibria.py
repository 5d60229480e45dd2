"""Equilibria in a box, all of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import combinations

import casadi as ca
import numpy as np

from varcalc.mechanics.constraints import Held
from varcalc.mechanics.lagrange import Lagrange
from varcalc.mechanics.linearised import check_holonomic, standing_forces
from varcalc.numerics.stacked import applied
from varcalc.showing import Fact, Shown
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.intervals import Interval, enclosures
from varcalc.symbolic.tracing import Expression

AT_REST = 1e-8
"""Of the box, times the slopes: what is left of the conditions at an equilibrium."""
SOME_TIME = 0.7320508
"""No zero of what is periodic with a period that anybody would write down."""
OTHER_TIMES = np.geomspace(1e-3, 1e3, 13) * SOME_TIME
FINEST = 1e-5
"""Of the box: a part so small is not divided further."""
MOST_PARTS = 4000
TRIALS, LAST_TRIALS = 2, 64
"""Of Newton's iteration, each time that the parts are halved, and in the end."""
STEPS_TO_REST = 40
ALONE = 1e-7
"""Of the largest singular value of the slopes: a place at which one is less need not be alone."""
SLACK = 1e-12
"""For the round-off of what is enclosed."""
TOLD_PLACES = 12
"""Places that a print shows."""
ONE_PLACE = 1e-7
"""Of the box: two places so near are one."""


@dataclass(frozen=True, repr=False, eq=False)
class Equilibria(Shown):
    """The ``places`` (k, n) at which a system can rest, and how they were ``searched`` for.

    ``unresolved`` counts parts of the box in which there may be others: none where it is 0.
    """

    places: np.ndarray
    searched: str
    unresolved: int

    def _headline(self) -> str:
        return f"{len(self.places)} {'place' if len(self.places) == 1 else 'places'} of rest"

    def _facts(self) -> Iterator[Fact]:
        for k, place in enumerate(self.places[:TOLD_PLACES]):
            yield Fact("" if k else "at", ", ".join(f"{q:.12g}" for q in place))
        if len(self.places) > TOLD_PLACES:
            yield Fact("", f"and {len(self.places) - TOLD_PLACES} more")
        yield Fact("searched", self.searched)
        if self.unresolved:
            yield Fact("unresolved", f"{self.unresolved} parts of the box, in which there may be more")


def equilibria(
    lagrange: Lagrange, held: Held | None, low: np.ndarray, high: np.ndarray, numbers: np.ndarray
) -> Equilibria:
    """Where a system rests at all times, in the box from ``low`` to ``high`` (n,).

    The box is halved wherever enclosures of the conditions do not show that one of them has no zero in a part
    (Neumaier, "Interval Methods for Systems of Equations", ch. 5); Newton's iteration from the middles of parts finds
    the places. Raises ValueError for constraints that move, or that hold rates alone.
    """
    s, conditions = lagrange.symbols, _conditions(lagrange, held)
    lasting = _lasting(conditions, s.t)
    search = _ZeroSearch(
        ca.Function("both", [s.q, s.p], [lasting, ca.densify(ca.jacobian(lasting, s.q))]),
        ca.Function("at_rest", [s.t, s.q, s.p], [conditions]),
        PointEvaluator(ca.Function("conditions", [s.q, s.p], [lasting])),
        numbers, low, high,
    )  # fmt: skip
    return search.run()


Boxes = tuple[np.ndarray, np.ndarray]
"""Least and greatest corners (m, n)."""


@dataclass
class _ZeroSearch:
    """Zeros of the conditions ``both`` with their slopes, between ``low`` and ``high``."""

    both: ca.Function
    at_rest: ca.Function
    at_middles: PointEvaluator
    numbers: np.ndarray
    low: np.ndarray
    high: np.ndarray
    found: list[np.ndarray] = field(default_factory=list)
    """Inside the box or beside it."""

    def run(self) -> Equilibria:
        """Halve the box until every part holds nothing, or one known place alone, or is too small."""
        size, looked_at, boxes = self.high - self.low, 0, (self.low[None], self.high[None])
        while len(boxes[0]):
            looked_at += len(boxes[0])
            kept = self._may_vanish(*boxes)
            boxes = self._unsettled(boxes[0][kept], boxes[1][kept], TRIALS)
            if len(boxes[0]) > MOST_PARTS or np.all(boxes[1] - boxes[0] <= FINEST * size):
                break
            boxes = _halved(*boxes, size)
        boxes = self._unsettled(*boxes, LAST_TRIALS)
        places = [
            x for x in self.found if np.all((x >= self.low - ONE_PLACE * size) & (x <= self.high + ONE_PLACE * size))
        ]
        inside = np.array(places).reshape(-1, len(size))
        unresolved = len(boxes[0])
        searched = (
            f"the box was divided into parts, {looked_at} looked at, {unresolved} of which may hide another place"
        )
        return Equilibria(inside[np.lexsort(inside.T[::-1])], searched, unresolved)

    def _may_vanish(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """Whether all components may be zero in boxes (m, n): by their enclosures, and by those of their slopes."""
        values, slopes = self._enclosed(low, high)
        centre = self.at_middles(len(low), (low + high) / 2, self.numbers[None, :])
        middle, half = _stacked(slopes, low.shape)
        with np.errstate(all="ignore"):
            reach = ((np.abs(middle) + half) @ ((high - low) / 2)[:, :, None])[:, :, 0]
            least, greatest = (
                np.stack(np.broadcast_arrays(low[:, 0], *ends)[1:], 1) for ends in zip(*values, strict=True)
            )
            noise = SLACK * np.abs(centre).max(axis=0, initial=0.0)
            kept = ~np.any((least > 0) | (greatest < 0) | (np.abs(centre) > reach * (1 + SLACK) + noise), axis=1)
        sound = np.flatnonzero(kept & np.all(np.isfinite(middle + half), axis=(1, 2)))
        # what is no number is kept; of the others combinations are looked at that single coordinates decide
        back = np.linalg.pinv(middle[sound])
        at, near = np.abs(applied(back, centre[sound])), np.abs(back) @ half[sound]
        near += np.abs(back @ middle[sound])
        beyond = at > applied(near, (high - low)[sound] / 2) * (1 + SLACK) + applied(np.abs(back), noise[None])
        kept[sound[np.any(beyond, axis=1)]] = False
        return kept

    def _enclosed(self, low: np.ndarray, high: np.ndarray) -> list[list[Interval]]:
        fixed = [(np.array(x), np.array(x)) for x in self.numbers]
        return enclosures(self.both, [list(zip(low.T, high.T, strict=True)), fixed])

    def _unsettled(self, low: np.ndarray, high: np.ndarray, trials: int) -> Boxes:
        """The boxes that may hold a place that is not known, after Newton's iteration from some of their middles."""
        for place in self.found:
            settled = self._only(place, low, high)
            low, high = low[~settled], high[~settled]
        tried = 0
        while tried < min(trials, len(low)):
            place = self._rest((low[tried] + high[tried]) / 2)
            tried += 1
            if place is None or any(
                np.all(np.abs(x - place) <= ONE_PLACE * (self.high - self.low)) for x in self.found
            ):
                continue
            if not self._rests(place):
                continue
            sizes = np.linalg.svd(np.array(self.both(place, self.numbers)[1]), compute_uv=False)
            if sizes[-1] <= ALONE * sizes[0]:  # there may be a line of them
                continue
            self.found.append(place)
            settled = self._only(place, low, high)
            low, high, tried = low[~settled], high[~settled], 0
        return low, high

    def _only(self, place: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """Whether boxes (m, n) hold no zero but perhaps this place.

        No two zeros are in a box, made large enough to hold the place, over which the slopes differ so little from
        those at the place that the conditions are one to one (Neumaier, sect. 5.1).
        """
        wide_low, wide_high = np.minimum(low, place), np.maximum(high, place)
        slope = np.array(self.both(place, self.numbers)[1])
        middle, half = _stacked(self._enclosed(wide_low, wide_high)[1], low.shape)
        back = np.linalg.pinv(slope)
        with np.errstate(all="ignore"):
            spread = np.abs(back @ middle - np.eye(len(place))) + np.abs(back) @ half
            return spread.sum(axis=2).max(axis=1) < 1

    def _rest(self, place: np.ndarray) -> np.ndarray | None:
        """Newton's iteration; None where it does not settle."""
        step = np.full(len(place), np.inf)
        for _ in range(STEPS_TO_REST):
            pull, slope = (np.array(part) for part in self.both(place, self.numbers))
            if not (np.all(np.isfinite(pull)) and np.all(np.isfinite(slope))):
                return None
            rows = np.abs(slope).max(axis=1, keepdims=True)
            rows = np.where(rows > 0, rows, 1.0)
            step = np.linalg.lstsq(slope / rows, (-pull / rows).ravel(), rcond=None)[0]
            place = place + step
            if np.abs(step).max() <= 1e-15 * max(1.0, np.abs(place).max()):
                break
        settled = np.abs(step).max() <= 1e-10 * max(1.0, np.abs(place).max())
        return place if settled else None

    def _rests(self, place: np.ndarray) -> bool:
        """Whether the conditions hold at a place, at other times too."""
        pull, slope = (np.array(part) for part in self.both(place, self.numbers))
        close = AT_REST * np.abs(slope) @ (self.high - self.low)
        later = (np.abs(np.array(self.at_rest(t, place, self.numbers)).ravel()) for t in OTHER_TIMES)
        now = bool(np.all(np.abs(pull).ravel() <= close))
        return now and all(np.all(left <= close[: len(left)]) for left in later)


def _stacked(slopes: list[Interval], boxes: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Middles and half widths (m, count, n) of the enclosures of a matrix, which come by its columns."""
    ends = (np.stack(np.broadcast_arrays(np.zeros(boxes[0]), *side)[1:], axis=1) for side in zip(*slopes, strict=True))
    low, high = (side.reshape(*boxes, len(slopes) // boxes[1]).swapaxes(1, 2) for side in ends)
    with np.errstate(all="ignore"):
        return (low + high) / 2, (high - low) / 2


def _halved(low: np.ndarray, high: np.ndarray, size: np.ndarray) -> Boxes:
    """Both halves of boxes (m, n), across their widest side."""
    row, widest = np.arange(len(low)), np.argmax((high - low) / size, axis=1)
    middle = ((low + high) / 2)[row, widest]
    upper, lower = high.copy(), low.copy()
    upper[row, widest], lower[row, widest] = middle, middle
    return np.concatenate([low, lower]), np.concatenate([upper, high])


def _conditions(lagrange: Lagrange, held: Held | None) -> Expression:
    """What vanishes at places of rest, at all times.

    Under k constraints the forces are combinations of their gradients: with those, all determinants of k + 1 of their
    components vanish.
    """
    forces = standing_forces(lagrange)
    if held is None:
        return forces
    check_holonomic(lagrange, held)
    both = ca.horzcat(held.rows.T, forces)
    minors = [ca.det(both[list(rows), :]) for rows in combinations(range(both.shape[0]), both.shape[1])]
    return ca.densify(ca.vertcat(held.level, *minors))


def _lasting(conditions: Expression, t: Expression) -> Expression:
    """The conditions at some time, with their derivatives by the time: what vanishes with these vanishes at all."""
    rows, rate = [conditions], conditions
    for _ in range(2):
        rate = ca.densify(ca.jacobian(rate, t))
        rows.append(ca.vertcat(*[part for part in ca.vertsplit(rate) if not part.is_zero()]))
    return ca.densify(ca.substitute(ca.vertcat(*rows), t, SOME_TIME))
