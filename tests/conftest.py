"""Options of the test suite, and one thread for the linear algebra of each worker."""

from __future__ import annotations

import gc
import os
from pathlib import Path

import pytest

# Set before NumPy is first imported: with a worker on every core, threads of the BLAS only wait for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")
# The workers' own: glibc hands large arrays back to the system as soon as they are freed, and has them zeroed again,
# page by page, when the next one is made. Kept, they save a fortieth of all processor time.
os.environ.setdefault("MALLOC_MMAP_THRESHOLD_", str(2**25))
os.environ.setdefault("MALLOC_TRIM_THRESHOLD_", str(2**32))
os.environ.setdefault("MALLOC_TOP_PAD_", str(2**26))


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--every-tolerance",
        action="store_true",
        help="hold the methods' claims against the closed forms at all five tolerances, not only at three of them",
    )
    parser.addoption(
        "--everything",
        action="store_true",
        help="meet every transformation of every reference by every method, not only by the ladder and a part by each, "
        "and every member of each class, those that tests/further_members.txt names as well; make all of the gallery",
    )
    parser.addoption(
        "--pages",
        type=Path,
        metavar="FOLDER",
        help="open every page of this folder in the browser, as `varcalc report --all -o FOLDER` has written it, not "
        "only a few",
    )


FURTHER_MEMBERS = Path(__file__).parent / "further_members.txt"
"""Names tests with parameters that take 0.3 s or more, each with a quicker one of the same function beside it."""
COLLECTED = pytest.StashKey[set[str]]()
"""The names of all tests of the files that were collected."""


def further_members() -> set[str]:
    """The names of tests that are left to ``--everything``."""
    return set(FURTHER_MEMBERS.read_text(encoding="utf-8").splitlines())


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """What takes longest is begun first: begun last, it would keep the other workers waiting.

    Further members of a class are left out where nobody asks for them by name or for everything.
    """
    items.sort(key=lambda item: item.get_closest_marker("longest") is None)
    config.stash[COLLECTED] = {item.nodeid for item in items}
    if config.getoption("--everything") or any("::" in argument for argument in config.args):
        return
    further = further_members()
    left_out = [item for item in items if item.nodeid in further]
    if left_out:
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if item.nodeid not in further]


@pytest.fixture
def left_to_everything(request: pytest.FixtureRequest) -> tuple[set[str], set[str]]:
    """The names of tests that are left out, of files that were collected, and of all tests of these."""
    collected = request.config.stash[COLLECTED]
    files = {name.split("::")[0] for name in collected}
    return {name for name in further_members() if name.split("::")[0] in files}, collected


def pytest_collection_finish() -> None:
    """Modules and thousands of tests live to the end: what collects garbage need not go through them time and again."""
    gc.collect()
    gc.freeze()
