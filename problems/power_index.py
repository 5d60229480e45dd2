"""Rays in n = y^-s: like the brachistochrone, singular where they start, at any power below 1.

    J[y] = integral of y^-s sqrt(1 + y'^2) dx,  0 < s < 1,  from the origin,

stays finite though n does not; s = 1/2 is the brachistochrone. L does not
contain x, so n/sqrt(1 + y'^2) is constant, equal to n at the turning depth a.
With (y/a)^s = sin(phi) the first integral gives, for S_m(phi) the integral of
sin^m from 0 to phi,

    y = a sin(phi)^(1/s),  x = (a/s) S_{1/s}(phi),  J = (a^(1-s)/s) S_{1/s-2}(phi),

incomplete beta functions. For s = 1/3 they are elementary.

Source: Brizard, "An Introduction to Lagrangian Mechanics" (2005), eq. 1.33,
integrated for this index.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

import varcalc as vc
from varcalc.problems._roots import increasing_root


def optical_length(power: float) -> Callable[..., Any]:
    return lambda x, y, dy: ca.sqrt(1 + dy**2) / y**power


def sine_power_integral(m: float, angle: Any) -> np.ndarray:
    """The integral of sin^m from 0 to an angle in [0, pi], m > -1."""
    from scipy.special import beta, betainc

    a = 0.5 * (m + 1)
    quarter = 0.5 * beta(a, 0.5)
    # near the middle the part beyond is the well-conditioned one
    from_start = quarter * betainc(a, 0.5, np.sin(angle) ** 2)
    to_middle = np.sign(np.cos(angle)) * quarter * betainc(0.5, a, np.cos(angle) ** 2)
    return np.where(np.asarray(angle) < np.pi / 4, from_start, quarter - to_middle)


@dataclass(frozen=True)
class Ray:
    """The ray in n = y^-power from the origin, which turns at ``depth``; it is used up to the angle ``turn``."""

    power: float
    depth: float
    turn: float

    @classmethod
    def through(cls, across: float, down: float, power: float) -> Ray:
        """The ray that meets a point."""
        m = 1 / power

        def ratio(phi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            s, area = np.sin(phi), sine_power_integral(m, phi)
            return m * area / s**m, m * (1 - m * area * np.cos(phi) / s ** (m + 1))

        turn = float(increasing_root(ratio, 0.0, np.pi, across / down))
        return cls(power, float(across / (m * sine_power_integral(m, turn))), turn)

    @property
    def optical_path(self) -> float:
        """J up to the angle ``turn``."""
        m = 1 / self.power
        return float(m * self.depth ** (1 - self.power) * sine_power_integral(m - 2, self.turn))

    def y(self, x: Any) -> np.ndarray:
        """The depth at given x."""
        m = 1 / self.power
        target = np.asarray(x, dtype=float) / (m * self.depth)

        def area(phi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            return sine_power_integral(m, phi), np.sin(phi) ** m

        # S_m(phi)/phi^(m+1) falls from 1/(m+1)
        lower = ((m + 1) * target) ** (1 / (m + 1))
        upper = self.turn * (target / sine_power_integral(m, self.turn)) ** (1 / (m + 1))
        return self.depth * np.sin(increasing_root(area, lower, upper, target)) ** m


def ray(power: float, across: float, case: str, statement: str) -> vc.Reference:
    exact = Ray.through(across, 1, power)
    return vc.Reference(
        name="power_index" + case,
        problem=vc.Problem(optical_length(power), vc.Fixed(0, 0), vc.Fixed(across, 1), name="power_index"),
        exact=vc.Exact(exact.optical_path, exact.y, "incomplete beta functions"),
        source='Brizard, "An Introduction to Lagrangian Mechanics" (2005), eq. 1.33',
        statement=statement,
        downward=True,
    )


references = (
    ray(1 / 3, 1, "", "A ray in n = y^(-1/3), from where n is infinite."),
    ray(3 / 4, 1, "/steep", "A ray in n = y^(-3/4), from where n is infinite."),
    ray(1 / 4, 1, "/gentle", "A ray in n = y^(-1/4), from where n is infinite."),
    ray(1 / 3, 4, "/beyond", "A ray in n = y^(-1/3) that turns before its end."),
)
