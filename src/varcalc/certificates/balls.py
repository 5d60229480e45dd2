"""Ball arithmetic: numbers, polynomials and Taylor forms that hold what they stand for, whatever is rounded.

Arb's balls (Johansson, "Arb: efficient arbitrary-precision midpoint-radius interval arithmetic", IEEE Trans. Computers
66 (2017) 1281) enclose the exact result of every operation. A function of x on a box is enclosed by its Taylor form:
its coefficients at the centre, and as the remainder the next coefficient over the whole box (Makino and Berz, "Taylor
models and other validated functional inclusion methods", Int. J. Pure Appl. Math. 4 (2003) 379).
"""

from __future__ import annotations

import math
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from functools import lru_cache
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np

from varcalc.extensions import optional

ROUND_OFF, MOST_ROUND_OFF = 2.0**-51, 1e-13
"""Coefficients of a polynomial through doubles, relative to its values, that are round-off: at least and at most."""
NARROW = 2.0**-60
"""Share of a piece that no box is narrower than."""
LITTLE_LEFT = 0.8
"""Share of a box from which on all of it is taken for a part of that length."""
Ball: TypeAlias = Any
"""A python-flint ``arb``."""
Series: TypeAlias = Any
"""A python-flint ``arb_series``, or an ``arb`` where it is a constant."""
Poly: TypeAlias = Any
"""A python-flint ``arb_poly``."""


@lru_cache(maxsize=1)
def flint() -> Any:
    """The module python-flint; ModuleNotFoundError with a remedy where it is absent."""
    return optional("flint", "certify", "proofs by ball arithmetic")


@contextmanager
def working(bits: int, terms: int) -> Generator[None]:
    """Arb's precision in ``bits`` and the length of its series, restored afterwards."""
    context = flint().ctx
    before = context.prec, context.cap
    context.prec, context.cap = bits, terms
    try:
        yield
    finally:
        context.prec, context.cap = before


def below(ball: Ball) -> float:
    """The greatest double that no number of the ball is proved to lie below."""
    if not ball.is_finite():
        return -math.inf
    exact = ball.lower()
    value = float(exact)
    return value if flint().arb(value) <= exact else math.nextafter(value, -math.inf)


def above(ball: Ball) -> float:
    """The least double that no number of the ball is proved to lie above."""
    return -below(-ball)


@lru_cache(maxsize=64)
def nodes(degree: int) -> np.ndarray:
    """Chebyshev's points of the second kind on [-1, 1], ascending; shape (degree + 1,)."""
    points = -np.cos(np.pi * np.arange(degree + 1) / degree)
    points.setflags(write=False)
    return points


@lru_cache(maxsize=64)
def differentiation(degree: int) -> np.ndarray:
    """The derivatives at the nodes of the polynomial through values there (Trefethen, "Spectral Methods", ch. 6)."""
    x = nodes(degree)
    c = np.r_[2.0, np.ones(degree - 1), 2.0] * (-1.0) ** np.arange(degree + 1)
    matrix = np.outer(c, 1.0 / c) / (x[:, None] - x + np.eye(degree + 1))
    matrix -= np.diag(matrix.sum(axis=1))
    matrix.setflags(write=False)
    return matrix


@lru_cache(maxsize=64)
def transform(degree: int) -> np.ndarray:
    """The matrix from values at the nodes to coefficients of Chebyshev polynomials; (degree + 1, degree + 1)."""
    k = np.arange(degree + 1)
    half = np.where((k == 0) | (k == degree), 0.5, 1.0)
    return (2.0 / degree) * half[:, None] * half * np.cos(np.pi * np.outer(k, degree - k) / degree)


@lru_cache(maxsize=64)
def _chebyshev(k: int) -> Poly:
    """T_k with its whole coefficients."""
    found = flint()
    return found.arb_poly(found.fmpz_poly.chebyshev_t(k))


def polynomial(values: np.ndarray, size: float = 0.0) -> Poly:
    """An exact polynomial on [-1, 1] close to ``values`` (degree + 1,) at the nodes, and equal to them at both ends.

    Coefficients at the end that are but round-off are left out: their derivatives would be large. ``size`` is that of
    which the values are known to round-off, where it is more than their own.
    """
    found = flint()
    total, coefficients = found.arb_poly([0]), transform(len(values) - 1) @ values
    sizes, largest_value = np.abs(coefficients), max(np.abs(values).max(), size)
    noise = 3.0 * sizes[-4:].max()  # where the values are resolved the last ones are nothing else
    large = np.flatnonzero(
        sizes > max(ROUND_OFF * largest_value, noise if noise < MOST_ROUND_OFF * largest_value else 0.0)
    )
    for k, c in enumerate(coefficients[: large.max(initial=0) + 1].tolist()):
        total += _chebyshev(k) * found.arb(c)
    return anchored(total, found.arb(float(values[0])), found.arb(float(values[-1])))


def anchored(poly: Poly, start: Ball, end: Ball) -> Poly:
    """The polynomial with the line added that gives it the values ``start`` and ``end`` at -1 and 1."""
    found = flint()
    first, last = start - poly(found.arb(-1)), end - poly(found.arb(1))
    return poly + found.arb_poly([(first + last) / 2, (last - first) / 2])


