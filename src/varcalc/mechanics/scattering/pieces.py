"""A central potential as it is written, cut into pieces on which it is smooth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np

from varcalc.numerics.one_coordinate.potential import NOT_FOLLOWED, PLACES, Potential
from varcalc.symbolic.differences import carry, displaced
from varcalc.symbolic.evaluation import Columns, PointEvaluator, in_shape
from varcalc.symbolic.intervals import enclosures
from varcalc.symbolic.places import places
from varcalc.symbolic.switches import Switch, held, switches
from varcalc.symbolic.tracing import Expression, trace
from varcalc.symbolic.variation import gentle_boxes

LOG_RADIUS_LIMIT = 300.0
"""Of |ln r|: beyond it r² is no number."""
MOST_PLACES_OF_POTENTIAL = 2000
"""Places at which a potential that varies fast is looked at."""
DIGITS_KEPT = 0.1
"""Of a radius: farther from it differences of a potential have their digits."""
NEGLIGIBLE = 1e-15
"""Of the energy: a potential that is less is nothing to what an integral has to resolve."""
SPREAD = np.array([1e-3, 1.0])
"""Of that: to where."""
SILENT, NO_ENERGY = 1e120, 1e-60
"""How far away a potential is asked whether it is a number still, and of the energy what is nothing there."""
SAFE_DECADES, QUIET = 2, 1e-5
"""Powers of ten of the radius before that, at which nothing is lost yet; of that, the inner end of a leg all beyond."""
AROUND_EDGE = 1e-10
"""Of an edge: how far on either side of it its place is looked for to round-off."""


@dataclass(frozen=True)
class RadialPiece:
    """A potential U(r) between the radii ``inner`` and ``outer``, where it is smooth; inner is 0 at the centre."""

    written: Expression
    radius: Expression
    inner: float
    outer: float

    @property
    def middle(self) -> float:
        """A radius inside, in the geometric middle of those that are numbers."""
        low = max(self.inner, min(1e-3, self.outer / 4))
        return float(np.sqrt(low * min(self.outer, max(1e3, 4 * low))))

    @cached_property
    def impenetrable(self) -> bool:
        """Whether U is infinite throughout."""
        return bool(self.written.is_constant() and float(self.written) == np.inf)

    @cached_property
    def constant(self) -> bool:
        """Whether U is the same throughout, so that no force acts."""
        return bool(self.written.is_constant())

    @cached_property
    def _functions(self) -> ca.Function:
        """U and r U'."""
        slope = ca.densify(ca.gradient(self.written, self.radius))
        return ca.Function("potential", [self.radius], [self.written, self.radius * slope])

    @cached_property
    def _values(self) -> Columns:
        return PointEvaluator(self._functions).columns

    @cached_property
    def _changes(self) -> Columns:
        base, x = ca.SX.sym("base"), ca.SX.sym("x")
        value, slope = carry(self._functions, [displaced(base, x, self.middle)])
        results = [value.value, slope.value, value.change, slope.change]
        return PointEvaluator(ca.Function("changes", [base, x], results, {"cse": True})).columns

    def values(self, r: np.ndarray) -> list[np.ndarray]:
        """U and r U' at ``r``, in its shape."""
        return in_shape(self._values(r), np.shape(r))

    def curvature(self, r: float) -> float:
        """r (r U')' at ``r``: the second derivative of U by ln r."""
        value = self.radius * ca.gradient(self._functions(self.radius)[1], self.radius)
        return float(ca.Function("curvature", [self.radius], [value])(r))

    def changes(self, base: np.ndarray, x: np.ndarray) -> list[np.ndarray]:
        """U and r U' at base + ``x``, and their changes since ``base``, exact to round-off however small x is.

        Where a whole column of x is no small part of the base, the changes are differences, which cost less.
        """
        far = np.all(x > DIGITS_KEPT * base, axis=0)
        if not np.any(far):
            return in_shape(self._changes(base, x), np.shape(x))
        found = [np.empty(np.shape(x)) for _ in range(4)]
        if not np.all(far):
            for out, part in zip(found, self._changes(base, x[..., ~far]), strict=True):
                out[..., ~far] = part
        start, there = self.values(base), self.values(base + x[..., far])
        differences = [new - old for new, old in zip(there, start, strict=True)]
        for out, part in zip(found, [*there, *differences], strict=True):
            out[..., far] = part
        return found

    def gentle(self, negligible: float) -> np.ndarray:
        """Radii (k,), ascending, between which U varies gently, as far as it is more than ``negligible``."""
        function = ca.Function("U", [self.radius], [self.written])
        scale = np.exp(np.linspace(-LOG_RADIUS_LIMIT, LOG_RADIUS_LIMIT, 5))
        inside = scale[(scale > self.inner) & (scale < self.outer)]
        ends = max(self.inner, scale[0]), min(self.outer, scale[-1])
        edges = gentle_boxes(function, np.unique([*ends, *inside]), MOST_PLACES_OF_POTENTIAL)
        ((low, high),) = enclosures(function, [[(edges[:-1], edges[1:])]])[0]
        size = np.broadcast_to(np.maximum(np.abs(low), np.abs(high)), (len(edges) - 1,))
        felt = np.flatnonzero(size > negligible)
        return edges[felt[0] : felt[-1] + 2] if len(felt) else edges[:0]


