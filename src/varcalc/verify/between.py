"""Whether anything of a problem lies between the samples of its answer.

A curve is found, and its value is summed, from what L is at points. Between neighbouring points L is enclosed
(:mod:`varcalc.symbolic.variation`): where it may vary faster than the points can tell, it is looked at closer, until
nothing narrower can hide. What is found is marked, for a mesh that sees it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from varcalc.formulation import formulate
from varcalc.methods.answer import Extremal, functional, functional_value, lifted, sample
from varcalc.numerics.mesh import composite_gauss, subdivided
from varcalc.problem.breaks import bounds, breaks, integrals
from varcalc.problem.conditions import Bound
from varcalc.problem.problem import Problem
from varcalc.solution import Solution
from varcalc.symbolic.derived import derived
from varcalc.symbolic.instructions import instructions
from varcalc.symbolic.variation import LOCAL, VARYING, Between, Rules, excess, gentle
from varcalc.verify.along_curve import along_curve
from varcalc.verify.candidate import undivided
from varcalc.verify.given_curve import stated
from varcalc.verify.residual import residual
from varcalc.verify.slopes import slopes_beside

BOXES = 32
"""Boxes an element, where the points of a method are not known and elements are few."""
FEW_ELEMENTS = 4
LEAST_BOXES = 4
"""Boxes an element where there are more."""
BESIDE_SINGULAR = 0.25
"""Share of s beside a singular end that is left out: there everything varies by factors, and s is made for that."""
BEYOND_ENDS = 0.1
"""By what share of their difference a curve may leave the range of two neighbouring samples."""
BEFORE_VERTEX = 1e-9
"""Share of a box by which its end lies before a vertex."""
AN_ELEMENT = 3.0
"""By how many times more than is gentle something may vary from the middle of an element."""
BESIDE_EDGE, STIFF = 0.05, 10.0
"""Share of s beside an end that may be edged, and by what factor L_y'y' grows there."""
NARROWEST = 1e-9
"""Width of a box, relative to the interval, that is not looked into."""
MOST_BOXES = 300_000
SUM_POINTS = 24
"""Gauss points between marks."""
BELIED, SAME_SUM = 10.0, 1e-9
"""By how many times its claimed error, and a relative difference, two sums of a functional may differ."""
SAME_LENGTH, BESIDE_LINE = 1e-6, 0.05
"""Relative difference of a length and L's integral that is none, and the share of s left out at either end: beside
a line where L is infinite L itself has few digits."""
ALGEBRAIC = {
    ca.OP_CONST, ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_ASSIGN, ca.OP_ADD, ca.OP_SUB, ca.OP_MUL, ca.OP_DIV, ca.OP_NEG,
    ca.OP_POW, ca.OP_CONSTPOW, ca.OP_SQ, ca.OP_SQRT, ca.OP_TWICE, ca.OP_INV,
}  # fmt: skip
BELIED_BY_TEAR = 300.0
"""By how many times its claimed error a functional may change where a slope jumps by what no extremal's does: the jumps
of the slope and of the momentum, times the longer element. Those of a mesh's own error make some 72 of it.
"""
BESIDE_TEAR = 1e-4
"""Distance from a vertex, in units of the shorter element, at which its two sides are looked at."""
CLOSER_TO_VERTEX, MOST_CLOSER = 8.0, 12
"""By what factor elements become shorter toward a vertex beside which a layer is not seen, and how often."""
BALANCED = 1e-6
"""Residual of the Euler-Lagrange equation, relative to its terms, of a curve that solves it."""
WITHIN_BOX = 16
"""Points in a box at which a bound is asked."""
FEATURES_APART = 0.02
"""Share of the interval by which two features lie apart."""
NEXT_TO_BOUND, NEARER = 1e-2, 2
"""How near a bound, relative to its range along the curve, it is looked at closer whether that is kept, and how often.
"""
BROKEN = 1e-7
"""By how much a bound may be missed between the points at which it was asked, relative to its range along the curve."""


@dataclass(frozen=True)
class Unseen:
    """What the samples of a curve may have missed: ``marks`` in s at which a mesh sees it, its ``place`` in x."""

    marks: np.ndarray
    place: float
    torn: bool = False
    """Whether the momentum jumps there, which no extremal's does."""
    beyond: bool = False
    """Whether the curve itself breaks a bound there."""

    @property
    def sentence(self) -> str:
        """What was seen, in the user's words."""
        if self.torn:
            return f"at x = {self.place:.9g} the momentum jumps between two elements, and moving that place does better"
        return f"near x = {self.place:.9g} L or a constraint varies faster than the points of the mesh can tell"


