"""What methods claim at tolerances so loose that two spaces may miss the same: layers, and many oscillations."""

import casadi as ca
import numpy as np
import pytest

import varcalc as vc
from varcalc.numerics.mesh import composite_gauss

TOLERANCES = (1e-1, 1e-2, 1e-3, 1e-4)
METHODS = {"ladder": None, "Ritz": vc.Ritz(), "Collocation": vc.Collocation()}


def forced(frequency, load):
    """A string under a load A sin(w t) from 1 to 2 in 3, and its value: y'' = y + A sin(w t) in closed form."""
    t, weights = composite_gauss(np.linspace(0, 3, 6 * frequency + 1), 10)
    forced = -load / (1 + frequency**2)

    def free(s):
        """The combination of sinh that meets the ends."""
        last = 2 - forced * np.sin(3 * frequency)
        return np.sinh(3 - s) / np.sinh(3) + last * np.sinh(s) / np.sinh(3)

    y = free(t) + forced * np.sin(frequency * t)
    last = 2 - forced * np.sin(3 * frequency)
    rate = (last * np.cosh(t) - np.cosh(3 - t)) / np.sinh(3) + forced * frequency * np.cos(frequency * t)
    value = float((rate**2 / 2 + y**2 / 2 + load * y * np.sin(frequency * t)) @ weights)
    problem = vc.Problem(
        lambda t, y, v: v**2 / 2 + y**2 / 2 + load * y * ca.sin(frequency * t), vc.Fixed(0, 1), vc.Fixed(3, 2)
    )
    return problem, value


def weighed(g, place, width):
    """g(x) v^2/2 from 0 to 3 on [0, 4]: 9 / (2 int 1/g)."""
    edges = np.unique(np.concatenate([np.linspace(0, 4, 401), place + width * np.linspace(-40, 40, 1601)]))
    x, weights = composite_gauss(edges[(edges >= 0) & (edges <= 4)], 10)
    value = float(9 / 2 / (weights @ (1 / g(x, np))))
    return vc.Problem(lambda x, y, v: g(x, ca) * v**2 / 2, vc.Fixed(0, 0), vc.Fixed(4, 3)), value


CASES = {
    "40 loads": lambda: forced(40, 5),
    "100 loads": lambda: forced(100, 5),
    "300 loads": lambda: forced(300, 5),
    "300 heavy loads": lambda: forced(300, 30),
    "a layer": lambda: weighed(lambda x, n: 1.2 + n.tanh((x - 1) / 0.02), 1.0, 0.02),
    "a dip": lambda: weighed(lambda x, n: 1 - 0.999 * n.exp(-(((x - 1.7) / 0.1) ** 2)), 1.7, 0.1),
    "a narrow dip": lambda: weighed(lambda x, n: 1 - 0.999 * n.exp(-(((x - 1.7) / 0.01) ** 2)), 1.7, 0.01),
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("case", CASES)
def test_the_error_is_no_larger_than_claimed(case, method):
    problem, exact = CASES[case]()
    for tol in TOLERANCES:
        solution = vc.solve(problem, METHODS[method], tol=tol, throw=False)
        if solution.status.ok:
            assert abs(solution.value - exact) <= solution.error.value + 1e-13 * abs(exact), tol
