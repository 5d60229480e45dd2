"""Deflection angles: an orbit followed inwards from piece to piece, to where it turns back."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from functools import cached_property

import numpy as np

from varcalc.mechanics.scattering.legs import BentAngles, EdgeLegs, TurningLegs
from varcalc.mechanics.scattering.pieces import LOG_RADIUS_LIMIT, PieceOfEnergy, RadialGain, RadialPiece
from varcalc.numerics.one_coordinate.potential import NodesOutwards
from varcalc.numerics.one_coordinate.quadrature import AGREED
from varcalc.numerics.roots import EPSILON, bracketed_newton
from varcalc.showing import Brief, Shown

NEXT_TO_ORBITING = 1e-8
"""Of the impact parameter at which an orbit goes round: nearer, round-off takes more than the logarithm leaves out."""
SAME_AS_ORBITING = 8 * EPSILON
"""Of the square of an impact parameter: one that is so near to an orbiting one goes round for ever."""
INSIDE_RADIUS = 1 - 1e-6
"""Of the least radius at which a potential is a number."""
FEWER = 4.0
"""By how many times more than round-off what is all but at rest is off."""


class ScatteringOutcome(Enum):
    """What becomes of an orbit; the value says it in words."""

    DEFLECTED = "deflected"
    CAPTURED = "falls into the centre"
    UNDEFINED = "comes to where the potential is no number"
    ORBITING = "goes round for ever: the angle diverges"
    UNRESOLVED = "an integral was not resolved"


@dataclass(frozen=True, repr=False, eq=False)
class Deflections(Shown):
    """Deflections of m orbits with the impact parameters ``impact``, all arrays of their shape.

    Attributes
    ----------
    angle : array
        The deflection angle π - 2φ, in radians: positive where the potential repels, negative where it attracts, by
        more than π where an orbit goes round; not a number for an orbit that is captured or goes round for ever.
    slope : array
        Its derivative by the impact parameter.
    closest : array
        The least distance from the centre; 0 for an orbit that falls into it.
    outcomes : array of ScatteringOutcome
    """

    impact: np.ndarray
    angle: np.ndarray
    slope: np.ndarray
    closest: np.ndarray
    outcomes: np.ndarray


@dataclass(frozen=True, repr=False)
class Orbiting(Brief):
    """An orbit that comes in and goes round for ever, on a circle of ``radius``.

    Next to its ``impact`` parameter b₀ the angle goes as -``logarithm`` ln(1/(b/b₀ - 1)) outside, and with twice as
    much inside, where the orbit passes the circle inwards and outwards (Landau and Lifshitz, "Mechanics", sect. 18).
    """

    impact: float
    radius: float
    logarithm: float


@dataclass(frozen=True)
class Approach:
    """Orbits of one energy in one piece of a potential."""

    piece: RadialPiece
    energy: float

    @cached_property
    def medium(self) -> PieceOfEnergy:
        """The piece as these orbits feel it."""
        return PieceOfEnergy(self.piece, self.energy)

    @cached_property
    def nodes(self) -> NodesOutwards:
        """Places of -ln r, inwards, between which r² F is monotone."""
        limits = np.exp([-LOG_RADIUS_LIMIT, LOG_RADIUS_LIMIT])
        low, high = np.log(np.clip([self.piece.inner, self.piece.outer], *limits))
        middle = float(np.log(self.piece.middle))
        return RadialGain(self.medium).nodes(middle, middle, low, high).downwards

    @cached_property
    def _hollows(self) -> tuple[np.ndarray, np.ndarray]:
        """The radii and r² F of minima of r² F."""
        g, u = self.nodes.g, self.nodes.u
        low = np.flatnonzero((g[1:-1] <= g[:-2]) & (g[1:-1] <= g[2:])) + 1
        return np.exp(-u[low]), g[low]

    def agreed(self, impact: np.ndarray, inner: np.ndarray) -> np.ndarray:
        """To what share integrals outside ``inner`` (m,) are told (m,): fewer digits where an orbit all but rests."""
        squared, (radii, least) = impact[:, None] ** 2, self._hollows
        passed = radii > inner[:, None]
        with np.errstate(all="ignore"):
            left = np.min(np.where(passed, np.abs(least / squared - 1), np.inf), axis=1, initial=1.0)
            return np.maximum(AGREED, FEWER * EPSILON / left)

    @cached_property
    def inmost(self) -> ScatteringOutcome:
        """What becomes of orbits that do not turn back in the piece about the centre."""
        inside = np.array(INSIDE_RADIUS * np.exp(-self.nodes.u[-1]))
        with np.errstate(all="ignore"):
            lost = bool(np.isnan(self.piece.values(inside)[0]))
        return ScatteringOutcome.UNDEFINED if lost else ScatteringOutcome.CAPTURED

    def enters(self, impact: np.ndarray) -> np.ndarray:
        """Whether orbits that come to the outer edge go on into the piece."""
        share, _ = self.medium.values(np.array(self.piece.outer))
        return share * self.piece.outer**2 > impact**2

    def turning(self, impact: np.ndarray) -> np.ndarray:
        """The outermost turning points (m,); not numbers where there are none in the piece."""
        nodes, squared = self.nodes, impact**2
        number = nodes.first_below(np.zeros(len(impact), dtype=int), squared)
        inside = np.clip(number, 1, len(nodes.u) - 1)
        far, near = np.exp(-nodes.u[inside - 1]), np.exp(-nodes.u[inside])
        above, below = nodes.g[inside - 1], nodes.g[inside]

        def left(r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            share, slope = self.medium.values(r)
            return r**2 * share - squared, r * (2 * share + slope)

        with np.errstate(all="ignore"):
            start = far + (near - far) * np.clip((above - squared) / (above - below), 0.0, 1.0)
            r, _ = bracketed_newton(left, far, near, start, relative=2 * EPSILON, flat=2 * EPSILON * squared)
        return np.where(number < len(nodes.u), r, np.nan)


@dataclass(frozen=True)
class Inwards:
    """Orbits with ``impact`` parameters (m,), followed inwards through the ``approaches``, and which go ``round``."""

    approaches: tuple[Approach, ...]
    round: tuple[Orbiting, ...]
    impact: np.ndarray

    def followed(self) -> Deflections:
        """What becomes of them."""
        found = self._through()
        for orbiting in self.round:
            for side in (-1, 1):
                self._beside(orbiting, side, found)
        return found

    def _beside(self, orbiting: Orbiting, side: int, found: Deflections) -> None:
        """Writes the angles next to an orbit that goes round by its logarithm: quadrature has lost their digits."""
        off = self.impact - orbiting.impact
        near = (side * off > 0) & (np.abs(off) < NEXT_TO_ORBITING * orbiting.impact)
        near &= found.outcomes != ScatteringOutcome.ORBITING
        if not np.any(near):
            return
        farther = orbiting.impact * (1 + side * NEXT_TO_ORBITING)
        anchor = Inwards(self.approaches, (), np.array([farther])).followed()
        apart = farther - orbiting.impact
        passed = np.rint(anchor.slope[0] * apart / orbiting.logarithm)  # in and out over it, or up to it and back
        if anchor.outcomes[0] is not ScatteringOutcome.DEFLECTED:
            return
        found.angle[near] = anchor.angle[0] + passed * orbiting.logarithm * np.log(off[near] / apart)
        found.slope[near] = passed * orbiting.logarithm / off[near]
        found.outcomes[near] = ScatteringOutcome.DEFLECTED

    def _through(self) -> Deflections:
        m = len(self.impact)
        total = BentAngles(np.zeros(m), np.zeros(m), np.zeros(m))
        closest, outcomes = np.zeros(m), np.full(m, ScatteringOutcome.CAPTURED)
        alive = np.arange(m)
        for number, approach in enumerate(self.approaches):
            turning = approach.turning(self.impact[alive])
            turns = np.isfinite(turning)
            self._walk(total, approach, alive[turns], turning[turns], TurningLegs)
            closest[alive[turns]], outcomes[alive[turns]] = turning[turns], ScatteringOutcome.DEFLECTED
            alive, edge = alive[~turns], approach.piece.inner
            if edge == 0 or len(alive) == 0:
                outcomes[alive] = approach.inmost
                break
            self._walk(total, approach, alive, np.full(len(alive), edge), EdgeLegs)
            last = number + 1 == len(self.approaches)
            back = np.full(len(alive), last) | (not last and ~self.approaches[number + 1].enters(self.impact[alive]))
            closest[alive[back]], outcomes[alive[back]] = edge, ScatteringOutcome.DEFLECTED
            alive = alive[~back]
        return self._summed(total, closest, outcomes)

    def _walk(
        self,
        total: BentAngles,
        approach: Approach,
        rows: np.ndarray,
        inner: np.ndarray,
        kind: type[TurningLegs | EdgeLegs],
    ) -> None:
        """Adds the angles of the legs outside ``inner`` to those of the ``rows``."""
        share, slope = approach.medium.values(inner)
        impact = self.impact[rows]
        if kind is TurningLegs:
            share = (impact / inner) ** 2  # it has more digits than 1 - U/E
        legs = kind(approach.medium, inner, impact, share, slope, approach.agreed(impact, inner))
        angles = legs.angles(approach.piece.outer)
        total.free[rows] += angles.free
        total.bent[rows] += angles.bent
        total.by_impact[rows] += angles.by_impact

    def _summed(self, total: BentAngles, closest: np.ndarray, outcomes: np.ndarray) -> Deflections:
        angle, slope = 2 * total.bent + (np.pi - 2 * total.free), -2 * total.by_impact
        outcomes[(outcomes == ScatteringOutcome.DEFLECTED) & ~np.isfinite(angle)] = ScatteringOutcome.UNRESOLVED
        for orbiting in self.round:
            outcomes[np.abs(self.impact**2 / orbiting.impact**2 - 1) <= SAME_AS_ORBITING] = ScatteringOutcome.ORBITING
        through = (self.impact == 0) & (outcomes == ScatteringOutcome.CAPTURED) & self._open
        angle[through], slope[through], outcomes[through] = 0.0, np.nan, ScatteringOutcome.DEFLECTED
        lost = outcomes != ScatteringOutcome.DEFLECTED
        angle[lost], slope[lost] = np.nan, np.nan
        return Deflections(self.impact, angle, slope, closest, outcomes)

    @property
    def _open(self) -> bool:
        """Whether an orbit with b = 0 goes straight through the centre: the potential is finite there."""
        innermost = self.approaches[-1]
        return innermost.piece.inner == 0 and bool(np.isfinite(innermost.medium.values(np.array(0.0))[0]))


def orbits_round(approaches: tuple[Approach, ...]) -> tuple[Orbiting, ...]:
    """The orbits that go round for ever, the outermost first: minima of r² F less than all that is farther out."""
    found, least = [], np.inf
    for approach in approaches:
        g, u = approach.nodes.g, approach.nodes.u
        before = np.minimum(np.minimum.accumulate(g), least)[:-2]
        hollow = (g[1:-1] < before) & (g[1:-1] <= g[2:]) & (g[1:-1] > 0)
        for r in np.exp(-u[1:-1][hollow]):
            share, slope = approach.medium.values(r)
            # g'' by ln r, of g = r² F with g' = 0
            bent = float(4 * (share + slope) - approach.piece.curvature(r) / approach.energy)
            if bent > 0:
                found.append(Orbiting(float(r * np.sqrt(share)), float(r), float(np.sqrt(2 * share / bent))))
        least = min(least, float(np.min(g)))
    return tuple(found)
