"""Functionals without a lower bound, shown by curves along which they fall for ever.

A functional is unbounded when it falls at least linearly along some straight
line of admissible curves. The lines tried lead from a starting curve into the
directions of least curvature of the functional and into its lowest modes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from varcalc.formulation import Form, formulate
from varcalc.methods.ritz.method import Rungs
from varcalc.methods.ritz.newton import Newton
from varcalc.methods.ritz.system import RitzSystem
from varcalc.numerics.mesh import gauss
from varcalc.problem.functional import Functional
from varcalc.problem.problem import Problem
from varcalc.solution import Finding, Verdict

if TYPE_CHECKING:
    from varcalc.existence.landscape import Landscape

LINE_DEGREE = 12
LINE_POINTS = 8
"""Gauss points on a piece of a polygon."""
LEAST_CURVED = 3
"""Directions of least curvature, and modes, that are tried both ways."""
DISTANCE_DOUBLINGS = 40
DOUBLINGS_FALLING = 5
"""Doublings of the distance over which the functional must keep falling."""
NEAREST = 1e-6
"""Distance, in units of the problem's size, from which the doubling starts."""
FALL_RESOLVED = 1e-10
"""Least fall relative to what is summed: less is made of round-off."""
DEEP_FALL = 1e3
"""How far below its first size a functional has to fall."""
DEEPENING = 1.5
"""Factor by which each doubling must deepen the fall: 2 for a linear one."""
OVERFLOWING = 1e100
"""What is summed from which on a value that is no number is one too large for a double."""


@dataclass(frozen=True)
class Fall:
    """Values of the functional (with the person's sign) at growing distances along one line of curves."""

    distances: np.ndarray
    values: np.ndarray

    @property
    def finding(self) -> Finding:
        """What the line shows."""
        side = "above" if self.values[-1] > self.values[0] else "below"
        sentence = (
            f"the functional is unbounded {side}: along a straight line of admissible curves it reaches "
            f"{self.values[0]:.3g} at a distance of {self.distances[0]:.3g} and {self.values[-1]:.3g} at "
            f"{self.distances[-1]:.3g}, and goes on"
        )
        numbers = {"distance": float(self.distances[-1]), "value": float(self.values[-1])}
        return Finding(Verdict.UNBOUNDED, sentence, numbers)


def falling(problem: Functional) -> Fall | None:
    """A line of admissible curves along which the functional has no bound; None when none was found.

    Problems with constraints, of which a line of curves keeps none in general,
    are not looked at.
    """
    if problem.constraints or not isinstance(problem, Problem):
        return None
    form = formulate(problem)
    rungs = Rungs(form, Newton(), 1)
    system = rungs.system(rungs.first_space(1, LINE_DEGREE))
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        start = next((z for z in rungs.candidates(system, None) if np.isfinite(system.evaluate(z).value)), None)
        if start is None or form.ends.joint is not None:
            return None
        for direction in _directions(system, start):
            for sign in (1.0, -1.0):
                fall = _along(form, system, start, sign * direction)
                if fall is not None:
                    return fall
    return None


def falls_along(landscape: Landscape, x: np.ndarray, y: np.ndarray, away: np.ndarray) -> Fall | None:
    """The line of polygons y + t ``away`` on vertices x (m,), of one function, where it leads down for ever."""
    nodes, weights = gauss(LINE_POINTS)
    steps = np.diff(x)
    share = 0.5 * (1 + nodes)
    s = x[:-1, None] + steps[:, None] * share

    def between(v: np.ndarray) -> np.ndarray:
        return v[:-1, None] + np.diff(v)[:, None] * share

    far = np.concatenate([[0.0], 2.0 ** np.arange(-DOUBLINGS_FALLING, 1)])[:, None, None]
    slopes = (np.diff(y) / steps)[:, None] + far * (np.diff(away) / steps)[:, None]
    with np.errstate(all="ignore"):
        values = landscape.values(s, between(y) + far * between(away), slopes)
        sums = np.einsum("tkq,k,q->t", np.broadcast_to(values, (len(far), *s.shape)), 0.5 * steps, weights)
        sums = sums + sum(landscape.at_end(side, y[-side] + far[:, 0, 0] * away[-side]) for side in (0, 1))
    return falling_on(sums[0], sums[2:], float(np.abs(away).max()) * far[2:, 0, 0], landscape.sign)


