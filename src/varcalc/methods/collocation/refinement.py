"""From a root on a coarse mesh to one whose error meets a tolerance."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from varcalc.formulation import Form
from varcalc.methods.answer import answer, unsettled
from varcalc.methods.collocation.error import Assessment, Root, assess
from varcalc.methods.collocation.newton import Sizes, stationary
from varcalc.methods.collocation.system import CollocationSystem, Residual, collocation_space
from varcalc.solution import ErrorEstimate, Solution, Stats, Status

HIGHEST_DEGREE = {1: 40, 2: 30}
"""Degree beyond which elements are bisected instead, by the order of the functional."""
RICHER_FACTOR = 1.5
"""Factor by which the space of the error estimate may exceed that degree."""
BISECTED_SHARE = 0.02
"""Elements with more than this share of the largest contribution to the error are bisected."""
MOST_UNKNOWNS = 6000
MOST_ON_THE_WAY = 1000
"""The same for the stations of a continuation: where one needs more, the path leads to no extremal."""
MOST_MESHES = 60
CLOSED_TO = 1e-10
"""How nearly a periodic curve comes back to its start, in units of its ordinates, at any tolerance of the value."""
PATIENT_REFINEMENTS = 2
"""Refinements after which a curve that does not settle, though the value does, is given up."""
SLOW = 0.8
"""A refinement that leaves more than this share of the error behind is slow."""
GIVEN_UP = 8.0
"""Slow refinements in a row after which a root is given up."""
FEW, LOCAL = 2, 0.25
"""A refinement of so few elements is on its way into a layer, before the error falls; what it counts if it is slow."""
STALLED = 0.3
"""An error that falls by less than this factor in two successive refinements has met round-off."""
STALLED_BY_ROUND_OFF = 1e-11
"""Relative error of the value below which a stall is round-off rather than a failure to converge."""
HIDDEN = "round-off hides whether its root stands for an extremal: a fold may be near"
ON_THE_WAY = 1e-4
"""Tolerance of the stations of a continuation."""
SMALLEST_STRIDE = 1.0 / 128.0
"""Part of the way below which a continuation is given up."""

History = list[tuple[int, float]]
"""Degrees tried on one mesh and the errors of their values."""


@dataclass(frozen=True)
class Improved:
    """A root as far as it was refined, its errors, and whether they meet the tolerance."""

    level: Root
    assessment: Assessment
    status: Status

    def solution(self, method: Any, stats: Stats, message: str = "") -> Solution:
        """The answer of ``method``, in the user's coordinates and with the user's sign."""
        system, a = self.level.system, self.assessment
        form, space = system.form, system.space
        # multipliers of an energy J^2 become those of J by the chain rule
        extremal = system.extremal(self.level.state, 0.5 / abs(a.value) if form.coordinates.energetic else 1.0)
        errors, rule = ErrorEstimate(a.value_error, a.curve_error), 2 * space.degree + 4
        message = message or (self.status.value if self.status is Status.ROUND_OFF else "")
        return answer(extremal, method, form.sign * a.value, errors, space.vertices, stats, self.status, message, rule)

    @property
    def rounded(self) -> bool:
        """True when all that is left of the error is round-off."""
        a = self.assessment
        return a.trusted and a.value_error <= max(2.0 * a.value_floor, STALLED_BY_ROUND_OFF * abs(a.value))


@dataclass
class Refinement:
    """Newton's iteration and the choice of meshes, with a record of what failed and why.

    With ``adaptive`` false every mesh is kept as it is.
    """

    scales: Sizes
    adaptive: bool
    iterations: int = 0
    reasons: list[str] = field(default_factory=list)
    adrift: str = ""
    """What was seen of a root whose value settles though its curve does not; empty where all of them do."""

    def newton(self, system: CollocationSystem, z: np.ndarray, residual: Residual | None = None) -> Root | None:
        """The root that Newton's iteration reaches from ``z``; None, with the reason noted, when it reaches none."""
        outcome = stationary(system, z, self.scales, residual)
        self.iterations += outcome.iterations
        if not outcome.converged:
            return self._failed(outcome.reason)
        return Root(system, outcome.z, outcome.residual)

    def _failed(self, reason: str) -> None:
        self.reasons.append(reason)

    def levels(
        self, level: Root, climbs: Callable[[Root, Assessment], bool], rounds: int, most: int
    ) -> Iterator[tuple[Root, Assessment]]:
        """A root and those on richer and richer meshes, each with its errors, for as long as one leads to the next.

        ``climbs`` tells of a root with its errors whether the next has a higher degree. Otherwise the elements that
        carry the error are bisected, up to ``most`` unknowns.
        """
        slow, before = 0.0, math.inf
        for _ in range(rounds):
            assessment = assess(level, self.scales)
            if assessment is None:
                return self._failed("the linearised conditions are singular in a richer space")
            yield level, assessment
            error = assessment.value_error
            slow, before = 0.0 if error < SLOW * before else slow + _pace(assessment), error
            if slow >= GIVEN_UP:
                return self._failed("refinement after refinement hardly lowered the error")
            climbing = climbs(level, assessment)
            following = self._climbed(assessment) if climbing else self._bisected(level, assessment, most)
            if following is None:
                return None
            level = following
        return self._failed(f"the tolerance was not met after {rounds} refinements")

    def improve(self, level: Root, tol: float, most: int = MOST_UNKNOWNS) -> Improved | None:
        """Refine a root, with at most so many unknowns, until its error meets ``tol``; a kept mesh is only assessed."""
        history: History = []
        best: Improved | None = None
        stalls = adrift = 0
        for root, assessment in self.levels(level, partial(_pays, history, tol), MOST_MESHES, most):
            error, target = assessment.value_error, tol * max(1.0, abs(assessment.value))
            met = assessment.trusted and ((error <= target and not _open(root)) or not self.adaptive)
            if met and not (self.adaptive and self._astray(root, assessment, tol)):
                return Improved(root, assessment, Status.SOLVED)
            adrift = adrift + 1 if met else 0
            if adrift > PATIENT_REFINEMENTS:
                self.adrift = (
                    f"the value settles near {root.system.form.sign * assessment.value:.6g}, but the curve does not"
                )
                return self._failed(self.adrift)
            if not self.adaptive:
                return self._failed("the mesh is too coarse to tell whether its root stands for an extremal")
            stalls = stalls + 1 if best and error > STALLED * best.assessment.value_error else 0
            if best is None or error < best.assessment.value_error:
                best = Improved(root, assessment, Status.ROUND_OFF)
            if stalls >= 2 or error <= 2.0 * assessment.value_floor:
                # finer meshes would only show more of it
                hopeless = stalls >= 2 and error <= STALLED_BY_ROUND_OFF * abs(assessment.value)
                if best.rounded:
                    return best
                if hopeless:
                    return self._failed(HIDDEN)
        return best if best is not None and best.rounded else None

    def _astray(self, level: Root, assessment: Assessment, tol: float) -> bool:
        """Whether the curve does not settle, though the value does: then no curve may attain it."""
        space = level.system.space
        ordinates = space.at_quadrature(level.state.coefficients, space.degree, 0)[0]
        size = max(float(np.abs(ordinates).max()), float(self.scales.functions.max()))
        return assessment.curve_error > unsettled(tol) * size

    def _climbed(self, assessment: Assessment) -> Root | None:
        """The root of a higher degree, near the curve that the error estimate corrected."""
        return self.settled(assessment) or self.newton(assessment.system, assessment.z)

    def _bisected(self, level: Root, assessment: Assessment, most: int) -> Root | None:
        """The root on the mesh whose elements with the largest errors are halved."""
        space, form = level.system.space, level.system.form
        marked = assessment.indicators >= BISECTED_SHARE * assessment.indicators.max()
        middles = 0.5 * (space.vertices[1:] + space.vertices[:-1])
        vertices = np.sort(np.concatenate([space.vertices, middles[marked]]))
        system = CollocationSystem(form, collocation_space(form, vertices, space.degree))
        if system.size > most:
            return self._failed(f"{system.size} unknowns would be needed")
        return self.newton(system, system.pack(level.system.transferred(level.state, system)))

    def settled(self, assessment: Assessment) -> Root | None:
        """The corrected curve of an error estimate, where it is a root of the richer space already."""
        if not assessment.settled:
            return None
        residual = assessment.system.evaluate(assessment.z)
        return Root(assessment.system, assessment.z, residual) if residual.finite else None

    def continued(self, start: Root | None, form_at: Callable[[float], Form]) -> Root | None:
        """Follow a root from ``form_at(0)`` to ``form_at(1)``, refining the mesh on the way.

        The root wanted may not exist on the mesh the path begins with.
        """
        level, reached, stride = start, 0.0, 0.5
        while level is not None and reached < 1.0 and stride >= SMALLEST_STRIDE:
            following = min(1.0, reached + stride)
            system = CollocationSystem(form_at(following), level.system.space)
            trial = self.newton(system, system.pack(level.state))
            if trial is not None and self.adaptive:
                improved = self.improve(trial, ON_THE_WAY, MOST_ON_THE_WAY)
                trial = None if improved is None else improved.level
            if trial is None:
                stride *= 0.5
            else:
                level, reached, stride = trial, following, 1.5 * stride
        return level if reached == 1.0 else None


