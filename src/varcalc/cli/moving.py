"""``varcalc move``: the motion of a mechanical system."""

from __future__ import annotations

import json
import sys
from contextlib import nullcontext, redirect_stdout
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from varcalc.cli.options import PICTURE_TEXT, JsonCommand, picture_option, save_figure

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure

    from varcalc.mechanics import Examined, Moved


@click.command(cls=JsonCommand)
@click.argument("name_or_file")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON document and nothing else.")
@picture_option("-o", "--output", text=PICTURE_TEXT)
def move(name_or_file: str, as_json: bool, output: Path | None) -> None:
    """Move a mechanical system, and hold the motion against what is known of it.

    NAME_OR_FILE is an experiment (see `varcalc list --systems`), or a Python file of your own that defines
    `experiment`, a varcalc.mechanics.Experiment (or an Examination, of what is no motion).

    The exit status is 0 when the motion came to its end, 1 when not, 2 when there was nothing to move: a wrong
    option, or a file that does not work.
    """
    with redirect_stdout(sys.stderr) if as_json else nullcontext():
        moved = _carried_out(name_or_file)
    figure = None if output is None else _drawing(moved, name_or_file)
    title = moved.title or name_or_file
    click.echo(json.dumps(moved.document(), indent=2) if as_json else f"{title}\n\n{moved.table()}")
    if output is not None and figure is not None:
        save_figure(figure, output)
    if not moved.completed:
        raise SystemExit(1)


def _drawing(moved: Moved | Examined, name_or_file: str) -> Callable[[], Figure]:
    from varcalc.mechanics import Moved

    if not isinstance(moved, Moved):
        raise click.UsageError(f"{name_or_file} is no motion, so there is no picture of it; leave -o out")
    from varcalc.charts import motion_picture

    return partial(motion_picture, moved)


def _carried_out(name_or_file: str) -> Moved | Examined:
    from varcalc.study.experiments import load_experiment
    from varcalc.study.user_file import said_with_its_line

    try:
        with said_with_its_line(name_or_file):
            return load_experiment(name_or_file).run()
    except (TypeError, ValueError) as error:
        raise click.UsageError(str(error)) from error
