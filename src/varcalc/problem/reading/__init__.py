"""Expressions and Euler-Lagrange equations as text and as LaTeX.

By hand and not by SymPy, whose import takes longer than a solve: a CasADi expression would have to be rebuilt in it,
its simplification has no bound in time, and Newton's dots and y'' are not what its printers write.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import casadi as ca

from varcalc.axes import numbered
from varcalc.problem.conditions import Bound
from varcalc.problem.functional import Functional, check_functional
from varcalc.problem.lagrangian import Lagrangian
from varcalc.problem.reading.equations import MOST_TERMS, collected, simplified
from varcalc.problem.reading.reader import EXPANDED, FACTORED, Named, TooLong, names, names_of
from varcalc.problem.reading.sums import Sum
from varcalc.problem.reading.writing import LATEX, TEXT, Style, write
from varcalc.spelling import spelled
from varcalc.symbolic.tracing import Expression

__all__ = [
    "equation_latex",
    "equation_text",
    "euler_lagrange_latex",
    "euler_lagrange_text",
    "first_integrals_text",
    "latex",
    "names",
    "text",
]


def _written(expression: Expression, named: Named, style: Style) -> str:
    if not isinstance(expression, ca.SX):
        return str(expression)
    return write(FACTORED.read(expression, named), style)


def text(expression: Expression, named: Named = ()) -> str:
    """A scalar expression as text; ``named`` pairs symbols with the names of their entries (see :func:`names`).

    An MX expression, whose operations are not all formulas, is written as CasADi writes it.

    >>> y, v = ca.SX.sym("y"), ca.SX.sym("v")
    >>> text(ca.sqrt((1 + v**2) / (2 * y)), [(v, ["y'"])])
    "sqrt((1 + y'^2)/(2 y))"
    """
    return _written(expression, named, TEXT)


def latex(expression: Expression, named: Named = ()) -> str:
    r"""A scalar expression as LaTeX; arguments as for :func:`text`.

    >>> y = ca.SX.sym("y")
    >>> print(latex(ca.sqrt(y) / 2))
    \frac{\sqrt{y}}{2}
    """
    return _written(expression, named, LATEX)


def left_sides(problem: Functional, legible: float = math.inf) -> Iterator[Sum | None]:
    """What vanishes along an extremal, of L less each condition times its multiplier: one sum for each function.

    None for one of more than ``legible`` operations. The problem is one of SX expressions.
    """
    held = [t for t in problem.traced if not isinstance(t.constraint, Bound)]
    multipliers = ca.SX.sym("lambda", len(held))
    conditions = ca.vertcat(*(t.expression for t in held)) if held else ca.SX(0, 1)
    lagrangian = Lagrangian(problem.symbols, problem.integrand - ca.dot(multipliers, conditions))
    taken = {axis.name for axis in problem.axes} | {*problem.parameters, *problem.unknowns}
    letter = "mu" if any(name.startswith("lambda") for name in taken) else "lambda"
    named = [*names_of(problem, lagrangian), *([(multipliers, numbered(letter, len(held)))] if held else [])]
    symbols = [symbol for symbol, _ in named]
    for k in range(problem.n):
        component = lagrangian.euler_lagrange[k]
        operations = ca.Function("left", symbols, [component], {"allow_free": True}).n_instructions()
        yield _shortened(component, named) if operations <= legible else None


def _shortened(component: Expression, named: Named) -> Sum:
    """What is to vanish, over a common denominator, which is left out; the first of the names is the abscissa's."""
    left = _expanded(component, named)
    left = None if left is None else simplified(left, named[0][1][0])
    return FACTORED.read(component, named) if left is None or len(left.terms) > MOST_TERMS else left


def _expanded(expression: Expression, named: Named) -> Sum | None:
    """An expression with its products carried out; None where nobody would read what comes of it."""
    try:
        return EXPANDED.read(expression, named)
    except TooLong:
        return None


