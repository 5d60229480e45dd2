"""Extremals of a Lagrangian without x between two points: every one with at most one turning point."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from varcalc.methods.first_integral.answers import ROUND_OFF, ConstantCurve, EndValues, Evaluate, Reduced, Unsuitable
from varcalc.methods.first_integral.contract import Aim, Joined
from varcalc.methods.first_integral.energy import EnergyLines
from varcalc.methods.first_integral.families import EndOrdinates, Orbits, families, lingering
from varcalc.methods.first_integral.isoperimetric import LevelStart
from varcalc.methods.first_integral.lines import CurveBatch, CurveIntegrals
from varcalc.methods.first_integral.reduction import PROBED_SLOPES, START_CLOSE, Reduction
from varcalc.methods.first_integral.search import joining, solved
from varcalc.numerics.one_coordinate.panels import Cumulative, distance
from varcalc.numerics.resampled import SentResampled

STEP_ASIDE, SHARE_LEFT = 1e-3, 0.25
"""A step from an end, in units of the size, that leaves no more than such a share of L there: a singularity is near."""
STATIONARY = 1e-13
"""L_y at an end, relative to its size nearby, below which the constant is an extremal."""
EVEN = 1e-12
"""Relative size of L_y' at slope zero below which a turning point meets the natural condition."""


@dataclass(frozen=True)
class Autonomous(Reduction):
    """The search for extremals of a Lagrangian without x."""

    @property
    def row(self) -> int:
        """L - y' L_y'."""
        return 2

    @property
    def searched(self) -> str:
        """What kind of extremal is looked for."""
        return f"no extremal with at most one turning point and L_y'y' {self.sign}"

    def aim(self, ends: EndValues) -> Aim:
        """A curve must cover the width of the interval."""
        return Aim(ends.width, ends.width, self.integrands.levels)

    def reaching(self, ends: EndValues, covered: float) -> EndValues:
        """The ends of a curve that covers another width."""
        return replace(ends, x1=ends.x0 + covered)

    def _regular(self, y: float) -> bool:
        """True where L and its derivatives are numbers, at small slopes at least."""
        return bool(np.isfinite(self.probe(0.0, y)[:, :, 0]).all())

    def _points(self, ends: EndValues) -> EndOrdinates:
        known = [y for y in (ends.y0, ends.y1) if y is not None]
        points = EndOrdinates(ends.y0, ends.y1, ends.width)
        singular = tuple(y for y in known if not self._regular(y) or self._almost_singular(y, points.size))
        return replace(points, singular=singular)

    def _almost_singular(self, y: float, size: float) -> bool:
        """Whether L falls steeply from an end, as where it is infinite just beyond: distances matter there, not y."""
        around = y + STEP_ASIDE * size * np.array([0.0, 1.0, -1.0])
        values = np.abs(self.integrands.at(np.zeros(3), around, np.zeros(3))[0, 0])
        return bool(np.nanmin(values) < SHARE_LEFT * values[0])

    def _inside(self, points: EndOrdinates) -> float | None:
        """An ordinate near the ends at which everything probed is a number."""
        middle = 0.5 * (points.known[0] + points.known[-1])
        steps = points.size * np.array([0.0, 0.25, -0.25, 0.03, -0.03, 1e-3, -1e-3])
        tried = [*(middle + steps), *(y + s for y in points.known for s in steps[5:])]
        return next((float(y) for y in tried if self._regular(float(y))), None)

    def curves(self, ends: EndValues) -> list[Joined]:
        """Every curve found between the ends, over all families."""
        points = self._points(ends)
        inside = self._inside(points)
        if inside is None:
            return []
        if ends.y0 is None or ends.y1 is None:
            self._check_natural(inside)
        sign = self.probe(0.0, inside)[0, 4]
        found: list[Joined] = []
        for orientation in (1.0, -1.0):
            if np.any(orientation * sign > 0) and self.legendre(orientation):
                energy = EnergyLines(self.integrands, orientation, inside)
                for family, sample in families(energy, points, np.zeros(0)):
                    aim = self.aim(ends)
                    found += joining(family, sample, aim) or joining(*lingering(family, sample), aim)
        return found

    def _check_natural(self, inside: float) -> None:
        parts = self.probe(0.0, inside)[0]
        if abs(parts[3, 0]) > 2 * PROBED_SLOPES[0] * np.abs(parts[3]).max() + EVEN * np.abs(parts[0]).max():
            raise Unsuitable(
                "the natural condition at the free end asks for a slope that is not zero, which FirstIntegral "
                "does not look for; use Ritz or Collocation"
            )

    def level(self, ends: EndValues) -> Reduced | None:
        """y = const where that joins the ends and fulfils the Euler-Lagrange equation.

        It always fulfils L - y' L_y' = const: the first integral alone proves nothing here.
        """
        if len(self.integrands.levels) or (ends.y0 is not None and ends.y1 is not None and ends.y0 != ends.y1):
            return None
        y = ends.y0 if ends.y0 is not None else ends.y1
        assert y is not None
        size = max(abs(y), ends.width)
        x = np.array([ends.x0, ends.x1, ends.x1])
        parts = self.integrands.at(x, y + size * np.array([0.0, 0.5, -0.5]), np.zeros(3))[0]
        nearby = [abs(v) for v in parts[1, 1:] if np.isfinite(v)]
        if (
            not nearby
            or not abs(parts[1, 0]) <= STATIONARY * max(nearby)
            or not self.legendre(self.probe(0.0, y)[0, 4, 0])
        ):
            return None
        value = float(parts[0, 0]) * ends.width
        partials = self.integrands.partials_at(ends.x0, y) * ends.width
        curve = ConstantCurve(y, ends)
        errors = ROUND_OFF * abs(value), ROUND_OFF * abs(y)
        return Reduced(value, errors[0], curve, errors[1], curve.nodes, np.zeros(0), partials, 1)

    def from_start(self, ends: EndValues, start: LevelStart) -> Iterator[Joined]:
        """Turning where the start turns, monotone where it does not."""
        if not self.legendre(1.0 if start.convex else -1.0):
            return
        points, multipliers = self._points(ends), np.array([start.multiplier])
        inside = self._inside(points)
        if inside is None or ends.y0 is None or ends.y1 is None:
            return
        energy = EnergyLines(self.integrands, 1.0 if start.convex else -1.0, inside)
        aim = self.aim(ends)
        top, bottom = float(start.y.max()), float(start.y.min())
        tries: list[tuple[Orbits, float]] = []
        if top > max(ends.y0, ends.y1):
            tries.append((Orbits(energy, points, 1), top))
        if bottom < min(ends.y0, ends.y1):
            tries.append((Orbits(energy, points, -1), bottom))
        if ends.y0 != ends.y1:
            gentle = int(np.argmin(np.abs(start.slope)))
            reference = ends.y0 if gentle < len(start.x) // 2 else ends.y1
            slope = max(float(np.abs(start.slope).min()), 1e-3 * self.integrands.scale) / self.integrands.scale
            tries.append((Orbits(energy, points, 0, reference), float(np.log(slope))))
        for family, parameter in tries:
            found = solved(family, parameter, multipliers, aim, START_CLOSE)
            if found is not None:
                yield found
                return

    def curve(self, batch: CurveBatch, found: Joined, ends: EndValues) -> Evaluate:
        """The curve by inversion of x(y)."""
        assert isinstance(found.family, Orbits)
        return OrbitCurve(found.family.lines, batch, found.measured, ends.x0, ends.x1)


