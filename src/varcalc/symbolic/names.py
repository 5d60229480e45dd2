"""The parameters as a person's function is handed them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NoReturn

import casadi as ca

from varcalc.spelling import listed, near


class Misused(TypeError):
    """Parameters that are treated as what they are not; the message says what to write."""


class Undeclared(ValueError, AttributeError):
    """A parameter that is used but not declared; to those who only ask whether there is an attribute: there is none."""


class Names:
    """The ``p`` handed to a Lagrangian: one attribute for each parameter or unknown.

    It is no number and no mapping; what treats it as one is refused with what to write.
    """

    def __init__(self, symbols: dict[str, Any]) -> None:
        self.__dict__.update(symbols)

    # CasADi and NumPy leave an operation to what has these
    __array_priority__ = 1e6
    __array_ufunc__ = None

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        known = sorted(self.__dict__)
        suggested = near(name, known)
        remedy = suggested or "; give it in parameters= or unknowns="
        raise Undeclared(f"p.{name} is used but not declared{remedy} (declared: {', '.join(known) or 'none'})")

    def __getitem__(self, key: Any) -> NoReturn:
        if isinstance(key, str):
            getattr(self, key)  # refused where there is no such parameter
            raise Misused(f"p[{key!r}] is written p.{key}: parameters are attributes of p")
        raise Misused(f"p[{key!r}] has no meaning: parameters are attributes of p, {self._as_written()}")

    def __call__(self, *_: Any) -> NoReturn:
        """Refused: p is no function."""
        raise Misused(f"p is called like a function: parameters are attributes of p, {self._as_written()}")

    def __iter__(self) -> NoReturn:
        raise Misused(f"p is unpacked or looped over: parameters are attributes of p, {self._as_written()}")

    def _as_written(self) -> str:
        return "written " + listed([f"p.{name}" for name in sorted(self.__dict__)])

    def _no_number(self, *_: Any) -> NoReturn:
        raise Misused(
            "the last argument, p, is used as a number: it holds all parameters as its attributes, "
            f"{self._as_written()}"
        )

    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __truediv__ = __rtruediv__ = _no_number
    __pow__ = __rpow__ = __matmul__ = __rmatmul__ = __mod__ = __rmod__ = __floordiv__ = __rfloordiv__ = _no_number
    __neg__ = __pos__ = __abs__ = __float__ = __int__ = __lt__ = __le__ = __gt__ = __ge__ = __array__ = _no_number


def with_names(columns: Sequence[Any], names: Sequence[str], values: ca.SX | ca.MX) -> list[Any]:
    """``columns`` and, where there are any ``names``, the ``p`` that holds the ``values`` under them."""
    return [*columns, Names(dict(zip(names, ca.vertsplit(values), strict=True)))] if names else list(columns)
