"""``varcalc figure``: a figure of the literature, drawn anew."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import click

from varcalc.cli.options import PICTURES, picture_option, save_figure
from varcalc.study.user_file import SUFFIX


@click.command()
@click.argument("number_or_file")
@picture_option("-o", "--output", text="Write the picture here (.png, .pdf or .svg).  [default: figure_NUMBER.png]")
def figure(number_or_file: str, output: Path | None) -> None:
    """Draw a figure of the literature anew from what the library computes.

    NUMBER_OR_FILE is a number such as 7.10 (see `varcalc list --figures`), or a Python file of your own that defines
    `figure`, a varcalc.study.drawing.Drawing.

    The exit status is 0 when the picture was written, 1 when it could not be, 2 when there is no such figure.
    """
    from varcalc.charts import drawing_picture
    from varcalc.study.figures import load_figure

    try:
        drawing = load_figure(number_or_file)
    except ValueError as error:
        raise click.UsageError(str(error)) from error
    try:
        _ = drawing.rows
    except ValueError as error:
        raise click.ClickException(f"the figure cannot be computed: {error}") from error
    stem = Path(number_or_file).stem if number_or_file.endswith(SUFFIX) else f"figure_{number_or_file}"
    path = Path(stem.replace(".", "_") + PICTURES[0]) if output is None else output
    save_figure(partial(drawing_picture, drawing), path)
    click.echo(f"{drawing.title}: {path}")
