"""Media: the refractive index as a function of position.

Every medium answers with n² as a CasADi expression of the coordinates, which
is what Hamilton's ray equations need, and often a polynomial where n is none.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import InitVar, dataclass, field, replace
from types import MappingProxyType
from typing import Any, ClassVar, Self

import casadi as ca
import numpy as np

from varcalc.optics.media.dispersion import Dispersion
from varcalc.optics.parameters import Parametrised
from varcalc.optics.validation import point
from varcalc.problem.conditions import finite, named, told
from varcalc.showing import Brief
from varcalc.spelling import spelled
from varcalc.symbolic import tracing
from varcalc.symbolic.centred import about_centre, over_plane
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.switches import switches, tables

Expression = Any
"""A CasADi SX expression."""


WAVELENGTH = "wavelength"
"""The parameter that a scene's ``wavelength`` sets, in micrometres in vacuum."""


class Medium(Parametrised, ABC):
    """What fills a part of a scene. A new medium defines :meth:`index`."""

    @abstractmethod
    def index(self, position: Expression) -> Expression:
        """n at ``position``, a column of 2 or 3 CasADi symbols."""

    def parametric_index(self, position: Expression, parameters: Mapping[str, Expression]) -> Expression:  # noqa: ARG002  none, unless a medium says otherwise
        """n at ``position`` for other values of the parameters, which may be symbols."""
        return self.index(position)

    def at_wavelength(self, wavelength: float) -> Self:
        """The medium for light of ``wavelength``, in micrometres in vacuum; itself where it has no dispersion.

        It has where ``wavelength`` is among its parameters.
        """
        return self.with_parameters({WAVELENGTH: wavelength}) if WAVELENGTH in self.parameters else self

    def squared_index(self, position: Expression) -> Expression:
        """n² at ``position``; simpler than n where that is a root."""
        return squared(self.index(position))

    def through(self, position: Expression) -> tuple[ca.Function, Expression] | None:  # noqa: ARG002  most have none
        """A function F and an expression u of ``position`` with n² = F(u), where n² depends on one u alone.

        Its derivatives are then cheaper by the chain rule.
        """
        return None

    def written_in_parts(self, position: Expression) -> tuple[Expression, Expression, Expression] | None:  # noqa: ARG002  most are not
        """Symbols (k, 1), and n² and n at ``position`` by them, which stand for the numbers of the part it is in.

        None where the medium is written as a whole. :meth:`numbers_of_parts` has the numbers.
        """
        return None

    def numbers_of_parts(self, points: np.ndarray) -> np.ndarray:
        """The numbers (m, k) of the parts in which points (m, d) are; see :meth:`written_in_parts`."""
        return np.zeros((len(points), 0))

    @property
    def dimension(self) -> int | None:
        """2 or 3 where the medium itself says so; None for a medium that fits both."""
        return None

    @property
    def is_uniform(self) -> bool:
        """True where rays are straight."""
        return False


def _declared() -> Any:
    """The field ``parameters`` of a medium."""
    return field(default_factory=dict, hash=False)


@dataclass(frozen=True)
class _Parametric(Medium):
    """A medium whose ``n`` takes the parameters as its last argument ``p``, where there are any."""

    def index(self, position: Expression) -> Expression:
        """n at ``position``, for the present values of the parameters."""
        return self.parametric_index(position, self.parameters)


