"""``varcalc trace``: the rays of a scene."""

from __future__ import annotations

import json
import sys
from contextlib import nullcontext, redirect_stdout
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from varcalc.cli.groups import end, kept
from varcalc.cli.options import PICTURE_TEXT, JsonCommand, picture_option, save_figure

if TYPE_CHECKING:
    from varcalc.optics import RangeChart, Seen, Study


@click.command(cls=JsonCommand)
@click.argument("name_or_file")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON document and nothing else.")
@picture_option("-o", "--output", text=PICTURE_TEXT)
@picture_option("--range", "reach", text="Write the range chart of source and receiver here.")
def trace(name_or_file: str, as_json: bool, output: Path | None, reach: Path | None) -> None:
    """Trace the rays of a scene, and find every ray to its receiver.

    NAME_OR_FILE is a scene (see `varcalc list --scenes`), or a Python file of your own that defines `study`, a
    varcalc.optics.Study.

    The exit status is 0, or 2 when there was nothing to trace: a wrong option, or a file that does not work.
    """
    with redirect_stdout(sys.stderr) if as_json else nullcontext():
        (seen, chart), stopped = _carried_out(name_or_file, reach is not None)
    title = seen.study.title or name_or_file
    click.echo(json.dumps(seen.document(), indent=2) if as_json else f"{title}\n\n{seen.table()}")
    if output is not None:
        from varcalc.charts import rays_picture

        save_figure(partial(rays_picture, seen), output)
    if reach is not None and chart is not None:
        from varcalc.charts import range_picture

        save_figure(partial(range_picture, chart, title=title), reach)
    end(stopped=stopped, failed=False)


def _carried_out(name_or_file: str, with_range: bool) -> tuple[tuple[Seen, RangeChart | None], bool]:
    from varcalc.study.scenes import load_study
    from varcalc.study.user_file import said_with_its_line

    try:
        with said_with_its_line(name_or_file):
            study = load_study(name_or_file)
            chart = _range_chart(study) if with_range else None  # the quicker to be refused
            seen, stopped = kept(study.run)
            seen.errors  # noqa: B018  what is known is held against the rays by functions of the file
    except (TypeError, ValueError) as error:
        raise click.UsageError(str(error)) from error
    return (seen, chart), stopped


def _range_chart(study: Study) -> RangeChart:
    from varcalc.optics import PointSource, range_chart

    if study.receiver is None or not isinstance(study.source, PointSource):
        raise click.UsageError("a range chart needs a point source and a receiver; give the study both")
    return range_chart(study.scene, study.source.point, study.receiver, within=study.within)
