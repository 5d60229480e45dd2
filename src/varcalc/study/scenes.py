"""Scenes to look at: those of the catalogue, and a person's own files.

A scene file is an ordinary Python file that defines ``study``, a
:class:`varcalc.optics.Study`.
"""

from __future__ import annotations

from pathlib import Path

from varcalc.optics.results.study import Study
from varcalc.study.user_file import defined, listed

SCENES_PACKAGE = "varcalc.problems.optics"
"""The package the scenes are installed as."""


def scene_catalogue() -> dict[str, str]:
    """The names of the scenes with the first line of each file's docstring; the files are read, not run."""
    return listed(SCENES_PACKAGE)


def load_study(path_or_name: str | Path) -> Study:
    """The study of a scene of the catalogue, by its name, or of a file of one's own, by its path.

    Raises :class:`varcalc.study.reference.ProblemFileError`, a ValueError, naming the file and the remedy.
    """
    example = "study = optics.Study(scene, source, rays, optical_path)"
    return defined(SCENES_PACKAGE, path_or_name, "scene", "study", Study, "varcalc.optics.Study", example)
