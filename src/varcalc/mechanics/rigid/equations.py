"""The equations of a turning body, and what they keep.

The state is the orientation q, a quaternion, and the angular momentum L in space:

    q' = q ∘ (0, ω)/2 + (α/2) (1 - |q|²) q,   ω = I⁻¹ Rᵀ L,   L' = N.

Whatever component of the torque N in space vanishes, its momentum is then kept to the last digit: all of L where
there is no torque, p_φ in gravity. Euler's equations for ω in place of those for L would let each drift by round-off.
No orientation is singular, as every chart of three angles is somewhere, and none is divided by: without torques the
equations are polynomials. The term with α is Baumgarte's; it lets die what round-off adds to the length of q, which
measures nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from varcalc.integrators import Continuous
from varcalc.mechanics.rigid.rotations import entries, normalised, quaternion_rate
from varcalc.symbolic.names import with_names
from varcalc.symbolic.tracing import LAST, Expression, called, check_arity, column, trace

PLACES = 12
"""Random states at which it is asked whether something is kept."""
CONSERVED = 1e-11
"""Of the terms of its rate: what is kept changes by less at every one of those."""
CANDIDATES = ("energy", "L_x", "L_y", "L_z", "L_1", "L_2", "L_3")
"""The energy, and components of the angular momentum along fixed axes and along the body's own."""


@dataclass(frozen=True)
class BodySymbols:
    """Time, rotation matrix, angular velocity along the body's axes, and the parameters, as CasADi symbols."""

    t: Expression
    R: Expression
    omega: Expression
    p: Expression
    names: tuple[str, ...]

    @classmethod
    def of(cls, names: Sequence[str]) -> BodySymbols:
        """With parameters of these names."""
        return cls(ca.SX.sym("t"), ca.SX.sym("R", 3, 3), ca.SX.sym("omega", 3), ca.SX.sym("p", len(names)), (*names,))

    @property
    def all(self) -> list[Expression]:
        """As functions of them take them."""
        return [self.t, self.R, self.omega, self.p]

    def arguments(self, *columns: Expression) -> list[Expression]:
        """``columns`` and, where there are parameters, what a person's functions call p."""
        return with_names(columns, self.names, self.p)

    def energy(self, potential: Callable[..., Any] | None) -> Expression:
        """The energy of an orientation that a person's ``potential`` says."""
        if potential is None:
            return ca.SX(0)
        return trace("potential", potential, self.arguments(self.t, self.R), ca.SX, LAST)

    def torque(self, given: Callable[..., Any] | None) -> Expression:
        """The torque (3,) along the body's axes that a person's function says."""
        if given is None:
            return ca.SX.zeros(3)
        arguments = self.arguments(self.t, self.R, self.omega)
        check_arity("torque", given, len(arguments), LAST)
        return column("torque", called("torque", given, arguments, ca.SX), 3, "one along each of the body's axes")


