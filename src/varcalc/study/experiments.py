"""Experiments of mechanics to look at: those of the catalogue, and a person's own files.

An experiment file is an ordinary Python file that defines ``experiment``, a
:class:`varcalc.mechanics.Experiment`, or a :class:`varcalc.mechanics.Examination` of what is no motion.
"""

from __future__ import annotations

from pathlib import Path

from varcalc.mechanics.examination import Examination
from varcalc.mechanics.experiment import Experiment
from varcalc.study.user_file import defined, listed

EXPERIMENTS_PACKAGE = "varcalc.problems.mechanics"
"""The package the experiments are installed as."""


def experiment_catalogue() -> dict[str, str]:
    """The names of the experiments with the first line of each file's docstring; the files are read, not run."""
    return listed(EXPERIMENTS_PACKAGE)


def load_experiment(path_or_name: str | Path) -> Experiment | Examination:
    """The experiment of the catalogue, by its name, or of a file of one's own, by its path.

    Raises :class:`varcalc.study.reference.ProblemFileError`, a ValueError, naming the file and the remedy.
    """
    example = "experiment = mechanics.Experiment(system, q0, v0, span)"
    return defined(
        EXPERIMENTS_PACKAGE,
        path_or_name,
        "experiment",
        "experiment",
        (Experiment, Examination),
        "mechanics.Experiment or mechanics.Examination",
        example,
    )
