"""Newton's method for a discretised functional under a few equality conditions.

A step solves the quadratic model in the null space of the conditions'
Jacobian (Nocedal and Wright, "Numerical Optimization", sect. 16.2 and 18.4);
where the model is not convex there it is shifted by a multiple of a Sobolev
metric. Steps are kept inside the region where the Lagrangian satisfies the
Legendre condition: without that guard a minimisation slides through a
singularity to where the functional has no lower bound.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Any

import numpy as np

from varcalc.formulation.height import height
from varcalc.methods.ritz.elements import (
    COMPLIANT,
    DAMPING,
    NEARLY_SINGULAR,
    banded_step,
    generic_load,
)
from varcalc.methods.ritz.system import Evaluation, RitzSystem
from varcalc.numerics.stacked import applied, positive, solutions
from varcalc.problem.conditions import whole
from varcalc.spelling import spelled

STAGNATED = 1e-9
"""Relative Newton decrement below which a search that finds no descent has met round-off."""
CONVERGED = 1e-11
"""Relative Newton decrement after which one full step leaves only round-off."""
NEARBY = 1e-5
"""Relative Newton decrement beyond which no step is the last one, whatever the tolerance."""
ENOUGH = 1e-2
"""Share of the tolerance by which the quadratic model may be wrong about the last step: its decrement to the 3/2."""
QUICK = 1e-2
"""Share of the decrement before that tells of quadratic convergence: next to a fold an eighth is left each time."""
CRAWLING, NO_DECREMENT = 0.5, 1e-14
"""Share of the decrement before, and relative decrement beyond round-off, that tell of steps that do not shrink.

They go along a bent valley, where what each gains says nothing of what is left."""
ARMIJO = 1e-4
SHRINK = 0.5
SMALLEST_STEP = 1e-10
REGROWTH = 2.0**6
"""How many times the share of the last step is the first that is tried where a whole step does not descend.

Against a kink shares stay as small as 2^-30 for dozens of steps, and each would be halved so many times again."""
SHORT_STEP, SHORTER_IN_A_ROW = 2.0**-16, 4
"""A share of Newton's step, and how many in a row are each less than the one before, that lead nowhere any more.

They run into an edge of the domain of L. Of the descents of the tests that went so none found a minimum, and to be told
that each took twice as long again. Shares of 2^-15 have grown again."""
LARGEST_DENSE = 300
"""Unknowns up to which a dense factorisation is still worth its cube."""
RUNAWAY = 1e9
"""Factor of its starting size below which a functional is taken to have no lower bound."""
NO_NUMBER = "the functional is not a number on the starting curve"
VANISHING = 1e-8
"""Share of its first size below which a functional is on its way to zero."""
SQUARED_ROUND_OFF = 1e-29
"""What the round-off of a curve costs a functional that vanishes: its square, in units of the second derivatives."""
EXPECTED = 2
"""Iterations after which it is asked whether only that is left."""
SETTLING = 5
"""Iterations in which the size of the functional is learnt."""
FEASIBLE = 1e-6
"""Relative miss of a condition at which a step may be the last one."""
MET = 1e-10
"""Relative miss of a condition that is none."""
PENALTY = 1e-3
"""Least weight of a condition's miss in the merit function, in units of the functional by the condition."""
INEFFECTIVE = 1e-14
"""Relative derivative of a level, by what is summed to it, that is made of round-off."""
ROUND_OFF = 1e-14
"""The same where the factorisation went through: a small eigenvalue may be true, and its step needed whole."""
LOADS_OFF_SADDLE, OFF_SADDLE = 3, 1e-2
"""Loads whose answers lead off a saddle, and the first step there, in units of the problem's size."""
SHIFT = -1.5
"""Multiple of the lowest eigenvalue by which a Hessian is shifted that is not positive."""
AT_EDGE = 1e10
"""Factor by which L_y'y' is greater than its median at an edge of the domain of L."""
STIFFENINGS, STIFFER = 12, 4.0
"""Times that a step is stiffened where it leaves the domain of L, and by what factor."""
DEPENDENT = 1e-13
"""Share of the largest gradient of a condition by which another has to differ from it."""
MANY_ITERATIONS, FEW_HALVINGS = 20, 6
"""Newton steps, and halvings of one, after which one value of many is left to a solve of its own."""


