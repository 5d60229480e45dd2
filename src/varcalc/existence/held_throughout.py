"""Curves that kinks of a convex L hold from end to end: what friction lets nobody move, and what rests on a level.

Where a curve follows a kink, L_y and L_y' are intervals there, between the derivatives on its sides. With a momentum
p(x) in the one, whose rate p' is in the other, the curve is an extremal (Euler and Lagrange's inclusion; Clarke,
"Optimization and Nonsmooth Analysis", 1983, sect. 4.4), and where L is convex it is the minimum. Whether there is one
is seen by following all momenta at once: an interval that must not become empty.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import count as counted
from typing import NamedTuple

import casadi as ca
import numpy as np

from varcalc.formulation import formulate
from varcalc.formulation.height import height
from varcalc.methods.crossings import Crossing
from varcalc.methods.ritz.method import Ritz
from varcalc.numerics.mesh import CurveOrSlope, composite_gauss
from varcalc.numerics.resampled import resampled
from varcalc.problem.breaks import breaks, kinks_at_ends, on_curve
from varcalc.problem.convexity import proved_jointly_convex
from varcalc.problem.end_cost import cost_along, costs_of_ends, natural_momenta
from varcalc.problem.functional import Functional, arguments_at
from varcalc.problem.problem import Problem
from varcalc.solution import ErrorEstimate, Solution, Status
from varcalc.symbolic.switches import Switch
from varcalc.verify.held_by_kinks import BESIDE_KINK

SUMMED_ELEMENTS, SUMMED_POINTS = 64, 12
MOMENTUM_STEPS = 2001
"""Abscissae between which the interval of momenta is followed."""
NEARLY = 1e-5
"""Part of the largest derivative by which an interval may be empty: what derivatives beside a kink are off by."""
ON_KINK = 1e-9
"""Departure from a kink, in its own units along the chord, that is round-off."""
TRIED_PLACES = 41
OTHER_SLOPES = np.concatenate([-np.geomspace(1e4, 1e-4, 33), np.geomspace(1e-4, 1e4, 33)])
"""Slopes, beside the curve's own and in units of what the functional feels, that are held against its own."""
STEPS_ONTO_KINK = 8
REST_POINTS, MOST_RESTS = 3, 3
"""Gauss points an element by which it is told what resting costs, and ordinates that are tried."""
BRENT_TOLERANCE, BRENT_KNOWN = 1e-12, 3e-11
"""Brent's own tolerance, and how nearly, of itself or the interval, it knows the place of a sharp minimum."""
REST_KNOWN, SHARP = 1e-7, 1e-9
"""The same of a flat one, and the rise on that way, in units of the value or the interval, from which one is sharp."""
COSTS_ROUNDED = 1e-12
"""Difference of two costs of resting that is round-off, in units of what is summed."""
RESTS_TRIED = np.unique(
    np.concatenate([reach * np.linspace(-1, 1, 257) for reach in np.sqrt(2) * 8.0 ** np.arange(-1, 5)])
)
"""Ordinates at which closed curves may rest, in units of the interval: no round number lies half way between two."""
EVENLY = 1e-9
"""Relative difference of steps that are equally long."""
LEVELS_APART = 8
"""Of how many of them one is looked at for a level, which is a root."""
NOT_PRESSED = np.zeros((2, 2))
"""Of a curve that no bound holds."""
FOLLOWED_TOLERANCE, ORDINATE_ROUND_OFF = 1e-13, 1e-15
MOST_ASKED = 2000
"""Points of a path along which a switch is zero at which slopes are asked for; a smooth one takes some hundreds."""


class HeldMomentum(NamedTuple):
    """Momenta (m,) along a curve at abscissae x (m,), which, or whose rates, may be a little greater and less or not.

    The one where a kink of the slope holds the curve, the other where one of the ordinate does. Whether one
    ``returns`` to what it was at the start is known by the rates alone, which may be far less than it is.
    """

    x: np.ndarray
    values: np.ndarray
    free: bool
    rates_free: bool
    returns: bool


