"""Bodies that come to rest beside a jump, on a kink of the slope as well, or at a bound, and set out again.

L = v^2/2 + m |v| + V(y), and V has its least value V_r where the body rests. Then L - V_r is at least
|v| sqrt(2 (V - V_r)) + m |v| on any curve, with equality where v^2/2 = V - V_r: that curve is the least one, and its
value V_r T plus what the ways to the rest and from it sum to.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

import varcalc as vc
from campaigns.least import Least
from campaigns.statement import Integrand, Statement


def roughness(random: np.random.Generator) -> float:
    """The friction m, none now and then."""
    return float(random.choice([0.0, random.uniform(0.05, 1.0)]))


def at_rest(
    random: np.random.Generator, L: Integrand, ends: tuple[float, float | None], level: float, rough: float,
    pull: float, way: Callable[[float], tuple[float, float]], constraints: tuple[vc.Bound, ...] = (),
) -> Statement:  # fmt: skip
    """A body at rest on the ``level`` V_r between ways from and to the ends, the second one free where it is None.

    A ``way`` of an end is the time that it takes, and the integral of the speed over y. Friction lets the body set out
    once the momentum has turned, at the rate of the ``pull`` at most.
    """
    known = [way(y) for y in ends if y is not None]
    turning = rough * len(known) / pull
    length = sum(time for time, _ in known) + (1 + random.uniform(0.1, 2)) * max(turning, 0.3)
    value = level * length + sum(summed for _, summed in known)
    return Statement(L, (0.0, ends[0]), (length, ends[1]), Least(value), constraints)


def heights(random: np.random.Generator) -> tuple[float, float | None]:
    """How far the ends are from where the body rests, or nothing for a free one."""
    return float(10 ** random.uniform(-1.5, 0.3)), (
        None if random.uniform() < 0.4 else float(10 ** random.uniform(-1.5, 0.3))
    )


def ledges(random: np.random.Generator) -> Statement:
    """A weight g y above a wall where V jumps up, and on the way there, now and then, a ledge of another height."""
    pull, rough, higher = random.uniform(0.5, 3), roughness(random), 10 ** random.uniform(0, 1.5)
    drop, deep = (random.uniform(0.2, 2), random.uniform(0.1, 0.8)) if random.uniform() < 0.5 else (0.0, 0.0)
    level = -pull * deep - drop

    def L(x: Any, y: Any, v: Any) -> Any:
        friction = rough * ca.fabs(v) if rough else 0.0
        above = pull * y - (ca.if_else(y < 0, drop, 0) if drop else 0)
        return v**2 / 2 + friction + ca.if_else(y < -deep, level + higher, above)

    def way(y: float) -> tuple[float, float]:
        speeds = np.sqrt(2 * np.array([pull * y - level, -level, pull * deep]))
        time = (speeds[0] - speeds[1] + speeds[2]) / pull
        return float(time), float((speeds[0] ** 3 - speeds[1] ** 3 + speeds[2] ** 3) / (3 * pull) + rough * (y + deep))

    return at_rest(random, L, heights(random), level, rough, pull, way)


def stops(random: np.random.Generator) -> Statement:
    """A body that is pushed up against a bound, and rests there."""
    pull, rough, top = random.uniform(0.5, 3), roughness(random), random.uniform(-1, 1)
    below, other = heights(random)

    def L(x: Any, y: Any, v: Any) -> Any:
        return v**2 / 2 + (rough * ca.fabs(v) if rough else 0.0) - pull * y

    def way(y: float) -> tuple[float, float]:
        speed = np.sqrt(2 * pull * (top - y))
        return float(speed / pull), float(speed**3 / (3 * pull) + rough * (top - y))

    ends = top - below, None if other is None else top - other
    bound = vc.Bound(lambda x, y, v: y, upper=top)
    return at_rest(random, L, ends, -pull * top, rough, pull, way, (bound,))
