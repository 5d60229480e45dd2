"""A curve nearer to its extremal than a solution knows it, by steps of Newton's method on the pieces of a proof.

What the Euler-Lagrange equation misses at the nodes is the load of Jacobi's equation, whose solution is the way to the
extremal (Ascher, Mattheij and Russell, "Numerical Solution of Boundary Value Problems", 1995, sect. 2.3.4). Beside the
curve its numbers move, the multipliers of its levels and those of the equations between its ends: an end that slides is
known to few digits by its value alone, which is stationary in it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from varcalc.certificates.curve import (
    Samples,
    carried_on,
    end_values,
    held_inside,
    integrated,
    joint_states,
    samples_of,
    state_sizes,
    through,
)
from varcalc.certificates.ends import second, tied
from varcalc.certificates.field import dynamics, jacobi, propagated, turned_dynamics
from varcalc.certificates.statement import Statement

STEPS_TO_EXTREMAL = 5
"""At most."""
KNOWN, ENOUGH, FAR = 1e-12, 1e-6, 2.0
"""Lengths of steps, relative to the curve: as good as none; one after which the next would be; one that leads away."""


@dataclass(frozen=True)
class WayToExtremal:
    """What is to be added to the states (m, N + 1) at the nodes of each piece, and to the levels' multipliers."""

    states: Sequence[np.ndarray]
    lambdas: np.ndarray

    def length(self, sizes: np.ndarray) -> float:
        """The largest part of the step, in units (bare, 1) of the states."""
        return max(float(np.abs(w[: len(sizes)] / sizes).max()) for w in self.states)


def stationary(stated: Statement, samples: list[Samples]) -> tuple[Statement, list[Samples]]:
    """The statement and the samples of the extremal near a curve; of the curve itself where none is found."""
    sizes, last = state_sizes(samples, stated)[: stated.bare, None], FAR
    best = stated, samples
    for _ in range(STEPS_TO_EXTREMAL):
        with np.errstate(all="ignore"):
            step = _step(stated, samples)
        length = np.inf if step is None else step.length(sizes)
        if step is None or not length < last:
            return best
        if length <= KNOWN:
            return stated, samples
        best = stated, samples
        stated, samples = _moved(stated, samples, step)
        if length <= ENOUGH:
            return stated, samples
        last = 0.5 * length
    return best


def _moved(stated: Statement, samples: Sequence[Samples], step: WayToExtremal) -> tuple[Statement, list[Samples]]:
    parts = [(s.start, s.end, s.states[: stated.n] + w[: stated.n]) for s, w in zip(samples, step.states, strict=True)]
    along = replace(
        stated.along,
        evaluate=through(parts),
        vertices=np.array([*(a for a, _, _ in parts), parts[-1][1]]),
        numbers=stated.along.numbers + step.states[0][stated.n * stated.order : stated.bare, 0],
        lambdas=stated.along.lambdas + step.lambdas,
    )
    nearer = stated.of_another(along)
    return nearer, carried_on(nearer, [samples_of(nearer, *part) for part in parts])


def _step(stated: Statement, samples: list[Samples]) -> WayToExtremal | None:
    """A step of Newton's method; None where there is none."""
    m, size, count = stated.states, 2 * stated.states, len(samples)
    try:
        maps, own = _loaded(stated, samples)
    except np.linalg.LinAlgError:
        return None  # H does not bend in the controls
    border, right_of = _conditions(stated, samples)
    extra = len(border) - size  # multipliers of equations between the ends
    wide = size * (count + 1)
    system, right = np.zeros((wide + extra, wide + extra)), np.zeros(wide + extra)
    for k, gap in enumerate([*_gaps(stated, samples), np.zeros(size)]):
        rows = slice(size * k, size * (k + 1))
        system[rows, rows], system[rows, size * (k + 1) : size * (k + 2)] = maps[k, -1], -np.eye(size)
        right[rows] = -own[k, -1] - gap
    for k, given in held_inside(stated, samples):
        for i in np.flatnonzero(~np.isnan(given)):
            row = size * (k - 1) + m + i  # the momentum may jump, and the function may not move
            system[row], right[row] = np.arange(wide + extra) == size * k + i, 0.0
    columns = [*range(size), *range(wide - size, wide + extra)]
    system[size * count :, columns], right[size * count :] = border, right_of
    try:
        found = np.linalg.solve(system, right)
    except np.linalg.LinAlgError:
        return None
    joints = found[:wide].reshape(-1, size)
    moved = [(f @ joint + w)[:, :m].T for f, w, joint in zip(maps, own, joints[:-1], strict=True)]
    return WayToExtremal(moved, -joints[0, m + stated.bare :]) if all(np.isfinite(w).all() for w in moved) else None


