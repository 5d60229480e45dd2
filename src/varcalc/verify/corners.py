"""Corners: where the slope jumps, the momentum and the energy must not.

At a corner the curve is free to move in both directions, so L_y' and
L - y' L_y' are the same on either side (Weierstrass and Erdmann; Gelfand and
Fomin, "Calculus of Variations", sect. 15). At a breakpoint of L the abscissa is
given and only the momentum is bound; at a waypoint neither is.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import casadi as ca
import numpy as np

from varcalc.methods.crossings import on_curve, switch_arguments
from varcalc.solution import Finding, Solution, Verdict
from varcalc.verify.along_curve import AlongCurve
from varcalc.verify.candidate import HELD_TO, Candidate
from varcalc.verify.check import Check
from varcalc.verify.residual import FAINT, felt
from varcalc.verify.slopes import BESIDE_VERTEX, slopes_beside

UNBROKEN = 1e-4
"""Relative jump of momentum or energy across a corner that is the error of the curve."""


@dataclass(frozen=True)
class Corner:
    """A corner at abscissa ``at``: jumps of the slope, and of momentum and energy relative to their terms.

    ``energy`` is NaN where the abscissa is not free; ``held`` tells that the
    curve is held there, which takes any jump of the momentum.
    """

    at: float
    slope: float
    momentum: float
    energy: float
    held: bool


@dataclass(frozen=True)
class Corners(Check[list[Corner]]):
    """Whether momentum and energy are the same on both sides of every corner."""

    name = "corners"

    def measure(self, candidate: Candidate) -> list[Corner]:
        """The extremal's own corners: a kink that polishing has smoothed was the error of the curve."""
        polished = candidate.best is not None and not candidate.reason
        found = [] if candidate.touched else corners(candidate.along, partial(_pace_of_jump, candidate.solution))
        return [corner for corner in found if not polished or corner.held or math.isnan(corner.energy)]

    def findings(self, candidate: Candidate) -> Iterator[Finding]:
        """What holds at each."""
        for corner in candidate.measured(self):
            numbers = {"at": corner.at, "slope": corner.slope, "momentum": corner.momentum, "energy": corner.energy}
            jump = max(corner.momentum, 0.0 if math.isnan(corner.energy) else corner.energy)
            place = f"at the corner at {corner.at:.8g}, where the slope jumps by {corner.slope:.4g},"
            conditions = f"{place} Weierstrass's and Erdmann's conditions"
            if corner.held:
                yield Finding(None, f"{place} the curve is held, so its momentum may jump", numbers)
            elif jump <= UNBROKEN:
                yield Finding(None, f"{conditions} hold to {jump:.2g}", numbers)
            else:
                sentence = f"{conditions} fail by {jump:.2g}: moving the corner does better"
                yield Finding(Verdict.NO_EXTREMAL, sentence, numbers)


def corners(along: AlongCurve, pace_of_jump: Callable[[float], float | None] = lambda _: None) -> list[Corner]:
    """The corners of a curve of first order at its inner vertices.

    Where it meets a jump of L, which has a pace there, its momentum may jump, and the energy is that seen from there.
    """
    changed = along.form.lift is not None and not along.slides  # such coordinates are smooth, as is the curve in them
    if along.order != 1 or len(along.vertices) < 3 or changed:
        return []
    inner = along.vertices[1:-1]
    v = along.symbols.dy
    H, momentum = along.whole.expression, along.whole.partial(1)
    uncancelled = FAINT * felt(along)
    function = along.function(
        momentum, H - ca.dot(v, momentum),
        ca.fabs(H) + ca.fabs(ca.dot(v, momentum)) + ca.dot(ca.fabs(v), uncancelled), uncancelled,
    )  # fmt: skip
    beside = slopes_beside(along.evaluate, along.vertices, inner)
    left, right = function(beside.left), function(beside.right)
    found = []
    for k in np.flatnonzero(beside.jump.any(0)):
        at, jump = float(inner[k]), float(np.abs(beside.after[:, k] - beside.before[:, k]).max())
        size = max(float(np.abs([side[term][k] for side in (left, right) for term in (0, 3)]).max()), 1e-300)
        energy = abs(float((right[1] - left[1])[k].item())) / max(float((left[2] + right[2])[k].item()), 1e-300)
        given = at in along.form.conditions.knots
        held = bool(np.any(np.abs(np.array(along.held) - at) <= BESIDE_VERTEX * along.length))
        momentum_jump = float(np.abs(right[0][k] - left[0][k]).max()) / size
        if not given and (pace := pace_of_jump(at)) is not None:
            seen = [side[1][k] + pace * side[0][k] for side in (left, right)]
            energy, momentum_jump = abs(float((seen[1] - seen[0]).item())) / float((left[2] + right[2])[k].item()), 0.0
        found.append(Corner(at, jump, momentum_jump, float("nan") if given else energy, held))
    return found


def _pace_of_jump(solution: Solution, at: float) -> float | None:
    """How fast the surface moves on which L of one function jumps where a curve is; None where it is on none."""
    problem, curve = solution.problem, solution.curve
    jumps = [k for k, switch in enumerate(on_curve(problem)) if switch.jumps and not switch.stepped]
    if problem.n > 1 or curve is None or not jumps:
        return None
    s, x = problem.symbols, np.append(np.unique(solution.x), at)
    unknowns = solution.unknown_values
    values = np.abs(switch_arguments(problem, curve, x, unknowns))[jumps]
    met = np.flatnonzero(values[:, -1] <= HELD_TO * values.max(1))
    if not len(met):
        return None
    argument = on_curve(problem)[jumps[int(met[0])]].argument
    pace = ca.Function(
        "pace", [s.x, s.y, s.parameters, s.unknowns], [-ca.gradient(argument, s.x) / ca.gradient(argument, s.y)]
    )
    return float(pace(at, curve(x[-1:], 0)[:, 0], problem.parameter_values, unknowns))
