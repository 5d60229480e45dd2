"""Surfaces: where a ray is refracted or reflected, and where a bundle is stopped.

A surface is the zero set of a smooth function of position, its *level*; the
normal is the gradient of that, and its curvature the second derivatives.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import InitVar, dataclass, field
from types import MappingProxyType
from typing import Any, ClassVar

import casadi as ca
import numpy as np

from varcalc.optics.parameters import Parametrised
from varcalc.optics.validation import by_chunks, direction, number, numbers, point
from varcalc.problem.conditions import named, truth
from varcalc.showing import Brief
from varcalc.spelling import spelled
from varcalc.symbolic import tracing
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.intervals import Interval, enclosures

Expression = Any
"""A CasADi SX expression."""
Constant = Callable[[float], Any]
"""What a number of a surface enters its formula as: ``float``, or a symbol that stands for it."""
ON_SURFACE = 1e-12
"""A point is on a surface when it is no farther from it than this share of the scene's size."""


class Surface(Parametrised, ABC):
    """A surface in the plane (a curve there) or in space. A new one defines :meth:`level`."""

    mirror: bool

    @abstractmethod
    def level(self, position: Expression) -> Expression:
        """A smooth expression that is zero on the surface, at ``position`` (a column of symbols)."""

    def parametric_level(self, position: Expression, parameters: Mapping[str, Expression]) -> Expression:  # noqa: ARG002  none, unless a surface says otherwise
        """The level for other values of the parameters, which may be symbols."""
        return self.level(position)

    def formula(self, position: Expression, constant: Constant) -> Expression:  # noqa: ARG002  none, as for parameters
        """The level, or any multiple of it, with the surface's numbers as ``constant`` has them.

        Where these are symbols no arithmetic among the numbers is carried out, and so none is rounded.
        """
        return self.level(position)

    def belongs(self, position: Expression) -> Expression:  # noqa: ARG002  every zero does, unless a surface says otherwise
        """Positive where a zero of the level belongs to the surface; an expression, or a number."""
        return 1.0

    @property
    def dimension(self) -> int | None:
        """2 or 3; None for a surface that fits both."""
        return None

    @property
    def middle(self) -> Sequence[float] | None:
        """A point towards which rays are looked for first, where the surface has one."""
        return None

    @property
    def extent(self) -> float:
        """How far from its middle the surface is looked for as closely; all of it is there where it is ``bounded``."""
        return 0.0

    @property
    def bounded(self) -> bool:
        """Whether no point of the surface is farther from its middle than its extent."""
        return False


