"""The energy of a conformal metric next to a singular line, in numbers.

With xi along the line and the distance D = w^p from it, the length element
n(q) |dq| has the energy n^2 (xi'^2 + D'^2), divided by the rate of the parameter;
its derivatives follow from those of n by the chain rule. The powers of s that the
extremal is known to start with enter as an affine map of the unknown functions.
Where the line does not meet an axis at zero, n is stated in coordinates measured
from the line, since D would lose its digits in a sum.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import casadi as ca
import numpy as np

from varcalc.formulation import AtPoints, Reported
from varcalc.formulation.singular.offsets import gathered
from varcalc.problem.problem import Problem
from varcalc.symbolic.derived import derived
from varcalc.symbolic.evaluation import PointEvaluator


@dataclass(frozen=True)
class Factors:
    """xi = ``base`` + ``along`` z and w = ``off`` omega, with the derivatives of each by s; all of shape (Q,)."""

    base: np.ndarray
    dbase: np.ndarray
    along: np.ndarray
    dalong: np.ndarray
    off: np.ndarray
    doff: np.ndarray

    @property
    def transform(self) -> np.ndarray:
        """From (z, omega, z', omega') to (xi, w, xi', w'), shape (Q, 4, 4)."""
        out = np.zeros((len(self.base), 4, 4))
        out[:, 0, 0] = out[:, 2, 2] = self.along
        out[:, 2, 0] = self.dalong
        out[:, 1, 1] = out[:, 3, 3] = self.off
        out[:, 3, 1] = self.doff
        return out

    @property
    def offset(self) -> np.ndarray:
        """What is added to that, (Q, 4)."""
        out = np.zeros((len(self.base), 4))
        out[:, 0], out[:, 2] = self.base, self.dbase
        return out


@lru_cache(maxsize=1)
def _chain_rule() -> ca.Function:
    """The energy with its gradient and Hessian in u = (xi, w, xi', w'), from n with its derivatives in (x, y, y').

    It holds for every n, and is made once: inputs are the rows of :class:`varcalc.problem.problem.Derivatives`, u, the
    chart (tangent, normal, power) and the rate of the parameter.
    """
    rows, u, chart, rate = (ca.SX.sym(name, size) for name, size in (("n", 13), ("u", 4), ("chart", 5), ("rate", 1)))
    tangent, normal, p = chart[:2], chart[2:4], chart[4]
    w, v, dw = u[1], u[2], u[3]
    first = rows[1:3]
    second = ca.reshape(rows[4:], 3, 3)[:2, :2]
    # n^2 as a function of place, to second order about it
    step = ca.SX.sym("step", 2)
    n = rows[0] + ca.dot(first, step) + 0.5 * ca.dot(step, ca.mtimes(second, step))
    distance, along = ca.SX.sym("distance"), ca.SX.sym("along")
    fall = p * distance ** (p - 1)
    square = ca.substitute(n**2, step, tangent * (along - u[0]) + normal * (distance**p - w**p))
    moving = ca.vertcat(along, distance, ca.SX.sym("v"), ca.SX.sym("dw"))
    energy = square * (moving[2] ** 2 + (fall * moving[3]) ** 2) / rate
    hessian, gradient = ca.hessian(energy, moving)
    results = ca.substitute([energy, gradient, hessian], [moving], [ca.vertcat(u[0], w, v, dw)])
    return ca.Function("energy", [rows, u, chart, rate], [ca.densify(e) for e in results])


class ConformalEnergy:
    """The energy of n |dq| at points s: see the module.

    ``origin`` and ``normal`` place the line, which is parallel to an axis; ``rate`` is dtau/ds at the points,
    ``energy`` a call of :func:`_chain_rule`.
    """

    def __init__(
        self,
        problem: Problem,
        numbers: ConformalNumbers,
        energy: PointEvaluator,
        rate: np.ndarray,
        factors: Factors | None,
    ) -> None:
        self.power, self.rate, self._energy = numbers.power, rate, energy
        (nx, ny), (self.x0, self.y0) = numbers.normal.tolist(), numbers.origin.tolist()
        self.problem = problem
        self._local = _measured_from(problem, self.x0, self.y0) if numbers.shifted else None
        self.tangent, self.normal = (ny, -nx), (nx, ny)
        self._chart = np.array([[ny, -nx, nx, ny, self.power]])
        self.transform = None if factors is None else factors.transform
        self.offset = None if factors is None else factors.offset

    def _offsets(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The point of the plane measured from ``origin``, (Q,) each."""
        (tx, ty), (nx, ny), distance = self.tangent, self.normal, u[:, 1] ** self.power
        return tx * u[:, 0] + nx * distance, ty * u[:, 0] + ny * distance

    def _rows(self, u: np.ndarray) -> np.ndarray:
        """n with its derivatives (Q, 13): the rows of :class:`varcalc.symbolic.evaluation.Derivatives`."""
        x, y = self._offsets(u)
        if self._local is not None:
            return self._local(len(x), x[:, None], y[:, None], self.problem.parameter_values[None])
        return self.problem.integrand_derivatives(self.x0 + x, self.y0 + y[None], np.zeros((1, len(x)))).rows

    def derivatives(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """See :class:`varcalc.formulation.AtPoints`."""
        found = self._energy(len(u), self._rows(u), u, self._chart, self.rate)
        return found[:, 0], found[:, 1:5], found[:, 5:].reshape(-1, 4, 4)

    def reported(self, u: np.ndarray) -> Reported:
        """The length element, and the point of the plane with its velocity."""
        x, y = self._offsets(u)
        x, y = self.x0 + x, self.y0 + y
        if self._local is None:
            n = self.problem.integrand_values(x, y[None], np.zeros((1, len(x))))
        else:
            n = self._rows(u)[:, 0]
        v, fall = u[:, 2], self.power * u[:, 1] ** (self.power - 1) * u[:, 3]
        (tx, ty), (nx, ny) = self.tangent, self.normal
        dx, dy = tx * v + nx * fall, ty * v + ny * fall
        return Reported(np.abs(n) * np.hypot(v, fall), x, y[:, None], dx, dy[:, None])


@derived
def _measured_from(problem: Problem, x0: float, y0: float) -> PointEvaluator:
    """n with its derivatives, as a function of the point measured from (x0, y0) and of the parameters."""
    s = problem.symbols
    n = ca.substitute([problem.integrand], [s.x, s.y, s.dy], [x0 + s.x, y0 + s.y, s.kind(0)])[0]
    n = gathered(n, s)
    hessian, gradient = ca.hessian(n, s.variables)
    rows = ca.densify(ca.vertcat(n, gradient, ca.vec(hessian)))
    return PointEvaluator(ca.Function("n", [s.x, s.y, s.parameters], [rows]))


@dataclass(frozen=True)
class ConformalNumbers:
    """:class:`ConformalEnergy` at any points; ``factors`` gives those of the powers taken out, if any are."""

    origin: np.ndarray
    normal: np.ndarray
    power: float
    growth: float
    grade: int
    line: tuple[float, float]
    """xi at the ends."""
    singular: tuple[bool, bool]
    factored: bool
    shifted: bool
    """Whether the line is elsewhere than where a coordinate is zero."""

    def on(self, problem: Problem, s: np.ndarray) -> AtPoints:
        """The energy at points s (Q,), at the parameter values of ``problem``."""
        factors = self._factors(s) if self.factored else None
        return ConformalEnergy(problem, self, self._energy, self._rate(s), factors)

    @cached_property
    def _energy(self) -> PointEvaluator:
        return PointEvaluator(_chain_rule())

    def _rate(self, s: np.ndarray) -> np.ndarray:
        if self.grade == 1:
            return np.ones((1, 1))
        near = s if self.singular[0] else 1 - s
        return self.grade * near[:, None] ** (self.grade - 1)

    def _factors(self, s: np.ndarray) -> Factors:
        """One singular end, at a distance r in s: xi = xi_end +- r^growth z, w = r omega."""
        at_start, p = self.singular[0], self.growth
        near, origin, sign = (s, self.line[0], 1.0) if at_start else (1 - s, self.line[1], -1.0)
        power = near ** (p - 1)
        return Factors(
            np.full_like(s, origin), np.zeros_like(s), sign * power * near, p * power, near, np.full_like(s, sign)
        )
