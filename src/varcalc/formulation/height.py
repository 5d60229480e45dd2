"""At which heights a functional changes, in whatever units it is written.

How high curves are bent that a method tries is told by what the functional feels of bends, and where there are hills
and wells by where L turns along vertical lines.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np

from varcalc.formulation.form import Form
from varcalc.numerics.mesh import gauss
from varcalc.problem.breaks import on_curve
from varcalc.problem.functional import arguments_at
from varcalc.problem.problem import Curve, Problem
from varcalc.symbolic.derived import derived
from varcalc.symbolic.evaluation import PointEvaluator

OCTAVES = 3
"""Doublings of the height from one bend that is measured to the next."""
DOUBLINGS = OCTAVES * np.arange(-17, 18)
"""Heights at which bends are measured, in units of the ends' distance: so many times doubled, or halved."""
POINTS = 4
POWER_CHANGED = 0.4
"""Change of the power of the height with which an integral grows, by which it has left its first one."""
BEND_SEEN = 1e-9
"""Part of what is summed that a bend has to change before the growth of the sum is more than rounding."""
ADDED_SEEN = 1e-12
"""Part of the ordinates that a bend has to add to them, for as many digits of it to be left as its growth needs."""
FLAT = 1e-9
"""Height, in units of what the functional feels, that is none."""
FAR_OUT = 1e6
"""Height, in units of :func:`height`, from which on a curve is on its way out."""
LINE_ROUND_OFF = 1e-15
"""The same of a line between ends that are zero."""
KEPT_FORMS = 16
"""Forms whose height is kept: it is asked for by every solve of one, on every mesh."""
WITHIN = 100.0
"""Ratio of the ends' distance and the height that the functional feels, either way, to which one unit serves both."""

FEW_HEIGHTS = 1e4
"""Ratio of the heights between which an integral changes its power, of one landscape."""
MUCH_HIGHER = 8.0
"""How many times higher the functional may feel than the ends are apart, for one unit to show all of its landscape."""
SWITCHED_AT, SHOWN = 9, 2.0
"""Abscissae at which it is told how far away something switches, and how much broader a lattice is than that."""
NO_CHANGE = 1e-7
"""Change of L from one to the next, relative to its size there, that is none."""
NEAREST_TURNS = 8
"""Turns of a vertical line that are taken, the nearest ones: what is periodic has no end of them."""
LEAST_SWING = 1e-3
"""How much L changes from a turn to the next, of its greatest such change, for the levels to reach so far."""


def height(form: Form) -> float:
    """A length of the size of the problem's functions.

    It is the extent of the baseline, or of the interval where that is larger, as if both had one unit. Where they have
    not, a bend so high is nothing to the functional, or all: then it is the nearest height at which one of its
    integrals does not grow with a power of the height.
    """
    extent, felt = _measured(form)
    if felt is None:
        return extent
    if extent > WITHIN * felt.high:
        return felt.high
    return felt.low if WITHIN * extent < felt.low else extent


def breadths(form: Form) -> tuple[float, ...]:
    """How broad the landscape of a functional may be: as the baseline, or the interval, as :func:`height`.

    Where that is far less than the heights that the functional feels it is the highest of these. Where an integral ends
    to be a number, or changes its power again and again, there is no height at which that is over. Where it is far
    more, a lattice so broad passes by what is felt: then it is as much more as one lattice shows, and the extent comes
    second, as what is felt may lie far from what bends along one function show. A Curve has a size
    of its own, and none.
    """
    if isinstance(form.problem, Curve):
        return (0.0,)
    extent, felt = _measured(form)
    switched = _switched(form)
    if extent < switched or 0.0 < WITHIN * switched < extent:  # what is chosen by the height is felt from there on
        return (min(SHOWN * switched, WITHIN * switched), extent)
    if felt is None:
        return (extent,)
    over = not felt.ends and felt.high <= FEW_HEIGHTS * felt.low
    if over and MUCH_HIGHER * extent < felt.high:
        return (felt.high,)
    shown = WITHIN * felt.high
    return (shown, extent) if shown < extent else (extent,)


def far_out(form: Form, size: float) -> bool:
    """Whether ordinates of this size say nothing of curves of the problem: nothing finite lies so far out."""
    return size > FAR_OUT * height(form)


def flat(form: Form) -> float:
    """The height up to which a curve is as good as zero; none for ends that are not, whose unit may be as small.

    An end that slides may come to lie anywhere.
    """
    line = float(np.abs(form.start.curve(np.linspace(*form.span, 3))).max())
    unit = height(form)
    return FLAT * unit if any(form.problem.slides) or line <= LINE_ROUND_OFF * unit else 0.0


