"""Many rays at one moment of their way: the state that every model carries on.

A ray is its position r and its momentum p = n dr/ds, with σ the parameter in
which dr/dσ = p, dp/dσ = ∇n²/2 and dS/dσ = n² = |p|² (Born and Wolf,
"Principles of Optics", sect. 3.2; Brizard, sect. 3.1.2). Along with it go the
deviations of its neighbours, the columns δr and δp: the variational
equations' solutions that begin with δr = 0 and δp across the ray.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Any, ClassVar, Self

import numpy as np

from varcalc.optics.surfaces import Geometry


class Rows:
    """A dataclass of arrays (m, ...), or of other such tables, that have as many rows each."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    def __len__(self) -> int:
        return len(getattr(self, next(iter(self.__dataclass_fields__))))

    def take(self, rows: np.ndarray | Sequence[int] | slice) -> Self:
        """The rows ``rows``: numbers, or a slice, which gives views."""
        values = [getattr(self, name) for name in self.__dataclass_fields__]
        return type(self)(*[v.take(rows) if isinstance(v, Rows) else v[rows] for v in values])

    def put(self, rows: np.ndarray, other: Self) -> None:
        """Write ``other`` over the ``rows``, in place."""
        for name in self.__dataclass_fields__:
            mine, its = getattr(self, name), getattr(other, name)
            if isinstance(mine, Rows):
                mine.put(rows, its)
            else:
                mine[rows] = its

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """The rows of all ``parts``, one of them at least, one part after the other."""
        columns = ([getattr(part, name) for part in parts] for name in cls.__dataclass_fields__)
        return cls(*(type(c[0]).joined(c) if isinstance(c[0], Rows) else np.concatenate(c) for c in columns))


class RayStatus(IntEnum):
    """How one ray of a bundle ended; :attr:`message` says it in words."""

    ARRIVED = 0
    MISSED = 1
    TOTAL_REFLECTION = 2
    OUT_OF_ORDER = 3
    SINGULAR = 4
    OUTSIDE = 5
    TOO_MANY_STEPS = 6
    INTERRUPTED = 7

    @property
    def message(self) -> str:
        """What happened to the ray."""
        return MESSAGES[self]


MESSAGES = {
    RayStatus.ARRIVED: "the ray stopped where it was to stop",
    RayStatus.MISSED: "the ray meets neither the surface it was to stop at nor any other",
    RayStatus.TOTAL_REFLECTION: "total reflection: there is no refracted ray at the surface it has come to",
    RayStatus.OUT_OF_ORDER: "the ray comes to a surface before one that stands earlier in the scene",
    RayStatus.SINGULAR: "the index is not a positive number, or infinite, where the ray has come to",
    RayStatus.OUTSIDE: "the ray has left the table of the medium",
    RayStatus.TOO_MANY_STEPS: "the ray was followed for as many steps as are allowed, without an end",
    RayStatus.INTERRUPTED: "the call was stopped before the ray came to an end",
}


@dataclass(frozen=True)
class Beam(Rows):
    """m rays in d dimensions, with k deviations each: ``position`` and ``momentum`` (m, d), ``optical_path`` (m,).

    ``moved`` and ``turned`` (m, k, d) are the deviations of position and momentum. ``crossed`` (m,) says by a number
    which jumps of the index inside media a ray has come through, or been turned back by, in which order: rays of which
    it differs are no neighbours. Zero, where it is left out: none.
    """

    position: np.ndarray
    momentum: np.ndarray
    optical_path: np.ndarray
    moved: np.ndarray
    turned: np.ndarray
    crossed: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        if len(self.crossed) != len(self.position):
            object.__setattr__(self, "crossed", np.zeros(len(self.position)))

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return self.position.shape[1]

    @property
    def deviations(self) -> int:
        """The number k of neighbours."""
        return self.moved.shape[1]

    def known(self, where: np.ndarray) -> Beam:
        """The rays ``where`` (m,) is true; in place of the others not a number."""
        columns = (getattr(self, name) for name in self.__dataclass_fields__)
        return Beam(*(np.where(where.reshape(-1, *[1] * (values.ndim - 1)), values, np.nan) for values in columns))


