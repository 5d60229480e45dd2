"""A mechanical system declared by its Lagrangian."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from varcalc import integrators
from varcalc.integrators import Engine, Flow
from varcalc.mechanics.action import Action
from varcalc.mechanics.closed_orbits import ClosedOrbit, ClosedOrbits, closed_orbit, closed_state
from varcalc.mechanics.constraints import RATE, Held, Pfaffian, started
from varcalc.mechanics.course import MOST_STEPS, course
from varcalc.mechanics.equilibria import Equilibria, equilibria
from varcalc.mechanics.galerkin import GalerkinSteps, Stepped
from varcalc.mechanics.lagrange import Lagrange, StateSymbols
from varcalc.mechanics.legendre import Hamiltonian
from varcalc.mechanics.linearised import Linearised, NormalModes, check_standing, linearised
from varcalc.mechanics.monodromy import Floquet, Monodromy, MonodromyAtRest
from varcalc.mechanics.motion import Ensemble, Event, Motion, carried, happenings
from varcalc.mechanics.orbit_symmetry import Repeats, Returns
from varcalc.mechanics.passages import Passages, passages
from varcalc.mechanics.reduced.reduced import ReducedMotion
from varcalc.mechanics.reduced.routh import OneCoordinate, routh
from varcalc.mechanics.symmetries import Symmetry, noether
from varcalc.problem.conditions import Fixed, Holonomic
from varcalc.problem.problem import Problem
from varcalc.problem.reading import equation_latex, equation_text, text
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.switches import switches
from varcalc.symbolic.tracing import Expression

COMPILED = "_rates", "_monodromy", "about_rest"
"""What a system shares with the same one for other parameters, which are arguments of these."""


class System:
    """A system of n coordinates whose motions make the action, the integral of L over time, stationary.

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

    Raises
    ------
    TypeError, ValueError
        Naming the argument, where one of them is not what it should be, and where L is singular: L_vv without inertia
        in some direction, which is given.

    Examples
    --------
    >>> import casadi as ca
    >>> pendulum = System(lambda t, q, v, p: v[0]**2 / 2 + p.g * ca.cos(q[0]), ("theta",), parameters={"g": 9.81})
    >>> motion = pendulum.motion([1.0], [0.0], (0, 10))
    >>> motion.drift["energy"] < 1e-13
    True
    """

    def __init__(
        self,
        lagrangian: Callable[..., Any],
        coordinates: Sequence[str],
        *,
        parameters: Mapping[str, float] | None = None,
        constraints: Sequence[Holonomic | Pfaffian] = (),
        forces: Callable[..., Any] | None = None,
        symmetries: Sequence[Symmetry] = (),
        units: Sequence[str] = (),
        time_unit: str = "",
        name: str = "",
    ) -> None:
        self.coordinates = _names(coordinates)
        self.n = len(self.coordinates)
        self.units, self.time_unit = _units(units, self.n), time_unit
        self.parameters = {key: _number(f"parameters[{key!r}]", value) for key, value in (parameters or {}).items()}
        self.name, self.symmetries = name, tuple(symmetries)
        self._given, self._forces_given = lagrangian, forces
        symbols = StateSymbols.of(self.n, tuple(self.parameters))
        value = symbols.traced("lagrangian", lagrangian, symbols.t, symbols.q, symbols.v)
        pushed = symbols.column("forces", forces, self.n, *symbols.all[:3]) if forces else ca.SX.zeros(self.n)
        self._lagrange = Lagrange(symbols, value, pushed)
        self.constraints = tuple(constraints)
        self._held = Held.of(symbols, self.constraints)
        self._numbers = np.array(list(self.parameters.values()), dtype=float)
        self._flows: dict[tuple[Event, ...] | Engine, Flow] = {}
        self._invariants = {one.name: noether(self._lagrange, one, self.parameters) for one in self.symmetries}

    def __repr__(self) -> str:
        return f"System({', '.join(self.coordinates)}{': ' + self.name if self.name else ''})"

    def with_parameters(self, parameters: Mapping[str, float]) -> System:
        """The system with other values of some of its ``parameters``.

        Raises ValueError for names that it does not have.
        """
        if unknown := sorted(set(parameters) - set(self.parameters)):
            raise ValueError(f"parameters {unknown} are none of this system's: {sorted(self.parameters)}")
        given = {key: _number(f"parameters[{key!r}]", value) for key, value in parameters.items()}
        other = copy.copy(self)  # L is not called again, and what is compiled for any parameters is shared
        for name, attribute in vars(System).items():
            if isinstance(attribute, cached_property) and name not in COMPILED:
                vars(other).pop(name, None)
        values = {**self.parameters, **given}
        vars(other).update(
            parameters=values, _numbers=np.array(list(values.values()), dtype=float),
            _invariants={one.name: noether(self._lagrange, one, values) for one in self.symmetries},
        )  # fmt: skip
        return other

    @property
    def lagrange(self) -> Lagrange:
        """What L says by differentiation, as expressions."""
        return self._lagrange

    @property
    def numbers(self) -> np.ndarray:
        """The values of the parameters (c,), in their order."""
        return self._numbers

    @cached_property
    def ignorable(self) -> tuple[str, ...]:
        """The names of coordinates that L and the forces do not depend on: their momenta are kept."""
        read = ca.vertcat(self._lagrange.value, self._lagrange.forces)
        held = read if self._held is None else ca.vertcat(read, *map(ca.vec, self._held.rate), self._held.level)
        q = self._lagrange.symbols.q
        pushed = [not force.is_zero() for force in ca.vertsplit(self._lagrange.forces)]
        free = self._held is None
        return tuple(
            name for k, name in enumerate(self.coordinates) if free and not pushed[k] and not ca.depends_on(held, q[k])
        )

    @cached_property
    def _kept(self) -> dict[str, Expression]:
        """The invariants that L has, by name."""
        one = self._lagrange
        kept = {f"p_{name}": one.momenta[self.coordinates.index(name)] for name in self.ignorable}
        steady = not ca.depends_on(one.value, one.symbols.t) and one.forces.is_zero()
        if self._held is not None:
            steady = steady and self._held.drift.is_zero()
        return ({"energy": one.energy} if steady else {}) | kept | self._invariants

    def equations(self) -> str:
        """The equations of motion as text, one line a coordinate; the multipliers of constraints are lambda_1, ...

        >>> import casadi as ca
        >>> print(System(lambda t, q, v: (v[0]**2 + q[0]**2 * v[1]**2) / 2 + 1 / q[0], ("r", "phi")).equations())
        r^2 r'' - r^3 phi'^2 + 1 = 0
        r^2 phi'' + 2 r phi' r' = 0
        """
        return "\n".join(equation_text(left, self._named) for left in self._balance)

    def equations_latex(self) -> str:
        r"""The equations of motion as LaTeX, one line a coordinate.

        >>> print(System(lambda t, q, v: (v[0]**2 - q[0]**2) / 2, ("theta",)).equations_latex())
        \theta'' + \theta = 0
        """
        return "\n".join(equation_latex(left, self._named) for left in self._balance)

    @cached_property
    def _rate_symbols(self) -> tuple[Expression, Expression]:
        """Accelerations (n,) and multipliers (k,) as symbols."""
        return ca.SX.sym("a", self.n), ca.SX.sym("lambda", len(self.constraints))

    @cached_property
    def _balance(self) -> list[Expression]:
        """What vanishes along a motion, for each coordinate: d/dt L_v - L_q - Q less the reactions."""
        accelerations, multipliers = self._rate_symbols
        left = ca.mtimes(self._lagrange.mass, accelerations) - self._lagrange.pull
        if self._held is not None:
            left -= ca.mtimes(self._held.rows.T, multipliers)
        return ca.vertsplit(ca.densify(left))

    @cached_property
    def _named(self) -> list[tuple[Expression, Sequence[str]]]:
        """The symbols of the equations with their names."""
        s, (accelerations, multipliers) = self._lagrange.symbols, self._rate_symbols
        q = self.coordinates
        v, a = [f"{name}'" for name in q], [f"{name}''" for name in q]
        lambdas = [f"lambda_{k + 1}" for k in range(len(self.constraints))]
        pairs = [(s.t, ["t"]), (s.q, q), (s.v, v), (accelerations, a), (s.p, s.names), (multipliers, lambdas)]
        return [(symbols, labels) for symbols, labels in pairs if labels]

    def invariant(self, symmetry: Symmetry) -> Callable[..., float]:
        """Noether's invariant of a symmetry, as a function of t, q (n,) and v (n,).

        Raises ValueError where it is no symmetry of L.
        """
        value = noether(self._lagrange, symmetry, self.parameters)
        function = ca.Function("invariant", self._lagrange.symbols.all, [value])
        return lambda t, q, v: float(function(t, q, v, self._numbers))

    def momenta(self, t: float, q: Sequence[float], v: Sequence[float]) -> np.ndarray:
        """The momenta L_v (n,)."""
        return self._evaluated("momenta", self._lagrange.momenta, t, q, v).ravel()

    def energy(self, t: float, q: Sequence[float], v: Sequence[float]) -> float:
        """Jacobi's integral v·L_v - L."""
        return float(self._evaluated("energy", self._lagrange.energy, t, q, v)[0, 0])

    def energies(self, q: np.ndarray, v: np.ndarray, t: float = 0.0) -> np.ndarray:
        """The energy (m,) of many states (n, m)."""
        function = PointEvaluator(ca.Function("energies", self._lagrange.symbols.all, [self._lagrange.energy]))
        columns = np.full((1, 1), t), np.asarray(q, dtype=float).T, np.asarray(v, dtype=float).T, self._numbers[None, :]
        return function(np.shape(q)[1], *columns)[:, 0]

    def accelerations(self, t: float, q: Sequence[float], v: Sequence[float]) -> np.ndarray:
        """The second derivatives of the coordinates (n,), with forces and constraints."""
        self._check_regular()
        return self._evaluated("accelerations", self._bare, t, q, v).ravel()

    def _evaluated(self, name: str, value: Expression, t: float, q: Sequence[float], v: Sequence[float]) -> np.ndarray:
        state = _column("q", q, self.n), _column("v", v, self.n)
        return np.array(ca.Function(name, self._lagrange.symbols.all, [value])(t, *state, self._numbers))

    def _check_regular(self) -> None:
        if self._null is not None:
            direction = ", ".join(f"{x:.6g}" for x in self._null)
            raise ValueError(
                f"L is singular: L_vv has no inertia along ({direction}) in ({', '.join(self.coordinates)}), so that "
                "it fixes no acceleration there and has no Hamiltonian"
            )

    @cached_property
    def _switch(self) -> str | None:
        """What is said of a kink or a jump: a step of an integration would go over it, and its error would not tell."""
        s = self._lagrange.symbols
        read = [self._lagrange.value, *ca.vertsplit(self._lagrange.forces)]
        if self._held is not None:
            read += [*ca.vertsplit(ca.vec(self._held.rows)), *ca.vertsplit(self._held.level)]
        state = ca.vertcat(s.t, s.q, s.v)
        found = next((one for one in switches(read, s.all) if one.depends_on(state)), None)
        if found is None:
            return None
        return (
            f"L, the forces or a constraint switches ({found.word}) where {text(found.argument, self._named)} is "
            "zero, and a motion would step over that; move each side by itself, up to a terminal event there"
        )

    @cached_property
    def _null(self) -> np.ndarray | None:
        return self._lagrange.without_inertia(self.parameters)

    @cached_property
    def _bare(self) -> Expression:
        return self._accelerations(ca.SX(0))[0]

    def _accelerations(self, alpha: Expression) -> tuple[Expression, Expression]:
        """The accelerations, and the reactions of constraints (n,)."""
        if self._held is None:
            return self._lagrange.solved(self._lagrange.pull), ca.SX.zeros(self.n)
        accelerations, multipliers = self._held.accelerations(self._lagrange, alpha)
        return accelerations, ca.mtimes(self._held.rows.T, multipliers)

    def hamiltonian(self) -> Hamiltonian:
        """H(t, q, p), with the velocities of momenta and Hamilton's equations.

        Raises ValueError, with the null direction, where L is singular.
        """
        self._check_regular()
        return Hamiltonian(self._lagrange, self._numbers)

    def equilibria(self, low: Sequence[float] | np.ndarray, high: Sequence[float] | np.ndarray) -> Equilibria:
        """All places between ``low`` and ``high`` (n,) at which the system can rest, and how they were searched for.

        In a frame that turns these are the steady motions; of a system that is driven, places that stand still at all
        times. Raises ValueError for constraints other than Holonomic ones that stand still.

        >>> import casadi as ca
        >>> pendulum = System(lambda t, q, v: v[0]**2 / 2 + ca.cos(q[0]), ("theta",))
        >>> [round(float(x), 6) for x in pendulum.equilibria([-1], [7]).places[:, 0]]
        [0.0, 3.141593, 6.283185]
        """
        corners = _column("low", low, self.n), _column("high", high, self.n)
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
        return linearised(self._lagrange, self._held, _column("q0", q0, self.n), self._numbers)

    def floquet(self, q0: Sequence[float] | np.ndarray, period: float) -> Floquet:
        """What becomes in a ``period`` of small motions about ``q0`` (n,), where a driven system stands still.

        That of a closed orbit is :attr:`ClosedOrbit.floquet`. Raises ValueError where ``q0`` does not stand still,
        where the equations do not repeat themselves after the period, and for constraints.

        >>> import casadi as ca
        >>> swing = System(lambda t, q, v: v[0]**2 / 2 + (1 + 0.3 * ca.cos(2 * t)) * ca.cos(q[0]), ("theta",))
        >>> swing.floquet([0.0], np.pi).stable
        False
        """
        place, last = _column("q0", q0, self.n), _number("period", period)
        self.check_standing(place, self._numbers[None, :], np.array([last]))
        matrices, _ = self.about_rest(place, np.append(self._numbers, 0.0)[None, :], np.array([last]))
        return Floquet(last, matrices[0], self.symplectic_form(0.0, place, np.zeros(self.n)))

    def symplectic_form(self, t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """The form dq ∧ dp of changes of the coordinates and rates (2n, 2n), with the momenta p of such a state."""
        one, n = self._lagrange, self.n
        function = ca.Function(
            "momenta", one.symbols.all, [ca.densify(ca.jacobian(one.momenta, one.symbols.q)), one.mass]
        )
        change = np.hstack([np.array(part) for part in function(t, q, v, self._numbers)])
        upper = np.hstack([np.eye(n), np.zeros((n, n))]).T @ change
        return upper - upper.T

    @cached_property
    def about_rest(self) -> MonodromyAtRest:
        """Small motions about places that stand still, compiled for any values of the parameters."""
        self._check_motion()
        return MonodromyAtRest.of(self._rates[0])

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
        wrong = [name for name in momenta if name not in self.ignorable]
        if wrong or not momenta or len(momenta) == self.n:
            raise ValueError(f"momenta must name some of the ignorable coordinates {self.ignorable}, not {wrong}")
        s = self._lagrange.symbols
        gone = [self.coordinates.index(name) for name in momenta]
        left = [k for k in range(self.n) if k not in gone]
        value, _ = routh(self._lagrange, gone, list(momenta.values()))
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
        given = dict(momenta or {})
        wrong = [name for name in given if name not in self.ignorable]
        if wrong:
            raise ValueError(f"momenta must name ignorable coordinates, which are {self.ignorable}, not {wrong}")
        left = [name for name in self.coordinates if name not in given]
        if len(left) != 1:
            raise ValueError(f"momenta must leave one coordinate, not {left}: give those of all that are ignorable")
        if self._held is not None or "energy" not in self._kept:
            raise ValueError("L must keep its energy to be reduced: without the time, forces and constraints")
        self._check_regular()
        numbers = [_number(f"momenta[{name!r}]", value) for name, value in given.items()]
        one = OneCoordinate.of(self._lagrange, [self.coordinates.index(k) for k in given], numbers, self._numbers)
        return ReducedMotion(one, left[0], tuple(given))

    def between(self, q0: Sequence[float], q1: Sequence[float], duration: float) -> Problem:
        """The action of motions from ``q0`` to ``q1`` (n,) in the time ``duration``: a problem to solve and verify."""
        first, last = _column("q0", q0, self.n), _column("q1", q1, self.n)
        start, end = Fixed(0.0, first.tolist()), Fixed(float(duration), last.tolist())
        return self._action.problem(start, end)

    def periodic(self, period: float | str, symmetry: Sequence[Repeats | Returns] = ()) -> Problem:
        """The action of closed motions of a ``period``: a problem to solve or to verify.

        Where the motions have a ``symmetry`` it is the action of the part from which the rest follows, on that part of
        the period. A period that names one of the parameters is that parameter, to be followed by
        :func:`varcalc.continue_branch`; the problem's abscissa is then the share of the period. The problem's
        coordinates, and whole orbits of its solutions, are those of :meth:`closed_orbits`.
        """
        return self.closed_orbits(period, symmetry).problem

    def closed_orbits(self, period: float | str, symmetry: Sequence[Repeats | Returns] = ()) -> ClosedOrbits:
        """The same with the way there and back: guesses for the ``problem``, and the orbits of its solutions."""
        return ClosedOrbits(self._action, self._orbit, period, symmetry)

    def orbit(self, q0: Sequence[float], v0: Sequence[float], period: float) -> ClosedOrbit:
        """The closed orbit of a ``period`` next to the motion from ``q0`` and ``v0`` (n,), with what becomes of others.

        Raises ValueError where no closed orbit is next to it.
        """
        return self._orbit(np.asarray(q0, dtype=float), np.asarray(v0, dtype=float), period, None)

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
    def _monodromy(self) -> Monodromy:
        return Monodromy.of(self._rates[0])

    @cached_property
    def _action(self) -> Action:
        held = tuple(c for c in self.constraints if isinstance(c, Holonomic))
        if len(held) < len(self.constraints) or self._forces_given:
            raise ValueError("forces and Pfaffian constraints have no action: leave them out, or use motion()")
        return Action(self._given, self._lagrange, held, self.parameters, self.name)

    def motion(
        self, q0: Sequence[float], v0: Sequence[float], span: tuple[float, float], *, events: Sequence[Event] = ()
    ) -> Motion:
        """The motion from coordinates ``q0`` and rates ``v0`` (n,) over the times ``span``, with its ``events``.

        Raises ValueError for a start that breaks a constraint, and for a singular L.
        """
        first, last = (_number(f"span[{k}]", value) for k, value in enumerate(span))
        for k, event in enumerate(events):
            if not isinstance(event, Event):
                raise TypeError(f"events[{k}] must be a mechanics.Event, not {event!r}")
        if not last > first:
            raise ValueError(f"span must be two ascending times, not {span!r}")
        q, v = self._started(first, q0, v0)
        numbers, state = self._with_rate(first, q, v, last - first), np.concatenate([q, v])
        happened, end = self._happened(tuple(events), state, numbers, (first, last))
        flown = course(self._flow, state, numbers, (first, end))
        drift = self._drift(flown.looked, flown.states)
        error = flown.error(slice(self.n), float(np.abs(flown.states[:, : self.n]).max()))
        error += self._out_of_step(flown.looked, flown.states, drift.get("energy", 0.0))
        return Motion(
            (first, flown.reached), flown.run.outcome, error, drift, happened, flown.run.steps, numbers,
            flown.trajectory, self._measured,
        )  # fmt: skip

    def ensemble(self, q0: Any, v0: Any, times: Sequence[float]) -> Ensemble:
        """Motions from many states at once: ``q0`` and ``v0`` (m, n) at the first of the ascending ``times`` (k,)."""
        when = np.asarray(times, dtype=float)
        if when.ndim != 1 or len(when) < 2 or not np.all(np.diff(when) > 0):
            raise ValueError(f"times must be two or more, ascending, not {times!r}")
        states, numbers = self._many(q0, v0, when[0], when[-1])
        return carried(self._flow(integrators.for_many(MOST_STEPS)), states, numbers, when)

    def galerkin(
        self, q0: Sequence[float], v0: Sequence[float], span: tuple[float, float], *, steps: int, degree: int = 3
    ) -> Stepped:
        """The motion by a variational integrator: in each of equal ``steps`` a polynomial makes the action stationary.

        Of order 2 ``degree``. It keeps momenta of symmetries and the symplectic form to round-off, and its energy does
        not drift, however long; :meth:`motion` is the quicker and the more accurate (docs/mechanics.md), and it alone
        claims an error: what is narrower than a step is not seen here. Raises
        ValueError for Pfaffian constraints, and for steps that are too long to have a solution.
        """
        first, last = (_number(f"span[{k}]", value) for k, value in enumerate(span))
        for name, value in (("steps", steps), ("degree", degree)):
            if isinstance(value, bool) or not isinstance(value, int) or value < 1:
                raise ValueError(f"{name} must be a whole number from 1 on, not {value!r}")
        if not last > first:
            raise ValueError(f"span must be two ascending times, not {span!r}")
        if any(isinstance(c, Pfaffian) for c in self.constraints):
            raise ValueError("Pfaffian constraints have no action to be made stationary: use motion()")
        q, v = self._started(first, q0, v0)
        size = max(float(np.abs(q).max()), float(np.abs(v).max()) * (last - first) / steps)
        stepper = GalerkinSteps(self._lagrange, self._held, degree, size or 1.0)
        return stepper.run(q, v, np.linspace(first, last, steps + 1), self._numbers)

    def passages(self, q0: Any, v0: Any, event: Event, span: tuple[float, float], *, most: int = 1) -> Passages:
        """The first ``most`` passages through an ``event`` of motions from many states ``q0`` and ``v0`` (m, n).

        Of many passages it is Poincaré's section; of the first one, the time that each motion takes to it. An event
        counts as many times as it happens, whether or not it is ``terminal``.
        """
        if isinstance(most, bool) or not isinstance(most, int) or most < 1:
            raise ValueError(f"most must be a whole number from 1 on, not {most!r}")
        if not isinstance(event, Event):
            raise TypeError(f"event must be a mechanics.Event, not {event!r}")
        first, last = (_number(f"span[{k}]", value) for k, value in enumerate(span))
        if not last > first:
            raise ValueError(f"span must be two ascending times, not {span!r}")
        states, numbers = self._many(q0, v0, first, last)
        flow, slopes = self._with_events((event,))
        return passages(flow, states, numbers, (first, last), slopes, event.direction, most)

    def _many(self, q0: Any, v0: Any, first: float, last: float) -> tuple[np.ndarray, np.ndarray]:
        """Many states (m, 2n) at the ``first`` time, and the constants of their motions up to the ``last``."""
        q, v = (np.atleast_2d(np.asarray(part, dtype=float)) for part in (q0, v0))
        if q.shape != v.shape or q.shape[1] != self.n:
            raise ValueError(f"q0 and v0 must both have the shape (m, {self.n}), not {q.shape} and {v.shape}")
        if not (np.all(np.isfinite(q)) and np.all(np.isfinite(v))):
            raise ValueError("q0 and v0 must be finite numbers")
        states = np.concatenate([q, v], axis=1)
        self._check_motion()
        if self._held is not None:
            states = np.array([np.concatenate(self._started(first, *pair)) for pair in zip(q, v, strict=True)])
        return states, self._with_rate(first, q[0], v[0], last - first)

    def _check_motion(self) -> None:
        """Refuse what fixes no accelerations, or switches them."""
        self._check_regular()
        if self._switch is not None:
            raise ValueError(self._switch)

    def _started(self, t: float, q0: Any, v0: Any) -> tuple[np.ndarray, np.ndarray]:
        self._check_motion()
        q, v = _column("q0", q0, self.n), _column("v0", v0, self.n)
        return (q, v) if self._held is None else started(self._lagrange, self._held, t, q, v, self._numbers)

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
            self._flows[engine] = engine.compile(self._rates[0])
        return self._flows[engine]

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
            self._flows[events] = integrators.for_many(MOST_STEPS).compile(system, stops)
        slope = ca.densify(ca.jtimes(level, state_and_time, rates))
        slopes = PointEvaluator(ca.Function("slopes", [state_and_time, constants], [level, slope]))
        return self._flows[events], slopes

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
        way = (times[-1] - times[0]) * float(np.nanmax(np.abs(states[:, self.n :]), initial=0.0))
        return way * drift / size if size > 0 else 0.0

    def _drift(self, times: np.ndarray, states: np.ndarray) -> dict[str, float]:
        """How far each invariant goes from where it was."""
        kept = self._kept
        if not kept:
            return {}
        function = PointEvaluator(ca.Function("kept", self._lagrange.symbols.all, [ca.vertcat(*kept.values())]))
        columns = times[:, None], states[:, : self.n], states[:, self.n :], self._numbers[None, :]
        values = function(len(times), *columns)
        return dict(zip(kept, np.abs(values - values[0]).max(axis=0).tolist(), strict=True))


def _names(coordinates: Sequence[str]) -> tuple[str, ...]:
    names = (coordinates,) if isinstance(coordinates, str) else tuple(coordinates)
    if not names or not all(isinstance(name, str) and name for name in names) or len(set(names)) != len(names):
        raise ValueError(f"coordinates must be different names, one for each coordinate, not {coordinates!r}")
    return names


def _units(units: Sequence[str], n: int) -> tuple[str, ...]:
    given = (units,) if isinstance(units, str) else tuple(units)
    if (given and len(given) != n) or not all(isinstance(unit, str) for unit in given):
        raise ValueError(f"units must be {n} strings, one for each coordinate, not {units!r}")
    return given or ("",) * n


def _number(name: str, value: Any) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise TypeError(f"{name} must be a number, not {value!r}") from None
    if not np.isfinite(number):
        raise ValueError(f"{name} must be finite, not {value!r}")
    return number


def _column(name: str, values: Any, n: int) -> np.ndarray:
    column = np.atleast_1d(np.asarray(values, dtype=float))
    if column.shape != (n,) or not np.all(np.isfinite(column)):
        raise ValueError(f"{name} must be {n} finite numbers, one for each coordinate, not {values!r}")
    return column
