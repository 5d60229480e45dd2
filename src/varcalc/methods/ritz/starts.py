"""Curves to start from: the library's job, not the user's.

The straight line (or the form's own baseline) comes first. It is not the only
one: an isoperimetric level is met by bending it until the level is reached,
and where the integrand is not a number on it (a square root of zero all
along), it is bent by amplitudes of the size of the problem.

A level is met by bending either way, and from one bend the minimiser may slide along the level into the other's
minimum, which takes it many steps. Whether the way there is downhill throughout is seen beforehand, from bends in
between.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import casadi as ca
import numpy as np

from varcalc.formulation import Form, Sampled, arched
from varcalc.formulation.height import height
from varcalc.methods.ritz.system import RitzSystem
from varcalc.numerics.stacked import applied

AMPLITUDES = (0.3, -0.3, 1.0, -1.0, 0.1, -0.1, 3.0, -3.0)
"""Heights of a bent start in units of the problem's size."""
GAUSS_NEWTON = 30
"""Iterations in which several levels are to be met at once."""
MET = 1e-3
"""Relative miss of one of several levels that a start may have: Newton's iteration does the rest."""
LADDER = np.concatenate([[0.0], np.geomspace(1e-3, 1.0, 40), np.geomspace(1.0, 30.0, 21)[1:]])
"""Amplitudes among which a bound is kept, or a level of another method sought."""
HEIGHTS = LADDER[::3]
"""Amplitudes of a bend between two of which it meets the level."""
STRETCHES = np.geomspace(0.3, 3.0, 8)
"""Heights of bends between two, in units of theirs."""
TURNS = np.arange(1, 6) / 6
"""Where bends between two are looked at, as shares of the way."""
BACK, NEXT_TO = 4.0 ** np.arange(-20, 0), 1e-3
"""Shares of the way to the baseline at which a curve may have come back to the domain of L, and the most for a guess.

A guess that is further off, as a polygon may be, is not next to a minimum.
"""
COMPARED = 2
"""Starting curves on a level whose minima are compared, where nothing tells that one of them suffices."""


def bent(form: Form, amplitude: float, direction: np.ndarray) -> Sampled:
    """The baseline with a parabolic arch of the given height along ``direction``."""
    return arched(form.start.curve, form.span, amplitude * direction)


def scaled_ring(form: Form, radius: float) -> Sampled:
    """The baseline of a closed curve, a ring of the size that the level asks for, blown up by ``radius``."""
    return lambda s: radius * form.start.curve(s)


def bent_anyhow(system: RitzSystem) -> Iterator[np.ndarray]:
    """The unknowns of curves bent by amplitudes of the size of the problem."""
    scale = height(system.form)
    for direction in system.form.start.bumps:
        for amplitude in AMPLITUDES:
            yield system.fitted(bent(system.form, amplitude * scale, direction))


def toward_baseline(system: RitzSystem, z: np.ndarray, most: float = 1.0) -> Iterator[np.ndarray]:
    """Unknowns on the way from ``z`` to the baseline, as far as ``most`` of it, the nearest first.

    A curve whose slope ends at the edge of the domain of L leaves that by next to nothing between the points of a rule,
    and is inside again a little further on.
    """
    line = system.fitted(system.form.start.curve)
    for share in BACK[most >= BACK]:
        yield z + share * (line - z)


def clear_of_bounds(system: RitzSystem) -> Iterator[np.ndarray]:
    """The least bent curves that keep every inequality, each way; the baseline itself when it does."""
    form = system.form
    bounds = [c for c in form.conditions.pathwise if not c.equality]
    if not bounds:
        return
    function = ca.Function("bounds", form.symbols.all, [ca.vertcat(*(c.expression for c in bounds))])
    lower, upper = (np.array([[getattr(c, k)] for c in bounds]) for k in ("lower", "upper"))
    scale = height(form)
    found: list[tuple[float, np.ndarray]] = []
    for direction in form.start.bumps:
        for sign in (1.0, -1.0):
            for amplitude in LADDER:
                z = system.fitted(bent(form, float(amplitude) * scale, sign * direction))
                values = np.asarray(function(*system.arguments(z)))
                if np.all((values >= lower) & (values <= upper)):
                    found.append((system.evaluate(z).value, z))
                    break
    found.sort(key=lambda pair: pair[0])
    yield from (z for _, z in found)


