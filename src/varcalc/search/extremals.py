"""extremals: every extremal that a systematic search finds."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from varcalc.formulation import Form, Sampled
from varcalc.formulation.singular import Infinite, forms
from varcalc.integrators import RunOutcome
from varcalc.methods.arguments import check_arguments
from varcalc.methods.collocation.method import Collocation
from varcalc.methods.crossings import met_by
from varcalc.methods.shooting.method import Shooting
from varcalc.problem.functional import Functional
from varcalc.progress import Interrupted, Progress, telling
from varcalc.search.collected import as_asked, deflated, degenerate, finer
from varcalc.search.end_map import EndMap, mappable
from varcalc.search.lattice import SLOPE_SIZES, StartLattice, shootable
from varcalc.search.scan import scan
from varcalc.search.sequence import Extremals
from varcalc.search.windings import wound
from varcalc.solution import WORTHLESS_ERROR, Solution, Verdict
from varcalc.spelling import spelled
from varcalc.verify.candidate import COMPARED_POINTS

SAME_SLOPE = 1e-6
"""Relative difference of initial slopes up to which two routes found the same extremal."""
SAME_CURVE = 1e-8
"""Distance of two curves, relative to their size, below which they are one."""
MERGED_CURVES = 1e-4
"""The same where one of them is degenerate."""
CONFIRMING_DEGREE = 20
"""Degree with which an extremal is found again: enough for the curve, not only its value, to be good."""
END_MISSED = 1e-6
"""Relative distance from a fixed end beyond which a curve misses it."""


@spelled
def extremals(
    problem: Functional, *, tol: float = 1e-10, period: Any = None, windings: int = 1, progress: Progress = None
) -> Extremals:
    """Every extremal of ``problem`` that a systematic search finds, best first.

    One unknown function with a fixed end and a Lagrangian of first order is
    searched by its initial slope: all trajectories of a wide range of slopes
    are followed to the other end, and every zero of their miss there is taken
    (a shooting method; Gelfand and Fomin, "Calculus of Variations", sect. 26
    for the map and its derivative). For every problem the collocated
    Euler-Lagrange equation is solved from many starting curves, the solutions
    found being deflated (Farrell, Birkisson and Funke 2015). Each extremal is
    then refined to ``tol`` as :func:`varcalc.solve` does, and one that no
    refinement confirms is left out.

    A coordinate that is an angle is told by ``period``: a number, or one entry
    for each unknown function, None where there is no period. Then curves that
    end up to ``windings`` periods further on, either way, are sought as well;
    the number of each is in ``windings`` of the sequence, and in the name of
    its solution's problem.

    The sequence is empty when there is none. Its ``searched`` says what range
    was covered; nothing is claimed about what lies outside. ``progress`` is as
    :data:`varcalc.progress.Progress` says; Ctrl-C raises :class:`varcalc.Interrupted`, which holds the extremals that
    are found.

    Raises TypeError or ValueError for unusable arguments, such as a period
    that the Lagrangian does not have.

    >>> import casadi as ca
    >>> import varcalc as vc
    >>> film = vc.Problem(lambda x, y, dy: y * ca.sqrt(1 + dy**2), vc.Fixed(-0.5, 1), vc.Fixed(0.5, 1))
    >>> found = vc.extremals(film)
    >>> [round(film.y(0.0), 6) for film in found]
    [0.848338, 0.235095]
    >>> [film.index for film in found], found[1].conjugate_points.round(9)
    ([0, 1], array([0.15291144]))
    >>> found.searched.split(" that ")[0]
    'all with initial slope in [-1e+06, 1e+06]'

    On a cylinder of radius 1, from height 0 to 1 and from angle 0 to 2:

    >>> cylinder = vc.Problem(lambda z, angle, slope: ca.sqrt(1 + slope**2), vc.Fixed(0, 0), vc.Fixed(1, 2))
    >>> found = vc.extremals(cylinder, period=2 * ca.pi)
    >>> [(k, round(helix.value, 9)) for k, helix in zip(found.windings, found)]
    [(0, 2.236067977), (-1, 4.398372014), (1, 8.3433302)]
    """
    check_arguments(problem, None, tol)
    moved = list(wound(problem, period, windings))
    searches: list[_ExtremalSearch] = []
    # trajectories leave the Lagrangian's domain; what is no number is left out
    with telling(progress, problem.name) as told:
        try:
            for number, each in moved:
                winding = None if period is None else number
                searches.append(_ExtremalSearch(tol, partial(told, len(searches), len(moved)), winding))
                searches[-1].run(each)
        except KeyboardInterrupt as stop:
            raise Interrupted(_together(searches, ["stopped before its end"])) from stop
    return _together(searches, [])


def _together(searches: Sequence[_ExtremalSearch], remarks: list[str]) -> Extremals:
    """What the searches of all windings have found, complete where there is nothing to remark."""
    said = [(search.winding, "; ".join(search.words)) for search in searches if search.words]
    words = [told if winding is None else f"winding {winding}: {told}" for winding, told in said]
    found = [(solution, search.winding or 0) for search in searches for solution in search.found]
    complete = not remarks and all(search.complete for search in searches)
    return Extremals([s for s, _ in found], ". ".join([*words, *remarks]), [w for _, w in found], complete)


def by_slope_alone(problem: Functional, tol: float) -> Extremals | None:
    """What a scan of the initial slope finds, the first part of :func:`extremals`; None where there is none to scan."""
    search = _ExtremalSearch(tol)
    with np.errstate(all="ignore"):
        form = next((form for form in forms(problem) if form is not None and mappable(form)), None)
        if form is None:
            return None
        search.by_slope(form)
    return Extremals(search.found, "; ".join(search.words), (), search.complete)


@dataclass
class _ExtremalSearch:
    """The extremals found so far, and what was done to find them."""

    tol: float
    told: Callable[[str], Any] = lambda _: None
    winding: Any = None

    def __post_init__(self) -> None:
        self.found: list[Solution] = []
        self.words: list[str] = []
        self.complete = False
        """Whether a scan of one number covers all there is, and resolved it."""

    def _leave_out_what_meets_switches(self) -> None:
        """Drop curves that go through a kink or a jump: the equations they were found by do not hold there."""
        smooth = [s for s in self.found if not met_by(s)]
        if len(smooth) < len(self.found):
            self.words.append(
                f"curves that meet kinks or jumps of the problem, {len(self.found) - len(smooth)}, left out"
            )
            self.found, self.complete = smooth, False

    def run(self, problem: Functional) -> None:
        """Search a problem, and leave out the curves for which its equations do not hold."""
        self._search_forms(problem)
        self._leave_out_what_meets_switches()

    def _search_forms(self, problem: Functional) -> None:
        """Search the forms of a problem in turn until one gives extremals."""
        try:
            candidates = [form for form in forms(problem) if form is not None]
        except Infinite as reason:
            self.words.append(str(reason))
            return
        for form in candidates:
            if not self.by_slope(form):
                self.by_lattice(form)
                self.by_deflation(form)
            if self.found:
                break
        else:
            self.by_collocation(candidates)

    def by_slope(self, form: Form) -> bool:
        """Scan the initial slopes of a form that allows it; True when that leaves nothing else to find."""
        if not mappable(form):
            return False
        self.told("initial slopes")
        end_map = EndMap(form)
        scanned = scan(end_map)
        self.words.append(scanned.searched)
        degenerates = scanned.double if scanned.continuum is None else [scanned.continuum]
        lost = 0
        for u in scanned.zeros + degenerates:
            slope = np.array([math.sinh(u)])
            solution = _confirmed(form, end_map.curve(u), end_map.slope, slope, self.tol)
            if solution is None:
                lost += 1
            else:
                self.add(degenerate(solution) if u in degenerates else solution)
        begun = all(outcome is not RunOutcome.NOT_FINITE for *_, outcome in scanned.lost)
        self.complete = begun and not (lost or scanned.unresolved)
        if lost:
            self.words.append(f"{lost} zeros of the miss at the end were not confirmed and are left out")
        return scanned.continuum is not None

    def by_lattice(self, form: Form) -> None:
        """Shoot with slopes in all directions where a scan would have to be in more than one dimension."""
        if mappable(form) or not shootable(form):
            return
        self.told("initial slopes in all directions")
        lattice = StartLattice(form)
        before = len(self.found)
        for slope, near, guess in lattice.roots():
            solution = _confirmed(near, guess, lattice.slope, slope, self.tol)
            if solution is not None:
                self.add(solution)
        self.words.append(
            f"shooting from {len(list(lattice.slopes()))} initial slopes of up to {SLOPE_SIZES[-1]:g} times the "
            f"problem's size gave {len(self.found) - before}"
        )

    def by_deflation(self, form: Form) -> None:
        """Solve the collocated equations from many starting curves."""
        reason = Collocation().inapplicable(form)
        if reason:
            self.words.append(f"not searched by collocation: {reason}")
            return
        self.told("starting curves")
        before = len(self.found)
        for solution in deflated(form, self.tol):
            self.add(solution)
        self.words.append(
            f"deflated Newton iterations from the starting curves gave {len(self.found) - before} "
            f"{'more' if before else 'in all'}"
        )

    def by_collocation(self, candidates: list[Form]) -> None:
        """The extremal that collocation comes to in the first form that has one, where the search had none to show."""
        for form in candidates:
            if Collocation().inapplicable(form):
                continue
            solution = as_asked(Collocation().solve(form, tol=finer(self.tol), guess=None), self.tol)
            if solution.status.ok:
                self.add(solution)
                break
        if self.found:
            self.words.append("collocation from its own starting curves gave 1")

    def add(self, solution: Solution) -> None:
        """Keep a solution that has digits to show, meets its ends, and is not one of those known."""
        sound = solution.error.value <= WORTHLESS_ERROR * max(1.0, abs(solution.value)) and meets_ends(solution)
        if sound and not any(same_curve(solution, other) for other in self.found):
            self.found.append(solution)


def _confirmed(
    form: Form, guess: Sampled, slope_of: Callable[[Sampled], np.ndarray], slope: np.ndarray, tol: float
) -> Solution | None:
    """The extremal near a trajectory, found again by collocation or by multiple shooting; None when another is found.

    ``slope`` (n,) is the scaled slope of the trajectory where it sets out, ``slope_of`` that of a curve's derivative.
    """
    for method in (Collocation(degree=CONFIRMING_DEGREE), Shooting()):
        solution = as_asked(method.solve(form, tol=finer(tol), guess=guess), tol)
        if solution.status.ok and solution.curve is not None:
            reached = slope_of(derivative(form, solution))
            if np.abs(reached - slope).max() <= SAME_SLOPE * (1.0 + np.abs(slope).max()):
                return solution
    return None


def derivative(form: Form, solution: Solution) -> Sampled:
    """The derivative of a solution by the form's abscissa."""
    curve = solution.curve
    assert curve is not None
    if form.lift is None:
        return lambda s: curve(s, 1)
    start, end = solution.interval
    width = end - start
    return lambda s: width * curve(start + s * width, 1)


