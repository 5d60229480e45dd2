"""Motions between two places in a given time: all of them, what each does to the action, kinetic foci."""

import math

import casadi as ca
import numpy as np
import pytest
from scipy.special import ellipj

import varcalc as vc
from varcalc import mechanics

PENDULUM = mechanics.System(lambda t, q, v: v[0] ** 2 / 2 + ca.cos(q[0]), ("theta",))


def angle(rate, t):
    """Of a pendulum that leaves its place of rest with a rate, below 2 and above."""
    if abs(rate) < 2:
        return 2 * math.asin(rate / 2 * ellipj(t, rate**2 / 4)[0])
    return 2 * ellipj(rate * t / 2, 4 / rate**2)[3]


def test_all_motions_of_a_pendulum_between_two_places():
    duration, place = 5.0, 0.5
    rates = np.linspace(-8, 8, 16_001)
    off = np.array([angle(rate, duration) for rate in rates]) - place
    known = rates[np.flatnonzero(off[:-1] * off[1:] < 0)]
    found = vc.extremals(PENDULUM.between([0.0], [place], duration))
    assert len(found) == len(known) == 3
    leaving = np.sort([float(motion.dy(0.0)[0]) for motion in found])
    np.testing.assert_allclose(leaving, known, atol=1e-3)
    for motion in found:
        w, step = float(motion.dy(0.0)[0]), 1e-6
        beside = [angle(w + step, t) - angle(w - step, t) for t in np.linspace(0.01, duration, 2000)]
        foci = np.count_nonzero(np.diff(np.sign(beside)))
        assert vc.verify(motion).index == foci


def test_a_kinetic_focus_of_the_oscillator_lies_half_a_period_on():
    oscillator = mechanics.System(lambda t, q, v: (v[0] ** 2 - q[0] ** 2) / 2, ("x",))
    (motion,) = vc.extremals(oscillator.between([0.2], [0.7], 4.0))
    check = vc.verify(motion)
    assert (check.verdict, check.index) == (vc.Verdict.SADDLE, 1)
    assert check.conjugate_points == pytest.approx([math.pi], abs=1e-9)
