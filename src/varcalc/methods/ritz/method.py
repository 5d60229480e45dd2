"""The direct method: minimise the functional over piecewise polynomials.

The degree climbs while convergence is geometric; where it is not, the
elements that carry the error are bisected. The value reported is the
functional on the trial curve by the next richer space's finer rule, hence an
upper bound; its error is estimated there (:mod:`varcalc.methods.ritz.error`).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, ClassVar

import numpy as np

from varcalc.formulation import Contact, Form, Sampled
from varcalc.formulation.height import far_out, flat
from varcalc.methods.answer import AlongGraph, Extremal, SampledExtremal, answer, unsettled, with_ends
from varcalc.methods.ritz.degeneracy import degenerate
from varcalc.methods.ritz.error import CURVE, Estimate, estimate, settled
from varcalc.methods.ritz.held_ends import held_ends, holds_free_ends
from varcalc.methods.ritz.ipopt import Ipopt, optimise
from varcalc.methods.ritz.layers import cuts, hidden, layered
from varcalc.methods.ritz.newton import NO_NUMBER, Descent, Newton, edge_met, load, minimise
from varcalc.methods.ritz.slack import kept, without_inequalities
from varcalc.methods.ritz.starts import COMPARED, NEXT_TO, bent_anyhow, clear_of_bounds, meeting_levels, toward_baseline
from varcalc.methods.ritz.steepest import (
    FOUND,
    NEARLY_FOUND,
    Shifted,
    at_bounds,
    carried,
    kept_vertices,
    moved,
    shift,
    steep,
    steepest,
)
from varcalc.methods.ritz.switching import of_first_degree, switching
from varcalc.methods.ritz.system import Evaluation, RitzSystem
from varcalc.methods.ritz.touching import Touching, touchable, touching
from varcalc.numerics.mesh import CurveOrSlope, Space, on_one_element
from varcalc.problem.conditions import truth, whole
from varcalc.showing import Brief
from varcalc.solution import ErrorEstimate, Solution, Stats, Status, Verdict, no_answer
from varcalc.spelling import spelled

DEGREES: dict[int, tuple[int, ...]] = {1: (6, 10, 16, 24, 36, 52), 2: (7, 11, 16, 24, 36)}
"""The rungs of the degree, by the order of the Lagrangian."""
NOWHERE = (
    "the Lagrangian is not a number on any of the starting curves tried; "
    "check its domain between the ends, or give guess= a curve on which it is one"
)
NO_DERIVATIVES = (
    "the Lagrangian is a number along the starting curve, but its derivatives are not: an exponential in it is beyond "
    "all numbers, as in 1/(1 + exp(u)) or 1/cosh(u)**2, which are (1 - tanh(u/2))/2 and 1 - tanh(u)**2"
)
STEPS_FROM_NEARBY = 12
"""Newton steps that lead to a minimum from one nearby."""
MOST_ITERATIONS, UNFINISHED = 600, 3
"""Iterations in all after which a solve is given up; by IPOPT no more than what it may take on so many meshes."""
SPLIT_DEGREE = 16
"""Degree kept while elements are bisected."""
COARSE, POLYGON = ((16, 4), (64, 4)), (128, 1)
"""Elements and degree of meshes on which contacts with a bound are looked for, the next where one holds no curve.

