"""Scenes to look at: those of the catalogue, and a person's own files.

A scene file is an ordinary Python file that defines ``study``, a
:class:`varcalc.optics.Study`.
"""

from __future__ import annotations

import importlib
import pkgutil
from pathlib import Path
from types import ModuleType

from varcalc.optics.results.study import Study
from varcalc.study.user_file import SUFFIX, ProblemFileError, first_line, run_file

SCENES_PACKAGE = "varcalc.problems.optics"
"""The package the scenes are installed as."""


def scene_catalogue() -> dict[str, str]:
    """The names of the scenes with the first line of each file's docstring; the files are read, not run."""
    package = importlib.import_module(SCENES_PACKAGE)
    return {
        module.name: first_line(f"{SCENES_PACKAGE}.{module.name}")
        for module in pkgutil.iter_modules(package.__path__)
        if not module.name.startswith("_")
    }


def load_study(path_or_name: str | Path) -> Study:
    """The study of a scene of the catalogue, by its name, or of a file of one's own, by its path.

    Raises :class:`varcalc.study.reference.ProblemFileError`, a ValueError, naming the file and the remedy.
    """
    text = str(path_or_name)
    if text.endswith(SUFFIX):
        return _study(run_file(Path(text), "`study`"), text)
    known = scene_catalogue()
    if text not in known:
        raise ProblemFileError(
            f"{text!r} is no scene of the catalogue, which holds {', '.join(known) or 'none'}; "
            f"a file of your own is given by its path, ending in {SUFFIX}"
        )
    return _study(importlib.import_module(f"{SCENES_PACKAGE}.{text}"), text)


def _study(module: ModuleType, where: str) -> Study:
    study = getattr(module, "study", None)
    if isinstance(study, Study):
        return study
    if study is not None:
        raise ProblemFileError(f"`study` in {where} must be a varcalc.optics.Study, not {study!r}")
    raise ProblemFileError(
        f"{where} defines no `study`; end it with study = optics.Study(scene, source, rays, optical_path)"
    )