def meets_ends(solution: Solution) -> bool:
    """True when the curve has the values prescribed at fixed ends, which a change of coordinates may have lost."""
    problem, curve = solution.problem, solution.curve
    assert curve is not None
    for x, end in zip(problem.span, (problem.start, problem.end), strict=True):
        values, reached = end.values(problem.n), curve(np.array([x]), 0)[:, 0]
        met = np.abs(reached - values) <= END_MISSED * np.maximum(1.0, np.abs(values)) + solution.error.curve
        if not np.all(met | np.isnan(values)):
            return False
    return True


def same_curve(one: Solution, other: Solution) -> bool:
    """True when two solutions are one extremal, within what their errors allow."""
    assert one.curve is not None
    assert other.curve is not None
    spans = np.array([one.interval, other.interval])
    width = float(np.ptp(spans[0]))
    if float(np.abs(spans[0] - spans[1]).max()) > SAME_CURVE * max(width, float(np.abs(spans).max())):
        return False
    x = np.linspace(max(spans[:, 0]), min(spans[:, 1]), COMPARED_POINTS)
    first, second = one.curve(x, 0), other.curve(x, 0)
    size = float(np.abs(first).max())
    # where two merge, their distance is the root of what is left of the conditions
    merged = Verdict.DEGENERATE in (one.verdict, other.verdict)
    allowed = (MERGED_CURVES if merged else SAME_CURVE) * max(size, width * 1e-3) + 2 * (
        one.error.curve + other.error.curve
    )
    return float(np.abs(first - second).max()) <= allowed
