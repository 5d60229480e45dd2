"""Answers that may hold a jump: a curve so steep somewhere that its mesh cannot tell it from an upright piece.

Where L grows no faster than the slope, a piece that stands upright costs no more than its height, and the infimum may
be one that no curve attains (Dacorogna, "Direct Methods in the Calculus of Variations", sect. 3.1). The value of the
curves that come near it settles all the same; what does not settle is the curve, by the height of what stands upright.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from varcalc.existence.approach import approached
from varcalc.formulation import formulate
from varcalc.formulation.height import height
from varcalc.problem.breaks import integrals
from varcalc.problem.conditions import Isoperimetric
from varcalc.problem.functional import Functional, arguments_at
from varcalc.problem.problem import Problem
from varcalc.solution import Finding, Solution, refusal
from varcalc.symbolic.derived import answered

DOUBTED = 1e-5
"""Error of a curve, relative to its extent, from which other coordinates are asked."""
UNSETTLED = 3e-4
"""The same from which it is no answer where no coordinates tell more."""
ONE_ABSCISSA = 64 * float(np.finfo(float).eps)
"""Relative distance of two abscissae that are one to round-off."""
STEEP = 30.0
"""Slope, in units of the curve's extent over the interval, from which a curve may be about to stand upright."""
SLOPES = 1e4, 1e6
"""Slopes, in units of the curve's own steepest one, between which the growth of L is seen."""
NO_GRAPH = "what is sought may be no graph y(x), but stand upright or turn back there"
STEEP_FAILURE = 10.0
"""The same of a curve at which a search was given up: it is told why that may be."""
PLACES_FOR_EXTENT = 65
LINEAR = 0.05
"""Relative difference from linear growth between them that the terms which do not grow may make."""


@dataclass(frozen=True)
class Upright:
    """What stands upright in an answer: how high, relative to the curve's extent, it may be, and where."""

    share: float
    x: float
    slope: float

    @property
    def doubtful(self) -> bool:
        """Whether the curve is no answer unless it is known better."""
        return self.share > UNSETTLED

    def sentence(self, value: float) -> str:
        """What is seen of the answer with this value."""
        return (
            f"the value settles near {value:.6g}, but the curve does not: at x = {self.x:.4g} its slope has grown to "
            f"{self.slope:.3g}, and L grows no faster than the slope, so that a jump there may cost as little; "
            "the infimum may not be attained. A Curve may stand upright: state the problem as one"
        )


def upright(solution: Solution) -> Upright | None:
    """What of a graph of first order may stand upright; None where L or the curve's own error leaves no room for it."""
    problem, curve = solution.problem, solution.curve
    if not isinstance(problem, Problem) or problem.order != 1 or curve is None:
        return None
    extent = _extent(solution)
    if solution.extremal is None and (found := _at_one_abscissa(problem, solution, extent)) is not None:
        return found
    if not (extent > 0 and solution.error.curve > DOUBTED * extent):  # a curve that does not move stands nowhere
        return None
    x = np.unique(solution.x)
    with np.errstate(all="ignore"):  # a slope may be infinite at an end
        slopes = curve(x, 1)
    if not np.isfinite(slopes).all():
        return None
    steepest = int(np.argmax(np.abs(slopes).max(0)))
    at, slope = x[[steepest]], slopes[:, [steepest]]
    if not np.abs(slope).max() > STEEP * extent / (x[-1] - x[0]) or not _grows_linearly(
        problem, at, curve(at, 0), slope
    ):
        return None
    return Upright(solution.error.curve / extent, float(at[0]), float(np.abs(slope).max()))


