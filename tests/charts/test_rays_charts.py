"""Pictures of rays: what is on them."""

from __future__ import annotations

import json

import numpy as np
import pytest
from click.testing import CliRunner

from varcalc import optics
from varcalc.charts import range_picture, rays_picture
from varcalc.cli import main

SCENE = """
import casadi as ca
from varcalc import optics
study = optics.Study(
    optics.Scene(optics.Stratified(lambda y: ca.sqrt(1 - 2 * y))), optics.PointSource((0, 0)), [(1, 1), (1, 2)], 0.8,
    receiver=(0.5, 0), wavefronts=2, title="falling",
)
"""


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "falling.py"
    path.write_text(SCENE)
    return path


def test_a_picture_has_the_rays_the_wavefronts_and_the_arrivals():
    study = optics.Study(
        optics.Scene([optics.Uniform(1.0), optics.Uniform(1.5)], [optics.Plane((0, 0), (0, 1))]),
        optics.PointSource((0.0, 1.0)), [(0.2, -1), (0.5, -1), (1, 1)], 2.5, receiver=(0.3, -0.5), wavefronts=2,
    )  # fmt: skip
    seen = study.run()
    figure = rays_picture(seen)
    [panel] = figure.axes
    drawn = [line.get_xydata() for line in panel.get_lines()]
    for track in (*seen.tracks, *seen.arriving):
        assert any(np.array_equal(track.points, line) for line in drawn)
    assert {text.get_text() for text in figure.legends[0].get_texts()} == {
        "rays", "wavefronts", "rays to the receiver"
    }  # fmt: skip


def test_a_range_picture_marks_the_arrivals():
    scene = optics.Scene(optics.Stratified(lambda y: (1 - 2 * y) ** 0.5))
    chart = optics.range_chart(scene, (0, 0), (0.5, 0), angles=np.radians(np.arange(5, 90, 5)))
    [panel] = range_picture(chart, title="reach").axes
    marks = [line.get_xdata()[0] for line in panel.get_lines() if line.get_marker() == "o"]
    assert sorted(marks) == pytest.approx([15.0, 75.0], abs=1e-9)


def test_trace_prints_and_draws(scene, tmp_path):
    picture, reach = tmp_path / "rays.png", tmp_path / "range.svg"
    result = CliRunner().invoke(main, ["trace", str(scene), "-o", str(picture), "--range", str(reach)])
    assert result.exit_code == 0, result.output
    assert "2 rays to (0.5, 0)" in result.output
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert "<svg" in reach.read_text()


def test_trace_gives_json(scene):
    result = CliRunner().invoke(main, ["trace", str(scene), "--json"])
    assert result.exit_code == 0
    document = json.loads(result.stdout)
    assert [ray["index"] for ray in document["arrivals"]] == [0, 1]


@pytest.mark.parametrize("arguments", [["moonlight"], ["rainbow", "--range", "x.png"], ["rainbow", "-o", "x.txt"]])
def test_what_cannot_be_traced_is_a_usage_error(arguments):
    assert CliRunner().invoke(main, ["trace", *arguments]).exit_code == 2


def test_scenes_are_listed():
    result = CliRunner().invoke(main, ["list", "--scenes"])
    assert result.exit_code == 0
    assert any(line.startswith("fish_eye") for line in result.output.splitlines())
