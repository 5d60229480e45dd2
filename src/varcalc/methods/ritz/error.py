"""What a rung is worth: its value by a finer rule, and its error from the next richer space.

The Newton correction there is the estimate: the functional is stationary, so
half its squared length in the Hessian is what the value is too high by, to
leading order (Ciarlet, "The Finite Element Method for Elliptic Problems",
sect. 2.4, for the quadratic case).

By how much a composite Gauss rule misses an integral is told from its own samples, which give the Legendre coefficients
of the integrand on each element; the rule of Q points integrates a polynomial of degree 2 Q - 1 exactly, so what the
coefficients will have fallen to at 2 Q is what it misses (Trefethen, "Is Gauss quadrature better than
Clenshaw-Curtis?", SIAM Review 50, 2008, sect. 4). Only panels where that is more than round-off are bisected.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.polynomial import legendre

from varcalc.formulation import Reported
from varcalc.formulation.height import FLAT, flat
from varcalc.methods.ritz.elements import stiff
from varcalc.methods.ritz.newton import SQUARED_ROUND_OFF, NullSpace, Step, newton_step
from varcalc.methods.ritz.starts import toward_baseline
from varcalc.methods.ritz.system import Evaluation, RitzSystem
from varcalc.numerics.mesh import gauss
from varcalc.numerics.stacked import positive

if TYPE_CHECKING:
    from varcalc.methods.ritz.method import Rung, Rungs

SAFETY = 1.5
"""The correction leaves out what lies beyond the richer space."""
CURVE = 3e-2
"""Relative error of the curve, in units of the square root of the value's tolerance, that ends the climb."""
VALUE_ROUND_OFF = 4e-16
"""Round-off of the value relative to the sum of the absolute contributions."""
SOFT = 1e-2
"""Decrease of the functional, by the size of the step in the metric, that tells of a soft mode."""
SOFT_MODE = 1e-3
"""Eigenvalues of the second variation, in units of its leading term, that a richer space may lower to zero."""
COMPLIANT, SUSPECT = 1e2, 1e3
"""Compliances of a step below which it does not go along a soft mode, and no mode is soft; 0 where it is not told."""
MOST_UNKNOWNS = 800
"""Unknowns up to which the metric is computed."""
UNMOVED = 1e-7
"""Step of a curve, relative in the metric, that may be made of round-off along a soft mode."""
SLIGHT = 3e-6
"""Relative move of the curve that no merging of extremals explains: they are apart by the root of what is missing."""
CONTRACTION = 0.1
"""Largest ratio of successive Newton steps that counts as evidence of a minimum."""
LAST_STEPS, NOTHING_LEFT = 8, 1e-15
"""Steps looked at where L has narrow features, and decrement, relative to what is summed, that is round-off."""
PANEL_MISS = 1e-14
"""Share of the integral of the absolute value that one panel may miss; samples carry round-off of a tenth of it."""
MOST_ROUNDS = 40
"""Bisections that bring a panel with a kink inside to round-off."""
MOST_BISECTED_PANELS = 4000
"""Panels bisected at once beyond which an integrand is noise."""
UNMOVED_CURVE = 1e-14
"""Relative distance of two curves that is made of rounding."""
SHARED = 1e-4
"""Share of the last error that two spaces on one mesh may have in common, where a curve touches a bound."""


@dataclass(frozen=True)
class NewtonEstimate:
    """What the Newton step in a richer space says of a curve, or of K curves: then each entry has a first axis more.

    ``value`` is the reported functional in the sense that is minimised, ``error`` and ``curve`` its error and the
    curve's, ``scale`` the size of what was summed, in which a prescribed integral counts with its multiplier.
    ``integrand`` (Q,) is what was summed for the value at the Gauss points, ``miss`` what a unit by
    which each condition is missed costs, ``moved`` (Q, k) by how much the step changes the curve and its slopes.
    ``here`` and ``there`` are what is reported of the curve and of the one it is mended to.
    """

    value: Any
    error: Any
    curve: Any
    scale: Any
    integrand: np.ndarray
    miss: np.ndarray
    moved: np.ndarray
    here: Reported
    there: Reported

    @property
    def floor(self) -> Any:
        """The round-off that summing leaves in the value."""
        return VALUE_ROUND_OFF * self.scale


