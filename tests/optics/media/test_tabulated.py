"""Measured profiles: what is exact by construction, and what is refused."""

import casadi as ca
import numpy as np
import pytest

from varcalc import optics
from varcalc.optics import RayStatus
from varcalc.optics.media.medium import Field

HEIGHTS = np.array([-3.0, -1.7, -1.0, -0.2, 0.1, 0.3, 0.45])
ANGLES = np.linspace(-2.0, 1.2, 9)
FAN = np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])


@pytest.mark.parametrize("smooth", [True, False])
def test_a_table_of_a_linear_squared_index_has_parabolas_for_rays(smooth):
    table = optics.Tabulated(HEIGHTS, np.sqrt(1 - 2 * HEIGHTS), smooth=smooth)
    exact = optics.Scene(optics.Stratified(lambda y: ca.sqrt(1 - 2 * y)))
    for until in ({"optical_path": 0.9}, {"until": optics.Plane((0.4, 0), (1, 0))}):
        ends = [s.trace((0, -0.1), FAN, with_spreading=True, **until) for s in (optics.Scene(table), exact)]
        assert np.sum(ends[1].arrived) >= 7
        np.testing.assert_allclose(ends[0].points[ends[1].arrived], ends[1].points[ends[1].arrived], atol=1e-13)
        np.testing.assert_allclose(ends[0].spreading[ends[1].arrived], ends[1].spreading[ends[1].arrived], rtol=1e-11)


def test_a_ray_may_start_at_a_height_of_the_table_and_touch_one():
    table = optics.Tabulated(HEIGHTS, np.sqrt(1 - 2 * HEIGHTS), smooth=False)
    top = 0.1  # a turning point at a height of the table: sin² θ (1 - 2 y) = 2 (top - y)
    y = -0.2
    sine = np.sqrt(2 * (top - y) / (1 - 2 * y))
    bundle = optics.Scene(table).trace((0, y), (np.sqrt(1 - sine**2), sine), until=optics.Plane((0, y), (0, 1)))
    sigma = 2 * sine * np.sqrt(1 - 2 * y)
    np.testing.assert_allclose(bundle.points, [[np.sqrt(1 - sine**2) * np.sqrt(1 - 2 * y) * sigma, y]], atol=1e-12)


def test_a_cubic_table_is_the_cubic_it_was_made_from():
    def squared(y):
        return 2 - 0.3 * y + 0.1 * y**2 - 0.05 * y**3

    table = optics.Tabulated(HEIGHTS, np.sqrt(squared(HEIGHTS)))
    smooth = optics.Stratified(lambda y: ca.sqrt(squared(y)))
    ends = [optics.Scene(medium).trace((0, -0.5), FAN, optical_path=0.8) for medium in (table, smooth)]
    np.testing.assert_allclose(ends[0].points, ends[1].points, atol=1e-13)


def test_rays_that_leave_the_table_are_marked():
    table = optics.Tabulated([0.0, 1.0], [1.2, 1.0], smooth=False)
    bundle = optics.Scene(table).trace((0, 0.5), [(0, 1), (0, -1), (1, 0)], optical_path=0.7)
    assert list(bundle.status) == [RayStatus.OUTSIDE, RayStatus.OUTSIDE, RayStatus.ARRIVED]
    np.testing.assert_allclose(bundle.points[:2], [[0, 1], [0, 0]], atol=1e-15)


def test_all_rays_in_a_table():
    table = optics.Tabulated(HEIGHTS, np.sqrt(1 - 2 * HEIGHTS), smooth=False)
    rays = optics.Scene(table).rays((0, 0), (0.5, 0))
    assert rays[0].optical_path == pytest.approx(0.494521305498037, rel=1e-13)
    assert [r.index for r in rays] == [0]  # the other one rises to 0.4665, above the table


@pytest.mark.parametrize(
    ("heights", "n", "message"),
    [
        ([0, 2, 1], [1, 1, 1], "2 is followed by 1"),
        ([0, 1, 1], [1, 1, 1], "leave out what is there twice"),
        ([0, 1], [1, 0], "n must be positive, but it is 0 at height 1"),
        ([0, 1, 2], [1, 1], "as many numbers"),
        ([0, 1, 1.01, 3], [0.1, 0.1, 3, 0.1], "the spline through the table is negative"),
    ],
)
def test_tables_that_make_no_profile_are_refused(heights, n, message):
    with pytest.raises(ValueError, match=message):
        optics.Tabulated(heights, n)


def test_a_source_outside_the_table_is_refused():
    with pytest.raises(ValueError, match="index is nan at the source"):
        optics.Scene(optics.Tabulated([0, 1], [1, 1])).trace((0, 2), (1, 0), optical_path=1)


def test_the_rays_of_a_smooth_table_end_where_they_should():
    """A spline that is no polynomial: the ray found is traced again, and passes B."""
    heights = np.linspace(-2.0, 0.6, 14)
    table = optics.Tabulated(heights, np.sqrt(1.2 - heights + 0.2 * np.sin(3 * heights)))
    scene = optics.Scene(table)
    rays = scene.rays((0, 0.05), (0.9, -0.1))
    assert len(rays) >= 1
    for ray in rays:
        again = scene.trace((0, 0.05), ray.tangents[0], optical_path=ray.optical_path)
        np.testing.assert_allclose(again.points[0], [0.9, -0.1], atol=1e-13)
        half = scene.trace((0, 0.05), ray.tangents[0], optical_path=ray.optical_path / 2)
        np.testing.assert_allclose(ray.point(ray.optical_path / 2), half.points[0], atol=1e-13)


def test_heights_too_far_apart_for_cubics_are_refused():
    with pytest.raises(ValueError, match="which is too far; use larger units"):
        optics.Tabulated([0.0, 1.0, 1e200], [1.0, 1.1, 1.2])


@pytest.mark.parametrize("smooth", [True, False])
def test_a_table_is_looked_up_layer_by_layer_as_it_is_written_as_a_whole(smooth: bool) -> None:
    table = optics.Tabulated(HEIGHTS, 1.4 + 0.1 * np.sin(5 * HEIGHTS), smooth=smooth)
    heights = np.concatenate([HEIGHTS, np.linspace(-3.1, 0.55, 40)])
    points = np.column_stack([np.zeros_like(heights), heights])
    position = ca.SX.sym("r", 2)
    hessian, gradient = ca.hessian(table.squared_index(position), position)
    whole = [ca.Function("whole", [position], [ca.densify(e)]) for e in (gradient, hessian, table.index(position))]
    expected = [np.array([np.array(f(point)).ravel() for point in points]) for f in whole]
    field = Field(table, 2)
    for own, other in zip((field(points)[1], field(points)[2], field.index(points)), expected, strict=True):
        np.testing.assert_allclose(own.reshape(other.shape), other, rtol=1e-14, atol=1e-14)
