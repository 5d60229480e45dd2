"""A thousand random problems, each with a random starting curve: no wrong answer may be called right.

Run: python benchmarks/random_pairs.py [--count N] [--workers N] [--fresh]
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import click

from campaigns.manufactured import draw, kind_of
from campaigns.records import Record, completed, tally
from campaigns.routes import ROUTES
from campaigns.truth import Outcome, judged
from campaigns.witness import witnessed

RECORDS = Path(__file__).parent / "records" / "random_pairs.csv"
SEED = 1696
"""The year of Johann Bernoulli's challenge."""
QUICK_FIRST = ("Ritz (Newton)", "Collocation", "FirstIntegral", "Ritz (IPOPT)", "the ladder", "Shooting")
BLOCK = 100
"""Pairs that are tried by every route before others are: what is interrupted is a fair sample of all."""
LIMIT = 30.0
"""Seconds of processor time after which a solve is too slow."""


def solved(task: Record) -> Record:
    """One solve, judged."""
    _, drawn = draw(SEED, int(task.case))
    route = ROUTES[task.route]
    begun = time.process_time()
    answer, solution = route.answer(drawn.problem, drawn.start)
    seconds = time.process_time() - begun
    if drawn.complete:
        outcome, error = judged(answer, drawn.truth, route.minimises)
    else:
        outcome, error = witnessed(answer, solution, drawn.truth, route.minimises, drawn.coercive)
    return task.of(outcome, answer, error, seconds)


def wanted(count: int) -> list[Record]:
    """Every route on every pair, block by block, the quicker routes first."""
    blocks = [range(first, min(count, first + BLOCK)) for first in range(0, count, BLOCK)]
    return [Record(kind_of(n), str(n), "1", route) for block in blocks for route in QUICK_FIRST for n in block]


@click.command()
@click.option("--count", default=1000, show_default=True, help="How many problems.")
@click.option("--workers", default=2, show_default=True, help="Processes that solve side by side.")
@click.option("--fresh", is_flag=True, help="Measure everything anew.")
def main(count: int, workers: int, fresh: bool) -> None:
    """Measure what the records lack and print the outcomes; exit 1 when a wrong answer was called right."""
    if fresh:
        RECORDS.unlink(missing_ok=True)
    records = completed(RECORDS, wanted(count), solved, seconds=LIMIT, workers=workers)
    print(tally(records, list(ROUTES), lambda record: record.route))
    print()
    print(tally(records, list(dict.fromkeys(r.family for r in records)), lambda record: record.family))
    sys.exit(any(record.outcome == Outcome.FALSE.name for record in records))


if __name__ == "__main__":
    main()