And of polygons, which come first where the slope may switch from bound to bound."""
COARSE_TOLERANCE = 1e-8
"""Tolerance of the optimiser on it."""
UNSEEN, ROUGHLY = 1e-3, 1e-6
"""Relative error of that mesh from which on contacts may be narrower than it, and the tolerance that shows them."""
TOUCHING_DEGREE = 6
"""The same where the curve may touch a bound: its curvature jumps there, and high degrees do not help."""
STALLED = 0.05
"""A rung that leaves more than this share of the error does not converge geometrically."""
BISECTED_SHARE = 0.05
"""Elements with more than this share of the largest contribution to the error are bisected."""
SLOW = 0.4
"""A refinement that leaves more than this share of the error behind is slow."""
SLOW_REFINEMENTS = 8
"""Slow refinements in a row after which a solve is given up."""
FEW = 2
"""Elements: a refinement of no more is local, on its way into a layer that it must reach before the error falls."""
LOCAL = 0.25
"""What a slow refinement counts that is local."""
MOST_UNKNOWNS, MOST_AN_ELEMENT = 4000, 24
"""Unknowns with which a solve is given up that needs more: in all, or an element of the mesh that it was given."""
MOST_WORTH_WHILE, WORTH_WHILE = 100_000, 0.3
"""The same while every refinement leaves no more than this share of the error."""
DRIFTING, STILL_SHIFTED = 4, 0.9
"""Steps in which the ends of contacts that are found shift less and less, and what is left of a shift after as many
where they only drift."""
STEPS_TO_ENDS, ON_KNOWN_MESH = 12, 16
"""Times that the ends of stretches on which the slope is at a bound are moved, and the degree on a mesh that is known.
"""
NEXT_TO_NOTHING = 1e6
"""Height of a curve that vanishes on a bound, in units of one that is as good as zero, from which it has not yet."""
WORTHLESS = 1e-3
"""Relative round-off at which a value is no answer."""
RESTART_DEGREE = 24
"""Degree up to which a solve begins again from the starting curves."""


@spelled
@dataclass(frozen=True, repr=False)
class Ritz(Brief):
    """Minimise over piecewise polynomials of ``degree`` on ``elements`` equal elements.

    With ``refine`` the mesh is the first one and is refined until the error
    estimate meets ``tol``; without it that mesh is kept and the value is
    returned with its error. ``optimiser`` is :class:`Newton` or
    :class:`Ipopt`; by default Newton, and IPOPT always where there are
    inequalities or pathwise conditions. ``starts`` bounds the starting curves
    tried before a problem is given up.

    Raises ValueError for a mesh that cannot be.
    """

    elements: int = 1
    degree: int | None = None
    refine: bool = True
    optimiser: Newton | Ipopt | None = None
    starts: int = 12
    minimises: ClassVar[bool] = True
    """An answer is a minimum by construction."""

    def __post_init__(self) -> None:
        for name, value in (("elements", self.elements), ("degree", self.degree), ("starts", self.starts)):
            if value is not None:
                whole(f"Ritz.{name}", value)
        truth("Ritz.refine", self.refine)
        if not (self.optimiser is None or isinstance(self.optimiser, Newton | Ipopt)):
            raise TypeError(f"Ritz.optimiser must be Newton() or Ipopt(), not {self.optimiser!r}")

    def solve(self, form: Form, *, tol: float, guess: Sampled | None) -> Solution:
        """The lowest curve of ``form`` that Newton or IPOPT reaches; see :func:`varcalc.solve`."""
        least = 2 * form.order - 1
        if self.degree is not None and self.degree < least:
            reason = f"degree={self.degree} is too low for a functional of order {form.order}; give at least {least}"
            return no_answer(form.problem, self, Status.REFUSED, reason)
        load()
        solution = self._unbound(form, tol, guess) if form.has_bounds else None
        return self.bound(form, tol=tol, guess=guess) if solution is None else solution

    def bound(self, form: Form, *, tol: float, guess: Sampled | None) -> Solution:
        """The lowest curve where it is known that there is none, or none that counts, without the inequalities."""
        load()
        solution, climbs = None, list[_Climb]()
        if form.has_bounds and self.refine and (touchable(form) or steep(form) or holds_free_ends(form)):
            solution = self._through_contacts(form, tol, guess, climbs)
        if solution is None:
            climbs.append(_Climb(self, form, tol))
            solution = climbs[-1].run(guess)
        more = any(climb.rungs.more_starts for climb in climbs)
        return replace(solution, stats=replace(solution.stats, more_starts=True)) if more else solution

    @property
    def plain(self) -> bool:
        """Whether the mesh is the method's own affair, and Newton's iteration the optimiser."""
        newton = self.optimiser is None or self.optimiser == Newton()
        return newton and self.refine and self.degree is None and self.elements == 1

    def continued(self, form: Form, degree: int, coefficients: np.ndarray, tol: float) -> Solution | None:
        """The answer next to the curve that ``coefficients`` give on one element; None where it is in doubt."""
        load()
        return _Climb(self, form, tol).continued(degree, coefficients)

    def _unbound(self, form: Form, tol: float, guess: Sampled | None) -> Solution | None:
        """The minimum without the inequalities where it keeps them, or where they hold no more than its free ends.

        None where they bind it otherwise, or none is found.
        """
        free = _Climb(replace(self, starts=1), without_inequalities(form), tol).run(guess)
        if free.verdict is Verdict.DEGENERATE and kept(form, free) is not None:
            return replace(free, method=self)  # it is one of a continuum, whatever bounds end that further on
        if not free.status.ok:
            return None
        if (found := kept(form, replace(free, method=self))) is not None:
            return found
        return self._with_held_ends(form, free, tol, guess)

    def _with_held_ends(self, form: Form, seen: Solution, tol: float, guess: Sampled | None) -> Solution | None:
        """The answer with free ends given where bounds hold them, as ``seen`` shows; None where none hold them."""
        for way in held_ends(form, seen):
            solution = self.solve(way.form, tol=tol, guess=guess)
            if solution.status.ok and (counted := way.counted(solution)) is not None:
                return counted
        return None

    def _through_contacts(self, form: Form, tol: float, guess: Sampled | None, climbs: list[_Climb]) -> Solution | None:
        """The answer with the ends of contact among the unknowns; None where that leads to none that counts.

        Those of the ``climbs`` to it are added that begin from the method's own starting curves.
        """
        started = time.perf_counter()
        optimiser = self.optimiser if isinstance(self.optimiser, Ipopt) else Ipopt()
        optimiser = replace(optimiser, tol=max(optimiser.tol, COARSE_TOLERANCE))
        switches = steep(form) and of_first_degree(form)
        meshes = (POLYGON, *COARSE) if switches else COARSE
        coarse = replace(self, refine=False, optimiser=optimiser)

        def tried(way: Ritz, nearly: float) -> Solution:
            climbs.append(_Climb(way, form, nearly))
            return climbs[-1].run(guess)

        tries = (tried(replace(coarse, elements=max(e, self.elements), degree=degree), tol) for e, degree in meshes)
        first = next((one for one in tries if one.curve is not None), None)
        if first is None:
            return None
        solution = self._held(form, first, started, tol)
        if solution is None and first.error.value > UNSEEN * abs(first.value):  # what is touched is narrower than that
            closer = tried(self, ROUGHLY)
            solution = None if closer.curve is None else self._held(form, closer, started, tol)
        return solution

    def _held(self, form: Form, first: Solution, started: float, tol: float) -> Solution | None:
        """The answer with the contacts of a ``first`` one as equations; None where it does not count."""
        if (found := self._with_held_ends(form, first, tol, None)) is not None:
            return self._timed(found, first, started)
        if steep(form) and not of_first_degree(form):
            return self._at_steepest(form, first, started, tol)
        ways = switching(form, first) if steep(form) else touching(form, first) if touchable(form) else ()
        for found in ways:
            solution = _Climb(replace(self, elements=1, degree=None, starts=1), found.form, tol).run(None)
            if not (solution.status.ok and found.counts(solution)):
                continue
            return found.plainly(self._timed(solution, first, started))
        return None

    def _at_steepest(self, form: Form, first: Solution, started: float, tol: float) -> Solution | None:
        """The answer with its slope at a bound where the ``first`` one's is, nearly; None where it does not count."""
        contacts = steepest(form, first)
        if not contacts or first.curve is None:
            return None
        led = self.at_contacts(lambda _: form, contacts, first.curve, tol)
        if led is None:
            return None
        solution, contacts = led
        found = Touching(at_bounds(form, contacts), tuple(contacts), form)
        return found.plainly(self._timed(solution, first, started)) if found.counts(solution) else None

    def at_contacts(
        self, stated: Callable[[Sequence[Contact]], Form | None], contacts: Sequence[Contact],
        curve: CurveOrSlope, tol: float,
    ) -> tuple[Solution, list[Contact]] | None:  # fmt: skip
        """The answer that follows ``contacts``, moved to where it sets out smoothly; None for none.

        They are guesses, as the ``curve`` is, and may vanish. ``stated`` is the form with them, whose pathwise
        conditions say what they are with, or None for those that it does not know: they are where this ends.
        """
        apart, shifts, vertices, contacts = math.inf, list[float](), list[float](), list(contacts)
        guess: Sampled = partial(_ordinates, curve)
        shifted, known = Shifted(), None
        for _ in range(STEPS_TO_ENDS):
            way = replace(self, elements=1, degree=ON_KNOWN_MESH if vertices else None, starts=1)
            nearly = tol if apart <= NEARLY_FOUND or not contacts else max(tol, ROUGHLY)
            if (form := stated(contacts)) is None:
                return known
            solution = _Climb(way, at_bounds(form, contacts, vertices), nearly).run(guess)
            if vertices and not solution.status.ok:  # the mesh that is known may be none for this
                afresh = replace(way, degree=None)
                solution = _Climb(afresh, at_bounds(form, contacts), nearly).run(guess)
            # ends that are off may leave a curve between them that no polynomial holds
            off = (
                nearly > tol
                and solution.status is Status.NOT_CONVERGED
                and solution.error.value <= NEARLY_FOUND * abs(solution.value)
            )
            if not (solution.status.ok or off) or solution.curve is None:
                return None
            if far_out(form, float(np.abs(solution.curve(solution.x, 0)).max())):
                return None
            following = moved(form, contacts, solution)
            apart = shift(form, contacts, following)
            if nearly == tol and (apart <= FOUND or not contacts):
                return solution, contacts
            shifts.append(apart)
            if len(shifts) > DRIFTING and apart > STILL_SHIFTED * shifts[-1 - DRIFTING]:
                return None
            vertices = kept_vertices(contacts, following, solution)
            following = shifted.mixed(contacts, following)
            known = solution, following
            contacts, guess = following, carried(form, contacts, following, solution.curve)
        return None

    def _timed(self, solution: Solution, first: Solution, started: float) -> Solution:
        """The solution with what was spent on the ``first`` one as well."""
        build, spent = first.stats.build + solution.stats.build, time.perf_counter() - started
        iterations = first.stats.iterations + solution.stats.iterations
        stats = replace(solution.stats, build=build, solve=spent - build, iterations=iterations)
        return replace(solution, method=self, stats=stats)