def unseen(solution: Solution, worth: float = 0.0) -> Unseen | None:
    """What the samples of a solution's curve may have missed; None where nothing lies between them.

    A bound may vary as it likes where the curve keeps it. A curve that is no answer may be steep: what roots and
    reciprocals make of it says nothing. Of an answer, what they
    make of a slope that ends at the edge of the domain of L is left alone where it is no more than it is ``worth``.
    """
    extremal, problem = solution.extremal, solution.problem
    if problem.symbols.kind is not ca.SX or (problem.order == 2 and any(problem.slides)):
        return None
    if extremal is None:  # a quadrature has looked between its own points
        return None
    if not solution.status.ok:
        return _in_integrals(extremal, LOCAL, everywhere=True)
    inside = _in_integrals(extremal, VARYING, everywhere=False, worth=worth)
    return inside or _beyond_bounds(extremal) or _torn(solution)


def unseen_where_broken(solution: Solution) -> Unseen | None:
    """The same of a curve that is broken, or rests, of which no method has looked: features of L and its conditions.

    Of each a mesh needs the edges and the middle, to be refined there.
    """
    finely = _finely(solution)
    missed = None if finely is None else _in_integrals(finely, VARYING, everywhere=False) or _beyond_bounds(finely)
    if finely is None or missed is None:
        return None
    marks, room = np.unique(missed.marks), FEATURES_APART * (finely.form.span[1] - finely.form.span[0])
    features = np.split(marks, 1 + np.flatnonzero(np.diff(marks) > room))
    return replace(missed, marks=np.unique([(f[0], 0.5 * (f[0] + f[-1]), f[-1]) for f in features]))


def keeps_bounds(solution: Solution) -> bool:
    """Whether the curve of a graph of first order is shown to keep its bounds, those it was found without as well."""
    finely = _finely(solution)
    return finely is not None and _beyond_bounds(finely) is None


