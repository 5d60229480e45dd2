"""The cells that the rays of a source make of the plane."""

import casadi as ca
import numpy as np
import pytest

from varcalc import optics
from varcalc.optics.arrivals.cells import P, R
from varcalc.optics.arrivals.fan import Fan, FanReach
from varcalc.optics.propagation.sequential import Propagator

PARABOLIC = optics.Stratified(lambda y: ca.sqrt(1 - 2 * y))


def fan(medium, source=(0.0, 0.0), middle=(0.4, 0.2), surfaces=()):
    propagator = Propagator((medium,) * (len(surfaces) + 1), surfaces, None, 2)
    bounds = FanReach(np.array([4.0]), np.array([4.0]), np.array([middle]), np.array([0.3]), np.array([0.5]))
    return Fan(propagator, np.array([source]), bounds)


def parabola(angle, sigma):
    """Where the ray of n² = 1 - 2y from the origin is."""
    return np.array([np.cos(angle) * sigma, np.sin(angle) * sigma - sigma**2 / 2])


def test_cells_have_their_corners_on_the_rays():
    cells = fan(PARABOLIC).cells()
    places = parabola(cells.angle[:, :, None], cells.sigma)
    np.testing.assert_allclose(cells.state[..., R], np.moveaxis(places, 0, -1), atol=1e-14)


def test_no_point_of_a_cell_leaves_the_box_widened_by_its_error():
    it = fan(PARABOLIC)
    parts, parent = it.parted(it.cells())
    assert np.all(np.diff(parent) >= 0)
    low, high = parts.boxes()
    rng = np.random.default_rng(2)
    a, u = rng.uniform(0, 1, (2, len(parts)))
    width = parts.angle[:, 1] - parts.angle[:, 0]
    ends = []
    for k in (0, 1):  # σ along an end is a cubic of the angle
        first, last = parts.sigma[:, 0, k], parts.sigma[:, 1, k]
        slopes = width[:, None] * parts.delay[:, :, k]
        rise = last - first
        square, cube = 3 * rise - 2 * slopes[:, 0] - slopes[:, 1], slopes.sum(axis=1) - 2 * rise
        ends.append(first + a * (slopes[:, 0] + a * (square + a * cube)))
    place = parabola(parts.angle[:, 0] + a * width, (1 - u) * ends[0] + u * ends[1]).T
    known = np.isfinite(parts.error)
    room = parts.error[:, None] + 1e-12
    assert np.all(((place >= low - room) & (place <= high + room))[known])


def test_the_error_falls_with_the_fourth_power_of_the_width():
    it = fan(PARABOLIC)
    coarse, _ = it.parted(it.cells())
    finer, parent = it.parted(coarse)
    ratio = finer.sideways / coarse.sideways[parent]
    assert np.median(ratio[coarse.sideways[parent] > 1e-9]) == pytest.approx(1 / 16, rel=0.5)


def test_the_ends_of_cells_are_nearly_wavefronts():
    cells = fan(optics.fish_eye(), source=(1.0, 0.0)).cells()
    _, across, ahead, _ = cells.derivatives()
    tilt = np.sum(across * ahead, axis=3) / np.linalg.norm(ahead, axis=3) / np.linalg.norm(across, axis=3)
    assert np.nanmedian(np.abs(tilt)) < 0.2


def test_a_direction_that_parts_rays_is_closed_in_on():
    surface = optics.Plane((0.0, 0.0), (0.0, 1.0))
    propagator = Propagator((optics.Uniform(1.5), optics.Uniform(1.0)), (surface,), None, 2)
    bounds = FanReach(np.array([20.0]), np.array([20.0]), np.array([[1.0, -1.0]]), np.array([0.1]), np.array([1.0]))
    cells = Fan(propagator, np.array([[0.0, 1.0]]), bounds).cells()
    critical = 1.5 * np.pi + np.arcsin(1 / 1.5)
    assert np.min(np.abs(np.mod(cells.angle, 2 * np.pi) - critical)) < 1e-13
    assert np.all(cells.state[..., P][np.isfinite(cells.state[..., P])] ** 2 <= 1.0 + 1e-12)
