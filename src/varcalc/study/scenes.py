"""Scenes to look at: those of the catalogue, and a person's own files.

A scene file is an ordinary Python file that defines ``study``, a
:class:`varcalc.optics.Study`.
"""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

from varcalc.optics.results.study import Study
from varcalc.study.user_file import SUFFIX, ProblemFileError, catalogued, listed, run_file

SCENES_PACKAGE = "varcalc.problems.optics"
"""The package the scenes are installed as."""


def scene_catalogue() -> dict[str, str]:
    """The names of the scenes with the first line of each file's docstring; the files are read, not run."""
    return listed(SCENES_PACKAGE)


def load_study(path_or_name: str | Path) -> Study:
    """The study of a scene of the catalogue, by its name, or of a file of one's own, by its path.

    Raises :class:`varcalc.study.reference.ProblemFileError`, a ValueError, naming the file and the remedy.
    """
    text = str(path_or_name)
    if text.endswith(SUFFIX):
        return _study(run_file(Path(text), "`study`"), text)
    return _study(catalogued(SCENES_PACKAGE, text, text, "scene"), text)


def _study(module: ModuleType, where: str) -> Study:
    study = getattr(module, "study", None)
    if isinstance(study, Study):
        return study
    if study is not None:
        raise ProblemFileError(f"`study` in {where} must be a varcalc.optics.Study, not {study!r}")
    raise ProblemFileError(
        f"{where} defines no `study`; end it with study = optics.Study(scene, source, rays, optical_path)"
    )
