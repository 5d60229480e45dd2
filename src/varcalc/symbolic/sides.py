"""A function that switches, read as one smooth function for each side on which its switches may be.

Each switch is an argument and a side: above zero or below it, or, for what switches at every whole number (floor,
fmod), how many whole numbers lie below. On one side |u| is u or -u, a comparison is true or not, and of if_else only
the branch that is meant is left, so that the other one need not even be a number there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.instructions import Instruction, in_numbers, interpret, operate, program
from varcalc.symbolic.nearest import nearest
from varcalc.symbolic.switches import STEPPED, arguments, likeness
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
    """An expression, or a number, and the places that it hangs on."""

    written: Expression | float
    of: frozenset[int] = frozenset()


_EVERY, _OWN = slice(None), slice(-1)
"""Of the results of a function, after which the arguments of its places come."""


class _Branches:
    """The operations of an SX ``function``, of which those alone are carried out that a result is made of.

    ``uses`` are what all operations switch by, in order. What is not meant on a side is left alone: of a table that is
    written as one branch inside the other there is a piece for every knot.
    """

    def __init__(self, function: ca.Function, uses: Sequence[tuple[int, int] | None]) -> None:
        self.steps: list[tuple[Instruction, tuple[int, ...], Sequence[tuple[int, int] | None]]] = []
        self.ends: list[list[int]] = [[-1] * function.nnz_out(k) for k in range(function.n_out())]
        written: dict[int, int] = {}
        left = 0
        for number, one in enumerate(program(function).steps):
            sources = tuple(written[s] for s in one.sources if one.operation != ca.OP_INPUT)
            count = len(arguments(one.operation, [ca.SX(1)] * len(sources))) if sources else 0
            self.steps.append((one, sources, uses[left : left + count]))
            left += count
            if one.operation == ca.OP_OUTPUT:
                self.ends[one.place[0]][one.place[1]] = sources[0]
            else:
                written[one.target] = number

    def run(
        self, given: Sequence[Sequence[_Part]], applied: Callable[..., _Part], results: slice = _EVERY
    ) -> list[list[_Part]]:
        """The nonzeros of some ``results``; ``applied`` takes an operation, its operands, the places it switches at."""
        done: dict[int, _Part] = {}
        for end in (end for column in self.ends[results] for end in column if end >= 0):
            stack = [end]
            while stack:
                number = stack[-1]
                one, sources, uses = self.steps[number]
                if one.operation in (ca.OP_CONST, ca.OP_INPUT):
                    constant = one.operation == ca.OP_CONST
                    done[number] = _Part(one.constant) if constant else given[one.sources[0]][one.sources[1]]
                    stack.pop()
                    continue
                meant = self._meant(one.operation, sources, done)
                missing = [s for s in meant if s not in done]
                if missing:
                    stack += missing
                    continue
                stack.pop()
                parts = [done[s] for s in meant]
                if one.operation == ca.OP_IF_ELSE_ZERO and isinstance(parts[0].written, float):
                    of = frozenset[int]().union(*(part.of for part in parts))
                    done[number] = _Part(parts[1].written if len(parts) > 1 else 0.0, of)
                else:
                    done[number] = applied(one.operation, parts, uses)
        return [[done[end] if end >= 0 else _Part(0.0) for end in column] for column in self.ends[results]]

    def _meant(self, operation: int, sources: tuple[int, ...], done: dict[int, _Part]) -> tuple[int, ...]:
        """Of what an operation takes that which must be known: what a branch is only where its condition holds."""
        if operation != ca.OP_IF_ELSE_ZERO:
            return sources
        condition = done.get(sources[0])
        if condition is None:
            return sources[:1]
        return sources[:1] if isinstance(condition.written, float) and not condition.written else sources


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
        written, used = self._interpreted(self.function)
        places, _ = self._placed(used, ())
        own = [ca.vertcat(*column) for column in written]
        whole = ca.Function("whole", self.symbols, [*own, ca.vertcat(*(p.argument for p in places))])
        return places, whole, self._placed(self._interpreted(whole)[1], places)[1]

    def _interpreted(self, function: ca.Function) -> tuple[list[list[Expression]], list[SwitchingArgument | None]]:
        """The results of a function of the symbols, and what its operations switch by; None for what is still."""
        used: list[SwitchingArgument | None] = []
        along = ca.vertcat(*(self.symbols[k] for k in self.moving))

        def applied(operation: int, operands: Sequence[Expression]) -> Expression:
            """The operation; what it switches by is noted."""
            used.extend(
                SwitchingArgument(argument, operation in STEPPED) if _moves(argument, along) else None
                for argument in arguments(operation, operands)
            )
            return operate(operation, operands)

        return interpret(function, [s.nonzeros() for s in self.symbols], ca.SX, applied), used

    def _placed(
        self, used: Sequence[SwitchingArgument | None], known: Sequence[SwitchingArgument]
    ) -> tuple[tuple[SwitchingArgument, ...], tuple[tuple[int, int] | None, ...]]:
        """The places, the ``known`` ones first, and at which each argument switches, 1 or -1 as it has its sign."""
        places, every = list(known), [*known, *(one for one in used if one is not None)]
        own = [one.argument for one in every]
        same = likeness(own, own, ca.vertcat(*map(ca.vec, self.symbols)))
        stepped = np.array([one.stepped for one in every], dtype=bool)
        same[stepped[:, None] != stepped] = 0
        same[stepped & (same < 0)] = 0  # the whole numbers below are others
        rows, number, uses = list(range(len(known))), len(known), list[tuple[int, int] | None]()
        for one in used:
            if one is None:
                uses.append(None)
                continue
            alike = np.flatnonzero(same[rows, number]) if rows else np.zeros(0, dtype=int)
            if not len(alike):
                rows.append(number)
                places.append(one)
            place = int(alike[0]) if len(alike) else len(rows) - 1
            uses.append((place, int(same[rows[place], number]) or 1))
            number += 1
        return tuple(places), tuple(uses)

    @cached_property
    def _branches(self) -> _Branches:
        _, whole, uses = self._read
        return _Branches(whole, uses)

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

    def formula(self, numbers: Sequence[int]) -> Expression:
        """The one result of the function alone on sides that :meth:`at` tells, of its own symbols."""
        side = [0 if p.stepped else int(n) or 1 for p, n in zip(self.places, numbers, strict=True)]
        return ca.vertcat(
            *(ca.SX(part.written) for part in self._on(side, [int(numbers[k]) for k in self.stepped], _OWN)[0])
        )

    def values(self, points: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        """The one result at ``points`` (m, d), each on the sides ``numbers`` (m, places) that :meth:`at` tells."""
        side = list(numbers.T)
        step = {k: np.stack([numbers[:, k], numbers[:, k] + (numbers[:, k] < 0)]) for k in self.stepped}
        left = iter(self._read[2])

        def applied(operation: int, operands: Sequence[np.ndarray]) -> np.ndarray:
            used = [next(left) for _ in arguments(operation, operands)]
            return np.asarray(_held(operation, operands, side, step, used, _IN_NUMBERS))

        with np.errstate(all="ignore"):
            found = interpret(self._read[1], [list(points.T)], np.array, applied)[0][0]
        return np.broadcast_to(found, len(points))

    def on(self, side: Sequence[int], below: Sequence[int] | None = None) -> FunctionOnSide:
        """The function on one ``side``, of the symbols and counts, or with the whole numbers ``below`` put in."""
        found = self._on(side, below, _EVERY)
        *results, places = (ca.vertcat(*(ca.SX(part.written) for part in column)) for column in found)
        live = frozenset[int]().union(*(part.of for column in found[:-1] for part in column))
        along = ca.vertcat(*(self.symbols[k] for k in self.moving))
        # what hangs on no other place moves, as it does wherever it is asked for
        still = frozenset(k for k, part in enumerate(found[-1]) if part.of and not ca.depends_on(places[k], along))
        return FunctionOnSide(results, places, live, still)

    def _on(self, side: Sequence[int], below: Sequence[int] | None, results: slice) -> list[list[_Part]]:
        """Some results, the places last, on one side."""
        counts = self.counts if below is None else ca.vertcat(ca.SX(0, 1), *(v for b in below for v in _counts(b)))
        step = {k: counts[2 * number : 2 * number + 2] for number, k in enumerate(self.stepped)}

        def applied(operation: int, operands: Sequence[_Part], used: Sequence[tuple[int, int] | None]) -> _Part:
            """The operation on the side, and the places that it hangs on."""
            written = [part.written for part in operands]
            of = frozenset(use[0] for use in used if use is not None).union(*(part.of for part in operands))
            if all(isinstance(part, float) for part in written):
                return _Part(float(in_numbers(operation)(*written)), of)
            return _Part(_plain(_held(operation, written, side, step, used, _ON_ONE_SIDE)), of)

        return self._branches.run([[_Part(e) for e in s.nonzeros()] for s in self.symbols], applied, results)

    @property
    def stepped(self) -> tuple[int, ...]:
        """The numbers of the places that are stepped."""
        return tuple(k for k, place in enumerate(self.places) if place.stepped)


def _counts(below: int) -> tuple[int, int]:
    """The whole number below, and the one nearer to zero."""
    return below, below + (below < 0)


def _plain(written: Expression) -> Expression | float:
    """What is a constant as a number."""
    return float(written) if not isinstance(written, ca.SX) or written.is_constant() else written


def _moves(argument: Expression, along: Expression) -> bool:
    return not argument.is_constant() and bool(ca.depends_on(argument, along))


@dataclass(frozen=True)
class _Algebra:
    """What is done on sides that are numbers, or arrays of them: a choice by a condition, and operations."""

    choose: Callable[[Any, Any, Any], Any]
    operate: Callable[[int, Sequence[Any]], Any]


_ON_ONE_SIDE = _Algebra(lambda condition, a, b: a if condition else b, operate)
_IN_NUMBERS = _Algebra(np.where, lambda operation, operands: in_numbers(operation)(*operands))


def _held(
    operation: int, operands: Sequence[Any], side: Sequence[Any], step: Mapping[int, Any],
    uses: Sequence[tuple[int, int] | None], algebra: _Algebra,
) -> Any:  # fmt: skip
    """What an operation is on a side, by its uses of places."""
    a, b, choose = operands[0], operands[-1], algebra.choose
    if operation == ca.OP_COPYSIGN:
        size, sign = uses
        size = algebra.operate(ca.OP_FABS, [a]) if size is None else side[size[0]] * size[1] * a
        if sign is None:
            return algebra.operate(operation, [size, b])
        return choose(side[sign[0]] * sign[1] < 0, -size, size)
    if not uses or uses[0] is None:
        return algebra.operate(operation, operands)
    place, turned = uses[0]
    if operation in STEPPED:
        below, nearer = step[place][0], step[place][1]
        return {
            ca.OP_FLOOR: below, ca.OP_CEIL: below + 1, ca.OP_FMOD: a - b * nearer, ca.OP_REMAINDER: a - b * below,
        }[operation]  # fmt: skip
    sign = side[place] * turned
    return {
        ca.OP_FABS: choose(sign > 0, a, -a),
        ca.OP_SIGN: sign,
        ca.OP_FMIN: choose(sign > 0, b, a),
        ca.OP_FMAX: choose(sign > 0, a, b),
        ca.OP_LT: choose(sign < 0, 1.0, 0.0),
        ca.OP_LE: choose(sign <= 0, 1.0, 0.0),
        ca.OP_EQ: choose(sign == 0, 1.0, 0.0),
        ca.OP_NE: choose(sign != 0, 1.0, 0.0),
    }[operation]
