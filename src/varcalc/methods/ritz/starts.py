"""Curves to start from: the library's job, not the person's.

The straight line (or the form's own baseline) comes first. It is not the only
one: an isoperimetric level is met by bending it until the level is reached,
and where the integrand is not a number on it (a square root of zero all
along), it is bent by amplitudes of the size of the problem.
"""

from __future__ import annotations

from collections.abc import Iterator

import casadi as ca
import numpy as np

from varcalc.formulation import Form, Sampled
from varcalc.formulation.height import height
from varcalc.methods.ritz.system import RitzSystem

AMPLITUDES = (0.3, -0.3, 1.0, -1.0, 0.1, -0.1, 3.0, -3.0)
"""Heights of a bent start in units of the problem's size."""
GAUSS_NEWTON = 30
"""Iterations in which several levels are to be met at once."""
MET = 1e-3
"""Relative miss of a level that a start may have: Newton's iteration does the rest."""
LADDER = np.concatenate([[0.0], np.geomspace(1e-3, 1.0, 40), np.geomspace(1.0, 30.0, 21)[1:]])
"""Amplitudes among which the isoperimetric level is sought."""


def bent(form: Form, amplitude: float, direction: np.ndarray) -> Sampled:
    """The baseline with a parabolic arch of the given height along ``direction``."""
    a, b = form.span

    def curve(s: np.ndarray) -> np.ndarray:
        along = (s - a) / (b - a)
        return form.baseline(s) + amplitude * direction[:, None] * 4 * along * (1 - along)

    return curve


def scaled_ring(form: Form, radius: float) -> Sampled:
    """The baseline of a closed curve, a ring of the size that the level asks for, blown up by ``radius``."""
    return lambda s: radius * form.baseline(s)


def candidates(system: RitzSystem, guess: Sampled | None) -> Iterator[np.ndarray]:
    """Unknown vectors to start from, the most promising first; none on which the functional is not a number."""
    form = system.form
    if guess is not None:
        yield _fit(system, guess)
    if system.levels.size > 1:
        yield from _meeting_all_levels(system)
    if system.levels.size:
        yield from _meeting_levels(system)
    if form.pathwise:
        yield from _clear_of_bounds(system)
    yield _fit(system, form.baseline)
    scale = height(form)
    for direction in form.bumps:
        for amplitude in AMPLITUDES:
            yield _fit(system, bent(form, amplitude * scale, direction))


def _fit(system: RitzSystem, curve: Sampled) -> np.ndarray:
    space = system.space
    coefficients = space.fit(curve)
    unknowns = system.form.unknown_guess.copy()
    if system.form.gauged:
        velocity = space.at_quadrature(coefficients, system.count, 1)[1]
        speed = float(np.sqrt((velocity**2).sum(2).mean()))
        unknowns[-1] = speed if speed > 0 else unknowns[-1]
    return system.pack(coefficients, unknowns)


def _clear_of_bounds(system: RitzSystem) -> Iterator[np.ndarray]:
    """The least bent curves that keep every inequality, each way; the baseline itself when it does."""
    form = system.form
    bounds = [c for c in form.pathwise if not c.equality]
    if not bounds:
        return
    function = ca.Function("bounds", form.symbols.all, [ca.vertcat(*(c.expression for c in bounds))])
    lower, upper = (np.array([[getattr(c, k)] for c in bounds]) for k in ("lower", "upper"))
    scale = height(form)
    found: list[tuple[float, np.ndarray]] = []
    for direction in form.bumps:
        for sign in (1.0, -1.0):
            for amplitude in LADDER:
                z = _fit(system, bent(form, float(amplitude) * scale, sign * direction))
                values = np.asarray(function(*system.arguments(z)))
                if np.all((values >= lower) & (values <= upper)):
                    found.append((system.evaluate(z).value, z))
                    break
    found.sort(key=lambda pair: pair[0])
    yield from (z for _, z in found)


def _meeting_all_levels(system: RitzSystem) -> Iterator[np.ndarray]:
    """The baseline bent by its lowest modes until every isoperimetric condition holds, from each mode in turn.

    One bend cannot meet several levels. Their sum of squares is brought to
    zero by Gauss and Newton's iteration in the amplitudes of the modes.
    """
    form, scale = system.form, height(system.form)
    count = len(system.levels)
    straight_on = _fit(system, form.baseline)
    modes = np.array([_mode(system, k, d) for k in range(1, count + 3) for d in form.bumps]) * scale
    found: list[tuple[float, np.ndarray]] = []
    for first in np.eye(len(modes)):
        z = straight_on + first @ modes
        for _ in range(GAUSS_NEWTON):
            at = system.evaluate(z)
            miss = at.conditions[:count]
            if not (np.isfinite(at.value) and np.isfinite(at.jacobian).all()):
                break
            if np.all(np.abs(miss) <= MET * np.maximum(1.0, np.abs(system.levels))):
                found.append((at.value, z))
                break
            z = z - np.linalg.lstsq(at.jacobian[:count] @ modes.T, miss, rcond=1e-6)[0] @ modes
    found.sort(key=lambda pair: pair[0])
    yield from (z for _, z in found)


def _mode(system: RitzSystem, number: int, direction: np.ndarray) -> np.ndarray:
    """The unknowns of sin(number pi s) along ``direction``, s the share of the interval."""
    a, b = system.form.span
    coefficients = system.space.fit(
        lambda s: direction[:, None] * np.sin(number * np.pi * (np.asarray(s) - a) / (b - a))
    )
    return system.pack(coefficients, np.zeros(system.extra))


def _meeting_levels(system: RitzSystem) -> Iterator[np.ndarray]:
    """Bend the baseline (or blow up the ring) until the first isoperimetric condition holds, each way."""
    form = system.form
    scale = height(form)
    if form.periodic and form.baseline(np.array(form.span)).any() and form.n > 1:
        families = [lambda r: scaled_ring(form, r)]
    else:
        families = [lambda r, d=sign * d: bent(form, r * scale, d) for d in form.bumps for sign in (1.0, -1.0)]
    found: list[tuple[float, np.ndarray]] = []
    for family in families:
        best: tuple[float, float, np.ndarray] | None = None
        previous: float | None = None
        for amplitude in LADDER:
            z = _fit(system, family(float(amplitude)))
            at = system.evaluate(z)
            miss = float(at.conditions[0])
            if not np.isfinite(at.value) or not np.isfinite(miss):
                previous = None
                continue
            if best is None or abs(miss) < best[0]:
                best = (abs(miss), at.value, z)
            if previous is not None and previous * miss < 0:
                break
            previous = miss
        if best is not None:
            found.append(best[1:])
    found.sort(key=lambda pair: pair[0])
    yield from (z for _, z in found)