@spelled
@dataclass(frozen=True)
class Newton:
    """The guarded Newton iteration. ``iterations`` bounds the steps of one solve.

    Raises TypeError or ValueError where that is not a positive whole number.
    """

    iterations: int = 100

    def __post_init__(self) -> None:
        whole("Newton.iterations", self.iterations)


@dataclass
class Step:
    """A Newton step: the change of the unknowns, the new multipliers, the predicted decrease.

    ``decrement`` is half the squared length of the step in the Hessian: what
    the functional will fall by. ``shift`` is the multiple of the metric that
    was added; ``definite`` tells that none was needed. ``compliance`` is the
    answer to a generic load in units of what the stiffest direction gives: it
    is large when a mode costs next to nothing. ``reduced`` is the Hessian along the conditions, as it was factored.
    Of many values the first three have a first axis for them, and the rest is not told.
    """

    change: np.ndarray
    multipliers: np.ndarray
    decrement: Any
    shift: float = 0.0
    compliance: float = 0.0
    reduced: np.ndarray | None = None

    @property
    def definite(self) -> bool:
        """True when the Hessian was positive on the conditions' null space."""
        return self.shift == 0.0

    def __getitem__(self, rows: np.ndarray) -> Step:
        return Step(self.change[rows], self.multipliers[rows], self.decrement[rows])


@dataclass
class Descent:
    """Where an iteration ended. ``reason`` is empty when it converged to a minimum, ``direct`` tells of whole steps.

    ``gap`` is what bounds that are not quite met leave between the value and the minimum: the sum of each multiplier
    times the room to its bound (Boyd and Vandenberghe, "Convex Optimization", sect. 5.5.1).
    """

    z: np.ndarray
    multipliers: np.ndarray
    value: float
    iterations: int
    reason: str
    direct: bool = False
    gap: float = 0.0


def newton_step(system: RitzSystem, at: Evaluation, multipliers: np.ndarray) -> Step | None:
    """The (shifted, when need be) Newton step from an evaluation; None when there is none."""
    # a sum is a number where all of its terms are
    if not math.isfinite(at.hessians.sum() + at.gradient.sum() + (at.jacobian.sum() if len(at.conditions) else 0.0)):
        return None
    if len(system.levels) and not effective(system, at):
        return None
    if system.banded:
        # of conditions the dense step knows better what to shift by
        shifting = len(at.conditions) == 0 or system.size > LARGEST_DENSE
        found = banded_step(system, at, multipliers, shifting=shifting)
        if found is not None and (shifting or found[3] == 0.0):
            return Step(*found)
        if system.size > LARGEST_DENSE:
            return None
    try:
        return _dense_step(system, at, multipliers)
    except np.linalg.LinAlgError:  # entries of 1e200 and the like: not a matrix to be factored
        return None


def effective(system: RitzSystem, at: Evaluation) -> Any:
    """Whether some change of the curve changes each level by more than round-off.

    None does where a level's integrand is a total derivative.
    """
    count = len(system.levels)
    sizes = (np.abs(at.slopes[..., 1:, :]) * system.first[..., None, :]).sum((-3, -1))
    return np.all(np.abs(at.jacobian[..., :count, :]).max(-1, initial=0.0) > INEFFECTIVE * sizes, axis=-1)