def first_degree(form: Form) -> int:
    """The degree of the first rung: as low as the form can do with, which at a singular end may be beyond them all."""
    least = max(form.coordinates.least_degree, 2 * form.order - 1)
    return next((degree for degree in DEGREES[form.order] if degree >= least), least)


def _ordinates(curve: CurveOrSlope, x: np.ndarray) -> np.ndarray:
    return curve(x, 0)


@dataclass
class Rung:
    """A minimum in one space, its value known to a ``gap`` (see :class:`Descent`).

    ``path`` holds the multipliers of pathwise conditions by their index.
    """

    system: RitzSystem
    z: np.ndarray
    multipliers: np.ndarray
    value: float
    path: dict[int, Callable[[np.ndarray], np.ndarray]] = field(default_factory=dict)
    levels: dict[int, float] = field(default_factory=dict)
    """Multipliers of integral inequalities by their index."""
    gap: float = 0.0


class Rungs:
    """Solves one form in one space after another, and counts the iterations."""

    def __init__(self, form: Form, optimiser: Newton | Ipopt | None, starts: int, tol: float = 0.0) -> None:
        self.form, self.starts, self.tol = form, starts, tol
        self.optimiser = optimiser if optimiser is not None else Newton()
        # Newton's iteration knows no inequalities and no pathwise conditions
        self.constrained = form.has_inequalities
        if self.constrained and isinstance(self.optimiser, Newton):
            self.optimiser = Ipopt()
        self.inequalities = any(not c.equality for c in (*form.conditions.pathwise, *form.conditions.integrals))
        self.iterations, self.most = 0, MOST_ITERATIONS
        if isinstance(self.optimiser, Ipopt):
            self.most = min(self.most, UNFINISHED * self.optimiser.iterations)
        self.more_starts = False
        """Whether starting curves were left that might have led elsewhere."""

    def first_space(self, elements: int, degree: int | None) -> Space:
        """The first mesh: equal elements and the form's knots."""
        (a, b), vertices = self.form.span, np.array(self.form.span)
        if elements > 1 or self.form.conditions.knots:
            vertices = np.unique(np.concatenate([np.linspace(a, b, elements + 1), self.form.conditions.knots]))
            close = np.diff(vertices) < 1e-12 * (b - a)
            vertices = vertices[np.concatenate([[True], ~close])]
        first = first_degree(self.form) if degree is None else max(degree, 2 * self.form.order - 1)
        return self.space(vertices, first)

    def space(self, vertices: np.ndarray, degree: int) -> Space:
        """The form's functions on a mesh."""
        if len(vertices) == 2 and not self.form.ends.periodic:
            return on_one_element(*vertices.tolist(), degree, self.form.n, self.form.order)
        return Space(vertices, degree, self.form.n, self.form.order, self.form.ends.periodic)

    def richer(self, degree: int) -> int:
        """The degree of the next rung: two more at least, as symmetry may leave nothing to gain by one more."""
        if self.inequalities:
            return degree + 4
        above = [d for d in DEGREES[self.form.order] if d > degree + 1]
        return above[0] if above else degree + max(4, degree // 3)

    def system(self, space: Space) -> RitzSystem:
        """The form discretised on a space."""
        return RitzSystem(self.form, space)

    def prolonged(self, system: RitzSystem, z: np.ndarray) -> tuple[RitzSystem, np.ndarray]:
        """The next richer space on the same mesh, and the curve of ``z`` in it."""
        space = system.space
        richer = self.space(space.vertices, self.richer(space.degree))
        coefficients = space.prolonged(system.coefficients(z), richer)
        following = self.system(richer)
        return following, following.pack(coefficients, system.unknowns(z))

    def optimise(
        self, system: RitzSystem, z: np.ndarray, multipliers: np.ndarray, *, known: bool = True, near: bool = False
    ) -> Rung | str:
        """A minimum near ``z``, or why there is none; ``known`` says that z is one in another space.

        From a curve that is one, or ``near`` one, and off the domain of L, Newton's iteration begins just inside.
        """
        if self.iterations > self.most:
            return f"{self.iterations} iterations led to no minimum"
        path: dict[Any, Any] = {}
        if isinstance(self.optimiser, Ipopt):
            outcome, path = optimise(system, z, multipliers, self.optimiser, known=known)
        else:
            most = 1.0 if known else NEXT_TO * near
            outcome = self._minimised(system, z, multipliers, self.optimiser, most)
        self.iterations += outcome.iterations
        if outcome.reason:
            return outcome.reason
        along = {k: v for k, v in path.items() if isinstance(k, int)}
        levels = {k[1]: v for k, v in path.items() if isinstance(k, tuple)}
        return Rung(system, outcome.z, outcome.multipliers, outcome.value, along, levels, outcome.gap)

    def _minimised(
        self, system: RitzSystem, z: np.ndarray, multipliers: np.ndarray, newton: Newton, most: float
    ) -> Descent:
        """Where Newton's iteration ends; where the domain of L has an edge in its way, it is taken along that.

        From beyond the edge it is begun inside, if that is no more than ``most`` of the way to the baseline.
        """
        outcome = minimise(system, z, multipliers, newton, self.tol)
        if outcome.reason == NO_NUMBER:
            for inside in toward_baseline(system, z, most):
                outcome = minimise(system, inside, multipliers, newton, self.tol, edged=True)
                if outcome.reason != NO_NUMBER:
                    break
        elif (
            outcome.reason
            and 0 < outcome.iterations < newton.iterations
            and edge_met(system, system.evaluate(outcome.z))
        ):
            outcome = minimise(system, z, multipliers, newton, self.tol, edged=True)
        return outcome

    def start(self, space: Space, guess: Sampled | None) -> Rung | str:
        """The lowest of the minima in ``space`` that the first starting curves lead to."""
        system = self.system(space)
        conditions = len(system.levels) + self.form.ends.equations
        best: Rung | None = None
        reasons: list[str] = []
        # a level is met by bending either way: both are tried, and the lower one taken
        bent, wanted = meeting_levels(system) if system.levels.size else ([], 1)
        wanted += guess is not None and wanted < COMPARED and len(bent) > 0
        found = 0
        for tried, z in enumerate(self.candidates(system, guess, bent), start=1):
            given = guess is not None and tried == 1
            rung = self.optimise(system, z, np.zeros(conditions), known=False, near=given)
            if isinstance(rung, str):
                reasons.append(rung)
            else:
                found += 1
                best = rung if best is None or rung.value < best.value else best
            if found >= wanted:
                break
            if tried >= self.starts:
                self.more_starts = True
                break
        if best is not None:
            return best
        if all(reason == NO_NUMBER for reason in reasons):
            value = system.integrated(system.fitted(guess or self.form.start.curve)).value
            return NO_DERIVATIVES if np.isfinite(value) else NOWHERE
        return f"no starting curve led to a minimum: {max(set(reasons), key=reasons.count)}"

    def candidates(
        self, system: RitzSystem, guess: Sampled | None, on_levels: Sequence[np.ndarray] = ()
    ) -> Iterator[np.ndarray]:
        """Unknown vectors to start from, the most promising first; ``on_levels`` are those that meet the levels."""
        if guess is not None:
            yield system.fitted(guess)
        yield from on_levels
        if self.form.conditions.pathwise:
            yield from clear_of_bounds(system)
        yield system.fitted(self.form.start.curve)
        yield from bent_anyhow(system)

    def improve(
        self, system: RitzSystem, step: np.ndarray, fallback: np.ndarray, before: Evaluation, multipliers: np.ndarray
    ) -> Rung | str:
        """A minimum a ``step`` from ``fallback``, or near that itself when this fails or leads above it.

        ``before`` is the evaluation there; what is higher counts in an unconstrained problem only.
        """
        outcome = self.optimise(system, fallback + step, multipliers)
        if not step.any():
            return outcome
        higher = (
            not isinstance(outcome, str)
            and not len(before.conditions)
            and outcome.value > before.value + 1e-9 * before.scale
        )
        return self.optimise(system, fallback, multipliers) if isinstance(outcome, str) or higher else outcome

    def extremal(self, rung: Rung, speed: np.ndarray | None, along: AlongGraph | None) -> Extremal:
        """The curve of a rung with its multipliers; those of an energy J^2 become those of J by the chain rule.

        ``speed`` is dx/ds at some points where x is not the parameter, ``along`` what was evaluated along the curve.
        """
        system, form, energetic = rung.system, self.form, self.form.coordinates.energetic
        coefficients, one = system.coefficients(rung.z), system.space.elements == 1
        equalities = iter(rung.multipliers[: len(system.levels)])
        lambdas = [next(equalities) if c.equality else rung.levels.get(c.index, 0.0) for c in form.conditions.integrals]
        factor = 0.5 / math.sqrt(rung.value) if energetic and rung.value > 0 else 1.0
        path = {k: lambda s, mu=mu: factor * mu(s) for k, mu in rung.path.items()}
        return Extremal(
            form, system.space.curve(coefficients), system.unknowns(rung.z).copy(), system.space.vertices,
            np.array(lambdas), path, speed, coefficients if one else None, along,
            forces=rung.multipliers[len(system.levels) :],
        )  # fmt: skip


class _Climb:
    """One solve: from a starting curve up the rungs to an answer."""

    def __init__(self, method: Ritz, form: Form, tol: float) -> None:
        self.method, self.form, self.tol = method, form, tol
        self.started = time.perf_counter()
        self.rungs = Rungs(form, method.optimiser, method.starts, tol)
        self.split_degree = TOUCHING_DEGREE if self.rungs.inequalities else SPLIT_DEGREE
        self.built = 0.0
        self.slow = 0.0
        # where corners are unknown, what holds the curve begins at them
        self.bounded = any(not c.equality for c in form.conditions.pathwise) and not form.coordinates.corners
        self.looked_beside = False

    def run(self, guess: Sampled | None) -> Solution:
        """The answer of the highest rung that is reached, from a ``guess`` or from the form's own starting curves."""
        rung = self.first_rung(guess)
        self.built = time.perf_counter() - self.started
        best: tuple[Rung, Estimate] | None = None
        previous = math.inf
        refuted = False
        while not isinstance(rung, str):
            found = self.judged(rung, previous)
            if isinstance(found, str):
                rung = found
                break
            refuted = not math.isfinite(found.error)
            if best is None or found.error < best[1].error:
                best = (rung, found)
            if not self.method.refine or self.is_met(rung, found):
                sure = settled(found)
                if isinstance(sure, str):
                    rung = sure
                    break
                if not self.method.refine or self.is_met(rung, sure):
                    vertices = self.layered(rung)
                    if vertices is None:
                        return self.alone(rung, sure)
                    rung = self.rungs.optimise(*self.on_mesh(rung, vertices), rung.multipliers)
                    best, previous = None, math.inf
                    continue
            rung, previous = self.next_rung(rung, found, previous), found.error
        if best is None:
            stats = Stats(0.0, time.perf_counter() - self.started, self.rungs.iterations)
            status = Status.REFUSED if rung == NOWHERE else Status.NOT_CONVERGED
            return no_answer(self.form.problem, self.method, status, rung, stats=stats)
        sure = settled(best[1])
        # the last space, the richest, has the last word: where it holds no minimum, that of a poorer one was none
        if isinstance(sure, str) or refuted:
            sure = replace(best[1], error=math.inf)
        return self.report(best[0], sure, rung)

    def judged(self, rung: Rung, previous: float) -> Estimate | str:
        """The errors of a rung, with what a bound may do beside a vertex where no point of a rule sees it.

        Why there are none where curves of ever less value lead further and further out.
        """
        found = estimate(self.rungs, rung, previous)
        if isinstance(found, str):
            return found
        if (not math.isfinite(found.error) or self.astray(found)) and far_out(self.form, found.size):
            return f"curves of ever less value lead out to {found.size:.3g}"
        if not self.bounded:
            return found
        return replace(found, error=found.error + found.scale * hidden(self.tol))

    def continued(self, degree: int, coefficients: np.ndarray) -> Solution | None:
        """The answer next to a known curve, without a climb; None where it is in doubt."""
        rungs = self.rungs
        system = rungs.system(rungs.space(np.array(self.form.span), degree))
        outcome = minimise(system, coefficients[system.free], np.zeros(0), Newton(STEPS_FROM_NEARBY), self.tol)
        if outcome.reason or not outcome.direct:
            return None
        rungs.iterations += outcome.iterations
        rung = Rung(system, outcome.z, outcome.multipliers, outcome.value)
        found = estimate(rungs, rung, math.inf)
        if isinstance(found, str) or not self.is_met(rung, found):
            return None
        sure = settled(found)
        return None if isinstance(sure, str) or not self.is_met(rung, sure) else self.alone(rung, sure)

    def first_rung(self, guess: Sampled | None) -> Rung | str:
        """A minimum in the first space, or in the next ones: a coarse space may hold none where a richer one does."""
        rungs = self.rungs
        space = rungs.first_space(self.method.elements, self.method.degree)
        rung = rungs.start(space, guess)
        while isinstance(rung, str) and self.method.refine and space.degree < RESTART_DEGREE:
            if self.method.starts <= 2:
                rungs.more_starts = True
                break
            space = rungs.space(space.vertices, rungs.richer(space.degree))
            rung = rungs.start(space, guess)
        return rung

    def is_met(self, rung: Rung, found: Estimate) -> bool:
        """Whether value and curve are as good as asked for, or as good as double precision allows."""
        size = max(1.0, abs(found.value))
        # a small functional is solved to its own size, but not where a comparison of two solves is all there is
        own = found.scale
        if size * self.tol >= found.error > self.tol * 10 * own:  # it may be small by cancellation: a minimum of zero
            own = max(own, found.system.quadratic_size(found.at))
        target = self.tol * (size if self.rungs.constrained else min(size, 10 * own))
        return found.error <= max(target, found.floor) and not self.astray(found) and self.curve_is_good(rung, found)

    def astray(self, found: Estimate) -> bool:
        """Whether the curve does not settle, though the value may: then no curve attains it.

        One that vanishes on a bound settles where next to nothing is left of it.
        """
        moved = found.curve / unsettled(self.tol)
        if not moved > found.size:
            return False
        only_bounds = self.rungs.inequalities and not self.form.conditions.integrals
        return not only_bounds or moved > NEXT_TO_NOTHING * flat(self.form)

    def curve_is_good(self, rung: Rung, found: Estimate) -> bool:
        """Whether the curve is as good as the value's tolerance promises, as far as the degree alone can make it.

        The value is stationary, so its error is the square of the curve's: a
        curve is not left worse than that when one more rung would mend it.
        """
        space = rung.system.space
        climbing = space.degree < DEGREES[self.form.order][-2] and space.elements == 1
        return not climbing or found.curve <= max(CURVE * math.sqrt(self.tol), 1e-14) * found.size

    def next_rung(self, rung: Rung, found: Estimate, previous: float) -> Rung | str:
        """Climb the degree while that pays, else bisect where the error is."""
        local = (found.shares > BISECTED_SHARE * found.shares.max()).sum() <= FEW and rung.system.space.elements > FEW
        # what a prescribed integral makes stand upright is a minimum in no richer space, nor on its way into a layer
        local = local and (math.isfinite(found.error) or not self.form.conditions.integrals)
        self.slow = 0.0 if found.error < SLOW * previous else self.slow + (LOCAL if local else 1.0)
        if self.slow >= SLOW_REFINEMENTS:
            return "refinement after refinement hardly lowered the error"
        given, space = max(MOST_UNKNOWNS, MOST_AN_ELEMENT * (1 + len(self.form.conditions.knots))), rung.system.space
        if space.degree >= self.split_degree:  # of many elements a few are bisected at the price of all
            given = min(given, MOST_WORTH_WHILE)
        if rung.system.size > (MOST_WORTH_WHILE if found.error < WORTH_WHILE * previous else given):
            return f"{rung.system.size} unknowns did not suffice"
        stalled = found.error > STALLED * previous or space.degree >= DEGREES[self.form.order][-1]
        kinked = self.bounded and space.elements > 1  # where a bound begins to hold the curve
        if (stalled or kinked) and space.degree >= self.split_degree:
            system, z = self.bisected(rung, found.shares)
            following = self.rungs.optimise(system, z, rung.multipliers)
        elif found.solved is not None:
            return found.solved
        else:
            # a shifted step may leap into another basin; only a true Newton step is taken whole
            whole = found.step is not None and found.step.definite
            step = found.step.change if whole and found.step is not None else np.zeros_like(found.z)
            system = found.system
            following = self.rungs.improve(system, step, found.z, found.at, rung.multipliers)
        if isinstance(following, str) and system.space.degree <= RESTART_DEGREE and system.space.elements == 1:
            # what was a minimum in the poorer space led nowhere: look again from the starting curves
            return self.rungs.start(system.space, None)
        return following

    def bisected(self, rung: Rung, shares: np.ndarray) -> tuple[RitzSystem, np.ndarray]:
        """The elements that carry the error cut in two, and the curve on the new mesh."""
        space = rung.system.space
        marked = shares > BISECTED_SHARE * shares.max()
        marked = marked if marked.any() else np.ones_like(marked)
        if self.bounded:
            return self.on_mesh(rung, np.union1d(space.vertices, cuts(rung.system, rung.z, marked)))
        coarse = self.rungs.space(space.vertices, min(space.degree, self.split_degree))
        kept = np.zeros(coarse.size)
        kept[coarse.numbers] = rung.system.coefficients(rung.z)[space.numbers[:, : coarse.degree + 1]]
        finer, coefficients = coarse.split(kept, marked)
        system = self.rungs.system(finer)
        return system, system.pack(coefficients, rung.system.unknowns(rung.z))

    def on_mesh(self, rung: Rung, vertices: np.ndarray) -> tuple[RitzSystem, np.ndarray]:
        """The curve of a rung on a mesh with other vertices."""
        space = rung.system.space
        system = self.rungs.system(self.rungs.space(vertices, min(space.degree, self.split_degree)))
        curve = space.curve(rung.system.coefficients(rung.z))
        return system, system.pack(system.space.fit(lambda s: curve(s, 0)), rung.system.unknowns(rung.z))

    def layered(self, rung: Rung) -> np.ndarray | None:
        """The vertices of a mesh with layers where bounds begin to hold the curve; None where it needs none."""
        if self.looked_beside or not (self.method.refine and self.bounded):
            return None
        self.looked_beside = True
        return layered(rung.system, rung.z, self.tol)

    def report(self, rung: Rung, found: Estimate, reason: str) -> Solution:
        """The answer of a rung with its estimated error, and the ``reason`` where it falls short of the tolerance."""
        if found.solved is not None or found.moved_back:  # the answer is what was found in the richer space
            rung = replace(rung, system=found.system, z=found.z)
        space: Space = rung.system.space
        value, error = float(found.value), float(found.error + found.floor)
        status, message = self.verdict(error, found.floor, value, reason)
        if self.method.refine and status.ok and self.astray(found):
            status = Status.NOT_CONVERGED
            message = f"the value settles near {self.form.sign * value:.6g}, but the curve does not: {reason}"
        solve_time = time.perf_counter() - self.started - self.built
        stats = Stats(
            self.built, solve_time, self.rungs.iterations, rung.system.size, space.elements, space.degree
        )  # fmt: skip
        curve = max(float(found.curve), 4e-16 * found.size)
        extremal = self.rungs.extremal(rung, self.speed(found), self.along(found))
        extremal = replace(extremal, samples=self.samples(found))
        return answer(
            extremal, self.method, self.form.sign * value, ErrorEstimate(error, curve), space.vertices, stats,
            status, message, rule=found.system.count,
        )  # fmt: skip

    def speed(self, found: Estimate) -> np.ndarray | None:
        """The speed dx/ds where the curve was judged, and at its ends; None where x is its own parameter."""
        if not self.form.coordinates.energetic:
            return None
        return with_ends(found.system.x, found.here.dx, self.form.span)

    def samples(self, found: Estimate) -> SampledExtremal | None:
        """Where the curve was judged, for a graph of first order."""
        if self.form.order > 1:
            return None
        here = found.here
        with np.errstate(divide="ignore", invalid="ignore"):
            return SampledExtremal(found.system.x, here.x, here.y.T, (here.dy / here.dx[:, None]).T)

    def along(self, found: Estimate) -> AlongGraph | None:
        """What was evaluated along a smooth graph in the user's own coordinates; None for other curves."""
        system, at, n = found.system, found.at, self.form.n
        if not self.form.plainly_reported or system.extra or system.order > 1 or system.space.elements > 1:
            return None
        top = slice(n, 2 * n)
        y, dy = at.variables[:, :n].T, at.variables[:, top].T
        return AlongGraph(system.x, y, dy, at.integrands[:, 0], at.slopes[:, 0, top].T, at.hessians[:, 0, top, top])

    def alone(self, rung: Rung, found: Estimate) -> Solution:
        """The answer, refused where the minimum is one of a continuum."""
        solution = self.report(rung, found, "")
        if not found.suspect or found.step is None:
            return solution
        why = degenerate(self.rungs, found.system, found.z, found.step, found.curve / found.size)
        if why is None:
            return solution
        status = Status.NOT_CONVERGED if why[0] is None else Status.REFUSED
        return replace(solution, status=status, verdict=why[0], message=why[1])

    def verdict(self, error: float, floor: float, value: float, reason: str) -> tuple[Status, str]:
        """The status of an answer and, when it does not stand, the sentence that says why."""
        target = self.tol * max(1.0, abs(value))
        if not math.isfinite(error):
            return Status.NOT_CONVERGED, reason or "the curve found is not a minimum in a richer space"
        if self.method.refine and error - floor > max(target, floor):
            met = f"the tolerance {self.tol:g} was not met: {reason}; the error estimate is {error:.2g}"
            return Status.NOT_CONVERGED, met
        if floor > WORTHLESS * max(1.0, abs(value)):
            return Status.NOT_CONVERGED, "round-off leaves nothing of the value: the ends are conjugate, or nearly so"
        limited = floor > target or (self.method.refine and error > target)
        return (Status.ROUND_OFF if limited else Status.SOLVED), ""