@dataclass(frozen=True)
class PieceOfEnergy:
    """A piece of the potential as an orbit of the ``energy`` feels it: F = 1 - U/E."""

    piece: RadialPiece
    energy: float

    @cached_property
    def gentle(self) -> np.ndarray:
        """See :meth:`RadialPiece.gentle`."""
        return self.piece.gentle(NEGLIGIBLE * self.energy)

    @cached_property
    def silent(self) -> float:
        """The radius beyond which powers of r are no numbers any more, and a potential of them is nothing."""
        r = np.geomspace(1.0, SILENT, 121)
        with np.errstate(all="ignore"):
            known = np.all(np.isfinite(self.piece.changes(r[:, None], r[:, None] * SPREAD)), axis=(0, 2))
            first = len(r) - int(np.argmax(known[::-1]))
            if np.isfinite(self.piece.outer) or first == len(r):
                return np.inf
            last = float(r[max(first - SAFE_DECADES, 0)])
            return last if np.abs(self.piece.values(np.array(last))[0]) <= NO_ENERGY * self.energy else np.inf

    def values(self, r: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
        """F and r F' at ``r``, in its shape."""
        at = np.asarray(r)
        value, slope = self.piece.values(at)
        heard = at <= self.silent
        return np.where(heard, 1 - value / self.energy, 1.0), np.where(heard, -slope / self.energy, 0.0)

    def changes(self, base: np.ndarray, x: np.ndarray) -> FeltChange:
        """What is felt at base + ``x``."""
        value, slope, change, bend = self.piece.changes(base, x)
        felt = FeltChange(1 - value / self.energy, -slope / self.energy, -change / self.energy, -bend / self.energy)
        quiet = base > QUIET * self.silent
        silent = quiet | (base + x > self.silent)
        if not np.any(silent):
            return felt
        level, rise = (np.where(quiet, 0.0, part / self.energy) for part in self.piece.values(base))
        far = 1.0, 0.0, level, rise
        parts = felt.share, felt.slope, felt.change, felt.bend
        return FeltChange(*(np.where(silent, there, part) for there, part in zip(far, parts, strict=True)))


@dataclass(frozen=True)
class FeltChange:
    """F, called ``share``, and r F', called ``slope``, at places; and their changes since the inner ends of legs."""

    share: np.ndarray
    slope: np.ndarray
    change: np.ndarray
    bend: np.ndarray


@dataclass(frozen=True)
class RadialGain(Potential):
    """g = r² (1 - U/E) of u = ln r: (du/dτ)² = g - b² and b dτ is the angle about the centre."""

    medium: PieceOfEnergy

    def at(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See :meth:`Potential.at`."""
        with np.errstate(all="ignore"):
            r = np.exp(u)
            share, slope = self.medium.values(r)
            return r**2 * share, r**2 * (2 * share + slope)

    def changes(self, base: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See :meth:`Potential.changes`."""
        with np.errstate(all="ignore"):
            start, grown = np.exp(base), np.expm1(2 * x)
            share, slope = self.medium.values(np.broadcast_to(start, np.shape(x)))
            felt = self.medium.changes(start, start * np.expm1(x))
            gain = grown * share + (1 + grown) * felt.change
            steeper = grown * (2 * share + slope) + (1 + grown) * (2 * felt.change + felt.bend)
            return start**2 * gain, start**2 * steeper

    @property
    def gentle(self) -> np.ndarray:
        """See :meth:`Potential.gentle`."""
        return np.log(self.medium.gentle)

    @property
    def reach(self) -> np.ndarray:
        """Multiples of one: u is a logarithm."""
        reach = np.geomspace(1e-8, NOT_FOLLOWED, PLACES)
        return reach[reach < LOG_RADIUS_LIMIT]


def radial_pieces(potential: Callable[..., Any], hard_core: float) -> tuple[RadialPiece, ...]:
    """The pieces of ``potential(r)`` from the outermost inwards, up to where it is infinite or ``hard_core``.

    Raises TypeError and ValueError, naming the argument, for what is no potential of a radius or switches too often.
    """
    r = ca.SX.sym("r")
    written = trace("potential", potential, [r], ca.SX, "it takes the distance r from the centre")
    edges = [hard_core, *(edge for edge in _edges(written, r) if edge > hard_core), np.inf]
    found = []
    for inner, outer in reversed(list(pairwise(edges))):
        middle = RadialPiece(written, r, inner, outer).middle
        piece = RadialPiece(held([written], [r], [np.array([middle])])[0], r, inner, outer)
        if piece.impenetrable and found:
            break
        if not np.isfinite(float(piece.values(np.array(middle))[0])):
            raise ValueError(
                f"potential must be a number at every r outside a hard core; at r = {middle:.6g} it is not"
            )
        found.append(piece)
    return tuple(found)


def _edges(written: Expression, r: Expression) -> list[float]:
    """Radii, ascending, at which the potential has kinks or jumps."""
    u = ca.SX.sym("u")
    logarithmic, found = ca.substitute(written, r, ca.exp(u)), []
    for switch in switches([logarithmic], [u]):
        here = places(switch, u, (-LOG_RADIUS_LIMIT, LOG_RADIUS_LIMIT), found)
        if here is None:
            raise ValueError(f"potential switches ({switch.word}) at more radii than can be placed; give fewer")
        found += here
    radii = [float(np.exp(place)) for place in found]
    for switch in switches([written], [r]):
        radii = [_exact(switch, r, radius) for radius in radii]
    return np.unique(radii).tolist()


def _exact(switch: Switch, r: Expression, radius: float) -> float:
    """The radius at which the argument of the switch vanishes, where that is next to ``radius``, to round-off."""
    from scipy.optimize import brentq

    argument = ca.Function("argument", [r], [switch.argument])
    low, high = radius * (1 - AROUND_EDGE), radius * (1 + AROUND_EDGE)
    if float(argument(low)) * float(argument(high)) >= 0:
        return radius
    return float(brentq(lambda x: float(argument(x)), low, high, xtol=1e-300, rtol=1e-15))
