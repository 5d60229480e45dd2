"""Functions of x on a box as Taylor forms, and at the ends of the interval, where they may vanish exactly."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

from varcalc.certificates.balls import Around, Ball, Box, Series, coefficient, enclosed, flint, integral

TAYLOR_ORDER = 16
"""Order of the Taylor forms."""


class Values:
    """A function of a box as a Taylor form: series about its middle and about all of its points.

    Next to an end of the interval also about that ``end``, where coefficients may vanish exactly; ``inward`` is the
    sign of t there.
    """

    def __init__(self, middle: Series, whole: Series, end: Series = None, inward: int = 1) -> None:
        self.middle, self.whole, self.end, self.inward = middle, whole, end, inward

    @classmethod
    def on(cls, views: Sequence[Around], series: Sequence[Series]) -> Values:
        """A function by its series in some :func:`views_of` a box."""
        last = views[-1]
        return cls(*series, inward=-last.side) if isinstance(last, AtEnd) else cls(*series)

    def by_views(self) -> list[Series]:
        """Its series."""
        return [self.middle, self.whole, *([] if self.end is None else [self.end])]

    def __add__(self, other: Any) -> Values:
        return self._with(other, lambda a, b: a + b)

    def __sub__(self, other: Any) -> Values:
        return self._with(other, lambda a, b: a - b)

    def __mul__(self, other: Any) -> Values:
        return self._with(other, lambda a, b: a * b)

    def _with(self, other: Any, apply: Callable[[Any, Any], Any]) -> Values:
        b = other if isinstance(other, Values) else Values(other, other, other)
        end = None if self.end is None or b.end is None else apply(self.end, b.end)
        return Values(apply(self.middle, b.middle), apply(self.whole, b.whole), end, self.inward)

    @cached_property
    def ball(self) -> Ball:
        """All that the function takes on the box."""
        return enclosed(self.middle, self.whole, TAYLOR_ORDER)

    @property
    def positive(self) -> bool:
        """Whether it is proved nowhere negative: at an end it may vanish by the first coefficients there."""
        if self.ball >= 0:
            return True
        first = self._first
        return first is not None and bool(coefficient(self.whole, first) * self.inward**first >= 0)

    @property
    def _first(self) -> int | None:
        """The number of the first coefficient at the end of the interval that does not vanish exactly."""
        if self.end is None:
            return None
        return next((k for k in range(TAYLOR_ORDER) if not coefficient(self.end, k).is_zero()), None)

    def integral(self) -> Ball:
        """The integral over t in [-1, 1]."""
        return sum(integral(self.middle, self.whole, TAYLOR_ORDER))

    @property
    def rough(self) -> Ball:
        """The remainder."""
        return abs(coefficient(self.whole, TAYLOR_ORDER)).upper()

    def half_integral(self) -> Ball:
        """The integral over t in [-1, 0]."""
        found = flint()
        total = sum((coefficient(self.middle, k) * (-1) ** k / (k + 1) for k in range(TAYLOR_ORDER)), found.arb(0))
        return total + coefficient(self.whole, TAYLOR_ORDER) * found.arb(0, 1) / (TAYLOR_ORDER + 1)


class AtEnd(Around):
    """Series in t about one end of a box, its ``side`` -1 or 1, which is the abscissa ``x``."""

    def __init__(self, box: Box, terms: int, side: int, x: float) -> None:
        super().__init__(box, terms, whole=True)
        self.side, self.about, self._x = side, flint().arb_poly([side, 1]), flint().arb(x)

    def abscissa(self) -> Series:
        """The abscissa x."""
        return flint().arb_series([self._x, self.box.unit], self.terms)


def views_of(box: Box, first: float | None, last: float | None) -> list[Around]:
    """Series about the middle of a box and about all of its points; about its end if that is one of the interval.

    ``first`` and ``last`` are the abscissae of the interval's ends on the piece of the box, None where it has none.
    """
    views = [Around(box, TAYLOR_ORDER + 1, whole=False), Around(box, TAYLOR_ORDER + 1, whole=True)]
    if first is not None and box.low == -1:
        views.append(AtEnd(box, TAYLOR_ORDER + 1, -1, first))
    elif last is not None and box.high == 1:
        views.append(AtEnd(box, TAYLOR_ORDER + 1, 1, last))
    return views
