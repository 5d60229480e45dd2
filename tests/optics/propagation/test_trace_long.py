"""What is constant along a ray stays so over ten thousand steps; and what goes wrong on the way harms nobody else."""

import casadi as ca
import numpy as np
import pytest

from varcalc import optics
from varcalc.integrators.taylor_ensemble import TaylorEnsemble

STEPS = 10_000
DRIFT = 1e-13
HEADINGS = np.random.default_rng(5).normal(size=(8, 3))


def sech(y):
    return 1.5 / ca.cosh(y)


def fibre(x, y, z):
    return ca.sqrt(2 - (x**2 + y**2) + 0.3 * (x**2 + y**2) ** 2)


@pytest.fixture
def steps(monkeypatch):
    """The largest number of steps taken by any ensemble."""
    taken = [0]
    carried = TaylorEnsemble._ends

    def counted(self, waiting):
        step, count = self._call, [0]

        class Counting:
            def __call__(self, columns, results):
                count[0] += 1
                step(columns, results)

        self._call = Counting()
        found = carried(self, waiting)
        self._call = step
        taken[0] = max(taken[0], count[0])
        return found

    monkeypatch.setattr(TaylorEnsemble, "_ends", counted)
    return taken


def ends(medium, path, headings, start=(0.1, 0.05, 0.2)):
    bundle = optics.Scene(medium).trace(start, headings, optical_path=path)
    assert np.all(bundle.arrived)
    index = optics.media.medium.Field(medium, 3).index(bundle.points)
    return bundle.points, index[:, None] * bundle.directions


def test_the_tangential_momentum_of_layers(steps):
    heading = np.column_stack([HEADINGS[4:, :2], 0.5 * HEADINGS[4:, 2]])
    start = ends(optics.Stratified(sech), 0.0, heading)
    end = ends(optics.Stratified(sech), 3700.0, heading)
    assert steps[0] >= STEPS
    across = [np.linalg.norm(p[:, :2], axis=1) for _, p in (start, end)]  # n cos φ
    np.testing.assert_allclose(across[1], across[0], rtol=DRIFT)


def test_bouguers_invariant(steps):
    start, end = (ends(optics.fish_eye(), path, HEADINGS[:4]) for path in (0.0, 1000.0))
    assert steps[0] >= STEPS
    bouguer = [np.linalg.norm(np.cross(r, p), axis=1) for r, p in (start, end)]
    np.testing.assert_allclose(bouguer[1], bouguer[0], rtol=DRIFT)


def test_the_hamiltonian_and_the_momentum_along_a_fibre(steps):
    heading = [(0.1, 0.2, 1), (-0.2, 0.3, 1), (0.4, 0.0, 1)]
    start, end = (ends(optics.Graded(fibre), path, heading) for path in (0.0, 7000.0))
    assert steps[0] >= STEPS
    np.testing.assert_allclose(end[1][:, 2], start[1][:, 2], rtol=DRIFT)
    squared = 2 - np.sum(end[0][:, :2] ** 2, axis=1) + 0.3 * np.sum(end[0][:, :2] ** 2, axis=1) ** 2
    np.testing.assert_allclose(np.sum(end[1] ** 2, axis=1), squared, rtol=DRIFT)
