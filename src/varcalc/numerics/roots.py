"""Roots and minima along one line, on whole arrays at a time: a call costs about as much for 300 places as for one.

SciPy's brentq and minimize_scalar ask for one place at a call.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

EPSILON = float(np.finfo(float).eps)
SCANS = 40
"""Scans of a bracket; each leaves at most half of it, an analytic function 1e-5 of it or less."""
SPREAD = np.array([1e-7, 1e-5, 1e-3, 3e-2, 0.2, 0.5])
"""Distances from the place foretold, in units of the bracket, at which a function is looked at."""
NEIGHBOURS = 3
"""Places on either side of a change of sign through which the inverse function is laid."""
NEWTON_STEPS = 100
SHARES = np.linspace(0.0, 1.0, 65)
DOUBLINGS = 80
FAR_BEYOND = 8.0
"""Times what a growing function must grow to vanish: values that are larger are far beyond."""
NARROWING = 6
CUTS = 257
"""Places of a scan that looks for an extremum: 128^-6 = 2e-13 of the first bracket after all."""


def scanned_root(function: Callable[[np.ndarray], np.ndarray], low: float, high: float, close: float) -> float | None:
    """A root of a ``function`` (m,) -> (m,) between two places where its signs differ, by scans and interpolation.

    Taken as met where the function is not farther than ``close`` from zero. None when the ends do not bracket a root
    or no change of sign is left between places at which the function is a number.
    """
    at: np.ndarray = np.linspace(low, high, 2 * len(SPREAD) + 3)
    spread = abs(high - low)
    for _ in range(SCANS):
        values = function(at)
        at, values = at[np.isfinite(values)], values[np.isfinite(values)]
        change = np.flatnonzero(np.sign(values[1:]) * np.sign(values[:-1]) <= 0)
        if len(change) == 0:
            return None
        k = int(change[0])
        best = k + int(abs(values[k + 1]) < abs(values[k]))
        a, b = float(at[k]), float(at[k + 1])
        spread = abs(b - a)
        if abs(values[best]) <= close or spread <= 2 * EPSILON * abs(at[best]) + 1e-300:
            return float(at[best])
        near = slice(max(k + 1 - NEIGHBOURS, 0), k + 1 + NEIGHBOURS)
        guess = _inverse(at[near], values[near], a, b)
        inner = guess + (b - a) * np.concatenate([-SPREAD[::-1], [0.0], SPREAD])
        ends = min(a, b), max(a, b)
        inner = inner[(inner > ends[0]) & (inner < ends[1])]
        at = np.concatenate([[a], inner, [b]])
    return float(at[len(at) // 2])


def _inverse(at: np.ndarray, values: np.ndarray, a: float, b: float) -> float:
    """Where the inverse function is zero, by interpolation where that is safe, else halfway."""
    steps = np.diff(values)
    if np.all(steps > 0) or np.all(steps < 0):
        apart = values[:, None] - values
        np.fill_diagonal(apart, 1.0)
        shares = np.where(np.eye(len(values), dtype=bool), 1.0, -values / apart)
        guess = float(np.prod(shares, axis=1) @ at)
        if min(a, b) < guess < max(a, b):
            return guess
    return 0.5 * (a + b)


def least(function: Callable[[np.ndarray], np.ndarray], low: float, high: float) -> float:
    """The place of a minimum inside a bracket, by repeated scans; where the function is no number it is not."""
    for _ in range(NARROWING):
        at = np.linspace(low, high, CUTS)
        k = int(np.argmin(np.nan_to_num(function(at), nan=np.inf)))
        low, high = float(at[max(k - 1, 0)]), float(at[min(k + 1, CUTS - 1)])
    return 0.5 * (low + high)


def edges(
    holds: Callable[[np.ndarray], np.ndarray], inside: np.ndarray, outside: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Where a condition (m, k) -> (m, k) ceases to hold, going from ``inside`` (m,), where it does, to ``outside``.

    Neighbouring numbers (m,) and (m,), the last at which it holds and the first at which it does not.
    """
    rows = np.arange(len(inside))
    for _ in range(SCANS):
        at = inside[:, None] + (outside - inside)[:, None] * SHARES
        at[:, -1] = outside
        good = holds(at)
        good[:, 0], good[:, -1] = True, False
        first = np.argmin(good, axis=1)
        before, after = at[rows, first - 1], at[rows, first]
        if np.all((before == inside) & (after == outside)):
            break
        inside, outside = before, after
    return inside, outside