@lru_cache(maxsize=KEPT_FORMS)
def _switched(form: Form) -> float:
    """The greatest distance from the straight line between the ends at which something switches; 0 where nothing does.

    Along vertical lines, of graphs of one function.
    """
    problem = form.problem
    if not isinstance(problem, Problem) or problem.n > 1 or problem.symbols.kind is not ca.SX:
        return 0.0
    s, x = problem.symbols, np.linspace(*problem.span, SWITCHED_AT)
    arguments = [w.argument for w in on_curve(problem) if not w.stepped and ca.depends_on(w.argument, s.y)]
    if not arguments:
        return 0.0
    steps = [-argument / ca.gradient(argument, s.y) for argument in arguments]
    function = ca.Function("away", s.all, [ca.densify(ca.substitute(ca.vertcat(*steps), s.dy, ca.SX.zeros(1)))])
    ends = np.array([end.values(1)[0] for end in (problem.start, problem.end)])
    given = ends[~np.isnan(ends)] if not np.isnan(ends).all() else np.zeros(1)
    line = np.linspace(given[0], given[-1], SWITCHED_AT)[None]
    with np.errstate(all="ignore"):
        away = np.abs(np.asarray(function(*arguments_at(problem, x, line, np.zeros_like(line)))))
    return float(away.max(where=np.isfinite(away), initial=0.0))


@lru_cache(maxsize=KEPT_FORMS)
def _measured(form: Form) -> tuple[float, _Felt | None]:
    """The extent of a form, and what its functional feels."""
    extent = _extent(form)
    return extent, _felt(form, extent)


def _extent(form: Form) -> float:
    """The spread of the baseline, and of the interval where that has a unit of length."""
    line = form.start.curve(np.linspace(*form.span, 9))
    spread = float(np.ptp(line, axis=1).max())
    scale = max(spread, float(np.abs(line).max()) * 1e-3)
    # the parameter of a curve has no unit of length, and s of a lifted form has none either
    unlike = form.stated.is_lifted or isinstance(form.problem, Curve)
    return scale if unlike and spread > 0.0 else max(scale, form.problem.span[1] - form.problem.span[0])


@dataclass(frozen=True)
class _Felt:
    """Heights between which integrals change the power with which they grow, and whether one ends to be a number."""

    low: float
    high: float
    ends: bool


def _felt(form: Form, extent: float) -> _Felt | None:
    """The heights at which integrals change the power with which they grow; None where each is one throughout."""
    nodes, weights = gauss(POINTS)
    a, b = form.span
    s, half = 0.5 * (a + b) + 0.5 * (b - a) * nodes, 0.5 * (b - a)
    arch, slope, step = 1 - nodes**2, -2 * nodes / half, 0.05 * half
    line, rise = form.start.curve(s), (form.start.curve(s + step) - form.start.curve(s - step)) / (2 * step)
    heights = extent * 2.0 ** DOUBLINGS[:, None]
    signed = np.concatenate([np.zeros((1, 1)), heights, -heights])
    # what is added to ordinates that are so much larger is rounded
    unseen = np.where(heights[:, 0] > ADDED_SEEN * np.abs(line).max(), 0.0, np.inf)
    found, ends = list[int](), False
    for direction in form.start.bumps:
        y = line.T + (signed * arch)[:, :, None] * direction
        dy = rise.T + (signed * slope)[:, :, None] * direction
        values = _values(form, s, y, dy)
        integrals, sums = (np.einsum("q,aqi->ia", weights, v) for v in (values, np.abs(values)))
        for row, summed in zip(integrals, sums, strict=True):
            for side in (slice(1, len(heights) + 1), slice(len(heights) + 1, None)):
                noise = BEND_SEEN * (summed[side] + np.nan_to_num(summed[0], posinf=0.0)) + unseen
                found += _turns(row[side], float(row[0]), noise)
                ends = ends or not np.isfinite(row[side]).all()
    return _Felt(float(heights[min(found), 0]), float(heights[max(found), 0]), ends) if found else None


def _turns(grown: np.ndarray, flat: float, noise: np.ndarray) -> list[int]:
    """Where an integral (A,) leaves the power with which it grows from ``flat`` at first, and meets its last one.

    Changes below the ``noise`` (A,) are made of rounding. Where the integral ends to be a number it has its last turn.
    """
    change = grown - flat if np.isfinite(flat) else grown
    known = np.isfinite(change) & (np.abs(change) > noise)
    if not known.any():
        return []
    first = int(np.argmax(known))
    ends = np.flatnonzero(~known[first:])
    last = first + int(ends[0]) if len(ends) else len(change)
    powers = np.diff(np.log2(np.abs(change[first:last]))) / OCTAVES
    left = np.flatnonzero(np.abs(powers - powers[0]) > POWER_CHANGED) if len(powers) else []
    short = np.flatnonzero(np.abs(powers - powers[-1]) > POWER_CHANGED) if len(powers) else []
    turns = [first + int(left[0]), first + int(short[-1])] if len(left) and len(short) else []
    return [*turns, last - 1] if len(ends) else turns