def _finely(solution: Solution) -> Extremal | None:
    """The curve of an answer, a graph of first order, with as many boxes as a method has points; None for others."""
    problem = solution.problem
    form = formulate(problem)
    plain = isinstance(problem, Problem) and problem.order == 1 and not form.stated.is_lifted
    if not plain or solution.curve is None or problem.symbols.kind is not ca.SX or not solution.status.ok:
        return None
    known = stated(solution, form)
    # what was found without its bounds is on a mesh that does not know where these have kinks
    vertices = np.union1d(known.vertices, breaks(problem))
    # a method looks at as many points of an element as its degree
    parts = max(1, -(-solution.stats.degree // LEAST_BOXES))
    return replace(known, vertices=subdivided(vertices, parts))


def of_powers_alone(solution: Solution) -> bool:
    """Whether nothing but roots, reciprocals and powers may have hidden something between a solution's samples."""
    extremal = solution.extremal
    return extremal is None or _in_integrals(extremal, LOCAL, everywhere=False) is None


def as_stated(solution: Solution, missed: Unseen | None = None) -> bool:
    """Whether the person's own L has the value that a metric's length has, summed where a mesh sees what was missed.

    That L is the length of a metric is seen from a few slopes, and it need not be one for others. Where nothing was
    missed, sums, products, powers and roots are what they look like at those.
    """
    extremal, problem = solution.extremal, solution.problem
    if extremal is None or not extremal.form.coordinates.energetic or not isinstance(problem, Problem):
        return True
    if missed is None and (problem.symbols.kind is not ca.SX or _algebraic(problem)):
        return True
    edges = extremal.vertices if missed is None else np.union1d(extremal.vertices, missed.marks)
    s, weights = composite_gauss(edges, SUM_POINTS)
    first, last = extremal.form.span
    inner = np.minimum(s - first, last - s) > BESIDE_LINE * (last - first)
    s, weights = s[inner], weights[inner]
    x, y, dx, dy = lifted(extremal, s)
    length = np.asarray(functional(extremal.form)(*sample(extremal, s))).ravel()
    with np.errstate(all="ignore"):
        apart = problem.sign * problem.integrand_values(x, y, dy / dx) * dx - length
    return not float(weights @ np.abs(apart)) > SAME_LENGTH * float(weights @ np.abs(length))


@derived
def _algebraic(problem: Problem) -> bool:
    return {i.operation for i in instructions(integrals(problem))} <= ALGEBRAIC


def balanced(solution: Solution, missed: Unseen) -> bool:
    """Whether a root of the Euler-Lagrange equation is one on the points that its mesh missed as well.

    A minimum that was found without them may still lie in a bent valley, of which no residual tells.
    """
    extremal = solution.extremal
    if extremal is None or extremal.form.conditions.pathwise or not solution.status.ok:
        return False
    finer = replace(extremal, vertices=np.unique(np.concatenate([extremal.vertices, missed.marks])))
    value, size = functional_value(finer, SUM_POINTS), max(abs(solution.value), 1e-300)
    if not abs(value - solution.value) <= BELIED * solution.error.value + SAME_SUM * size:
        return False
    return residual(along_curve(undivided(finer, solution.value))) <= BALANCED


def _in_integrals(extremal: Extremal, rules: Rules, *, everywhere: bool, worth: float = 0.0) -> Unseen | None:
    looked = _looked(extremal, integrals(extremal.form.problem), rules, everywhere=everywhere, worth=worth)
    return None if looked is None or not len(looked[0]) else Unseen(looked[0], float(looked[2]))


def _beyond_bounds(extremal: Extremal) -> Unseen | None:
    problem = extremal.form.problem
    held = [t.constraint for t in problem.traced if isinstance(t.constraint, Bound)]
    if not held:
        return None
    function = bounds(problem)
    s, _ = _samples(extremal)
    looked = _looked(extremal, function, VARYING, everywhere=False)
    marks, edges = (np.zeros(0), s) if looked is None else looked[:2]
    asked, sizes = subdivided(edges, WITHIN_BOX), np.ones((len(held), 1))
    for nearer in range(1 + NEARER):
        points = _points(extremal, asked)
        values = np.asarray(function(*_arguments(extremal, points)))
        if nearer == 0:
            sizes = np.maximum(1.0, np.ptp(values, axis=1))[:, None]
        levels = np.array([bound.interval for bound in held])
        over = (np.maximum(levels[:, :1] - values, values - levels[:, 1:]) / sizes).max(0)
        broken = np.flatnonzero(over > BROKEN)
        if len(broken):
            boxes = np.clip(np.searchsorted(edges, asked[broken], side="right") - 1, 0, len(edges) - 2)
            at = np.union1d(edges[boxes], edges[boxes + 1])
            inside = np.union1d(marks, at[(at > s[0]) & (at < s[-1])])
            return Unseen(inside, float(points[0, int(np.argmax(over))]), beyond=True)
        # where a curve comes next to a bound it may go beyond that between two points, but not where it stays at it
        rises = over[1:-1, None] - np.column_stack([over[:-2], over[2:]])
        near = 1 + np.flatnonzero((rises >= 0.0).all(1) & (rises > BROKEN).any(1) & (over[1:-1] > -NEXT_TO_BOUND))
        if not len(near):
            return None
        low, high = asked[near - 1], asked[near + 1]
        asked = np.unique(low[:, None] + (high - low)[:, None] * (np.arange(1 + WITHIN_BOX) / WITHIN_BOX))
    return None


def _torn(solution: Solution) -> Unseen | None:
    """Where the momentum jumps from one element to the next: a layer beside a vertex in an element that sees no layers.

    Where a step of the curve ends at a vertex, and the next element's points all lie beyond it, moving the step costs
    more on that mesh, whatever it costs.
    """
    extremal, problem = solution.extremal, solution.problem
    assert extremal is not None
    plain = isinstance(problem, Problem) and problem.order == 1 and not extremal.form.stated.is_lifted
    inner = extremal.vertices[1:-1]
    if not plain or not len(inner) or extremal.form.conditions.pathwise:
        return None
    if not slopes_beside(extremal.evaluate, extremal.vertices, inner).jump.any():
        return None
    along = along_curve(undivided(extremal, solution.value))
    momentum, elements = along.function(along.whole.partial(1)), np.diff(extremal.vertices)
    step = BESIDE_TEAR * np.minimum(elements[1:], elements[:-1])

    def at_vertices(of: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        """By how much something (m, n) jumps at the vertices themselves: beside them it may change fast."""
        left, right = (2 * of(inner + way * step) - of(inner + 2 * way * step) for way in (-1, 1))
        return np.abs(right - left)

    slopes = at_vertices(lambda s: extremal.evaluate(s, 1).T)
    pulled = at_vertices(lambda s: momentum(s)[0].reshape(len(s), -1))
    costs = (slopes * pulled).sum(1) * np.maximum(elements[1:], elements[:-1])
    costs[np.isin(inner, [*problem.breakpoints, *along.held])] = 0.0
    k = int(np.argmax(costs))
    if not costs[k] > BELIED_BY_TEAR * solution.error.value:
        return None
    place, widths, shortest = inner[k], (elements[k + 1], -elements[k]), min(elements[k], elements[k + 1])
    graded = [place + w * CLOSER_TO_VERTEX**-j for w in widths for j in range(1, MOST_CLOSER)]
    marks = [x for x in graded if abs(x - place) >= shortest / CLOSER_TO_VERTEX]
    return Unseen(np.array(sorted(marks)), float(place), torn=True)


def _looked(
    extremal: Extremal, function: ca.Function, rules: Rules, *, everywhere: bool, worth: float = 0.0
) -> tuple[np.ndarray, np.ndarray, float] | None:
    """Marks in s that a mesh needs for a function, the edges of all boxes looked at, and the x of the worst.

    None where nothing may hide; what varies ``everywhere`` is marked even so. See :func:`unseen` for its ``worth``.
    """
    if gentle(function, rules):
        return None
    s, points = _samples(extremal)
    low, high, first, last = s[:-1], s[1:], points[:, :-1], points[:, 1:]
    if extremal.samples is None and len(extremal.vertices) > 2:
        # at a corner the slope is that of the piece behind it
        last = _points(extremal, high - BEFORE_VERTEX * (high - low))
    over = _excess(extremal, function, rules, first, last, first, last)
    if extremal.samples is None:  # these are no points of the method's, which need not have seen what they show
        inside = _points(extremal, 0.5 * (low + high))
        over = np.fmax(over, _excess(extremal, function, rules, first, last, inside, inside) / AN_ELEMENT)
    # what is infinite at an end is a matter of its coordinates, not of the mesh
    over[((low == s[0]) | (high == s[-1])) & np.isinf(over)] = 0.0
    if not everywhere and not np.any(over > 1.0):
        return None
    place = float(points[0, np.argmax(over)])
    marks, seen = [np.zeros(0)], [s]
    edge = _edged(extremal, s, points) if worth > 0.0 else np.zeros((0, 2))
    narrowest = NARROWEST * (extremal.form.span[1] - extremal.form.span[0])
    while 0 < len(low) <= MOST_BOXES:
        middle = 0.5 * (low + high)
        halfway = _points(extremal, middle)
        over = _excess(extremal, function, rules, first, last, halfway, halfway)
        varies = (over > 1.0) & (high - low > narrowest)
        beside = varies & np.any((low >= edge[:, :1]) & (high <= edge[:, 1:]), axis=0)
        if beside.any():
            around = first[:, beside], last[:, beside], halfway[:, beside]
            varies[beside] = ~_worthless(extremal, function, worth, *around)
        marks.append(middle[varies & (over > AN_ELEMENT)])
        seen.append(middle[varies])
        low, high, middle = low[varies], high[varies], middle[varies]
        first, last, halfway = first[:, varies], last[:, varies], halfway[:, varies]
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
        first, last = np.hstack([first, halfway]), np.hstack([halfway, last])
    return np.concatenate(marks), np.unique(np.concatenate(seen)), place


def _edged(extremal: Extremal, s: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Stretches of s (ends, 2) beside ends toward which L_y'y' grows without bound: a slope ends at an edge there."""
    problem, room = extremal.form.problem, BESIDE_EDGE * (s[-1] - s[0])
    if not isinstance(problem, Problem) or problem.order > 1:
        return np.zeros((0, 2))
    with np.errstate(all="ignore"):
        stiffness = np.abs(np.asarray(_stiffness(problem)(*_arguments(extremal, points)))).ravel()
    away = np.clip(np.searchsorted(s, [s[0] + room, s[-1] - room]) - [0, 1], 1, len(s) - 2)
    stiff = ~(stiffness[[1, -2]] <= STIFF * stiffness[away])
    return np.array([[s[0], s[0] + room], [s[-1] - room, s[-1]]])[stiff]


@derived
def _stiffness(problem: Problem) -> ca.Function:
    """The sum of the second derivatives of L in each slope."""
    second = ca.trace(ca.densify(ca.hessian(problem.integrand, problem.symbols.dy)[0]))
    return ca.Function("stiffness", problem.symbols.all, [second])


def _worthless(extremal: Extremal, function: ca.Function, worth: float, *points: np.ndarray) -> np.ndarray:
    """Between which of three points (rows, m) of a curve nothing but powers varies, and by no more than it is worth.

    Next to an edge of its domain L is so curved in the slope that nothing else moves the curve there. A level counts
    with its multiplier.
    """
    weights = np.array([1.0, *np.abs(extremal.lambdas)])
    with np.errstate(all="ignore"):
        known = (np.asarray(ca.vertcat(*function.call(_arguments(extremal, p)))) for p in points)
        values = np.array([weights @ rows[: len(weights)] for rows in known])
    values = np.where(np.isfinite(values), values, np.nan)  # of a slope that round-off carries over the edge
    spread = np.nan_to_num(np.fmax.reduce(values) - np.fmin.reduce(values))
    local = _excess(extremal, function, LOCAL, *points, points[2]) > 1.0
    return ~local & (spread * np.abs(points[1][0] - points[0][0]) <= worth)


def _samples(extremal: Extremal) -> tuple[np.ndarray, np.ndarray]:
    """Ascending s (m,), and :func:`_points` there; ends at which the coordinates are singular are left out."""
    known, vertices, (first, last) = extremal.samples, extremal.vertices, extremal.form.span
    if known is not None:
        s, points = known.s, np.vstack([known.x, known.y, known.dy])
        before, after = _led_on(s, points, first, 0, 1), _led_on(s, points, last, -1, -2)
        ends = np.column_stack([before, after])
        # a curve may be far from its end at the point next to that
        given = [end.values(len(known.y)) for end in (extremal.form.problem.start, extremal.form.problem.end)]
        ordinates = ends[1 : 1 + len(known.y)]
        np.copyto(ordinates, np.transpose(given), where=np.isfinite(np.transpose(given)))
        s, points = np.concatenate([[first], s, [last]]), np.column_stack([ends[:, 0], points, ends[:, 1]])
    else:
        pieces = BOXES if len(vertices) <= FEW_ELEMENTS + 1 else LEAST_BOXES
        s = np.append(subdivided(vertices, pieces)[:-1], last)
        points = _points(extremal, s)
    start, end = extremal.form.coordinates.singular
    if start or end:
        room = BESIDE_SINGULAR * (last - first)
        kept = (s >= first + room * start) & (s <= last - room * end)
        s, points = s[kept], points[:, kept]
    return s, points


def _led_on(s: np.ndarray, points: np.ndarray, at: float, near: int, next_one: int) -> np.ndarray:
    """Where the straight line through two of the points (rows, m) at s (m,) is ``at`` an end."""
    share = (at - s[near]) / (s[next_one] - s[near])
    with np.errstate(invalid="ignore"):  # of a slope that is infinite at both places nothing is known at the end
        return points[:, near] + (points[:, next_one] - points[:, near]) * share


def _points(extremal: Extremal, s: np.ndarray) -> np.ndarray:
    """The user's abscissa, ordinates and their derivatives at s (m,), one below the other."""
    if not extremal.form.stated.is_lifted:
        return np.vstack([s, *(extremal.evaluate(s, k) for k in range(extremal.form.order + 1))])
    x, y, dx, dy = lifted(extremal, s)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.vstack([x, y, dy / dx])


def _arguments(extremal: Extremal, points: np.ndarray) -> list[np.ndarray]:
    """The arguments of the problem's expressions at points of the curve (rows, m), each with m columns."""
    problem, count = extremal.form.problem, points.shape[1]
    n = problem.n
    numbers = problem.parameter_values, extremal.unknowns[: len(problem.unknowns)]
    fixed = [np.tile(np.asarray(v, dtype=float)[:, None], (1, count)) for v in numbers]
    return [points[:1], points[1 : 1 + n], points[1 + n : 1 + 2 * n], points[1 + 2 * n :], *fixed]


def _excess(extremal: Extremal, function: ca.Function, rules: Rules, *points: np.ndarray) -> np.ndarray:
    """How far something goes between the first two of four points beyond what it is at the last two; each (rows, m).

    It is 0 where one of the points is no number.
    """
    low, high = np.minimum(*points[:2]), np.maximum(*points[:2])
    with np.errstate(invalid="ignore"):  # a slope may be infinite at both
        room = BEYOND_ENDS * (high - low)
        room[0] = 0.0
        low, high = low - room, high + room
    sides = [_arguments(extremal, side) for side in (low, high, *points[2:])]
    boxes = [[Between((a, b), c, d) for a, b, c, d in zip(*rows, strict=True)] for rows in zip(*sides, strict=True)]
    over = excess(function, boxes, low.shape[1:], rules)
    over[~np.isfinite(points[0] + points[1]).all(0)] = 0.0
    return over
