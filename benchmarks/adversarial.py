"""Problems made to mislead, by every route: no wrong answer may be called right, and few may be refused.

Every family draws its problems at random, each with its least value from elsewhere: a closed form, quadrature, a root,
a dynamic programme with a finite-difference polish, or the eigenvalues of a matrix, and never the library's own solver.
Half of them are mirrored, shifted, stretched or asked for as a maximum of the opposite functional.

What an answer is worth (campaigns/least.py): a route that minimises, the ladder or Ritz, is wrong when its value is off
the least one by more than ten times what it claims (and a floor of round-off), unless it says that it is a local one;
and with any value where no curve attains the least. Collocation, Shooting and FirstIntegral answer with stationary
curves. They are wrong below the least value, where no curve can be, and anywhere else but on it where the least curve
is the only stationary one; otherwise another value is taken for another extremal. A refusal by the ladder or Ritz of
what has a minimum is one that should not be; indirect routes may say that they do not apply.

Run: python benchmarks/adversarial.py [--count N] [--workers N] [--family NAME] [--route NAME] [--fresh] [--draw]
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import click
import numpy as np

from campaigns.adversaries.catalogue import FAMILIES, adversary
from campaigns.least import judged_by_least
from campaigns.picture import adversarial_picture
from campaigns.records import Record, completed, read, tally
from campaigns.routes import ROUTES
from campaigns.truth import Outcome

HERE = Path(__file__).parent
RECORDS = HERE / "records" / "adversarial.csv"
PICTURE = HERE.parent / "docs" / "adversarial.png"
QUICK_FIRST = ("the ladder", "Ritz (Newton)", "Collocation", "FirstIntegral", "Ritz (IPOPT)", "Shooting")
BLOCK = 10
"""Problems of each family that are tried by every route before others are: what is interrupted is a fair sample."""
LIMIT = 30.0
"""Seconds of processor time after which a solve is too slow."""
TARGET = 0.02
"""The share of solvable problems that the ladder may refuse, or take too long for."""
LOST = (Outcome.MISSED, Outcome.MISREASONED, Outcome.SLOW)


def solved(task: Record) -> Record:
    """One solve, judged."""
    case, route = adversary(task.family, int(task.case)), ROUTES[task.route]
    begun = time.process_time()
    answer, solution = route.answer(case.problem, None)
    seconds = time.process_time() - begun
    seen = replace(answer, value=case.sign * answer.value)
    outcome, error = judged_by_least(seen, solution.local, case.least, route.minimises)
    return task.of(outcome, answer, error, seconds)


def wanted(count: int, families: Sequence[str], routes: Sequence[str]) -> list[Record]:
    """Every route on the first problems of every family, block by block, the quicker routes first."""
    blocks = [range(first, min(count, first + BLOCK)) for first in range(0, count, BLOCK)]
    return [
        Record(family, str(number), "0", route)
        for block in blocks for route in routes for family in families for number in block
    ]  # fmt: skip


def times(records: Sequence[Record], routes: Sequence[str]) -> str:
    """Shares of what a route refused or gave up wrongly, and its seconds per solve: median, nine of ten, most."""
    lines = [f"{'':<15}  refused wrongly  median s     90 %     most"]
    for route in routes:
        mine = [r for r in records if r.route == route and r.outcome != Outcome.INAPPLICABLE.name]
        due = [r for r in mine if r.outcome != Outcome.REFUSED.name]
        lost = sum(r.outcome in {kind.name for kind in LOST} for r in due) / max(1, len(due))
        seconds = [float(r.seconds) for r in mine] or [0.0]
        median, most, all_ = np.percentile(seconds, [50, 90, 100])
        lines.append(f"{route:<15}  {lost:>14.1%}   {median:>8.3f} {most:>8.3f} {all_:>8.3f}")
    return "\n".join(lines)


def faults(records: Sequence[Record]) -> str:
    """Every wrong answer called right, and the problem."""
    lines = []
    for record in (r for r in records if r.outcome == Outcome.FALSE.name):
        case = adversary(record.family, int(record.case))
        least = f"{case.sign * case.least.value:.12g}" + ("" if case.least.attained else " (not attained)")
        lines.append(
            f"{record.family} {record.case} by {record.route}: said {record.value}, claimed {record.claim}, is {least}"
        )
        lines.append(f"    {case.problem.integrand} {case.problem!r}")
    return "\n".join(lines)


@click.command()
@click.option("--count", default=100, show_default=True, help="Problems of each family.")
@click.option("--workers", default=2, show_default=True, help="Processes that solve side by side.")
@click.option("--family", "families", multiple=True, type=click.Choice(list(FAMILIES)), help="Only these families.")
@click.option("--route", "routes", multiple=True, type=click.Choice(list(ROUTES)), help="Only these routes.")
@click.option("--fresh", is_flag=True, help="Measure everything anew.")
@click.option("--draw", is_flag=True, help="Draw what the records hold, and measure nothing.")
def main(count: int, workers: int, families: tuple[str, ...], routes: tuple[str, ...], fresh: bool, draw: bool) -> None:
    """Measure what the records lack, print the outcomes and draw them; exit 1 when a wrong answer was called right."""
    chosen = [route for route in QUICK_FIRST if route in routes or not routes]
    names = list(families or FAMILIES)
    if fresh and not draw:
        RECORDS.unlink(missing_ok=True)
    stored = read(RECORDS)
    if draw:
        records = [record for record in stored if record.family in names and record.route in chosen]
    else:
        records = completed(RECORDS, wanted(count, names, chosen), solved, seconds=LIMIT, workers=workers, keep=True)
    shown = [route for route in ROUTES if route in chosen]
    print(tally(records, shown, lambda record: record.route))
    print(f"\n{times(records, shown)}\n(the ladder's target: {TARGET:.0%} refused wrongly)\n")
    print(tally(records, names, lambda record: record.family))
    print(faults(records))
    titles = {name: FAMILIES[name].title for name in names}
    adversarial_picture(titles, shown, records).savefig(PICTURE, dpi=100)
    sys.exit(any(record.outcome == Outcome.FALSE.name for record in records))


if __name__ == "__main__":
    main()
