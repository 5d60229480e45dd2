"""The command line, called as a person calls it."""

import json
import math
import subprocess
import sys

import pytest
from click.testing import CliRunner

import varcalc as vc
from varcalc.cli import main
from varcalc.study.reference import catalogue

SHORTEST = """
import casadi as ca
import varcalc as vc
problem = vc.Problem(lambda x, y, dy: ca.sqrt(1 + dy**2), vc.Fixed(0, 0), vc.Fixed(3, 4), name="shortest path")
"""


@pytest.fixture
def call():
    def run(*arguments):
        return CliRunner().invoke(main, [str(a) for a in arguments])

    return run


@pytest.fixture
def write(tmp_path):
    def write_file(text):
        path = tmp_path / "mine.py"
        path.write_text(text, encoding="utf-8")
        return path

    return write_file


def test_python_finds_the_command_where_the_shell_does_not():
    command = [sys.executable, "-m", "varcalc", "run", "nowhere"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "Usage: python -m varcalc run" in done.stderr


def test_help_names_every_command(call):
    done = call("--help")
    assert done.exit_code == 0
    assert "list" in done.output
    assert "run" in done.output


def test_list_names_the_catalogue(call):
    done = call("list")
    assert done.exit_code == 0
    assert [line.split()[0] for line in done.output.splitlines()] == list(catalogue())


def test_list_names_the_cases_of_a_problem(call):
    done = call("list", "brachistochrone")
    assert done.exit_code == 0
    assert done.output.splitlines()[0].split()[0] == "brachistochrone"
    assert "brachistochrone/" in done.output


def test_run_compares_the_brachistochrone(call, tmp_path):
    picture = tmp_path / "picture.png"
    done = call("run", "brachistochrone", "-o", picture)
    assert done.exit_code == 0, done.output
    assert "the routes agree" in done.output
    assert "ladder (" in done.output
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_run_prints_one_json_document_and_nothing_else(call, tmp_path):
    picture = tmp_path / "picture.svg"
    done = call("run", "soap_film", "--json", "-o", picture)
    assert done.exit_code == 0, done.output
    document = json.loads(done.stdout)
    assert document["name"] == "soap_film"
    assert document["agree"] is True
    assert document["rows"][-1]["method"].startswith("ladder (")
    for row in document["rows"]:
        assert row["value"] is None or row["value"] == pytest.approx(document["exact"], rel=1e-9)
    assert picture.exists()


def test_run_takes_a_file_of_ones_own(call, write):
    done = call("run", write(SHORTEST), "--tol", "1e-8")
    assert done.exit_code == 0, done.output
    assert "mine" in done.output
    assert "closed form" not in done.output


def test_a_wrong_closed_form_fails(call, write):
    done = call("run", write(SHORTEST + "exact = 5.1\n"))
    assert done.exit_code == 1
    assert "from the closed form, more than 10 times the error it claims" in done.output


def test_a_problem_without_an_answer_fails(call, write):
    without_minimum = SHORTEST.replace("ca.sqrt(1 + dy**2)", "x * dy")
    done = call("run", write(without_minimum), "--json")
    assert done.exit_code == 1, done.output
    document = json.loads(done.stdout)
    assert document["rows"][-1]["value"] is None
    assert document["rows"][-1]["reason"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run"], "Missing argument"),
        (["run", "nowhere"], "'nowhere' is no problem of the catalogue"),
        (["run", "nowhere.py"], "there is no file nowhere.py"),
        (["list", "nowhere"], "'nowhere' is no problem of the catalogue"),
        (["run", "brachistochrone", "--tol", "0"], "--tol"),
        (["run", "brachistochrone", "--tol", "inf"], "inf is not in the range"),
        (["run", "brachistochrone", "--tol", "nan"], "nan is no tolerance; give a positive number"),
        (["chart", "brachistochrone", "--tol", "1e-3", "--tol", "nan"], "nan is no tolerance"),
        (["run", "brachistochrone", "-o", "picture.gif"], "must end in .png, .pdf or .svg"),
        (["run", "brachistochrone", "-o", "no/such/folder/picture.png"], "does not exist; make it first"),
    ],
)
def test_wrong_usage_is_status_2_and_says_why(call, arguments, message):
    done = call(*arguments)
    assert done.exit_code == 2
    assert message in " ".join(done.stderr.split())
    assert done.stdout == ""


