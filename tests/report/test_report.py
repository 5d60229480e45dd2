"""Pages as they are made: what they are about, what they say, failures that are said, and colours."""

import math
import multiprocessing
import os
import signal
import subprocess
import sys
import time

import casadi as ca
import numpy as np
import pytest
from click.testing import CliRunner

import varcalc as vc
from varcalc.charts.themed_svg import DARK, LIGHT, contrast, in_the_dark, readable
from varcalc.cli import main
from varcalc.report.evidence import certificate_section
from varcalc.report.formulas import mathml
from varcalc.report.gallery import CRASHED, write_pages
from varcalc.report.page import Mark
from varcalc.report.pictures import sketch
from varcalc.report.question import asked_of_problem, asked_of_scene, asked_of_system
from varcalc.report.subjects import Kind, catalogued_subjects, subjects_of
from varcalc.report.words import about_sections
from varcalc.study.experiments import experiment_catalogue, load_experiment
from varcalc.study.reference import catalogue, load
from varcalc.study.scenes import load_study, scene_catalogue
from varcalc.study.user_file import ProblemFileError


def test_a_name_may_be_of_several_catalogues():
    assert [subject.kind for subject in subjects_of(["cone"])] == [Kind.PROBLEM, Kind.SYSTEM]
    [system] = subjects_of(["mechanics/cone"])
    assert system.file == "mechanics/cone.html"
    [case] = subjects_of(["brachistochrone/beyond"])
    assert (case.name, case.file) == ("brachistochrone/beyond", "problems/brachistochrone-beyond.html")


def test_everything_has_a_page_of_its_own():
    subjects = catalogued_subjects()
    assert len({subject.file for subject in subjects}) == len(subjects)
    assert len(subjects) == len(catalogue()) + len(scene_catalogue()) + len(experiment_catalogue())
    assert all(subject.line for subject in subjects)


@pytest.mark.parametrize(
    ("given", "meant"),
    [
        ("brachistocrone", "'brachistochrone'"),
        ("rainbo", "'rainbow'"),
        ("optics/fisheye", "'fish_eye'"),
        ("mechanics/pendlum", "'pendulum'"),
        ("rainbow/second", "'rainbow'"),  # scenes have no cases
    ],
)
def test_a_near_name_is_suggested_of_every_catalogue(given, meant):
    with pytest.raises(ProblemFileError, match=f"of the catalogues; did you mean {meant}"):
        subjects_of([given])


