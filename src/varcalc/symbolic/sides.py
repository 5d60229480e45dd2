"""A function that switches, read as one smooth function for each side on which its switches may be.

Each switch is an argument and a side: above zero or below it, or, for what switches at every whole number (floor,
fmod), how many whole numbers lie below. On one side |u| is u or -u, a comparison is true or not, and of if_else only
the branch that is meant is left, so that the other one need not even be a number there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.instructions import interpret, operate
from varcalc.symbolic.nearest import nearest
from varcalc.symbolic.switches import STEPPED, alike, arguments
from varcalc.symbolic.tracing import Expression


@dataclass(frozen=True)
class SwitchingArgument:
    """One argument that switches, as an expression of the function's own symbols."""

    argument: Expression
    stepped: bool


@dataclass(frozen=True)
class FunctionOnSide:
    """The ``results`` of a function on one side, with the ``arguments`` of all places, and which of these are ``live``.

    The others are of branches that are not meant on this side, where they need not be numbers. Those that are ``still``
    depend on nothing but counts: they change only where another place is crossed.
    """

    results: list[Expression]
    arguments: Expression
    live: frozenset[int]
    still: frozenset[int]


@dataclass(frozen=True)
class ExpressionOnSide:
    """What an ``expression`` is on one side of each of its switches.

    ``ends`` vanish where the piece does; ``beyond`` holds for each of them the place that is crossed and the new side.
    Whole numbers are put in, or are symbols for which ``counts`` stand.
    """

    expression: Expression
    ends: tuple[Expression, ...]
    beyond: tuple[tuple[int, int], ...]
    counts: tuple[float, ...] = ()


@dataclass(frozen=True)
class _Part:
    """An expression, and the places that it hangs on."""

    written: Expression
    of: frozenset[int] = frozenset()


@dataclass(frozen=True)
class Sides:
    """The SX ``function``, with dense results, some of whose inputs, ``moving``, change along a run.

    What depends on none of those does not switch. A side is a tuple of one number for each of the :attr:`places`: 1
    above and -1 below, 0 for what is zero and still, and 0 for what is stepped.
    """

    function: ca.Function
    moving: tuple[int, ...]
    own: tuple[Expression, ...] = ()
    """Symbols in the shapes of the inputs; new ones where there are none."""

    @classmethod
    def of(cls, expression: Expression, symbols: Expression) -> Sides:
        """Those of an SX ``expression`` of a column of ``symbols``."""
        return cls(ca.Function("switching", [symbols], [ca.densify(ca.SX(expression))]), (0,), (symbols,))

    def __len__(self) -> int:
        return len(self.places)

    @cached_property
    def symbols(self) -> list[Expression]:
        """Symbols in the shapes of the function's inputs."""
        f = self.function
        return list(self.own) or [ca.SX.sym(f.name_in(k), f.numel_in(k)) for k in range(f.n_in())]

    @cached_property
    def _read(self) -> tuple[tuple[SwitchingArgument, ...], ca.Function, tuple[tuple[int, int] | None, ...]]:
        """The places; the function with their arguments as one result more; and its uses of them, in order.

        A use is the place at which an operation switches, with its orientation there.
        """
        places: list[SwitchingArgument] = []
        written, _ = self._interpreted(self.function, places)
        own = [ca.vertcat(*column) for column in written]
        whole = ca.Function("whole", self.symbols, [*own, ca.vertcat(*(p.argument for p in places))])
        return tuple(places), whole, self._interpreted(whole, places)[1]

    def _interpreted(
        self, function: ca.Function, places: list[SwitchingArgument]
    ) -> tuple[list[list[Expression]], tuple[tuple[int, int] | None, ...]]:
        uses: list[tuple[int, int] | None] = []
        along = ca.vertcat(*(self.symbols[k] for k in self.moving))

        def applied(operation: int, operands: Sequence[Expression]) -> Expression:
            uses.extend(
                _placed(places, argument, operation in STEPPED) if _moves(argument, along) else None
                for argument in arguments(operation, operands)
            )
            return operate(operation, operands)

        return interpret(function, [s.nonzeros() for s in self.symbols], ca.SX, applied), tuple(uses)

    @property
    def places(self) -> tuple[SwitchingArgument, ...]:
        """What switches, in the order in which it is computed."""
        return self._read[0]

    @cached_property
    def counts(self) -> Expression:
        """Two symbols for each place that is stepped: the whole number below, and the one nearer to zero."""
        return ca.SX.sym("counts", 2 * sum(p.stepped for p in self.places))

    @cached_property
    def arguments(self) -> ca.Function:
        """All arguments that switch, by their values."""
        return ca.Function("places", self.symbols, [ca.vertcat(*(p.argument for p in self.places))])

    @cached_property
    def _values(self) -> PointEvaluator:
        return PointEvaluator(self.arguments)

    def at(self, points: np.ndarray) -> np.ndarray:
        """On which sides (m, places) points (m, d) are, of a function of one column: of what is stepped, its number.

        Where an argument is no number, its operation is not asked for.
        """
        values = np.nan_to_num(self._values(len(points), points), nan=1.0)
        return np.where([p.stepped for p in self.places], np.floor(values), np.sign(values)).astype(int)

    def piece(self, numbers: Sequence[int], *, counted: bool = False) -> ExpressionOnSide:
        """The one result of the function on sides that :meth:`at` tells, and where that ends, of its own symbols.

        Where it is ``counted`` whole numbers stay the symbols :attr:`counts`, unless it is on a switch: what these make
        of that is then put in. Of places at which multiples of one
        expression, or what is a number more, vanish, those that are met before others are ends.
        """
        counted &= not any(n == 0 and not p.stepped for p, n in zip(self.places, numbers, strict=True))
        below = [int(numbers[k]) for k in self.stepped]
        side = [0 if p.stepped else int(n) or 1 for p, n in zip(self.places, numbers, strict=True)]
        one = self.on(side, None if counted else below)
        ends: list[tuple[Expression, tuple[int, int]]] = []
        moving = sorted(one.live - one.still)
        plain = [k for k in moving if not self.places[k].stepped]
        first = nearest([one.arguments[k] for k in plain], [int(numbers[k]) or 1 for k in plain])
        for k in moving:
            argument, side = one.arguments[k], int(numbers[k]) or 1
            if self.places[k].stepped:
                side = int(numbers[k])
                lower = self.counts[2 * self.stepped.index(k)] if counted else side
                ends += [(argument - lower, (k, side - 1)), (argument - (lower + 1), (k, side + 1))]
            elif (number := plain.index(k)) in first:
                ends.append((first[number], (k, -side)))
        counts = tuple(float(v) for b in below for v in _counts(b)) if counted else ()
        return ExpressionOnSide(
            one.results[0], tuple(end for end, _ in ends), tuple(other for _, other in ends), counts
        )

    def on(self, side: Sequence[int], below: Sequence[int] | None = None) -> FunctionOnSide:
        """The function on one ``side``, of the symbols and counts, or with the whole numbers ``below`` put in."""
        _, whole, uses = self._read
        counts = self.counts if below is None else ca.vertcat(ca.SX(0, 1), *(v for b in below for v in _counts(b)))
        step = {k: counts[2 * number : 2 * number + 2] for number, k in enumerate(self.stepped)}
        left = iter(uses)

        def applied(operation: int, operands: Sequence[_Part]) -> _Part:
            written = [part.written for part in operands]
            used = [next(left) for _ in arguments(operation, written)]
            if operation == ca.OP_IF_ELSE_ZERO and written[0].is_constant():
                meant = bool(float(written[0]))
                of = operands[0].of | (operands[1].of if meant else frozenset())
                return _Part(written[1] if meant else ca.SX(0), of)
            of = frozenset(use[0] for use in used if use is not None).union(*(part.of for part in operands))
            if used and all(part.is_constant() for part in written):
                return _Part(operate(operation, written), of)
            return _Part(_held(operation, written, side, step, used), of)

        found = interpret(whole, [[_Part(e) for e in s.nonzeros()] for s in self.symbols], _constant, applied)
        *results, places = (ca.vertcat(*(part.written for part in column)) for column in found)
        live = frozenset[int]().union(*(part.of for column in found[:-1] for part in column))
        along = ca.vertcat(*(self.symbols[k] for k in self.moving))
        still = frozenset(k for k in range(len(self)) if not ca.depends_on(places[k], along))
        return FunctionOnSide(results, places, live, still)

    @property
    def stepped(self) -> tuple[int, ...]:
        """The numbers of the places that are stepped."""
        return tuple(k for k, place in enumerate(self.places) if place.stepped)