# prescribed integrals


@dataclass(frozen=True)
class Bends:
    """Bends of the curves of ``K`` values, the lowest first.

    ``unknowns`` (K, W, N), ``values`` (K, W) what is minimised: inf where the level is not met.
    """

    unknowns: np.ndarray
    values: np.ndarray


def bends(system: RitzSystem, lines: np.ndarray) -> Bends:
    """The bends of the curves ``lines`` (K, N), one for each value that ``system`` stands for, that meet the levels."""
    found = _by_modes(system, lines) if len(system.levels) > 1 else _by_arches(system, lines)
    order = np.argsort(found.values, axis=1, kind="stable")
    return Bends(np.take_along_axis(found.unknowns, order[:, :, None], 1), np.take_along_axis(found.values, order, 1))


def meeting_levels(system: RitzSystem) -> tuple[list[np.ndarray], int]:
    """The unknowns of bent curves that meet the levels, the lowest first, and how many minima are to be compared.

    One that leads down to the lowest, along bends in between that meet the level too, need not be.
    """
    line = system.fitted(system.form.start.curve)[None]
    found = bends(system, line)
    kept = np.isfinite(found.values[0])
    curves, values = list(found.unknowns[0, kept]), found.values[0, kept]
    compared = COMPARED
    if len(system.levels) > 1:
        curves += list(_by_arches(system, line).unknowns[0])
    elif len(curves) > 1 and not _is_ring(system) and _leads_down(system, line[0], curves[1::-1], values[1::-1]):
        compared = 1
    return curves, compared


def _is_ring(system: RitzSystem) -> bool:
    """Whether the baseline is a closed curve of the size that the level asks for, to be blown up."""
    form = system.form
    return form.ends.periodic > 0 and form.n > 1 and bool(form.start.curve(np.array(form.span)).any())


def _mode(system: RitzSystem, number: int) -> np.ndarray:
    """The unknowns (bumps, N) of a parabola (0) or of a sine with more half waves along every bump, one high."""
    form, (a, b) = system.form, system.form.span

    def wave(s: np.ndarray) -> np.ndarray:
        along = (np.asarray(s) - a) / (b - a)
        return 4 * along * (1 - along) if number == 0 else np.sin((number + 1) * np.pi * along)

    nothing = np.zeros(system.extra)
    return np.array(
        [system.pack(system.space.fit(lambda s, d=d: d[:, None] * wave(s)), nothing) for d in form.start.bumps]
    )


def _by_arches(system: RitzSystem, lines: np.ndarray) -> Bends:
    """Arches along every bump, each way, as high as the first level asks for; where none is, as meets it best."""
    if _is_ring(system):
        still = np.append(np.zeros(len(system.free)), system.form.start.unknowns)
        arches, lines = lines - still, np.broadcast_to(still, lines.shape)
    else:
        arch = _mode(system, 0) * height(system.form)
        arches = np.concatenate([arch, -arch])
    heights = _heights(system, lines, arches, HEIGHTS)
    z = lines[:, None] + heights.amplitude[:, :, None] * arches
    return Bends(system.gauged(z), heights.value)


@dataclass(frozen=True)
class _Heights:
    """How far along directions the level is met, and the functional there; each (K, R), and where it was (K, R)."""

    amplitude: np.ndarray
    value: np.ndarray
    met: np.ndarray


