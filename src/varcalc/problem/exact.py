"""A problem as its functions were written: CasADi puts numbers together as an expression is built, and rounds.

Of 5*(0.2*y) it makes y, of 0.1*(0.3*y) one product, and of 0.3*y + 0.7*y again y. Numbers that are parameters it
leaves alone, whatever is later done with the expression. What stays in it are exponents, and few powers of two, with
which CasADi's rules are exact.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca

from varcalc.problem.conditions import OfFunction
from varcalc.problem.functional import Functional, rebuilt
from varcalc.problem.problem import Problem
from varcalc.symbolic.derived import derived
from varcalc.symbolic.instructions import POWERS, Program, operate
from varcalc.symbolic.tracing import Expression, TracedFunction, as_written

STAYING = frozenset({0.0, 0.25, 0.5, 1.0, 2.0, 4.0})
"""Sizes of numbers that stay: products and quotients of these are exact, and no sum of two is rounded."""
EXACT = frozenset({ca.OP_ADD, ca.OP_SUB, ca.OP_MUL, ca.OP_DIV, ca.OP_NEG, ca.OP_TWICE, ca.OP_SQ, ca.OP_ASSIGN})
"""Operations that make a number of numbers that stay without rounding; of others, as sqrt(2), no number is made."""


def exactly(problem: Functional) -> Functional | None:
    """The same problem with the numbers that its functions hold as parameters; itself where they hold none.

    None where CasADi's expression is all there is: of a problem that came from another process or a file, and of one
    whose functions have since become others.
    """
    original = problem.original or problem
    found = _exactly(original)
    if found is None or problem is original:
        return found
    return problem if found is original else found.with_parameters(problem.parameters)


@derived
def _exactly(problem: Functional) -> Functional | None:
    if problem.symbols.kind is not ca.SX:
        return problem
    moved = problem.end_cost is not None and problem.end_parameters
    if moved or any(isinstance(function, TracedFunction) for function in _given(problem)):
        return None
    with as_written():
        anew = problem.retraced()
        written = _traced(anew)
    if not all(_alike(*pair) for pair in zip(_traced(problem), written, strict=True)):
        return None
    numbers = _Numbers({*problem.parameters, *problem.unknowns})
    fixed = [None] * 2 if problem.end_cost is None else _abscissae(problem, numbers)
    for traced in written:
        numbers.named(traced)  # so that all numbers are known when the first function is stated
    if not (numbers.values or any(problem.slides)):
        return problem
    (lagrangian, *_, constraints), options = anew.sent(numbers.named)
    ends = [end.stated(_unfolded(end.function)) if isinstance(end, OfFunction) else end for end in problem.templates]
    options["end_cost"] = options["end_cost"] and _at(fixed, options["end_cost"])
    options["parameters"] = problem.parameters | numbers.values
    return rebuilt(type(problem), (lagrangian, *ends, constraints), options)


def _abscissae(problem: Functional, numbers: _Numbers) -> list[str | None]:
    """The names of the parameters for the abscissae of a graph's ends; None for one that slides."""
    if not isinstance(problem, Problem):
        return [None, None]
    return [None if slides else numbers.name(x) for x, slides in zip(problem.span, problem.slides, strict=True)]


def _at(fixed: Sequence[str | None], cost: Callable[..., Any]) -> Callable[..., Any]:
    """What ends cost, at abscissae that are parameters: as numbers they would be put together with others."""
    if not any(fixed):
        return cost

    def end_cost(x0: Any, y0: Any, x1: Any, y1: Any, p: Any) -> Any:
        a, b = (x if name is None else getattr(p, name) for x, name in zip((x0, x1), fixed, strict=True))
        return cost(a, y0, b, y1, p)

    return end_cost


def _given(problem: Functional) -> list[Callable[..., Any] | None]:
    """The functions that a problem was given."""
    conditions = [c for c in (*problem.templates, *problem.constraints) if isinstance(c, OfFunction)]
    return [problem.lagrangian, problem.end_cost, *(c.function for c in conditions)]


def _traced(problem: Functional) -> list[TracedFunction]:
    """What the functions of a problem gave."""
    found: list[TracedFunction] = []

    def kept(traced: TracedFunction) -> TracedFunction:
        found.append(traced)
        return traced

    problem.sent(kept)
    return found


def _alike(simplified: TracedFunction, written: TracedFunction) -> bool:
    """Whether CasADi makes one of the other, step by step."""
    symbols = _symbols(written.function)
    again = ca.Function("again", symbols, written.function.call(symbols, True, False))
    return Program(simplified.function).steps == Program(again).steps


def _symbols(function: ca.Function) -> list[Expression]:
    return [ca.SX.sym(f"a{k}", *function.size_in(k)) for k in range(function.n_in())]


def _unfolded(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function that ends slide on, which is called without parameters: its expression stays as it is written."""

    def phi(*place: Expression) -> Expression:
        with as_written():
            return function(*place)

    return phi


class _Numbers:
    """The numbers of functions: ``values`` by the names of the parameters that stand for them."""

    def __init__(self, taken: set[str]) -> None:
        self._taken, self.values = taken, dict[str, float]()
        self._symbols = dict[float, Expression]()

    def named(self, traced: TracedFunction) -> TracedFunction:
        """The same function with parameters for its numbers, and for those of the functions named before."""
        if not traced.names:
            return traced  # ends slide on it: it is called without parameters
        symbols = _symbols(traced.function)
        entries = [ca.vertsplit(s) if s.numel() else [] for s in symbols]
        found = Program(traced.function).run(entries, ca.SX, self._applied)
        results = [ca.vertcat(*map(self._named, row)) for row in found]
        numbers = ca.vertcat(ca.SX(0, 1), *self._symbols.values())
        function = ca.Function("traced", [*symbols, numbers], results)
        return TracedFunction(function, (*traced.names, tuple(self.values)), traced.__name__)

    def _applied(self, operation: int, operands: Sequence[Expression]) -> Expression:
        # exponents tell what a power is
        entries = [e if k and operation in POWERS else self._named(e) for k, e in enumerate(operands)]
        if operation not in EXACT and all(e.is_constant() for e in entries):
            entries = [self._symbol(float(e)) for e in entries]
        return operate(operation, entries)

    def _named(self, entry: Expression) -> Expression:
        """What stands for an expression: a parameter where it is a number that does not stay."""
        if not entry.is_constant() or abs(float(entry)) in STAYING or not math.isfinite(float(entry)):
            return entry
        return self._symbol(float(entry))

    def name(self, value: float) -> str:
        """The name of the parameter that stands for a number."""
        return self._symbol(value).name()

    def _symbol(self, value: float) -> Expression:
        if value not in self._symbols:
            name = f"number_{len(self.values)}"
            while name in self._taken:
                name += "_"
            self.values[name], self._symbols[value] = value, ca.SX.sym(name)
        return self._symbols[value]
