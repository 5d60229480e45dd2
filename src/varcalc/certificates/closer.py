"""A curve nearer to its extremal than a solution knows it, by a step of Newton's method on the pieces of a proof.

What the Euler-Lagrange equation misses at the nodes is the load of Jacobi's equation, whose solution is the way to the
extremal (Ascher, Mattheij and Russell, "Numerical Solution of Boundary Value Problems", 1995, sect. 2.3.4).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from varcalc.certificates.balls import differentiation, transform
from varcalc.certificates.curve import DEGREE, Samples, carried_on, samples_of
from varcalc.certificates.field import boundary, dynamics, propagator
from varcalc.certificates.setting import Setting, setting_of
from varcalc.certificates.statement import statement

Part: TypeAlias = tuple[float, float, np.ndarray]
"""Where a piece of the curve begins and ends, and the functions (n, N + 1) at its nodes."""


def closer(setting: Setting, value: float) -> Setting | None:
    """The setting of the curve one step nearer, on the same pieces.

    None where levels, costs of ends or waypoints hold the curve, or where there is no step. ``value`` is about its own.
    """
    stated = setting.statement
    if stated.levels or stated.cost is not None or stated.waypoints or stated.periodic:
        return None
    with np.errstate(all="ignore"):
        moved = _moved(setting)
    if moved is None:
        return None
    parts = [
        (float(s.x[0]), float(s.x[-1]), s.states[: stated.n] + w[: stated.n])
        for s, w in zip(setting.samples, moved, strict=True)
    ]
    numbers = stated.along.numbers + moved[0][stated.n * stated.order :, 0]
    vertices = np.array([*(a for a, _, _ in parts), parts[-1][1]])
    along = replace(stated.along, evaluate=_through(parts), vertices=vertices, numbers=numbers)
    nearer = statement(along, stated.beside)
    return setting_of(nearer, carried_on(nearer, [samples_of(nearer, *part) for part in parts]), value)


def _moved(setting: Setting) -> list[np.ndarray] | None:
    """What is to be added to the states (m, N + 1) at the nodes of each piece."""
    samples, m = setting.samples, setting.statement.states
    solved = [_loaded(setting, s) for s in samples]
    size = 2 * m
    system, right = np.zeros((size * (len(samples) + 1),) * 2), np.zeros(size * (len(samples) + 1))
    gaps = [np.r_[a.states[:, -1] - b.states[:, 0], a.momenta[:, -1] - b.momenta[:, 0]] for a, b in pairwise(samples)]
    for k, ((maps, own), gap) in enumerate(zip(solved, [*gaps, np.zeros(size)], strict=True)):
        rows = slice(size * k, size * (k + 1))
        system[rows, rows], system[rows, size * (k + 1) : size * (k + 2)] = maps[-1], -np.eye(size)
        right[rows] = -own[-1] - gap
    free = np.zeros((m, m))
    conditions = boundary(setting.statement, (free, free))
    for rows, at, condition, s, node in (
        (slice(-size, -m), slice(0, size), conditions[0], samples[0], 0),
        (slice(-m, None), slice(-size, None), conditions[1], samples[-1], -1),
    ):
        system[rows, at] = condition
        # given states are met as they are; momenta vanish where states are free
        right[rows] = -condition[:, m:] @ s.momenta[:, node]
    try:
        joints = np.linalg.solve(system, right).reshape(-1, size)
    except np.linalg.LinAlgError:
        return None
    moved = [(maps @ joint + own)[:, :m].T for (maps, own), joint in zip(solved, joints[:-1], strict=True)]
    return moved if all(np.isfinite(w).all() for w in moved) else None


def _loaded(setting: Setting, s: Samples) -> tuple[np.ndarray, np.ndarray]:
    """Solutions (z, pi) of Jacobi's equation from those at a piece's first node; that of its load, from zero."""
    stated = setting.statement
    m, n = stated.states, stated.n
    A, B = dynamics(n, stated.order, m)
    gradient = stated.sampled(s.x, s.states, s.controls)[0]
    p = s.momenta
    r = gradient[:, :m] - (differentiation(DEGREE) @ p.T) / s.half - p.T @ A
    q = gradient[:, m:] - p.T @ B
    system, maps = propagator(stated, s, np.zeros(m + n))
    bent = np.linalg.solve(s.hessian[:, m:, m:], q[:, :, None])
    load = np.hstack([-(B @ bent)[:, :, 0], r - (s.hessian[:, :m, m:] @ bent)[:, :, 0]])
    own = np.linalg.solve(system, load[1:].ravel()).reshape(-1, 2 * m)
    return maps, np.vstack([np.zeros((1, 2 * m)), own])


def _through(parts: Sequence[Part]) -> Callable[[np.ndarray, int], np.ndarray]:
    """The curve through values at the nodes of parts, and its derivatives."""
    starts = np.array([a for a, _, _ in parts])
    series = [[np.polynomial.Chebyshev(row, domain=[a, b]) for row in values @ transform(DEGREE).T]
              for a, b, values in parts]  # fmt: skip

    def evaluate(x: np.ndarray, k: int) -> np.ndarray:
        at = np.clip(np.searchsorted(starts, x, side="right") - 1, 0, len(starts) - 1)
        found = np.empty((len(series[0]), *np.shape(x)))
        for number in np.unique(at):
            here = at == number
            found[:, here] = [row.deriv(k)(x[here]) for row in series[number]]
        return found

    return evaluate
