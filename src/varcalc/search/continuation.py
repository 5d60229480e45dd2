"""continue_branch: an extremal followed in a parameter, through the folds of its branch."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from varcalc.formulation import formulate
from varcalc.methods.arguments import check_arguments
from varcalc.methods.collocation.error import Root
from varcalc.methods.collocation.method import Collocation, first_unknowns, first_vertices
from varcalc.methods.collocation.newton import stationary
from varcalc.methods.collocation.refinement import Refinement
from varcalc.methods.collocation.starting_curves import function_sizes, resolving_vertices
from varcalc.methods.collocation.system import CollocationSystem, collocation_space
from varcalc.numerics.mesh import Space
from varcalc.problem.conditions import finite, text
from varcalc.search.arclength import Fold, Follower, ParameterFamily, Point
from varcalc.search.collected import finer, refined, scales_of
from varcalc.showing import Fact, Plotted, counted, figure_of, line
from varcalc.solution import Solution, no_solution
from varcalc.spelling import check_names, spelled

BRANCH_DEGREES = {1: 20, 2: 24}
"""Degree of the mesh that a branch sets out on, by the order of the functional."""
FIRST_STEP, LONGEST_STEP, SHORTEST_STEP = 0.05, 0.2, 1e-6
"""Lengths of a step, in units of the curve's own size and of the parameter's range."""
QUICK_CORRECTIONS = 3
"""Corrections up to which the next step is longer."""
LEAST_COSINE = 0.9
"""Least cosine of the angle between successive tangents: beyond, the step may have left the branch."""
FOLD_TANGENT = 0.02
"""Part of the parameter in the tangent below which a point is too near a fold for an error of its own."""
MOST_BRANCH_POINTS = 400
"""Points of one branch."""


@dataclass(frozen=True, repr=False, eq=False)
class Branch(Plotted):
    """Extremals along a branch, in the order in which it is followed.

    ``parameter``, ``value`` (m,) and ``solutions`` belong together. ``folds``
    (k,) are the values of the parameter where the branch turns back,
    ``fold_errors`` (k,) the claimed errors of these, ``fold_values`` (k,) the
    functional there. ``ended`` says why the branch was followed no further.
    """

    name: str
    solutions: tuple[Solution, ...]
    folds: np.ndarray
    fold_errors: np.ndarray
    fold_values: np.ndarray
    ended: str

    def __repr__(self) -> str:
        return line("Branch", [self.name, counted(len(self.solutions), "point"), counted(len(self.folds), "fold")])

    def _headline(self) -> str:
        return f"A branch of {counted(len(self.solutions), 'extremal')} in {self.name}"

    def _facts(self) -> Iterator[Fact]:
        first, last = self.parameter[[0, -1]]
        yield Fact("from", f"{self.name} = {first:.9g}, value {self.value[0]:.12g}")
        for fold, error, value in zip(self.folds, self.fold_errors, self.fold_values, strict=True):
            yield Fact("fold", f"{self.name} = {figure_of(fold, error)}, value {value:.12g}")
        yield Fact("to", f"{self.name} = {last:.9g}, value {self.value[-1]:.12g}")
        yield Fact("ended", self.ended)

    @property
    def parameter(self) -> np.ndarray:
        """The values of the parameter, shape (m,)."""
        return np.array([s.problem.parameters[self.name] for s in self.solutions])

    @property
    def value(self) -> np.ndarray:
        """The values of the functional, shape (m,)."""
        return np.array([s.value for s in self.solutions])


@spelled
def continue_branch(solution: Solution, name: str, *, until: float, tol: float = 1e-10) -> Branch:
    """The branch of extremals that ``solution`` lies on, as the parameter ``name`` goes towards ``until``.

    The branch is followed by its arc length, on through folds, where the
    parameter turns back and another extremal takes over. It ends where the
    parameter reaches ``until``, or, having turned, its first value again: then
    the last solution is another extremal of the same problem. Every solution
    is refined to ``tol``; each fold is located as a zero of the derivative of
    the parameter by the arc length, to round-off as far as its error claims
    (Keller 1977; Seydel, "Practical Bifurcation and Stability Analysis", ch. 4
    and 5).

    Raises ValueError for a ``name`` that is no parameter of the problem, or one that moves an end, for
    an ``until`` that is the parameter's own value, for a solution without a
    curve, and where collocation in the person's own coordinates cannot follow
    it: with inequalities, or with an infinite Lagrangian at an end.

    >>> import casadi as ca
    >>> import varcalc as vc
    >>> bratu = vc.Problem(lambda x, y, dy, p: dy**2 / 2 - p.k * ca.exp(y), vc.Fixed(0, 0), vc.Fixed(1, 0),
    ...                    parameters={"k": 1.0})
    >>> branch = vc.continue_branch(vc.solve(bratu), "k", until=4.0)
    >>> print(*(f"{k:.11f}" for k in branch.folds))
    3.51383071913
    >>> print(f"{branch.solutions[-1].y(0.5):.9f} at k = {branch.parameter[-1]:g}")
    4.091467246 at k = 1
    """
    if not isinstance(solution, Solution):
        raise no_solution(solution, "continue_branch")
    problem = solution.problem
    check_arguments(problem, None, tol)
    check_names("parameters of this problem", [text("name", name)], problem.parameters)
    if name in problem.end_parameters:
        raise ValueError(f"{name!r} moves an end; a branch is followed in a parameter of the Lagrangian, see sweep")
    until = finite("until", until)
    if until == problem.parameters[name]:
        raise ValueError(f"until must differ from the value that {name} has, {until}")
    with np.errstate(all="ignore"):  # trial curves leave the Lagrangian's domain; what is no number is rejected
        level = _first(solution, tol)
        family = ParameterFamily(level.system.form, name, abs(until - problem.parameters[name]))
        return _Walk(family, until, tol).run(level)


def _first(solution: Solution, tol: float) -> Root:
    """The solution found again by collocation."""
    curve = solution.curve
    if curve is None:
        raise ValueError(f"the solution holds no curve to set out from: {solution.message or solution.status.value}")
    form = formulate(solution.problem)
    reason = Collocation().inapplicable(form)
    if reason:
        raise ValueError(f"this branch cannot be followed by collocation: {reason}")
    guess = form.coordinates.pull(lambda x: curve(x, 0))
    vertices = resolving_vertices(guess, first_vertices(form, 1), BRANCH_DEGREES[form.order])
    system = CollocationSystem(form, collocation_space(form, vertices, BRANCH_DEGREES[form.order]))
    refinement = Refinement(scales_of(form), adaptive=True)
    level = refinement.newton(system, first_unknowns(system, guess))
    improved = None if level is None else refinement.improve(level, finer(tol))
    if improved is None:
        raise ValueError(
            "the solution is not found again by collocation in the person's own coordinates, so that no branch could "
            "be followed from it; its ends may be singular, or conjugate"
        )
    return improved.level


@dataclass
class _Walk:
    """One branch as far as it has been followed."""

    family: ParameterFamily
    until: float
    tol: float
    solutions: list[Solution] = field(default_factory=list)
    folds: list[Fold] = field(default_factory=list)

    def run(self, level: Root) -> Branch:
        """The branch from the root of a ``level`` on, until it ends."""
        self.follower = Follower(self.family, function_sizes(self.family.form))
        self.start = self.family.form.problem.parameters[self.family.name]
        point = self._departure(level)
        self._keep(point)
        ended = self._follow(point)
        errors, values = ([getattr(f, k) for f in self.folds] for k in ("error", "value"))
        return Branch(
            self.family.name, tuple(self.solutions), np.array([f.parameter for f in self.folds]),
            np.array(errors), np.array(values), ended,
        )  # fmt: skip

    def _departure(self, level: Root) -> Point:
        """The first point, with the tangent that takes the parameter towards ``until``."""
        sign = math.copysign(1.0, self.until - self.start)
        return self.follower.departure(level.system.space, level.z, self.start, sign)

    def _follow(self, point: Point) -> str:
        """Step on until the window is left; the reason for the end."""
        length = FIRST_STEP
        for _ in range(MOST_BRANCH_POINTS):
            stepped = self.follower.step(point, length)
            if stepped is None or self.follower.turn(point, stepped[0]) < LEAST_COSINE:
                length *= 0.5
                if length < SHORTEST_STEP:
                    return f"no step leads on from {self.family.name} = {point.parameter:.12g}"
                continue
            following, corrections = stepped
            self._note_fold(point, following, length)
            edge = self._edge(following)
            if edge is not None:
                self._land(point, following, edge)
                return f"{self.family.name} reached {edge:.12g}"
            point = self._keep(following)
            length = min(LONGEST_STEP, 1.5 * length) if corrections <= QUICK_CORRECTIONS else length
        return f"the branch was left after {MOST_BRANCH_POINTS} points, at {self.family.name} = {point.parameter:.12g}"

    def _note_fold(self, point: Point, following: Point, length: float) -> None:
        before, after = point.tangent[-1], following.tangent[-1]
        if before * after < 0:
            fold = self.follower.fold(point, length * before / (before - after))
            if fold is not None:
                self.folds.append(fold)

    def _edge(self, point: Point) -> float | None:
        """The end of the window that a point lies beyond."""
        ahead = self.until > self.start
        for edge, beyond in ((self.until, ahead), (self.start, not ahead)):
            if (point.parameter >= edge) if beyond else (point.parameter <= edge):
                return edge
        return None

    def _land(self, point: Point, following: Point, edge: float) -> None:
        """The extremal at the edge of the window, between two points."""
        share = (edge - point.parameter) / (following.parameter - point.parameter)
        z = point.z + share * (following.z - point.z)
        system = self.family.system(point.space, edge)
        outcome = stationary(system, z, scales_of(system.form))
        if outcome.converged:
            self._solution(Root(system, outcome.z, outcome.residual))

    def _keep(self, point: Point) -> Point:
        """Note the extremal at a point, unless it is too near a fold; the point on a mesh that resolves it."""
        if abs(point.tangent[-1]) < FOLD_TANGENT * self.family.unit:
            return point
        space = self._solution(self.follower.level(point))
        return point if space is None or space is point.space else self.follower.moved(point, space)

    def _solution(self, level: Root) -> Space | None:
        """Refine a level and keep it; the mesh it took, None when it could not be refined."""
        found = refined(level, self.tol)
        if found is None or not found[0].status.ok:
            return None
        self.solutions.append(found[0])
        return found[1]
