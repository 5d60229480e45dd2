"""Pages as HTML: templates, one style sheet for light and dark, and the script that sorts tables; all in the page."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import version
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from varcalc.report.formulas import mathml
from varcalc.report.page import Cell, Mark, Page, PageSection, Picture, number_cell, table
from varcalc.report.subjects import Kind

if TYPE_CHECKING:
    from jinja2 import Environment


@dataclass(frozen=True)
class DarkTheme:
    """Where pages are dark: a rule for the ``media``, and the selector of what lies ``within``."""

    media: str
    within: str


READERS = DarkTheme("@media (prefers-color-scheme: dark)", ".vc")
"""As the reader's system says."""


@dataclass(frozen=True)
class Entry:
    """What an index says of a page, which lies at ``file``."""

    file: str
    kind: Kind
    name: str
    title: str
    answer: str
    known: str
    mark: Mark
    sketch: str
    value: float | None
    error: float | None
    seconds: float

    @classmethod
    def of(cls, page: Page, file: str, kind: Kind) -> Entry:
        """That of a page."""
        return cls(
            file, kind, page.name, page.title, page.answer, page.known, page.mark, page.sketch, page.value, page.error,
            page.seconds,
        )  # fmt: skip


def page_html(page: Page, index: str) -> str:
    """A page as one self-contained HTML document; ``index`` is where the index lies, seen from it."""
    return _written("page.html", f"{page.title} - varcalc", page.pictures, page=page, index=index)


def index_html(entries: Sequence[Entry], title: str, summary: str) -> str:
    """The gallery of pages, and all of them in one table."""
    kinds = [kind for kind in Kind if any(entry.kind is kind for entry in entries)]
    groups = [(kind.plural, kind.value, [e for e in entries if e.kind is kind]) for kind in kinds]
    columns = (
        ("name", False), ("what", False), ("value", True), ("error", True), ("stands", False), ("processor s", True),
    )  # fmt: skip
    rows = [
        (
            Cell(e.name, href=e.file), Cell(e.kind.singular), number_cell(e.value, ".12g"),
            number_cell(e.error, ".1e"), Cell(e.mark.value), number_cell(e.seconds, ".2f"),
        )
        for e in entries
    ]  # fmt: skip
    glance = table(
        "Errors are claimed ones of problems and scenes, the largest delivered ones of systems", columns, rows
    )
    return _written("index.html", title, (), groups=groups, glance=glance, summary=summary)


def sections_html(sections: Iterable[PageSection]) -> str:
    """Sections alone, for a page of something else: with :func:`style` and :func:`script` there."""
    macro: Any = _environment().get_template("parts.html").module
    return f'<div class="vc">{"".join(str(macro.section(one)) for one in sections)}</div>'


def tile_html(entry: Entry) -> str:
    """The tile of a page in a gallery, an element of a list of the class ``gallery``."""
    macro: Any = _environment().get_template("parts.html").module
    return str(macro.tile(entry))


def style(themes: Sequence[DarkTheme] = (READERS,)) -> str:
    """The style sheet of pages; ``themes`` say where it is dark."""
    dark = _asset("dark.css")
    inverted = "filter: invert(1); mix-blend-mode: screen;"  # a picture of greys
    rules = [f"{t.media} {{ {t.within} {{ {dark} }} {t.within} image.greys {{ {inverted} }} }}" for t in themes]
    return "\n".join([_asset("style.css"), *rules])


def colours(pictures: Iterable[Picture], themes: Sequence[DarkTheme] = (READERS,)) -> str:
    """The variables that the pictures' colours are, in the light and in the dark."""
    found = sorted({colour for one in pictures for colour in one.colours})
    light, dark = (" ".join(f"{colour[0]}: {colour[k]};" for colour in found) for k in (1, 2))
    rules = [f"{theme.media} {{ {theme.within} {{ {dark} }} }}" for theme in themes]
    return "\n".join([f".vc {{ {light} }}", *rules]) if found else ""


def script() -> str:
    """The script that sorts tables."""
    return _asset("sort.js")


def _written(template: str, title: str, pictures: Iterable[Picture], **parts: Any) -> str:
    return (
        _environment()
        .get_template(template)
        .render(
            title=title, css=style(), colours=colours(pictures), script=script(), version=version("varcalc"),
            date=f"{datetime.now(UTC):%Y-%m-%d}", **parts,
        )
    )  # fmt: skip


@cache
def _asset(name: str) -> str:
    return (files("varcalc.report") / "templates" / name).read_text(encoding="utf-8")


@cache
def _environment() -> Environment:
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from markupsafe import Markup

    environment = Environment(
        loader=PackageLoader("varcalc.report"), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    environment.filters["mathml"] = lambda latex: Markup(mathml(latex))
    return environment
