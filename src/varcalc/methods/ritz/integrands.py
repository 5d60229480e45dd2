"""The integrands of a form at points, with their derivatives.

They come from numbers where the form has them, else from its expressions, differentiated and kept with the form.
Arrays may have leading axes before that of the points: several curves, or several values of the parameters.
"""

from __future__ import annotations

from functools import cached_property
from typing import Protocol

import casadi as ca
import numpy as np

from varcalc.formulation import Form, Reported
from varcalc.problem.lagrangian import Lagrangian
from varcalc.symbolic.buffered import Pointwise
from varcalc.symbolic.columns import FewOrMany

FEW, CHUNK = 26, 128
"""Points evaluated in one go: as many as one curve of the lower degrees has, and of several curves."""
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
        assert form.numbers is not None
        self._at = form.numbers.on(form.problem, s)  # type: ignore[arg-type]

    def _own(self, variables: np.ndarray) -> np.ndarray:
        """The variables that the numbers are stated in."""
        transform, offset = self._at.transform, self._at.offset
        if transform is None or offset is None:
            return variables
        return (transform @ variables[:, :, None])[:, :, 0] + offset

    def derivatives(self, variables: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        value, gradient, hessian = self._at.derivatives(self._own(variables))
        transform = self._at.transform
        if transform is not None:
            gradient = (gradient[:, None] @ transform)[:, 0]
            hessian = transform.transpose(0, 2, 1) @ hessian @ transform
        return value[:, None], gradient[:, None], hessian[:, None]

    def values(self, variables: np.ndarray) -> np.ndarray:
        return self._at.derivatives(self._own(variables))[0][:, None]

    def reported(self, variables: np.ndarray) -> Reported:
        return self._at.reported(self._own(variables))


class CompiledIntegrands:
    """The integrands from the expressions of ``form`` at ``s`` (..., Q) and ``parameters`` (..., 1, parameters)."""

    def __init__(self, form: Form, s: np.ndarray, parameters: np.ndarray) -> None:
        self.form, self.functions, self.s, self.parameters = form, IntegrandFunctions.of(form), s, parameters
        self.count = 1 + sum(c.equality for c in form.integrals)
        self.k = (form.order + 1) * form.n + len(form.unknown_guess)

    def _called(self, name: str, variables: np.ndarray) -> np.ndarray:
        n, points = self.form.n, variables.shape[:-1]
        rows = variables.reshape(-1, self.k)
        s = self.s if self.s.shape == points else np.broadcast_to(self.s, points)
        parameters, width = self.parameters, self.parameters.shape[-1]
        if parameters.ndim > 2:
            parameters = np.broadcast_to(parameters, (*points, width)).reshape(len(rows), width) if width else BLANK
        second = rows[:, 2 * n : 3 * n] if self.form.order == 2 else BLANK
        unknowns = rows[:, (self.form.order + 1) * n :]
        function = self.functions.evaluator(name, len(rows))
        out = function(len(rows), s.reshape(-1, 1), rows[:, :n], rows[:, n : 2 * n], second, parameters, unknowns)
        return out.reshape(*points, -1)

    def derivatives(self, variables: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        out, k = self._called("derivatives", variables), self.k
        out = out.reshape(*out.shape[:-1], self.count, -1)
        return out[..., 0], out[..., 1 : 1 + k], out[..., 1 + k :].reshape(*out.shape[:-1], k, k)

    def values(self, variables: np.ndarray) -> np.ndarray:
        return self._called("values", variables)

    def reported(self, variables: np.ndarray) -> Reported:
        out, n = self._called("reported", variables), self.form.n
        if not self.form.stated.is_lifted:
            y, dy = variables[..., :n], variables[..., n : 2 * n]
            return Reported(out[..., 0], self.s, y, np.ones_like(self.s), dy)
        n = self.form.problem.n
        return Reported(out[..., 0], out[..., 1], out[..., 2 : 2 + n], out[..., 2 + n], out[..., 3 + n :])


class IntegrandFunctions:
    """The functions of points that are built from the expressions of a form, once for all values of its parameters."""

    def __init__(self, form: Form) -> None:
        self._form = form
        self._kept: dict[tuple[str, bool], Pointwise | FewOrMany] = {}

    @classmethod
    def of(cls, form: Form) -> IntegrandFunctions:
        """Those of a form, kept with it."""
        if "integrand functions" not in form.built:
            form.built["integrand functions"] = cls(form)
        return form.built["integrand functions"]

    @cached_property
    def derivatives(self) -> ca.Function:
        """Values, gradients and Hessians, see :meth:`varcalc.problem.lagrangian.Lagrangian.pointwise`."""
        form = self._form
        return Lagrangian(form.symbols, form.integrand).pointwise([c.expression for c in form.integrals if c.equality])

    @cached_property
    def values(self) -> ca.Function:
        """The values alone."""
        form = self._form
        rows = ca.vertcat(form.integrand, *(c.expression for c in form.integrals if c.equality))
        return ca.Function("values", form.symbols.all, [ca.densify(rows)])

    @cached_property
    def reported(self) -> ca.Function:
        """The reported integrand and, where the form is lifted, x, y, dx/ds, dy/ds."""
        form = self._form
        rows = ca.vertcat(form.functional, *(form.lifted or ()))
        return ca.Function("reported", form.symbols.all, [ca.densify(rows)])

    @cached_property
    def summed(self) -> ca.Function:
        """The reported integrand and those of the levels."""
        form = self._form
        rows = ca.vertcat(form.functional, *(c.expression for c in form.integrals if c.equality))
        return ca.Function("summed", form.symbols.all, [ca.densify(rows)])

    @cached_property
    def ends(self) -> ca.Function:
        """The cost of the ends, its gradient in (start, end, unknowns), their equations, Jacobian, and all Hessians."""
        form, e = self._form, self._form.ends
        assert e is not None
        u = form.symbols.unknowns
        v = ca.vertcat(e.start, e.end, u)
        equations = ca.vertsplit(e.equations) if e.equations.numel() else []
        hessians = [ca.hessian(h, v)[0] for h in (e.cost, *equations)]
        outputs = [e.cost, ca.gradient(e.cost, v), e.equations, ca.jacobian(e.equations, v), *hessians]
        return ca.Function("ends", [e.start, e.end, u, form.symbols.parameters], [ca.densify(o) for o in outputs])

    def evaluator(self, name: str, points: int) -> Pointwise | FewOrMany:
        """One of the functions, called at about so many points."""
        few = points <= CHUNK
        if (name, few) not in self._kept:
            function = getattr(self, name)
            self._kept[name, few] = Pointwise(function, FEW) if few else FewOrMany(function, CHUNK)
        return self._kept[name, few]
