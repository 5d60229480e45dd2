"""The symmetric top with one fixed point, in gravity."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from varcalc.mechanics.arguments import triple
from varcalc.mechanics.rigid.body import RigidBody, oriented
from varcalc.mechanics.rigid.inertia import Inertia, check_inertia
from varcalc.mechanics.rigid.motion import RigidMotion
from varcalc.mechanics.rigid.nutation import Nutation, nutation
from varcalc.mechanics.rigid.rotations import EulerAngles, entries
from varcalc.mechanics.rigid.top_cubic import TopStart
from varcalc.mechanics.system import System
from varcalc.numerics.roots import quadratic
from varcalc.problem.conditions import finite
from varcalc.showing import Shown
from varcalc.spelling import spelled

ALIGNED = 1e-12
"""Of the moments, or of the arm: by how much a body may miss being a symmetric top on its axis."""


@spelled
@dataclass(frozen=True, repr=False)
class Top(Shown):
    """A symmetric top: the moments ``I1`` across its axis and ``I3`` about it, at the fixed point, and ``Mgh``.

    M g h is the weight times the distance from the fixed point to the centre of mass along the axis e3: negative for a
    top that hangs from it, zero for one that is free. Its motion is that of its :attr:`body`, in quaternions: any
    start will do, upright ones too. Raises ValueError for moments of no body.

    Sources: Landau and Lifshitz, "Mechanics", sect. 35; Goldstein, Poole and Safko, "Classical Mechanics", sect. 5.7;
    Brizard, "An Introduction to Lagrangian Mechanics", sect. 7.3.

    Examples
    --------
    >>> top = Top(I1=1.0, I3=0.5, Mgh=1.0)
    >>> top.critical_spin
    4.0
    >>> released = top.nutation(EulerAngles(0.0, 1.0, 0.0), [0.0, 0.0, 5.0])
    >>> released.case.name, round(released.theta[0], 12)
    ('CUSP', 1.0)
    """

    I1: float
    I3: float
    Mgh: float

    def __post_init__(self) -> None:
        for name in ("I1", "I3", "Mgh"):
            object.__setattr__(self, name, finite(name, getattr(self, name)))
        if not 0 < self.I3 <= 2 * self.I1 * (1 + ALIGNED):
            raise ValueError(
                f"I1 = {self.I1:g} and I3 = {self.I3:g} are of no body: both are positive, and I3 is no more than 2 I1"
            )

    @classmethod
    def of(cls, inertia: Inertia, pivot: Sequence[float], gravity: float = 9.81) -> Top:
        """The top that a symmetric body about z is on a ``pivot`` on that axis.

        Raises ValueError for a body that is not symmetric about z, and a pivot beside the axis: see
        :meth:`RigidBody.pivoted` for these.
        """
        check_inertia(inertia)
        tensor, arm = inertia.about(triple("pivot", pivot)), inertia.centre - triple("pivot", pivot)
        wrong = np.abs(tensor - np.diag([tensor[0, 0], tensor[0, 0], tensor[2, 2]])).max()
        if wrong > ALIGNED * np.abs(tensor).max() or np.abs(arm[:2]).max() > ALIGNED * np.abs(arm).max():
            raise ValueError("inertia must be symmetric about z, and the pivot on that axis; see RigidBody.pivoted")
        return cls(float(tensor[0, 0]), float(tensor[2, 2]), float(inertia.mass * finite("gravity", gravity) * arm[2]))

    @cached_property
    def body(self) -> RigidBody:
        """The body that moves; the z-axis is vertical, and e3 its own axis."""
        moments, weight = [self.I1, self.I1, self.I3], {"Mgh": self.Mgh}
        return RigidBody(moments, potential=lambda t, R, p: p.Mgh * R[2, 2], parameters=weight, name="top")

    @cached_property
    def system(self) -> System:
        """The same in Euler angles, for equations, momenta and the Routhian; singular where the axis is upright.

        >>> Top(1.0, 0.5, 1.0).system.ignorable
        ('phi', 'psi')
        """
        I1, I3, Mgh = self.I1, self.I3, self.Mgh
        return System(
            lambda t, q, v: (
                I1 * (v[1] ** 2 + (v[0] * ca.sin(q[1])) ** 2) / 2
                + I3 * (v[2] + v[0] * ca.cos(q[1])) ** 2 / 2
                - Mgh * ca.cos(q[1])
            ),
            ("phi", "theta", "psi"),
            name="top",
        )

    def motion(
        self,
        orientation: EulerAngles | Sequence[float] | np.ndarray,
        angular_velocity: Sequence[float] | np.ndarray,
        span: tuple[float, float],
    ) -> RigidMotion:
        """The motion of the :attr:`body`: see :meth:`RigidBody.motion`."""
        return self.body.motion(orientation, angular_velocity, span)

    def nutation(
        self, orientation: EulerAngles | Sequence[float] | np.ndarray, angular_velocity: Sequence[float] | np.ndarray
    ) -> Nutation:
        """The limits of θ, their case, and what φ and ψ advance by in a period; the arguments are those of a motion."""
        q, omega = oriented(orientation, angular_velocity)
        R = np.array(entries(q))
        p_phi, p_psi = R[2] @ (np.array([self.I1, self.I1, self.I3]) * omega), self.I3 * omega[2]
        energy = (self.I1 * (omega[0] ** 2 + omega[1] ** 2) + self.I3 * omega[2] ** 2) / 2 + self.Mgh * R[2, 2]
        start = TopStart.of(q, omega, self.I1, self.I3, self.Mgh)
        return nutation(start, (float(p_phi), float(p_psi)), float(energy))

    @property
    def critical_spin(self) -> float:
        """The least ω3 at which the top sleeps: (I3 ω3)² = 4 M g h I1; zero for a top that hangs or is free."""
        return 2 * math.sqrt(max(self.Mgh, 0.0) * self.I1) / self.I3

    def sleeps(self, omega3: float) -> bool:
        """Whether a small push leaves the top nearly upright, where it spins with ``omega3``.

        At the critical spin itself it does: Mgh sin²(θ/2) then grows by more than the barrier sinks (Landau and
        Lifshitz, "Mechanics", sect. 35, problem 2, for the threshold).
        """
        return abs(finite("omega3", omega3)) >= self.critical_spin

    def steady_precessions(self, theta: float, omega3: float) -> tuple[float, ...]:
        """The rates φ', ascending in size, at which the axis goes round at the inclination ``theta``.

        Roots of I1 cos θ φ'² - I3 ω3 φ' + M g h = 0: two, or one where the axis is level, or none where the top is too
        slow. The slow one is found without loss of digits (Goldstein, Poole and Safko, eq. 5.78).
        """
        bend, spin = self.I1 * math.cos(finite("theta", theta)), self.I3 * finite("omega3", omega3)
        weight = self.Mgh
        if abs(bend) <= ALIGNED**1.25 * self.I1:
            return (weight / spin,) if spin else ()
        rates = quadratic(*np.array([weight, -spin, bend]))
        return tuple(sorted({float(rate) for rate in rates if np.isfinite(rate)}, key=abs))
