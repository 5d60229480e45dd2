"""Where a curve meets what switches on it: kinks and jumps of the Lagrangian in y, in (x, y) or in the slope.

The equations that methods solve hold on either side of a switch, not across it: there momenta and energy obey
Weierstrass and Erdmann's conditions of refraction. A curve whose mesh does not know of a crossing is no answer.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import casadi as ca
import numpy as np

from varcalc.numerics.mesh import CurveOrSlope
from varcalc.numerics.runs import runs
from varcalc.problem.breaks import on_curve
from varcalc.problem.functional import Functional, arguments_along, arguments_at
from varcalc.problem.reading import names, text
from varcalc.solution import Solution
from varcalc.symbolic.derived import derived
from varcalc.symbolic.switches import Switch, units

AN_ELEMENT = 0.5 - 0.5 * np.cos(np.pi * np.arange(1, 16) / 16)
"""Places in an element at which the switches are looked at, besides its ends."""
ARGUMENT_ROUND_OFF = 1e-11
"""Size of a switch's argument, in units of its own along the curve, that counts as zero."""
MAY_CANCEL = 1e-8
"""Size of an argument, in units of the curve's, below which it may be round-off of what cancels all along."""
MADE_OUT = 1e-9
"""Distance, relative to the interval, within which a crossing is at a vertex that the mesh was given for it."""
MOST_LEVELS = 64
"""Whole numbers that are looked for along a curve: one that meets so many is not treated."""
RIDDEN = 1e-3
"""Share of the interval along which an argument is zero, and not at a point."""
WAVERING = 30.0
"""Argument, in units of what counts as zero, up to which a curve comes back to a kink that it follows."""
STRAIGHT = 0.6
"""Pace in the middle of where an argument is small, in units of what takes it straight through, that is as good."""
LEFT_BEHIND = 0.125
"""Share of what counts as zero to which the last place before it is left shows more of what goes straight away."""
MOST_PLACED = 6
"""Switches of the place whose ordinates are looked for."""
STEPS_ONTO_SWITCH, BESIDE_SWITCH = 8, 1e-9
"""Steps of Newton's method to one, and how near, in units of the ordinate and the interval, it comes to it."""
HALVINGS = 42
"""Times that the stretch in which a crossing was seen is halved: to a part in 1e12 of an element."""
FEWEST_AT_ONCE, MOST_AT_ONCE = 3, 7
"""Halvings made by one look at evenly spread places: few looks at few crossings, few places at many."""
PLACES_A_LOOK = 2048
"""Places at which all crossings together are looked at, about."""


@dataclass(frozen=True)
class Crossing:
    """Where a curve goes from one side of a switch to the other, or, with an ``until``, follows it."""

    switch: Switch
    x: float
    level: float = 0.0
    until: float | None = None


@derived
def _arguments(problem: Functional) -> ca.Function:
    s = problem.symbols
    found = [ca.densify(switch.argument) for switch in on_curve(problem)]
    return ca.Function("arguments", s.all, [ca.vertcat(*found)])


def switch_arguments(problem: Functional, curve: CurveOrSlope, x: np.ndarray, unknowns: np.ndarray) -> np.ndarray:
    """What decides each switch of ``on_curve``, at abscissae x (m,) of a curve; shape (switches, m)."""
    with np.errstate(all="ignore"):
        return np.asarray(_arguments(problem)(*arguments_along(problem, curve, x, unknowns))).reshape(-1, len(x))


def crossings(
    problem: Functional,
    curve: CurveOrSlope,
    nodes: np.ndarray,
    unknowns: np.ndarray,
    small: float = ARGUMENT_ROUND_OFF,
    sizes: np.ndarray | None = None,
) -> list[Crossing]:
    """All crossings of a curve, seen at points of the elements between ``nodes``, in their order along it.

    An argument so ``small``, in ``sizes`` (by switch; else its own along the curve), counts as zero.
    """
    switched = on_curve(problem)
    if not switched:
        return []
    nodes = np.unique(nodes)
    x = np.unique(np.concatenate([nodes, (nodes[:-1, None] + np.diff(nodes)[:, None] * AN_ELEMENT).ravel()]))

    def arguments(at: np.ndarray) -> np.ndarray:
        return switch_arguments(problem, curve, at, unknowns)

    found: list[Crossing] = []
    for k, (switch, values) in enumerate(zip(switched, arguments(x), strict=True)):
        size = _size(problem, switch, values, curve, x, unknowns) if sizes is None else float(sizes[k])
        for end, at_end in ((problem.start, 0), (problem.end, -1)):
            # what is asked at a free end is asked on the switch itself
            if np.isnan(end.values(problem.n)).any() and not end.periodic and abs(values[at_end]) <= small * size:
                found.append(Crossing(switch, float(x[at_end])))
        signs = np.where(np.abs(values) <= small * size, 0.0, np.sign(values))
        # on which side of a jump the curve ends is known, however near to it that is
        sure = np.array([0, -1])[np.abs(values[[0, -1]]) > ARGUMENT_ROUND_OFF * size]
        signs[sure] = np.sign(values[sure]) if switch.jumps else signs[sure]
        ends = not problem.start.periodic
        ridden = not switch.smooth and (not switch.jumps or switch.depends_on(problem.symbols.highest))
        found += _to_corners(
            _of_one(switch, x, values, signs, small * size, lambda at, k=k: arguments(at)[k], ends=ends, ridden=ridden),
            x,
            nodes,
        )
    return sorted(found, key=lambda c: c.x)


