"""What a problem demands of its curve: the ends and the constraints.

Every class here is a small frozen record that checks its own arguments; it
knows nothing of how a problem is solved.
"""

from __future__ import annotations

import keyword
import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from types import FunctionType
from typing import Any, ClassVar, cast

import casadi as ca
import numpy as np

from varcalc.showing import Brief
from varcalc.spelling import spelled


@spelled
@dataclass(frozen=True)
class Parameter:
    """A coordinate of an end that is the parameter ``name`` of its problem.

    It stands where a number does in :class:`Fixed`, :class:`Free` and :class:`At`,
    and takes the value given in ``parameters``, so that
    ``problem.with_parameters`` moves the end with nothing built anew. Raises TypeError for a name that is no text.

    >>> import casadi as ca
    >>> import varcalc as vc
    >>> line = vc.Problem(lambda x, y, dy, p: ca.sqrt(1 + dy**2), vc.Fixed(0, 0), vc.Fixed(3, vc.Parameter("height")),
    ...                   parameters={"height": 4})
    >>> [round(vc.solve(line.with_parameters({"height": h})).value, 12) for h in (0, 4)]
    [3.0, 5.0]
    """

    name: str

    def __post_init__(self) -> None:
        text("Parameter.name", self.name)


MOST_TOLD = 200
"""Characters of what was given that a message repeats."""


def told(given: Any) -> str:
    """What was given, as a message repeats it: on one line, and no more of it than can be read."""
    written = " ".join(repr(given).split())
    return written if len(written) <= MOST_TOLD else f"{written[:MOST_TOLD]}..."


def real(name: str, value: Any) -> float:
    """``value`` as the nearest float, which need not be finite; TypeError naming ``name`` for what is no number.

    Numbers are all that Python and its packages make: of NumPy, Fractions, Decimals, SymPy's and mpmath's.
    """
    if type(value) is float:
        return value
    # float() takes these, and arrays of one entry, for numbers, and none was meant as one
    several = is_vector(value) or (isinstance(value, ca.DM) and value.numel() != 1)
    if not (several or isinstance(value, _NO_NUMBERS)):
        try:
            return float(value)
        except (TypeError, ValueError):
            pass
        except OverflowError:  # whole numbers and ratios that no float holds
            return math.inf if value > 0 else -math.inf
    within = (
        "; a Parameter is a coordinate of an end; in a formula it is p.<name>" if isinstance(value, Parameter) else ""
    )
    raise TypeError(f"{name} must be a number, not {told(value)}{within}")


_NO_NUMBERS = str | bytes | bytearray | bool | np.bool_ | np.complexfloating | ca.SX | ca.MX


MOST_COUNTED = 2**31 - 1
"""What a count may be at most: more of anything no memory holds."""

FARTHEST_OUT = 1e150
"""The largest coordinate that is taken."""


def finite(name: str, value: Any) -> float:
    """``value`` as a float; TypeError or ValueError naming ``name`` otherwise."""
    number = real(name, value)
    if not math.isfinite(number):
        raise ValueError(f"{name} must be finite, not {told(value)}")
    return number


def _example(given: Any) -> str:
    """The name in an example of what names numbers: the first of those that were ``given``, where they are names."""
    first = next(iter(given), None) if isinstance(given, Collection) else None
    return first if isinstance(first, str) and first.isidentifier() else "g"


def named(name: str, values: Mapping[str, float] | None) -> dict[str, float]:
    """Parameters as people give them, copied; TypeError or ValueError naming ``name`` for what are none."""
    if values is None:
        return {}
    if not isinstance(values, Mapping):
        raise TypeError(
            f"{name} must be a mapping from names to numbers, not {values!r}; write {{{_example(values)!r}: 9.81}}"
        )
    for key in values:
        if not (isinstance(key, str) and key.isidentifier()) or keyword.iskeyword(key) or key.startswith("__"):
            raise ValueError(f"{name}: {key!r} is no name that p.<name> could have; choose another")
    return {key: finite(f"{name}[{key!r}]", value) for key, value in values.items()}