def correction(
    system: RitzSystem, z: np.ndarray, at: Evaluation, change: np.ndarray, miss: np.ndarray, decrement: Any, own: Any,
    poorer: int,
) -> NewtonEstimate:  # fmt: skip
    """The correction of the curve ``z`` by ``change``, which has the multipliers ``miss``; its value was ``own``.

    The finer rule sees the side conditions missed: to first order that costs the multiplier times the miss. The space
    of the curve's own is of the ``poorer`` degree.
    """
    form, moved = system.form, system.moved(change)
    here, there = system.reported(at), system.reported(at, moved)
    if form.same_functional:
        value, scale = at.value + (miss * at.conditions).sum(-1), at.scale
        error = np.abs(decrement) + np.abs(value - own)
    else:
        value = _total(system, z, here)
        error = np.abs(value - _total(system, z + change, there))
        if form.coordinates.energetic:  # the energy is the square of the value
            miss = miss * np.where(value > 0, 0.5 / np.where(value > 0, value, 1.0), 1.0)[..., None]
        value = value + (miss * at.conditions).sum(-1)
        scale = np.abs(value)
    integrand = here.integrand
    if len(system.levels):  # a prescribed integral is summed like the value, and what it misses costs its multiplier
        levels = miss[..., : len(system.levels)]
        scale = scale + np.abs(levels) @ np.abs(system.levels)
        integrand = integrand + (at.integrands[..., 1:] * levels[..., None, :]).sum(-1)
    curve = SAFETY * displacement(here, there)
    error = SAFETY * error * (1.0 + _beyond(system, change, poorer))
    return NewtonEstimate(value, error, curve, scale, integrand, miss, moved, here, there)


def _beyond(system: RitzSystem, change: np.ndarray, poorer: int) -> Any:
    """What lies beyond the richer space; nothing of it where a curve is singular, whose energies are no such series."""
    if any(system.form.coordinates.singular):
        return 0.0
    coefficients = np.zeros((*change.shape[:-1], system.space.size))
    coefficients[..., system.free] = change[..., : len(system.free)]
    return system.space.left_out(coefficients, poorer, system.form.order)


def _total(system: RitzSystem, z: np.ndarray, reported: Reported) -> Any:
    """The reported functional, in the sense that is minimised, by the system's own rule."""
    return (system.weights * reported.integrand).sum(-1) + system.end_cost(z)


def displacement(here: Reported, there: Reported) -> Any:
    """Largest distance between two curves: of ordinates at the same abscissa, in the user's coordinates."""
    move = there.y - here.y
    if there.x is not here.x:
        forward = here.dx[..., None] != 0
        slope = np.where(forward, here.dy / np.where(forward, here.dx[..., None], 1.0), 0.0)
        move = np.where(forward, move - slope * (there.x - here.x)[..., None], 0.0)
    return np.abs(move).max((-2, -1), initial=0.0)


@dataclass(frozen=True)
class Estimate(NewtonEstimate):
    """The errors of a rung.

    ``system`` is the richer space, with the rung's curve ``z``, its evaluation ``at``
    and the Newton ``step`` there; ``shares`` each element's part in the correction. Where it was solved
    instead there is no step, ``z`` is the curve of that minimum, and ``solved`` all that is known of it.
    """

    system: RitzSystem
    z: np.ndarray
    at: Evaluation
    step: Step | None
    shares: np.ndarray
    solved: Rung | None = None
    moved_back: bool = False
    """Whether ``z`` is no longer the rung's curve, but one next to it inside the domain of L."""

    @property
    def suspect(self) -> bool:
        """Whether some mode of the second variation may cost next to nothing."""
        step, at, system = self.step, self.at, self.system
        if step is None or not step.definite:
            return False
        if step.compliance == 0.0 and system.banded:
            return at.legendre > 0.0 and not stiff(system, at, self.z, step.multipliers, SOFT_MODE)
        # where no load moves the curve far, none does
        if step.compliance < SUSPECT:
            return False
        if step.reduced is None or not at.legendre > 0.0:
            return True
        leading = NullSpace(at.jacobian).reduced(system.leading_term(at, self.z))
        return not positive((step.reduced - SOFT_MODE * leading)[None])[0]

    @cached_property
    def size(self) -> float:
        """The largest ordinate, or the largest that is as good as none."""
        largest = float(np.abs(self.at.variables[:, : self.system.n]).max())
        form = self.system.form
        return largest if largest > FLAT * (form.span[1] - form.span[0]) else max(largest, flat(form), 1e-300)


def estimate(rungs: Rungs, rung: Rung, previous: float) -> Estimate | str:
    """The errors of a rung, or why they cannot be told; ``previous`` is the error of the rung before."""
    system, z = rungs.prolonged(rung.system, rung.z)
    if rungs.constrained:
        return _by_solving(rungs, rung, system, z, previous)
    at = system.evaluate(z)
    step = newton_step(system, at, rung.multipliers)
    if step is None and not math.isfinite(at.value + at.gradient.sum()):
        # between the points of the poorer rule the curve has left the domain of L
        return _by_solving(rungs, rung, system, z, previous)
    if step is None:
        return "the Newton step in the richer space is not defined (degenerate Hessian)"
    poorer = rung.system.space.degree
    found = correction(system, z, at, step.change, step.multipliers, step.decrement, rung.value, poorer)
    if not (step.definite and _contracts(system, z, step, at, found)):
        if not math.isfinite(system.evaluate(z + step.change).value):  # the domain of L has an edge in the way
            return _by_solving(rungs, rung, system, z, previous)
        found = replace(found, error=math.inf)
    return Estimate(**vars(found), system=system, z=z, at=at, step=step, shares=_shares(rungs, system, step.change))