@spelled
@dataclass(frozen=True, repr=False)
class Plane(Brief, Surface):
    """The plane through ``point`` with the given ``normal`` (a straight line, in the plane)."""

    point: Sequence[float]
    normal: Sequence[float]
    mirror: bool = False
    _given: Sequence[float] = field(init=False, repr=False, compare=False)
    """The normal before it was made a unit vector, which is rounded."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "point", point("point", self.point))
        object.__setattr__(self, "_given", point("normal", self.normal))
        object.__setattr__(self, "normal", direction("normal", self.normal))
        truth("mirror", self.mirror)
        _same_dimension(point=self.point, normal=self.normal)

    @property
    def dimension(self) -> int:
        """That of the point."""
        return len(self.point)

    def level(self, position: Expression) -> Expression:
        """The distance from the plane, with sign."""
        return _along_normal(position, self.normal, self.point, float)

    def formula(self, position: Expression, constant: Constant) -> Expression:
        """See :meth:`Surface.formula`; by the normal as it was given, of any length."""
        return _along_normal(position, self._given, self.point, constant)


@spelled
@dataclass(frozen=True, repr=False)
class Sphere(Brief, Surface):
    """The whole sphere (circle) of ``radius`` about ``center`` (d,).

    Raises TypeError or ValueError for a center that is no point, and a radius that is not positive.
    """

    center: Sequence[float]
    radius: float
    mirror: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "center", point("center", self.center))
        truth("mirror", self.mirror)
        if not number("radius", self.radius) > 0:
            raise ValueError(f"radius must be a positive number, not {self.radius!r}")

    @property
    def dimension(self) -> int:
        """That of the centre."""
        return len(self.center)

    @property
    def middle(self) -> Sequence[float]:
        """The centre."""
        return self.center

    @property
    def extent(self) -> float:
        """The radius."""
        return self.radius

    @property
    def bounded(self) -> bool:
        """Always."""
        return True

    def level(self, position: Expression) -> Expression:
        """(|r - center|² - radius²)/(2 radius): near the surface the distance from it."""
        return self.formula(position, float)

    def formula(self, position: Expression, constant: Constant) -> Expression:
        """See :meth:`Surface.formula`."""
        radius = constant(self.radius)
        return (ca.sumsqr(position - _column(self.center, constant)) - radius**2) / (2 * radius)


@dataclass(frozen=True)
class _OfRevolution(Surface):
    """What surfaces about an axis through their vertex have in common."""

    vertex: Sequence[float]
    axis: Sequence[float]
    radius: float
    conic: float = 0.0
    _given: Sequence[float] = field(init=False, repr=False, compare=False)
    """The axis before it was made a unit vector, which is rounded."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertex", point("vertex", self.vertex))
        object.__setattr__(self, "_given", point("axis", self.axis))
        object.__setattr__(self, "axis", direction("axis", self.axis))
        _same_dimension(vertex=self.vertex, axis=self.axis)
        truth("mirror", self.mirror)
        if number("radius", self.radius) == 0:
            raise ValueError(f"radius must be a number other than zero, not {self.radius!r}; for none take Plane")
        number("conic", self.conic)

    @property
    def dimension(self) -> int:
        """That of the vertex."""
        return len(self.vertex)

    @property
    def middle(self) -> Sequence[float]:
        """The vertex."""
        return self.vertex

    @property
    def extent(self) -> float:
        """The radius of curvature there."""
        return abs(self.radius)

    def _cylindrical(self, position: Expression, constant: Constant) -> tuple[Expression, Expression]:
        """Height along the axis above the vertex, and the squared distance from the axis."""
        offset, given = position - _column(self.vertex, constant), _column(self._given, constant)
        axis = given / ca.sqrt(ca.sumsqr(given))
        height = ca.dot(axis, offset)
        return height, ca.sumsqr(offset - height * axis)


@spelled
@dataclass(frozen=True, repr=False)
class Conic(Brief, _OfRevolution):
    """A conic of revolution: the sheet through its vertex, as far as it is a graph over the tangent plane there.

    Parameters
    ----------
    vertex, axis : sequence of float
        The vertex and the direction of the axis of revolution.
    radius : float
        Radius of curvature at the vertex, the centre of curvature at ``vertex + radius * axis``: negative for a
        surface bent the other way.
    conic : float
        The conic constant k = -e²: 0 a sphere, -1 a paraboloid, below -1 a hyperboloid, above an ellipsoid.
    mirror : bool

    Notes
    -----
    With z along the axis and ρ the distance from it, ρ² - 2 R z + (1 + k) z² = 0 (Malacara, "Optical Shop
    Testing", appendix A).
    """

    mirror: bool = False

    def level(self, position: Expression) -> Expression:
        """The conic's equation over 2 R."""
        return self.formula(position, float)

    def formula(self, position: Expression, constant: Constant) -> Expression:
        """See :meth:`Surface.formula`."""
        height, squared = self._cylindrical(position, constant)
        return (squared + (1 + constant(self.conic)) * height**2) / (2 * constant(self.radius)) - height

    def belongs(self, position: Expression) -> Expression:
        """Positive on the sheet of the vertex."""
        height, _ = self._cylindrical(position, float)
        return 1 - (1 + self.conic) * height / self.radius


