"""``varcalc report``: pages to read, and their index."""

from __future__ import annotations

import os
import sys
from contextlib import redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING

import click

from varcalc_command import EXIT_AFTER_INTERRUPT

if TYPE_CHECKING:
    from collections.abc import Sequence

    from varcalc.report.rendering import Entry
    from varcalc.report.subjects import Subject


@click.command()
@click.argument("names", nargs=-1, metavar="[PROBLEM]...")
@click.option("--all", "everything", is_flag=True, help="Report every problem, scene and system of the catalogues.")
@click.option(
    "-o", "--output", type=click.Path(file_okay=False, path_type=Path), default=Path("report"), show_default=True,
    help="The folder to write the pages into.",
)  # fmt: skip
@click.option("--cores", type=click.IntRange(1), help="Processes to share the pages.  [default: one for each core]")
def report(names: tuple[str, ...], everything: bool, output: Path, cores: int | None) -> None:
    """Write a page of HTML about each PROBLEM, and an index of the pages.

    PROBLEM is a problem, a scene or a system of the catalogues (see `varcalc list`), one case of a problem such as
    brachistochrone/beyond, or a Python file of your own as `varcalc run`, `varcalc trace` or `varcalc move` take it.
    A page holds the question in formulas, the answer by every route, the verdict, the certificate, pictures,
    measurements, and what was not looked at. It needs nothing but itself to be read.

    The exit status is 0 when every page has an answer, 1 when not, 2 when there was nothing to report, 130 when
    interrupted: the pages that were finished stay, with an index.
    """
    subjects = _subjects(names, everything)
    entries: list[Entry] = []
    interrupted = False
    try:
        _written(subjects, output, cores or _cores(), entries)
    except KeyboardInterrupt:
        interrupted = True
    except OSError as error:
        raise click.ClickException(f"{error.filename or output} could not be written: {error.strerror}") from error
    from varcalc.report.gallery import FAILED, write_index
    from varcalc.report.page import Mark

    index = write_index(entries, output, len(subjects))
    bad = [entry for entry in entries if entry.mark is Mark.BAD]
    for entry in bad:
        click.echo(f"{entry.name}: {entry.answer}: {entry.known}", err=True)
    made = sum(entry.answer != FAILED for entry in entries)
    click.echo(f"{made} of {len(subjects)} pages: {index}")
    if interrupted:
        raise SystemExit(EXIT_AFTER_INTERRUPT)
    if bad:
        raise SystemExit(1)


def _subjects(names: tuple[str, ...], everything: bool) -> tuple[Subject, ...]:
    from varcalc.report.subjects import catalogued_subjects, subjects_of
    from varcalc.study.user_file import ProblemFileError

    if everything and names:
        raise click.UsageError("--all reports everything there is; leave it out, or the names")
    if not everything and not names:
        raise click.UsageError("name at least one problem, scene, system or file of your own, or give --all")
    try:
        with redirect_stdout(sys.stderr):  # what a person's own file prints
            return catalogued_subjects() if everything else subjects_of(names)
    except ProblemFileError as error:
        raise click.UsageError(str(error)) from error


def _cores() -> int:
    """Those that this process may use, where the system tells."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _written(subjects: Sequence[Subject], folder: Path, cores: int, entries: list[Entry]) -> None:
    """Write all pages and put what an index says of each into ``entries``, with a bar if somebody is watching."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    from varcalc.report.gallery import write_pages

    columns = (
        SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
    )  # fmt: skip
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task(subjects[0].name, total=len(subjects))
        for entry in write_pages(subjects, folder, min(cores, len(subjects))):
            entries.append(entry)
            progress.update(task, advance=1, description=entry.name)
