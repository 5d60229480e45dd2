"""Certificates of solutions: curve, field of extremals and tube are chosen here, and the proof is put together."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from varcalc.certificates.balls import Ball, above, below, flint, working
from varcalc.certificates.certificate import Certificate, Distance, Hypothesis, Means, Scope, decimals
from varcalc.certificates.convexity import convex_in_slope
from varcalc.certificates.cost import Cost
from varcalc.certificates.curve import Piece, Samples, end_values, joint_states, pieces, sampled, state_sizes
from varcalc.certificates.ends import prove_ends
from varcalc.certificates.field import Field, dynamics, field, turned_dynamics
from varcalc.certificates.integrals import Along, Unproved, along_curve, total, worst
from varcalc.certificates.jets import without_enclosure
from varcalc.certificates.levels import Meeting, bumps_for
from varcalc.certificates.statement import Statement, statement
from varcalc.certificates.tube import Prover, Tube, slopes
from varcalc.problem.conditions import Bound, Isoperimetric, whole
from varcalc.problem.convexity import proved_jointly_convex
from varcalc.solution import Solution, Status, VariationalError
from varcalc.symbolic.convexity import Entry, proved_convex
from varcalc.verify.along_curve import AlongCurve
from varcalc.verify.candidate import candidate

BITS = 128
"""Precision of the balls."""
TERMS = 24
"""Length to which Arb keeps series: more than any Taylor form here has terms."""
VALUE_TOLERANCE = 1e-19
"""Share of the value that the remainders of its integral may come to."""
KAPPAS = tuple(10.0 ** (0.5 - 0.5 * k) for k in range(18))
"""Values of kappa that are tried, in units of H_uu, from the greatest."""
MARGIN = 1.5
"""How many times kappa and mu Jacobi's equation is lowered by: what is over pays for rounding and for the tube."""
CONVEX_ENOUGH = 0.3
"""Least second derivative of a convex Lagrangian, in units of H_uu, at which Q = 0 serves."""
EVEN = 0.2
"""Evenness of a field that will do: a smaller kappa would make it more even, and the tube narrower."""
NEARLY_AS_EVEN = 0.6
"""Share of the evenness that the smallest kappa has, where none is even enough, that will do."""
WIDEST = 0.5
"""Widest tube tried, relative to the size of the curve."""
TUBES = 40
"""How many times the tube may be halved."""
SOME_BOXES = 6
"""Boxes at whose middles tubes are tried first."""
MOST_BOXES = 400
"""Boxes for the inequality; at first a narrower tube is tried where it takes ``MORE_BOXES`` than its integrals."""
MORE_BOXES = 20
NARROWINGS = 4
"""Tubes that are tried so."""


@dataclass(frozen=True)
class Setting:
    """The statement with its curve and its scales."""

    statement: Statement
    samples: Sequence[Samples]
    joints: np.ndarray
    pieces: Sequence[Piece]
    sizes: tuple[np.ndarray, np.ndarray]
    along: Along

    @property
    def length(self) -> float:
        """Length of the interval."""
        return float(self.samples[-1].x[-1] - self.samples[0].x[0])

    @property
    def scaled(self) -> list[np.ndarray]:
        """The second derivatives of H at the nodes of each piece, in units of states and controls."""
        scale = np.concatenate(self.sizes)
        return [s.hessian * scale[:, None] * scale for s in self.samples]


