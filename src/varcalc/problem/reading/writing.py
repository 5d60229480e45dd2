"""Sums as text and as LaTeX."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from varcalc.axes import latex_name
from varcalc.problem.reading.sums import LARGEST_DENOMINATOR, SAME_NUMBER, Atom, Monomial, Sum, monomial, times

LARGEST_WHOLE = 1e15
"""Of numbers that are written with all their digits."""


@dataclass(frozen=True)
class Style:
    """How signs, fractions and roots are written."""

    name: Callable[[str], str]
    number: Callable[[float], str]
    fraction: Callable[[str, str], str]
    root: Callable[[str], str]
    raised: Callable[[str, str], str]
    function: Callable[[str, list[str]], str]
    bracket: Callable[[str], str]
    bare_fraction: bool


def _text_number(value: float) -> str:
    return f"{value:.12g}"


def _latex_number(value: float) -> str:
    r"""A number, its power of ten written out.

    >>> print(_latex_number(7.2921159e-05), _latex_number(1e20), _latex_number(0.3))
    7.2921159 \cdot 10^{-5} 10^{20} 0.3
    """
    if math.isinf(value):
        return r"\infty"
    digits, _, power = _text_number(value).partition("e")
    if not power:
        return digits
    return ("" if digits == "1" else rf"{digits} \cdot ") + f"10^{{{int(power)}}}"


def _text_fraction(above: str, below: str) -> str:
    return f"{above}/{below}"


LATEX_FUNCTIONS = {
    "sin": r"\sin", "cos": r"\cos", "tan": r"\tan", "exp": r"\exp", "log": r"\ln", "sinh": r"\sinh", "cosh": r"\cosh",
    "tanh": r"\tanh", "asin": r"\arcsin", "acos": r"\arccos", "atan": r"\arctan",
}  # fmt: skip


RELATIONS = {"lt": ("<", "<"), "le": ("<=", r"\leq"), "eq": ("==", "="), "ne": ("!=", r"\neq"),
             "and": ("and", r"\wedge"), "or": ("or", r"\vee")}  # fmt: skip
"""What stands between two operands, as text and as LaTeX."""
TABLE = "table"
"""What a function is called that CasADi knows no name of."""


def _text_function(name: str, arguments: list[str]) -> str:
    if name in RELATIONS:
        return f" {RELATIONS[name][0]} ".join(arguments)
    known = {"fabs": "abs", "if_else_zero": "if", "call": TABLE}
    return f"{known.get(name, name)}({', '.join(arguments)})"


def _latex_function(name: str, arguments: list[str]) -> str:
    if name in RELATIONS:
        return f" {RELATIONS[name][1]} ".join(arguments)
    inside = ", ".join(arguments)
    if name == "fabs":
        return rf"\left|{inside}\right|"
    if name == "not":
        return rf"\neg\left({inside}\right)"
    if name == "if_else_zero":  # Iverson's bracket: 1 where it is true, 0 elsewhere
        condition, value = arguments
        return rf"\left[{condition}\right]" + ("" if value == "1" else rf" \left({value}\right)")
    name = TABLE if name == "call" else name
    escaped = name.replace("_", r"\_")
    return LATEX_FUNCTIONS.get(name, rf"\operatorname{{{escaped}}}") + rf"\left({inside}\right)"


TEXT = Style(
    name=lambda name: name,
    number=_text_number,
    fraction=_text_fraction,
    root=lambda inside: f"sqrt({inside})",
    raised=lambda base, exponent: f"{base}^{exponent}" if re.fullmatch(r"\d+", exponent) else f"{base}^({exponent})",
    function=_text_function,
    bracket=lambda inside: f"({inside})",
    bare_fraction=False,
)
LATEX = Style(
    name=latex_name,
    number=_latex_number,
    fraction=lambda above, below: rf"\frac{{{above}}}{{{below}}}",
    root=lambda inside: rf"\sqrt{{{inside}}}",
    raised=lambda base, exponent: f"{base}^{{{exponent}}}",
    function=_latex_function,
    bracket=lambda inside: rf"\left({inside}\right)",
    bare_fraction=True,
)


def _fraction(value: float) -> Fraction | None:
    if not abs(value) < LARGEST_WHOLE:
        return None
    nice = Fraction(value).limit_denominator(LARGEST_DENOMINATOR)
    return nice if nice and abs(float(nice) - value) <= SAME_NUMBER * abs(value) else None


def write(total: Sum, style: Style) -> str:
    """A sum in a style."""
    if not total.terms:
        return "0"
    # 1 - y rather than -y + 1
    first = next((k for k, (_, c) in enumerate(total.terms) if c > 0), 0)
    out = ""
    for m, c in (total.terms[first], *total.terms[:first], *total.terms[first + 1 :]):
        body = _term(abs(c), m, style)
        if not out:
            out = body if c > 0 else f"-{body}"
        else:
            out += f" + {body}" if c > 0 else f" - {body}"
    return out


def _display_order(power: tuple[Atom, Fraction]) -> tuple[Any, ...]:
    """Symbols before functions before parentheses, derivatives after what they are derivatives of."""
    a = power[0]
    return (2 if a.bracket is not None else 1 if a.arguments else 0, a.name.count("'"), a.key)


def _term(coefficient: float, m: Monomial, style: Style) -> str:
    """One product, as a fraction where it has a denominator; square roots are gathered under one sign."""
    value, square = _fraction(coefficient), Fraction(1)
    if value is None and (root := _fraction(coefficient * coefficient)) is not None:
        value, square = Fraction(1), root
    ordered = sorted(m, key=_display_order)
    half = Fraction(1, 2)
    roots = [(a, 2 * e) for a, e in ordered if abs(e) == half]
    others = [(a, e) for a, e in ordered if abs(e) != half]
    top = [_powered(a, e, style) for a, e in others if e > 0]
    bottom = [_powered(a, -e, style) for a, e in others if e < 0]
    if roots or square != 1:
        below = (bool(roots) and all(e < 0 for _, e in roots)) or (not roots and square < 1)
        under = [(a, -e) for a, e in roots] if below else roots
        inside = style.root(_inside_root(1 / square if below else square, under, style))
        (bottom if below else top).append(inside)
    if value is None:
        top.insert(0, style.number(coefficient))
    else:
        top = ([str(value.numerator)] if value.numerator != 1 else []) + top
        bottom = ([str(value.denominator)] if value.denominator != 1 else []) + bottom
    return _quotient(top, bottom, style)


def _inside_root(square: Fraction, under: list[tuple[Atom, Fraction]], style: Style) -> str:
    only = under[0][0].bracket if len(under) == 1 and under[0][1] > 0 and square == 1 else None
    if only is not None:
        return write(only, style)
    flat = monomial(dict(under))
    for a, e in under:  # parentheses around a product are not needed under a root
        inner = a.bracket
        if inner is not None and len(inner.terms) == 1 and inner.terms[0][1] == 1.0:
            rest = monomial({b: f for b, f in flat if b != a})
            flat = times(rest, monomial({b: f * e for b, f in inner.terms[0][0]}))
    return _term(float(square), flat, style)


def _quotient(top: list[str], bottom: list[str], style: Style) -> str:
    numerator = " ".join(top) or "1"
    if not bottom:
        return numerator
    denominator = " ".join(bottom)
    if style.bare_fraction:
        return style.fraction(_stripped(top, style) or "1", _stripped(bottom, style))
    return style.fraction(numerator, denominator if len(bottom) == 1 else style.bracket(denominator))


def _stripped(parts: list[str], style: Style) -> str:
    """The product of parts, without parentheses around a single one."""
    if len(parts) != 1:
        return " ".join(parts)
    left, right = style.bracket("\0").split("\0")
    only = parts[0]
    inner = only[len(left) : -len(right)]
    alone = only.startswith(left) and only.endswith(right) and left not in inner and right not in inner
    return inner if alone else only


def _powered(a: Atom, e: Fraction, style: Style) -> str:
    inner = a.bracket
    if inner is not None:
        base = style.bracket(write(inner, style))
    elif a.arguments:
        base = style.function(a.name, [write(s, style) for s in a.arguments])
    else:
        base = style.name(a.name)
    return base if e == 1 else style.raised(base, str(e))