def held_throughout(problem: Problem, method: Ritz, curve: CurveOrSlope, found: list[Crossing]) -> Solution | None:
    """The minimum that follows a kink from end to end; None where none is shown to."""
    convex = proved_jointly_convex(problem)
    for switch, along in _followed(problem, curve, found):
        momentum = _closing_momentum(problem, along)
        if momentum is None:
            continue
        slides = switch.depends_on(problem.symbols.dy)
        free = momentum.free if slides else momentum.rates_free
        if slides and not (problem.start.fixed or problem.end.fixed):
            free = free and problem.start.periodic  # nothing but the rest of L holds it where it is
        if convex or (free and _stands(problem, along, momentum)):
            return answer_along(problem, method, along)
    return None


def let_go(problem: Problem, curve: CurveOrSlope, found: list[Crossing]) -> bool:
    """Whether a curve follows a kink of the slope from end to end along which there is no momentum to hold it.

    Points between which the momentum is not followed, such as those of a mesh, do not tell.
    """
    span = problem.span
    whole = [c for c in found if c.switch.depends_on(problem.symbols.dy) and (c.x, c.until) == span]
    return any(_closing_momentum(problem, along) is None for _, along in _followed(problem, curve, whole))


def _followed(problem: Problem, curve: CurveOrSlope, found: list[Crossing]) -> Iterator[tuple[Switch, CurveOrSlope]]:
    """The kinks that a curve follows, and the curves from end to end along each of them."""
    plain = problem.n == problem.order == 1 and not (problem.constraints or problem.unknowns)
    if not plain or any(problem.slides) or kinks_at_ends(problem):
        return
    for switch in (c.switch for c in found if c.until is not None):
        along = (
            _following(problem, switch, curve)
            if switch.depends_on(problem.symbols.dy)
            else resampled(on_level(problem, switch, curve), problem.span, 2)
        )
        if along is not None and _between_ends(problem, along):
            yield switch, along


def resting(problem: Functional, method: Ritz) -> Solution | None:
    """The curve that friction holds at one ordinate all the way; None where that is not shown to stand.

    It is closed, or free at both ends. The ordinate is one at which resting costs least: what pulls at the curve then
    adds up to nothing on the way, and its momentum comes to what it is to be.
    """
    if not (isinstance(problem, Problem) and problem.n == problem.order == 1):
        return None
    ends = problem.start, problem.end
    moves = problem.start.periodic or not (any(end.fixed for end in ends) or any(problem.slides))
    held = moves and any(_at_rest(problem, switch) for switch in on_curve(problem))
    if problem.unknowns or kinks_at_ends(problem) or not held:
        return None
    if problem.constraints:
        return _resting_on_level(problem, method) if problem.end_cost is None else None
    rests = _cheapest_rests(problem)[:MOST_RESTS]
    return next(filter(None, (_at_one_ordinate(problem, method, *rest) for rest in rests)), None)


def _at_one_ordinate(problem: Problem, method: Ritz, ordinate: float, room: float) -> Solution | None:
    """The curve at rest at an ordinate that is known but for a ``room``; None where it is not shown to stand."""
    along = _constant(ordinate)
    momentum = _closing_momentum(problem, along)
    if momentum is None:
        return None
    stands = proved_jointly_convex(problem) or (momentum.free and _stands(problem, along, momentum))
    return answer_along(problem, method, along, room=room) if stands else None