def _heights(system: RitzSystem, lines: np.ndarray, directions: np.ndarray, amplitudes: np.ndarray) -> _Heights:
    """The least amplitude by which each of ``directions`` (R, N) meets the level, between two of ``amplitudes``.

    Where none does it is the one that misses the level least.
    """
    K, R, A = len(lines), len(directions), len(amplitudes)
    curves = (amplitudes[:, None, None] * directions).transpose(1, 0, 2).reshape(R * A, -1)
    z = (lines[:, None] + curves).reshape(K * R * A, -1)
    values, misses = _at_each(system, K, R * A).measured(system.gauged(z))
    value, miss = values.reshape(K, R, A), misses[:, 0].reshape(K, R, A)
    sound = np.isfinite(value) & np.isfinite(miss)
    value, miss = np.where(sound, value, np.inf), np.where(sound, miss, np.inf)
    across = sound[:, :, :-1] & sound[:, :, 1:] & (np.sign(miss[:, :, :-1]) != np.sign(miss[:, :, 1:]))
    met = across.any(2)
    first = np.where(met, across.argmax(2), 0)

    def at(rows: np.ndarray, index: np.ndarray) -> np.ndarray:
        return np.take_along_axis(rows, index[:, :, None], 2)[:, :, 0]

    below, above = at(miss, first), at(miss, first + 1)
    share = np.where(met, below / np.where(met, below - above, 1.0), 0.0)
    best = np.abs(miss).argmin(2)
    left, right = amplitudes[first], amplitudes[first + 1]
    amplitude = np.where(met, left + share * (right - left), amplitudes[best])
    between = at(value, first) + share * (at(value, first + 1) - at(value, first))
    return _Heights(amplitude, np.where(met, between, at(value, best)), met)


def _at_each(system: RitzSystem, count: int, times: int) -> RitzSystem:
    """The system of ``count`` values, each repeated so many times; of one value any number of curves can be had."""
    return system if system.places is None else system.restricted(np.repeat(np.arange(count), times))


def _leads_down(system: RitzSystem, line: np.ndarray, pair: list[np.ndarray], values: np.ndarray) -> bool:
    """Whether bends on the level between the first and the second of a ``pair`` fall all the way.

    Between opposite ones they go round by the next mode along the same bump.
    """
    first, last = (np.append((own - line)[: len(system.free)], np.zeros(system.extra)) for own in pair)
    if not (first.any() and last.any()):
        return False
    opposite = abs(first @ last) > 0
    aside = last
    if opposite:
        arches = _mode(system, 0)
        along = int(np.argmax(np.abs(arches @ first)))
        aside = _mode(system, 1)[along] * (np.abs(first).max() / np.abs(arches[along]).max())
    angles = TURNS[:, None] * (np.pi if opposite else 0.5 * np.pi)
    found = _heights(system, line[None], np.cos(angles) * first + np.sin(angles) * aside, STRETCHES)
    passed = np.concatenate([values[:1], found.value[0], values[1:]])
    return bool(found.met.all() and (np.diff(passed) < 0).all())


def _by_modes(system: RitzSystem, lines: np.ndarray) -> Bends:
    """Bends by the lowest modes that meet several levels at once, from each mode in turn.

    Their sum of squares is brought to zero by Gauss and Newton's iteration in the amplitudes of the modes.
    """
    K, m = len(lines), len(system.levels)
    modes = np.concatenate([_mode(system, k) for k in range(m + 2)]) * height(system.form)
    R = len(modes)
    many = _at_each(system, K, R)
    z = system.gauged((lines[:, None] + modes).reshape(K * R, -1))
    values, rows = np.full(K * R, np.inf), np.arange(K * R)
    for _ in range(GAUSS_NEWTON):
        at = many.integrated(z[rows])
        usable = np.isfinite(at.value) & np.isfinite(at.conditions).all(1) & np.isfinite(at.jacobian).all((1, 2))
        met = usable & (np.abs(at.conditions) <= MET * np.maximum(1.0, np.abs(system.levels))).all(1)
        values[rows[met]] = at.value[met]
        on = usable & ~met
        if not on.any():
            break
        rows, many, at = rows[on], many.restricted(on), at[on]
        inverse = np.linalg.pinv(at.jacobian @ modes.T, rcond=1e-6)
        z[rows] = system.gauged(z[rows] - applied(inverse, at.conditions) @ modes)
    return Bends(z.reshape(K, R, -1), values.reshape(K, R))