def _contracts(system: RitzSystem, z: np.ndarray, step: Step, at: Evaluation, found: NewtonEstimate) -> bool:
    """Whether there is a minimum near a curve, as far as a second Newton step can tell.

    A step that lowers the functional by far less than its own size in the metric
    would have it goes along a soft mode. Where two extremals have just merged and
    vanished there is one, the functional is all but stationary, and what it still
    falls by is no error of anything. Newton's steps do not shrink there (the theorem of
    Newton and Kantorovich).
    """
    # beside what is narrow no step is short beforehand, and where no compliance is told, many elements are for a reason
    if system.form.conditions.knots or step.compliance == 0.0:
        return _ends(system, z, at, step)
    if step.compliance < COMPLIANT:
        return True
    there, moved = found.there, found.curve / SAFETY
    if moved <= SLIGHT * float(np.abs(found.here.y).max(initial=0.0)):
        return True  # next to a fold the two extremals are further apart than that
    if bool(moves_as_it_gains(system, at, found.moved, step.decrement)):
        return True
    again = system.evaluate(z + step.change)
    following = newton_step(system, again, step.multipliers)
    if following is None or not following.definite:
        return False
    beyond = system.reported(again, system.moved(following.change))
    return bool(displacement(there, beyond) <= CONTRACTION * moved)


def _ends(system: RitzSystem, z: np.ndarray, at: Evaluation, step: Step) -> bool:
    """Whether Newton's steps shrink until nothing is left to gain, and do not crawl along a bent valley."""
    nothing = max(NOTHING_LEFT * at.scale, SQUARED_ROUND_OFF * system.quadratic_size(at))
    for _ in range(LAST_STEPS):
        if step.decrement <= nothing:
            return True
        z = z + step.change
        following = newton_step(system, system.evaluate(z), step.multipliers)
        if following is None or not following.definite or following.decrement > CONTRACTION * step.decrement:
            return False
        step = following
    return True


def moves_as_it_gains(system: RitzSystem, at: Evaluation, moved: np.ndarray, decrement: Any) -> Any:
    """Whether a step is so short that it may be round-off, or lowers the functional by what its size asks for."""
    size = 0.5 * system.squared(at, moved)
    return (size <= UNMOVED**2 * at.scale) | (decrement >= SOFT * size)


def _by_solving(rungs: Rungs, rung: Rung, system: RitzSystem, z: np.ndarray, previous: float) -> Estimate | str:
    """Under pathwise conditions a Newton step says nothing: solve in the richer space and compare."""
    richer = rungs.optimise(system, z, rung.multipliers)
    if isinstance(richer, str):
        return richer
    at = system.evaluate(richer.z)
    poorer = rung.system.space.degree
    found = correction(system, richer.z, at, z - richer.z, richer.multipliers, 0.0, richer.value, poorer)
    value = richer.value if rungs.form.same_functional else _total(system, richer.z, found.here)
    unit = (
        0.5 / value if rungs.form.coordinates.energetic and value > 0 else 1.0
    )  # the energy is the square of the value
    before = system.evaluate(z).value
    changes = (richer.value - before if math.isfinite(before) else 0.0), richer.value - rung.value
    error = unit * SAFETY * float(np.abs(changes).sum())
    # what the values of two curves differ by that are one to round-off is round-off
    same = found.curve <= UNMOVED_CURVE * float(np.abs(at.variables[:, : system.n]).max())
    if math.isfinite(previous) and not same and (rungs.inequalities or not rungs.form.coordinates.corners):
        error = max(error, SAFETY * SHARED * previous)
    error += unit * SAFETY * richer.gap
    curve, scale = found.curve, unit * at.scale
    if rungs.inequalities and not rungs.form.coordinates.corners and scale > 0:
        # where a bound begins to hold the curve is off by d: of order d^3 in the value, and of d^2 in the curve
        largest = float(np.abs(at.variables[:, : system.n]).max())
        size = max(scale, unit * system.quadratic_size(at))  # a minimum of zero has no size of its own
        curve = max(curve, largest * min(error / size, 1.0) ** (2 / 3))
    found = replace(found, value=value, error=error, scale=scale, curve=curve)
    # where a condition gives the curve, the rule may still miss what L does along it
    by_rule = missed(found.integrand.reshape(system.space.elements, -1)) * 0.5 * system.space.widths
    shares = _shares(rungs, system, richer.z - z) + by_rule
    return Estimate(**vars(found), system=system, z=richer.z, at=at, step=None, shares=shares, solved=richer)


