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


@pytest.mark.parametrize(("base", "there"), [(-8685.166, -1.1875), (-1e5, 0.3), (2e3, -0.01), (1e4, 9.9e3)])
def test_a_change_from_far_off_keeps_its_digits(base, there):
    # 1 + u² comes from 1e8 down to 2: told from the base and the change it would have half of its digits
    y, b, x = ca.SX.sym("y"), ca.SX.sym("b"), ca.SX.sym("x")
    [carried] = carry(ca.Function("f", [y], [1 + 1e-4 / (1 + y**2)]), [displaced(b, x, 0.3)])
    change = float(ca.Function("change", [b, x], [carried.change])(base, there - base))
    with mp.workdps(40):
        at = lambda u: mp.mpf(1e-4) / (1 + u**2)  # noqa: E731
        true = at(mp.mpf(base) + mp.mpf(there - base)) - at(mp.mpf(base))
        # the place itself is rounded as far off as the base is large
        assert abs(change - true) <= (8e-16 + 2.3e-16 * abs(base)) * abs(true)