def _open(level: Root) -> bool:
    """Whether a periodic curve misses its start: where it may be shifted as a whole its momenta alone are closed."""
    system = level.system
    closed = system.form.ends.periodic
    if not closed:
        return False
    ends = system.space.evaluate(level.state.coefficients, np.array(system.form.span))[:closed]
    ordinates = system.space.at_quadrature(level.state.coefficients, system.space.degree, 0)[0]
    return bool(np.abs(ends[:, 1] - ends[:, 0]).max() > CLOSED_TO * np.abs(ordinates).max())


def _pace(assessment: Assessment) -> float:
    """What a slow refinement counts."""
    indicators = assessment.indicators
    marked = int((indicators >= BISECTED_SHARE * indicators.max()).sum())
    return LOCAL if marked <= FEW < len(indicators) else 1.0


def _pays(history: History, tol: float, level: Root, assessment: Assessment) -> bool:
    """Whether to climb the degree, by the ``history`` of this mesh, to which the level is added."""
    space, form = level.system.space, level.system.form
    history.append((space.degree, assessment.value_error))
    target = tol * max(1.0, abs(assessment.value))
    if climbs(history, target, space.elements, assessment.system.space.degree, HIGHEST_DEGREE[form.order]):
        return True
    history.clear()
    return False


def climbs(history: History, target: float, elements: int, following: int, highest: int) -> bool:
    """True when the degree at which the error would meet the target is within reach."""
    if following > RICHER_FACTOR * highest:
        return False
    if len(history) < 2:
        return elements <= 2 and following <= highest
    (before, large), (degree, small) = history[-2:]
    if small >= 0.5 * large:
        return False
    rate = math.log(small / large) / (degree - before)
    return degree + math.log(target / small) / rate <= highest