def settled(found: Estimate) -> Estimate | str:
    """The estimate with its value by a rule that resolves the integrand of the trial curve.

    A value by a rule that does not may lie below the minimum. A curve that leaves the domain of L between the points of
    the rule, where its slope ends at an edge, is moved back by what it takes.
    """
    change = _change(found, found.z, found.integrand)
    if math.isfinite(change):
        return found if change == 0.0 else replace(found, value=found.value + change, error=found.error + abs(change))
    if not len(found.system.levels):
        for z in toward_baseline(found.system, found.z):
            there = found.system.reported(found.system.evaluate(z)).integrand
            change = _change(found, z, there) + float(found.system.weights @ (there - found.integrand))
            if math.isfinite(change):
                error = found.error + abs(change)
                return replace(found, z=z, value=found.value + change, error=error, moved_back=True)
    return "the functional is not a number on the trial curve between the points of its rule"


def _change(found: Estimate, z: np.ndarray, integrand: np.ndarray) -> float:
    """What the rule misses of the functional of a curve ``z`` with this ``integrand``; no number off the domain."""
    system, levels = found.system, found.miss[: len(found.system.levels)]

    def sampled(s: np.ndarray) -> np.ndarray:
        """The integrand, with the levels' multipliers, at s (m,)."""
        source, variables = system.integrands_at(s), system.along(z, s)
        same = system.form.same_functional
        values = source.values(variables)[:, 0] if same else source.reported(variables).integrand
        return values + source.values(variables)[:, 1:] @ levels if len(levels) else values

    return shortfall(sampled, system.space.vertices, integrand.reshape(system.space.elements, -1), found.scale)


def _shares(rungs: Rungs, system: RitzSystem, change: np.ndarray) -> np.ndarray:
    """How much each element contributes to the correction: squares of its bubbles, weighed as their energy."""
    space = system.space
    if space.elements == 1:
        return np.ones(1)
    full = np.zeros(space.size)
    full[system.free] = change[: len(system.free)]
    local = full[space.numbers[:, 2 * space.smoothness :]]
    return (local**2).sum((1, 2)) * (2.0 / space.widths) ** (2 * rungs.form.order - 1)


# quadrature


@lru_cache(maxsize=64)
def _transform(count: int) -> np.ndarray:
    """The matrix from samples at the Gauss points to Legendre coefficients, the upper half of them; (count, rows)."""
    nodes, weights = gauss(count)
    degrees = np.arange(count // 2, count)
    rows = legendre.legvander(nodes, count - 1)[:, count // 2 :] * weights[:, None] * (degrees + 0.5)
    rows.setflags(write=False)
    return rows


def missed(samples: np.ndarray) -> np.ndarray:
    """What the rule misses of the mean over each panel, from ``samples`` (panels, points); shape (panels,).

    The coefficients of the last quarter, taken on to twice the number of
    points at the rate at which they fell from the quarter before.
    """
    count = samples.shape[1]
    coefficients = np.abs(samples @ _transform(count))
    middle = coefficients.shape[1] // 2
    before, last = coefficients[:, :middle].max(1), coefficients[:, middle:].max(1)
    rate = np.minimum(last / np.maximum(before, 1e-300), 1.0)
    return last * rate**4


def shortfall(
    sampled: Callable[[np.ndarray], np.ndarray], vertices: np.ndarray, samples: np.ndarray, scale: float
) -> float:
    """The integral less its composite Gauss sum on ``vertices``.

    ``samples`` (elements, points) are the integrand's values in the sum,
    ``sampled`` gives others at abscissae (m,), and ``scale`` is the integral
    of its absolute value. Zero, and ``sampled`` is not called, where the rule
    was fine enough.
    """
    left, half = vertices[:-1], 0.5 * np.diff(vertices)
    nodes, weights = gauss(samples.shape[1])
    found = 0.0
    for _ in range(MOST_ROUNDS):
        poor = missed(samples) * half > PANEL_MISS * scale
        if not poor.any() or poor.sum() > MOST_BISECTED_PANELS:
            break
        found -= float(half[poor] @ (samples[poor] @ weights))
        half = np.repeat(0.5 * half[poor], 2)
        left = np.repeat(left[poor], 2)
        left[1::2] += 2 * half[1::2]
        samples = sampled((left[:, None] + half[:, None] * (1 + nodes)).ravel()).reshape(len(left), -1)
        found += float(half @ (samples @ weights))
    return found
