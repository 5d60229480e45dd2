"""Passages of many motions through an event, against closed forms and one motion after the other."""

import casadi as ca
import numpy as np
import pytest

from varcalc import mechanics
from varcalc.integrators import RunOutcome

oscillators = mechanics.System(lambda t, q, v: ca.sumsqr(v) / 2 - (q[0] ** 2 + 2 * q[1] ** 2) / 2, ("x", "y"))
RISING = mechanics.Event(lambda t, q, v: q[0], "x = 0", direction=1)


def test_a_section_of_two_oscillators():
    phases = np.array([0.3, 1.0, 2.5])
    q0 = np.column_stack([np.cos(phases), [0.5, 1.0, -0.2]])
    v0 = np.column_stack([-np.sin(phases), [0.0, 0.3, 0.0]])
    found = oscillators.passages(q0, v0, RISING, (1.0, 40.0), most=4)
    # cos(t - 1 + phase) rises through zero at 3 pi/2
    exact = 1.0 + 1.5 * np.pi - phases[:, None] + 2 * np.pi * np.arange(4)
    np.testing.assert_allclose(found.times, exact, atol=1e-12)
    np.testing.assert_allclose(found.q[:, 0], 0.0, atol=1e-13)
    np.testing.assert_allclose(found.v[:, 0], 1.0, atol=1e-12)
    turned = np.sqrt(2) * (exact - 1.0)
    y = q0[:, 1:] * np.cos(turned) + v0[:, 1:] / np.sqrt(2) * np.sin(turned)
    np.testing.assert_allclose(found.q[:, 1], y, atol=1e-12)
    assert found.outcomes == (RunOutcome.STOPPED,) * 3


def test_motions_that_do_not_come_there_and_one_that_begins_there():
    q0, v0 = [[0.0, 0.0], [0.0, 0.1], [1.0, 0.0]], [[1.0, 0.0], [-1.0, 0.0], [0.0, 0.0]]
    found = oscillators.passages(q0, v0, RISING, (0.0, 4.0), most=2)
    np.testing.assert_array_equal(found.counts, [0, 1, 0])  # the start itself does not count
    assert found.times[1, 0] == pytest.approx(np.pi, abs=1e-13)
    assert np.all(np.isnan(found.q[0]))
    assert found.outcomes == (RunOutcome.COMPLETED,) * 3


def test_many_motions_pass_when_one_of_them_does():
    pendulum = mechanics.System(lambda t, q, v: v[0] ** 2 / 2 + ca.cos(q[0]), ("theta",))
    event = mechanics.Event(lambda t, q, v: q[0] - 0.4 * ca.sin(t), "moving")
    starts = np.linspace(0.5, 2.5, 7)[:, None]
    found = pendulum.passages(starts, 0 * starts, event, (0.0, 15.0), most=3)
    for row, start in enumerate(starts):
        alone = pendulum.motion(start, [0.0], (0.0, 15.0), events=[event]).events[:3]
        np.testing.assert_allclose(found.times[row], [one.t for one in alone], atol=1e-11)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"most": 0}, "most must be"),
        ({"event": "x"}, "event must be"),
        ({"span": (1, 0)}, "span must be"),
        ({"q0": [[1.0]]}, "shape"),
    ],
)
def test_arguments_are_named(change, said):
    given = {"q0": [[1.0, 0.0]], "v0": [[0.0, 0.0]], "event": RISING, "span": (0, 1)} | change
    with pytest.raises((TypeError, ValueError), match=said):
        oscillators.passages(**given)
