"""The cubic by which a heavy symmetric top nutates, in coordinates that keep its digits.

With u = cos θ, x = u - u₀ from where the motion begins, s² = 1 - u₀², A = 2 M g h/I1, β = I3 ω3/I1,
a = (p_φ - p_ψ u₀)/I1 and the angular velocity √k across the axis,

    (dx/dt)² = (s² - 2 u₀ x - x²)(k - A x) - (a - β x)².

The cubic in u itself (Brizard, "An Introduction to Lagrangian Mechanics", eq. 7.65; Goldstein, Poole and Safko,
"Classical Mechanics", eq. 5.62') has coefficients of the order β², which for a fast top leave no digits of a narrow
nutation; those in x do, and what begins upright is no exception. A motion that comes next to a pole from afar has its
digits in the distance from there.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from varcalc.numerics.one_coordinate.motions import MotionPoint
from varcalc.numerics.one_coordinate.potential import Potential, PotentialValues

LOST_TERM = 32 * float(np.finfo(float).eps)
"""Of the terms of a sum: one that is less is round-off."""
UPRIGHT = float(np.finfo(float).eps) ** 2
"""Of 1 - |cos θ|: a tilt that is round-off."""


@dataclass(frozen=True)
class TopStart:
    """How a top begins, without Euler angles, so that it may be upright.

    ``above`` and ``below`` are 1 - u₀ and 1 + u₀, ``a``, ``k``, ``beta`` and ``A`` as in this module's head, ``w`` the
    rate of u and ``omega3`` that of the body's own turning; with ``sense`` -1 it is seen upside down, and u is -cos θ.
    """

    above: float
    below: float
    w: float
    a: float
    k: float
    beta: float
    A: float
    omega3: float
    sense: int = 1

    @classmethod
    def of(cls, q: np.ndarray, omega: np.ndarray, I1: float, I3: float, Mgh: float) -> TopStart:
        """From a quaternion (4,) and the angular velocity (3,) along the top's axes."""
        w, x, y, z = q.tolist()
        along, across, omega3 = omega.tolist()
        above, below = (0.0 if d <= UPRIGHT else d for d in (2 * (x * x + y * y), 2 * (w * w + z * z)))
        tilted = above > 0 and below > 0
        first, second = (2 * (x * z - w * y), 2 * (y * z + w * x)) if tilted else (0.0, 0.0)  # the vertical, across e3
        return cls(
            above, below, total(first * across, -second * along), total(first * along, second * across),
            along**2 + across**2, I3 * omega3 / I1, 2 * Mgh / I1, omega3,
        )  # fmt: skip

    @property
    def u(self) -> float:
        """cos θ, from the nearer end."""
        return 1 - self.above if self.above < self.below else self.below - 1

    @cached_property
    def coefficients(self) -> tuple[float, float, float]:
        """Of x, x² and x³ in (dx/dt)²; round-off of the first is zero."""
        terms = -self.above * self.below * self.A, -2 * self.u * self.k, 2 * self.a * self.beta
        first = math.fsum(terms)
        first = 0.0 if abs(first) <= LOST_TERM * sum(map(abs, terms)) else first
        return first, 2 * self.u * self.A - self.k - self.beta**2, self.A

    def at_pole(self, pole: int) -> float:
        """(p_φ ∓ p_ψ)/I1, which is zero where the axis may come to be upright (1) or upside down (-1)."""
        reach = self.above if pole > 0 else -self.below
        return total(self.a, -self.beta * reach)

    def azimuth_rate(self, x: np.ndarray) -> np.ndarray:
        """φ' = (α - β u)/(1 - u²) at ``x``, with the numerator from where it loses least: a pole, or the start."""
        up, down, above, below = self.at_pole(1), self.at_pole(-1), self.above - x, self.below + x
        if up == 0 and down == 0:
            return np.zeros_like(x)
        if up == 0 or down == 0:
            return self.beta / below if up == 0 else -self.beta / above
        known = np.array([up, down, self.a]).reshape(3, *[1] * np.ndim(x))
        changes = self.beta * np.array([above, -below, -x])
        best = np.argmin(np.abs(known) + np.abs(changes), axis=0)[None]
        numerator = np.take_along_axis(known + changes, best, axis=0)[0]
        return numerator / (above * below)

    @property
    def asymptotic(self) -> bool:
        """Whether it comes to rest on the pole where it has most potential energy."""
        pole = 1 if self.A > 0 else -1
        reach = self.above if pole > 0 else -self.below
        return self.A != 0 and self.at_pole(pole) == 0 and total(self.k, -self.A * reach) == 0 and self.k > 0

    @property
    def upside_down(self) -> TopStart:
        """The same with -u in the place of u."""
        return replace(
            self, above=self.below, below=self.above, w=-self.w, beta=-self.beta, A=-self.A, sense=-self.sense
        )

    @property
    def about_start(self) -> TopCubic:
        """The cubic in x, its constant, the square of ``w``, left out."""
        return TopCubic(
            self.coefficients,
            self.azimuth_rate,
            lambda x: self.omega3 - self.sense * (self.u + x) * self.azimuth_rate(x),
        )

    @property
    def about_lower_pole(self) -> tuple[TopCubic, float]:
        """The cubic in y = 1 + u, and its constant: next to the pole y has all digits, as x has next to the start."""
        down, over, beta = self.at_pole(-1), self.k + self.A * self.below, self.beta

        def azimuth_rate(y: np.ndarray) -> np.ndarray:
            return (down - beta * y) / (y * (2 - y)) if down else -beta / (2 - y)

        return TopCubic(
            (2 * (over + down * beta), -(over + 2 * self.A + beta**2), self.A), azimuth_rate,
            lambda y: self.omega3 - self.sense * (y - 1) * azimuth_rate(y),
        ), -(down**2)  # fmt: skip


