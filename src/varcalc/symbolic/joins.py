"""Whether an expression is smooth at a switch after all: |v|^1.5, y |y| and fmax(y, 0)^2 have no kink.

The size that switches is taken for a variable of its own. Where the expression does not feel it, on the surface on
which it is zero, the gradient is the same on either side. Branches, as of Huber's loss by ``if_else``, are held against
each other on that surface: where their difference and its gradient vanish there is neither a jump nor a kink.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from itertools import product

import casadi as ca
import numpy as np

from varcalc.symbolic.instructions import interpret, operate
from varcalc.symbolic.switches import CONTINUOUS, Switch, alike, arguments, switches
from varcalc.symbolic.tracing import Expression

STARTS = np.modf(np.outer(np.sqrt([2.0, 3.0, 5.0, 7.0, 11.0, 13.0]), np.arange(1.0, 40.0)))[0] * 2 - 0.7
"""Points from which the surface is looked for, a row each, as many entries of it as there are variables."""
STEPS_ONTO_SURFACE = 30
ON_SURFACE = 1e-13
"""Size of what switches that is round-off, at a point on the surface."""
UNFELT = 1e-9
"""Derivative by the size that switches, in units of what it is away from the surface, that is none."""
WIDE = (1.0, 10.0, 100.0)
"""Multiples of the starts from which branches are held against each other: a switch may have several surfaces."""
MOST_BESIDE = 4
"""Other switches that a switch crosses: with more of them branches are not held against each other."""
ENOUGH_POINTS = 2
"""Points on the surface without which nothing is said."""
SIDES: dict[int, Callable[..., Expression]] = {
    ca.OP_LT: lambda a, b, below: ca.SX(below),
    ca.OP_LE: lambda a, b, below: ca.SX(below),
    ca.OP_SIGN: lambda a, below: ca.SX(1 - 2 * below),
    ca.OP_FABS: lambda a, below: a * (1 - 2 * below),
    ca.OP_FMAX: lambda a, b, below: a + below * (b - a),
    ca.OP_FMIN: lambda a, b, below: b + below * (a - b),
}
"""What an operation that switches is, where ``below`` is 1 on the negative side of its argument and 0 on the other."""


def joined(expressions: Sequence[Expression], symbols: Sequence[Expression], switch: Switch) -> Switch:
    """The switch of SX ``expressions`` of ``symbols``, told to be smooth where both sides agree in value and gradient.

    Branches that agree in value alone count as a jump: nothing else tells which way their kink points.
    """
    variables = ca.vertcat(*(ca.vec(s) for s in symbols))
    if switch.stepped or variables.numel() > STARTS.shape[1]:
        return switch
    if not switch.jumps:
        return replace(switch, smooth=_size_unfelt(expressions, symbols, variables, switch))
    beside = _beside(expressions, symbols, variables, switch)
    if len(beside) > MOST_BESIDE:
        return switch
    sides = [list(zip(beside, held, strict=True)) for held in product((0, 1), repeat=len(beside))]
    above, below = ([_branch(expressions, symbols, [(switch, side), *held]) for held in sides] for side in (0, 1))
    if any(branch is None for branch in (*above, *below)):
        return switch
    difference = ca.vertcat(*above) - ca.vertcat(*below)
    both = ca.horzcat(difference, ca.jacobian(difference, variables))
    smooth = _none(both, variables, switch)
    return replace(switch, jumps=not smooth, smooth=smooth)


def _beside(
    expressions: Sequence[Expression], symbols: Sequence[Expression], variables: Expression, switch: Switch
) -> list[Switch]:
    """What else jumps, and not on one side all over a switch: branches might agree there in parts of it alone."""
    others = [o for o in switches(expressions, symbols) if o.jumps and not alike(o.argument, switch.argument)]
    points = _points_on(switch, variables, STARTS)
    if not (others and points):
        return others
    values = np.array(_at([other.argument for other in others], variables, points))
    steady = np.ptp(values, axis=0) <= UNFELT * np.abs(values).max(axis=0)
    return [other for other, known in zip(others, steady, strict=True) if not known]


def _branch(
    expressions: Sequence[Expression], symbols: Sequence[Expression], sides: Sequence[tuple[Switch, int]]
) -> Expression | None:
    """The expressions with each switch held on a side, 1 where its argument is negative; None where it has no two."""
    two_sided = True

    def applied(operation: int, operands: Sequence[Expression]) -> Expression:
        nonlocal two_sided
        for argument in arguments(operation, operands):
            for switch, side in sides:
                if turned := alike(argument, switch.argument):
                    two_sided = two_sided and operation in SIDES
                    return SIDES[operation](*operands, side if turned > 0 else 1 - side) if two_sided else operands[0]
        return operate(operation, operands)

    function = ca.Function("read", list(symbols), list(expressions))
    results = interpret(function, [s.nonzeros() if s.numel() else [] for s in symbols], ca.SX, applied)
    return ca.densify(ca.vertcat(*(e for result in results for e in result))) if two_sided else None


def _none(rows: Expression, variables: Expression, switch: Switch) -> bool:
    """Whether each row of an expression is zero wherever it was tried on a switch, in units of what it is elsewhere."""
    tried = 0
    for wide in WIDE:
        on, off = (
            [size for size in map(np.abs, _at([rows], variables, points)) if np.isfinite(size).all()]
            for points in (_points_on(switch, variables, wide * STARTS), wide * STARTS)
        )
        if on and np.any(np.array(on) > UNFELT * np.max(off, axis=0, initial=0.0)):
            return False
        tried += len(on)
    return tried >= ENOUGH_POINTS


def _at(rows: Sequence[Expression], variables: Expression, points: Iterable[np.ndarray]) -> list[np.ndarray]:
    """The entries of expressions at points, which have entries to spare."""
    function = ca.Function("rows", [variables], [ca.densify(ca.vertcat(*map(ca.vec, rows)))])
    return [np.asarray(function(point[: variables.numel()])).ravel() for point in points]


def _size_unfelt(
    expressions: Sequence[Expression], symbols: Sequence[Expression], variables: Expression, switch: Switch
) -> bool:
    """Whether SX ``expressions`` of ``symbols`` have the same gradient on either side of a switch that is a kink."""
    size = ca.SX.sym("size")
    function = ca.Function("read", list(symbols), list(expressions))

    def applied(operation: int, operands: Sequence[Expression]) -> Expression:
        if operation in CONTINUOUS and alike(arguments(operation, operands)[0], switch.argument):
            a, b = operands[0], operands[-1]
            return {ca.OP_FABS: size, ca.OP_FMAX: 0.5 * (a + b + size), ca.OP_FMIN: 0.5 * (a + b - size)}[operation]
        return operate(operation, operands)

    results = interpret(function, [s.nonzeros() if s.numel() else [] for s in symbols], ca.SX, applied)
    stated = ca.vertcat(*(e for result in results for e in result))
    felt = ca.Function("felt", [variables, size], [ca.densify(ca.jacobian(stated, size))])
    found = _points_on(switch, variables, STARTS)
    ratios = [_felt(felt, there, 0.0) / max(_felt(felt, there, 1.0), 1e-300) for there in found]
    known = [ratio for ratio in ratios if np.isfinite(ratio)]
    return len(known) >= ENOUGH_POINTS and max(known) <= UNFELT


def _points_on(switch: Switch, variables: Expression, starts: Iterable[np.ndarray]) -> list[np.ndarray]:
    """The points of a switch that are found from the ``starts``, which have entries to spare."""
    surface = ca.Function(
        "surface", [variables], [switch.argument, ca.densify(ca.gradient(switch.argument, variables))]
    )
    return [there for start in starts if (there := _on_surface(surface, start[: variables.numel()])) is not None]


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
