"""Curves from which an iteration for stationary curves sets out.

The first is the form's own baseline. The others bend it to either side; where
an integral is prescribed, by as much as brings that integral to its level.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from varcalc.formulation import Form, Sampled
from varcalc.formulation.height import height
from varcalc.methods.ritz.starts import AMPLITUDES, bent, scaled_ring
from varcalc.numerics.mesh import gauss
from varcalc.problem.functional import arguments_at

SCAN = np.geomspace(0.01, 30.0, 36)
"""Heights scanned for a prescribed integral, in units of the curve's own size."""
GENTLE = 0.3
"""Part of the height at which a curve is still easily made stationary."""
BASELINE_SAMPLES = 129

FITTED = 1e-4
"""Part of a guess's extent that may be left out by the polynomials which stand for it."""
ROUNDING = 1e-13
"""Relative variation of a guess that is round-off."""
BISECTIONS = 14

Bending = Callable[[float], Sampled]


@dataclass(frozen=True)
class StartingCurve:
    """A curve to start from; ``gentle`` is a weaker version, from which its prescribed integral can be approached."""

    curve: Sampled
    gentle: Sampled | None = None


def starting_curves(form: Form) -> Iterator[StartingCurve]:
    """The baseline, then bent curves, those that meet a prescribed integral first."""
    if form.conditions.integrals:
        yield from _levelled(form, height(form))
    yield StartingCurve(form.start.curve)
    extent = height(form)
    for family in _sloped(form):
        yield StartingCurve(family(extent))
    for direction in form.start.bumps:
        for amplitude in AMPLITUDES:
            yield StartingCurve(bent(form, amplitude * extent, np.asarray(direction)))


def function_sizes(form: Form) -> np.ndarray:
    """The largest absolute value of each function on the baseline, the problem's size for those that are zero; (n,)."""
    values = np.abs(form.start.curve(np.linspace(*form.span, BASELINE_SAMPLES)))
    sizes = np.where(np.isfinite(values), values, 0.0).max(1)
    return sizes if sizes.min() > 0.0 else np.where(sizes > 0.0, sizes, height(form))


def resolving_vertices(
    curve: Sampled, vertices: np.ndarray, degree: int, negligible: np.ndarray | float = 0.0
) -> np.ndarray:
    """The mesh, bisected where polynomials of ``degree`` do not resolve a curve (by its last Legendre coefficients).

    Variations of a function below ``negligible`` (n,) are left alone.
    """
    nodes = gauss(degree + 1)[0]
    inverse = np.linalg.inv(np.polynomial.legendre.legvander(nodes, degree))
    for _ in range(BISECTIONS):
        middles, half = 0.5 * (vertices[1:] + vertices[:-1]), 0.5 * np.diff(vertices)
        values = curve((middles[:, None] + half[:, None] * nodes).ravel()).reshape(-1, len(middles), degree + 1)
        rounding = ROUNDING * np.abs(values).max((1, 2))
        allowed = np.maximum(FITTED * np.ptp(values, axis=(1, 2)) + rounding, negligible)
        coarse = np.abs((values @ inverse.T)[:, :, -2:]).max(2) > allowed[:, None]
        if not (np.isfinite(values).all() and coarse.any()):
            break
        vertices = np.sort(np.concatenate([vertices, middles[coarse.any(0)]]))
    return vertices


def _sloped(form: Form) -> list[Bending]:
    """Where a component is free at an end: curves that run along it and bulge across it, each way."""
    if form.ends.periodic or form.n == 1:
        return []
    free = np.isnan(form.ends.end[0]) - 1.0 * np.isnan(form.ends.start[0])
    families: list[Bending] = []
    for along in np.flatnonzero(free):
        for across in np.flatnonzero(free == 0):
            for run, rise in ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)):
                run_by, rise_by = run * free[along] * np.eye(form.n)[along], rise * np.eye(form.n)[across]
                families.append(lambda r, d=run_by, e=rise_by: _arc(form, r * d, r * e))
    return families


def _arc(form: Form, run: np.ndarray, rise: np.ndarray) -> Sampled:
    """The baseline with half a turn of an ellipse added: from 0 to ``run``, by way of ``rise`` / 2."""
    a, b = form.span

    def curve(s: np.ndarray) -> np.ndarray:
        """The points (n, m) at s (m,)."""
        angle = np.pi * (s - a) / (b - a)
        along, across = 0.5 * (1.0 - np.cos(angle)), 0.5 * np.sin(angle)
        return form.start.curve(s) + run[:, None] * along + rise[:, None] * across

    return curve


def _levelled(form: Form, extent: float) -> Iterator[StartingCurve]:
    """Bent (or, when closed, blown up) baselines on which the first prescribed integral has its level."""
    integral = _integral(form)
    families: list[Bending] = _sloped(form)
    if form.ends.periodic and form.n > 1:
        families.append(lambda r: scaled_ring(form, r))
    else:
        directions = [sign * np.asarray(d) for d in form.start.bumps for sign in (1.0, -1.0)]
        families += [lambda r, d=direction: bent(form, r, d) for direction in directions]
    for family in families:
        heights = SCAN * extent
        misses = np.array([integral(family(r)) for r in heights])
        for k in np.flatnonzero(misses[:-1] * misses[1:] <= 0.0)[:1]:
            share = misses[k] / (misses[k] - misses[k + 1]) if misses[k] != misses[k + 1] else 0.0
            height = float(heights[k] + share * (heights[k + 1] - heights[k]))
            yield StartingCurve(family(height), family(GENTLE * height))


def _integral(form: Form) -> Callable[[Sampled], float]:
    """How far the first prescribed integral of a curve is from its level, to a few digits."""
    condition = form.conditions.integrals[0]
    function = ca.Function("g", form.symbols.all, [condition.expression])
    s = np.linspace(*form.span, BASELINE_SAMPLES)

    def miss(curve: Sampled) -> float:
        """What the integral along a curve is above its level, by the trapezoidal rule."""
        y = curve(s)
        dy = np.gradient(y, s, axis=1, edge_order=2)
        ddy = np.gradient(dy, s, axis=1, edge_order=2) if form.order == 2 else None
        result: Any = function(*arguments_at(form.problem, s, y, dy, ddy, form.start.unknowns))
        values = np.asarray(result).ravel()
        return float(np.sum((values[1:] + values[:-1]) * np.diff(s))) / 2 - condition.lower

    return miss
