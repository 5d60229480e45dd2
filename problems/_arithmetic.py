"""Elementary functions of doubles, of arrays of them, and of mpmath's numbers: a closed form is written once for all.

A form is a function of ``number``, which takes the doubles of the problem's statement into the arithmetic it is
evaluated in: ``float``, or mpmath's ``mpf`` of as many digits as are wanted. From there on the kind of its arguments
decides what a function does.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np


def context(*values: Any) -> Any:
    """Mpmath's context of the first of the values that has one; None for doubles."""
    return next((v.context for v in values if hasattr(v, "context")), None)


def _either(ours: str, theirs: str = "") -> Callable[..., Any]:
    """NumPy's function ``ours``, or mpmath's, called ``theirs`` where it is called otherwise."""

    def function(*arguments: Any) -> Any:
        digits = context(*arguments)
        return getattr(np, ours)(*arguments) if digits is None else getattr(digits, theirs or ours)(*arguments)

    return function


sqrt, exp, log, expm1 = _either("sqrt"), _either("exp"), _either("log"), _either("expm1")
log1p, cbrt, hypot = _either("log1p"), _either("cbrt"), _either("hypot")
sin, cos, tan = _either("sin"), _either("cos"), _either("tan")
asin, acos, atan = _either("arcsin", "asin"), _either("arccos", "acos"), _either("arctan", "atan")
atan2 = _either("arctan2", "atan2")
sinh, cosh, tanh = _either("sinh"), _either("cosh"), _either("tanh")
asinh, atanh = _either("arcsinh", "asinh"), _either("arctanh", "atanh")


def pi(like: Any) -> Any:
    """Pi in the arithmetic of a number."""
    return math.pi if context(like) is None else +context(like).pi


def scalar(x: Any) -> Any:
    """One number: a float, or mpmath's as it is."""
    return float(x) if context(x) is None else x


def numbers(x: Any) -> Any:
    """What a curve is asked at: an array of doubles, or one of mpmath's numbers as it is."""
    return np.asarray(x, dtype=float) if context(x) is None else x


def least(x: Any, y: Any) -> Any:
    """The lesser of two, one by one."""
    return np.minimum(x, y) if context(x, y) is None else min(x, y)


def greatest(x: Any, y: Any) -> Any:
    """The greater of two, one by one."""
    return np.maximum(x, y) if context(x, y) is None else max(x, y)


def where(condition: Any, yes: Any, no: Any) -> Any:
    """One of two, one by one; both are evaluated."""
    return np.where(condition, yes, no) if context(yes, no) is None else (yes if condition else no)