class NullSpace:
    """The directions that keep conditions with a Jacobian (.., m, N) to first order; all of them where m is 0."""

    def __init__(self, jacobian: np.ndarray) -> None:
        self.count, self._jacobian = jacobian.shape[-2], jacobian
        m = self.count
        if m:
            q, r = np.linalg.qr(jacobian.swapaxes(-1, -2), mode="complete")
            self._across, self.basis, self._r = q[..., :m], q[..., m:], r[..., :m, :]

    @cached_property
    def _reflections(self) -> tuple[np.ndarray, np.ndarray]:
        """V and W (.., N, m) with [across, basis] = I - W V'."""
        m, (raw, scales) = self.count, np.linalg.qr(self._jacobian.swapaxes(-1, -2), mode="raw")
        v = np.tril(raw.swapaxes(-1, -2), -1)
        v[..., range(m), range(m)] = 1.0
        w = np.zeros_like(v)
        for j in range(m):
            before = applied(w[..., :j], applied(v[..., :j].swapaxes(-1, -2), v[..., j]))
            w[..., j] = scales[..., [j]] * (v[..., j] - before)
        return v, w

    @property
    def independent(self) -> Any:
        """Whether no condition's gradient is a combination of the others'."""
        if not self.count:
            return True
        sizes = np.abs(np.diagonal(self._r, axis1=-2, axis2=-1))
        return sizes.min(-1) > DEPENDENT * sizes.max(-1)

    def reduced(self, matrices: np.ndarray) -> np.ndarray:
        """Symmetric quadratic forms (.., N, N) on these directions."""
        if not self.count:
            return matrices
        if self.count >= matrices.shape[-1]:
            return self.basis.swapaxes(-1, -2) @ matrices @ self.basis
        # Q = I - W V' (Schreiber and Van Loan, SIAM J. Sci. Stat. Comput. 10, 1989), so that Q'M Q takes no product of
        # matrices as large as M: few conditions cost next to nothing
        m, (v, w) = self.count, self._reflections
        applied_to = matrices @ w
        both = v @ (w.swapaxes(-1, -2) @ applied_to)
        part = applied_to - 0.5 * both
        change = part[..., m:, :] @ v[..., m:, :].swapaxes(-1, -2)
        return matrices[..., m:, m:] - change - change.swapaxes(-1, -2)

    def along(self, gradients: np.ndarray) -> np.ndarray:
        """Linear forms (.., N) on these directions."""
        return applied(self.basis.swapaxes(-1, -2), gradients) if self.count else gradients

    def step(self, tangents: np.ndarray, normal: Any) -> np.ndarray:
        """The step along these directions and across them."""
        return normal + applied(self.basis, tangents) if self.count else tangents

    def back(self, conditions: np.ndarray) -> Any:
        """The least step that makes up for missing the conditions by so much."""
        return -applied(self._across, solutions(self._r.swapaxes(-1, -2), conditions)) if self.count else 0.0

    def multipliers(self, slopes: np.ndarray) -> np.ndarray:
        """The multipliers that cancel slopes (.., N) across, where there are conditions."""
        return -solutions(self._r, applied(self._across.swapaxes(-1, -2), slopes))


class QuadraticModel:
    """The quadratic model from an evaluation under the linearised conditions, of one value or of many.

    ``reduced`` and ``slope`` are its Hessian and its gradient on the directions that keep the conditions.
    """

    def __init__(self, at: Evaluation, hessian: np.ndarray) -> None:
        self._at, self._hessian, self.null = at, hessian, NullSpace(at.jacobian)
        self._normal = self.null.back(at.conditions)
        self.reduced = self.null.reduced(hessian)
        self.slope = self.null.along(self._gradient(self._normal))

    def _gradient(self, change: Any) -> np.ndarray:
        return self._at.gradient + applied(self._hessian, change) if self.null.count else self._at.gradient

    def step(self, tangent: np.ndarray, shift: float = 0.0, compliance: float = 0.0) -> Step:
        """The step that goes by ``tangent`` along the conditions."""
        change = self.null.step(tangent, self._normal)
        multipliers = self.null.multipliers(self._gradient(change)) if self.null.count else self._at.conditions
        decrement = -0.5 * (tangent * self.slope).sum(-1)
        return Step(change, multipliers, decrement, shift, compliance, self.reduced)