@spelled
@dataclass(frozen=True, repr=False)
class Uniform(Brief, _Parametric):
    """The same index everywhere.

    Raises TypeError or ValueError where ``n`` is not a positive number.

    Parameters
    ----------
    n : float, Dispersion or callable
        The refractive index, positive; or the formula of a glass, for a scene with a ``wavelength``; or ``n(p)``, a
        function of the parameters.
    parameters : Mapping[str, float], optional
        Names with values, that ``n`` finds in its last argument: ``p.name``.

    Examples
    --------
    >>> from varcalc import optics
    >>> glass = optics.Uniform(optics.GLASSES["N-BK7"])
    >>> round(float(glass.at_wavelength(0.5875618).index(None)), 5)
    1.5168
    """

    n: float | Dispersion | Callable[[Any], Expression]
    parameters: Mapping[str, float] = _declared()

    def __post_init__(self) -> None:
        object.__setattr__(self, "parameters", named("parameters", self.parameters))
        if isinstance(self.n, Dispersion) and not self.parameters:
            return
        if not isinstance(self.n, Dispersion) and not callable(self.n):
            object.__setattr__(self, "n", finite("n", self.n))
        value = float(self.index(None))
        if not 0 < value < np.inf:
            raise ValueError(f"n must be a positive index, not {value}; a mirror is a surface with mirror=True")

    def parametric_index(self, position: Expression, parameters: Mapping[str, Expression]) -> Expression:  # noqa: ARG002  the same everywhere
        """n, the same everywhere."""
        if isinstance(self.n, Dispersion):
            if WAVELENGTH not in parameters:
                raise ValueError(
                    "a medium of the scene has dispersion; give wavelength=, in micrometres in vacuum, to the scene or "
                    "to the call"
                )
            return ca.SX(self.n.index(parameters[WAVELENGTH]))
        if callable(self.n):
            return _traced("n", self.n, [], parameters)
        return ca.SX(self.n)

    def at_wavelength(self, wavelength: float) -> Self:
        """The medium for light of ``wavelength``, in micrometres in vacuum; itself where it has no dispersion."""
        if isinstance(self.n, Dispersion):
            return replace(self, parameters={**self.parameters, WAVELENGTH: wavelength})
        return super().at_wavelength(wavelength)

    @property
    def is_uniform(self) -> bool:
        """True."""
        return True


@spelled
@dataclass(frozen=True, repr=False)
class Stratified(Brief, _Parametric):
    """An index that depends on the height, the last coordinate.

    Parameters
    ----------
    n : callable
        ``n(height)``, written with NumPy's or CasADi's functions, or ``n(height, p)`` where there are parameters;
        called with symbols.
    parameters : Mapping[str, float], optional
        Names with values, that ``n`` finds in its last argument: ``p.name``.
    """

    functions: ClassVar[Mapping[str, tuple[int, ...]]] = MappingProxyType({"n": (1,)})

    n: Callable[..., Expression]
    parameters: Mapping[str, float] = _declared()

    def __post_init__(self) -> None:
        object.__setattr__(self, "parameters", named("parameters", self.parameters))
        _traced("n", self.n, [ca.SX.sym("height")], self.parameters)

    def parametric_index(self, position: Expression, parameters: Mapping[str, Expression]) -> Expression:
        """n at the height of ``position``."""
        return _traced("n", self.n, [position[position.numel() - 1]], parameters)

    def through(self, position: Expression) -> tuple[ca.Function, Expression]:
        """n² as a function of the height."""
        height = ca.SX.sym("height")
        return ca.Function("squared", [height], [squared(_traced("n", self.n, [height], self.parameters))]), position[
            position.numel() - 1
        ]


@spelled
@dataclass(frozen=True, repr=False)
class Radial(Brief, _Parametric):
    """An index that depends on the distance from a centre.

    Parameters
    ----------
    n : callable
        ``n(radius)``, written with NumPy's or CasADi's functions, or ``n(radius, p)`` where there are parameters;
        called with symbols.
    center : sequence of float, optional
        2 or 3 coordinates; the origin when left out.
    parameters : Mapping[str, float], optional
        Names with values, that ``n`` finds in its last argument: ``p.name``.
    """

    functions: ClassVar[Mapping[str, tuple[int, ...]]] = MappingProxyType({"n": (1,)})

    n: Callable[..., Expression]
    center: Sequence[float] | None = None
    parameters: Mapping[str, float] = _declared()

    def __post_init__(self) -> None:
        if self.center is not None:
            object.__setattr__(self, "center", point("center", self.center))
        object.__setattr__(self, "parameters", named("parameters", self.parameters))
        _traced("n", self.n, [ca.SX.sym("radius")], self.parameters)

    @property
    def dimension(self) -> int | None:
        """That of the centre, where it is given."""
        return None if self.center is None else len(self.center)

    def middle(self, dimension: int) -> np.ndarray:
        """The centre as an array."""
        return np.zeros(dimension) if self.center is None else np.asarray(self.center, dtype=float)

    def parametric_index(self, position: Expression, parameters: Mapping[str, Expression]) -> Expression:
        """n at the distance of ``position`` from the centre; even powers of it are written without a root."""
        return _traced("n", self.n, [ca.sqrt(self._squared_distance(position))], parameters)

    def through(self, position: Expression) -> tuple[ca.Function, Expression]:
        """n² as a function of the squared distance from the centre."""
        u = ca.SX.sym("u")
        return ca.Function(
            "squared", [u], [squared(_traced("n", self.n, [ca.sqrt(u)], self.parameters))]
        ), self._squared_distance(position)

    def _squared_distance(self, position: Expression) -> Expression:
        return ca.sumsqr(position - ca.DM(self.middle(position.numel())))


