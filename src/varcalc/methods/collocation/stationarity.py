"""The conditions of stationarity of a form, pointwise, with their derivatives.

The first variation of the Lagrangian function

    H = integrand + sum of lambda_j g_j + sum of mu_k(s) phi_k

vanishes when the Euler-Lagrange expression of H does at every point and the
boundary terms do at the ends (Gelfand and Fomin, "Calculus of Variations",
sect. 6, 12 and 15; Clegg, "Calculus of Variations", ch. 6). Everything here is
in the strong form and undivided: L_y'y' is never inverted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import casadi as ca
import numpy as np

from varcalc.formulation import Form
from varcalc.problem.lagrangian import Lagrangian
from varcalc.symbolic.derived import derived
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.tracing import Expression

REMEMBERED = 16
"""Meshes, and numbers of points, for which tables and memory are kept with a form: the last ones."""


@dataclass(frozen=True)
class Counts:
    """How many of everything there are in the conditions of a form.

    ``functions`` unknown functions of a functional of ``order``, ``numbers``
    unknown numbers, ``levels`` isoperimetric equalities, ``paths`` pathwise
    equalities, ``equations`` equations between the ends; ``caps`` are the
    (path, end) pairs where a pathwise equality has to be imposed at an end
    that is not wholly fixed.
    """

    order: int
    functions: int
    numbers: int
    levels: int
    paths: int
    equations: int
    caps: tuple[tuple[int, int], ...]

    @property
    def tower(self) -> int:
        """Entries of (y, y', ..., y^(2 order))."""
        return (2 * self.order + 1) * self.functions


@dataclass(frozen=True)
class Stationarity:
    """CasADi functions for the conditions of stationarity, each with its dense Jacobian by columns.

    ``interior(s, y, y', .., parameters, unknowns, lambda, mu)`` gives the
    functional, the rows (Euler-Lagrange expression, pathwise equalities,
    isoperimetric integrands, dH/d unknowns) and their Jacobian in (y, y', ..,
    unknowns, lambda, mu). ``momentum`` (the same arguments, short of the
    highest derivative and mu) gives the conjugate momenta and their Jacobian
    in (y, y', .., unknowns, lambda). ``ends(y0, y1, parameters, unknowns, nu,
    eta)`` gives the gradient of cost + nu . equations + eta . phi in (y0, y1,
    unknowns), the equations and phi, and the Jacobian of all these in (y0, y1,
    unknowns, nu, eta).
    """

    counts: Counts
    interior: ca.Function
    momentum: ca.Function | None
    ends: ca.Function | None
    mapped: dict[int, MappedCall] = field(default_factory=dict, repr=False)
    """The function of the interior on memory of its own, by the number of points."""

    def at(
        self, x: np.ndarray, tower: np.ndarray, numbers: Sequence[np.ndarray], forces: np.ndarray | None = None
    ) -> np.ndarray:
        """The interior's conditions at m points, (m, rows).

        ``x`` is (m, 1), ``tower`` the curve's derivatives (2 order + 1, .., n), ``numbers`` the parameters, unknowns
        and lambdas, ``forces`` the mu (.., paths), zero when they are left out.
        """
        count = len(x)
        if count not in self.mapped:
            while len(self.mapped) >= REMEMBERED:
                del self.mapped[next(iter(self.mapped))]
            self.mapped[count] = MappedCall(self.interior, count)
        return self.mapped[count](x, tower, numbers, forces)

    def at_many(self, x: np.ndarray, tower: np.ndarray, parameters: np.ndarray) -> np.ndarray:
        """:meth:`at` many points with ``parameters`` of their own, (m, parameters), where nothing else is unknown."""
        blank = np.zeros((1, 0))
        return self.many(len(x), x, *tower.reshape(len(tower), len(x), -1), parameters, blank, blank, blank)

    @cached_property
    def many(self) -> PointEvaluator:
        """The function of the interior for many points."""
        return PointEvaluator(self.interior)


class MappedCall:
    """The function of the interior at so many points, with the memory it reads and writes."""

    def __init__(self, interior: ca.Function, count: int) -> None:
        sizes = [interior.numel_in(i) for i in range(interior.n_in())]
        depth = len(sizes) - 5
        self._tower = np.zeros((depth, count, sizes[1]))
        self._x, self._forces = np.zeros((count, 1)), np.zeros((count, sizes[-1]))
        self._numbers = [np.zeros((count, size)) for size in sizes[1 + depth : -1]]
        self._output = np.zeros((count, interior.numel_out(0)))
        inputs = [self._x, *self._tower, *self._numbers, self._forces]
        self._run = PointEvaluator(interior).bound(inputs, self._output)

    def __call__(
        self, x: np.ndarray, tower: np.ndarray, numbers: Sequence[np.ndarray], forces: np.ndarray | None
    ) -> np.ndarray:
        """See :meth:`Stationarity.at`."""
        self._x[:] = x
        self._tower.reshape(tower.shape)[:] = tower
        for own, given in zip(self._numbers, numbers, strict=True):
            if own.shape[1]:
                own[:] = given
        if self._forces.shape[1]:
            self._forces[:] = 0.0 if forces is None else forces.reshape(self._forces.shape)
        self._run()
        return self._output.copy()


def _dense(*expressions: Expression) -> Expression:
    return ca.densify(ca.vertcat(*expressions))


@derived
def stationarity(form: Form) -> Stationarity:
    """The conditions of a form, built once and kept with it."""
    symbols, kind = form.symbols, form.symbols.kind
    caps = _caps(form)
    counts = Counts(
        form.order,
        form.n,
        len(form.start.unknowns),
        len(form.conditions.integrals),
        len(form.conditions.pathwise),
        form.ends.equations,
        caps,
    )
    levels = kind.sym("lambda", counts.levels)
    forces = kind.sym("mu", counts.paths)
    integrands = [c.expression for c in form.conditions.integrals]
    paths = [c.expression for c in form.conditions.pathwise]
    whole = form.integrand
    for multiplier, expression in [*_pairs(levels, integrands), *_pairs(forces, paths)]:
        whole = whole + multiplier * expression
    lagrangian = Lagrangian(symbols, whole)
    tower, u = lagrangian.derivatives_of_y, symbols.unknowns
    rows = _dense(lagrangian.euler_lagrange, *paths, *integrands, *([ca.gradient(whole, u)] if counts.numbers else []))
    jacobian = ca.jacobian(rows, ca.vertcat(*tower, u, levels, forces))
    interior = ca.Function(
        "interior",
        [symbols.x, *tower, symbols.parameters, u, levels, forces],
        [_dense(form.functional, rows, ca.vec(ca.densify(jacobian)))],
    )
    momentum = None
    if _has_boundary_rows(form):
        momenta = _dense(*lagrangian.momenta)
        derivatives = ca.densify(ca.jacobian(momenta, ca.vertcat(*tower[:-1], u, levels)))
        momentum = ca.Function(
            "momentum",
            [symbols.x, *tower[:-1], symbols.parameters, u, levels],
            [_dense(momenta, ca.vec(derivatives))],
        )
    return Stationarity(counts, interior, momentum, _ends(form, caps))


def _pairs(symbol: Expression, expressions: list[Expression]) -> list[tuple[Expression, Expression]]:
    return [(symbol[j], e) for j, e in enumerate(expressions)]


def _caps(form: Form) -> tuple[tuple[int, int], ...]:
    """Pathwise equalities that involve a free component of an end: they restrict its variations."""
    if form.ends.periodic:
        return ()
    caps = []
    for k, condition in enumerate(form.conditions.pathwise):
        involved = np.array(ca.which_depends(condition.expression, form.symbols.y, 1, False))
        for end, fixed in enumerate((form.ends.start, form.ends.end)):
            if np.any(np.isnan(fixed[0]) & involved):
                caps.append((k, end))
    return tuple(caps)


def _has_boundary_rows(form: Form) -> bool:
    free = np.isnan(form.ends.start).any() or np.isnan(form.ends.end).any()
    return bool(free or form.ends.periodic or form.conditions.knots)


def _ends(form: Form, caps: tuple[tuple[int, int], ...]) -> ca.Function | None:
    """Boundary terms that are functions of the end points alone."""
    if form.ends.joint is None and not caps:
        return None
    s, kind = form.symbols, form.symbols.kind
    if form.ends.joint is None:
        first, last, equations, cost = kind.sym("y0", form.n), kind.sym("y1", form.n), kind(0, 1), kind(0)
    else:
        joint = form.ends.joint
        first, last, equations, cost = joint.start, joint.end, joint.equations, joint.cost
    at = [(form.span[0], first), (form.span[1], last)]
    on_path = [
        ca.substitute([form.conditions.pathwise[k].expression], [s.x, s.y], [kind(at[end][0]), at[end][1]])[0]
        for k, end in caps
    ]
    conditions = ca.vertcat(equations, *on_path)
    multipliers = kind.sym("nu", conditions.numel())
    total = cost + (ca.dot(multipliers, conditions) if conditions.numel() else 0)
    variables = ca.vertcat(first, last, s.unknowns)
    rows = _dense(ca.gradient(total, variables), conditions)
    jacobian = ca.densify(ca.jacobian(rows, ca.vertcat(variables, multipliers)))
    return ca.Function("ends", [first, last, s.parameters, s.unknowns, multipliers], [rows, jacobian])
