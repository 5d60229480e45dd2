"""SciPy's solve_bvp on the Euler-Lagrange equation (graphs) or Pontryagin's conditions (descents).

The equation is derived outside the clock: a person would do that on paper.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np
from scipy.integrate import solve_bvp

from peers.adapter import Adapter, NotSolvedError
from tasks import GRAVITY, TASKS, Descent, Graph, Task
from varcalc.symbolic.evaluation import PointEvaluator

NODES = 10000
"""Nodes after which solve_bvp gives up; a step there takes seconds."""


@lru_cache(maxsize=16)
def acceleration(name: str) -> Any:
    """(x, y, y', multiplier) to y'', the cost and the held integrand, for a task by its name: NumPy on all nodes."""
    task = TASKS[name](1.0)
    assert isinstance(task, Graph)
    x, y, u, k = (ca.SX.sym(letter) for letter in "xyuk")
    held = task.held(ca, x, y, u) if task.held is not None else ca.SX(0)
    cost = task.cost(ca, x, y, u)
    total = cost + k * held
    slope = ca.gradient(total, u)
    second = ca.gradient(total, y) - ca.gradient(slope, x) - u * ca.gradient(slope, y)
    results = [ca.densify(e) for e in (second / ca.gradient(slope, u), cost, held)]
    return PointEvaluator(ca.Function("second", [x, y, u, k], results)).columns


def build(task: Task, tolerance: float) -> Any:
    """The arguments of solve_bvp, and where the value stands in its answer."""
    return graph(task, tolerance) if isinstance(task, Graph) else descent(task, tolerance)


def graph(task: Graph, tolerance: float) -> Any:
    """y, y', the integral, and where a level is held the integral held with its multiplier as parameter."""
    second, levelled = acceleration(task.name), task.held is not None

    def rates(x: np.ndarray, s: np.ndarray, p: Any = None) -> np.ndarray:
        k = np.full(x.size, p[0]) if levelled else np.zeros(x.size)
        found = second(x, s[0], s[1], k)
        return np.array([s[1], *(v + np.zeros_like(x) for v in found[: 3 if levelled else 2])])

    def ends(a: np.ndarray, b: np.ndarray, p: Any = None) -> np.ndarray:
        known = [a[0] - task.start[1], b[0] - task.end[1], a[2]]
        return np.array([*known, a[3], b[3] - task.level] if levelled else known)

    x = np.linspace(task.start[0], task.end[0], 11)
    y = task.line(x)
    slope = np.gradient(y, x)
    along = np.linspace(0, 1, x.size)
    guess = np.vstack([y, slope, along * task.exact, *([along * task.level] if levelled else [])])
    options = {"p": [0.3 if task.name == "isoperimetric" else 0.5]} if levelled else {}
    return (rates, ends, x, guess), options | {"tol": tolerance, "max_nodes": NODES}, lambda s: s.y[2, -1]


def descent(task: Descent, tolerance: float) -> Any:
    """x, y, v and the costate of v on [0, 1]; parameters are the time and the two constant costates."""

    def control(v: np.ndarray, costate: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        across, down = p[1] * v, p[2] * v + costate * GRAVITY
        size = np.hypot(across, down)
        return -across / size, -down / size

    def rates(t: np.ndarray, s: np.ndarray, p: np.ndarray) -> np.ndarray:
        sine, cosine = control(s[2], s[3], p)
        return p[0] * np.vstack([s[2] * sine, s[2] * cosine, GRAVITY * cosine, -(p[1] * sine + p[2] * cosine)])

    def ends(a: np.ndarray, b: np.ndarray, p: np.ndarray) -> np.ndarray:
        energy = 1 - np.hypot(p[1] * b[2], p[2] * b[2])
        return np.array([a[0], a[1], a[2], b[0] - task.across, b[1] - task.depth, b[3], energy])

    t = np.linspace(0, 1, 11)
    speed = np.sqrt(2 * GRAVITY * task.depth)
    guess = np.vstack([task.across * t, task.depth * t, speed * t, -0.1 * (1 - t)])
    slow = 2 * np.hypot(task.across, task.depth) / speed
    start = {"p": [slow, -slow / 2 / task.across, -slow / 8 / task.depth]}
    return (rates, ends, t, guess), start | {"tol": tolerance, "max_nodes": NODES}, lambda s: s.p[0]


def solve(built: Any) -> float:
    """The value, refused where solve_bvp reports failure."""
    arguments, options, value = built
    with np.errstate(all="ignore"):
        found = solve_bvp(*arguments, **options)
    if not found.success:
        raise NotSolvedError(found.message)
    return float(value(found))


ADAPTER = Adapter("SciPy solve_bvp", "scipy", (1e-3, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12), build, solve)
