"""Bundles in parts: the same rays, and a bar only for those who want one."""

import numpy as np
import pytest

from varcalc import optics
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
