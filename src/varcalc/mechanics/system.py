"""A mechanical system declared by its Lagrangian."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from varcalc import integrators
from varcalc.mechanics.action import Action
from varcalc.mechanics.arguments import ascending_span, ascending_times, finite_column, momenta_of
from varcalc.mechanics.closed_orbits import ClosedOrbit, ClosedOrbits, closed_orbit, closed_state
from varcalc.mechanics.constraints import Pfaffian
from varcalc.mechanics.course import MOST_STEPS, course
from varcalc.mechanics.equilibria import Equilibria, equilibria
from varcalc.mechanics.galerkin import GalerkinSteps, Stepped
from varcalc.mechanics.linearised import Linearised, NormalModes, check_standing, linearised
from varcalc.mechanics.monodromy import Floquet
from varcalc.mechanics.motion import Ensemble, Event, Motion, carried
from varcalc.mechanics.moving import Moving
from varcalc.mechanics.orbit_symmetry import Repeats, Returns
from varcalc.mechanics.passages import Passages, passages
from varcalc.mechanics.reduced.reduced import ReducedMotion
from varcalc.mechanics.reduced.routh import OneCoordinate, routh
from varcalc.problem.conditions import Fixed, Holonomic, finite, sequence, told, whole
from varcalc.problem.problem import Problem
from varcalc.progress import Interrupted, Progress
from varcalc.spelling import spelled


@spelled
class System(Moving):
    """A system of n coordinates whose motions make the action, the integral of L over time, stationary.

    Raises TypeError or ValueError naming the argument, where one of them is not what it should be, and where L is
    singular: L_vv without inertia in some direction, which is given.

    Parameters
    ----------
    lagrangian : callable
        ``L(t, q, v)``, with ``p`` last where there are parameters: a scalar of the time, the coordinates (n,) and
        their rates (n,), written with CasADi or NumPy functions.
    coordinates : sequence of str
        A name for each.
    parameters : mapping, optional
        Numbers that the formulas know as attributes of ``p``.
    constraints : sequence of Holonomic and Pfaffian
        Conditions that the motion keeps; their reactions are :meth:`Motion.reactions`.
    forces : callable, optional
        ``forces(t, q, v[, p])``: n generalised forces that no Lagrangian gives, such as damping and drive.
    symmetries : sequence of Symmetry
        Symmetries of L whose invariants are watched along motions, beside the energy and ignorable momenta.
    units : sequence of str, optional
        Of the coordinates, and ``time_unit`` of the time, for the axes of pictures.
    name : str

    Examples
    --------
    >>> import casadi as ca
    >>> pendulum = System(lambda t, q, v, p: v[0]**2 / 2 + p.g * ca.cos(q[0]), ("theta",), parameters={"g": 9.81})
    >>> motion = pendulum.motion([1.0], [0.0], (0, 10))
    >>> motion.drift["energy"] < 1e-13
    True
    """

    def equilibria(self, low: Sequence[float] | np.ndarray, high: Sequence[float] | np.ndarray) -> Equilibria:
        """All places between ``low`` and ``high`` (n,) at which the system can rest, and how they were searched for.

        In a frame that turns these are the steady motions; of a system that is driven, places that stand still at all
        times. Raises ValueError for constraints other than Holonomic ones that stand still.

        >>> import casadi as ca
        >>> pendulum = System(lambda t, q, v: v[0]**2 / 2 + ca.cos(q[0]), ("theta",))
        >>> [round(float(x), 6) for x in pendulum.equilibria([-1], [7]).places[:, 0]]
        [0.0, 3.141593, 6.283185]
        """
        corners = finite_column("low", low, self.n), finite_column("high", high, self.n)
        if not np.all(corners[1] > corners[0]):
            raise ValueError(f"high must lie above low in every coordinate, not {high!r} and {low!r}")
        return equilibria(self._lagrange, self._held, *corners, self._numbers)

    def normal_modes(self, q0: Sequence[float] | np.ndarray) -> NormalModes:
        """Small motions about the equilibrium ``q0`` (n,): ``frequencies`` (angular), ``shapes``, ``stable``.

        Gyroscopic and dissipative forces are part of them. Raises ValueError where ``q0`` is no equilibrium, and where
        the equations about it change with the time: see :meth:`floquet`.

        >>> sway = System(lambda t, q, v: (v[0]**2 - 4 * q[0]**2) / 2, ("x",), forces=lambda t, q, v: [-0.4 * v[0]])
        >>> modes = sway.normal_modes([0.0])
        >>> print(f"{modes.frequencies[0]:.6f} {modes.rates[0]:.1f} {modes.stable}")
        1.989975 -0.2 True
        """
        return self.linearised(q0).modes()

    def linearised(self, q0: Sequence[float] | np.ndarray) -> Linearised:
        """The equations of small motions about the equilibrium ``q0`` (n,), with gyroscopic and dissipative forces.

        Raises ValueError as :meth:`normal_modes` does.
        """
        self._check_regular()
        return linearised(self._lagrange, self._held, finite_column("q0", q0, self.n), self._numbers)

    def floquet(self, q0: Sequence[float] | np.ndarray, period: float) -> Floquet:
        """What becomes in a ``period`` of small motions about ``q0`` (n,), where a driven system stands still.

        That of a closed orbit is :attr:`ClosedOrbit.floquet`. Raises ValueError where ``q0`` does not stand still,
        where the equations do not repeat themselves after the period, and for constraints.

        >>> import casadi as ca
        >>> swing = System(lambda t, q, v: v[0]**2 / 2 + (1 + 0.3 * ca.cos(2 * t)) * ca.cos(q[0]), ("theta",))
        >>> swing.floquet([0.0], np.pi).stable
        False
        """
        place, last = finite_column("q0", q0, self.n), finite("period", period)
        self.check_standing(place, self._numbers[None, :], np.array([last]))
        matrices, _ = self.about_rest(place, np.append(self._numbers, 0.0)[None, :], np.array([last]))
        return Floquet(last, matrices[0], self.symplectic_form(0.0, place, np.zeros(self.n)))

    def check_standing(self, q0: np.ndarray, numbers: np.ndarray, periods: np.ndarray) -> None:
        """ValueError where ``q0`` (n,) is no place of rest for parameters (m, c), or the equations do not repeat."""
        if self._held is not None:
            raise ValueError("constraints: Floquet's multipliers need coordinates that need none")
        if not np.all(np.isfinite(periods) & (periods > 0)):
            raise ValueError(f"period must be positive, not {periods.min()}")
        check_standing(self._lagrange, q0, numbers, periods)

    def gauged(self, gauge: Callable[..., Any]) -> System:
        """The system of L + dF/dt with F = ``gauge(t, q[, p])``, which has the same motions."""
        s = self._lagrange.symbols
        f = s.traced("gauge", gauge, s.t, s.q)
        total = self._lagrange.value + ca.jtimes(f, s.q, s.v) + ca.jacobian(f, s.t)
        return System(
            s.function(total, s.t, s.q, s.v), self.coordinates, parameters=self.parameters,
            constraints=self.constraints, forces=self._forces_given, units=self.units, time_unit=self.time_unit,
            name=self.name,
        )  # fmt: skip

    def routhian(self, momenta: Mapping[str, float]) -> System:
        """The reduced system of the other coordinates, where the ``momenta`` of ignorable ones have these values.

        Its Lagrangian is Routh's R = L - Σ p v (Goldstein, Poole and Safko, "Classical Mechanics", sect. 8.3). Raises
        ValueError for coordinates that are not ignorable, and where L is not of second degree in their rates.
        """
        given = momenta_of(momenta, self.ignorable)
        if not given or len(given) == self.n:
            raise ValueError(f"momenta must name some of the ignorable coordinates {self.ignorable}, and not all")
        s = self._lagrange.symbols
        gone = [self.coordinates.index(name) for name in given]
        left = [k for k in range(self.n) if k not in gone]
        value, _ = routh(self._lagrange, gone, list(given.values()))
        lagrangian = s.function(value, s.t, s.q[left], s.v[left])
        return System(
            lagrangian, [self.coordinates[k] for k in left], parameters=self.parameters,
            units=[self.units[k] for k in left], time_unit=self.time_unit, name=self.name,
        )  # fmt: skip

    def reduced(self, momenta: Mapping[str, float] | None = None) -> ReducedMotion:
        """The motions in the one coordinate that is left where the ``momenta`` of all ignorable others are given.

        Turning points, periods, angles, separatrices and circular orbits, by quadrature; nothing is moved. Raises
        ValueError where more or fewer coordinates are left, for coordinates that are not ignorable, and where L knows
        the time, has forces or constraints, or is not of second degree in the rates.

        >>> kepler = System(lambda t, q, v: (v[0]**2 + q[0]**2 * v[1]**2) / 2 + 1 / q[0], ("r", "phi"))
        >>> [ellipse] = kepler.reduced({"phi": 0.8}).orbits(-0.5)
        >>> bool(abs(ellipse.period - 2 * np.pi) < 1e-14), bool(abs(ellipse.precession["phi"]) < 1e-14)
        (True, True)
        """
        given = momenta_of({} if momenta is None else momenta, self.ignorable)
        left = [name for name in self.coordinates if name not in given]
        if len(left) != 1:
            raise ValueError(f"momenta must leave one coordinate, not {left}: give those of all that are ignorable")
        if self._held is not None or "energy" not in self._kept:
            raise ValueError("L must keep its energy to be reduced: without the time, forces and constraints")
        self._check_regular()
        numbers = [finite(f"momenta[{name!r}]", value) for name, value in given.items()]
        one = OneCoordinate.of(self._lagrange, [self.coordinates.index(k) for k in given], numbers, self._numbers)
        return ReducedMotion(one, left[0], tuple(given))

    def between(self, q0: Sequence[float], q1: Sequence[float], duration: float) -> Problem:
        """The action of motions from ``q0`` to ``q1`` (n,) in the time ``duration``: a problem to solve and verify.

        Raises TypeError or ValueError for what are not n numbers, and a duration that is not positive.
        """
        first, last = finite_column("q0", q0, self.n), finite_column("q1", q1, self.n)
        if not finite("duration", duration) > 0:
            raise ValueError(f"duration must be positive, not {duration!r}")
        start, end = Fixed(0.0, first.tolist()), Fixed(float(duration), last.tolist())
        return self._action.problem(start, end)

    def periodic(self, period: float | str, symmetry: Sequence[Repeats | Returns] | None = None) -> Problem:
        """The action of closed motions of a ``period``: a problem to solve or to verify.

        Where the motions have a ``symmetry`` it is the action of the part from which the rest follows, on that part of
        the period. A period that names one of the parameters is that parameter, to be followed by
        :func:`varcalc.continue_branch`; the problem's abscissa is then the share of the period. The problem's
        coordinates, and whole orbits of its solutions, are those of :meth:`closed_orbits`.
        """
        return self.closed_orbits(period, symmetry).problem

    def closed_orbits(self, period: float | str, symmetry: Sequence[Repeats | Returns] | None = None) -> ClosedOrbits:
        """The same with the way there and back: guesses for the ``problem``, and the orbits of its solutions."""
        return ClosedOrbits(
            self._action, self._orbit, period, sequence("symmetry", () if symmetry is None else symmetry)
        )

    def orbit(self, q0: Sequence[float], v0: Sequence[float], period: float) -> ClosedOrbit:
        """The closed orbit of a ``period`` next to the motion from ``q0`` and ``v0`` (n,), with what becomes of others.

        Raises ValueError where no closed orbit is next to it.
        """
        time = finite("period", period)
        if not time > 0:
            raise ValueError(f"period must be positive, not {period!r}")
        return self._orbit(finite_column("q0", q0, self.n), finite_column("v0", v0, self.n), time, None)

    def _orbit(self, q0: np.ndarray, v0: np.ndarray, period: float, back: np.ndarray | None) -> ClosedOrbit:
        if self._held is not None:
            raise ValueError("orbit() is of systems without constraints: give coordinates that need none")
        q, v = self._started(0.0, q0, v0)
        numbers = self._with_rate(0.0, q, v, period)
        state = closed_state(self._monodromy, np.concatenate([q, v]), numbers, float(period), back)
        motion = self.motion(state[: self.n].tolist(), state[self.n :].tolist(), (0.0, float(period)))
        form = self.symplectic_form(0.0, state[: self.n], state[self.n :])
        return closed_orbit(self._monodromy, motion, form, self._summed, self._second_variation)

    @cached_property
    def _action(self) -> Action:
        held = tuple(c for c in self.constraints if isinstance(c, Holonomic))
        if len(held) < len(self.constraints) or self._forces_given:
            raise ValueError("forces and Pfaffian constraints have no action: leave them out, or use motion()")
        return Action(self._given, self._lagrange, held, self.parameters, self.name, self.axes)

    def motion(
        self, q0: Sequence[float], v0: Sequence[float], span: tuple[float, float], *, events: Sequence[Event] = (),
        progress: Progress = None,
    ) -> Motion:  # fmt: skip
        """The motion from coordinates ``q0`` and rates ``v0`` (n,) over the times ``span``, with its ``events``.

        A long one tells its ``progress`` as :data:`varcalc.progress.Progress` says; Ctrl-C raises
        :class:`varcalc.Interrupted`, which holds the motion as far as it had come. Raises ValueError for a start that
        breaks a constraint, and for a singular L.
        """
        first, last = ascending_span(span)
        for k, event in enumerate(given := sequence("events", events)):
            if not isinstance(event, Event):
                raise TypeError(f"events[{k}] must be a mechanics.Event, not {event!r}")
        q, v = self._started(first, q0, v0)
        numbers, state = self._with_rate(first, q, v, last - first), np.concatenate([q, v])
        happened, end = self._happened(given, state, numbers, (first, last))
        flown = course(self._flow, state, numbers, (first, end), progress)
        drift = self._drift(flown.looked, flown.states)
        error = flown.error(slice(self.n), float(np.abs(flown.states[:, : self.n]).max()))
        error += self._out_of_step(flown.looked, flown.states, drift.get("energy", 0.0))
        motion = Motion(
            (first, flown.reached), flown.run.outcome, error, drift,
            tuple(h for h in happened if h.t <= flown.reached), flown.run.steps, numbers, flown.trajectory,
            self._measured, self.axes,
        )  # fmt: skip
        if flown.stopped:
            raise Interrupted(motion)
        return motion

    def ensemble(self, q0: Any, v0: Any, times: Sequence[float]) -> Ensemble:
        """Motions from many states at once: ``q0`` and ``v0`` (m, n) at the first of the ascending ``times`` (k,)."""
        when = ascending_times(times)
        states, numbers = self._many(q0, v0, when[0], when[-1])
        return carried(self._flow(integrators.for_many(MOST_STEPS)), states, numbers, when, self.axes)

    def galerkin(
        self, q0: Sequence[float], v0: Sequence[float], span: tuple[float, float], *, steps: int, degree: int = 3
    ) -> Stepped:
        """The motion by a variational integrator: in each of equal ``steps`` a polynomial makes the action stationary.

        Of order 2 ``degree``. It keeps momenta of symmetries and the symplectic form to round-off, and its energy does
        not drift, however long; :meth:`motion` is the quicker and the more accurate (docs/mechanics.md), and it alone
        claims an error: what is narrower than a step is not seen here. Raises
        ValueError for Pfaffian constraints, and for steps that are too long to have a solution.
        """
        first, last = ascending_span(span)
        steps, degree = whole("steps", steps), whole("degree", degree)
        if any(isinstance(c, Pfaffian) for c in self.constraints):
            raise ValueError("Pfaffian constraints have no action to be made stationary: use motion()")
        if self._switches:
            raise ValueError(f"{self._said(self._switches[0])}, and a step would go over that: use motion()")
        q, v = self._started(first, q0, v0)
        size = max(float(np.abs(q).max()), float(np.abs(v).max()) * (last - first) / steps)
        stepper = GalerkinSteps(self._lagrange, self._held, degree, size or 1.0)
        return stepper.run(q, v, np.linspace(first, last, steps + 1), self._numbers)

    def passages(self, q0: Any, v0: Any, event: Event, span: tuple[float, float], *, most: int = 1) -> Passages:
        """The first ``most`` passages through an ``event`` of motions from many states ``q0`` and ``v0`` (m, n).

        Of many passages it is Poincaré's section; of the first one, the time that each motion takes to it. An event
        counts as many times as it happens, whether or not it is ``terminal``. Raises TypeError or ValueError for
        arguments of another kind or shape, and times that do not ascend.
        """
        most = whole("most", most)
        if not isinstance(event, Event):
            raise TypeError(f"event must be a mechanics.Event, not {event!r}")
        first, last = ascending_span(span)
        states, numbers = self._many(q0, v0, first, last)
        flow, slopes = self._with_events((event,))
        return passages(flow, states, numbers, (first, last), slopes, event.direction, most)


def check_system(system: Any) -> None:
    """TypeError for what is no :class:`System`."""
    if not isinstance(system, System):
        raise TypeError(f"system must be a mechanics.System, not {told(system)}")
