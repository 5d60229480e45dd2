"""Equilibria in a box, all of them, and small oscillations about one."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
import scipy.linalg

from varcalc.mechanics.lagrange import Lagrange
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.intervals import enclosures

AT_REST = 1e-8
"""Of the terms of L_q: what is left of it at an equilibrium."""
ROUND_OFF = 1e-12
"""Of the largest squared frequency: less is a zero mode."""
FINEST = 1e-5
"""Of the box: a part so small is not divided further."""
MOST_PARTS = 4000
NEWTON = 40
ALONE = 1e-7
"""Of the largest singular value of the slopes: a place at which one is less need not be alone."""
SLACK = 1e-12
"""For the round-off of what is enclosed."""
SAME = 1e-7
"""Of the box: two places so near are one."""


@dataclass(frozen=True)
class Equilibria:
    """The ``places`` (k, n) at which a system can rest, and how they were ``searched`` for.

    ``unresolved`` counts parts of the box in which there may be others: none where it is 0.
    """

    places: np.ndarray
    searched: str
    unresolved: int


def equilibria(lagrange: Lagrange, low: np.ndarray, high: np.ndarray, numbers: np.ndarray) -> Equilibria:
    """Where L_q and the forces vanish at rest, in the box from ``low`` to ``high`` (n,).

    The box is halved wherever enclosures of these do not show that one of them has no zero in a part (Neumaier,
    "Interval Methods for Systems of Equations", ch. 5); Newton's iteration from the middles of parts finds the places.
    """
    s, n = lagrange.symbols, len(low)
    pull = ca.densify(ca.substitute(ca.gradient(lagrange.value, s.q) + lagrange.forces, s.v, ca.SX.zeros(n)))
    pull = ca.substitute(pull, s.t, 0)
    both = ca.Function("both", [s.q, s.p], [pull, ca.densify(ca.jacobian(pull, s.q))])
    at_middles = PointEvaluator(ca.Function("pull", [s.q, s.p], [pull]))
    size, found, looked_at = high - low, np.zeros((0, n)), 0
    boxes = low[None], high[None]
    while len(boxes[0]):
        looked_at += len(boxes[0])
        kept = _may_vanish(both, at_middles, boxes, numbers)
        boxes = boxes[0][kept], boxes[1][kept]
        fine = np.all(boxes[1] - boxes[0] <= FINEST * size, axis=1)
        if np.all(fine) or len(boxes[0]) > MOST_PARTS:
            break
        widest = np.argmax((boxes[1] - boxes[0]) / size, axis=1)
        row = np.arange(len(widest))
        middle = (boxes[0] + boxes[1]) / 2
        upper, lower = boxes[1].copy(), boxes[0].copy()
        upper[row, widest], lower[row, widest] = middle[row, widest], middle[row, widest]
        boxes = np.concatenate([boxes[0], lower]), np.concatenate([upper, boxes[1]])
    middles = (boxes[0] + boxes[1]) / 2
    away = np.full(len(middles), np.inf)
    for k in range(len(middles)):
        if away[k] <= 4 * FINEST:
            continue
        place = _rest(both, middles[k], numbers)
        inside = place is not None and np.all((place >= low - SAME * size) & (place <= high + SAME * size))
        if place is None or not inside:
            continue
        isolated = np.linalg.svd(np.array(both(place, numbers)[1]), compute_uv=False)
        if isolated[-1] <= ALONE * isolated[0]:  # there may be a line of them
            continue
        if not len(found) or np.min(np.max(np.abs(found - place) / size, axis=1)) > SAME:
            found = np.vstack([found, place])
            away = np.minimum(away, np.max(np.abs(middles - place) / size, axis=1))
    unresolved = int(np.count_nonzero(away > 4 * FINEST))
    order = np.lexsort(found.T[::-1])
    searched = f"the box was divided into parts, {looked_at} looked at, {unresolved} of which may hide another place"
    return Equilibria(found[order], searched, unresolved)


def _may_vanish(
    both: ca.Function, at_middles: PointEvaluator, boxes: tuple[np.ndarray, np.ndarray], numbers: np.ndarray
) -> np.ndarray:
    """Whether all components may be zero in boxes (m, n): by their enclosures, and by those of their slopes."""
    low, high = boxes
    fixed = [(np.array(x), np.array(x)) for x in numbers]
    values, slopes = enclosures(both, [list(zip(low.T, high.T, strict=True)), fixed])
    middle, half = (low + high) / 2, (high - low) / 2
    centre = at_middles(len(low), middle, numbers[None, :])
    kept, n = np.ones(len(low), dtype=bool), low.shape[1]
    with np.errstate(all="ignore"):
        for i, (least, greatest) in enumerate(values):
            steepest = [np.maximum(np.abs(a), np.abs(b)) for a, b in slopes[i::n]]
            reach = sum(half[:, j] * steep for j, steep in enumerate(steepest))
            beyond = np.abs(centre[:, i]) > reach * (1 + SLACK) + SLACK * np.abs(centre).max(initial=0.0)
            kept &= ~((least > 0) | (greatest < 0) | beyond)  # what is no number is kept
    return kept


def _rest(both: ca.Function, place: np.ndarray, numbers: np.ndarray) -> np.ndarray | None:
    """Newton's iteration; None where it does not settle."""
    step = np.full(len(place), np.inf)
    for _ in range(NEWTON):
        pull, slope = (np.array(part) for part in both(place, numbers))
        if not (np.all(np.isfinite(pull)) and np.all(np.isfinite(slope))):
            return None
        step = np.linalg.lstsq(slope, -pull.ravel(), rcond=None)[0]
        place = place + step
        if np.abs(step).max() <= 1e-15 * max(1.0, np.abs(place).max()):
            return place
    return place if np.abs(step).max() <= 1e-10 * max(1.0, np.abs(place).max()) else None


