"""A system linearised about a place of rest: its matrices, characteristic exponents and normal modes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice

import casadi as ca
import numpy as np
import scipy.linalg

from varcalc.mechanics.constraints import Held
from varcalc.mechanics.lagrange import PLACES, Lagrange
from varcalc.numerics.spectrum import DEFECTIVE, MATRIX_ROUND_OFF, Spectrum
from varcalc.showing import Fact, Shown, counted
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.tracing import Expression

AT_REST = 1e-8
"""Of the length over which the stiffness changes: how far off an equilibrium may be said to be."""
MOST_MODES = 6
"""Modes that a print tells."""
FORCE_ROUND_OFF = 1e-12
"""Of all forces: what is twisting or resistance by rounding."""
UNLIKE = 1e-9
"""Relative difference of what is the same at times or places that are alike."""
STEADY = 1e-12
"""Of the matrices, in a time of the system's own: what counts as no change."""


@dataclass(frozen=True, repr=False, eq=False)
class NormalModes(Shown):
    """Small motions about an equilibrium, m of them: of a mode they go as exp((rate ± i frequency) t).

    ``frequencies`` (m,) are angular, ascending, and 0 for modes that do not oscillate; ``rates`` (m,) are those of
    growth, negative for damped modes. ``shapes`` (n, m) are the modes by columns: real, with (shape)ᵀ L_vv (shape) = 1,
    where there are neither gyroscopic nor dissipative forces, else complex. ``exponents`` (2m,) are all
    characteristic exponents, the fastest growing first, and ``zero_modes`` tells how many modes nothing brings back.
    ``stable`` is whether every small motion stays small, as far as the linear equations say: not so where a zero mode
    drifts away, nor where double exponents do not show that their motions do not grow as powers of the time.
    Of m = n modes, less one for each constraint.
    """

    frequencies: np.ndarray
    shapes: np.ndarray
    stable: bool
    rates: np.ndarray
    exponents: np.ndarray
    zero_modes: int

    def _headline(self) -> str:
        return f"{counted(len(self.frequencies), 'small motion')} about an equilibrium, " + (
            "which is stable" if self.stable else "which is not stable"
        )

    def _facts(self) -> Iterator[Fact]:
        shown = zip(self.frequencies, self.rates, self.shapes.T, strict=True)
        for number, (frequency, rate, shape) in enumerate(islice(shown, MOST_MODES)):
            grows = (
                f", grows at the rate {rate:.6g}" if rate > 0 else f", decays at the rate {-rate:.6g}" if rate else ""
            )
            moves = np.array2string(shape, precision=4)
            yield Fact(f"mode {number + 1}", f"angular frequency {frequency:.12g}{grows}, along {moves}")
        if len(self.frequencies) > MOST_MODES:
            yield Fact("", f"and {len(self.frequencies) - MOST_MODES} more")


