"""Forms of graphs with corners at abscissae that are themselves unknown.

The interval is cut into pieces, and each is mapped linearly onto a fixed one:
in the reference variable the corners stand still, and their abscissae are
unknown numbers. Stationarity in them is Erdmann's second corner condition
(continuity of y' L_y' - L), in the ordinates the first (continuity of L_y');
Gelfand and Fomin, "Calculus of Variations", sect. 15.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import casadi as ca
import numpy as np

from varcalc.formulation.form import (
    Coordinates,
    EndConditions,
    Form,
    Sampled,
    SideCondition,
    Start,
    Stated,
    conditions_of,
    end_conditions,
    extended,
    rewriter,
)
from varcalc.formulation.graph import graph_form
from varcalc.problem.functional import Symbols
from varcalc.problem.problem import Problem
from varcalc.symbolic.instructions import Instruction, instructions
from varcalc.symbolic.switches import held
from varcalc.symbolic.tracing import Expression

LENGTH_KEPT = 1e-2
"""Share of its first length that a piece must keep where IPOPT moves its ends."""

STEPS_ONTO_SURFACE = 6


@dataclass(frozen=True)
class Contact:
    """A stretch along which a bound is touched: the constraint's number, its level, and guesses of the ends.

    At second order it may be a point, at which the bound presses with a force. The curve may come to what is a jump
    ``through`` it, from the other side, and leave it so.
    """

    index: int
    level: float
    start: float
    end: float
    through: tuple[bool, bool] = (False, False)


@dataclass(frozen=True)
class Refraction:
    """A corner where the curve goes through a surface on which the Lagrangian has a kink, or jumps.

    ``surface`` is zero there, an expression in the problem's symbols for x and y, and at second order for the slope;
    None for a switch of the highest derivative, which is as free as the abscissa ``x``, of which this is a guess.
    """

    x: float
    surface: Expression | None


@dataclass(frozen=True)
class Ride:
    """A stretch along which the curve stays on a surface where the Lagrangian has a kink: it is zero there.

    At its ends the curve may have corners, ``bent``, where the surface is one of the highest derivative.
    """

    start: float
    end: float
    surface: Expression
    bent: tuple[bool, bool] = (False, False)

    def drawn(self, problem: Problem) -> bool:
        """Whether the surface is one of the highest derivative, to which nothing but the functional draws a curve.

        On any other the curve comes to rest smoothly, which tells where.
        """
        return bool(ca.depends_on(self.surface, problem.symbols.highest))


def broken_form(
    problem: Problem,
    corners: Sequence[float],
    curve: Sampled,
    contacts: Sequence[Contact] | None = None,
    switched: Sequence[Refraction | Ride] = (),
    *,
    loose: Sequence[Expression] = (),
    keeping: bool = False,
) -> Form:
    """The problem with corners near the given abscissae, where only they and ``curve`` are guesses.

    ``corners`` lie inside the interval, away from breakpoints and waypoints;
    the ends are fixed abscissae (:class:`varcalc.Fixed` or :class:`varcalc.Free`).
    With ``contacts``, whose ends are corners or ends of the interval, the
    bounds are kept as equations along them and not at all elsewhere, where it
    is for the caller to look whether they hold. ``switched`` are more corners, and stretches that end in corners or
    at the ends: between them everything that switches is left as it is in the middle of ``curve``'s piece, but what
    has a ``loose`` argument, and may switch anywhere. ``keeping`` asks for an interior-point method that keeps some of
    every piece: Newton's may turn short ones inside out.
    """
    plain = graph_form(problem)
    refractions = [c for c in switched if isinstance(c, Refraction)]
    rides = [c for c in switched if isinstance(c, Ride)]
    edges = {e for r in rides for e in (r.start, r.end)} - set(problem.span)
    corners = sorted({*corners, *(r.x for r in refractions), *edges})
    symbols = extended(problem, problem.n, len(corners))
    moving = symbols.unknowns[len(problem.unknowns) :]
    marks = _marks(problem, plain, corners, moving)
    x, speed = _piecewise(symbols.x, marks, smoothly=problem.order == 2)
    slopes = [symbols.dy / speed]
    if problem.order == 2:
        slopes += [(symbols.ddy - slopes[0] * ca.gradient(speed, symbols.x)) / speed**2]
    rewrite = unheld = rewriter(problem, symbols, x, symbols.y, slopes, speed)
    if switched:
        rewrite = _held_between(problem, symbols, marks, curve, rewrite, loose, rides)
    integrand = plain.sign * rewrite(problem.integrand, True)
    conditions = replace(conditions_of(problem, rewrite), knots=tuple(s for s, _ in marks[1:-1]))
    if contacts is not None:
        kept = (SideCondition(speed, LENGTH_KEPT, math.inf, -1),) if keeping else ()
        pathwise = (*_touching(conditions.pathwise, contacts), *kept)
    elif conditions.pathwise or keeping or any(r.drawn(problem) for r in rides):
        # the interior-point method is kept from turning a piece inside out
        pathwise = (*conditions.pathwise, SideCondition(speed, LENGTH_KEPT, math.inf, -1))
    else:
        pathwise = ()
    pathwise += tuple(c for r in rides for c in _along(problem, r, unheld(r.surface, False), marks, curve))
    stated = Stated(symbols, integrand, integrand, (x, symbols.y, speed, symbols.dy))
    joint = end_conditions(problem, symbols, lambda k, y: (problem.span[k], y))
    surfaces = [(r.x, r.surface) for r in refractions if r.surface is not None]
    surfaces += [(c.start, e) for c in contacts or () if c.start == c.end for e in _tangent(problem, c)]
    if surfaces:
        joint = _with_surfaces(problem, symbols, joint, corners, moving, surfaces)
    return Form(
        problem,
        Coordinates(stated, problem.span, corners=len(corners), note="corners at unknown abscissae"),
        replace(plain.ends, joint=joint),
        replace(conditions, pathwise=pathwise, waypoints=plain.conditions.waypoints),
        Start(curve, np.array([*problem.unknown_guesses, *corners]), plain.start.bumps),
    )


def _touching(bounds: Sequence[SideCondition], contacts: Sequence[Contact]) -> tuple[SideCondition, ...]:
    """Equations in place of the ``bounds``, where they are met along a stretch."""
    by_index = {c.index: c for c in bounds}
    return tuple(
        replace(by_index[c.index], lower=c.level, upper=c.level, where=(c.start, c.end))
        for c in contacts
        if c.start < c.end
    )


def _points(
    problem: Problem, marks: list[tuple[float, Expression]], curve: Sampled
) -> Iterator[tuple[tuple[float, float], list[np.ndarray]]]:
    """Each piece between marks, and the arguments of the problem's expressions in the middle of the curve's piece."""
    for (first, _), (last, _) in pairwise(marks):
        at = first + (last - first) * np.array([0.45, 0.5, 0.55])
        y = curve(at)
        slope = (y[:, 2] - y[:, 0]) / (at[2] - at[0])
        bend = 4 * (y[:, 2] - 2 * y[:, 1] + y[:, 0])[: problem.symbols.ddy.numel()] / (at[2] - at[0]) ** 2
        yield (first, last), [at[1:2], y[:, 1], slope, bend, problem.parameter_values, problem.unknown_guesses]


def _along(
    problem: Problem, ride: Ride, surface: Expression, marks: list[tuple[float, Expression]], curve: Sampled
) -> Iterator[SideCondition]:
    """That a curve stays on a surface along a stretch, and elsewhere on its side of one to which it is drawn."""
    smoothly = (not ride.bent[0], not ride.bent[1]) if ride.drawn(problem) else (False, False)
    yield SideCondition(surface, 0.0, 0.0, -1, (ride.start, ride.end), smoothly)
    if ride.drawn(problem):
        for piece, side in _sides(problem, ride, marks, curve):
            yield SideCondition(surface, *((0.0, math.inf) if side > 0 else (-math.inf, 0.0)), -1, piece)


def _sides(
    problem: Problem, ride: Ride, marks: list[tuple[float, Expression]], curve: Sampled
) -> Iterator[tuple[tuple[float, float], float]]:
    """The pieces along which a surface is not followed, and the side of it on which the curve's piece is."""
    surface = ca.Function("surface", problem.symbols.all, [ride.surface])
    for (first, last), point in _points(problem, marks, curve):
        if not ride.start <= first < ride.end:
            yield (first, last), float(surface(*point))