def positive(name: str, value: Any) -> float:
    """``value`` as a float, which must be more than 0; TypeError or ValueError naming ``name`` otherwise."""
    number = finite(name, value)
    if not number > 0:
        raise ValueError(f"{name} must be a positive number, not {told(value)}")
    return number


def reals(name: str, given: Any) -> np.ndarray:
    """``given`` as an array of floats, which need not be finite; TypeError naming ``name`` otherwise."""
    try:
        array = np.array(given)
        kind = array.dtype.kind
        if kind in "fiu":
            return array.astype(float)
        if kind == "O":  # Fractions, Decimals, and what is no number
            return np.array([real(name, v) for v in array.ravel().tolist()]).reshape(array.shape)
    except (TypeError, ValueError, RuntimeError):  # ValueError: rows of different lengths
        pass
    raise TypeError(f"{name} must be made of numbers, not {told(given)}")


def numbers(name: str, given: Any) -> np.ndarray:
    """``given`` as an array of finite floats; TypeError or ValueError naming ``name`` otherwise."""
    array = reals(name, given)
    if not np.all(np.isfinite(array)):
        raise ValueError(f"{name} must be finite, not {told(given)}")
    return array


def coordinate(name: str, value: Any) -> float | Parameter:
    """``value`` as a float, or the :class:`Parameter` it is; TypeError or ValueError naming ``name`` otherwise."""
    return value if isinstance(value, Parameter) else _within_reach(name, value)


def _within_reach(name: str, value: Any) -> float:
    """``value`` as a float whose square is one, as lengths and energies are made of squares."""
    number = finite(name, value)
    if abs(number) > FARTHEST_OUT:
        raise ValueError(f"{name} is {told(value)}, and squares of what is so large overflow; use a larger unit")
    return number


