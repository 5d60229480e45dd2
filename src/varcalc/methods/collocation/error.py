"""How far a collocated curve is from the extremal: one Newton correction in a richer space.

The curve is carried over to a higher degree on the same mesh and corrected
there once; as the richer space is nearer to the extremal by an order, the
correction is the error of the curve that was corrected (Ascher, Mattheij and
Russell, "Numerical Solution of Boundary Value Problems for ODEs", sect. 9.3).
A second, simplified correction tells whether the iteration contracts there.
By the theorem of Newton and Kantorovich that is evidence that an extremal
exists: beyond a fold the ratio exceeds one quarter.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from varcalc.formulation import Form
from varcalc.methods.answer import end_cost_function
from varcalc.methods.collocation.newton import Scales, factorised, measure
from varcalc.methods.collocation.stationarity import stationarity
from varcalc.methods.collocation.system import CollocationSystem, Residual, State, collocation_space
from varcalc.numerics.mesh import Space

CONTRACTION = 0.1
"""Largest ratio of successive corrections that counts as evidence; one quarter is where roots merge."""
NEGLIGIBLE = 1e-10
"""Relative correction below which the ratio says nothing but round-off."""
SETTLED = 1e-14
"""Relative size of the next simplified correction that leaves a root as good as any."""
UNMET = 1e-6
"""Share of the residual that the correction of a singular system may leave."""
SAFETY = 1.5
"""The correction leaves out what lies beyond the richer space."""
EPSILON = float(np.finfo(float).eps)
ROUNDING = 4.0
"""Round-off of a sum, in units of its absolute terms and of the machine's precision."""


@dataclass(frozen=True)
class Level:
    """A root of the collocated conditions: the system, the unknowns, the residual there."""

    system: CollocationSystem
    z: np.ndarray
    residual: Residual

    @property
    def state(self) -> State:
        """The curve with its numbers and multipliers."""
        return self.system.unpack(self.z)


@dataclass(frozen=True)
class Assessment:
    """The errors of a level: of the value (and its round-off) and of the curve.

    ``value`` is the functional on the level's curve, in the sense that is
    minimised; ``system`` and ``z`` the richer system and the corrected curve, which is a root there
    when it has ``settled``.
    """

    value: float
    value_error: float
    value_floor: float
    curve_error: float
    correction: float
    contraction: float
    shares: Callable[[], np.ndarray]
    system: CollocationSystem
    z: np.ndarray
    settled: bool

    @property
    def trusted(self) -> bool:
        """True when there is evidence of an extremal near the curve."""
        return self.correction <= NEGLIGIBLE or self.contraction <= CONTRACTION

    @property
    def indicators(self) -> np.ndarray:
        """The share of each element in the error."""
        return self.shares()


def richer_degree(degree: int) -> int:
    """The degree that follows on the ladder of degrees."""
    return math.ceil(1.5 * degree) + 1


def assess(level: Level, scales: Scales) -> Assessment | None:
    """The errors of a level; None when the richer conditions are not numbers near it."""
    base = level.system
    form, degree = base.form, base.space.degree
    following = richer_degree(degree) if base.space.elements <= 2 else degree + 4
    system = CollocationSystem(form, collocation_space(form, base.space.vertices, following))
    z = system.pack(base.transferred(level.state, system))
    before = system.evaluate(z)
    own = replace(scales)
    own.grow(system, z)
    weights = own.weights(system)
    solve = factorised(system, before, weights, regular=True) if before.finite else None
    step = _shifting(system, before, weights) if solve is None else -solve(before.rows)
    solve = solve or factorised(system, before, weights)
    if solve is None or step is None:
        return None
    after = system.evaluate(z + step)
    correction = measure(weights, step)
    if not (after.finite and math.isfinite(correction)):
        return None
    simplified = -solve(after.rows)
    value = fine_value(base.space, level.state, form, 2 * degree + 4)
    old, new = system.unpack(z), system.unpack(z + step)
    floor = rounding(system, before, new.levels * (0.5 / abs(value) if form.energetic and value else 1.0))
    cost, coarse = end_cost(form, system.space, old), before.value
    change = after.value - coarse + end_cost(form, system.space, new) - cost
    unresolved = value - coarse - cost
    smaller = measure(weights, simplified)
    contraction = smaller / max(correction, 1e-300)
    return Assessment(
        value=value,
        value_error=SAFETY * (abs(change) + abs(unresolved)) + floor,
        value_floor=floor,
        curve_error=curve_distance(system, old, new),
        correction=correction,
        contraction=contraction,
        shares=lambda: _indicators(system, before, z, step),
        system=system,
        z=z + step + simplified,
        settled=contraction * smaller <= SETTLED,
    )  # fmt: skip


