"""What a weak force does to a system about a place of rest: the response function, its poles and its causality."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.linalg

from varcalc.mechanics.linearised import Linearised
from varcalc.problem.conditions import reals
from varcalc.showing import Shown
from varcalc.spelling import spelled

FIRST_PLACES, MOST_PLACES = 256, 1 << 22
"""Places of the sum that stands for the integral over all frequencies."""
SETTLED = 1e-13
"""Of the largest absorption: by how much twice as many places may change the integral."""


@spelled
@dataclass(frozen=True, repr=False)
class Response(Shown):
    """The response of small motions of m directions (``about``) to forces: x(ω) = χ(ω) f(ω) for f exp(-iωt).

    χ(ω) = (K - iω (D + G) - ω² M)⁻¹ (Landau and Lifshitz, "Mechanics", sect. 26; "Statistical Physics", sect. 123).
    """

    about: Linearised

    def __call__(self, omega: Any) -> np.ndarray:
        """χ, of shape omega.shape + (m, m), at angular frequencies, which may be complex.

        On a pole it is infinite or not a number.
        """
        w = np.asarray(omega)[..., None, None]
        one = self.about
        matrices = one.stiffness - 1j * w * one.resistance - w**2 * one.mass
        with np.errstate(all="ignore"):
            return _inverses(matrices)

    def amplitude(self, omega: Any) -> np.ndarray:
        """Amplitudes of the directions for unit forces on each, of shape omega.shape + (m, m)."""
        return np.abs(self(omega))

    def phase(self, omega: Any) -> np.ndarray:
        """By what angle the motion lags behind the force, in radians between -π and π: omega.shape + (m, m)."""
        return np.angle(self(omega))

    @property
    def poles(self) -> np.ndarray:
        """The poles (2m,) of χ, i times the characteristic exponents: below the real axis where motions die away."""
        return 1j * self.about.exponents

    @property
    def causal(self) -> bool:
        """Whether all poles are below the real axis: only then χ is what forces of the past do, and those alone."""
        return bool(np.all(np.imag(self.poles) < 0))

    @cached_property
    def _rates(self) -> np.ndarray:
        """Of (u, u') (2m, 2m)."""
        one, m = self.about, len(self.about.mass)
        lower = np.linalg.solve(one.mass, np.hstack([-one.stiffness, -one.resistance]))
        return np.vstack([np.hstack([np.zeros((m, m)), np.eye(m)]), lower])

    def impulse(self, t: Any) -> np.ndarray:
        """What a unit blow at time 0 does: directions at times t, shape t.shape + (m, m); zero before the blow.

        It is the Fourier transform of χ, Green's function of the equations.
        """
        times, m = reals("t", t), len(self.about.mass)
        blow = np.linalg.inv(self.about.mass)
        found = [
            scipy.linalg.expm(self._rates * one)[:m, m:] @ blow if one > 0 else np.zeros((m, m))
            for one in times.ravel()
        ]
        return np.array(found).reshape(*times.shape, m, m)

    def from_absorption(self, omega: float) -> np.ndarray:
        """Re χ(ω) (m, m) by Kramers and Kronig from Im χ at all other frequencies: equal to it where χ is causal.

        (1/π) P∫ Im χ(w) dw/(w - ω), with w = s tan(θ/2): the principal value of what is periodic in θ, by sums whose
        places lie evenly on either side of ω. They converge as a power of the distance of the poles, as the number of
        places. Raises ValueError where they do not settle: with poles on the real axis, or all but on it.
        """
        scale = self.about.rate
        target, before, count = 2 * np.arctan(omega / scale), None, FIRST_PLACES
        sharp = "the response is too sharp for the integral: a pole lies on the real axis, or all but on it"
        if np.any(np.imag(self.poles) == 0):
            raise ValueError(sharp)
        while count * len(self.about.mass) ** 2 <= MOST_PLACES:
            angle = target + (2 * np.arange(count) + 1) * np.pi / count
            absorbed = np.imag(self(scale * np.tan(angle / 2)))
            # dw/(w - ω) = (cot((θ - θ0)/2) + tan(θ/2)) dθ/2, of which the second is the same for all ω
            kernel = (1 / np.tan((angle - target) / 2) + np.tan(angle / 2)) / count
            total = np.tensordot(kernel, absorbed, 1)
            size = max(float(np.abs(absorbed).max()), float(np.abs(total).max()))
            if before is not None and np.abs(total - before).max() <= SETTLED * size:
                return total
            before, count = total, 2 * count
        raise ValueError(sharp)


def _inverses(matrices: np.ndarray) -> np.ndarray:
    """Inverses (..., m, m), infinite where a matrix is singular."""
    if matrices.shape[-1] == 1:
        return 1 / matrices
    try:
        return np.linalg.inv(matrices)
    except np.linalg.LinAlgError:
        flat = matrices.reshape(-1, *matrices.shape[-2:])
        sizes = np.linalg.cond(flat)
        found = np.full(flat.shape, np.inf, dtype=complex)
        fine = np.isfinite(sizes)
        found[fine] = np.linalg.inv(flat[fine])
        return found.reshape(matrices.shape)