def whole(name: str, value: Any, least: int = 1) -> int:
    """``value`` as an int; TypeError or ValueError naming ``name`` where it is none, or less than ``least``."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise TypeError(f"{name} must be a whole number, not {told(value)}")
    if value < least:
        raise ValueError(f"{name} must be at least {least}, not {value}")
    if value > MOST_COUNTED:
        raise ValueError(f"{name} must be at most {MOST_COUNTED}, not {told(value)}")
    return int(value)


def truth(name: str, value: Any) -> bool:
    """``value`` as a bool; TypeError naming ``name`` where it is anything else, such as the text ``"no"``."""
    if not isinstance(value, bool | np.bool_):
        raise TypeError(f"{name} must be True or False, not {told(value)}")
    return bool(value)


def text(name: str, value: Any) -> str:
    """``value``, which must be a text; TypeError naming ``name`` where it is none."""
    if not isinstance(value, str):
        raise TypeError(f"{name} must be a text, not {told(value)}")
    return value


def file(name: str, value: Any) -> Path:
    """``value``, which must be the path of a file; TypeError naming ``name`` where it is none."""
    if not isinstance(value, str | PathLike):
        raise TypeError(f"{name} must be the path of a file, not {told(value)}")
    return Path(value)


def sequence(name: str, value: Any) -> tuple[Any, ...]:
    """The entries of ``value``; TypeError naming ``name`` where it has none to go through."""
    try:
        if not isinstance(value, str | bytes | Mapping):
            return tuple(value)
    except TypeError:  # what has no entries; arrays without a dimension and symbols tell only when they are asked
        pass
    one = name.isidentifier() and not isinstance(value, FunctionType)
    raise TypeError(f"{name} must be a sequence, not {told(value)}" + (f"; write {name}=[...]" if one else ""))


def components(name: str, value: Any) -> tuple[Any, ...]:
    """``value`` as a tuple of floats, ``None`` where a component is free; a :class:`Parameter` stays what it is."""
    if type(value) in (float, int):
        return (_within_reach(name, value),)
    if isinstance(value, str):
        raise TypeError(f"{name} must be a number or a sequence of numbers, not {told(value)}")
    if not is_vector(value):
        return (None if value is None else coordinate(name, value),)
    if len(value) == 0:
        raise ValueError(f"{name} is empty; give one number for each unknown function")
    return tuple(None if v is None else coordinate(f"{name}[{i}]", v) for i, v in enumerate(value))


def is_vector(value: Any) -> bool:
    """True when ``value`` was given as a sequence, so that y is a column vector."""
    dimensions = getattr(value, "ndim", None)
    if isinstance(dimensions, int):
        return dimensions > 0
    return isinstance(value, Sequence) and not isinstance(value, str | bytes)


def as_written(given: Any) -> Any:
    """A coordinate, or several, whose whole numbers and floats are left alone; other numbers are made floats.

    Where a Fraction or one of NumPy's short floats stayed, arithmetic would go on in it.
    """
    if is_vector(given):
        return given if all(type(v) in _PLAIN for v in given) else tuple(map(as_written, given))
    if isinstance(given, np.generic | np.ndarray):
        given = given.item()
    return given if type(given) in _PLAIN else float(given)


_PLAIN = (float, int, type(None), Parameter)


def keep_as_written(condition: Any, *fields: str) -> None:
    """The numbers in the ``fields`` of a frozen condition, which have been checked, made :func:`as_written`."""
    for field in fields:
        object.__setattr__(condition, field, as_written(getattr(condition, field)))


def function(name: str, value: Any) -> None:
    """TypeError naming ``name`` where ``value`` cannot be called."""
    if not callable(value):
        raise TypeError(f"{name} must be a function, not {told(value)}")


def functions(name: str, given: Any) -> None:
    """TypeError naming ``name`` for anything but functions by name."""
    if not isinstance(given, Mapping):
        raise TypeError(f"{name} must be a mapping from names to functions, not {told(given)}")
    for key, check in given.items():
        function(f"{name}[{key!r}]", check)


def _number_of_functions(name: str, n: Any) -> None:
    if n is not None:
        whole(name, n)


class OfFunction:
    """A condition that a function of the user's states: the field that ``written`` names."""

    written: ClassVar[str]

    @property
    def function(self) -> Callable[..., Any]:
        """The function as it was given."""
        return getattr(self, self.written)

    def stated(self, function: Callable[..., Any]) -> Any:
        """The same condition, stated by another function."""
        return replace(cast("Any", self), **{self.written: function})

    def arguments(self, position: list[Any], slopes: list[Any]) -> list[Any]:  # noqa: ARG002  what others take
        """What the function is called with, before the parameters: of a place on the curve and the slopes there."""
        return position


class AnyEnd:
    """What an end is asked, in place of which kind it is; an end of one's own derives from it.

    ``fixed`` tells that components of the curve are given there, ``slides`` that it moves along phi(x, y) = 0, for
    which it has ``phi`` and a first guess ``x`` (a Curve's phi(q) = 0, and ``guess``), ``periodic`` that it is both
    ends of a periodic curve, ``of_space`` whether it is an end of a :class:`varcalc.Curve` (True), of a
    :class:`varcalc.Problem` (False), or of either (None).
    """

    fixed: ClassVar[bool] = False
    slides: ClassVar[bool] = False
    periodic: ClassVar[bool] = False
    of_space: ClassVar[bool | None] = False

    def values(self, n: int) -> np.ndarray:
        """The ``n`` unknown functions at the end, NaN where one is free."""
        return np.full(n, np.nan)

    def slopes(self, n: int) -> np.ndarray:
        """Their derivatives, NaN where one is free."""
        return np.full(n, np.nan)

    def in_unit(self, unit: float) -> Any:
        """The same end of one function, stated in y / ``unit``."""
        own: Any = self
        return OnCurve(lambda x, y: own.phi(x, unit * y), own.x) if self.slides else self

    def tells(self, label: str) -> tuple[int, bool | None] | None:  # noqa: ARG002  for messages, where there are any
        """How many functions there are and whether y is a number (None: either); None where the end does not tell."""
        n = getattr(self, "n", None)
        return None if n is None else (int(n), None)


