"""Shooting from a lattice of initial slopes: for several unknown functions, and for ends that slide.

With more than one number open at the start no scan is complete. The shooting
equations are solved from slopes in all directions and of many sizes instead
(Newton's iteration with exact sensitivities, damped), each root counting once.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np

from varcalc.formulation import Form, Sampled
from varcalc.formulation.height import height
from varcalc.integrators import compiled, for_many
from varcalc.methods.shooting.flow import EulerLagrangeFlow, Scales
from varcalc.methods.shooting.initial_states import nus
from varcalc.methods.shooting.newton import Termination, iterate
from varcalc.methods.shooting.regular_arc import Work
from varcalc.methods.shooting.segments import Segments
from varcalc.methods.shooting.shots import Failure
from varcalc.search.end_map import TRAJECTORY_POINTS

SLOPE_SIZES = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
"""Sizes of the initial slope, in units of the problem's size by its width."""
LATTICE_DIRECTIONS = 24
"""Directions in a plane."""
END_DISTANCES = (1.0, 0.5, 2.0, 4.0)
"""Distances at which a sliding end is first put, in units of the one that was guessed."""
MOST_FUNCTIONS = 3
"""Unknown functions up to which directions are covered."""
WORK_PER_START = 60
"""Integrations granted to one start, long ones counting as several."""
WORST_GROWTH = 1e12
"""Growth of errors on the way beyond which a trajectory tells nothing."""
SAME_ROOT = 1e-8


def shootable(form: Form) -> bool:
    """True for a first-order functional whose trajectories are fixed by their start and by numbers without levels."""
    plain = form.order == 1 and form.n <= MOST_FUNCTIONS and not (form.ends.periodic or form.conditions.knots)
    bare = not (
        form.conditions.integrals or form.conditions.pathwise or form.coordinates.weak_only or form.coordinates.gauged
    )
    same = form.lift is None or (form.ends.joint is not None and form.n == form.problem.n)  # a change of abscissa only
    return plain and bare and same and not np.isnan(form.ends.start).any()


@dataclass(frozen=True)
class StartLattice:
    """The starts for one ``shootable`` form and the roots they lead to."""

    form: Form

    @cached_property
    def equations(self) -> EulerLagrangeFlow:
        """The Euler-Lagrange equation as a first-order system."""
        return EulerLagrangeFlow(self.form)

    @cached_property
    def _segments(self) -> Segments:
        """One segment over the whole interval."""
        unit = max(height(self.form), float(np.abs(self.form.ends.start).max()))
        units = Scales(np.full(self.form.n, unit), np.ones(self.equations.integrals))
        flow = compiled(self.form.problem, for_many(), self.equations.system.system)
        return Segments(self.equations, flow, Work(), units, np.array([0.0, 1.0]), np.array([0.0]), {})

    def slopes(self) -> Iterator[np.ndarray]:
        """Initial slopes (n,) in scaled units, the small ones first."""
        yield np.zeros(self.form.n)
        for length in SLOPE_SIZES:
            yield from length * _directions(self.form.n)

    def roots(self) -> list[tuple[np.ndarray, Form, Sampled]]:
        """Of the roots found the initial slopes, scaled, the form with their unknown numbers, the trajectories."""
        segments = self._segments
        found: list[np.ndarray] = []
        for slope, numbers in product(self.slopes(), self._numbers()):
            x = self._first(segments, slope, numbers)
            floor = np.maximum(np.abs(x), 1.0)
            result = iterate(segments, x, floor, WORST_GROWTH, WORK_PER_START)
            if result.ending is Termination.CONVERGED and not any(_same(result.x, other) for other in found):
                found.append(result.x)
        n, curves = self.form.n, [self._curve(segments, x) for x in found]
        starts = [replace(self.form.start, unknowns=segments.parts(x)[1]) for x in found]
        return [
            (x[n : 2 * n], replace(self.form, start=start), curve)
            for x, start, curve in zip(found, starts, curves, strict=True)
            if curve is not None
        ]

    def _numbers(self) -> list[np.ndarray]:
        """First values of the unknown numbers: the guesses, and a sliding end at other distances from the start."""
        form = self.form
        if form.lift is None or len(form.start.unknowns) == len(form.problem.unknowns):
            return [form.start.unknowns]
        start, out = form.problem.span[0], []
        for factor in END_DISTANCES:
            numbers = form.start.unknowns.copy()
            numbers[-1] = start + factor * (numbers[-1] - start)
            out.append(numbers)
        return out

    def _first(self, segments: Segments, slope: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        form, units = self.form, segments.scales.ordinates
        states = [np.concatenate([form.start.curve(np.array([s]))[:, 0] / units, slope]) for s in form.span]
        states[0][: form.n] = form.ends.start[0] / units
        nu = nus(self.equations, segments.scales, np.array(states), numbers, np.zeros(0))
        return np.concatenate([states[0], numbers, nu])

    def _curve(self, segments: Segments, x: np.ndarray) -> Sampled | None:
        """The trajectory of a root, linear between its points."""
        t = np.linspace(0.0, 1.0, TRAJECTORY_POINTS)
        trajectories = segments.paths(x, 0).trajectories()
        if isinstance(trajectories, Failure):
            return None
        rows = trajectories(t)[: self.form.n] * segments.scales.ordinates[:, None]
        a, b = self.form.span
        return lambda s: np.array([np.interp((s - a) / (b - a), t, row) for row in rows])

    def slope(self, curve: Sampled) -> np.ndarray:
        """The scaled slope with which a curve, given by its derivative, sets out."""
        a, b = self.form.span
        return curve(np.array([a]))[:, 0] * (b - a) / self._segments.scales.ordinates


def _directions(n: int) -> np.ndarray:
    """Unit vectors (m, n): both signs, a circle of them, or those to the corners, edges and faces of a cube."""
    if n == 1:
        return np.array([[1.0], [-1.0]])
    if n == 2:
        angles = 2 * np.pi * (np.arange(LATTICE_DIRECTIONS) + 0.5) / LATTICE_DIRECTIONS
        return np.column_stack([np.cos(angles), np.sin(angles)])
    corners = np.array([c for c in product((-1.0, 0.0, 1.0), repeat=n) if any(c)])
    return corners / np.linalg.norm(corners, axis=1)[:, None]


def _same(one: np.ndarray, other: np.ndarray) -> bool:
    return bool(np.abs(one - other).max() <= SAME_ROOT * max(1.0, float(np.abs(other).max())))
