"""Conjugate and focal ends, continua of extremals, and the families that are one minimum in many places."""

from __future__ import annotations

import math

import casadi as ca
import pytest

import varcalc as vc


def oscillator(x, y, v):
    return (v**2 - y**2) / 2


def many_oscillators(x, y, v):
    return (ca.sumsqr(v) - ca.sumsqr(y)) / 2


def unit_circle(q):
    return ca.sumsqr(q) - 1


CONTINUA = {
    # y = c sin x
    "scalar": vc.Problem(oscillator, vc.Fixed(0, 0), vc.Fixed(math.pi, 0)),
    "other units": vc.Problem(lambda x, y, v: 1e14 * oscillator(x, y, v), vc.Fixed(0, 0), vc.Fixed(math.pi, 0)),
    "loaded": vc.Problem(lambda x, y, v: oscillator(x, y, v) + y * ca.sin(2 * x), vc.Fixed(0, 0), vc.Fixed(math.pi, 0)),
    "between other ends": vc.Problem(oscillator, vc.Fixed(0, 1), vc.Fixed(math.pi, -1)),
    "vector": vc.Problem(many_oscillators, vc.Fixed(0, (0, 0)), vc.Fixed(math.pi, (0, 0))),
    # c sin x meets the natural condition v = 0 at pi/2
    "focal": vc.Problem(oscillator, vc.Fixed(0, 0), vc.Free(math.pi / 2)),
    # Euler's column clamped at both ends, at its load: y = c (1 - cos x)
    "column": vc.Problem(
        lambda x, y, v, w: (w**2 - v**2) / 2, vc.Fixed(0, 0, 0), vc.Fixed(2 * math.pi, 0, 0), order=2
    ),
    # phase and amplitude: one zero mode is a shift of the start, the other is not
    "periodic": vc.Problem(
        oscillator, vc.Periodic(0, 2 * math.pi), vc.Periodic(0, 2 * math.pi), [vc.Isoperimetric(lambda x, y, v: y, 0)]
    ),
    # great circles between antipodes, in longitude and latitude
    "antipodes": vc.Problem(lambda x, y, v: ca.sqrt(v**2 + ca.cos(y) ** 2), vc.Fixed(0, 0), vc.Fixed(math.pi, 0)),
    "centre to circle": vc.Curve(
        lambda q, dq: ca.norm_2(dq), vc.At((0, 0)), vc.OnSurface(unit_circle, (0.6, 0.8))
    ),
    "a number without influence": vc.Problem(
        lambda x, y, v, p: v**2 + 0 * p.k, vc.Fixed(0, 0), vc.Fixed(1, 1), unknowns={"k": 1.0}
    ),
}  # fmt: skip


def test_a_long_kink_that_is_hardly_held_is_not_said_to_have_conjugate_ends():
    # the slope of tanh((x - x0)/sqrt 2) is a Jacobi field without a zero, some exp(-x0 sqrt 2) at its ends
    span = 27.0
    x0 = 0.3 * span
    ends = (math.tanh((x - x0) / math.sqrt(2)) for x in (0.0, span))
    first, last = (vc.Fixed(x, y) for x, y in zip((0.0, span), ends, strict=True))
    alone = vc.solve(vc.Problem(lambda x, y, v: v**2 / 2 + (1 - y**2) ** 2 / 4, first, last), vc.Ritz(), throw=False)
    assert alone.verdict is not vc.Verdict.DEGENERATE
    assert "conjugate" not in alone.message


@pytest.mark.parametrize("method", [None, vc.Ritz(), vc.Ritz(3, 10)])
@pytest.mark.parametrize("name", CONTINUA)
def test_a_continuum_is_degenerate(name, method):
    solution = vc.solve(CONTINUA[name], method, throw=False)
    assert solution.status is vc.Status.REFUSED
    assert solution.verdict is vc.Verdict.DEGENERATE
    assert "second variation vanishes" in solution.message


@pytest.mark.parametrize("mesh", [(30, 5), (100, 9), (200, 5)])
@pytest.mark.parametrize("name", CONTINUA)
def test_a_fine_mesh_does_not_hide_it(name, mesh):
    solution = vc.solve(CONTINUA[name], vc.Ritz(*mesh), throw=False)
    assert solution.verdict is vc.Verdict.DEGENERATE


def test_a_fine_mesh_holds_a_minimum_just_before_the_conjugate_point():
    for before in (0.3, 1e-3):
        problem = vc.Problem(oscillator, vc.Fixed(0, 0), vc.Fixed(math.pi - before, 1))
        solution = vc.solve(problem, vc.Ritz(100, 9))
        # y = sin x / sin b, with the value y y' / 2 at the end
        assert solution.value == pytest.approx(0.5 / math.tan(math.pi - before), rel=1e-9)


def test_a_looser_tolerance_does_not_hide_it():
    for tol in (1e-2, 1e-6, 1e-12):
        for name in ("scalar", "loaded", "antipodes", "column"):
            assert vc.solve(CONTINUA[name], tol=tol, throw=False).verdict is vc.Verdict.DEGENERATE