def bracketed_newton(
    function: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]], low: np.ndarray, high: np.ndarray, at: np.ndarray,
    *, relative: float = 0.0, absolute: float = 0.0, flat: np.ndarray | float = 0.0, most: int = NEWTON_STEPS,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Roots between ``low``, where the function is positive, and ``high``, by Newton's steps kept inside the brackets.

    ``function`` takes places, in the shape of ``at``, where it begins, to values and derivatives. A step is the last
    where it is within ``relative`` of the place and ``absolute``, or starts from a value within ``flat``; ``most`` are
    taken. Returns the places, and the last step of each; NaN stays what it is.
    """
    moved = np.full(np.shape(at), np.inf)
    for _ in range(most):
        value, rate = function(at)
        low, high = np.where(value > 0, at, low), np.where(value > 0, high, at)
        with np.errstate(all="ignore"):
            newton = np.where(value == 0, at, at - value / rate)
        # at round-off the sign of the value, and so the bracket, means nothing
        last = (np.abs(newton - at) <= relative * np.abs(at) + absolute) | (np.abs(value) <= flat)
        following = np.where(((newton - low) * (newton - high) < 0) | last, newton, (low + high) / 2)
        moved, at = np.abs(following - at), following
        if not np.any((moved > relative * np.abs(at) + absolute) & ~last):
            break
    return at, moved


def growing(
    function: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]], guess: np.ndarray, relative: float
) -> np.ndarray:
    """Where functions that never fall, and are negative at 0, vanish: places in the shape of ``guess``, not negative.

    ``function`` takes places to values and derivatives. The guess is doubled until it is beyond, and halved while the
    value is far beyond, as of what grows exponentially, on which Newton's steps are short; these, kept inside the
    bracket, end where they are within ``relative`` of the place.
    """
    low, high = np.zeros(np.shape(guess)), np.maximum(guess, 0.0)
    with np.errstate(all="ignore"):
        for _ in range(DOUBLINGS):
            short = function(high)[0] < 0
            if not np.any(short):
                break
            low, high = np.where(short, high, low), np.where(short, 2 * high, high)
        most = -FAR_BEYOND * function(np.zeros_like(low))[0]
        for _ in range(DOUBLINGS):
            far = ~(function(high)[0] <= most) & (most > 0)
            if not np.any(far):
                break
            middle = (low + high) / 2
            beyond = ~(function(middle)[0] < 0)
            low, high = np.where(far & ~beyond, middle, low), np.where(far & beyond, middle, high)

        def falling(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            value, rate = function(at)
            return -value, -rate

        return bracketed_newton(falling, low, high, np.clip(guess, low, high), relative=relative)[0]


def quadratic(constant: np.ndarray, slope: np.ndarray, bend: np.ndarray) -> np.ndarray:
    """Both zeros (2, ...) of constant + slope x + bend x², without cancellation; not numbers where there are none."""
    with np.errstate(all="ignore"):
        q = -(slope + np.copysign(np.sqrt(slope**2 - 4 * constant * bend), slope)) / 2
        return np.stack([q / bend, constant / q])


def quadratic_ahead(
    level: np.ndarray, slope: np.ndarray, bend: np.ndarray, leaving: np.ndarray | bool = False
) -> np.ndarray:
    """The zeros (2, ...) of level + slope x + bend x²/2; of those ``leaving`` one at x = 0 only the other."""
    if not np.any(leaving):
        return quadratic(level, slope, bend / 2)
    with np.errstate(all="ignore"):
        other = np.stack([-2 * slope / bend, np.full_like(slope, np.nan)])
    return other if np.all(leaving) else np.where(leaving, other, quadratic(level, slope, bend / 2))


def first_ahead(places: np.ndarray) -> np.ndarray:
    """The least positive number of the first axis; infinite where there is none."""
    return np.where(np.isfinite(places) & (places > 0), places, np.inf).min(axis=0)
