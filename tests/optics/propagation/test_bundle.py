"""Bundles in parts: the same rays, and a bar only for those who want one."""

import numpy as np
import pytest

from varcalc import integrators, optics
from varcalc.optics import validation

HEADINGS = np.random.default_rng(1).normal(size=(130, 3))
SCENE = optics.Scene(optics.luneburg())


@pytest.mark.parametrize("points", [(0.1, 0.2, 0.3), np.random.default_rng(2).uniform(-0.4, 0.4, (130, 3))])
def test_parts_make_the_whole(monkeypatch, points):
    path = np.linspace(0.1, 2.0, 130)
    whole = SCENE.trace(points, HEADINGS, optical_path=path, with_spreading=True)
    monkeypatch.setattr(validation, "CHUNK", 50)
    parts = SCENE.trace(points, HEADINGS, optical_path=path, with_spreading=True)
    for name in ("points", "directions", "optical_path", "status", "spreading"):
        np.testing.assert_allclose(getattr(parts, name), getattr(whole, name), rtol=1e-14, atol=1e-15)


def test_a_bad_source_is_found_wherever_it_is(monkeypatch):
    monkeypatch.setattr(validation, "CHUNK", 50)
    points = np.zeros((130, 3))
    points[101] = 2.0
    with pytest.raises(ValueError, match=r"index is nan at the source \(2.0, 2.0, 2.0\)"):
        SCENE.trace(points, HEADINGS, optical_path=1.0)


def test_a_bar_is_shown_to_those_who_ask(capsys):
    SCENE.trace((0, 0, 0), HEADINGS, optical_path=1.0)
    assert capsys.readouterr().err == ""
    SCENE.trace((0, 0, 0), HEADINGS, optical_path=1.0, progress=True)
    assert "rays" in capsys.readouterr().err


def test_no_rays_make_an_empty_bundle():
    bundle = SCENE.trace(np.zeros((0, 3)), np.zeros((0, 3)), optical_path=1.0)
    assert len(bundle) == 0


@pytest.mark.parametrize("count", [5, 400])
@pytest.mark.parametrize("compiled", [True, False])
def test_all_rays_of_the_fish_eye_meet_where_its_lens_maps_their_source(monkeypatch, count, compiled):
    """Of n = 2/(1 + r²) rays are circles, and all ways from A to -A/|A|² are of the optical length π."""
    if not compiled:
        monkeypatch.setattr(integrators, "available", lambda taylor=None: (integrators.Dop853(),))
    scene = optics.Scene(optics.Graded(lambda x, y: 2 / (1 + x**2 + y**2)))
    source = np.array([0.4, 0.3])
    angles = np.arctan2(-0.3, -0.4) + np.linspace(-1.2, 1.2, count)  # the others go far out, where the index vanishes
    directions = np.column_stack([np.cos(angles), np.sin(angles)])
    bundle = scene.trace([source] * count, directions, optical_path=np.pi, with_spreading=True)
    np.testing.assert_allclose(bundle.points, [-source / (source @ source)] * count, rtol=0, atol=2e-13)
    # they meet there to first order too
    np.testing.assert_allclose(bundle.spreading, 0.0, atol=1e-11)