def _held_between(
    problem: Problem,
    symbols: Symbols,
    marks: list[tuple[float, Expression]],
    curve: Sampled,
    rewrite: Callable[[Expression, bool], Expression],
    loose: Sequence[Expression],
    rides: Sequence[Ride],
) -> Callable[[Expression, bool], Expression]:
    """``rewrite``, with what switches left as it is in the middle of the curve's piece, but what is ``loose``.

    Along rides on a surface of the slope that is what the surface gives.
    """
    s, points = problem.symbols, []
    for (first, _), point in _points(problem, marks, curve):
        on = [r for r in rides if r.start <= first < r.end and r.drawn(problem)]
        points.append(_onto(problem, on[0].surface, point) if on else point)

    def rewritten(expression: Expression, integrated: bool) -> Expression:
        """What the branch of each piece is rewritten to, chosen by where the abscissa is."""
        branches: dict[tuple[Instruction, ...], tuple[Expression, Expression]] = {}
        for here, point in zip(_within(symbols.x, marks), points, strict=True):
            branch = held([expression], s.all, point, loose=loose)[0]
            written = tuple(instructions(ca.Function("branch", s.all, [branch])))
            elsewhere, branch = branches.get(written, (symbols.kind(0), branch))
            branches[written] = elsewhere + here, branch
        # what branches have in common is differentiated once
        common = ca.cse(ca.vertcat(*(rewrite(branch, integrated) for _, branch in branches.values())))
        return _chosen([there for there, _ in branches.values()], ca.vertsplit(common))

    return rewritten


