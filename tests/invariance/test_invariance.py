"""No origin, scale, direction or order is special: every reference, written anew in other coordinates.

A transformation makes of a problem the same problem in other words: measured from another origin, in other units,
from the other end, its functions in another order, its Lagrangian multiplied by a constant or with the derivative of a
function of x and y added to it. A method has to give the same extremal and value, status, verdict, ``local`` and
``lower``, and an error it can be held to. Without ``--everything`` each method meets every transformation on a part of
the references, the ladder on a larger one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np
import pytest

import varcalc as vc
from varcalc.problem.conditions import components, is_vector
from varcalc.study.reference import catalogue, load

METHODS = {
    "ladder": None,
    "Newton": vc.Ritz(),
    "IPOPT": vc.Ritz(optimiser=vc.Ipopt()),
    "Collocation": vc.Collocation(),
    "Shooting": vc.Shooting(),
    "FirstIntegral": vc.FirstIntegral(),
}
REFERENCES = {reference.name: reference for name in sorted(catalogue()) for reference in load(name)}
TOL = 1e-10
LADDERS, PART = 11, 41
"""Without ``--everything`` the ladder, and each method, meets one in so many pairs of reference and transformation."""


@dataclass(frozen=True)
class Change:
    """x = x0 + sx X and y = y0 + sy Y, with ``order`` the places of the new functions among the old ones.

    The Lagrangian is multiplied by ``factor``, and ``slope`` times the sum of the functions is added to what it is
    the derivative of. A Curve has no abscissa: a negative ``sx`` turns its direction.
    """

    x0: float = 0.0
    sx: float = 1.0
    y0: np.ndarray | float = 0.0
    sy: float = 1.0
    order: tuple[int, ...] | None = None
    factor: float = 1.0
    slope: float = 0.0

    def old(self, y: Any) -> Any:
        """The old functions in terms of the new ones."""
        if self.order is not None:
            y = ca.vertcat(*(y[i] for i in np.argsort(self.order)))
        return self.y0 + self.sy * y

    def old_slopes(self, dy: Any, power: int = 1) -> Any:
        """The old derivatives in terms of the new ones."""
        if self.order is not None:
            dy = ca.vertcat(*(dy[i] for i in np.argsort(self.order)))
        return (self.sy / self.sx**power) * dy

    def new(self, y: Any, scale: float | None = None) -> Any:
        """The new ordinates, or slopes with their ``scale``, of the old components; None where they are free."""
        values = components("y", y)
        origin = np.broadcast_to(self.y0 if scale is None else 0.0, len(values))
        found = [
            None if v is None else float((v - o) / (self.sy if scale is None else scale))
            for v, o in zip(values, origin, strict=True)
        ]
        if self.order is not None:
            found = [found[i] for i in self.order]
        return found if is_vector(y) else found[0]


class Graph:
    """The parts of a Problem in the coordinates of a change."""

    def __init__(self, problem: vc.Problem, change: Change) -> None:
        self.problem, self.change = problem, change

    def abscissa(self, x):
        return self.change.x0 + self.change.sx * x

    def new_abscissa(self, x):
        return (x - self.change.x0) / self.change.sx

    def along(self, function):
        """An integrand."""
        change, order = self.change, self.problem.order

        def wrapped(x, y, *rest):
            slopes = [change.old_slopes(v, k + 1) for k, v in enumerate(rest[:order])]
            return abs(change.sx) * function(self.abscissa(x), change.old(y), *slopes, *rest[order:])

        return wrapped

    def bounded(self, function):
        return lambda x, y, dy, *p: function(self.abscissa(x), self.change.old(y), self.change.old_slopes(dy), *p)

    def placed(self, function):
        return lambda x, y, *p: function(self.abscissa(x), self.change.old(y), *p)

    def lagrangian(self, x, y, dy, *rest):
        own = self.along(self.problem.lagrangian)(x, y, dy, *rest)
        return self.change.factor * own + self.change.slope * ca.sum1(dy)

    def end_cost(self, x0, y0, x1, y1, *p):
        ends = [(self.abscissa(x0), self.change.old(y0)), (self.abscissa(x1), self.change.old(y1))]
        first, last = ends[::-1] if self.change.sx < 0 else ends
        return self.change.factor * self.problem.end_cost(*first, *last, *p)

    def end(self, given):
        if isinstance(given, vc.Periodic):
            x0, x1 = sorted(map(self.new_abscissa, (given.x0, given.x1)))
            return replace(given, x0=x0, x1=x1)
        given = replace(given, x=self.new_abscissa(given.x))
        if isinstance(given, vc.OnCurve):
            return replace(given, phi=self.placed(given.phi))
        if isinstance(given, vc.Fixed):
            dy = None if given.dy is None else self.change.new(given.dy, self.change.sy / self.change.sx)
            return vc.Fixed(given.x, self.change.new(given.y), dy)
        return given

    def condition(self, given):
        if isinstance(given, vc.Isoperimetric):
            return replace(given, g=self.along(given.g))
        if isinstance(given, vc.Holonomic):
            return vc.Holonomic(self.placed(given.phi))
        if isinstance(given, vc.Bound):
            return replace(given, h=self.bounded(given.h))
        return vc.Through(self.new_abscissa(given.x), self.change.new(given.y))

    def own(self):
        """What a Problem has and a Curve has not."""
        breakpoints = sorted(self.new_abscissa(x) for x in self.problem.breakpoints)
        return {"order": self.problem.order, "breakpoints": breakpoints}


class Line:
    """The parts of a Curve in the coordinates of a change."""

    def __init__(self, problem: vc.Curve, change: Change) -> None:
        self.problem, self.change = problem, change

    def along(self, function):
        turn = math.copysign(1.0, self.change.sx)
        return lambda q, dq, *p: function(self.change.old(q), turn * self.change.old_slopes(dq, 0), *p)

    def placed(self, function):
        return lambda q, *p: function(self.change.old(q), *p)

    def lagrangian(self, q, dq, *p):
        own = self.along(self.problem.lagrangian)(q, dq, *p)
        return self.change.factor * own + self.change.slope * ca.sum1(dq)

    def end_cost(self, q0, q1, *p):
        ends = [self.change.old(q0), self.change.old(q1)]
        return self.change.factor * self.problem.end_cost(*(ends[::-1] if self.change.sx < 0 else ends), *p)

    def end(self, given):
        if isinstance(given, vc.At):
            return vc.At(self.change.new(given.q))
        if isinstance(given, vc.OnSurface):
            return vc.OnSurface(self.placed(given.phi), self.change.new(given.guess))
        return given

    def condition(self, given):
        if isinstance(given, vc.Isoperimetric):
            return replace(given, g=self.along(given.g))
        if isinstance(given, vc.Holonomic):
            return vc.Holonomic(self.placed(given.phi))
        return replace(given, h=self.along(given.h))

    def own(self):
        return {}


def rewritten(problem: Any, change: Change) -> Any:
    """The problem in the coordinates of a change."""
    kind = vc.Curve if isinstance(problem, vc.Curve) else vc.Problem
    words = Line(problem, change) if kind is vc.Curve else Graph(problem, change)
    ends = [words.end(problem.start), words.end(problem.end)]
    if isinstance(problem.start, vc.Periodic):
        ends[1] = ends[0]
    elif change.sx < 0:
        ends.reverse()
    return kind(
        words.lagrangian, *ends, [words.condition(given) for given in problem.constraints],
        parameters=problem.parameters, unknowns=problem.unknowns,
        end_cost=None if problem.end_cost is None else words.end_cost, maximise=problem.maximise, name=problem.name,
        **words.own(),
    )  # fmt: skip


def _width(problem: Any) -> float:
    return problem.span[1] - problem.span[0]


def _height(reference: Any) -> float:
    """The size of the exact curve, or of the interval where it is level or not known."""
    if reference.exact.y is None:
        return 1.0
    x = np.linspace(*reference.problem.span, 33)
    y = np.asarray(reference.exact.y(x), dtype=float)
    return float(np.ptp(y, axis=-1).max()) or _width(reference.problem)


def _whole_ends(problem: Any) -> bool:
    """Whether both ends are points, so that a function of them is a constant."""
    ends = [getattr(e, "y", getattr(e, "q", None)) for e in (problem.start, problem.end)]
    return not any(e is None or any(v is None for v in components("y", e)) for e in ends)


def _with_slope(reference: Any) -> Change | None:
    if not _whole_ends(reference.problem):
        return None
    return Change(slope=0.3 * abs(reference.exact.value) / _height(reference))


def _swapped(reference: Any) -> Change | None:
    n = reference.problem.n
    return Change(order=tuple(range(n))[::-1]) if n > 1 else None


def _of_graphs(change: Callable[[Any], Change]) -> Callable[[Any], Change | None]:
    return lambda reference: None if isinstance(reference.problem, vc.Curve) else change(reference)


TRANSFORMATIONS: dict[str, Callable[[Any], Change | None]] = {
    "shift of x": _of_graphs(lambda r: Change(x0=-3.7 * _width(r.problem))),
    "x in other units": _of_graphs(lambda r: Change(sx=1e-3)),
    "shift of y": lambda r: Change(y0=-2.3 * _height(r) * (1 + 0.4 * np.arange(r.problem.n))),
    "y in other units": lambda r: Change(sy=1e3),
    "reversal": lambda r: Change(x0=0.0 if isinstance(r.problem, vc.Curve) else sum(r.problem.span), sx=-1.0),
    "functions in another order": _swapped,
    "L times a constant": lambda r: Change(factor=7.3),
    "L with a derivative added": _with_slope,
}

PAIRS = [(name, what) for name, reference in REFERENCES.items() for what in TRANSFORMATIONS
         if TRANSFORMATIONS[what](reference) is not None]  # fmt: skip


def chosen(name: str, what: str, label: str, everything: bool) -> bool:
    """Whether a method meets a pair of reference and transformation."""
    names = [pair[0] for pair in PAIRS if pair[1] == what]
    number = names.index(name) + 7 * list(TRANSFORMATIONS).index(what) + 2 * list(METHODS).index(label)
    return everything or number % min(LADDERS if label == "ladder" else PART, len(names)) == 0


@pytest.fixture(scope="module")
def answers() -> Callable[[str, str], Any]:
    """The answers to the references as they are written, each solved for once."""
    known: dict[tuple[str, str], Any] = {}

    def solved(name: str, label: str) -> Any:
        if (name, label) not in known:
            known[name, label] = vc.solve(REFERENCES[name].problem, METHODS[label], tol=TOL, throw=False)
        return known[name, label]

    return solved


def values_of(problem, solution, x):
    found = solution.q(x) if isinstance(problem, vc.Curve) else solution.y(x)
    return np.atleast_2d(found)


def interval(problem, solution):
    return (0.0, 1.0) if isinstance(problem, vc.Curve) else solution.interval


def check(reference: Any, change: Change, plain: Any, other: Any) -> None:
    """That ``other``, an answer to the rewritten problem, is ``plain`` in other words."""
    assert other.status.ok == plain.status.ok, f"{plain.status.name} became {other.status.name}: {other.message}"
    assert other.verdict is plain.verdict
    assert other.local == plain.local
    if not plain.status.ok:
        return
    check_value(reference, change, plain, other)
    # a circle may begin anywhere, and what is added to the length changes the parameter that a Curve is given by
    if reference.exact.y is not None and not (isinstance(reference.problem, vc.Curve) and change.slope):
        check_curve(reference, change, plain, other)


def check_value(reference: Any, change: Change, plain: Any, other: Any) -> None:
    """The value, the claim that is made of it, and the lower one of a rival."""
    added = 0.0
    if change.slope:
        ends = [reference.problem.start, reference.problem.end]
        first, last = (np.sum(components("y", e.q if isinstance(e, vc.At) else e.y)) for e in ends)
        added = change.slope * (last - first)
    exact = change.factor * reference.exact.value + added
    scale = max(1.0, abs(exact))
    floor = 1e-13 * max(scale, abs(added), change.factor * abs(reference.exact.value))
    assert abs(other.value - exact) <= TOL * scale
    assert abs(other.value - exact) <= 10 * max(other.error.value, floor)
    assert other.error.value <= TOL * scale or other.status is vc.Status.ROUND_OFF
    if plain.lower is None:
        assert other.lower is None
    else:
        assert other.lower == pytest.approx(change.factor * plain.lower + added, rel=1e-6)


def check_curve(reference: Any, change: Change, plain: Any, other: Any) -> None:
    """The curve, to the errors that are claimed of it."""
    problem, t = reference.problem, np.linspace(0.0, 1.0, 65)
    (a, b), (c, d) = interval(problem, plain), interval(problem, other)
    new = values_of(problem, other, c + (d - c) * t)
    old = values_of(problem, plain, a + (b - a) * (t[::-1] if change.sx < 0 else t))
    if change.order is not None:
        new = new[np.argsort(change.order)]
    origin = np.broadcast_to(change.y0, len(old))[:, None]
    distance = np.abs(origin + change.sy * new - old).max()
    size = np.abs(old).max() + np.abs(origin).max()
    assert distance <= 10 * (plain.error.curve + change.sy * other.error.curve) + 1e-9 * size


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "case" in metafunc.fixturenames:
        everything = metafunc.config.getoption("everything")
        cases = [
            pytest.param((*pair, label), id=", ".join((*pair, label)))
            for label in METHODS
            for pair in PAIRS
            if chosen(*pair, label, everything)
        ]
        metafunc.parametrize("case", cases)


def test_the_answer_is_the_same_in_other_words(case, answers):
    name, what, label = case
    reference = REFERENCES[name]
    change = TRANSFORMATIONS[what](reference)
    other = vc.solve(rewritten(reference.problem, change), METHODS[label], tol=TOL, throw=False)
    check(reference, change, answers(name, label), other)


def test_every_method_meets_every_transformation():
    for label in METHODS:
        met = {what for name, what in PAIRS if chosen(name, what, label, everything=False)}
        assert met == set(TRANSFORMATIONS)