class Box:
    """The part of a piece from ``low`` to ``high`` of its own variable in [-1, 1], itself run through by t in [-1, 1].

    ``centre`` and ``half`` are the abscissa of the piece's middle and half its length, as balls.
    """

    def __init__(self, centre: Ball, half: Ball, low: Ball, high: Ball) -> None:
        self.centre, self.half, self.low, self.high = centre, half, low, high
        self.middle, self.width = (low + high) / 2, (high - low) / 2
        self.unit = half * self.width
        """Half the length of the box in x: dx/dt."""
        self.x = centre + half * self.middle
        self._local: dict[int, tuple[Poly, Poly]] = {}

    def halves(self) -> list[Box]:
        """The left and the right half."""
        return self.split(2)

    def split(self, count: int) -> list[Box]:
        """The box cut into equal parts."""
        step = (self.high - self.low) / count
        cuts = [self.low, *((self.low + k * step).mid() for k in range(1, count)), self.high]
        return [Box(self.centre, self.half, a, b) for a, b in pairwise(cuts)]

    def ends_apart(self, share: float) -> list[Box]:
        """Parts of that share at both ends, and what is between them."""
        inside = (self.high - self.low) * flint().arb(share)
        cuts = [self.low, (self.low + inside).mid(), (self.high - inside).mid(), self.high]
        return [Box(self.centre, self.half, a, b) for a, b in pairwise(cuts)]

    def cut(self, width: float) -> tuple[Box, Box | None]:
        """The first part, of about that half-width, and the rest; all of the box where little more is left."""
        middle = self.low + flint().arb(2.0 * width)
        if width >= LITTLE_LEFT * float(self.width):
            return self, None
        return (
            Box(self.centre, self.half, self.low, middle.mid()),
            Box(self.centre, self.half, middle.mid(), self.high),
        )

    def local(self, poly: Poly) -> Poly:
        """A polynomial of the piece as one in t; kept, as a box is looked at more than once."""
        kept = self._local.get(id(poly))
        if kept is None:
            kept = self._local[id(poly)] = poly, poly(flint().arb_poly([self.middle, self.width]))
        return kept[1]

    @property
    def narrow(self) -> bool:
        """Whether the box is so narrow that halves of it would tell no more."""
        return bool(self.width < NARROW)

    @property
    def at(self) -> float:
        """The abscissa of the middle, for messages."""
        return float(self.x.mid())


class Around:
    """Series in t about the centre of a box, or, ``whole``, about every point of it at once."""

    def __init__(self, box: Box, terms: int, whole: bool) -> None:
        self.box, self.terms, self.whole = box, terms, whole
        found = flint()
        self.ball = found.arb(0, 1)
        self.about = found.arb_poly([self.ball, 1])

    def abscissa(self) -> Series:
        """The abscissa x."""
        x = self.box.x + self.box.unit * self.ball if self.whole else self.box.x
        return flint().arb_series([x, self.box.unit], self.terms)

    def series(self, local: Poly) -> Series:
        """A polynomial in t, see :meth:`Box.local`."""
        moved = local(self.about) if self.whole else local
        return flint().arb_series(moved.coeffs()[: self.terms], self.terms)

    def slope(self, series: Series) -> Series:
        """d/dx of a series; one term shorter."""
        return series.derivative() / self.box.unit


def solved(matrix: Sequence[Sequence[Ball]], right: Sequence[Ball]) -> list[Ball]:
    """The solution of linear equations; ZeroDivisionError where a pivot may vanish."""
    found = flint()
    solution = found.arb_mat(matrix).solve(found.arb_mat([[v] for v in right]))
    return [solution[i, 0] for i in range(len(right))]


def coefficient(series: Series, k: int) -> Ball:
    """The coefficient of t^k, of a constant as well."""
    if isinstance(series, flint().arb_series):
        if k >= series.prec:
            raise IndexError(f"a series of {series.prec} terms has no coefficient {k}")
        return series[k]
    return series if k == 0 else flint().arb(0)


def enclosed(centred: Series, whole: Series, order: int) -> Ball:
    """What a Taylor form takes for t in [-1, 1], by its coefficients in Chebyshev polynomials.

    The sum of the sizes of these is seldom much more than the largest value, and that of powers of t may be by 2^order.
    """
    found = flint()
    total, *rest = (found.arb_mat([[coefficient(centred, k) for k in range(order)]]) * _from_powers(order)).entries()
    room = sum((abs(c) for c in rest), abs(coefficient(whole, order)))
    return total + room * found.arb(0, 1)


@lru_cache(maxsize=64)
def _from_powers(count: int) -> Any:
    """The matrix from coefficients of powers below t^count to those of Chebyshev polynomials; of whole 2^-k."""
    found = flint()
    rows = np.zeros((count, count))
    rows[0, 0] = 1.0
    for k in range(1, count):
        # t T_0 = T_1, and t T_j is half of T_(j-1) and T_(j+1)
        halves = 0.5 * rows[k - 1]
        rows[k, 1:] = halves[:-1]
        rows[k, :-1] += halves[1:]
        rows[k, 1] += halves[0]
    return found.arb_mat(rows.tolist())


def integral(centred: Series, whole: Series, order: int) -> tuple[Ball, Ball]:
    """The integral of a Taylor form over t in [-1, 1], without its remainder; the remainder's own."""
    found = flint()
    total = found.arb(0)
    for k in range(0, order, 2):
        total += 2 * coefficient(centred, k) / (k + 1)
    # |t|^order integrates to 2/(order + 1)
    return total, coefficient(whole, order) * found.arb(0, 1) * 2 / (order + 1)


def most(poly: Poly) -> Ball:
    """What the size of a polynomial stays below on [-1, 1]."""
    return sum((abs(c).upper() for c in poly.coeffs()), flint().arb(0))


def largest(balls: Sequence[Ball]) -> Ball:
    """A number that none of the balls exceeds."""
    found = flint()
    best = found.arb(0)
    for ball in balls:
        upper = abs(ball).upper()
        if not upper <= best:
            best = upper
    return best
