"""Rays of layers and of centres as motions along one coordinate, and back.

In layers the momentum p_h along them is constant (Snell's law; Brizard, "An
Introduction to Lagrangian Mechanics", eq. 1.33), and the height u obeys
(du/dτ)² = g(u) - C with g = n², C = p_h² and τ = σ. About a centre Bouguer's
c = |r × p| is constant (eq. 1.45). With u = ln(r/r₀), the logarithm being
conformal, the equation is the same with g = n² r², C = c² and dτ = dσ/r². In
both the optical path is ∫ g dτ, and √C τ is the distance along the layers or
the angle about the centre.

The plane of a ray is kept, the momentum along the layers or Bouguer's
invariant too. Deviations go the same way: those in the plane change C and the
start of the motion, the others are carried along in closed form.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from functools import cached_property

import casadi as ca
import numpy as np

from varcalc.numerics.one_coordinate.motions import MotionPoint
from varcalc.numerics.one_coordinate.potential import NOT_FOLLOWED, PLACES, Potential
from varcalc.numerics.one_coordinate.quadrature import BY_C, TAU
from varcalc.optics.media.medium import Expression, Medium, Radial
from varcalc.optics.models.cell_formulas import CellFormulas
from varcalc.optics.models.jumps import (
    LOG_RADIUS_LIMIT,
    CellsBetween,
    jumps_in,
    pieces,
    switched_pieces,
)
from varcalc.optics.rays.beam import Beam, frames
from varcalc.symbolic.variation import gentle_boxes

PATH, SIGMA = 1, 2
"""The columns of the integrals, after τ, that hold the optical path and σ."""
MOST_BOXES = 20_000
"""Places at which an index that varies fast is looked at, those next to the scene first."""
ROUGH_PLACES, HEIGHT_MARGIN = 240, 2.0
"""Heights at which the index is summed to say how high rays come, and by what factor that may be wrong."""
FARTHEST_LOG = 300.0
"""Of the logarithm of a radius."""
DARK_MINIMUM, FEW_MINIMA = 1e-25, 32
"""Of g: where it comes down to less no ray goes on; and how many of the next minima are looked at for that."""
MANY_STOPS = 8
"""Of so many on each piece between two of them the formula is taken by itself: the whole one holds them all."""
LEAST_ANGULAR_MOMENTUM = 1e-140
"""Of n r: a ray through the centre is the limit of rays past it."""


_NONE = np.zeros(0)


class RayPotential(Potential):
    """g of rays; the integrals over τ are the optical path, ∫ g dτ, and σ."""

    @property
    @abstractmethod
    def about_centre(self) -> bool:
        """True for a centre, False for layers."""

    @property
    def index_at_centre(self) -> float:
        """n where all turns about; not a number in layers."""
        return np.nan

    @abstractmethod
    def within(self, place: np.ndarray, base: np.ndarray, x: np.ndarray) -> np.ndarray:
        """The change of g from ``base`` over ``x`` by the formula that holds at a ``place`` between two stops."""

    def sigma_rate(self, u: np.ndarray) -> np.ndarray:
        """dσ/dτ at u: 1 in layers."""
        return np.ones_like(u)

    def weighted(self, point: MotionPoint) -> tuple[np.ndarray, ...]:
        """The integrands of the optical path, g, and of σ."""
        return point.g, self.sigma_rate(point.u)

    def enclosed(self, u: np.ndarray, first: float, last: float) -> np.ndarray:
        """See :meth:`Potential.enclosed`: rays turn back, or end, at the first place without an index."""
        g, slope = self.at(u)
        bar = DARK_MINIMUM * float(self.at(np.array([first, last]))[0].min())
        lows = np.flatnonzero((slope[:-1] < 0) & (slope[1:] > 0))
        beside = lows[u[lows] > last][:FEW_MINIMA], lows[u[lows + 1] < first][-FEW_MINIMA:]
        at = np.append(u[g <= bar], self.turning(slope, u, np.concatenate(beside)))
        dark = at[self.at(at)[0] <= bar]
        low, high = dark[dark < first].max(initial=-np.inf), dark[dark > last].min(initial=np.inf)
        return np.unique(np.append(u[(u >= low) & (u <= high)], [end for end in (low, high) if np.isfinite(end)]))

    def farthest(self, edge: np.ndarray, way: int, path: np.ndarray, sigma: np.ndarray) -> np.ndarray:
        """The places (p,) beyond which no ray comes from an edge (p,), about, downwards for -1; infinite for none.

        Rays go no farther than to optical paths ``path`` and σ ``sigma`` (p,), and not through a place without an
        index.
        """
        if self.about_centre and way < 0:
            return np.full(len(edge), -np.inf)
        away = np.append(0.0, np.geomspace(1e-6, 1e6, ROUGH_PLACES))
        away = away[away <= FARTHEST_LOG] if self.about_centre else away
        with np.errstate(all="ignore"):
            scale = np.ones(len(edge)) if self.about_centre else np.fmin(path, sigma * np.sqrt(self.at(edge)[0]))
            u = edge[:, None] + way * away * scale[:, None]
            g = self.at(u)[0]
            steps = np.abs(np.diff(u))
            # du/dτ is √g at the most
            sums = (
                np.cumsum(np.fmin(rate[:, 1:], rate[:, :-1]) * steps, axis=1)
                for rate in (np.sqrt(np.fmax(g, 0.0)), self.sigma_rate(u) / np.sqrt(g))
            )
            limits = (HEIGHT_MARGIN * limit[:, None] for limit in (path, sigma))
            enough = np.any([own > limit for own, limit in zip(sums, limits, strict=True)], axis=0) | (g[:, 1:] <= 0)
        number = 1 + np.argmax(enough, axis=1)
        return np.where(enough.any(axis=1), u[np.arange(len(edge)), number], way * np.inf)


@dataclass(frozen=True)
class Profile(RayPotential):
    """g of one medium, about ``unit``: the radius u is measured from, or any height in layers.

    Parameters
    ----------
    medium : Stratified or Radial
    unit : float
        A radius, for a centre; a length of the scene, for layers.
    probe : float
        A u at which there is an index.
    """

    medium: Medium
    unit: float
    probe: float
    _formulas: CellFormulas = field(init=False, repr=False, compare=False)
    _ends: np.ndarray = field(init=False, repr=False, compare=False)
    _stops: np.ndarray = field(init=False, repr=False, compare=False)
    _cells: CellsBetween = field(init=False, repr=False, compare=False)
    _jumps: np.ndarray = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        u = ca.SX.sym("u")
        far = LOG_RADIUS_LIMIT if self.about_centre else NOT_FOLLOWED * max(1.0, abs(self.probe))
        whole = ca.vertcat(self._squared(u), ca.SX(self._plain.index(self._position(u))))
        stops, cells = pieces(whole, u, far)
        jumps = jumps_in(ca.SX(self._squared(u)), u, far)
        many = jumps is not None and len(stops) >= MANY_STOPS and not len(cells.edges)
        if jumps is None or len(cells.edges):
            jumps = _NONE
        ends = stops if len(jumps) or many else _NONE
        if len(ends):
            formulas = CellFormulas.of_pieces(switched_pieces(whole, u, ends), u)
        else:
            formulas = CellFormulas.of_tables(cells, u, self.probe)
        below = ends[[int(np.argmin(np.abs(ends - place))) for place in jumps]]  # the same to round-off
        sides = np.column_stack([below, np.nextafter(below, np.inf)])
        own = {"_formulas": formulas, "_ends": ends, "_stops": stops, "_cells": cells, "_jumps": sides}
        for name, value in own.items():
            object.__setattr__(self, name, value)

    @property
    def stops(self) -> np.ndarray:
        """See :meth:`Potential.stops`."""
        return self._stops

    @property
    def jumps(self) -> np.ndarray:
        """See :meth:`Potential.jumps`."""
        return self._jumps

    @property
    def gentle(self) -> np.ndarray:
        """See :meth:`Potential.gentle`."""
        return self._gentle

    @cached_property
    def _gentle(self) -> np.ndarray:
        u = ca.SX.sym("u")
        reach = LOG_RADIUS_LIMIT if self.about_centre else NOT_FOLLOWED * abs(self.unit)
        edges = self.probe + reach * np.array([-1.0, 0.0, 1.0])
        return gentle_boxes(ca.Function("g", [u], [self._squared(u)]), edges, MOST_BOXES)[1:-1]

    @property
    def about_centre(self) -> bool:
        """True for a centre, False for layers."""
        return isinstance(self.medium, Radial)

    @property
    def index_at_centre(self) -> float:
        """See :meth:`RayPotential.index_at_centre`."""
        return self._index_at_centre

    @cached_property
    def _index_at_centre(self) -> float:
        if not self.about_centre:
            return np.nan
        place = ca.SX.sym("place", 2)  # where a table ends before the centre there is no number
        return float(ca.Function("index", [place], [self._plain.index(place)])(ca.DM.zeros(2)))

    def _position(self, u: Expression) -> Expression:
        return ca.vertcat(self.unit * ca.exp(u), 0) if self.about_centre else ca.vertcat(0, u)

    @property
    def _plain(self) -> Medium:
        """The medium, its centre at the origin."""
        return replace(self.medium, center=None) if isinstance(self.medium, Radial) else self.medium

    def _squared(self, u: Expression) -> Expression:
        squared = self._plain.squared_index(self._position(u))
        return squared * (self.unit * ca.exp(u)) ** 2 if self.about_centre else squared

    def at(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See :meth:`Potential.at`."""
        g, slope, _ = self._table(u)
        return g, slope

    def _table(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """g, its slope and n at u; g is not a number where there is no index."""
        return self._there(u, self._cell(u))

    def _cell(self, u: np.ndarray) -> np.ndarray:
        """The cells of tables, or the pieces between switches, in which places are; on a switch, the one below."""
        return np.searchsorted(self._ends, u, "left") if len(self._ends) else self._cells.of(u)

    def _there(self, u: np.ndarray, cell: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """g, its slope and n at u by the formula of a cell."""
        g, slope, n = self._formulas.index(u, cell)
        return g, slope, n

    def _by_formula(self, base: np.ndarray, x: np.ndarray, cell: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The changes of g and its slope from ``base`` over ``x`` by the formula of a cell."""
        gain, bend = self._formulas.changes(base, x, cell)
        return gain, bend

    def within(self, place: np.ndarray, base: np.ndarray, x: np.ndarray) -> np.ndarray:
        """See :meth:`RayPotential.within`."""
        place, base, x = np.broadcast_arrays(place, base, x)
        return self._by_formula(base, x, self._cell(place))[0]

    def changes(self, base: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See :meth:`Potential.changes`: through the knots of tables, and switches, that lie between, cell by cell."""
        first, last = self._cell(base), self._cell(base + x)
        gain, bend = self._by_formula(base, x, first)
        if np.all(first == last):
            return gain, bend
        gain, bend, first, last, base, x = (np.array(a) for a in np.broadcast_arrays(gain, bend, first, last, base, x))
        crossing = np.nonzero(first != last)
        gain[crossing], bend[crossing] = self._through(*(a[crossing] for a in (first, last, base, x)))
        return gain, bend

    def _through(
        self, first: np.ndarray, last: np.ndarray, base: np.ndarray, x: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The changes from ``base`` in the cells ``first`` over ``x`` into the cells ``last``."""
        edges = self._ends if len(self._ends) else self._cells.edges
        up = first < last
        leave, enter = np.where(up, first, first - 1), np.where(up, last - 1, last)
        to_leave = edges[leave] - base
        # what is left of x is told from x, which may be far smaller than the place
        rest = (x - to_leave) - (edges[enter] - edges[leave])
        out, back = self._by_formula(base, to_leave, first), self._by_formula(edges[enter], rest, last)
        left, entered = self._there(edges[leave], first), self._there(edges[enter], last)
        gain, bend = (out[k] + (entered[k] - left[k]) + back[k] for k in range(2))
        return gain, bend

    def sound(self, u: np.ndarray) -> np.ndarray:
        """True where g is a number and n not negative; where n² is negative rays turn before."""
        g, slope, n = self._table(u)
        known = len(self._ends) > 0 or self._cells.inside(u)
        return np.isfinite(g) & np.isfinite(slope) & ~(n < 0) & known

    def sigma_rate(self, u: np.ndarray) -> np.ndarray:
        """See :meth:`RayPotential.sigma_rate`: r² about a centre."""
        return (self.unit * np.exp(u)) ** 2 if self.about_centre else np.ones_like(u)

    @property
    def reach(self) -> np.ndarray | None:
        """Multiples of one about a centre, where u is a logarithm."""
        reach = np.geomspace(1e-8, NOT_FOLLOWED, PLACES)
        return reach[reach < LOG_RADIUS_LIMIT] if self.about_centre else None


@dataclass(frozen=True)
class ReducedRays:
    """m motions: ``u``, ``w`` = du/dτ (m,) at the start, ``C``, and the deviations (m, k) of u, w and C."""

    u: np.ndarray
    w: np.ndarray
    C: np.ndarray
    u_moved: np.ndarray
    w_moved: np.ndarray
    c_moved: np.ndarray


@dataclass(frozen=True)
class Deviated:
    """Where motions have come: places, integrals (m, COUNT), and the deviations (m, k) of u, w and τ."""

    place: MotionPoint
    integrals: np.ndarray
    u_moved: np.ndarray
    w_moved: np.ndarray
    tau_moved: np.ndarray


class RayReduction(ABC):
    """Rays at their starts, and their motions."""

    beam: Beam
    motions: ReducedRays

    @abstractmethod
    def carried(self, moved: Deviated) -> Beam:
        """The rays where their motions have come."""


class InLayers(RayReduction):
    """The height is u; the horizontal momentum is constant, whatever its direction (direction cosines, eq. 1.42)."""

    def __init__(self, beam: Beam) -> None:
        self.beam = beam
        along = beam.momentum[:, :-1]
        self.motions = ReducedRays(
            beam.position[:, -1], beam.momentum[:, -1], np.sum(along**2, axis=1),
            beam.moved[:, :, -1], beam.turned[:, :, -1],
            2 * np.einsum("md,mkd->mk", along, beam.turned[:, :, :-1]),
        )  # fmt: skip

    def carried(self, moved: Deviated) -> Beam:
        """See :meth:`RayReduction.carried`."""
        beam, tau = self.beam, moved.integrals[:, TAU]
        along = beam.momentum[:, :-1]
        shifted = beam.moved[:, :, :-1] + beam.turned[:, :, :-1] * tau[:, None, None]
        shifted = shifted + along[:, None, :] * moved.tau_moved[:, :, None]
        return Beam(
            np.column_stack([beam.position[:, :-1] + along * tau[:, None], moved.place.u]),
            np.column_stack([along, moved.place.w]),
            beam.optical_path + moved.integrals[:, PATH],
            np.concatenate([shifted, moved.u_moved[:, :, None]], axis=2),
            np.concatenate([beam.turned[:, :, :-1], moved.w_moved[:, :, None]], axis=2),
        )


class AboutCentre(RayReduction):
    """ln(r/r₀) is u; every ray has a plane of its own, in which φ = c τ is its angle from the start."""

    def __init__(self, beam: Beam, centre: np.ndarray, unit: float) -> None:
        self.beam, self.centre, self.unit = beam, centre, unit
        offset = beam.position - centre
        self.r = np.linalg.norm(offset, axis=1)
        self.out = offset / self.r[:, None]
        radial = np.sum(beam.momentum * self.out, axis=1)
        across = beam.momentum - radial[:, None] * self.out
        rising = np.linalg.norm(across, axis=1)
        self.around = np.where(rising[:, None] > 0, across / np.where(rising > 0, rising, 1.0)[:, None], _any(self.out))
        self.c = self.r * np.maximum(rising, LEAST_ANGULAR_MOMENTUM * np.linalg.norm(beam.momentum, axis=1))
        parts = [_parts(vectors, self.out, self.around) for vectors in (beam.moved, beam.turned)]
        (out, around, self.rest), (out_turned, around_turned, self.rest_turned) = parts
        r, p_out, p_around = self.r[:, None], radial[:, None], rising[:, None]
        self.angle_moved = around / r
        self.c_moved = out * p_around - around * p_out + r * around_turned
        self.motions = ReducedRays(
            np.log(self.r / unit), self.r * radial, self.c**2, out / r,
            out * p_out + around * p_around + r * out_turned, 2 * self.c[:, None] * self.c_moved,
        )  # fmt: skip

    def carried(self, moved: Deviated) -> Beam:
        """See :meth:`RayReduction.carried`."""
        beam, tau, c = self.beam, moved.integrals[:, TAU], self.c
        angle = c * tau
        cos, sin = np.cos(angle), np.sin(angle)
        out = cos[:, None] * self.out + sin[:, None] * self.around
        around = cos[:, None] * self.around - sin[:, None] * self.out
        r = self.unit * np.exp(moved.place.u)
        p_out, p_around = moved.place.w / r, c / r
        du = moved.u_moved
        turn = self.angle_moved + self.c_moved * tau[:, None] + c[:, None] * moved.tau_moved
        p_out_moved = (moved.w_moved - moved.place.w[:, None] * du) / r[:, None] - p_around[:, None] * turn
        p_around_moved = (self.c_moved - c[:, None] * du) / r[:, None] + p_out[:, None] * turn
        shifted = (r[:, None] * du)[:, :, None] * out[:, None, :] + (r[:, None] * turn)[:, :, None] * around[:, None, :]
        turned = p_out_moved[:, :, None] * out[:, None, :] + p_around_moved[:, :, None] * around[:, None, :]
        off, off_turned = self._off_plane(r, p_out, cos, sin)
        return Beam(
            self.centre + r[:, None] * out,
            p_out[:, None] * out + p_around[:, None] * around,
            beam.optical_path + moved.integrals[:, PATH],
            shifted + off,
            turned + off_turned,
        )

    def _off_plane(
        self, r: np.ndarray, p_out: np.ndarray, cos: np.ndarray, sin: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Deviations (m, k, d) out of the plane of the ray: its plane is tilted."""
        first = self.rest / self.r[:, None, None]
        speed = self.rest_turned * self.r[:, None, None] - first * (self.motions.w[:, None, None])
        sine = (sin / self.c)[:, None, None]
        r, p_out, cos, c = (a[:, None, None] for a in (r, p_out, cos, self.c))
        tilt = first * cos + speed * sine
        return r * tilt, p_out * tilt + (speed * cos - first * c**2 * sine) / r


def reduction(profile: Profile, beam: Beam) -> InLayers | AboutCentre:
    """The rays of ``beam`` as motions in ``profile``."""
    if isinstance(profile.medium, Radial):
        return AboutCentre(beam, profile.medium.middle(beam.dimension), profile.unit)
    return InLayers(beam)


def _any(out: np.ndarray) -> np.ndarray:
    """Unit vectors (m, d) at right angles to ``out``."""
    return frames(out)[:, 0]


def _parts(vectors: np.ndarray, out: np.ndarray, around: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Components (m, k) of ``vectors`` (m, k, d) along two directions, and the rest (m, k, d)."""
    first, second = np.einsum("mkd,md->mk", vectors, out), np.einsum("mkd,md->mk", vectors, around)
    rest = vectors - first[:, :, None] * out[:, None, :] - second[:, :, None] * around[:, None, :]
    return first, second, rest


def started_later(motions: ReducedRays, start: MotionPoint) -> np.ndarray:
    """How much farther in q (m, k) the neighbours start, from their u or their w, whichever says it more precisely."""
    by_u, by_w = start.w * start.rate, start.slope / 2 * start.rate
    u_own, w_own = start.u_by_c * motions.c_moved, start.w_by_c * motions.c_moved
    with np.errstate(all="ignore"):
        u_worth = np.nan_to_num(np.abs(by_u) / (np.abs(motions.u_moved) + np.abs(u_own)), nan=0.0)
        w_worth = np.nan_to_num(np.abs(by_w) / (np.abs(motions.w_moved) + np.abs(w_own)), nan=0.0)
        from_u, from_w = (motions.u_moved - u_own) / by_u, (motions.w_moved - w_own) / by_w
    return np.where(u_worth >= w_worth, from_u, from_w)


def deviations(motions: ReducedRays, start: MotionPoint, end: MotionPoint, integrals: np.ndarray) -> Deviated:
    """The deviations at the end, at equal q: ``start`` and ``end`` hold arrays (m, 1)."""
    c = motions.c_moved
    tau = integrals[:, [BY_C]] * c - start.rate * started_later(motions, start)
    place = MotionPoint(*(getattr(end, name)[:, 0] for name in MotionPoint.__dataclass_fields__))
    return Deviated(place, integrals, end.u_by_c * c, end.w_by_c * c, tau)