@spelled
@dataclass(frozen=True, repr=False)
class Asphere(Brief, _OfRevolution):
    """A conic with even powers added: z = c ρ²/(1 + sqrt(1 - (1 + k) c² ρ²)) + a₄ ρ⁴ + a₆ ρ⁶ + ...

    Raises TypeError or ValueError for what are no numbers of these shapes.

    Parameters
    ----------
    vertex, axis, radius, conic, mirror
        As for :class:`Conic`; c = 1/radius.
    coefficients : sequence of float
        a₄, a₆, ...; ISO 10110-12.
    """

    coefficients: Sequence[float] = ()
    mirror: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        coefficients = numbers("coefficients", self.coefficients)
        if coefficients.ndim != 1:
            raise ValueError(f"coefficients must be a sequence a4, a6, ..., not {self.coefficients!r}")
        object.__setattr__(self, "coefficients", tuple(float(a) for a in coefficients))

    def level(self, position: Expression) -> Expression:
        """The sag at the distance of ``position`` from the axis, less its height."""
        return self.formula(position, float)

    def formula(self, position: Expression, constant: Constant) -> Expression:
        """See :meth:`Surface.formula`."""
        height, squared = self._cylindrical(position, constant)
        radius = constant(self.radius)
        root = ca.sqrt(1 - (1 + constant(self.conic)) * squared / radius**2)
        sag = squared / radius / (1 + root)
        return sag + sum(constant(a) * squared ** (i + 2) for i, a in enumerate(self.coefficients)) - height


@spelled
@dataclass(frozen=True, repr=False)
class Implicit(Brief, Surface):
    """The zeros of any smooth function.

    Raises TypeError or ValueError where ``level_function`` is no function, and for parameters that are no numbers.

    Parameters
    ----------
    level_function : callable
        ``f(x, y)`` in the plane, ``f(x, y, z)`` in space, and ``p`` last where there are parameters; zero on the
        surface, with a gradient other than zero there; written with NumPy's or CasADi's functions, called with
        symbols.
    mirror : bool
    parameters : Mapping[str, float], optional
        Names with values, that the function finds in its last argument: ``p.name``.
    """

    functions: ClassVar[Mapping[str, tuple[int, ...]]] = MappingProxyType({"level_function": (2, 3)})

    level_function: Callable[..., Expression]
    mirror: bool = False
    parameters: Mapping[str, float] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        if not callable(self.level_function):
            raise TypeError(f"level_function must be a function of the coordinates, not {self.level_function!r}")
        truth("mirror", self.mirror)
        object.__setattr__(self, "parameters", named("parameters", self.parameters))

    def level(self, position: Expression) -> Expression:
        """f at ``position``, for the present values of the parameters."""
        return self.parametric_level(position, self.parameters)

    def formula(self, position: Expression, constant: Constant) -> Expression:
        """See :meth:`Surface.formula`."""
        return self.parametric_level(position, {name: constant(value) for name, value in self.parameters.items()})

    def parametric_level(self, position: Expression, parameters: Mapping[str, Expression]) -> Expression:
        """f at ``position``."""
        hint = "it is called with as many coordinates as a point has, and with p last where there are parameters"
        arguments = [position[i] for i in range(position.numel())]
        last = [tracing.Names(dict(parameters))] if parameters else []
        return tracing.trace("level_function", self.level_function, [*arguments, *last], ca.SX, hint)


def _same_dimension(**points: Sequence[float]) -> None:
    (first, a), (second, b) = points.items()
    if len(a) != len(b):
        raise ValueError(f"{first} has {len(a)} coordinates and {second} {len(b)}; give both 2 or both 3")


def _column(numbers_of: Sequence[float], constant: Constant) -> Expression:
    return ca.vertcat(*map(constant, numbers_of))


def _along_normal(position: Expression, normal: Sequence[float], of: Sequence[float], constant: Constant) -> Expression:
    return ca.dot(_column(normal, constant), position - _column(of, constant))


