"""A branch of collocated extremals by its arc length: correctors, tangents, folds.

The unknowns are those of the collocated conditions and one parameter more; the
conditions leave a curve, which is followed along its tangent, so that a point
where the parameter turns back is a point like any other (Keller, "Numerical
solution of bifurcation and nonlinear eigenvalue problems", in: Applications of
Bifurcation Theory, 1977; Seydel, "Practical Bifurcation and Stability
Analysis", sect. 4.5 and 5.4).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from varcalc.formulation import Form
from varcalc.methods.collocation.error import Root, end_cost
from varcalc.methods.collocation.system import CollocationSystem, collocation_space
from varcalc.numerics.mesh import Space

PARAMETER_DIFFERENCE = 1e-6
"""Step of the difference quotient by the parameter, in its unit; it bends directions only, never a solution."""
CORRECTIONS = 8
CONVERGED_CORRECTION = 1e-11
"""Relative correction after which one more step leaves only round-off."""
STALLED_CORRECTION = 1e-8
"""Relative correction below which a failure to shrink is round-off."""
FOLD_STEPS = 30
FLAT_TANGENT = 1e-13
"""Part of the parameter in the tangent that counts as zero."""
FOLD_DEGREES, HIGHEST_FOLD_DEGREE = 6, 50
"""By how much the degree is raised to see whether a fold has settled, and how far."""
BESIDE_FOLD = 1e-3
"""Length of the first step from a fold to where it is looked for on a richer mesh."""
FOLD_ROUNDING = 4 * float(np.finfo(float).eps)
"""Relative error of a fold that rounding alone explains."""


@dataclass(frozen=True)
class ParameterFamily:
    """A form in dependence of its parameter ``name``, measured in ``unit``."""

    form: Form
    name: str
    unit: float

    def form_at(self, parameter: float) -> Form:
        """The form for another value of the parameter."""
        return replace(self.form, problem=self.form.problem.with_parameters({self.name: parameter}))

    def system(self, space: Space, parameter: float) -> CollocationSystem:
        """The collocated conditions for a value of the parameter."""
        return CollocationSystem(self.form_at(parameter), space)


@dataclass(frozen=True)
class Point:
    """A point of a branch: the unknowns z on ``space``, the parameter, the tangent (of z, then of the parameter)."""

    space: Space
    z: np.ndarray
    parameter: float
    tangent: np.ndarray


@dataclass(frozen=True)
class Fold:
    """Where the parameter turns back: its value there, the error of that, and the functional."""

    parameter: float
    error: float
    value: float


class Follower:
    """Steps along a branch of a family; ``sizes`` (n,) are the least units of its functions."""

    def __init__(self, family: ParameterFamily, sizes: np.ndarray) -> None:
        self.family, self.sizes = family, sizes
        self._values: tuple[Space, np.ndarray] | None = None

    def _evaluation(self, system: CollocationSystem) -> np.ndarray:
        """The matrix from z to the functions at the collocation points, by the roots of the rule's weights."""
        space = system.space
        if self._values is None or self._values[0] is not space:
            origin = system.unpack(np.zeros(system.size)).coefficients
            weights = np.sqrt(system.weights / system.weights.sum())[:, :, None]
            columns = []
            for unit in np.eye(system.size):
                change = system.unpack(unit).coefficients - origin
                columns.append(space.at_quadrature(change, system.points, 0)[0] * weights)
            self._values = space, np.array(columns).reshape(system.size, -1, system.form.n)
        return self._values[1]

    def _metric(self, system: CollocationSystem, z: np.ndarray) -> np.ndarray:
        """The matrix by which changes of z and of the parameter are measured: mean squares of relative changes.

        It is that of functions, not of coefficients, so it is the same on every mesh.
        """
        values = self._evaluation(system)
        curve = system.space.at_quadrature(system.unpack(z).coefficients, system.points, 0)[0]
        sizes = np.maximum(self.sizes, np.abs(curve).max((0, 1)))
        flat = (values / sizes).reshape(system.size, -1)
        metric = np.zeros((system.size + 1, system.size + 1))
        metric[:-1, :-1] = flat @ flat.T
        metric[-1, -1] = self.family.unit**-2
        return metric

    def metric(self, point: Point) -> np.ndarray:
        """The metric at a point, shape (N + 1, N + 1)."""
        return self._metric(self.family.system(point.space, point.parameter), point.z)

    def _linearised(self, space: Space, z: np.ndarray, parameter: float) -> tuple[np.ndarray, np.ndarray]:
        """The residual and its Jacobian by z and the parameter."""
        step = PARAMETER_DIFFERENCE * self.family.unit
        system = self.family.system(space, parameter)
        residual = system.evaluate(z)
        ahead, behind = (self.family.system(space, parameter + d).evaluate(z).rows for d in (step, -step))
        return residual.rows, np.column_stack([system.dense(residual), (ahead - behind) / (2 * step)])

    def _tangent(self, space: Space, z: np.ndarray, parameter: float, border: np.ndarray) -> np.ndarray:
        """The unit tangent that goes on in the direction of ``border``, a row."""
        matrix = self._linearised(space, z, parameter)[1]
        direction = _solved(np.vstack([matrix, border]), np.append(np.zeros(len(z)), 1.0))
        metric = self._metric(self.family.system(space, parameter), z)
        return direction / np.sqrt(direction @ metric @ direction)

    def departure(self, space: Space, z: np.ndarray, parameter: float, sign: float) -> Point:
        """The first point of a branch, with the tangent on which the parameter grows (falls for a negative sign)."""
        return Point(space, z, parameter, self._tangent(space, z, parameter, np.append(np.zeros(len(z)), sign)))

    def step(self, point: Point, length: float) -> tuple[Point, int] | None:
        """The point at ``length`` along the tangent and the corrections it took; None when they do not converge."""
        z, parameter = point.z + length * point.tangent[:-1], point.parameter + length * point.tangent[-1]
        metric = self.metric(point)
        border, before = point.tangent @ metric, np.inf
        for iteration in range(1, CORRECTIONS + 1):
            rows, matrix = self._linearised(point.space, z, parameter)
            gone = np.append(z - point.z, parameter - point.parameter)
            change = _solved(np.vstack([matrix, border]), np.append(-rows, length - border @ gone))
            size = float(np.sqrt(change @ metric @ change))
            if not np.isfinite(size):
                return None
            z, parameter = z + change[:-1], parameter + change[-1]
            if size <= CONVERGED_CORRECTION or (before <= STALLED_CORRECTION and size > 0.1 * before):
                following = Point(point.space, z, parameter, self._tangent(point.space, z, parameter, border))
                return (following, iteration) if np.isfinite(following.tangent).all() else None
            before = size
        return None

    def turn(self, one: Point, other: Point) -> float:
        """The cosine of the angle between the tangents of two points on one mesh."""
        metric = self.metric(one)
        length = np.sqrt(other.tangent @ metric @ other.tangent)
        return float(one.tangent @ metric @ other.tangent / length)

    def moved(self, point: Point, space: Space) -> Point:
        """A point on a richer mesh, corrected there; its tangent with it."""
        old, new = (self.family.system(s, point.parameter) for s in (point.space, space))
        z = new.pack(old.transferred(old.unpack(point.z), new))
        ahead = new.pack(old.transferred(old.unpack(point.z + point.tangent[:-1]), new))
        there = Point(space, z, point.parameter, np.append(ahead - z, point.tangent[-1]))
        stepped = self.step(there, 0.0)
        return there if stepped is None else stepped[0]

    def _fold(self, point: Point, length: float) -> Point | None:
        """The point where the parameter turns, by the secant method from a first guess of its distance."""
        here, s, at = point, 0.0, length
        slope = here.tangent[-1] / self.family.unit
        for _ in range(FOLD_STEPS):
            stepped = self.step(point, at)
            if stepped is None:
                return None
            here, s, before = stepped[0], at, s
            following = here.tangent[-1] / self.family.unit
            bend, slope = (following - slope) / (s - before), following
            if abs(slope) <= FLAT_TANGENT or not abs(slope) > FLAT_TANGENT * abs(bend):
                return here
            at = s - slope / bend
        return here

    def fold(self, point: Point, length: float) -> Fold | None:
        """The fold at about ``length`` from a point, on richer and richer meshes until its parameter settles."""
        best: Fold | None = None
        here = self._fold(point, length)
        while here is not None:
            form = self.family.form_at(here.parameter)
            system = CollocationSystem(form, here.space)
            curve = system.unpack(here.z)
            rule = 2 * here.space.degree + 4
            value = form.sign * (system.fine_value(curve, rule) + end_cost(form, here.space, curve))
            error = math.inf if best is None else abs(here.parameter - best.parameter)
            if best is not None and error >= best.error:
                break
            best = Fold(here.parameter, error, value)
            if error <= FOLD_ROUNDING * abs(here.parameter) or here.space.degree >= HIGHEST_FOLD_DEGREE:
                break
            richer = collocation_space(form, here.space.vertices, here.space.degree + FOLD_DEGREES)
            here = self._fold(self.moved(here, richer), BESIDE_FOLD)
        return None if best is None else replace(best, error=best.error + FOLD_ROUNDING * abs(best.parameter))

    def level(self, point: Point) -> Root:
        """A point as a root of the conditions for its parameter."""
        system = self.family.system(point.space, point.parameter)
        return Root(system, point.z, system.evaluate(point.z))


def _solved(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """The solution of a linear system, its rows and columns scaled; NaN when there is none."""
    rows = np.abs(matrix).max(1)
    rows = np.where(rows > 0.0, rows, 1.0)
    columns = np.abs(matrix / rows[:, None]).max(0)
    columns = np.where(columns > 0.0, columns, 1.0)
    try:
        return np.linalg.solve(matrix / rows[:, None] / columns, right / rows) / columns
    except np.linalg.LinAlgError:
        return np.full(len(right), np.nan)
