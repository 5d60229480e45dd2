"""Runs on their way through a system that switches: to the end of a side, and which one comes next."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np

from varcalc.integrators.one_side import ALONG, ORDERS, OneSided
from varcalc.integrators.protocol import NONE, OUTCOMES, Landing, RunOutcome

NO_TERM = 1e-10
"""Of the largest term of an argument's series: a term that is round-off."""
ON = 16 * float(np.finfo(float).eps)
"""Of what an argument is made of, or of the time: how near to its zero it is on it."""
NO_JUMP = 1e-9
"""Relative difference of what does not jump."""
AT_ONCE = 6
"""Switches that may turn over in one place."""
MOST_RUN_PIECES = 5_000
"""Of one run: some seconds of work. A motion through more of them is carried in parts, between which it is told of."""


@dataclass
class Walker:
    """A run on its way: its state with the abscissa, what is left to go, the side it is on, and how it ended."""

    state: np.ndarray
    left: float
    constants: np.ndarray
    direction: float
    leaving: tuple[int, ...]
    longest: float = math.inf
    side: tuple[int, ...] = ()
    counts: np.ndarray = field(default_factory=lambda: np.zeros(0))
    gone: float = 0.0
    steps: int = 0
    pieces: int = 0
    outcome: RunOutcome | None = None
    stopped_by: int = NONE

    @property
    def numbers(self) -> np.ndarray:
        """The constants with the counts of what is stepped."""
        return np.concatenate([self.constants, self.counts])

    def ended(self, outcome: RunOutcome, stopped_by: int = NONE) -> None:
        """Go no farther."""
        self.outcome, self.stopped_by = outcome, stopped_by


