"""Nutation of a heavy symmetric top: motion in the one coordinate cos θ, by its cubic."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from varcalc.mechanics.rigid.top_cubic import TopCubic, TopStart, total
from varcalc.numerics.one_coordinate.motions import CoordinateMotion, MotionBounds, both_bounds, ways
from varcalc.numerics.one_coordinate.quadrature import integrals
from varcalc.numerics.roots import EPSILON, bracketed_newton
from varcalc.showing import Shown

UPRIGHT_MARGIN = 1.0
"""How far beyond upright and upside down the cubic is looked at, so that a root there lies inside."""
HALF_PERIOD_PLACES = 33
"""Places of half a period at which rates are looked at for their size."""
HALVINGS_NEXT_TO_POLE = 500
"""Of a panel, next to a pole."""
LAST_DIGITS = 1e-12
"""Of a root: a step that is longer is no correction of its last digits."""
NEXT_TO = 0.1
"""Of the way of cos θ: what comes nearer to a pole is measured from there."""


class NutationCase(Enum):
    """What the azimuth φ does while θ goes to and fro; each member carries its meaning."""

    MONOTONE = "case I: it goes one way only"
    CUSP = "case II: it comes to rest where θ turns"
    LOOP = "case III: it goes backwards on part of the way"
    PLANE = "the axis swings in a plane through the vertical"
    STEADY = "the axis goes round at one θ: regular precession"
    SLEEPING = "the axis stays upright, or hangs"
    ASYMPTOTIC = "the axis comes to the vertical, and takes for ever"


@dataclass(frozen=True, repr=False)
class Nutation(Shown):
    """How the axis of a top goes to and fro.

    ``theta`` are the limits of θ, the lesser first, ``u`` those of cos θ, the lesser first. In a ``period``, infinite
    where that is asymptotic, φ advances by ``precession`` and ψ by ``spin``, in radians (an axis that goes through the
    vertical changes φ there by π, which is not counted). Of a steady or sleeping axis, the period is that of small
    departures, infinite where they grow: it is then not ``stable``. p_φ, p_ψ and the energy are those of the motion.
    """

    case: NutationCase
    theta: tuple[float, float]
    u: tuple[float, float]
    period: float
    precession: float
    spin: float
    p_phi: float
    p_psi: float
    energy: float
    stable: bool = True


def nutation(start: TopStart, momenta: tuple[float, float], energy: float) -> Nutation:
    """The nutation of a top from its ``start``; its p_φ and p_ψ and its energy are handed on.

    Raises ValueError where the integrals of a period are not resolved.
    """
    b, c, _ = start.coefficients
    if start.w == 0 and b == 0:
        return _steady(start, c, momenta, energy)
    potential, at, squared = start.about_start, np.zeros(1), np.array([start.w**2])
    nodes = potential.nodes(0.0, 0.0, -start.below - UPRIGHT_MARGIN, start.above + UPRIGHT_MARGIN)
    free = np.full(1, np.inf)
    found = both_bounds(potential, nodes, at, squared, -squared, (free, free))
    low, high = (MotionBounds(_polished(potential, one.x, start.w**2), one.turning) for one in found)
    limits = max(float(low.x[0]), -start.below), min(float(high.x[0]), start.above)
    ends = [(start.below + x, start.above - x) for x in limits]
    if start.asymptotic:
        return _found(NutationCase.ASYMPTOTIC, ends, (math.inf, math.inf, math.inf), momenta, energy)
    across, upwards = limits[1] - limits[0], ends[1][1] < ends[0][0]
    case = _case(start, *limits)
    if case is not NutationCase.PLANE and min(ends[0][0], ends[1][1]) < NEXT_TO * across:
        near, half = _next_to_pole(start.upside_down if upwards else start, across)
        ends[upwards] = (2 - near, near) if upwards else (near, 2 - near)
    else:
        [(_, way, _)] = ways(potential, at, np.array([start.w]), low, high)
        half = _half_period(way)
    period, precession, spin = (2 * half).tolist()
    return _found(case, ends, (period, precession, spin), momenta, energy)


def _polished(potential: TopCubic, x: np.ndarray, constant: float) -> np.ndarray:
    """The root ``x`` (1,) after one more of Newton's steps: next to a pole φ' magnifies its last digits."""
    value, slope = potential.at(x)
    with np.errstate(all="ignore"):
        step = (value + constant) / slope
    return np.where(np.abs(step) <= LAST_DIGITS * np.abs(x), x - step, x)


def _next_to_pole(start: TopStart, across: float) -> tuple[float, np.ndarray]:
    """How near a motion that goes so far ``across`` comes to the lower pole, and its half period."""
    potential, constant = start.about_lower_pole
    near = np.zeros(1)
    if constant != 0:

        def above(y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            value, slope = potential.at(y)
            return value + constant, slope

        middle = np.full(1, across / 2)
        near, _ = bracketed_newton(above, middle, np.zeros(1), middle / 2, relative=4 * EPSILON)
        # φ changes by nearly π while y is a few times its least value, however small that is
        potential = replace(potential, steps=near * 4.0 ** np.arange(math.ceil(math.log(2 / near[0], 4)) + 1))
    far = _polished(potential, near + across, constant)
    below, up = (MotionBounds(x, np.ones(1, dtype=bool)) for x in (np.zeros(1), far - near))
    [(_, way, _)] = ways(potential, near, np.zeros(1), below, up)
    return float(near[0]), _half_period(way)


def _found(
    case: NutationCase, ends: Sequence[tuple[float, float]], whole: tuple[float, float, float],
    momenta: tuple[float, float], energy: float,
) -> Nutation:  # fmt: skip
    """The nutation between ``ends``, each so far from the lower and the upper pole; and what a period brings."""
    lower, upper = ends
    thetas = [2 * math.atan2(math.sqrt(above), math.sqrt(below)) for below, above in (upper, lower)]
    us = [1 - above if above < below else below - 1 for below, above in ends]
    return Nutation(case, (thetas[0], thetas[1]), (us[0], us[1]), *whole, *momenta, energy)


def _half_period(way: CoordinateMotion) -> np.ndarray:
    """Half a period, and what φ and ψ advance by in it (3,).

    They are resolved to the digits that the rates have where they are largest, next to a pole.
    """
    rates = way.integrands(np.linspace(0.0, way.period / 2, HALF_PERIOD_PLACES)[None])[1]
    known = np.abs(rates[:, 0]).mean(axis=1) * way.period / 2
    half = integrals(way, np.zeros(1), np.full(1, way.period / 2), known[None], HALVINGS_NEXT_TO_POLE)[0, :3]
    if not np.all(np.isfinite(half)):
        raise ValueError("the integrals over a period of this nutation are not resolved")
    return half


def _case(start: TopStart, low: float, high: float) -> NutationCase:
    if start.beta == 0 and start.a == 0:
        return NutationCase.PLANE
    # at a pole that the axis comes to φ does not come to rest, though what says so elsewhere vanishes there
    ends = [total(start.a, -start.beta * x) for x, pole in ((low, -1), (high, 1)) if start.at_pole(pole) != 0]
    if any(end == 0 for end in ends):
        return NutationCase.CUSP
    return NutationCase.LOOP if len(ends) == 2 and ends[0] * ends[1] < 0 else NutationCase.MONOTONE


def _steady(start: TopStart, bend: float, momenta: tuple[float, float], energy: float) -> Nutation:
    """What stays at one θ: small departures swing with the frequency √-bend, where that is one."""
    upright = start.above * start.below == 0
    rate = 0.0 if upright else start.a / (start.above * start.below)
    period = 2 * math.pi / math.sqrt(-bend) if bend < 0 else math.inf
    case = NutationCase.SLEEPING if upright else NutationCase.STEADY
    # at the threshold the next term of the cubic decides: it holds the axis upright
    stable = bend < 0 or (bend == 0 and start.A * start.u >= 0)
    own = start.omega3 - start.u * rate
    precession, spin = (part * period if part else 0.0 for part in (rate, own))
    ends = [(start.below, start.above)] * 2
    return replace(_found(case, ends, (period, precession, spin), momenta, energy), stable=stable)
