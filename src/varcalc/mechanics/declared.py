"""What a Lagrangian, forces and constraints say of a system, by differentiation."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from textwrap import shorten
from typing import Any, Self

import casadi as ca
import numpy as np

from varcalc.axes import Axis
from varcalc.integrators import Engine, Flow
from varcalc.mechanics.arguments import coordinate_names, coordinate_units, finite_column
from varcalc.mechanics.constraints import Held, Pfaffian
from varcalc.mechanics.lagrange import Lagrange, StateSymbols
from varcalc.mechanics.legendre import Hamiltonian
from varcalc.mechanics.motion import Event
from varcalc.mechanics.symmetries import Symmetry, noether
from varcalc.problem.conditions import Holonomic, named, reals, sequence, told
from varcalc.problem.conditions import text as text_of
from varcalc.problem.reading import equation_latex, equation_text, latex, text
from varcalc.problem.reading.statement import LONGEST_LATEX
from varcalc.showing import FACT_WIDTH, Fact, Shown, brief, counted, equations, line, listed
from varcalc.spelling import check_names, spelled
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.switches import Switch, switches
from varcalc.symbolic.tracing import Expression

MOST_NAMES = 4
"""Coordinates and equations that are told one by one."""
COMPILED = "_rates", "_monodromy", "about_rest"
"""What a system shares with the same one for other parameters, which are arguments of these."""


@spelled
class Declared(Shown):
    """A system as it is declared, with what follows without any motion; see :class:`varcalc.mechanics.System`."""

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
        if not callable(lagrangian):
            raise TypeError(
                f"lagrangian, which comes before the coordinates, must be a function, not {told(lagrangian)}"
            )
        self.coordinates: tuple[str, ...] = coordinate_names(coordinates)
        self.n: int = len(self.coordinates)
        self.units: tuple[str, ...] = coordinate_units(units, self.n)
        self.time_unit: str = text_of("time_unit", time_unit)
        self.parameters: dict[str, float] = named("parameters", parameters)
        self.name: str = text_of("name", name)
        self.symmetries: tuple[Symmetry, ...] = sequence("symmetries", symmetries)
        self._given, self._forces_given = lagrangian, forces
        symbols = StateSymbols.of(self.n, tuple(self.parameters))
        value = symbols.traced("lagrangian", lagrangian, symbols.t, symbols.q, symbols.v)
        none = ca.SX.zeros(self.n)
        pushed = none if forces is None else symbols.column("forces", forces, self.n, *symbols.all[:3])
        self._lagrange = Lagrange(symbols, value, pushed)
        self.constraints: tuple[Holonomic | Pfaffian, ...] = sequence("constraints", constraints)
        self._held = Held.of(symbols, self.constraints)
        self._numbers = np.array(list(self.parameters.values()), dtype=float)
        self._flows: dict[tuple[Event, ...] | Engine, Flow] = {}
        for k, one in enumerate(self.symmetries):
            if not isinstance(one, Symmetry):
                raise TypeError(f"symmetries[{k}] must be a mechanics.Symmetry, not {one!r}")
        self._invariants = {one.name: noether(self._lagrange, one, self.parameters) for one in self.symmetries}

    def __repr__(self) -> str:
        known = self.coordinates[:MOST_NAMES]
        more = ", ..." if len(self.coordinates) > MOST_NAMES else ""
        return line("System", [f"{', '.join(known)}{more}{': ' + self.name if self.name else ''}"])

    def _headline(self) -> str:
        kind = f"system of {counted(self.n, 'coordinate')}"
        return f"{self.name}: a {kind}" if self.name else f"A {kind}"

    def _facts(self) -> Iterator[Fact]:
        yield Fact("coordinates", shorten(", ".join(map(str, self.axes[1:])), FACT_WIDTH, placeholder=" ..."))
        if self.parameters:
            yield Fact("parameters", listed(self.parameters))
        if self.constraints:
            yield Fact(
                "constraints", f"{len(self.constraints)}: {', '.join(map(brief, self.constraints[:MOST_NAMES]))}"
            )
        yield Fact("keeps", ", ".join(self._kept) or "nothing that its formulas show")
        balance = list(zip(self.equations().splitlines(), self.equations_latex().splitlines(), strict=True))
        shown = balance if len(balance) <= MOST_NAMES else balance[: MOST_NAMES - 1]
        for number, (written, formula) in enumerate(shown):
            short = written if len(written) <= FACT_WIDTH else f"{written[: FACT_WIDTH - 4]} ..."
            yield Fact("" if number else "motion", short, formula if len(formula) <= LONGEST_LATEX else "")
        if len(shown) < len(balance):
            yield Fact("", f"and {len(balance) - len(shown)} more: equations() writes them")

    def _repr_latex_(self) -> str:
        """The equations of motion, typeset."""
        return rf"$\displaystyle {equations(self.equations_latex().splitlines())}$"

    @property
    def axes(self) -> tuple[Axis, ...]:
        """The names and units of the time and the coordinates."""
        time = "time" if "t" in self.coordinates else "t"
        return (Axis(time, self.time_unit), *map(Axis, self.coordinates, self.units))

    def with_parameters(self, parameters: Mapping[str, float]) -> Self:
        """The system with other values of some of its ``parameters``.

        Raises ValueError for names that it does not have.
        """
        given = named("parameters", parameters)
        check_names("parameters of this system", given, self.parameters)
        other = copy.copy(self)  # L is not called again, and what is compiled for any parameters is shared
        for name, attribute in ((n, a) for kind in type(self).__mro__ for n, a in vars(kind).items()):
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

        >>> from varcalc.mechanics import System
        >>> print(System(lambda t, q, v: (v[0]**2 + q[0]**2 * v[1]**2) / 2 + 1 / q[0], ("r", "phi")).equations())
        r^2 r'' - r^3 phi'^2 + 1 = 0
        r^2 phi'' + 2 r phi' r' = 0
        """
        return "\n".join(equation_text(left, self._named) for left in self._balance)

    def equations_latex(self) -> str:
        r"""The equations of motion as LaTeX, one line a coordinate.

        >>> from varcalc.mechanics import System
        >>> print(System(lambda t, q, v: (v[0]**2 - q[0]**2) / 2, ("theta",)).equations_latex())
        \theta'' + \theta = 0
        """
        return "\n".join(equation_latex(left, self._named) for left in self._balance)

    def lagrangian_latex(self) -> str:
        r"""The Lagrangian as LaTeX, its numbers as they are given.

        >>> from varcalc.mechanics import System
        >>> print(System(lambda t, q, v, p: (v[0]**2 - p.k * q[0]**2) / 2, ("x",), parameters={"k": 2.0})
        ...       .lagrangian_latex())
        \frac{x'^{2} - k x^{2}}{2}
        """
        return latex(self._lagrange.value, self._named)

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
        columns = np.full((1, 1), t), reals("q", q).T, np.asarray(v, dtype=float).T, self._numbers[None, :]
        return function(np.shape(q)[1], *columns)[:, 0]

    def accelerations(self, t: float, q: Sequence[float], v: Sequence[float]) -> np.ndarray:
        """The second derivatives of the coordinates (n,), with forces and constraints."""
        self._check_regular()
        return self._evaluated("accelerations", self._bare, t, q, v).ravel()

    def _evaluated(self, name: str, value: Expression, t: float, q: Sequence[float], v: Sequence[float]) -> np.ndarray:
        state = finite_column("q", q, self.n), finite_column("v", v, self.n)
        return np.array(ca.Function(name, self._lagrange.symbols.all, [value])(t, *state, self._numbers))

    def _check_regular(self) -> None:
        if self._null is not None:
            direction = ", ".join(f"{x:.6g}" for x in self._null)
            raise ValueError(
                f"L is singular: L_vv has no inertia along ({direction}) in ({', '.join(self.coordinates)}), so that "
                "it fixes no acceleration there and has no Hamiltonian"
            )

    def _check_motion(self) -> None:
        """Refuse what fixes no accelerations, and switches at which something comes in with a blow."""
        self._check_regular()
        if self._blow is not None:
            raise ValueError(self._blow)

    def _check_smooth(self, asked: str) -> None:
        """Refuse to answer what is ``asked`` of a system that switches on its coordinates or rates."""
        s = self._lagrange.symbols
        found = next((one for one in self._switches if one.depends_on(ca.vertcat(s.q, s.v))), None)
        if found is not None:
            raise ValueError(f"{self._said(found)}, and {asked}: ask motion(), which goes on by what L is beyond")

    @cached_property
    def _switches(self) -> tuple[Switch, ...]:
        """Kinks and jumps of L and the forces that a motion may come to."""
        return self._switching([self._lagrange.value, *ca.vertsplit(self._lagrange.forces)])

    def _switching(self, read: list[Expression]) -> tuple[Switch, ...]:
        s = self._lagrange.symbols
        state = ca.vertcat(s.t, s.q, s.v)
        return tuple(one for one in switches(read, s.all) if one.depends_on(state))

    def _said(self, found: Switch) -> str:
        place = text(found.argument, self._named)
        return f"L, the forces or a constraint switches ({found.word}) where {place} is zero"

    @cached_property
    def _blow(self) -> str | None:
        """What is said of momenta or constraints that switch: rates would jump there, or forces be without bound."""
        if self._held is not None:
            held = [*ca.vertsplit(ca.vec(self._held.rows)), *ca.vertsplit(self._held.level)]
            for found in self._switching(held):
                return f"{self._said(found)}, where it would strike: move each side by itself, up to a terminal event"
        for found in self._switching(ca.vertsplit(self._lagrange.momenta)) if self._switches else ():
            return (
                f"{self._said(found)}, and the momenta with it, so that rates would jump there: move each side by "
                "itself, up to a terminal event, and start the other one with the rates that belong to its momenta"
            )
        return None

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

    def symplectic_form(self, t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """The form dq ∧ dp of changes of the coordinates and rates (2n, 2n), with the momenta p of such a state."""
        one, n = self._lagrange, self.n
        function = ca.Function(
            "momenta", one.symbols.all, [ca.densify(ca.jacobian(one.momenta, one.symbols.q)), one.mass]
        )
        change = np.hstack([np.array(part) for part in function(t, q, v, self._numbers)])
        upper = np.hstack([np.eye(n), np.zeros((n, n))]).T @ change
        return upper - upper.T
