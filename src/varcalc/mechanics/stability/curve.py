"""The curve of equilibria in coordinates and one parameter: correctors, tangents, folds, and where curves meet."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from varcalc.mechanics.linearised import Linearised, standing_forces
from varcalc.mechanics.system import System

STEPS_ONTO_CURVE = 12
CONVERGED = 1e-13
"""Of the box: a correction after which only round-off is left."""
EDGE_STEPS = 32
"""Halvings of a step that leaves the box, or at the end of which another stability begins."""
SECOND = 1e-3
"""Of the box: how far along the second null vector the curvature of the conditions is measured."""
ANOTHER_BIFURCATION = 0.1
"""Of the box: a bifurcation farther than this from the stations about it is another one."""


@dataclass(frozen=True)
class Station:
    """An equilibrium z (n + 1,), the parameter last, and the unit ``tangent`` there in units of the box.

    ``side`` is the sign of the determinant of the slopes with the tangent below, which changes where branches meet.
    """

    z: np.ndarray
    tangent: np.ndarray
    side: float
    stable: bool

    def turned(self) -> Station:
        """The same, looking back."""
        return replace(self, tangent=-self.tangent, side=-self.side)


@dataclass(frozen=True)
class RestCurve:
    """Forces at rest (n,) of z (n + 1,) with their slopes, in units ``size`` (n + 1,) of the box."""

    forces: ca.Function
    matrices: ca.Function
    folding: ca.Function
    meeting_of: ca.Function
    size: np.ndarray

    @classmethod
    def of(cls, system: System, name: str, size: np.ndarray) -> RestCurve:
        """The equilibria of a ``system`` as the parameter ``name`` changes."""
        lagrange, s = system.lagrange, system.lagrange.symbols
        if system.constraints:
            raise ValueError("constraints: a bifurcation chart is of systems without; give coordinates that need none")
        forces, n, place = standing_forces(lagrange), system.n, list(system.parameters).index(name)
        if ca.depends_on(forces, s.t):
            raise ValueError("the forces depend on the time, so that places of rest are no matter of a parameter")
        z, fixed = ca.SX.sym("z", n + 1), ca.SX(system.numbers)
        fixed[place] = z[n]

        def at(value: ca.SX) -> ca.SX:
            still = ca.substitute([value], [s.v, s.t], [ca.SX.zeros(n), ca.SX(0)])[0]
            return ca.densify(ca.substitute([still], [s.q, s.p], [z[:n], fixed])[0])

        pull = at(forces)
        slope = ca.densify(ca.jacobian(pull, z))
        rows = [lagrange.mass, -ca.jacobian(lagrange.pull, s.v), -ca.jacobian(lagrange.pull, s.q)]
        phi, slack = ca.SX.sym("phi", n), ca.SX.sym("beta")
        unit = ca.dot(phi, phi) - 1
        scale = ca.SX(size)
        steep = slope @ ca.diag(scale)
        fold, met = ca.vertcat(z, phi), ca.vertcat(z, phi, slack)
        folded = ca.vertcat(pull, steep[:, :n] @ phi, unit)
        crossed = ca.vertcat(pull + slack * phi, steep.T @ phi, unit)
        return cls(
            ca.Function("forces", [z], [pull, slope]), ca.Function("matrices", [z], [at(row) for row in rows]),
            ca.Function("folding", [fold], [folded, ca.densify(ca.jacobian(folded, fold))]),
            ca.Function("meeting", [met], [crossed, ca.densify(ca.jacobian(crossed, met))]), size,
        )  # fmt: skip

    @cached_property
    def _n(self) -> int:
        return len(self.size) - 1

    def _slopes(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The forces (n,) and their slopes (n, n + 1) in units of the box, each row by its size."""
        pull, slope = (np.array(part) for part in self.forces(z))
        slope = slope * self.size
        rows = np.abs(slope).max(axis=1)
        rows = np.where(rows > 0, rows, 1.0)
        return pull.ravel() / rows, slope / rows[:, None]

    def station(self, z: np.ndarray, along: np.ndarray | None) -> Station | None:
        """The station at an equilibrium, looking ``along`` (n + 1,); None where the slopes are no numbers."""
        slope = self._slopes(z)[1]
        if not np.all(np.isfinite(slope)):
            return None
        tangent = np.linalg.svd(slope)[2][-1]
        if along is not None and tangent @ along < 0:
            tangent = -tangent
        side = float(np.sign(np.linalg.det(np.vstack([slope, tangent]))))
        return Station(z, tangent, side, self._stable(z))

    def _stable(self, z: np.ndarray) -> bool:
        mass, resistance, stiffness = (np.array(part) for part in self.matrices(z))
        return Linearised(mass, resistance, stiffness, np.eye(self._n)).stable

    def step(self, here: Station, length: float) -> Station | None:
        """The equilibrium in the plane across the tangent at a ``length`` from a station; None where there is none."""

        def across(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            """What is left of the equations of equilibrium and of that of the plane (n + 1,), and their slopes."""
            pull, slope = self._slopes(z)
            off = here.tangent @ ((z - here.z) / self.size) - length
            return np.append(pull, off), np.vstack([slope, here.tangent])

        found = _zero(across, here.z + length * here.tangent * self.size, self.size, STEPS_ONTO_CURVE)
        return None if found is None else self.station(found[0], here.tangent)

    def at_edge(self, here: Station, length: float, low: np.ndarray, high: np.ndarray) -> Station | None:
        """The last station inside the box on the way of a step that leaves it."""
        inside, outside, best = 0.0, length, None
        for _ in range(EDGE_STEPS):
            middle = (inside + outside) / 2
            met = self.step(here, middle)
            if met is not None and np.all((met.z >= low) & (met.z <= high)):
                inside, best = middle, met
            else:
                outside = middle
        return best

    def change(self, before: Station, after: Station) -> tuple[np.ndarray, float]:
        """Where between two stations of a branch the stability changes, and what its parameter may be off."""
        first, last = 0.0, float(before.tangent @ ((after.z - before.z) / self.size))
        z = before.z
        for _ in range(EDGE_STEPS):
            middle = (first + last) / 2
            met = self.step(before, middle)
            if met is None:
                break
            z = met.z
            first, last = (middle, last) if met.stable == before.stable else (first, middle)
        return z, abs(last - first) * float(self.size[-1]) + 1e-8 * float(self.size[-1])

    def _solved(self, function: ca.Function, start: np.ndarray) -> tuple[np.ndarray, float] | None:
        """A regular zero of extended equations next to a guess, and what its parameter may be off."""
        width = np.append(self.size, np.ones(len(start) - self._n - 1))

        def scaled(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            """The equations and their slopes by what is counted in ``width``, each row over its largest slope."""
            values, slopes = (np.array(part) for part in function(z))
            slopes = slopes * width
            rows = np.maximum(np.abs(slopes).max(axis=1), 1e-300)
            return values.ravel() / rows, slopes / rows[:, None]

        found = _zero(scaled, start, width, 3 * STEPS_ONTO_CURVE)
        if found is None:
            return None
        z, change = found
        if np.abs((z - start)[: self._n + 1] / self.size).max() > ANOTHER_BIFURCATION:
            return None
        error = (abs(change[self._n]) + 8 * np.finfo(float).eps) * float(self.size[-1])
        return z[: self._n + 1], float(error + 4 * np.finfo(float).eps * abs(z[self._n]))

    def fold(self, before: Station, after: Station) -> tuple[np.ndarray, float] | None:
        """The fold between two stations, a zero of the slopes in a direction φ, and what its parameter may be off."""
        share = before.tangent[-1] / (before.tangent[-1] - after.tangent[-1])
        z = before.z + share * (after.z - before.z)
        phi = np.linalg.svd(self._slopes(z)[1][:, :-1])[2][-1]
        return self._solved(self.folding, np.concatenate([z, phi]))

    def meeting(self, before: Station, after: Station) -> tuple[np.ndarray, float] | None:
        """Where another branch meets this one between two stations: a combination φ of the forces has no slope."""
        z = (before.z + after.z) / 2
        slope = np.array(self.forces(z)[1]) * self.size
        phi = np.linalg.svd(slope)[0][:, -1]
        found = self._solved(self.meeting_of, np.concatenate([z, phi, [0.0]]))
        return found if found is not None and np.abs(self._slopes(found[0])[0]).max() <= CONVERGED**0.5 else None

    def other_tangents(self, z: np.ndarray, tangent: np.ndarray) -> list[np.ndarray]:
        """Unit tangents of the branches that meet at z, but the one of this ``tangent``.

        On the two null vectors of the slopes the second derivatives, by differences, have two directions without.
        """
        slope = np.array(self.forces(z)[1]) * self.size
        left, _, right = np.linalg.svd(slope)
        plane, across = right[-2:], left[:, -1]

        def bend(one: np.ndarray, other: np.ndarray) -> float:
            """The second derivative of the forces along two directions, as it is felt across the slopes' range."""
            ahead, behind = (
                np.array(self.forces(z + sign * SECOND * one * self.size)[1]) * self.size for sign in (1, -1)
            )
            return float(across @ (ahead - behind) @ other / (2 * SECOND))

        a, b, c = bend(plane[0], plane[0]), bend(plane[0], plane[1]), bend(plane[1], plane[1])
        found = []
        if abs(a) + abs(c) + abs(b) == 0 or b * b - a * c <= 0:
            return found
        root = np.sqrt(b * b - a * c)
        q = -(b + np.copysign(root, b))
        for one in ((q, a), (c, q)):  # ratios of the parts along both null vectors
            direction = one[0] * plane[0] + one[1] * plane[1]
            size = np.linalg.norm(direction)
            if size > 0 and abs(direction @ tangent) < 0.999 * size * np.linalg.norm(tangent):
                found.append(direction / size)
        return found

    def beside(self, guess: np.ndarray, z: np.ndarray) -> np.ndarray | None:
        """The equilibrium next to a guess beside z, at the same distance."""
        along = (guess - z) / self.size
        length = float(np.linalg.norm(along))
        met = self.step(Station(z, along / length, 0.0, stable=False), length)
        return None if met is None else met.z


def _zero(
    equations: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]], z: np.ndarray, size: np.ndarray, steps: int
) -> tuple[np.ndarray, np.ndarray] | None:
    """Newton's method from ``z`` on: where it ends and its last correction, in units of ``size``; None where nowhere.

    ``equations`` give values, and slopes in these units, of which there may be more than unknowns.
    """
    change = np.full(len(z), np.inf)
    for _ in range(steps):
        values, slopes = equations(z)
        if not (np.all(np.isfinite(values)) and np.all(np.isfinite(slopes))):
            return None
        change = np.linalg.lstsq(slopes, -values, rcond=None)[0]
        z = z + change * size
        if np.abs(change).max() <= CONVERGED:
            break
    return (z, change) if np.abs(change).max() <= CONVERGED**0.5 else None