def _size(
    problem: Functional, switch: Switch, values: np.ndarray, curve: CurveOrSlope,
    x: np.ndarray, unknowns: np.ndarray,
) -> float:  # fmt: skip
    """How large an argument is along a curve, by its ``values`` at x (m,); where these are round-off, its terms."""
    largest = float(np.nanmax(np.abs(values), initial=0.0))
    points = [[x], list(curve(x, 0)), list(curve(x, 1)), list(curve(x, 2)) if problem.order == 2 else []]
    scale = max(float(np.abs(row).max()) for rows in points for row in rows)
    if largest < MAY_CANCEL * scale:
        numbers = [[np.array(v) for v in row] for row in (problem.parameter_values, unknowns)]
        largest = max(largest, units([switch.argument], problem.symbols.all, [*points, *numbers])[0][0])
    return max(largest, 1e-300)


@derived
def _placed_jumps(problem: Functional) -> tuple[Switch, ...]:
    """The jumps of ``on_curve`` that do not feel the slope, if they are few."""
    slopes = ca.vertcat(*problem.symbols.slopes)
    found = [s for s in on_curve(problem) if s.jumps and not s.stepped and not s.depends_on(slopes)]
    return tuple(found) if len(found) <= MOST_PLACED and not any(problem.slides) else ()


@derived
def _onto(problem: Functional) -> ca.Function:
    """Newton's step in y to each of them: where it leads."""
    s = problem.symbols
    steps = [s.y - (w.argument - w.levels[0]) / ca.gradient(w.argument, s.y) for w in _placed_jumps(problem)]
    return ca.Function("onto", s.all, [ca.densify(ca.vertcat(*steps))])


def beside_jumps(problem: Functional, x: np.ndarray, y: np.ndarray) -> list[np.ndarray]:
    """Ordinates (m,) just beside those at which L of one function jumps, on either side, from y (m,)."""
    jumps = _placed_jumps(problem)
    found: list[np.ndarray] = []
    with np.errstate(all="ignore"):
        for k in range(len(jumps)):
            at, last = y, y
            for _ in range(STEPS_ONTO_SWITCH):
                at, last = np.asarray(_onto(problem)(*arguments_at(problem, x, at[None], 0 * at[None])))[k], at
            unit = np.maximum(np.abs(at), np.ptp(x))
            known = np.isfinite(at) & (np.abs(at - last) <= BESIDE_SWITCH * unit)
            found += [np.where(known, at + way * 2 * BESIDE_SWITCH * unit, y) for way in (-1, 1) if known.any()]
    return found


def met_by(solution: Solution, small: float = ARGUMENT_ROUND_OFF) -> list[Crossing]:
    """The switches that a solution's curve meets."""
    if solution.curve is None or not on_curve(solution.problem):
        return []
    numbers = solution.unknown_values
    return crossings(solution.problem, solution.curve, solution.x, numbers, small)


def stretches_beside_jumps(solution: Solution, small: float) -> list[tuple[float, float]]:
    """Where a solution's curve runs beside a jump of its place: what lies beyond holds it there, as a wall does.

    The argument is as ``small`` there, in units of its size along the curve.
    """
    problem, curve = solution.problem, solution.curve
    if curve is None or not any(s.jumps and not s.stepped for s in on_curve(problem)):
        return []
    nodes = np.unique(solution.x)
    x = np.unique(np.concatenate([nodes, (nodes[:-1, None] + np.diff(nodes)[:, None] * AN_ELEMENT).ravel()]))
    values = np.abs(switch_arguments(problem, curve, x, solution.unknown_values))
    found: list[tuple[float, float]] = []
    for switch, row in zip(on_curve(problem), values, strict=True):
        near = runs(row <= small * np.nanmax(row, initial=0.0)) if switch.jumps and not switch.stepped else []
        found += [(float(x[a]), float(x[b])) for a, b in near if x[b] - x[a] > RIDDEN * (x[-1] - x[0])]
    return found


def _to_corners(found: list[Crossing], x: np.ndarray, nodes: np.ndarray) -> list[Crossing]:
    """The crossings, those that are followed as far as the vertex next to the last place that shows it.

    At a vertex a curve has the slope of one side, which may be another than that which it keeps on the other.
    """
    out: list[Crossing] = []
    for c in found:
        if c.until is None:
            out.append(c)
            continue
        before, after = x[max(np.searchsorted(x, c.x) - 1, 0)], x[min(np.searchsorted(x, c.until) + 1, len(x) - 1)]
        beside = [(float(at), end) for at, end in ((before, c.x), (after, c.until))]
        first, last = (at if at in nodes and end not in nodes else end for at, end in beside)
        out.append(replace(c, x=first, until=last))
    return out


