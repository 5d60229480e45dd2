"""Rays that start along a height or a plane come to an end, with a status, before long."""

import signal
from contextlib import contextmanager

import casadi as ca
import numpy as np
import pytest

from varcalc import optics
from varcalc.optics import RayStatus

HEIGHTS = np.linspace(-1, 1, 9)
ROD = optics.selfoc(1.5, 0.7)
MODELS = (None, optics.Hamilton())


@contextmanager
def at_most(seconds):
    """TimeoutError in the body after so long, where the system has such an alarm."""

    def late(*_):
        raise TimeoutError(f"no end after {seconds} seconds")

    before = signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def along(index, height, model, *, smooth):
    """A horizontal ray from a height of a table of the index."""
    scene = optics.Scene(optics.Tabulated(HEIGHTS, index(HEIGHTS), smooth=smooth))
    with at_most(30):
        return scene.trace((0, height), (1, 0), optical_path=2.0, model=model)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("smooth", [True, False])
@pytest.mark.parametrize("bend", [-0.1, 0.1])
def test_a_horizontal_ray_on_a_height_goes_to_the_side_it_is_pulled_to(model, smooth, bend):
    ends = [along(lambda y: 1.5 + bend * y**2, height, model, smooth=smooth) for height in (-0.25, 0.25)]
    for end, height in zip(ends, (-0.25, 0.25), strict=True):
        assert end.status[0] == RayStatus.ARRIVED
        assert np.sign(end.points[0, 1] - height) == np.sign(bend * height)
    np.testing.assert_allclose(ends[0].points, ends[1].points * (1, -1), rtol=0, atol=1e-14)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("smooth", [True, False])
def test_a_horizontal_ray_on_the_edge_leaves_the_table_at_once(model, smooth):
    for height in (-1.0, 1.0):
        end = along(lambda y: 1.5 + 0.1 * y**2, height, model, smooth=smooth)
        assert end.status[0] == RayStatus.OUTSIDE


@pytest.mark.parametrize("model", MODELS)
def test_a_ray_along_a_kink_to_which_both_sides_turn_it_back_is_given_up(model):
    assert along(lambda y: 1.5 - 0.1 * np.abs(y), 0.0, model, smooth=False).status[0] == RayStatus.SINGULAR


@pytest.mark.parametrize("model", [*MODELS, optics.Invariants()])
@pytest.mark.parametrize("tilt", [-1.2e-16, 0.0, 1.2e-16])
def test_a_plane_at_the_height_of_the_source(model, tilt):
    """Rays fall, y = tilt σ - σ²/2: one that rises comes back to the plane at once, the others do not."""
    scene = optics.Scene(optics.Stratified(lambda y: ca.sqrt(1 - 2 * y)))
    with at_most(30):
        end = scene.trace((0, 0), (-1, tilt), until=optics.Plane((0, 0), (0, 1)), model=model)
    assert end.status[0] == (RayStatus.ARRIVED if tilt > 0 else RayStatus.MISSED)
    if tilt > 0:
        np.testing.assert_allclose(end.points, 0, rtol=0, atol=1e-15)


def test_rays_that_turn_where_the_index_vanishes_are_carried_in_the_regular_parameter():
    """Straight up to the place where n = 0, and back: S is no parameter there, σ is."""
    scene = optics.Scene(optics.Stratified(lambda y: ca.sqrt(1 - 2 * y)))
    bundle = scene.trace((0, 0), [(0, 1), (1e-7, 1)], optical_path=1.0)
    assert np.all(bundle.arrived)
    sigma = np.roots([1 / 3, -1, 1, -1.0])  # S = σ - σ² + σ³/3
    sigma = sigma[np.abs(sigma.imag) < 1e-12].real[0]
    np.testing.assert_allclose(bundle.points[:, 1], sigma - sigma**2 / 2, atol=1e-12)


def test_rays_that_run_away_from_a_plane_never_meet_it():
    bundle = optics.Scene(ROD).trace((0, 0, 0), [(0.1, 0, 1), (0.1, 0, -1)], until=optics.Plane((0, 0, 1), (0, 0, 1)))
    assert list(bundle.status) == [RayStatus.ARRIVED, RayStatus.MISSED]


def test_rays_that_leave_a_plane_do_not_meet_it_at_once():
    level = optics.Plane((0, 0, 0), (0, 0, 1))
    bundle = optics.Scene(optics.Graded(lambda x, y, z: 1.5 + 0 * x)).trace((0, 0, 0), (0.1, 0, 1), until=level)
    assert list(bundle.status) == [RayStatus.MISSED]