@dataclass(frozen=True)
class TurningEquations:
    """Of a body with this ``inertia`` (3, 3), the ``potential`` of an orientation and a ``torque`` along its axes."""

    symbols: BodySymbols
    inertia: np.ndarray
    potential: Expression
    torque: Expression

    @cached_property
    def state(self) -> Expression:
        """The quaternion (4,), and the angular momentum in space (3,) in units that are one of the constants."""
        return ca.SX.sym("Y", 7)

    @cached_property
    def constants(self) -> Expression:
        """The parameters, Baumgarte's α, the unit of angular momentum, and the entries of I⁻¹ that are not zero.

        As symbols, so that all bodies in one potential are one system, which an engine compiles once.
        """
        inverse = ca.SX.sym("J", 3 if self._aligned else 6)
        return ca.vertcat(self.symbols.p, ca.SX.sym("alpha"), ca.SX.sym("unit"), inverse)

    def numbers(self, parameters: np.ndarray, alpha: float, unit: float) -> np.ndarray:
        """The constants' values."""
        inverse = np.diag(1 / np.diag(self.inertia)) if self._aligned else np.linalg.inv(self.inertia)
        return np.concatenate([parameters, [alpha, unit], inverse[self._places]])

    @cached_property
    def _aligned(self) -> bool:
        """Whether the body's axes are principal ones."""
        return np.count_nonzero(self.inertia - np.diag(np.diag(self.inertia))) == 0

    @property
    def _places(self) -> tuple[np.ndarray, np.ndarray]:
        """Which entries of I⁻¹ are told, by rows and columns: the diagonal first."""
        rows, columns = np.array([0, 1, 2, 0, 0, 1]), np.array([0, 1, 2, 1, 2, 2])
        count = 3 if self._aligned else 6
        return rows[:count], columns[:count]

    @cached_property
    def _scales(self) -> tuple[Expression, Expression, Expression]:
        """α, the unit of angular momentum, and I⁻¹ (3, 3)."""
        first = self.symbols.p.numel()
        inverse = ca.SX(3, 3)
        for number, (row, across) in enumerate(zip(*(place.tolist() for place in self._places), strict=True)):
            inverse[row, across] = inverse[across, row] = self.constants[first + 2 + number]
        return self.constants[first], self.constants[first + 1], inverse

    @property
    def arguments(self) -> list[Expression]:
        """As functions of the state take them."""
        return [self.symbols.t, self.state, self.constants]

    @cached_property
    def rotation(self) -> Expression:
        """R (3, 3) of the state."""
        return ca.blockcat(entries(ca.vertsplit(self.state[:4])))

    @cached_property
    def momentum(self) -> Expression:
        """L (3,) in space."""
        return self.state[4:] * self._scales[1]

    @cached_property
    def own_momentum(self) -> Expression:
        """L (3,) along the body's axes."""
        return ca.mtimes(self.rotation.T, self.momentum)

    @cached_property
    def omega(self) -> Expression:
        """The angular velocity (3,) along the body's axes."""
        return ca.mtimes(self._scales[2], self.own_momentum)

    @cached_property
    def torque_of_potential(self) -> Expression:
        """-Σ R_k × ∂U/∂R_k (3,) in space, over the body's axes R_k: what U loses in a small turn."""
        R = self.symbols.R
        slope = ca.reshape(ca.gradient(self.potential, ca.vec(R)), 3, 3)
        return -sum((ca.cross(R[:, k], slope[:, k]) for k in range(3)), ca.SX.zeros(3))

    def _of_state(self, value: Expression) -> Expression:
        s = self.symbols
        return ca.substitute([value], [s.R, s.omega], [self.rotation, self.omega])[0]

    @cached_property
    def rates(self) -> Expression:
        """d(state)/dt (7,)."""
        q, (alpha, unit, _) = self.state[:4], self._scales
        push = self._of_state(self.torque_of_potential + ca.mtimes(self.symbols.R, self.torque))
        turning = quaternion_rate(q, self.omega) + alpha / 2 * (1 - ca.sumsqr(q)) * q
        return ca.densify(ca.vertcat(turning, push / unit))

    @cached_property
    def energy(self) -> Expression:
        """ω·I ω/2 and the potential."""
        return ca.dot(self.omega, self.own_momentum) / 2 + self._of_state(self.potential)

    def kept(self, parameters: np.ndarray) -> dict[str, Expression]:
        """Of the energy and the momenta those whose rate vanishes, against its terms, at random states."""
        column = ca.densify(ca.vertcat(self.energy, self.momentum, self.own_momentum))
        changes = ca.horzcat(ca.jacobian(column, self.state), ca.jacobian(column, self.symbols.t))
        terms = changes * ca.repmat(ca.vertcat(self.rates, 1).T, len(CANDIDATES), 1)
        function = ca.Function("terms", self.arguments, [ca.densify(terms)])
        rng, kept = np.random.default_rng(1758), np.ones(len(CANDIDATES), dtype=bool)
        numbers = self.numbers(parameters, 1.0, float(np.trace(self.inertia)))
        for _ in range(PLACES):
            place = np.append(normalised(rng.normal(size=4)), rng.uniform(-1, 1, 3))
            found = np.array(function(rng.uniform(), place, numbers))
            kept &= np.abs(found.sum(axis=1)) <= CONSERVED * np.abs(found).sum(axis=1)
        values = ca.vertsplit(column)
        return {name: values[k] for k, name in enumerate(CANDIDATES) if kept[k]}

    @property
    def unjumping(self) -> Continuous:
        """The potential, a jump of which is a blow."""
        value = self._of_state(self.potential)
        return Continuous(ca.Function("potential", self.arguments, [ca.densify(value)]), self.state.numel())
