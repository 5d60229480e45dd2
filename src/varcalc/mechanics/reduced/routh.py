"""A Lagrangian without its ignorable coordinates, and what is left as a motion in one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from varcalc.mechanics.lagrange import Lagrange
from varcalc.symbolic.tracing import Expression


def routh(lagrange: Lagrange, gone: Sequence[int], momenta: Sequence[float]) -> tuple[Expression, Expression]:
    """Routh's R = L - Σ p v without the coordinates of the numbers ``gone``, and their rates, by the others.

    (Goldstein, Poole and Safko, "Classical Mechanics", sect. 8.3.) Raises ValueError where L is not of second degree
    in the rates of those.
    """
    s, places = lagrange.symbols, list(gone)
    rates = s.v[places]
    inertia = lagrange.mass[places, places]
    if ca.depends_on(inertia, rates):
        raise ValueError("L must be of second degree in the rates of ignorable coordinates to be reduced")
    rest = ca.substitute(lagrange.momenta[places], rates, ca.SX.zeros(len(places)))
    values = ca.SX(list(momenta))
    found = ca.solve(inertia, values - rest)
    reduced = ca.substitute(lagrange.value - ca.dot(values, rates), rates, found)
    # the coordinates do not occur, but for what CasADi does not see to cancel
    zero = ca.SX.zeros(len(places))
    return ca.substitute(reduced, s.q[places], zero), ca.substitute(found, s.q[places], zero)


@dataclass(frozen=True)
class OneCoordinate:
    """a(q) q'²/2 + W(q), which is kept, and the angles' rates ``steady`` + ``carried`` q' (k,), by q alone.

    ``inertia`` is a and ``potential`` W; ``covering`` is the determinant of the inertia of those that are gone.
    """

    q: Expression
    inertia: Expression
    potential: Expression
    steady: Expression
    carried: Expression
    covering: Expression

    @classmethod
    def of(
        cls, lagrange: Lagrange, gone: Sequence[int], momenta: Sequence[float], numbers: np.ndarray
    ) -> OneCoordinate:
        """What is left of a Lagrangian whose one coordinate is not among those ``gone``, its parameters put in.

        Raises ValueError where it is not of second degree in the rate.
        """
        s = lagrange.symbols
        left = next(k for k in range(s.q.numel()) if k not in gone)
        value, rates = routh(lagrange, gone, momenta) if len(gone) else (lagrange.value, ca.SX.zeros(0))
        q, v = s.q[left], s.v[left]
        value, rates = (ca.substitute(part, s.p, ca.SX(numbers)) for part in (value, rates))
        inertia, along = ca.hessian(value, v)[0], ca.densify(ca.jacobian(rates, v))
        if ca.depends_on(ca.vertcat(inertia, along), v):
            raise ValueError("L must be of second degree in the rate of the coordinate that is left to be reduced")
        still = [ca.substitute(part, v, 0) for part in (-value, rates)]
        places = list(gone)
        covering = ca.substitute(ca.det(lagrange.mass[places, places]) if places else ca.SX(1), s.p, ca.SX(numbers))
        return cls(q, inertia, ca.densify(still[0]), ca.densify(still[1]), along, covering)
