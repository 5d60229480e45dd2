"""Many pages, made in several processes, and their index; what is finished stays, whatever becomes of the rest."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from pathlib import Path

from varcalc.report.page import Mark, Page, PageSection, Paragraph
from varcalc.report.problem_page import Depth, problem_page
from varcalc.report.rendering import Entry, index_html, page_html
from varcalc.report.scene_page import scene_page
from varcalc.report.subjects import Kind, Subject
from varcalc.report.system_page import system_page
from varcalc.report.words import about_sections, source_section
from varcalc.study.user_file import BROKEN
from varcalc.workers import Workers

INDEX = "index.html"
FAILED = "this page could not be made"
GRACE = 1.0
"""Seconds after an interrupt in which a page that is being written may still be finished."""
CRASHED = "the process that made it ended before it was done"
"""What is said where there is no exception: a crash below Python, or no more memory."""


def page_of(subject: Subject, depth: Depth = Depth.FULL) -> Page:
    """The page of a subject; where making it fails, a page that says how."""
    try:
        if subject.kind is Kind.PROBLEM:
            return problem_page(subject, depth)
        return scene_page(subject) if subject.kind is Kind.SCENE else system_page(subject)
    except BROKEN as error:
        reason = f"{type(error).__name__}: {error}"
        return _failure(subject, reason, "".join(traceback.format_exception(error)))


def _failure(subject: Subject, reason: str, details: str = "") -> Page:
    parts = [Paragraph(reason), *([Paragraph(details, verbatim=True)] if details else [])]
    sections = (*about_sections(subject), PageSection("What went wrong", tuple(parts)), source_section(subject))
    title = subject.line or subject.name
    return Page(subject.name, subject.kind.singular, title, FAILED, reason, Mark.BAD, sections)


def write_page(subject: Subject, folder: Path, depth: Depth = Depth.FULL) -> Entry:
    """Make the page of a subject and write it into a folder; what an index says of it. Raises OSError."""
    return _write(subject, folder, page_of(subject, depth))


def _write(subject: Subject, folder: Path, page: Page) -> Entry:
    path = folder / subject.file
    path.parent.mkdir(parents=True, exist_ok=True)
    up = "../" * subject.file.count("/")
    _replace(path, page_html(page, f"{up}{INDEX}"))
    return Entry.of(page, subject.file, subject.kind)


def _replace(path: Path, text: str) -> None:
    """Write a file at once: nobody ever finds half of it."""
    part = path.with_name(f"{path.name}.part")
    part.write_text(text, encoding="utf-8")
    part.replace(path)


def write_index(entries: Sequence[Entry], folder: Path, wanted: int) -> Path:
    """Write the index of some pages, in the order of their kinds and names; its path. Raises OSError."""
    order = list(Kind)
    known = sorted(entries, key=lambda entry: (order.index(entry.kind), entry.name))
    failed = sum(entry.mark is Mark.BAD for entry in known)
    missing = f", of {wanted} that were asked for" if len(known) < wanted else ""
    bad = f"; {failed} without an answer" if failed else ""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / INDEX
    plural = "s" if len(known) != 1 else ""
    _replace(
        path,
        index_html(known, "Variational problems, solved and verified", f"{len(known)} page{plural}{missing}{bad}."),
    )
    return path


def write_pages(subjects: Sequence[Subject], folder: Path, cores: int) -> Iterator[Entry]:
    """Write the pages of some subjects in ``cores`` processes; what an index says of each, as they are finished.

    A page that cannot be made says so itself. Raises OSError where a page cannot be written.
    """
    write = partial(write_page, folder=folder)
    waiting = list(subjects)
    while waiting:
        suspects: list[Subject] = []
        for subject, entry in _finished(waiting, write, cores):
            waiting.remove(subject)
            if entry is None:
                suspects.append(subject)
            else:
                yield entry
        # a process that dies takes those beside it along: which of them did it shows when each runs alone
        for suspect in suspects:
            alone = next((entry for _, entry in _finished([suspect], write, 1)), None) if len(suspects) > 1 else None
            yield alone or _write(suspect, folder, _failure(suspect, CRASHED))


def _finished(
    subjects: Sequence[Subject], write: Callable[[Subject], Entry], cores: int
) -> Iterator[tuple[Subject, Entry | None]]:
    """Subjects with their entries as they are finished; None for those that ran when a process died, and the end."""
    waiting, running = list(reversed(subjects)), dict[Future[Entry], Subject]()
    workers = Workers(cores)
    try:
        while waiting or running:
            while waiting and len(running) < cores:
                running[workers.submit(write, waiting[-1])] = waiting[-1]
                waiting.pop()
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            if any(isinstance(future.exception(), BrokenProcessPool) for future in done):
                yield from ((subject, None) for subject in running.values())
                return
            for future in done:
                yield running.pop(future), future.result()
    except KeyboardInterrupt:
        for future in wait(running, timeout=GRACE).done:  # written already, or all but
            yield running.pop(future), future.result()
        raise
    finally:
        # interrupted, maybe before a page that was begun could be noted: what is not finished is not waited for
        if running or waiting:
            workers.dismiss()
        workers.shutdown()
