"""Where a turning body is at any time, and how well that is known."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from varcalc.integrators.protocol import RunOutcome
from varcalc.mechanics.arguments import times_within
from varcalc.mechanics.rigid.rotations import EulerAngles, rotation_matrix
from varcalc.showing import Plotted
from varcalc.symbolic.evaluation import PointEvaluator


@dataclass(frozen=True, repr=False, eq=False)
class RigidMotion(Plotted):
    """The motion of a rigid body from ``span[0]`` to ``span[1]``, known at every time between.

    ``error`` bounds, in radians, the angle by which the orientation is off anywhere, as the difference from a motion
    that is integrated more carefully tells; ``drift`` how far each invariant goes from where it was, in its own
    units: the energy, and components of the angular momentum in space (L_x) or along the body's axes (L_1).
    ``outcome`` says why it ended, ``steps`` what it took.
    """

    span: tuple[float, float]
    outcome: RunOutcome
    error: float
    drift: Mapping[str, float]
    steps: int
    numbers: np.ndarray = field(repr=False)
    states: Callable[[np.ndarray], np.ndarray] = field(repr=False)
    """From times (m,) to states (m, 7)."""
    measured: PointEvaluator = field(repr=False)
    """Of the state: the angular velocity along the body's axes, the angular momentum in space, and the energy."""

    @property
    def completed(self) -> bool:
        """True when it came to its last time."""
        return self.outcome is RunOutcome.COMPLETED

    def _at(self, t: Any) -> tuple[np.ndarray, np.ndarray]:
        times = times_within(t, self.span)
        return times, with_unit_quaternions(self.states(times.ravel()))

    def orientation(self, t: Any) -> np.ndarray:
        """The orientation as a unit quaternion, shape (4,) + t.shape, at times of any shape.

        It goes on without a jump, so that a body that has turned once has the opposite sign.
        """
        times, states = self._at(t)
        return states[:, :4].T.reshape(4, *times.shape)

    def rotation(self, t: Any) -> np.ndarray:
        """The rotation matrix, shape (3, 3) + t.shape; its columns are the body's axes in space."""
        return rotation_matrix(self.orientation(t))

    def euler_angles(self, t: Any) -> EulerAngles:
        """φ, θ and ψ in the shape of ``t``: θ from 0 to π, φ and ψ from -π to π (see :meth:`EulerAngles.of`)."""
        return EulerAngles.of(self.orientation(t))

    def _values(self, t: Any, columns: slice) -> np.ndarray:
        times, states = self._at(t)
        values = self.measured(len(states), times.reshape(-1, 1), states, self.numbers[None, :])
        return values[:, columns].T.reshape(-1, *times.shape)

    def angular_velocity(self, t: Any) -> np.ndarray:
        """ω along the body's axes, shape (3,) + t.shape."""
        return self._values(t, slice(3))

    def momentum(self, t: Any) -> np.ndarray:
        """The angular momentum along fixed axes, shape (3,) + t.shape."""
        return self._values(t, slice(3, 6))

    def energy(self, t: Any) -> np.ndarray:
        """Kinetic energy of turning and potential, in the shape of ``t``."""
        return self._values(t, slice(6, 7))[0]


def with_unit_quaternions(states: np.ndarray) -> np.ndarray:
    """States (m, 7) whose quaternions have the length 1."""
    return np.column_stack([states[:, :4] / np.linalg.norm(states[:, :4], axis=1)[:, None], states[:, 4:]])
