"""Which way kinks point: no minimum follows one that points up.

Where L has a kink in the highest derivative with a maximum there, both sides are lower. Across a kink of the place L_y
jumps and L_v does not; a curve along it is least only if the first variation is positive on the side where the argument
grows and negative on the other, so that L_y must rise.
"""

from __future__ import annotations

import math

import casadi as ca
import numpy as np

from varcalc.methods.crossings import Crossing
from varcalc.numerics.mesh import CurveOrSlope
from varcalc.problem.breaks import integrals
from varcalc.problem.problem import Problem

BESIDE_KINK = 1e-3
"""Change of the highest derivative, in units of 1 and of its own, over which it is seen which way a kink points."""
BESIDE_PLACE, STILL_NEARER = 1e-8, 16.0
"""Of the largest ordinate: how far off a kink of the place that is seen, and how many times nearer again."""
STILL_JUMPS = 4.0
"""What changes as much but for this factor so much nearer jumps; what is smooth changes less, by as much as that is."""
PLACES_ALONG_KINK, STEPS_ONTO = 33, 8
"""Places along a curve from which Newton's steps may lead onto a kink, and how many steps."""


def points_up(problem: Problem, curve: CurveOrSlope, crossing: Crossing) -> bool:
    """Whether L has a maximum at the kink that a curve meets: across it L_v, or L_y, falls."""
    if not crossing.switch.depends_on(problem.symbols.highest):
        return not crossing.switch.jumps and _of_place(problem, curve, crossing)
    return _of_slope(problem, curve, crossing)


def _of_slope(problem: Problem, curve: CurveOrSlope, crossing: Crossing) -> bool:
    """The same of a kink of the highest derivative."""
    s = problem.symbols
    x = np.array([crossing.x if crossing.until is None else 0.5 * (crossing.x + crossing.until)])
    derivatives = [curve(x, k)[:, 0] for k in range(1 + problem.order)]
    lower, highest = derivatives[:-1], derivatives[-1]
    switch = crossing.switch.argument - crossing.level
    function = ca.Function("switch", s.all, [switch, ca.jacobian(switch, s.highest)])
    bends = highest if problem.order == 2 else np.zeros(0)
    at, rate = function(x, *derivatives[:2], bends, problem.parameter_values, problem.unknown_guesses)
    rates = np.asarray(rate)[0]
    size = float(rates @ rates)
    if not size > 0.0:
        return False
    onto, along = highest - float(at) * rates / size, rates / np.sqrt(size)
    step = BESIDE_KINK * max(1.0, float(np.abs(highest).max()))
    beside = (onto + step * np.array([[-1.0], [0.0], [1.0]]) * along).T
    points = [np.repeat(v[:, None], 3, axis=1) for v in lower] + [beside]
    bent = points[2] if problem.order == 2 else None
    left, here, right = problem.sign * problem.integrand_values(np.repeat(x, 3), points[0], points[1], ddy=bent)
    return bool(left + right - 2 * here < 0.0)


def _of_place(problem: Problem, curve: CurveOrSlope, crossing: Crossing) -> bool:
    """The same of a kink of the place; False where a level weighs it by what is not known yet."""
    argument, numbers = crossing.switch.argument - crossing.level, problem.unknown_guesses
    function = ca.Function("across", problem.symbols.all, [argument, ca.gradient(argument, problem.symbols.y)])

    def given(x: float) -> list[np.ndarray]:
        slopes = [curve(np.array([x]), k)[:, 0] for k in range(1, 1 + problem.order)]
        return [*slopes, *([np.zeros(0)] if problem.order == 1 else []), problem.parameter_values, numbers]

    def across(x: float, y: np.ndarray) -> tuple[float, np.ndarray]:
        """How far off the kink a place is, to first order, and the direction."""
        at, rates = (np.asarray(r)[:, 0] for r in function(x, y, *given(x)))
        size = float(np.linalg.norm(rates))
        return (at[0] / size, rates / size) if size > 0.0 else (math.inf, rates)

    way = np.linspace(crossing.x, crossing.x if crossing.until is None else crossing.until, PLACES_ALONG_KINK)
    ordinates = curve(way, 0)
    # where it is nearest to the kink: half way a curve may be in a valley beyond
    nearest = min(range(PLACES_ALONG_KINK), key=lambda k: abs(across(way[k], ordinates[:, k])[0]))
    x, y, step = way[nearest], ordinates[:, nearest], BESIDE_PLACE * float(np.abs(ordinates).max())
    off, along = across(x, y)
    for _ in range(STEPS_ONTO):
        if not math.isfinite(off):
            return False
        y = y - off * along
        off, along = across(x, y)
    if not abs(off) <= step / STILL_NEARER:
        return False
    symbols = problem.symbols.all
    rates = [ca.jtimes(f, problem.symbols.y, ca.DM(along)) for f in integrals(problem).call(symbols)]
    slope = ca.Function("slope", symbols, [ca.vertcat(*rates)])

    def jump(off: float) -> np.ndarray:
        """The difference of L_y, and of what levels are stated with, on the two sides."""
        after, before = (np.asarray(slope(x, y + side * along, *given(x)))[:, 0] for side in (off, -off))
        return after - before

    far, near = jump(step), jump(step / STILL_NEARER)
    jumps = np.abs(near) * STILL_JUMPS > np.abs(far)
    return bool(jumps[0] and problem.sign * near[0] < 0 and not np.any(jumps[1:] & (near[1:] != 0)))
