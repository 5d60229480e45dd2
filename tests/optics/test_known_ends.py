"""Ends known beforehand, held against the same ends looked for."""

import casadi as ca
import numpy as np
import pytest

from varcalc import engines, optics
from varcalc.optics import RayStatus
from varcalc.optics.beam import launched
from varcalc.optics.known_ends import KnownEnds
from varcalc.optics.surfaces import Geometry
from varcalc.optics.system import packed

ROD = optics.selfoc(1.5, 0.7)


def states(headings):
    headings = np.array(headings) / np.linalg.norm(headings, axis=1)[:, None]
    return packed(launched(np.zeros((len(headings), 3)), headings, np.full(len(headings), 1.5), neighbours=True))


def test_a_plane_across_a_rod_is_reached_without_looking():
    known = KnownEnds(ROD, 3, engines.default())
    start = states([(0.1, 0, 1), (0.1, 0.2, -1), (0.3, 0.2, 1)])
    met, never, left = known.to_surface(start, Geometry(optics.Plane((0, 0, 5), (0, 0, 1)), 3), np.arange(3))
    assert (list(met), list(never), list(left)) == ([0, 2], [1], [])
    np.testing.assert_allclose(start[met, 2], 5.0, rtol=1e-15)


@pytest.mark.parametrize("surface", [optics.Plane((0, 0, 5), (0.1, 0, 1)), optics.Sphere((0, 0, 0), 2.0)])
def test_other_surfaces_are_looked_for(surface):
    known = KnownEnds(ROD, 3, engines.default())
    met, never, left = known.to_surface(states([(0.1, 0, 1)]), Geometry(surface, 3), np.arange(1))
    assert (list(met), list(never), list(left)) == ([], [], [0])


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
