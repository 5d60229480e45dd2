"""Certificates of solutions: what is to be proved of which curve is chosen here, and what it comes to put together."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from varcalc.certificates.balls import above, below, flint, working
from varcalc.certificates.bounds import bounds
from varcalc.certificates.by_convexity import by_convexity
from varcalc.certificates.by_tube import BOUNDS, PACED, about_curve, bounded, certified
from varcalc.certificates.certificate import Certificate, Distance, Hypothesis, Means, Scope, decimals
from varcalc.certificates.choice import Told
from varcalc.certificates.closed import begun
from varcalc.certificates.inequalities import inequalities
from varcalc.certificates.integrals import Unproved
from varcalc.certificates.kinks import Kinked, kinks
from varcalc.certificates.pathwise import pathwise
from varcalc.certificates.regular import Regular, check_forward, regular
from varcalc.certificates.separated import Separated, separated
from varcalc.certificates.setting import Setting, as_graph, setting_along
from varcalc.certificates.shifts import pinned
from varcalc.certificates.smooth import Undecided
from varcalc.formulation.singular import forms, number_of
from varcalc.methods.answer import of_energy
from varcalc.methods.collocation.method import Collocation
from varcalc.problem.conditions import Bound, Isoperimetric, whole
from varcalc.problem.exact import exactly
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Problem
from varcalc.progress import Interrupted, Progress, telling
from varcalc.solution import Solution, Status, VariationalError, no_solution
from varcalc.solve.ladder import solve
from varcalc.spelling import spelled
from varcalc.verify.along_curve import AlongCurve, in_form
from varcalc.verify.along_curve import along_curve as along_curve_of
from varcalc.verify.candidate import candidate, in_regular_form

BITS = 128
"""Precision of the balls."""
SERIES_LENGTH = 24
"""Length to which Arb keeps series: more than any Taylor form here has terms."""

WIDE = 1e-13
"""Width of an interval, relative to the value, from which on another proof is tried."""

CURVE, NEARBY = "the curve", "a problem that bounds this one from below"
"""What is told while it is done."""
COORDINATES = "the end where L is infinite is regular in alpha and z, by which the tube and the distances are meant"
FORWARD = "the curve y0 is a graph: its abscissa grows"
FORTH = "a curve that runs back is no shorter than a graph: the abscissa does not occur in the metric"
EXPRESSION = "L is CasADi's expression, in which products of the numbers of a function may be rounded"
SUBGRADIENTS = "lines of support, which hang on x, are in place of convex terms of L, so that it is nowhere more than L"
MULTIPLIERS = "the multipliers of the levels have their signs, so that L with them is no more than L where these hold"
KINKS_MET = (
    "kinks and jumps that the curve meets are covered where these are convex, in graphs without conditions other than "
    "waypoints and prescribed integrals"
)
SHIFTED = "shifted curves have the same value: they are meant shifted so that all have one start"
BEGUN = (
    "a closed curve may begin at any of its points, and be shifted where that changes nothing: each is meant from "
    "a start for which a linear integral vanishes, and less that start"
)
SEPARATED = (
    "up to x = {:.3g} beside the line where L is infinite the length exceeds a quadratic in y there, by Hamilton and "
    "Jacobi's equation; y0 is what goes on from there"
)
SIGNS = "the multipliers of the bounds have their signs, so that L with them is no more than L within the bounds"
WITHIN = "the curve of the upper bound lies within all bounds"


@spelled
def certify(solution: Solution, *, digits: int | None = None, progress: Progress = None) -> Certificate:
    """Prove between which two numbers the infimum lies that a solution is an estimate of.

    The proof is Hilbert's invariant integral of a quadratic near the curve, with every inequality checked in ball
    arithmetic, see :doc:`certificates`. Curve, field, tube and boxes are chosen here.

    Raises VariationalError where the proof is not found: which inequality failed, and where. Raises ImportError where
    python-flint is not installed. Raises TypeError or ValueError for what is no solution, and for digits that are no
    whole number from 1 on.

    Parameters
    ----------
    solution:
        What :func:`varcalc.solve` found: a minimum, or a maximum of a functional that is to be greatest.
    digits:
        Decimal digits of the value that the interval must tell; by default as many as it happens to.
    progress:
        As :data:`varcalc.progress.Progress` says. Ctrl-C raises :class:`varcalc.Interrupted`, which holds the
        ``solution``: nothing is proved of it before the end.

    Returns
    -------
    Certificate
        The interval, the curves it speaks of and the theorem.

    References
    ----------
    Gelfand and Fomin, "Calculus of Variations", sect. 33 (Hilbert's invariant integral); Carathéodory, "Calculus of
    Variations and Partial Differential Equations of the First Order", ch. 12.

    Examples
    --------
    >>> import varcalc as vc
    >>> swing = vc.Problem(lambda t, q, v: (v**2 - q**2) / 2, vc.Fixed(0, 0), vc.Fixed(2, 1))
    >>> certificate = vc.certify(vc.solve(swing))
    >>> certificate.scope
    <Scope.ALL: 'all curves'>
    >>> certificate.width < 1e-16
    True
    """
    if not isinstance(solution, Solution):
        raise no_solution(solution, "certify")
    if digits is not None:
        whole("digits", digits)
    flint()
    if not solution.status.ok:
        raise VariationalError(solution)
    if of_energy(solution):
        raise _refusal(
            solution, "the curve was found by its energy, the square of the functional: certify that problem"
        )
    certificate = _timed(solution, progress)
    size = max(abs(certificate.lower), abs(certificate.upper))
    if digits is not None and not certificate.width <= 10.0**-digits * size:
        raise _refusal(solution, f"the interval is {certificate.width:.1g} wide, too much for {digits} digits")
    return certificate


def _timed(solution: Solution, progress: Progress) -> Certificate:
    """The certificate with the time that it took; VariationalError where there is none."""
    began = time.perf_counter()
    try:
        with telling(progress, solution.problem.name) as told, working(BITS, SERIES_LENGTH):
            exact, written = _exact(solution)
            found = _proved(exact, partial(told, 0, None))
    except (Unproved, Undecided) as unproved:
        raise _refusal(solution, str(unproved)) from None
    except KeyboardInterrupt as stop:
        raise Interrupted(solution) from stop
    seconds = time.perf_counter() - began
    return replace(found, solution=solution, proved=(*found.proved, *written), seconds=seconds)


def _refusal(solution: Solution, reason: str) -> VariationalError:
    return VariationalError(replace(solution, status=Status.REFUSED, message=f"no certificate: {reason}"))


def _exact(solution: Solution) -> tuple[Solution, tuple[Hypothesis, ...]]:
    """The solution with the problem as its functions were written; where these are lost, what is proved instead."""
    problem, extremal = exactly(solution.problem), solution.extremal
    if problem is None:
        return solution, (Hypothesis(EXPRESSION, Means.CONSTRUCTION),)
    if problem is solution.problem:
        return solution, ()
    number = None if extremal is None else number_of(extremal.form)
    if extremal is not None:
        extremal = None if number is None else replace(extremal, form=forms(problem)[number])
    return replace(solution, problem=problem, extremal=extremal), ()


def _proved(solution: Solution, told: Told) -> Certificate:
    """The certificate of a solution; by duality where another proof fails, tells little, or of slopes near alone."""
    found, reason = None, Unproved("")
    try:
        found = _proof(solution, told)
    except (Unproved, Undecided) as unproved:
        reason = unproved
    enough = 0.0 if found is None else WIDE * abs(found.upper)
    if found is not None and found.width <= enough and found.scope is not Scope.WEAK:
        return found
    try:
        other = _by_convexity(solution, told)
    except (Unproved, Undecided):
        if found is None:
            raise reason from None
        return found
    return other if found is None or other.width < max(found.width, enough) else found


def _by_convexity(solution: Solution, told: Told) -> Certificate:
    """The certificate of a functional by its dual."""
    told(BOUNDS)
    low, high, proved = by_convexity(solution)
    if solution.problem.maximise:
        low, high = -high, -low
    return Certificate(
        solution=solution,
        lower=below(low),
        upper=above(high),
        enclosure=decimals(low, high),
        scope=Scope.ALL,
        tube=math.inf,
        slopes=math.inf,
        integrals=(),
        distance=Distance(math.inf, math.inf),
        proved=(about_curve()[0], *proved),
        seconds=0.0,
    )


def _proof(solution: Solution, told: Told) -> Certificate:
    """The certificate of a solution's curve, polished, in coordinates in which it is regular."""
    if any(solution.problem.of_type(Bound)):
        return _within_bounds(solution, told)
    kinked = kinks(solution)
    if kinked is not None:
        try:
            return _over_kinks(solution, kinked, told)
        except Unproved:
            if kinked.met:
                raise
    told(CURVE)
    alike = pinned(solution)
    if alike is not None:
        found = _proof(_solved_nearby(*alike, told), told)
        return replace(found, proved=(*found.proved, Hypothesis(SHIFTED, Means.CONSTRUCTION)))
    try:
        found = _regular_curve(solution)
        return _of_length(solution, found, told) if isinstance(found, Regular) else _of_curve(solution, found, told)
    except (Unproved, Undecided):
        parted = separated(solution)
        if parted is None:
            raise
    return _parted(parted, told)


def _parted(parted: Separated, told: Told) -> Certificate:
    """The certificate of a singular length, by that of its regular rest, which begins or ends free."""
    rest, setting = _rest(parted, parted.guess, told)
    # where it begins is told by its value to half the digits alone: once more from there
    parted = parted.moved(float(setting.joints[-parted.end][0]))
    rest, setting = _rest(parted, rest.y, told)
    low, _, found = bounded(rest, setting, told)
    low = (low + parted.lower()).lower()
    high = (setting.along.value + parted.upper(float(setting.joints[-parted.end][0]))).upper()
    return replace(
        found,
        lower=below(low),
        upper=above(high),
        enclosure=decimals(low, high),
        scope=Scope.TUBE if found.scope is Scope.ALL else found.scope,
        tube=min(found.tube, parted.room),
        distance=Distance(math.inf, math.inf),
        proved=(*found.proved, Hypothesis(SEPARATED.format(parted.at), Means.BALLS)),
    )


def _regular_curve(solution: Solution) -> AlongCurve | Regular:
    """The curve, polished; of a singular length the regular problem near it."""
    try:
        along = _polished(solution)
    except Unproved:
        # at an end where the metric is infinite Newton's iteration for the curve may fail
        extremal = in_regular_form(solution)
        found = None if extremal is None else regular(along_curve_of(extremal))
        if found is None:
            raise
        return found
    return regular(along) or along


def _of_curve(solution: Solution, along: AlongCurve, told: Told) -> Certificate:
    """The certificate of a curve in coordinates in which it is regular, under whatever it is held by."""
    if along.paths and not along.form.broken_at_switches:
        return _under_equations(solution, along, told)
    if along.form.coordinates.gauged and along.form.ends.periodic:
        ring = begun(along)
        found = certified(replace(solution, problem=ring.form.problem), ring, told)
        hypotheses = (Hypothesis(sentence, Means.CONSTRUCTION) for sentence in (PACED, BEGUN))
        return replace(found, proved=(*found.proved, *hypotheses))
    if any(isinstance(c, Isoperimetric) and not c.equality for c in solution.problem.constraints):
        return _under_inequalities(solution, along, told)
    reason = _out_of_reach(along)
    if reason:
        raise Unproved(reason)
    return certified(solution, along, told)


def _within_bounds(solution: Solution, told: Told) -> Certificate:
    """The certificate of a curve that bounds hold, as it was found."""
    along = as_graph(solution) if solution.extremal is None else along_curve_of(solution.extremal)
    if along is None:
        raise Unproved("bounds are covered where the method knows its curve in coordinates of its own")
    reason = Unproved("")
    for held in bounds(along):
        held.prove_signs()
        if _out_of_reach(held.plain):
            raise Unproved(_out_of_reach(held.plain))
        try:
            # off what it touches its way back would be longer
            setting = setting_along(held.plain, solution.value, held.terms, as_found=any(held.touched))
            found = bounded(solution, setting, told, held)[2]
        except Unproved as unproved:
            reason = unproved
        else:
            return replace(found, proved=(*found.proved, *(Hypothesis(what, Means.BALLS) for what in (SIGNS, WITHIN))))
    raise reason


def _under_inequalities(solution: Solution, along: AlongCurve, told: Told) -> Certificate:
    """The certificate of a curve under levels that are inequalities, by that of L + lambda g without them."""
    problem, reason = solution.problem, _out_of_reach(along)
    if reason or not isinstance(problem, Problem):
        raise Unproved(reason or "levels of a Curve that are inequalities are not covered")
    held = inequalities(problem, setting_along(along, solution.value))
    free = _solved_nearby(held.lower(), solution.y, told)
    found = bounded(free, setting_along(_polished(free), free.value), told, held)[2]
    return replace(found, proved=(*found.proved, Hypothesis(MULTIPLIERS, Means.BALLS)))


def _under_equations(solution: Solution, along: AlongCurve, told: Told) -> Certificate:
    """The certificate of a curve that meets equations at each of its points, by those around it that need not."""
    reason = Unproved("")
    for held in pathwise(along):
        if _out_of_reach(held.along):
            raise Unproved(_out_of_reach(held.along))
        try:
            found = bounded(solution, setting_along(held.along, solution.value, held.terms), told, held)[2]
            return replace(found, proved=(*found.proved, *held.told()))
        except Unproved as unproved:
            reason = unproved
    raise reason


def _solved_nearby(problem: Functional, guess: Callable[..., Any], told: Told) -> Solution:
    """The extremal of a problem that stands for another, near that one's curve."""
    told(NEARBY)
    try:
        return solve(problem, Collocation(), guess=guess, progress=False)
    except VariationalError as error:
        raise Unproved(f"the problem by which this one is bounded is not solved: {error}") from None


def _over_kinks(solution: Solution, kinked: Kinked, told: Told) -> Certificate:
    """The certificate of a curve of a Lagrangian with convex kinks, by that of a smooth one that lies below it."""
    assert isinstance(solution.problem, Problem)
    kinked.prove()
    smooth = _solved_nearby(kinked.lower(solution.problem), kinked.guess, told)
    found = bounded(smooth, setting_along(_polished(smooth), smooth.value), told, kinked)[2]
    return replace(found, proved=(*found.proved, Hypothesis(SUBGRADIENTS, Means.BALLS)))


def _polished(solution: Solution) -> AlongCurve:
    found = candidate(solution)
    if found.touched:
        raise Unproved(KINKS_MET)  # bounds of its own are dealt with apart
    if found.along_best is None:
        raise Unproved(found.reason or "no coordinates are known in which the curve is regular")
    return in_form(found.best) if found.along_best.slides and found.best is not None else found.along_best


def _of_length(solution: Solution, found: Regular, told: Told) -> Certificate:
    """The certificate of a singular length, by that of the energy of its regular problem."""
    energy = _solved_nearby(found.problem, found.guess, told)
    setting = setting_along(_polished(energy), energy.value)
    if found.abscissa_is_z:
        check_forward(setting)
    low, high, certificate = bounded(energy, setting, told)
    if not (low > 0 and solution.problem.sign * solution.value > 0):
        raise Unproved("the length is not proved positive")
    factor = flint().arb(found.factor.numerator) / found.factor.denominator
    low, high = (factor * low).sqrt().lower(), (factor * high).sqrt().upper()
    if solution.problem.maximise:
        low, high = -high, -low
    forward = Hypothesis(FORWARD, Means.BALLS) if found.abscissa_is_z else Hypothesis(FORTH, Means.CONSTRUCTION)
    proved = (*certificate.proved, Hypothesis(COORDINATES, Means.CONSTRUCTION), forward)
    return replace(
        certificate,
        solution=solution,
        lower=below(low),
        upper=above(high),
        enclosure=decimals(low, high),
        proved=proved,
    )


def _rest(parted: Separated, guess: Callable[..., Any], told: Told) -> tuple[Solution, Setting]:
    """The regular rest of a singular length, and its setting."""
    rest = _solved_nearby(parted.rest(), guess, told)
    along = as_graph(rest)
    if along is None:
        raise Unproved("the rest of the curve is not known as a graph")
    return rest, setting_along(along, rest.value)


def _out_of_reach(along: AlongCurve) -> str:
    """Why a curve is not covered; empty where it is."""
    form = along.form
    reasons = {
        KINKS_MET: form.coordinates.corners > 0,
        f"curves in coordinates of their own ({form.coordinates.note}) are not covered": form.lift is not None
        and (form.coordinates.energetic or not any(form.problem.slides)),
        "ends that slide are not covered of Lagrangians of second order": form.ends.equations > 0 and form.order == 2,
        "periodic ends that cost something are not covered": form.ends.joint is not None and form.ends.periodic,
        "curves that are broken where L is not smooth are not covered": form.broken_at_switches,
    }
    return next((reason for reason, holds in reasons.items() if holds), "")
