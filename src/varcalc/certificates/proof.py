"""Certificates of solutions: curve, field of extremals and tube are chosen here, and the proof is put together."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from varcalc.certificates.balls import Ball, above, below, flint, largest, working
from varcalc.certificates.bounds import Bounds, bounds
from varcalc.certificates.by_convexity import by_convexity
from varcalc.certificates.certificate import Certificate, Distance, Hypothesis, Means, Scope, decimals
from varcalc.certificates.choice import Told, proved_tube, silent
from varcalc.certificates.closed import begun
from varcalc.certificates.convexity import convex_in_slope
from varcalc.certificates.ends import end_cost, prove_ends
from varcalc.certificates.inequalities import Inequalities, inequalities
from varcalc.certificates.integrals import Unproved, total
from varcalc.certificates.jets import Undecided
from varcalc.certificates.kinks import Kinked, kinks
from varcalc.certificates.levels import allowed_for, meeting
from varcalc.certificates.nearness import Attained, Nearness, nearness
from varcalc.certificates.pathwise import Pathwise, pathwise
from varcalc.certificates.rayleigh import lowest_of_all
from varcalc.certificates.regular import Regular, check_forward, regular
from varcalc.certificates.separated import Separated, separated
from varcalc.certificates.setting import Setting, as_graph, setting_along
from varcalc.certificates.shifts import pinned
from varcalc.certificates.statement import Statement
from varcalc.certificates.tube import Prover, Tube
from varcalc.formulation.singular import forms, number_of
from varcalc.methods.collocation.method import Collocation
from varcalc.problem.conditions import Bound, Isoperimetric, whole
from varcalc.problem.convexity import proved_jointly_convex
from varcalc.problem.exact import exactly
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Problem
from varcalc.progress import Interrupted, Progress, telling
from varcalc.solution import Solution, Status, VariationalError, no_solution
from varcalc.solve.ladder import solve
from varcalc.spelling import spelled
from varcalc.symbolic.convexity import Entry, proved_convex
from varcalc.verify.along_curve import AlongCurve, in_form
from varcalc.verify.along_curve import along_curve as along_curve_of
from varcalc.verify.candidate import candidate, in_regular_form

BITS = 128
"""Precision of the balls."""
SERIES_LENGTH = 24
"""Length to which Arb keeps series: more than any Taylor form here has terms."""

WIDE = 1e-13
"""Width of an interval, relative to the value, from which on another proof is tried."""

CURVE, NEARBY, BOUNDS = "the curve", "a problem that bounds this one from below", "the bounds"
"""What is told while it is done."""
COORDINATES = "the end where L is infinite is regular in alpha and z, by which the tube and the distances are meant"
FORWARD = "the curve y0 is a graph: its abscissa grows"
FORTH = "a curve that runs back is no shorter than a graph: the abscissa does not occur in the metric"
EXPRESSION = "L is CasADi's expression, in which products of the numbers of a function may be rounded"
RAYLEIGH = "L and the prescribed integrand are homogeneous of second degree: what is proved near y0 holds of all curves"
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
SHARES = "an abscissa that slides is a number, and distances are meant at equal shares of the interval"
PACED = "each curve is run through at constant speed, and its distance is meant at equal shares of its length"


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
        proved=(_about_curve()[0], *proved),
        seconds=0.0,
    )


def _proof(solution: Solution, told: Told) -> Certificate:
    """The certificate of a solution's curve, polished, in coordinates in which it is regular."""
    if any(isinstance(c, Bound) for c in solution.problem.constraints):
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
    low, _, found = _bounded(rest, setting, told)
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
            found = _bounded(solution, setting, told, held)[2]
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
    found = _bounded(free, setting_along(_polished(free), free.value), told, held)[2]
    return replace(found, proved=(*found.proved, Hypothesis(MULTIPLIERS, Means.BALLS)))


def _under_equations(solution: Solution, along: AlongCurve, told: Told) -> Certificate:
    """The certificate of a curve that meets equations at each of its points, by those around it that need not."""
    reason = Unproved("")
    for held in pathwise(along):
        if _out_of_reach(held.along):
            raise Unproved(_out_of_reach(held.along))
        try:
            found = _bounded(solution, setting_along(held.along, solution.value, held.terms), told, held)[2]
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
    found = _bounded(smooth, setting_along(_polished(smooth), smooth.value), told, kinked)[2]
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
    low, high, certificate = _bounded(energy, setting, told)
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