@spelled
@dataclass(frozen=True, repr=False)
class Graded(Brief, _Parametric):
    """Any index.

    Raises TypeError or ValueError where ``n`` is no function, and for parameters that are no numbers.

    Parameters
    ----------
    n : callable
        ``n(x, y)`` in the plane, ``n(x, y, z)`` in space: as many arguments as points have coordinates, and ``p``
        last where there are parameters; written with NumPy's or CasADi's functions, called with symbols.
    parameters : Mapping[str, float], optional
        Names with values, that ``n`` finds in its last argument: ``p.name``.
    """

    functions: ClassVar[Mapping[str, tuple[int, ...]]] = MappingProxyType({"n": (2, 3)})

    n: Callable[..., Expression]
    parameters: Mapping[str, float] = _declared()

    def __post_init__(self) -> None:
        if not callable(self.n):
            raise TypeError(f"n must be a function of the coordinates, not {told(self.n)}; for a number take Uniform")
        object.__setattr__(self, "parameters", named("parameters", self.parameters))

    def parametric_index(self, position: Expression, parameters: Mapping[str, Expression]) -> Expression:
        """n at ``position``."""
        return _traced("n", self.n, [position[i] for i in range(position.numel())], parameters)


def squared(value: Expression) -> Expression:
    """The square of an SX scalar, without the roots among its factors, also of one that is chosen by a condition."""
    value = ca.SX(value)
    if not _has_root(value):
        return value**2
    if value.is_op(ca.OP_SQRT):
        return value.dep(0)
    if value.is_op(ca.OP_IF_ELSE_ZERO):
        return ca.if_else(value.dep(0), squared(value.dep(1)), 0)
    first = squared(value.dep(0))
    if value.is_op(ca.OP_NEG) or value.is_op(ca.OP_TWICE):
        return first if value.is_op(ca.OP_NEG) else 4 * first
    second = squared(value.dep(1))
    if value.is_op(ca.OP_ADD):  # of two of which one is zero
        return first + second
    return first * second if value.is_op(ca.OP_MUL) else first / second


def _has_root(value: Expression) -> bool:
    """Whether one of the factors of an SX scalar is a square root, or what is chosen by a condition has one."""
    if value.is_constant() or value.is_symbolic():
        return False
    if value.is_op(ca.OP_NEG) or value.is_op(ca.OP_TWICE):
        return _has_root(value.dep(0))
    if value.is_op(ca.OP_IF_ELSE_ZERO):
        return _has_root(value.dep(1))
    if value.is_op(ca.OP_MUL) or value.is_op(ca.OP_DIV) or _one_of_two(value):
        return _has_root(value.dep(0)) or _has_root(value.dep(1))
    return bool(value.is_op(ca.OP_SQRT))


def _one_of_two(value: Expression) -> bool:
    """Whether an SX scalar is what CasADi makes of ``if_else``: a sum of what is there if, and what is there unless."""
    if not (value.is_op(ca.OP_ADD) and all(value.dep(k).is_op(ca.OP_IF_ELSE_ZERO) for k in (0, 1))):
        return False
    first, second = (value.dep(k).dep(0) for k in (0, 1))
    return any(b.is_op(ca.OP_NOT) and ca.is_equal(b.dep(0), a, 4) for a, b in ((first, second), (second, first)))


def switching(medium: Medium, dimension: int) -> bool:
    """Whether n² has kinks or jumps in the position, told from its expression."""
    position = ca.SX.sym("r", dimension)
    squared_index = _squared_index(medium, position)
    return squared_index is not None and any(s.depends_on(position) for s in switches([squared_index], [position]))


def looking_up(medium: Medium, dimension: int) -> bool:
    """Whether n² is looked up in tables, told from its expression."""
    position = ca.SX.sym("r", dimension)
    squared_index = _squared_index(medium, position)
    return squared_index is not None and bool(tables(squared_index, position))


def _squared_index(medium: Medium, position: Expression) -> Expression | None:
    """n² as an SX expression; None of an index that is none, in which nothing can be read."""
    try:
        return ca.SX(medium.squared_index(position))
    except (TypeError, NotImplementedError):
        return None


