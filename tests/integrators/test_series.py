"""Taylor coefficients by recurrences, against derivatives by CasADi's differentiation."""

import math

import casadi as ca
import numpy as np
import pytest

from varcalc.integrators import CannotLower
from varcalc.integrators.series import solution_series

ORDER = 7
FORMULAS = {
    "products": lambda y, z: y * z + y**2 - 2 * z + y**3 * z**4,
    "quotients": lambda y, z: y / z + 1 / y - (y + z) / (1 + y * z),
    "multiples": lambda y, z: -2 * (3 * y) * (z / 4) + (2 * y) ** 2 / (-5 * z) - (y / 7) / 3 + (-y) ** 3,
    "ratios by numerators": lambda y, z: (y / z) * y + z * (2 * z / (3 * y)) + (y / z) * (-y) * z,
    "roots": lambda y, z: ca.sqrt(y) + ca.hypot(y, z) - ca.sqrt(y * z),
    "powers": lambda y, z: y**2.5 + z**-3 + y**z,
    "exponentials": lambda y, z: ca.exp(-y) + ca.log(z) + ca.expm1(y) * ca.log1p(z),
    "circular": lambda y, z: ca.sin(y) * ca.cos(z) + ca.tan(y / 3),
    "inverse circular": lambda y, z: ca.asin(y / 3) + ca.acos(z / 4) * ca.atan(y) + ca.atan2(y, z),
    "hyperbolic": lambda y, z: ca.sinh(y) * ca.cosh(z) + ca.tanh(y),
    "inverse hyperbolic": lambda y, z: ca.asinh(y) + ca.acosh(2 + z) + ca.atanh(y / 3),
    "error function": lambda y, z: ca.erf(y) * z,
    "pieces": lambda y, z: ca.fabs(y - 5) + ca.fmin(y, z) + ca.fmax(y, z) + ca.if_else(y < z, y**2, z),
    "signs": lambda y, z: ca.sign(y) * z + ca.copysign(y, -z),
}


@pytest.mark.parametrize("formula", FORMULAS.values(), ids=FORMULAS.keys())
def test_every_operation_has_the_series_of_its_derivatives(formula):
    """y = e^s-like and z run along y' = y, z' = -z; the operation is differentiated ORDER times along them."""
    s, state, constants = ca.SX.sym("s"), ca.SX.sym("Y", 2), ca.SX.sym("c", 1)
    rate = ca.vertcat(state[0], -state[1]) * constants[0]
    system = ca.Function("f", [s, state, constants], [rate])
    value = formula(state[0], state[1])
    stop = ca.Function("g", [s, state, constants], [value])
    _, (column,), symbols, known = solution_series(system, stop, ORDER)
    found = np.array(ca.Function("found", [symbols, known], [ca.densify(column)])([1.2, 0.7], [0.5])).ravel()
    expected = []
    for k in range(ORDER + 1):
        call = ca.Function("exact", [state, constants], [value])
        expected.append(float(call([1.2, 0.7], [0.5])) / math.factorial(k))
        value = ca.jtimes(value, state, rate)
    np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-13)


def test_an_operation_without_a_recurrence_is_named():
    s, y, c = ca.SX.sym("s"), ca.SX.sym("Y"), ca.SX.sym("c", 0)
    floor = ca.Function("f", [s, y, c], [ca.floor(y)])
    with pytest.raises(CannotLower, match="floor"):
        solution_series(floor, ca.Function("g", [s, y, c], [y]), 3)
