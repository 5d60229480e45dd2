"""Whether a problem at other parameter values, its ends among them, has the form that it has at its own.

Which form is tried first follows from what the Lagrangian does at the ends.
All of that is measured again here, for many values in one go. Where a
measurement comes out differently, or nearly so, the answer is no: then the
forms of that value have to be found for themselves.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from varcalc.conditions import parameters_of
from varcalc.problem import NUDGE, Problem
from varcalc.singular.detection import (
    A_FRACTION,
    ACROSS,
    ASIDE,
    FIT,
    POWERS,
    PROBE,
    QUADRATIC,
    RING,
    SLOPES,
    STEEP,
    SURVEY,
    Blowup,
    end_points,
    rational,
    traced_metric,
)

TURNED = 1e-6
"""Difference of two unit normals that is none."""
PARALLEL = 1e-4
"""By how much normals around an end may differ where a line goes through it."""


class Ends:
    """The ends of ``problem`` at ``values`` (K, m) of its parameters: ``points`` (K, 2, 1 + n), NaN where free."""

    def __init__(self, problem: Problem, values: np.ndarray) -> None:
        self.problem, self.values = problem, values
        self.points = np.tile(np.array(end_points(problem)), (len(values), 1, 1))
        names = list(problem.parameters)
        for end, template in enumerate(problem.templates):
            for name, field, component in parameters_of(template):
                place = 0 if field == "x" else 1 + component
                self.points[:, end, place] = values[:, names.index(name)]

    @cached_property
    def extent(self) -> np.ndarray:
        """The larger extension along an axis, as far as the ends tell; (K,)."""
        known = np.nan_to_num(np.abs(self.points[:, 1] - self.points[:, 0]), nan=0.0, posinf=0.0)
        return known.max(1)

    @cached_property
    def ordered(self) -> np.ndarray:
        """Whether the end lies right of the start; (K,) of bool."""
        return self.points[:, 1, 0] > self.points[:, 0, 0]

    def lagrangian(self, points: np.ndarray, slopes: np.ndarray) -> np.ndarray:
        """L at points (K, M, 1 + n) with slopes that broadcast to (K, M, n); shape (K, M)."""
        count = points.shape[1]
        slopes = np.broadcast_to(slopes, (*points.shape[:2], self.problem.n)).reshape(-1, self.problem.n)
        flat = points.reshape(-1, points.shape[2])
        values = self.problem.integrand_values(
            flat[:, 0], flat[:, 1:].T, slopes.T, np.repeat(self.values, count, axis=0)
        )
        return values.reshape(-1, count)

    @cached_property
    def infinite(self) -> np.ndarray:
        """Where L is infinite or no number at an end, for any slope tried; (K, 2) of bool."""
        points = np.repeat(self.points, len(SLOPES), axis=1)
        values = self.lagrangian(points, np.tile(SLOPES, 2)[:, None])
        finite = np.all(np.isfinite(values).reshape(len(values), 2, -1), axis=2)
        return np.logical_not(finite | np.any(np.isnan(self.points), axis=2))

    @cached_property
    def steep(self) -> np.ndarray:
        """Where L falls so steeply from an end that it may be infinite just beyond, of one function; (K,) of bool."""
        step = ASIDE * self.extent[:, None, None, None]
        offsets = np.array([[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
        around = (self.points[:, :, None] + step * offsets).reshape(len(self.values), -1, 2)
        values = np.abs(self.lagrangian(around, SLOPES[1:2])).reshape(len(self.values), 2, -1)
        least = np.where(np.isnan(values), np.inf, values).min(2)
        return (np.isfinite(values[:, :, 0]) & (least < STEEP * values[:, :, 0])).any(1)

    @cached_property
    def inside(self) -> np.ndarray:
        """Whether L is a number at both ends, however they are approached; (K,) of bool."""
        n = self.problem.n
        aside = np.vstack([np.zeros(n), np.eye(n), -np.eye(n)])
        size = np.maximum(1.0, np.abs(np.nan_to_num(self.points[:, :, 1:])).max(2))
        around = np.repeat(self.points, len(aside), axis=1).reshape(len(self.values), 2, len(aside), -1)
        around[:, :, :, 1:] += NUDGE * size[:, :, None, None] * aside
        rise = np.nan_to_num(self.points[:, 1, 1:] - self.points[:, 0, 1:])
        slopes = rise / (self.points[:, 1, :1] - self.points[:, 0, :1])
        values = self.lagrangian(around.reshape(len(self.values), -1, 1 + n), slopes[:, None])
        nowhere = np.all(np.isnan(values).reshape(len(values), 2, -1), axis=2)
        return np.all(~nowhere | np.any(np.isnan(self.points), axis=2), axis=1)

    def metric(self, conformal: bool) -> np.ndarray:
        """Whether L^2 is quadratic in the slope, and conformal or not, and L of one sign across the problem; (K,)."""
        start = np.where(np.isnan(self.points[:, 0]), self.points[:, 1], self.points[:, 0])[:, None]
        end = np.where(np.isnan(self.points[:, 1]), self.points[:, 0], self.points[:, 1])[:, None]
        points = start + SURVEY[0][:, None] * (end - start)
        points[:, :, 1] += self.extent[:, None] * SURVEY[1]
        values = self.lagrangian(points, SURVEY[2][:, None])
        values = -values if self.problem.maximise else values
        across = values[:, -len(ACROSS) :]
        one_sign = ~(np.isfinite(across) & (across <= 0)).any(1) & np.isfinite(across).any(1)
        sampled = values[:, : -len(ACROSS)].reshape(len(values), -1, len(SLOPES))
        usable = np.all(np.isfinite(sampled) & (sampled > 0), axis=2)
        squares = np.where(usable[:, :, None], sampled, 1.0) ** 2
        fit = squares @ FIT.T
        off = np.abs(fit @ POWERS.T - squares).max(2) > QUADRATIC * squares.max(2)
        skew = np.abs(fit[:, :, 1]) + np.abs(fit[:, :, 2] - fit[:, :, 0]) > QUADRATIC * np.abs(fit[:, :, 0])
        skew = (skew & usable).any(1)
        return one_sign & (usable.sum(1) >= 2) & ~(off & usable).any(1) & (skew != conformal)

    def line(self, end: int, known: Blowup) -> np.ndarray:
        """Whether L falls from an end as from the ``known`` line through it; (K,) of bool."""
        here = self.points[:, end]
        offsets = np.vstack([PROBE[0] * RING.T, np.outer(PROBE, known.normal)])
        points = here[:, None] + self.extent[:, None, None] * offsets
        values, slopes = traced_metric(self.problem, points.reshape(-1, 2).T, np.repeat(self.values, len(offsets), 0))
        values, slopes = values.reshape(len(here), -1), slopes.T.reshape(len(here), -1, 2)
        ring, length = slopes[:, :-2], np.linalg.norm(slopes[:, :-2], axis=2)
        usable = np.isfinite(values[:, :-2]) & (values[:, :-2] > 0) & np.isfinite(length) & (length > 0)
        normals = -ring / np.where(usable, length, 1.0)[:, :, None]
        along = (np.abs(normals @ known.normal) >= 1 - PARALLEL) | ~usable
        first = np.take_along_axis(normals, usable.argmax(1)[:, None, None], 1)[:, 0]
        same = np.abs(first - known.normal).max(1) <= TURNED
        powers = 0.5 * np.log(values[:, -1] / values[:, -2]) / np.log(PROBE[0] / PROBE[1])
        # a power that is no fraction was measured, and may be another one there
        alike = (np.abs(powers - known.power) < A_FRACTION) & (rational(known.power + A_FRACTION / 2) == known.power)
        return usable.any(1) & along.all(1) & same & alike & (here == known.origin).all(1)


def alike(problem: Problem, values: np.ndarray, lines: dict[bool, Blowup], conformal: bool) -> np.ndarray:
    """At which ``values`` (K, m) the first form of a problem is the one that it has at its own values; (K,) of bool.

    ``lines`` are the singular lines through its ends, at the start (True) and the end, ``conformal`` tells the kind
    of its metric where there are any.
    """
    with np.errstate(all="ignore"):
        ends = Ends(problem, values)
        found = ends.ordered & ends.inside
        for end, at_start in enumerate((True, False)):
            found &= ends.infinite[:, end] == (at_start in lines)
            if at_start in lines:
                found &= ends.line(end, lines[at_start])
        if problem.n == 1:
            found &= ~ends.steep
        if lines:
            found &= ends.metric(conformal)
    return found