def equation_text(left: Expression, named: Named) -> str:
    """The equation that makes an SX scalar vanish, as short as algebra makes it; ``named`` as for :func:`text`."""
    return f"{write(_shortened(left, named), TEXT)} = 0"


def equation_latex(left: Expression, named: Named) -> str:
    """The same as LaTeX."""
    return f"{write(_shortened(left, named), LATEX)} = 0"


def _integrals(problem: Functional, lagrangian: Lagrangian) -> Iterator[tuple[str, Expression]]:
    """Which first integrals the Lagrangian has, with their names."""
    labels = [axis.name for axis in problem.ordinates]
    for k in lagrangian.ignorable:
        yield f"momentum of {labels[k]}", lagrangian.momenta[0][k]
    if lagrangian.ignorable_abscissa:
        yield "energy", lagrangian.energy


@spelled
def euler_lagrange_text(problem: Functional) -> str:
    """The Euler-Lagrange equation, one line for each unknown function, as short as algebra makes it.

    Terms are over a common denominator, which is left out: it cannot vanish
    where the equation makes sense. A condition stands in it with its multiplier,
    lambda (lambda_1, ... of several; mu where a variable has that name), that of
    ``solution.multipliers``; bounds do not: the equation holds where none of them is met.
    Raises TypeError for what is no problem.

    >>> from varcalc import Fixed, Problem
    >>> film = Problem(lambda x, y, dy: y * ca.sqrt(1 + dy**2), Fixed(-0.5, 1), Fixed(0.5, 1))
    >>> euler_lagrange_text(film)
    "y y'' - y'^2 - 1 = 0"
    """
    return _all_equations(problem, TEXT)


@spelled
def euler_lagrange_latex(problem: Functional) -> str:
    r"""The Euler-Lagrange equation as LaTeX, one line for each unknown function; see :func:`euler_lagrange_text`.

    Raises TypeError for what is no problem.

    >>> from varcalc import Fixed, Problem
    >>> film = Problem(lambda x, y, dy: y * ca.sqrt(1 + dy**2), Fixed(-0.5, 1), Fixed(0.5, 1))
    >>> euler_lagrange_latex(film)
    "y y'' - y'^{2} - 1 = 0"
    """
    return _all_equations(problem, LATEX)


def _all_equations(problem: Functional, style: Style) -> str:
    check_functional(problem)
    if problem.symbols.kind is not ca.SX:
        components = ca.vertsplit(Lagrangian.of(problem).euler_lagrange)
        return "\n".join(f"{component} = 0" for component in components)
    return "\n".join(f"{write(left, style)} = 0" for left in left_sides(problem) if left is not None)


@spelled
def first_integrals_text(problem: Functional) -> dict[str, str]:
    """The first integrals that follow from ignorable variables: name to expression that is constant on extremals.

    Raises TypeError for what is no problem.

    >>> from varcalc import Fixed, Problem
    >>> line = Problem(lambda x, y, dy: dy**2 / 2 - ca.cos(y), Fixed(0, 0), Fixed(1, 1))
    >>> first_integrals_text(line)
    {'energy': "y'^2/2 + cos(y)"}
    """
    check_functional(problem)
    lagrangian = Lagrangian.of(problem)
    found = list(_integrals(problem, lagrangian))
    if problem.symbols.kind is not ca.SX:
        return {name: str(expression) for name, expression in found}
    named = names_of(problem, lagrangian)
    return {name: write(_shorter(expression, named), TEXT) for name, expression in found}


def _shorter(expression: Expression, named: Named) -> Sum:
    """Whichever has fewer terms: as it stands, expanded, or with common denominators of its parts carried out."""
    factored, multiplied_out = FACTORED.read(expression, named), _expanded(expression, named)
    if multiplied_out is None:
        return factored
    readings = [multiplied_out, factored]
    readings += [collected(r) for r in readings]
    return min(readings, key=lambda s: (len(s.terms), len(write(s, TEXT))))
