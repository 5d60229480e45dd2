"""Extremals of a Lagrangian without y between two points."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from varcalc.methods.first_integral.answers import EndValues, Evaluate
from varcalc.methods.first_integral.contract import Aim, Joined
from varcalc.methods.first_integral.isoperimetric import LevelStart
from varcalc.methods.first_integral.lines import CurveBatch
from varcalc.methods.first_integral.momentum import SLOPE_GRID, Abscissae, Momentum, Rising, RisingCurve, rising
from varcalc.methods.first_integral.reduction import START_CLOSE, Reduction
from varcalc.methods.first_integral.search import joining, solved
from varcalc.numerics.roots import scanned_root
from varcalc.problem.breaks import breaks


@dataclass(frozen=True)
class Cyclic(Reduction):
    """The search for the extremal of a Lagrangian without y."""

    @property
    def row(self) -> int:
        """The momentum L_y'."""
        return 3

    @property
    def searched(self) -> str:
        """What kind of extremal is looked for."""
        return f"no extremal whose slope stays finite, with L_y'y' {self.sign},"

    def aim(self, ends: EndValues) -> Aim:
        """A curve must rise from one ordinate to the other; with a free end any rise will do."""
        known = [y for y in (ends.y0, ends.y1) if y is not None]
        size = max(*map(abs, known), self.integrands.scale * ends.width)
        return Aim(known[1] - known[0] if len(known) > 1 else None, size, self.integrands.levels)

    def reaching(self, ends: EndValues, covered: float) -> EndValues:
        """The ends of a curve that rises otherwise."""
        return replace(ends, y1=(ends.y0 or 0.0) + covered)

    def _points(self, ends: EndValues) -> Abscissae:
        marks = tuple(b for b in breaks(self.integrands.problem) if ends.x0 < b < ends.x1)
        stops = (ends.x0, *marks, ends.x1)
        singular = tuple(not np.isfinite(self.probe(x, 0.0)[:, :, 0]).all() for x in (ends.x0, ends.x1))
        return Abscissae(stops, ends.width, (singular[0], singular[1]))

    def curves(self, ends: EndValues) -> list[Joined]:
        """The curve with L_y' = c that rises as far as it must; c = 0 where an end is free."""
        none, found = np.zeros(0), []
        for family in self._families(ends, none):
            if ends.y0 is None or ends.y1 is None:
                found += self._natural(family)
            else:
                found += joining(family, SLOPE_GRID, self.aim(ends))
        return found

    def _families(self, ends: EndValues, multipliers: np.ndarray) -> list[Rising]:
        points = self._points(ends)
        inside = 0.5 * (points.stops[0] + points.stops[1])
        sign = self.probe(inside, 0.0)[0, 4]
        upward = ends.y0 is None or ends.y1 is None or ends.y1 >= ends.y0
        return [
            rising(Momentum(self.integrands, orientation, inside), points, upward, multipliers)
            for orientation in (1.0, -1.0)
            if np.any(orientation * sign > 0) and self.legendre(orientation)
        ]

    def _natural(self, family: Rising) -> list[Joined]:
        """The curve with c = 0."""

        def momentum(parameters: np.ndarray) -> np.ndarray:
            at = np.full(parameters.shape, family.reference)
            return family.lines.momentum(at, parameters, np.zeros(0)) * np.ones_like(at)

        parameter = scanned_root(momentum, float(SLOPE_GRID[0]), float(SLOPE_GRID[-1]), 0.0)
        if parameter is None:
            return []
        return [Joined.of(family, parameter, np.zeros(0))]

    def from_start(self, ends: EndValues, start: LevelStart) -> Iterator[Joined]:
        """Newton's method from the slope the start has at the reference."""
        if not self.legendre(1.0 if start.convex else -1.0):
            return
        multipliers = np.array([start.multiplier])
        points = self._points(ends)
        inside = 0.5 * (points.stops[0] + points.stops[1])
        momentum = Momentum(self.integrands, 1.0 if start.convex else -1.0, inside)
        family = Rising(momentum, points, float(start.x[len(start.x) // 2]))
        slope = float(start.slope[len(start.x) // 2]) / self.integrands.scale
        found = solved(family, float(np.arcsinh(slope)), multipliers, self.aim(ends), START_CLOSE)
        if found is not None:
            yield found

    def curve(self, batch: CurveBatch, found: Joined, ends: EndValues) -> Evaluate:
        """The curve as the integral of its slope."""
        assert isinstance(found.family, Rising)
        rise = float(found.measured.x[0])
        y0 = ends.y0 if ends.y0 is not None else float(ends.y1 or 0.0) - rise
        y1 = ends.y1 if ends.y1 is not None else y0 + rise
        return RisingCurve(found.family, batch, found.measured, (y0, y1))
