"""What README.md and docs/ print is run: every Python block, in order, one namespace a page; what they list exists.

The pages are built as well, with warnings as errors, and read as they are shown; the build executes the notebooks.
Without ``--everything`` the gallery has a tenth of its pages: what they say is solved where it is tested.
"""

import csv
import html
import io
import re
import subprocess
import sys
import tomllib
import zipfile
from fractions import Fraction
from importlib.metadata import metadata
from pathlib import Path

import pytest

import varcalc as vc
from varcalc import mechanics, optics
from varcalc.report.gallery import FAILED
from varcalc.report.subjects import Kind, catalogued_subjects
from varcalc.study.reference import load

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
BUILT = DOCS / "_build" / "html"
PAGES = sorted(
    [ROOT / "README.md", *(page for page in DOCS.rglob("*.md") if not {"_build", "gallery"} & {*page.parts})]
)


def blocks(page, language):
    text = page.read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)


@pytest.mark.parametrize("page", [p for p in PAGES if blocks(p, "python")], ids=lambda page: page.stem)
def test_python_blocks_run(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    namespace = {}
    for block in blocks(page, "python"):
        exec(compile(block, page.name, "exec"), namespace)


def test_readme_claims_no_more_of_a_certificate_than_is_proved():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    lower, upper = (Fraction(end) for end in re.findall(r"[0-9.]{20,}", re.search(r"\| certificate \|.*", text)[0]))
    reference = load("brachistochrone")[0]
    assert lower < Fraction(str(reference.exact(digits=40))) < upper
    certificate = vc.certify(vc.solve(reference.problem))
    proved = [Fraction(end) for end in certificate.enclosure]
    assert upper - lower >= (proved[1] - proved[0]) / 2  # round-off is not the same on every machine


def test_the_size_of_the_wheel_is_what_is_said():
    said = float(re.search(r"([0-9.]+) MB as a wheel", (DOCS / "install.md").read_text(encoding="utf-8"))[1])
    # links are not followed: problems/, which the package holds by one, is counted once
    found = [path for folder in ("src/varcalc", "problems") for path in (ROOT / folder).rglob("*")]
    files = [path for path in found if path.suffix in {".py", ".typed"} or path.parent.name == "templates"]
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as wheel:
        for path in files:
            wheel.write(path, path.relative_to(ROOT))
    assert abs(len(packed.getvalue()) / 1e6 - said) < 0.15


def test_readme_has_two_commands_that_set_themselves_up():
    first, second = blocks(ROOT / "README.md", "bash")
    assert "varcalc run brachistochrone -o brachistochrone.png" in first
    assert "-m pytest" in second
    for block in (first, second):
        assert "-m venv .venv" in block
        assert "pip install" in block


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_to_files_lead_somewhere(page):
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\((?!https?:)([^)#]+)\)", text):
        assert (page.parent / target).exists(), f"{page.name} links to {target}"


def test_readme_links_hold_on_a_package_index():
    """Index pages show it without the repository."""
    about = metadata("varcalc")
    [home] = [url.split(", ")[1] for url in about.get_all("Project-URL") if url.startswith("Source")]
    targets = re.findall(r"\]\(([^)]*)\)", about["Description"])
    assert len(targets) > 10
    for target in targets:
        assert target.startswith("https://")
        if target.startswith(home):
            assert (ROOT / re.sub(r"^/(blob|raw)/main/", "", target.removeprefix(home)).split("#")[0]).exists()


def shown(page):
    """The text of a built page as a reader sees it, without what stands in code."""
    text = page.read_text(encoding="utf-8")
    [article] = re.findall(r'<article role="main"[^>]*>(.*?)</article>', text, re.DOTALL)
    article = re.sub(r"<(pre|code|script|style)\b.*?</\1>", " ", article, flags=re.DOTALL)
    article = re.sub(r'<(span|div) class="math.*?</\1>', " ", article, flags=re.DOTALL)
    return html.unescape(re.sub(r"<[^>]+>", "", article))


FAULTS = {
    "a role or directive that was not understood": r":\w+:`|^\s*\.\. \w+::",
    "marks of literals": r"``|(?<!\w)`[^`\n]+`",
    "marks of emphasis": r"\*\*\w|\w\*\*(?!\s*\d)",
    "an example that is not one": r">>> ",
    "a link that leads nowhere": r"\]\(\S+\)|\{(?:doc|ref|class|func|py:\w+)\}",
    "a section that was not read as one": r"^-{4,}$|^(?:Parameters|Returns|Raises|Notes)\s*\n\s*-{3,}",
}


def misread_fields(page):
    """Parameters that are no names: prose that was taken for a field list."""
    text = page.read_text(encoding="utf-8")
    names = []
    for listed in re.findall(r'<dt class="field-[^>]*>Parameters.*?</dt>\s*<dd[^>]*>(.*?)</dd>', text, re.DOTALL):
        for entry in re.findall(r"<(?:li|dd[^>]*)>\s*<p>(.*?)</p>", listed, re.DOTALL) or [listed]:
            names += re.findall(r"^\s*(?:<p>)?<strong>(.*?)</strong>\s*\((.*?)\)", entry, re.DOTALL)
    signs = {name for text in re.findall(r'<em class="sig-param">(.*?)</em>', text, re.DOTALL)
             for name in re.findall(r'<span class="n"><span class="pre">(\w+)', text)}  # fmt: skip
    return [
        (name, kind) for name, kind in names
        if not set(re.findall(r"\w+", re.sub(r"<[^>]+>", "", name))) <= signs or "Raises" in kind or "naming" in kind
    ]  # fmt: skip


GALLERY_PART = 10
"""Without ``--everything`` one page in so many of the gallery is made."""
EMPTY_BOX = "<pre><span></span>\n</pre>"
"""What a bar that was taken away used to leave under a cell of a notebook."""


@pytest.mark.longest
def test_pages_are_built_and_read_as_they_were_written(pytestconfig):
    every = 1 if pytestconfig.getoption("--everything") else GALLERY_PART
    command = [
        sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-b", "html", "-D", f"gallery_every={every}",
        str(DOCS), str(BUILT),
    ]  # fmt: skip
    built = subprocess.run(command, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    gallery = [BUILT / "gallery" / subject.file for subject in catalogued_subjects()[::every]]
    assert {page.parent.name for page in gallery} == {kind.value for kind in Kind}
    assert [page.name for page in gallery if FAILED in page.read_text(encoding="utf-8")] == []
    written = [BUILT / page.relative_to(DOCS).with_suffix(".html") for page in PAGES if page.is_relative_to(DOCS)]
    assert [page.name for page in written if EMPTY_BOX in page.read_text(encoding="utf-8")] == []
    faults = [
        f"{page.name}: {fault}: {found.group()!r}"
        for page in written
        for fault, pattern in FAULTS.items()
        for found in re.finditer(pattern, shown(page), re.MULTILINE)
    ]
    assert faults == []
    assert misread_fields(BUILT / "api.html") == []
    signatures = re.findall(r'<em class="sig-param">(.*?)</em>', (BUILT / "api.html").read_text("utf-8"), re.DOTALL)
    assert len(signatures) > 500
    assert [text for text in signatures if re.search(r"&lt;|~|> at 0x", re.sub(r"<[^>]+>", "", text))] == []


@pytest.mark.parametrize(
    "text", ["Raises :class:`X`", "a ``name``", "**bold", "[page](page.md)", "Returns\n-------", ">>> 1"]
)
def test_faults_of_shown_text_are_seen(text):
    assert any(re.search(pattern, text, re.MULTILINE) for pattern in FAULTS.values())


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
