"""A system that can be moved: its first-order equations, engines, starts, and what is measured along motions."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from varcalc import integrators
from varcalc.integrators import Continuous, Engine, Flow, Piecewise
from varcalc.mechanics.arguments import finite_column
from varcalc.mechanics.constraints import RATE, started
from varcalc.mechanics.course import MOST_STEPS
from varcalc.mechanics.declared import Declared
from varcalc.mechanics.monodromy import Monodromy, MonodromyAtRest
from varcalc.mechanics.motion import Event, happenings
from varcalc.problem.conditions import reals
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.tracing import Expression


class Moving(Declared):
    """What :class:`varcalc.mechanics.System` moves by."""

    def _many(self, q0: Any, v0: Any, first: float, last: float) -> tuple[np.ndarray, np.ndarray]:
        """Many states (m, 2n) at the ``first`` time, and the constants of their motions up to the ``last``."""
        q, v = (np.atleast_2d(reals(name, part)) for name, part in (("q0", q0), ("v0", v0)))
        if q.shape != v.shape or q.shape[1] != self.n:
            raise ValueError(f"q0 and v0 must both have the shape (m, {self.n}), not {q.shape} and {v.shape}")
        if not (np.all(np.isfinite(q)) and np.all(np.isfinite(v))):
            raise ValueError("q0 and v0 must be finite numbers")
        states = np.concatenate([q, v], axis=1)
        self._check_motion()
        if self._held is not None:
            states = np.array([np.concatenate(self._started(first, *pair)) for pair in zip(q, v, strict=True)])
        return states, self._with_rate(first, q[0], v[0], last - first)

    def _started(self, t: float, q0: Any, v0: Any) -> tuple[np.ndarray, np.ndarray]:
        self._check_motion()
        q, v = finite_column("q0", q0, self.n), finite_column("v0", v0, self.n)
        if self._held is not None:
            q, v = started(self._lagrange, self._held, t, q, v, self._numbers)
        if np.isnan(float(self._value(t, q, v, self._numbers))):  # its forces may be numbers all the same
            raise ValueError(f"L is not a number at the start, where q0 = {q.tolist()} and v0 = {v.tolist()}")
        return q, v

    @cached_property
    def _value(self) -> ca.Function:
        """L of times, coordinates, rates and parameters."""
        return ca.Function("L", self._lagrange.symbols.all, [self._lagrange.value])

    def _with_rate(self, t: float, q: np.ndarray, v: np.ndarray, duration: float) -> np.ndarray:
        """The parameters and Baumgarte's rate, from how fast the motion begins."""
        if self._held is None:
            return np.append(self._numbers, 0.0)
        pull, speed = float(np.abs(self.accelerations(t, q.tolist(), v.tolist())).max()), float(np.abs(v).max())
        size = max(float(np.abs(q).max()), speed**2 / pull if pull > 0 else speed * duration)
        size = size if size > 0 else max(pull * duration**2, 1e-150)  # at rest at the origin
        rate = max(speed / size, (pull / size) ** 0.5, 1 / duration)
        return np.append(self._numbers, RATE * rate)

    @cached_property
    def _rates(self) -> tuple[ca.Function, Expression]:
        """d(q, v)/dt of (t, (q, v), (parameters, α)), and α."""
        s, alpha = self._lagrange.symbols, ca.SX.sym("alpha")
        rates = ca.densify(ca.vertcat(s.v, self._accelerations(alpha)[0]))
        columns = [s.t, ca.vertcat(s.q, s.v), ca.vertcat(s.p, alpha)]
        return ca.Function("motion", columns, [rates], {"cse": True}), alpha

    def _flow(self, engine: Engine) -> Flow:
        if engine not in self._flows:
            self._flows[engine] = self._switched(engine).compile(self._rates[0])
        return self._flows[engine]

    def _switched(self, engine: Engine) -> Engine:
        """An engine that goes from one switch of L to the next, where it has any."""
        if not self._switches:
            return engine
        s, state = self._lagrange.symbols, ca.SX.sym("y", 2 * self.n)
        constants = ca.vertcat(s.p, self._rates[1])
        value = ca.substitute([self._lagrange.value], [s.q, s.v], [state[: self.n], state[self.n :]])
        return Piecewise(engine, Continuous(ca.Function("L", [s.t, state, constants], value), self.n))

    def _happened(
        self, events: tuple[Event, ...], state: np.ndarray, numbers: np.ndarray, span: tuple[float, float]
    ) -> tuple[Any, float]:
        """What happens on a motion, and when it ends."""
        if not events:
            return (), span[1]
        flow, slopes = self._with_events(events)
        return happenings(flow, state, numbers, span, events, slopes)

    def _with_events(self, events: tuple[Event, ...]) -> tuple[Flow, PointEvaluator]:
        """Motions, with the time as a state like others, up to events; and the events' functions and their rates."""
        s = self._lagrange.symbols
        levels = [s.traced(f"events[{k}]", e.function, s.t, s.q, s.v) for k, e in enumerate(events)]
        free, alpha = self._rates
        state_and_time, never = ca.vertcat(s.q, s.v, s.t), ca.SX.sym("s")
        constants = ca.vertcat(s.p, alpha)
        rates = ca.vertcat(free(s.t, ca.vertcat(s.q, s.v), constants), 1)
        level = ca.densify(ca.vertcat(*levels))
        if events not in self._flows:
            system, stops = (
                ca.Function(name, [never, state_and_time, constants], [value])
                for name, value in (("with_time", rates), ("events", level))
            )
            self._flows[events] = self._switched(integrators.for_many(MOST_STEPS)).compile(system, stops)
        slope = ca.densify(ca.jtimes(level, state_and_time, rates))
        slopes = PointEvaluator(ca.Function("slopes", [state_and_time, constants], [level, slope]))
        return self._flows[events], slopes

    @cached_property
    def _monodromy(self) -> Monodromy:
        self._check_smooth("motions beside one are bent there by what no derivative tells")
        return Monodromy.of(self._rates[0])

    @cached_property
    def about_rest(self) -> MonodromyAtRest:
        """Small motions about places that stand still, compiled for any values of the parameters."""
        self._check_motion()
        self._check_smooth("small motions about a place of rest want it smooth")
        return MonodromyAtRest.of(self._rates[0])

    @cached_property
    def _summed(self) -> PointEvaluator:
        """L of the state."""
        s = self._lagrange.symbols
        return PointEvaluator(
            ca.Function("L", [s.t, s.q, s.v, ca.vertcat(s.p, self._rates[1])], [self._lagrange.value])
        )

    @cached_property
    def _second_variation(self) -> PointEvaluator:
        """L_vv, L_vq and L_qq (n, n) of the state, by their columns."""
        s, one = self._lagrange.symbols, self._lagrange
        columns = [s.t, s.q, s.v, ca.vertcat(s.p, self._rates[1])]
        mixed, bent = ca.jacobian(one.momenta, s.q), ca.jacobian(ca.gradient(one.value, s.q), s.q)
        parts = [ca.densify(ca.vec(part)) for part in (one.mass, mixed, bent)]
        return PointEvaluator(ca.Function("second_variation", columns, parts))

    @cached_property
    def _measured(self) -> PointEvaluator:
        s, alpha = self._lagrange.symbols, ca.SX.sym("alpha")
        columns = [s.t, s.q, s.v, ca.vertcat(s.p, alpha)]
        reactions = ca.densify(self._accelerations(alpha)[1])
        return PointEvaluator(ca.Function("measured", columns, [self._lagrange.energy, reactions]))

    def _out_of_step(self, times: np.ndarray, states: np.ndarray, drift: float) -> float:
        """How far a motion is out of step whose energy is off by its ``drift``: by a share of all its way."""
        s = self._lagrange.symbols
        twice_kinetic = PointEvaluator(ca.Function("twice_kinetic", s.all, [ca.dot(s.v, self._lagrange.momenta)]))
        columns = times[:, None], states[:, : self.n], states[:, self.n :], self._numbers[None, :]
        size = float(np.nanmax(np.abs(twice_kinetic(len(times), *columns)), initial=0.0))
        way = float(times[-1] - times[0]) * float(np.nanmax(np.abs(states[:, self.n :]), initial=0.0))
        return _as_error(way * float(drift) / size) if size > 0 else 0.0

    def _drift(self, times: np.ndarray, states: np.ndarray) -> dict[str, float]:
        """How far each invariant goes from where it was."""
        kept = self._kept
        if not kept:
            return {}
        function = PointEvaluator(ca.Function("kept", self._lagrange.symbols.all, [ca.vertcat(*kept.values())]))
        columns = times[:, None], states[:, : self.n], states[:, self.n :], self._numbers[None, :]
        values = function(len(times), *columns)
        with np.errstate(invalid="ignore"):
            off = np.abs(values - values[0]).max(axis=0)
        return dict(zip(kept, map(_as_error, off.tolist()), strict=True))


def _as_error(value: float) -> float:
    """What something is off by: infinite where that is no number."""
    return float("inf") if np.isnan(value) else value