def _dense_step(system: RitzSystem, at: Evaluation, multipliers: np.ndarray) -> Step | None:
    """The step by null-space reduction and dense factorisation."""
    hessian = system.hessian(at, multipliers)
    model = QuadraticModel(at, hessian)
    if not model.null.independent:
        return None
    solved, shift = _solved(model.reduced, model.slope), 0.0
    if solved is None or (solved[1] > COMPLIANT and at.legendre > 0.0):
        metric = system.metric(at)
        measured = model.null.reduced(metric)
        if solved is not None and positive((model.reduced - ROUND_OFF * measured)[None])[0]:
            return model.step(solved[0], shift, solved[1])  # no eigenvalue is as small as round-off
        lowest = lowest_eigenvalue(model.reduced, measured)
        if not math.isfinite(lowest):
            return None
        zero_mode = abs(lowest) < (NEARLY_SINGULAR if solved is None else ROUND_OFF)
        if zero_mode or lowest < 0:
            shift = DAMPING if zero_mode else SHIFT * lowest
            model = QuadraticModel(at, hessian + shift * metric)
            solved = _solved(model.reduced, model.slope)
        if solved is None:
            return None
        if zero_mode:  # the curvature across it is positive; only the step along it was held
            solved, shift = (solved[0], math.inf), 0.0
    return model.step(solved[0], shift, solved[1])


def _solved(matrix: np.ndarray, slope: np.ndarray) -> tuple[np.ndarray, float] | None:
    """The Newton step and the compliance of a positive matrix; None of any other."""
    if not len(matrix):
        return slope, 0.0
    load, length = generic_load(len(matrix))
    _, both, failed = _dposv()(matrix, np.array([-slope, load]).T)
    if failed:
        return None
    answer = both[:, 1]
    compliance = math.sqrt(answer @ answer) * np.abs(matrix.diagonal()).max(initial=0.0) / length
    return both[:, 0], float(compliance)


@lru_cache(maxsize=1)
def _dposv() -> Callable[..., Any]:
    """LAPACK's own solution by Cholesky's factors: NumPy's two calls cost ten times as much on a small matrix."""
    from scipy.linalg.lapack import dposv  # loaded by the first solve, not with the package

    return dposv


def load() -> None:
    """Load what takes a tenth of a second once in a process, and is no part of a solve."""
    _dposv()


def first_multipliers(at: Evaluation) -> np.ndarray:
    """Least-squares multipliers: those that make the gradient of the Lagrangian function smallest.

    With none at all an isoperimetric problem may look concave, the convexity
    being in the constraint. They are 0 where they would be no numbers.
    """
    J = at.jacobian
    if J.shape[-2] == 1:
        squares = (J**2).sum(-1)
        found = -(J * at.gradient[..., None, :]).sum(-1) / np.where(squares > 0, squares, 1.0)
    else:
        finite: Any = np.isfinite(J).all((-1, -2))
        found = -applied(np.linalg.pinv(np.where(finite[..., None, None], J, 0.0).swapaxes(-1, -2)), at.gradient)
    return np.where(np.isfinite(found).all(-1, keepdims=True), found, 0.0)


def lowest_eigenvalue(matrix: np.ndarray, metric: np.ndarray) -> float:
    """Least eigenvalue of the pencil (matrix, metric)."""
    try:
        factor = np.linalg.cholesky(metric)
    except np.linalg.LinAlgError:
        return math.nan
    half = np.linalg.solve(factor, matrix)
    return float(np.linalg.eigvalsh(np.linalg.solve(factor, half.T))[0])


