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
from varcalc.methods.answer import cost_between, lift
from varcalc.methods.collocation.newton import Sizes, Solve, factorised, measure
from varcalc.methods.collocation.system import CollocationSystem, Residual, State, collocation_space
from varcalc.numerics.mesh import Space
from varcalc.numerics.roots import EPSILON

SAFETY = 1.9
"""The correction leaves out what the richer space is off by: half of the error is left where it is four degrees richer
and the curve just about shown."""
CONTRACTION = 0.1
"""Largest ratio of successive corrections that counts as evidence; one quarter is where roots merge."""
NEGLIGIBLE = 1e-10
"""Relative correction below which the ratio says nothing but round-off."""
CORRECTION_SETTLED = 1e-14
"""Relative size of the next simplified correction that leaves a root as good as any."""
UNMET = 1e-6
"""Share of the residual that the correction of a singular system may leave."""
ROUNDING = 4.0
"""Round-off of a sum, in units of its absolute terms and of the machine's precision."""

Length = Callable[[np.ndarray], Any]
"""The length of a correction relative to the unknowns."""


@dataclass(frozen=True)
class Root:
    """A root of the collocated conditions: the system, the unknowns, the residual there."""

    system: CollocationSystem
    z: np.ndarray
    residual: Residual

    @property
    def state(self) -> State:
        """The curve with its numbers and multipliers."""
        return self.system.unpack(self.z)


@dataclass(frozen=True)
class Correction:
    """Newton's step in a richer space, the simplified one after it, the residual between, and how long the two are.

    Lengths are relative. At K places everything has K along its first axis.
    """

    step: np.ndarray
    after: Residual
    simplified: np.ndarray
    length: Any
    following: Any

    @classmethod
    def of(cls, z: np.ndarray, step: np.ndarray, system: CollocationSystem, solve: Solve, length: Length) -> Correction:
        """The correction of ``z`` by ``step``; ``solve`` is the inverse of the Jacobian at ``z``."""
        after = system.evaluate(z + step)
        simplified = -solve(after.rows)
        return cls(step, after, simplified, length(step), length(simplified))

    @property
    def trusted(self) -> Any:
        """True when there is evidence of an extremal near the curve."""
        return (self.length <= NEGLIGIBLE) | (self.following <= CONTRACTION * self.length)


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
    correction: Correction
    shares: Callable[[], np.ndarray]
    system: CollocationSystem
    z: np.ndarray

    @property
    def trusted(self) -> bool:
        """True when there is evidence of an extremal near the curve."""
        return self.correction.trusted

    @property
    def settled(self) -> bool:
        """True when the corrected curve is a root of the richer space already."""
        following = self.correction.following
        return following * following <= CORRECTION_SETTLED * self.correction.length

    @property
    def indicators(self) -> np.ndarray:
        """The share of each element in the error."""
        return self.shares()


def richer_degree(degree: int) -> int:
    """The degree that follows on the ladder of degrees."""
    return math.ceil(1.5 * degree) + 1


def assess(level: Root, scales: Sizes) -> Assessment | None:
    """The errors of a root; None when its functional, or the richer conditions near it, are not numbers."""
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
    correction = Correction.of(z, step, system, solve, lambda change: measure(weights, change))
    if not (correction.after.finite and math.isfinite(correction.length)):
        return None
    old, new = system.unpack(z), system.unpack(z + step)
    cost = end_cost(form, system.space, old)
    value = base.fine_value(level.state, 2 * degree + 4) + end_cost(form, base.space, level.state)
    floor = rounding(system, before, new.levels * (0.5 / abs(value) if form.coordinates.energetic and value else 1.0))
    if not math.isfinite(value):
        return None
    fine = correction.after.value + end_cost(form, system.space, new)
    beyond = float(system.space.left_out(new.coefficients - old.coefficients, degree, form.order))
    return Assessment(
        value=value,
        value_error=value_error(value, before.value + cost, fine, floor, beyond),
        value_floor=floor,
        curve_error=float(curve_distance(system, old, new)),
        correction=correction,
        shares=lambda: _indicators(system, before, z, step),
        system=system,
        z=z + step + correction.simplified,
    )


def value_error(value: Any, coarse: Any, fine: Any, floor: Any, beyond: Any) -> Any:
    """The error of a ``value``: what correcting the curve changes by the coarse rule, and what that rule misses.

    What lies ``beyond`` the richer space is added in units of both.
    """
    return SAFETY * (1.0 + beyond) * (abs(fine - coarse) + abs(value - coarse)) + floor


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


def rounding(system: CollocationSystem, at: Residual, multipliers: np.ndarray) -> Any:
    """Round-off of the value: of its own sum, and of each prescribed integral, a miss of which costs its multiplier."""
    if system.plain:
        return ROUNDING * EPSILON * at.size
    first = 1 + system.counts.functions + system.counts.paths
    terms = np.abs(at.interior[:, first : first + system.counts.levels])
    sums = system.weights.ravel() @ terms + np.abs(system.levels)
    return ROUNDING * EPSILON * (at.size + float(np.abs(multipliers) @ sums))


def end_cost(form: Form, space: Space, state: State) -> float:
    """The cost of the ends of a curve, in the sense that is minimised."""
    m = space.smoothness
    first, last = state.coefficients[space.numbers[0, 0]], state.coefficients[space.numbers[-1, m]]
    return cost_between(form, first, last, state.unknowns)


def curve_distance(system: CollocationSystem, old: State, new: State) -> Any:
    """The largest distance of ordinates at the same abscissa of the user's, to first order; (K,) at K places."""
    count = system.points + 3
    (y0, d0), (y1, d1) = (system.sampled(state.coefficients, count, 1) for state in (old, new))
    change = y1 - y0
    form = system.form
    if form.lift is not None:
        lifted = []
        s = system.space.quadrature(count)[0].ravel()
        for y, d, state in ((y0, d0, old), (y1, d1, new)):
            sampled = (values.reshape(s.size, -1).T for values in (y, d))
            numbers = form.problem.parameter_values[:, None], state.unknowns[:, None]
            lifted.append(lift(form, [s, *sampled, np.zeros((0, s.size)), *numbers]))
        (x0, q0, dx, dq), (x1, q1, _, _) = lifted
        with np.errstate(divide="ignore", invalid="ignore"):
            change = q1 - q0 - dq / dx * (x1 - x0)
        change = change[np.isfinite(change)]
    axes = None if system.places is None else (1, 2)
    return np.abs(change).max(axes, initial=0.0) + ROUNDING * EPSILON * np.abs(y0).max(axes, initial=0.0)


def _indicators(system: CollocationSystem, residual: Residual, z: np.ndarray, step: np.ndarray) -> np.ndarray:
    """The second variation of the correction, by its leading term, element by element."""
    n, top = system.counts.functions, system.form.order
    change = system.unpack(z + step).coefficients - system.unpack(z).coefficients
    slopes = system.space.at_quadrature(change, system.points, top)[top]
    first = 2 * top * n
    hessian = system.pointwise_jacobian(residual)[:, :, :n, first : first + n]
    terms = np.abs(np.einsum("eqa,eqab,eqb->eq", slopes, hessian, slopes))
    return (terms * system.weights).sum(1)
