"""Polynomials in u that have given values and derivatives at u = 0 and u = 1, by which lengths are measured."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def cubic_at(u: np.ndarray, first: Sequence[np.ndarray], last: Sequence[np.ndarray]) -> np.ndarray:
    """The cubic with the value and slope ``first`` at u = 0 and ``last`` at u = 1, at u; all shapes broadcast."""
    (start, slope), (end, going) = first, last
    change, gain = end - start - slope, going - slope
    return start + u * (slope + u * ((3 * change - gain) + u * (gain - 2 * change)))


def quintic(first: Sequence[np.ndarray], last: Sequence[np.ndarray]) -> list[np.ndarray]:
    """The six coefficients, of ascending powers of u, of the polynomial of fifth degree.

    It has the value, the slope and the second derivative ``first`` at u = 0 and ``last`` at u = 1, of one shape, as its
    coefficients are.
    """
    (start, slope, bend), (end, going, turn) = first, last
    gap, gain, turn = end - start - slope - bend / 2, going - slope - bend, turn - bend
    last_terms = 10 * gap - 4 * gain + turn / 2, -15 * gap + 7 * gain - turn, 6 * gap - 3 * gain + turn / 2
    return [start, slope, bend / 2, *last_terms]


def quintic_at(u: np.ndarray, terms: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Value and slope at u of the polynomial with the coefficients ``terms`` of :func:`quintic`; shapes broadcast."""
    c0, c1, c2, c3, c4, c5 = terms
    value = c0 + u * (c1 + u * (c2 + u * (c3 + u * (c4 + u * c5))))
    return value, c1 + u * (2 * c2 + u * (3 * c3 + u * (4 * c4 + u * 5 * c5)))