def _numbers(name: str, given: Any) -> np.ndarray:
    if type(given) in (float, int):
        return np.array([given], dtype=float)
    return np.array([np.nan if v is None else v for v in components(name, given)], dtype=float)


@spelled
@dataclass(frozen=True, repr=False)
class Fixed(Brief, AnyEnd):
    """An end at the abscissa ``x`` with the ordinate ``y`` given.

    ``y`` is a number, or a sequence with one entry for each unknown function,
    ``None`` where that component is free (natural condition). For a
    second-order Lagrangian ``dy`` fixes the slope as well; without it the
    slope is natural. Each number may be a :class:`Parameter`.

    Raises TypeError or ValueError for what are no numbers, a ``y`` that gives no component, and a ``dy`` that has not
    as many as ``y``.
    """

    fixed = True

    x: Any
    y: Any
    dy: Any = None

    def __post_init__(self) -> None:
        coordinate("Fixed.x", self.x)
        values = components("Fixed.y", self.y)
        if all(v is None for v in values):
            raise ValueError("Fixed.y gives no component; use Free(x) for an end that is wholly free")
        if self.dy is not None and (
            len(components("Fixed.dy", self.dy)) != len(values) or is_vector(self.dy) != is_vector(self.y)
        ):
            raise ValueError("Fixed.dy must have as many components as Fixed.y")
        keep_as_written(self, "x", "y", "dy")

    def values(self, n: int) -> np.ndarray:  # noqa: ARG002
        """The components of ``y``, NaN for those that are None."""
        return _numbers("Fixed.y", self.y)

    def slopes(self, n: int) -> np.ndarray:
        """The components of ``dy``, NaN where there are none."""
        return super().slopes(n) if self.dy is None else _numbers("Fixed.dy", self.dy)

    def in_unit(self, unit: float) -> Fixed:
        """The same end, its ordinate and slope divided by ``unit``."""
        y, dy = (None if np.isnan(v[0]) else v[0] / unit for v in (self.values(1), self.slopes(1)))
        return Fixed(self.x, y, dy)

    def tells(self, label: str) -> tuple[int, bool | None]:
        """As many functions as ``y`` has components; a number is one."""
        return len(components(f"{label}.y", self.y)), not is_vector(self.y)


@spelled
@dataclass(frozen=True, repr=False)
class Free(Brief, AnyEnd):
    """An end at the abscissa ``x`` whose ordinate is free (natural condition).

    ``n`` is the number of unknown functions, needed only when the other end
    does not tell.
    """

    x: Any
    n: int | None = None

    def __post_init__(self) -> None:
        coordinate("Free.x", self.x)
        _number_of_functions("Free.n", self.n)
        keep_as_written(self, "x")


@spelled
@dataclass(frozen=True, repr=False)
class OnCurve(Brief, OfFunction, AnyEnd):
    """An end that slides on ``phi(x, y) = 0``; ``x`` is a first guess of its abscissa.

    ``n`` is the number of unknown functions (by default 1). Raises TypeError or ValueError for a ``phi`` that is no
    function, and for what are no such numbers.
    """

    slides = True
    written = "phi"

    phi: Callable[..., Any]
    x: float
    n: int | None = None

    def __post_init__(self) -> None:
        function("OnCurve.phi", self.phi)
        finite("OnCurve.x", self.x)
        _number_of_functions("OnCurve.n", self.n)
        keep_as_written(self, "x")


@spelled
@dataclass(frozen=True, repr=False)
class Periodic(Brief, AnyEnd):
    """Both ends of a periodic curve: ``y(x0) = y(x1)`` and so the slope.

    Give the same object as start and end. For a closed :class:`varcalc.Curve`
    the abscissae are left out. ``n`` is the number of unknown functions
    (by default 1, and 2 for a closed Curve).

    Raises TypeError or ValueError where one abscissa alone is given, where they do not ascend, and for what are no
    such numbers.
    """

    periodic = True
    of_space: ClassVar[bool | None] = None

    x0: float | None = None
    x1: float | None = None
    n: int | None = None

    def __post_init__(self) -> None:
        if (self.x0 is None) != (self.x1 is None):
            raise ValueError("Periodic needs both abscissae x0 and x1, or neither (a closed Curve)")
        if self.x0 is not None and finite("Periodic.x1", self.x1) <= finite("Periodic.x0", self.x0):
            raise ValueError(f"Periodic.x1 must lie right of Periodic.x0, not at {self.x1} and {self.x0}")
        _number_of_functions("Periodic.n", self.n)
        keep_as_written(self, "x0", "x1")


