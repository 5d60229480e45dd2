"""Constraints on motions, and the accelerations and reactions with them.

The index of the differential-algebraic system is reduced, with Baumgarte's terms: φ'' + 2αφ' + α²φ = 0 in place of
φ'' = 0, so that what round-off adds dies out (J. Baumgarte, Comput. Methods Appl. Mech. Eng. 1 (1972) 1).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from varcalc.mechanics.lagrange import Lagrange, StateSymbols
from varcalc.problem.conditions import Holonomic, function
from varcalc.showing import Brief
from varcalc.spelling import spelled
from varcalc.symbolic.tracing import Expression

FAR_OFF = 1e-6
"""Of the coordinates, or of the rates: who starts farther off a constraint breaks it."""
DEPENDENT = 1e-10
"""Of the largest singular value of the constraints' gradients: one that is less makes one of them redundant."""
PROJECTIONS = 8
RATE = 2.0
"""Baumgarte's α, in units of the rate at which the motion begins."""


@spelled
@dataclass(frozen=True, repr=False)
class Pfaffian(Brief):
    """``a(t, q[, p])``·v is zero along the motion: n numbers, such as those of rolling without slipping."""

    a: Callable[..., Any]

    def __post_init__(self) -> None:
        function("Pfaffian.a", self.a)


@dataclass(frozen=True)
class Held:
    """k constraints as expressions: their gradients ``rows`` (k, n) with (rows) v + ``drift`` = 0.

    ``level`` (k,) is φ, and zero for those that hold rates alone.
    """

    rows: Expression
    drift: Expression
    level: Expression

    @property
    def rate(self) -> tuple[Expression, Expression]:
        """The rows and what is added to their product with v."""
        return self.rows, self.drift

    @classmethod
    def of(cls, symbols: StateSymbols, constraints: Sequence[Holonomic | Pfaffian]) -> Held | None:
        """The constraints of a system; None where there are none."""
        rows, drifts, levels = [], [], []
        n = symbols.q.numel()
        for number, constraint in enumerate(constraints):
            if isinstance(constraint, Holonomic):
                phi = symbols.traced(f"constraints[{number}].phi", constraint.phi, symbols.t, symbols.q)
                rows.append(ca.jacobian(phi, symbols.q))
                drifts.append(ca.jacobian(phi, symbols.t))
                levels.append(phi)
            elif isinstance(constraint, Pfaffian):
                row = symbols.column(f"constraints[{number}].a", constraint.a, n, symbols.t, symbols.q)
                rows.append(row.T)
                drifts.append(ca.SX(0))
                levels.append(ca.SX(0))
            else:
                raise TypeError(f"constraints[{number}] must be Holonomic or Pfaffian, not {constraint!r}")
        if not rows:
            return None
        return cls(*(ca.densify(ca.vertcat(*parts)) for parts in (rows, drifts, levels)))

    def accelerations(self, lagrange: Lagrange, alpha: Expression) -> tuple[Expression, Expression]:
        """The accelerations (n,) and the multipliers (k,): reactions are rowsᵀ times these."""
        s = lagrange.symbols
        speed = ca.mtimes(self.rows, s.v) + self.drift
        bend = ca.jtimes(speed, s.q, s.v) + ca.jacobian(speed, s.t)
        holonomic = ca.SX(np.array([[float(not level.is_zero())] for level in ca.vertsplit(self.level)]))
        damped = (1 + holonomic) * alpha * speed + alpha**2 * self.level
        free = lagrange.solved(ca.horzcat(lagrange.pull, self.rows.T))
        short = ca.mtimes(self.rows, free[:, 0]) + bend + damped
        multipliers = -ca.solve(ca.mtimes(self.rows, free[:, 1:]), short)
        return free[:, 0] + ca.mtimes(free[:, 1:], multipliers), multipliers


def _check_independent(lagrange: Lagrange, held: Held, rows: np.ndarray, state: tuple[Any, ...]) -> None:
    """Refuse constraints of which one follows from others at the start, or contradicts them; naming them."""
    scale = np.linalg.norm(rows, axis=1)
    if np.any(scale == 0):
        raise ValueError(
            f"constraints[{int(np.argmin(scale))}] holds nothing at the start: its gradient vanishes there"
        )
    left, sizes, _ = np.linalg.svd(rows / scale[:, None])
    if len(rows) <= rows.shape[1] and sizes[-1] > DEPENDENT * sizes[0]:
        return
    # a combination in which the gradients cancel: what it leaves of levels, rates and accelerations is a contradiction
    share = left[:, -1] / scale
    involved = np.flatnonzero(np.abs(left[:, -1]) > DEPENDENT**0.5)
    names = " and ".join(f"constraints[{k}]" for k in involved)
    speed, s = ca.mtimes(held.rows, lagrange.symbols.v) + held.drift, lagrange.symbols
    bend = ca.jtimes(speed, s.q, s.v) + ca.jacobian(speed, s.t)
    parts = ca.Function("parts", s.all, [held.level, held.drift, bend])(*state)
    for part in parts:
        values = np.array(part).ravel()
        if abs(share @ values) > FAR_OFF * np.abs(share * values).max(initial=0.0):
            raise ValueError(f"{names} contradict each other: no motion keeps them all")
    raise ValueError(f"{names} say the same thing twice at the start: leave one of them out")


def started(
    lagrange: Lagrange, held: Held, t: float, q: np.ndarray, v: np.ndarray, numbers: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The state nearest to ``q``, ``v`` that keeps the constraints.

    Raises ValueError, naming the constraint, where it is farther than round-off and typing can explain, and where
    constraints say the same twice.
    """
    s = lagrange.symbols
    function = ca.Function(
        "held", s.all, [held.rows, held.level, ca.mtimes(held.rows, s.v) + held.drift, lagrange.mass]
    )
    rows = np.array(function(t, q, v, numbers)[0])
    _check_independent(lagrange, held, rows, (t, q, v, numbers))
    scales = max(float(np.abs(q).max()), 1e-300), max(float(np.abs(v).max()), 1e-300)
    for what, (scale, number) in {"phi": (scales[0], 1), "rate": (scales[1], 2)}.items():
        off = np.abs(np.array(function(t, q, v, numbers)[number]).ravel()) / np.linalg.norm(rows, axis=1)
        if off.max() > FAR_OFF * scale:
            worst = int(np.argmax(off))
            raise ValueError(
                f"the start is {off[worst]:.3g} off constraints[{worst}] in its {what}; begin on the constraint"
            )
    for _ in range(PROJECTIONS):
        rows, level, _, mass = (np.array(part) for part in function(t, q, v, numbers))
        q = q - np.linalg.solve(mass, rows.T @ np.linalg.solve(rows @ np.linalg.solve(mass, rows.T), level)).ravel()
        rows, _, rate, mass = (np.array(part) for part in function(t, q, v, numbers))
        v = v - np.linalg.solve(mass, rows.T @ np.linalg.solve(rows @ np.linalg.solve(mass, rows.T), rate)).ravel()
    return q, v