def certify(solution: Solution, *, digits: int | None = None) -> Certificate:
    """Prove between which two numbers the infimum lies that a solution is an estimate of.

    The proof is Hilbert's invariant integral of a quadratic near the curve, with every inequality checked in ball
    arithmetic, see :doc:`certificates`. Curve, field, tube and boxes are chosen here.

    Parameters
    ----------
    solution:
        What :func:`varcalc.solve` found: a minimum, or a maximum of a functional that is to be greatest.
    digits:
        Decimal digits of the value that the interval must tell; by default as many as it happens to.

    Returns
    -------
    Certificate
        The interval, the curves it speaks of and the theorem.

    Raises
    ------
    VariationalError
        Where the proof is not found: which inequality failed, and where.
    ImportError
        Where python-flint is not installed.
    TypeError, ValueError
        For what is no solution, and for digits that are no whole number from 1 on.

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
        raise TypeError(f"solution must be what varcalc.solve gives back, not {solution!r}")
    if digits is not None:
        whole("digits", digits)
    flint()
    began = time.perf_counter()
    if not solution.status.ok:
        raise VariationalError(solution)
    try:
        with working(BITS, TERMS):
            found = certified(solution, _curve_of(solution))
    except Unproved as unproved:
        raise _refusal(solution, str(unproved)) from None
    certificate = replace(found, seconds=time.perf_counter() - began)
    if digits is not None and not certificate.width <= 10.0**-digits * max(map(abs, (found.lower, found.upper))):
        raise _refusal(solution, f"the interval is {certificate.width:.1g} wide, too much for {digits} digits")
    return certificate


def _refusal(solution: Solution, reason: str) -> VariationalError:
    return VariationalError(replace(solution, status=Status.REFUSED, message=f"no certificate: {reason}"))


def _curve_of(solution: Solution) -> AlongCurve:
    """The curve of a solution, polished, in coordinates in which it is regular."""
    found = candidate(solution)
    along = found.along_best
    if along is None:
        raise Unproved(found.reason or "no coordinates are known in which the curve is regular")
    reason = _out_of_reach(along)
    if reason:
        raise Unproved(reason)
    return along


def certified(solution: Solution, along: AlongCurve) -> Certificate:
    """The certificate of a curve, whatever it is: where it is no minimum, Unproved is raised."""
    setting = _setting(solution, along)
    prover = _proved_tube(setting)
    end_terms = prove_ends(prover)
    distance = _distance(setting, prover.tube)
    drop = total(setting.along, prover.tube.kappa, prover.tube.mu)
    scope, hypotheses = _scope(setting, prover, distance, solution)
    value = setting.along.value + _end_cost(setting) - _levels(setting.statement)
    low, high = (value - drop).lower(), (value + _correction(setting)).upper()
    if setting.statement.along.form.coordinates.energetic:
        low, high = _length(setting.statement, solution, low, high)
    if solution.problem.maximise:
        low, high = -high, -low
    unit = float(setting.sizes[0][0])
    infinite = scope is Scope.ALL
    proved = (*_about_curve(), Hypothesis(_inequality(prover.tube), Means.BALLS), *end_terms, *hypotheses)
    return Certificate(
        solution, below(low), above(high), decimals(low, high), scope,
        math.inf if infinite else unit * prover.tube.delta,
        float(setting.sizes[1][0]) * min(prover.tube.rho) if scope is Scope.WEAK else math.inf,
        () if infinite else tuple((prover.tube.delta * setting.sizes[0][setting.statement.bare :]).tolist()),
        distance, proved, 0.0,
    )  # fmt: skip


def _setting(solution: Solution, along: AlongCurve) -> Setting:
    stated = statement(along)
    strange = without_enclosure(stated.function)
    if strange:
        raise Unproved(f"the Lagrangian holds {strange}, of which no enclosure is known")
    samples = sampled(stated)
    if not all(np.isfinite(s.hessian).all() and np.isfinite(s.momenta).all() for s in samples):
        raise Unproved("the Lagrangian or its derivatives are no numbers on the curve")
    joints = joint_states(stated, samples)
    exact = pieces(stated, samples, joints)
    states = state_sizes(samples, stated)
    length = float(samples[-1].x[-1] - samples[0].x[0])
    controls = states[(stated.order - 1) * stated.n : stated.order * stated.n] / 2.0 ** round(math.log2(length))
    sizes = states, controls
    tolerance = VALUE_TOLERANCE * (abs(solution.value) or 1.0)
    return Setting(stated, samples, joints, exact, sizes, along_curve(stated, exact, sizes, tolerance))


def _out_of_reach(along: AlongCurve) -> str:
    """Why a curve is not covered; empty where it is."""
    form = along.form
    reasons = {
        f"curves in coordinates of their own ({form.coordinates.note}) are not covered": form.lift is not None
        or form.coordinates.gauged,
        "conditions all along the curve are not covered": bool(along.paths),
        "inequalities are not covered": any(
            isinstance(c, Bound) or (isinstance(c, Isoperimetric) and not c.equality) for c in form.problem.constraints
        ),
        "ends that slide, or cost something together, are not covered": form.ends.joint is not None
        and (form.ends.equations > 0 or bool(form.ends.joint.inside) or not Cost(form).separate or form.ends.periodic),
        "waypoints are not covered": bool(form.held),
    }
    return next((reason for reason, holds in reasons.items() if holds), "")


def _length(stated: Statement, solution: Solution, low: Ball, high: Ball) -> tuple[Ball, Ball]:
    """Bounds of a length from those of its energy, the integral of its square over an interval of length 1.

    J^2 <= E by Cauchy and Schwarz, with equality where the speed is constant, as any curve may be run through. The
    integrand, a root of a positive definite form in the velocities, has one sign throughout the tube.
    """
    if not stated.quadratic_in_controls:
        raise Unproved("the integrand is no root of a quadratic form in the velocities, so its energy tells no length")
    if not (solution.problem.sign * solution.value > 0 and low > 0):
        raise Unproved("the length is not proved positive")
    return low.sqrt().lower(), high.sqrt().upper()


def _correction(setting: Setting) -> Ball:
    """What the value changes by from the curve to one near it that meets the prescribed integrals exactly."""
    stated = setting.statement
    if not stated.levels:
        return flint().arb(0)
    return Meeting(stated, setting.pieces, setting.along.boxes, bumps_for(stated, setting.samples)).correction()


def _end_cost(setting: Setting) -> Ball:
    """What the ends of the curve cost."""
    cost = setting.statement.cost
    return flint().arb(0) if cost is None else cost.jet(*end_values(setting.statement, setting.joints), 0).value


def _levels(stated: Statement) -> Ball:
    """What the multipliers times the levels come to."""
    total_of = flint().arb(0)
    for multiplier, condition in zip(stated.along.lambdas, stated.along.form.conditions.integrals, strict=True):
        total_of += flint().arb(float(multiplier)) * flint().arb(condition.lower)
    return total_of


def _proved_tube(setting: Setting) -> Prover:
    """The inequality proved, in a tube as wide as a few halvings find."""
    kappa, mu, found = _field(setting)
    Q = slopes(found, len(setting.pieces), setting.statement.states)
    boxes, reason = setting.along.boxes, ""

    def prover(delta: float) -> Prover:
        return Prover(setting.statement, setting.pieces, Q, _tube(setting, found, kappa, mu, delta), setting.joints)

    if setting.statement.quadratic:
        prover(math.inf).prove(boxes, MOST_BOXES)
        return prover(math.inf)
    widths = [WIDEST * 0.5**k for k in range(TUBES)]
    some = boxes[:: max(1, len(boxes) // SOME_BOXES)]
    first = next((k for k, delta in enumerate(widths) if not prover(delta).wide(some)), TUBES)
    # half of what holds at the middles of boxes: between them it takes a little more
    for k, delta in enumerate(widths[first + 1 :]):
        try:
            prover(delta).prove(boxes, MOST_BOXES if k >= NARROWINGS else len(boxes) + MORE_BOXES)
        except Unproved as unproved:
            reason = str(unproved)
            if k >= NARROWINGS:
                break
        else:
            return prover(delta)
    raise Unproved(reason or "the inequality holds in no tube, however narrow")


def _field(setting: Setting) -> tuple[float, float, Field | None]:
    """kappa, mu and the field, with kappa as great as the field allows; no field where H is convex enough."""
    m = setting.statement.states
    hessians = np.concatenate(setting.scaled)
    zz, zu, uu = hessians[:, :m, :m], hessians[:, :m, m:], hessians[:, m:, m:]
    stiffness = float(np.linalg.eigvalsh(uu).min())
    if not stiffness > 0:
        at = np.concatenate([s.x for s in setting.samples])[int(np.linalg.eigvalsh(uu)[:, 0].argmin())]
        raise Unproved(
            f"Legendre's condition fails: the least second derivative in the slope is {stiffness:.3g} near {at:.6g}"
        )
    schur = zz - zu @ np.linalg.solve(0.6 * uu, zu.transpose(0, 2, 1))
    convex = float(np.linalg.eigvalsh(schur).min())
    if convex >= CONVEX_ENOUGH * stiffness and setting.statement.order == 1:
        return 0.5 * convex, 0.25 * stiffness, None
    scales = np.concatenate(setting.sizes)
    fields: list[tuple[float, float, Field]] = []
    for share in KAPPAS:
        kappa, mu = share * stiffness, min(0.1 * share, 0.25) * stiffness
        lowered = MARGIN * np.r_[np.full(m, kappa), np.full(len(scales) - m, mu)] / scales**2
        found = field(setting.statement, setting.samples, lowered)
        if found is not None:
            fields.append((kappa, mu, found))
            if found.evenness > EVEN:
                break
    if fields:
        enough = NEARLY_AS_EVEN * max(f.evenness for *_, f in fields)
        return next(f for f in fields if f[2].evenness >= enough)
    raise Unproved(
        "Jacobi's equation has no field of extremals around the curve: there is a conjugate point, or nearly one"
    )


def _tube(setting: Setting, found: Field | None, kappa: float, mu: float, delta: float) -> Tube:
    """The tube of half-width ``delta``, with bounds that the curve's own second derivatives suggest."""
    stated, (states, controls) = setting.statement, setting.sizes
    m = stated.states
    stiff, tilts, rho = [], [], []
    for k, (hessian, s) in enumerate(zip(setting.scaled, setting.samples, strict=True)):
        least = float(np.linalg.eigvalsh(hessian[:, m:, m:]).min())
        B, mixed = turned_dynamics(stated, s)[1], s.hessian[:, :m, m:]
        if found is not None:
            mixed = (
                mixed
                - np.linalg.solve(found.U[k].transpose(0, 2, 1), found.M[k].transpose(0, 2, 1)).transpose(0, 2, 1) @ B
            )
        tilt = float(np.sqrt(((mixed * states[:, None] * controls) ** 2).sum(axis=(1, 2))).max())
        stiff.append(0.7 * least)
        tilts.append(1.3 * tilt + 0.1 * least)
        rho.append(math.inf if delta == math.inf else 1.05 * tilts[-1] * delta / (stiff[-1] - mu))
    return Tube(delta, tuple(rho), kappa, mu, tuple(stiff), tuple(tilts), setting.sizes)