def certified(solution: Solution, along: AlongCurve, told: Told = silent, *, as_found: bool = False) -> Certificate:
    """The certificate of the extremal near a curve, or of the curve ``as_found``: where it is no minimum, Unproved."""
    return _bounded(solution, setting_along(along, solution.value, as_found=as_found), told)[2]


def _bounded(
    solution: Solution, setting: Setting, told: Told, held: Bounds | Kinked | Inequalities | Pathwise | None = None
) -> tuple[Ball, Ball, Certificate]:
    """The two numbers as balls, and the certificate; ``held`` are the bounds along the curve."""
    prover = proved_tube(setting, told)
    told(BOUNDS)
    setting = replace(prover.setting, along=allowed_for(prover.setting, prover))
    end_terms = prove_ends(prover)
    drop = total(setting.along, prover.tube.kappa, prover.tube.mu)
    value = setting.along.value + end_cost(setting.statement, setting.joints) - _levels(setting.statement)
    attained = _attained(setting, value) if held is None else held.above(setting)
    high = (attained.value if held is None else attained.value + end_cost(setting.statement, setting.joints)).upper()
    near = nearness(setting, prover.tube, largest([high - value]))
    scope, hypotheses = _scope(setting, prover, near, solution)
    if scope is not Scope.ALL and not attained.stays(setting, prover.tube, slopes=scope is Scope.WEAK):
        raise Unproved("the curve of the upper bound is not proved to lie in the tube")
    low = (value - drop).lower()
    lowest = lowest_of_all(setting, prover.tube, drop) if held is None and scope is not Scope.ALL else None
    if lowest is not None:
        low, scope, hypotheses = lowest, Scope.ALL, [Hypothesis(RAYLEIGH, Means.CONSTRUCTION)]
    if isinstance(held, Inequalities | Pathwise):
        low, high = (low - held.shift).lower(), (high - held.shift).upper()
    if setting.statement.along.form.coordinates.energetic:
        low, high = _length(setting.statement, solution, low, high)
    if solution.problem.maximise:
        low, high = -high, -low
    unit = float(setting.sizes[0][0])
    infinite = scope is Scope.ALL
    proved = (*_about_curve(), Hypothesis(_inequality(prover.tube), Means.BALLS), *end_terms, *hypotheses)
    certificate = Certificate(
        solution=solution,
        lower=below(low),
        upper=above(high),
        enclosure=decimals(low, high),
        scope=scope,
        tube=math.inf if infinite else unit * prover.tube.delta,
        slopes=_slope_room(setting, prover.tube, scope),
        integrals=() if infinite else tuple((prover.tube.delta * setting.sizes[0][setting.statement.bare :]).tolist()),
        distance=near.distance(setting) if lowest is None else Distance(math.inf, math.inf),
        proved=proved,
        seconds=0.0,
    )
    return low, high, certificate


def _rest(parted: Separated, guess: Callable[..., Any], told: Told) -> tuple[Solution, Setting]:
    """The regular rest of a singular length, and its setting."""
    rest = _solved_nearby(parted.rest(), guess, told)
    along = as_graph(rest)
    if along is None:
        raise Unproved("the rest of the curve is not known as a graph")
    return rest, setting_along(along, rest.value)


def _slope_room(setting: Setting, tube: Tube, scope: Scope) -> float:
    """How far slopes may lie from the curve's own; for a Lagrangian of second order they are states of the tube."""
    if scope is Scope.ALL:
        return math.inf
    if setting.statement.order == 2:
        return tube.delta * float(setting.sizes[0][setting.statement.n])
    return float(setting.sizes[1][0]) * min(tube.rho) if scope is Scope.WEAK else math.inf


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


