"""Motions through kinks and jumps of the forces, against closed forms; and what is refused of them."""

import math

import casadi as ca
import numpy as np
import pytest

from varcalc import mechanics
from varcalc.integrators import RunOutcome


def one(potential, **more):
    return mechanics.System(lambda t, q, v: v[0] ** 2 / 2 - potential(t, q[0]), ("x",), **more)


def test_a_ball_on_a_spring_floor():
    """Free fall from h, half a swing of the spring with its place of rest at -g/k, and up again: a period in time."""
    g, k, h = 9.81, 400.0, 0.7
    ball = one(lambda t, x: g * x + ca.if_else(x < 0, k * x**2 / 2, 0))
    fall, w = math.sqrt(2 * h / g), math.sqrt(k)
    contact = 2 * (math.pi - math.atan(w * math.sqrt(2 * g * h) / g)) / w
    period = 2 * fall + contact
    lands = mechanics.Event(lambda t, q, v: q[0], "floor")
    motion = ball.motion([h], [0.0], (0.0, 3 * period), events=[lands])
    np.testing.assert_allclose(motion.q(np.arange(1, 4) * period)[0], h, rtol=1e-12)
    exact = [n * period + t for n in range(3) for t in (fall, fall + contact)]
    np.testing.assert_allclose([happened.t for happened in motion.events], exact, rtol=1e-13)
    lowest = -g / k - math.sqrt((g / k) ** 2 + 2 * g * h / k)
    assert float(motion.q(period / 2)[0]) == pytest.approx(lowest, rel=1e-12)
    assert motion.drift["energy"] < 1e-13 * g * h
    assert np.abs(motion.q(np.arange(1, 4) * period)[0] - h).max() <= motion.error


def test_many_go_through_as_one_does():
    wedge = one(lambda t, x: ca.fabs(x))
    many = wedge.ensemble([[1.0], [2.0], [0.5]], np.zeros((3, 1)), [0.0, 3.0, 7.0])
    for row, start in enumerate((1.0, 2.0, 0.5)):
        alone = wedge.motion([start], [0.0], (0.0, 7.0))
        np.testing.assert_allclose(many.q[row, 0], alone.q([0.0, 3.0, 7.0])[0], rtol=0, atol=1e-12)
    times = wedge.passages([[1.0], [2.0]], np.zeros((2, 1)), mechanics.Event(lambda t, q, v: q[0]), (0, 20), most=3)
    exact = np.sqrt([[2.0], [4.0]]) * [1, 3, 5]
    np.testing.assert_allclose(times.times, exact, rtol=1e-13)


def test_meissners_equation():
    """x'' + (a + b sign(cos t)) x = 0: the matrix of a period is a product of three (E. Meissner, 1918)."""
    a, b = 1.2, 0.5
    swing = one(lambda t, x: (a + b * ca.sign(ca.cos(t))) * x**2 / 2)

    def matrix(stiffness, t):
        w = math.sqrt(stiffness)
        return np.array([[math.cos(w * t), math.sin(w * t) / w], [-w * math.sin(w * t), math.cos(w * t)]])

    quarter = math.pi / 2
    exact = matrix(a + b, quarter) @ matrix(a - b, 2 * quarter) @ matrix(a + b, quarter)
    found = swing.floquet([0.0], 4 * quarter)
    np.testing.assert_allclose(found.monodromy, exact, rtol=0, atol=1e-13)
    motion = swing.motion([1.0], [0.3], (0.0, 4 * quarter))
    np.testing.assert_allclose(motion.q(4 * quarter), exact[:1] @ [1.0, 0.3], rtol=0, atol=1e-13)


def test_a_boundary_of_a_square_drive_is_a_root():
    """Of a + b sign(cos t), b = 1, the trace of the period's matrix is ±2 on the chart's boundary."""
    drive = mechanics.System(
        lambda t, q, v, p: v**2 / 2 - (p.a + ca.sign(ca.cos(t))) * q**2 / 2, ("x",), parameters={"a": 1.0}
    )
    chart = mechanics.stability_chart(drive, [0.0], 2 * math.pi, {"a": np.linspace(1.1, 2.9, 10)})

    def trace(a):
        fast, slow = math.sqrt(a + 1), math.sqrt(a - 1)
        mixed = fast / slow + slow / fast
        return 2 * math.cos(fast * math.pi) * math.cos(slow * math.pi) - mixed * math.sin(fast * math.pi) * math.sin(
            slow * math.pi
        )

    places = chart.boundaries.places[:, 0]
    assert len(places) > 0
    np.testing.assert_allclose([abs(trace(a)) for a in places], 2.0, rtol=1e-11)


def test_friction_brings_to_rest():
    block = one(lambda t, x: x**2 / 2, forces=lambda t, q, v: [-0.3 * ca.sign(v[0])])
    motion = block.motion([2.0], [0.0], (0.0, 5 * np.pi))
    np.testing.assert_allclose(motion.q(np.arange(1, 6) * np.pi)[0], [-1.4, 0.8, -0.2, -0.2, -0.2], atol=1e-12)


def test_a_step_of_the_potential_is_an_impulse_and_ends_the_motion():
    step = one(lambda t, x: ca.if_else(x < 0, 0, 1.0))
    motion = step.motion([-1.0], [2.0], (0.0, 3.0))
    assert motion.outcome is RunOutcome.IMPULSE
    assert motion.span[1] == pytest.approx(0.5, rel=1e-14)


def test_what_is_refused_says_so():
    wedge, heavier = (
        one(lambda t, x: ca.fabs(x)),
        mechanics.System(lambda t, q, v: ca.if_else(t < 1, 1, 2) * v[0] ** 2 / 2, ("x",)),
    )
    with pytest.raises(ValueError, match=r"switches .fabs. where x is zero, and a step would go over that"):
        wedge.galerkin([1.0], [0.0], (0.0, 1.0), steps=4)
    with pytest.raises(ValueError, match=r"switches .fabs. where x is zero, and motions beside one are bent"):
        wedge.orbit([1.0], [0.0], 4 * math.sqrt(2))
    with pytest.raises(ValueError, match="small motions about a place of rest want it smooth"):
        wedge.floquet([0.0], 1.0)
    with pytest.raises(ValueError, match="and the momenta with it, so that rates would jump"):
        heavier.motion([0.0], [1.0], (0.0, 2.0))