def _resting_on_level(problem: Problem, method: Ritz) -> Solution | None:
    """The least of the curves at rest that keep one level; None where it is not shown to stand.

    The multiplier lets what pulls at the curve add up to nothing on the way round.
    """
    from scipy.optimize import brentq  # few solves come here

    from varcalc.existence.on_level import level_let_go, level_of

    level = level_of(problem)
    if level is None:
        return None
    x, weights = composite_gauss(_summed_on(problem), SUMMED_POINTS)
    s, still = problem.symbols, np.zeros((1, len(x)))
    stated = [problem.integrand, problem.traced[0].expression]
    rates = [ca.gradient(expression, s.y) for expression in stated]
    function = ca.Function("resting", s.all, [ca.densify(ca.vertcat(*stated, *rates))])

    def summed(y: float) -> np.ndarray:
        return np.asarray(function(*arguments_at(problem, x, still + y, still))) @ weights

    tried = (problem.span[1] - problem.span[0]) * RESTS_TRIED
    off = np.array([summed(y)[1] - level for y in tried[::LEVELS_APART]])
    at = np.flatnonzero(np.sign(off[1:]) * np.sign(off[:-1]) <= 0)
    ordinates = [
        float(brentq(lambda y: summed(y)[1] - level, *tried[::LEVELS_APART][k : k + 2], xtol=BRENT_TOLERANCE))
        for k in at.tolist()
    ]
    for y in sorted(ordinates, key=lambda y: problem.sign * summed(y)[0])[:MOST_RESTS]:
        _, _, pull, rate = summed(y)
        multiplier = float(pull / rate)
        known = _at_one_ordinate(level_let_go(problem, multiplier), method, y, 0.0) if rate else None
        if known is not None:
            value = known.value + multiplier * level
            return replace(known, problem=problem, value=value, multipliers=(multiplier,))
    return None


def _closing_momentum(problem: Problem, along: CurveOrSlope) -> HeldMomentum | None:
    """Momenta along a curve: of a closed one alike at both ends, at free ends what their cost asks for.

    None where there are none.
    """
    x = np.union1d(np.linspace(*problem.span, MOMENTUM_STEPS), breaks(problem))
    momentum = held_momentum(problem, along, x, () if problem.start.periodic else natural_momenta(problem, along))
    if momentum is None or not problem.start.periodic:
        return momentum
    if not momentum.returns:  # however much friction would hold, it holds nothing that goes down as a whole
        return None
    begun = float(momentum.values[0])
    return held_momentum(problem, along, x, (begun, begun))


def _at_rest(problem: Problem, switch: Switch) -> bool:
    """Whether a kink is met by whatever rests, wherever it does."""
    s = problem.symbols
    if switch.smooth or ca.depends_on(switch.argument, ca.vertcat(s.x, s.y)):
        return False
    argument = ca.Function("argument", [s.dy, s.parameters], [switch.argument])
    return bool(switch.met(*(np.asarray(argument(0.0, problem.parameter_values)).ravel() for _ in range(2)))[0] > 0)


def _constant(ordinate: float) -> CurveOrSlope:
    return lambda x, derivative: np.full((1, len(x)), 0.0 if derivative else ordinate)


def _cheapest_rests(problem: Problem) -> list[tuple[float, float]]:
    """The ordinates at which resting costs less than beside them, the cheapest first, and how nearly each is known."""
    from scipy.optimize import minimize_scalar  # few solves come here

    x, weights = composite_gauss(_summed_on(problem), REST_POINTS)
    width = problem.span[1] - problem.span[0]

    def terms(y: np.ndarray) -> np.ndarray:
        """What a rest at each ordinate (k,) adds at each place, weights included: (k, places)."""
        count, places = len(y), len(x)
        at = np.tile(x, count), np.repeat(y, places)[None], np.zeros((1, count * places))
        return problem.sign * problem.integrand_values(*at).reshape(count, places) * weights

    def cost(y: float) -> float:
        return float(summed(np.array([y]))[0])

    def summed(y: np.ndarray) -> np.ndarray:
        start, end = ((at, y[None]) for at in np.array(problem.span)[:, None])
        return terms(y).sum(1) + costs_of_ends(problem, start, end, problem.unknown_guesses[None])

    found = []
    tried = width * RESTS_TRIED
    with np.errstate(all="ignore"):
        costs, rounded = np.nan_to_num(summed(tried), nan=np.inf), COSTS_ROUNDED * np.abs(terms(tried)).sum(1)
        lower = (costs + rounded)[1:-1] < np.minimum(costs[:-2], costs[2:])
        for k in (1 + np.flatnonzero(lower)).tolist():
            least = minimize_scalar(cost, tuple(tried[k - 1 : k + 2]), method="brent", tol=BRENT_TOLERANCE)
            y, size = float(least.x), max(abs(float(least.x)), width)
            flat = REST_KNOWN * size
            # at a kink of L the place is known as nearly as Brent's method stops
            sharp = abs(cost(y + flat) - float(least.fun)) > SHARP * max(abs(float(least.fun)), width)
            found.append((float(least.fun), y, BRENT_KNOWN * size if sharp else flat))
    return [(y, room) for _, y, room in sorted(found)]