def minimise(
    system: RitzSystem, z: np.ndarray, multipliers: np.ndarray, newton: Newton, tol: float = 0.0, *, edged: bool = False
) -> Descent:
    """Iterate from ``z`` to a minimum of the discretised functional, good enough for a value to the tolerance.

    Where the domain of L is ``edged`` next to the minimum, the last step is not taken blindly.
    """
    at = system.evaluate(z)
    if not _finite(at):
        return Descent(z, multipliers, at.value, 0, NO_NUMBER)
    multipliers = first_multipliers(at) if len(multipliers) and not multipliers.any() else multipliers
    guarded = at.legendre > 0.0 and len(at.conditions) == 0
    enough = _enough(at, tol, edged=edged)
    begun, largest, direct, before = at.scale, at.scale, True, 0.0
    length, blocked_lengths = 1.0, list[float]()
    for iteration in range(1, newton.iterations + 1):
        step = newton_step(system, at, multipliers)
        if step is None:
            return Descent(z, multipliers, at.value, iteration, "the Newton step is not defined (degenerate Hessian)")
        multipliers = step.multipliers
        # along a zero mode the functional need not stop falling, however large its terms become
        decrement = _decrement(system, at, step, largest, begun if math.isinf(step.compliance) else math.inf)
        late = iteration > EXPECTED
        step = _within_edges(system, z, at, step) if edged else step
        if _converged(decrement, before, *enough) or (late and _is_round_off(system, at, step, decrement)):
            ended = _ended(system, z, at, step, iteration, direct=direct, edged=edged)
            if math.isfinite(ended.value):
                return ended
        following = None if _aground(blocked_lengths) else _search(system, z, at, step, guarded, length)
        if not step.definite and step.decrement <= STAGNATED * at.scale:
            following = _off_saddle(system, z, at, step, guarded) or following
        if following is None:
            nothing_left = decrement <= STAGNATED or _is_round_off(system, at, step, decrement)
            reason = _unmet(system, at) if nothing_left else "no step along the Newton direction descends"
            return Descent(z, multipliers, at.value, iteration, reason, gap=edged * step.decrement)
        (z, at, length, blocked), before = following, decrement
        blocked_lengths.append(length if blocked else 1.0)
        direct = direct and length == 1.0 and step.definite
        if iteration <= SETTLING:
            largest = max(largest, at.scale)
        elif at.value < -RUNAWAY * largest:
            return Descent(z, multipliers, at.value, iteration, "the functional appears to have no lower bound")
    return Descent(z, multipliers, at.value, newton.iterations, f"no convergence within {newton.iterations} iterations")


def _off_saddle(
    system: RitzSystem, z: np.ndarray, at: Evaluation, step: Step, guarded: bool
) -> tuple[np.ndarray, Evaluation, float, bool] | None:
    """A curve beside a saddle that is lower, as :func:`_search` returns it; None where none is found.

    Where the gradient vanishes Newton's step does. The shifted matrix answers a generic load, and its answers as loads
    in their turn, along its softest mode, which leads down (More and Sorensen, Mathematical Programming 16, 1979).
    """
    change = generic_load(len(z))[0]
    for _ in range(LOADS_OFF_SADDLE):
        loaded = newton_step(system, replace(at, gradient=-change, conditions=0.0 * at.conditions), step.multipliers)
        if loaded is None or not (largest := float(np.abs(loaded.change).max(initial=0.0))) > 0:
            return None
        change = loaded.change / largest
    away = replace(step, change=OFF_SADDLE * height(system.form) * change)
    found = _search(system, z, at, away, guarded, 1.0)
    return found if found is not None and found[1].value < at.value else None


def _enough(at: Evaluation, tol: float, *, edged: bool) -> tuple[float, float]:
    """The relative decrement that ends an iteration, and the one that does where it is reached quickly."""
    if edged:  # no quadratic model is good there
        return NO_DECREMENT, NO_DECREMENT
    # conditions have to be met whatever the tolerance of the value
    return CONVERGED, CONVERGED if len(at.conditions) else min(max(CONVERGED, (ENOUGH * tol) ** (2 / 3)), NEARBY)


def _converged(decrement: float, before: float, enough: float, quickly: float) -> bool:
    """Whether a relative decrement is ``enough``, or fell ``quickly`` enough from the one before."""
    crawls = decrement > max(CRAWLING * before, NO_DECREMENT) and before > 0.0
    return decrement <= min(quickly, QUICK * before) or (decrement <= enough and not crawls)


def _aground(lengths: Sequence[float]) -> bool:
    """Whether steps of these ``lengths`` go ever more slowly towards an edge of the domain of L."""
    last = lengths[-SHORTER_IN_A_ROW:]
    return len(last) == SHORTER_IN_A_ROW and last[-1] < SHORT_STEP and all(b < a for a, b in pairwise(last))