def falling_on(own: float, sums: np.ndarray, distances: np.ndarray, sign: float) -> Fall | None:
    """The fall from what is summed at first, ``own``, to ``sums`` at distances that double, where it leads on so.

    The ``sign`` is -1 where the functional is maximised.
    """
    with np.errstate(all="ignore"):
        falls = sums - own
        deepens = bool(np.all((falls[1:] <= DEEPENING * falls[:-1]) | (falls[1:] == -np.inf)))
    if not math.isfinite(own) or not deepens or not falls[-1] < -DEEP_FALL * (abs(own) + abs(falls[0]) * 1e-3):
        return None
    return Fall(distances, sign * sums)


def _directions(system: RitzSystem, start: np.ndarray) -> list[np.ndarray]:
    """Each unknown number, and the directions of least curvature in the H^1 (H^2) metric at the start.

    They are of unit size along the curve; one that moves unknown numbers alone is of unit size in them.
    """
    at = system.evaluate(start)
    hessian, metric = system.hessian(at, np.zeros(0)), system.metric(at)
    if not (np.isfinite(hessian).all() and np.isfinite(metric).all()):
        return []
    try:
        factor = np.linalg.inv(np.linalg.cholesky(metric))
    except np.linalg.LinAlgError:
        return []
    vectors = factor.T @ np.linalg.eigh(factor @ hessian @ factor.T)[1][:, :LEAST_CURVED]
    moved = (float(np.abs(system.ordinates(start + v) - system.ordinates(start)).max()) for v in vectors.T)
    sizes = [size or float(np.abs(v).max()) for size, v in zip(moved, vectors.T, strict=True)]
    numbers = list(np.eye(len(start))[len(start) - system.extra :])
    return [*numbers, *(v / size for v, size in zip(vectors.T, sizes, strict=True) if size > 0)]


def _along(form: Form, system: RitzSystem, start: np.ndarray, direction: np.ndarray) -> Fall | None:
    """The values along a line, when each doubling of the distance deepens the fall."""
    size = NEAREST * max(float(np.abs(system.ordinates(start)).max()), form.span[1] - form.span[0])
    first = system.evaluate(start)
    moves = not np.array_equal(system.ordinates(start + direction), system.ordinates(start))
    rows = []
    for k in range(DISTANCE_DOUBLINGS):
        distance = size * 2.0**k
        at = system.evaluate(start + distance * direction)
        if not np.isfinite(at.value):
            if rows and rows[-1][2] < OVERFLOWING:
                return None  # L is not defined further on, as sqrt(1 - v^2) is not: nothing goes on there
            break
        if moves and at.legendre * first.legendre < 0:
            return None  # where a curve changes Legendre's sign L is another functional beyond, as area is for y < 0
        rows.append((distance, at.value - first.value, at.scale))
    # the far end decides, near the start the functional may rise first; but not where round-off is all there is
    resolved = [row for row in rows if abs(row[1]) > FALL_RESOLVED * row[2]]
    distances, falls, scales = np.array(resolved[-DOUBLINGS_FALLING:]).reshape(-1, 3).T
    real = (
        len(falls) == DOUBLINGS_FALLING
        and bool(np.all(falls < -FALL_RESOLVED * scales))
        and falls[-1] < -DEEP_FALL * first.scale
    )
    if not real or np.any(falls[1:] > DEEPENING * falls[:-1]):
        return None
    return Fall(distances, form.sign * (first.value + falls))
