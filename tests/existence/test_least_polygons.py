"""Where the line between the ends leads nowhere a minimum is found from the least polygons."""

import math
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

import varcalc as vc
from varcalc.existence.least_polygons import least_polygons
from varcalc.existence.refraction import meets_switches


def least_on_lattice(integrand, start, length, low, high, at_end):
    """The least polygon's value on a fine lattice, by dynamic programming: no infimum lies above it."""
    x, y = np.linspace(0, length, 49), np.linspace(low, high, 201)
    h = x[1]
    nodes, weights = np.polynomial.legendre.leggauss(5)

    def costs(k, a, b):
        slope = (b - a) / h
        shares = 0.5 + 0.5 * nodes
        return sum(
            h / 2 * w * integrand(x[k] + s * h, a + s * (b - a), slope) for s, w in zip(shares, weights, strict=True)
        )

    reached = costs(0, start, y)
    for k in range(1, len(x) - 1):
        reached = (reached[:, None] + costs(k, y[:, None], y)).min(0)
    return float((reached + at_end(y)).min())


@pytest.mark.parametrize("bound", [None, 1.6], ids=["free", "under a ceiling that is not met"])
def test_valleys_that_move_are_followed_to_a_free_end(bound):
    def on(m):
        return lambda x, y, v: v**2 * (1 + 0.4 * m.sin(3 * y) ** 2) / 2 + 2.13 * m.sin(5.927 * y - 2.298 + 0.798 * x)

    def cost(m):
        return lambda y: 2 * m.sin(2 * y + 2.875) + y**2 / 2

    conditions = [] if bound is None else [vc.Bound(lambda x, y, v: y, upper=bound)]
    found = vc.solve(
        vc.Problem(
            on(ca), vc.Fixed(0, 0.15), vc.Free(8), conditions, end_cost=lambda x0, y0, x1, y1: cost(ca)(y1)
        ),
        tol=1e-12,
    )  # fmt: skip
    polygon = least_on_lattice(on(np), 0.15, 8.0, -3.0, 2.0 if bound is None else bound, cost(np))
    assert polygon - 0.3 < found.value < polygon
    # the momentum at the free end pays for what it costs, and L_y is its rate: Euler and Lagrange's equation
    y, v = found.curve(np.array([8.0]), 0)[0, 0], found.curve(np.array([8.0]), 1)[0, 0]
    momentum = v * (1 + 0.4 * math.sin(3 * y) ** 2)
    assert momentum == pytest.approx(-(4 * math.cos(2 * y + 2.875) + y), abs=1e-5)


def test_a_valley_along_a_ceiling_is_found():
    """A curve that rests on its bound is lower than the one that turns away from it."""

    def on(m):
        return lambda x, y, v: v**2 / 2 + 3 * (y + 1) ** 2 * (y - 1.1) ** 2 * (2 + m.sin(x)) - 0.8 * y

    ceiling, length = 0.9, 6.0
    found = vc.solve(
        vc.Problem(on(ca), vc.Fixed(0, -0.9), vc.Free(length), [vc.Bound(lambda x, y, v: y, upper=ceiling)])
    )
    polygon = least_on_lattice(on(np), -0.9, length, -2.0, ceiling, np.zeros_like)
    assert found.value < polygon or found.local
    assert found.value > polygon - 0.1
    assert float(found.curve(np.linspace(0, length, 2001), 0).max()) <= ceiling + 1e-9


def test_curves_that_no_other_is_beside_are_refused():
    """L is no number on any curve, for squares beyond all floats: no lattice has a level beside the line."""
    ends = vc.Fixed(10, [-3.3, 1e150, 1]), vc.Fixed(10.5, [1e4, 1e4, 0])
    problem = vc.Problem(lambda x, y, dy: 1e20 * ca.sumsqr(dy), *ends, maximise=True)
    assert vc.solve(problem, throw=False).status is vc.Status.REFUSED


def test_a_polygon_that_rests_but_for_a_step_meets_its_kink():
    # a load of 0.3 brings it down by 0.15 in a time of 1; friction holds it from there
    low = vc.Bound(lambda x, y, v: y + 0.1 * x, upper=0.35)
    problem = vc.Problem(lambda x, y, v: v**2 / 2 + ca.fabs(v) + 0.3 * y, vc.Fixed(0, 0.3), vc.Fixed(2, 0.15), [low])
    polygon = least_polygons(problem)[0]
    assert meets_switches(problem, polygon)
    assert not meets_switches(problem, replace(polygon, y=0.3 - polygon.x[:, None]))
