"""Calling a person's functions once, with symbols, and checking what comes back."""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from types import CodeType, FunctionType
from typing import Any

import casadi as ca

from varcalc.symbolic.look_up import within_knots
from varcalc.symbolic.names import Names
from varcalc.symbolic.remedies import BROKEN, MOST_TOLD, NotSymbolic, complaint, is_ratio, no_expression

__all__ = ["LAST", "Expression", "Names", "NotSymbolic", "TracedFunction", "as_written", "check_arity", "trace"]

Expression = Any
"""A CasADi SX or MX expression."""

LAST = "p comes last, and only when there are parameters or unknowns"
"""What most often makes a function's arguments too many or too few."""
SLOPE_NAMES = ("d{}", "{}p", "{}dot", "{}_dot", "{}prime", "{}_prime")
"""What the derivative of an argument is called, after it."""


class TracedFunction:
    """What a user's function gave, to be called in its place where the function itself cannot go: another process.

    ``function`` takes the columns the user's function was called with and, after them, a column for each group of
    ``names``: numbers that are attributes of the last argument, where there are any. It is ``called`` what the user's
    function was.
    """

    def __init__(self, function: ca.Function, names: tuple[tuple[str, ...], ...] = (), called: str = "") -> None:
        self.function: ca.Function = function
        self.names: tuple[tuple[str, ...], ...] = names
        self.__name__: str = called or function.name()

    def __call__(self, *arguments: Expression) -> Expression:
        """The expression, of other arguments."""
        places, p = (arguments[:-1], arguments[-1]) if any(self.names) else (arguments, None)
        if any(isinstance(a, ca.SX) for a in places) and not self.function.is_a("SXFunction"):
            raise NotSymbolic("a function that was traced with MX symbols cannot be called with SX")
        columns = [ca.vertcat(*(getattr(p, name) for name in group)) for group in self.names]
        return self.function.call([*places, *columns], True, False)[0]

    def __reduce__(self) -> tuple[Any, ...]:
        return _read_back, (self.function.serialize(), self.names, self.__name__)


def _read_back(serialized: str, names: tuple[tuple[str, ...], ...], called: str = "") -> TracedFunction:
    return TracedFunction(ca.Function.deserialize(serialized), names, called)


def name_of(function: Callable[..., Any]) -> str:
    """What a function is called."""
    return getattr(function, "__name__", type(function).__name__)


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
    name: str,
    function: Callable[..., Any],
    arguments: Sequence[Expression],
    kind: type,
    hint: str = "",
    order: Sequence[str] = (),
) -> Expression:
    """The scalar expression ``function(*arguments)``.

    NumPy functions work as CasADi's do; CasADi's notice about them is kept
    quiet inside this call only. Raises TypeError or ValueError naming
    ``name`` when the function cannot be called so or does not return a scalar;
    ``hint`` says what its arguments are, ``order`` what a textbook calls them (see :func:`check_order`), ``hint`` then
    when there are more.
    """
    if order:
        names = [*order, *["p"][: len(arguments) - len(order)]]
        hint = f"it is called with ({', '.join(names)}), where {LAST}{hint}"
    check_arity(name, function, len(arguments), hint)
    check_order(name, function, order)
    return scalar(name, called(name, function, arguments, kind), kind)


@contextmanager
def as_written() -> Generator[None]:
    """CasADi leaves expressions as they are written: else it makes 0.03 x of 0.1 (0.3 x), which is rounded."""
    before = ca.GlobalOptions.getSimplificationOnTheFly()
    ca.GlobalOptions.setSimplificationOnTheFly(False)
    try:
        yield
    finally:
        ca.GlobalOptions.setSimplificationOnTheFly(before)


def called(name: str, function: Callable[..., Any], arguments: Sequence[Expression], kind: type) -> Any:
    """What a person's ``function`` returns for symbols; where it fails, a sentence that says what to write instead.

    Raises :class:`NotSymbolic` where another kind of symbols may do, TypeError or ValueError elsewhere.
    """
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=r"\s*casadi: a numpy function", category=FutureWarning)
        warnings.filterwarnings("ignore", message="The delegation of int", category=DeprecationWarning)
        try:
            # copies: y[0] = 0 in a person's function changes what it is given, and others are handed the same symbols
            return function(*(type(a)(a) if isinstance(a, ca.SX | ca.MX) else a for a in arguments))
        except NotSymbolic:
            raise
        except BROKEN as error:
            columns = [a.numel() for a in arguments if isinstance(a, kind)]
            raise complaint(name, error, columns, kind, _last_name(function)) from error


def _last_name(function: Callable[..., Any]) -> str:
    """What the last argument of a plain function is called."""
    return "".join(_given(function)[-1:]) if isinstance(function, FunctionType) else ""


def _given(function: FunctionType) -> tuple[str, ...]:
    return function.__code__.co_varnames[: function.__code__.co_argcount]


def check_order(name: str, function: Callable[..., Any], order: Sequence[str]) -> None:
    """ValueError where the function's arguments are, by their names, those it is called with, but in another order.

    ``order`` is how a textbook calls them. Arguments named otherwise are in any order; but a slope, whatever its
    function is called, comes after it, and both after the abscissa, which the time is where there is one.
    """
    if not isinstance(function, FunctionType) or not order:
        return
    given = _given(function)
    first = given[: len(order)]
    mixed = first != tuple(order) and sorted(first) == sorted(order)
    if not mixed and "dy" in order:
        pairs = [(k, given.index(s)) for k, a in enumerate(given) for f in SLOPE_NAMES if (s := f.format(a)) in given]
        mixed = any(k == 0 or after != k + 1 for k, after in pairs) or "t" in first[1:]
    if mixed:
        raise ValueError(
            f"{name} is called with ({', '.join(order)}), but its arguments are named ({', '.join(given)}): "
            "put them in that order, or rename them"
        )


def column(name: str, result: Any, size: int, what: str) -> Expression:
    """``result`` as a column of ``size`` SX expressions, or an error that says ``what`` they are and what it was."""
    try:
        found = ca.vertcat(*result) if isinstance(result, list | tuple) else ca.SX(result)
    except (NotImplementedError, TypeError):
        said = " ".join(repr(result).split())[:MOST_TOLD]
        raise TypeError(f"{name} must return a list of expressions or numbers, not {said}") from None
    if found.numel() != size:
        raise ValueError(f"{name} must return {size} numbers, {what}, not {found.numel()}")
    return ca.densify(ca.reshape(found, size, 1))


def scalar(name: str, result: Any, kind: type) -> Expression:
    """``result`` as a scalar expression, or an error that says what it was instead."""
    try:
        expression = result if isinstance(result, kind) else kind(float(result) if is_ratio(result) else result)
    except (NotImplementedError, TypeError):
        raise TypeError(no_expression(name, result)) from None
    written = str(expression)
    if "nan" in written:
        raise TypeError(
            f"{name} holds a constant that is not a number: Python's math functions and SciPy's interpolants do not "
            "take symbols; write it with NumPy's or CasADi's, tables by ca.interpolant"
        )
    if expression.shape != (1, 1):
        raise ValueError(
            f"{name} must return a scalar, but its result has shape {expression.shape}; "
            "use ca.dot or ca.sumsqr for products of vectors"
        )
    if isinstance(expression, ca.SX) and "{" in written:  # CasADi's mark of the result of a call
        expression = within_knots(expression)
    return ca.densify(expression) if expression.nnz() == 0 else expression
