"""Every reference problem's answer, verified: a minimum (a maximum) of index 0, by every route that is open."""

import pytest

import varcalc as vc
from varcalc.study.reference import catalogue, load

REFERENCES = {reference.name: reference for name in sorted(catalogue()) for reference in load(name)}


@pytest.mark.parametrize("name", REFERENCES)
def test_the_answer_is_what_solve_says(name):
    solution = vc.solve(REFERENCES[name].problem)
    check = vc.verify(solution)
    assert check.verdict is (vc.Verdict.MAXIMUM if solution.problem.maximise else vc.Verdict.MINIMUM)
    assert check.index == 0
    assert len(check.conjugate_points) == 0
    assert set(check.routes.values()) <= {0, None}
    assert check.bound == pytest.approx(solution.value, rel=1e-9, abs=1e-9)
