"""What a file says of itself: its docstring as paragraphs, its source, and its text."""

from __future__ import annotations

from varcalc.report.page import Folded, PageSection, Paragraph
from varcalc.report.subjects import Subject

SOURCE = "Source:"


def capital(sentence: str) -> str:
    """With a capital at its beginning; the rest as it is."""
    return sentence[:1].upper() + sentence[1:]


def about_sections(subject: Subject) -> tuple[PageSection, ...]:
    """The paragraphs of the docstring but its first line, if any; indented ones are displayed as they stand."""
    parts = []
    for number, paragraph in enumerate(subject.paragraphs):
        text = paragraph.partition("\n")[2] if not number else paragraph
        if text.strip():
            indented = all(line.startswith("    ") for line in text.splitlines() if line.strip())
            parts.append(Paragraph(text if indented else " ".join(text.split()), verbatim=indented))
    return (PageSection("What it is", tuple(parts)),) if parts else ()


def source_section(subject: Subject) -> PageSection:
    """The file itself."""
    shown = Folded(f"The file {subject.path.name}", (Paragraph(subject.source, verbatim=True),))
    return PageSection("How it is declared", (shown,))
