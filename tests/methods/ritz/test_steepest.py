"""Slopes at their bounds along stretches, against closed forms."""

import math
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

import varcalc as vc
from varcalc.methods.ritz import method
from varcalc.methods.ritz.steepest import steepest


@pytest.mark.parametrize("height", [0.3, 1.0, 1.4])
def test_a_fall_that_may_not_be_faster(height):
    """v^2/2 + k y with v <= B: a parabola up to c, where BT - k (T - c)... is the way that is left, then a line.

    On [0, c] the slope is B - k (c - x), on [c, T] it is B; y(T) = BT - k c^2/2 gives c.
    """
    k, B, T = 2.0, 1.0, 2.0
    c = math.sqrt(2 * (B * T - height) / k)
    # the integral of v^2/2 + k y = that of v^2/2 + k (T - x) v, by parts
    slope = np.polynomial.Polynomial([B - k * c, k])
    x = np.polynomial.Polynomial([0.0, 1.0])
    first, last = ((v**2 / 2 + k * (T - x) * v).integ() for v in (slope, 0 * x + B))
    value = first(c) - first(0) + last(T) - last(c)
    assert 0 < c < T
    found = vc.solve(
        vc.Problem(
            lambda x, y, v: v**2 / 2 + k * y, vc.Fixed(0, 0), vc.Fixed(T, height),
            [vc.Bound(lambda x, y, v: v, upper=B)],
        )
    )  # fmt: skip
    assert found.value == pytest.approx(value, abs=1e-9)
    assert abs(found.value - value) <= found.error.value + 1e-14
    at = np.array([c + 1e-5, 0.5 * (c + T), T - 1e-5])
    assert found.curve(at, 1)[0] == pytest.approx(B, abs=1e-7)
    assert found.curve(np.array([c / 2]), 1)[0, 0] == pytest.approx(B - k * c / 2, abs=1e-7)


@pytest.mark.parametrize("steepest", [0.3, 0.8, 0.99])
@pytest.mark.parametrize("turns", [1, 2])
def test_slopes_are_cut_where_momentum_goes_beyond_them(steepest, turns):
    """v^2/2 + y cos x from y = 0 to a free end at 2 pi n: the momentum is sin x, and the slope its part within bounds.

    By parts the functional is the integral of v^2/2 - v sin x.
    """
    T, cut = 2 * math.pi * turns, math.asin(steepest)
    # a quarter of a turn: v = sin x up to the cut, then the bound
    free = -(cut / 2 - math.sin(2 * cut) / 4) / 2
    held = steepest**2 / 2 * (math.pi / 2 - cut) - steepest * math.cos(cut)
    found = vc.solve(
        vc.Problem(
            lambda x, y, v: v**2 / 2 + y * ca.cos(x), vc.Fixed(0, 0), vc.Free(T),
            [vc.Bound(lambda x, y, v: v, lower=-steepest, upper=steepest)],
        )
    )  # fmt: skip
    assert found.value == pytest.approx(4 * turns * (free + held), abs=1e-9)
    x = np.linspace(0.05, T - 0.05, 101)
    clear = np.abs(np.abs(np.sin(x)) - steepest) > 1e-3
    slopes = np.clip(np.sin(x), -steepest, steepest)
    assert found.curve(x[clear], 1)[0] == pytest.approx(slopes[clear], abs=1e-5)


def test_a_stretch_that_only_seems_to_be_one_is_left_out():
    """The curve comes near its bound once more, on the other side of it, and does not rest there."""
    found = vc.solve(
        vc.Problem(
            lambda x, y, v: v**2 / 2 + y * ca.cos(x), vc.Fixed(0, 0), vc.Free(2 * math.pi),
            [vc.Bound(lambda x, y, v: v, lower=-1 - 1e-4, upper=1 - 1e-4)],
        )
    )  # fmt: skip
    cut = math.asin(1 - 1e-4)
    bound = 1 - 1e-4
    # half a turn without the bound, and one that is cut
    free = -(cut - math.sin(2 * cut) / 2) / 2
    held = bound**2 / 2 * (math.pi - 2 * cut) - 2 * bound * math.cos(cut)
    assert found.value == pytest.approx(-math.pi / 4 + free + held, abs=1e-9)


def test_a_closer_look_that_finds_no_curve_has_no_contacts(monkeypatch):
    """As under v >= 0 where no minimum exists; the method then goes its own way, as where no contact counts."""
    run = method._Climb.run

    def without(climb, guess):
        found = run(climb, guess)
        return replace(found, curve=None) if climb.tol == method.ROUGHLY else found

    monkeypatch.setattr(method._Climb, "run", without)
    monkeypatch.setattr(method, "UNSEEN", 0.0)
    monkeypatch.setattr(method, "steepest", lambda form, coarse: steepest(form, coarse) and [])
    bound = vc.Bound(lambda x, y, v: v, upper=1.0)
    problem = vc.Problem(lambda x, y, v: v**2 / 2 + 2 * y, vc.Fixed(0, 0), vc.Fixed(2, 1), [bound])
    c = 1.0  # as in a fall that may not be faster: the slope is 1 - 2 (1 - x) up to c
    found = vc.solve(problem, vc.Ritz(), tol=1e-7)
    falling = np.polynomial.Polynomial([-1.0, 2.0])
    value = (falling**2 / 2 + 2 * falling.integ()).integ()(c) + 0.5 * c + 2 * (0.0 * c + c**2 / 2)
    assert found.value == pytest.approx(value, abs=1e-5)