@pytest.mark.parametrize("before", [1e-1, 1e-3, 1e-6])
def test_just_before_the_conjugate_point_there_is_a_minimum(before):
    end = math.pi - before
    solution = vc.solve(vc.Problem(oscillator, vc.Fixed(0, 0), vc.Fixed(end, before)))
    assert solution.value == pytest.approx(before**2 / (2 * math.tan(end)), rel=1e-6)
    assert vc.solve(vc.Problem(oscillator, vc.Fixed(0, 0), vc.Fixed(end, 0))).value == 0.0


@pytest.mark.parametrize("beyond", [1e-7, 1e-4, 1e-1])
def test_just_beyond_it_there_is_none(beyond):
    problem = vc.Problem(oscillator, vc.Fixed(0, 0), vc.Fixed(math.pi + beyond, 0))
    assert not vc.solve(problem, throw=False).status.ok


def length(x, y, v):
    return ca.sqrt(1 + v**2)


SYMMETRIC = {
    "a shift": (vc.Problem(lambda x, y, v: (v - ca.cos(x)) ** 2 + 1, vc.Free(0), vc.Free(2)), 2.0),
    "a shift, round": (
        vc.Problem(lambda x, y, v: (v - ca.cos(x)) ** 2, vc.Periodic(0, 2 * math.pi), vc.Periodic(0, 2 * math.pi)),
        0.0,
    ),
    "a shift and a tilt": (vc.Problem(lambda x, y, v, w: (w - 1) ** 2 + 1, vc.Free(0), vc.Free(2), order=2), 2.0),
    "a shift of both abscissae and the ordinate": (
        vc.Problem(length, vc.OnCurve(lambda x, y: y - x, x=0.0), vc.OnCurve(lambda x, y: y - x + 2, x=1.0)),
        math.sqrt(2),
    ),
    "a shift of a curve": (
        vc.Curve(
            lambda q, dq: ca.norm_2(dq),
            vc.OnSurface(lambda q: q[0] - q[1], (0.0, 0.0)),
            vc.OnSurface(lambda q: q[0] - q[1] - 2, (1.0, -1.0)),
        ),
        math.sqrt(2),
    ),
    "a rotation": (
        vc.Curve(
            lambda q, dq: ca.norm_2(dq),
            vc.OnSurface(unit_circle, (0.6, 0.8)),
            vc.OnSurface(lambda q: ca.sumsqr(q) - 4, (1.2, 1.6)),
        ),
        1.0,
    ),
    "place, phase and rotation of a circle": (
        vc.Curve(
            lambda q, dq: ca.norm_2(dq), vc.Periodic(), vc.Periodic(),
            [vc.Isoperimetric(lambda q, dq: (q[0] * dq[1] - q[1] * dq[0]) / 2, math.pi)],
        ),
        2 * math.pi,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", SYMMETRIC)
def test_a_rigid_motion_is_no_degeneracy(name):
    problem, value = SYMMETRIC[name]
    solution = vc.solve(problem)
    assert solution.value == pytest.approx(value, rel=1e-10, abs=1e-15)


def test_a_flat_bottom_is_no_symmetry():
    # the second variation at y = 0 vanishes for constants, but y^4 (or -y^4) does not let the curve be moved
    for sign in (1, -1):
        problem = vc.Problem(lambda x, y, v, sign=sign: v**2 + sign * y**4, vc.Free(0), vc.Free(2))
        assert vc.solve(problem, vc.Ritz(), throw=False).verdict is vc.Verdict.DEGENERATE


@pytest.mark.parametrize(("rate", "stiffness"), [(30.0, 0.0), (0.0, 1e8), (-20.0, 1.0)])
def test_neither_a_steep_weight_nor_stiffness_is_degenerate(rate, stiffness):
    problem = vc.Problem(lambda x, y, v: ca.exp(-rate * x) * (v**2 + stiffness * y**2), vc.Fixed(0, 0), vc.Free(1))
    assert vc.solve(problem).value == 0.0


def test_a_minimum_of_zero_takes_few_iterations():
    # a square that vanishes: its own size tells nothing of its round-off
    for problem in (
        SYMMETRIC["a shift, round"][0],
        vc.Problem(lambda x, y, v: (v - ca.exp(x)) ** 2, vc.Free(0), vc.Free(1)),
    ):
        solution = vc.solve(problem)
        assert abs(solution.value) < 1e-10
        assert solution.stats.iterations < 12
    ends = (vc.Fixed(0, 1), vc.Fixed(1, math.e))
    solution = vc.solve(vc.Problem(lambda x, y, v: (v - y) ** 2, *ends))
    assert 0 <= solution.value < 1e-10
    assert solution.stats.iterations < 12
    assert solution.y(0.5) == pytest.approx(math.exp(0.5), rel=1e-6)