@dataclass(frozen=True)
class Geometry:
    """A surface's level and its derivatives, evaluated on arrays of points.

    Parameters
    ----------
    surface : Surface
    dimension : int
        2 or 3.
    numbers : Expression
        Symbols (k, 1) in the level; what they are is said by :meth:`of`.
    """

    surface: Surface
    dimension: int
    numbers: InitVar[Expression | None] = None
    quadric: bool = field(init=False)
    """True where the level is a polynomial of second degree along every straight line."""
    _call: PointEvaluator = field(init=False, repr=False, compare=False)
    _plain: PointEvaluator = field(init=False, repr=False, compare=False)
    _along: ca.Function = field(init=False, repr=False, compare=False)
    _given: np.ndarray = field(init=False, repr=False, compare=False)

    def __post_init__(self, numbers: Expression | None) -> None:
        position = ca.SX.sym("r", self.dimension)
        given = ca.SX(0, 1) if numbers is None else numbers
        level = ca.SX(self.surface.level(position))
        gradient = ca.gradient(level, position)
        hessian = ca.jacobian(gradient, position)
        object.__setattr__(self, "quadric", not ca.depends_on(hessian, position))
        results = [ca.SX(self.surface.belongs(position)), level, gradient, hessian]
        function = ca.Function("surface", [position, given], [ca.densify(result) for result in results])
        object.__setattr__(self, "_call", PointEvaluator(function))
        object.__setattr__(self, "_plain", PointEvaluator(ca.Function("level", [position, given], results[:2])))
        heading = ca.SX.sym("p", self.dimension)
        slope = ca.jtimes(level, position, heading)
        object.__setattr__(self, "_along", ca.Function("along", [position, heading, given], [level, slope]))
        object.__setattr__(self, "_given", np.zeros((1, given.numel())))

    def of(self, numbers: np.ndarray) -> Geometry:
        """The same for other ``numbers`` (k,); nothing is compiled for it."""
        other = copy(self)
        object.__setattr__(other, "_given", numbers[None, :])
        return other

    def level(self, points: np.ndarray) -> np.ndarray:
        """The level (m,) at points (m, d)."""
        return self._call(len(points), points, self._given)[:, 1]

    def gradient(self, points: np.ndarray) -> np.ndarray:
        """Its gradient (m, d) at points (m, d)."""
        return self._call(len(points), points, self._given)[:, 2 : 2 + self.dimension]

    def distance(self, points: np.ndarray) -> np.ndarray:
        """The distance (m,) of points (m, d) from the surface, to first order; not a number where its level is none."""
        table = self._call(len(points), points, self._given)
        with np.errstate(all="ignore"):
            return np.abs(table[:, 1]) / np.linalg.norm(table[:, 2 : 2 + self.dimension], axis=1)

    def along(self, points: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The level and its first two derivatives (m,) along the straight lines from points (m, d)."""
        d = self.dimension
        table = self._call(len(points), points, self._given)
        slope = np.sum(table[:, 2 : 2 + d] * directions, axis=1)
        bend = np.einsum("mi,mij,mj->m", directions, table[:, 2 + d :].reshape(-1, d, d), directions)
        return table[:, 1], slope, bend

    def belongs(self, points: np.ndarray) -> np.ndarray:
        """True (m,) where a zero of the level at the point belongs to the surface."""
        return self._call(len(points), points, self._given)[:, 0] > 0

    def belonging(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What :meth:`belongs` and :meth:`level` say of points (m, d), and nothing else."""
        table = self._plain(len(points), points, self._given)
        return table[:, 0] > 0, table[:, 1]

    def enclosed(self, low: np.ndarray, high: np.ndarray, directions: np.ndarray) -> tuple[Interval, Interval]:
        """What the level and its slope along ``directions`` (m, d) can be in boxes from ``low`` to ``high`` (m, d).

        Infinite where no enclosure is known.
        """
        boxes = [list(zip(low.T, high.T, strict=True)), list(zip(directions.T, directions.T, strict=True))]
        boxes.append(list(zip(self._given.T, self._given.T, strict=True)))
        shape = np.shape(low[:, 0])
        found = [np.broadcast_to(end, shape) for (both,) in enclosures(self._along, boxes) for end in both]
        return (found[0], found[1]), (found[2], found[3])

    def normal(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The unit normal (m, d) and its derivative by position (m, d, d), tangential part."""
        d = self.dimension
        table = self._call(len(points), points, self._given)
        gradient, hessian = table[:, 2 : 2 + d], table[:, 2 + d :].reshape(-1, d, d)
        length = np.linalg.norm(gradient, axis=1)
        normal = gradient / length[:, None]
        tangential = np.eye(d) - normal[:, :, None] * normal[:, None, :]
        return normal, tangential @ hessian / length[:, None, None]


def touched(geometry: Geometry, points: np.ndarray) -> np.ndarray:
    """True (m,) for points on the surface to round-off."""
    extent = max(float(points.max(initial=0.0)), -float(points.min(initial=0.0))) or 1.0

    def on(some: np.ndarray) -> np.ndarray:
        with np.errstate(invalid="ignore"):
            return (geometry.distance(some) <= ON_SURFACE * extent) & geometry.belongs(some)

    return by_chunks(on, points).astype(bool)