def beyond_graphs(solution: Solution) -> Solution:
    """A failure, told where its curve has grown steep under integral conditions: what is sought may be no graph."""
    problem, curve = solution.problem, solution.curve
    graph = isinstance(problem, Problem) and problem.order == 1 and any(problem.of_type(Isoperimetric))
    if solution.status.ok or solution.verdict is not None or not graph or curve is None:
        return solution
    x = np.unique(solution.x)
    with np.errstate(all="ignore"):
        slopes = np.abs(curve(x, 1)).max(0)
    steepest = int(np.argmax(np.nan_to_num(slopes)))
    if not slopes[steepest] > STEEP_FAILURE * _extent(solution) / (x[-1] - x[0]):
        return solution
    return replace(
        solution,
        message=f"at x = {x[steepest]:.4g} the slope has grown to {slopes[steepest]:.3g}, and {NO_GRAPH}: state "
        f"the problem as a Curve ({solution.message})",
    )


def not_attained(problem: Functional, method: Any) -> Solution | None:
    """The refusal where least polygons rise ever more steeply, and L lets them: no curve attains the infimum.

    None elsewhere. ``method`` is what would have been tried.
    """
    finding = _jumping(problem)
    if finding is None:
        return None
    if any(problem.of_type(Isoperimetric)):
        finding = replace(finding, sentence=f"{finding.sentence}; {NO_GRAPH}: state the problem as a Curve")
    return refusal(problem, method, finding)


@answered
def _jumping(problem: Functional) -> Finding | None:
    if not isinstance(problem, Problem) or problem.order != 1:
        return None
    (a, b), form = problem.span, formulate(problem)
    middle = np.array([0.5 * (a + b)])
    if form.stated.is_lifted or not _grows_linearly(
        problem, middle, form.start.curve(middle), np.ones((problem.n, 1)) * max(1.0, height(form)) / (b - a)
    ):
        return None
    approach = approached(problem, closely=True)
    if approach is None or not approach.concentrates:
        return None
    at, polygon = np.array([approach.where]), approach.last.evaluate
    if not _grows_linearly(problem, at, polygon(at, 0), polygon(at, 1)):
        return None
    return approach.finding


def _at_one_abscissa(problem: Problem, solution: Solution, extent: float) -> Upright | None:
    """What a curve by quadrature, which may be known to any slope, rises by at abscissae that are one to round-off."""
    assert solution.curve is not None
    first, last = solution.interval
    apart = ONE_ABSCISSA * max(abs(first), abs(last), last - first)
    x = np.unique([*solution.x, first + apart, last - apart])
    y, close = solution.curve(x, 0), np.diff(x) <= apart
    rises = np.where(close, np.diff(y), 0.0)
    share = float(np.abs(rises).sum(axis=1).max()) / extent if extent > 0 else 0.0
    if not share > UNSETTLED:
        return None
    k = int(np.argmax(np.abs(rises).max(0)))
    slope = rises[:, [k]] / apart
    if not _grows_linearly(problem, x[[k]], y[:, [k]], slope):
        return None
    return Upright(share, float(x[k]), float(np.abs(slope).max()))


def _extent(solution: Solution) -> float:
    """The largest difference of the ordinates of one function."""
    assert solution.curve is not None
    known = None if solution.extremal is None else solution.extremal.samples  # every solve passes here
    if known is not None:
        return float(np.ptp(known.y, axis=1).max())
    return float(np.ptp(solution.curve(np.linspace(*solution.interval, PLACES_FOR_EXTENT), 0), axis=1).max())


def _grows_linearly(problem: Problem, x: np.ndarray, y: np.ndarray, slope: np.ndarray) -> bool:
    """Whether L grows as the slope does in the direction of the curve's own, and not faster.

    Where integrals are prescribed it is enough that one of them does, and none faster.
    """
    directions = np.repeat(slope, 2, axis=1) * np.array(SLOPES)
    places = arguments_at(problem, np.repeat(x, 2), np.repeat(y, 2, axis=1), directions)
    with np.errstate(all="ignore"):
        values = np.asarray(ca.vertcat(*integrals(problem).call(places)))
        growth = values[:, 1] / values[:, 0] / (SLOPES[1] / SLOPES[0])
    growth = np.where(values[:, 0] == values[:, 1], 0.0, growth)
    return bool(abs(growth.max() - 1.0) <= LINEAR)
