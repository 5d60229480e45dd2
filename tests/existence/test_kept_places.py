"""Ends that slide where bounds and levels are asked: the better place is found, though no curve goes between."""

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import brentq

import varcalc as vc

COST = 0.2


def two_windows(mirrored, slides, maximise):
    """From x = 0 to y = 1.5 x - 2.5, with slopes of 0.9 to 1.1 and y of the integral -1; L = (y' - 1)²/2 + COST.

    Where D = (X - 0.5) (X - 2) is far from 0 no such curve ends at X.
    """
    sign, way = -1 if maximise else 1, -1 if mirrored else 1
    shore = vc.OnCurve(lambda x, y: y - 1.5 * way * x + 2.5, x=2.0 * way)
    other = vc.OnCurve(lambda x, y: x + 0 * y, x=0.0) if slides else vc.Free(0.0)
    conditions = [
        vc.Bound(lambda x, y, v: way * v, lower=0.9, upper=1.1),
        vc.Isoperimetric(lambda x, y, v: y, -1.0),
    ]
    ends = (shore, other) if mirrored else (other, shore)
    return vc.Problem(lambda x, y, v: sign * ((way * v - 1) ** 2 / 2 + COST), *ends, conditions, maximise=maximise)


def least_of_windows():
    """With u = y' - 1 the level asks for D as the integral of x u, which costs 3 D² / (2 X³), by u = 3 D x / X³."""
    x = np.linspace(0.3, 3, 270_001)
    missed = (x - 0.5) * (x - 2)
    return np.where(np.abs(3 * missed / x**2) <= 0.1, COST * x + 1.5 * missed**2 / x**3, np.inf).min()


@pytest.mark.parametrize(
    ("mirrored", "slides", "maximise"),
    [(False, False, False), (True, False, False), (False, True, False), (False, False, True)],
)
def test_an_end_leaves_a_place_to_which_no_admitted_curve_leads_from_the_better_one(mirrored, slides, maximise):
    solution = vc.solve(two_windows(mirrored, slides, maximise))
    assert (-1 if maximise else 1) * solution.value == pytest.approx(least_of_windows(), abs=1e-7)
    assert not solution.local


def bays(x, exp):
    """A shore with bays at 2 and at -3, of which the first comes nearer."""
    return 4 - 1.5 * exp(-2 * (x - 2) ** 2) - 2.5 * exp(-2 * (x + 3) ** 2)


def arc(chord, area):
    """The length of the arc that lies so much above its chord: that of a circle (Dido)."""

    def beyond(half):
        return (chord / (2 * np.sin(half))) ** 2 * (half - np.sin(half) * np.cos(half)) - area

    half = brentq(beyond, 1e-6, np.pi - 1e-6)
    return chord * half / np.sin(half)


@pytest.mark.parametrize("begun", [(2.0, 2.5), (-3.0, 1.5)])
def test_the_shortest_arc_of_a_given_area_goes_to_the_nearer_bay(begun):
    shore = vc.OnSurface(lambda q: q[1] - bays(q[0], ca.exp), begun)
    area = vc.Isoperimetric(lambda q, dq: (q[0] * dq[1] - q[1] * dq[0]) / 2, 1.0)
    solution = vc.solve(vc.Curve(lambda q, dq: ca.norm_2(dq), vc.At((0, 0)), shore, [area]))
    x = np.linspace(-5, 5, 4001)
    known = min(arc(chord, 1.0) for chord in np.hypot(x, bays(x, np.exp)))
    assert solution.value == pytest.approx(known, abs=1e-5)


@pytest.mark.parametrize("begun", [(0.5, 3.9), (1.8, 4.0)])
def test_ends_whose_curves_meet_under_a_bound_leave_nothing_of_the_curve(begun):
    start = vc.OnCurve(lambda x, y: y + 0.23 - 0.905 * x + 0.671 * x**2, x=begun[0])
    end = vc.OnCurve(lambda x, y: x - 4 - 0.7 * (y - 0.364), x=begun[1])

    def positive(x, y, v):
        return v**2 / 2 + 1 + 2.4 * ca.exp(-3 * y**2) - 1.4 * y * ca.cos(0.2 * x) + y**2 / 2

    solution = vc.solve(vc.Problem(positive, start, end, [vc.Bound(lambda x, y, v: y, upper=2.0)]))
    meeting = brentq(lambda x: (x - 4) / 0.7 + 0.364 + 0.23 - 0.905 * x + 0.671 * x**2, 2, 3)
    assert solution.value == pytest.approx(0, abs=1e-9)
    assert solution.x[[0, -1]] == pytest.approx([meeting, meeting], abs=1e-6)