def _summed_on(problem: Problem) -> np.ndarray:
    """Edges of the elements on which a curve at rest is summed."""
    return np.union1d(np.linspace(*problem.span, SUMMED_ELEMENTS + 1), breaks(problem))


def _between_ends(problem: Problem, along: CurveOrSlope) -> bool:
    """Whether a curve comes from the start to the end, where these are given."""
    reached = along(np.array(problem.span), 0)[0]
    given = np.array([float(end.values(1)[0]) for end in (problem.start, problem.end)])
    if problem.start.periodic:
        given = reached[[0, 0]]
    given = np.where(np.isnan(given), reached, given)
    room = ON_KINK * max(height(formulate(problem)), *np.abs(given))
    return bool((np.abs(reached - given) <= room).all())


def on_level(problem: Problem, switch: Switch, curve: CurveOrSlope) -> CurveOrSlope:
    """The curve along which a switch that does not feel the slope is zero, by Newton's method from another."""
    s = problem.symbols
    rates = [ca.gradient(switch.argument, v) for v in (s.x, s.y)]
    function = ca.Function("level", [s.x, s.y, s.parameters], [switch.argument / rates[1], -rates[0] / rates[1]])

    def along(x: np.ndarray, derivative: int) -> np.ndarray:
        """The ordinates on the level, or the slopes, at x (m,): (1, m)."""
        numbers = np.tile(problem.parameter_values[:, None], (1, len(x)))
        y = curve(x, 0)
        for _ in range(STEPS_ONTO_KINK):
            y = y - np.asarray(function(x[None], y, numbers)[0])
        return y if derivative == 0 else np.asarray(function(x[None], y, numbers)[1])

    return along


class _CreepingError(Exception):
    """A path along which slopes jump from one to another, as where a switch is zero at two: steps come to nothing."""


