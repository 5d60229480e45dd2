"""Records of a campaign: one line a solve, written as it is done, so that what is interrupted goes on from there."""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from campaigns.bounded import Failed, results
from campaigns.truth import Answer, Outcome

MESSAGE = 100
"""Characters of a message that are kept, of answers that are not simply right."""


@dataclass(frozen=True)
class Record:
    """One solve: of problem ``problem`` (its ``case``) from the random curve ``start`` (0: the route's own).

    Numbers are kept as text, as they stand in the file.
    """

    family: str
    case: str
    start: str
    route: str
    outcome: str = ""
    status: str = ""
    verdict: str = ""
    value: str = ""
    error: str = ""
    claim: str = ""
    seconds: str = ""
    message: str = ""

    @property
    def key(self) -> tuple[str, str, str, str]:
        """What tells a solve from all others."""
        return self.family, self.case, self.start, self.route

    def of(self, outcome: Outcome, answer: Answer, error: float, seconds: float) -> Record:
        """The record with what came of the solve."""
        message = "" if outcome is Outcome.RIGHT else " ".join(answer.message.split())[:MESSAGE]
        return replace(
            self, outcome=outcome.name, status=answer.status,
            verdict=answer.verdict.name if answer.verdict else "",
            value=f"{answer.value:.16g}" if answer.ok else "", error=f"{error:.1e}" if answer.ok else "",
            claim=f"{answer.claim:.1e}" if answer.ok else "", seconds=f"{seconds:.3f}", message=message,
        )  # fmt: skip


NAMES = [field.name for field in fields(Record)]


def read(path: Path) -> list[Record]:
    """The records of a file; none when there is no file. A line that was cut short by an interruption is left out."""
    if not path.exists():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        return [Record(**row) for row in csv.DictReader(file) if None not in row.values()]


def write(path: Path, records: Sequence[Record]) -> None:
    """Write records over whatever the file held."""
    path.parent.mkdir(exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.DictWriter(file, NAMES, lineterminator="\n")
        rows.writeheader()
        rows.writerows(vars(record) for record in records)


def completed(
    path: Path, wanted: Sequence[Record], solve: Callable[[Record], Record], *, seconds: float, workers: int,
    keep: bool = False,
) -> list[Record]:  # fmt: skip
    """The ``wanted`` records, those that the file lacks being computed by ``solve`` and stored one by one.

    A solve of more than ``seconds`` of processor time, or one that ends its process, is recorded as such. What the
    file holds besides is left out of it, unless it is to be kept, where only a part of a campaign is asked for.
    """
    known = {record.key: record for record in read(path)}
    asked = {task.key for task in wanted}
    others = [record for key, record in known.items() if keep and key not in asked]
    records = {task.key: known[task.key] for task in wanted if task.key in known}
    missing = [task for task in wanted if task.key not in records]
    write(path, [*others, *records.values()])
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with path.open("a", newline="", encoding="utf-8") as file, Progress(*columns, disable=not missing) as progress:
        rows = csv.DictWriter(file, NAMES, lineterminator="\n")
        shown = progress.add_task(path.stem, total=len(missing))
        for task, result in results(solve, missing, seconds, workers) if missing else ():
            record = _failed(task, result, seconds) if isinstance(result, Failed) else result
            rows.writerow(vars(record))
            file.flush()
            records[record.key] = record
            progress.advance(shown)
    ordered = [records[task.key] for task in wanted]
    write(path, [*others, *ordered])
    return ordered


def _failed(task: Record, why: Failed, seconds: float) -> Record:
    return replace(task, outcome=Outcome.SLOW.name, status=why.name, seconds=f"{seconds:.3f}", message=why.value)


def tally(records: Sequence[Record], names: Sequence[str], group: Callable[[Record], Any]) -> str:
    """A table of outcomes: one row for each of ``names`` that ``group`` gives, one column an outcome."""
    kinds = [kind for kind in Outcome if any(r.outcome == kind.name for r in records) or kind is Outcome.FALSE]
    width = max(map(len, names))
    lines = [" " * width + "  " + "  ".join(kind.value for kind in kinds)]
    for name in names:
        mine = [r.outcome for r in records if group(r) == name]
        lines.append(f"{name:<{width}}  " + "  ".join(f"{mine.count(k.name):>{len(k.value)}}" for k in kinds))
    return "\n".join(lines)