@dataclass(frozen=True)
class OrbitCurve(SentResampled):
    """y(x) where x(y) is known on monotone legs: inverted in the variable of each leg's rule."""

    lines: EnergyLines
    batch: CurveBatch
    measured: CurveIntegrals
    start: float
    end: float

    @cached_property
    def _cumulative(self) -> Cumulative:
        return self.batch.cumulative(self.measured)

    @cached_property
    def _anchors(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Abscissa of each leg's anchor, sign of the way from it, and the abscissae between legs."""
        return self.batch.anchors(self._cumulative, self.start, self.end)

    @property
    def nodes(self) -> np.ndarray:
        """Abscissae of the panels' edges."""
        at, sign, _ = self._anchors
        edges = [np.array(leg.panels.edges) for leg in self.batch.legs]
        x = [at[k] + sign[k] * self._cumulative.at(np.full(len(e), k), e) for k, e in enumerate(edges)]
        return np.unique(np.clip(np.concatenate([[self.start], *x, [self.end]]), self.start, self.end))

    def __call__(self, x: np.ndarray, derivative: int) -> np.ndarray:
        """y (derivative 0) or y' (1) at abscissae x (m,); shape (1, m)."""
        at, sign, between = self._anchors
        leg = np.clip(np.searchsorted(between, x, side="right") - 1, 0, len(at) - 1)
        t = self._cumulative.inverse(leg, np.maximum(sign[leg] * (x - at[leg]), 0.0))
        out = np.empty(len(x))
        for k in np.unique(leg):
            mask, this = leg == k, self.batch.legs[k]
            delta = this.length[0] * distance(this.panels.kind, t[mask])[0]
            out[mask] = self.lines.slope(this, delta, self.batch) if derivative else this.anchor[0] + delta
        return out[None, :]
