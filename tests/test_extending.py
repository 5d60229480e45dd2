"""What docs/extending.md adds from outside is found by the contract suite, the command line and the charts."""

import importlib.util
import json
import pickle
import re
import sys
from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import pytest
from click.testing import CliRunner

import varcalc as vc
from varcalc.cli import main
from varcalc.problem.conditions import AnyEnd
from varcalc.study.routes import methods_for, routes

ROOT = Path(__file__).parents[1]
BLOCKS = re.findall(
    r"^```python\n(.*?)^```$", (ROOT / "docs" / "extending.md").read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE
)


@pytest.fixture
def install(tmp_path, monkeypatch):
    """What a package's installation leaves: the page's module of that name, and the entry point in its metadata."""
    modules = []

    def installed(module, group, target):
        (source,) = (block for block in BLOCKS if block.startswith(f'"""{module}.py"""'))
        (tmp_path / f"{module}.py").write_text(source, encoding="utf-8")
        metadata = tmp_path / f"{module}-1.0.dist-info"
        metadata.mkdir()
        (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {module}\nVersion: 1.0\n", encoding="utf-8")
        (metadata / "entry_points.txt").write_text(f"[{group}]\n{module} = {module}:{target}\n", encoding="utf-8")
        monkeypatch.syspath_prepend(str(tmp_path))
        modules.append(module)

    yield installed
    for module in modules:
        sys.modules.pop(module, None)


@pytest.fixture
def straight(install):
    """The method of the page, installed as another package would be."""
    install("straight", "varcalc.methods", "route")


def contract_suite():
    path = ROOT / "tests" / "contract" / "test_methods.py"
    spec = importlib.util.spec_from_file_location("contract_with_another_method", path)
    suite = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(suite)
    return suite


def test_without_it_there_are_the_packages_own():
    assert [r.name for r in routes()] == ["Ritz", "Ritz(optimiser=Ipopt())", "Collocation", "Shooting", "FirstIntegral"]


@pytest.mark.usefixtures("straight")
def test_the_contract_suite_has_it_and_holds_it_to_the_closed_forms():
    suite = contract_suite()
    assert "Straight" in suite.ROUTES
    assert "Straight" in suite.DIRECT
    offered = [r for r in suite.REFERENCES.values() if suite.given(r, "Straight")]
    assert offered
    for reference in offered:
        for tol in suite.TOLERANCES:
            suite.check(reference, vc.solve(reference.problem, suite.METHODS["Straight"], tol=tol), "Straight", tol)


@pytest.mark.usefixtures("straight")
def test_comparisons_offer_it_where_it_applies():
    line = vc.Problem(lambda x, y, dy: dy**2, vc.Fixed(0, 0), vc.Fixed(1, 2))
    assert "Straight" in [type(m).__name__ for m in methods_for(line)]
    bent = vc.Problem(lambda x, y, dy: dy**2 + y**2, vc.Fixed(0, 0), vc.Fixed(1, 2))
    assert "Straight" not in [type(m).__name__ for m in methods_for(bent)]


@pytest.mark.usefixtures("straight")
def test_the_command_line_runs_and_draws_it(tmp_path):
    file, picture = tmp_path / "mine.py", tmp_path / "mine.png"
    text = "import varcalc as vc\nproblem = vc.Problem(lambda x, y, dy: dy**2, vc.Fixed(0, 0), vc.Fixed(1, 2))\n"
    file.write_text(text + "exact = vc.Exact(4.0, lambda x: 2 * x)\n", encoding="utf-8")
    done = CliRunner().invoke(main, ["run", str(file), "--json", "-o", str(picture)])
    assert done.exit_code == 0, done.output
    document = json.loads(done.stdout)
    assert document["agree"] is True
    (row,) = [row for row in document["rows"] if row["method"] == "Straight"]
    assert row["value"] == pytest.approx(4.0, rel=1e-15)
    assert picture.stat().st_size > 5000


@pytest.mark.usefixtures("straight")
def test_charts_have_a_place_for_it():
    from varcalc.charts import work_precision_picture

    line = vc.Problem(lambda x, y, dy: dy**2, vc.Fixed(0, 0), vc.Fixed(1, 2), name="line")
    methods = [m for m in methods_for(line) if type(m).__name__ in ("Ritz", "Straight")]
    measured = vc.work_precision([line], methods, [1e-6], exact=[4.0], repeats=1)
    names = [t.get_text() for t in work_precision_picture(measured.records).legends[0].get_texts()]
    assert "Straight" in names


def test_an_entry_point_of_something_else_is_refused(install):
    install("straight", "varcalc.methods", "Straight")
    with pytest.raises(TypeError, match=r"straight = straight:Straight of varcalc\.methods must name a Route"):
        routes()


@dataclass(frozen=True)
class OnCircle(AnyEnd):
    """An end of this file's own."""

    slides = True

    centre: tuple[float, float]
    radius: float
    x: float

    def phi(self, x, y):
        return (x - self.centre[0]) ** 2 + (y - self.centre[1]) ** 2 - self.radius**2


@pytest.mark.parametrize("name", ["Ritz", "Ritz(optimiser=Ipopt())", "Collocation", "Shooting", "FirstIntegral"])
def test_every_method_takes_an_end_from_outside(name):
    """The shortest way to a circle ends where the line to its centre meets it."""
    problem = vc.Problem(lambda x, y, dy: ca.sqrt(1 + dy**2), vc.Fixed(0, 0), OnCircle((3.0, 4.0), 1.0, x=2.0))
    (route,) = (r for r in routes() if r.name == name)
    for given in (problem, pickle.loads(pickle.dumps(problem))):
        solution = vc.solve(given, route.method)
        assert solution.status is vc.Status.SOLVED
        assert abs(solution.value - 4) <= solution.error.value + 1e-14
        assert solution.x[-1] == pytest.approx(3 - 3 / 5, abs=1e-8)


def parabola():
    """y = x (1 - x), whose slope goes from 1 to -1."""
    return vc.solve(vc.Problem(lambda x, y, dy: dy**2 / 2 - 2 * y, vc.Fixed(0, 0), vc.Fixed(1, 0)))


def test_a_check_of_another_package_is_run_and_its_finding_is_printed(install):
    before = vc.verify(parabola())
    assert "paraxial" not in before.evidence
    install("paraxial", "varcalc.checks", "check")
    after = vc.verify(parabola())
    (found,) = after.findings[len(before.findings) - 1 : -1]  # the last one is the verdict
    assert found.numbers["slope"] == pytest.approx(1, rel=0.02)
    assert after.evidence["paraxial"] == found.numbers["slope"]
    assert "beyond the 0.1 of the paraxial approximation" in found.sentence
    assert f"- {found.sentence}" in str(after).splitlines()
    assert after.verdict is before.verdict is vc.Verdict.MINIMUM


def test_a_check_of_another_package_may_decide(install, monkeypatch):
    install("paraxial", "varcalc.checks", "check")
    vc.verify(parabola())
    decides = vc.Finding(vc.Verdict.DEGENERATE, "the model does not hold")
    monkeypatch.setattr(sys.modules["paraxial"].Paraxial, "findings", lambda check, candidate: [decides])
    assert vc.verify(parabola()).verdict is vc.Verdict.DEGENERATE


def test_something_else_is_no_check(install):
    install("paraxial", "varcalc.checks", "Paraxial")
    with pytest.raises(TypeError, match=r"paraxial = paraxial:Paraxial of varcalc\.checks must name a Check"):
        vc.verify(parabola())