def _values(form: Form, s: np.ndarray, y: np.ndarray, dy: np.ndarray) -> np.ndarray:
    """The integrands (A, Q, 1 + m) on curves y and dy (A, Q, n)."""
    count = y.shape[0] * y.shape[1]
    rows = [y.reshape(count, -1), dy.reshape(count, -1)]
    second = np.zeros((1, form.n if form.order == 2 else 0))
    numbers = form.problem.parameter_values[None], form.start.unknowns[None]
    out = _integrands(form)(count, np.tile(s, len(y))[:, None], *rows, second, *numbers)
    return out.reshape(*y.shape[:2], -1)


@derived
def _integrands(form: Form) -> PointEvaluator:
    """The integrand of the functional and those of the levels."""
    rows = [form.integrand, *(c.expression for c in form.conditions.integrals)]
    return PointEvaluator(ca.Function("integrands", form.symbols.all, [ca.densify(ca.vertcat(*rows))]))


def turns_along_lines(y: np.ndarray, values: np.ndarray, unit: float) -> np.ndarray | None:
    """The ordinates at which the ``values`` (R, P) of L turn on R lines; None where no line has two minima.

    On each they are asked at ascending ordinates y (R, P), of which the middle one is the curve's; ``unit`` is theirs.
    Where curves may not go, between two places at which they may, there is a hill.
    """
    turned, banks = _turned(y, values, unit), _banks(y, values)
    if turned is None:
        return banks if len(banks) else None
    return np.concatenate([turned, banks])


def _banks(y: np.ndarray, values: np.ndarray) -> np.ndarray:
    """The ordinates, of those asked, on both sides of where curves may not go between two at which they may."""
    barred = values == np.inf
    open_below = np.logical_or.accumulate(~barred, axis=1)
    open_above = np.logical_or.accumulate(~barred[:, ::-1], axis=1)[:, ::-1]
    island = barred & open_below & open_above
    beside = np.zeros(values.shape, dtype=bool)
    beside[:, :-1] |= island[:, 1:]
    beside[:, 1:] |= island[:, :-1]
    return y[beside & ~barred]


def _turned(y: np.ndarray, values: np.ndarray, unit: float) -> np.ndarray | None:
    """The same without what bars curves."""
    change = np.diff(values)
    told = np.isfinite(change) & (np.abs(change) > NO_CHANGE * (np.abs(values[:, 1:]) + np.abs(values[:, :-1])))
    line, step = np.nonzero(told)
    if not len(line):
        return None
    sign = np.sign(change[line, step])
    first = np.flatnonzero(np.diff(line, prepend=-1))
    last = np.append(first[1:], len(line)) - 1
    # where a hill's foot is flat there is no turn, but it is as low as a minimum
    falls = np.array([sign[first] > 0, sign[last] < 0])
    feet = falls & np.array([step[first] > 0, step[last] < change.shape[1] - 1])
    # what falls on beyond a hill is a valley as well: how deep it is slopes tell, which cost the more
    on = falls & ~feet
    turning = np.flatnonzero((line[1:] == line[:-1]) & (sign[1:] != sign[:-1]))
    minima = np.bincount(line[turning[sign[turning] < 0]], minlength=len(y))[line[first]]
    if not (minima + falls.sum(0) > 1).any():
        return None
    turning = _nearest(turning, line, np.abs(step - change.shape[1] // 2))
    ends = np.zeros((2, len(y)), dtype=int)
    ends[:, line[first]] = step[first], step[last] + 1
    places = line[turning], step[turning] + 1
    swing = _swings(values, *places, ends)
    inner = y[places][swing >= LEAST_SWING * swing[np.isfinite(swing)].max(initial=0.0)]
    # what descends to where curves may not go is lowest there
    at = np.array([step[first], step[last] + 1])
    beyond = np.clip(at + np.array([[-1], [1]]), 0, change.shape[1])
    edges = feet & (values[line[first], beyond] == np.inf)
    centre = y[line[first], change.shape[1] // 2]
    return np.concatenate([inner, y[line[first], at][edges], (centre + unit * np.array([[-1.0], [1.0]]))[on]])


def _nearest(turning: np.ndarray, line: np.ndarray, distance: np.ndarray) -> np.ndarray:
    """Those of the turns, by their numbers, that are the nearest ones of each line."""
    order = turning[np.lexsort((turning, distance[turning], line[turning]))]
    begun = np.searchsorted(line[order], line[order])
    return np.sort(order[np.arange(len(order)) - begun < NEAREST_TURNS])


def _swings(values: np.ndarray, line: np.ndarray, place: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """By how much the values change from each turn of a line to the next, or its ``ends``, the larger of both sides."""
    same = line[1:] == line[:-1]
    before, behind = ends[:, line]
    before[1:][same], behind[:-1][same] = place[:-1][same], place[1:][same]
    own = values[line, place]
    return np.maximum(np.abs(own - values[line, before]), np.abs(values[line, behind] - own))
