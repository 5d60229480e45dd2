"""Experiments of mechanics to look at: those of the catalogue, and a person's own files.

An experiment file is an ordinary Python file that defines ``experiment``, a
:class:`varcalc.mechanics.Experiment`.
"""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

from varcalc.mechanics.experiment import Experiment
from varcalc.study.user_file import SUFFIX, ProblemFileError, catalogued, listed, run_file

EXPERIMENTS_PACKAGE = "varcalc.problems.mechanics"
"""The package the experiments are installed as."""


def experiment_catalogue() -> dict[str, str]:
    """The names of the experiments with the first line of each file's docstring; the files are read, not run."""
    return listed(EXPERIMENTS_PACKAGE)


def load_experiment(path_or_name: str | Path) -> Experiment:
    """The experiment of the catalogue, by its name, or of a file of one's own, by its path.

    Raises :class:`varcalc.study.reference.ProblemFileError`, a ValueError, naming the file and the remedy.
    """
    text = str(path_or_name)
    if text.endswith(SUFFIX):
        return _experiment(run_file(Path(text), "`experiment`"), text)
    return _experiment(catalogued(EXPERIMENTS_PACKAGE, text, text, "experiment"), text)


def _experiment(module: ModuleType, where: str) -> Experiment:
    experiment = getattr(module, "experiment", None)
    if isinstance(experiment, Experiment):
        return experiment
    if experiment is not None:
        raise ProblemFileError(f"`experiment` in {where} must be a mechanics.Experiment, not {experiment!r}")
    raise ProblemFileError(
        f"{where} defines no `experiment`; end it with experiment = mechanics.Experiment(system, q0, v0, span)"
    )