def _following(problem: Problem, switch: Switch, curve: CurveOrSlope) -> CurveOrSlope | None:
    """The curve from an end along which a switch is zero, its slopes by Newton's method from those of another.

    None where these lead to none.
    """
    from scipy.integrate import solve_ivp  # few solves come here

    s, backward = problem.symbols, problem.end.fixed and not problem.start.fixed
    given, span = (problem.end, problem.span[::-1]) if backward else (problem.start, problem.span)
    newton = s.dy - switch.argument / ca.gradient(switch.argument, s.dy)
    step, found = ca.Function("step", [s.x, s.y, s.dy, s.parameters], [newton]), s.dy
    for _ in range(STEPS_ONTO_KINK):
        found = step(s.x, s.y, found, s.parameters)
    onto = ca.Function("onto", [s.x, s.y, s.dy, s.parameters], [found])

    def slopes(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """The slopes (1, m) with which the switch is zero at the points ``x`` and ``y``."""
        numbers = np.tile(problem.parameter_values[:, None], (1, len(x)))
        return np.asarray(onto(x[None], y, curve(x, 1), numbers))

    first, unit = given.values(1), height(formulate(problem))
    if not given.fixed:
        first = curve(np.array(span[:1]), 0)[:, 0]
    if not np.isfinite(slopes(np.array(span[:1]), first[:, None])).all():
        return None  # SciPy would choose no first step, and try it for ever
    asked = counted()

    def rates(x: float, y: np.ndarray) -> np.ndarray:
        """The slope at one point."""
        if next(asked) > MOST_ASKED:
            raise _CreepingError
        return slopes(np.array([x]), y[:, None])[:, 0]

    try:
        path = solve_ivp(
            rates, span, first, "DOP853", dense_output=True, rtol=FOLLOWED_TOLERANCE, atol=FOLLOWED_TOLERANCE * unit
        )
    except _CreepingError:
        return None
    if not (path.success and np.isfinite(path.y).all()):
        return None
    return resampled(lambda x, k: slopes(x, path.sol(x)) if k else path.sol(x), problem.span, 2)


def held_momentum(
    problem: Problem, along: CurveOrSlope, x: np.ndarray, ends: Sequence[float | None] = (),
    pressed: np.ndarray = NOT_PRESSED, size: float = 0.0,
) -> HeldMomentum | None:  # fmt: skip
    """Momenta between L_y' on both sides of the kink whose rates are between L_y on both; None where there are none.

    At the ``ends`` of x (m,) they are what is given. By how much rates, and momenta, may be less and more where bounds
    hold the curve says ``pressed`` (2, 2). Momenta are known to a part of their ``size`` elsewhere.
    """
    y, slope = along(x, 0), along(x, 1)
    aside = _beside(problem)
    sides = (
        np.array(
            [
                [
                    problem.integrand_derivatives(x, y + i * aside[0], slope + j * aside[1]).gradient[:, 1:]
                    for j in (-1, 1)
                ]
                for i in (-1, 1)
            ]
        )
        * problem.sign
    )  # (side of y, side of the slope, abscissa, derivative by y and by the slope)
    rates, momenta = sides[..., 0], sides[..., 1]
    room = NEARLY * np.maximum(np.abs(sides).max(axis=(0, 1, 2)), [0.0, size]) + 1e-300
    # the derivatives fill a box, and not a part of it, if the one by y is alone with y, and so the other
    boxed = np.abs(np.diff(rates, axis=1)).max() <= room[0] and np.abs(np.diff(momenta, axis=0)).max() <= room[1]
    if not (np.isfinite(sides).all() and boxed):
        return None
    width, away = np.diff(x), pressed * np.array([-1.0, 1.0])
    lows, highs = momenta.min(axis=(0, 1)) + away[1, 0], momenta.max(axis=(0, 1)) + away[1, 1]
    held = lows.copy(), highs.copy()
    for k, end in zip((0, -1), ends, strict=False):
        # where a bound presses, it may press with a force at the end
        if end is not None and not pressed[0].any() and not lows[k] - room[1] <= end <= highs[k] + room[1]:
            return None
        lows[k], highs[k] = (lows[k], highs[k]) if end is None else (end, end)
    slowest, fastest = (
        _between(r, width) * width + free
        for r, free in zip((rates.min(axis=(0, 1)), rates.max(axis=(0, 1))), away[0], strict=True)
    )
    for k in range(len(width)):  # forward those that can be come to, in place
        lows[k + 1] = max(lows[k] + slowest[k], lows[k + 1])
        highs[k + 1] = min(highs[k] + fastest[k], highs[k + 1])
        if lows[k + 1] > highs[k + 1] + room[1]:
            return None
    values = 0.5 * (lows + highs)
    for k in range(len(width) - 1, -1, -1):  # back along one of them, half way between those it can come from
        first, last = max(lows[k], values[k + 1] - fastest[k]), min(highs[k], values[k + 1] - slowest[k])
        values[k] = 0.5 * (first + last)
    rate, inside, valley = np.diff(values), room[0] * width, rates[1] >= rates[0]
    rates_free = bool(valley.all() and ((rate > slowest + inside) & (rate < fastest - inside)).all())
    pull = NEARLY * float(np.abs(rates).max(axis=(0, 1)).mean() * (x[-1] - x[0]))
    returns = bool(slowest.sum() <= pull and fastest.sum() >= -pull)
    least = min((values - held[0]).min(), (held[1] - values).min())
    return HeldMomentum(x, values, bool(least > 0.5 * room[1]), rates_free, returns)


def _between(rates: np.ndarray, widths: np.ndarray) -> np.ndarray:
    """The mean of each two of ``rates`` (m,), as a cubic through four tells it where their ``widths`` are equal."""
    bends = np.pad(np.diff(rates, 2), 1, mode="edge")
    beside = np.pad(widths, 1, mode="edge")
    even = np.ptp([beside[:-2], widths, beside[2:]], axis=0) <= EVENLY * widths
    return 0.5 * (rates[1:] + rates[:-1]) - np.where(even, (bends[1:] + bends[:-1]) / 24, 0.0)


def _stands(problem: Problem, along: CurveOrSlope, momentum: HeldMomentum) -> bool:
    """Whether the curve is a strong minimum among those near it, though L is not convex in the ordinate.

    Where momenta may be a little greater and a little less, each small variation eta costs a share of the integral of
    |eta'|, and where their rates may, one of that of |eta|, which is more than its square can gain; and no other slope
    does better against the momentum.
    """
    tried = np.linspace(0, len(momentum.x) - 1, TRIED_PLACES).astype(int)
    x, p = momentum.x[tried], momentum.values[tried]
    y, slope = along(x, 0)[0], along(x, 1)[0]
    unit = height(formulate(problem)) / (problem.span[1] - problem.span[0])
    slopes = slope[:, None] + unit * OTHER_SLOPES
    here = problem.sign * problem.integrand_on(x, y, slope)
    there = problem.sign * problem.integrand_on(x[:, None], y[:, None], slopes)
    excess = there - np.reshape(here, (-1, 1)) - p[:, None] * (slopes - slope[:, None])
    return bool((excess >= -NEARLY * np.abs(there)).all())


def answer_along(
    problem: Problem, method: Ritz, along: CurveOrSlope, edges: Sequence[float] | np.ndarray = (), *, room: float = 0.0,
    rates: dict[str, float] | None = None,
) -> Solution:  # fmt: skip
    """The functional of a curve, with what two rules differ by and round-off of ordinates beside a kink makes.

    At ``edges`` the curve may be less smooth, and ordinates may be off by a ``room`` besides. The sensitivities are
    those of L at the curve unless ``rates`` are given.
    """
    values, mesh = [], np.union1d(_summed_on(problem), np.array(edges))
    for points, near in ((SUMMED_POINTS, 0.0), (SUMMED_POINTS + 4, 0.0), (SUMMED_POINTS + 4, 1.0)):
        x, weights = composite_gauss(mesh, points)
        y = (1.0 + near * ORDINATE_ROUND_OFF) * along(x, 0) + near * room
        terms = problem.integrand_values(x, y, along(x, 1))
        cost = problem.sign * cost_along(problem, along, problem.span, problem.unknown_guesses)
        values.append((float(terms @ weights) + cost, float(np.abs(terms) @ weights) + abs(cost)))
    (coarse, _), (value, size), (moved, _) = values
    error = abs(value - coarse) + abs(value - moved) + FOLLOWED_TOLERANCE * size
    off = room + FOLLOWED_TOLERANCE * float(np.abs(along(x, 0)).max())
    return Solution(
        problem, method, Status.SOLVED, value, ErrorEstimate(error, off),
        np.array(edges if len(edges) else problem.span), along,
        sensitivities=_sensitivities(problem, along, x, weights) if rates is None else rates,
    )  # fmt: skip


def _sensitivities(problem: Problem, along: CurveOrSlope, x: np.ndarray, weights: np.ndarray) -> dict[str, float]:
    """dJ/dparameter, that of L at the curve; NaN where it differs from side to side of a kink, which then moves."""
    s = problem.symbols
    rate = ca.Function("rate", s.all, [ca.densify(ca.gradient(problem.integrand, s.parameters))])
    y, slope = along(x, 0), along(x, 1)
    y_aside, slope_aside = _beside(problem)
    rates = np.array(
        [
            np.asarray(rate(*arguments_at(problem, x, y + i * y_aside, slope + j * slope_aside)))
            for i in (-1, 1)
            for j in (-1, 1)
        ]
    )  # (side, parameter, abscissa)
    apart = np.ptp(rates, axis=0).max(axis=-1, initial=0.0) > NEARLY * np.abs(rates).max(axis=(0, 2), initial=0.0)
    values = np.where(apart, np.nan, rates.mean(axis=0) @ weights)
    return dict(zip(problem.parameters, values.tolist(), strict=True))


def _beside(problem: Problem) -> np.ndarray:
    """How far beside a kink its sides are looked at, in the ordinate and in the slope."""
    unit = height(formulate(problem))
    return BESIDE_KINK * np.array([unit, unit / (problem.span[1] - problem.span[0])])
