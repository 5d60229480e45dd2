"""What a campaign stores: what was interrupted goes on, and starting curves are those of the seed."""

from dataclasses import replace

import pytest

from campaigns.families import FAMILIES
from campaigns.records import Record, completed, read, tally, write
from campaigns.truth import Outcome


def answered(record):
    return replace(record, outcome=Outcome.RIGHT.name, seconds="0.1")


def test_what_was_stored_is_not_computed_again(tmp_path):
    path = tmp_path / "records" / "some.csv"
    wanted = [Record("film", str(case), "0", "Ritz") for case in range(3)]
    done = replace(wanted[2], outcome=Outcome.MISSED.name)
    write(path, [done])
    with path.open("a") as file:
        file.write("film,1,0")  # the line at which it was interrupted
    records = completed(path, wanted, answered, seconds=5.0, workers=1)
    assert [record.outcome for record in records] == ["RIGHT", "RIGHT", "MISSED"]
    assert read(path) == records
    assert "wrong answer called right" in tally(records, ["Ritz"], lambda record: record.route)


@pytest.mark.parametrize("family", FAMILIES.values(), ids=list(FAMILIES))
def test_starting_curves_are_the_same_for_the_same_seed_and_meet_the_ends(family):
    one, same, other = (family.start([7, 0, seed]) for seed in (1, 1, 2))
    problem = family.problem(family.grid[0])
    x0, x1 = problem.span
    assert one(0.3 * x0 + 0.7 * x1) == same(0.3 * x0 + 0.7 * x1) != other(0.3 * x0 + 0.7 * x1)
    assert one(x0) == pytest.approx(problem.start.y, abs=1e-12)
    assert one(x1) == pytest.approx(problem.end.y, abs=1e-12)
