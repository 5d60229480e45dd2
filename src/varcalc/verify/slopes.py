"""Whether a graph can be a minimum at all, judged by other slopes at a few of its points: what every solve asks.

It costs one call of L; a verification looks in more directions at more points (``weierstrass.py``).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca
import numpy as np

from varcalc.formulation import Form
from varcalc.methods.answer import AlongGraph
from varcalc.numerics.chebyshev import roots
from varcalc.numerics.mesh import CurveOrSlope
from varcalc.problem.breaks import breaks, on_curve
from varcalc.problem.conditions import Bound, Holonomic, Isoperimetric, Through
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Problem
from varcalc.solution import Finding, Solution, Verdict, refused
from varcalc.symbolic.derived import derived
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.tracing import Expression
from varcalc.verify.verification import excesses, slope_turns

TELLING_TURNS = np.array([-20.0, 0.3, 4.0])
"""The same, by which it is seen that the square of a Lagrangian is quadratic in the slope."""
ROUND_OFF_EXCESS = 1e-9
"""Relative excess below zero that is round-off or the curve's own error."""
TRIED_PLACES, CLOSELY = 9, 129
"""Points of a graph at which slopes are tried, and where L is not convex in them: it may fail on a short way."""
SLOPE_HELD = 1e-6
"""Relative distance from a bound within which it is touched."""
EXCESS_AT_CORNERS = 1e-6
"""The same where L is not convex: at a corner there is a slope of no excess, but for the error of the curve's own."""
STEPS_ONTO_SWITCH, BESIDE_JUMP = 4, 1e-9
"""Newton's steps to slopes at which L switches, and how far on either side of these are tried, relative to them."""
BENDS_ABOUT, BENDS_TRIED = 4.0, 65
"""How far from a curve's own second derivatives others are tried, in units of theirs or 1, and how many."""
ALONE_AT_LEVEL = {"sign", "==", "!="}
"""What may have a value of its own at the very place where it switches."""
STEPS_TO_LEAST_EXCESS = 4
"""Newton's steps to the slopes whose excess is least, where L is not convex in them."""
CORNER_JUMP = 1e-3
"""Relative jump of the slope that is a corner, not the error of the curve."""
BESIDE_VERTEX = 1e-9
"""Relative distance from a vertex at which its two sides are looked at."""
ORDINATE_ROUND_OFF = 1e-14
"""Error of an ordinate, in units of the largest, that a short element makes a jump of the slope of."""


def vouched(solution: Solution, form: Form) -> Solution:
    """The solution, refused when other slopes at its points show that it is no strong minimum."""
    found = objection(solution, form)
    return solution if found is None else refused(solution, found)


def objection(solution: Solution, form: Form) -> Finding | None:
    """What other slopes at a solution's points show of it when it is no strong minimum.

    First-order graphs are tested, under isoperimetric conditions with their
    multipliers, under bounds with the slopes these leave where none is touched.
    """
    problem = solution.problem
    tested = isinstance(problem, Problem) and problem.order == 1 and not any(problem.of_type(Holonomic))
    if not tested or form.coordinates.energetic or solution.curve is None or _seen(solution):
        return None
    x = places(solution)
    fan = SlopeFan.of(solution, x)
    if not_convex := fan.concave():
        x = places(solution, CLOSELY)
        fan = SlopeFan(solution, x)
        for _ in range(STEPS_TO_LEAST_EXCESS):
            fan = fan.closer()
    floor = EXCESS_AT_CORNERS if not_convex else ROUND_OFF_EXCESS
    bent = fan.legendre_fails()
    if bent is not None:
        place, curvature = bent
        return Finding(
            Verdict.SADDLE,
            f"no minimum of any kind: at {problem.abscissa.at([x[place]], 4)} the second derivative of L in the slope "
            f"is {curvature:.3g}, so Legendre's condition fails and fine ripples come lower",
        )
    relative, worst = fan.least()
    if relative < -floor:
        return Finding(
            Verdict.WEAK_MINIMUM,
            f"a weak minimum only: at {problem.abscissa.at([x[worst.place]], 4)} Weierstrass's excess is "
            f"{worst.excess:.3g} for the slope {worst.slope:.4g} instead of {worst.own:.4g}, so curves with corners "
            "come lower",
        )
    if not_convex and len(corners := _corners(solution)) > form.coordinates.corners:
        return Finding(
            Verdict.WEAK_MINIMUM,
            f"a weak minimum only: the Lagrangian is not convex in the slope, and the curve found has a corner at "
            f"{problem.abscissa.at(corners[:1], 6)} where the mesh allows one; more corners may come lower still",
        )
    return None


