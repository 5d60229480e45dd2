"""Changes of expressions between two places, exact to round-off however near these are."""

import casadi as ca
import mpmath as mp
import pytest

from varcalc.symbolic.differences import carry, displaced


@pytest.mark.parametrize("move", [-0.3, -1e-3, -1e-9, -1e-15, 1e-15, 1e-9, 1e-3, 0.3])
@pytest.mark.parametrize("base", [0.3000350005, 0.9999, 1.0001, 2.5])
@pytest.mark.parametrize(
    ("written", "exact"),
    [
        (lambda y: ca.fmax(1 - y, 0) ** 2, lambda y: max(1 - y, 0) ** 2),
        (lambda y: ca.fmin(ca.sin(y), y / 2), lambda y: min(mp.sin(y), y / 2)),
        (lambda y: ca.fmax(y**2, 2 * y - 0.5), lambda y: max(y**2, 2 * y - mp.mpf("0.5"))),
    ],
)
def test_the_larger_and_the_less_of_two_lose_no_digits(written, exact, base, move):
    y, b, x = ca.SX.sym("y"), ca.SX.sym("b"), ca.SX.sym("x")
    [carried] = carry(ca.Function("f", [y], [written(y)]), [displaced(b, x, 0.3)])
    change = float(ca.Function("change", [b, x], [carried.change])(base, move))
    with mp.workdps(40):
        true = exact(mp.mpf(base) + mp.mpf(move)) - exact(mp.mpf(base))
        kink = abs(base - 1) <= abs(move)  # on its other side what is left is known to round-off of the value
        assert abs(change - true) <= 8e-16 * abs(true) + (4e-16 if kink else 0)