def _length(stated: Statement, solution: Solution, low: Ball, high: Ball) -> tuple[Ball, Ball]:
    """Bounds of a length from those of its energy, the integral of its square over an interval of length 1.

    J^2 <= E by Cauchy and Schwarz, with equality where the speed is constant, as any curve may be run through. The
    integrand, a root of a positive definite form in the velocities, has one sign throughout the tube.
    """
    if stated.along.span != (0.0, 1.0):
        raise Unproved("the energy is not that of an interval of length 1")
    if not stated.quadratic_in_controls:
        raise Unproved("the integrand is no root of a quadratic form in the velocities, so its energy tells no length")
    if not (solution.problem.sign * solution.value > 0 and low > 0):
        raise Unproved("the length is not proved positive")
    return (stated.factor * low).sqrt().lower(), (stated.factor * high).sqrt().upper()


def _attained(setting: Setting, value: Ball) -> Attained:
    """The curve of a setting, of that ``value``, or one near it that meets what is prescribed exactly."""
    if not (setting.statement.levels or setting.statement.along.form.ends.equations):
        return Attained(value, setting.pieces)
    met = meeting(setting)
    return Attained(value + met.correction(), setting.pieces, met.moved())


def _levels(stated: Statement) -> Ball:
    """What the multipliers times the levels come to."""
    total_of = flint().arb(0)
    for multiplier, condition in zip(stated.along.lambdas, stated.along.form.conditions.integrals, strict=True):
        total_of += flint().arb(float(multiplier)) * flint().arb(condition.lower)
    return total_of


def _about_curve() -> tuple[Hypothesis, ...]:
    return (
        Hypothesis("the curve y0 meets the ends, is continuous, and its value lies below the upper bound", Means.BALLS),
        Hypothesis(
            "its residuals in the Euler-Lagrange equation are below what the lower bound allows for", Means.BALLS
        ),
    )


def _inequality(tube: Tube) -> str:
    where = (
        "everywhere"
        if tube.delta == math.inf
        else f"for |y - y0| <= {tube.delta * tube.sizes[0][0]:.3g} and slopes near"
    )
    return f"the second derivatives of L - dS/dx, S = S0 + p w + w Q w/2, exceed diag(kappa, mu) {where}"


def _jointly_convex(stated: Statement, solution: Solution) -> bool:
    """Whether what is minimised is proved jointly convex; of a length, its energy."""
    coordinates = stated.along.form.coordinates
    if not coordinates.energetic:
        return not coordinates.gauged and proved_jointly_convex(solution.problem)
    if stated.cost is not None and not stated.cost.quadratic:
        return False  # where its ends may lie is no convex set
    entries: list[list[Entry]] = [[None] * n for n in (stated.n, stated.n)]
    parameters: list[Entry] = [float(v) for v in stated.along.form.problem.parameter_values]
    return proved_convex(stated.function, [[0.0], *entries, [], parameters, [], [], []])


def _all_by_convexity(setting: Setting, tube: Tube, near: Nearness, solution: Solution) -> bool:
    """Whether no curve outside the tube is as good, because L is jointly convex.

    A segment of curves as good would join it to the one in the middle, and leave the tube.
    """
    stated = setting.statement
    if not _jointly_convex(stated, solution) or (stated.levels and stated.bent > 1.0):
        return False
    return bool(near.pointwise + near.of_levels(setting) < tube.delta)


def _scope(setting: Setting, prover: Prover, near: Nearness, solution: Solution) -> tuple[Scope, list[Hypothesis]]:
    """The curves the interval speaks of: as many as is proved."""
    tube, stated = prover.tube, setting.statement
    if tube.delta == math.inf:
        return Scope.ALL, [Hypothesis("L is of second degree in the curve and its slope", Means.CONSTRUCTION)]
    if _all_by_convexity(setting, tube, near, solution):
        return Scope.ALL, [Hypothesis("L is jointly convex in the curve and its slope", Means.COMPOSITION)]
    coordinates = stated.along.form.coordinates
    paced = [Hypothesis(PACED, Means.CONSTRUCTION)] if coordinates.energetic or coordinates.gauged else []
    if stated.along.form.lift is not None:
        paced.append(Hypothesis(SHARES, Means.CONSTRUCTION))
    if stated.quadratic_in_controls:
        return Scope.TUBE, [Hypothesis("L is of second degree in the slope", Means.CONSTRUCTION), *paced]
    if convex_in_slope(prover, setting.along.boxes):
        convex = Hypothesis("L is convex in the slope, at every point of the tube", Means.COMPOSITION)
        return Scope.TUBE, [convex, *paced]
    return Scope.WEAK, paced
