"""What bundles are made of: tables of rows, the first thing that is met, and the count of conjugate points."""

import numpy as np
import pytest

from varcalc.optics.rays.beam import NOTHING, Beam, RayStatus, caustics_between, first_met, packed, unpacked


def ray(*moved):
    """One ray along the last axis, with neighbours at ``moved``."""
    d = len(moved[0])
    ahead = np.eye(d)[-1:] * 1.5
    return Beam(np.zeros((1, d)), ahead, np.zeros(1), np.array([moved], dtype=float), np.zeros((1, len(moved), d)))


def turned(beam, matrix):
    """The same seen from elsewhere."""
    columns = {name: getattr(beam, name) @ matrix.T for name in ("position", "momentum", "moved", "turned")}
    return Beam(optical_path=beam.optical_path, **columns)


IN_SPACE = [
    ([(1, 0, 0), (0, 1, 0)], [(0.5, 0, 0), (0, 0.8, 0)], 0),
    ([(1, 0, 0), (0, 1, 0)], [(-0.5, 0, 0), (0, 0.8, 0)], 1),
    ([(1, 0, 0), (0, 1, 0)], [(-0.1, 0, 0), (0, -0.1, 0)], 2),
    ([(1, 0.2, 0), (0.1, 1, 0)], [(-0.1, -0.02, 0), (-0.01, -0.1, 0)], 2),
    ([(1, 0, 0), (0, 1, 0)], [(0, 0, 0), (0, 0, 0)], 2),
    ([(1, 0, 0), (0, 1, 0)], [(0, 0, 0), (0, 1, 0)], 1),
    ([(1, 0, 0), (0, 1, 0)], [(0, 0, 0), (0, -1, 0)], 2),
    ([(0, 0, 0), (0, 0, 0)], [(-1, 0, 0), (0, 1, 0)], 0),
    ([(0, 0, 0), (0, 1, 0)], [(-1, 0, 0), (0, 1, 0)], 0),
    ([(0, 0, 0), (0, 1, 0)], [(-1, 0, 0), (0, -1, 0)], 1),
    ([(1, 0, 70), (0, 1, -50)], [(0.9, 0, 80), (0, 0.9, -60)], 0),
]


@pytest.mark.parametrize(("before", "after", "count"), IN_SPACE)
def test_conjugate_points_of_a_step_in_space(before, after, count):
    matrix, _ = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))
    for seen in (np.eye(3), np.diag([1.0, -1.0, 1.0]), matrix):
        steps = [turned(ray(*moved), seen) for moved in (before, after)]
        if seen is matrix and 0 in np.array([before, after])[..., :2].any(axis=2):
            continue  # what is zero is not to round-off
        assert caustics_between(*steps).tolist() == [count]


@pytest.mark.parametrize(("before", "after", "count"), [(1, 0.5, 0), (1, -0.5, 1), (-1, 1, 1), (1, 0, 1), (0, -1, 0)])
def test_conjugate_points_of_a_step_in_the_plane(before, after, count):
    """A point that a step ends in belongs to it, and not to the next step."""
    assert caustics_between(ray((before, 0.3)), ray((after, -0.2))).tolist() == [count]


def test_what_is_not_known_passes_nothing():
    for d in (2, 3):
        known = ray(*np.eye(d)[: d - 1])
        assert caustics_between(known, ray(*np.full((d - 1, d), np.nan))).tolist() == [0]


def test_the_limit_comes_before_a_surface_in_the_same_place():
    struck, sigma, status = first_met(
        [np.array([2.0, 1.0, np.inf]), np.array([1.0, 1.0, np.inf])], np.array([3, 1, np.inf])
    )
    assert struck.tolist() == [1, NOTHING, NOTHING]
    assert sigma.tolist() == [1.0, 1.0, 0.0]
    assert status.tolist() == [RayStatus.ARRIVED, RayStatus.ARRIVED, RayStatus.MISSED]


def test_beams_as_states_and_back_in_parts():
    generator = np.random.default_rng(1)
    states = generator.normal(size=(5, 19))
    beam = unpacked(states, 3)
    np.testing.assert_array_equal(packed(beam), states)
    parts = Beam.joined([beam.take(slice(0, 2)), beam.take(np.arange(2, 5))])
    np.testing.assert_array_equal(packed(parts), states)
    parts.put(np.array([4, 0]), beam.take(np.array([1, 1])))
    np.testing.assert_array_equal(packed(parts), states[[1, 1, 2, 3, 1]])
