"""Curves that meet prescribed integrals, for the batched direct method to start from.

The first curve is bent until the level is met, as in
:mod:`varcalc.methods.ritz.starts`, but all amplitudes of all bends are
measured at once. A level is met by bending either way, and from one bend the
minimiser may slide along the level into the other's minimum, which takes it
many steps. Whether the way there is downhill throughout is seen beforehand,
from bends in between.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from varcalc.formulation.height import height
from varcalc.methods.ritz.levelled import Levelled
from varcalc.methods.ritz.starts import GAUSS_NEWTON, LADDER, MET

AMPLITUDES = LADDER[::3]
"""Heights of a bend, in units of the problem's size, between which it meets the level."""
STRETCHES = np.geomspace(0.3, 3.0, 8)
"""Heights of bends between two, in units of theirs."""
TURNS = np.arange(1, 6) / 6
"""Where bends between two are looked at, as shares of the way."""


@dataclass(frozen=True)
class Bends:
    """Bends of the curves of ``K`` values, the lowest first.

    ``unknowns`` (K, W, N) are those of a batch, ``values`` (K, W) what is minimised: inf where the level is not met.
    """

    unknowns: np.ndarray
    values: np.ndarray


def bends(batch: Levelled, lines: np.ndarray) -> Bends:
    """The bends of the curves ``lines`` (K, N) that meet the levels of ``batch``."""
    found = _by_modes(batch, lines) if len(batch.levels) > 1 else _by_arches(batch, lines)
    order = np.argsort(found.values, axis=1, kind="stable")
    return Bends(np.take_along_axis(found.unknowns, order[:, :, None], 1), np.take_along_axis(found.values, order, 1))


def ways(batch: Levelled, line: np.ndarray, most: int) -> np.ndarray:
    """The unknowns of the lowest bends of one ``line`` (N,), ``most`` of them; shape (W, N).

    One that leads down to a lower one, along bends in between that meet the level too, is left out.
    """
    found = bends(batch, line[None])
    z, values = found.unknowns[0, :most], found.values[0, :most]
    z, values = z[np.isfinite(values)], values[np.isfinite(values)]
    if len(z) == 2 and len(batch.levels) == 1 and _leads_down(batch, line, z[::-1], values[::-1]):
        return z[:1]
    return z


def _mode(batch: Levelled, number: int) -> np.ndarray:
    """The unknowns (bumps, N) of bends by the bubble ``number`` (from 0) along every bump, one high and up at first."""
    form, basis = batch.form, batch.basis
    places = np.searchsorted(basis.free, basis.numbers[2 + number])
    bubble = batch.matrix[:, 0, places[0]]
    out = np.zeros((len(form.bumps), batch.matrix.shape[2]))
    out[:, places] = form.bumps * (np.sign(bubble[0]) / np.abs(bubble).max())
    return out


def _by_arches(batch: Levelled, lines: np.ndarray) -> Bends:
    """Arches along every bump, each way, as high as the level asks for; where none is, as meets it best."""
    arch = _mode(batch, 0) * height(batch.form)
    arches = np.concatenate([arch, -arch])
    heights = _heights(batch, lines, arches, AMPLITUDES)
    z = lines[:, None] + heights.amplitude[:, :, None] * arches
    return Bends(z, heights.value)


@dataclass(frozen=True)
class _Heights:
    """How far along directions the level is met, and the functional there; each (K, R), and where it was (K, R)."""

    amplitude: np.ndarray
    value: np.ndarray
    met: np.ndarray


def _heights(batch: Levelled, lines: np.ndarray, directions: np.ndarray, amplitudes: np.ndarray) -> _Heights:
    """The least amplitude by which each of ``directions`` (R, N) meets the level, between two of ``amplitudes``.

    Where none does it is the one that misses the level least.
    """
    K, R, A = len(lines), len(directions), len(amplitudes)
    curves = (amplitudes[:, None, None] * directions).transpose(1, 0, 2).reshape(1, R * A, -1)
    values, misses = batch.measured(lines[:, None] + curves)
    value, miss = values.reshape(K, R, A), misses.reshape(K, R, A)
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


def _leads_down(batch: Levelled, line: np.ndarray, pair: np.ndarray, values: np.ndarray) -> bool:
    """Whether bends on the level between the first and the second of a ``pair`` (2, N) fall all the way.

    Between opposite ones they go round by the next mode along the same bump.
    """
    first, last = pair - line
    if not (first.any() and last.any()):
        return False
    opposite = abs(first @ last) > 0
    aside = last
    if opposite:
        modes = _mode(batch, 1)
        along = int(np.argmax(np.abs(_mode(batch, 0) @ first)))
        aside = modes[along] * (np.abs(first).max() / np.abs(_mode(batch, 0)[along]).max())
    angles = TURNS[:, None] * (np.pi if opposite else 0.5 * np.pi)
    found = _heights(batch, line[None], np.cos(angles) * first + np.sin(angles) * aside, STRETCHES)
    passed = np.concatenate([values[:1], found.value[0], values[1:]])
    return bool(found.met.all() and (np.diff(passed) < 0).all())


def _by_modes(batch: Levelled, lines: np.ndarray) -> Bends:
    """Bends by the lowest modes that meet several levels at once, from each mode in turn.

    Their sum of squares is brought to zero by Gauss and Newton's iteration in the amplitudes of the modes.
    """
    K, m, high = len(lines), len(batch.levels), height(batch.form)
    bubbles = min(m + 2, batch.degree - 1)
    modes = np.concatenate([_mode(batch, k) for k in range(bubbles)]) * high
    R = len(modes)
    many = batch.restricted(np.repeat(np.arange(K), R))
    z = (lines[:, None] + modes).reshape(K * R, -1)
    values, rows = np.full(K * R, np.inf), np.arange(K * R)
    for _ in range(GAUSS_NEWTON):
        at = many.evaluate(z[rows])
        met = at.sound & (np.abs(at.conditions) <= MET * np.maximum(1.0, np.abs(batch.levels))).all(1)
        values[rows[met]] = at.value[met]
        on = at.sound & ~met
        if not on.any():
            break
        rows, many, at = rows[on], many.restricted(on), at[on]
        inverse = np.linalg.pinv(at.gradients @ modes.T, rcond=1e-6)
        z[rows] -= (inverse @ at.conditions[:, :, None])[:, :, 0] @ modes
    return Bends(z.reshape(K, R, -1), values.reshape(K, R))
