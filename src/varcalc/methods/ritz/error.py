"""What a rung is worth: its value by a finer rule, and its error from the next richer space.

The Newton correction there is the estimate: the functional is stationary, so
half its squared length in the Hessian is what the value is too high by, to
leading order (Ciarlet, "The Finite Element Method for Elliptic Problems",
sect. 2.4, for the quadratic case).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from varcalc.formulation import Form
from varcalc.methods.answer import end_cost, sample
from varcalc.methods.ritz.newton import Step, newton_step
from varcalc.methods.ritz.quadrature import shortfall
from varcalc.methods.ritz.rungs import Rung, Rungs
from varcalc.methods.ritz.system import Evaluation, Reported, RitzSystem
from varcalc.symbolic.derived import derived

SAFETY = 1.5
"""The correction leaves out what lies beyond the richer space."""
CURVE = 3e-2
"""Relative error of the curve, in units of the square root of the value's tolerance, that ends the climb."""
ASTRAY, ASTRAY_SHARE = 2e-2, 30.0
"""Relative error of the curve, and the same by the square root of the tolerance, with which no value counts."""
ROUND_OFF = 4e-16
"""Round-off of the value relative to the sum of the absolute contributions."""
SOFT = 1e-2
"""Decrease of the functional, by the size of the step in the metric, that tells of a soft mode."""
COMPLIANT = 1e2
"""Compliance of a step below which no mode is as soft; the banded solver does not tell it, and gives 0."""
LARGEST = 800
"""Unknowns up to which the metric is computed."""
UNMOVED = 1e-7
"""Step of a curve, relative in the metric, that may be made of round-off along a soft mode."""
SLIGHT = 3e-6
"""Relative move of the curve that no merging of extremals explains: they are apart by the root of what is missing."""
CONTRACTION = 0.1
"""Largest ratio of successive Newton steps that counts as evidence of a minimum."""
SHARED = 0.1
"""Share of the last error that two spaces on one mesh may have in common, where a curve touches a bound."""


@dataclass
class Estimate:
    """Errors of a rung.

    ``value`` is the reported functional in the sense that is minimised,
    ``error`` and ``curve`` its error and the curve's, ``scale`` the size of
    what was summed, ``floor`` the round-off that leaves in the value;
    ``system`` the richer space with the rung's curve ``z``
    and the correction ``step`` there (None when it was solved instead);
    ``shares`` each element's part in the correction. ``integrand`` is what was
    summed for ``value`` at the Gauss points, ``miss`` what a unit by which each
    level is missed costs.
    """

    value: float
    error: float
    curve: float
    scale: float
    floor: float
    system: RitzSystem
    z: np.ndarray
    step: Step | None
    shares: np.ndarray
    integrand: np.ndarray
    miss: np.ndarray


def estimate(rungs: Rungs, rung: Rung, previous: float) -> Estimate | str:
    """The errors of a rung, or why they cannot be told; ``previous`` is the error of the rung before."""
    system, z = rungs.prolonged(rung.system, rung.z)
    if rungs.constrained:
        return _by_solving(rungs, rung, system, z, previous)
    at = system.evaluate(z)
    if not math.isfinite(at.value):
        return "the functional is not a number on the trial curve by a finer rule"
    step = newton_step(system, at, rung.multipliers)
    if step is None:
        return "the Newton step in the richer space is not defined (degenerate Hessian)"
    # the finer rule sees the side conditions missed: to first order that costs the multiplier times the miss
    miss = step.multipliers
    moved = z + step.change
    here, there = system.reported(z), system.reported(moved)
    sound = step.definite and _contracts(system, z, step, at)
    error = abs(step.decrement) if sound else math.inf
    if rungs.form.same_functional:
        value, scale = at.value + float(miss @ at.conditions), at.scale
        error += abs(value - rung.at.value)
    else:
        value = functional_at(rungs, system, z, here)
        error = abs(value - functional_at(rungs, system, moved, there)) if sound else math.inf
        if rungs.form.energetic and value > 0:  # the energy is the square of the value
            miss = miss * (0.5 / value)
        value += float(miss @ at.conditions)
        scale = abs(value)
    # a prescribed integral is summed like the value, and what it misses costs its multiplier
    floor = ROUND_OFF * (scale + float(np.abs(miss[: len(system.levels)]) @ np.abs(system.levels)))
    curve, shares = displacement(here, there), _shares(rungs, system, step.change)
    integrand = _with_levels(system, here, at, miss)
    return Estimate(value, SAFETY * error, SAFETY * curve, scale, floor, system, z, step, shares, integrand, miss)


