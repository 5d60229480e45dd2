"""Whether an expression is smooth at a switch after all: |v|^1.5, y |y| and fmax(y, 0)^2 have no kink.

The size that switches is taken for a variable of its own. Where the expression does not feel it, on the surface on
which it is zero, the gradient is the same on either side.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from varcalc.symbolic.instructions import interpret, operate
from varcalc.symbolic.switches import CONTINUOUS, Switch, alike, arguments
from varcalc.symbolic.tracing import Expression

STARTS = np.modf(np.outer(np.sqrt([2.0, 3.0, 5.0, 7.0, 11.0, 13.0]), np.arange(1.0, 40.0)))[0] * 2 - 0.7
"""Points from which the surface is looked for, a row each, as many entries of it as there are variables."""
STEPS_ONTO_SURFACE = 30
ON_SURFACE = 1e-13
"""Size of what switches that is round-off, at a point on the surface."""
UNFELT = 1e-9
"""Derivative by the size that switches, in units of what it is away from the surface, that is none."""
ENOUGH_POINTS = 2
"""Points on the surface without which nothing is said."""


def joins_smoothly(expressions: Sequence[Expression], symbols: Sequence[Expression], switch: Switch) -> bool:
    """Whether SX ``expressions`` of ``symbols`` have the same gradient on either side of a switch that is a kink."""
    if switch.jumps or switch.stepped:
        return False
    size = ca.SX.sym("size")
    function = ca.Function("read", list(symbols), list(expressions))

    def applied(operation: int, operands: Sequence[Expression]) -> Expression:
        if operation in CONTINUOUS and alike(arguments(operation, operands)[0], switch.argument):
            a, b = operands[0], operands[-1]
            return {ca.OP_FABS: size, ca.OP_FMAX: 0.5 * (a + b + size), ca.OP_FMIN: 0.5 * (a + b - size)}[operation]
        return operate(operation, operands)

    results = interpret(function, [s.nonzeros() if s.numel() else [] for s in symbols], ca.SX, applied)
    stated = ca.vertcat(*(e for result in results for e in result))
    variables = ca.vertcat(*(ca.vec(s) for s in symbols))
    if variables.numel() > STARTS.shape[1]:
        return False
    felt = ca.Function("felt", [variables, size], [ca.densify(ca.jacobian(stated, size))])
    surface = ca.Function(
        "surface", [variables], [switch.argument, ca.densify(ca.gradient(switch.argument, variables))]
    )
    found = [there for start in STARTS[:, : variables.numel()] if (there := _on_surface(surface, start)) is not None]
    ratios = [_felt(felt, there, 0.0) / max(_felt(felt, there, 1.0), 1e-300) for there in found]
    known = [ratio for ratio in ratios if np.isfinite(ratio)]
    return len(known) >= ENOUGH_POINTS and max(known) <= UNFELT


def _felt(felt: ca.Function, point: np.ndarray, size: float) -> float:
    return float(np.abs(np.asarray(felt(point, size))).max())


def _on_surface(surface: ca.Function, point: np.ndarray) -> np.ndarray | None:
    """The point of the surface near another, by Newton's method along the gradient; None where it leads to none."""
    with np.errstate(all="ignore"):
        for _ in range(STEPS_ONTO_SURFACE):
            value, gradient = (np.asarray(v).ravel() for v in surface(point))
            if not (np.isfinite(value).all() and np.isfinite(gradient).all() and gradient.any()):
                return None
            if abs(value[0]) <= ON_SURFACE:
                return point
            point = point - value[0] * gradient / (gradient @ gradient)
    return None