def _counts(below: int) -> tuple[int, int]:
    """The whole number below, and the one nearer to zero."""
    return below, below + (below < 0)


def _constant(number: float) -> _Part:
    return _Part(ca.SX(number))


def _moves(argument: Expression, along: Expression) -> bool:
    return not argument.is_constant() and bool(ca.depends_on(argument, along))


def _placed(places: list[SwitchingArgument], argument: Expression, stepped: bool) -> tuple[int, int]:
    """The number of the place at which ``argument`` switches, and 1 or -1 as it has the place's sign or the other."""
    for k, known in enumerate(places):
        same = alike(known.argument, argument) if known.stepped == stepped else 0
        if same == 1 or (same == -1 and not stepped):
            return k, same
    places.append(SwitchingArgument(argument, stepped))
    return len(places) - 1, 1


def _held(
    operation: int, operands: Sequence[Expression], side: Sequence[int], step: dict[int, Expression],
    uses: Sequence[tuple[int, int] | None],
) -> Expression:  # fmt: skip
    """What an operation is on a side, by its uses of places."""
    a, b = operands[0], operands[-1]
    if operation == ca.OP_COPYSIGN:
        size, sign = uses
        size = ca.fabs(a) if size is None else side[size[0]] * size[1] * a
        return ca.copysign(size, b) if sign is None else side[sign[0]] * sign[1] * size
    if not uses or uses[0] is None:
        return operate(operation, operands)
    place, turned = uses[0]
    if operation in STEPPED:
        below, nearer = step[place][0], step[place][1]
        return {
            ca.OP_FLOOR: below, ca.OP_CEIL: below + 1, ca.OP_FMOD: a - b * nearer, ca.OP_REMAINDER: a - b * below,
        }[operation]  # fmt: skip
    sign = side[place] * turned
    return {
        ca.OP_FABS: a if sign > 0 else -a,
        ca.OP_SIGN: ca.SX(sign),
        ca.OP_FMIN: b if sign > 0 else a,
        ca.OP_FMAX: a if sign > 0 else b,
        ca.OP_LT: ca.SX(sign < 0),
        ca.OP_LE: ca.SX(sign <= 0),
        ca.OP_EQ: ca.SX(sign == 0),
        ca.OP_NE: ca.SX(sign != 0),
    }[operation]
