"""How mass is spread: inertia tensors of points and of simple solids, composed, moved and turned."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np

from varcalc.mechanics.arguments import triple
from varcalc.mechanics.rigid.rotations import NOT_ORTHOGONAL
from varcalc.problem.conditions import positive, reals, told
from varcalc.showing import Shown
from varcalc.spelling import spelled

SAME_MOMENT = 1e-12
"""Of the largest principal moment: moments that differ by less are one."""


class TopKind(Enum):
    """What the principal moments say of a body; each member carries its meaning."""

    SPHERICAL = "three equal moments"
    SYMMETRIC = "two equal moments"
    ASYMMETRIC = "three different moments"
    LINEAR = "no moment about one axis, on which all of the mass lies"


@dataclass(frozen=True, repr=False, eq=False)
class Principal(Shown):
    """The principal ``moments`` (3,), ascending, and the ``axes`` (3, 3), one a column, a right-handed frame."""

    moments: np.ndarray
    axes: np.ndarray

    @property
    def kind(self) -> TopKind:
        """What kind of top that is; moments that differ by round-off are equal."""
        low, middle, high = self.moments
        alike = SAME_MOMENT * high
        if low <= alike:
            return TopKind.LINEAR
        equal = int(middle - low <= alike) + int(high - middle <= alike)
        return (TopKind.ASYMMETRIC, TopKind.SYMMETRIC, TopKind.SPHERICAL)[equal]


@spelled
@dataclass(frozen=True, repr=False, eq=False)
class Inertia(Shown):
    """A mass with its ``centre`` (3,) and its inertia ``tensor`` (3, 3) about that centre.

    The units are any that agree: a tensor is in those of the mass times those of length squared. Bodies are put
    together by ``+``; what is hollow is cut out by ``-``. Raises TypeError or ValueError for a mass that is not
    positive, and for what are no numbers of these shapes.

    Sources of the solids: Landau and Lifshitz, "Mechanics" (3rd ed., 1976), sect. 32, problem 2; Brizard, "An
    Introduction to Lagrangian Mechanics", sect. 7.1 and problems.

    Examples
    --------
    >>> cube = Inertia.box(12.0, 1.0, 1.0, 1.0)
    >>> cube.about([0.5, 0.5, 0.5])  # a corner
    array([[ 8., -3., -3.],
           [-3.,  8., -3.],
           [-3., -3.,  8.]])
    >>> dumbbell = Inertia.points([1.0, 1.0], [[0, 0, -1.0], [0, 0, 1.0]])
    >>> dumbbell.principal.moments, dumbbell.principal.kind.name
    (array([0., 2., 2.]), 'LINEAR')
    """

    mass: float
    centre: np.ndarray
    tensor: np.ndarray

    def __post_init__(self) -> None:
        tensor = reals("tensor", self.tensor)
        if tensor.shape != (3, 3):
            raise ValueError(f"tensor must be a matrix (3, 3), not {told(self.tensor)}")
        object.__setattr__(self, "mass", positive("mass", self.mass))
        object.__setattr__(self, "centre", triple("centre", self.centre))
        object.__setattr__(self, "tensor", tensor)

    @classmethod
    def points(cls, masses: Sequence[float], positions: Any) -> Inertia:
        """Point masses (m,) at ``positions`` (m, 3).

        Raises ValueError where there is none, or one that is not positive.
        """
        m, r = reals("masses", masses), reals("positions", positions)
        if m.ndim != 1 or len(m) == 0 or r.shape != (len(m), 3):
            raise ValueError(f"positions must be (m, 3) for m masses, not {r.shape} for {m.shape}")
        if not (np.all(m > 0) and np.all(np.isfinite(m)) and np.all(np.isfinite(r))):
            raise ValueError(f"masses must be positive, and positions finite, not {told(masses)} at {told(positions)}")
        centre = m @ r / m.sum()
        return cls(float(m.sum()), centre, _spread(m, r - centre))

    @classmethod
    def _symmetrical(cls, mass: float, *moments: float) -> Inertia:
        return cls(mass, np.zeros(3), np.diag(moments))

    @classmethod
    def box(cls, mass: float, a: float, b: float, c: float) -> Inertia:
        """A uniform block with edges ``a``, ``b`` and ``c`` along x, y and z, about its middle."""
        m, a, b, c = _positive(mass=mass, a=a, b=b, c=c)
        return cls._symmetrical(m, *(m / 12 * np.array([b**2 + c**2, c**2 + a**2, a**2 + b**2])))

    @classmethod
    def plate(cls, mass: float, a: float, b: float) -> Inertia:
        """A thin rectangle with edges ``a`` along x and ``b`` along y."""
        m, a, b = _positive(mass=mass, a=a, b=b)
        return cls._symmetrical(m, *(m / 12 * np.array([b**2, a**2, a**2 + b**2])))

    @classmethod
    def rod(cls, mass: float, length: float) -> Inertia:
        """A thin rod along z."""
        m, length = _positive(mass=mass, length=length)
        return cls._symmetrical(m, m * length**2 / 12, m * length**2 / 12, 0.0)

    @classmethod
    def dumbbell(cls, first: float, second: float, length: float) -> Inertia:
        """Two point masses a ``length`` apart on z, the second above; their centre of mass is the origin."""
        first, second, length = _positive(first=first, second=second, length=length)
        share = length / (first + second)
        return cls.points([first, second], [[0, 0, -second * share], [0, 0, first * share]])

    @classmethod
    def ellipsoid(cls, mass: float, a: float, b: float, c: float) -> Inertia:
        """A uniform solid with semi-axes ``a``, ``b`` and ``c`` along x, y and z."""
        m, a, b, c = _positive(mass=mass, a=a, b=b, c=c)
        return cls._symmetrical(m, *(m / 5 * np.array([b**2 + c**2, c**2 + a**2, a**2 + b**2])))

    @classmethod
    def sphere(cls, mass: float, radius: float) -> Inertia:
        """A uniform ball."""
        m, r = _positive(mass=mass, radius=radius)
        return cls.ellipsoid(m, r, r, r)

    @classmethod
    def spherical_shell(cls, mass: float, radius: float) -> Inertia:
        """A thin hollow sphere."""
        m, r = _positive(mass=mass, radius=radius)
        return cls._symmetrical(m, *[2 / 3 * m * r**2] * 3)

    @classmethod
    def cylinder(cls, mass: float, radius: float, height: float) -> Inertia:
        """A uniform cylinder about z, its middle at the origin."""
        m, r, h = _positive(mass=mass, radius=radius, height=height)
        across = m / 4 * (r**2 + h**2 / 3)
        return cls._symmetrical(m, across, across, m * r**2 / 2)

    @classmethod
    def cylindrical_shell(cls, mass: float, radius: float, height: float) -> Inertia:
        """A thin tube about z without ends, its middle at the origin."""
        m, r, h = _positive(mass=mass, radius=radius, height=height)
        across = m / 2 * (r**2 + h**2 / 6)
        return cls._symmetrical(m, across, across, m * r**2)

    @classmethod
    def disc(cls, mass: float, radius: float) -> Inertia:
        """A thin uniform disc in the plane of x and y."""
        m, r = _positive(mass=mass, radius=radius)
        return cls._symmetrical(m, m * r**2 / 4, m * r**2 / 4, m * r**2 / 2)

    @classmethod
    def ring(cls, mass: float, radius: float) -> Inertia:
        """A thin ring in the plane of x and y."""
        m, r = _positive(mass=mass, radius=radius)
        return cls._symmetrical(m, m * r**2 / 2, m * r**2 / 2, m * r**2)

    @classmethod
    def cone(cls, mass: float, radius: float, height: float) -> Inertia:
        """A uniform circular cone about z that stands on its vertex, the vertex at the origin."""
        m, r, h = _positive(mass=mass, radius=radius, height=height)
        across = 3 / 20 * m * (r**2 + h**2 / 4)
        return cls(m, np.array([0.0, 0.0, 3 * h / 4]), np.diag([across, across, 3 / 10 * m * r**2]))

    @classmethod
    def tetrahedron(cls, mass: float, corners: Any) -> Inertia:
        """A uniform tetrahedron with these ``corners`` (4, 3); any polyhedron is a sum of some.

        Its second moments are those of m/20 at each corner and 4 m/5 at the centre. Raises TypeError or ValueError for
        a mass that is not positive, and for what are not four points.
        """
        (m,), r = _positive(mass=mass), reals("corners", corners)
        if r.shape != (4, 3) or not np.all(np.isfinite(r)):
            raise ValueError(f"corners must be four points (4, 3), not {told(corners)}")
        return cls.points([m / 20] * 4 + [4 * m / 5], [*r, r.mean(axis=0)])

    def moved(self, displacement: Sequence[float] | np.ndarray) -> Inertia:
        """The same elsewhere."""
        return Inertia(self.mass, self.centre + triple("displacement", displacement), self.tensor)

    def turned(self, rotation: Any) -> Inertia:
        """The same turned about the origin by a matrix (3, 3). Raises ValueError where that is no rotation."""
        r = reals("rotation", rotation)
        if r.shape != (3, 3) or not np.abs(r.T @ r - np.eye(3)).max() <= NOT_ORTHOGONAL:
            raise ValueError("rotation must be an orthogonal matrix (3, 3); see EulerAngles.rotation")
        return Inertia(self.mass, r @ self.centre, r @ self.tensor @ r.T)

    def __add__(self, other: Inertia) -> Inertia:
        return self._with(other, 1.0)

    def __sub__(self, other: Inertia) -> Inertia:
        if not self.mass > other.mass:
            raise ValueError(f"a mass of {other.mass:g} cannot be cut out of {self.mass:g}")
        return self._with(other, -1.0)

    def _with(self, other: Inertia, sign: float) -> Inertia:
        """Both together, or one without the other: about the common centre by the parallel axes."""
        mass = self.mass + sign * other.mass
        apart = other.centre - self.centre
        reduced = np.array([sign * self.mass * other.mass / mass])
        centre = self.centre + sign * other.mass / mass * apart
        return Inertia(mass, centre, self.tensor + sign * other.tensor + _spread(reduced, apart[None]))

    def about(self, point: Sequence[float] | np.ndarray) -> np.ndarray:
        """The tensor (3, 3) about a ``point``: parallel axes, J = I + M (d² 1 - d d) (Brizard, eq. 7.8)."""
        away = self.centre - triple("point", point)
        return self.tensor + _spread(np.array([self.mass]), away[None])

    def moment(self, axis: Sequence[float] | np.ndarray, point: Sequence[float] | np.ndarray | None = None) -> float:
        """The moment about an ``axis`` (3,), of any length, through a ``point``: the centre of mass unless given.

        Raises TypeError or ValueError for what are not three numbers, and for an axis of the length zero.
        """
        n = triple("axis", axis)
        if not np.any(n):
            raise ValueError("axis must have a direction, not the length zero")
        n = n / np.linalg.norm(n)
        tensor = self.tensor if point is None else self.about(point)
        return float(n @ tensor @ n)

    @property
    def principal(self) -> Principal:
        """Principal moments and axes about the centre of mass."""
        return principal(self.tensor)


def check_inertia(inertia: Any) -> None:
    """TypeError for what is no :class:`Inertia`."""
    if not isinstance(inertia, Inertia):
        raise TypeError(f"inertia must be a mechanics.Inertia, which knows mass and centre, not {told(inertia)}")


@spelled
def principal(tensor: Any) -> Principal:
    """The principal moments and axes of an inertia ``tensor`` (3, 3).

    Raises ValueError for what is no inertia tensor: not symmetric, or a moment that is negative or more than the
    other two together (Landau and Lifshitz, "Mechanics", sect. 32).
    """
    t = reals("tensor", tensor)
    size = np.abs(t).max(initial=0.0)
    if t.shape != (3, 3) or not np.isfinite(size) or not np.abs(t - t.T).max() <= SAME_MOMENT * size:
        raise ValueError(f"tensor must be a symmetric matrix (3, 3) of finite numbers, not {told(tensor)}")
    diagonal = np.diag(t)
    if np.array_equal(t, np.diag(diagonal)):  # its own axes, to the last digit
        order = np.argsort(diagonal, kind="stable")
        moments, axes = diagonal[order], np.eye(3)[:, order]
    else:
        moments, axes = np.linalg.eigh((t + t.T) / 2)
    if (
        moments[0] < -SAME_MOMENT * size
        or moments[2] > (moments[0] + moments[1]) * (1 + SAME_MOMENT) + SAME_MOMENT * size
    ):
        raise ValueError(
            f"the principal moments {moments.tolist()} are of no body: none is negative, and none is more than the "
            "other two together"
        )
    axes = axes * np.array([1.0, 1.0, np.sign(np.linalg.det(axes))])
    return Principal(np.where(moments <= SAME_MOMENT * size, 0.0, moments), axes)


def _spread(masses: np.ndarray, r: np.ndarray) -> np.ndarray:
    """Σ m (r² 1 - r r) (3, 3) of masses (m,) at ``r`` (m, 3)."""
    return np.eye(3) * (masses @ (r**2).sum(axis=1)) - (r.T * masses) @ r


def _positive(**values: float) -> list[float]:
    return [positive(name, value) for name, value in values.items()]