def test_a_file_whose_ending_is_left_out_is_suggested(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my_string.py").write_text("")
    with pytest.raises(ProblemFileError, match=r"for the file give my_string\.py"):
        subjects_of(["my_string"])


def test_names_that_are_none_are_refused(tmp_path):
    with pytest.raises(ProblemFileError, match="is no problem, scene or system of the catalogues; `varcalc list`"):
        subjects_of(["quite unlike any"])
    empty = tmp_path / "empty.py"
    empty.write_text("answer = 42\n")
    with pytest.raises(ProblemFileError, match="defines none of"):
        subjects_of([str(empty)])
    other = tmp_path / "other"
    other.mkdir()
    for path in (tmp_path / "mine.py", other / "mine.py"):
        path.write_text(
            "import varcalc as vc\nproblem = vc.Problem(lambda x, y, dy: dy**2, vc.Fixed(0, 0), vc.Fixed(1, 1))"
        )
    with pytest.raises(ProblemFileError, match="would both be reported"):
        subjects_of([str(tmp_path / "mine.py"), str(other / "mine.py")])


def every_formula():
    for name in catalogue():
        for reference in load(name):
            yield from asked_of_problem(reference.problem)
    for name in scene_catalogue():
        yield from asked_of_scene(load_study(name))
    for name in experiment_catalogue():
        if (system := getattr(load_experiment(name), "system", None)) is not None:
            yield from asked_of_system(system)


def test_every_formula_of_the_catalogues_is_typeset():
    formulas = {fact.formula for fact in every_formula() if fact.formula}
    assert len(formulas) > 300
    for latex in formulas:
        written = mathml(latex)
        assert written.startswith("<math")
        assert "\\" not in written, latex
        assert "merror" not in written


@pytest.mark.parametrize("colour", ["#0072b2", "#e69f00", "#332288", "#661100", "#7a5195", "#777777"])
def test_colours_have_contrast_in_the_light_and_in_the_dark(colour):
    assert contrast(readable(colour, LIGHT, 4.5), LIGHT) >= 4.5
    assert contrast(in_the_dark(colour, 3.0), DARK) >= 3.0


def test_contrast_is_that_of_the_guidelines():
    assert math.isclose(contrast("#000000", "#ffffff"), 21.0)
    # 0.2126 ((0.5 + 0.055)/1.055)^2.4 and so on of mid-grey is ((118/255 + 0.055)/1.055)^2.4
    grey = ((0x76 / 255 + 0.055) / 1.055) ** 2.4
    assert math.isclose(contrast("#767676", "#ffffff"), 1.05 / (grey + 0.05))


def test_greys_are_turned_round_in_the_dark():
    assert in_the_dark("#ffffff", 3.0) == DARK
    assert contrast(in_the_dark("#000000", 3.0), DARK) > 12


def test_a_sketch_leaves_out_what_is_no_number():
    line = np.array([[0.0, 1.0, np.nan, 2.0], [0.0, 1.0, 2.0, 0.0]])
    assert sketch([line]).count("L") == 2
    assert sketch([np.full((2, 3), np.nan)]) == ""


def test_an_answer_that_is_only_local_is_marked(folder):
    written = (folder / "problems" / "soap_film-local.html").read_text(encoding="utf-8")
    assert 'class="card doubtful"' in written
    assert "Only local" in written


def test_a_problem_without_a_minimum_says_why(folder):
    written = (folder / "without_minimum.html").read_text(encoding="utf-8")
    assert "Why there is no answer" in written
    assert "no curve meets the ends and constraints" in written.lower()
    assert "&lt;too&gt; short &amp; its" in written


def test_a_page_that_cannot_be_made_says_so(folder):
    written = (folder / "broken.html").read_text(encoding="utf-8")
    assert "this page could not be made" in written
    assert "What went wrong" in written
    assert "ZeroDivisionError" in written
    index = (folder / "index.html").read_text(encoding="utf-8")
    assert "7 pages; 2 without an answer" in index
    assert index.count('class="tile bad"') == 2


DEADLY = '''"""A file that ends the process it is solved in."""
import multiprocessing
import os
import varcalc as vc
if multiprocessing.parent_process() is not None:
    os._exit(3)
problem = vc.Problem(lambda x, y, dy: dy**2, vc.Fixed(0, 0), vc.Fixed(1, 1))
'''


def test_a_process_that_dies_takes_no_other_page_along(tmp_path):
    deadly = tmp_path / "deadly.py"
    deadly.write_text(DEADLY)
    subjects = subjects_of([str(deadly), "lever"])
    entries = {entry.name: entry for entry in write_pages(subjects, tmp_path, 2)}
    assert entries["deadly"].mark is Mark.BAD
    assert CRASHED in (tmp_path / "deadly.html").read_text(encoding="utf-8")
    assert entries["lever"].mark is Mark.GOOD
    assert not multiprocessing.active_children()


def test_a_docstring_of_one_line_is_the_title_and_no_section(tmp_path):
    mine = tmp_path / "mine.py"
    for text, headings in (("A string.", []), ("A string.\n\nPulled up at one end.\n", ["What it is"])):
        mine.write_text(f'"""{text}"""\nproblem = None\n')
        [subject] = subjects_of([str(mine)])
        assert [section.heading for section in about_sections(subject)] == headings


SLOW = '''"""A file that takes its time."""
import multiprocessing
import time
import varcalc as vc
if multiprocessing.parent_process() is not None:
    time.sleep(60)
problem = vc.Problem(lambda x, y, dy: dy**2, vc.Fixed(0, 0), vc.Fixed(1, 1))
'''


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGINT to send to another process")
def test_the_interrupt_key_keeps_what_is_finished(tmp_path):
    slow = tmp_path / "slow.py"
    slow.write_text(SLOW)
    # a shell's process in the background ignores the key, and its children with it
    heard = "import signal\nsignal.signal(signal.SIGINT, signal.default_int_handler)"
    script = tmp_path / "run.py"
    script.write_text(f"{heard}\nfrom varcalc.cli import main\nif __name__ == '__main__':\n    main()")
    out = tmp_path / "out"
    command = [sys.executable, str(script), "report", "lever", str(slow), "-o", str(out), "--cores", "1"]
    running = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=os.environ)
    until = time.monotonic() + 60
    while not (out / "mechanics" / "lever.html").exists() and time.monotonic() < until:
        time.sleep(0.05)
    running.send_signal(signal.SIGINT)
    said, _ = running.communicate(timeout=300)
    assert running.returncode == 130
    assert "1 of 2 pages" in said
    assert "1 page, of 2 that were asked for" in (out / "index.html").read_text(encoding="utf-8")
    assert not list(out.rglob("*.part"))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "name at least one"),
        (["--all", "brachistochrone"], "leave it out"),
        (["nothing_of_the_kind"], "is no problem, scene or system"),
    ],
)
def test_the_command_refuses(arguments, said):
    result = CliRunner().invoke(main, ["report", *arguments])
    assert result.exit_code == 2
    assert said in result.output


def test_the_page_states_the_theorem_with_all_that_limits_it():
    def length(_x, _y, dy):
        return ca.sqrt(1 + dy**2)

    level = vc.Isoperimetric(length, 1.2)
    dido = vc.Problem(lambda x, y, dy: y, vc.Fixed(0, 0), vc.Fixed(1, 0), [level], maximise=True)
    certificate = vc.certify(vc.solve(dido))
    [theorem, _] = certificate_section(certificate, "", 2).parts
    [over] = [fact.text for fact in theorem.facts if fact.label == "Of"]
    assert certificate.integrals
    assert all(f"{width:.3g} of its integral up to any x" in over for width in certificate.integrals)
