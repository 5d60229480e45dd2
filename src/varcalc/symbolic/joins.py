"""Whether an expression is smooth at a switch after all: |v|^1.5, y |y| and fmax(y, 0)^2 have no kink.

The size that switches is taken for a variable of its own. Where the expression does not feel it, on the surface on
which it is zero, the gradient is the same on either side. Branches, as of Huber's loss by ``if_else``, are held against
each other on that surface: where their difference and its gradient vanish there is neither a jump nor a kink.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import casadi as ca
import numpy as np

from varcalc.symbolic.instructions import instructions, interpret, operate
from varcalc.symbolic.switches import CONTINUOUS, SWITCH_ROUND_OFF, Switch, arguments, likeness, switches, switching
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
ON_ITSELF: dict[int, Callable[..., Expression]] = {
    ca.OP_LT: lambda a, b: ca.SX(0),
    ca.OP_LE: lambda a, b: ca.SX(1),
    ca.OP_SIGN: lambda a: ca.SX(0),
    ca.OP_FABS: lambda a: ca.SX(0),
    ca.OP_FMAX: lambda a, b: a,
    ca.OP_FMIN: lambda a, b: a,
}
"""What it is where its argument is zero, which may be neither, as of |sign(v)|: a curve may rest there."""


def joined(
    expressions: Sequence[Expression], symbols: Sequence[Expression], found: Iterable[Switch]
) -> tuple[Switch, ...]:
    """Switches of SX ``expressions`` of ``symbols``, told to be smooth where both sides agree in value and gradient.

    Branches that agree in value alone count as a jump: nothing else tells which way their kink points.
    """
    stated = _Stated(tuple(expressions), tuple(symbols))
    return tuple(_joined(stated, switch) for switch in found)


@dataclass(frozen=True)
class _Stated:
    """SX ``expressions`` of ``symbols``, read once for all their switches."""

    expressions: tuple[Expression, ...]
    symbols: tuple[Expression, ...]

    @cached_property
    def variables(self) -> Expression:
        """All symbols in one column."""
        return ca.vertcat(*(ca.vec(s) for s in self.symbols))

    @cached_property
    def arguments(self) -> list[Expression]:
        """What the operations that switch do so by, as they are carried out."""
        return [argument for _, argument in switching(self.expressions, self.symbols)]

    @cached_property
    def jumping(self) -> list[Switch]:
        """The switches that jump."""
        return [switch for switch in switches(self.expressions, self.symbols) if switch.jumps]

    @cached_property
    def _function(self) -> ca.Function:
        return ca.Function("read", list(self.symbols), list(self.expressions))

    def rewritten(
        self, sides: Sequence[Switch], replaced: Callable[[int, Sequence[Expression], np.ndarray], Expression | None]
    ) -> Expression:
        """All in one column, with what ``replaced`` gives in place of operations that switch, where that is not None.

        It is told the operation, its operands and which of the switches it is (see
        :func:`varcalc.symbolic.switches.likeness`).
        """
        turns = iter(likeness(self.arguments, [switch.argument for switch in sides], self.variables))

        def applied(operation: int, operands: Sequence[Expression]) -> Expression:
            """The operation, or what is put in its place."""
            for turn in [next(turns) for _ in arguments(operation, operands)]:
                if turn.any() and (other := replaced(operation, operands, turn)) is not None:
                    return other
            return operate(operation, operands)

        given = [s.nonzeros() if s.numel() else [] for s in self.symbols]
        results = interpret(self._function, given, ca.SX, applied)
        return ca.densify(ca.vertcat(*(e for result in results for e in result)))


def _joined(stated: _Stated, switch: Switch) -> Switch:
    variables = stated.variables
    if switch.stepped or variables.numel() > STARTS.shape[1]:
        return switch
    if not switch.jumps:
        return replace(switch, smooth=_size_unfelt(stated, switch))
    beside = _beside(stated, switch)
    if len(beside) > MOST_BESIDE:
        return switch
    sides = [list(zip(beside, held, strict=True)) for held in product((0, 1), repeat=len(beside))]
    above, below = ([_branch(stated, [(switch, side), *held]) for held in sides] for side in (0, 1))
    if any(branch is None for branch in (*above, *below)):
        return switch
    columns = [ca.vertcat(*branches) for branches in (above, below)]
    here, there = (ca.horzcat(column, ca.jacobian(column, variables)) for column in columns)
    smooth = _same(here, there, variables, switch)
    if smooth:  # and on itself it is no other again
        itself = ca.vertcat(*(_branch(stated, [(switch, None), *held]) for held in sides))
        written = [tuple(instructions(ca.Function("read", [variables], [c]))) for c in (itself, *columns)]
        smooth = written[0] in written[1:] or _same(itself, columns[0], variables, switch)
    return replace(switch, jumps=not smooth, smooth=smooth)


def _beside(stated: _Stated, switch: Switch) -> list[Switch]:
    """What else jumps, and not on one side all over a switch: branches might agree there in parts of it alone."""
    variables, others = stated.variables, stated.jumping
    same = likeness([o.argument for o in others], [switch.argument], variables)
    others = [other for other, itself in zip(others, same[:, 0], strict=True) if not itself]
    points = _points_on(switch, variables, STARTS)
    if not (others and points):
        return others
    values = np.array(_at([other.argument for other in others], variables, points))
    steady = np.ptp(values, axis=0) <= UNFELT * np.abs(values).max(axis=0)
    return [other for other, known in zip(others, steady, strict=True) if not known]


def _branch(stated: _Stated, sides: Sequence[tuple[Switch, int | None]]) -> Expression | None:
    """The expressions with each switch held on a side, 1 where its argument is negative; None where it has no two.

    A side that is None is the switch itself.
    """
    two_sided = True

    def on_side(operation: int, operands: Sequence[Expression], turn: np.ndarray) -> Expression:
        """The operation on the side of its switch; its first operand once anything has no two sides."""
        nonlocal two_sided
        two_sided = two_sided and operation in SIDES
        if not two_sided:
            return operands[0]
        which = int(np.flatnonzero(turn)[0])
        side = sides[which][1]
        if side is None:
            return ON_ITSELF[operation](*operands)
        return SIDES[operation](*operands, side if turn[which] > 0 else 1 - side)

    branch = stated.rewritten([switch for switch, _ in sides], on_side)
    return branch if two_sided else None


def _same(here: Expression, there: Expression, variables: Expression, switch: Switch) -> bool:
    """Whether the entries of two expressions agree wherever they were tried on a switch.

    Their difference is held against what it is elsewhere, and against their own round-off.
    """
    tried, seen, columns = 0, False, (here - there, here, there)
    for wide in WIDE:
        on, off = (
            np.array([v for v in _at(columns, variables, points) if np.isfinite(v).all()]).reshape(-1, 3, here.numel())
            for points in (_points_on(switch, variables, wide * STARTS), wide * STARTS)
        )
        tried += len(on)
        elsewhere = np.abs(off[:, 0]).max(axis=0, initial=0.0)
        seen = seen or bool(elsewhere.any())
        if np.any(np.abs(on[:, 0]) > np.maximum(UNFELT * elsewhere, SWITCH_ROUND_OFF * np.abs(on[:, 1:]).sum(1))):
            return False
    # what vanishes wherever it was tried may be narrow
    return tried >= ENOUGH_POINTS and seen


def _at(rows: Sequence[Expression], variables: Expression, points: Iterable[np.ndarray]) -> list[np.ndarray]:
    """The entries of expressions at points, which have entries to spare."""
    function = ca.Function("rows", [variables], [ca.densify(ca.vertcat(*map(ca.vec, rows)))])
    return [np.asarray(function(point[: variables.numel()])).ravel() for point in points]


def _size_unfelt(stated: _Stated, switch: Switch) -> bool:
    """Whether expressions have the same gradient on either side of a switch that is a kink."""
    size, variables = ca.SX.sym("size"), stated.variables

    def sized(operation: int, operands: Sequence[Expression], _: np.ndarray) -> Expression | None:
        """The operation with ``size`` for the size of the difference of its sides; None of what is no kink."""
        if operation not in CONTINUOUS:
            return None
        a, b = operands[0], operands[-1]
        return {ca.OP_FABS: size, ca.OP_FMAX: 0.5 * (a + b + size), ca.OP_FMIN: 0.5 * (a + b - size)}[operation]

    written = stated.rewritten([switch], sized)
    rates = ca.sparsify(ca.jacobian(written, size))
    felt = ca.Function("felt", [variables, size], [ca.densify(rates)])
    found = _points_on(switch, variables, STARTS)
    ratios = [_felt(felt, there, 0.0) / max(_felt(felt, there, 1.0), 1e-300) for there in found]
    known = [ratio for ratio in ratios if np.isfinite(ratio)]
    if rates.nnz() and not any(_felt(felt, start[: variables.numel()], 1.0) > 0.0 for start in STARTS):
        return False  # what is felt nowhere that was tried may be narrow
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
