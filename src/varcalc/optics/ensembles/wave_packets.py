"""Hamilton's ray equations for waves of any kind, from their dispersion relation ω(x, k).

A packet of waves goes with the group velocity, and its wavevector follows the
medium: dx/dt = ∂ω/∂k, dk/dt = -∂ω/∂x, with ω the same all along (Brizard, "An
Introduction to Lagrangian Mechanics", eq. 3.10; Whitham, "Linear and Nonlinear
Waves", sect. 11.5). Light in a medium at rest is ω = c |k|/n(x).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from varcalc.optics.models.hamilton import flown
from varcalc.optics.rays.beam import RayStatus
from varcalc.optics.validation import how_far, matched, rows
from varcalc.problem.conditions import function
from varcalc.showing import Brief, Shown
from varcalc.spelling import spelled
from varcalc.symbolic import tracing
from varcalc.symbolic.evaluation import PointEvaluator

Expression = Any
"""A CasADi SX expression."""


@dataclass(frozen=True, repr=False, eq=False)
class WavePackets(Shown):
    """The ends of m rays in d dimensions, one row a ray.

    Attributes
    ----------
    points, wavevectors : ndarray, shape (m, d)
        x and k where each ended.
    phase : ndarray, shape (m,)
        ∫ (k·dx - ω dt) along each, in radians.
    status : ndarray of int, shape (m,)
        Members of :class:`RayStatus`; the numbers of a ray that did not arrive are those of its start.
    """

    points: np.ndarray
    wavevectors: np.ndarray
    phase: np.ndarray
    status: np.ndarray

    @property
    def arrived(self) -> np.ndarray:
        """True (m,) for the rays that were followed to the end."""
        return self.status == RayStatus.ARRIVED


@spelled
@dataclass(frozen=True, repr=False)
class DispersionRelation(Brief):
    """Waves of the angular frequency ω(x, k), in the plane or in space.

    Parameters
    ----------
    omega : callable
        ``omega(x, k)`` of two columns, position and wavevector, written with CasADi's functions.

    Examples
    --------
    Waves on deep water: the group goes half as fast as its crests.

    >>> import casadi as ca
    >>> from varcalc import optics
    >>> water = optics.DispersionRelation(lambda x, k: ca.sqrt(9.81 * ca.norm_2(k)))
    >>> water.group_velocity((0, 0), (9.81, 0))
    array([[0.5, 0. ]])
    >>> water.trace((0, 0), (9.81, 0), 10.0).points
    array([[5., 0.]])
    """

    omega: Callable[[Expression, Expression], Expression]
    _calls: dict[int, PointEvaluator] = field(init=False, default_factory=dict, repr=False, compare=False)

    def __post_init__(self) -> None:
        function("omega", self.omega)

    def frequency(self, points: Any, wavevectors: Any) -> np.ndarray:
        """ω (m,) at points and wavevectors (m, d) or (d,)."""
        return self._evaluated(*_paired(points, wavevectors))[:, 0]

    def group_velocity(self, points: Any, wavevectors: Any) -> np.ndarray:
        """∂ω/∂k (m, d) at points and wavevectors (m, d) or (d,)."""
        return self._evaluated(*_paired(points, wavevectors))[:, 1:]

    def trace(self, points: Any, wavevectors: Any, time: float | np.ndarray) -> WavePackets:
        """Carry packets of waves for a time.

        Raises ValueError where ω or the group velocity is not a number at the start.

        Parameters
        ----------
        points, wavevectors : array_like, shape (m, d) or (d,)
            Where the packets are and their wavevectors; one serves for all of the other.
        time : float or array_like, shape (m,)
            For how long, not negative.

        Returns
        -------
        WavePackets
        """
        x, k = _paired(points, wavevectors)
        begin = self._evaluated(x, k)
        bad = ~np.all(np.isfinite(begin), axis=1)
        if np.any(bad):
            row = int(np.argmax(bad))
            raise ValueError(
                f"omega or its derivative by k is not a number at x = {x[row].tolist()}, k = {k[row].tolist()}; "
                "start where the waves exist"
            )
        d = x.shape[1]
        state = ca.SX.sym("Y", 2 * d + 1)
        omega = self._traced(state[:d], state[d : 2 * d])
        by_state = ca.gradient(omega, state)
        velocity, force = by_state[d : 2 * d], -by_state[:d]
        rates = ca.vertcat(velocity, force, ca.dot(state[d : 2 * d], velocity) - omega)
        until = how_far("time", time, len(x))
        ends, status = flown(rates, state, np.column_stack([x, k, np.zeros(len(x))]), until)
        return WavePackets(ends[:, :d], ends[:, d : 2 * d], ends[:, 2 * d], status)

    def _evaluated(self, x: np.ndarray, k: np.ndarray) -> np.ndarray:
        """ω and ∂ω/∂k (m, 1 + d)."""
        d = x.shape[1]
        if d not in self._calls:
            position, wavevector = ca.SX.sym("x", d), ca.SX.sym("k", d)
            omega = self._traced(position, wavevector)
            results = [omega, ca.densify(ca.gradient(omega, wavevector))]
            self._calls[d] = PointEvaluator(ca.Function("omega", [position, wavevector], results))
        return self._calls[d](len(x), x, k)

    def _traced(self, x: Expression, k: Expression) -> Expression:
        hint = "it is called with two columns, position and wavevector"
        return tracing.trace("omega", self.omega, [x, k], ca.SX, hint)


def _paired(points: Any, wavevectors: Any) -> tuple[np.ndarray, np.ndarray]:
    """Points and wavevectors (m, d), as many of the one as of the other."""
    x = rows("points", points)
    k = rows("wavevectors", wavevectors, x.shape[1])
    return matched("points", x, "wavevectors", k)
