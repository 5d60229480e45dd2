"""A cheap but whole report, and a browser to read it in."""

import os
import shutil

import pytest

from varcalc.report import problem_page
from varcalc.report.gallery import write_index, write_page
from varcalc.report.problem_page import Depth
from varcalc.report.subjects import subjects_of

REPORTED = ("bratu", "soap_film/local", "parabola_of_safety", "kepler", "rutherford")
"""Of every kind one: with cases, only local, a scene with a receiver, a motion, and an examination."""
IN_FULL = "bratu"


def missing_browser():
    """Why there is no browser; nothing where there is one."""
    lacking = [name for name in ("chromium", "chromedriver") if shutil.which(name) is None]
    return f"{' and '.join(lacking)} not installed (Debian: chromium, chromium-driver)" if lacking else ""


@pytest.fixture(scope="package")
def folder(tmp_path_factory):
    """A report of REPORTED and of two files of a person's own, one of them broken; measured but briefly."""
    folder = tmp_path_factory.mktemp("report")
    own = folder / "files"
    own.mkdir()
    (own / "without_minimum.py").write_text(
        '"""A chain that is <too> short & its ends too far apart."""\n'
        "import casadi as ca\nimport varcalc as vc\n"
        "length = vc.Isoperimetric(lambda x, y, dy: ca.sqrt(1 + dy**2), 0.5)\n"
        "problem = vc.Problem(lambda x, y, dy: y * ca.sqrt(1 + dy**2), vc.Fixed(0, 1), vc.Fixed(1, 1), [length])\n"
    )
    (own / "broken.py").write_text(
        '"""An examination that divides by nothing."""\n'
        "from varcalc import mechanics\n"
        'experiment = mechanics.Examination("Broken", {"a quotient": lambda: 1 / 0})\n'
    )
    subjects = subjects_of([*REPORTED, *(str(own / name) for name in ("without_minimum.py", "broken.py"))])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(problem_page, "MEASURED", 2.0)  # something of each kind, on a busy machine too
        patch.setattr(problem_page, "TOLERANCES", (1e-6,))
        entries = [write_page(s, folder, Depth.FULL if s.name == IN_FULL else Depth.QUICK) for s in subjects]
    write_index(entries, folder, len(entries))
    return folder


@pytest.fixture(scope="package")
def written(request):
    """The folder named by --pages, or else the report of REPORTED."""
    named = request.config.getoption("--pages")
    return request.getfixturevalue("folder") if named is None else named.resolve(strict=True)


@pytest.fixture(scope="package")
def browser():
    """Chromium without a window; in CI its absence is a failure, elsewhere the reason of a skip."""
    if why := missing_browser():
        if os.environ.get("CI") == "true":
            pytest.fail(f"{why}; the checks of the pages need it")
        pytest.skip(why)
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium")
    for argument in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(shutil.which("chromedriver")))
    yield driver
    driver.quit()
