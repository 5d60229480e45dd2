"""`varcalc move` and `varcalc list --systems`: from the catalogue, from a file, as JSON, as a picture."""

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from varcalc import mechanics
from varcalc.charts import motion_picture
from varcalc.cli import main
from varcalc.study.experiments import experiment_catalogue, load_experiment

OWN = """
from varcalc import mechanics
system = mechanics.System(lambda t, q, v: (v[0]**2 - q[0]**2) / 2, ("x",))
experiment = mechanics.Experiment(system, [1.0], [0.0], (0, 3.0))
"""


def run(*arguments):
    return CliRunner().invoke(main, list(arguments))


def test_a_system_of_the_catalogue_is_moved_and_drawn(tmp_path):
    picture = tmp_path / "pendulum.png"
    result = run("move", "pendulum", "-o", str(picture))
    assert result.exit_code == 0
    assert "closed form: off by" in result.output
    assert picture.stat().st_size > 10_000


def test_a_file_of_ones_own_as_json(tmp_path):
    path = tmp_path / "own.py"
    path.write_text(OWN, encoding="utf-8")
    document = json.loads(run("move", str(path), "--json").output)
    assert document["coordinates"] == ["x"]
    assert document["drift"]["energy"] < 1e-14


def test_numbers_that_are_no_motion_are_held_against_what_is_known(tmp_path):
    path = tmp_path / "own.py"
    path.write_text(
        "from varcalc import mechanics\n"
        'experiment = mechanics.Examination("A triangle", {"angles": lambda: 1e-16, "area": lambda: 0.25})\n',
        encoding="utf-8",
    )
    assert "area: off by 0.2" in run("move", str(path)).output
    assert json.loads(run("move", str(path), "--json").output)["errors"] == {"angles": 1e-16, "area": 0.25}
    drawn = run("move", str(path), "-o", str(tmp_path / "none.png"))
    assert (drawn.exit_code, "no motion" in drawn.output) == (2, True)
    with pytest.raises(ValueError, match="checks"):
        mechanics.Examination("nothing", {})


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x = 1\n", "defines no `experiment`"),
        ("experiment = 3\n", "must be a mechanics.Experiment"),
        ("1/0\n", "line 1"),
    ],
)
def test_files_that_do_not_work(tmp_path, text, said):
    path = tmp_path / "wrong.py"
    path.write_text(text, encoding="utf-8")
    result = run("move", str(path))
    assert result.exit_code == 2
    assert said in result.output


PLANE = """
import numpy as np
from varcalc import mechanics
system = mechanics.System(lambda t, q, v: (v[0]**2 - q[0]**2 + v[1]**2 - q[1]**2) / 2, ("x", "y"))
experiment = mechanics.Experiment(system, [1.0, 0.0], [0.0, 1.0], (0, 3.0), %s)
"""


@pytest.mark.parametrize(
    ("known", "said"),
    [
        ("lambda t: 1 / 0", "line 5 failed with ZeroDivisionError"),
        ("lambda t: np.stack([np.cos(t), np.sin(t)], axis=1)", "must return an array of shape (2, 1001)"),
        ("lambda t: np.cos(t)", "must return an array of shape (2, 1001)"),
        ("lambda t: 'x'", "what Experiment.exact gives must be made of numbers"),
        ("checks={'place': lambda motion: motion.q(1.0)}", "Experiment.checks['place'] must be a number"),
        ("checks={'place': lambda motion: motion.where}", "line 5 failed with NoMember: Motion has no attribute"),
        ("checks={'place': lambda motion: motion.q(4.0)[0]}", "line 5 failed with ValueError: t must lie between"),
        ("events=(mechanics.Event(lambda t: t, 'now'),)", "events[0] must accept 3 arguments"),
    ],
)
def test_functions_that_do_not_work_are_named_with_their_place(tmp_path, known, said):
    path = tmp_path / "wrong.py"
    path.write_text(PLANE % known, encoding="utf-8")
    result = run("move", str(path))
    assert (result.exit_code, said in result.stderr) == (2, True), result.output