@pytest.mark.parametrize("as_json", [False, True])
@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("problem = undefined", "line 1 failed with NameError"),
        ("problem = 1 / 0", "line 1 failed with ZeroDivisionError: division by zero"),
        ("problem = (", "line 1 failed with SyntaxError"),
        ("problem = {}['missing']", "line 1 failed with KeyError"),
        ("assert False, 'not yet'", "failed with AssertionError: not yet"),
        ("open('/no/such/file')", "failed with FileNotFoundError"),
        ("raise SystemExit(0)", "failed with SystemExit"),
        (
            SHORTEST + "vc.solve(vc.Problem(lambda x, y, dy: x * dy, vc.Fixed(0, 0), vc.Fixed(1, 1)))",
            "VariationalError",
        ),
        ("x = 1", "defines neither `problem` nor `references`; end it with problem ="),
        (SHORTEST.replace("problem =", "line ="), "defines the problem `line` and none called `problem`; rename it"),
        (
            SHORTEST.replace("problem =", "a = b ="),
            "defines 2 problems, a, b, and none called `problem`; rename the one",
        ),
        (SHORTEST + "exact = vc.Exact(5, lambda x: x / None)", "exact.y of 'mine'"),
        (
            SHORTEST + "exact = vc.Exact(5, lambda x: [x, x])",
            "must return an array of shape (1, 3) for 3 abscissae, not (2, 3)",
        ),
        (SHORTEST.replace("1 + dy**2", "y[3]"), "asks for a component that is not there"),
    ],
)
def test_a_broken_file_is_wrong_usage(call, write, text, message, as_json):
    done = call("run", write(text), *["--json"] * as_json)
    assert done.exit_code == 2
    assert message in " ".join(done.stderr.split())
    assert "Traceback" not in done.output
    if as_json:
        assert message in " ".join(json.loads(done.stdout)["error"].split())
    else:
        assert done.stdout == ""


@pytest.mark.parametrize("arguments", [["nowhere"], ["brachistochrone", "--tol", "0"], [], ["a", "b"]])
def test_json_on_wrong_usage_is_one_document(call, arguments):
    done = call("run", *arguments, "--json")
    assert done.exit_code == 2
    assert json.loads(done.stdout)["error"]


def test_what_a_file_prints_is_no_part_of_the_document(call, write):
    done = call("run", write(SHORTEST + "print('hello')"), "--json")
    assert done.exit_code == 0
    assert json.loads(done.stdout)["agree"] is True
    assert "hello" in done.stderr


def test_a_lambda_is_called_by_its_files_name(call, write):
    done = call("run", write(SHORTEST.replace(', name="shortest path"', "")), "--json", "--tol", "1e-6")
    assert json.loads(done.stdout)["problem"] == "mine"


def test_no_solver_is_listed_twice(call):
    done = call("run", "obstacle", "--json", "--tol", "1e-4")
    methods = [row["method"] for row in json.loads(done.stdout)["rows"]]
    assert methods == ["Ritz(optimiser=Ipopt())", "Collocation", "Shooting", "FirstIntegral", "ladder (Ritz)"]


def test_when_nothing_answers_the_closing_line_says_so(call, write):
    done = call("run", write(SHORTEST.replace("ca.sqrt(1 + dy**2)", "x * dy")))
    assert done.exit_code == 1
    assert done.stdout.rstrip().endswith("no route answered")