def edge_met(system: RitzSystem, at: Evaluation) -> bool:
    """Whether a curve has run into an edge of the domain of L: somewhere L is far more curved in a slope than usual."""
    stiffness = np.abs(at.hessians[:, 0, system.top, system.top].diagonal(0, 1, 2)).max(1)
    return not bool(stiffness.max() <= AT_EDGE * np.median(stiffness))


def _within_edges(system: RitzSystem, z: np.ndarray, at: Evaluation, step: Step) -> Step:
    """The step, stiffened at the points at which it would leave the domain of L, so that it is whole at all others."""
    hessians = at.hessians
    for _ in range(STIFFENINGS):
        there = system.evaluate(z + step.change)
        beyond = ~np.isfinite(there.integrands.sum(-1) + there.hessians.sum((-3, -2, -1)))
        if not beyond.any():
            break
        hessians = np.where(beyond[:, None, None, None], STIFFER * hessians, hessians)
        shorter = newton_step(system, replace(at, hessians=hessians), step.multipliers)
        if shorter is None:
            break
        step = replace(shorter, decrement=step.decrement, shift=step.shift)
    return step


def _ended(
    system: RitzSystem, z: np.ndarray, at: Evaluation, step: Step, iteration: int, *, direct: bool, edged: bool
) -> Descent:
    """The end of an iteration one full step from ``z``, its value no number where that leads over an edge."""
    if edged:
        last = system.evaluate(z + step.change)
        return Descent(z + step.change, step.multipliers, last.value, iteration, _unmet(system, last), direct)
    if not len(at.conditions):  # the quadratic model is as good as another evaluation
        return Descent(z + step.change, step.multipliers, at.value - step.decrement, iteration, "", direct)
    last = system.evaluate(z + step.change)
    if _finite(last):
        z, at = z + step.change, last
    return Descent(z, step.multipliers, at.value, iteration, _unmet(system, at), direct)


def _decrement(system: RitzSystem, at: Evaluation, step: Step, largest: float, most: float) -> float:
    """The relative Newton decrement, infinite away from the conditions or where the Hessian was shifted.

    A functional whose minimum is zero loses its own scale on the way; what it
    began with (``largest``) then is the measure. It is ``most`` what it may be measured by, where that is not zero.
    """
    if not step.definite or (len(at.conditions) and missed(system, at, FEASIBLE)):
        return math.inf
    scale = min(max(at.scale, VANISHING * largest), most or math.inf)
    if len(at.conditions):
        scale += float(_cost_of_conditions(system, at, step))
    if scale > 0:
        return step.decrement / scale
    # a functional that is zero all along has no size of its own, and a gradient even so
    return 0.0 if _is_round_off(system, at, step, step.decrement) else math.inf


def _cost_of_conditions(system: RitzSystem, at: Evaluation, step: Step) -> Any:
    """What the conditions cost at their multipliers, a part of what is summed.

    Multipliers that are far too large, as those of a curve that no condition feels, would make any step a short one:
    those that cancel the gradient best are the same at a minimum.
    """
    multipliers = np.minimum(np.abs(step.multipliers), np.abs(first_multipliers(at)))
    return (multipliers * system.sizes(at)).sum(-1)


def _is_round_off(system: RitzSystem, at: Evaluation, step: Step, decrement: float) -> bool:
    """Whether a step gains no more than the round-off of the curve costs: the end where the minimum is zero."""
    return math.isfinite(decrement) and step.decrement <= SQUARED_ROUND_OFF * system.quadratic_size(at)


def _finite(at: Evaluation) -> bool:
    return math.isfinite(at.value + at.gradient.sum() + (at.conditions.sum() if len(at.conditions) else 0.0))


def missed(system: RitzSystem, at: Evaluation, share: float) -> Any:
    """Whether some condition is missed by more than a share of its size."""
    return (np.abs(at.conditions) > share * system.sizes(at)).any(-1)


