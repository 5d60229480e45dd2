"""Runs that do not step over what is narrow, and steps whose series has gaps, against quadrature in many digits."""

import casadi as ca
import mpmath as mp
import numpy as np
import pytest
from scipy.special import ellipj, ellipk

from varcalc import mechanics, optics


def time_to(place, force_of, marks):
    """The time that a motion from x = 0 at the speed 1 takes to a place: v²/2 grows by what ``force_of`` tells."""
    with mp.workdps(25):
        marks = [0, *(m for m in marks if m < place), place]
        return float(mp.quad(lambda x: 1 / mp.sqrt(1 + 2 * force_of(mp.mpf(x))), marks))


PLACE = 0.61
BUMPS = {
    "gauss": (lambda u: ca.exp(-(u**2)), lambda u: mp.exp(-(u**2))),
    "lorentz": (lambda u: 1 / (1 + u**2), lambda u: 1 / (1 + u**2)),
    "step": (ca.tanh, mp.tanh),
    "root": (lambda u: 1 / ca.sqrt(1 + u**2), lambda u: 1 / mp.sqrt(1 + u**2)),
    "power": (lambda u: (1 + u**2) ** -2, lambda u: (1 + u**2) ** -2),
}


@pytest.mark.parametrize("bump", BUMPS)
@pytest.mark.parametrize("width", [1e-2, 1e-3, 1e-5])
def test_a_motion_goes_through_what_is_narrow(bump, width):
    given, known = BUMPS[bump]
    system = mechanics.System(lambda t, q, v: v[0] ** 2 / 2 + 0.3 * given((q[0] - PLACE) / width), ("x",))
    marks = [PLACE + side * width * 10**k for k in range(3, -2, -1) for side in (-1, 1)] + [PLACE]
    marks = sorted(m for m in marks if 0 < m < 2)
    start = known(-PLACE / mp.mpf(width))
    exact = time_to(2.0, lambda x: 0.3 * (known((x - PLACE) / width) - start), marks)
    motion = system.motion([0.0], [1.0], (0.0, exact))
    # a place is rounded to 1e-16, of the width of the bump
    assert float(motion.q(exact)[0]) == pytest.approx(2.0, abs=max(1e-12, 1e-14 / width))
    together = system.ensemble([[0.0]] * 3, [[1.0]] * 3, [0.0, exact])
    np.testing.assert_allclose(together.q[:, 0, -1], 2.0, atol=max(1e-12, 1e-14 / width))


@pytest.mark.parametrize("width", [1e-2, 1e-4])
@pytest.mark.parametrize("medium", [optics.Graded, lambda n: optics.Stratified(lambda y: n(0, y))])
def test_a_bundle_goes_through_a_thin_layer_or_is_turned_back(medium, width):
    scene = optics.Scene(medium(lambda x, y: ca.sqrt(1 - 0.5 * ca.exp(-(((y - PLACE) / width) ** 2)))))
    angles = np.radians([20.0, 60.0])
    bundle = scene.trace([(0, 0)] * 2, np.column_stack([np.cos(angles), np.sin(angles)]), optical_path=3.0)
    # n² falls to a half: a ray whose cos² is more turns back at most four widths before the middle
    mirrored = 2 * PLACE - 3.0 * np.sin(angles[0])
    assert bundle.points[0, 1] == pytest.approx(mirrored, abs=8 * width)
    np.testing.assert_allclose(
        np.abs(bundle.directions), np.abs(np.column_stack([np.cos(angles), np.sin(angles)])), atol=1e-9
    )
    p = np.cos(angles[1])
    marks = [0, *(PLACE + k * width for k in (-10, -3, 0, 3, 10)), 2.0]

    def squared(y):
        return 1 - mp.mpf(0.5) * mp.exp(-(((y - PLACE) / width) ** 2))

    path, along = (
        float(mp.quad(lambda y, w=w: w(y) / mp.sqrt(squared(y) - p**2), marks)) for w in (squared, lambda y: p)
    )
    rest = 3.0 - path
    np.testing.assert_allclose(bundle.points[1], [along + rest * p, 2.0 + rest * np.sin(angles[1])], atol=1e-11)


@pytest.mark.parametrize("events", [(), (mechanics.Event(lambda t, q, v: q[0] - 50),)])
def test_a_start_at_which_every_other_term_of_the_series_is_nothing(events):
    # x'' = cos x from rest at 0 is a pendulum let go at a right angle: x is even in time, and cos x in x
    system = mechanics.System(lambda t, q, v: v[0] ** 2 / 2 + ca.sin(q[0]), ("x",))
    motion = system.motion([0.0], [0.0], (0.0, 10.0), events=events)
    sn = ellipj(10.0 + ellipk(0.5), 0.5)[0]
    exact = np.pi / 2 - 2 * np.arcsin(np.sqrt(0.5) * sn)
    assert float(motion.q(10.0)[0]) == pytest.approx(exact, abs=1e-13)
    assert motion.error < 1e-12
    for count in (1, 100):
        together = system.ensemble([[0.0]] * count, [[0.0]] * count, [0.0, 10.0])
        np.testing.assert_allclose(together.q[:, 0, -1], exact, atol=1e-12)


def test_a_blind_first_step_among_others():
    # y² - y is even about 1/2, where the motion begins at rest; a period of the cubic potential brings it back
    system = mechanics.System(lambda t, q, v: v[0] ** 2 / 2 - q[0] ** 2 / 2 + q[0] ** 3 / 3, ("y",))
    low, high, beyond = np.sort(np.roots([-1 / 3, 1 / 2, 0, -1 / 12]).real)
    period = 4 * np.sqrt(1.5 / (beyond - low)) * ellipk((high - low) / (beyond - low))
    motion = system.motion([0.5], [0.0], (0.0, period))
    assert float(motion.q(period)[0]) == pytest.approx(0.5, abs=1e-13)
    assert motion.error < 1e-12


def test_rest_at_the_origin_with_events_and_with_constraints():
    falling = mechanics.System(lambda t, q, v: v[0] ** 2 / 2 + 3 * q[0], ("x",))
    [happening] = falling.motion([0.0], [0.0], (0, 1), events=[mechanics.Event(lambda t, q, v: q[0] - 0.5)]).events
    assert happening.t == pytest.approx(np.sqrt(1 / 3), abs=1e-15)
    tied = mechanics.System(
        lambda t, q, v: v[0] ** 2 + 0.55 * v[1] ** 2 + 9.81 * (1.3 * q[0] + 0.43 * q[1]),
        ("a", "b"),
        constraints=[mechanics.Holonomic(lambda t, q: q[0] + q[1])],
    )
    motion = tied.motion([0.0, 0.0], [0.0, 0.0], (0.0, 2.0))
    assert float(motion.q(2.0)[0]) == pytest.approx(9.81 * 0.87 / 3.1 * 2, rel=1e-13)