def test_a_picture_that_cannot_be_written_is_said(call, write, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("matplotlib.figure.Figure.savefig", full)
    path = write(SHORTEST)
    done = call("run", path, "-o", path.with_suffix(".png"), "--tol", "1e-6")
    assert done.exit_code == 1
    assert "could not be written" in done.stderr
    assert "No space left on device" in done.stderr


def test_the_list_is_wrapped_for_a_person_only(call, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr("click.testing._NamedTextIOWrapper.isatty", lambda self: True, raising=False)
    lines = call("list").output.splitlines()
    assert max(map(len, lines)) <= 80
    assert [line.split()[0] for line in lines[:-2] if not line.startswith(" ")] == list(catalogue())
    assert lines[-1].startswith("varcalc run NAME")


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    """One problem measured and drawn, for all tests of charts."""
    folder = tmp_path_factory.mktemp("chart")
    path, picture, claims = folder / "measured.json", folder / "picture.png", folder / "claims.svg"
    arguments = ["--tol", "1e-3", "--tol", "1e-9", "--repeats", "1", "--store", path, "-o", picture, "--claims", claims]
    done = CliRunner().invoke(main, ["chart", "oscillator", *map(str, arguments)])
    assert done.exit_code == 0, done.output
    assert all(p.stat().st_size > 5000 for p in (picture, claims))
    return path


def test_chart_measures_and_prints_every_method(call, stored):
    done = call("chart", stored)
    assert done.exit_code == 0, done.output
    for method in ("Ritz", "Ritz(optimiser=Ipopt())", "Collocation", "Shooting", "FirstIntegral", "ladder", "SciPyBvp"):
        assert sum(f" {method} " in line for line in done.output.splitlines()) == 2
    for curve in ("Ritz(degree=2, refine=False)", "Collocation(refine=False)", "Ritz(refine=False, optimiser=Ipopt())"):
        assert sum(f" {curve} " in line for line in done.output.splitlines()) >= 5


def test_a_stored_file_is_drawn_again_without_measuring(call, stored, tmp_path, monkeypatch):
    monkeypatch.setattr("varcalc.cli.measuring._lines", lambda *_: pytest.fail("measured again"))
    picture = tmp_path / "picture.png"
    done = call("chart", stored, "-o", picture)
    assert done.exit_code == 0, done.output
    assert picture.stat().st_size > 5000


def test_chart_prints_one_json_document(call, stored):
    document = json.loads(call("chart", stored, stored, "--json").stdout)
    assert sum(r["knob"] == "tol" for r in document["records"]) == 2 * 14
    assert {r["knob"] for r in document["records"]} == {"tol", "h", "p", "integrator"}
    assert document["about"]["varcalc"]


def measured(path, **errors):
    """A file of one measurement, as --store writes it."""
    record = vc.Record("mine", "Ritz", 1e-6, "solved", 1.0, 2.0, 0.5, claimed_error=1e-12, **errors)
    vc.WorkPrecision((record,), {"varcalc": "0"}).save(path)
    return path


def test_a_chart_of_a_wrong_closed_form_fails(call, tmp_path):
    done = call("chart", measured(tmp_path / "wrong.json", value_error=-0.1))
    assert done.exit_code == 1
    assert "mine by Ritz at tol = 1e-06 is wrong by more than it claims" in done.stderr


def test_no_picture_of_errors_without_a_closed_form(call, tmp_path):
    picture = tmp_path / "picture.png"
    done = call("chart", measured(tmp_path / "unknown.json"), "-o", picture)
    assert done.exit_code == 0
    assert "no picture: the errors of mine are not known, as no closed form was given" in done.stderr
    assert not picture.exists()


def test_no_picture_of_errors_of_a_file_without_a_closed_form_is_refused_before_it_is_measured(call, write, tmp_path):
    done = call("chart", write(SHORTEST), "-o", tmp_path / "picture.png")
    assert done.exit_code == 2
    assert "add exact = varcalc.Exact(value) to the file" in " ".join(done.stderr.split())


def test_sweep_prints_every_point(call):
    done = call("sweep", "brachistochrone", "g=1.62:9.81:3")
    assert done.exit_code == 0, done.output
    assert [line.split()[0] for line in done.output.splitlines()[2:]] == ["1.62", "5.715", "9.81"]


def test_sweep_stores_and_goes_on(call, tmp_path):
    store = tmp_path / "sweep.jsonl"
    first = call("sweep", "brachistochrone", "g=1,2", "--json", "--store", store)
    assert first.exit_code == 0, first.output
    assert len(store.read_text(encoding="utf-8").splitlines()) == 3
    assert json.loads(call("sweep", "brachistochrone", "g=1,2", "--json", "--store", store).stdout) == json.loads(
        first.stdout
    )


A_SCENE = """from varcalc import optics
scene = optics.Scene(optics.Uniform(1.0))
study = optics.Study(scene, optics.PointSource((0, 0)), [(1, 0)], 1.0)
"""
A_SYSTEM = """from varcalc import mechanics
free = mechanics.System(lambda t, q, v: v[0]**2, ('x',))
experiment = mechanics.Experiment(free, [0], [1], (0, 1))
"""


@pytest.mark.parametrize(("command", "text"), [("trace", A_SCENE), ("move", A_SYSTEM)])
def test_the_docstring_of_a_file_is_the_title_of_what_has_none(call, write, command, text):
    done = call(command, write(f'"""A path of one\'s own.\n\nAnd more."""\n{text}'))
    assert done.stdout.startswith("A path of one's own\n")
    titled = text.removesuffix(")\n") + ", title='mine')\n"
    assert call(command, write(f'"""A path."""\n{titled}')).stdout.startswith("mine\n")


def test_a_sweep_with_failures_fails(call, write):
    spring = write(
        "import varcalc as vc\nproblem = vc.Problem(lambda x, y, dy, p: dy**2 + p.k * y**2, vc.Fixed(0, 0), "
        "vc.Fixed(1, 1), parameters={'k': 1.0})\n"
    )
    done = call("sweep", spring, "k=1,-20")
    assert done.exit_code == 1
    assert "-20" in done.output


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["chart", "nowhere"], "'nowhere' is no problem of the catalogue"),
        (["chart", "nowhere.json"], "nowhere.json could not be read"),
        (["chart", "brachistochrone", "--store", "no/such/folder/a.json"], "does not exist; make it first"),
        (["chart", "brachistochrone", "--claims", "a.gif"], "must end in .png, .pdf or .svg"),
        (["chart", "brachistochrone", "--store", "mine.py"], "mine.py must end in .json"),
        (["sweep", "brachistochrone"], "Missing argument"),
        (["sweep", "brachistochrone", "g=1,2", "g=3,4"], "'g' is given twice; write all its values at once"),
        (["sweep", "brachistochrone", "g"], "is no grid; write name=from:to:count"),
        (["sweep", "brachistochrone", "g=1:20:0"], "'g=1:20:0' has no values"),
        (["sweep", "brachistochrone", "g=1:20:-3"], "'g=1:20:-3' has no values"),
        (["sweep", "brachistochrone", "k=1:2:3"], "are no parameters of this problem"),
        (["sweep", "soap_film", "h=1:2:3"], "it has none; declare them: parameters={'h': ...}"),
    ],
)
def test_wrong_usage_of_chart_and_sweep_says_why(call, arguments, message):
    done = call(*arguments)
    assert done.exit_code == 2
    assert message in " ".join(done.stderr.split())
    assert done.stdout == ""


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["rnu", "soap_film"], "there is no command 'rnu'; did you mean 'run'?"),
        (["optimise"], "there is no command 'optimise'; there are certify, chart, diagnose,"),
        (["run", "brachistocrone"], "did you mean 'brachistochrone'?"),
        (["run", "brachistochrone/beyand"], "did you mean 'beyond'?"),
        (["trace", "ranbow"], "did you mean 'rainbow'?"),
        (["move", "pendulm"], "did you mean 'pendulum'?"),
        (["list", "pendulm"], "did you mean 'pendulum'?"),
        (["run", "rainbow"], "'rainbow' is no problem of the catalogue; it is a scene: varcalc trace rainbow"),
        (["trace", "pendulum"], "it is a system: varcalc move pendulum"),
        (["move", "soap_film"], "it is a problem: varcalc run soap_film"),
        (["figure", "7.8"], "'7.8' is no figure of the catalogue; did you mean '7.7'?"),
        (["figure", "nowhere"], "'nowhere' is no figure of the catalogue; `varcalc list --figures` names them"),
        (["run", "brachistochrone", "--ouptut", "x.png"], "--output"),
        (["sweep", "soap_film", "k=1:2"], "write name=from:to:count"),
    ],
)
def test_what_may_have_been_meant_is_suggested(call, arguments, message):
    done = call(*arguments)
    assert done.exit_code == 2
    assert message in " ".join(done.stderr.split())