def _of_one(
    switch: Switch, x: np.ndarray, values: np.ndarray, signs: np.ndarray, small: float,
    at: Callable[[np.ndarray], np.ndarray], *, ends: bool, ridden: bool,
) -> list[Crossing]:  # fmt: skip
    """Those of one switch, along a curve that ``ends`` or is closed."""
    side = np.floor(values + small) if switch.stepped else signs
    found: list[Crossing] = []
    still = [] if switch.stepped else runs(_joined(side == 0.0, np.abs(values) <= WAVERING * small))
    for a, b in still:
        long = x[b] - x[a] > RIDDEN * (x[-1] - x[0])
        # a curve that begins or ends beside a switch goes from there, straight, to one side
        at_one_end = ends and (a > 0) != (b < len(x) - 1)
        there = max(abs(float(values[b]) - float(values[a])), LEFT_BEHIND * small)
        across = there if at_one_end else 2 * small
        if long and ridden and _lingers(values[a : b + 1], x[a : b + 1], across):
            found.append(Crossing(switch, float(x[a]), until=float(x[b])))
    told = np.isfinite(side)  # off the domain of what switches there is no side
    known = np.flatnonzero(told & (side != 0.0)) if not switch.stepped else np.flatnonzero(told)
    between: list[tuple[float, float, float]] = []
    for i, j in pairwise(known.tolist()):
        if side[i] == side[j] or any(c.x <= x[j] and x[i] <= c.until for c in found if c.until is not None):
            continue
        low, high = sorted((int(side[i]), int(side[j])))
        levels = range(low + 1, high + 1)[: max(MOST_LEVELS - len(between), 0)] if switch.stepped else (0,)
        between += [(float(level), float(x[i]), float(x[j])) for level in levels]
    if between:
        places = _placed(at, *np.array(between).T)
        found += [Crossing(switch, place, level) for place, (level, *_) in zip(places.tolist(), between, strict=True)]
    return found


def _joined(still: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Where (m,) an argument is zero, with what lies between if that is ``near`` zero throughout."""
    out = still.copy()
    for i, j in pairwise(np.flatnonzero(still).tolist()):
        out[i:j] |= near[i:j].all()
    return out


def _lingers(values: np.ndarray, x: np.ndarray, across: float) -> bool:
    """Whether an argument goes along zero rather than straight ``across`` what counts as zero."""
    if len(x) < 3:
        return False
    inner = slice(len(x) // 4, max(len(x) // 4 + 2, len(x) - len(x) // 4))
    pace = np.ptp(values[inner]) / np.ptp(x[inner]) * np.ptp(x)
    return bool(pace < STRAIGHT * across)


def _placed(
    at: Callable[[np.ndarray], np.ndarray], levels: np.ndarray, low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """Where the argument meets each of the ``levels`` (m,), between abscissae (m,): looks at all of them at once.

    An argument that comes up to a level, but for round-off, and not beyond it meets that where it is nearest.
    """
    each = np.arange(len(levels))
    at_once = min(max((PLACES_A_LOOK // len(levels)).bit_length() - 1, FEWEST_AT_ONCE), MOST_AT_ONCE)
    for _ in range(-(-HALVINGS // at_once)):
        x = np.linspace(low, high, 2**at_once + 1, axis=1)
        off = at(x.ravel()).reshape(x.shape) - levels[:, None]
        changes = (off[:, 1:] > 0.0) != (off[:, :-1] > 0.0)
        met, change, nearest = changes.any(axis=1), np.argmax(changes, axis=1), np.argmin(np.abs(off), axis=1)
        low, high = x[each, np.where(met, change, nearest)], x[each, np.where(met, change + 1, nearest)]
    return 0.5 * (low + high)


def unmet(problem: Functional, found: list[Crossing], knots: np.ndarray) -> list[Crossing]:
    """The crossings at which there is no vertex of those that a mesh was given for such places."""
    room = MADE_OUT * (problem.span[1] - problem.span[0])

    def missed(c: Crossing) -> bool:
        """Whether the mesh knew nothing of a crossing."""
        if c.until is None or c.switch.depends_on(problem.symbols.highest):
            return not all(np.any(np.abs(knots - x) <= room) for x in (c.x, c.until) if x is not None)
        # a curve leaves a kink of its place slowly, and is on it for a while beyond the vertices
        return bool(np.count_nonzero((knots >= c.x - room) & (knots <= c.until + room)) < 2)

    return [c for c in found if missed(c)]


def sentence(problem: Functional, crossing: Crossing) -> str:
    """What was seen, in the user's words."""
    until = "" if crossing.until is None else f", and follows it to {crossing.until:.6g}"
    return (
        f"the problem has {described(problem, crossing.switch)}, and the curve meets it at x = {crossing.x:.6g}{until}"
    )


def described(problem: Functional, switch: Switch) -> str:
    """What switches, and where, in the user's words."""
    what = "a jump" if switch.jumps else "a kink"
    level = "a whole number" if switch.stepped else "0"
    return f"{what} ({switch.word}) where {text(switch.argument, names(problem))} = {level}"
