"""The integrands of a form at points, with their derivatives.

They come from numbers where the form has them, else from its expressions, differentiated and kept with the form.
Arrays may have leading axes before that of the points: several curves, or several values of the parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import casadi as ca
import numpy as np

from varcalc.formulation import Form, Reported
from varcalc.methods.ritz.tabulated import CellEvaluator, Make, in_place_of_tables
from varcalc.problem.functional import Symbols
from varcalc.problem.lagrangian import Lagrangian
from varcalc.symbolic.derived import derived
from varcalc.symbolic.evaluation import PointEvaluator
from varcalc.symbolic.tracing import Expression

BLANK = np.zeros((1, 0))


class Integrands(Protocol):
    """The integrand of the functional and those of m levels, in the k variables (y, y'[, y''], unknown numbers)."""

    def derivatives(self, variables: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Values (..., Q, 1 + m), gradients (..., Q, 1 + m, k) and Hessians (..., Q, 1 + m, k, k)."""
        ...

    def values(self, variables: np.ndarray) -> np.ndarray:
        """The values alone, (..., Q, 1 + m)."""
        ...

    def reported(self, variables: np.ndarray) -> Reported:
        """What is reported of the curves: each (..., Q) or (..., Q, functions)."""
        ...


class NumericIntegrand:
    """The integrand of a form without levels, from its numbers at ``s`` (Q,)."""

    def __init__(self, form: Form, s: np.ndarray) -> None:
        assert form.coordinates.numbers is not None
        self._at = form.coordinates.numbers.on(form.problem, s)  # type: ignore[arg-type]

    def _own(self, variables: np.ndarray) -> np.ndarray:
        """The variables that the numbers are stated in."""
        transform, offset = self._at.transform, self._at.offset
        if transform is None or offset is None:
            return variables
        return (transform @ variables[:, :, None])[:, :, 0] + offset

    def derivatives(self, variables: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """See :class:`Integrands`, as of the other methods."""
        value, gradient, hessian = self._at.derivatives(self._own(variables))
        transform = self._at.transform
        if transform is not None:
            gradient = (gradient[:, None] @ transform)[:, 0]
            hessian = transform.transpose(0, 2, 1) @ hessian @ transform
        return value[:, None], gradient[:, None], hessian[:, None]

    def values(self, variables: np.ndarray) -> np.ndarray:
        """The integrands alone."""
        return self._at.derivatives(self._own(variables))[0][:, None]

    def reported(self, variables: np.ndarray) -> Reported:
        """What is reported of the curves."""
        return self._at.reported(self._own(variables))


class CompiledIntegrands:
    """The integrands from the expressions of ``form`` at ``s`` (..., Q) and ``parameters`` (..., 1, parameters)."""

    def __init__(self, form: Form, s: np.ndarray, parameters: np.ndarray) -> None:
        self.form, self.s, self.parameters = form, s, parameters
        self.count = 1 + sum(c.equality for c in form.conditions.integrals)
        self.k = (form.order + 1) * form.n + len(form.start.unknowns)

    def _called(self, function: PointEvaluator | CellEvaluator, variables: np.ndarray) -> np.ndarray:
        n, points = self.form.n, variables.shape[:-1]
        rows = variables.reshape(-1, self.k)
        s = self.s if self.s.shape == points else np.broadcast_to(self.s, points)
        parameters, width = self.parameters, self.parameters.shape[-1]
        if parameters.ndim > 2:
            parameters = np.broadcast_to(parameters, (*points, width)).reshape(len(rows), width) if width else BLANK
        second = rows[:, 2 * n : 3 * n] if self.form.order == 2 else BLANK
        unknowns = rows[:, (self.form.order + 1) * n :]
        out = function(len(rows), s.reshape(-1, 1), rows[:, :n], rows[:, n : 2 * n], second, parameters, unknowns)
        return out.reshape(*points, -1)

    def derivatives(self, variables: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """See :class:`Integrands`, as of the other methods."""
        out, k = self._called(_at_points(self.form, _with_derivatives), variables), self.k
        out = out.reshape(*out.shape[:-1], self.count, -1)
        return out[..., 0], out[..., 1 : 1 + k], out[..., 1 + k :].reshape(*out.shape[:-1], k, k)

    def values(self, variables: np.ndarray) -> np.ndarray:
        """The integrands alone."""
        return self._called(_at_points(self.form, _alone), variables)

    def reported(self, variables: np.ndarray) -> Reported:
        """What is reported of the curves."""
        out, n = self._called(_reported_at_points(self.form), variables), self.form.n
        if not self.form.stated.is_lifted:
            y, dy = variables[..., :n], variables[..., n : 2 * n]
            return Reported(out[..., 0], self.s, y, np.ones_like(self.s), dy)
        n = self.form.problem.n
        return Reported(out[..., 0], out[..., 1], out[..., 2 : 2 + n], out[..., 2 + n], out[..., 3 + n :])


def pointwise(form: Form) -> ca.Function:
    """The integrand and those of the levels, with their derivatives: :meth:`.Lagrangian.pointwise`."""
    return _function(form, _with_derivatives)


def integrands(form: Form) -> ca.Function:
    """The integrand and those of the levels alone."""
    return _function(form, _alone)


@derived
def _function(form: Form, make: Make) -> ca.Function:
    return make(form.symbols, _rows(form))


def _rows(form: Form) -> list[Expression]:
    return [form.integrand, *(c.expression for c in form.conditions.integrals if c.equality)]


def _with_derivatives(symbols: Symbols, rows: Sequence[Expression]) -> ca.Function:
    return Lagrangian(symbols, rows[0]).pointwise(rows[1:])


def _alone(symbols: Symbols, rows: Sequence[Expression]) -> ca.Function:
    return ca.Function("integrands", symbols.all, [ca.densify(ca.vertcat(*rows))])


@derived
def reported(form: Form) -> ca.Function:
    """The reported functional's integrand and, where the form is lifted, x, y, dx/ds, dy/ds."""
    outputs = [form.functional, *(form.lifted or ())]
    return ca.Function("reported", form.symbols.all, [ca.densify(ca.vertcat(*outputs))])


@derived
def at_ends(form: Form) -> PointEvaluator:
    """The cost of the ends and their equations, with derivatives in (start, end, values at knots, unknowns)."""
    assert form.ends.joint is not None
    e, u = form.ends.joint, form.symbols.unknowns
    v = ca.vertcat(*e.places, u)
    conditions = ca.vertsplit(e.equations) if e.equations.numel() else []
    hessians = [ca.hessian(h, v)[0] for h in (e.cost, *conditions)]
    outputs = [e.cost, ca.gradient(e.cost, v), e.equations, ca.jacobian(e.equations, v), *hessians]
    arguments = [*e.places, u, form.symbols.parameters]
    return PointEvaluator(ca.Function("ends", arguments, [ca.densify(o) for o in outputs]))


@derived
def _at_points(form: Form, make: Make) -> PointEvaluator | CellEvaluator:
    """A function of the form at any number of points."""
    function, found = _function(form, make), None
    if function.is_a("SXFunction") and function.find_functions():
        found = in_place_of_tables(form.symbols, _rows(form), make)
    return found or PointEvaluator(function)


@derived
def _reported_at_points(form: Form) -> PointEvaluator:
    return PointEvaluator(reported(form))