def _shifting(system: CollocationSystem, before: Residual, weights: np.ndarray) -> np.ndarray | None:
    """The correction where the Jacobian is singular; None where it leaves conditions unmet.

    Curves that may be shifted leave a direction free, and none of the conditions depends on it. Next to a resonance
    there is one that no curve meets, and a step that leaves the direction out would hide that.
    """
    solve = factorised(system, before, weights) if before.finite else None
    if solve is None:
        return None
    step, matrix = -solve(before.rows), system.dense(before)
    unit = np.maximum(np.abs(matrix).max(1), 1e-300)
    left = np.abs((matrix @ step + before.rows) / unit).max()
    return step if left <= UNMET * np.abs(before.rows / unit).max() else None


def rounding(system: CollocationSystem, at: Residual, multipliers: np.ndarray) -> float:
    """Round-off of the value: of its own sum, and of each prescribed integral, a miss of which costs its multiplier."""
    if system.plain:
        return ROUNDING * EPSILON * at.size
    first = 1 + system.counts.functions + system.counts.paths
    terms = np.abs(at.interior[:, first : first + system.counts.levels])
    sums = system.weights.ravel() @ terms + np.abs(system.levels)
    return ROUNDING * EPSILON * (at.size + float(np.abs(multipliers) @ sums))


def fine_value(space: Space, state: State, form: Form, count: int) -> float:
    """The functional on a curve with ``count`` Gauss points an element, end cost included."""
    conditions = stationarity(form)
    s, weights = space.quadrature(count)
    tower = space.at_quadrature(state.coefficients, count, 2 * form.order)
    numbers = (form.problem.parameter_values, state.unknowns, state.levels)
    values = conditions.at(s.reshape(-1, 1), np.array(tower), numbers)[:, 0]
    return float(weights.ravel() @ values) + end_cost(form, space, state)


def end_cost(form: Form, space: Space, state: State) -> float:
    """The cost of the ends of a curve, in the sense that is minimised."""
    if form.ends is None or form.problem.end_cost is None:
        return 0.0
    m = space.smoothness
    first, last = state.coefficients[space.numbers[0, 0]], state.coefficients[space.numbers[-1, m]]
    return float(end_cost_function(form)(first, last, form.problem.parameter_values, state.unknowns))


def curve_distance(system: CollocationSystem, old: State, new: State) -> float:
    """The largest distance of ordinates at the same abscissa of the person's, to first order."""
    count = system.points + 3
    (y0, d0), (y1, d1) = (system.space.at_quadrature(state.coefficients, count, 1) for state in (old, new))
    change = y1 - y0
    form = system.form
    if form.lift is not None:
        lifted = []
        s = system.space.quadrature(count)[0].reshape(1, -1)
        for y, d, state in ((y0, d0, old), (y1, d1, new)):
            columns = [np.repeat(v[:, None], s.size, axis=1) for v in (state.unknowns, form.problem.parameter_values)]
            out: Any = form.lift(s, y.reshape(s.size, -1).T, d.reshape(s.size, -1).T, *columns)
            lifted.append([np.asarray(v) for v in out])
        (x0, q0, dx, dq), (x1, q1, _, _) = lifted
        with np.errstate(divide="ignore", invalid="ignore"):
            change = q1 - q0 - dq / dx * (x1 - x0)
        change = change[np.isfinite(change)]
    return float(np.abs(change).max(initial=0.0)) + ROUNDING * EPSILON * float(np.abs(y0).max(initial=0.0))


def _indicators(system: CollocationSystem, residual: Residual, z: np.ndarray, step: np.ndarray) -> np.ndarray:
    """The second variation of the correction, by its leading term, element by element."""
    n, top = system.counts.functions, system.form.order
    change = system.unpack(z + step).coefficients - system.unpack(z).coefficients
    slopes = system.space.at_quadrature(change, system.points, top)[top]
    first = 2 * top * n
    hessian = system.pointwise_jacobian(residual)[:, :, :n, first : first + n]
    terms = np.abs(np.einsum("eqa,eqab,eqb->eq", slopes, hessian, slopes))
    return (terms * system.weights).sum(1)