def concave_beside(solution: Solution) -> bool:
    """Whether L of a graph of first order is concave in a slope somewhere about those of its points."""
    problem = solution.problem
    if not (isinstance(problem, Problem) and problem.order == 1) or solution.curve is None:
        return False
    if solution.extremal is not None and solution.extremal.form.coordinates.energetic:
        return False
    if _functions(problem).quadratic:  # Legendre's condition has been asked
        return False
    if (along := _evaluated(solution)) is not None:  # a few slopes tell of what most are, roots of quadratics
        points = (along.x, np.atleast_2d(along.y), np.atleast_2d(along.dy))
        with np.errstate(all="ignore"):
            telling = _tried(problem, points, 0, TELLING_TURNS, np.arange(len(along.x)))
            if _roots_of_quadratics(along.value, along.momenta[0], along.curvature[:, 0, 0], *telling).all():
                return False
    return SlopeFan.of(solution, places(solution)).concave()


def concave_in_bend(solution: Solution) -> bool:
    """Whether L of a graph of one function at second order is concave in y'' somewhere about those of its points."""
    problem, curve = solution.problem, solution.curve
    if not (isinstance(problem, Problem) and problem.order == 2 and problem.n == 1) or curve is None:
        return False
    x = places(solution)
    y, slope, bend = (curve(x, k) for k in range(3))
    turns = max(1.0, float(np.abs(bend).max())) * np.linspace(-BENDS_ABOUT, BENDS_ABOUT, BENDS_TRIED)
    bends = bend[0][:, None] + turns
    rows = [np.repeat(row, BENDS_TRIED) for row in (x, y[0], slope[0])]
    with np.errstate(all="ignore"):
        values = problem.integrand_values(rows[0], rows[1][None], rows[2][None], ddy=bends.reshape(1, -1))
        values = problem.sign * values.reshape(bends.shape)
        second = values[:, 2:] - 2 * values[:, 1:-1] + values[:, :-2]
        size = np.abs(values[:, 2:]) + 2 * np.abs(values[:, 1:-1]) + np.abs(values[:, :-2])
    return bool((second < -ROUND_OFF_EXCESS * size).any())


def convinced(problem: Problem, x: np.ndarray, y: np.ndarray, slopes: np.ndarray, parameters: np.ndarray) -> np.ndarray:
    """Which of ``K`` smooth graphs without constraints the test of :func:`vouched` leaves no doubt about; (K,) of bool.

    The graphs are known at P points each: x (K, P), y and slopes (K, P, n), for the values ``parameters`` (K, m). No
    slope tried there may have a negative excess, and L must be convex in each component of their own.
    """
    count, places, n = y.shape
    repeated, blank = np.repeat(parameters, places, axis=0), np.zeros((1, 0))
    points = (x.reshape(-1, 1), y.reshape(-1, n), slopes.reshape(-1, n))
    rows = _in_the_slopes(problem)(count * places, *points, blank, repeated, blank).T
    rows *= problem.sign
    columns = (points[0][:, 0], points[1].T, points[2].T, repeated)
    good = _unbeaten(problem, columns, rows[0], rows[1 : 1 + n], rows[1 + n :])
    return np.all(good.reshape(count, places), axis=1)


def _unbeaten(
    problem: Problem, points: tuple[np.ndarray, ...], own: np.ndarray, slope: np.ndarray, curvature: np.ndarray
) -> np.ndarray:
    """At which m points L is convex in each component of the slope and no slope tried has a negative excess; (m,).

    ``points`` are x (m,), y and y' (n, m) and the parameters (m, p), which may be left out for the problem's own. L is
    ``own`` (m,) there, ``slope`` and ``curvature`` (n, m) its derivatives by each component, as they are minimised.
    """
    v = points[2]
    good = np.isfinite(own + slope.sum(0) + curvature.sum(0)) & np.all(curvature > 0, axis=0)
    for a in range(len(v)):
        rest = np.flatnonzero(good)
        telling = _tried(problem, points, a, TELLING_TURNS, rest)
        rest = rest[~_roots_of_quadratics(own[rest], slope[a, rest], curvature[a, rest], *telling)]
        if len(rest):
            turns = slope_turns(v)
            other, step = _tried(problem, points, a, turns[turns != 0], rest)
            relative = excesses(own[rest, None], slope[a, rest, None] * step, other)[1]
            good[rest] = relative.min(1) >= -ROUND_OFF_EXCESS
    return good


