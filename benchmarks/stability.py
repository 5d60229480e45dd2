"""How far each method can be trusted where answers cease to exist: the stability chart.

Five families of problems, each with a parameter that crosses the value at which
the answer changes, from every method's own starting curves and from random
ones, held against closed forms. What the stored records lack is measured; then
the shares of the outcomes are printed, and drawn.

Run: python benchmarks/stability.py [--starts N] [--workers N] [--fresh] [--draw]
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import click

from campaigns.families import FAMILIES
from campaigns.picture import stability_picture
from campaigns.records import Record, completed, read, tally
from campaigns.routes import PEER, ROUTES, peer_answer
from campaigns.truth import Outcome, judged

HERE = Path(__file__).parent
RECORDS = HERE / "records" / "stability.csv"
PAIRS = HERE / "records" / "random_pairs.csv"
PICTURE = HERE.parent / "docs" / "stability.png"
SEED = 1744
"""Of the random starting curves; the year of Euler's Methodus inveniendi."""
LIMIT = 30.0
"""Seconds of processor time after which a solve is too slow."""


def solved(task: Record) -> Record:
    """One solve, judged."""
    family, case, number = FAMILIES[task.family], int(task.case), int(task.start)
    value = family.grid[case]
    start = family.start([SEED, case, list(FAMILIES).index(task.family), number]) if number else None
    problem, truth = family.problem(value), family.truth(value)
    begun = time.process_time()
    if task.route == PEER:
        answer, minimises = peer_answer(problem, start), False
    else:
        route = ROUTES[task.route]
        (answer, _), minimises = route.answer(problem, start), route.minimises
    seconds = time.process_time() - begun
    outcome, error = judged(answer, truth, minimises)
    return task.of(outcome, answer, error, seconds)


def wanted(starts: int) -> list[Record]:
    """Every solve of the campaign: all routes at all parameters, from their own start and ``starts`` random ones."""
    names = [*ROUTES, PEER]
    return [
        Record(family, str(case), str(number), name)
        for family, members in FAMILIES.items()
        for case in range(len(members.grid))
        for number in range(starts + 1)
        for name in names
        if number == 0 or name == PEER or ROUTES[name].starts
    ]


@click.command()
@click.option("--starts", default=2, show_default=True, help="Random starting curves for each problem.")
@click.option("--workers", default=2, show_default=True, help="Processes that solve side by side.")
@click.option("--fresh", is_flag=True, help="Measure everything anew.")
@click.option("--draw", is_flag=True, help="Draw what the records hold, and measure nothing.")
def main(starts: int, workers: int, fresh: bool, draw: bool) -> None:
    """Measure what the records lack, print the outcomes and draw them; exit 1 when a wrong answer was called right."""
    if fresh and not draw:
        RECORDS.unlink(missing_ok=True)
    records = read(RECORDS) if draw else completed(RECORDS, wanted(starts), solved, seconds=LIMIT, workers=workers)
    print(tally(records, [*ROUTES, PEER], lambda record: record.route))
    stability_picture(FAMILIES, [*ROUTES, PEER], records, read(PAIRS)).savefig(PICTURE, dpi=100)
    sys.exit(any(r.outcome == Outcome.FALSE.name and r.route != PEER for r in records))


if __name__ == "__main__":
    main()
