"""What a file says of itself: its docstring as paragraphs, its source, and its text."""

from __future__ import annotations

from varcalc.report.page import Folded, Section, Text
from varcalc.report.subjects import Subject

SOURCE = "Source:"


def capital(sentence: str) -> str:
    """With a capital at its beginning; the rest as it is."""
    return sentence[:1].upper() + sentence[1:]


def about_section(subject: Subject) -> Section:
    """The paragraphs of the docstring but its first line; indented ones are displayed as they stand."""
    parts = []
    for number, paragraph in enumerate(subject.paragraphs):
        text = paragraph.partition("\n")[2] if not number else paragraph
        if text.strip():
            indented = all(line.startswith("    ") for line in text.splitlines() if line.strip())
            parts.append(Text(text if indented else " ".join(text.split()), verbatim=indented))
    return Section("What it is", tuple(parts))


def source_section(subject: Subject) -> Section:
    """The file itself."""
    shown = Folded(f"The file {subject.path.name}", (Text(subject.source, verbatim=True),))
    return Section("How it is declared", (shown,))
