"""How high curves are bent that a method tries: what the functional feels, in whatever units it is written."""

from __future__ import annotations

import casadi as ca
import numpy as np

from varcalc.formulation.form import Form
from varcalc.numerics.mesh import gauss
from varcalc.problem.problem import Curve
from varcalc.symbolic.buffered import Pointwise
from varcalc.symbolic.derived import derived

DOUBLINGS = np.arange(-40, 41)
"""Heights at which bends are measured, in units of the ends' distance: so many times doubled, or halved."""
POINTS = 6
TURNED = 0.4
"""Change of the power of the height with which an integral grows, by which it has left its first one."""
SEEN = 1e-9
"""Part of an integral that a bend has to change before its growth is more than rounding."""
WITHIN = 30.0
"""Ratio of the ends' distance and the height that the functional feels, either way, to which one unit serves both."""


def height(form: Form) -> float:
    """A length of the size of the problem's functions.

    It is the extent of the baseline, or of the interval where that is larger, as if both had one unit. Where they have
    not, a bend so high is nothing to the functional, or all: then it is the height at which one of its integrals leaves
    the power of the height with which it grows at first.
    """
    extent = _extent(form)
    felt = _felt(form, extent)
    return felt if felt is not None and not 1 / WITHIN < extent / felt < WITHIN else extent


def _extent(form: Form) -> float:
    """The spread of the baseline, and of the interval where that has a unit of length."""
    line = form.baseline(np.linspace(*form.span, 9))
    spread = float(np.ptp(line, axis=1).max())
    scale = max(spread, float(np.abs(line).max()) * 1e-3)
    # the parameter of a curve has no unit of length, and s of a lifted form has none either
    unlike = form.stated.is_lifted or isinstance(form.problem, Curve)
    return scale if unlike and spread > 0.0 else max(scale, form.problem.span[1] - form.problem.span[0])


def _felt(form: Form, extent: float) -> float | None:
    """The least height of a bend at which an integral changes its growth; None where each is one power throughout."""
    nodes, weights = gauss(POINTS)
    a, b = form.span
    s, half = 0.5 * (a + b) + 0.5 * (b - a) * nodes, 0.5 * (b - a)
    arch, slope = 1 - nodes**2, -2 * nodes / half
    line = form.baseline(s)
    rise = (form.baseline(s + 1e-6 * half) - form.baseline(s - 1e-6 * half)) / (2e-6 * half)
    heights = extent * 2.0 ** DOUBLINGS[:, None]
    signed = np.concatenate([np.zeros((1, 1)), heights, -heights])
    least: float | None = None
    for direction in form.bumps:
        y = line.T + (signed * arch)[:, :, None] * direction
        dy = rise.T + (signed * slope)[:, :, None] * direction
        integrals = np.einsum("q,aqi->ia", weights, _values(form, s, y, dy))
        for row in integrals:
            for grown in (row[1 : len(heights) + 1], row[len(heights) + 1 :]):
                found = _turn(grown, float(row[0]))
                if found is not None and (least is None or heights[found, 0] < least):
                    least = float(heights[found, 0])
    return least


def _turn(grown: np.ndarray, flat: float) -> int | None:
    """Where an integral (A,) leaves the power with which it grows from ``flat`` at first; None where it never does."""
    change = grown - flat if np.isfinite(flat) else grown
    known = np.isfinite(change) & (np.abs(change) > SEEN * (abs(flat) if np.isfinite(flat) else 0.0))
    if not known.any() or not change[known].any():
        return None
    first = int(np.argmax(known))
    ends = np.flatnonzero(~known[first:])
    last = first + int(ends[0]) if len(ends) else len(change)
    powers = np.diff(np.log2(np.abs(change[first:last])))
    left = np.flatnonzero(np.abs(powers - powers[0]) > TURNED) if len(powers) else []
    if len(left):
        return first + int(left[0])
    return last - 1 if len(ends) else None


def _values(form: Form, s: np.ndarray, y: np.ndarray, dy: np.ndarray) -> np.ndarray:
    """The integrands (A, Q, 1 + m) on curves y and dy (A, Q, n)."""
    count = y.shape[0] * y.shape[1]
    rows = [y.reshape(count, -1), dy.reshape(count, -1)]
    second = np.zeros((1, form.n if form.order == 2 else 0))
    numbers = form.problem.parameter_values[None], form.unknown_guess[None]
    out = _integrands(form)(count, np.tile(s, len(y))[:, None], *rows, second, *numbers)
    return out.reshape(*y.shape[:2], -1)


@derived
def _integrands(form: Form) -> Pointwise:
    """The integrand of the functional and those of the levels."""
    rows = [form.integrand, *(c.expression for c in form.integrals)]
    return Pointwise(ca.Function("integrands", form.symbols.all, [ca.densify(ca.vertcat(*rows))]))