def as_layers(medium: Graded, dimension: int) -> tuple[Stratified, int] | None:
    """The same index as layers, and the number of the one coordinate that it depends on; None of any other."""
    position = ca.SX.sym("r", dimension)
    axes = np.flatnonzero(ca.which_depends(ca.SX(medium.index(position)), position, 1))
    if len(axes) != 1:
        return None
    axis = int(axes[0])
    before, after = [0.0] * axis, [0.0] * (dimension - 1 - axis)
    if medium.parameters:
        return Stratified(lambda height, p: medium.n(*before, height, *after, p), medium.parameters), axis
    return Stratified(lambda height: medium.n(*before, height, *after)), axis


def as_tilted_layers(medium: Graded, dimension: int) -> tuple[Stratified, np.ndarray] | None:
    """The same index as layers, and the unit vector (d,) across them, in any direction; None of any other."""
    found = as_layers(medium, dimension)
    if found is not None:
        return found[0], np.eye(dimension)[found[1]]
    position = ca.SX.sym("r", dimension)
    tilted = over_plane(ca.SX(medium.index(position)), position)
    return None if tilted is None else (Stratified(tilted[1]), tilted[0])


def as_shells(medium: Graded, dimension: int) -> Radial | None:
    """The same index about a centre; None of any other."""
    position = ca.SX.sym("r", dimension)
    found = about_centre(ca.SX(medium.index(position)), position)
    if found is None:
        return None
    centre, function = found
    return Radial(lambda radius: function(radius**2), centre.tolist())


def _traced(
    name: str, n: Callable[..., Expression], arguments: list[Expression], parameters: Mapping[str, Expression]
) -> Expression:
    """n(*arguments), or an error that names the argument and says what is wrong with it."""
    if not callable(n):
        raise TypeError(f"{name} must be a function, not {told(n)}; for a number take Uniform")
    hint = "it is called with as many coordinates as a point has, and with p last where there are parameters"
    if not arguments:
        hint = "it is called with p alone, where there are parameters; an index that varies is written Graded(n)"
    last = [tracing.Names(dict(parameters))] if parameters else []
    try:
        return tracing.trace(name, n, [*arguments, *last], ca.SX, hint)
    except tracing.NotSymbolic as error:
        raise ValueError(f"{error}; a measured profile is given as Tabulated") from error


@dataclass(frozen=True)
class Field:
    """n² of a medium and its derivatives, evaluated on arrays of points.

    Parameters
    ----------
    medium : Medium
    dimension : int
        2 or 3.
    numbers : Expression
        Symbols (k, 1) in n²; what they are is said by :meth:`of`.
    """

    medium: Medium
    dimension: int
    numbers: InitVar[Expression | None] = None
    _call: PointEvaluator = field(init=False, repr=False, compare=False)
    _given: np.ndarray | None = field(init=False, repr=False, compare=False)

    def __post_init__(self, numbers: Expression | None) -> None:
        position = ca.SX.sym("r", self.dimension)
        given = ca.SX(0, 1) if numbers is None else numbers
        parts = self.medium.written_in_parts(position) if numbers is None else None
        given, squared, index = parts or (given, self.medium.squared_index(position), self.medium.index(position))
        gradient = ca.gradient(squared, position)
        results = [squared, gradient, ca.jacobian(gradient, position), ca.SX(index)]
        function = ca.Function("field", [position, given], [ca.densify(result) for result in results])
        object.__setattr__(self, "_call", PointEvaluator(function))
        object.__setattr__(self, "_given", None if parts else np.zeros((1, given.numel())))

    def of(self, numbers: np.ndarray) -> Field:
        """The field for other ``numbers`` (k,); nothing is compiled for it."""
        other = copy(self)
        object.__setattr__(other, "_given", numbers[None, :])
        return other

    def __call__(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """n² (m,), its gradient (m, d) and its Hessian matrix (m, d, d) at points (m, d)."""
        table, d = self._table(points), self.dimension
        return table[:, 0], table[:, 1 : 1 + d], table[:, 1 + d : -1].reshape(-1, d, d)

    def index(self, points: np.ndarray) -> np.ndarray:
        """n (m,) at points (m, d); not a number where it is not real."""
        return self._table(points)[:, -1]

    def _table(self, points: np.ndarray) -> np.ndarray:
        given = self.medium.numbers_of_parts(points) if self._given is None else self._given
        return self._call(len(points), points, given)
