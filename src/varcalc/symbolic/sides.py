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

from varcalc.symbolic.instructions import interpret
from varcalc.symbolic.switches import STEPPED, alike, arguments
from varcalc.symbolic.tracing import Expression


@dataclass(frozen=True)
class Place:
    """One argument that switches, as an expression of the function's own symbols."""

    argument: Expression
    stepped: bool


@dataclass(frozen=True)
class Side:
    """The ``results`` of a function on one side, with the ``arguments`` of all places, and which of these are ``live``.

    The others are of branches that are not meant on this side, where they need not be numbers.
    """

    results: list[Expression]
    arguments: Expression
    live: frozenset[int]


@dataclass(frozen=True)
class _Part:
    """An expression, and the places that it hangs on."""

    written: Expression
    of: frozenset[int] = frozenset()


@dataclass(frozen=True)
class Sides:
    """The SX ``function``, with dense results, some of whose inputs, ``moving``, change along a run.

    What depends on none of those does not switch. A side is a tuple of one number for each of the :attr:`places`: 1
    above and -1 below, and for what is stepped 0.
    """

    function: ca.Function
    moving: tuple[int, ...]

    @cached_property
    def symbols(self) -> list[Expression]:
        """Symbols in the shapes of the function's inputs."""
        f = self.function
        return [ca.SX.sym(f.name_in(k), f.numel_in(k)) for k in range(f.n_in())]

    @cached_property
    def _read(self) -> tuple[tuple[Place, ...], ca.Function, tuple[tuple[int, int] | None, ...]]:
        """The places; the function with their arguments as one result more; and its uses of them, in order.

        A use is the place at which an operation switches, with its orientation there.
        """
        places: list[Place] = []
        written, _ = self._interpreted(self.function, places)
        own = [ca.vertcat(*column) for column in written]
        whole = ca.Function("whole", self.symbols, [*own, ca.vertcat(*(p.argument for p in places))])
        return tuple(places), whole, self._interpreted(whole, places)[1]

    def _interpreted(
        self, function: ca.Function, places: list[Place]
    ) -> tuple[list[list[Expression]], tuple[tuple[int, int] | None, ...]]:
        uses: list[tuple[int, int] | None] = []
        along = ca.vertcat(*(self.symbols[k] for k in self.moving))

        def applied(operation: int, operands: Sequence[Expression]) -> Expression:
            uses.extend(
                _placed(places, argument, operation in STEPPED) if _moves(argument, along) else None
                for argument in arguments(operation, operands)
            )
            return _plain(operation, operands)

        return interpret(function, [s.nonzeros() for s in self.symbols], ca.SX, applied), tuple(uses)

    @property
    def places(self) -> tuple[Place, ...]:
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

    def on(self, side: Sequence[int]) -> Side:
        """The function on one ``side``, of the symbols and counts."""
        _, whole, uses = self._read
        step = {k: self.counts[2 * number : 2 * number + 2] for number, k in enumerate(self.stepped)}
        left = iter(uses)

        def applied(operation: int, operands: Sequence[_Part]) -> _Part:
            written = [part.written for part in operands]
            used = [next(left) for _ in arguments(operation, written)]
            if operation == ca.OP_IF_ELSE_ZERO and written[0].is_constant():
                meant = bool(float(written[0]))
                of = operands[0].of | (operands[1].of if meant else frozenset())
                return _Part(written[1] if meant else ca.SX(0), of)
            of = frozenset(use[0] for use in used if use is not None).union(*(part.of for part in operands))
            return _Part(_held(operation, written, side, step, used), of)

        found = interpret(whole, [[_Part(e) for e in s.nonzeros()] for s in self.symbols], _constant, applied)
        *results, places = (ca.vertcat(*(part.written for part in column)) for column in found)
        live = frozenset[int]().union(*(part.of for column in found[:-1] for part in column))
        return Side(results, places, live)

    @property
    def stepped(self) -> tuple[int, ...]:
        """The numbers of the places that are stepped."""
        return tuple(k for k, place in enumerate(self.places) if place.stepped)


def _constant(number: float) -> _Part:
    return _Part(ca.SX(number))


def _moves(argument: Expression, along: Expression) -> bool:
    return not argument.is_constant() and bool(ca.depends_on(argument, along))


def _plain(operation: int, operands: Sequence[Expression]) -> Expression:
    return ca.SX.unary(operation, *operands) if len(operands) == 1 else ca.SX.binary(operation, *operands)


def _placed(places: list[Place], argument: Expression, stepped: bool) -> tuple[int, int]:
    """The number of the place at which ``argument`` switches, and 1 or -1 as it has the place's sign or the other."""
    for k, known in enumerate(places):
        same = alike(known.argument, argument) if known.stepped == stepped else 0
        if same == 1 or (same == -1 and not stepped):
            return k, same
    places.append(Place(argument, stepped))
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
        return _plain(operation, operands)
    place, turned = uses[0]
    if operation in STEPPED:
        below, nearer = step[place][0], step[place][1]
        return {
            ca.OP_FLOOR: below, ca.OP_CEIL: below + 1, ca.OP_FMOD: a - b * nearer, ca.OP_REMAINDER: a - b * below,
        }[operation]  # fmt: skip
    above = side[place] * turned > 0
    return {
        ca.OP_FABS: a if above else -a,
        ca.OP_SIGN: ca.SX(1 if above else -1),
        ca.OP_FMIN: b if above else a,
        ca.OP_FMAX: a if above else b,
        ca.OP_LT: ca.SX(not above),
        ca.OP_LE: ca.SX(not above),
        ca.OP_EQ: ca.SX(0),
        ca.OP_NE: ca.SX(1),
    }[operation]
