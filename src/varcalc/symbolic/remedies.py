"""How CasADi and Python complain of a formula, and what to write instead."""

from __future__ import annotations

from collections.abc import Sequence
from decimal import Decimal
from numbers import Rational
from types import ModuleType
from typing import Any

import casadi as ca

from varcalc.spelling import near
from varcalc.symbolic.names import Misused

BROKEN = (
    RuntimeError, TypeError, ValueError, ArithmeticError, AttributeError, LookupError, NameError, AssertionError,
)  # fmt: skip
"""What a person's function raises when it is called with symbols (CasADi raises RuntimeError)."""

LOOPED = (
    "unpacks or loops over a column of symbols, which CasADi does not allow: take its components by index, [0] and "
    "[1], or use ca.sumsqr and ca.dot"
)

MOST_TOLD = 200
"""Characters of what a function returned that a message repeats."""

REMEDIES = (
    ("Names", "p holds all parameters as its attributes and is no number itself; write p.<name>"),
    *((f"{kind}'", f"CasADi takes no {kind}; write float(...) around it") for kind in ("Fraction", "Decimal", "mpf")),
    ("create mpf from", "mpmath's functions take no symbols; use CasADi's, as ca.sqrt"),
    ("'complex'", "a functional is real; write real and imaginary parts as functions of their own"),
    ("has no len()", "y.numel() is the number of its components, which the ends say"),
    ("as an integer", "a symbol is no whole number; loop over numbers, and take components by index, y[0]"),
    ("truth value", ("a symbol is neither true nor false; write comparisons with ca.if_else, ca.logic_and, ca.fmin and "
     "ca.fmax instead of if, and, min and max")),
    ("by design", LOOPED),
    ("incompatible dimensions", "products of columns are written ca.dot(dy, dy) or ca.sumsqr(dy)"),
    ("not callable", "y stands for its value at x and dy for the slope there; write y, not y(x)"),
    ("unsupported operand type(s) for ^", "a power is written **"),
    ("__trunc__", "a symbol is no int; leave int() out, or use ca.floor"),
    ("to_double", "a symbol is no float; leave float() and Python's math functions out, and use NumPy's or CasADi's"),
    ("setting an array element", "NumPy makes no array of symbols here; use ca.vertcat"),
    ("has no attribute 'dot'", "the product of two columns is written ca.dot(a, b)"),
    ("has no attribute 'sum'", "the sum over a column is written ca.sum1(a)"),
    ("object has no attribute", ("a column has components, y[0], y[1], and no names; CasADi's functions are called "
     "ca.sin(y), not y.sin()")),
    ("overloaded function", "CasADi's functions take symbols and numbers, as many as their documentation says"),
    ("no implementation found", "CasADi has no such function of NumPy's; write it with others"),
    ("does not support numpy", "CasADi has no such function of NumPy's; write it with others"),
)  # fmt: skip
"""Part of a complaint, and the remedy; the first that fits is told."""


def is_ratio(result: Any) -> bool:
    """Whether a function gave a real number that CasADi does not know for one, such as a Fraction."""
    return isinstance(result, Rational | Decimal) and not isinstance(result, int)


def no_expression(name: str, result: Any) -> str:
    """What is said of the function ``name`` whose ``result`` is no expression."""
    remedy = ""
    if type(result).__module__.partition(".")[0] == "sympy":
        remedy = (
            "; SymPy and CasADi do not mix: write ca.sqrt for sympy.sqrt, or make a function of a SymPy expression by "
            "sympy.lambdify((x, y, dy), expression, casadi)"
        )
    elif result is None:
        remedy = "; it may lack a return"
    elif callable(result):
        remedy = "; call that function, and return what it gives"
    elif isinstance(result, tuple | list):
        remedy = "; it is one number, whose parts are added up: there is one functional, of one function or of several"
    elif isinstance(result, complex):
        remedy = "; a functional is real"
    told = " ".join(repr(result).split())
    return f"{name} must return a CasADi expression or a number, not {told[:MOST_TOLD]}{remedy}"


class NotSymbolic(ValueError):
    """A function could not be evaluated with SX symbols (interpolated data needs MX)."""


def complaint(name: str, error: Exception, columns: Sequence[int], kind: type, last: str) -> Exception:
    """The error to raise for the function ``name`` that failed with ``error`` when it was given such columns.

    ``last`` is what its author calls its last argument; nothing where that is not known.
    """
    text = str(error)
    if "out of bounds" in text.lower():
        return ValueError(_out_of_range(name, columns))
    if isinstance(error, Misused):
        return TypeError(
            f"{name}: {text}" + (f"; its last argument, here {last}, is p" if last not in {"", "p"} else "")
        )
    if isinstance(error, ValueError):
        return ValueError(f"{name}: {text}") if type(error) is ValueError else error
    remedy = next((remedy for part, remedy in REMEDIES if part in text), "mend the function")
    first = _first_line(text)
    if remedy is LOOPED:
        return TypeError(f"{name} {LOOPED}")
    if isinstance(error, RuntimeError):
        sentence = f"{name} could not be evaluated with symbols: {first}; {remedy}"
        return NotSymbolic(sentence) if kind is ca.SX else ValueError(sentence)
    if isinstance(error, AttributeError) and error.name is not None and isinstance(error.obj, ModuleType):
        remedy = near(error.name, dir(error.obj)).removeprefix("; ") or remedy
    sentence = f"{name} failed with {type(error).__name__}: {first}; {remedy}"
    return TypeError(sentence) if isinstance(error, TypeError) else ValueError(sentence)


def _first_line(text: str) -> str:
    """What a complaint says, without the place in CasADi's sources and lists of prototypes."""
    lines = text.strip().splitlines() or ["no reason given"]
    said = lines[-1] if "Assertion" in lines[0] else lines[0]
    return said.rpartition(".cpp:")[2].partition(": ")[2].rstrip(".") if ".cpp:" in said else said.rstrip(".")


def _out_of_range(name: str, columns: Sequence[int]) -> str:
    count = max(columns, default=1)
    components = "one component, [0]" if count == 1 else f"{count} components, [0] to [{count - 1}]"
    return (
        f"{name} asks for a component that is not there: it is called with columns of {components}; give the ends "
        "as many components, or the system as many coordinates, as the formula needs"
    )
