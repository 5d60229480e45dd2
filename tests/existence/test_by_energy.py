"""Curves in space through kinks and jumps, against Snell's law over the place at which they go through."""

import math
from functools import cache

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import minimize

import varcalc as vc


def through(normal, level, start, end, index):
    """The least optical path across a plane, 1 before it and ``index`` behind it: least over the point in the plane."""
    normal = np.array(normal, dtype=float)
    base = level * normal / (normal @ normal)
    along = np.linalg.svd(normal[None])[2][1:]

    def path(share):
        at = base + share @ along
        return np.linalg.norm(at - start) + index * np.linalg.norm(end - at)

    found = minimize(path, np.zeros(len(along)), method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-15})
    return found.fun, base + found.x @ along


@cache
def refracted(normal, level, start, end):
    """The curve across a plane behind which the index is 1.5; its level and that index are parameters."""
    weights = ca.DM(normal)
    return vc.solve(
        vc.Curve(
            lambda q, dq, p: ca.if_else(ca.dot(weights, q) > p.level, p.n, 1.0) * ca.norm_2(dq),
            vc.At(start), vc.At(end), parameters={"level": level, "n": 1.5},
        )
    )  # fmt: skip


@pytest.mark.parametrize(
    ("normal", "level", "end"), [((0, 1), 0.4, (1, 1.2)), ((1, 2), 1.5, (1, 1)), ((1, 1, 1), 1.0, (1, 0.2, 1.1))]
)
def test_a_curve_is_refracted_where_it_goes_through_a_plane(normal, level, end):
    start = (0,) * len(normal)
    exact, at = through(normal, level, np.array(start), np.array(end), 1.5)
    # of two functions each way takes seconds: one is asked for
    for ends in ((start, end), (end, start))[: 2 if len(end) > 2 else 1]:
        solution = refracted(normal, level, *ends)
        assert solution.value == pytest.approx(exact, rel=1e-13)
        assert solution.curve(np.array([solution.x[1]]), 0)[:, 0] == pytest.approx(at, abs=1e-6)
        assert vc.verify(solution).verdict is vc.Verdict.MINIMUM


@pytest.fixture(scope="module")
def bent():
    """The curve in the index n = 1 + |y - 1/2|."""
    return vc.solve(vc.Curve(lambda q, dq: (1 + ca.fabs(q[1] - 0.5)) * ca.norm_2(dq), vc.At((0, 0)), vc.At((1, 1.2))))


def test_a_curve_is_bent_by_a_kink_of_the_index_as_a_graph_is(bent):
    """The graph is broken at the kink as well."""
    # on either side a layer linear in y: a catenary cosh in x, with n sin(angle) = c the same on both
    c = math.nan
    across = lambda c: sum(c * math.acosh((1 + rise) / c) - c * math.acosh(1 / c) for rise in (0.5, 0.7))  # noqa: E731
    low, high = 1e-6, 1.0
    for _ in range(200):
        c = 0.5 * (low + high)
        low, high = (c, high) if across(c) < 1 else (low, c)

    def taken(rise):
        """int n² dy/sqrt(n² - c²) over a layer in which n rises from 1."""
        return 0.5 * sum(
            sign * (n * math.sqrt(n**2 - c**2) + c**2 * math.acosh(n / c)) for sign, n in ((1, 1 + rise), (-1, 1.0))
        )

    assert bent.value == pytest.approx(taken(0.5) + taken(0.7), rel=1e-11)


def test_what_a_curve_is_not_broken_at_is_named():
    dense = vc.Curve(
        lambda q, dq: ca.if_else((q[0] - 0.5) ** 2 + (q[1] - 0.6) ** 2 < 0.04, 1.5, 1.0) * ca.norm_2(dq),
        vc.At((0, 0)), vc.At((1, 1.2)),
    )  # fmt: skip
    assert "a jump (<) where (x - 1/2)^2 + (y - 3/5)^2 - 1/25 = 0" in vc.solve(dense, throw=False).message


@pytest.mark.parametrize("curve", [True, False])
def test_what_moving_the_plane_does_is_the_jump_of_the_normal_momentum(curve):
    start, end, index, level = np.zeros(2), np.array([1.0, 1.2]), 1.5, 0.4
    _, at = through((0, 1), level, start, end, index)
    exact = at[1] / np.linalg.norm(at) - index * (end - at)[1] / np.linalg.norm(end - at)
    if curve:
        solution = refracted((0, 1), level, (0, 0), (1, 1.2))
    else:
        problem = vc.Problem(
            lambda x, y, v, p: ca.if_else(y > p.level, p.n, 1.0) * ca.sqrt(1 + v**2), vc.Fixed(0, 0), vc.Fixed(1, 1.2),
            parameters={"level": level, "n": index},
        )  # fmt: skip
        solution = vc.solve(problem)
    rates = solution.sensitivities
    assert rates["level"] == pytest.approx(exact, abs=1e-7)
    assert rates["n"] == pytest.approx(np.linalg.norm(end - at), abs=1e-7)


def test_a_lower_graph_over_the_chord_is_told_of():
    """Where floor(2 y) is negative enough longer paths lower the functional: the curve between is a local one."""
    stairs = vc.Curve(lambda q, dq: (1.5 + ca.floor(2 * q[1])) * ca.norm_2(dq), vc.At((0, 0.1)), vc.At((1, 0.9)))
    assert vc.solve(stairs, throw=False).local


def test_a_curve_through_a_jump_may_be_begun_from_another():
    layered = vc.Curve(
        lambda q, dq: ca.if_else(q[1] + q[2] > 1, 1.5, 1.0) * ca.norm_2(dq), vc.At((0, 0, 0)), vc.At((1, 1, 0.5))
    )
    first = vc.solve(layered)
    assert vc.solve(layered, guess=first).value == pytest.approx(first.value, rel=1e-12)


def test_a_curve_that_meets_nothing_keeps_its_own_coordinates_and_certificate():
    clear = vc.Curve(lambda q, dq: (2 + ca.fmax(q[1], -1)) * ca.norm_2(dq), vc.At((0, 0)), vc.At((1, 0.5)))
    solution = vc.solve(clear)
    certificate = vc.certify(solution)
    assert certificate.lower <= solution.value + 1e-14
    assert certificate.upper >= solution.value - 1e-14


def test_what_was_found_by_its_energy_is_not_certified_with_the_square_of_its_value(bent):
    with pytest.raises(vc.VariationalError, match="by its energy"):
        vc.certify(bent)