def _onto(problem: Problem, surface: Expression, point: list[np.ndarray]) -> list[np.ndarray]:
    """A point with the highest derivative by which a surface is zero; as it is where Newton's steps lead nowhere."""
    s, place = problem.symbols, 1 + problem.order
    rate = ca.gradient(surface, s.highest)
    step = ca.Function("step", s.all, [-surface * rate / ca.sumsqr(rate)])
    found = list(point)
    for _ in range(STEPS_ONTO_SURFACE):
        found[place] = found[place] + np.asarray(step(*found)).ravel()
    return found if np.isfinite(found[place]).all() else point


def _with_surfaces(
    problem: Problem,
    symbols: Symbols,
    joint: EndConditions | None,
    corners: Sequence[float],
    moving: Expression,
    surfaces: Sequence[tuple[float, Expression]],
) -> EndConditions:
    """The conditions of the ends, and that the curve lies on each surface at its corner."""
    s, kind = problem.symbols, symbols.kind
    if joint is None:
        joint = EndConditions(kind.sym("start", problem.n), kind.sym("end", problem.n), kind(0, 1), kind(0))
    inside, equations, width = [], [], problem.span[1] - problem.span[0]
    for k, (at, surface) in enumerate(surfaces):
        count = len(problem.unknowns)
        before, after = [s.x, s.unknowns], [moving[corners.index(at)], symbols.unknowns[:count, :]]
        for derivative, variable in enumerate([s.y, *s.slopes[:-1]]):
            here = kind.sym(f"inside{k}", problem.n)
            inside.append((at, derivative, here))
            before.append(variable)
            after.append(here / width**derivative)  # dx/ds is 1 at corners where slopes count
        equations.append(ca.substitute([surface], before, after)[0])
    return replace(joint, equations=ca.vertcat(joint.equations, *equations), inside=tuple(inside))


def _tangent(problem: Problem, contact: Contact) -> list[Expression]:
    """What is zero where a curve touches a bound in a point: on it alone, the curve might go through."""
    s, bound = problem.symbols, problem.traced[contact.index].expression
    return [bound - contact.level, ca.jtimes(bound, ca.vertcat(s.x, s.y), ca.vertcat(1, s.dy))]


def _marks(
    problem: Problem, plain: Form, corners: Sequence[float], unknowns: Expression
) -> list[tuple[float, Expression]]:
    """(s, x) at the ends, the knots that stand still and the corners, in order."""
    kind = problem.symbols.kind
    moving = [(float(c), unknowns[i]) for i, c in enumerate(sorted(corners))]
    standing = [(v, kind(v)) for v in (problem.span[0], *plain.conditions.knots, problem.span[1])]
    return sorted([*moving, *standing], key=lambda mark: mark[0])


def _piecewise(
    s: Expression, marks: list[tuple[float, Expression]], *, smoothly: bool
) -> tuple[Expression, Expression]:
    """x(s), linear between the marks, or with the slope 1 at each, so that slopes are continuous; and dx/ds."""
    within = _within(s, marks)
    s0, length = _chosen(within, [a for a, _ in marks[:-1]]), _chosen(within, np.diff([a for a, _ in marks]).tolist())
    x0, x1 = (_chosen(within, [x for _, x in ends]) for ends in (marks[:-1], marks[1:]))
    rate = (x1 - x0) / length
    if not smoothly:
        return x0 + (s - s0) * rate, rate
    along = (s - s0) / length
    x = s + (x0 - s0) + length * (rate - 1) * along**2 * (3 - 2 * along)
    return x, 1 + (rate - 1) * 6 * along * (1 - along)


def _within(s: Expression, marks: list[tuple[float, Expression]]) -> list[Expression]:
    """For each piece between marks 1 where ``s`` is in it and 0 elsewhere; the first and the last have no outer end."""
    starts = [start for start, _ in marks[1:-1]]
    after, before = [1.0, *(s >= start for start in starts)], [*(s < start for start in starts), type(s)(1.0)]
    return [last * first for first, last in zip(after, before, strict=True)]


def _chosen(within: Sequence[Expression], choices: Sequence[Expression | float]) -> Expression:
    """The one of the ``choices`` whose condition holds.

    They stand in one sum: one within the other, each would be taken as often as there are pieces in every derivative.
    """
    return ca.sum1(ca.vertcat(*(ca.if_else(here, choice, 0) for here, choice in zip(within, choices, strict=True))))
