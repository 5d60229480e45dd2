"""What a problem asks, in words and formulas: its functional, ends, conditions and Euler-Lagrange equation."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from typing import Any

import casadi as ca

from varcalc.axes import latex_name
from varcalc.problem.conditions import Bound, Isoperimetric, Parameter, Through, components
from varcalc.problem.functional import Functional, Traced
from varcalc.problem.reading import left_sides
from varcalc.problem.reading.reader import FACTORED, Named, names
from varcalc.problem.reading.sums import Sum
from varcalc.problem.reading.writing import LATEX, TEXT, Style, write
from varcalc.showing import FACT_WIDTH, Fact, equations, listed
from varcalc.symbolic.tracing import Expression

MOST_LINES = 3
"""Conditions, and components of the equation, that are told one by one: a print stays a few lines."""
LONGEST_LATEX = 1500
"""Characters of a formula in a notebook, where so many fill a screen."""
LEGIBLE = 75
"""Operations of an equation: of one that has more there is nothing to be read."""
LEFT_OUT = "too long to be shown here; varcalc.euler_lagrange_text writes it"
NO_FORMULA = "not written out: L holds a table, or a function that has no formula"


class Writer(ABC):
    """One way to write what a problem asks: as text, or as LaTeX."""

    style: Style
    at_most: str
    free: str

    def __init__(self, problem: Functional) -> None:
        self.problem = problem
        self.graph = problem.axes is not problem.ordinates
        """Whether the curve is a graph over an abscissa."""

    def name(self, name: str) -> str:
        """A name."""
        return self.style.name(name)

    @abstractmethod
    def integral(self, integrand: str) -> str:
        """The integral along the curve."""

    @abstractmethod
    def slides(self, label: str, phi: str) -> str:
        """That an end lies where ``phi`` is zero."""

    def expression(self, expression: Expression, otherwise: str, named: Named | None = None) -> str:
        """A formula; where there is none, the letter that stands for it."""
        total = self._read(expression, named)
        return otherwise if total is None else write(total, self.style)

    def _read(self, expression: Expression, named: Named | None = None) -> Sum | None:
        if self.problem.symbols.kind is not ca.SX:
            return None
        return FACTORED.read(expression, names(self.problem) if named is None else named)

    def integrated(self, integrand: Expression, otherwise: str) -> str:
        """The integral of a formula along the curve, in parentheses where it has several terms."""
        total = self._read(integrand)
        if total is None:
            return self.integral(otherwise)
        written = write(total, self.style)
        return self.integral(self.style.bracket(written) if len(total.terms) > 1 else written)

    def number(self, given: float | Parameter) -> str:
        """A number of an end, or the parameter that it is."""
        return self.name(given.name) if isinstance(given, Parameter) else f"{given:g}"

    def limits(self) -> list[str]:
        """Between which abscissae the curve runs."""
        start, end = self.problem.templates
        if start.periodic:
            return [self.number(start.x0), self.number(start.x1)]
        x = self.problem.abscissa.name
        return [self.name(f"{x}{k}") if e.slides else self.number(e.x) for k, e in ((0, start), (1, end))]

    def values(self, at: str, given: Sequence[Any], primes: str = "") -> str:
        """What the unknown functions are at a place, as far as that is given."""
        told = zip(self.problem.ordinates, given, strict=True)
        return ", ".join(f"{self.name(axis.name + primes)}{at} = {self.number(v)}" for axis, v in told if v is not None)

    def end(self, label: str) -> str:
        """What holds at the start or at the end."""
        end = self.problem.templates[label == "end"]
        s = self.problem.symbols
        if end.slides:
            phi = self.problem.traced_slide(label, s.x, s.y, s.kind)
            return self.slides(label, self.expression(phi, "phi"))
        if not self.graph:
            return self.values("", components("At.q", end.q))
        at = f"({self.number(end.x)})"
        if not end.fixed:
            return ", ".join(f"{self.name(axis.name)}{at}" for axis in self.problem.ordinates) + self.free
        slope = [] if end.dy is None else [self.values(at, components("Fixed.dy", end.dy), "'")]
        return ", ".join([self.values(at, components("Fixed.y", end.y)), *slope])

    def periodic(self) -> str:
        """What holds of a periodic curve."""
        first, last = self.limits() if self.graph else ["0", "1"]
        return ", ".join(f"{n}({first}) = {n}({last})" for n in (self.name(a.name) for a in self.problem.ordinates))

    def condition(self, traced: Traced) -> str:
        """What a constraint demands."""
        constraint, expression = traced.constraint, traced.expression
        if isinstance(constraint, Isoperimetric):
            return self.between(constraint.interval, self.integrated(expression, constraint.written))
        written = self.expression(expression, constraint.written)
        return self.between(constraint.interval if isinstance(constraint, Bound) else (0.0, 0.0), written)

    def between(self, interval: tuple[float, float], middle: str) -> str:
        """That something lies in an interval, or is a number."""
        low, high = interval
        if low == high:
            return f"{middle} = {low:g}"
        left = "" if low == -math.inf else f"{low:g} {self.at_most} "
        return f"{left}{middle}" + ("" if high == math.inf else f" {self.at_most} {high:g}")

    def cost(self, symbols: Sequence[Expression], expression: Expression) -> str:
        """What the ends cost beside the integral."""
        x = self.problem.abscissa.name
        places = [f"{x}0", f"{x}1"] if self.graph else ["0", "1"]
        ends = [[f"{axis.name}({place})" for axis in self.problem.ordinates] for place in places]
        columns = [[places[0]], ends[0], [places[1]], ends[1]] if self.graph else ends
        s, problem = self.problem.symbols, self.problem
        numbers = [(s.parameters, list(problem.parameters)), (s.unknowns, list(problem.unknowns))]
        named = [*zip(symbols, columns, strict=True), *((symbol, labels) for symbol, labels in numbers if labels)]
        return self.expression(expression, "M", named)


class InText(Writer):
    """As text."""

    style = TEXT
    at_most = "<="
    free = " free"

    def integral(self, integrand: str) -> str:
        """The functional in words."""
        if not self.graph:
            return f"integral of {integrand} along the curve"
        x, (first, last) = self.problem.abscissa.name, self.limits()
        return f"integral of {integrand} d{x} from {first} to {last}"

    def slides(self, label: str, phi: str) -> str:  # noqa: ARG002
        """The condition of an end that slides, in words."""
        return f"slides where {phi} = 0"


class InLatex(Writer):
    """As LaTeX."""

    style = LATEX
    at_most = r"\leq"
    free = r"\ \mathrm{free}"

    def integral(self, integrand: str) -> str:
        """The functional as an integral sign."""
        if not self.graph:
            return rf"\int {integrand} \,dt"
        first, last = self.limits()
        return rf"\int_{{{first}}}^{{{last}}} {integrand} \,d{self.name(self.problem.abscissa.name)}"

    def slides(self, label: str, phi: str) -> str:
        """The condition of an end that slides, at its end."""
        return rf"\left[ {phi} \right]_\mathrm{{{label}}} = 0"


def statement(problem: Functional) -> Iterator[Fact]:
    """What there is to say of a problem, one fact after the other, for print and notebook."""
    both = InText(problem), InLatex(problem)
    yield _fact("functional", *(w.integrated(problem.integrand, "L") for w in both))
    if problem.end_cost_expression is not None:
        yield _fact("plus", *(w.cost(*problem.end_cost_expression) for w in both))
    if problem.start.periodic:
        yield _fact("periodic", *(w.periodic() for w in both))
    else:
        for label in ("start", "end"):
            yield _fact(label, *(w.end(label) for w in both))
    yield from _several("condition", [_fact("", *(w.condition(t) for w in both)) for t in problem.traced])
    through = [*problem.of_type(Through)]
    yield from _several(
        "waypoint", [_fact("", *(w.values(f"({c.x:g})", components("", c.y)) for w in both)) for c in through]
    )
    yield from _numbers(problem)
    bounded = any(isinstance(t.constraint, Bound) for t in problem.traced)
    yield from _several("Euler-Lagrange" + (", off the bounds" if bounded else ""), _equations(problem))


def statement_latex(problem: Functional) -> str:
    """The same as one formula in LaTeX, lines below each other."""
    first, *others = [fact.formula for fact in statement(problem) if fact.formula]
    return rf"$\displaystyle {equations([first + _aim(problem), *others])}$"


def _aim(problem: Functional) -> str:
    return r" \to \max" if problem.maximise else r" \to \min"


def _numbers(problem: Functional) -> Iterator[Fact]:
    if problem.breakpoints:
        yield Fact("jumps at", _at_most(", ".join(f"{problem.abscissa.name} = {x:g}" for x in problem.breakpoints)))
    for label, values in (("parameters", problem.parameters), ("unknowns, from", problem.unknowns)):
        if values:
            yield Fact(label, listed(values))
    if any(axis.unit for axis in problem.axes):
        yield Fact("axes", _at_most(", ".join(map(str, problem.axes))))


def _equations(problem: Functional) -> list[Fact]:
    if problem.symbols.kind is not ca.SX:
        return [Fact("", NO_FORMULA, _in_general(problem))]
    lefts = list(left_sides(problem, LEGIBLE))
    written = [None if left is None else (f"{write(left, TEXT)} = 0", f"{write(left, LATEX)} = 0") for left in lefts]
    if all(both is None or len(both[1]) > LONGEST_LATEX for both in written):
        return [Fact("", LEFT_OUT, _in_general(problem))]
    return [Fact("", LEFT_OUT) if both is None else _fact("", both[0], both[1], LEFT_OUT) for both in written]


def _in_general(problem: Functional) -> str:
    """The equation of any L, of which no condition but those of the ends is asked."""
    if problem.traced:
        return ""
    y = "q" if problem.n > 1 else latex_name(problem.ordinates[0].name)
    x = latex_name(problem.abscissa.name)
    terms = [rf"\frac{{\partial L}}{{\partial {y}}}", rf"\frac{{d}}{{d{x}}} \frac{{\partial L}}{{\partial {y}'}}"]
    terms += [rf"\frac{{d^2}}{{d{x}^2}} \frac{{\partial L}}{{\partial {y}''}}"] if problem.order == 2 else []
    return " - ".join(terms[:2]) + "".join(f" + {term}" for term in terms[2:]) + " = 0"


def _several(label: str, facts: Sequence[Fact]) -> Iterator[Fact]:
    """Facts of one kind under one label; of many the first, and how many more there are."""
    shown = facts if len(facts) <= MOST_LINES else facts[: MOST_LINES - 1]
    for number, fact in enumerate(shown):
        yield Fact("" if number else label, fact.text, fact.formula)
    if len(shown) < len(facts):
        yield Fact("", f"and {len(facts) - len(shown)} more")


def _fact(label: str, words: str, formula: str, otherwise: str = "") -> Fact:
    return Fact(label, _at_most(words, otherwise), formula if len(formula) <= LONGEST_LATEX else "")


def _at_most(words: str, otherwise: str = "") -> str:
    return words if len(words) <= FACT_WIDTH else otherwise or words[: FACT_WIDTH - 4] + " ..."
