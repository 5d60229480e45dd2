"""Functions of a form at points of a discretised curve, and the derivatives that they give a program of CasADi's.

What a program asks at a point depends on the curve through (y, y'[, y''], unknown numbers) there alone. So its
gradients and the Hessian of its Lagrangian are those of a small function at every point, between the matrices that take
the unknowns to the points. CasADi, which sees one expression in all unknowns, would take longer to find this than IPOPT
to solve.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import casadi as ca
import numpy as np

from varcalc.formulation.form import Form
from varcalc.methods.ritz.system import RitzSystem
from varcalc.numerics.mesh import basis, basis_at_gauss, gauss
from varcalc.symbolic.derived import derived

Shares = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Numbers of values, point by point, of the rows that they enter (0 is the objective), and with what factors."""


@dataclass(frozen=True)
class CurvePoints:
    """Points of a curve: their ``s`` (count,), and ``matrix`` times unknowns plus ``constant`` (count * k,).

    The rows are the k variables (y, y'[, y''], unknown numbers) of one point after the other.
    """

    system: RitzSystem
    s: np.ndarray
    matrix: ca.DM
    constant: np.ndarray

    @classmethod
    def of(cls, system: RitzSystem, scale: np.ndarray, nodes: np.ndarray | None = None) -> CurvePoints:
        """The Gauss points, or ``nodes`` of the reference element, of every element; unknowns are in ``scale``."""
        space, order = system.space, system.order
        if nodes is None:
            table, nodes = basis_at_gauss(space.smoothness, space.degree, system.count, order), gauss(system.count)[0]
        else:
            table = basis(space.smoothness, space.degree, nodes, order)
        s = (space.vertices[:-1, None] + 0.5 * space.widths[:, None] * (1 + nodes)).ravel()
        return cls(system, s, *_placement(system, table, scale))

    def kept(self, mask: np.ndarray) -> CurvePoints:
        """Those of a ``mask`` (count,)."""
        if mask.all():
            return self
        rows = np.flatnonzero(np.repeat(mask, len(self.constant) // len(self.s)))
        return replace(self, s=self.s[mask], matrix=self.matrix[rows.tolist(), :], constant=self.constant[rows])

    def arguments(self, w: Any) -> list[Any]:
        """What the form's functions take at the points of the curve of unknowns ``w``."""
        system, count = self.system, len(self.s)
        n, depth = system.n, system.order + 1
        variables = ca.reshape(ca.mtimes(self.matrix, w) + self.constant, -1, count)
        columns = [variables[d * n : (d + 1) * n, :] for d in range(depth)]
        columns += [ca.MX(0, count)] * (3 - depth)
        parameters = np.repeat(system.form.problem.parameter_values[:, None], count, axis=1)
        return [self.s[None, :], *columns, parameters, variables[depth * n :, :]]


class ExpressionColumn:
    """Expressions one below the other; two are one where they hold the same objects."""

    def __init__(self, *expressions: Any) -> None:
        self.expressions = expressions

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ExpressionColumn) and [*map(id, self.expressions)] == [*map(id, other.expressions)]

    def __hash__(self) -> int:
        return hash(tuple(map(id, self.expressions)))


@dataclass(frozen=True)
class ColumnFunctions:
    """What a program asks of a column at one point.

    ``values`` gives it alone, ``rates`` with its Jacobian, ``curvature`` the Hessian of its sum by multipliers; None
    where that is zero. An expression ``bends`` where it enters that.
    """

    values: ca.Function
    rates: ca.Function
    curvature: ca.Function | None
    bends: tuple[bool, ...]

    @classmethod
    def of(cls, symbols: list[Any], variables: list[Any], expressions: Sequence[Any]) -> ColumnFunctions:
        """Of ``expressions`` in ``symbols``, with derivatives by the ``variables``."""
        column, at = ca.densify(ca.vertcat(*expressions)), ca.vertcat(*(v for v in variables if v.numel()))
        multipliers = type(symbols[0]).sym("multipliers", column.numel())
        values = ca.Function("column", symbols, [column])
        rates = ca.Function("rates", symbols, [column, ca.jacobian(column, at)])
        hessian = ca.hessian(ca.dot(multipliers, column), at)[0]
        if not hessian.nnz():
            return cls(values, rates, None, (False,) * column.numel())
        curvature = ca.Function("curvature", [*symbols, multipliers], [ca.densify(hessian)])
        return cls(values, rates, curvature, tuple(ca.depends_on(hessian, m) for m in ca.vertsplit(multipliers)))


@derived
def column_functions(form: Form, column: ExpressionColumn) -> ColumnFunctions:
    """Those of a column in the form's symbols, by the curve and the unknown numbers."""
    s = form.symbols
    return ColumnFunctions.of(s.all, [s.y, *s.slopes, s.unknowns], column.expressions)


@dataclass(frozen=True)
class _Term:
    """A column of functions at points, their arguments, and the shares in the rows.

    What enters constraints may be ``straight``: linear in the variables.
    """

    functions: ColumnFunctions
    arguments: list[Any]
    matrix: ca.DM
    shares: Shares

    @property
    def straight(self) -> bool:
        """Whether what enters constraints is linear in the variables."""
        values, numbers, _ = self.shares
        bends = self.functions.bends
        return not any(bends[k] for k in np.unique(values[numbers > 0] % len(bends)).tolist())

    @property
    def count(self) -> int:
        """The number of points."""
        return self.matrix.shape[0] // self.functions.rates.size2_out(1)

    def in_rows(self, first: int, rows: int) -> ca.DM:
        """The shares, (count * width, rows), of the values in so many rows from the ``first`` one on."""
        values, numbers, factors = self.shares
        own = (numbers >= first) & (numbers < first + rows)
        size = self.count * self.functions.rates.size1_out(0)
        return ca.DM.triplet(values[own].tolist(), (numbers[own] - first).tolist(), ca.DM(factors[own]), size, rows)


@dataclass
class ProgramDerivatives:
    """The derivatives of a program in its unknowns ``w``, gathered from its functions at points."""

    w: Any
    terms: list[_Term] = field(default_factory=list)

    def at_points(self, points: CurvePoints, functions: ColumnFunctions, arguments: list[Any], shares: Shares) -> None:
        """Add a column at ``points``, whose ``arguments`` it takes; values are numbered point by point."""
        self.terms.append(_Term(functions, arguments, points.matrix, shares))

    def at_ends(self, ends: EndPlaces, shares: Shares) -> None:
        """Add the cost of the ends and their equations."""
        equations, symbols = ends.joint.equations, ends.symbols
        expressions = [ends.joint.cost, *(ca.vertsplit(equations) if equations.numel() else [])]
        functions = ColumnFunctions.of(symbols, symbols[:-1], expressions)
        self.terms.append(_Term(functions, ends.arguments(self.w), ends.matrix, shares))

    @property
    def straight(self) -> bool:
        """Whether all constraints are linear in the unknowns."""
        return all(term.straight for term in self.terms)

    def options(self, rows: int) -> dict[str, ca.Function]:
        """What ``nlpsol`` takes of a program with this many rows of constraints."""
        functions = {"hess_lag": self._hessian(rows), "grad_f": self._rates("grad_f", 0, 1)}
        return functions | ({"jac_g": self._rates("jac_g", 1, rows)} if rows else {})

    def _rates(self, name: str, first: int, rows: int) -> ca.Function:
        """So many rows of the program from the ``first`` one on, and their Jacobian; of one row its gradient."""
        values, jacobian = ca.MX.zeros(rows), ca.MX(rows, self.w.numel())
        for term in self.terms:
            shares = term.in_rows(first, rows)
            if not shares.nnz():
                continue
            column, rates = term.functions.rates.map(term.count)(*term.arguments)
            blocks = ca.MX(along_diagonal(term.functions.rates.sparsity_out(1), term.count), ca.vec(rates.nz[:]))
            values += ca.mtimes(shares.T, ca.vec(column))
            jacobian += ca.mtimes(shares.T, ca.mtimes(blocks, term.matrix))
        out = jacobian if first else ca.densify(jacobian.T)
        return ca.Function(name, [self.w, ca.MX.sym("p", 0)], [values, out], ["x", "p"], ["value", "rates"])

    def _hessian(self, rows: int) -> ca.Function:
        """The Hessian of the Lagrangian."""
        w, p = self.w, ca.MX.sym("p", 0)
        lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", rows)
        multipliers = ca.vertcat(lam_f, lam_g)
        total = ca.MX(w.numel(), w.numel())
        for term in self.terms:
            curvature = term.functions.curvature
            if curvature is None:
                continue
            count, width = term.count, len(term.functions.bends)
            weights = ca.reshape(ca.mtimes(term.in_rows(0, 1 + rows), multipliers), width, count)
            out = curvature.map(count)(*term.arguments, ca.densify(weights))
            blocks = ca.MX(along_diagonal(curvature.sparsity_out(0), count), ca.vec(out))
            total += ca.mtimes(term.matrix.T, ca.mtimes(blocks, term.matrix))
        return ca.Function(
            "hess_lag", [w, p, lam_f, lam_g], [ca.triu(total)],
            ["x", "p", "lam_f", "lam_g"], ["triu_hess_gamma_x_x"],
        )  # fmt: skip


class EndPlaces:
    """The values at the vertices that the ends' cost and equations are about, and the unknown numbers."""

    def __init__(self, system: RitzSystem, scale: np.ndarray) -> None:
        assert system.form.ends.joint is not None
        self.joint = system.form.ends.joint
        self.symbols = [*self.joint.places, system.form.symbols.unknowns, system.form.symbols.parameters]
        self._parameters = system.form.problem.parameter_values
        numbers = system.joint_numbers.ravel()
        self._n = system.n
        place = _places(system)[numbers]
        columns = np.concatenate([place, len(system.free) + np.arange(system.extra)])
        moving = np.flatnonzero(columns >= 0)
        picked = columns[moving]
        self.matrix = ca.DM.triplet(
            moving.tolist(), picked.tolist(), ca.DM(scale[picked]), len(columns), system.size
        )  # fmt: skip
        self.constant = np.concatenate([np.where(place < 0, system.fixed[numbers], 0.0), np.zeros(system.extra)])

    def arguments(self, w: Any) -> list[Any]:
        """What the cost and the equations take on the curve of unknowns ``w``."""
        count = len(self.joint.places) * self._n
        values = ca.mtimes(self.matrix, w) + self.constant
        ends = [values[i : i + self._n] for i in range(0, count, self._n)]
        return [*ends, values[count:], self._parameters]


def along_diagonal(block: ca.Sparsity, count: int) -> ca.Sparsity:
    """``count`` blocks along the diagonal."""
    return ca.kron(ca.Sparsity.diag(count), block)


def _placement(system: RitzSystem, table: np.ndarray, scale: np.ndarray) -> tuple[ca.DM, np.ndarray]:
    """Sparse matrix from unknowns in units of ``scale`` to the variables at points of every element, and what is fixed.

    ``table`` (derivatives, points, polynomials) is that of the basis at the points of the reference element.
    """
    space, n, extra = system.space, system.n, system.extra
    factors = (2.0 / space.widths)[:, None, None] ** np.arange(len(table))[:, None] * space.local_scale[:, None]
    entries = table.transpose(1, 0, 2) * factors[:, None]
    E, Q, D, P = entries.shape
    k, count = D * n + extra, E * Q
    values = np.broadcast_to(entries[..., None], (E, Q, D, P, n))
    first = k * np.arange(count).reshape(E, Q)[..., None] + n * np.arange(D)
    rows = np.broadcast_to(first[..., None, None] + np.arange(n), values.shape)
    numbers = np.broadcast_to(space.numbers[:, None, None], values.shape)
    columns = _places(system)[numbers]
    free = columns >= 0
    constant = np.zeros(k * count)
    np.add.at(constant, rows[~free], values[~free] * system.fixed[numbers[~free]])
    # the unknown numbers are the same at each point
    others = np.repeat(len(system.free) + np.arange(extra), count)
    of_others = (k * np.arange(count) + D * n + np.arange(extra)[:, None]).ravel()
    at, column = np.concatenate([rows[free], of_others]), np.concatenate([columns[free], others])
    value = np.concatenate([values[free], np.ones(len(others))]) * scale[column]
    if space.periodic and E == 1:  # the vertices of the only element are one, and CasADi keeps one entry of a place
        places, entry = np.unique(at * system.size + column, return_inverse=True)
        (at, column), value = np.divmod(places, system.size), np.bincount(entry, value)
    matrix = ca.DM.triplet(at.tolist(), column.tolist(), ca.DM(value), k * count, system.size)
    return matrix, constant


def _places(system: RitzSystem) -> np.ndarray:
    """The place of each coefficient among the free ones, -1 for a fixed one."""
    place = np.full(system.space.size, -1)
    place[system.free] = np.arange(len(system.free))
    return place
