"""What README.md and docs/ print is run: every Python block, in order, one namespace a page; what they list exists."""

import csv
import re
import tomllib
from pathlib import Path

import pytest

import varcalc as vc
from varcalc import mechanics, optics

ROOT = Path(__file__).parents[1]
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").glob("*.md")])


def blocks(page, language):
    text = page.read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)


@pytest.mark.parametrize("page", [p for p in PAGES if blocks(p, "python")], ids=lambda page: page.name)
def test_python_blocks_run(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    namespace = {}
    for block in blocks(page, "python"):
        exec(compile(block, page.name, "exec"), namespace)


def test_readme_has_two_commands_that_set_themselves_up():
    first, second = blocks(ROOT / "README.md", "bash")
    assert "varcalc run brachistochrone -o brachistochrone.png" in first
    assert "-m pytest" in second
    for block in (first, second):
        assert "-m venv .venv" in block
        assert "pip install" in block


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_to_files_lead_somewhere(page):
    for target in re.findall(r"\]\((?!https?:)([^)#]+)\)", page.read_text(encoding="utf-8")):
        assert (page.parent / target).exists(), f"{page.name} links to {target}"


@pytest.mark.parametrize("picture", ["brachistochrone.png", "stability.png", "chart.png"])
def test_readme_shows_the_pictures_its_commands_write(picture):
    assert f"](docs/{picture})" in (ROOT / "README.md").read_text(encoding="utf-8")
    assert (ROOT / "docs" / picture).stat().st_size < 350_000


def test_the_campaigns_called_no_wrong_answer_right():
    for campaign in ("stability", "random_pairs"):
        with (ROOT / "benchmarks" / "records" / f"{campaign}.csv").open(newline="", encoding="utf-8") as file:
            records = list(csv.DictReader(file))
        assert records
        false = {(r["family"], r["case"], r["route"]) for r in records if r["outcome"] == "FALSE"}
        assert not {place for place in false if place[2] != "SciPy solve_bvp alone"}


def test_reference_page_names_every_public_name():
    page = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    documented = set(re.findall(r"^\.\. auto(?:class|function|exception):: (\w+)$", page, re.MULTILINE))
    assert documented == set(vc.__all__)


def test_reference_page_names_every_public_name_of_optics():
    page = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    documented = set(
        re.findall(r"^\.\. auto(?:class|function|exception):: varcalc\.optics\.(\w+)$", page, re.MULTILINE)
    )
    listed = re.findall(r"automodule:: varcalc\.optics\.[\w.]+\n   :members: (.*)$", page, re.MULTILINE)
    assert documented | set(", ".join(listed).split(", ")) == set(optics.__all__)


def test_reference_page_names_every_public_name_of_mechanics():
    page = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    documented = re.findall(r"^\.\. auto(?:class|function):: varcalc\.mechanics\.(\w+)$", page, re.MULTILINE)
    assert set(documented) == set(mechanics.__all__)


@pytest.mark.parametrize(("page", "least"), [("architecture", 20), ("extending", 5)])
def test_every_step_that_is_told_is_a_file(page, least):
    text = (ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8")
    named = re.findall(r"`([\w/]+/\w+\.py)`", text)
    assert len(named) > least
    places = [ROOT / "src" / "varcalc", ROOT]
    assert [name for name in named if not any((place / name).is_file() for place in places)] == []


@pytest.mark.parametrize("page", ["README.md", "docs/architecture.md"])
def test_import_line_is_the_contract(page):
    tools = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]
    layers = [re.findall(r"\w+", layer) for layer in tools["importlinter"]["contracts"][0]["layers"]]
    package = ROOT / "src" / "varcalc"
    built = [[n for n in layer if (package / n).is_dir() or (package / f"{n}.py").exists()] for layer in layers]
    [line] = re.findall(r"^```\n(\w[\w| ]* -> [^`]*)```$", (ROOT / page).read_text(encoding="utf-8"), re.MULTILINE)
    assert [re.findall(r"\w+", place) for place in line.split("->")] == [layer for layer in reversed(built) if layer]