@spelled
@dataclass(frozen=True, repr=False)
class At(Brief, AnyEnd):
    """An end of a :class:`varcalc.Curve` at the point ``q`` (``None``: that component is free).

    Raises TypeError or ValueError where ``q`` is no sequence of numbers, :class:`Parameter` and None.
    """

    fixed = True
    of_space: ClassVar[bool | None] = True

    q: Sequence[float | Parameter | None]

    def __post_init__(self) -> None:
        if not is_vector(self.q):
            raise TypeError(f"At.q must be a sequence of coordinates, not {told(self.q)}")
        components("At.q", self.q)
        keep_as_written(self, "q")

    def values(self, n: int) -> np.ndarray:  # noqa: ARG002
        """The coordinates ``q``, NaN for those that are None."""
        return _numbers("At.q", self.q)

    def tells(self, label: str) -> tuple[int, bool | None]:  # noqa: ARG002
        """As many coordinates as ``q`` has."""
        return len(self.q), False


@spelled
@dataclass(frozen=True, repr=False)
class OnSurface(Brief, OfFunction, AnyEnd):
    """An end of a :class:`varcalc.Curve` that slides on ``phi(q) = 0``; ``guess`` is a point near it.

    Raises TypeError or ValueError for a ``phi`` that is no function, and a ``guess`` that is no sequence of numbers.
    """

    slides = True
    of_space: ClassVar[bool | None] = True
    written = "phi"

    phi: Callable[..., Any]
    guess: Sequence[float]

    def __post_init__(self) -> None:
        function("OnSurface.phi", self.phi)
        if not is_vector(self.guess) or any(
            v is None or isinstance(v, Parameter) for v in components("OnSurface.guess", self.guess)
        ):
            raise TypeError("OnSurface.guess must be a point: one number for each coordinate")
        keep_as_written(self, "guess")

    def tells(self, label: str) -> tuple[int, bool | None]:  # noqa: ARG002
        """As many coordinates as ``guess`` has."""
        return len(self.guess), False


def _level(name: str, value: Any) -> float | None:
    return None if value is None else finite(name, value)


def _between(lower: float | None, upper: float | None) -> tuple[float, float]:
    """The numbers from ``lower`` to ``upper``, infinite where there is no bound."""
    return -math.inf if lower is None else float(lower), math.inf if upper is None else float(upper)


def _check_between(owner: str, lower: float | None, upper: float | None) -> None:
    if lower is None and upper is None:
        raise ValueError(f"{owner} bounds nothing; give lower=, upper= or both")
    if lower is not None and upper is not None and lower > upper:
        raise ValueError(f"{owner}: lower ({lower}) must not exceed upper ({upper})")


