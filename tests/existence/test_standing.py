"""Saddles and continua under holonomic conditions, to which IPOPT's conditions of first order are blind."""

import math

import casadi as ca
import pytest

import varcalc as vc
from varcalc.existence.standing import off_saddle
from varcalc.formulation.singular import forms
from varcalc.methods.collocation.method import Collocation


def sphere(angle):
    return vc.Curve(
        lambda q, dq: ca.norm_2(dq), vc.At([1, 0, 0]), vc.At([math.cos(angle), math.sin(angle), 0]),
        [vc.Holonomic(lambda q: ca.sumsqr(q) - 1)],
    )  # fmt: skip


def long_way(t):
    turn = (2.5 - 2 * math.pi) * t
    return [math.cos(turn), math.sin(turn), 0.0]


def test_the_long_arc_is_left_for_the_short_one():
    solution = vc.solve(sphere(2.5), vc.Ritz(starts=1), guess=long_way)
    assert solution.value == pytest.approx(2.5, abs=1e-9)


def test_an_indirect_method_may_stay_on_it():
    problem = sphere(2.5)
    form = forms(problem)[0]
    arc = vc.solve(problem, Collocation(), guess=long_way, throw=False)
    assert arc.value == pytest.approx(2 * math.pi - 2.5, abs=1e-9)
    assert off_saddle(Collocation(), form, arc, 1e-10) is arc


def test_a_minimum_that_can_be_moved_along_its_surface_is_one():
    # closed curves round the waist of a surface of revolution; each may begin anywhere
    waist = vc.Curve(
        lambda q, dq: ca.norm_2(dq), vc.Periodic(n=3), vc.Periodic(n=3),
        [vc.Holonomic(lambda q: q[0] ** 2 + q[1] ** 2 - 1 - q[2] ** 2)],
    )  # fmt: skip
    ring = vc.solve(waist, guess=lambda t: [math.cos(2 * math.pi * t), math.sin(2 * math.pi * t), 0.1], throw=False)
    assert ring.verdict is not vc.Verdict.DEGENERATE
    if ring.status.ok:
        assert ring.value == pytest.approx(2 * math.pi, abs=1e-8)