@dataclass(frozen=True)
class TopCubic(Potential):
    """A cubic without its constant, by the ``coefficients`` of the first, second and third power.

    ``azimuth_rate`` and ``spin_rate`` are φ' and ψ' of the coordinate, which vary gently between the ``steps``.
    """

    coefficients: tuple[float, float, float]
    azimuth_rate: Callable[[np.ndarray], np.ndarray]
    spin_rate: Callable[[np.ndarray], np.ndarray]
    steps: np.ndarray = field(default_factory=lambda: np.zeros(0))

    @property
    def stops(self) -> np.ndarray:
        """See :attr:`Potential.stops`."""
        return self.steps

    def at(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See :meth:`Potential.at`."""
        b, c, d = self.coefficients
        return u * (b + u * (c + d * u)), b + u * (2 * c + 3 * d * u)

    def changes(self, base: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See :meth:`Potential.changes`."""
        b, c, d = self.coefficients
        slope = b + base * (2 * c + 3 * d * base)
        return x * (slope + x * (c + d * (3 * base + x))), x * (2 * c + 3 * d * (2 * base + x))

    def moved(self, base: np.ndarray, x: np.ndarray, start: tuple[np.ndarray, np.ndarray]) -> PotentialValues:  # noqa: ARG002
        """See :meth:`Potential.moved`: where terms cancel, differences of values are round-off, and changes are not."""
        return PotentialValues(*self.at(base + x), *self.changes(base, x))

    def weighted(self, point: MotionPoint) -> tuple[np.ndarray, ...]:
        """The rates of φ and ψ; see :meth:`Potential.weighted`."""
        return self.azimuth_rate(point.u), self.spin_rate(point.u)


def total(first: float, second: float) -> float:
    """The sum, without round-off where that is all there is."""
    found = first + second
    return 0.0 if abs(found) <= LOST_TERM * (abs(first) + abs(second)) else found