def _contracts(system: RitzSystem, z: np.ndarray, step: Step, at: Evaluation) -> bool:
    """Whether there is a minimum near ``z``, as far as a second Newton step can tell.

    A step that lowers the functional by far less than its own size in the metric
    would have it goes along a soft mode. Where two extremals have just merged and
    vanished there is one, the functional is all but stationary, and what it still
    falls by is no error of anything. Newton's steps do not shrink there (the theorem of
    Newton and Kantorovich).
    """
    if 0.0 < step.compliance < COMPLIANT or system.size > LARGEST:
        return True
    size = 0.5 * float(step.change @ system.metric(at) @ step.change)
    if size <= UNMOVED**2 * at.scale or step.decrement >= SOFT * size:
        return True
    following = newton_step(system, system.evaluate(z + step.change), step.multipliers)
    here, there = (system.reported(y) for y in (z, z + step.change))
    if displacement(here, there) <= SLIGHT * float(np.abs(here.y).max(initial=0.0)):
        return True  # next to a fold the two extremals are further apart than that
    if following is None or not following.definite:
        return False
    beyond = system.reported(z + step.change + following.change)
    return displacement(there, beyond) <= CONTRACTION * displacement(here, there)


def _by_solving(rungs: Rungs, rung: Rung, system: RitzSystem, z: np.ndarray, previous: float) -> Estimate | str:
    """Under pathwise conditions a Newton step says nothing: solve in the richer space and compare."""
    richer = rungs.optimise(system, z, rung.multipliers)
    if isinstance(richer, str):
        return richer
    error = abs(richer.at.value - system.evaluate(z).value) + abs(richer.at.value - rung.at.value)
    if math.isfinite(previous) and (rungs.inequalities or not rungs.form.corners):
        error = max(error, SHARED * previous)
    here, there = system.reported(z), system.reported(richer.z)
    value = richer.at.value if rungs.form.same_functional else functional_at(rungs, system, richer.z, there)
    curve = displacement(here, there)
    shares = _shares(rungs, system, richer.z - z)
    miss = richer.multipliers
    if rungs.form.energetic and value > 0:
        miss = miss * (0.5 / value)
    integrand = _with_levels(system, there, richer.at, miss)
    return Estimate(
        value, SAFETY * error, SAFETY * curve, richer.at.scale, ROUND_OFF * richer.at.scale, system, richer.z, None,
        shares, integrand, miss,
    )  # fmt: skip


def _with_levels(system: RitzSystem, reported: Reported, at: Evaluation, miss: np.ndarray) -> np.ndarray:
    """The reported integrand with those of the levels, each times what a unit of it costs."""
    count = len(system.levels)
    return reported.integrand + system.integrands(at)[:, 1:] @ miss[:count] if count else reported.integrand


def settled(rungs: Rungs, found: Estimate) -> Estimate | str:
    """The estimate with its value by a rule that resolves the integrand of the trial curve.

    A value by a rule that does not may lie below the minimum.
    """
    form, system = rungs.form, found.system

    def sampled(s: np.ndarray) -> np.ndarray:
        values = np.asarray(_reported_with_levels(form)(*sample(rungs.extremal(system, found.z), s)))
        return values[0] + found.miss[: len(system.levels)] @ values[1:]

    samples = found.integrand.reshape(system.space.elements, -1)
    change = shortfall(sampled, system.space.vertices, samples, found.scale)
    if not math.isfinite(change):
        return "the functional is not a number on the trial curve between the points of its rule"
    return found if change == 0.0 else replace(found, value=found.value + change, error=found.error + abs(change))


@derived
def _reported_with_levels(form: Form) -> ca.Function:
    integrands = ca.vertcat(form.functional, *(c.expression for c in form.integrals if c.equality))
    return ca.Function("settled", form.symbols.all, [ca.densify(integrands)])


def functional_at(rungs: Rungs, system: RitzSystem, z: np.ndarray, reported: Reported) -> float:
    """The reported functional, in the sense that is minimised, by the system's own rule."""
    total = float(system.weights @ reported.integrand)
    return total if rungs.form.ends is None else total + end_cost(rungs.extremal(system, z))


def displacement(here: Reported, there: Reported) -> float:
    """Largest distance between two curves: of ordinates at the same abscissa, in the person's coordinates."""
    move = there.y - here.y
    if here.x is not None and here.dx is not None and here.dy is not None and there.x is not None:
        with np.errstate(divide="ignore", invalid="ignore"):
            move = (move - here.dy / here.dx * (there.x - here.x))[:, here.dx != 0]
    return float(np.abs(move).max(initial=0.0))


def _shares(rungs: Rungs, system: RitzSystem, change: np.ndarray) -> np.ndarray:
    """How much each element contributes to the correction: squares of its bubbles, weighed as their energy."""
    space = system.space
    full = np.zeros(space.size)
    full[system.free] = change[: len(system.free)]
    local = full[space.numbers[:, 2 * space.smoothness :]]
    return (local**2).sum((1, 2)) * (2.0 / space.widths) ** (2 * rungs.form.order - 1)
