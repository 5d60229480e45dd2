"""Studies of scenes, range charts, and scene files."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from click.testing import CliRunner

from varcalc import optics
from varcalc.cli import main
from varcalc.study.reference import ProblemFileError
from varcalc.study.scenes import load_study, scene_catalogue

FALLING = optics.Scene(optics.Stratified(lambda y: ca.sqrt(1 - 2 * y)))
ORIGIN = optics.PointSource((0.0, 0.0))
ANGLES = np.radians([20.0, 40.0, 70.0, 100.0])
FAN = np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])


@pytest.fixture(scope="module")
def seen():
    return optics.Study(FALLING, ORIGIN, FAN, 1.2, receiver=(0.5, 0.0), wavefronts=3, title="falling").run()


def test_tracks_are_the_rays(seen):
    # y = x tan(a) - x^2/(2 cos(a)^2)
    assert len(seen.tracks) == len(ANGLES)
    for angle, track in zip(ANGLES, seen.tracks, strict=True):
        x, y = track.points.T
        assert y == pytest.approx(x * np.tan(angle) - x**2 / (2 * np.cos(angle) ** 2), abs=1e-12)


def test_rays_that_go_to_and_fro_are_drawn_round():
    # n^2 = 2 - y^2: from (0, 1/2) along the axis y = cos(x / p) / 2, p^2 = 7/4
    rod = optics.Scene(optics.Graded(lambda x, y: ca.sqrt(2 - y**2)))
    seen = optics.Study(rod, optics.PointSource((0, 0.5)), [(1.0, 0.0)], 300.0).run()
    x, y = seen.tracks[0].points.T
    between, drawn = (x[1:] + x[:-1]) / 2, (y[1:] + y[:-1]) / 2
    assert abs(drawn - np.cos(between / np.sqrt(7 / 4)) / 2).max() < 1e-3


def test_the_caustic_is_the_parabola_of_safety(seen):
    assert len(seen.caustic)
    x, y = seen.caustic.points.T
    assert y == pytest.approx(0.5 - x**2 / 2, abs=1e-10)


def test_wavefronts_are_at_equal_steps(seen):
    assert [front.optical_path for front in seen.wavefronts] == pytest.approx([0.4, 0.8, 1.2])


def test_arrivals_are_told(seen):
    assert [ray.index for ray in seen.arrivals] == [0, 1]
    assert "2 rays to (0.5, 0)" in seen.table()
    document = seen.document()
    assert len(document["arrivals"]) == 2
    assert document["rays"] == {"ARRIVED": 4}


def test_the_background_holds_the_index_where_there_is_one(seen):
    behind = seen.background()
    assert behind.index.shape == (len(behind.up), len(behind.across))
    real = behind.up < 0.5
    expected = np.sqrt(1 - 2 * behind.up[real])
    assert behind.index[real] == pytest.approx(np.repeat(expected[:, None], len(behind.across), axis=1), abs=1e-12)


def test_surfaces_are_in_the_background():
    study = load_study("thick_lens")
    behind = optics.Study(study.scene, study.source, [0.5], 3.0).run().background()
    assert behind.index is None
    assert len(behind.levels) == 2


def test_an_empty_answer_gives_its_reason():
    shadow = optics.Study(FALLING, ORIGIN, FAN[:1], 0.5, receiver=(2.0, 0.0)).run()
    assert "no ray to (2, 0): shadow" in shadow.table()
    assert "shadow" in shadow.document()["reason"]


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"optical_path": 0.0}, ValueError, "optical_path"),
        ({"scene": "lens"}, TypeError, "must be a Scene"),
        ({"source": (0, 0)}, TypeError, "PointSource"),
        ({"source": optics.PlaneWave((0, 0), (1, 0)), "receiver": (1, 0)}, ValueError, "receiver"),
    ],
)
def test_studies_that_do_not_fit_are_refused(arguments, error, message):
    given = {"scene": FALLING, "source": ORIGIN, "rays": FAN, "optical_path": 1.0, **arguments}
    with pytest.raises(error, match=message):
        optics.Study(**given)


def test_the_range_chart_of_a_falling_squared_index():
    # X = sin(2 a)
    chart = optics.range_chart(FALLING, (0, 0), (0.5, 0), angles=np.radians([10, 45, 80]), crossings=1)
    assert chart.reach[:, 0] == pytest.approx(np.sin(2 * chart.angles), abs=1e-12)
    assert chart.momentum == pytest.approx(np.cos(chart.angles), abs=1e-15)
    assert len(chart.arrivals) == 2


def test_rays_that_never_come_to_the_height_have_no_reach():
    chart = optics.range_chart(FALLING, (0, 0), (0.3, 0.4), angles=np.radians([30, 80, 200]))
    assert np.isnan(chart.reach[[0, 2]]).all()
    assert np.isfinite(chart.reach[1]).all()


def test_a_range_chart_of_surfaces_is_refused():
    with pytest.raises(ValueError, match="one medium in the plane"):
        optics.range_chart(load_study("thick_lens").scene, (0, 0), (1, 0))


@pytest.mark.parametrize("name", scene_catalogue())
def test_every_scene_of_the_catalogue_is_a_study(name):
    study = load_study(name)
    assert isinstance(study, optics.Study)
    assert study.title
    points, directions = study.source.starts(study.rays)
    assert points.shape == directions.shape


@pytest.mark.parametrize(
    ("name", "most"),
    [
        ("mirrors", 1e-14),
        ("wavy_layers", 1e-14),
        ("linear_layers", 1e-9),  # a curvature is a derivative of what is known to 1e-14
        ("elliptic_rays", 1e-13),
        ("deviating_rays", 1e-11),
    ],
)
def test_scenes_are_what_is_known_of_them(name, most):
    errors = load_study(name).errors()
    assert len(errors) > 1
    assert max(errors.values()) < most


def test_what_is_known_is_told():
    study = optics.Study(FALLING, ORIGIN, FAN[:2], 0.5, known={"a thing": lambda scene: 0.25})
    seen = study.run()
    assert "a thing: missed by 2.5e-01" in seen.table()
    assert seen.document()["errors"] == {"a thing": 0.25}


@pytest.mark.parametrize(
    ("text", "message"),
    [("study = 1", "must be a varcalc.optics.Study"), ("x = 1", "defines no `study`"), ("1/0", "line 1")],
)
def test_scene_files_that_do_not_work_are_refused(tmp_path, text, message):
    path = tmp_path / "scene.py"
    path.write_text(text)
    with pytest.raises(ProblemFileError, match=message):
        load_study(path)


@pytest.mark.parametrize(
    ("index", "known", "message"),
    [
        ("lambda x: 1.5", "{}", "n must accept 2 arguments"),
        ("lambda x, y: 1 / 0", "{}", "n failed with ZeroDivisionError"),
        ("lambda x, y: 1.5", "{'one': lambda scene: 1 / 0}", "line 4 failed with ZeroDivisionError"),
        ("lambda x, y: 1.5", "{'one': lambda scene: None}", "Study.known['one'] must be a number"),
    ],
)
def test_functions_that_do_not_work_are_named_with_their_place(tmp_path, index, known, message):
    path = tmp_path / "scene.py"
    path.write_text(
        "from varcalc import optics\n"
        f"scene = optics.Scene(optics.Graded({index}))\n"
        "source = optics.PointSource((0, 0))\n"
        f"study = optics.Study(scene, source, [(1, 0)], 2.0, known={known})\n",
        encoding="utf-8",
    )
    result = CliRunner().invoke(main, ["trace", str(path)])
    assert (result.exit_code, message in result.stderr) == (2, True), result.output


def test_one_ray_is_called_one():
    assert "1 ray up to" in optics.Study(FALLING, ORIGIN, FAN[:1], 0.5).run().table()


def test_a_name_that_is_no_scene_is_refused():
    with pytest.raises(ProblemFileError, match="is no scene of the catalogue"):
        load_study("moonlight")