@dataclass(frozen=True)
class Crossings:
    """How runs of a ``system`` go on at its switches."""

    system: OneSided

    def _series(self, walker: Walker, side: tuple[int, ...], counts: np.ndarray) -> dict[str, np.ndarray]:
        """What :attr:`Piece.series` gives on a side, where a walker is."""
        numbers = np.concatenate([walker.constants, counts, [walker.direction]])
        row = self.system.piece(side).series(1, walker.state[None, :], numbers[None, :])[0]
        parts = {name: row[own] for name, own in self._columns.items()}
        parts["terms"] = parts["terms"].reshape(ORDERS + 1, -1)
        return parts

    @cached_property
    def _columns(self) -> dict[str, slice]:
        """Where the parts of :attr:`Piece.series` stand."""
        m, k = len(self.system.sides.places), self.system.stops
        ends = np.cumsum([0, (ORDERS + 1) * m, m, k, k, self.system.sides.function.numel_out(2)]).tolist()
        names = ("terms", "size", "stops", "stop_rates", "kept", "rates")
        return {name: slice(*pair) for name, pair in zip(names, pairwise([*ends, None]), strict=True)}

    def _counted(self, arguments: np.ndarray, lower: dict[int, int]) -> np.ndarray:
        """The counts at the ``arguments``, or the whole numbers in ``lower``, by place."""
        below = [lower[k] if k in lower else math.floor(arguments[k]) for k in self.system.sides.stepped]
        return np.array([float(v) for b in below for v in (b, b + (b < 0))])

    def set_out(self, walker: Walker, met: Sequence[int] = ()) -> None:
        """Find the side on which a walker goes on, having ``met`` these places, or say in its outcome why it cannot."""
        s, y = walker.state[-1], walker.state[:-1]
        arguments = np.array(self.system.sides.arguments(s, y, walker.constants)).ravel()
        stepped = set(self.system.sides.stepped)
        side = tuple(0 if k in stepped else (-1 if a < 0 else 1) for k, a in enumerate(arguments))
        side, counts = self._settled(walker, side, self._counted(np.nan_to_num(arguments), {}))
        live = self.system.piece(side).live - self.system.piece(side).still
        if not np.all(np.isfinite(arguments[sorted(live)])):
            walker.ended(RunOutcome.NOT_FINITE if walker.pieces == 0 else RunOutcome.BLOW_UP)
            return
        arguments = np.nan_to_num(arguments)  # of branches that are not meant here
        here = self._series(walker, side, counts)
        beyond = arguments - np.where([k in stepped for k in range(len(side))], np.round(arguments), 0.0)
        time = ON * max(abs(s), walker.gone)
        with np.errstate(all="ignore"):
            near = np.abs(beyond) <= np.fmax(ON * here["size"], time * np.abs(here["terms"][1]))
        on = sorted({*met, *(live & set(np.flatnonzero(near).tolist()))})
        found = (side, counts) if not on else self._resolved(walker, side, arguments, on)
        if found is None:
            walker.ended(RunOutcome.UNDECIDED)
            return
        before = walker.side, walker.counts
        walker.side, walker.counts = found
        if met and self._jumps(walker, before, met):
            walker.ended(RunOutcome.IMPULSE)
        walker.leaving += tuple(self.system.leaving(walker.side, on, arguments, walker.counts))
        walker.pieces += 1

    def _settled(self, walker: Walker, side: tuple[int, ...], counts: np.ndarray) -> tuple[tuple[int, ...], np.ndarray]:
        """The side and counts with those of what depends on nothing but counts."""
        for _ in range(len(side) + 1):
            still = self.system.piece(side).still
            if not still:
                break
            values = self._series(walker, side, counts)["terms"][0]
            before, stepped = (side, counts.tolist()), self.system.sides.stepped
            side = tuple(
                int(np.sign(values[k])) if k in still and k not in stepped else one for k, one in enumerate(side)
            )
            lower = {k: math.floor(values[k]) if k in still else int(counts[2 * n]) for n, k in enumerate(stepped)}
            counts = self._counted(values, lower)
            if before == (side, counts.tolist()):
                break
        return side, counts

    def _jumps(self, walker: Walker, before: tuple[tuple[int, ...], np.ndarray], met: Sequence[int]) -> bool:
        """Whether what must not jump does, between the side ``before`` and the walker's."""
        if not any(self.system.with_coordinates[k] for k in met):
            return False
        old, new = (self._series(walker, *at)["kept"] for at in (before, (walker.side, walker.counts)))
        return bool(np.any(np.abs(new - old) > NO_JUMP * (np.abs(new) + np.abs(old))))

    def _resolved(
        self, walker: Walker, side: tuple[int, ...], arguments: np.ndarray, on: Sequence[int]
    ) -> tuple[tuple[int, ...], np.ndarray] | None:
        """The side whose own rates lead into it from where a walker is ``on`` some switches; None where none does."""
        if len(on) > AT_ONCE:
            return None
        ways: list[tuple[tuple[int, ...], np.ndarray, np.ndarray]] = []
        for choice in itertools.product((1, -1), repeat=len(on)):
            turned, lower = list(side), {}
            for k, one in zip(on, choice, strict=True):
                if self.system.sides.places[k].stepped:
                    lower[k] = round(float(arguments[k])) - (one < 0)
                else:
                    turned[k] = one
            there, counts = self._settled(walker, tuple(turned), self._counted(arguments, lower))
            found, live = self._series(walker, there, counts), self.system.piece(there).live
            if all(k not in live or _leads(found, walker, k, one) for k, one in zip(on, choice, strict=True)):
                ways.append((there, counts, found["rates"]))
        if ways and all(np.allclose(rates, ways[0][2], rtol=NO_JUMP, atol=0.0) for _, _, rates in ways):
            return ways[0][:2]
        [place] = on if len(on) == 1 else [-1]
        if ways or place < 0 or self.system.sides.places[place].stepped or walker.direction < 0:
            return None
        up, down = (
            self._series(walker, (*side[:place], one, *side[place + 1 :]), self._counted(arguments, {}))["terms"][
                1, place
            ]
            for one in (1, -1)
        )
        return ((*side[:place], ALONG, *side[place + 1 :]), self._counted(arguments, {})) if up < 0 < down else None

    def step(self, walkers: Sequence[Walker], level: int) -> None:
        """Carry walkers to the end of their piece, those on one side together."""
        groups: dict[tuple[tuple[int, ...], tuple[int, ...]], list[Walker]] = {}
        for one in walkers:
            groups.setdefault((one.side, one.leaving), []).append(one)
        for (side, leaving), group in groups.items():
            states = np.array([one.state for one in group])
            constants = np.array([[*one.numbers, one.direction] for one in group])
            landing = self.system.piece(side).stopping.ensemble(
                states, constants, until=np.array([one.left for one in group]), leaving=leaving, level=level,
                longest=np.array([one.longest for one in group]) if np.isfinite(group[0].longest) else None,
            )  # fmt: skip
            for k, one in enumerate(group):
                self._landed(one, landing, k)

    def _landed(self, walker: Walker, landing: Landing, row: int) -> None:
        gone, outcome = float(landing.reached[row]), OUTCOMES[int(landing.outcomes[row])]
        begun_at = walker.state[-1]
        walker.state = landing.states[row].copy()
        walker.state[-1] = begun_at + walker.direction * gone
        walker.steps += int(landing.steps[row])
        walker.gone, walker.left = walker.gone + gone, walker.left - gone
        if outcome is not RunOutcome.STOPPED:
            walker.ended(outcome if outcome is not RunOutcome.NOT_FINITE or walker.pieces == 1 else RunOutcome.BLOW_UP)
            return
        stop, old = int(landing.stopped_by[row]), walker.leaving
        walker.leaving = ()
        if stop < self.system.stops:
            walker.ended(RunOutcome.STOPPED, stop)
            return
        place = self.system.ends(walker.side)[stop - self.system.stops]
        reached = self._met_with(walker, old if gone == 0.0 else ())
        if reached != NONE:
            walker.ended(RunOutcome.STOPPED, reached)
        elif walker.pieces >= MOST_RUN_PIECES:
            walker.ended(RunOutcome.TOO_MANY_STEPS)
        else:
            self.set_out(walker, (place,))

    def _met_with(self, walker: Walker, left: tuple[int, ...]) -> int:
        """The first of the person's stops that is zero where a switch is."""
        if not self.system.stops:
            return NONE
        here = self._series(walker, walker.side, walker.counts)
        time = ON * max(abs(walker.state[-1]), walker.gone)
        near = np.abs(here["stops"]) <= time * np.abs(here["stop_rates"])
        return next((k for k in np.flatnonzero(near).tolist() if k not in left), NONE)

    def begun(
        self, states: np.ndarray, constants: np.ndarray, start: np.ndarray, ends: np.ndarray, leaving: tuple[int, ...]
    ) -> list[Walker]:
        """Runs where they begin, on their sides."""
        found = [
            Walker(np.append(state, s), abs(end - s), row, 1.0 if end >= s else -1.0, leaving)
            for state, s, end, row in zip(states, start, ends, constants, strict=True)
        ]
        for one in found:
            self.set_out(one)
            if one.outcome is None and one.left == 0.0:
                one.ended(RunOutcome.COMPLETED)
        return found


def _leads(found: dict[str, np.ndarray], walker: Walker, place: int, side: int) -> bool:
    """Whether the first derivative that there is of a place's argument leads to this side; true where there is none."""
    rates = float(np.abs(found["rates"]).max())
    size = float(np.abs(walker.state).max())
    unit = size / rates if size > 0 and rates > 0 else 1.0
    terms = [found["terms"][k, place] * unit**k / math.factorial(k) for k in range(1, ORDERS + 1)]
    largest = max(map(abs, terms))
    return next((term * side > 0 for term in terms if abs(term) > NO_TERM * largest), True)
