"""A rigid body that turns about a fixed point, or about its centre of mass."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from varcalc.integrators import Engine, Flow, Piecewise
from varcalc.mechanics.arguments import triple
from varcalc.mechanics.constraints import RATE
from varcalc.mechanics.course import course
from varcalc.mechanics.rigid.equations import BodySymbols, TurningEquations
from varcalc.mechanics.rigid.free import Cones, Polhode, SteadyRotation, cones, polhode, steady_rotations
from varcalc.mechanics.rigid.inertia import Inertia, Principal, TopKind, check_inertia, principal
from varcalc.mechanics.rigid.motion import RigidMotion, with_unit_quaternions
from varcalc.mechanics.rigid.rotations import EulerAngles, entries, normalised
from varcalc.problem.conditions import named, reals, text, told
from varcalc.progress import Interrupted, Progress
from varcalc.showing import Fact, Shown, line, listed
from varcalc.spelling import spelled
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.tracing import Expression


@spelled
class RigidBody(Shown):
    """A body of a given inertia about the point that is at rest: a pivot, or its centre of mass.

    Raises TypeError or ValueError naming the argument, where one of them is not what it should be; for an inertia of no
    body; and for one without moment about some axis, about which nothing would say how it turns.

    Parameters
    ----------
    inertia : Inertia or array_like
        About its centre of mass; or a tensor (3, 3), or three principal moments, about the point at rest. Components
        are along the body's own axes, which need not be principal ones.
    potential : callable, optional
        ``potential(t, R)``, with ``p`` last where there are parameters: the energy of an orientation, of the rotation
        matrix R (3, 3), whose columns are the body's axes in space.
    torque : callable, optional
        ``torque(t, R, omega[, p])``: three further torques along the body's axes, such as friction or a drive;
        ``omega`` (3,) is the angular velocity along the body's axes.
    parameters : mapping, optional
        Numbers that the formulas know as attributes of ``p``.
    name : str

    Examples
    --------
    >>> racket = RigidBody([1.0, 2.0, 3.0])
    >>> motion = racket.motion([1, 0, 0, 0], [0.1, 2.0, 0.1], (0, 100))
    >>> motion.drift["energy"] < 1e-13
    True
    """

    def __init__(
        self,
        inertia: Inertia | Any,
        *,
        potential: Callable[..., Any] | None = None,
        torque: Callable[..., Any] | None = None,
        parameters: Mapping[str, float] | None = None,
        name: str = "",
    ) -> None:
        self.inertia: np.ndarray = _tensor(inertia)
        self.principal: Principal = principal(self.inertia)
        if self.principal.kind is TopKind.LINEAR:
            axis = ", ".join(f"{x:.6g}" for x in self.principal.axes[:, 0])
            raise ValueError(
                f"inertia has no moment about ({axis}), so that nothing says how the body turns about it; give two "
                "angles to a mechanics.System instead"
            )
        self.parameters: dict[str, float] = named("parameters", parameters)
        self.name: str = text("name", name)
        self._numbers = np.array(list(self.parameters.values()), dtype=float)
        symbols = BodySymbols.of(tuple(self.parameters))
        self._equations = TurningEquations(symbols, self.inertia, symbols.energy(potential), symbols.torque(torque))
        self._flows: dict[Engine, Flow] = {}

    def __repr__(self) -> str:
        return line("RigidBody", [f"{self.principal.kind.name.lower()} top{': ' + self.name if self.name else ''}"])

    def _headline(self) -> str:
        told = f"body that turns, with {self.principal.kind.value}"
        return f"{self.name}: a {told}" if self.name else f"A {told}"

    def _facts(self) -> Iterator[Fact]:
        yield Fact("moments", ", ".join(f"{moment:.9g}" for moment in self.principal.moments))
        for number, axis in enumerate(self.principal.axes.T):
            yield Fact("" if number else "axes", f"({', '.join(f'{x:.6g}' for x in axis)})")
        if self.parameters:
            yield Fact("parameters", listed(self.parameters))

    @classmethod
    def pivoted(
        cls, inertia: Inertia, pivot: Sequence[float], gravity: Sequence[float] = (0.0, 0.0, -9.81), name: str = ""
    ) -> RigidBody:
        """A heavy body that turns about a ``pivot`` (3,), a point of the body in the coordinates of its ``inertia``.

        ``gravity`` (3,) is the acceleration of free fall in space; the energy of an orientation is -m g·R (c - pivot)
        (Goldstein, Poole and Safko, "Classical Mechanics", sect. 5.7).

        >>> top = RigidBody.pivoted(Inertia.cone(0.2, 0.03, 0.05), (0, 0, 0))
        >>> top.principal.kind.name
        'SYMMETRIC'
        """
        check_inertia(inertia)
        arm, weight = inertia.centre - triple("pivot", pivot), ca.DM(inertia.mass * triple("gravity", gravity))
        return cls(inertia.about(pivot), potential=lambda t, R: -ca.dot(weight, ca.mtimes(R, ca.DM(arm))), name=name)

    def motion(
        self,
        orientation: EulerAngles | Sequence[float] | np.ndarray,
        angular_velocity: Sequence[float] | np.ndarray,
        span: tuple[float, float],
        *,
        progress: Progress = None,
    ) -> RigidMotion:
        """The motion from an ``orientation`` and an ``angular_velocity`` (3,) over the times ``span``.

        The orientation is a quaternion (4,) or Euler angles; the angular velocity, in radians for each unit of time,
        is along the body's axes (that of Euler angles' rates is :meth:`EulerAngles.angular_velocity`). A long motion
        tells its ``progress``, and Ctrl-C raises :class:`varcalc.Interrupted`, which holds it as far as it had come.
        Raises ValueError for a start that is not finite, and for times that do not ascend.
        """
        times = reals("span", span)
        if times.shape != (2,) or not np.all(np.isfinite(times)) or not times[1] > times[0]:
            raise ValueError(f"span must be two ascending times, not {span!r}")
        first, last = times.tolist()
        q, omega = oriented(orientation, angular_velocity)
        rate = self._rate(first, q, omega, last - first)
        unit = self.principal.moments[-1] * rate
        state = np.concatenate([q, np.array(entries(q)) @ self.inertia @ omega / unit])
        numbers = self._equations.numbers(self._numbers, RATE * rate, unit)
        flown = course(self._flow, state, numbers, (first, last), progress)
        drift = self._drift(flown.looked, flown.states, numbers)
        error = 2 * flown.error(slice(4), 1.0) + self._out_of_step(
            flown.looked, flown.states, numbers, drift.get("energy", 0.0)
        )
        motion = RigidMotion(
            (first, flown.reached), flown.run.outcome, error, drift, flown.run.steps, numbers, flown.trajectory,
            self._measured,
        )  # fmt: skip
        if flown.stopped:
            raise Interrupted(motion)
        return motion

    def cones(self, angular_velocity: Sequence[float] | np.ndarray) -> Cones:
        """Body cone and space cone of a symmetric body that turns freely with an ``angular_velocity`` (3,).

        >>> RigidBody([1.0, 1.0, 2.0]).cones([0.0, 3.0, 4.0]).body_frequency
        4.0
        """
        return cones(self.principal, oriented((1.0, 0.0, 0.0, 0.0), angular_velocity)[1])

    def polhode(self, angular_velocity: Sequence[float] | np.ndarray) -> Polhode:
        """The way of an ``angular_velocity`` (3,) seen from the body, where that turns freely, and its period."""
        return polhode(self.principal, oriented((1.0, 0.0, 0.0, 0.0), angular_velocity)[1])

    @property
    def steady_rotations(self) -> tuple[SteadyRotation, ...]:
        """Free rotations about the principal axes, by ascending moments, and whether they are stable."""
        return steady_rotations(self.principal)

    @property
    def kept(self) -> tuple[str, ...]:
        """The invariants: the energy, and components of the angular momentum in space (L_x) or of the body (L_1)."""
        return tuple(self._invariants)

    @cached_property
    def _invariants(self) -> dict[str, Expression]:
        return self._equations.kept(self._numbers)

    def _rate(self, t: float, q: np.ndarray, omega: np.ndarray, duration: float) -> float:
        """How fast the motion begins: by its angular velocity, by its torques, or at least once in all its time."""
        one = self._equations
        function = ca.Function("begun", one.symbols.all, [one.torque_of_potential, one.torque])
        torques = function(t, np.array(entries(q)), omega, self._numbers)
        torque = max(float(np.abs(np.array(part)).max()) for part in torques)
        return max(float(np.linalg.norm(omega)), (torque / self.principal.moments[-1]) ** 0.5, 1 / duration)

    def _flow(self, engine: Engine) -> Flow:
        if engine not in self._flows:
            system = ca.Function("turning", self._equations.arguments, [self._equations.rates], {"cse": True})
            self._flows[engine] = Piecewise(engine, self._equations.unjumping).compile(system)
        return self._flows[engine]

    def _evaluator(self, *values: Expression) -> PointEvaluator:
        return PointEvaluator(ca.Function("values", self._equations.arguments, [ca.densify(ca.vertcat(*values))]))

    @cached_property
    def _measured(self) -> PointEvaluator:
        """The angular velocity along the body's axes, the angular momentum in space, and the energy."""
        one = self._equations
        return self._evaluator(one.omega, one.momentum, one.energy)

    @cached_property
    def _kept_values(self) -> PointEvaluator:
        return self._evaluator(*self._invariants.values())

    def _drift(self, times: np.ndarray, states: np.ndarray, numbers: np.ndarray) -> dict[str, float]:
        """How far each invariant goes from where it was."""
        if not self._invariants:
            return {}
        values = self._kept_values(len(times), times[:, None], with_unit_quaternions(states), numbers[None])
        return dict(zip(self._invariants, np.abs(values - values[0]).max(axis=0).tolist(), strict=True))

    def _out_of_step(self, times: np.ndarray, states: np.ndarray, numbers: np.ndarray, drift: float) -> float:
        """By what angle a motion is out of step whose energy is off by its ``drift``: by a share of all its turning."""
        omega = self._measured(len(times), times[:, None], with_unit_quaternions(states), numbers[None])[:, :3]
        twice_kinetic = float(((omega @ self.inertia) * omega).sum(axis=1).max())
        turned = (times[-1] - times[0]) * float(np.linalg.norm(omega, axis=1).max())
        return turned * drift / twice_kinetic if twice_kinetic > 0 else 0.0


def _tensor(inertia: Inertia | Any) -> np.ndarray:
    """The tensor (3, 3) of what was given."""
    if isinstance(inertia, Inertia):
        return inertia.tensor
    given = reals("inertia", inertia)
    return np.diag(given) if given.shape == (3,) else given


def oriented(
    orientation: EulerAngles | Sequence[float] | np.ndarray, angular_velocity: Sequence[float] | np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """A quaternion (4,) of length 1 and an angular velocity (3,), or a ValueError that says what is wrong."""
    given = orientation.quaternion if isinstance(orientation, EulerAngles) else orientation
    q, omega = normalised(given), reals("angular_velocity", angular_velocity)
    if q.shape != (4,):
        raise ValueError(f"orientation must be one quaternion (4,) or EulerAngles of numbers, not {told(orientation)}")
    if omega.shape != (3,) or not np.all(np.isfinite(omega)):
        raise ValueError(f"angular_velocity must be three finite numbers, not {angular_velocity!r}")
    return q, omega
