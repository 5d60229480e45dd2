"""Calling a person's functions once, with symbols, and checking what comes back."""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable, Sequence
from types import CodeType, FunctionType
from typing import Any

import casadi as ca

Expression = Any
"""A CasADi SX or MX expression."""


class Names:
    """The ``p`` handed to a Lagrangian: one attribute for each parameter or unknown."""

    def __init__(self, symbols: dict[str, Expression]) -> None:
        self.__dict__.update(symbols)

    def __getattr__(self, name: str) -> Expression:
        known = ", ".join(sorted(self.__dict__)) or "none"
        raise ValueError(f"p.{name} is used but not declared; give it in parameters= or unknowns= (declared: {known})")


LAST = "p comes last, and only when there are parameters or unknowns"
"""What most often makes a function's arguments too many or too few."""
OUT_OF_RANGE = "out of bounds"
"""How CasADi says that an index goes beyond the entries of a column."""
NOT_ITERABLE = "not iterable by design"
"""How CasADi refuses ``for v in y`` and ``a, b = y``."""


class NotSymbolic(Exception):
    """A function could not be evaluated with SX symbols (interpolated data needs MX)."""


class TracedFunction:
    """What a user's function gave, to be called in its place where the function itself cannot go: another process.

    ``function`` takes the columns the user's function was called with and, after them, a column for each group of
    ``names``: numbers that are attributes of the last argument, where there are any.
    """

    def __init__(self, function: ca.Function, names: tuple[tuple[str, ...], ...] = ()) -> None:
        self.function, self.names = function, names

    def __call__(self, *arguments: Expression) -> Expression:
        """The expression, of other arguments."""
        places, p = (arguments[:-1], arguments[-1]) if any(self.names) else (arguments, None)
        if any(isinstance(a, ca.SX) for a in places) and not self.function.is_a("SXFunction"):
            raise NotSymbolic("a function that was traced with MX symbols cannot be called with SX")
        columns = [ca.vertcat(*(getattr(p, name) for name in group)) for group in self.names]
        return self.function.call([*places, *columns], True, False)[0]

    def __reduce__(self) -> tuple[Any, ...]:
        return _read_back, (self.function.serialize(), self.names)


def _read_back(serialized: str, names: tuple[tuple[str, ...], ...]) -> TracedFunction:
    return TracedFunction(ca.Function.deserialize(serialized), names)


def check_arity(name: str, function: Callable[..., Any], count: int, hint: str = "") -> None:
    """TypeError naming ``name`` where ``function`` cannot be called with ``count`` arguments.

    ``hint`` says what the arguments are. What cannot be asked for its signature is believed.
    """
    if not callable(function):
        raise TypeError(f"{name} must be a function, not {function!r}")
    if isinstance(function, FunctionType) and _takes(function.__code__, count):
        return
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):  # builtins and compiled callables do not tell
        return
    try:
        signature.bind(*range(count))
    except TypeError:
        number = "1 argument" if count == 1 else f"{count} arguments"
        raise TypeError(f"{name} must accept {number} here, but its signature is {signature}; {hint or LAST}") from None


def _takes(code: CodeType, count: int) -> bool:
    """Whether a function of this code is one of ``count`` plain arguments, which needs no further look."""
    return code.co_argcount == count and not (code.co_kwonlyargcount or code.co_flags & inspect.CO_VARARGS)


def trace(
    name: str, function: Callable[..., Any], arguments: Sequence[Expression], kind: type, hint: str = ""
) -> Expression:
    """The scalar expression ``function(*arguments)``.

    NumPy functions work as CasADi's do; CasADi's notice about them is kept
    quiet inside this call only. Raises TypeError or ValueError naming
    ``name`` when the function cannot be called so or does not return a scalar;
    ``hint`` says what its arguments are.
    """
    check_arity(name, function, len(arguments), hint)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=r"\s*casadi: a numpy function", category=FutureWarning)
        try:
            result = function(*arguments)
        except (RuntimeError, NotImplementedError) as error:
            if OUT_OF_RANGE in str(error).lower():
                raise ValueError(_out_of_range(name, arguments)) from error
            if kind is ca.SX:
                raise NotSymbolic(str(error)) from error
            raise ValueError(
                f"{name} could not be evaluated with symbols: {error}; write comparisons with "
                "ca.if_else, ca.fmin and ca.fmax instead of if, min and max"
            ) from error
        except TypeError as error:
            if NOT_ITERABLE not in str(error):
                raise
            raise TypeError(
                f"{name} unpacks or loops over a column of symbols, which CasADi does not allow: "
                "take its components by index, y[0], y[1], or use ca.sumsqr and ca.dot"
            ) from error
    return scalar(name, result, kind)


def _out_of_range(name: str, arguments: Sequence[Expression]) -> str:
    columns = [a.numel() for a in arguments if isinstance(a, ca.SX | ca.MX)]
    count = max(columns, default=1)
    functions = "one unknown function, y[0]" if count == 1 else f"{count} unknown functions, y[0] to y[{count - 1}]"
    return (
        f"{name} asks for a component that is not there: the ends make {functions} (and so for the slopes); "
        "give the ends as many components as the formula needs"
    )


def scalar(name: str, result: Any, kind: type) -> Expression:
    """``result`` as a scalar expression, or an error that says what it was instead."""
    try:
        expression = result if isinstance(result, kind) else kind(result)
    except (NotImplementedError, TypeError):
        raise TypeError(f"{name} must return a CasADi expression or a number, not {result!r}") from None
    if "nan" in str(expression):
        raise TypeError(
            f"{name} holds a constant that is not a number: Python's math functions do not take symbols; "
            "write it with NumPy's or CasADi's"
        )
    if expression.shape != (1, 1):
        raise ValueError(
            f"{name} must return a scalar, but its result has shape {expression.shape}; "
            "use ca.dot or ca.sumsqr for products of vectors"
        )
    return ca.densify(expression) if expression.nnz() == 0 else expression
