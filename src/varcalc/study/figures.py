"""Figures of the literature drawn anew: those of the catalogue, by their numbers, and a person's own files.

A figure file is an ordinary Python file that defines ``figure``, a :class:`varcalc.study.drawing.Drawing`.
"""

from __future__ import annotations

from pathlib import Path

from varcalc.spelling import near
from varcalc.study.drawing import Drawing
from varcalc.study.user_file import SUFFIX, ProblemFileError, defined, listed, names_in

FIGURES_PACKAGE = "varcalc.problems.figures"
"""The package the figures are installed as."""
PREFIX = "figure_"


def figure_catalogue() -> dict[str, str]:
    """The numbers of the figures, ascending, with the first line of each file's docstring; the files are not run."""
    found = {name.removeprefix(PREFIX).replace("_", "."): line for name, line in listed(FIGURES_PACKAGE).items()}
    return dict(sorted(found.items(), key=lambda pair: [int(part) for part in pair[0].split(".")]))


def load_figure(path_or_number: str | Path) -> Drawing:
    """The figure of the catalogue, by its number, or of a file of one's own, by its path.

    Raises :class:`varcalc.study.user_file.ProblemFileError`, a ValueError, naming the file and the remedy.
    """
    text = str(path_or_number)
    name = text if text.endswith(SUFFIX) else PREFIX + text.replace(".", "_")
    if not text.endswith(SUFFIX) and name not in names_in(FIGURES_PACKAGE):
        remedy = near(text, figure_catalogue()) or "; `varcalc list --figures` names them"
        raise ProblemFileError(f"{text!r} is no figure of the catalogue{remedy}")
    return defined(
        FIGURES_PACKAGE, name, "figure", "figure", Drawing, "varcalc.study.drawing.Drawing",
        "figure = Drawing(title, panels)",
    )  # fmt: skip
