"""The slow motion under a fast drive: Kapitza's effective potential of any Lagrangian."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
import scipy.linalg

from varcalc.mechanics.linearised import UNLIKE, standing_forces
from varcalc.mechanics.system import System, check_system
from varcalc.problem.conditions import positive, reals
from varcalc.showing import Shown
from varcalc.spelling import spelled
from varcalc.symbolic.tracing import Expression, trace

FIRST_TIMES, MOST_TIMES = 8, 512
"""In a period, over which is averaged: twice as many until the averages settle."""
SETTLED = 1e-14
"""Of the forces: what twice as many times may change of their averages."""
DRAWN = 3
"""Times the usual number of random places."""
SEPARATE = 1e-13
"""Of what a drive does at its strongest: a part of another form that is less is round-off."""


@spelled
@dataclass(frozen=True, repr=False, eq=False)
class Averaged(Shown):
    """A ``system`` that moves as another, driven fast, does in the mean; ``swing`` is how far that goes about it."""

    system: System
    _swing: ca.Function
    _numbers: np.ndarray

    def swing(self, q: Sequence[float]) -> np.ndarray:
        """The largest displacements (n,) of the fast motion about the slow one, at coordinates q (n,).

        What is averaged holds while these are small beside the lengths over which the forces change.
        """
        return np.array(self._swing(reals("q", q), self._numbers)).ravel()


@spelled
def averaged(system: System, period: float | Callable[[Any], Any]) -> Averaged:
    """The slow motion of a ``system`` whose Lagrangian has a fast part of a ``period``.

    ``period`` is a number, or a function of the parameters, as in ``lambda p: 2 * np.pi / p.w``. The mean of L, less
    the mean energy gᵀ M⁻¹ g/2 of the fast motion: its momenta g, without mean, are the integral over the time of the
    fast part of L_q - L_vt, and M is L_vv. For a force f cos(wt) on a mass m that is the effective potential
    U + f²/(4 m w²) (Landau and Lifshitz, "Mechanics", sect. 30), here for any inertia, as the canonical
    transformation by the integral of the fast potential shows. What is left out is smaller by the square of the
    period beside the times of the slow motion, where the drive goes back as it came, else by the period. Forces that
    no Lagrangian gives are taken over, with the mean rates.

    Raises ValueError where L does not repeat itself after the period, where its fast part is in the inertia, where
    forces depend on the time, and for constraints.

    >>> import casadi as ca
    >>> shaken = System(lambda t, q, v, p: v[0]**2 / 2 + (1 + p.f * ca.cos(p.w * t)) * ca.cos(q[0]), ("theta",),
    ...                 parameters={"f": 200.0, "w": 100.0})
    >>> slow = averaged(shaken, lambda p: 2 * np.pi / p.w).system
    >>> slow.normal_modes([np.pi]).stable  # f²/(2 w²) > 1
    True
    """
    check_system(system)
    lagrange, s = system.lagrange, system.lagrange.symbols
    if system.constraints:
        raise ValueError("constraints: the mean motion needs coordinates that need none")
    if ca.depends_on(lagrange.forces, s.t):
        raise ValueError("forces: a fast force that depends on the time must be given by L, as in + q[0] * f(t)")
    if ca.depends_on(lagrange.mass, s.t):
        raise ValueError("lagrangian: L_vv depends on the time; only forces can be fast, the inertia not")
    if callable(period):
        length = trace("period", period, s.arguments(), ca.SX, "it takes the system's parameters, as p")
    else:
        length = ca.SX(positive("period", period))
    _check_repeats(system, length)
    times = FIRST_TIMES
    value, swing = _mean(system, length, times)
    while times < MOST_TIMES:
        times *= 2
        before, (value, swing) = value, _mean(system, length, times)
        if _same(system, length, before, value):
            break
    else:
        raise ValueError(f"lagrangian: its drive is not resolved by {MOST_TIMES} times in a period")
    forces = s.function(lagrange.forces, s.t, s.q, s.v) if not lagrange.forces.is_zero() else None
    slow = System(
        s.function(value, s.t, s.q, s.v), system.coordinates, parameters=system.parameters,
        forces=forces, name=system.name,
    )  # fmt: skip
    return Averaged(slow, ca.Function("swing", [s.q, s.p], [swing]), system.numbers)


def _mean(system: System, period: Expression, count: int) -> tuple[Expression, Expression]:
    """The Lagrangian of the slow motion, from ``count`` times of a period, and the swing of the fast one (n,).

    Sums over equal parts of a period, and integrals of what they interpolate, converge faster than any power.
    """
    lagrange, s = system.lagrange, system.lagrange.symbols
    values, shares = _separated(system, lagrange.value, period, count)
    mean = ca.mtimes(values, ca.SX(shares.mean(axis=0)))
    forces, shares = _separated(system, standing_forces(lagrange), period, count)
    momenta, moved = (np.linalg.matrix_power(_integration(count), k) @ shares for k in (1, 2))
    rates = lagrange.solved(forces) * period
    both = ca.mtimes(forces.T, rates) * period
    energy = ca.dot(both, ca.SX(momenta.T @ momenta / (2 * count)))
    energy, rates = (ca.substitute(part, s.v, ca.SX.zeros(s.v.numel())) for part in (energy, rates))
    swings = ca.fabs(ca.mtimes(rates * period, ca.SX(moved.T)))
    rows = [ca.mmax(swings[i, :]) for i in range(s.q.numel())]
    return ca.densify(mean - energy), ca.substitute(ca.vertcat(*rows), s.t, 0)


def _separated(system: System, value: Expression, period: Expression, count: int) -> tuple[Expression, np.ndarray]:
    """What is a sum of functions of the state times functions of the time, by its values at a few times of a period.

    From a column (k,) of expressions to the columns (k, r) at r times, and the shares (count, r) by which those at all
    ``count`` times are made of them: the same for all states and parameters, as random ones show. Where no few times
    do, r is ``count``.
    """
    s = system.lagrange.symbols
    function = ca.Function("at", s.all, [value])
    at = [function(period * k / count, s.q, s.v, s.p) for k in range(count)]
    sample = ca.Function("sample", s.all, [ca.horzcat(*at)])
    rng, rows = np.random.default_rng(1788), []
    for _ in range(DRAWN):
        for place in system.lagrange.places(system.parameters):
            numbers = place[3] * rng.uniform(0.5, 1.5, len(place[3]))
            rows.append(np.array(sample(0.0, place[1] * rng.uniform(-2, 2, len(place[1])), place[2], numbers)))
    drawn = np.vstack([row for row in rows if np.all(np.isfinite(row))])
    drawn = drawn / np.maximum(np.abs(drawn).max(axis=1, keepdims=True), 1e-300)
    _, triangle, order = scipy.linalg.qr(drawn, mode="economic", pivoting=True)
    sizes = np.abs(np.diag(triangle))
    rank = max(1, int(np.count_nonzero(sizes > SEPARATE * sizes[0])))
    if rank > min(count, len(drawn)) // 2:
        return ca.horzcat(*at), np.eye(count)
    few = np.sort(order[:rank])
    shares = np.linalg.lstsq(drawn[:, few], drawn, rcond=None)[0].T
    return ca.horzcat(*(at[k] for k in few)), shares


def _integration(count: int) -> np.ndarray:
    """The matrix from values at equal parts of a period 1 to those of the integral that has no mean (Fourier)."""
    wave = np.fft.fftfreq(count, 1 / count)
    factor = np.zeros(count, dtype=complex)
    known = (wave != 0) & (np.abs(wave) < count / 2)
    factor[known] = 1 / (2j * np.pi * wave[known])
    return np.real(np.fft.ifft(factor[:, None] * np.fft.fft(np.eye(count), axis=0), axis=0))


def _check_repeats(system: System, period: Expression) -> None:
    s = system.lagrange.symbols
    function = ca.Function("L", s.all, [system.lagrange.value])
    length = float(ca.Function("period", [s.p], [period])(system.numbers))
    if not 0 < length < np.inf:
        raise ValueError(f"period must be positive, not {length}")
    for t, q, v, numbers in system.lagrange.places(system.parameters):
        now, later = (float(function(at, q, v, numbers)) for at in (t * length, (t + 1) * length))
        if np.isfinite(now) and not abs(later - now) <= UNLIKE * max(1.0, abs(now)):
            raise ValueError(f"period: L is not the same after {length:.6g}: it changes by {later - now:.3g}")


def _same(system: System, period: Expression, one: Expression, other: Expression) -> bool:
    """Whether two Lagrangians have the same forces, to what rounding leaves of the sums of fast ones."""
    lagrange, s = system.lagrange, system.lagrange.symbols
    forces = [ca.densify(ca.gradient(value, s.q)) for value in (one, other)]
    fast = ca.substitute(standing_forces(lagrange), s.t, s.t * period)
    function = ca.Function("forces", s.all, [*forces, fast])
    for t, q, v, numbers in lagrange.places(system.parameters):
        first, last, summed = (np.array(part) for part in function(t, q, v, numbers))
        if not np.abs(first - last).max() <= SETTLED * max(np.abs(last).max(), np.abs(summed).max()):
            return False
    return True