@spelled
@dataclass(frozen=True, repr=False)
class Isoperimetric(Brief, OfFunction):
    """The integral of ``g`` (called as the Lagrangian is) equals ``value``, or lies between levels.

    Raises TypeError or ValueError for a ``g`` that is no function, levels that are no numbers or leave no room between
    them, and unless either a value or one level at least is given.
    """

    written = "g"

    g: Callable[..., Any]
    value: float | None = None
    lower: float | None = None
    upper: float | None = None

    def __post_init__(self) -> None:
        function("Isoperimetric.g", self.g)
        levels = [_level(f"Isoperimetric.{k}", getattr(self, k)) for k in ("value", "lower", "upper")]
        if levels[0] is None:
            if levels[1] is None and levels[2] is None:
                raise ValueError("Isoperimetric bounds nothing; give lower=, upper= or both, or value=")
            _check_between("Isoperimetric", levels[1], levels[2])
        elif levels[1] is not None or levels[2] is not None:
            raise ValueError("Isoperimetric: give either value, or lower and upper, not both")
        keep_as_written(self, "value", "lower", "upper")

    def arguments(self, position: list[Any], slopes: list[Any]) -> list[Any]:
        """The place and all slopes, as the Lagrangian has them."""
        return [*position, *slopes]

    @property
    def equality(self) -> bool:
        """True when the integral is prescribed exactly."""
        return self.value is not None or self.lower == self.upper

    @property
    def interval(self) -> tuple[float, float]:
        """Lowest and highest admissible level."""
        return _between(self.lower, self.upper) if self.value is None else _between(self.value, self.value)


@spelled
@dataclass(frozen=True, repr=False)
class Holonomic(Brief, OfFunction):
    """``phi(x, y[, p]) = 0`` all along the curve (``phi(q[, p])`` for a Curve)."""

    written = "phi"

    phi: Callable[..., Any]

    def __post_init__(self) -> None:
        function("Holonomic.phi", self.phi)


@spelled
@dataclass(frozen=True, repr=False)
class Bound(Brief, OfFunction):
    """``lower <= h(x, y, dy[, p]) <= upper`` all along the curve: obstacles, bounds on the slope.

    Raises TypeError or ValueError for an ``h`` that is no function, and levels that are no numbers or leave no room
    between them.
    """

    written = "h"

    h: Callable[..., Any]
    lower: float | None = None
    upper: float | None = None

    def __post_init__(self) -> None:
        function("Bound.h", self.h)
        _check_between("Bound", _level("Bound.lower", self.lower), _level("Bound.upper", self.upper))
        keep_as_written(self, "lower", "upper")

    def arguments(self, position: list[Any], slopes: list[Any]) -> list[Any]:
        """The place and the first slope."""
        return [*position, slopes[0]]

    @property
    def interval(self) -> tuple[float, float]:
        """Lowest and highest admissible value."""
        return _between(self.lower, self.upper)


@spelled
@dataclass(frozen=True, repr=False)
class Through(Brief):
    """A waypoint: ``y(x)`` has the given value. The slope may jump there (at order 2 the curvature may).

    Raises TypeError or ValueError for what are no numbers, and where a component is left out.
    """

    x: float
    y: Any

    def __post_init__(self) -> None:
        finite("Through.x", self.x)
        given = components("Through.y", self.y)
        if None in given:
            raise ValueError("Through.y must give every component of the waypoint; None is for ends")
        if any(isinstance(v, Parameter) for v in given):
            raise TypeError("Through.y must be numbers; only the ends may be parameters")
        keep_as_written(self, "x", "y")

    @property
    def values(self) -> np.ndarray:
        """``y`` as an array, one entry for each unknown function."""
        return _numbers("Through.y", self.y)


def parameters_of(end: Any) -> tuple[tuple[str, str, int], ...]:
    """The parameters among the coordinates of an end: name, field and component of each."""
    found = []
    for field in ("x", "y", "dy", "q"):
        given: Any = vars(end).get(field)
        if given is None or type(given) in (float, int):
            continue
        entries: Iterable[Any] = given if is_vector(given) else (given,)
        found += [(v.name, field, i) for i, v in enumerate(entries) if isinstance(v, Parameter)]
    return tuple(found)


def placed(end: Any, values: Mapping[str, float]) -> Any:
    """The end with the ``values`` of its parameters in place of them; KeyError for one that has none."""

    def number(given: Any) -> Any:
        return values[given.name] if isinstance(given, Parameter) else given

    fields = {field for _, field, _ in parameters_of(end)}
    given = {f: getattr(end, f) for f in fields}
    return replace(end, **{f: [*map(number, v)] if is_vector(v) else number(v) for f, v in given.items()})


Constraint = Isoperimetric | Holonomic | Bound | Through
