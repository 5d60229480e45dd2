"""The variational equations: sensitivities as part of the state.

With Y(s; Y_0, c) the solution of Y' = f(s, Y, c), the columns of
S = dY/d(Y_0, c) obey S' = f_Y S + f_c, S(0) = (1, 0) (Hairer, Norsett, Wanner,
"Solving Ordinary Differential Equations I", sect. I.14). The derivatives are
CasADi's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from varcalc.integrators.protocol import check_system


@dataclass(frozen=True)
class Variational:
    """A ``system`` of N (1 + k) states: Y and the k columns of its sensitivities.

    The columns are the derivatives by the initial values of ``initial``
    (indices into Y), then by ``constants`` (indices into the constants).
    """

    system: ca.Function
    size: int
    initial: tuple[int, ...]
    constants: tuple[int, ...]

    @property
    def columns(self) -> int:
        """Number of sensitivities k."""
        return len(self.initial) + len(self.constants)

    def start(self, states: np.ndarray) -> np.ndarray:
        """The augmented initial states (..., N (1 + k)) for Y_0 (..., N)."""
        sensitivity = np.zeros((self.columns, self.size))
        sensitivity[range(len(self.initial)), list(self.initial)] = 1.0
        columns = np.broadcast_to(sensitivity.ravel(), (*states.shape[:-1], sensitivity.size))
        return np.concatenate([states, columns], axis=-1)

    def split(self, augmented: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Y (..., N) and dY/d(initial, constants) (..., N, k) of augmented states."""
        columns = augmented[..., self.size :].reshape(*augmented.shape[:-1], self.columns, self.size)
        return augmented[..., : self.size], np.swapaxes(columns, -1, -2)


def variational(system: ca.Function, initial: Sequence[int], constants: Sequence[int]) -> Variational:
    """``system`` together with its variational equations, by CasADi's differentiation."""
    size = check_system(system)
    kind: Any = ca.SX if system.is_a("SXFunction") else ca.MX
    count = len(initial) + len(constants)
    s, numbers = kind.sym("s"), kind.sym("c", system.numel_in(2))
    augmented = kind.sym("Z", size * (1 + count))
    state, columns = augmented[:size], ca.reshape(augmented[size:], size, count)
    slope = system.jacobian()  # of dY/ds by s, Y and the constants
    _, by_state, by_constants = slope(s, state, numbers, kind(size, 1))
    rates = ca.mtimes(by_state, columns)
    if constants:
        rates += ca.horzcat(kind(size, len(initial)), by_constants[:, list(constants)])
    rates = ca.vertcat(system(s, state, numbers), ca.vec(rates))
    function = ca.Function("variational", [s, augmented, numbers], [ca.densify(rates)], {"cse": True})
    return Variational(function, size, tuple(initial), tuple(constants))
