"""Integrals along motions in one coordinate, tabled over the place and over C, for many motions in one potential.

(du/dτ)² = g(u) - C. Between two critical values of g the motions that turn back on the same slopes are smooth in C and
in the parameters of :mod:`varcalc.numerics.one_coordinate.motions`, and in the logarithm of where C lies between those
values even where a motion all but comes to rest. Panels of that are halved until motions between those interpolated are
met to round-off; where none are, the table says so.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from varcalc.numerics.one_coordinate.integral_leaves import (
    COLUMNS,
    LEAF_DEGREE,
    Leaf,
    in_groups,
    leaves,
    polynomials,
    rates,
    read,
    read_ends,
)
from varcalc.numerics.one_coordinate.motions import OneTurn, TwoTurns
from varcalc.numerics.one_coordinate.slopes import SameSlopes

LOWEST, WIDTH, PANELS = -64.0, 2.0, 52
"""Of the logarithm: where panels begin, how wide they are at first, and how many there are."""
WORTH_IT = 128
"""Motions that have been asked about: a panel takes as long to make as to integrate along so many."""
TABLE_HALVINGS = 2
"""Of these."""
LEAF_TOLERANCE = 1e-13
"""Of the whole integral: how far off a motion between those interpolated may be."""
NEAR = 0.2
"""Of the parameter: so close to a turning point the place on a motion is told from its speed."""


@dataclass
class SlopesTable:
    """The table of motions that turn back on the same slopes, made where it is often asked for.

    There is no leaf where none can stand for the motions, and not yet where few were asked about.
    """

    slopes: SameSlopes
    leaves: list[Leaf] = field(default_factory=list, init=False)
    _asked: np.ndarray = field(default_factory=lambda: np.zeros(PANELS, dtype=int), init=False, repr=False)
    _made: dict[int, list[tuple[float, int]]] = field(default_factory=dict, init=False, repr=False)

    def leaf(self, logarithm: np.ndarray, at_once: bool = False) -> np.ndarray:
        """The numbers (m,) of the leaves at logarithms (m,), -1 where there is none; for few made if ``at_once``."""
        panel = np.floor((logarithm - LOWEST) / WIDTH)
        numbers, counts = np.unique(panel[(panel >= 0) & (panel < PANELS)].astype(int), return_counts=True)
        np.add.at(self._asked, numbers, counts)
        often = numbers if at_once else numbers[self._asked[numbers] >= WORTH_IT]
        new = np.array([number for number in often if number not in self._made])
        if len(new):
            self._make(new)
        out = np.full(len(logarithm), -1)
        for number in (number for number in numbers if number in self._made):
            rows = np.flatnonzero(panel == number)
            lows, names = (np.array(column) for column in zip(*self._made[number], strict=True))
            out[rows] = names[np.searchsorted(lows, logarithm[rows], side="right") - 1]
        return out

    def _make(self, numbers: np.ndarray) -> None:
        """Make what there is to be known of some panels, halved until leaves stand for the motions."""
        low = LOWEST + WIDTH * numbers
        high, owner = low + WIDTH, numbers
        made: dict[int, list[tuple[float, int]]] = {int(number): [] for number in numbers}
        for halving in range(TABLE_HALVINGS + 1):
            again, rounded = [], self.slopes.rounded(low)
            for k, leaf in enumerate(leaves(self.slopes, low, high)):
                if leaf is not None and leaf[1] <= max(LEAF_TOLERANCE, rounded[k]):
                    made[int(owner[k])].append((float(low[k]), len(self.leaves)))
                    self.leaves.append(leaf[0])
                elif leaf is None or halving == TABLE_HALVINGS:
                    made[int(owner[k])].append((float(low[k]), -1))
                else:
                    again.append(k)
            middle = (low[again] + high[again]) / 2
            low, high, owner = np.append(low[again], middle), np.append(middle, high[again]), np.tile(owner[again], 2)
            if len(low) == 0:
                break
        self._made.update({number: sorted(own) for number, own in made.items()})

    def at(
        self, leaf: np.ndarray, logarithm: np.ndarray, x: np.ndarray, speed: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The integrals (k + 2, COLUMNS, m) of motions (m,) up to k places and both ends, and what they may be off.

        The leaves go by their numbers. The places are ``x`` (k, m) from the reference, where the speeds |du/dτ| are
        ``speed`` (k, m). All integrals are from one place on a motion; on those that turn once it goes away from there.
        """
        k = len(x)
        out, off = np.empty((2, k + 2, COLUMNS, len(leaf)))
        order, parts = in_groups(leaf)
        for number, part in parts:
            own, rows = self.leaves[number], order[part]
            local = (2 * logarithm[rows] - own.low - own.high) / (own.high - own.low)
            in_logarithm = polynomials(local, LEAF_DEGREE)
            out[k:, :, rows], off[k:, :, rows] = read_ends(own, in_logarithm)
            most = own.most @ in_logarithm
            q, stretch = self._parameters(own.ends.T @ in_logarithm, most, x[:, rows])
            share = np.clip(q / most, 0.0, 1.0)
            beside = self._beside_turns(q, stretch)
            for place in range(k):
                values, off[place][:, rows] = read(own, local, share[place])
                row = np.flatnonzero(beside[place])
                if len(row):
                    rate = rates(own, local[row], share[place, row]) / most[row]
                    ahead = self._nearer(q[place, row], stretch[row], rate[0], speed[place][rows][row])
                    values[:, row] += rate * ahead
                out[place][:, rows] = values
        return out, off

    def _parameters(self, ends: np.ndarray, most: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The parameters (k, m) at places ``x`` (k, m) of motions with ``ends`` (2, m), and the way between these."""
        low, high = ends
        if self.slopes.kind is TwoTurns:
            above, below = np.maximum(x - low, 0.0), np.maximum(high - x, 0.0)
            return 2 * np.arctan2(np.sqrt(above), np.sqrt(below)), high - low
        if self.slopes.kind is OneTurn:
            away = x - low if self.slopes.sign > 0 else high - x
            return np.sqrt(np.maximum(away, 0.0)), most
        return x - (self.slopes.box[0] - self.slopes.reference), most

    def _beside_turns(self, q: np.ndarray, stretch: np.ndarray) -> np.ndarray:
        """True where motions at parameters ``q`` (k, m) are next to turning points."""
        if self.slopes.kind is TwoTurns:
            return np.sin(q) < NEAR
        return q < NEAR * stretch if self.slopes.kind is OneTurn else np.zeros_like(q, dtype=bool)

    def _nearer(self, q: np.ndarray, stretch: np.ndarray, rate: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """How much farther than ``q`` motions are (n,), by their speeds and dτ/dq, the ``rate``."""
        with np.errstate(all="ignore"):
            if self.slopes.kind is TwoTurns:
                return (speed - np.sin(q) * stretch / (2 * rate)) * 2 * rate / (stretch * np.cos(q))
            return (speed - 2 * q / rate) * rate / 2
