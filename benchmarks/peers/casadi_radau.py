"""CasADi and IPOPT by hand: Radau collocation, every function mapped, exact derivatives."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from peers.adapter import IPOPT, Adapter, NotSolvedError
from tasks import GRAVITY, Descent, Task


def dynamics(task: Task) -> tuple[ca.Function, np.ndarray, np.ndarray]:
    """The right-hand side (t, states, control), and the states at the ends, NaN where they are free."""
    t, u = ca.SX.sym("t"), ca.SX.sym("u")
    if isinstance(task, Descent):
        s = ca.SX.sym("s", 3)
        rate = ca.vertcat(s[2] * ca.sin(u), s[2] * ca.cos(u), GRAVITY * ca.cos(u))
        return ca.Function("f", [t, s, u], [rate]), np.zeros(3), np.array([task.across, task.depth, np.nan])
    rates = [u, task.cost(ca, t, y := ca.SX.sym("y"), u)]
    start, end = [task.start[1], 0.0], [task.end[1], np.nan]
    if task.held is not None:
        rates.append(task.held(ca, t, y, u))
        start, end = [*start, 0.0], [*end, task.level]
    rest = ca.SX.sym("rest", len(rates) - 1)
    f = ca.Function("f", [t, ca.vertcat(y, rest), u], [ca.vertcat(*rates)])
    return f, np.array(start), np.array(end)


def first_guess(task: Task, along: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """States and control on the straight line, at shares of the way (m,)."""
    if isinstance(task, Descent):
        speed = np.sqrt(2 * GRAVITY * task.depth)
        states = np.vstack([task.across * along, task.depth * along, speed * along])
        return states, np.full(len(along), np.arctan2(task.across, task.depth))
    width = task.end[0] - task.start[0]
    x = task.start[0] + width * along
    y = task.line(x)
    slope = (task.line(x + 1e-6 * width) - y) / (1e-6 * width)
    extra = [along * task.level] if task.held is not None else []
    return np.vstack([y, along * abs(task.exact), *extra]), slope


def build(task: Task, setting: tuple[int, int]) -> Any:
    """The nonlinear program on ``elements`` elements of ``degree`` points."""
    elements, degree = setting
    f, start, end = dynamics(task)
    n, points = len(start), elements * degree
    roots = ca.collocation_points(degree, "radau")
    C, D, _ = ca.collocation_coeff(roots)
    X, Z, U = ca.MX.sym("X", n, elements + 1), ca.MX.sym("Z", n, points), ca.MX.sym("U", 1, points)
    free_time = isinstance(task, Descent)
    T = ca.MX.sym("T") if free_time else ca.MX(task.end[0] - task.start[0])
    offset = 0.0 if free_time else task.start[0]
    shares = (np.arange(elements)[:, None] + np.array(roots)).ravel() / elements
    rates = f.map(points)(offset + T * ca.DM(shares).T, Z, U)
    e, z, r, h = ca.SX.sym("e", n), ca.SX.sym("z", n, degree), ca.SX.sym("r", n, degree), ca.SX.sym("h")
    both = ca.horzcat(e, z)
    element = ca.Function("element", [e, z, r, h], [ca.vec(both @ C - h * r), both @ D])
    defects, last = element.map(elements)(X[:, :-1], Z, rates, ca.repmat(T / elements, 1, elements))
    w = ca.vertcat(ca.vec(X), ca.vec(Z), ca.vec(U), *([T] if free_time else []))
    goal = T if free_time else X[1, -1]
    solver = ca.nlpsol(
        "radau", "ipopt", {"x": w, "f": goal, "g": ca.vertcat(ca.vec(defects), ca.vec(X[:, 1:] - last))},
        IPOPT | {"expand": True, "error_on_fail": False},
    )  # fmt: skip
    guesses = [first_guess(task, np.linspace(0, 1, elements + 1))[0].T.ravel()]
    inside, control = first_guess(task, shares)
    w0 = np.concatenate([*guesses, inside.T.ravel(), control, [1.0] if free_time else []])
    low, high = np.full(len(w0), -np.inf), np.full(len(w0), np.inf)
    if free_time:
        low[n * (elements + 1 + points) : -1], high[n * (elements + 1 + points) : -1] = 0.0, np.pi
        low[-1] = 1e-3
    low[:n] = high[:n] = start
    fixed = n * elements + np.flatnonzero(~np.isnan(end))
    low[fixed] = high[fixed] = end[~np.isnan(end)]
    return solver, {"x0": w0, "lbx": low, "ubx": high, "lbg": 0.0, "ubg": 0.0}


def solve(built: Any) -> float:
    """The least value found."""
    solver, arguments = built
    value = float(solver(**arguments)["f"])
    if not solver.stats()["success"]:
        raise NotSolvedError(solver.stats()["return_status"])
    return value


SETTINGS = ((3, 3), (5, 3), (5, 5), (10, 5), (20, 5), (40, 5))
ADAPTER = Adapter("CasADi Radau", "casadi", SETTINGS, build, solve)
