"""The page of a system: its motion, held against what is known of it, or what was examined of it."""

from __future__ import annotations

import time
from collections.abc import Mapping

import numpy as np

from varcalc.charts import beside_picture, course_picture
from varcalc.mechanics.examination import Examined
from varcalc.mechanics.experiment import Moved
from varcalc.report.evidence import WELL, errors_table
from varcalc.report.page import (
    Cell,
    Fact,
    Facts,
    Listed,
    Mark,
    Page,
    PageSection,
    Pictures,
    Table,
    number_cell,
    table,
)
from varcalc.report.pictures import picture, sketch
from varcalc.report.question import asked_of_system
from varcalc.report.subjects import Subject
from varcalc.report.words import about_sections, capital, source_section
from varcalc.showing import counted
from varcalc.study.experiments import load_experiment

EVENTS = 12
"""That are listed; of more, only their number is."""


def system_page(subject: Subject) -> Page:
    """What is known of a system.

    Raises :class:`varcalc.study.user_file.ProblemFileError` for a file that cannot be used, ValueError for a motion
    that cannot be.
    """
    began = time.process_time()
    done = load_experiment(subject.given).run()
    moved = done if isinstance(done, Moved) else None
    sections = _sections(moved) if moved is not None else [_examined(done)] if isinstance(done, Examined) else []
    mark = Mark.BAD if not done.completed else Mark.GOOD if done.largest < WELL else Mark.DOUBTFUL
    return Page(
        subject.name, subject.kind.singular, done.title or subject.line, _answer(moved, done.errors),
        f"off by {done.largest:.1g} at the most from what is known of it", mark,
        (*about_sections(subject), *sections, source_section(subject)),
        "" if moved is None else _sketch(moved), None, done.largest, time.process_time() - began,
    )  # fmt: skip


def _answer(moved: Moved | None, errors: Mapping[str, float]) -> str:
    if moved is None:
        return f"{counted(len(errors), 'number')} held against what is known"
    first, last = moved.motion.span
    course = f"{', '.join(moved.names)} from t = {first:g} to {last:g}"
    return course if moved.completed else f"{course}: {moved.motion.outcome.value}"


def _sections(moved: Moved) -> list[PageSection]:
    motion, experiment = moved.motion, moved.experiment
    begun = ", ".join(f"{n} = {x:.9g}" for n, x in zip(moved.names, experiment.q0, strict=True))
    rates = ", ".join(f"{n}' = {x:.9g}" for n, x in zip(moved.names, experiment.v0, strict=True))
    asked = [*asked_of_system(experiment.system), Fact("From rest" if not any(experiment.v0) else "From", begun)]
    if any(experiment.v0):
        asked.append(Fact("With the rates", rates))
    facts = [
        Fact("Motion", f"{_answer(moved, {})}"), Fact("Outcome", capital(motion.outcome.value)),
        Fact("Steps", f"{motion.steps}"),
        Fact("Coordinates claimed to", f"{motion.error:.1g}"),
        *(Fact(f"Kept: {name}", f"to {drift:.1g}") for name, drift in motion.drift.items()),
    ]  # fmt: skip
    return [
        PageSection("The question", (Facts(tuple(asked)),)),
        PageSection("The answer", (Facts(tuple(facts)), _pictures(moved), *_events(moved))),
        PageSection("How well it is known", (errors_table(moved.errors),)),
        _unseen(moved),
    ]


def _examined(done: Examined) -> PageSection:
    return PageSection("How well it is known", (errors_table(done.errors),))


def _pictures(moved: Moved) -> Pictures:
    names = ", ".join(moved.names)
    beside = (
        "portrait" if len(moved.names) == 1 else "orbit" if moved.experiment.beside is None else "picture beside it"
    )
    drawn = (
        picture(course_picture(moved), f"The coordinates {names} over time.", f"{moved.title}: against time"),
        picture(beside_picture(moved), f"The {beside} of the motion.", f"{moved.title}: the {beside}"),
    )
    return Pictures(drawn)


def _events(moved: Moved) -> list[Table]:
    events = moved.motion.events
    if not events:
        return []
    rows = [(number_cell(e.t, ".12g"), Cell(e.name), Cell(np.array2string(e.q, precision=9))) for e in events[:EVENTS]]
    more = f", the first {EVENTS} of {len(events)}" if len(events) > EVENTS else ""
    return [table(f"Events{more}", (("t", True), ("event", False), ("coordinates", False)), rows)]


def _unseen(moved: Moved) -> PageSection:
    found = ["times after the end of the span, and other beginnings"]
    if moved.experiment.exact is None:
        found.append("no closed form is known of this motion: it was held against the checks above only")
    if not moved.motion.drift:
        found.append("no invariant is known that the motion must keep")
    return PageSection("What was not looked at", (Listed(tuple(map(capital, found))),))


def _sketch(moved: Moved) -> str:
    _, q, v = moved.drawn
    if len(q) == 1:
        return sketch([np.stack([q[0], v[0]])])
    return sketch([q[:2]])
