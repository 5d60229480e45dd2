"""Random functionals of one function: a form in the slope, terms in x and y, an end, what that costs, and bounds.

Each term alone is of a class that the adversaries know (a kink, a jump, a narrow load, a hill, a wave); here they stand
beside each other, as nobody has thought of. No value is known beforehand (see ``campaigns/admissible.py``).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

import varcalc as vc

Term = Callable[[Any, Any], Any]
"""Of x, in units of the interval, and y."""
Form = Callable[[Any, Any], Any]
"""Of the slope and the sum of all terms."""
BESIDE_ENDS = 0.05, 0.1
"""How far below both ends a floor lies, and how far above them a ceiling."""


@dataclass(frozen=True)
class Mixture:
    """A problem with what whoever sums it by hand has to know.

    ``lagrangian`` is called with NumPy's or CasADi's numbers; ``cost`` is of the ordinate of a free end. ``low``,
    ``high`` and ``steep`` bound y and the size of its slope.
    """

    span: float
    start: float
    end: float | None
    lagrangian: Callable[[Any, Any, Any], Any]
    cost: Callable[[Any], Any] | None
    low: float = -np.inf
    high: float = np.inf
    steep: float = np.inf

    @property
    def problem(self) -> vc.Problem:
        """As varcalc is asked."""
        last = vc.Free(self.span) if self.end is None else vc.Fixed(self.span, self.end)
        bounds = []
        if np.isfinite(self.low):
            bounds.append(vc.Bound(lambda x, y, v: y, lower=self.low))
        if np.isfinite(self.high):
            bounds.append(vc.Bound(lambda x, y, v: y, upper=self.high))
        if np.isfinite(self.steep):
            bounds.append(vc.Bound(lambda x, y, v: v, lower=-self.steep, upper=self.steep))
        cost = self.cost
        end_cost = None if cost is None else lambda x0, y0, x1, y1: cost(y1)
        return vc.Problem(self.lagrangian, vc.Fixed(0.0, self.start), last, bounds, end_cost=end_cost)


def mixture(number: int) -> Mixture:
    """The functional of a number, the same in every process."""
    random = np.random.default_rng([1697, number])
    span = float(random.choice([1.0, 2.0, 4.0]))
    form, terms = _form(random), [_term(random) for _ in range(random.integers(1, 4))]
    start, end = _number(random, -1, 1), _number(random, -1, 1)
    fixed, cost = random.uniform() < 0.55, None
    if not fixed and random.uniform() < 0.55:
        cost = _cost(random, end)
    low, high, steep = -np.inf, np.inf, np.inf
    which = random.uniform()
    if which < 0.12:
        low = min(start, end) - BESIDE_ENDS[0]
    elif which < 0.24:
        high = max(start, end) + BESIDE_ENDS[1]
    elif which < 0.32:
        steep = abs(end - start) / span + _number(random, 0.2, 1.5)

    def lagrangian(x: Any, y: Any, v: Any) -> Any:
        return form(v, sum(term(x / span, y) for term in terms))

    return Mixture(span, start, end if fixed else None, lagrangian, cost, low, high, steep)


def _number(random: np.random.Generator, low: float, high: float) -> float:
    return float(np.round(random.uniform(low, high), 3))


def _form(random: np.random.Generator) -> Form:
    friction, slope = _number(random, 0.1, 1.5), _number(random, -1, 1)
    forms: list[Form] = [
        lambda v, n: v**2 / 2 + n,
        lambda v, n: v**2 / 2 + n,
        lambda v, n: (4 + ca.tanh(n)) * ca.sqrt(1 + v**2),
        lambda v, n: v**2 / 2 + friction * ca.fabs(v) + n,
        lambda v, n: v**2 / 2 + friction * ca.fabs(v - slope) + n,
        lambda v, n: (v**2 - friction) ** 2 / 2 + n,
        lambda v, n: v**4 / 4 + v**2 / 4 + n,
        lambda v, n: v**2 / 2 + ca.if_else(v > slope, friction * (v - slope) ** 2, 0) + n,
        lambda v, n: ca.cosh(v) + n,
        lambda v, n: (1 + 0.5 * ca.tanh(n)) * v**2 / 2 + friction * ca.tanh(n) ** 2,
    ]
    return forms[random.integers(len(forms))]


def _term(random: np.random.Generator) -> Term:
    place, level = _number(random, 0.1, 0.9), _number(random, -1.2, 1.2)
    size, rate = _number(random, -3, 3), _number(random, 0.5, 6)
    width = float(10 ** np.round(random.uniform(-3, -0.7), 2))
    terms: list[Term] = [
        lambda x, y: size * y,
        lambda x, y: size * x * y,
        lambda x, y: abs(size) * y**2 / 2,
        lambda x, y: abs(size) / 2 * ((y - level) ** 2 - 0.5) ** 2,
        lambda x, y: size * ca.sin(rate * y),
        lambda x, y: size / 2 * ca.sin(rate * y + 4 * level * x),
        lambda x, y: size * ca.fabs(y - level),
        lambda x, y: size * ca.if_else(y > level, 1, 0),
        lambda x, y: abs(size) * ca.fmax(0, y - level),
        lambda x, y: 3 * size * ca.exp(-(((x - place) / width) ** 2)) * y,
        lambda x, y: 2 * size * ca.exp(-2 * rate * ((x - place) ** 2 + (y - level) ** 2)),
        lambda x, y: size * ca.if_else(x > place, 1, 0) * y,
        lambda x, y: size * ca.fabs(y - level * x),
        lambda x, y: size * ca.tanh((y - level) / width),
        lambda x, y: size * ca.fmin(ca.fabs(y - level), place),
    ]
    return terms[random.integers(len(terms))]


def _cost(random: np.random.Generator, level: float) -> Callable[[Any], Any]:
    size = _number(random, 0.2, 3)
    costs: list[Callable[[Any], Any]] = [
        lambda y: size * (y - level) ** 2,
        lambda y: size * ca.fabs(y - level),
        lambda y: -size * y,
    ]
    return costs[random.integers(len(costs))]
