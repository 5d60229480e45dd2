"""Parabolic arcs through tables, against finite differences and Hamilton's equations at kinks."""

import numpy as np
import pytest

from varcalc import optics

HEIGHTS = np.linspace(-2.0, 2.0, 23)
TABLE = optics.Scene(optics.Tabulated(HEIGHTS, 1.5 - 0.1 * HEIGHTS**2 + 0.05 * np.sin(3 * HEIGHTS), smooth=False))
ANGLES = np.linspace(0.05, 6.1, 40)


def fan(turned=0.0):
    return np.column_stack([np.cos(ANGLES + turned), np.sin(ANGLES + turned)])


@pytest.mark.parametrize("model", [optics.Parabolas(), optics.Hamilton()])
def test_neighbours_are_turned_at_the_kinks(model):
    step = 1e-6
    bundle = TABLE.trace((0.1, 0.03), fan(), optical_path=4.0, with_spreading=True, model=model)
    left, right = (TABLE.trace((0.1, 0.03), fan(s), optical_path=4.0, model=model) for s in (-step, step))
    apart = np.linalg.norm(right.points - left.points, axis=1) / (2 * step)
    rows = bundle.arrived & left.arrived & right.arrived
    assert np.count_nonzero(rows) > 20
    np.testing.assert_allclose(bundle.spreading[rows], apart[rows], rtol=1e-7)


def test_one_layer_is_a_parabola():
    scene = optics.Scene(optics.Tabulated([-10.0, 0.4], np.sqrt([21.0, 0.2]), smooth=False))  # n² = 1 - 2y
    sigma, climb = 1.2, np.sin(1.0)
    path = sigma - climb * sigma**2 + sigma**3 / 3
    end = scene.trace((0, 0), (np.cos(1.0), climb), optical_path=path, with_spreading=True)
    assert end.model == "parabolic arcs"
    np.testing.assert_allclose(end.points, [[np.cos(1.0) * sigma, climb * sigma - sigma**2 / 2]], rtol=1e-13)


def test_a_ray_leaves_the_table_or_stops_at_a_plane():
    scene = optics.Scene(optics.Tabulated([0.0, 1.0], [1.2, 1.0], smooth=False))
    assert scene.trace((0, 0.5), (0, 1), optical_path=3.0).status[0] == optics.RayStatus.OUTSIDE
    stopped = scene.trace((0, 0.5), (1, 0.1), until=optics.Plane((0.3, 0), (1, 0.2)))
    assert stopped.arrived[0]
    assert np.dot(stopped.points[0] - [0.3, 0], [1, 0.2]) == pytest.approx(0, abs=1e-15)