def _tried(
    problem: Problem, points: tuple[np.ndarray, ...], a: int, turns: np.ndarray, some: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """L as it is minimised at ``some`` of the points for other slopes of the function ``a``, and the steps to them."""
    step = np.maximum(1.0, np.abs(points[2][a, some]))[:, None] * turns
    x, y, changed = (np.repeat(p[..., some], len(turns), axis=-1) for p in points[:3])
    changed[a] += step.ravel()
    numbers = (np.repeat(p[some], len(turns), axis=0) for p in points[3:])
    return problem.sign * problem.integrand_values(x, y, changed, *numbers).reshape(step.shape), step


def _roots_of_quadratics(
    own: np.ndarray, slope: np.ndarray, curvature: np.ndarray, other: np.ndarray, step: np.ndarray
) -> np.ndarray:
    """At which m points L > 0 is the root of a quadratic form in one slope, as ``other`` slopes (m, T) show; (m,).

    Its second derivative there is the determinant of the form by L^3, of one sign for all slopes: where that is
    positive no slope has a negative excess.
    """
    own, slope, curvature = own[:, None], slope[:, None], curvature[:, None]
    square = own**2 + 2 * own * slope * step + (slope**2 + own * curvature) * step**2
    return np.all(
        (np.abs(other**2 - square) <= ROUND_OFF_EXCESS * square) & (other > 0) & (own > 0) & (curvature > 0), axis=1
    )


def _seen(solution: Solution) -> bool:
    """Whether what was evaluated along a smooth graph without constraints leaves no doubt that it is a minimum."""
    problem = solution.problem
    if not isinstance(problem, Problem) or problem.constraints or (along := _evaluated(solution)) is None:
        return False
    if jumps_of_slope(problem):
        return False
    if problem.end_cost is not None:  # what is asked of the momentum there may bend the curve beside an end alone
        return False
    points = (along.x, np.atleast_2d(along.y), np.atleast_2d(along.dy))
    with np.errstate(all="ignore"):
        return bool(_unbeaten(problem, points, along.value, along.momenta, along.curvature[:, 0].T).all())


def _evaluated(solution: Solution) -> AlongGraph | None:
    """What was evaluated along the smooth graph of one function."""
    problem, extremal = solution.problem, solution.extremal
    if extremal is None or extremal.form.problem is not problem or problem.n != 1:
        return None
    return extremal.along


def places(solution: Solution, count: int = TRIED_PLACES) -> np.ndarray:
    """Abscissae at which slopes are tried: Chebyshev's points, as a free end may bend the curve beside it alone."""
    low, high = solution.interval
    return low + (high - low) * 0.5 * (1.0 - roots(count))


@dataclass(frozen=True)
class Worst:
    """Where the excess is least: point, component of the slope, the value tried, the curve's own, the excess."""

    place: int
    component: int
    slope: float
    own: float
    excess: float


class SlopeFan:
    """Slopes tried at points of an extremal, one component at a time; arrays have shape (n, places, slopes).

    ``turns`` are the steps from the curve's own slope, the middle one of them 0, the same everywhere or of the shape of
    the rest; by default :func:`slope_turns`.
    """

    def __init__(self, solution: Solution, x: np.ndarray, turns: np.ndarray | None = None) -> None:
        assert solution.curve is not None
        self.solution, self.x = solution, x
        self.y, self.v = solution.curve(x, 0), solution.curve(x, 1)
        turns = slope_turns(self.v) if turns is None else turns
        self.tried = self.v[:, :, None] + turns * np.maximum(1.0, np.abs(self.v))[:, :, None]
        if (jumps := self._at_jumps()) is not None:  # on either side, so that the curve's own stay in the middle
            self.tried = np.concatenate([jumps, self.tried, jumps], axis=2)
        self.values, self.slopes, self.curvature, self.allowed = self._evaluate()

    @classmethod
    def of(cls, solution: Solution, x: np.ndarray) -> SlopeFan:
        """The fan, of the curve's own slopes alone where these tell of all others: where L is quadratic in the slope.

        The excess of a step there is half its square times the curvature.
        """
        problem = solution.problem
        if _functions(problem).quadratic and not any(problem.of_type(Bound)):
            own = cls(solution, x, np.zeros(1))
            if np.isfinite(own.values).all() and np.all(own.curvature >= 0.0):
                return own
        return cls(solution, x)

    def _at_jumps(self) -> np.ndarray | None:
        """Slopes at which L jumps and next to them, on either side; None where it jumps at none.

        A jump is as narrow as can be: between slopes that are tried L may be lower on one alone.
        """
        problem = self.solution.problem
        if not (found := jumps_of_slope(problem)):
            return None
        unknowns = self.solution.unknown_values[None]
        out: list[np.ndarray] = []
        for a in range(len(self.v)):
            slopes = [slope for jump in found for slope in jump.near(problem, self.x, self.y, self.v, a, unknowns)]
            out.append(np.array([np.where(np.isfinite(slope), slope, self.v[a]) for slope in slopes]).T)
        return np.array(out)

    def _evaluate(self) -> tuple[np.ndarray, ...]:
        """The Lagrangian function (minimised), its slope and curvature in the component tried, and what is allowed."""
        problem = self.solution.problem
        n, places, count = self.tried.shape
        slopes = np.broadcast_to(self.v.T[None, :, None, :], (n, places, count, n)).copy()
        for a in range(n):
            slopes[a, :, :, a] = self.tried[a]
        x, y = (np.tile(np.repeat(rows, count, axis=0), (n, 1)) for rows in (self.x[:, None], self.y.T))
        numbers = problem.parameter_values[None], self.solution.unknown_values[None]
        component = np.repeat(np.eye(n), places * count, axis=0)
        found = _functions(problem).rows(
            n * places * count, x, y, slopes.reshape(-1, n), np.zeros((1, 0)), *numbers, component
        )
        rows = found.T.reshape(-1, 3, n, places, count)
        levels = [m for c, m in zip(problem.constraints, self.solution.multipliers, strict=True) if _is_level(c)]
        sign = problem.sign
        # J falls by the multiplier as its level rises: the Lagrangian function is L - sum of multipliers times g
        weights = sign * np.array([1.0, *(-float(m) for m in levels)])
        total = np.einsum("r,r...->...", weights, rows[: len(weights)])
        allowed = np.ones((n, places, count), dtype=bool)
        bounds = [*problem.of_type(Bound)]
        for bound, row in zip(bounds, rows[len(weights) :, 0], strict=True):
            low, high = bound.interval
            own = row[:, :, [count // 2]]
            room = SLOPE_HELD * np.maximum(1.0, np.abs(own))
            allowed &= (row >= low) & (row <= high) & (own > low + room) & (own < high - room)
        return total[0], total[1], total[2], allowed

    def closer(self) -> SlopeFan:
        """The fan with slopes nearer to those of the least excess: Newton's step where L is convex in them."""
        here, unit = self.tried.shape[2] // 2, np.maximum(1.0, np.abs(self.v))[:, :, None]
        with np.errstate(all="ignore"):
            steps = np.clip((self.slopes[:, :, [here]] - self.slopes) / self.curvature, -0.5 * unit, 0.5 * unit)
        steps = np.where(np.isfinite(steps) & (self.curvature > 0), steps, 0.0)
        return SlopeFan(self.solution, self.x, (self.tried + steps - self.v[:, :, None]) / unit)

    def least(self) -> tuple[float, Worst]:
        """The least excess relative to its terms, and where it is found."""
        here = self.tried.shape[2] // 2
        linear = (self.tried - self.v[:, :, None]) * self._momenta()
        excess, relative = excesses(self.values[:, :, [here]], linear, self.values)
        # where a line touches L twice, as at a corner, all terms may be nothing, but not the hill in between
        hill = np.median(np.where(np.isfinite(excess), np.abs(excess), 0.0), axis=2, keepdims=True)
        with np.errstate(all="ignore"):
            relative = np.where(self.allowed & (relative < 0), excess / (excess / relative + hill), 0.0)
        a, k, j = (int(i) for i in np.unravel_index(np.argmin(relative), relative.shape))
        worst = Worst(k, a, float(self.tried[a, k, j]), float(self.v[a, k]), float(excess[a, k, j]))
        return float(relative[a, k, j]), worst

    def _momenta(self) -> np.ndarray:
        """The momenta (n, places, 1): L_v, or what supports L best at a slope at which that has a kink, or jumps.

        There any slope of a line that L does not come below is one.
        """
        here = self.tried.shape[2] // 2
        own = self.slopes[:, :, [here]]
        if not (at := self._at_switches()).any():
            return own
        step = self.tried - self.v[:, :, None]
        with np.errstate(all="ignore"):
            rates = (self.values - self.values[:, :, [here]]) / step
        far = np.isfinite(rates) & (np.abs(step) > 2 * BESIDE_JUMP * np.maximum(1.0, np.abs(self.v))[:, :, None])
        least = np.where(far & (step < 0), rates, -np.inf).max(2, keepdims=True)
        most = np.where(far & (step > 0), rates, np.inf).min(2, keepdims=True)
        return np.where(at[:, :, None] & (least <= most), np.clip(own, least, most), own)

    def _at_switches(self) -> np.ndarray:
        """Where the curve's own slope is one at which L has a kink, or jumps; (n, places) of bool."""
        problem, at = self.solution.problem, np.zeros(self.v.shape, dtype=bool)
        unknowns = self.solution.unknown_values[None]
        for switch in switches_of_slope(problem):
            for a in range(len(self.v)):
                for slope in switch.near(problem, self.x, self.y, self.v, a, unknowns)[::3]:
                    at[a] |= np.abs(slope - self.v[a]) <= BESIDE_JUMP * np.maximum(1.0, np.abs(self.v[a]))
        return at

    def legendre_fails(self) -> tuple[int, float] | None:
        """Where L is most concave in a component of the curve's own slope, and its second derivative there."""
        here = self.tried.shape[2] // 2
        curvature = np.where(self.allowed & np.isfinite(self.curvature), self.curvature, 0.0)
        unit = np.maximum(1.0, np.abs(self.v))
        size = np.abs(self.values[:, :, here]) / unit**2 + np.sort(np.abs(curvature), axis=2)[:, :, here]
        own = curvature[:, :, here]
        relative = np.divide(own, size, out=np.zeros_like(own), where=size > ROUND_OFF_EXCESS * np.abs(own))
        a, k = (int(i) for i in np.unravel_index(np.argmin(relative), relative.shape))
        return (k, float(own[a, k])) if relative[a, k] < -ROUND_OFF_EXCESS else None

    def concave(self) -> bool:
        """Whether the Lagrangian is concave in a component of the slope somewhere in the fan, or has a kink upward."""
        if (np.where(np.isfinite(self.curvature), self.curvature, 0.0) < 0).any():
            return True
        order = np.argsort(self.tried, axis=2)
        slopes = np.take_along_axis(self.slopes, order, axis=2)
        with np.errstate(all="ignore"):
            fallen = np.diff(slopes, axis=2) < -ROUND_OFF_EXCESS * (
                np.abs(slopes[:, :, 1:]) + np.abs(slopes[:, :, :-1])
            )
        return bool(fallen.any())


@dataclass(frozen=True)
class SwitchOfSlope:
    """A place at which L has a kink, or jumps, as the slope changes: ``values`` are its argument and their rates."""

    values: PointEvaluator
    levels: tuple[float, ...]
    stepped: bool
    jumps: bool

    def near(
        self, problem: Functional, x: np.ndarray, y: np.ndarray, v: np.ndarray, a: int, unknowns: np.ndarray
    ) -> list[np.ndarray]:
        """Slopes (m,) of the function ``a`` at each level, and just below and above it, from x (m,), y and v (n, m).

        Those that are no numbers are none. Of what is stepped the nearest levels are told.
        """

        def rows(slopes: np.ndarray) -> np.ndarray:
            blank = np.zeros((1, 0))
            return self.values(len(x), x[:, None], y.T, slopes, blank, problem.parameter_values[None], unknowns)

        below = np.floor(rows(v.T)[:, 0])
        found: list[np.ndarray] = []
        for level in [below + k for k in (-1, 0, 1, 2)] if self.stepped else self.levels:
            slopes = v.T.copy()
            with np.errstate(all="ignore"):
                for _ in range(STEPS_ONTO_SWITCH):
                    here = rows(slopes)
                    slopes[:, a] -= (here[:, 0] - level) / here[:, 1 + a]
            at = slopes[:, a]
            found += [at, *(at + way * BESIDE_JUMP * np.maximum(1.0, np.abs(at)) for way in (-1, 1))]
        return found


@derived
def switches_of_slope(problem: Functional) -> tuple[SwitchOfSlope, ...]:
    """The kinks and jumps of what is stated that depend on the slope of a graph of first order."""
    s = problem.symbols
    if not (isinstance(problem, Problem) and problem.order == 1):
        return ()
    found: list[SwitchOfSlope] = []
    for switch in on_curve(problem):
        # both sides of sign(v)² are alike, but not what lies between
        alone = switch.word in ALONE_AT_LEVEL
        if (alone or not switch.smooth) and switch.depends_on(s.dy):
            rows = ca.densify(ca.vertcat(switch.argument, ca.gradient(switch.argument, s.dy)))
            function = PointEvaluator(ca.Function("switch", s.all, [rows]))
            found.append(SwitchOfSlope(function, switch.levels, switch.stepped, alone or switch.jumps))
    return tuple(found)


def jumps_of_slope(problem: Functional) -> list[SwitchOfSlope]:
    """Those of them that jump."""
    return [switch for switch in switches_of_slope(problem) if switch.jumps]


@derived
def _in_the_slopes(problem: Problem) -> PointEvaluator:
    """L with its first and second derivatives in each component of the slope."""
    hessian, slope = ca.hessian(problem.integrand, problem.symbols.dy)
    own = ca.densify(ca.vertcat(problem.integrand, slope, ca.diag(ca.densify(hessian))))
    return PointEvaluator(ca.Function("slopes", problem.symbols.all, [own]))


def _is_level(constraint: object) -> bool:
    return isinstance(constraint, Isoperimetric)


@dataclass(frozen=True)
class _Functions:
    """L, each level's integrand and each bound along a direction of the slope.

    ``rows`` takes the problem's symbols and the direction (n,) to value, slope and curvature along it, one after the
    other. ``quadratic`` tells that none of the curvatures depends on the slope.
    """

    rows: PointEvaluator
    quadratic: bool


@derived
def _functions(problem: Functional) -> _Functions:
    """The functions of a problem, kept with it.

    Only what a direction needs is differentiated: the Hessian has as many entries as there are pairs of functions.
    """
    s = problem.symbols
    levels = [t.expression for t in problem.traced if _is_level(t.constraint)]
    bounds = [t.expression for t in problem.traced if isinstance(t.constraint, Bound)]
    direction = s.kind.sym("direction", problem.n)
    rows = []
    for expression in (problem.integrand, *levels, *bounds):
        slope = ca.jtimes(expression, s.dy, direction)
        rows += [expression, slope, ca.jtimes(slope, s.dy, direction)]
    function = ca.Function("slopes", [*s.all, direction], [ca.densify(ca.vertcat(*rows))])
    curved = ca.depends_on(ca.vertcat(*rows[2::3]), s.dy) or _level_has_kink(problem, levels)
    return _Functions(PointEvaluator(function), quadratic=not (curved or jumps_of_slope(problem)))


def _level_has_kink(problem: Functional, levels: list[Expression]) -> bool:
    """Whether a level switches at a slope: by its multiplier a kink may point up, where curvatures are those beside."""
    highest = problem.symbols.highest
    if not any(ca.depends_on(level, highest) for level in levels):
        return False
    return any(switch.depends_on(highest) for switch in on_curve(problem))


def _corners(solution: Solution) -> np.ndarray:
    """The inner vertices, but for the problem's own, at which the slope jumps."""
    assert solution.curve is not None
    own = (*breaks(solution.problem), *(c.x for c in solution.problem.of_type(Through)))
    inner = np.array([x for x in solution.x[1:-1] if x not in own])
    if not len(inner):
        return inner
    return inner[slopes_beside(solution.curve, solution.x, inner).jump.any(0)]


class SlopesBeside(NamedTuple):
    """The slopes (n, m) on either side of m inner vertices, abscissae on these sides (m,), and which slopes jump."""

    left: np.ndarray
    right: np.ndarray
    before: np.ndarray
    after: np.ndarray
    jump: np.ndarray


def slopes_beside(curve: CurveOrSlope, vertices: np.ndarray, inner: np.ndarray) -> SlopesBeside:
    """The slopes of a curve on either side of inner vertices, each in the element next to them, however short.

    A jump is one of the slope there or, where that is small, of the curve's mean slope; and more than the round-off
    of the ordinates makes of it in the shorter element.
    """
    elements, at = np.diff(vertices), np.searchsorted(vertices, inner)
    shorter = np.minimum(elements[at - 1], elements[at])
    step = np.minimum(BESIDE_VERTEX * np.ptp(vertices), 0.25 * shorter)
    left, right = inner - step, inner + step
    before, after, y = curve(left, 1), curve(right, 1), curve(vertices, 0)
    typical = np.ptp(y, axis=1, keepdims=True) / np.ptp(vertices)
    round_off = ORDINATE_ROUND_OFF * np.abs(y).max(axis=1, keepdims=True) / shorter
    jump = np.abs(after - before) > CORNER_JUMP * (typical + np.abs(before) + np.abs(after)) + round_off
    return SlopesBeside(left, right, before, after, jump)
