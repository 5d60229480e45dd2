"""The derivatives that IPOPT is handed are those of the discretised functional."""

import casadi as ca
import numpy as np
import pytest

import varcalc as vc
from varcalc.formulation import formulate
from varcalc.methods.ritz.ipopt import summed_up
from varcalc.methods.ritz.system import RitzSystem
from varcalc.numerics.mesh import Space

PROBLEMS = {
    "one function": vc.Problem(lambda x, y, dy: ca.exp(x) * dy**4 + ca.sin(y), vc.Fixed(0, 0), vc.Fixed(1, 1)),
    "parameters": vc.Problem(
        lambda x, y, dy, p: p.k * dy**2 + y**3, vc.Fixed(0, 1), vc.Free(2), parameters={"k": 2.0}
    ),
    "two functions": vc.Problem(
        lambda x, y, dy: ca.sumsqr(dy) * (1 + y[0] ** 2) + y[0] * y[1] * dy[1],
        vc.Fixed(0, [0, 1]),
        vc.Fixed(1, [1, None]),
    ),
    "second order": vc.Problem(
        lambda x, y, dy, ddy: ddy**2 * (1 + y**2) + dy**4, vc.Fixed(0, 0, 1), vc.Fixed(1, 0), order=2
    ),
}  # fmt: skip


@pytest.mark.parametrize("elements", [1, 3])
@pytest.mark.parametrize("name", PROBLEMS)
def test_value_gradient_and_hessian(name, elements):
    form = formulate(PROBLEMS[name])
    vertices = np.linspace(*form.span, elements + 1) ** 1.5 if elements > 1 else np.array(form.span)
    system = RitzSystem(form, Space(vertices, 5, form.n, form.order), 9)
    z = np.sin(1 + np.arange(system.size))
    scale, size = 1 + 0.1 * np.arange(system.size), 3.0
    options = summed_up(system, scale, size).options
    at = system.evaluate(z)
    value, gradient = options["grad_f"](z / scale, [])
    assert float(value) * size == pytest.approx(at.value, rel=1e-13)
    np.testing.assert_allclose(np.asarray(gradient).ravel() * size, at.gradient * scale, rtol=1e-11, atol=1e-11)
    upper = np.asarray(options["hess_lag"](z / scale, [], 2.0, []))
    hessian = system.hessian(at, np.zeros(0)) * np.outer(scale, scale) * 2.0
    np.testing.assert_allclose(upper * size, np.triu(hessian), rtol=1e-11, atol=1e-10 * np.abs(hessian).max())
