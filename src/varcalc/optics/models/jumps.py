"""Whether the index of a medium jumps inside it, and where an index of one coordinate is less than smooth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import casadi as ca
import numpy as np

from varcalc.optics.media.medium import Expression, Graded, Medium, Radial, Stratified, as_layers, switching
from varcalc.optics.media.tabulated import Layers, Tabulated
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.look_up import InCells, in_cells
from varcalc.symbolic.nearest import gathered
from varcalc.symbolic.places import places
from varcalc.symbolic.sides import Sides
from varcalc.symbolic.switches import Switch, switches, tables

LOG_RADIUS_LIMIT = 330.0
"""Of |ln(r/r₀)|: beyond it r² is no number."""
FARTHEST = 1e8
"""Heights at which an index is asked for."""
JUST_OUTSIDE = 8 * float(np.finfo(float).eps)
"""Of the largest knot of a table: who is so little outside it is at its end."""
SAME_SLOPE = 1e-9
"""Of n² on both sides of a knot: where slopes differ by less there is no kink."""
OUTSIDE = 1e-3
"""Of a place, and of one: so far outside the outermost switches it is asked what an expression is there."""
SIDE_OFFSET, INDEX_ROUND_OFF = 1e-9, 1e-11
"""Of a place: how far beside it its sides are told; and of n², what is round-off."""


def less_smooth(g: Expression, u: Expression, far: float) -> tuple[np.ndarray, np.ndarray] | None:
    """Where ``g`` of one coordinate ``u`` has kinks or jumps, and where knots of tables; None where they are too many.

    They are looked for up to ``far`` on either side.
    """
    switched, knots = _placed(switches([g], [u]), u, far), np.zeros(0)
    if switched is None:
        return None
    for table in tables(g, u):  # those that are carried out first come first
        own = _knots(table, u, far, switched, knots)
        if own is None:
            return None
        knots = np.union1d(knots, own)
    return switched, knots


def _knots(table: Switch, u: Expression, far: float, switched: np.ndarray, known: np.ndarray) -> Sequence[float] | None:
    """Where a table is at its knots; one asked at the value of others, cell by cell of these, whose knots are known."""
    written = in_cells(table.argument, u)
    if not written.tables:
        return places(table, u, (-far, far), list(switched))
    found: list[float] = []
    for low, high in pairwise(known.tolist()):
        (constants,) = written.at(np.array([[(low + high) / 2]]))
        if not np.all(np.isfinite(constants)):
            continue
        inside = replace(table, argument=written.expression)
        own = places(inside, u, (low, high), list(switched), written.constants, constants.tolist())
        if own is None:
            return None
        found += own
    return found


def _placed(found_in: Sequence[Switch], u: Expression, far: float) -> np.ndarray | None:
    """Where switches are, up to ``far`` on either side; None where they are too many."""
    found: list[float] = []
    for switch in gathered([switch for switch in found_in if switch.depends_on(u)]):
        here = places(switch, u, (-far, far), found)
        if here is None:
            return None
        found += here
    return np.unique(found)


def jumping(medium: Medium, dimension: int) -> bool:
    """Whether n² jumps: in layers and about a centre it is asked on both sides; elsewhere, whether it may is read."""
    if isinstance(medium, Stratified | Radial):
        found = jumps_of(medium)
        return found is None or len(found) > 0
    if isinstance(medium, Tabulated) or not switching(medium, dimension):
        return False
    position = ca.SX.sym("r", dimension)
    return any(
        one.jumps and one.depends_on(position) for one in switches([ca.SX(medium.squared_index(position))], [position])
    )


def jumps_of(medium: Stratified | Radial) -> np.ndarray | None:
    """Where n² jumps (k,), in heights or in logarithms of radii, as :func:`jumps_in` tells; None in tables, too."""
    u = ca.SX.sym("u")
    if isinstance(medium, Radial):
        g, far = replace(medium, center=None).squared_index(ca.vertcat(ca.exp(u), 0)), LOG_RADIUS_LIMIT
    else:
        g, far = medium.squared_index(ca.vertcat(0, u)), FARTHEST
    found = jumps_in(ca.SX(g), u, far)
    return None if found is not None and len(found) and tables(ca.SX(g), u) else found


def jumps_in(g: Expression, u: Expression, far: float) -> np.ndarray | None:
    """The places (k,), ascending, at which an expression ``g`` of ``u`` jumps, up to ``far``.

    None where it switches at too many places, and where on one side of such a place it is no number.
    """
    found = _placed(switches([g], [u]), u, far)  # tables are continuous
    if found is None or len(found) == 0:
        return found
    sides = Sides.of(g, u)
    beside = SIDE_OFFSET * np.maximum(1.0, np.abs(found))
    below, above = (sides.values(found[:, None], sides.at((found + way * beside)[:, None])) for way in (-1, 1))
    jumps = ~(np.abs(above - below) <= INDEX_ROUND_OFF * np.abs(below))
    return None if not np.all(np.isfinite(above - below)[jumps]) else found[jumps]


def placed(medium: Stratified | Radial | Tabulated) -> bool:
    """Whether all jumps of an index of one coordinate are known."""
    return isinstance(medium, Tabulated) or jumps_of(medium) is not None


@dataclass(frozen=True)
class CellsBetween:
    """What is ``written`` in cells of tables, between places ``edges`` (k,), and the ``constants`` (k + 1, c) there."""

    written: InCells
    edges: np.ndarray
    constants: np.ndarray

    def of(self, u: np.ndarray, outside: float = JUST_OUTSIDE) -> np.ndarray:
        """The number of the cell in which places are, those so little ``outside`` a table counted as at its end."""
        number = np.searchsorted(self.edges, u, "right")
        if np.all(self.known[number]):
            return number
        room = outside * np.abs(self.edges).max()
        for way in (-1, 1):
            edge = np.clip(number - (way < 0), 0, len(self.edges) - 1)
            other = np.clip(number + way, 0, len(self.edges))
            at_end = ~self.known[number] & self.known[other] & (np.abs(u - self.edges[edge]) <= room)
            number = np.where(at_end, other, number)
        return number

    def inside(self, u: np.ndarray) -> np.ndarray:
        """True where there are values, at the ends of tables but not beyond."""
        return self.known[self.of(u, 0.0)]

    @cached_property
    def known(self) -> np.ndarray:
        """In which cells (k + 1,) there are values."""
        return np.all(np.isfinite(self.constants), axis=1)

    def columns(self, cell: np.ndarray) -> list[np.ndarray]:
        """The constants in cells, one array for each."""
        return [column[cell] for column in self.constants.T]


def pieces(whole: Expression, u: Expression, far: float) -> tuple[np.ndarray, CellsBetween]:
    """Where an expression of ``u`` is less smooth, up to ``far``, and what it is between the knots of its tables.

    Where there are too many such places none is placed, and tables stay what they are.
    """
    found, none = less_smooth(whole, u, far), InCells(whole, u, ca.SX(0, 1), ())
    if found is None:
        return np.zeros(0), CellsBetween(none, np.zeros(0), np.zeros((1, 0)))
    switched, edges = found
    if len(edges) == 0:
        return switched, CellsBetween(none, edges, np.zeros((1, 0)))
    beyond = edges[[0, -1]] + np.array([-1, 1]) * (float(np.ptp(edges)) or 1.0)
    around = np.concatenate([beyond[:1], edges, beyond[1:]])
    written = in_cells(whole, u)
    constants = written.at((around[1:] + around[:-1])[:, None] / 2)
    return np.union1d(switched, edges), CellsBetween(written, edges, constants)


@dataclass(frozen=True)
class SwitchedFormula:
    """What an expression is from one place at which it switches to the next, and a place in it, ``probe``."""

    expression: Expression
    probe: float


def switched_pieces(whole: Expression, u: Expression, ends: np.ndarray) -> list[SwitchedFormula]:
    """The pieces (k + 1) of an expression of ``u``, which switches at ``ends`` (k,) alone."""
    sides, far = Sides.of(whole, u), np.maximum(1.0, np.abs(ends))
    inner = (ends[1:] + ends[:-1]) / 2
    places = np.concatenate([ends[:1] - OUTSIDE * far[:1], inner, ends[-1:] + OUTSIDE * far[-1:]])
    found = [sides.formula(side) for side in sides.at(places[:, None])]
    return [SwitchedFormula(expression, float(place)) for expression, place in zip(found, places, strict=True)]


@dataclass(frozen=True)
class TableLayers(Layers):
    """n² of a height in layers between the knots of the tables in it."""

    heights: Sequence[float]
    numbers: np.ndarray
    squared: ca.Function
    """Of a height and the constants of a layer."""

    def constants(self, layers: np.ndarray) -> np.ndarray:
        """See :meth:`Layers.constants`."""
        return self.numbers[layers]

    def written(self, height: Expression, constants: Expression) -> Expression:
        """See :meth:`Layers.written`."""
        return self.squared(height, constants)

    @cached_property
    def _slope(self) -> PointEvaluator:
        height, constants = ca.SX.sym("y"), ca.SX.sym("c", self.numbers.shape[1])
        slope = ca.densify(ca.gradient(self.squared(height, constants), height))
        return PointEvaluator(ca.Function("slope", [height, constants], [slope]))

    def slope(self, layers: np.ndarray, above: np.ndarray) -> np.ndarray:
        """See :meth:`Layers.slope`."""
        constants = self.numbers[layers]
        return self._slope(len(layers), (constants[:, 0] + above)[:, None], constants)[:, 0]

    @property
    def kinked(self) -> bool:
        """See :attr:`Layers.kinked`."""
        return self._kinked

    @cached_property
    def _kinked(self) -> bool:
        inner = np.arange(self.layers - 1)
        below = self.slope(inner, np.diff(self.heights)[:-1])
        above = self.slope(inner + 1, np.zeros(len(inner)))
        return bool(np.any(np.abs(above - below) > SAME_SLOPE * np.maximum(np.abs(above), np.abs(below))))


def layers_of(medium: Medium, dimension: int) -> Layers | None:
    """The layers of a table, or of an index of the height with tables in it; None of other media, and with kinks."""
    if isinstance(medium, Layers):
        return medium
    layers, axis = (
        (as_layers(medium, dimension) or (None, -1)) if isinstance(medium, Graded) else (medium, dimension - 1)
    )
    if not isinstance(layers, Stratified) or axis != dimension - 1 or switching(layers, dimension):
        return None
    u = ca.SX.sym("u")
    squared = ca.SX(layers.squared_index(ca.vertcat(0, u)))
    cells = pieces(squared, u, FARTHEST)[1]
    known = np.flatnonzero(cells.known)
    if not cells.written.tables or len(known) == 0 or np.any(np.diff(known) != 1):
        return None
    edges = np.array([-FARTHEST, *cells.edges, FARTHEST])
    heights = edges[known[0] : known[-1] + 2]
    numbers = np.column_stack([heights[:-1], heights[1:], cells.constants[known]])
    constants = ca.SX.sym("c", numbers.shape[1])
    written = ca.substitute(cells.written.expression, cells.written.constants, constants[2:])
    return TableLayers(tuple(heights.tolist()), numbers, ca.Function("squared", [u, constants], [written]))