def _distance(setting: Setting, tube: Tube) -> Distance:
    """How far curves of no greater value lie; Unproved where the curve is too far from stationary for the tube.

    From kappa |w|^2/4 + mu H(|u|)/2, H Huber's function, integrated, being no more than twice ``total``.
    """
    found = flint()
    r, q = worst(setting.along)
    energy, length = total(setting.along, tube.kappa, tube.mu), found.arb(setting.length)
    rho = min(tube.rho)
    if tube.delta < math.inf and not (
        q * 2 <= found.arb(tube.mu) * rho and 2 * r <= found.arb(tube.kappa) * tube.delta
    ):
        raise Unproved(
            f"the curve is not stationary enough for the tube: the residuals are {float(r):.1g} and {float(q):.1g}"
        )
    for stiff, tilt, radius in zip(tube.stiffness, tube.tilt, tube.rho, strict=True):
        if radius < math.inf and not (found.arb(stiff) - tube.mu) * radius >= found.arb(tilt) * tube.delta:
            raise Unproved("the slopes of the tube are not wide enough")
    square = (8 * energy / tube.kappa).sqrt()
    slope = (8 * energy * length / tube.mu).sqrt()
    if rho < math.inf and not (8 * energy / (length * tube.mu)).sqrt() <= rho:
        raise Unproved("the curve is not stationary enough for the slopes of the tube")
    A, _ = dynamics(setting.statement.n, setting.statement.order, setting.statement.states)
    # z' = A z + B u in units of the states
    states, controls = setting.sizes
    turning = float(np.abs(A * states / states[:, None]).max())
    rate = float((controls / states[(setting.statement.order - 1) * setting.statement.n]).max())
    pointwise = square * (1 / length.sqrt() + turning * length.sqrt()) + slope * rate
    if not pointwise.upper() < tube.delta:
        raise Unproved(f"curves of the same value are only known to lie within {float(pointwise):.1g}, beyond the tube")
    unit = found.arb(float(states[0]))
    return Distance(above(square / length.sqrt() * unit), above(pointwise * unit))


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
    if not stated.along.form.coordinates.energetic:
        return proved_jointly_convex(solution.problem)
    entries: list[list[Entry]] = [[None] * n for n in (stated.n, stated.n)]
    parameters: list[Entry] = [float(v) for v in stated.along.form.problem.parameter_values]
    return proved_convex(stated.function, [[0.0], *entries, [], parameters, [], [], []])


def _scope(setting: Setting, prover: Prover, distance: Distance, solution: Solution) -> tuple[Scope, list[Hypothesis]]:
    """The curves the interval speaks of: as many as is proved."""
    tube = prover.tube
    if tube.delta == math.inf:
        return Scope.ALL, [Hypothesis("L is of second degree in the curve and its slope", Means.CONSTRUCTION)]
    if _jointly_convex(setting.statement, solution):
        return Scope.ALL, [Hypothesis("L is jointly convex in the curve and its slope", Means.COMPOSITION)]
    if setting.statement.quadratic_in_controls:
        return Scope.TUBE, [Hypothesis("L is of second degree in the slope", Means.CONSTRUCTION)]
    if convex_in_slope(prover, setting.along.boxes):
        return Scope.TUBE, [Hypothesis("L is convex in the slope, at every point of the tube", Means.COMPOSITION)]
    return Scope.WEAK, []