SCENE = """
from varcalc import optics
study = optics.Study(optics.Scene(optics.Uniform(1.0)), optics.PointSource((0, 0)), [(1, 0)], 1.0)
"""
MOTION = """
from varcalc import mechanics
experiment = mechanics.Experiment(mechanics.System(lambda t, q, v: v[0] ** 2, ("x",)), [0.0], [1.0], (0.0, 1.0))
"""


@pytest.mark.parametrize(
    ("command", "text", "message"),
    [
        ("run", SCENE, "mine.py defines neither `problem` nor `references`; it defines `study`: varcalc trace mine.py"),
        ("run", MOTION, "it defines `experiment`: varcalc move mine.py"),
        ("trace", SHORTEST, "mine.py defines no `study`; it defines `problem`: varcalc run mine.py"),
        ("move", SCENE, "mine.py defines no `experiment`; it defines `study`: varcalc trace mine.py"),
    ],
)
def test_a_file_that_another_command_takes_is_told_so(call, tmp_path, monkeypatch, command, text, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(text, encoding="utf-8")
    done = call(command, "mine.py")
    assert (done.exit_code, done.stdout) == (2, "")
    assert message in " ".join(done.stderr.split())


@pytest.mark.parametrize("command", ["run", "trace", "move"])
def test_a_file_whose_ending_is_left_out_is_named(call, tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").touch()
    assert "of the catalogue; for the file give mine.py" in " ".join(call(command, "mine").stderr.split())


def test_list_finds_scenes_systems_and_figures(call):
    assert "varcalc trace rainbow" in call("list", "rainbow").stdout
    assert "varcalc move pendulum" in call("list", "pendulum").stdout
    assert call("list", "3.4").stdout.startswith("3.4 ")


def test_verify_says_what_the_answer_is(call):
    done = call("verify", "soap_film")
    assert done.exit_code == 0
    assert "a minimum among all curves near it" in done.stdout
    document = json.loads(call("verify", "soap_film", "--json").stdout)
    assert document["verdict"] == "a minimum"
    assert document["index"] == 0
    assert document["value"] == pytest.approx(0.953624106702003, rel=1e-12)


def test_verify_of_what_has_no_answer_gives_the_reason(call, write):
    file = write(SHORTEST.replace("ca.sqrt(1 + dy**2)", "x * dy"))
    done = call("verify", file, "--json")
    assert done.exit_code == 1
    assert "linear in the slope" in json.loads(done.stdout)["error"]


def test_extremals_are_listed_with_their_kind(call, write):
    swing = SHORTEST.replace("ca.sqrt(1 + dy**2)", "(dy**2 - y**2) / 2").replace("(3, 4)", "(4, 1)")
    done = call("extremals", write(swing), "--json")
    assert done.exit_code == 0
    [found] = json.loads(done.stdout)["extremals"]
    assert found["index"] == 1
    assert found["conjugate_points"] == pytest.approx([math.pi], abs=1e-8)
    assert found["value"] == pytest.approx(1 / math.tan(4) / 2, rel=1e-10)


def test_diagnose_says_why_there_is_no_minimum(call, write):
    teeth = SHORTEST.replace("ca.sqrt(1 + dy**2)", "-(dy**2)")
    done = call("diagnose", write(teeth), "--json")
    assert done.exit_code == 1
    assert json.loads(done.stdout)["verdict"] == "the functional is unbounded"


def test_sweep_draws_one_parameter_and_two(call, tmp_path, write):
    file = write(SHORTEST.replace("y, dy", "y, dy, p").replace("dy**2", "p.a * dy**2 + p.b * y**2").replace(
        ", name=", ", parameters={'a': 1.0, 'b': 0.0}, name="))  # fmt: skip
    for number, grid in enumerate((["a=1:4:3"], ["a=1:4:3", "b=0:1:2"])):
        picture = tmp_path / f"{number}.png"
        done = call("sweep", file, *grid, "-o", picture)
        assert done.exit_code == 0, done.output
        assert picture.read_bytes().startswith(b"\x89PNG")


class StoppedAt:
    """Raises as Ctrl-C does, at a call that is asked for."""

    def __init__(self, function, number):
        self.function, self.number, self.calls = function, number, 0

    def __call__(self, *arguments, **options):
        self.calls += 1
        if self.calls == self.number:
            raise KeyboardInterrupt
        return self.function(*arguments, **options)


@pytest.mark.parametrize("as_json", [False, True])
def test_ctrl_c_keeps_the_finished_rows_of_run(call, monkeypatch, as_json):
    monkeypatch.setattr("varcalc.study.compare.solve", StoppedAt(vc.solve, 3))
    done = call("run", "regulator", *(["--json"] if as_json else []))
    assert done.exit_code == 130
    assert "stopped" in done.stderr
    labels = [row["method"] for row in json.loads(done.stdout)["rows"]] if as_json else done.stdout.split()
    assert "Ritz" in labels
    assert "Collocation" not in labels


def test_ctrl_c_keeps_the_finished_lines_of_chart(call, monkeypatch):
    import varcalc.study.work_precision as module

    monkeypatch.setattr("varcalc.study.work_precision.convergence", StoppedAt(module.convergence, 2))
    done = call("chart", "regulator", "--json", "--repeats", "1", "--tol", "1e-3")
    assert done.exit_code == 130
    assert {record["route"] for record in json.loads(done.stdout)["records"]} == {"Ritz"}


def test_ctrl_c_keeps_the_finished_rays_of_trace(call, monkeypatch):
    monkeypatch.setattr("varcalc.optics.results.study.Study._fronts", StoppedAt(None, 1))
    done = call("trace", "rainbow", "--json")
    assert done.exit_code == 130
    assert sum(json.loads(done.stdout)["rays"].values()) > 1


def test_ctrl_c_before_anything_is_finished_is_130_too(call, monkeypatch):
    monkeypatch.setattr("varcalc.cli.problems.loaded", StoppedAt(None, 1))
    done = call("run", "regulator")
    assert done.exit_code == 130
    assert done.stdout == ""