def _loaded(stated: Statement, samples: Sequence[Samples]) -> tuple[np.ndarray, np.ndarray]:
    """Solutions (z, pi) of Jacobi's equation from those at each piece's first node; that of its load, from zero.

    Momenta are integrated from forces, so that the derivatives by the controls alone are missed.
    """
    m, n, bare = stated.states, stated.n, stated.bare
    plain = dynamics(n, stated.order, bare)[1]
    missed = np.array([s.pulls - s.momenta.T @ plain for s in samples])
    H = np.array([s.hessian for s in samples])
    B = np.array([turned_dynamics(stated, s)[1] for s in samples])
    bent = np.linalg.solve(H[..., m:, m:], missed[..., None])
    loaded = np.zeros((*H.shape[:2], 2 * m + 1, 2 * m + 1))
    loaded[..., :-1, :-1] = jacobi(stated, samples, np.zeros(m + n))
    loaded[..., :m, -1], loaded[..., m:-1, -1] = -(B @ bent)[..., 0], -(H[..., :m, m:] @ bent)[..., 0]
    found = propagated(loaded, np.array([s.half for s in samples]))
    return found[..., :-1, :-1], found[..., :-1, -1]


def _gaps(stated: Statement, samples: Sequence[Samples]) -> list[np.ndarray]:
    """By how much (z, pi) at the end of each piece exceeds that at the start of the next."""
    none = np.zeros(stated.levels)
    return [
        np.r_[a.states[:, -1] - b.states[:, 0], none, a.momenta[:, -1] - b.momenta[:, 0], none]
        for a, b in pairwise(samples)
    ]


def _conditions(stated: Statement, samples: list[Samples]) -> tuple[np.ndarray, np.ndarray]:
    """Rows on (z, pi) at the start, at the end, and the multipliers of equations between these; what they come to."""
    m, bare, size, equations = stated.states, stated.bare, 2 * stated.states, stated.along.form.ends.equations
    rows, right = np.zeros((size + equations, 2 * size + equations)), np.zeros(size + equations)
    slopes, bends = _cost(stated, samples)
    tie, met = _equations(stated, samples)
    missed = _missed(stated, samples)
    for end, s, node in ((0, samples[0], 0), (1, samples[-1], -1)):
        for i in range(m):
            row, at = m * end + i, size * end
            if i >= bare:
                rows[row, at + i], right[row] = 1.0, -missed[i - bare] * end
            elif stated.periodic and i < stated.n * stated.order:
                j = i + m * end  # functions at the first rows, momenta at the second
                rows[row, j], rows[row, size + j] = -1.0, 1.0
                both = [np.r_[t.states[:, k], t.momenta[:, k]] for t, k in ((samples[0], 0), (samples[-1], -1))]
                right[row] = (both[0] - both[1])[i + bare * end]
            elif stated.held[end][i]:
                rows[row, at + i], right[row] = 1.0, stated.values[end][i] - s.states[i, node]
            else:
                sign = 1.0 if end else -1.0
                rows[row, at + m + i], right[row] = 1.0, -s.momenta[i, node]
                place = None if stated.cost is None else stated.cost.index(end, i)
                if place is not None:
                    right[row] -= sign * slopes[place]
                    rows[row, _columns(stated)] += sign * bends[place]
                    rows[row, 2 * size :] += sign * tie[:, place]
    rows[size:, _columns(stated)], right[size:] = tie, -met
    return rows, right


def _columns(stated: Statement) -> list[int]:
    """Where the variables of a cost are among (z, pi) at the start and the end."""
    n, size = stated.n, 2 * stated.states
    return [*range(n), *range(size, size + n), *range(size + n * stated.order, size + stated.bare)]


def _cost(stated: Statement, samples: list[Samples]) -> tuple[np.ndarray, np.ndarray]:
    """The first and second derivatives of what the ends cost, with the multipliers of the equations between them."""
    if stated.cost is None:
        return np.zeros(0), np.zeros((0, 0))
    plain = replace(tied(stated, samples), weights=(0.0,) * stated.along.form.ends.equations).cost
    assert plain is not None
    jet = plain.jet(*end_values(stated, joint_states(stated, samples)), 2)
    count = len(_columns(stated))
    bends = [[float(second(jet, i, j).mid()) for j in range(count)] for i in range(count)]
    return _numbers([jet.first.get(i, 0) for i in range(count)]), np.array(bends)


def _equations(stated: Statement, samples: list[Samples]) -> tuple[np.ndarray, np.ndarray]:
    """The gradients of the equations between the ends, and their values."""
    count = len(_columns(stated))
    if not stated.along.form.ends.equations or stated.cost is None:
        return np.zeros((0, count)), np.zeros(0)
    found = stated.cost.equations(*end_values(stated, joint_states(stated, samples)))
    rows = [_numbers([jet.first.get(i, 0) for i in range(count)]) for jet in found]
    return np.array(rows), _numbers([jet.value for jet in found])


def _numbers(balls: Sequence[object]) -> np.ndarray:
    return np.array([float(v) for v in balls])  # pyright: ignore[reportArgumentType]


def _missed(stated: Statement, samples: Sequence[Samples]) -> np.ndarray:
    """By how much the integrals along the curve exceed what is prescribed."""
    if not stated.levels:
        return np.zeros(0)
    along = sum(s.half * integrated(stated.level_rates(s.x, s.states, s.controls))[-1] for s in samples)
    return along - np.array([c.lower for c in stated.along.form.conditions.integrals])