def test_what_is_known_is_held_against_the_motion_and_named_by_its_file(tmp_path):
    path = tmp_path / "circle.py"
    path.write_text(PLANE % "lambda t: np.stack([np.cos(t), np.sin(t)])", encoding="utf-8")
    result = run("move", str(path))
    assert result.exit_code == 0
    assert result.output.startswith(f"{path}\n\nfrom t = 0 to 3")
    moved = load_experiment(path).run()
    assert moved.errors["closed form"] < 1e-13
    times, q, _ = moved.drawn
    np.testing.assert_allclose(q, [np.cos(times), np.sin(times)], rtol=0, atol=1e-13)


def test_an_examination_that_gives_no_number_is_refused():
    with pytest.raises(TypeError, match=r"checks\['angle'\] must be a number"):
        mechanics.Examination("A triangle", {"angle": lambda: None}).run()


def test_the_list_gives_the_largest_error_of_every_system(monkeypatch):
    # each of them is run by itself in test_motion.py
    some = {name: line for name, line in experiment_catalogue().items() if name in ("pendulum", "rutherford", "cone")}
    monkeypatch.setattr("varcalc.study.experiments.experiment_catalogue", lambda: some)
    result = run("list", "--systems")
    assert result.exit_code == 0
    lines = result.output.splitlines()
    assert [line.split()[0] for line in lines] == list(some)
    assert all(float(line.split()[1]) <= 1e-12 for line in lines)
    assert run("list", "--systems", "--scenes").exit_code == 2


@pytest.mark.parametrize("name", ["pendulum", "elastic_pendulum", "bead_on_a_hoop"])
def test_pictures_name_their_axes(name):
    moved = load_experiment(name).run()
    left, right = motion_picture(moved).axes
    first = moved.names[0]
    assert left.get_xlabel() == "t (s)"
    if len(moved.names) > 1:
        assert (right.get_xlabel(), right.get_ylabel()) == (f"{first} (m)", r"$\theta$ (rad)")
    else:
        assert (right.get_xlabel(), right.get_ylabel()) == (r"$\theta$ (rad)", r"$d\theta/dt$ (rad/s)")


def test_units_are_one_a_coordinate():
    with pytest.raises(ValueError, match="units must be 2 strings"):
        mechanics.System(lambda t, q, v: v[0] ** 2 + v[1] ** 2, ("x", "y"), units=("m",))


def test_a_section_and_a_map_are_drawn_where_they_are_asked_for():
    asked = load_experiment("henon_heiles")
    section = asked.beside
    assert isinstance(section, mechanics.Section)
    few = replace(section, q0=section.q0[:3], v0=section.v0[:3], most=20)
    _, right = motion_picture(replace(asked, checks={}, beside=few).run()).axes
    assert (right.get_xlabel(), right.get_ylabel()) == ("y", "$dy/dt$")
    assert [len(line.get_xdata()) for line in right.lines] == [20] * 3
    asked = load_experiment("double_pendulum")
    flights = asked.beside
    assert isinstance(flights, mechanics.Flights)
    few = replace(flights, first=np.array([-3.0, 0.0, 3.0]), second=np.array([0.0, 3.0]), span=(0.0, 10.0))
    moved = replace(asked, beside=few).run()
    assert moved.many is not None
    times = moved.many.times.reshape(2, 3)
    assert np.isnan(times[0, 1])  # at rest
    assert times[0, 0] == pytest.approx(times[0, 2], rel=1e-9)  # the mirrored motion
    _, right, bar = motion_picture(moved).axes
    assert (right.get_xlabel(), bar.get_ylabel()) == (
        r"$\theta_{1}$ (rad) at rest",
        "time to the lower rod upright (s)",
    )


def test_the_separatrix_is_in_the_phase_portrait():
    portrait = load_experiment("pendulum").run().portrait
    assert portrait is not None
    assert portrait.separatrices == pytest.approx((9.81,), abs=1e-3)  # the upright pendulum
