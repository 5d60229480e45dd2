"""Orientations: unit quaternions, rotation matrices and Euler angles.

A quaternion (w, x, y, z) of length 1 turns components along the body's axes into components in space. Arrays have
their components first, so that many orientations have the shape (4,) + shape. SciPy's Rotation takes numbers alone: the
equations of motion need the same formulas of symbols.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from varcalc.problem.conditions import reals
from varcalc.showing import Brief
from varcalc.spelling import spelled
from varcalc.symbolic.tracing import Expression

NOT_ORTHOGONAL = 1e-9
"""By how much a matrix of floats may miss being a rotation."""


def entries(q: Any) -> list[list[Any]]:
    """The rotation matrix, by rows, of a quaternion: numbers, arrays or symbols; times its length squared.

    Source: Goldstein, Poole and Safko, "Classical Mechanics" (3rd ed., 2002), eq. 4.47 with e0 to e3.
    """
    w, x, y, z = q[0], q[1], q[2], q[3]
    return [
        [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
    ]


def quaternion_rate(q: Expression, omega: Expression) -> Expression:
    """dq/dt (4,) of a body that turns with ``omega`` (3,), along its own axes: q ∘ (0, ω)/2."""
    w, v = q[0], q[1:]
    return ca.vertcat(-ca.dot(v, omega), w * omega + ca.cross(v, omega)) / 2


@spelled
def rotation_matrix(quaternion: Any) -> np.ndarray:
    """The matrix (3, 3) + shape of quaternions (4,) + shape, which are brought to length 1.

    Its columns are the body's axes in space. Raises TypeError or ValueError for what are no quaternions.

    >>> rotation_matrix([1.0, 0.0, 0.0, 1.0]).round(15)  # a quarter turn about z
    array([[ 0., -1.,  0.],
           [ 1.,  0.,  0.],
           [ 0.,  0.,  1.]])
    """
    return np.array(entries(normalised(quaternion)))


def normalised(quaternion: Any) -> np.ndarray:
    """Quaternions (4,) + shape of length 1. Raises ValueError for one that has no direction."""
    q = reals("quaternion", quaternion)
    if q.ndim == 0 or len(q) != 4:
        raise ValueError(f"a quaternion has four numbers, w, x, y and z, not the shape {q.shape}")
    largest = np.abs(q).max(axis=0)
    if not np.all(np.isfinite(largest) & (largest > 0)):
        raise ValueError("a quaternion must be finite and not zero; no rotation at all is (1, 0, 0, 0)")
    q = q / largest
    return q / np.sqrt((q**2).sum(axis=0))


@spelled
def quaternion_of(rotation: Any) -> np.ndarray:
    """The quaternion (4,) of a rotation matrix (3, 3), w not negative.

    Of the four ways to find it the one with the largest divisor is taken (S. W. Shepperd, J. Guidance and Control 1
    (1978) 223). Raises ValueError for a matrix that is no rotation.
    """
    r = reals("rotation", rotation)
    if r.shape != (3, 3) or not np.abs(r.T @ r - np.eye(3)).max() <= NOT_ORTHOGONAL or np.linalg.det(r) < 0:
        raise ValueError("rotation must be a matrix (3, 3) whose columns are orthogonal axes of a right-handed frame")
    xx, yy, zz = np.diag(r)
    rows = np.array([
        [1 + xx + yy + zz, r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]],
        [r[2, 1] - r[1, 2], 1 + xx - yy - zz, r[0, 1] + r[1, 0], r[0, 2] + r[2, 0]],
        [r[0, 2] - r[2, 0], r[0, 1] + r[1, 0], 1 - xx + yy - zz, r[1, 2] + r[2, 1]],
        [r[1, 0] - r[0, 1], r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], 1 - xx - yy + zz],
    ])  # fmt: skip
    best = rows[np.argmax(np.diag(rows))]
    return normalised(best * (np.sign(best[0]) or 1.0))


@spelled
@dataclass(frozen=True, repr=False, eq=False)
class EulerAngles(Brief):
    """The angles φ, θ and ψ in radians, numbers or arrays of one shape.

    The body's frame is turned about z by φ, about the line of nodes x' by θ, about its own axis e3 by ψ (Goldstein,
    Poole and Safko, "Classical Mechanics", sect. 4.4; Landau and Lifshitz, "Mechanics", sect. 35; Brizard, "An
    Introduction to Lagrangian Mechanics", sect. 7.3). Raises TypeError or ValueError for what are no real numbers.

    >>> again = EulerAngles.of(EulerAngles(0.3, 3.0, 0.5).quaternion)
    >>> print(f"{again.phi:.12g} {again.theta:.12g} {again.psi:.12g}")
    0.3 3 0.5
    """

    phi: Any
    theta: Any
    psi: Any

    def __post_init__(self) -> None:
        for name in ("phi", "theta", "psi"):
            reals(f"EulerAngles.{name}", getattr(self, name))

    @classmethod
    def of(cls, quaternion: Any) -> EulerAngles:
        """The angles of quaternions (4,) + shape: θ from 0 to π, φ and ψ from -π to π.

        They come from half angles, so that θ is as accurate next to 0 and π as anywhere. Where the body's axis is
        upright, or upside down, only φ + ψ, or φ - ψ, is told: all of it is then ψ, the body's own turning.
        """
        w, x, y, z = normalised(quaternion)
        tilted, upright = np.hypot(x, y), np.hypot(w, z)
        half_sum, half_difference = np.arctan2(z, w), np.arctan2(y, x)
        half_difference = np.where(tilted == 0, -half_sum, half_difference)
        half_sum = np.where(upright == 0, -half_difference, half_sum)
        phi, psi = (_turned(half_sum + sign * half_difference) for sign in (1, -1))
        theta = 2 * np.arctan2(tilted, upright)
        return cls(phi[()], theta[()], psi[()])

    @property
    def quaternion(self) -> np.ndarray:
        """The orientation, (4,) + shape."""
        plus, minus = (self.phi + self.psi) / 2, (self.phi - self.psi) / 2
        c, s = np.cos(np.asarray(self.theta) / 2), np.sin(np.asarray(self.theta) / 2)
        return np.array([c * np.cos(plus), s * np.cos(minus), s * np.sin(minus), c * np.sin(plus)])

    @property
    def rotation(self) -> np.ndarray:
        """The rotation matrix (3, 3) + shape; its columns are the body's axes in space."""
        return rotation_matrix(self.quaternion)

    def angular_velocity(self, rates: Sequence[Any]) -> np.ndarray:
        """ω along the body's axes, (3,) + shape, of the ``rates`` φ', θ' and ψ'."""
        phi, theta, psi = rates
        s, c = np.sin(self.theta), np.cos(self.theta)
        node, across = np.cos(self.psi), np.sin(self.psi)
        return np.array([phi * s * across + theta * node, phi * s * node - theta * across, phi * c + psi])

    def rates(self, angular_velocity: Any) -> np.ndarray:
        """The rates φ', θ' and ψ', (3,) + shape, of ω along the body's axes.

        Raises ValueError where the axis is upright or upside down, where the angles have no rates.
        """
        s, c = np.sin(self.theta), np.cos(self.theta)
        if np.any(s == 0):
            raise ValueError("Euler angles have no rates where sin θ is 0; use the angular velocity there")
        first, second, third = reals("angular_velocity", angular_velocity)
        node, across = np.cos(self.psi), np.sin(self.psi)
        phi = (across * first + node * second) / s
        return np.array([phi, node * first - across * second, third - c * phi])


def _turned(angle: Any) -> np.ndarray:
    """The same angle between -π and π."""
    return np.asarray(angle - 2 * np.pi * np.round(angle / (2 * np.pi)))