def _unmet(system: RitzSystem, at: Evaluation) -> str:
    """Why a converged iterate is no answer after all: a condition that stays short of its level."""
    if not len(at.conditions) or not missed(system, at, MET):
        return ""
    return f"the side conditions are missed by {float(np.abs(at.conditions).max()):.2g}"


class _Merit:
    """The l1 merit function from an evaluation along a step: the functional, and what missing the conditions costs."""

    def __init__(self, system: RitzSystem, at: Evaluation, step: Step) -> None:
        self._count, penalty = at.conditions.shape[-1], 0.0
        if self._count:
            scale = np.asarray(at.scale)[..., None]
            self._weights = 2.0 * np.abs(step.multipliers) + PENALTY * scale / system.sizes(at)
            penalty = (self._weights * np.abs(at.conditions)).sum(-1)
        self._here = at.value + penalty
        self._slope = np.minimum((step.change * at.gradient).sum(-1) - penalty, 0.0)
        self._noise = 1e-14 * (at.scale + np.abs(self._here))

    def falls(self, trial: Evaluation, length: float, rows: Any = ()) -> Any:
        """Whether it is lower at a ``trial`` on the way, of many values for some ``rows`` of them."""
        value = trial.value
        if self._count:
            value = value + (self._weights[rows] * np.abs(trial.conditions)).sum(-1)
        return value <= self._here[rows] + ARMIJO * length * self._slope[rows] + self._noise[rows]


def _search(
    system: RitzSystem, z: np.ndarray, at: Evaluation, step: Step, guarded: bool, last: float
) -> tuple[np.ndarray, Evaluation, float, bool] | None:
    """Backtrack on the l1 merit function; trial curves outside the domain or the guard are rejected.

    The curve, what is there, the share of the step that was taken, and whether the longer one tried before was rejected
    for that. Of the step before the share ``last`` was taken.

    A full step along curved conditions leaves them by its square, which the merit
    function may not forgive however good the step (Maratos; Nocedal and Wright, sect. 18.3): it is then
    corrected to second order once.
    """
    merit = _Merit(system, at, step)

    def admitted(trial: Evaluation) -> bool:
        return bool(_finite(trial) and not (guarded and trial.legendre <= 0.0))

    length, blocked = 1.0, False
    while length > SMALLEST_STEP:
        moved = z + length * step.change
        trial = system.evaluate(moved)
        if admitted(trial) and merit.falls(trial, length):
            return moved, trial, length, blocked
        if length == 1.0 and len(at.conditions) and _finite(trial):
            moved = moved + NullSpace(at.jacobian).back(trial.conditions)
            trial = system.evaluate(moved)
            if admitted(trial) and merit.falls(trial, length):
                return moved, trial, length, blocked
        length, blocked = min(length, REGROWTH * last) * SHRINK, not admitted(trial)
    return None


# Many values at once: the same iteration, in which those that are done or given up are left out. What takes more than
# that is left to a solve of its own, where zero modes, banded steps and reasons are asked for: one value counts calls,
# and a mask of one costs as much as a step.


@dataclass
class Minima:
    """Where the iterations of ``K`` values ended: each entry has a first axis for them; ``found`` tells which count."""

    z: np.ndarray
    multipliers: np.ndarray
    value: np.ndarray
    found: np.ndarray
    iterations: int = 0

    def __getitem__(self, rows: np.ndarray) -> Minima:
        return Minima(self.z[rows], self.multipliers[rows], self.value[rows], self.found[rows], self.iterations)


def sound(system: RitzSystem, at: Evaluation) -> np.ndarray:
    """Where everything is a number, and Legendre's condition holds or every level can be changed; (K,) of bool."""
    found = np.isfinite(at.value) & np.isfinite(at.gradient).all(-1)
    if not len(system.levels):
        return found & (at.legendre > 0.0)
    return found & np.isfinite(at.conditions).all(-1) & np.isfinite(at.jacobian).all((-1, -2)) & effective(system, at)


