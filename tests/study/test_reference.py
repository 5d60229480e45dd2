"""Finding, running and refusing problem files."""

import dataclasses
import subprocess
import sys

import numpy as np
import pytest

import varcalc as vc
from varcalc.study.reference import Exact, ProblemFileError, Reference, as_exact, catalogue, load


@pytest.fixture
def shortest():
    return vc.Problem(lambda x, y, dy: (1 + dy**2) ** 0.5, vc.Fixed(0, 0), vc.Fixed(3, 4), name="shortest path")


@pytest.fixture
def write(tmp_path):
    """Write a problem file of a person's own and give its path."""

    def write_file(text, name="mine.py"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return write_file


SHORTEST = """
import casadi as ca
import varcalc as vc
problem = vc.Problem(lambda x, y, dy: ca.sqrt(1 + dy**2), vc.Fixed(0, 0), vc.Fixed(3, 4))
"""

CASES = """
import casadi as ca
import varcalc as vc
from varcalc.study.reference import Reference
def path(height):
    return vc.Problem(lambda x, y, dy: ca.sqrt(1 + dy**2), vc.Fixed(0, 0), vc.Fixed(3, height))
references = (Reference("mine", path(4)), Reference("mine/steep", path(40)))
"""


def test_exact_keeps_a_float():
    assert Exact(2).value == 2.0
    assert isinstance(Exact(np.float64(2)).value, float)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"value": float("nan")}, ValueError, "exact.value must be finite"),
        ({"value": "5"}, TypeError, "exact.value must be a number"),
        ({"value": "five"}, TypeError, "exact.value must be a number"),
        ({"value": 5.0, "y": 3.0}, TypeError, "exact.y must be a function"),
    ],
)
def test_exact_refuses(arguments, error, message):
    with pytest.raises(error, match=message):
        Exact(**arguments)


def test_as_exact():
    given = Exact(5.0)
    assert as_exact(given) is given
    assert as_exact(5) == Exact(5.0)
    assert as_exact(None) is None


def test_reference_is_frozen_and_has_its_own_reasons(shortest):
    one, other = Reference("one", shortest), Reference("other", shortest)
    assert one.inapplicable == {}
    assert one.inapplicable is not other.inapplicable
    with pytest.raises(dataclasses.FrozenInstanceError):
        one.name = "two"


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"name": ""}, ValueError, "name is empty"),
        ({"problem": 3}, TypeError, "problem of 'p' must be a Problem or a Curve"),
        ({"exact": 5.0}, TypeError, "write Exact"),
        ({"inapplicable": {vc.Fixed(0, 0): "why"}}, TypeError, "maps method classes to reasons; write Fixed"),
    ],
)
def test_reference_refuses(shortest, arguments, error, message):
    with pytest.raises(error, match=message):
        Reference(**{"name": "p", "problem": shortest} | arguments)


def test_catalogue_names_and_describes_every_file():
    known = catalogue()
    assert "brachistochrone" in known
    assert all(line and "\n" not in line for line in known.values())


def test_catalogue_runs_no_problem_file():
    code = (
        "import sys, varcalc.study.reference as r; r.catalogue(); "
        "print([m for m in sys.modules if m.startswith('varcalc.problems.')])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("name", sorted(catalogue()))
def test_the_names_of_a_file_lead_back_to_it(name):
    references = load(name)
    assert references[0].name == name
    for reference in references:
        assert reference.name.partition("/")[0] == name
        assert reference.source
        assert reference.statement
    for reference in references[1:]:
        assert load(reference.name) == (reference,)


def test_own_file_with_a_problem_only(write):
    (reference,) = load(write(SHORTEST))
    assert reference.name == "mine"
    assert reference.exact is None
    assert reference.problem.n == 1


@pytest.mark.parametrize("exact", ["5", "vc.Exact(5, lambda x: 4 * x / 3)"])
def test_own_file_with_a_closed_form(write, exact):
    (reference,) = load(write(f"'''The shortest path.'''\n{SHORTEST}exact = {exact}\n"))
    assert reference.exact.value == 5.0
    assert reference.statement == "The shortest path."


def test_own_file_with_cases(write):
    path = write(CASES)
    assert [r.name for r in load(path)] == ["mine", "mine/steep"]
    assert [r.name for r in load(f"{path}/steep")] == ["mine/steep"]
    with pytest.raises(ProblemFileError, match=r"has no case 'flat'; it defines mine, mine/steep"):
        load(f"{path}/flat")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"mine.py defines neither `problem` nor `references`"),
        ("problem = 3", r"`problem` in .*mine.py must be a varcalc.Problem"),
        (SHORTEST + "exact = 'five'", r"`exact` in .*mine.py must be a number"),
        (SHORTEST + "exact = float('inf')", r"`exact` in .*mine.py must be .* finite"),
        (SHORTEST + "references = problem", r"`references` in .*mine.py must be a tuple"),
        (SHORTEST + "references = ()", r"`references` in .*mine.py must be a tuple of at least one"),
        (SHORTEST + "references = (problem,)", r"every entry must be a Reference"),
        (CASES.replace("mine/steep", "mine"), r"holds 'mine' twice"),
        ("problem =", r"mine.py, line 1 failed with SyntaxError"),
        ("import casadi\n\nproblem = vc.Problem()", r"mine.py, line 3 failed with NameError"),
        (SHORTEST.replace("Fixed(3, 4)", "Fixed(0, 4)"), r"mine.py, line 4 failed with ValueError: .*; mend the file"),
    ],
)
def test_own_file_that_cannot_be_used(write, text, message):
    with pytest.raises(ProblemFileError, match=message):
        load(write(text))


def test_a_reader_who_has_gone_is_no_fault_of_the_file(write):
    with pytest.raises(BrokenPipeError):
        load(write("raise BrokenPipeError\n"))


def test_a_file_or_name_that_does_not_exist(tmp_path):
    with pytest.raises(ProblemFileError, match=r"there is no file .*nowhere.py"):
        load(tmp_path / "nowhere.py")
    with pytest.raises(ProblemFileError, match=r"'nowhere' is no problem of the catalogue, which holds .*brachist"):
        load("nowhere")
    with pytest.raises(ProblemFileError, match=r"brachistochrone has no case 'brachistochrone/nowhere'"):
        load("brachistochrone/nowhere")