@dataclass(frozen=True)
class NormalModes:
    """Angular ``frequencies`` (n,), ascending by their squares, ``shapes`` (n, n) by columns, and which are ``stable``.

    Of an unstable mode the frequency is the rate at which it grows.
    """

    frequencies: np.ndarray
    shapes: np.ndarray
    stable: np.ndarray


def normal_modes(lagrange: Lagrange, q0: np.ndarray, numbers: np.ndarray) -> NormalModes:
    """The modes of L_vv q'' = L_qq q about ``q0`` (Landau and Lifshitz, "Mechanics", sect. 23).

    Raises ValueError where ``q0`` is no equilibrium, and where gyroscopic terms couple the rates.
    """
    s = lagrange.symbols
    slope = ca.densify(ca.gradient(lagrange.value, s.q))
    parts = [slope, lagrange.mass, ca.densify(ca.jacobian(slope, s.q)), ca.densify(ca.jacobian(lagrange.momenta, s.q))]
    function = ca.Function("about", s.all, parts)
    pull, mass, stiffness, mixed = (np.array(part) for part in function(0.0, q0, np.zeros_like(q0), numbers))
    if np.abs(pull).max() > AT_REST * max(np.abs(stiffness).max(), 1e-300) * max(1.0, np.abs(q0).max()):
        raise ValueError(f"q0 = {q0} is no equilibrium: L_q is {pull.ravel()} there")
    if np.abs(mixed - mixed.T).max() > AT_REST * max(np.abs(mixed).max(), 1e-300):
        raise ValueError("L couples rates and coordinates (gyroscopic terms), for which these modes are not enough")
    squared, shapes = scipy.linalg.eigh(-stiffness, mass)
    squared[np.abs(squared) <= ROUND_OFF * np.abs(squared).max()] = 0.0
    return NormalModes(np.sqrt(np.abs(squared)), shapes, squared > 0)