@dataclass(frozen=True, repr=False, eq=False)
class Linearised(Shown):
    """The equations M x'' + (D + G) x' + K x = f of small motions x (n,) about a place of rest, which end in forces f.

    ``mass`` M, ``resistance`` D + G and ``stiffness`` K are (m, m), in coordinates u with x = ``directions`` u; the
    columns of ``directions`` (n, m) are the n coordinates' own where there are no constraints. ``damping`` D is the
    symmetric part of the resistance, ``gyroscopic`` G the other (Landau and Lifshitz, "Mechanics", sect. 23, 25, 39;
    Merkin, "Introduction to the Theory of Stability", ch. 6).
    """

    mass: np.ndarray
    resistance: np.ndarray
    stiffness: np.ndarray
    directions: np.ndarray

    @property
    def damping(self) -> np.ndarray:
        """The symmetric part of the resistance (m, m), which takes energy where it is positive."""
        return (self.resistance + self.resistance.T) / 2

    @property
    def gyroscopic(self) -> np.ndarray:
        """The antisymmetric part of the resistance (m, m), which does no work."""
        return (self.resistance - self.resistance.T) / 2

    @cached_property
    def _scaled(self) -> tuple[np.ndarray, float]:
        """The rates of (u, u'/s) (2m, 2m) in times 1/s of the system's own, and s."""
        m = len(self.mass)
        forces = np.linalg.solve(self.mass, np.hstack([self.stiffness, self.resistance]))
        own = max(float(np.linalg.norm(forces[:, :m], 2)) ** 0.5, float(np.linalg.norm(forces[:, m:], 2))) or 1.0
        lower = np.hstack([-forces[:, :m] / own**2, -forces[:, m:] / own])
        return np.vstack([np.hstack([np.zeros((m, m)), np.eye(m)]), lower]), own

    @property
    def rate(self) -> float:
        """The rate of the system's own time."""
        return self._scaled[1]

    @cached_property
    def _spectrum(self) -> Spectrum:
        """The exponents in the system's own time, by falling real parts; parts that are round-off are zero."""
        found = Spectrum.of(self._scaled[0])
        real, imaginary = (
            np.where(np.abs(part) <= found.noise, 0.0, part) for part in (np.real(found.values), np.imag(found.values))
        )
        return replace(found, values=real + 1j * imaginary)[np.lexsort([-imaginary, -real])]

    @property
    def exponents(self) -> np.ndarray:
        """The characteristic exponents λ (2m,) with det(λ² M + λ (D + G) + K) = 0, the fastest growing first."""
        return self.rate * self._spectrum.values

    @cached_property
    def _own_units(self) -> tuple[np.ndarray, np.ndarray] | None:
        """The stiffness and the resistance (m, m) in coordinates whose inertia is 1, and times of :attr:`rate`.

        None where the inertia is not positive.
        """
        try:
            lower = np.linalg.cholesky((self.mass + self.mass.T) / 2)
        except np.linalg.LinAlgError:
            return None
        stiffness, resistance = (
            np.linalg.solve(lower, np.linalg.solve(lower, part).T).T for part in (self.stiffness, self.resistance)
        )
        return stiffness / self.rate**2, resistance / self.rate

    @property
    def _round_off(self) -> float:
        """Of the largest squared frequency: what is less is a zero mode."""
        return MATRIX_ROUND_OFF * len(self.mass)

    @cached_property
    def _conservative(self) -> bool:
        """Whether positive inertia and a potential are all there is."""
        if self._own_units is None:
            return False
        stiffness, resistance = self._own_units
        twist = np.abs(stiffness - stiffness.T).max(initial=0.0)
        return bool(max(twist, np.abs(resistance).max(initial=0.0)) <= FORCE_ROUND_OFF)

    @cached_property
    def _holds(self) -> bool:
        """Whether the energy is least here and nothing adds to it: then motions stay near (Lagrange and Dirichlet)."""
        if self._own_units is None:
            return False
        stiffness, resistance = self._own_units
        symmetric = np.abs(stiffness - stiffness.T).max(initial=0.0) <= FORCE_ROUND_OFF
        firm = _least(stiffness) > self._round_off * np.abs(np.linalg.eigvalsh((stiffness + stiffness.T) / 2)).max()
        return bool(
            symmetric and firm and _least(resistance) >= -MATRIX_ROUND_OFF * np.abs(resistance).max(initial=0.0)
        )

    @cached_property
    def _slack(self) -> tuple[np.ndarray, np.ndarray]:
        """Directions without stiffness, on its right and on its left, by columns."""
        m = len(self.mass)
        left, sizes, right = np.linalg.svd(self._scaled[0][m:, :m])
        none = sizes <= self._round_off
        return right[none].T, left[:, none]

    @cached_property
    def stable(self) -> bool:
        """Whether small motions stay small: see :class:`NormalModes`."""
        if self._holds or self._conservative:
            return self._holds
        exponents = self._spectrum.values
        if np.any(np.real(exponents) > 0):
            return False
        (right, left), m = self._slack, len(self.mass)
        if right.shape[1]:  # a motion t z + y along z without stiffness needs K y = -(D + G) z
            held = np.linalg.svd(left.T @ self._scaled[0][m:, m:] @ right, compute_uv=False)
            if held[-1] <= DEFECTIVE * MATRIX_ROUND_OFF:
                return False
        undamped = (np.real(exponents) == 0) & (exponents != 0)
        return bool(np.all(self._spectrum.alone[undamped]))

    def modes(self) -> NormalModes:
        """The normal modes."""
        zero_modes = self._slack[0].shape[1]
        if self._conservative:
            squared, shapes = scipy.linalg.eigh((self.stiffness + self.stiffness.T) / 2, self.mass)
            squared[np.abs(squared) <= self._round_off * np.abs(squared).max(initial=0.0)] = 0.0
            frequencies, rates = np.sqrt(np.maximum(squared, 0)), np.sqrt(np.maximum(-squared, 0))
            one_way = np.concatenate([rates + 1j * frequencies, -rates - 1j * frequencies])
            exponents = one_way[np.lexsort([-np.imag(one_way), -np.real(one_way)])]
            return NormalModes(frequencies, self.directions @ shapes, self.stable, rates, exponents, zero_modes)
        exponents, vectors = self._spectrum.values, self._spectrum.vectors
        pairs, real = np.flatnonzero(np.imag(exponents) > 0), np.flatnonzero(np.imag(exponents) == 0)
        chosen = np.concatenate([pairs, real[: len(real) // 2]])
        chosen = chosen[np.lexsort([np.real(exponents[chosen]), np.imag(exponents[chosen])])]
        shapes = self.directions @ vectors[: len(self.mass), chosen]
        size = np.take_along_axis(shapes, np.argmax(np.abs(shapes), axis=0)[None], axis=0)
        found = self.rate * exponents[chosen]
        return NormalModes(np.imag(found), shapes / size, self.stable, np.real(found), self.exponents, zero_modes)


def _least(matrix: np.ndarray) -> float:
    """The least eigenvalue of the symmetric part of a matrix."""
    return float(np.linalg.eigvalsh((matrix + matrix.T) / 2)[0])


def linearised(lagrange: Lagrange, held: Held | None, q0: np.ndarray, numbers: np.ndarray) -> Linearised:
    """The equations of small motions about ``q0`` (n,).

    Raises ValueError where ``q0`` is no equilibrium, breaks a constraint, or where the equations change with the time.
    """
    s = lagrange.symbols
    multipliers = ca.SX.sym("lambda", 0 if held is None else held.level.numel())
    pull = lagrange.pull if held is None else lagrange.pull + ca.mtimes(held.rows.T, multipliers)
    stiffness = ca.densify(-ca.jacobian(pull, s.q))
    matrices = [lagrange.mass, ca.densify(-ca.jacobian(pull, s.v)), stiffness]
    bend = _bend(ca.vec(stiffness), s.q)
    rate = ca.jacobian(ca.vertcat(pull, *map(ca.vec, matrices)), s.t)
    about = ca.Function("about", [*s.all, multipliers], [pull, *matrices, bend, ca.densify(rate)])
    balance, directions = _balance(lagrange, held, q0, numbers)
    n = len(q0)
    pulled, mass, resistance, stiff, bent, changing = (
        np.array(part) for part in about(0.0, q0, np.zeros(n), numbers, balance)
    )
    _check_rest(q0, directions.T @ pulled.ravel(), directions.T @ stiff @ directions, bent)
    mass, resistance, stiff = (directions.T @ part @ directions for part in (mass, resistance, stiff))
    one = Linearised(mass, resistance, stiff, directions)
    if ca.depends_on(rate, s.t) or np.any(changing):
        _check_steady(about, q0, numbers, balance, one)
    return one


def _balance(
    lagrange: Lagrange, held: Held | None, q0: np.ndarray, numbers: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The multipliers (k,) that come nearest to rest, and the directions (n, m) that constraints leave."""
    n, s = len(q0), lagrange.symbols
    if held is None:
        return np.zeros(0), np.eye(n)
    check_holonomic(lagrange, held)
    function = ca.Function("held", s.all, [held.rows, held.level, lagrange.pull])
    rows, level, pull = (np.array(part) for part in function(0.0, q0, np.zeros(n), numbers))
    off = np.abs(level).ravel() / np.linalg.norm(rows, axis=1)
    if not off.max() <= AT_REST * max(1.0, float(np.abs(q0).max())):
        raise ValueError(f"q0 = {q0} is {off.max():.3g} off constraints[{int(np.argmax(off))}]")
    balance = np.linalg.lstsq(rows.T, -pull.ravel(), rcond=None)[0]
    return balance, scipy.linalg.null_space(rows)


def check_holonomic(lagrange: Lagrange, held: Held) -> None:
    """Refuse constraints under which rest is not a matter of places: of rates alone, or moving."""
    if any(level.is_zero() for level in ca.vertsplit(held.level)):
        raise ValueError(
            "constraints: a Pfaffian one holds rates alone, so that places of rest are never alone; give Holonomic ones"
        )
    if ca.depends_on(held.level, lagrange.symbols.t):
        raise ValueError("constraints: one moves with the time, so that nothing rests; give ones that stand still")


def _check_rest(q0: np.ndarray, pull: np.ndarray, stiffness: np.ndarray, bend: np.ndarray) -> None:
    """Refuse a place from which the forces would move the system by more than round-off.

    It is known to a share of the length over which the stiffness changes, or of the coordinates.
    """
    stiff, bent = float(np.abs(stiffness).max(initial=0.0)), float(np.abs(bend).max(initial=0.0))
    length = _length(q0, stiff, bent)
    if not np.abs(pull).max(initial=0.0) <= AT_REST * length * max(stiff, bent * length, 1e-300):
        raise ValueError(f"q0 = {q0} is no equilibrium: the forces left there are {pull}")


def _bend(slopes: Expression, q: Expression) -> Expression:
    """How much slopes change along a direction that no system prefers: of all directions it would be too long."""
    return ca.densify(ca.jtimes(slopes, q, ca.SX(np.cos(np.arange(1.0, q.numel() + 1)))))


def _length(q0: np.ndarray, stiff: float, bent: float) -> float:
    """Over what length the forces change at a place (n,), from their slopes and those of the slopes; at most 1."""
    largest = float(np.abs(q0).max())
    return min(max(1.0, largest), max(stiff / bent, largest)) if bent > 0 and stiff > 0 else max(1.0, largest)


def _check_steady(
    about: ca.Function, q0: np.ndarray, numbers: np.ndarray, balance: np.ndarray, one: Linearised
) -> None:
    """Refuse equations that change with the time."""
    sizes = [one.rate**2 * max(1.0, float(np.abs(q0).max())), 1.0, one.rate, one.rate**2]
    inertia, n = float(np.abs(one.mass).max()), len(q0)
    scale = inertia * one.rate * np.repeat(sizes, [n, n * n, n * n, n * n])
    for t in np.random.default_rng(1788).uniform(0, 2 * np.pi / one.rate, 5):
        changing = np.array(about(t, q0, np.zeros(n), numbers, balance)[5]).ravel()
        if not np.all(np.abs(changing) <= STEADY * scale):
            raise ValueError(
                f"the equations about q0 = {q0} change with the time: if they repeat themselves, use floquet()"
            )


def standing_forces(lagrange: Lagrange) -> Expression:
    """What moves a system that is at rest (n,): L_q - L_vt and the forces, without rates."""
    s = lagrange.symbols
    return ca.densify(ca.substitute(lagrange.pull, s.v, ca.SX.zeros(s.q.numel())))


def check_standing(lagrange: Lagrange, q0: np.ndarray, numbers: np.ndarray, periods: np.ndarray) -> None:
    """Refuse a place (n,) from which forces drive the system, and periods (m,) after which its equations are others.

    Both for parameters (m, c), at some times of the period.
    """
    s, n = lagrange.symbols, len(q0)
    forces = standing_forces(lagrange)
    slopes = [ca.vec(ca.jacobian(lagrange.pull, x)) for x in (s.q, s.v)]
    bend = _bend(slopes[0], s.q)
    parts = [forces, ca.densify(ca.vertcat(*slopes, ca.vec(lagrange.mass))), bend]
    function = PointEvaluator(ca.Function("standing", s.all, parts))

    def at(times: np.ndarray) -> np.ndarray:
        still = np.zeros((1, n))
        return function(times.size, times.reshape(-1, 1), q0[None], still, np.repeat(numbers, times.shape[1], axis=0))

    times = periods[:, None] * np.random.default_rng(1788).uniform(0, 1, (1, PLACES))
    now, later = at(times), at(times + periods[:, None])
    size = np.abs(now).max(axis=0)
    pull, stiff, bent = (
        float(np.abs(part).max(initial=0.0)) for part in (now[:, :n], now[:, n : n + n * n], now[:, -n * n :])
    )
    if not pull <= AT_REST * _length(q0, stiff, bent) * max(stiff, 1e-300):
        raise ValueError(f"q0 = {q0} does not stand still: it is driven with forces up to {pull:.3g}")
    if not np.all(np.abs(later - now) <= UNLIKE * size):
        raise ValueError(f"period: the equations about q0 = {q0} are others after {periods[0]:.6g}")
