"""The end map of a scalar problem: from the initial slope to the miss at the other end.

Every extremal that leaves the fixed end is an initial-value problem with one
open number, its slope v. It is followed to the other end, with its derivative
by v from the variational equation, and the extremals wanted are the zeros of
one function of one number (Gelfand and Fomin, "Calculus of Variations", sect. 4
and 26; the derivative is the Jacobi field, which vanishes at conjugate points).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from varcalc.formulation import Form, Sampled
from varcalc.formulation.height import height
from varcalc.integrators import Flow, Run, RunOutcome, Variational, compiled, for_many, variational
from varcalc.methods.shooting.flow import EulerLagrangeFlow, Scales

STATIONS = 9
"""Abscissae at which a trajectory is recorded, so that one which fails still tells which way it went."""
STEPS_PER_TRAJECTORY = 800
"""Steps of an integrator granted to one trajectory."""
COMPILED_STEPS, INTERPRETED_STEPS = 600_000, 30_000
"""Steps granted to a scan with a compiled system, and with one that is called from Python."""
TRAJECTORY_POINTS = 257
"""Points of a trajectory that is handed on as a curve."""


@dataclass(frozen=True)
class TrialTrajectory:
    """A trajectory with initial slope ``unit`` * sinh(u): its miss at the end.

    ``miss`` is asinh of the scaled miss and ``slope`` its derivative by u; both
    NaN where the end was not reached, and then ``side`` is the sign of the
    slope on which the trajectory was lost (0 when nothing is known).
    ``flat`` is the larger of miss and derivative relative to the trajectory,
    ``steps`` what the integration took.
    """

    u: float
    miss: float
    slope: float
    side: float
    flat: float
    outcome: RunOutcome
    steps: int

    @property
    def arrived(self) -> bool:
        """True when the end was reached."""
        return math.isfinite(self.miss) and math.isfinite(self.slope)


def mappable(form: Form) -> bool:
    """True for one function of a first-order functional with one fixed end and the other fixed or natural."""
    plain = form.order == 1 and form.n == 1 and form.lift is None and not form.coordinates.weak_only
    both_free = np.isnan(form.ends.start).any() and np.isnan(form.ends.end).any()
    return plain and form.bare and not form.conditions.integrals and not both_free


@dataclass(frozen=True)
class EndMap:
    """The end map of a ``mappable`` form.

    It sets out from the start, or from the end where only that is fixed.
    """

    form: Form

    @cached_property
    def equations(self) -> EulerLagrangeFlow:
        """The Euler-Lagrange equation as a first-order system."""
        return EulerLagrangeFlow(self.form)

    @cached_property
    def forward(self) -> bool:
        """True when trajectories set out from the start."""
        return not np.isnan(self.form.ends.start).any()

    @cached_property
    def ordinate(self) -> float:
        """The unit of ordinates."""
        ends = np.nan_to_num(np.abs([self.form.ends.start[0, 0], self.form.ends.end[0, 0]]))
        return float(max(height(self.form), *ends))

    @property
    def unit(self) -> float:
        """The unit of slopes."""
        return self.ordinate / (self.form.span[1] - self.form.span[0])

    @cached_property
    def _system(self) -> Variational:
        """(y, y') with its derivative by the initial slope."""
        full = self.equations.scaled
        kind: Any = ca.SX if full.is_a("SXFunction") else ca.MX
        t, state, constants = kind.sym("t"), kind.sym("Y", 2), kind.sym("c", full.numel_in(2))
        rates = full(t, ca.vertcat(state, kind.zeros(full.numel_in(1) - 2)), constants)[:2]
        return variational(ca.Function("extremal", [t, state, constants], [ca.densify(rates)]), [1], [])

    @cached_property
    def _flow(self) -> Flow:
        return compiled(self.form.problem, for_many(most_steps=STEPS_PER_TRAJECTORY), self._system.system)

    @property
    def budget(self) -> int:
        """Steps of the integrator that a scan may take: about ten seconds of them."""
        return COMPILED_STEPS if self._flow.compiled else INTERPRETED_STEPS

    @cached_property
    def _constants(self) -> np.ndarray:
        scales = Scales(np.array([self.ordinate]), np.ones(self.equations.integrals))
        line = self.equations.line(0.0, 1.0, (False, False))
        return np.concatenate([line, scales.all, self.form.problem.parameter_values])

    @cached_property
    def _momentum(self) -> ca.Function:
        """The scaled momentum at the far end and its gradient by the scaled state (y, y')."""
        symbols, lagrangian = self.form.symbols, self.equations.lagrangian
        momentum = lagrangian.momenta[0]
        gradient = ca.jacobian(momentum, ca.vertcat(symbols.y, symbols.dy))
        return ca.Function("momentum", [symbols.x, symbols.y, symbols.dy, symbols.parameters], [momentum, gradient])

    @cached_property
    def key(self) -> tuple[object, ...]:
        """All that the map depends on, as what can be compared."""
        ends = self.form.ends.start.tobytes(), self.form.ends.end.tobytes()
        formulas = self._system.system.serialize(), self._momentum.serialize()
        return (*formulas, *ends, self.form.span, self.ordinate, self._constants.tobytes())

    def _runs(self, slopes: Sequence[float], t: np.ndarray) -> list[Run]:
        """The trajectories of scaled ``slopes`` at the shares ``t`` of the way."""
        fixed = self.form.ends.start if self.forward else self.form.ends.end
        states = np.array([self._system.start(np.array([fixed[0, 0] / self.ordinate, v])) for v in slopes])
        return self._flow.trajectories(t if self.forward else 1.0 - t, states, self._constants)

    def _far(self, states: np.ndarray) -> tuple[float, float]:
        """The scaled miss at the far end and its derivative by the scaled initial slope."""
        (y, v), by = self._system.split(states)
        fixed = (self.form.ends.end if self.forward else self.form.ends.start)[0, 0]
        if not math.isnan(fixed):
            return float(y - fixed / self.ordinate), float(by[0, 0])
        s = self.form.span[1] if self.forward else self.form.span[0]
        out: Any = self._momentum(s, y * self.ordinate, v * self.unit, self.form.problem.parameter_values)
        gradient = np.asarray(out[1]).ravel() * [self.ordinate, self.unit]
        return float(out[0]), float(gradient @ by[:, 0])

    def shoot(self, u: float) -> TrialTrajectory:
        """Follow the trajectory whose scaled slope is sinh(u)."""
        return self.shots([u])[0]

    def shots(self, places: Sequence[float]) -> list[TrialTrajectory]:
        """The same for many u: what asks whether they went past something narrow asks it of all together."""
        if not places:
            return []
        runs = self._runs([math.sinh(u) for u in places], np.linspace(0.0, 1.0, STATIONS))
        return [self._told(u, run) for u, run in zip(places, runs, strict=True)]

    def _told(self, u: float, run: Run) -> TrialTrajectory:
        if not run.completed:
            slopes = run.states[np.isfinite(run.states[:, 1]), 1]
            side = math.copysign(1.0, slopes[-1]) if len(slopes) > 1 else 0.0
            return TrialTrajectory(u, math.nan, math.nan, side, math.inf, run.outcome, run.steps)
        miss, by = self._far(run.states[-1])
        grown, reach = by * math.cosh(u), float(np.abs(run.states[:, :2]).max())
        flat = max(abs(miss), abs(by)) / max(reach, 1.0)
        return TrialTrajectory(
            u, math.asinh(miss), grown / math.hypot(1.0, miss), math.copysign(1.0, miss), flat, run.outcome, run.steps
        )

    def curve(self, u: float) -> Sampled:
        """The trajectory of a shot that arrived, as a function of the form's abscissa (cubic between its points)."""
        t = np.linspace(0.0, 1.0, TRAJECTORY_POINTS)
        y, v = self._runs([math.sinh(u)], t)[0].states[:, :2].T
        y, v = (y, v) if self.forward else (y[::-1], v[::-1])
        a, b = self.form.span

        def trajectory(s: np.ndarray) -> np.ndarray:
            """The ordinates (1, m) at s (m,)."""
            at = (s - a) / (b - a) * (TRAJECTORY_POINTS - 1)
            k = np.clip(at.astype(int), 0, TRAJECTORY_POINTS - 2)
            r, h = at - k, 1.0 / (TRAJECTORY_POINTS - 1)
            rise = y[k + 1] - y[k]
            bend = (h * v[k] - rise) * (1 - r) - (h * v[k + 1] - rise) * r
            return self.ordinate * (y[k] + r * (rise + (1 - r) * bend))[None, :]

        return trajectory

    def slope(self, curve: Sampled) -> np.ndarray:
        """The slope (1,), in units of :attr:`unit`, with which a curve given by its derivative leaves the fixed end."""
        return curve(np.array([self.form.span[0 if self.forward else 1]]))[0] / self.unit
