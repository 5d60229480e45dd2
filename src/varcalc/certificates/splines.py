"""Tables of one argument in ball arithmetic: polynomials between knots, exact of the numbers that CasADi holds.

A theorem is about the table as it was given: the spline of the coefficients that were computed through its values, not
of what these were measured of.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from functools import lru_cache
from itertools import product
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from scipy.interpolate import BSpline

from varcalc.certificates.balls import Ball, Series, flint
from varcalc.certificates.piecewise import Coefficients, times, total
from varcalc.symbolic.look_up import KEPT_TABLES, NUMBER, WHOLE, knots, serialized, vectors

KEPT_CELLS = 4096
"""Cells of tables whose polynomials are kept."""
SPLINE_KNOTS, COEFFICIENTS, SPLINE_DEGREE = b"BSplineCommon::knots", b"BSpline::coeffs", b"BSplineCommon::degree"
"""The fields of a spline where CasADi writes one down."""
TABLE_VALUES = b"Interpolant::values"
"""That of the values between which there are lines."""
CHECKED_AT, SAME = (0.25, 0.6), 1e-11
"""Shares of each cell at which what was read must be the function, and how well, relative to its largest value."""


class Spline(NamedTuple):
    """B-splines of a ``degree``, each with its coefficient, on ``knots`` of which those at the ends are repeated.

    de Boor, "A Practical Guide to Splines" (2001), ch. IX.
    """

    knots: np.ndarray
    coefficients: np.ndarray
    degree: int


@lru_cache(maxsize=KEPT_TABLES)
def spline(function: ca.Function) -> Spline | None:
    """What a table of one argument is called by, as a spline; None of another function, derivatives among them."""
    if not (function.n_in() == function.n_out() == function.nnz_in(0) == function.nnz_out(0) == 1 and knots(function)):
        return None
    written, (grid,) = serialized(function), knots(function)
    between = (grid[:-1, None] + np.diff(grid)[:, None] * np.array(CHECKED_AT)).ravel()
    told = np.asarray(function.map(len(between))(between)).ravel()
    return next((read for read in _read(written, grid) if _is_it(read, between, told)), None)


def _read(written: bytes, grid: np.ndarray) -> Iterator[Spline]:
    """The splines that may be meant: derivatives that were taken of one are written down in it."""
    fields = (SPLINE_KNOTS, NUMBER), (COEFFICIENTS, NUMBER), (SPLINE_DEGREE, WHOLE)
    for places, coefficients, degree in product(*(list(vectors(written, *field)) for field in fields)):
        yield Spline(places, coefficients, int(degree[0]))
    for values in vectors(written, TABLE_VALUES, NUMBER):
        yield Spline(np.r_[grid[:1], grid, grid[-1:]], values, 1)


def _is_it(read: Spline, at: np.ndarray, told: np.ndarray) -> bool:
    if len(read.knots) != len(read.coefficients) + read.degree + 1:
        return False
    return bool(np.abs(BSpline(*read)(at) - told).max() <= SAME * np.abs(told).max())


def polynomial_of(read: Spline, knot: float) -> Coefficients:
    """The polynomial of a spline above one of its knots, in powers of the distance from it, by de Boor's recurrence."""
    p, at = read.degree, int(np.searchsorted(read.knots, knot, "right")) - 1
    t = [Fraction(float(v)) for v in read.knots]
    rows: list[Coefficients] = [(Fraction(float(v)),) for v in read.coefficients[at - p : at + 1]]
    for r in range(1, p + 1):
        for j in range(p, r - 1, -1):
            first = t[at - p + j]
            wide = t[at + 1 + j - r] - first
            share = ((t[at] - first) / wide, 1 / wide)
            rows[j] = total(rows[j - 1], times(share, total(rows[j], rows[j - 1], -1)))
    return rows[p]


@lru_cache(maxsize=KEPT_CELLS)
def cell_of(function: ca.Function, knot: float) -> tuple[Ball, ...]:
    """The coefficients, in balls, of a table above one of its knots, in powers of the distance from there."""
    read, found = spline(function), flint()
    assert read is not None
    exact = polynomial_of(read, knot) or (Fraction(0),)
    return tuple(found.arb(found.fmpq(c.numerator, c.denominator)) for c in exact)


@lru_cache(maxsize=KEPT_CELLS)
def smooth_at(function: ca.Function, knot: float) -> bool:
    """Whether a table and its slope are one on both sides of a knot between its ends, exactly."""
    read = spline(function)
    assert read is not None
    left = float(read.knots[np.searchsorted(read.knots, knot, "left") - 1])
    before, after = (*polynomial_of(read, left), 0, 0), (*polynomial_of(read, knot), 0, 0)
    way = Fraction(knot) - Fraction(left)
    value = sum((c * way**k for k, c in enumerate(before)), Fraction(0))
    slope = sum((k * c * way ** (k - 1) for k, c in enumerate(before) if k), Fraction(0))
    return (value, slope) == after[:2]


def horner(coefficients: Sequence[Ball], x: Series, order: int) -> tuple[Series, ...]:
    """A polynomial and its derivatives up to ``order``."""
    results: list[Any] = []
    for _ in range(order + 1):
        value = coefficients[-1] if coefficients else flint().arb(0)
        for c in coefficients[-2::-1]:
            value = value * x + c
        results.append(value)
        coefficients = [k * c for k, c in enumerate(coefficients)][1:]
    return tuple(results)
