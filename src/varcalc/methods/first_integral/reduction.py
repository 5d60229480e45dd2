"""What both reductions share: from curves found between two ends to an answer with its errors."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from varcalc.methods.first_integral.answers import ROUND_OFF, EndValues, Evaluate, Reduced
from varcalc.methods.first_integral.contract import Aim, Joined
from varcalc.methods.first_integral.hidden import doubt
from varcalc.methods.first_integral.integrands import ReducedIntegrands
from varcalc.methods.first_integral.isoperimetric import LevelStart, starts
from varcalc.methods.first_integral.lines import CurveBatch
from varcalc.methods.first_integral.refinement import quadrature_errors, truncation, unseen
from varcalc.methods.first_integral.search import DIFFERENCE, TINY, refined

PROBED_SLOPES = np.array([1e-3, 0.3, -0.3, 1.0, -1.0, 4.0, -4.0])
"""Slopes, in units of the mean one, at which L_vv and the behaviour at the ends are looked at."""
START_CLOSE = 1e-8
"""Of what is to be covered, and of the levels: what a curve found from a start may miss before it is refined."""
ERROR_PLACES = 0.5 - 0.5 * np.cos(np.linspace(0, np.pi, 41)[1:-1])
"""Where the curve's error is looked at, as shares of the interval."""
BEND_STEP = 1e3
"""Steps for a second difference, in units of those for a first one."""
NUDGES = np.array([1.0, -1.0, 1e-4, -1e-4])
"""Steps of which the first counts with which there is a curve."""


@dataclass(frozen=True)
class Reduction(ABC):
    """One way to reduce a problem to quadrature."""

    integrands: ReducedIntegrands

    @abstractmethod
    def aim(self, ends: EndValues) -> Aim:
        """What a curve between the ends must cover."""

    @abstractmethod
    def curves(self, ends: EndValues) -> list[Joined]:
        """Every curve found between the ends, roughly measured; without isoperimetric levels."""

    @abstractmethod
    def from_start(self, ends: EndValues, start: LevelStart) -> Iterator[Joined]:
        """Curves with the isoperimetric levels that Newton's method finds from a start."""

    @abstractmethod
    def curve(self, batch: CurveBatch, found: Joined, ends: EndValues) -> Evaluate:
        """The curve as a function of x."""

    @property
    @abstractmethod
    def searched(self) -> str:
        """What kind of extremal is looked for, in words."""

    def probe(self, x: float, y: float) -> np.ndarray:
        """The parts of L and the constraints at a point for every probed slope."""
        slope = PROBED_SLOPES * self.integrands.scale
        return self.integrands.at(np.full_like(slope, x), np.full_like(slope, y), slope)

    def legendre(self, curvature: float) -> bool:
        """True when L_vv of this sign suits a minimum (a maximum where that is asked for)."""
        return curvature < 0 if self.integrands.problem.maximise else curvature > 0

    @property
    def sign(self) -> str:
        """Which sign of L_vv is looked for, in words."""
        return (
            "< 0 (Legendre's condition for a maximum)"
            if self.integrands.problem.maximise
            else ("> 0 (Legendre's condition for a minimum)")
        )

    def all_curves(self, ends: EndValues) -> list[Joined]:
        """Every curve found between the ends, with or without isoperimetric levels."""
        if not len(self.integrands.levels):
            return self.curves(ends)
        return [found for start in starts(self.integrands, ends, self.row) for found in self.from_start(ends, start)]

    @property
    @abstractmethod
    def row(self) -> int:
        """Which part of :meth:`ReducedIntegrands.at` is the first integral: 2 for L - y' L_y', 3 for the momentum."""

    def level(self, ends: EndValues) -> Reduced | None:  # noqa: ARG002
        """y = const, where a reduction does not find it by itself and it is an extremal."""
        return None

    def value(self, found: Joined, ends: EndValues) -> float:
        """The functional, as action + constant * target - sum of lambda_j level_j: stationary in both."""
        target = self.aim(ends).target
        covered = float(found.measured.x[0]) if target is None else target
        total = float(found.measured.action[0]) + float(found.batch.constant[0]) * covered
        return found.family.lines.orientation * total - float(found.multipliers @ self.integrands.levels)

    def answer(self, rough: Joined, ends: EndValues) -> Reduced | None:
        """The curve refined to double precision, with its value and errors; None when it is lost on the way."""
        aim = self.aim(ends)
        found = refined(rough, aim)
        if found is None:
            return None
        measured, batch = found.measured, found.batch
        panels = [leg.panels for leg in batch.legs]
        parts = (quadrature_errors(measured), truncation(panels, measured), unseen(found))
        reach_error, value_error = (sum(errors) for errors in zip(*parts, strict=True))
        multipliers, levels = found.multipliers, self.integrands.levels
        covered = float(measured.x[0]) if aim.target is None else aim.target
        terms = abs(float(measured.action[0])) + abs(float(batch.constant[0]) * covered)
        terms += float(np.abs(multipliers) @ np.abs(levels))
        miss = reach_error + ROUND_OFF * aim.size + abs(float(measured.x[0]) - covered)
        curve = self.curve(batch, found, ends)
        return Reduced(
            value=self.value(found, ends),
            value_error=value_error + ROUND_OFF * terms,
            curve=curve,
            curve_error=self._curve_error(found, ends, miss),
            nodes=curve.nodes,
            multipliers=multipliers,
            partials=np.asarray(sum(f[1 + len(levels) :, 0].sum(axis=1) for f in measured.fields)),
            points=sum(d.shape[1] for d in measured.dx),
            doubt=doubt(found),
        )

    def end_gradient(self, best: Reduced, ends: EndValues, at_end: bool) -> tuple[float, float]:
        """The derivatives of the value by the abscissa and the ordinate of one end.

        At the end they are L - y' L_y' and L_y' of the Lagrangian function, at the start the negatives
        (Gelfand and Fomin, sect. 13).
        """
        x = np.array([ends.x1 if at_end else ends.x0])
        parts = self.integrands.at(x, best.curve(x, 0)[0], best.curve(x, 1)[0])
        energy, momentum = np.tensordot(np.array([1.0, *best.multipliers]), parts[:, 2:4, 0], axes=1)
        sign = 1.0 if at_end else -1.0
        return sign * float(energy), sign * float(momentum) / self.integrands.scale

    @abstractmethod
    def reaching(self, ends: EndValues, covered: float) -> EndValues:
        """The ends of a curve that covers something else."""

    def _curve_error(self, found: Joined, ends: EndValues, miss: float) -> float:
        """How far the curve can be off when what it covers, and its levels, are off by ``miss``."""
        at = ends.x0 + ends.width * ERROR_PLACES
        y = self.curve(found.batch, found, ends)(at, 0)[0]
        least = ROUND_OFF * float(np.abs(y).max())
        aim = self.aim(ends)
        if aim.target is None:
            return miss + least

        def shape(other: Joined) -> np.ndarray:
            """How far another curve lies above this one at the places; beyond its end it is not counted."""
            covered = self.reaching(ends, float(other.measured.x[0]))
            moved = self.curve(other.batch, other, covered)(np.minimum(at, covered.x1), 0)[0]
            return np.where(at < covered.x1, moved - y, 0.0)

        spread = sensitivity(found, aim, shape, miss)
        # at the edge of a family, where it turns at an end, the parameter moves nothing
        return least + (miss * ends.mean_slope if spread is None else spread)


