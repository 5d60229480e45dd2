"""Free rotation: the cones of a symmetric body, the polhodes of any, and which steady rotations are stable."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np

from varcalc.mechanics.rigid.inertia import Principal, TopKind
from varcalc.showing import Shown

SQUARE_ROUND_OFF = 16 * float(np.finfo(float).eps)
"""Of two squares: by how much they differ that differ by round-off."""


@dataclass(frozen=True, repr=False)
class Cones(Shown):
    """What a free symmetric body does: ω, its axis e3 and the angular momentum L lie in one plane, which turns.

    ``body_frequency`` is the angular frequency at which ω goes round e3, seen from the body, in the sense of e3 where
    positive: ω3 (I3/I1 - 1); ``space_frequency`` the one at which e3 and ω go round L in space, L/I1. The angles, in
    radians, are those between ω and e3, L and e3, ω and L.

    Source: Landau and Lifshitz, "Mechanics", sect. 33 and 36; Brizard, "An Introduction to Lagrangian Mechanics",
    eq. 7.28 and 7.31.
    """

    body_frequency: float
    space_frequency: float
    body_angle: float
    momentum_angle: float
    space_angle: float


def cones(principal: Principal, angular_velocity: np.ndarray) -> Cones:
    """The cones of a symmetric body with an angular velocity (3,).

    Raises ValueError for a body that has no axis of its own, or is not symmetric.
    """
    if principal.kind is not TopKind.SYMMETRIC:
        raise ValueError(f"cones are of a symmetric body; this one has {principal.kind.value}: see polhode()")
    low, middle, high = principal.moments
    first = middle - low > high - middle  # the axis is that of the moment which stands apart
    (along, across), axis = ((low, high), 0) if first else ((high, low), 2)
    own = principal.axes.T @ angular_velocity
    spin, sideways = own[axis], float(np.linalg.norm(np.delete(own, axis)))
    body, momentum = math.atan2(sideways, spin), math.atan2(across * sideways, along * spin)
    return Cones(
        float(spin * (along - across) / across), math.hypot(along * spin, across * sideways) / across, body, momentum,
        abs(body - momentum),
    )  # fmt: skip


class PolhodeKind(Enum):
    """About which axis the angular velocity goes, seen from the body; each member carries its meaning."""

    STEADY = "it stays where it is, on a principal axis"
    ABOUT_LEAST = "it goes round the axis of the least moment"
    ABOUT_GREATEST = "it goes round the axis of the greatest moment"
    SEPARATRIX = "it leaves the middle axis for its other end, and takes for ever"


@dataclass(frozen=True, repr=False)
class Polhode(Shown):
    """The closed way of the angular velocity of a free body, seen from the body.

    ``period`` is the time it takes, infinite on the separatrix and zero where it stays; ``parameter`` is the m = k² of
    Jacobi's functions by which it goes.
    """

    kind: PolhodeKind
    parameter: float
    period: float


def polhode(principal: Principal, angular_velocity: np.ndarray) -> Polhode:
    """The polhode of an angular velocity (3,).

    Source: Landau and Lifshitz, "Mechanics" (3rd ed., 1976), sect. 37. Near the separatrix the period is found from
    1 - m, which loses no digits there.
    """
    from scipy.special import ellipkm1

    (low, middle, high), squares = principal.moments, (principal.axes.T @ angular_velocity) ** 2
    about_low, about_high = low * (middle - low) * squares[0], high * (high - middle) * squares[2]
    over = middle * (middle - low) * squares[1] + high * (high - low) * squares[2]  # L² - 2 E I1
    under = low * (high - low) * squares[0] + middle * (high - middle) * squares[1]  # 2 E I3 - L²
    beside = sorted(principal.moments * squares)[:2]
    if principal.kind is TopKind.SPHERICAL or max(beside) <= SQUARE_ROUND_OFF**2 * (principal.moments @ squares):
        return Polhode(PolhodeKind.STEADY, 0.0, 0.0)
    apart = about_high - about_low
    if abs(apart) <= SQUARE_ROUND_OFF * (about_high + about_low):
        return Polhode(PolhodeKind.SEPARATRIX, 1.0, math.inf)
    outer, square, other = (high - middle, over, under) if apart > 0 else (middle - low, under, over)
    inner = middle - low if apart > 0 else high - middle
    frequency = math.sqrt(outer * square / (low * middle * high))
    complement = (high - low) * abs(apart) / (outer * square)
    period = 4 * float(ellipkm1(complement)) / frequency
    kind = PolhodeKind.ABOUT_GREATEST if apart > 0 else PolhodeKind.ABOUT_LEAST
    return Polhode(kind, inner * other / (outer * square), period)


@dataclass(frozen=True, repr=False, eq=False)
class SteadyRotation(Shown):
    """Free rotation about a principal ``axis`` (3,) with its ``moment``.

    Small departures swing with the angular frequency ``rate``, in units of that of the rotation, where it is
    ``stable``; else they grow by exp(rate ω t).
    """

    axis: np.ndarray
    moment: float
    stable: bool
    rate: float


def steady_rotations(principal: Principal) -> tuple[SteadyRotation, ...]:
    """The rotations about the three principal axes, by ascending moments: that about the middle one is unstable.

    rate² = ±(I_k - I_i)(I_k - I_j)/(I_i I_j) (Landau and Lifshitz, "Mechanics", sect. 37). About an axis that shares
    its moment with one other a departure grows in proportion to the time: not stable, with rate 0.
    """
    moments = principal.moments
    found = []
    for k in range(3):
        others = np.delete(moments, k)
        apart = moments[k] - others
        apart[np.abs(apart) <= SQUARE_ROUND_OFF * moments[-1]] = 0.0
        squared = float(np.prod(apart / others))
        stable = squared > 0 or not np.any(apart)
        found.append(SteadyRotation(principal.axes[:, k], float(moments[k]), stable, abs(squared) ** 0.5))
    return tuple(found)
