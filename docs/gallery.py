"""The gallery of the documentation: a page for everything in ``problems/``, written when Sphinx begins to build.

The pages are those of ``varcalc report`` without what takes long: other cases are named and not solved, and nothing
is measured. A page is made anew where its file, or the package, has changed since the last time.

``-D gallery_every=10`` makes every tenth page only: enough to see that such pages are read as they were written.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING

import varcalc as vc
from varcalc.report.gallery import page_of
from varcalc.report.problem_page import Depth
from varcalc.report.rendering import DarkTheme, Entry, colours, script, sections_html, style, tile_html
from varcalc.report.subjects import Kind, Subject, catalogued_subjects

if TYPE_CHECKING:
    from sphinx.application import Sphinx

FOLDER = "gallery"
THEMES = (
    DarkTheme("@media all", 'body[data-theme="dark"] .vc'),
    DarkTheme("@media (prefers-color-scheme: dark)", 'body:not([data-theme="light"]) .vc'),
)
"""Where furo is dark: when the reader chose so, and when the system is and the reader chose nothing."""
APART = "---\norphan: true\n---\n\n"
"""A page that the tiles lead to, not the navigation: with a hundred entries more the menu of every page takes longer
to write than the page, and to read."""
MARKS = re.compile(r"([\\`*_{}\[\]<>()#+!|$^~-])")
"""What means something in MyST."""


def setup(app: Sphinx) -> None:
    """What Sphinx calls."""
    app.add_config_value("gallery_every", 1, "env", int)
    _write_assets(Path(app.srcdir) / FOLDER / "static")  # Sphinx looks for them before it begins to build
    app.connect("builder-inited", write)


def write(app: Sphinx) -> None:
    """Write ``gallery/`` beside the other pages."""
    folder = Path(app.srcdir) / FOLDER
    folder.mkdir(exist_ok=True)
    state = folder / ".state.json"
    known = json.loads(state.read_text(encoding="utf-8")) if state.exists() else {}
    # what Python compiles of them comes and goes
    files = (path for path in sorted(Path(vc.__path__[0]).rglob("*.*")) if path.parent.name != "__pycache__")
    package = _digest(path.read_bytes() for path in files if path.is_file())
    subjects = catalogued_subjects()[:: app.config.gallery_every]
    digests = {s: _digest([package.encode(), s.source.encode()]) for s in subjects}
    stale = [
        s for s, digest in digests.items() if known.get(s.file, [""])[0] != digest or not _place(folder, s).exists()
    ]
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        for subject, (text, tile) in zip(stale, pool.map(written, stale), strict=True):
            place = _place(folder, subject)
            place.parent.mkdir(exist_ok=True)
            place.write_text(text, encoding="utf-8")
            known[subject.file] = [digests[subject], tile]
    (folder / "index.md").write_text(_index({s: known[s.file][1] for s in digests}), encoding="utf-8")
    state.write_text(json.dumps(known), encoding="utf-8")  # of pages that this build leaves out as well


def written(subject: Subject) -> tuple[str, str]:
    """The page of one subject as MyST, and its tile."""
    page = page_of(subject, Depth.QUICK)
    answer = f"**{_plain(page.answer)}** ({_plain(page.known)})"
    inner = _raw(f"<style>{colours(page.pictures, THEMES)}</style>\n{sections_html(page.sections)}")
    text = f"{APART}# {_plain(page.title)}\n\n[Gallery](../index.md)\n\n{answer}\n\n{inner}"
    return text, tile_html(Entry.of(page, subject.file, subject.kind))


def _index(tiles: dict[Subject, str]) -> str:
    """The first page of the gallery."""
    said = (
        "# Gallery\n\nEvery problem, scene and system that comes with the package: the question, the answer by every "
        "route, the picture, the evidence. `varcalc report --all` writes these pages with their other cases and "
        "measurements.\n"
    )
    parts = [said]
    for kind in Kind:
        chosen = "".join(tile for subject, tile in tiles.items() if subject.kind is kind)
        tiled = f'<div class="vc"><ul class="gallery">{chosen}</ul></div>'
        parts.append(f"## {kind.plural}\n\n{_raw(tiled)}")
    return "\n".join(parts)


def _raw(text: str) -> str:
    """HTML within MyST; the fence is longer than any within."""
    return f"``````{{raw}} html\n{text}\n``````\n"


def _plain(text: str) -> str:
    """Words that mean nothing to MyST."""
    return MARKS.sub(r"\\\1", text)


def _place(folder: Path, subject: Subject) -> Path:
    return folder / Path(subject.file).with_suffix(".md")


def _digest(parts: Iterable[bytes]) -> str:
    digest = hashlib.sha256()
    for part in parts:
        digest.update(part)
    return digest.hexdigest()


def _write_assets(static: Path) -> None:
    """The style sheet and the script of the pages, as files that Sphinx adds to every page."""
    static.mkdir(parents=True, exist_ok=True)
    transparent = ".vc { background: transparent; }"
    (static / "report.css").write_text(f"{style(THEMES)}\n{transparent}\n", encoding="utf-8")
    (static / "report.js").write_text(script(), encoding="utf-8")
