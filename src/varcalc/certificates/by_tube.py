"""The certificate of one curve by a tube around it, in coordinates in which the curve is regular."""

from __future__ import annotations

import math
from dataclasses import replace

from varcalc.certificates.balls import Ball, above, below, flint, largest
from varcalc.certificates.bounds import Bounds
from varcalc.certificates.certificate import Certificate, Distance, Hypothesis, Means, Scope, decimals
from varcalc.certificates.choice import Told, proved_tube, silent
from varcalc.certificates.convexity import convex_in_slope
from varcalc.certificates.ends import end_cost, prove_ends
from varcalc.certificates.inequalities import Inequalities
from varcalc.certificates.integrals import Unproved, total
from varcalc.certificates.kinks import Kinked
from varcalc.certificates.levels import allowed_for, meeting
from varcalc.certificates.nearness import Attained, Nearness, nearness
from varcalc.certificates.pathwise import Pathwise
from varcalc.certificates.rayleigh import lowest_of_all
from varcalc.certificates.setting import Setting, setting_along
from varcalc.certificates.statement import Statement
from varcalc.certificates.tube import Prover, Tube
from varcalc.problem.convexity import proved_jointly_convex
from varcalc.solution import Solution
from varcalc.symbolic.convexity import Entry, proved_convex
from varcalc.verify.along_curve import AlongCurve

BOUNDS = "the bounds"
"""What is told while they are found."""
RAYLEIGH = "L and the prescribed integrand are homogeneous of second degree: what is proved near y0 holds of all curves"
SHARES = "an abscissa that slides is a number, and distances are meant at equal shares of the interval"
PACED = "each curve is run through at constant speed, and its distance is meant at equal shares of its length"


def certified(solution: Solution, along: AlongCurve, told: Told = silent, *, as_found: bool = False) -> Certificate:
    """The certificate of the extremal near a curve, or of the curve ``as_found``: where it is no minimum, Unproved."""
    return bounded(solution, setting_along(along, solution.value, as_found=as_found), told)[2]


def bounded(
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
    proved = (*about_curve(), Hypothesis(_inequality(prover.tube), Means.BALLS), *end_terms, *hypotheses)
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


def _slope_room(setting: Setting, tube: Tube, scope: Scope) -> float:
    """How far slopes may lie from the curve's own; for a Lagrangian of second order they are states of the tube."""
    if scope is Scope.ALL:
        return math.inf
    if setting.statement.order == 2:
        return tube.delta * float(setting.sizes[0][setting.statement.n])
    return float(setting.sizes[1][0]) * min(tube.rho) if scope is Scope.WEAK else math.inf


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


def about_curve() -> tuple[Hypothesis, ...]:
    """What is proved of every curve of an upper bound."""
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