def minima(system: RitzSystem, z: np.ndarray, *, shifting: bool) -> Minima:
    """Newton's guarded iteration from ``z`` (K, N) for the values that ``system`` stands for.

    Where a Hessian is not positive it is shifted, or, without ``shifting``, the value is given up; so is one where no
    step descends.
    """
    rows, count = np.arange(len(z)), len(system.levels)
    ended = Minima(z.copy(), np.zeros((len(z), count)), np.full(len(z), np.inf), np.zeros(len(z), dtype=bool))
    at = system.evaluate(z)
    multipliers, kept = first_multipliers(at) if count else at.conditions, sound(system, at)
    while ended.iterations < MANY_ITERATIONS:
        if not kept.all():
            rows, system, at, multipliers = rows[kept], system.restricted(kept), at[kept], multipliers[kept]
        if not len(rows):
            break
        ended.iterations += 1
        model = QuadraticModel(at, system.hessian(at, multipliers))
        kept = definite = positive(model.reduced)
        if not kept.all():
            if not shifting:
                continue
            model = _shifted(system, at, multipliers, model, definite)
        steps = model.step(-solutions(model.reduced, model.slope))
        scale = at.scale
        if count:
            scale = scale + _cost_of_conditions(system, at, steps)
            definite = definite & ~missed(system, at, FEASIBLE)
        last = definite & (steps.decrement <= CONVERGED * scale)
        if last.any():
            _end(ended, rows[last], system.restricted(last), at[last], steps[last])
            rows, system, at, steps = rows[~last], system.restricted(~last), at[~last], steps[~last]
            if not len(rows):
                break
        kept, ended.z[rows], at = _searched(system, ended.z[rows], at, steps)
        multipliers = steps.multipliers
    return ended


def _end(ended: Minima, rows: np.ndarray, system: RitzSystem, at: Evaluation, steps: Step) -> None:
    """The end of some of the iterations one full step from where they are."""
    ended.z[rows] += steps.change
    ended.multipliers[rows] = steps.multipliers
    if not len(system.levels):  # the quadratic model is as good as another evaluation
        ended.value[rows], ended.found[rows] = at.value - steps.decrement, True
        return
    last = system.evaluate(ended.z[rows])
    ended.value[rows], ended.found[rows] = last.value, np.isfinite(last.value) & ~missed(system, last, MET)


def _shifted(
    system: RitzSystem, at: Evaluation, multipliers: np.ndarray, model: QuadraticModel, definite: np.ndarray
) -> QuadraticModel:
    """The model with the Hessians made positive that are not so along the conditions."""
    hessians = system.hessian(at, multipliers)
    for k in np.flatnonzero(~definite):
        metric = system.restricted(np.array([k])).metric(at[np.array([k])])
        lowest = lowest_eigenvalue(model.reduced[k], NullSpace(at.jacobian[k]).reduced(metric[0]))
        # along a symmetry, or where there is no metric, nothing tells how far to go
        hessians[k] += (SHIFT * lowest if lowest < -NEARLY_SINGULAR else np.nan) * metric[0]
    return QuadraticModel(at, hessians)


def _searched(
    system: RitzSystem, z: np.ndarray, at: Evaluation, steps: Step
) -> tuple[np.ndarray, np.ndarray, Evaluation]:
    """:func:`_search` for many values: where the merit function falls, the curves there and what is there."""
    merit, moved = _Merit(system, at, steps), z + steps.change
    trial = system.evaluate(moved)
    found = sound(system, trial) & merit.falls(trial, 1.0)
    length, correcting = 1.0, len(system.levels) > 0
    for _ in range(FEW_HALVINGS + correcting):
        left = np.flatnonzero(~found)
        if not len(left):
            break
        if correcting:
            shorter = moved[left] + NullSpace(at.jacobian[left]).back(trial.conditions[left])
        else:
            length *= SHRINK
            shorter = z[left] + length * steps.change[left]
        correcting, part = False, system.restricted(left)
        there = part.evaluate(shorter)
        good = sound(part, there) & merit.falls(there, length, left)
        moved[left[good]] = shorter[good]
        trial.enter(left[good], there[good])
        found[left[good]] = True
    return found, moved, trial
