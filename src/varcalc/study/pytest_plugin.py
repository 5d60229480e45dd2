"""A fixture of pytest: ``varcalc_problem``, each reference problem in turn, for the tests of somebody's own solver.

It is taken by ``pytest_plugins = ["varcalc.study.pytest_plugin"]`` in the ``conftest.py`` at the root of the tests, and
not by itself, so that no other session of pytest has to import varcalc.
"""

from __future__ import annotations

import pytest

from varcalc.study.plain import PlainProblem
from varcalc.study.reference import catalogue, load
from varcalc.study.verify_solver import Outcome, Solver, SolverRow, check_solver, judged

FIXTURE = "varcalc_problem"


class GivenProblem(PlainProblem):
    """A reference problem in a test: its statement, the closed form, and what a solver is held to."""

    def __init__(self, name: str) -> None:
        self.reference = next(reference for reference in load(name) if reference.name == name)
        super().__init__(self.reference)

    def check(self, solver: Solver, *, tolerance: float = 1e-6) -> SolverRow:
        """Fail the test unless the solver is right, and skip it where it says that it has no answer.

        Raises TypeError for what is no function of one problem.
        """
        check_solver(solver)
        row = judged(solver, self.reference, tolerance)
        if row.outcome is Outcome.REFUSED:
            pytest.skip(row.message or "refused")
        if row.outcome is not Outcome.RIGHT:
            pytest.fail(f"{self.name}: {row.outcome.value}: {row.value!r}, off by {row.value_error:.2g}", pytrace=False)
        return row


def pytest_addoption(parser: pytest.Parser) -> None:
    """The option that chooses problems by their names."""
    help_ = "reference problems that varcalc_problem stands for, their names separated by commas; all without it"
    parser.addoption("--varcalc-problems", default="", help=help_)


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Run a test that takes the fixture once for each case of each problem."""
    if FIXTURE in metafunc.fixturenames:
        chosen = metafunc.config.getoption("--varcalc-problems")
        names = chosen.split(",") if chosen else catalogue()
        cases = [reference.name for name in names for reference in load(name) if reference.exact is not None]
        metafunc.parametrize(FIXTURE, cases, indirect=True)


@pytest.fixture
def varcalc_problem(request: pytest.FixtureRequest) -> GivenProblem:
    """A reference problem with a closed form, as :class:`varcalc.study.plain.PlainProblem` states it."""
    return GivenProblem(request.param)
