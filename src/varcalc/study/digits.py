"""Closed forms evaluated to any number of digits, with mpmath (``pip install 'varcalc[digits]'``)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from varcalc.extensions import optional

GUARD = 12
"""Digits that are carried beyond those wanted, at first; doubled until two evaluations agree."""
ATTEMPTS = 6
"""Times that they are doubled."""

ClosedForm = Callable[[Callable[[float], Any]], tuple[Any, Callable[[Any], Any] | None]]
"""Value and curve in the arithmetic that the function given takes doubles into."""


@dataclass(frozen=True)
class ExactDigits:
    """A closed form to ``digits`` digits: its ``value``, and :meth:`y` along the curve, as mpmath's numbers.

    It is that of the problem as stated in doubles: gravity is the double nearest 9.81 (a whole period is 2 pi itself).
    ``has_curve`` tells whether the curve is known. Numbers are good to so many digits relative to max(1, abs(number)):
    two evaluations, of different precision, agree to them. As text it is the value with its digits.
    """

    value: Any
    digits: int
    has_curve: bool
    form: ClosedForm = field(repr=False, compare=False)

    def __str__(self) -> str:
        from mpmath import nstr

        return nstr(self.value, self.digits)

    def y(self, x: Any) -> Any:
        """The curve at one abscissa (t of a Curve), a number or its digits as text; a tuple for several functions.

        Raises ValueError where the curve is not known.
        """
        if not self.has_curve:
            raise ValueError("the closed form is one of the value alone")

        def at(number: Callable[[Any], Any], curve: Callable[[Any], Any]) -> Any:
            return curve(number(x))

        return _settled(lambda digits: at(*_evaluated(self.form, digits)[::2]), self.digits)


def to_digits(form: ClosedForm, digits: int) -> ExactDigits:
    """A closed form to so many digits; ArithmeticError where evaluations do not come to agree.

    Raises ModuleNotFoundError without mpmath.
    """
    optional("mpmath", "digits", "closed forms to many digits")
    value = _settled(lambda working: _evaluated(form, working)[1], digits)
    return ExactDigits(value, digits, _evaluated(form, digits + GUARD)[2] is not None, form)


@lru_cache(maxsize=16)
def _evaluated(form: ClosedForm, digits: int) -> tuple[Callable[[Any], Any], Any, Any]:
    """What takes numbers to so many digits, the value and the curve there."""
    from mpmath.ctx_mp import MPContext

    context = MPContext()  # of its own, so that nobody else's precision is touched
    context.dps = digits
    value, curve = form(context.mpf)
    return context.mpf, context.mpf(value), curve


def _settled(evaluate: Callable[[int], Any], digits: int) -> Any:
    """What is evaluated with more and more digits, once two results agree to those wanted."""
    from mpmath import mp

    guard = GUARD
    last = _plain(evaluate(digits + guard))
    for _ in range(ATTEMPTS):
        guard *= 2
        found = _plain(evaluate(digits + guard))
        with mp.workdps(digits + guard):
            if all(abs(a - b) <= mp.mpf(10) ** -digits * max(1, abs(b)) for a, b in zip(last, found, strict=True)):
                return found[0] if len(found) == 1 else found
        last = found
    raise ArithmeticError(f"the closed form does not settle to {digits} digits")


def _plain(found: Any) -> tuple[Any, ...]:
    """One number or several as mpmath's ordinary numbers, with all their digits."""
    from mpmath import mp, mpf

    several = found if hasattr(found, "__len__") else [found]
    return tuple(mp.make_mpf(v._mpf_) if hasattr(v, "_mpf_") else mpf(float(v)) for v in several)
