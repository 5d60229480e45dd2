"""The derivatives that IPOPT is handed are those of the discretised functional."""

import casadi as ca
import numpy as np
import pytest

import varcalc as vc
from varcalc.formulation import formulate
from varcalc.methods.ritz.ipopt import program_of, summed_up
from varcalc.methods.ritz.system import RitzSystem
from varcalc.numerics.mesh import Space

ROUND = vc.Periodic(0, 1)
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


CONSTRAINED = {
    "a bound, an equality and integrals": vc.Problem(
        lambda x, y, dy: ca.exp(x) * dy[0] ** 4 + dy[1] ** 2 * ca.cos(y[0]), vc.Fixed(0, [0, 1]), vc.Fixed(1, [1, 2]),
        [
            vc.Bound(lambda x, y, dy: y[0] ** 2 * dy[1] - x, upper=2.0),
            vc.Holonomic(lambda x, y: ca.sumsqr(y) - (1 + 4 * x)),
            vc.Isoperimetric(lambda x, y, dy: y[0] ** 3 * y[1], 0.3),
            vc.Isoperimetric(lambda x, y, dy: dy[1] ** 3, upper=4.0),
        ],
    ),
    "a wall with a step": vc.Problem(
        lambda x, y, dy: dy**2, vc.Fixed(0, 0), vc.Fixed(3, 1),
        [vc.Bound(lambda x, y, dy: y**3 - ca.if_else(x < 1, 0.1, 0.3), upper=0.8)],
    ),
    "second order": vc.Problem(
        lambda x, y, dy, ddy: ddy**2 * (1 + y**2), vc.Fixed(0, 0, 1), vc.Fixed(1, 0),
        [vc.Bound(lambda x, y, dy: dy**3, upper=2.0)], order=2,
    ),
    "an end that slides and costs, with a parameter": vc.Problem(
        lambda x, y, dy, p: p.k * dy**2 + y**3, vc.Fixed(0, 1), vc.OnCurve(lambda x, y: x - 2 - ca.sin(y), 2.0),
        [vc.Bound(lambda x, y, dy, p: p.k * y**2 - x**3 * dy, upper=30.0)],
        end_cost=lambda x0, y0, x1, y1, p: p.k * y1**3 * x1, parameters={"k": 2.0},
    ),
    "round and round": vc.Problem(
        lambda x, y, dy: dy**2 * (1 + y**4), ROUND, ROUND, [vc.Bound(lambda x, y, dy: y**2, lower=0.1)]
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CONSTRAINED)
def test_the_derivatives_are_those_of_the_whole_program(name):
    form = formulate(CONSTRAINED[name])
    space = Space(np.linspace(*form.span, 4), 5, form.n, form.order, periodic=form.ends.periodic)
    system = RitzSystem(form, space, 9)
    z = 1.2 + 0.2 * np.sin(1 + np.arange(system.size))
    program = program_of(system, z, 1 + 0.1 * np.arange(system.size), 3.0)
    options, rows = program.derivatives.options(program.count), ca.vertcat(*program.rows)
    factor, multipliers = ca.MX.sym("factor"), ca.MX.sym("multipliers", program.count)
    hessian = ca.hessian(factor * program.objective + ca.dot(multipliers, rows), program.w)[0]
    at = np.cos(2 + np.arange(program.count))
    whole = ca.Function("whole", [program.w, factor, multipliers], [hessian])
    alike(options["hess_lag"](z, [], 2.0, at), np.triu(np.asarray(whole(z, 2.0, at))))
    for option, row in (("grad_f", program.objective), ("jac_g", rows)):
        whole = ca.Function("whole", [program.w], [row, ca.jacobian(row, program.w)])
        for found, expected in zip(options[option](z, []), whole(z), strict=True):
            alike(found.T if found.shape != expected.shape else found, expected)


def alike(found, expected):
    expected = np.asarray(expected)
    np.testing.assert_allclose(np.asarray(found), expected, rtol=1e-11, atol=1e-12 * np.abs(expected).max())


def test_a_program_is_straight_where_its_conditions_are():
    def straight(*conditions):
        problem = vc.Problem(lambda x, y, dy: dy**4, vc.Fixed(0, 0), vc.Fixed(1, 1), conditions)
        form = formulate(problem)
        system = RitzSystem(form, Space(np.linspace(0.0, 1.0, 3), 5, 1, 1), 9)
        return program_of(system, np.ones(system.size), np.ones(system.size), 1.0).derivatives.straight

    line, level = vc.Bound(lambda x, y, dy: dy - x**2, lower=-1), vc.Isoperimetric(lambda x, y, dy: x * y, 1)
    assert straight(line)
    assert straight(line, level)
    assert not straight(line, vc.Isoperimetric(lambda x, y, dy: y**2, 1))
    assert not straight(level, vc.Bound(lambda x, y, dy: y * dy, lower=-1))