def packed(beam: Beam) -> np.ndarray:
    """The states (m, N) of :func:`varcalc.optics.models.equations.ray_system` for the rays of ``beam``."""
    pairs = np.concatenate([beam.moved, beam.turned], axis=2).reshape(len(beam), 2 * beam.deviations * beam.dimension)
    return np.column_stack([beam.position, beam.momentum, beam.optical_path, pairs])


def unpacked(states: np.ndarray, dimension: int) -> Beam:
    """The rays of the states (m, N)."""
    d = dimension
    pairs = states[:, 2 * d + 1 :].reshape(len(states), states.shape[1] // (2 * d) - 1, 2 * d)
    return Beam(states[:, :d], states[:, d : 2 * d], states[:, 2 * d], pairs[:, :, :d], pairs[:, :, d:])


AT_END = 1e-5
"""Of an optical path: conjugate points so close to the end of a ray on a caustic are the end itself."""
DARK = 1e-12
"""Of n² where rays come in: where it is no more, and its slope vanishes with it, no ray passes."""
STEP_TURN = 0.3
"""How far a ray turns over one step, in radians, by order of magnitude."""
NOTHING = -1
"""In place of the number of a surface: none is met."""


@dataclass(frozen=True)
class Arrival(Rows):
    """Rays carried on to the first thing they meet: ``struck`` (m,) is the number of the surface.

    It is :data:`NOTHING` where the limit of the optical path came first, or
    where ``status`` (m,) says that the ray came to neither.
    """

    beam: Beam
    struck: np.ndarray
    status: np.ndarray


def first_met(surfaces: list[np.ndarray], end: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What rays come to first: the number of a surface (m,), or :data:`NOTHING`; σ there; and their status.

    ``surfaces`` are the σ (m,) at which they meet each, ``end`` (m,) that of their limit, infinite where there is none.
    """
    far = np.stack([end, *surfaces])
    first = np.argmin(far, axis=0)  # of several at once the limit, then the first surface
    sigma = far[first, np.arange(len(end))]
    missed = ~np.isfinite(sigma)
    status = np.where(missed, int(RayStatus.MISSED), int(RayStatus.ARRIVED))
    return np.where(missed | (first == 0), NOTHING, first - 1), np.where(missed, 0.0, sigma), status


def launched(points: np.ndarray, directions: np.ndarray, index: np.ndarray, *, neighbours: bool) -> Beam:
    """Rays at points (m, d) along unit ``directions`` (m, d), each with d - 1 neighbours at right angles or none.

    The deviations are those for one radian of direction.
    """
    m, d = points.shape
    across = frames(directions) if neighbours else np.zeros((m, 0, d))
    return Beam(
        position=np.array(points),
        momentum=index[:, None] * directions,
        optical_path=np.zeros(m),
        moved=np.zeros_like(across),
        turned=index[:, None, None] * across,
    )


def frames(directions: np.ndarray) -> np.ndarray:
    """d - 1 unit vectors (m, d - 1, d) at right angles to each of the unit ``directions`` (m, d) and to each other."""
    if directions.shape[1] == 2:
        return np.stack([-directions[:, 1], directions[:, 0]], axis=1)[:, None, :]
    smallest = np.eye(3)[np.argmin(np.abs(directions), axis=1)]
    first = np.cross(directions, smallest)
    first /= np.linalg.norm(first, axis=1)[:, None]
    return np.stack([first, np.cross(directions, first)], axis=1)


SquaredIndex = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]
"""From points (m, d) to n² (m,), its gradient (m, d) and its Hessian matrix (m, d, d), as a :class:`Field` has them."""


def stride(position: np.ndarray, momentum: np.ndarray, field: SquaredIndex, length: np.ndarray) -> np.ndarray:
    """σ (m,) over which the rays turn little and go no farther than about ``length`` (m,); zero where none is known."""
    _, gradient, hessian = field(position)
    return paced(momentum, gradient / 2, np.linalg.norm(hessian, axis=(1, 2)), length)


def paced(momentum: np.ndarray, pulls: np.ndarray, bends: np.ndarray, length: np.ndarray) -> np.ndarray:
    """The same of rays on which ∇n²/2 ``pulls`` (m, d), where the Hessian matrix of n² is as large as ``bends`` (m,).

    A ray whose momentum is all but spent turns quickly in space, not in momentum: there it is the pull that counts.
    """
    size, pull = np.linalg.norm(momentum, axis=1), np.linalg.norm(pulls, axis=1)
    with np.errstate(all="ignore"):
        turning = STEP_TURN * np.fmax(size / pull, np.sqrt(length / pull))
        step = np.fmin(np.fmin(turning, STEP_TURN * 2 / np.sqrt(bends)), length / size)
    return np.where(np.isfinite(step), step, 0.0)


def at_surface(
    beam: Beam, geometry: Geometry, before: SquaredIndex, after: SquaredIndex, *, mirror: bool
) -> tuple[Beam, np.ndarray]:
    """The rays of ``beam``, which are on the surface, refracted from one medium into the next or reflected.

    Returns them with True (m,) for those which are totally reflected; those
    are left as they came. In momenta: the tangential part stays, the normal
    part becomes ±sqrt(n₂² - |tangential|²) (Snell's law; Born and Wolf,
    sect. 3.2.2), for the deviations differentiated.
    """
    met = _Met.of(beam, geometry, before)
    p, normal, into, into_change = beam.momentum, met.normal, met.into, met.into_change
    with np.errstate(all="ignore"):
        if mirror:
            out, out_change, total = -into, -into_change, np.zeros(len(p), dtype=bool)
        else:
            under, under_change = met.squared_behind(beam, before, after)
            total = ~(under > 0)
            out = np.sign(into) * np.sqrt(np.where(total, 1.0, under))
            out_change = under_change / (2 * out[:, None])
        gain, gain_change = (out - into)[:, None], (out_change - into_change)[:, :, None]
        leaving = replace(
            beam,
            momentum=p + gain * normal,
            moved=met.moved,
            turned=met.turned + gain_change * normal[:, None, :] + gain[:, None] * met.tilt,
        )
    if np.any(total):
        leaving.put(np.flatnonzero(total), beam.take(np.flatnonzero(total)))
    return leaving, total


def behind(beam: Beam, geometry: Geometry, before: SquaredIndex, after: SquaredIndex) -> tuple[np.ndarray, np.ndarray]:
    """The square (m,) of the normal momentum of rays of the plane behind a surface: n₂² - |tangential|².

    And its derivative by the launching angle. Where it is not positive they are totally reflected.
    """
    with np.errstate(all="ignore"):
        under, change = _Met.of(beam, geometry, before).squared_behind(beam, before, after)
    return under, change[:, 0]


def headings(beam: Beam) -> np.ndarray:
    """The angles of the directions of rays of the plane (m, 2), and their derivatives by the launching angle."""
    p, turned = beam.momentum, beam.turned[:, 0]
    with np.errstate(all="ignore"):
        rate = (p[:, 0] * turned[:, 1] - p[:, 1] * turned[:, 0]) / np.sum(p**2, axis=1)
    return np.stack([np.arctan2(p[:, 1], p[:, 0]), rate], axis=1)


@dataclass(frozen=True)
class _Met:
    """m rays on a surface of ``normal`` (m, d), with momenta ``into`` (m,) it, and where their neighbours meet it.

    These are ``moved`` along it and ``turned`` there, the normal by ``tilt`` (m, k, d), and ``into_change`` (m, k) is
    how their momenta into it differ.
    """

    normal: np.ndarray
    into: np.ndarray
    moved: np.ndarray
    turned: np.ndarray
    tilt: np.ndarray
    into_change: np.ndarray

    @classmethod
    def of(cls, beam: Beam, geometry: Geometry, before: SquaredIndex) -> _Met:
        """The rays of ``beam``, which are on the surface."""
        normal, curvature = geometry.normal(beam.position)
        gradient, p = before(beam.position)[1], beam.momentum
        with np.errstate(all="ignore"):  # of a ray that only touches the surface nothing is known of the neighbours
            into = np.sum(p * normal, axis=1)
            lateness = -np.einsum("mkd,md->mk", beam.moved, normal) / into[:, None]
            moved = beam.moved + lateness[:, :, None] * p[:, None, :]
            turned = beam.turned + lateness[:, :, None] * gradient[:, None, :] / 2
            tilt = np.einsum("mij,mkj->mki", curvature, moved)
            into_change = np.einsum("mkd,md->mk", turned, normal) + np.einsum("mkd,md->mk", tilt, p)
        return cls(normal, into, moved, turned, tilt, into_change)

    def squared_behind(self, beam: Beam, before: SquaredIndex, after: SquaredIndex) -> tuple[np.ndarray, np.ndarray]:
        """The square (m,) of the normal momentum behind the surface, and how that of neighbours differs (m, k)."""
        squared, gradient, _ = before(beam.position)
        squared_after, gradient_after, _ = after(beam.position)
        steeper = np.einsum("mkd,md->mk", self.moved, gradient_after - gradient)
        return self.into**2 + squared_after - squared, 2 * self.into[:, None] * self.into_change + steeper


def moved_on(beam: Beam, sigma: np.ndarray, squared_index: float) -> Beam:
    """The rays after ``sigma`` (m,) on their straight lines."""
    return replace(
        beam,
        position=beam.position + sigma[:, None] * beam.momentum,
        optical_path=beam.optical_path + sigma * squared_index,
        moved=beam.moved + sigma[:, None, None] * beam.turned,
    )


def spreading(beam: Beam) -> np.ndarray:
    """|dr⊥/dθ| in the plane, |dA/dΩ| in space (m,), from d - 1 neighbours' distances across the ray."""
    tangent = beam.momentum / np.linalg.norm(beam.momentum, axis=1)[:, None]
    return np.abs(_area(beam.moved, tangent))


def caustics_between(before: Beam, after: Beam) -> np.ndarray:
    """How many conjugate points (m,) the rays pass from ``before``, exclusive, to ``after``, inclusive.

    The area between a ray and its neighbours vanishes at one, with its sign: in the plane that says all. In space
    two of them may lie close together or in one place, and the sign comes back. What counts is how many
    eigenvalues are not positive of the map that takes the deviations across the ray before to those after: near the
    identity for rays that turn little from the one to the other, it is counted from trace and determinant. The
    count is the KMAH index of the stretch (Maslov's; Arnold, "Mathematical Methods of Classical Mechanics", app. 11).
    Rays from a point have not passed one yet.
    """
    with np.errstate(invalid="ignore"):
        ahead = [beam.momentum / np.linalg.norm(beam.momentum, axis=1)[:, None] for beam in (before, after)]
    a, b = before.moved, after.moved
    if before.dimension == 3:
        a, b = (_across(moved, tangent) for moved, tangent in zip((a, b), ahead, strict=True))
    start, end = (np.sign(_area(moved, tangent)) for moved, tangent in zip((a, b), ahead, strict=True))
    if before.dimension == 2:
        return ((start != 0) & (start * end <= 0)).astype(int)
    changed = (np.stack([b[:, 0], a[:, 1]], axis=1), np.stack([a[:, 0], b[:, 1]], axis=1))
    mixed = np.sign(sum(_area(moved, ahead[0]) for moved in changed))
    both, trace = start * end, mixed * start
    count = np.where(both < 0, 1, np.where(trace > 0, both == 0, 2 * (both >= 0)))
    return np.where(start == 0, mixed * end < 0, count).astype(int)  # from a line focus: the other neighbour's


def _across(moved: np.ndarray, tangent: np.ndarray) -> np.ndarray:
    """The part of deviations (m, d - 1, d) that is across rays with unit tangents (m, d)."""
    return moved - np.sum(moved * tangent[:, None, :], axis=2)[:, :, None] * tangent[:, None, :]


def _area(moved: np.ndarray, tangent: np.ndarray) -> np.ndarray:
    """The area (m,), with sign, between deviations (m, d - 1, d) across rays with unit tangents (m, d)."""
    with np.errstate(invalid="ignore"):  # what is not known has no area
        return np.linalg.det(np.concatenate([moved, tangent[:, None, :]], axis=1))
