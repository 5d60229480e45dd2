"""Elastic collisions of two bodies: the centre of mass and the laboratory."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from varcalc.mechanics.arguments import sampled
from varcalc.problem.conditions import positive, reals, told
from varcalc.showing import Shown
from varcalc.spelling import spelled


@spelled
@dataclass(frozen=True, repr=False)
class Collision(Shown):
    """A body of the mass ``projectile`` that meets one of the mass ``target``, which is at rest in the laboratory.

    All angles are in radians (Brizard, "An Introduction to Lagrangian Mechanics", sect. 5.2 to 5.4; Landau and
    Lifshitz, "Mechanics", sect. 17).

    Raises ValueError for a mass that is not positive.

    >>> import numpy as np
    >>> billiards = Collision(1.0, 1.0)
    >>> bool(abs(billiards.laboratory_angle(1.0) + billiards.recoil_angle(1.0) - np.pi / 2) < 1e-15)
    True
    """

    projectile: float
    target: float

    def __post_init__(self) -> None:
        for name in ("projectile", "target"):
            object.__setattr__(self, name, positive(name, getattr(self, name)))

    @property
    def mass_ratio(self) -> float:
        """α, the projectile's mass over the target's."""
        return self.projectile / self.target

    @property
    def reduced_mass(self) -> float:
        """The mass of the relative motion."""
        return self.projectile * (self.target / (self.projectile + self.target))

    @property
    def largest_laboratory_angle(self) -> float:
        """π for a projectile that is lighter, π/2 for equal masses, arcsin(1/α) for a heavier one."""
        alpha = self.mass_ratio
        return np.pi if alpha < 1 else float(np.arcsin(1 / alpha))

    def relative_energy(self, laboratory_energy: float) -> float:
        """The energy of the relative motion, where the projectile has the ``laboratory_energy``."""
        return positive("laboratory_energy", laboratory_energy) / (1 + self.mass_ratio)

    def laboratory_angle(self, angle: Any) -> np.ndarray:
        """The angle θ of the projectile in the laboratory, of deflections ``angle`` about the centre of mass."""
        deflection = reals("angle", angle)
        return np.arctan2(np.sin(deflection), self.mass_ratio + np.cos(deflection))

    def recoil_angle(self, angle: Any) -> np.ndarray:
        """The angle between the incoming projectile and the target as it goes off: (π - Θ)/2."""
        return (np.pi - reals("angle", angle)) / 2

    def centre_of_mass_angles(self, angle: Any) -> np.ndarray:
        """The deflections (2, ...) about the centre of mass that give an ``angle`` in the laboratory.

        The second is not a number where there is one only, both where there is none.
        """
        theta, alpha = reals("angle", angle), self.mass_ratio
        with np.errstate(invalid="ignore"):
            turned = np.arcsin(alpha * np.sin(theta))
        forward = theta <= np.pi / 2
        first = np.where((alpha < 1) | forward, theta + turned, np.nan)
        return np.stack([first, np.where((alpha > 1) & forward, theta + np.pi - turned, np.nan)])

    def laboratory_cross_section(self, cross_section: Callable[[np.ndarray], np.ndarray], angle: Any) -> np.ndarray:
        """dσ/dΩ in the laboratory at an ``angle``, from the ``cross_section`` about the centre of mass.

        Both deflections that give the angle count (Brizard, eq. 5.17): with each goes the factor
        (1 + 2 α cos Θ + α²)^(3/2)/abs(1 + α cos Θ). Zero at angles that no projectile takes.
        """
        alpha, deflections = self.mass_ratio, self.centre_of_mass_angles(angle)
        known = np.isfinite(deflections)
        parts = np.zeros_like(deflections)
        cosine = np.cos(deflections[known])
        with np.errstate(divide="ignore"):
            widened = (1 + 2 * alpha * cosine + alpha**2) ** 1.5 / np.abs(1 + alpha * cosine)
        parts[known] = sampled("cross_section", cross_section, deflections[known]) * widened
        return parts.sum(axis=0)[()]

    def after(self, projectile: ArrayLike, target: ArrayLike, direction: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """The velocities (n,) of both after they collide with velocities ``projectile`` and ``target`` (n,).

        ``direction`` (n,), of any length but 0, is that of the relative velocity afterwards; its size is kept. Raises
        ValueError for columns of different sizes and for no direction.
        """
        first, second = reals("projectile", projectile), reals("target", target)
        way = reals("direction", direction)
        if not first.shape == second.shape == way.shape or first.ndim != 1:
            raise ValueError("projectile, target and direction must be columns of one size")
        length = float(np.linalg.norm(way))
        if not (length > 0 and np.isfinite(length)):
            raise ValueError(f"direction must not vanish, and be finite, not {told(direction)}")
        whole = self.projectile + self.target
        centre = (self.projectile * first + self.target * second) / whole
        relative = np.linalg.norm(first - second) * way / length
        return centre + self.target / whole * relative, centre - self.projectile / whole * relative