def sensitivity(found: Joined, aim: Aim, shape: Callable[[Joined], np.ndarray], miss: float) -> float | None:
    """The largest change of ``shape`` (0 for the curve itself) when reach and levels are off by ``miss``.

    None when the parameter moves nothing.
    """
    unknowns = np.array([found.parameter, *found.multipliers])
    sizes = np.array([aim.size, *np.maximum(np.abs(aim.levels), TINY)])
    units = DIFFERENCE * np.array([found.family.unit, *(np.abs(found.multipliers) + (found.multipliers == 0))])
    count = len(unknowns)
    far = BEND_STEP * units[0] * np.outer(np.eye(count)[0], [1, -1])
    steps = np.concatenate([np.kron(np.diag(units), NUDGES), far], axis=1)
    columns = unknowns[:, None] + steps
    measured = found.family.lines.measure(found.family.batch(columns[0], columns[1:]))
    covered = np.vstack([measured.x, measured.levels])
    here = np.append(found.measured.x, found.measured.levels[:, 0])
    rates, spreads = np.empty((len(sizes), count)), np.empty(count)
    for j in range(count):
        known = np.flatnonzero(np.isfinite(covered[0, j * len(NUDGES) : (j + 1) * len(NUDGES)]))
        if len(known) == 0:
            return float("inf")
        k = j * len(NUDGES) + int(known[0])
        rates[:, j] = (covered[:, k] - here) / sizes / steps[j, k]
        other = Joined(found.family, float(columns[0, k]), columns[1:, k], measured.take(k))
        spreads[j] = np.abs(shape(other)).max() / abs(steps[j, k])
    if np.abs(rates[0, 0]) * units[0] <= ROUND_OFF:
        return None
    relative = miss / aim.size
    if count == 1:
        # close to a fold the reach is quadratic in the parameter
        second = abs(float(covered[0, -2] - 2 * here[0] + covered[0, -1])) / (BEND_STEP * units[0]) ** 2
        bend = max(second / aim.size if np.isfinite(second) else 0.0, TINY)
        return float(spreads[0] * min(relative / abs(rates[0, 0]), np.sqrt(2 * relative / bend)))
    return float(spreads @ (np.abs(np.linalg.pinv(rates)).sum(axis=1) * relative))
